"""A logged swing as a function of parameters, of how it began, and of the sensor's zero."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import SimpleNamespace

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.dynamics.evaluation.simulation import free_swing
from gen_profile.dynamics.problem.linearization import Linearization, linearize
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant
from gen_profile.studies.identification.measurements import SwingLog, require_angle
from gen_profile.support.errors import InfeasibleProblem

SLOPE_STEP = 1e-6  # relative, of numerical slopes
WIDEST_SWING = math.pi / 4.0  # rad, beyond which no load is let swing
AT_REST = 1e-9  # SI units, which no sensor tells from rest
DIFFERENCE_PERIODS = 1e-3  # between angles whose difference is a rate; less than between samples
DERIVATIVES = {"rate": 1, "acceleration": 2}  # by time; of the angle, or the sway
OF_SWAY = ("sway", "acceleration")
MOST_SAMPLES, SWINGS = 6000, 300  # of a log that is fitted: twenty averages of each swing
SWINGS_A_DRIFT, MOST_DRIFTS = 2.0, 4  # a zero drifts slower than the load swings
FEWEST_SWINGS, CLEAR = 4, 0.5  # of a log, and share of its power at one frequency, which tell its pace
PACE = 5.0  # times slower or faster than the machine, of which no rope is so wrong as a clock may be
OBSERVED_SIZE = 1e-6  # relative size from which on a log shows a part of its start


@attrs.frozen(kw_only=True, eq=False)
class SwingingMachine:
    """What is known beforehand: the machine, all its parameters, and where its axes stood."""

    plant: Plant
    parameters: Mapping[str, float]
    q_a: tuple[float, ...]

    @property
    def linear(self) -> Linearization:
        """Its small swings."""
        return linearize(self.plant, self.parameters, self.q_a)

    def of(self, parameters: Mapping[str, float]) -> SwingingMachine:
        """Give the same machine with other parameters."""
        return attrs.evolve(self, parameters=parameters)


@attrs.frozen(kw_only=True, eq=False)
class SwingModel:
    """A log beside the machine that swings.

    The unknowns of a log beside the machine's parameters, its *start*, are those of q_u and q̇_u at its first
    sample that it shows, and the sensor's zero, by Legendre's polynomials over the log: it drifts, slower
    than the load swings. A log of one direction of a gantry's payload shows nothing of the other.

    Attributes
    ----------
    machine : SwingingMachine
        Of about the parameters that it is compared with.
    log : SwingLog
    shown : (s,) array of int
        Which of q_u and q̇_u, one after the other, are unknowns; all others are zero.
    period : float
        Of the machine's slowest mode, roughly, in s.
    small : bool
        Whether swings are taken to be small, which is a hundred times faster.
    """

    machine: SwingingMachine
    log: SwingLog
    shown: NDArray[np.intp]
    period: float
    small: bool = False

    @property
    def unknowns(self) -> int:
        """Numbers in a start."""
        return len(self.shown) + self.drifts

    @property
    def drifts(self) -> int:
        """Numbers that a sensor's zero takes: a constant, and one more for every few swings."""
        return 1 + min(int(self.log.times[-1] / (SWINGS_A_DRIFT * self.period)), MOST_DRIFTS)

    def zeros(self, until: float = math.inf) -> Array:
        """Give unit drifts of the zero up to a time, (samples, drifts); constants alone of a part."""
        count = self.samples(until)
        place = 2.0 * self.log.times[:count] / self.log.times[-1] - 1.0
        drifts = np.polynomial.legendre.legvander(place, self.drifts - 1)
        if count < len(self.log.times):
            drifts[:, 1:] = 0.0
        return np.asarray(drifts)

    def samples(self, until: float) -> int:
        """Count the samples before a time in s."""
        return int(np.searchsorted(self.log.times, until, side="right"))

    def guess(self, parameters: Mapping[str, float], until: float) -> Array:
        """Find the start that the linear model agrees with best, up to a time in s."""
        count = self.samples(until)
        columns = _linear_answers(self.machine.of(parameters), self.log, count)[:, self.shown]
        design = np.column_stack([columns, self.zeros(until)])
        size = np.linalg.norm(design, axis=0)
        size[size == 0.0] = 1.0
        start = np.linalg.lstsq(design / size, self.log.values[:count], rcond=1e-8)[0] / size
        return np.asarray(start)

    def widest(self, parameters: Mapping[str, float], start: Array) -> float:
        """Say how far any load swings from such a start, in rad, were its swings small."""
        machine, loads = self.machine.of(parameters), self.machine.plant.loads
        logs = (attrs.evolve(self.log, quantity="angle", load=load) for load in loads)
        answers = (_linear_answers(machine, log)[:, self.shown] @ start[: len(self.shown)] for log in logs)
        return max(float(np.abs(answer).max()) for answer in answers)

    def residuals(
        self, parameters: Mapping[str, float], names: Sequence[str], steps: Array, start: Array, until: float
    ) -> tuple[Array, Array]:
        """Compare the swing with the log up to a time in s.

        Parameters
        ----------
        parameters : mapping of str to float
        names : (p,) sequence of str
            Parameters to take slopes by.
        steps : (p,) array
            How far to step for them, in their units.
        start : (s + drifts,) array

        Returns
        -------
        residuals : (samples,) array
            In the log's unit.
        slopes : (samples, p + s + drifts) array
        """
        count, n, zeros = self.samples(until), len(self.shown), self.zeros(until)
        size = float(np.abs(start[:n]).max()) or 1.0
        machines, starts, by = self.lanes(parameters, names, steps, start[:n], size)
        outputs = self._outputs(machines, starts, count)
        slopes = (outputs[1:] - outputs[0]).T / by
        left = outputs[0] + zeros @ start[n:] - self.log.values[:count]
        return left, np.column_stack([slopes, zeros])

    def lanes(
        self, parameters: Mapping[str, float], names: Sequence[str], steps: Array, start: Array, size: float
    ) -> tuple[Array, Array, Array]:
        """Put machines side by side that tell slopes: the first as it is, then with a step in each unknown.

        Parameters
        ----------
        parameters, names, steps
            As of `residuals`.
        start : (s,) array
            Of q_u and q̇_u, those that are shown.
        size : float
            Of a swing, a millionth of which is a step of the start.

        Returns
        -------
        machines : (1 + p + s, parameters) array
        starts : (1 + p + s, 2 n_u) array
        steps : (p + s,) array
        """
        n, step, plant = len(start), SLOPE_STEP * size, self.machine.plant
        order = [q.name for q in plant.parameters]
        machines = np.tile([parameters[name] for name in order], (1 + len(names) + n, 1))
        for lane, (name, by) in enumerate(zip(names, steps, strict=True), start=1):
            machines[lane, order.index(name)] += by
        starts = np.zeros((len(machines), 2 * len(plant.unactuated)))
        starts[:, self.shown] = start
        starts[1 + len(names) + np.arange(n), self.shown] += step
        return machines, starts, np.concatenate([steps, np.full(n, step)])

    def _outputs(self, machines: Array, starts: Array, count: int) -> Array:
        """Say what the log would show of machines that begin so: (machines, count)."""
        plant, slopes = self.machine.plant, DERIVATIVES.get(self.log.quantity, 0)
        if self.small:
            order = [q.name for q in plant.parameters]
            rows = (dict(zip(order, row, strict=True)) for row in machines.tolist())
            pairs = zip(rows, starts, strict=True)
            return np.stack([self._small_swing(parameters, start, count) for parameters, start in pairs])
        times = self.log.times[:count]
        apart = min(DIFFERENCE_PERIODS * self.period, 0.4 * float(np.diff(self.log.times).min()))
        # that time later, and later again: a start is another one then
        times = (times[:, None] + apart * np.arange(slopes + 1)).ravel()
        sway, angle = free_swing(plant, machines, q_a=self.machine.q_a, starts=starts, times=times)
        shown = (sway if self.log.quantity in OF_SWAY else angle)[:, :, plant.loads.index(self.log.load)]
        return np.asarray(np.diff(shown.reshape(len(machines), count, -1), slopes)[..., 0] / apart**slopes)

    def _small_swing(self, parameters: Mapping[str, float], start: Array, count: int) -> Array:
        """Say what the log would show of a machine of small swings; of two conjugate rates one tells all."""
        rates, gains, inverse = _linear_modes(self.machine.of(parameters), self.log)
        shares = gains * (inverse @ start) * (1.0 + np.sign(rates.imag))
        shown = rates.imag >= 0.0
        return np.asarray((np.exp(self.log.times[:count, None] * rates[shown]) @ shares[shown]).real)


