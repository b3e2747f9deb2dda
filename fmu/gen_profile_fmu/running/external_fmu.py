"""An external FMU, co-simulated in a child process: whatever its native code does, it does it there."""

import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.support.errors import CosimulationError


@attrs.frozen(kw_only=True, eq=False)
class ForeignRun:
    """Co-simulations of one FMU, one per machine.

    Attributes
    ----------
    archive : Path
    times : (samples,) array
        Communication points in s.
    inputs : (samples - 1, inputs) array
        Held from each point to the next.
    input_names, output_names : sequence of str
        Variables of the FMU.
    machines : sequence of mapping of str to float
        Start values of the FMU's parameters, for each run.
    si_units : mapping of str to str
        What each of these variables is meant in; the FMU's own units are converted.
    stated_units : mapping of str to float
        By variable, how many SI units one of the FMU's makes, in place of what the FMU declares.
    parameters : mapping of str to tuple of float, str, str or None
        Value, SI unit and the FMU's variable, if one is named, of each parameter of the spec, which the FMU's
        start values are compared with.
    time_limit : float
        For all runs together, in s.
    step : float or None
        Of all communication steps in s, where the FMU takes no other.
    """

    archive: Path
    times: Array
    inputs: Array
    input_names: Sequence[str]
    output_names: Sequence[str]
    machines: Sequence[Mapping[str, float]]
    si_units: Mapping[str, str]
    stated_units: Mapping[str, float]
    parameters: Mapping[str, tuple[float, str, str | None]]
    time_limit: float
    step: float | None = None


@attrs.frozen(kw_only=True, eq=False)
class ForeignResult:
    """What an FMU gave.

    Attributes
    ----------
    outputs : (machines, samples, outputs) array
        In SI units.
    remarks : tuple of str
        What is to be known of its units and start values, a sentence each.
    """

    outputs: Array
    remarks: tuple[str, ...]


def run_foreign(run: ForeignRun) -> ForeignResult:
    """Co-simulate.

    Raises
    ------
    CosimulationError
        The FMU is damaged, lacks a variable or measures it in a unit of something else, refuses a step,
        crashes, hangs, or ends its process.
    """
    with tempfile.TemporaryDirectory(prefix="gen-profile-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        write_job(run, folder)
        _run_child(run, folder)
        return _result(run, folder)


def write_job(run: ForeignRun, folder: Path) -> None:
    """Tell the child what to do."""
    names = {"input_names": list(run.input_names), "output_names": list(run.output_names)}
    kept = ("si_units", "stated_units", "parameters")
    mappings = {name: dict(getattr(run, name)) for name in kept}
    machines = [dict(machine) for machine in run.machines]
    job = {
        "archive": str(run.archive.absolute()),
        "machines": machines,
        "step": run.step,
        **names,
        **mappings,
    }
    (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
    np.savez(folder / "motion.npz", times=run.times, inputs=run.inputs)


def _run_child(run: ForeignRun, folder: Path) -> None:
    command = [sys.executable, "-m", "gen_profile_fmu.running.external_child", str(folder)]
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        code = subprocess.run(command, timeout=run.time_limit, check=False, **quiet).returncode  # type: ignore[call-overload]
    except subprocess.TimeoutExpired as error:
        raise CosimulationError(
            f"{run.archive.name}: the FMU was not done after {run.time_limit:g} s; "
            "if it only needs longer, raise check.time_limit."
        ) from error
    if code < 0:
        raise CosimulationError(
            f"{run.archive.name}: the FMU crashed ({signal.Signals(-code).name}). Its maker must correct it."
        )


def _result(run: ForeignRun, folder: Path) -> ForeignResult:
    refusal, result = folder / "refusal.txt", folder / "result.npy"
    if refusal.exists():
        raise CosimulationError(refusal.read_text(encoding="utf-8"))
    if not result.exists():
        raise CosimulationError(f"{run.archive.name}: the FMU ended its process before the simulation's end.")
    outputs: Array = np.load(result, allow_pickle=False)
    if not np.isfinite(outputs).all():
        raise CosimulationError(f"{run.archive.name}: the FMU's outputs are not finite numbers.")
    remarks = json.loads((folder / "remarks.json").read_text(encoding="utf-8"))
    return ForeignResult(outputs=outputs, remarks=tuple(remarks))
