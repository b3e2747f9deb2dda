"""From measurements on site to a spec whose machine they determine, and whose uncertainty they state."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import tomli_w

from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec
from gen_profile.studies.identification.estimation import (
    CONFIDENCE,
    INITIAL_RESIDUAL_RATIO,
    Estimate,
    estimate,
)
from gen_profile.studies.identification.log_clock import TIME_UNITS
from gen_profile.studies.identification.log_table import read_text
from gen_profile.studies.identification.measurements import (
    GREATEST,
    SI_UNITS,
    DirectReading,
    Measurement,
    Period,
    SwingLog,
    parse_swing,
    signal_units,
)
from gen_profile.studies.identification.standing import swings_from
from gen_profile.studies.identification.swing_model import SwingingMachine, shortened
from gen_profile.studies.identification.uncertainty import WIDEST
from gen_profile.support.artefacts.writing import deliver_all
from gen_profile.support.errors import InfeasibleProblem, SpecError, rounded_up
from gen_profile.support.one_thread import one_thread
from gen_profile.support.phrase import AND, Phrase, joined
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.suggestion import finite_number, suggestion
from gen_profile.support.summary import Drawable

RELATIVE = 3.0  # of a value: what is known no better is stated in its own unit
MOST_NOISE = 0.2  # of the swing: noise beyond it is none of a sensor


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Identification(Drawable):
    """Outcome of an identification.

    Attributes
    ----------
    given, spec : Spec
        What the search began with, and what it ended in.
    readings : tuple of DirectReading or Period
    logs : tuple of SwingLog
    estimate : Estimate
    q_a : tuple of float
        Where the axes stood, in m or rad.
    """

    given: Spec
    spec: Spec
    readings: tuple[DirectReading | Period, ...]
    logs: tuple[SwingLog, ...]
    estimate: Estimate
    q_a: tuple[float, ...]

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        values = {name: f"{value:.6g}" for name, value in self.estimate.values.items()}
        return {"name": self.spec.name, **values}

    def warnings(self) -> tuple[str, ...]:
        """Say what is wrong with the measurements, though parameters were found; a sentence each."""
        logs = [sentence for row in self.to_dict()["logs"] for sentence in _log_warnings(row)]
        if (factor := self.estimate.contradiction) != 1.0:
            template = "the readings contradict one another; ranges widened {factor:.2g} times"
            logs.append(Phrase(template, factor=factor))
        return tuple(logs)

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        estimated, units = self.estimate, self.spec.machine().units
        return {
            "name": self.spec.name,
            "spec_sha256": self.spec.sha256(),
            "confidence": CONFIDENCE,
            "contradiction": estimated.contradiction,
            "parameters": {
                name: {
                    "unit": units[name],
                    "given": self.given.plant.parameters[name],
                    "value": value,
                    "standard_uncertainty": estimated.standard_uncertainty[name],
                    "half_range": estimated.half_range[name],
                    "stated": self.given.robustness.uncertain.get(name),
                    "uncertain": self.spec.robustness.uncertain.get(name),
                    "rests_on": estimated.rests_on[name],
                }
                for name, value in estimated.values.items()
            },
            "readings": [
                {
                    **attrs.asdict(reading),
                    "model": model,
                    "unit": units[reading.parameter] if isinstance(reading, DirectReading) else "s",
                }
                for reading, model in zip(self.readings, estimated.model, strict=True)
            ],
            "logs": [self._log(index) for index in range(len(self.logs))],
        }

    def _log(self, index: int) -> dict[str, Any]:
        """Nest plain values of one log."""
        log, found = self.logs[index], self.estimate
        misfit = None
        if (left := found.misfits[index]) is not None:
            misfit = {"rms": left.rms, "frequency_rad_per_s": left.frequency, "widened": found.widened[index]}
        return {
            "load": log.load,
            "quantity": log.quantity,
            "samples": log.logged,
            "averages": len(log.times) if len(log.times) < log.logged else None,
            "lasts_s": float(log.times[-1]),
            "read": list(log.notes),
            "unit": log.unit,
            "swing": float(np.ptp(log.values)) / 2.0,
            "noise": found.noise[index],
            "unrest": found.initial_residual_ratio[index],
            "misfit": misfit,
        }


def read_swing(
    path: Path,
    spec: Spec,
    *,
    columns: tuple[str, str] | None = None,
    signal: str = "angle",
    unit: str | None = None,
    time_unit: str | None = None,
    after: float | None = None,
) -> SwingLog:
    """Read a logged swing of a spec's machine; what is not given, the names of the columns say.

    Raises
    ------
    SpecError
        The machine has no such signal, or a choice is wrong.
    OutputError
        The file cannot be read.
    """
    plant = spec.machine()
    loads = plant.loads
    if time_unit is not None and time_unit not in TIME_UNITS:
        raise SpecError(f"time_unit: unknown unit {time_unit!r}{suggestion(time_unit, TIME_UNITS)}")
    quantity, _, named = signal.partition(":")
    load = named or loads[0]
    if quantity not in SI_UNITS:
        raise SpecError(f"signal: unknown signal {quantity!r}{suggestion(quantity, SI_UNITS)}")
    if load not in loads:
        raise SpecError(f"signal: unknown load {load!r}{suggestion(load, loads)}")
    per_unit = None if unit is None else _per_unit(unit, quantity)
    return parse_swing(
        read_text(path, "swing"),
        str(path),
        columns=columns,
        per_second=None if time_unit is None else TIME_UNITS[time_unit],
        per_unit=per_unit,
        after=after,
        quantity=quantity,
        load=load,
        one_direction=plant.directions == 1,
    )


def _per_unit(unit: str, quantity: str) -> float:
    """Say how many of a log's steps make an SI unit."""
    name = unit.lstrip("0123456789. ").rstrip()
    size = unit.rstrip().removesuffix(name).strip()
    fitting = signal_units(quantity)
    if name not in fitting:
        raise SpecError(f"unit: {unit!r} does not measure {quantity}{suggestion(name, fitting)}")
    step = finite_number(size or "1")
    if not step > 0.0:
        raise SpecError(f"unit: {unit!r} shall begin with the size of a count, as in 0.0879 {name}.")
    return fitting[name] / step


