"""The child process that runs an external FMU: ``python -m`` this module, then a folder.

Reads job.json and motion.npz from the folder, writes result.npy and remarks.json, or
refusal.txt with a sentence.
"""

import json
import sys
from collections.abc import Mapping, Sequence, Set
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from fmpy import instantiate_fmu, platform, platform_tuple, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2OK

from gen_profile.motion.profile import Array
from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.running.foreign_units import Conversion, ForeignUnits
from gen_profile_fmu.running.safe_archive import unpack

LONGEST_MESSAGE = 300  # characters, of what an external FMU says


def main(folder: Path) -> None:
    """Do the job of a folder."""
    job = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    motion = np.load(folder / "motion.npz", allow_pickle=False)
    try:
        result, remarks = _simulate(job, motion["times"], motion["inputs"], folder / "fmu")
    except CosimulationError as error:
        (folder / "refusal.txt").write_text(str(error), encoding="utf-8")
    else:
        (folder / "remarks.json").write_text(json.dumps(remarks), encoding="utf-8")
        # under another name first: what ends in the middle of writing must not look done
        with (folder / "result.part").open("wb") as file:
            np.save(file, result)
        (folder / "result.part").replace(folder / "result.npy")


def _simulate(job: Mapping[str, Any], times: Array, inputs: Array, unpacked: Path) -> tuple[Array, list[str]]:
    archive = Path(job["archive"])
    unpacked.mkdir()
    unpack(archive, unpacked)
    description = _description(archive.name, unpacked)
    second = description.fmiVersion.startswith("2")
    _require_binary(archive.name, unpacked, platform if second else platform_tuple)
    reals = _reals(archive.name, description, job)
    references = {key: variable.valueReference for key, variable in reals.items()}
    conversions, remarks = _conversions(archive.name, description, job, reals)
    fed = np.column_stack(
        [conversions[name].from_si(column) for name, column in zip(job["input_names"], inputs.T, strict=True)]
    )
    said: list[str] = []

    def follow(machine: Any) -> Array:
        instance = _instance(description, unpacked, said)
        set_to = {name: conversions[name].from_si(value) for name, value in machine.items()}
        return _run(instance, second, references, job, set_to, times, fed)

    try:
        found = np.array([follow(machine) for machine in job["machines"]])
    except FMICallException as error:
        reason = f", saying: {said[-1][:LONGEST_MESSAGE]}" if said else "."
        cure = _step_cure(description, job) if error.function.endswith("DoStep") else ""
        raise CosimulationError(
            f"{archive.name}: the FMU refused {error.function} (status {error.status}){reason}{cure}"
        ) from error
    except Exception as error:  # FMPy raises nothing more special
        raise CosimulationError(f"{archive.name}: the FMU cannot be run: {error}") from error
    for column, name in enumerate(job["output_names"]):
        found[:, :, column] = conversions[name].to_si(found[:, :, column])
    return found, remarks


def _step_cure(description: Any, job: Mapping[str, Any]) -> str:
    """Name the key for an FMU that declares to take steps of one length only."""
    if job["step"] is not None or description.coSimulation.canHandleVariableCommunicationStepSize:
        return ""
    usual = description.defaultExperiment and description.defaultExperiment.stepSize
    return (
        f" It declares to take communication steps of one length only: state it, such as check.step = "
        f"{float(usual or 0.01):g}."
    )


def _description(name: str, unpacked: Path) -> Any:
    try:
        version = ElementTree.parse(unpacked / "modelDescription.xml").getroot().get("fmiVersion", "unknown")
        known = version.startswith(("2", "3"))
        description = read_model_description(str(unpacked), validate=False) if known else None
    except Exception as error:  # neither FMPy nor the parsers promise more
        raise CosimulationError(f"{name}: the model description cannot be read: {error}") from error
    if description is None:
        raise CosimulationError(f"{name}: FMI {version} is not taken; export the FMU for FMI 2 or 3.")
    if description.coSimulation is None:
        raise CosimulationError(f"{name}: the FMU is for model exchange only; export it for co-simulation.")
    return description


