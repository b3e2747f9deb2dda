"""What the machine really did, beside what was planned."""

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np
from scipy.integrate import trapezoid
from scipy.linalg import null_space
from scipy.optimize import minimize_scalar

from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.dynamics.evaluation.simulation import Response
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.profile import Array
from gen_profile.presentation.report.log import MeasuredLog
from gen_profile.spec.model import Spec
from gen_profile.support.errors import OutputError

STARTS = 400  # starts of the move that are tried before the best is refined
MOST_FITTED = 4000  # samples
LEAST_WAY = 0.1  # of an axis' way, that it goes in a log at least
UNLIKE = 0.25  # of it, RMS: by which a log is off the plan that is none of this move
ANYTHING = 0.1  # rad, of what no angle tells
LEAST_PERIODS = 1.0  # of the slowest mode that a log must hold after the arrival for a residual to be judged


@attrs.frozen(kw_only=True, eq=False)
class Signal:
    """One measured quantity and the planned one at the same times.

    Attributes
    ----------
    times : (samples,) array
        s since the start of the move.
    measured, planned : (samples,) arrays
    unit : str
        Theirs: ``"m"`` or ``"rad"``.
    """

    times: Array
    measured: Array
    planned: Array
    unit: str

    @property
    def deviation(self) -> Array:
        """How far the machine is from the plan, shape (samples,)."""
        return np.asarray(self.measured - self.planned)

    @property
    def peak(self) -> float:
        """Greatest deviation."""
        return float(np.abs(self.deviation).max())

    @property
    def rms(self) -> float:
        """Root mean square of the deviation over time."""
        spans = self.times[-1] - self.times[0]
        return float(np.sqrt(trapezoid(self.deviation**2, self.times) / spans))

    def to_dict(self) -> dict[str, float]:
        """Nest plain values for JSON."""
        return {f"deviation_rms_{self.unit}": self.rms, f"deviation_peak_{self.unit}": self.peak}


@attrs.frozen(kw_only=True, eq=False)
class MeasuredSway:
    """A load's sway, and what is left of it after the arrival.

    Attributes
    ----------
    signal : Signal
        Planned for the nominal machine.
    residual : float or None
        Greatest distance from its place at rest after the arrival, in m: a sensor's zero does not sway. None
        where the log ends too soon.
    noise : float
        The sensor's, from sample to sample, in m (RMS): it is part of the residual.
    limit : float
        m.
    from_angles : bool
        Whether it was computed from the ropes' angles.
    """

    signal: Signal
    residual: float | None
    noise: float
    limit: float
    from_angles: bool

    @property
    def passed(self) -> bool | None:
        """Whether the load keeps its limit; None where that cannot be said."""
        return None if self.residual is None else self.residual <= self.limit

    def to_dict(self) -> dict[str, float | bool | None]:
        """Nest plain values for JSON."""
        judged = {"residual_m": self.residual, "noise_m": self.noise, "limit_m": self.limit}
        return {**self.signal.to_dict(), **judged, "passed": self.passed}


@attrs.frozen(kw_only=True, eq=False)
class Measured:
    """A log held against an evaluation.

    Attributes
    ----------
    log : MeasuredLog
        What it holds of the move.
    start : float
        When the move begins in the whole log, in s.
    arrival : float
        When the axes shall stand still, in s since the start.
    positions : mapping of str to Signal
        By axis.
    sways : mapping of str to MeasuredSway
        By load.
    angles : mapping of str to Signal
        By load, of the nominal machine.
    nearest : int or None
        Which of the evaluation's machines swings most like it; None where no swing was logged.
    loads : tuple of str
        Of the machine, whether they were logged or not.
    """

    log: MeasuredLog
    start: float
    arrival: float
    positions: Mapping[str, Signal]
    sways: Mapping[str, MeasuredSway]
    angles: Mapping[str, Signal]
    nearest: int | None
    loads: tuple[str, ...]

    @property
    def passed(self) -> bool | None:
        """Whether all loads that were measured keep their limits; None where none could be judged."""
        verdicts = [sway.passed for sway in self.sways.values() if sway.passed is not None]
        return all(verdicts) if verdicts else None

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "passed": self.passed,
            "start_s": self.start,
            "nearest": self.nearest,
            "positions": {name: signal.to_dict() for name, signal in self.positions.items()},
            "sways": {name: sway.to_dict() for name, sway in self.sways.items()},
            "angles": {name: signal.to_dict() for name, signal in self.angles.items()},
        }


