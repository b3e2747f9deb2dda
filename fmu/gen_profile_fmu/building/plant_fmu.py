"""A plant's FMU for the check: built once per content, then taken from the cache."""

from functools import cache, partial
from pathlib import Path

import attrs
import fmpy

from gen_profile.plants.plant import Plant
from gen_profile.support.progress import Progress, no_progress
from gen_profile_fmu.building.build import compile_texts, sources_key
from gen_profile_fmu.building.cache import cached
from gen_profile_fmu.building.compiler import Compiler, find_compiler
from gen_profile_fmu.description.fmu_files import SOURCE_FILE, Sources, Version, archive, fmu_files, sources
from gen_profile_fmu.model.contents import Model, plant_model
from gen_profile_fmu.model.plant_variables import InputKind, PlantInstance
from gen_profile_fmu.model.variables import VariableTable


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


def plant_fmu(plant: Plant, progress: Progress = no_progress) -> PlantFmu:
    """Build the FMI 2.0 FMU of a plant that follows setpoints, or find it in the cache.

    Parameters
    ----------
    plant : Plant
    progress : callable
        Told of a compilation, which takes seconds.

    Raises
    ------
    CosimulationError
        When there is no compiler, it fails, or no cache folder can be written.
    """
    return cached_fmu(_followed(plant), Version.FMI2, progress)


@cache
def _followed(plant: Plant) -> Model:
    return plant_model(PlantInstance(plant=plant, parameters=plant.nominal()), InputKind.SETPOINT)


def cached_fmu(model: Model, version: Version, progress: Progress = no_progress) -> PlantFmu:
    """Build a model's FMU for this computer, without documentation, or find it in the cache.

    Raises as `plant_fmu` does.
    """
    compiler = find_compiler()
    made, key = _keyed(model, version, compiler)
    library = model.identifier + fmpy.sharedLibraryExtension
    platform = fmpy.platform if version is Version.FMI2 else fmpy.platform_tuple

    tell = partial(progress, "compiling the plant's FMU, once")

    def make(cache: Path) -> dict[str, bytes]:
        binary = compile_texts(made.compiled, SOURCE_FILE, compiler, library, cache, tell=tell)
        laid = fmu_files(made, {f"binaries/{platform}/{library}": binary}, with_extras=False)
        return {**laid, f"{model.identifier}.fmu": archive(laid)}

    entry = cached(f"{model.identifier}-{key}", make)
    return PlantFmu(
        archive=entry / f"{model.identifier}.fmu",
        folder=entry,
        guid=made.identity,
        model_identifier=model.identifier,
        variables=model.variables,
    )


@cache
def _keyed(model: Model, version: Version, compiler: Compiler) -> tuple[Sources, str]:
    """Write the texts of an FMU, and name its binary."""
    made = sources(model, version)
    return made, sources_key(made, compiler)