def _reals(name: str, description: Any, job: Mapping[str, Any]) -> dict[str, Any]:
    """Find the real scalars of an FMU, among them all variables that a job names."""
    parameters = {parameter for machine in job["machines"] for parameter in machine}
    reals = {
        variable.name: variable
        for variable in description.modelVariables
        if variable.type in {"Real", "Float64"} and not variable.dimensions
    }
    for variable in (*job["input_names"], *job["output_names"], *sorted(parameters)):
        if variable not in reals:
            raise CosimulationError(f"{name}: there is no real scalar variable {variable!r} in the FMU.")
    _require_settable(name, "input", [reals[key] for key in job["input_names"]], {"input"})
    _require_settable(name, "parameter", [reals[key] for key in sorted(parameters)], {"input", "parameter"})
    return reals


def _conversions(
    name: str, description: Any, job: Mapping[str, Any], reals: Mapping[str, Any]
) -> tuple[dict[str, Conversion], list[str]]:
    """Convert between SI and each variable that a job names; what is to be said of units and start values."""
    units = ForeignUnits(name, description, job["stated_units"])
    asked = [(reals[variable], si) for variable, si in job["si_units"].items()]
    conversions = {variable.name: units.conversion(variable, si) for variable, si in asked}
    remarks = [*units.undeclared(asked), *units.differences(list(reals.values()), job["parameters"])]
    return conversions, remarks


def _require_settable(name: str, role: str, variables: Sequence[Any], causalities: Set[str]) -> None:
    for variable in variables:
        if variable.causality not in causalities or variable.variability == "constant":
            raise CosimulationError(
                f"{name}: {variable.name!r} cannot be set as {role}: it is {variable.variability} and of "
                f"causality {variable.causality!r} in the FMU; name another variable in the spec's [check]."
            )


def _require_binary(name: str, unpacked: Path, here: str) -> None:
    if not (unpacked / "binaries" / here).is_dir():
        others = ", ".join(sorted(folder.name for folder in unpacked.glob("binaries/*"))) or "sources only"
        raise CosimulationError(
            f"{name}: the FMU has no binary for this computer, {here} (it has {others}); export one for it."
        )


def _instance(description: Any, unpacked: Path, said: list[str]) -> Any:
    """Load the FMU; what it says of failures goes to `said`."""

    def log(*call: Any) -> None:  # the last three of both versions: status, category, message
        if call[-3] != fmi2OK:  # FMI 3 has the same numbers
            said.append((call[-1] or b"").decode("utf-8", errors="replace"))

    return instantiate_fmu(str(unpacked), description, fmi_type="CoSimulation", logger=log)


def _run(
    fmu: Any,
    second: bool,
    references: Mapping[str, int],
    job: Mapping[str, Any],
    machine: Mapping[str, float],
    *motion: Array,
) -> Array:
    """Simulate one machine under a motion (times, inputs); outputs at all times, shape (samples, outputs)."""
    times, inputs = motion
    write, read = (fmu.setReal, fmu.getReal) if second else (fmu.setFloat64, fmu.getFloat64)
    u = [references[name] for name in job["input_names"]]
    y = [references[name] for name in job["output_names"]]
    start, stop = float(times[0]), float(times[-1])
    if second:
        fmu.setupExperiment(startTime=start, stopTime=stop)
    write([references[name] for name in machine], list(machine.values()))
    fmu.enterInitializationMode(**({} if second else {"startTime": start, "stopTime": stop}))
    fmu.exitInitializationMode()
    rows = [read(y)]
    steps = np.diff(times) if job["step"] is None else np.full(len(inputs), job["step"])
    for time, size, held in zip(times[:-1].tolist(), steps.tolist(), inputs.tolist(), strict=True):
        write(u, held)
        fmu.doStep(currentCommunicationPoint=time, communicationStepSize=size)
        rows.append(read(y))
    fmu.terminate()
    fmu.freeInstance()
    return np.array(rows)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