def swing_model(machine: SwingingMachine, log: SwingLog) -> SwingModel:
    """Put a log beside a machine of about these parameters.

    Raises
    ------
    InfeasibleProblem
        The log is too short or too sparse to show the machine's swing, or shows a greater one than any.
    """
    period = 2.0 * np.pi / float(machine.linear.frequencies[0])
    lasts, between = float(log.times[-1]), float(np.median(np.diff(log.times)))
    if lasts < period / 2.0 or between > period / 4.0:
        template = (
            "The log lasts {lasts:.3g} s with a sample every {between:.3g} s, and this machine "
            "swings once in {period:.3g} s: look at the unit of the log's times, log more of it, "
            "or correct the spec."
        )
        raise InfeasibleProblem(template, lasts=lasts, between=between, period=period)
    _require_swing(machine, log)
    size = np.linalg.norm(_linear_answers(machine, log), axis=0)
    shown = np.flatnonzero(size > OBSERVED_SIZE * size.max())
    return SwingModel(machine=machine, log=log, shown=shown, period=period)


def require_likely(model: SwingModel) -> None:
    """Refuse a log that swings many times slower or faster than its machine, or too wide: a unit is wrong.

    A search from so far away takes minutes and finds nothing. Logs of few swings, or of many frequencies,
    are left to the fit.

    Raises
    ------
    InfeasibleProblem
    """
    log, natural = model.log, model.machine.linear.frequencies
    times = np.linspace(0.0, log.times[-1], len(log.times))
    values = np.interp(times, log.times, log.values)
    places = 2.0 * times / times[-1] - 1.0
    drift = np.polynomial.legendre.legfit(places, values, MOST_DRIFTS)
    swinging = values - np.polynomial.legendre.legval(places, drift)
    power = np.square(np.abs(np.fft.rfft(swinging * np.hanning(len(times)))))
    peak = int(np.argmax(power))
    seen = 2.0 * np.pi * peak / float(times[-1])
    if peak < FEWEST_SWINGS or power[peak - 2 : peak + 3].sum() < CLEAR * power.sum():
        return
    if natural[0] / PACE <= seen <= PACE * natural[-1]:
        mode = int(np.argmin(np.abs(np.log(natural / seen))))
        _require_narrow(model.machine, log, float(np.sqrt(2.0) * np.std(swinging)), mode)
        return
    near = natural[0] if seen < natural[0] else natural[-1]
    template = (
        "By its clock, the log swings once in {seen:.3g} s, and this machine in {period:.3g} s: look at the "
        "column and the unit of the log's times, or correct the spec."
    )
    raise InfeasibleProblem(template, seen=2.0 * np.pi / seen, period=2.0 * np.pi / float(near))


