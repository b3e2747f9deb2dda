"""What a run tells of a machine: ranges of parameters, less what cannot have shown it (set membership).

A run narrows ranges and never widens one, whatever was seen: bounds on what is measured exclude machines, and
what no bound excludes stays (F. C. Schweppe, 1968; M. Milanese and A. Vicino, 1991). Of a log, machines are
excluded that are farther off than noise, and what the fit leaves of it, explain with `CONFIDENCE`; of a sway
that was seen at the end, those that leave more or less than its bounds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import attrs
import numpy as np
from scipy.special import ndtri

from gen_profile.dynamics.evaluation.residual_sway import observation_time
from gen_profile.dynamics.evaluation.simulation import driven_swing, motion_of
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.metrics import peak
from gen_profile.motion.profile import Array, SampledProfile
from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec
from gen_profile.studies.identification.driven_model import COARSE, DrivenModel, driven_model, through
from gen_profile.studies.identification.estimation import taken_as_exact
from gen_profile.studies.identification.fit import Fit, fit_of
from gen_profile.studies.identification.measurements import DirectReading, SwingLog
from gen_profile.studies.identification.misfit import GROSS, Explanation, likeliest, misfits, nothing_left
from gen_profile.studies.identification.swing_model import AT_REST, SwingingMachine, shortened
from gen_profile.studies.identification.uncertainty import uncertainty
from gen_profile.support.errors import CosimulationError, InfeasibleProblem, SpecError
from gen_profile.support.one_thread import one_thread
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.suggestion import suggestion

CONFIDENCE = 0.999  # of each log, so that the ranges after ten of them hold with 99 %
DRAWN, BEST = 256, 2  # machines of the ranges that are tried, and of these the ones from which a fit begins
FITTED_SAMPLES = 1500  # of a log that are fitted
LOOSE = 3.0  # half-ranges: the standard deviation of a parameter of which a log tells nothing
IMPOSSIBLE = 25.0  # by which the squares that a log leaves are more by chance once in a million times
SENSOR_GAIN = (0.5, 1.5)  # times a swing that a sensor may show: it may lie askew, by 60° at most
WIDE = np.geomspace(0.25, 4.0, 33)  # times a parameter of the spec, where one is looked for that changed
SLABS, PER_SLAB = 16, 8  # into which a range is cut, and machines that are looked at in each
MOST_RANGES = 2  # ranges for which these multiply: more of them have no more machines
LEAST_HALF_RANGE = 0.005  # relative, left in any case: a machine in service is not known any better

NARROWER = 0.99  # of a range, down to which it stays as it was stated

Ranges = Mapping[str, tuple[float, float]]


@attrs.frozen(kw_only=True, eq=False)
class Machines:
    """All machines that may be: those of a plant, some of whose parameters have ranges."""

    plant: Plant
    parameters: Mapping[str, float]
    ranges: Ranges

    def drawn(self, count: int) -> list[dict[str, float]]:
        """Draw so many evenly, the middle one first (I. M. Sobol, 1967)."""
        ends = np.array(list(self.ranges.values()))
        from scipy.stats import qmc  # noqa: PLC0415  (half of what the command line takes to start)

        shares = qmc.Sobol(len(ends), scramble=False).random(count)
        shares[0] = 0.5
        rows = ends[:, 0] + shares * (ends[:, 1] - ends[:, 0])
        return [{**self.parameters, **dict(zip(self.ranges, row, strict=True))} for row in rows.tolist()]

    def within(self, ranges: Ranges) -> Machines:
        """Exclude those outside of ranges; what these have outside of what may be counts for nothing."""
        kept = {
            name: _rounded((max(low, ranges[name][0]), min(high, ranges[name][1])), (low, high))
            for name, (low, high) in self.ranges.items()
        }
        return attrs.evolve(self, ranges=kept)


Lesson = tuple[Machines, dict[str, Any]]  # what is left after a run, and by what evidence, in plain values


def narrowed_by_log(
    machines: Machines, played: SampledProfile, log: SwingLog, progress: Progress = no_progress
) -> Lesson:
    """Exclude what does not swing as the log of a run shows.

    Parameters
    ----------
    machines : Machines
    played : SampledProfile
        The setpoints that the drives were given.
    log : SwingLog
        Of the whole motion, and of some swings after it.
    progress : callable
        Told what is being done.

    Raises
    ------
    InfeasibleProblem
        No machine of the ranges shows this log; or it is of no run of this motion.
    """
    progress("comparing the run with machines of the ranges")
    drawn, stood = machines.drawn(DRAWN), tuple(map(float, played.position[-1]))
    middle = SwingingMachine(plant=machines.plant, parameters=drawn[0], q_a=stood)
    model = driven_model(middle, played, shortened(log, middle, FITTED_SAMPLES))
    starts, residual = model.guesses(drawn)
    model = attrs.evolve(model, lead=max(float(starts[np.argmin(residual), -3]), 0.0) + model.fastest)
    free = _free_fit(machines, model)
    fit = attrs.evolve(free, bounds=np.array([machines.ranges[name] for name in free.names]).T / free.scale)
    best = np.argsort(residual)[:BEST]
    begun = [np.array([drawn[k][name] for name in fit.names]) / fit.scale for k in best]
    unknowns, noise = _fitted(fit, [np.concatenate(pair) for pair in zip(begun, starts[best], strict=True)])
    progress("looking at what is left of it")
    (lines,), left = misfits(fit, unknowns), float(np.std(fit.left(unknowns)[0]))
    beyond = _fitted_from(free, [unknowns], noise)
    excess = len(model.log.times) * (left**2 / float(np.var(free.left(beyond)[0])) - 1.0)
    if lines is not None or excess > IMPOSSIBLE:
        _require_unchanged(fit, model, unknowns, certain=excess > IMPOSSIBLE)
    begin, gain, _ = unknowns[-3:].tolist()
    if not SENSOR_GAIN[0] < abs(gain) < SENSOR_GAIN[1]:
        _require_swing(model, left)
        raise InfeasibleProblem(
            f"The log of {log.load} shows {float(f'{abs(gain):.2g}'):g} times the {log.quantity} that this "
            "motion leads to: look at its unit, and at what it is of (signal)."
        )
    sigma = noise if lines is None else np.array([lines.widened(float(noise[0]), len(model.log.times))])
    factor = float(ndtri((1.0 + CONFIDENCE ** (1.0 / len(fit.names))) / 2.0))
    half = uncertainty(fit, unknowns, sigma).half_ranges(factor)
    ends = np.stack([unknowns[: len(half)] - half, unknowns[: len(half)] + half], axis=1) * fit.scale[:, None]
    evidence = {
        "load": log.load,
        "quantity": log.quantity,
        "unit": log.unit,
        "begins_s": begin,
        "gain": gain,
        "swing": float(np.std(model.log.values)),
        "left": left,
        "unexplained_rad_per_s": None if lines is None else lines.frequency,
    }
    ranges = dict(zip(fit.names, map(tuple, ends.tolist()), strict=True))
    return machines.within(ranges), evidence


def narrowed_by_sight(
    machines: Machines, played: SampledProfile, seen: DirectReading, watch: float
) -> Lesson:
    """Exclude what does not leave the sway that was seen after a run.

    A slab of a range is excluded where no machine drawn from it leaves as much, nor from the slab beside it.

    Parameters
    ----------
    machines : Machines
    played : SampledProfile
        The setpoints that the drives were given.
    seen : DirectReading
        Greatest sway after the motion in m, of the load that its parameter names; its uncertainty is a bound.
    watch : float
        How long it was looked at, in s.

    Raises
    ------
    InfeasibleProblem
        No machine of the ranges leaves it.
    """
    plant, drawn = machines.plant, machines.drawn(SLABS * PER_SLAB ** min(len(machines.ranges), MOST_RANGES))
    frequencies = linearize(plant, drawn[0], played.position[-1]).frequencies
    apart = 2.0 * np.pi / COARSE / float(frequencies[-1])
    times = np.concatenate([[0.0], played.times[-1] + np.arange(0.0, watch, apart)])
    motion = motion_of(through(played, apart))
    peaks = []
    for part in np.array_split(parameter_rows(plant, drawn), SLABS):
        at_rest = np.zeros((len(part), 2 * len(plant.unactuated)))
        sway, _ = driven_swing(plant, part, motion=motion, starts=at_rest, times=times)
        peaks.append(peak(sway[:, 1:])[:, plant.loads.index(seen.parameter)])
    left = np.concatenate(peaks)
    possible = np.abs(left - seen.value) <= seen.uncertainty
    evidence = {"load": seen.parameter, "seen": seen.value, "bound": seen.uncertainty}
    if not possible.any():
        raise InfeasibleProblem(
            f"No machine of the ranges leaves {seen.value:.3g} ± {seen.uncertainty:.2g} m of sway of "
            f"{seen.parameter} after this motion; they leave {left.min():.2g} to {left.max():.2g} m. The "
            "machine has changed, or the ranges were too narrow: log a run, or state wider ones."
        )
    kept = {}
    for name, (low, high) in machines.ranges.items():
        values = np.array([one[name] for one, can in zip(drawn, possible, strict=True) if can])
        slab = (high - low) / SLABS
        first, last = (np.floor((end - low) / slab) for end in (values.min(), values.max()))
        kept[name] = (float(low + (first - 1.0) * slab), float(low + (last + 2.0) * slab))
    return machines.within(kept), evidence


def _free_fit(machines: Machines, model: DrivenModel) -> Fit:
    """Pose the fit of what has ranges, as far as the plant takes it; what a log does not tell stays near."""
    middle = model.machine.parameters
    known = [
        DirectReading(parameter=name, value=middle[name], uncertainty=LOOSE * (high - low) / 2.0)
        for name, (low, high) in machines.ranges.items()
    ]
    return fit_of(model.machine, list(machines.ranges), known, [model])


def _fitted(fit: Fit, begun: Sequence[Array]) -> tuple[Array, Array]:
    """Find what agrees best with the log, from the best of several places; and the noise."""
    unknowns = _fitted_from(fit, begun, np.array([max(float(np.std(fit.models[0].log.values)), AT_REST)]))
    try:
        return fit.near(unknowns)
    except InfeasibleProblem:  # at a bound that is far off
        return unknowns, np.array([float(np.std(fit.left(unknowns)[0]))])


def _fitted_from(fit: Fit, begun: Sequence[Array], noise: Array) -> Array:
    """Fit from several places, and take what leaves least; a place itself where no fit comes to rest."""
    found = list(begun)
    for place in begun:
        with suppress(InfeasibleProblem, CosimulationError):
            found.append(fit.improved(place, noise))
    return min(found, key=lambda unknowns: float(np.std(fit.left(unknowns)[0])))


def _require_swing(model: DrivenModel, left: float) -> None:
    """Refuse a log of which no machine's swing takes off enough."""
    size = float(np.std(model.log.values))
    if left > GROSS * size:
        raise InfeasibleProblem(
            f"{left / size:.0%} of the log of {model.log.load} is left where the machine that fits best is "
            "taken off: it is of no whole run of this motion from rest, or of another machine, or noise "
            "alone."
        )


