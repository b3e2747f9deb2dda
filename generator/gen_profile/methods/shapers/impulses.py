"""Input shapers: impulse trains whose convolution with any motion leaves a mode at rest, or nearly so.

`SHAPERS` names them; each takes a mode's undamped frequency ω in rad/s and its damping ratio ζ. A train
leaves the mode at rest when ``Σ aᵢ exp(s tᵢ) = 0`` with ``s = ω (ζ + j √(1 − ζ²))``; the motion keeps its
distance when ``Σ aᵢ = 1`` (Singer and Seering, 1990).

A train for an undamped mode becomes one for a damped mode by stretching its times to the damped period and
weighing its amplitudes by exp(−ζω tᵢ): every term of that sum is then what it was. Trains of unity magnitude
keep their amplitudes and move in time instead. So weighed, an extra-insensitive train would lose what it
tolerates, and with it a part of its range: it follows published fits over the damping ratio instead.
"""

import cmath
import math
from collections.abc import Iterable, Sequence
from functools import cache, partial, reduce
from typing import Protocol

import attrs
import numpy as np

from gen_profile.motion.profile import Array, read_only
from gen_profile.support.errors import InfeasibleProblem

TOLERATED = 0.05  # share of the vibration that extra-insensitive shapers trade for a wider range
MOST_DAMPING = 0.3  # ratio up to which trains of unity magnitude, and those that tolerate, are known
NEWTON_STEPS = 10  # six reach rounding for every ratio up to that
MOST_IMPULSES = 4096


@attrs.frozen(kw_only=True, eq=False)
class Impulses:
    """A train of impulses.

    Attributes
    ----------
    times : (impulses,) array
        s, rising from 0.
    amplitudes : (impulses,) array
        Their sum is 1.
    """

    times: Array = attrs.field(converter=read_only)
    amplitudes: Array = attrs.field(converter=read_only)

    @property
    def delay(self) -> float:
        """Time of the last impulse in s: what the shaper adds to any motion."""
        return float(self.times[-1])


class Shaper(Protocol):
    """What makes a train for one mode."""

    def __call__(self, frequency: float, damping_ratio: float = 0.0) -> Impulses:
        """Make it for an undamped frequency in rad/s and a damping ratio."""


def evenly_spaced(
    amplitudes: Sequence[float], spacing: float, frequency: float, damping_ratio: float = 0.0
) -> Impulses:
    """Place impulses at even distances.

    Parameters
    ----------
    amplitudes : (impulses,) sequence of float
        For an undamped mode, in any unit.
    spacing : float
        In damped periods.
    frequency : float
        Undamped, in rad/s.
    damping_ratio : float

    Raises
    ------
    InfeasibleProblem
        The mode does not swing.
    """
    if damping_ratio >= 1.0:
        raise InfeasibleProblem(
            f"A mode of this machine creeps back without swinging (damping ratio {damping_ratio:.2g}), "
            "and shapers are for modes that swing; choose another method."
        )
    pole = frequency * _unit_pole(damping_ratio)
    times = spacing * 2.0 * math.pi / pole.imag * np.arange(len(amplitudes))
    weighed = np.array(amplitudes) * np.exp(-pole.real * times)
    return Impulses(times=times, amplitudes=weighed / weighed.sum())


def unity_magnitude(guess: Sequence[float], frequency: float, damping_ratio: float = 0.0) -> Impulses:
    """Place +1 −1 +1 … so that Σ aᵢ exp(s tᵢ) vanishes, with as many derivatives by s as there is room for.

    Parameters
    ----------
    guess : (impulses − 1,) sequence of float
        Times of all impulses but the first for an undamped mode, in periods; roughly will do.
    frequency : float
        Undamped, in rad/s.
    damping_ratio : float

    Raises
    ------
    InfeasibleProblem
        The mode is damped beyond `MOST_DAMPING`.
    """
    _require_little_damping(damping_ratio, "of unity magnitude")
    phases = _alternating_phases(tuple(guess), damping_ratio)
    return Impulses(times=phases / frequency, amplitudes=_alternating(len(phases)))


def extra_insensitive(
    amplitudes: Sequence[float],
    weights: Sequence[Sequence[float]],
    delays: Sequence[Sequence[float]],
    frequency: float,
    damping_ratio: float = 0.0,
) -> Impulses:
    """Place impulses that leave `TOLERATED` of a mode on purpose, by fits over its damping ratio ζ.

    Parameters
    ----------
    amplitudes : (impulses,) sequence of float
        For an undamped mode, half a period apart.
    weights : (impulses,) sequence of sequence of float
        What they change by: factors of ζ, ζ², ζ³.
    delays : (impulses − 1,) sequence of sequence of float
        Likewise of the times of all but the first, in damped periods.
    frequency : float
        Undamped, in rad/s.
    damping_ratio : float

    Raises
    ------
    InfeasibleProblem
        The mode is damped beyond `MOST_DAMPING`.
    """
    _require_little_damping(damping_ratio, "that tolerate some vibration")
    powers = damping_ratio ** np.arange(1, 4)
    weighed = np.array(amplitudes) / sum(amplitudes) + np.array(weights) @ powers
    places = 0.5 * np.arange(len(amplitudes)) + np.concatenate([[0.0], np.array(delays) @ powers])
    period = 2.0 * math.pi / (frequency * math.sqrt(1.0 - damping_ratio**2))
    return Impulses(times=places * period, amplitudes=weighed / weighed.sum())


def _require_little_damping(damping_ratio: float, which: str) -> None:
    if damping_ratio > MOST_DAMPING:
        raise InfeasibleProblem(
            f"A mode of this machine has a damping ratio of {damping_ratio:.2g}, and shapers {which} are for "
            f"ratios up to {MOST_DAMPING:g}; choose another method."
        )