def shortened(log: SwingLog, machine: SwingingMachine, most: int = MOST_SAMPLES) -> SwingLog:
    """Average neighbouring samples of a log of more than so many, but no long stretches.

    What is left out then is the log's end, after some three hundred swings of the fastest mode.
    """
    if len(log.times) <= most:
        return log
    fastest = 2.0 * np.pi / float(machine.linear.frequencies[-1])
    return log.averaged(min(float(log.times[-1]), SWINGS * fastest) / most, most)


def _require_swing(machine: SwingingMachine, log: SwingLog) -> None:
    """Refuse a log of swings that no machine makes: it is in another unit."""
    if log.quantity == "angle":
        require_angle(log.values)
    swing = float(np.ptp(log.values)) / 2.0
    if swing < AT_REST:
        template = "The log's {quantity} does not swing; look at its columns, and at when it begins (after)."
        raise InfeasibleProblem(template, quantity=log.quantity)
    gains = _gain(machine, log) @ machine.linear.modes
    shown = np.abs(gains * machine.linear.frequencies ** DERIVATIVES.get(log.quantity, 0))
    _require_narrow(machine, log, swing, int(np.argmax(shown)))


def _require_narrow(machine: SwingingMachine, log: SwingLog, swing: float, mode: int) -> None:
    """Refuse a log of which a mode would swing wider than any load is let swing."""
    linear = machine.linear
    gains = _gain(machine, log) @ linear.modes * linear.frequencies ** DERIVATIVES.get(log.quantity, 0)
    angles = _gain(machine, attrs.evolve(log, quantity="angle")) @ linear.modes
    angle = swing * abs(angles[mode] / gains[mode]) if gains[mode] else 0.0
    if angle > WIDEST_SWING:
        template = (
            "The log's {log.quantity} goes {swing:.3g} {log.unit} to either side, a swing of "
            "{angle:.0f}°: look at its unit, and at what it is of (signal)."
        )
        raise InfeasibleProblem(template, log=log, swing=swing, angle=math.degrees(angle))


def _linear_answers(machine: SwingingMachine, log: SwingLog, count: int | None = None) -> Array:
    """Say what the log would show of a unit of each of q_u and q̇_u in the linear model: (samples, 2 n_u).

    Of all of its samples, or of so many.
    """
    rates, gains, inverse = _linear_modes(machine, log)
    return np.asarray(((gains * np.exp(log.times[:count, None] * rates)) @ inverse).real)


def _linear_modes(machine: SwingingMachine, log: SwingLog) -> tuple[Array, Array, Array]:
    """Give the linear model's rates, what the log shows of each mode, and the modes in any state; complex."""
    linear = machine.linear
    n_u = len(linear.frequencies)
    system = np.block([[np.zeros((n_u, n_u)), np.eye(n_u)], [-linear.stiffness, -linear.damping]])
    rates, vectors = np.linalg.eig(system)
    gains = _gain(machine, log) @ vectors[:n_u]
    return rates, gains * rates ** DERIVATIVES.get(log.quantity, 0), np.linalg.inv(vectors)


def _gain(machine: SwingingMachine, log: SwingLog) -> Array:
    """Slopes of the logged output by q_u, at rest; of a derivative those of what it is of."""
    p, plant = SimpleNamespace(**machine.parameters), machine.plant
    outputs = [plant.outputs(q_u, machine.q_a, p) for q_u in SLOPE_STEP * np.eye(len(plant.unactuated))]
    name = "sway" if log.quantity in OF_SWAY else "angle"
    return np.array([getattr(output, name)[plant.loads.index(log.load)] for output in outputs]) / SLOPE_STEP