def _require_unchanged(fit: Fit, model: DrivenModel, unknowns: Array, *, certain: bool) -> None:
    """Refuse a run that machines outside of the ranges explain, and tell which."""
    parameters = fit.parameters(unknowns)
    explained = likeliest(_explained(fit, model, parameters, ())) or likeliest(
        [one for name in taken_as_exact(fit) for one in _explained(fit, model, parameters, (name,))]
    )
    left, log = float(np.std(fit.left(unknowns)[0])), f"the log of {model.log.load}"
    if not explained:
        _require_swing(model, left)
    if not (explained or certain):
        return
    others = " or with ".join(one.words for one in explained)
    cure = f"nothing but noise is left with {others}: the machine has changed, or the spec was wrong there"
    if not others:
        cure = "nor does any that differs in one more parameter: look at how and of what this was logged"
    raise InfeasibleProblem(
        f"No machine of the ranges swings as this run shows: the nearest leaves {left:.2g} {model.log.unit} "
        f"RMS of {log}; {cure}."
    )


def _explained(
    fit: Fit, model: DrivenModel, parameters: Mapping[str, float], freed: tuple[str, ...]
) -> list[Explanation]:
    """Find the machine that leaves nothing but noise, parameters freed beside those with ranges; or none."""
    begun, bounds = [dict(parameters)], {q.name: (q.lower, q.upper) for q in fit.machine.plant.parameters}
    for name in freed or fit.names:
        values = np.clip(parameters[name] * WIDE, *bounds[name])
        begun += [{**parameters, name: value} for value in values.tolist()]
    _, left = model.guesses(begun)
    if left.min() > GROSS:  # even of the variance; fits from so far off may take minutes, by endless damping
        return []
    found = nothing_left(fit.freed(freed).beginning(begun[int(np.argmin(left))]), freed, small_first=False)
    return [] if found is None else [found]


