"""The quickest motion of an axis that keeps a promise, by linear programmes.

The acceleration is linear over pieces of equal length. In the end the machine as given hangs still, whatever
was before; and each machine of the stated errors keeps its bound, the past included: its modes s of
`SwayModes` are linear in the accelerations, and a modulus is bounded by its shadows in some directions, which
allows a little more. So nothing that is possible is missed but for the length of the pieces.
"""

from __future__ import annotations

from collections.abc import Iterator

import attrs
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_matrix, eye, hstack, kron, vstack

from gen_profile.methods.quickest.axis_alone import AxisLimits, to_place, to_velocity
from gen_profile.methods.quickest.modes import Complex
from gen_profile.motion.profile import Array

PIECES = 24  # of the slowest period: the time is known to 4 % of it
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

    @property
    def piece(self) -> float:
        """Length of a piece in s."""
        return float(2.0 * np.pi / self.poles[0].imag.min() / PIECES)


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
    low = int(alone(promise.limits, state, goal) / promise.piece)
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
    now, then = eye(pieces, pieces + 1, k=1), eye(pieces, pieces + 1)
    h, wide = promise.piece, 2 * (pieces + 1)
    moves = [
        [-0.5 * h * (now + then), now - then, 0.0 * now],
        [-(h * h / 6.0) * (now + 2.0 * then), -h * then, now - then],
    ]
    equal = [
        *(hstack([*row, csr_matrix((pieces, moduli))]) for row in moves),
        *(_row(part, wide + moduli) for part in _parts(waves[:still])),
    ]
    shadows = [_row((turn * waves[still:]).real, wide, -np.eye(moduli)) for turn in SHADOWS]
    sums = hstack([csr_matrix((machines, 3 * (pieces + 1))), kron(eye(machines), np.ones((1, modes)))])
    jerks = hstack([now - then, csr_matrix((pieces, wide + moduli))])
    above = [
        *(-(turn * rests[still:]).real for turn in SHADOWS),
        np.ones(machines),
        np.full(2 * pieces, h * promise.limits.jerk),
    ]
    price = np.zeros(wide + pieces + 1 + moduli)
    price[wide + pieces] = shortest * np.sign(state.velocity or 1.0)
    found = linprog(
        price,
        A_ub=vstack([*shadows, sums, jerks, -jerks]).tocsr(),
        b_ub=np.concatenate(above),
        A_eq=vstack(equal).tocsr(),
        b_eq=np.concatenate([np.zeros(2 * pieces), *(-part for part in _parts(rests[:still]))]),
        bounds=[*_bounds(promise, state, goal, pieces), *[(0.0, None)] * moduli],
        method="highs-ds",
    )
    return np.asarray(found.x[: wide + pieces + 1].reshape(3, -1)) if found.status == 0 else None


def _row(own: Array, others: int, last: Array | None = None) -> csr_matrix:
    """Make rows of what belongs to the accelerations, of noughts, and of what comes last."""
    return hstack([csr_matrix(own), csr_matrix((len(own), others)), *([] if last is None else [last])])


def _parts(numbers: Complex) -> tuple[Array, Array]:
    return numbers.real, numbers.imag


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
