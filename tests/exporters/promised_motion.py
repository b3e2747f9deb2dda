"""The quickest motion that keeps a planner block's promise, by linear programs of SciPy's: an oracle.

The jerk is constant over pieces. A mode swings by ∫ v exp(iωt) dt times a gain: nought in the end,
whatever was before, its slope by the frequency's error within a bound, and all modes together, each
at its worst error, within what is allowed.
"""

import attrs
import numpy as np
from scipy.optimize import linprog

ANGLES = np.exp(-1j * np.pi / 8 * np.arange(16))  # a bound of a modulus as that of 16 shadows
STEP = 1e-5  # relative, for the slope by a frequency
SHARES = np.array([0.0, -1.0, -0.75, -0.5, 0.5, 0.75, 1.0])  # of the errors


@attrs.frozen(eq=False)
class Promise:
    """What a motion must keep: sums over modes of slopes (by errors and gains) and of sways, and limits."""

    frequencies: np.ndarray
    errors: np.ndarray
    gains: np.ndarray
    slopes: float
    sway: float
    limits: tuple[float, float, float]

    @property
    def rates(self):
        """Frequencies of each mode at its errors."""
        return self.frequencies[:, None] * (1.0 + np.outer(self.errors, SHARES))

    @property
    def period(self):
        return 2.0 * np.pi / self.frequencies[0]


@attrs.frozen(eq=False)
class State:
    """Of an axis now, and of each mode ∫ v exp(iωt) dt of the past at its errors, and its slope by them."""

    place: float
    velocity: float
    acceleration: float
    waves: np.ndarray
    slopes: np.ndarray

    @classmethod
    def after(cls, promise, cycle, place, velocity, acceleration):
        """Read it off the setpoints up to now."""
        past = cycle * (np.arange(len(velocity)) - len(velocity) + 1)
        weighed = cycle * np.append(velocity[:-1], 0.5 * velocity[-1])
        phases = 1j * promise.frequencies[:, None] * past
        return cls(
            place[-1],
            velocity[-1],
            acceleration[-1],
            np.array([np.exp(1j * np.outer(rates, past)) @ weighed for rates in promise.rates]),
            (phases * np.exp(phases)) @ weighed * promise.errors,
        )


def quickest(promise, state, target=None, speed=0.0, travel=(-1e6, 1e6), most=400):
    """Give the least time in s to a standstill at a target or anywhere, or to a speed, and how far it goes.

    A speed is reached while nothing swings but what the decline from it takes away.
    """
    step = promise.period / 50
    low, high = 2, 8
    while _motion(promise, state, high, step, target, speed, travel) is None:
        low, high = high, 2 * high
        if low > most:
            return None
    while high - low > 1:
        middle = (low + high) // 2
        if _motion(promise, state, middle, step, target, speed, travel) is None:
            low = middle
        else:
            high = middle
    return high * step, _motion(promise, state, high, step, target, speed, travel)


def _motion(promise, state, pieces, step, target, speed, travel):
    """Way of a motion in so many pieces, the least one; none where there is none."""
    starts = step * np.arange(pieces)
    below = np.tri(pieces)
    accelerations = step * below
    velocities = step * (below @ accelerations) - 0.5 * step**2 * below
    ends = starts + step
    places = np.where(
        below > 0, ((ends[:, None] - starts) ** 3 - np.maximum(ends[:, None] - ends, 0.0) ** 3) / 6, 0.0
    )
    v, a = state.velocity, state.acceleration
    drift, drifted = v + a * ends, v * ends + 0.5 * a * ends**2
    equal, due = [accelerations[-1], velocities[-1]], [-a, speed - drift[-1]]
    if target is not None:
        equal, due = [*equal, places[-1]], [*due, target - state.place - drifted[-1]]
    above, most, sways = [], [], []
    total = float(promise.gains @ promise.errors)
    for mode, (rate, error) in enumerate(zip(promise.frequencies, promise.errors, strict=True)):
        rows, rests = zip(*(_wave(rate, starts, step, v, a) for rate in promise.rates[mode]), strict=True)
        left = np.array(rests) + state.waves[mode]
        equal, due = [*equal, rows[0].real, rows[0].imag], [*due, *(-c for c in _parts(left[0]))]
        (up, rest_up), (down, rest_down) = (
            _wave(rate * (1.0 + way * STEP), starts, step, v, a) for way in (1.0, -1.0)
        )
        slope, rest = (
            (one - other) / (2.0 * STEP) * error for one, other in ((up, down), (rest_up, rest_down))
        )
        for angle in ANGLES:
            above.append((slope * angle).real)
            most.append(promise.slopes * error / total - ((rest + state.slopes[mode]) * angle).real)
        projected = [
            (angle * row, angle * rest) for angle in ANGLES for row, rest in zip(rows, left, strict=True)
        ]
        sways.append([(row.real, rest.real) for row, rest in projected])
    fastest, greatest, jerk = promise.limits
    for rows, now, limits in (
        (accelerations, a + 0.0 * ends, (-greatest, greatest)),
        (velocities, drift, (-fastest, fastest)),
        (places, state.place + drifted, travel),
    ):
        above, most = [*above, *rows, *-rows], [*most, *(limits[1] - now), *(now - limits[0])]
    shortest = np.sign(v or 1.0) * places[-1] if target is None else np.zeros(pieces)
    modes = len(sways)  # as many unknowns more, each the most that a mode is left with
    above = [*(np.append(row, np.zeros(modes)) for row in above), np.append(np.zeros(pieces), promise.gains)]
    most.append(promise.sway)
    for mode, swings in enumerate(sways):
        above.extend(np.append(row, -np.eye(modes)[mode]) for row, _ in swings)
        most.extend(-rest for _, rest in swings)
    found = linprog(
        np.append(shortest, np.zeros(modes)),
        A_ub=np.array(above),
        b_ub=np.array(most),
        A_eq=np.pad(np.array(equal), ((0, 0), (0, modes))),
        b_eq=np.array(due),
        bounds=[(-jerk, jerk)] * pieces + [(0.0, None)] * modes,
    )
    return float(places[-1] @ found.x[:pieces] + drifted[-1]) if found.status == 0 else None


def _wave(rate, starts, step, velocity, acceleration):
    """∫ v exp(iωt) dt by the jerk of each piece, and without any; the end's own speed is no swing."""
    i = 1j * rate
    return (np.exp(i * (starts + step)) - np.exp(i * starts)) / i**3, (acceleration / i - velocity) / i


def _parts(number):
    return number.real, number.imag