@attrs.frozen(kw_only=True, eq=False)
class Learning:
    """What runs told of a machine.

    Attributes
    ----------
    spec : Spec
        With the ranges that are left, and their middles as values.
    before : Machines
    runs : tuple of dict
        What each run showed, in plain values.
    """

    spec: Spec
    before: Machines
    runs: tuple[dict[str, Any], ...]

    def warnings(self) -> tuple[str, ...]:
        """Say what no machine of the ranges explains, though it excludes some; a sentence each."""
        return tuple(
            f"a swing at {at:.3g} rad/s in the log of {run['load']} is none of the machine's, "
            "and no other value of one parameter explains it: this run excludes little"
            for run in self.runs
            if (at := run.get("unexplained_rad_per_s")) is not None
        )

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        units, ranges = self.spec.machine().units, self.spec.checked_ranges()
        return {
            "name": self.spec.name,
            "spec_sha256": self.spec.sha256(),
            "confidence": CONFIDENCE,
            "parameters": {
                name: {"unit": units[name], "before": list(ends), "range": list(ranges[name])}
                for name, ends in self.before.ranges.items()
            },
            "runs": list(self.runs),
        }


def learn(
    spec: Spec,
    played: SampledProfile,
    runs: Sequence[SwingLog | DirectReading],
    progress: Progress = no_progress,
) -> Learning:
    """Narrow a spec's ranges by what runs of a motion showed.

    Parameters
    ----------
    spec : Spec
    played : SampledProfile
        The setpoints that the drives were given, as replayed from the artefact.
    runs : sequence of SwingLog or DirectReading
        A log of a whole run, or the greatest sway in m that was seen after one, of the load that the reading
        names, with a bound.
    progress : callable
        Told what is being done.

    Raises
    ------
    SpecError
        Nothing has a range, or there is no such load.
    InfeasibleProblem
        A run is of no machine of the ranges.
    """
    plant = spec.machine()
    ranges = {name: ends for name, ends in spec.checked_ranges().items() if ends[1] > ends[0]}
    if not ranges:
        raise SpecError(
            "robustness.uncertain: no parameter has a range, so there is nothing to learn; state how far "
            "each may be off, as in { L1 = 0.2 }."
        )
    if not runs:
        raise SpecError("Name a log of a run, or what was seen after one, as in payload=0.03±0.01.")
    for seen in (run for run in runs if isinstance(run, DirectReading)):
        if seen.parameter not in plant.loads:
            raise SpecError(f"seen: unknown load {seen.parameter!r}{suggestion(seen.parameter, plant.loads)}")
        if seen.value < 0.0:
            raise SpecError(
                f"seen: the greatest sway of {seen.parameter} is no less than 0 m, found {seen.value:g}."
            )
        if spec.move.initial:
            raise SpecError("seen: tells of machines only where the load hung at rest before; log a run.")
    machines = before = Machines(plant=plant, parameters=spec.plant.parameters, ranges=ranges)
    showed = []
    with one_thread:
        for run in runs:
            if isinstance(run, SwingLog):
                machines, evidence = narrowed_by_log(machines, played, run, progress)
            else:
                machines, evidence = narrowed_by_sight(machines, played, run, observation_time(spec))
            showed.append(evidence)
    return Learning(spec=_learned(spec, machines), before=before, runs=tuple(showed))