def compare_measured(
    spec: Spec, evaluation: MotionEvaluation, log: MeasuredLog, arrival: float, start: float | None = None
) -> Measured:
    """Hold a log against the plan.

    Parameters
    ----------
    spec : Spec
    evaluation : MotionEvaluation
    log : MeasuredLog
    arrival : float
        When the axes stand still, in s since the start of the move.
    start : float, optional
        When the move begins in the log, in s; where not given, the start that fits best is taken.

    Raises
    ------
    OutputError
        The log does not hold the move, or one that is like it.
    """
    if start is None:
        start = _best_start(evaluation, log)
        _require_alike(evaluation, log, start)
    move = _the_move(evaluation, log, start)
    q_a, responses = evaluation.motion(move.times).position, evaluation.swing.at(move.times)
    plant, loads = spec.machine(), spec.machine().loads
    for logged, planned in ((move.sways, responses[0].sway), (move.angles, responses[0].angle)):
        for name, values in logged.items():
            _require_sign(move.source, name, values, planned[:, loads.index(name)])
    sways = {**_sways_of_angles(spec, move, q_a), **move.sways}

    swung = _signals(move.times, sways, responses[0].sway, dict.fromkeys(loads, "m"))
    units = {axis.name: axis.unit for axis in plant.actuated}
    return Measured(
        log=move,
        start=start,
        arrival=arrival,
        positions=_signals(move.times, move.positions, q_a, units),
        sways={
            load: _sway(spec, load, signal, arrival=arrival, from_angles=load not in move.sways)
            for load, signal in swung.items()
        },
        angles=_signals(move.times, move.angles, responses[0].angle, dict.fromkeys(loads, "rad")),
        nearest=_nearest(move, responses, loads),
        loads=tuple(loads),
    )


def _signals(
    times: Array, measured: Mapping[str, Array], planned: Array, units: Mapping[str, str]
) -> dict[str, Signal]:
    """Pair what was measured with its planned column, which has a name and a unit; leave out what was not."""
    return {
        name: Signal(times=times, measured=measured[name], planned=planned[:, column], unit=unit)
        for column, (name, unit) in enumerate(units.items())
        if name in measured
    }


def _moving(evaluation: MotionEvaluation, log: MeasuredLog) -> tuple[str, int] | None:
    """Name an axis that moves and was logged, with its number; None where there is none."""
    ways = evaluation.motion.target - evaluation.motion.start
    axes = [axis.name for axis in evaluation.swing.plant.actuated]
    return next(((name, axes.index(name)) for name in log.positions if ways[axes.index(name)]), None)