def identify(
    spec: Spec,
    measurements: Sequence[Measurement],
    free: Sequence[str] = (),
    q_a: Sequence[float] | None = None,
    progress: Progress = no_progress,
) -> Identification:
    """Identify parameters of a spec's machine, and put them and their ranges into the spec.

    Raises
    ------
    SpecError
        A measurement or parameter does not belong to the machine.
    InfeasibleProblem
        The measurements do not determine the parameters, or not well enough to be of use.
    """
    plant = spec.machine()
    readings = tuple(m for m in measurements if not isinstance(m, SwingLog))
    read = [reading.parameter for reading in readings if isinstance(reading, DirectReading)]
    asked = {*free, *read}
    _require_known(plant, readings, asked)
    stood = tuple(spec.move.target if q_a is None else q_a)
    if len(stood) != len(plant.actuated):
        template = "at: must hold one position per axis ({axes}), found {found}."
        raise SpecError(template, axes=len(plant.actuated), found=len(stood))
    if not all(abs(place) <= GREATEST for place in stood):
        raise SpecError(
            "at: must be places in m or rad, found {places}.", places=", ".join(f"{x:g}" for x in stood)
        )
    machine = SwingingMachine(plant=plant, parameters=spec.plant.parameters, q_a=stood)
    logs = tuple(shortened(log, machine) for log in measurements if isinstance(log, SwingLog))
    with one_thread:
        names = [q.name for q in plant.parameters if q.name in asked]
        try:
            estimated = estimate(machine, names, readings, logs, progress)
            identified = _identified(spec, estimated, logs)
        except InfeasibleProblem as refused:
            for index, log in enumerate(logs):
                later = swings_from(machine, names, readings, log)
                if later is None:
                    continue
                kept = (*logs[:index], later, *logs[index + 1 :])
                try:
                    _identified(spec, estimate(machine, names, readings, kept, progress), kept)
                except InfeasibleProblem:  # no cure
                    continue
                raise _begins_later(later) from refused
            raise
    return Identification(
        given=spec,
        spec=identified,
        readings=readings,
        logs=logs,
        estimate=estimated,
        q_a=stood,
    )


def _begins_later(log: SwingLog) -> InfeasibleProblem:
    """Name the cure of a refused log that begins while the axes still move."""
    template = (
        "The log of {log.load} is no free swing of this machine at first, but is one from {start:.9g} s on: "
        "leave out what was logged before the axes stood still (after {start:.9g})."
    )
    return InfeasibleProblem(template, log=log, start=log.start_time)


def write_spec(spec: Spec, path: Path, text: str | None = None) -> None:
    """Write a spec as TOML, and the machine's file beside it where the user wrote one.

    Parameters
    ----------
    spec : Spec
    path : Path
    text : str, optional
        That states it; by default it is written out in full.

    Raises
    ------
    OutputError
    """
    machine = {} if spec.plant.file is None else {spec.plant.file.name: spec.plant.file.content}
    written = (text or tomli_w.dumps(spec.to_dict())).encode("utf-8")
    deliver_all(path.parent, {**machine, path.name: written})


