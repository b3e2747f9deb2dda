"""Many machines integrated at once by Gauss collocation: all nodes of all steps in one call.

Over a step the accelerations are a polynomial through Gauss's nodes, which is integrated twice exactly. Those
of all steps are found by one Newton iteration with the stiffness and damping of the machines at rest, which
small swings need some six times; where large ones need more, the steps that are settled are kept, and the
others begun anew. (E. Hairer, S. Nørsett, G. Wanner, Solving ordinary differential equations I, II.7.)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import attrs
import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.support.errors import CosimulationError

NODES = 12
PHASE, ACCURACY = 4.0, 1e-6  # rad of a machine's fastest mode that a step covers at first, for an accuracy
WIDEST, MOST = 64, 2048  # steps that are solved at once, and coordinates of all machines in them
MOST_ITERATIONS = 12  # after which the first step is halved, if not even that one is settled
SHORTEST = 1e-9  # of the whole time: a step that must be shorter fails
TAIL = 2  # highest coefficients of a step's polynomial, which tell how well it converges
TRUNCATION = 0.1  # of them, that the coefficients which the polynomial lacks come to at most
CONVERGED = 0.03  # of the allowed error, that one more iteration would change at the pace of the last two

Accelerations = Callable[[Array], Callable[[Array, Array], Array]]
Linear = Callable[[float], tuple[Array, Array]]


def _integrals(order: int) -> Array:
    """Matrix that integrates Legendre coefficients over [0, 1] from 0, shape (order + 1, order)."""
    return np.stack([0.5 * legendre.legint(unit, lbnd=-1) for unit in np.eye(order)], axis=1)


_POINTS = legendre.leggauss(NODES)[0]
TIMES: Array = 0.5 * (_POINTS + 1.0)  # of the nodes, in steps
_TO_COEFFICIENTS = np.linalg.inv(legendre.legvander(_POINTS, NODES - 1))
_ONCE = _integrals(NODES) @ _TO_COEFFICIENTS  # accelerations → coefficients of the velocity
_TWICE = _integrals(NODES + 1) @ _ONCE  # accelerations → coefficients of the position
# accelerations → velocities at the nodes
_VELOCITY = np.asarray(legendre.legvander(_POINTS, NODES) @ _ONCE, dtype=np.float64)
_POSITION: Array = legendre.legvander(_POINTS, NODES + 1) @ _TWICE
_ENDS: Array = np.stack([_TWICE.sum(axis=0), _ONCE.sum(axis=0)])  # accelerations → position, velocity at 1


@attrs.frozen(kw_only=True, eq=False)
class Trajectories:
    """Positions and velocities of many coordinates as polynomials of each step.

    Attributes
    ----------
    knots : (steps + 1,) array
        s, rising.
    position, velocity : (steps, powers, coordinates) arrays
        Legendre coefficients over each step.
    """

    knots: Array
    position: Array
    velocity: Array

    def __call__(self, times: Array) -> Array:
        """Evaluate at rising times in s, shape (2, times, coordinates): positions and velocities."""
        return self._evaluated(times, (self.position, self.velocity))

    def positions(self, times: Array) -> Array:
        """Evaluate positions at rising times in s, shape (times, coordinates)."""
        (rows,) = self._evaluated(times, (self.position,))
        return np.asarray(rows)

    def _evaluated(self, times: Array, polynomials: Sequence[Array]) -> Array:
        """Evaluate polynomials at rising times, shape (polynomials, times, coordinates)."""
        values = np.empty((len(polynomials), len(times), self.position.shape[-1]))
        step = np.clip(np.searchsorted(self.knots, times, side="right") - 1, 0, len(self.knots) - 2)
        begin, end = self.knots[step], self.knots[step + 1]
        powers = legendre.legvander(2.0 * (times - begin) / (end - begin) - 1.0, NODES + 1)
        edges = np.searchsorted(step, np.arange(len(self.knots)))
        for rows, coefficients in zip(values, polynomials, strict=True):
            taken = powers[:, : coefficients.shape[1]]
            for own, (first, last) in zip(coefficients, pairwise(edges.tolist()), strict=True):
                np.matmul(taken[first:last], own, out=rows[first:last])
        return values


def integrate(
    accelerations: Accelerations,
    linear: Linear,
    start: Array,
    stretches: Array,
    *,
    fastest: float,
    accuracy: float,
    least: float,
    what: str,
) -> Trajectories:
    """Integrate from time to time, in steps that are halved until they are accurate.

    Parameters
    ----------
    accelerations : (nodes,) array → two (nodes, machines n_u) arrays → (nodes, machines n_u) array
        Of times in s, then of coordinates and their rates at these.
    linear : float → two (machines, n_u, n_u) arrays
        Stiffness in 1/s² and damping in 1/s of every machine at rest, at a time in s.
    start : (2, machines n_u) array
        Coordinates and rates at the first time.
    stretches : (k,) array
        Rising times in s between which everything is smooth.
    fastest : float
        Greatest rate of change of any machine in 1/s.
    accuracy, least : float
        Error of a step that is allowed, relative to the coordinates and at least.
    what : str
        For errors.

    Raises
    ------
    CosimulationError
        It fails, as when a load is thrown over.
    """
    window = _Window(accelerations, linear, accuracy, least)
    phase = PHASE * (accuracy / ACCURACY) ** (1.0 / NODES)
    waiting = [
        pair
        for first, last in pairwise(stretches.tolist())
        for pair in pairwise(np.linspace(first, last, 2 + int((last - first) * fastest / phase)).tolist())
    ]
    waiting.reverse()
    shortest = SHORTEST * float(stretches[-1] - stretches[0])
    widest = max(min(WIDEST, MOST // start.shape[1]), 1)
    knots, pieces, state, width = [float(stretches[0])], [], start, widest
    while waiting:
        tried = waiting[-width:][::-1]
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is halved
            accepted, fine = window.take(np.array(tried), state)
        del waiting[-len(fine) :]
        for (begin, end), well in reversed(list(zip(tried, fine.tolist(), strict=False))[len(accepted) :]):
            middle = 0.5 * (begin + end)
            waiting += [(begin, end)] if well else [(middle, end), (begin, middle)]
        if accepted:
            pieces += accepted
            knots += [end for _, end in tried[: len(accepted)]]
            # Legendre's end at 1
            state = np.array([coefficients.sum(axis=0) for coefficients in accepted[-1]])
        elif end - begin < shortest:
            raise CosimulationError(f"The {what} cannot be integrated beyond {begin:.4g} s.")
        width = min(2 * len(fine) + 1, widest)
    position, velocity = map(np.array, zip(*pieces, strict=True))
    return Trajectories(knots=np.array(knots), position=position, velocity=velocity)


@attrs.frozen(eq=False)
class _Newton:
    """Newton's matrices of a step, one per machine; a state is coordinates, then rates, at its begin.

    Attributes
    ----------
    inverse : (machines, NODES n_u, NODES n_u) array
        Of I + h² A² K + h A C.
    given : (machines, NODES n_u, 2 n_u) array
        What a state adds to the restoring acceleration at the nodes.
    end : (machines, 2 n_u, NODES n_u) array
        What accelerations add to the state at the end.
    onward : (machines, 2 n_u, 2 n_u) array
        What a state at the begin makes of the state at the end.
    """

    inverse: Array
    given: Array
    end: Array
    onward: Array

    @classmethod
    def of(cls, length: float, stiffness: Array, damping: Array) -> _Newton:
        """Work them out for a step's length in s, and (machines, n_u, n_u) terms."""
        n_u = stiffness.shape[1]
        unit = np.eye(n_u)[None]

        def spread(nodes: Array, terms: Array) -> Array:
            joined = nodes[:, None, :, None] * terms[:, None, :, None, :]
            return joined.reshape(len(terms), len(nodes) * n_u, -1)

        matrix = spread(length**2 * _POSITION, stiffness) + spread(length * _VELOCITY, damping)
        inverse = np.asarray(np.linalg.inv(np.eye(NODES * n_u) + matrix), dtype=np.float64)
        ones, times = np.ones((NODES, 1)), length * TIMES[:, None]
        given = np.concatenate(
            [spread(ones, stiffness), spread(times, stiffness) + spread(ones, damping)], axis=2
        )
        end = spread(np.array([[length**2], [length]]) * _ENDS, unit) @ inverse
        unforced = spread(np.array([[1.0, length], [0.0, 1.0]]), unit)
        return cls(inverse, given, end, unforced - end @ given)


