"""Stability margins of a written block's damping by a sensor, from its text, in the frequency domain.

What the block does is linear between its least and its greatest motions. The observer leaves e of what a
sensor shows; where that is M(s) of what was expected of the axis's own motion, e = S (M − 1) P a, with P the
machine from acceleration to sensor and S = 1/(1 + C (s − A)⁻¹ K e^(−s age)). The law makes a = H e of it: a
regulator from slot to slot, and the spline of its pulses. So the loop is at its limit where M Q/(1 + Q) = 1,
Q = H S P e^(−s age), whatever the gains were made for. Gains are those of the text, the machine
is the spec's.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import attrs
import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.planner.directions import (
    SensedDirection,
    linearized,
    planned_axes,
    sensed_directions,
    shown_of_modes,
)
from gen_profile.planner.sensor import damping_kernel
from gen_profile.spec.model import Spec
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.planner.block import SLOTS_PER_PERIOD
from gen_profile_exporters.planner.sensor_constants import ROWS_BEFORE, model_rows

POINTS = 3  # of each live range
FREQUENCIES = np.geomspace(0.02, 9.0, 2001)  # of the slowest mode's

Complex = NDArray[np.complex128]


@attrs.frozen(kw_only=True)
class Margins:
    """How wrong a sensor may be, at the worst of the live ranges, before damping excites the load.

    Attributes
    ----------
    delay : float
        s, by which it may be later than `planner.sensor.delay` says in the middle.
    gain : float
        How many times too much it may show; infinity where nothing excites.
    """

    delay: float
    gain: float

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {"delay_s": self.delay, "gain": self.gain}


def sensor_margins(spec: Spec, text: str) -> Margins | None:
    """Find the margins of a written block.

    Parameters
    ----------
    spec : Spec
    text : str
        Of the block of this spec.

    Returns
    -------
    Margins or None
        None where it has no sensor.
    """
    if spec.planner.sensor is None:
        return None
    written = {
        variable.name: np.array([float(value) for value in variable.elements])
        for variable in parse_function_block(text).variables
        if variable.array and variable.initial
    }
    found = [
        _margins(_loop(spec, written, point, one), float(linearized(spec, point).distinct_frequencies[0]))
        for point in product(np.linspace(-1.0, 1.0, POINTS).tolist(), repeat=len(spec.planner.live))
        for one in sensed_directions(spec).values()
    ]
    return Margins(delay=min(one.delay for one in found), gain=min(one.gain for one in found))


def _margins(open_loop: Complex, slowest: float) -> Margins:
    """Find where a loop, closed by −1, is at its limit: crossings of the unit circle and of the real axis."""
    frequencies = slowest * FREQUENCIES
    size, late = np.abs(open_loop), np.mod(np.angle(-open_loop), 2.0 * np.pi) / frequencies
    crosses = np.flatnonzero((size[1:] - 1.0) * (size[:-1] - 1.0) <= 0.0)
    real = np.flatnonzero((open_loop.imag[1:] * open_loop.imag[:-1] <= 0.0) & (open_loop.real[1:] < 0.0))
    gains = 1.0 / size[real]
    return Margins(
        delay=float(late[crosses].min(initial=np.inf)), gain=float(gains[gains >= 1.0].min(initial=np.inf))
    )


def _loop(
    spec: Spec, written: Mapping[str, Array], point: Sequence[float], direction: SensedDirection
) -> Complex:
    """Give −Q/(1 + Q) at all frequencies: the loop from the sensor to itself."""
    sensor = spec.planner.sensor
    assert sensor is not None
    at, axes = linearized(spec, point), list(planned_axes(spec))
    frequencies = at.distinct_frequencies
    modes, slowest, rate = len(frequencies), float(frequencies[0]), int(sensor.quantity == "rate")
    rows = _model(spec, written, point)[(ROWS_BEFORE + len(axes)) * modes :]
    rows = rows[axes.index(direction.axis) * model_rows(modes) :]
    push, shown = rows[:modes], rows[modes : 2 * modes]
    gains = rows[3 * modes : 5 * modes + 1] / spec.export.cycle_time
    s = 1j * slowest * FREQUENCIES
    decays = at.distinct_damping_ratios * frequencies
    moved = shown_of_modes(spec, at, direction)
    machine, learnt = np.zeros_like(s), gains[-1] / s
    for mode in range(modes):
        own = s * s + 2.0 * decays[mode] * s + frequencies[mode] ** 2
        machine += moved[mode] * s**rate / own
        position, velocity = gains[mode], gains[modes + mode]
        estimated = (position * (s + 2.0 * decays[mode]) + velocity) / own
        if rate:
            estimated = (velocity * s - position * frequencies[mode] ** 2) / own
        learnt = learnt + shown[mode] * estimated
    late = np.exp(-s * sensor.usual_age)
    answer = _law(spec, written["cDampGain"], (gains[0], gains[modes]), float(push[0]), frequencies)
    closed = answer * late * machine / (1.0 + learnt * late)
    return np.asarray(-closed / (1.0 + closed))


def _law(spec: Spec, law: Array, gains: tuple[float, float], push: float, frequencies: Array) -> Complex:
    """Find H, from what the observer leaves to the acceleration: mode, regulator, pulses."""
    slowest, cycle = float(frequencies[0]), spec.export.cycle_time
    slot = max(1, round(2.0 * np.pi / slowest / (SLOTS_PER_PERIOD * cycle))) * cycle
    kernel = damping_kernel(frequencies)

    def pulse(s: Complex) -> Complex:
        taps = np.exp(-np.multiply.outer(s * slot, np.arange(len(kernel)))) @ kernel
        return np.asarray(taps * (-np.expm1(-s * slot) / (s * slot)) ** 3)

    effect = push * slowest * slot * abs(pulse(np.array([1j * slowest], dtype=np.complex128))[0])
    ahead = np.exp(0.5j * slowest * (len(kernel) + 2) * slot)
    learnt = -1j * (gains[1] + 1j * slowest * gains[0]) * ahead / effect
    turn = np.exp(1j * slowest * slot)
    free = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
    closed = free @ (np.eye(3) - np.outer([1.0, 0.0, 1.0], law))
    swings = np.array([[0.0, -slowest], [slowest, 0.0]])
    s = np.asarray(1j * slowest * FREQUENCIES, dtype=np.complex128)
    each, z = s[:, None, None], np.exp(s * slot)[:, None, None]
    grown = (z * np.eye(2) - free[:2, :2]) @ np.array([[learnt.real], [learnt.imag]])
    comes = np.zeros((len(s), 3, 1), dtype=np.complex128)
    comes[:, :2] = np.linalg.solve(each * np.eye(2) - swings, grown)
    answer = -(law @ np.linalg.solve(z * np.eye(3) - closed, comes))[:, 0]
    return np.asarray(answer * s * pulse(s))


def _model(spec: Spec, written: Mapping[str, Array], point: Sequence[float]) -> Array:
    """Evaluate the text's polynomials at a point of the live ranges, for all but its frequencies."""
    lives = len(spec.planner.live)
    exponents = written["cExponent"].astype(np.int64).reshape(max(lives, 1), -1)
    curvatures = written["cLiveBend"].reshape(2, -1)[1]
    values = np.ones(exponents.shape[1])
    for live, t in enumerate(point):
        bent = (t + curvatures[live]) / (1.0 + curvatures[live] * t)
        powers = [chebyshev.chebval(bent, np.eye(n + 1)[n]) for n in range(exponents.max() + 1)]
        values = values * np.array(powers)[exponents[live]]
    return np.asarray(written["cModel"].reshape(-1, exponents.shape[1]) @ values)