def _log_warnings(row: Mapping[str, Any]) -> Iterator[str]:
    """Say what is wrong with a logged swing."""
    name, unit = Phrase("the log of {load}", load=row["load"]), row["unit"]
    if row["unrest"] > INITIAL_RESIDUAL_RATIO:
        template = (
            "{name} is {row[unrest]:.2g} times farther off the model at first; leave out what was logged "
            "before the axes stood still"
        )
        yield Phrase(template, name=name, row=row)
    if (left := row["misfit"]) is not None:
        template = (
            "a swing of {left[rms]:.2g} {unit} RMS at {left[frequency_rad_per_s]:.3g} rad/s is left of "
            "{name}, which no parameter of this machine explains; ranges that follow from it are "
            "{left[widened]:.2g} times wider"
        )
        yield Phrase(template, left=left, unit=unit, name=name)
    if row["noise"] > MOST_NOISE * row["swing"]:
        fraction = row["noise"] / row["swing"]
        template = "the noise in {name} is {share:.0%} of the swing; are unit and signal right?"
        yield Phrase(template, name=name, share=fraction)


def _require_known(plant: Plant, readings: Sequence[DirectReading | Period], asked: set[str]) -> None:
    known = {q.name: q for q in plant.parameters}
    direct = [one for one in readings if isinstance(one, DirectReading)]
    read = {one.parameter for one in direct}
    faults = [
        f"{'measured' if name in read else 'free'} {name}: unknown parameter{suggestion(name, known)}"
        for name in sorted(asked - known.keys())
    ]
    for reading in direct:
        q = known.get(reading.parameter)
        if q and not q.lower <= reading.value <= q.upper:
            bounds = f"{q.lower:g} to {q.upper:g} {q.unit}"
            faults.append(f"measured {q.name}: must be from {bounds}, found {reading.value:g}.")
    modes = len(plant.unactuated)
    beyond = [one.mode for one in readings if isinstance(one, Period) and one.mode > modes]
    faults += [f"period: the machine has {modes} modes, found mode {mode}." for mode in beyond]
    if not asked:
        what = f"parameters to free ({', '.join(known)}), or a direct reading, NAME=VALUE±UNCERTAINTY"
        faults.append(f"Name what to identify: {what}.")
    if faults:
        raise SpecError(*faults)


def _identified(spec: Spec, estimated: Estimate, logs: Sequence[SwingLog]) -> Spec:
    """Put the parameters and their ranges into a spec."""
    known = {name: abs(value) for name, value in estimated.values.items() if value != 0.0}
    shares = {name: estimated.half_range[name] / size for name, size in known.items()}
    wide = {name: fraction for name, fraction in shares.items() if fraction > WIDEST}
    if wide:
        words = joined(AND, [_how_well(spec, estimated, name) for name in wide])
        rows = zip(logs, estimated.misfits, strict=True)
        if foreign := [(log, left) for log, left in rows if left is not None]:
            log, left = max(foreign, key=lambda one: one[1].rms / one[1].noise)
            template = (
                "The log of {log.load} is not of this machine: a swing of {left.rms:.2g} {log.unit} RMS at "
                "{left.frequency:.3g} rad/s, {ratio:.2g} times the noise, is left of it, which no parameter "
                "explains; look at which machine was logged, and at the log's columns, unit and signal."
            )
            raise InfeasibleProblem(template, log=log, left=left, ratio=left.rms / left.noise)
        if estimated.contradiction > 1.0:
            template = (
                "The measurements contradict one another by {contradiction:.2g} times their "
                "uncertainties, so they determine {words}; look for the wrong one."
            )
            raise InfeasibleProblem(template, contradiction=estimated.contradiction, words=words)
        raise InfeasibleProblem(
            "The measurements determine {words}; measure better, or take it as known.", words=words
        )
    sigma = estimated.standard_uncertainty
    values = {name: _rounded(value, sigma[name]) for name, value in estimated.values.items()}
    robustness = spec.robustness
    robust = robustness.method if robustness.uncertain else "sensitivity"
    stated = robustness.uncertain  # what a rope does in service: that it was measured once narrows nothing
    widened = {
        name: max(rounded_up(share, digits=2), stated.get(name, 0.0)) for name, share in shares.items()
    }
    uncertain = {**stated, **widened}
    order = [name for name in spec.plant.parameters if name in uncertain]
    return spec.changed(
        {
            "plant.parameters": {**spec.plant.parameters, **values},
            "plant.defaults": tuple(name for name in spec.plant.defaults if name not in estimated.values),
            "robustness.method": robust,
            "robustness.uncertain": {name: uncertain[name] for name in order},
        }
    )


def _how_well(spec: Spec, estimated: Estimate, name: str) -> str:
    """Say how well a parameter is known that is not known well; one that may be nothing in its own unit."""
    half, value = estimated.half_range[name], abs(estimated.values[name])
    if half <= RELATIVE * value:
        return Phrase("{name} to ±{percent:.0f} % only", name=name, percent=100.0 * half / value)
    if not half < math.inf:
        return Phrase("{name} not at all", name=name)
    template = "{name} to ±{half:.2g} {unit} only, which may be nothing"
    return Phrase(template, name=name, half=half, unit=spec.machine().units[name])


def _rounded(value: float, uncertainty: float) -> float:
    """Leave out the digits that are worth less than a hundredth of the uncertainty."""
    return round(value, 2 - math.floor(math.log10(uncertainty)))