_Group = tuple[slice | list[int], _Newton]  # numbers of steps, and what they share


class _Window:
    """Steps one after the other, solved all at once; what a Newton step needs is kept for others like it."""

    def __init__(self, accelerations: Accelerations, linear: Linear, accuracy: float, least: float) -> None:
        self._accelerations, self._linear = accelerations, linear
        self._accuracy, self._least = accuracy, least
        self._known: dict[bytes, _Newton] = {}

    def take(self, steps: Array, start: Array) -> tuple[list[tuple[Array, Array]], NDArray[np.bool_]]:
        """Find the coefficients of coordinates and rates, each (powers, machines n_u), of the first steps.

        Of steps (k, 2) from begin to end in s, those are returned before the first one that is too long; and
        of those that are settled, at least one, whether they are short enough.
        """
        length = np.diff(steps, axis=1)[:, 0]
        groups = self._grouped(steps, length)
        accelerations = self._accelerations((steps[:, 0] + np.multiply.outer(TIMES, length)).ravel())
        a = np.zeros((NODES, len(steps), start.shape[1]))
        h, nodes = length[:, None], TIMES[:, None, None]
        done, before = 0, np.zeros(len(steps))
        for _ in range(MOST_ITERATIONS):
            q, v = _states(a, h, start)
            at = (q + nodes * h * v + h**2 * _along(_POSITION, a), v + h * _along(_VELOCITY, a))
            computed = accelerations(*(part.reshape(NODES * len(steps), -1) for part in at)).reshape(a.shape)
            change = _solved(computed - a, groups)
            a += change
            allowed = self._least + self._accuracy * np.abs(at[0]).max(axis=(0, 2))
            moved = length**2 * np.abs(change).max(axis=(0, 2))
            done = _leading(moved**2 <= CONVERGED * allowed * np.maximum(before, moved))
            before = moved
            if done == len(steps):
                break
        q, v = _states(a, h, start)
        position, velocity = h**2 * _along(_TWICE, a), h * _along(_ONCE, a)
        fine = TRUNCATION * np.abs(position[-TAIL:]).max(axis=(0, 2)) <= allowed
        position[0] += q + 0.5 * h * v
        position[1] += 0.5 * h * v
        velocity[0] += v
        fine = fine[:done] if done else np.array([False])
        return [(position[:, step], velocity[:, step]) for step in range(_leading(fine))], fine

    def _grouped(self, steps: Array, length: Array) -> list[_Group]:
        """Gather the steps that share their Newton matrices."""
        gathered: dict[bytes, list[int]] = {}
        terms: tuple[Array, ...] = ()
        rounded = length.astype(np.float32)  # lengths of one stretch differ by rounding
        for step, (middle, short) in enumerate(zip(steps.mean(axis=1).tolist(), rounded, strict=True)):
            if (terms_here := self._linear(middle)) is not terms:
                terms, terms_key = terms_here, b"".join(term.tobytes() for term in terms_here)
            key = short.tobytes() + terms_key
            gathered.setdefault(key, []).append(step)
            if key not in self._known:
                self._known[key] = _Newton.of(float(short), *terms_here)
        self._known = {key: self._known[key] for key in gathered}
        return [(_numbered(steps_alike), self._known[key]) for key, steps_alike in gathered.items()]