def _require_alike(evaluation: MotionEvaluation, log: MeasuredLog, start: float) -> None:
    """Refuse a log whose axis goes another way than planned, as in another unit or the other way round."""
    moving = _moving(evaluation, log)
    if moving is None:
        return
    name, column = moving
    signal, motion = log.positions[name], evaluation.motion
    begin, end = motion.start[column], motion.target[column]
    during = (log.times >= start) & (log.times <= start + motion.duration)
    planned = motion(log.times - start).position[:, column]
    off = (signal - planned)[during] / (end - begin)
    if np.ptp(signal) < LEAST_WAY * abs(end - begin) or (off**2).sum() > UNLIKE**2 * len(off):
        unit = evaluation.swing.plant.actuated[column].unit
        if max(abs(signal[0] - begin), abs(signal[-1] - end)) < LEAST_WAY * abs(end - begin):
            worst = int(np.argmax(np.abs(np.where(during, signal - planned, 0.0))))
            template = (
                "measured {source}: {axis} is at {found:.4g} {unit} at {time:.4g} s, and the move leads it "
                "to {there:.4g} {unit} then; leave out values that were not measured, and look whether this "
                "is a log of this move."
            )
            values = {"found": signal[worst], "time": log.times[worst], "there": planned[worst], "unit": unit}
            raise OutputError(template, source=log.source, axis=name, **values)
        template = (
            "measured {source}: {axis} goes from {first:.4g} to {last:.4g} {unit} in the log, and from "
            "{begin:.4g} to {end:.4g} {unit} in the move; look at the unit and the sign of its column, and "
            "whether this is the whole log of this move."
        )
        values = {"first": signal[0] + 0.0, "last": signal[-1], "begin": begin, "end": end, "unit": unit}
        raise OutputError(template, source=log.source, axis=name, **values)


def _require_sign(source: str, load: str, measured: Array, planned: Array) -> None:
    """Refuse a swing that is the planned one the other way round, sensors' zeros aside."""
    if float(np.var(measured + planned)) < UNLIKE**2 * float(np.var(planned)):
        template = (
            "measured {source}: the {load} swings as planned, but the other way round: sway and angle are "
            "positive where the load trails the axis; negate the column."
        )
        raise OutputError(template, source=source, load=load)


def _the_move(evaluation: MotionEvaluation, log: MeasuredLog, start: float) -> MeasuredLog:
    """Cut out of a log what was planned, the swing afterwards included; its times begin with the move."""
    until = evaluation.motion.duration + evaluation.watch
    kept = (log.times >= start) & (log.times <= start + until)
    if kept.sum() < 2 or log.times[kept][-1] < start + evaluation.motion.duration:
        template = (
            "measured {source}: the log ends before the move that begins at {start:.4g} s in it "
            "does; log on until the load is at rest, or state when it starts (measured_start)."
        )
        raise OutputError(template, source=log.source, start=start)

    def cut(signals: Mapping[str, Array]) -> dict[str, Array]:
        return {name: values[kept] for name, values in signals.items()}

    positions, sways, angles = map(cut, (log.positions, log.sways, log.angles))
    return attrs.evolve(log, times=log.times[kept] - start, positions=positions, sways=sways, angles=angles)


def _nearest(move: MeasuredLog, responses: Sequence[Response], loads: Sequence[str]) -> int | None:
    """Find the machine whose swing is nearest to all that was logged, sensors' zeros aside."""
    apart = np.zeros(len(responses))
    for logged, kind in ((move.sways, "sway"), (move.angles, "angle")):
        for name, values in logged.items():
            planned = [getattr(response, kind)[:, loads.index(name)] for response in responses]
            size = float(np.var(planned[0])) or 1.0
            apart += [float(np.var(values - one)) / size for one in planned]
    return int(np.argmin(apart)) if move.sways or move.angles else None


def _sway(spec: Spec, load: str, signal: Signal, *, arrival: float, from_angles: bool) -> MeasuredSway:
    frequencies = linearize(spec.machine(), spec.plant.parameters, spec.move.target).distinct_frequencies
    after = signal.times >= arrival
    residual = None
    if after.any() and signal.times[-1] - arrival >= LEAST_PERIODS * 2.0 * np.pi / frequencies[0]:
        left = signal.measured[after]
        residual = float(np.abs(left - _zero(signal.times[after], left, frequencies)).max())
    # no swing has such differences; 70 is the sum of their weights' squares
    noise = float(np.sqrt(np.sum(np.diff(signal.measured, 4) ** 2) / (70.0 * len(signal.times))))
    limit = spec.check.residual_sway[load]
    return MeasuredSway(signal=signal, residual=residual, noise=noise, limit=limit, from_angles=from_angles)


