"""A plant's FMU: built once per content, then taken from the cache."""

from __future__ import annotations

import hashlib
import io
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import attrs
import fmpy

from gen_profile.errors import CosimulationError
from gen_profile.plants.plant import Plant
from gen_profile.problem.dynamics import dynamics
from gen_profile_fmu.c_sources import c_sources, identity_header
from gen_profile_fmu.cache import ENVIRONMENT_VARIABLE, cache_folders, is_intact, write_entry
from gen_profile_fmu.compiler import Compiler, compile_library, find_compiler
from gen_profile_fmu.model_description import model_description, model_identifier
from gen_profile_fmu.variables import VariableTable, plant_variables

_FMI_HEADERS = ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")


@attrs.frozen(kw_only=True)
class PlantFmu:
    """An FMU on disk, as an archive and unpacked.

    Attributes
    ----------
    archive : Path
        The ``.fmu`` file.
    folder : Path
        The same, unpacked.
    guid, model_identifier : str
        As in its model description.
    variables : VariableTable
    """

    archive: Path
    folder: Path
    guid: str
    model_identifier: str
    variables: VariableTable


@attrs.frozen(kw_only=True)
class _Sources:
    """All that goes into an FMU, as text."""

    guid: str
    model_identifier: str
    description: bytes
    code: Mapping[str, str]
    variables: VariableTable


def plant_fmu(plant: Plant, on_build: Callable[[], None] | None = None) -> PlantFmu:
    """Build the FMI 2.0 co-simulation FMU of a plant, or find it in the cache.

    Parameters
    ----------
    plant : Plant
    on_build : callable, optional
        Called before a compilation, which takes seconds.

    Raises
    ------
    CosimulationError
        When there is no compiler, it fails, or no cache folder can be written.
    """
    sources = _sources(plant)
    compiler = find_compiler()
    name = f"{sources.model_identifier}-{_key(sources, compiler)[:32]}"
    refusals = []
    for cache in cache_folders():
        try:
            if not is_intact(cache / name):
                write_entry(cache / name, _build(sources, compiler, cache, on_build))
        except OSError as error:
            refusals.append(f"{cache}: {error.strerror or error}")
        else:
            return _plant_fmu(sources, cache / name)
    raise CosimulationError(
        f"There is no folder to keep the plant's FMU in ({'; '.join(refusals)}). "
        f"Name one that can be written in the environment variable {ENVIRONMENT_VARIABLE}."
    )


def _sources(plant: Plant) -> _Sources:
    table = plant_variables(plant)
    equations = dynamics(plant)
    code = {**c_sources(plant, equations, table), **_fmi_headers()}
    anonymous = model_description(plant, equations, table, guid="")
    guid = _digest(anonymous, *_flat(code))[:32]
    return _Sources(
        guid=guid,
        model_identifier=model_identifier(plant),
        description=model_description(plant, equations, table, guid=guid),
        code={**code, "identity.h": identity_header(guid)},
        variables=table,
    )


def _fmi_headers() -> dict[str, str]:
    """Read FMI's own headers, which FMPy brings along."""
    folder = Path(fmpy.__file__).parent / "c-code"
    return {name: (folder / name).read_text(encoding="utf-8") for name in _FMI_HEADERS}


def _build(
    sources: _Sources, compiler: Compiler, cache: Path, on_build: Callable[[], None] | None
) -> dict[str, bytes]:
    """Compile and pack, in a folder that is gone afterwards."""
    cache.mkdir(parents=True, exist_ok=True, mode=0o700)
    library = Path("binaries", fmpy.platform, sources.model_identifier + fmpy.sharedLibraryExtension)
    with tempfile.TemporaryDirectory(dir=cache, prefix="build-") as folder:
        if on_build is not None:
            on_build()
        for name, text in sources.code.items():
            Path(folder, name).write_text(text, encoding="utf-8", newline="\n")
        compile_library(compiler, Path(folder), library.name, zig_cache=cache / "zig")
        files = {
            "modelDescription.xml": sources.description,
            library.as_posix(): Path(folder, library.name).read_bytes(),
        }
    return {**files, f"{sources.model_identifier}.fmu": _archive(files)}


def _archive(files: Mapping[str, bytes]) -> bytes:
    """Zip files so that the same content gives the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.create_system = 3  # Unix, wherever it is written
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content, compress_type=zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _plant_fmu(sources: _Sources, entry: Path) -> PlantFmu:
    return PlantFmu(
        archive=entry / f"{sources.model_identifier}.fmu",
        folder=entry,
        guid=sources.guid,
        model_identifier=sources.model_identifier,
        variables=sources.variables,
    )


def _key(sources: _Sources, compiler: Compiler) -> str:
    return _digest(compiler.identity.encode("utf-8"), sources.description, *_flat(sources.code))


def _flat(texts: Mapping[str, str]) -> list[bytes]:
    return [part.encode("utf-8") for name, text in sorted(texts.items()) for part in (name, text)]


def _digest(*parts: bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.hexdigest()