@cache
def _alternating_phases(guess: tuple[float, ...], damping_ratio: float) -> Array:
    """Solve ``Σ ± φᵢᵏ exp(s φᵢ) = 0``, k = 0, 1 …, for the times φᵢ at ω = 1 by Newton's method; φ₀ = 0."""
    pole, signs = _unit_pole(damping_ratio), _alternating(len(guess) + 1)
    powers = np.arange(len(guess) // 2)[:, None]
    phases = 2.0 * math.pi * np.array([0.0, *guess])
    for _ in range(NEWTON_STEPS):
        moments = signs * phases**powers * np.exp(pole * phases)
        slopes = pole * moments[:, 1:] + powers * moments[:, 1:] / phases[1:]
        jacobian = np.concatenate([slopes.real, slopes.imag])
        residual = moments.sum(axis=1)
        phases[1:] -= np.linalg.solve(jacobian, np.concatenate([residual.real, residual.imag]))
    return read_only(phases)


def _alternating(count: int) -> Array:
    return np.asarray(np.where(np.arange(count) % 2 == 0, 1.0, -1.0))


def _unit_pole(damping_ratio: float) -> complex:
    """Find s for ω = 1."""
    return damping_ratio + cmath.sqrt(damping_ratio**2 - 1.0)


def _two_hump(V: float) -> tuple[float, ...]:
    X = math.cbrt(V**2 * (math.sqrt(1.0 - V**2) + 1.0))
    outer = (3.0 * X**2 + 2.0 * X + 3.0 * V**2) / (16.0 * X)
    return (outer, 0.5 - outer, 0.5 - outer, outer)


def _three_hump(V: float) -> tuple[float, ...]:
    outer = (1.0 + 3.0 * V + 2.0 * math.sqrt(2.0 * V * (V + 1.0))) / 16.0
    inner = (1.0 - V) / 4.0
    return (outer, inner, 1.0 - 2.0 * (outer + inner), inner, outer)


SHAPERS: dict[str, Shaper] = {
    # unity-magnitude zero vibration: the shortest, no gentler on the drive (Singhose et al., 1994)
    "nzv": partial(unity_magnitude, (1.0 / 6.0, 1.0 / 3.0)),
    # zero vibration, and with one and two derivatives by frequency (Singer and Seering, 1990)
    "zv": partial(evenly_spaced, (1.0, 1.0), 0.5),
    "zvd": partial(evenly_spaced, (1.0, 2.0, 1.0), 0.5),
    "zvdd": partial(evenly_spaced, (1.0, 3.0, 3.0, 1.0), 0.5),
    # unity magnitude and derivative (Singhose et al., 1994)
    "umzvd": partial(unity_magnitude, (0.09, 0.37, 0.64, 0.73)),
    # extra-insensitive: small vibration over a range of frequencies (Singhose et al., 1994 and 1997), with
    # their fits over the damping ratio for 5 %
    "ei": partial(
        extra_insensitive,
        (1.0 + TOLERATED, 2.0 - 2.0 * TOLERATED, 1.0 + TOLERATED),
        ((0.861744, 0.654648, 0.0), (-0.100003, -1.261411, 0.0), (-0.761741, 0.606763, 0.0)),
        ((0.0445256, -0.0585255, 0.930273), (0.0, 0.0, 0.0)),
    ),
    "2hump-ei": partial(
        extra_insensitive,
        _two_hump(TOLERATED),
        (
            (0.76699, 2.26560, -1.22750),
            (0.45081, -2.58080, 1.73650),
            (-0.61533, -0.68765, 0.42261),
            (-0.60246, 1.00280, -0.93145),
        ),
        ((0.16270, -0.54262, 6.16180), (0.18382, -1.58270, 8.17120), (-0.09297, -0.28338, 1.85710)),
    ),
    "3hump-ei": partial(
        extra_insensitive,
        _three_hump(TOLERATED),
        (
            (0.76632, 3.29160, -1.44380),
            (0.61164, -2.57850, 4.85220),
            (-0.19062, -2.14560, 0.13744),
            (-0.73297, 0.46885, -2.08650),
            (-0.45439, 0.96382, -1.46000),
        ),
        (
            (0.23834, 0.44559, 12.47200),
            (0.29808, -2.36460, 23.39900),
            (0.10306, -2.01390, 17.03200),
            (-0.28231, 0.61536, 5.40450),
        ),
    ),
    # zero vibration with three impulses within ¾ of a period, known from 3D printers' firmware
    "mzv": partial(evenly_spaced, (1.0 - math.sqrt(0.5), math.sqrt(2.0) - 1.0, 1.0 - math.sqrt(0.5)), 0.375),
}


def convolve(trains: Iterable[Impulses]) -> Impulses:
    """Join shapers of several modes into one that suits all of them.

    Raises
    ------
    InfeasibleProblem
        They are so many that no controller could make use of the train.
    """
    return reduce(_convolve, trains)


def _convolve(one: Impulses, other: Impulses) -> Impulses:
    count = len(one.times) * len(other.times)
    if count > MOST_IMPULSES:
        raise InfeasibleProblem(
            f"A shaper for all modes of this machine would be a train of {count} impulses or more; "
            "choose a shaper of fewer impulses, or another method."
        )
    times = np.add.outer(one.times, other.times).ravel()
    order = np.argsort(times, kind="stable")
    amplitudes = np.multiply.outer(one.amplitudes, other.amplitudes).ravel()
    return Impulses(times=times[order], amplitudes=amplitudes[order])