def _zero(times: Array, values: Array, frequencies: Array) -> float:
    """Find what a sensor shows at rest from a swing: the constant beside the machine's modes.

    A mean is off by up to a fifth of the swing unless swings are whole. Least squares are exact for the
    nominal modes, and Hann's window, which fades out swings cut short, makes up for modes a little off.
    """
    stride = -(-len(times) // MOST_FITTED)
    t, y = times[::stride] - times[0], values[::stride]
    resolved = frequencies[frequencies * np.diff(t).max() < np.pi]
    waves = (wave(frequency * t) for frequency in resolved for wave in (np.cos, np.sin))
    weights = np.sin(np.pi * (t + t[1]) / (t[-1] + 2.0 * t[1]))  # root of the window; no sample has none
    basis = np.column_stack([np.ones_like(t), *waves])
    return float(np.linalg.lstsq(basis * weights[:, None], y * weights)[0][0])


def _best_start(evaluation: MotionEvaluation, log: MeasuredLog) -> float:
    """Find when the move begins in a log: where a measured signal is nearest to the planned one.

    An axis' position tells it best; the sway of a load where no axis that moves was logged.
    """
    plant, duration = evaluation.swing.plant, evaluation.motion.duration
    moving = _moving(evaluation, log)
    grid = np.linspace(0.0, duration, 2001)
    if moving is not None:
        name, column = moving
        signal, planned = log.positions[name], evaluation.motion(grid).position[:, column]
    else:
        name, signal = next(iter({**log.sways, **log.angles}.items()))
        (nominal, *_) = evaluation.swing.at(grid)
        outputs = nominal.sway if name in log.sways else nominal.angle
        planned = outputs[:, plant.loads.index(name)]
    times = log.times

    def apart(start: float, sign: float = 1.0) -> float:
        return float(np.mean((sign * signal - np.interp(times - start, grid, planned)) ** 2))

    first, last = float(times[0]) - 0.1 * duration, float(times[-1]) - 0.5 * duration
    starts = np.linspace(first, max(last, first + duration), STARTS)
    misfits = [apart(start) for start in starts]
    if moving is None and min(misfits) > UNLIKE**2 * float(np.var(planned)):
        reversed_misfits = [apart(start, -1.0) for start in starts]
        start = starts[int(np.argmin(reversed_misfits))]
        _require_sign(log.source, name, np.interp(grid + start, times, signal), planned)
    best = int(np.argmin(misfits))
    step = starts[1] - starts[0]
    around = (starts[best] - step, starts[best] + step)
    refined = minimize_scalar(apart, bounds=around, method="bounded", options={"xatol": 1e-6})
    return float(refined.x)


def _sways_of_angles(spec: Spec, move: MeasuredLog, q_a: Array) -> dict[str, Array]:
    """Compute the sway of the loads that the ropes' angles tell of.

    The angles are taken to be linear in the coordinates, as ropes' are. What no angle tells of may be
    anything: a load whose sway depends on that has none.
    """
    plant = spec.machine()
    p, n_u = SimpleNamespace(**spec.plant.parameters), len(plant.unactuated)
    still = list(map(float, q_a[-1]))
    rows = [plant.loads.index(name) for name in move.angles]
    if not rows:
        return {}
    columns = [plant.outputs(list(unit), still, p).angle for unit in np.eye(n_u)]
    gain = np.array(columns, dtype=np.float64).T[rows].reshape(-1, n_u)
    if not gain.any():
        return {}
    measured = np.stack(list(move.angles.values()))
    q_u = np.linalg.lstsq(gain, measured, rcond=None)[0]
    unknown = null_space(gain).sum(axis=1)[:, None]

    def swayed(q: Any) -> list[Array]:
        sways = plant.outputs(list(q), list(q_a.T), p).sway
        return [np.broadcast_to(np.asarray(one, dtype=np.float64), len(q_a)).copy() for one in sways]

    both = zip(plant.loads, swayed(q_u), swayed(q_u + ANYTHING * unknown), strict=True)
    return {name: sway for name, sway, same in both if np.allclose(sway, same, rtol=1e-9, atol=1e-12)}
