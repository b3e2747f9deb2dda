"""A plant's FMU for the check: built once per content, then taken from the cache."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import attrs
import fmpy

from gen_profile.errors import CosimulationError
from gen_profile.plants.plant import Plant
from gen_profile_fmu.cache import ENVIRONMENT_VARIABLE, cache_folders, is_intact, write_entry
from gen_profile_fmu.compiler import Compiler, compile_library, find_compiler
from gen_profile_fmu.fmu_files import SOURCE_FILE, Sources, Version, archive, digest, flat, fmu_files, sources
from gen_profile_fmu.model import Model, plant_model
from gen_profile_fmu.plant_variables import InputKind, Machine
from gen_profile_fmu.variables import VariableTable


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


def plant_fmu(plant: Plant, on_build: Callable[[], None] | None = None) -> PlantFmu:
    """Build the FMI 2.0 FMU of a plant that follows setpoints, or find it in the cache.

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
    machine = Machine(plant=plant, parameters=plant.nominal())
    return cached_fmu(plant_model(machine, InputKind.SETPOINT), Version.FMI2, on_build)


def cached_fmu(model: Model, version: Version, on_build: Callable[[], None] | None = None) -> PlantFmu:
    """Build a model's FMU for this computer, without documentation, or find it in the cache.

    Raises as `plant_fmu` does.
    """
    made, compiler = sources(model, version), find_compiler()
    key = digest(compiler.identity.encode("utf-8"), made.description, *flat(made.code))
    name = f"{model.identifier}-{key[:32]}"
    refusals = []
    for cache in cache_folders():
        try:
            if not is_intact(cache / name):
                write_entry(cache / name, _build(made, compiler, cache, on_build))
        except OSError as error:
            refusals.append(f"{cache}: {error.strerror or error}")
        else:
            return PlantFmu(
                archive=cache / name / f"{model.identifier}.fmu",
                folder=cache / name,
                guid=made.identity,
                model_identifier=model.identifier,
                variables=model.variables,
            )
    raise CosimulationError(
        f"There is no folder to keep the plant's FMU in ({'; '.join(refusals)}). "
        f"Name one that can be written in the environment variable {ENVIRONMENT_VARIABLE}."
    )


def _build(
    made: Sources, compiler: Compiler, cache: Path, on_build: Callable[[], None] | None
) -> dict[str, bytes]:
    name = made.model.identifier + fmpy.sharedLibraryExtension
    platform = fmpy.platform if made.version is Version.FMI2 else fmpy.platform_tuple
    library = compile_sources(made, compiler, name, cache, on_build)
    laid = fmu_files(made, {f"binaries/{platform}/{name}": library}, with_extras=False)
    return {**laid, f"{made.model.identifier}.fmu": archive(laid)}


def compile_sources(
    made: Sources,
    compiler: Compiler,
    name: str,
    cache: Path,
    on_build: Callable[[], None] | None = None,
) -> bytes:
    """Compile a library of this name in a folder that is gone afterwards; its bytes."""
    cache.mkdir(parents=True, exist_ok=True, mode=0o700)
    with tempfile.TemporaryDirectory(dir=cache, prefix="build-") as folder:
        if on_build is not None:
            on_build()
        for file, text in made.code.items():
            Path(folder, file).write_text(text, encoding="utf-8", newline="\n")
        compile_library(compiler, Path(folder), SOURCE_FILE, name, zig_cache=cache / "zig")
        return Path(folder, name).read_bytes()
