"""The quickest motion of an axis that keeps a promise, by linear programmes.

The acceleration is linear over pieces of equal length. In the end the machine as given hangs still, whatever
was before; and each machine of the stated errors keeps its bound, the past included: its modes s of
`SwayModes` are linear in the accelerations, and a modulus is bounded by its shadows in some directions, which
allows a little more. So nothing that is possible is missed but for the length of the pieces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import attrs
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csc_matrix

from gen_profile.methods.quickest.axis_alone import AxisLimits, to_place, to_velocity
from gen_profile.methods.quickest.modes import Complex
from gen_profile.motion.profile import Array

PIECES, FEWEST = 24, 8  # of the slowest period: the time is known to 4 % of it; and of the longest motions
PERIODS = 6.0  # that a motion may take in pieces so short; in longer ones these are as many
SHADOWS = np.exp(2j * np.pi / 8 * np.arange(8))  # which allow 8 % more
ANYWHERE = (-np.inf, np.inf)


@attrs.frozen(kw_only=True, eq=False)
class Promise:
    """What the motions of an axis must keep.

    Attributes
    ----------
    poles : (machines, modes) array
        As of `SwayModes`: first of those that must hang still, the one as given before all; then of those of
        the stated errors.
    gains : (machines, modes) array
        In s: of the load that shows a mode most.
    exact : int
        How many must hang still.
    left : float
        m, by which the others may sway on.
    limits : AxisLimits
    travel : (float, float)
        m (or rad).
    """

    poles: Complex
    gains: Array
    exact: int = 1
    left: float
    limits: AxisLimits
    travel: tuple[float, float] = ANYWHERE
    pieces: float = PIECES

    @property
    def period(self) -> float:
        """Of the slowest mode in s."""
        return float(2.0 * np.pi / self.poles[0].imag.min())

    @property
    def piece(self) -> float:
        """Length of a piece in s."""
        return self.period / self.pieces

    def lasting(self, seconds: float) -> Promise:
        """Let a motion of so many seconds be of no more pieces than can be solved for soon."""
        pieces = PIECES * PERIODS * self.period / max(seconds, 1e-9)
        return attrs.evolve(self, pieces=min(max(pieces, FEWEST), PIECES))


@attrs.frozen(kw_only=True, eq=False)
class AxisState:
    """An axis in an instant, in m (or rad) and s.

    Attributes
    ----------
    place, velocity, acceleration : float
    moved : (machines, modes) array
        What its motions have made of the modes of a `Promise`, as of `SwayModes.moved`.
    """

    place: float
    velocity: float
    acceleration: float
    moved: Complex


@attrs.frozen(kw_only=True)
class AxisGoal:
    """Where a motion ends: at a place at rest, at a speed, or, without both, at rest anywhere."""

    place: float | None = None
    speed: float = 0.0


def alone(limits: AxisLimits, state: AxisState, goal: AxisGoal) -> float:
    """Find the least time in s of an axis without a load."""
    if goal.place is None:
        return to_velocity(state.velocity, state.acceleration, goal.speed, limits)
    return to_place(goal.place - state.place, state.velocity, state.acceleration, limits)


def quickest(promise: Promise, state: AxisState, goal: AxisGoal, most: float) -> float | None:
    """Find the least time in s in which a goal is reached, the promise kept; none within the most."""
    least = alone(promise.limits, state, goal)
    promise = promise.lasting(least)
    low = int(least / promise.piece)
    high, last = low + 2, int(np.ceil(most / promise.piece))
    while motion(promise, state, goal, high) is None:
        if high >= last:
            return None
        low, high = high, min(high + PIECES // 2, last)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if motion(promise, state, goal, middle) is not None else (middle, high)
    return high * promise.piece


def motion(
    promise: Promise, state: AxisState, goal: AxisGoal, pieces: int, *, shortest: bool = False
) -> Array | None:
    """Find a motion to a goal in so many pieces, the one of the shortest way where that is asked for.

    Returns
    -------
    (3, pieces + 1) array or None
        Acceleration, velocity and place at the ends of all pieces; None where there is no such motion.
    """
    modes, machines = promise.poles.shape[1], len(promise.poles) - promise.exact
    moduli, still = modes * machines, modes * promise.exact
    waves, rests = _waves(promise, state, pieces)
    wide, shadows, ends = 3 * (pieces + 1), len(SHADOWS) * moduli, 2 * pieces
    total, own, mode = wide + moduli, np.arange(pieces), np.arange(moduli)
    above = [
        *((k * moduli + mode, wide + mode, -1.0) for k in range(len(SHADOWS))),
        (shadows + mode // modes, wide + mode, 1.0),
        *_differences(shadows + machines, own, 1.0),
        *_differences(shadows + machines + pieces, own, -1.0),
    ]
    shadowed = np.concatenate([(turn * waves[still:]).real for turn in SHADOWS])
    most = [
        *(-(turn * rests[still:]).real for turn in SHADOWS),
        np.ones(machines),
        np.full(ends, promise.piece * promise.limits.jerk),
    ]
    parts, past = (np.concatenate([one[:still].real, one[:still].imag]) for one in (waves, rests))
    price = np.zeros(total)
    price[wide - 1] = shortest * np.sign(state.velocity or 1.0)
    found = linprog(
        price,
        A_ub=_matrix(above, shadowed, 0, (shadows + machines + ends, total)),
        b_ub=np.concatenate(most),
        A_eq=_matrix([*_moves(own, promise.piece)], parts, ends, (ends + len(parts), total)),
        b_eq=np.concatenate([np.zeros(ends), -past]),
        bounds=[*_bounds(promise, state, goal, pieces), *[(0.0, None)] * moduli],
        method="highs-ds",
    )
    return np.asarray(found.x[:wide].reshape(3, -1)) if found.status == 0 else None


Numbers = NDArray[np.int64]
Entries = tuple[Numbers, Numbers, float]  # rows, their columns, and what stands there


def _differences(row: int, own: Numbers, sign: float) -> Iterator[Entries]:
    """Change of each value, numbered `own`, to the next one, in rows from one on."""
    yield row + own, own + 1, sign
    yield row + own, own, -sign


def _moves(own: Numbers, h: float) -> Iterator[Entries]:
    """Let velocities be the integrals of the accelerations, and places those of the velocities."""
    last, count = own + 1, len(own)
    v, x = count + 1, 2 * (count + 1)  # where these begin
    yield from ((own, own, -0.5 * h), (own, last, -0.5 * h), (own, v + own, -1.0), (own, v + last, 1.0))
    yield from ((count + own, own, -h * h / 3.0), (count + own, last, -h * h / 6.0))
    yield from ((count + own, v + own, -h), (count + own, x + own, -1.0), (count + own, x + last, 1.0))


def _matrix(entries: Sequence[Entries], dense: Array, top: int, shape: tuple[int, int]) -> csc_matrix:
    """Make a matrix of some entries and of full rows from one on, which begin in the first column."""
    rows, columns = np.indices(dense.shape)
    return csc_matrix(
        (
            np.concatenate([*(np.full(len(at), value) for at, _, value in entries), dense.ravel()]),
            (
                np.concatenate([*(at for at, *_ in entries), top + rows.ravel()]),
                np.concatenate([*(at for _, at, _ in entries), columns.ravel()]),
            ),
        ),
        shape,
    )


def _waves(promise: Promise, state: AxisState, pieces: int) -> tuple[Complex, Complex]:
    """Give each mode in the end by the accelerations, and by the past, in shares of what may be left."""
    poles, h = promise.poles.ravel(), promise.piece
    turn = poles * h
    later = (np.exp(turn) - 1.0 - turn) / (turn * poles)  # of the acceleration at a piece's end
    sooner = (np.exp(turn) - 1.0) / poles - later
    passed = np.exp(np.outer(turn, np.arange(pieces - 1, -1, -1)))
    waves = np.zeros((len(poles), pieces + 1), dtype=np.complex128)
    waves[:, :-1] += sooner[:, None] * passed
    waves[:, 1:] += later[:, None] * passed
    shares = promise.gains.ravel() / promise.left
    return shares[:, None] * waves, shares * np.exp(turn * pieces) * state.moved.ravel()


def _bounds(promise: Promise, state: AxisState, goal: AxisGoal, pieces: int) -> Iterator[tuple[float, float]]:
    """Bound accelerations, velocities and places; what is already beyond a limit may come back."""
    own, (low, high) = promise.limits, promise.travel
    speed = max(own.velocity, abs(state.velocity))
    place = ANYWHERE if goal.place is None else (goal.place, goal.place)
    yield from _column(state.acceleration, (-own.acceleration, own.acceleration), (0.0, 0.0), pieces)
    yield from _column(state.velocity, (-speed, speed), (goal.speed, goal.speed), pieces)
    yield from _column(state.place, (min(low, state.place), max(high, state.place)), place, pieces)


def _column(
    first: float, between: tuple[float, float], last: tuple[float, float], pieces: int
) -> list[tuple[float, float]]:
    return [(first, first), *[between] * (pieces - 1), last]