def _along(matrix: Array, values: Array) -> Array:
    """Apply a matrix along the first axis."""
    return np.asarray((matrix @ values.reshape(len(values), -1)).reshape(-1, *values.shape[1:]))


def _states(a: Array, h: Array, start: Array) -> tuple[Array, Array]:
    """Coordinates and rates at the begin of every step, each of shape (steps, machines n_u)."""
    twice, once = _along(_ENDS, a)
    v = np.cumsum(np.concatenate([start[1:], h * once]), axis=0)[:-1]
    q = np.cumsum(np.concatenate([start[:1], h * v + h**2 * twice]), axis=0)[:-1]
    return q, v


def _numbered(steps: list[int]) -> slice | list[int]:
    """Write numbers as a range where they are one, which copies nothing."""
    return slice(steps[0], steps[-1] + 1) if steps[-1] - steps[0] == len(steps) - 1 else steps


def _solved(residual: Array, groups: list[_Group]) -> Array:
    """Solve for the change of accelerations, (NODES, steps, machines n_u) as what they lack."""
    nodes, steps, width = residual.shape
    machines = len(groups[0][1].inverse)
    lacking = residual.reshape(nodes, steps, machines, -1).transpose(2, 0, 3, 1).reshape(machines, -1, steps)
    ends = np.empty((steps, machines, 2 * width // machines, 1))
    onward = np.empty((steps, *groups[0][1].onward.shape))
    for numbers, newton in groups:
        ends[numbers, :, :, 0] = (newton.end @ lacking[:, :, numbers]).transpose(2, 0, 1)
        onward[numbers] = newton.onward
    states = np.zeros_like(ends)
    for move, begin, added, end in zip(onward, states, ends, states[1:], strict=False):
        np.add(move @ begin, added, out=end)
    begun = states[..., 0].transpose(1, 2, 0)
    for numbers, newton in groups:
        lacking[:, :, numbers] = newton.inverse @ (
            lacking[:, :, numbers] - newton.given @ begun[:, :, numbers]
        )
    solved = lacking.reshape(machines, nodes, -1, steps).transpose(1, 3, 0, 2)
    return np.ascontiguousarray(solved).reshape(residual.shape)


def _leading(sound: NDArray[np.bool_]) -> int:
    """Count the first ones that are all sound."""
    return int(np.argmin(np.append(sound, False)))