def _learned(spec: Spec, machines: Machines) -> Spec:
    """State the ranges that are left in a spec, and their middles as values."""
    given, values, changed = spec.checked_ranges(), dict(spec.plant.parameters), dict[str, Any]()
    for name, ends in machines.ranges.items():
        if ends == given[name]:
            continue
        values[name] = middle = sum(ends) / 2.0
        if name in spec.check.spans:
            changed[f"check.spans.{name}"] = ends
        inside = min(middle - given[name][0], given[name][1] - middle)  # which rounding must not leave
        share = min(float(f"{(ends[1] - middle) / abs(middle):.3g}"), inside / abs(middle))
        for table, shares in {"robustness": spec.robustness.uncertain, "check": spec.check.uncertain}.items():
            if shares and name in shares:
                changed[f"{table}.uncertain.{name}"] = min(share, shares[name])
    defaults = tuple(name for name in spec.plant.defaults if values[name] == spec.plant.parameters[name])
    return spec.changed({**changed, "plant.parameters": values, "plant.defaults": defaults})


def _rounded(ends: tuple[float, float], given: tuple[float, float]) -> tuple[float, float]:
    """Leave `LEAST_HALF_RANGE` at least, in digits worth a hundredth of it, within the given ends."""
    middle = sum(ends) / 2.0
    half = max((ends[1] - ends[0]) / 2.0, LEAST_HALF_RANGE * abs(middle))
    if 2.0 * half > NARROWER * (given[1] - given[0]):
        return given
    middle = min(max(middle, given[0] + half), given[1] - half)
    unit = 10.0 ** (math.floor(math.log10(half)) - 2)
    low, high = math.floor((middle - half) / unit) * unit, math.ceil((middle + half) / unit) * unit
    return max(given[0], float(f"{low:.10g}")), min(given[1], float(f"{high:.10g}"))
