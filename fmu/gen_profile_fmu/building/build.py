"""Compiled binaries out of the cache, and whole FMUs made of them."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

from gen_profile.support.private_folder import own_folder, temporary_folder
from gen_profile_fmu.building.cache import cached
from gen_profile_fmu.building.compiler import Compiler, compile_library, find_compiler
from gen_profile_fmu.building.platforms import PLATFORMS, host_platform
from gen_profile_fmu.building.universal_binary import universal_binary
from gen_profile_fmu.description.fmu_files import (
    SOURCE_FILE,
    Sources,
    Version,
    archive,
    digest,
    flat,
    fmu_files,
    sources,
)
from gen_profile_fmu.model.contents import Model

Progress = Callable[[str], None]


def build_fmu(
    model: Model, version: Version, platforms: Iterable[str], progress: Progress = lambda _: None
) -> bytes:
    """Build an FMU with sources, documentation, icon and licences.

    Parameters
    ----------
    model : Model
    version : Version
    platforms : iterable of str
        Names of `PLATFORMS` to build binaries for; none for sources only.
    progress : callable
        Told what is being compiled.

    Returns
    -------
    bytes
        The archive: the same for the same model and compiler.

    Raises
    ------
    CosimulationError
        When there is no compiler, it fails, or no cache folder can be written.
    """
    made = sources(model, version)
    binaries: dict[str, list[bytes]] = {}
    for name in platforms:
        platform = PLATFORMS[name]
        compiler = find_compiler(None if name == host_platform() else name)
        tell = partial(progress, f"compiling for {name}")
        library = _cached_library(made, compiler, model.identifier + platform.extension, tell)
        binaries.setdefault(platform.library(version, model.identifier), []).append(library)
    joined: Mapping[str, bytes] = {
        path: libraries[0] if len(libraries) == 1 else universal_binary(libraries)
        for path, libraries in binaries.items()
    }
    return archive(fmu_files(made, joined))


def _cached_library(made: Sources, compiler: Compiler, name: str, tell: Callable[[], None]) -> bytes:
    def make(cache: Path) -> dict[str, bytes]:
        return {name: compile_texts(made.compiled, SOURCE_FILE, compiler, name, cache, tell=tell)}

    return (cached(f"library-{sources_key(made, compiler)}", make) / name).read_bytes()


def sources_key(made: Sources, compiler: Compiler) -> str:
    """Name a binary by all that it is made of."""
    return digest(compiler.identity.encode("utf-8"), made.description, *flat(made.compiled))[:32]


def compile_texts(
    texts: Mapping[str, str],
    source: str,
    compiler: Compiler,
    name: str,
    cache: Path,
    *,
    tell: Callable[[], None] = lambda: None,
) -> bytes:
    """Compile a library in a folder that is gone afterwards; its bytes.

    Parameters
    ----------
    texts : mapping of str to str
        C files by name.
    source : str
        Which of them is compiled; it includes the others.
    compiler : Compiler
    name : str
        Of the library.
    cache : Path
        Folder in which it is done, and in which Zig keeps what it needs again.
    tell : callable
        Called before it begins.

    Raises
    ------
    CosimulationError
        With the compiler's words.
    """
    zig_cache = own_folder(cache / "zig", within=cache)
    with temporary_folder(cache, "build-") as folder:
        tell()
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        compile_library(compiler, folder, source, name, zig_cache=zig_cache)
        return (folder / name).read_bytes()
