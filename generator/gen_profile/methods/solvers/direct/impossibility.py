"""Proof that no motion keeps a problem's limits, where there is one.

A linear machine comes to rest at its target only if ``∫ K(T − t) u(t) dt = b`` for its axes' lowest limited
derivatives u. Of any such motion, within limits s times as wide, means weighted by hats (linear B-splines)
keep the limit of u, differences of neighbouring ones the limit of the next derivative, and so on. A linear
program finds the least s for which such means meet the conditions if K is interpolated between the middles
of the hats, Kₕ. Its multipliers λ, with λᵀ b = s*, bound all motions::

    λᵀ b = ∫ λᵀ Kₕ u dt + ∫ λᵀ (K − Kₕ) u dt ≤ s + δ s,    s ≥ s* / (1 + δ)

(weak duality; D. G. Luenberger, Optimization by vector space methods, 1969, chapter 5). Limits of travel,
sway and overshoot are left out, which only lowers the bound. An axis by itself is linear whatever hangs on
it.
"""

import math
from collections.abc import Sequence

import attrs
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.direct.conic import ConicProgram, ConicStatus, Entries, place
from gen_profile.methods.solvers.direct.set_up import set_up
from gen_profile.motion.profile import Array
from gen_profile.support.one_thread import one_thread
from gen_profile.support.units import RATES

# shares of the limits of u and its derivatives that hats at a motion's ends can see: sums of Eulerian numbers
AT_ENDS = (1 / 2,), (1 / 6, 5 / 6), (1 / 24, 12 / 24, 23 / 24)
CELLS = 200  # of time; δ is about (periods / CELLS)²
FARTHEST = 0.5  # rad, beyond which a linear model tells too little
NOTICED = 1e-4  # by which limits must be too narrow
UNFELT = 1e-9  # of a dimensionless state, by which an axis without limits changes what is to be zero
PROBED = 0.3  # of a state's usual size, at which it is tried whether equations are linear
SLIGHTLY = 1e-6  # likewise, at which angles are


@attrs.frozen(kw_only=True, eq=False)
class DrivenMachine:
    """A machine at rest, dimensionless: ``y' = A y + B q̈_a``, from `start` to ``end y = 0``.

    Attributes
    ----------
    A, B : (n, n) and (n, m) arrays
    start : (n,) array
    end : (conditions, n) array
    angles : (angles, n) array
        Of its ropes, in rad; none where equations are linear however far it swings.
    """

    A: Array
    B: Array
    start: Array
    end: Array
    angles: Array


@attrs.frozen(kw_only=True, eq=False)
class _Axis:
    """An axis that drives a machine by a derivative u of its position.

    Attributes
    ----------
    column : int
    order : int
        Of u.
    limits : (orders,) array
        Of u and its derivatives; infinite where there is none.
    gains : (n + order, CELLS + 1) array
        Final states, and lower derivatives of the axis, by an impulse of u at the edge of every cell.
    """

    column: int
    order: int
    limits: Array
    gains: Array


def impossible(problem: Problem) -> bool:
    """Tell whether a bound proves that no motion keeps the limits; where loads swing, to second order.

    An angle θ makes a pendulum's period longer by up to θ² / 16, and its axis' effect weaker by θ² / 2. So
    much more time and room the linear machine is given, for the greatest θ to which any motion within the
    limits can swing it.
    """
    with one_thread:
        if least_widening(problem, nothing(len(problem.target))) > 1.0 + NOTICED:
            return True
        machine = linear_machine(problem)
        swings = math.inf if machine is None else _greatest_angle(problem, machine)
        if machine is None or swings > FARTHEST:
            return False
        longer = attrs.evolve(problem, duration=problem.duration * (1.0 + swings**2 / 16.0))
        return least_widening(longer, machine) > 1.0 + NOTICED + swings**2 / 2.0


def least_widening(problem: Problem, machine: DrivenMachine) -> float:
    """Bound from below how many times as wide limits must be for a machine; 0 where nothing is known."""
    axes, n = _axes(problem, machine), len(machine.A)
    if not axes or any(problem.final_velocity):
        return 0.0
    kept = _unmoved_by_others(problem, machine, axes)
    swung = -machine.end[kept] @ expm(machine.A * problem.duration) @ machine.start
    sides, rows = [swung], [np.hstack([machine.end[kept] @ axis.gains[:n] for axis in axes])]
    for index, axis in enumerate(axes):
        own = np.zeros((axis.order, len(axes), CELLS + 1))
        own[:, index] = axis.gains[n:]
        rows.append(own.reshape(axis.order, -1))
        sides.append(problem.distance[axis.column] * np.eye(axis.order)[0])
    gains, step = np.concatenate(rows), problem.duration / CELLS
    units = np.repeat([axis.limits[0] for axis in axes], CELLS + 1)
    sizes = np.maximum(step * np.abs(gains * units).sum(axis=1), np.finfo(np.float64).tiny)[:, None]
    program = ConicProgram(np.ones(len(units) + 1))
    meeting = place((step * gains * units / sizes)[None], np.zeros(1, dtype=np.intp))
    program.equal(meeting, np.concatenate(sides) / sizes[:, 0])
    for index, axis in enumerate(axes):
        for order, limit in enumerate(axis.limits):
            at_rest = np.pad(np.eye(CELLS + 1), ((order, order), (0, 0)))  # before and after
            differences = np.diff(at_rest, order, axis=0) * axis.limits[0] / (limit * step**order)
            for end, share in enumerate(AT_ENDS[order]):
                differences[[end, -1 - end]] /= share
            where, columns = np.nonzero(differences)
            entries = Entries(
                rows=where, columns=columns + index * (CELLS + 1), values=differences[where, columns]
            )
            for one in (entries, -entries) if limit < math.inf else ():
                program.at_most(one, np.ones(len(differences)), 1.0)
    none, wider = np.zeros(0, dtype=np.intp), np.zeros(program.variables)
    wider[-1] = 1.0
    solution = program.solve(Entries(rows=none, columns=none, values=np.zeros(0)), wider)
    if solution.verdict is not ConicStatus.SOLVED:
        return 0.0
    weighed = (solution.multipliers[0] @ (gains * units / sizes)).reshape(len(axes), -1)
    curvature = np.abs(np.diff(weighed, 2, axis=1)).sum()
    return float(solution.x[-1]) / (1.0 + float(curvature) * step / 12.0)


