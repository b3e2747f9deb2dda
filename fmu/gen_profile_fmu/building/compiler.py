"""The C compiler that makes an FMU's binary: Zig's from PyPI, or the one that the environment names."""

import importlib.util
import os
import shlex
import subprocess
import sys
import tarfile
from functools import cache
from importlib.metadata import version
from lzma import LZMAError
from pathlib import Path
from platform import machine
from tempfile import TemporaryDirectory

import attrs

from gen_profile.support.errors import CosimulationError
from gen_profile.support.private_folder import temporary_folder
from gen_profile_fmu.building.platforms import PLATFORMS, host_platform

ENVIRONMENT_VARIABLE = "GEN_PROFILE_CC"
PACKED = "zig.tar.xz"  # what a standalone folder has in Zig's place
FLAGS = (
    "-std=c99",
    "-O2",
    "-ffp-contract=off",  # fused multiply-add would make results depend on the processor
    "-fno-math-errno",  # sine and cosine of an angle in one call, with the same bits: a third of the time
    *("-fPIC", "-fvisibility=hidden"),
)
# else Zig first builds MinGW's runtime, for a minute or two; all we need of it is in the system's library
WINDOWS_FLAGS = ("-fmath-errno", "-U__CRT__NO_INLINE")  # no sincos; isnan and the like in the header
WINDOWS_LIBRARIES = ("-nostdlib", "-e", "begin", "-lucrtbase")
WINDOWS_ENTRY = """\
int __stdcall begin(void *library, unsigned long reason, void *reserved) {
    (void)library, (void)reason, (void)reserved;
    return 1; /* nothing to begin: no constructors, no storage of threads */
}
"""
# names as they are in a shared library; a library of several FMUs linked statically has prefixed ones
DEFINITIONS = ("-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX")


@attrs.frozen(kw_only=True)
class Compiler:
    """A C compiler and all of its options.

    Attributes
    ----------
    command : tuple of str
        Program and options, without files.
    libraries : tuple of str
        What is linked.
    own_entry : bool
        Whether a library has `WINDOWS_ENTRY` in the place of a runtime.
    identity : str
        Names version and options: the same sources and identity give the same binary.
    """

    command: tuple[str, ...]
    libraries: tuple[str, ...]
    own_entry: bool = False
    identity: str


def find_compiler(platform: str | None = None) -> Compiler:
    """Choose the compiler: Zig's or, for this computer, `GEN_PROFILE_CC` where that is set.

    Parameters
    ----------
    platform : str, optional
        One of `PLATFORMS`; this computer's if not given.

    Raises
    ------
    CosimulationError
        When there is none, or the one named does not run.
    """
    named = os.environ.get(ENVIRONMENT_VARIABLE, "").strip()
    if named and platform is None:
        return _named_compiler(named)
    return _zig_compiler(PLATFORMS[platform or host_platform()].target)


def _named_compiler(text: str) -> Compiler:
    program, *options = shlex.split(text)
    reported = _run((program, "--version"), folder=None, environment=None)
    return Compiler(
        command=(program, *FLAGS, *DEFINITIONS, *options),  # the last one of two that contradict counts
        libraries=("-lm",),
        identity="\n".join((text, *FLAGS, sys.platform, machine(), reported)),
    )


@cache
def _zig_compiler(target: str) -> Compiler:
    spec = importlib.util.find_spec("ziglang")
    if spec is None or not spec.submodule_search_locations:
        raise CosimulationError(
            "There is no compiler for the plant's FMU. Install the package ziglang, "
            f"or name a C compiler in the environment variable {ENVIRONMENT_VARIABLE}."
        )
    program = Path(spec.submodule_search_locations[0], "zig.exe" if sys.platform == "win32" else "zig")
    windows = "windows" in target
    libraries = WINDOWS_LIBRARIES if windows else ("-lm",)
    options = ("-target", target, *FLAGS, *(WINDOWS_FLAGS if windows else ()), *DEFINITIONS, "-s")
    return Compiler(
        command=(str(program), "cc", *options),
        libraries=libraries,
        own_entry=windows,
        identity="\n".join(("ziglang", version("ziglang"), *options, *libraries)),
    )


def compile_library(compiler: Compiler, folder: Path, source: str, output: str, zig_cache: Path) -> None:
    """Compile a C file of a folder to a shared library beside it.

    Parameters
    ----------
    compiler : Compiler
    folder : Path
        Files are named relative to it, so that no path of this computer gets into the library.
    source, output : str
        File names of the C file and the library.
    zig_cache : Path
        Where Zig keeps the parts of a C library that it has built.

    Raises
    ------
    CosimulationError
        With the compiler's words.
    """
    program, *options = compiler.command
    if not Path(program).exists() and (packed := Path(program).with_name(PACKED)).exists():
        program = str(_unpacked(packed, zig_cache.parent) / Path(program).name)
    command = (program, *options)
    # old Zigs at work side by side take each other's object files from a shared local cache
    with TemporaryDirectory(prefix="zig-") as local_cache:
        environment = {
            **os.environ,
            "ZIG_GLOBAL_CACHE_DIR": str(zig_cache),
            "ZIG_LOCAL_CACHE_DIR": local_cache,
        }
        sources = [source]
        if compiler.own_entry:
            # first, for without its runtime Zig takes away the headers, too
            _run((*command, "-I.", "-c", "-o", "library.obj", source), folder, environment)
            (folder / "entry.c").write_text(WINDOWS_ENTRY, encoding="ascii")
            sources = ["library.obj", "entry.c"]
        link = (*command, "-I.", "-shared", "-o", output, *sources, *compiler.libraries)
        _run(link, folder, environment)


def _unpacked(packed: Path, cache: Path) -> Path:
    """Unpack Zig once; another process that does so meanwhile unpacks the same."""
    folder = cache / f"ziglang-{version('ziglang')}"
    if not folder.exists():
        with temporary_folder(cache, "unpacked-") as new:
            try:
                with tarfile.open(packed, "r:xz") as archive:
                    archive.extraction_filter = lambda member, _: member  # our own, whatever Python's default
                    archive.extractall(new / "zig")
            except (tarfile.TarError, LZMAError, EOFError) as error:
                raise CosimulationError(f"{packed} is damaged ({error}); unpack gen-profile anew.") from error
            try:
                (new / "zig").rename(folder)
            except OSError:
                if not folder.exists():
                    raise
    return folder


def _run(command: tuple[str, ...], folder: Path | None, environment: dict[str, str] | None) -> str:
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, check=False
        )
    except OSError as error:
        raise CosimulationError(
            f"The C compiler {command[0]} does not run: {error.strerror}. "
            f"Reinstall ziglang, or name another in the environment variable {ENVIRONMENT_VARIABLE}."
        ) from error
    words = (done.stdout + done.stderr).decode("utf-8", errors="replace").strip()
    if done.returncode != 0:
        raise CosimulationError(
            f"The C compiler {command[0]} could not build the plant's FMU (exit code {done.returncode}). "
            f"It says:\n{words[-2000:]}"
        )
    return words