def linear_machine(problem: Problem) -> DrivenMachine | None:
    """Linearise the nominal machine at rest; None where it changes with its axes' places, or a drive lags."""
    if problem.tau is not None:
        return None
    setup, _ = set_up(problem)
    machine, m = setup.transcription.machines[0], len(problem.target)
    n = len(machine.scale)
    places = np.zeros((3, 3 * m))
    places[:, :m] = np.array([problem.target, problem.start, problem.start])
    places[2, :m] += PROBED * np.maximum(np.abs(problem.distance), 1.0)

    def derivatives(states: Array) -> Array:
        values = machine.equations.rate(states, places, machine.parameters)[:, :, 1:]
        values[:, :, :n] *= machine.scale
        return np.asarray(values / machine.scale[:, None])

    at_rest, swinging = derivatives(np.zeros((3, n))), derivatives(np.tile(PROBED * machine.scale, (3, 1)))
    if not np.allclose(at_rest, at_rest[0]) or at_rest[0, :, n : n + 2 * m].any():
        return None
    angles = np.zeros((0, n))
    if not np.allclose(swinging, at_rest[0]):
        states, still = SLIGHTLY * np.diag(machine.scale), np.repeat(places[:1], n, axis=0)
        angles = machine.equations.angle(states, still, machine.parameters)[:, :, 0].T / SLIGHTLY
        if not angles.any():  # which says nothing of how far it is from linear
            return None
    return DrivenMachine(
        A=at_rest[0, :, :n],
        B=at_rest[0, :, n + 2 * m :],
        start=machine.start,
        end=machine.end,
        angles=angles,
    )


def nothing(axes: int) -> DrivenMachine:
    """No load at all on axes."""
    none = np.zeros((0, 0))
    return DrivenMachine(A=none, B=np.zeros((0, axes)), start=np.zeros(0), end=none, angles=none)


def _axes(problem: Problem, machine: DrivenMachine) -> list[_Axis]:
    """List the axes whose rates are limited."""
    limited = [_rates(problem, column) for column in range(len(problem.target))]
    return [
        _driving(problem, machine, column, int(np.isfinite(limits).argmax()) + 1)
        for column, limits in enumerate(limited)
        if np.isfinite(limits).any()
    ]


def _rates(problem: Problem, column: int) -> Array:
    limits = problem.limits.of(column)
    stated = (getattr(limits, name) for name in RATES)
    return np.array([math.inf if limit is None else limit for limit in stated])


def _driving(problem: Problem, machine: DrivenMachine, column: int, order: int) -> _Axis:
    """Find what a derivative of an axis does to a machine; its velocity acts on y less B times itself."""
    n = len(machine.A)
    flow = np.zeros((n + order + 1, n + order + 1))  # states, the axis' lower derivatives, and u
    flow[:n, :n] = machine.A
    flow[n:-1, n + 1 :] = np.eye(order)
    flow[:n, n + 2 if order > 1 else -1] = machine.B[:, column]
    if order == 1:
        flow[:n, -1] = machine.A @ machine.B[:, column]
    gains, across = [flow[:-1, -1]], expm(flow[:-1, :-1] * (problem.duration / CELLS))
    for _ in range(CELLS):
        gains.append(across @ gains[-1])
    limits = _rates(problem, column)[order - 1 :]
    return _Axis(column=column, order=order, limits=limits, gains=np.array(gains[::-1]).T)


def _unmoved_by_others(problem: Problem, machine: DrivenMachine, axes: Sequence[_Axis]) -> NDArray[np.bool_]:
    """Tell which end conditions axes without limits do not change."""
    free = set(range(len(problem.target))) - {axis.column for axis in axes}
    moved = [_driving(problem, machine, column, 2).gains[: len(machine.A)] for column in free]
    changes = [np.abs(machine.end @ each).max(axis=1, initial=0.0) for each in moved]
    return np.asarray(np.max([np.zeros(len(machine.end)), *changes], axis=0) <= UNFELT)


def _greatest_angle(problem: Problem, machine: DrivenMachine) -> float:
    """Bound in rad how far any motion within the limits can swing a linear machine."""
    if not len(machine.angles):
        return 0.0
    step, states = problem.duration / CELLS, [machine.start]
    across = expm(machine.A * step)
    for _ in range(CELLS):
        states.append(across @ states[-1])
    greatest = np.abs(machine.angles @ np.array(states).T).max(axis=1)
    for column in range(len(problem.target)):
        by_limit = [np.full(len(greatest), math.inf)]
        for order, limit in enumerate(_rates(problem, column), start=1):
            if limit < math.inf:
                impulses = _driving(problem, machine, column, order).gains[: len(machine.A)]
                by_limit.append(limit * step * np.abs(machine.angles @ impulses).sum(axis=1))
        greatest = greatest + np.min(by_limit, axis=0)
    return float(greatest.max())
