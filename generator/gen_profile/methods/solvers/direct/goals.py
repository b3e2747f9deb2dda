"""What the conic programs of the direct method minimise, and keep within bounds."""

from collections.abc import Container, Iterator, Mapping, Sequence

import attrs
import numpy as np

from gen_profile.dynamics.problem.cost import SwayCost, axis_reach
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.dynamics.problem.overshoot import beyond
from gen_profile.dynamics.problem.pontryagin import SNAP_TIME
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.direct.bezier import Piece, gram
from gen_profile.methods.solvers.direct.condensing import IntervalMaps
from gen_profile.methods.solvers.direct.conic import ConicProgram, Entries, place, squares
from gen_profile.methods.solvers.direct.transcription import Iterate, Transcription
from gen_profile.motion.profile import Array
from gen_profile.spec.passed_target import BoundedTarget
from gen_profile.support.one_thread import one_thread

WITHIN = 1.0 - 1e-6  # fraction of a limit that a program may use: its own tolerance must not break the limit

HELD = 3e-7  # cost of changing the highest derivative by as much as it is usually
USUAL_ACCELERATION, USUAL_JERK = 25.0, 1e3  # halves of squares, dimensionless; a quintic's are 9 and 360
DERIVATIVES = {1: "velocity", 2: "acceleration", 3: "jerk", 0: "travel"}  # of the position, that have limits


def effort_form(problem: Problem, piece: Piece) -> Array:
    """Write twice the effort of an axis as a quadratic form, for an axis measured by its own reach.

    In units of reach² / duration⁶, shape (intervals, size, size).
    """

    def square(rows: Array) -> Array:
        whole = rows.swapaxes(-1, -2) @ gram(rows.shape[-2] - 1) @ rows
        return np.asarray(whole * piece.length[..., None, None])

    if problem.effort == "snap":
        return square(piece.derivative(3)) + (SNAP_TIME / problem.duration) ** 2 * square(piece.derivative(4))
    if problem.effort == "reference":
        # ÿ_ref = ÿ + τ y⃛, and ÿ counts as jerk times duration
        return square(piece.leading(2, (problem.tau or 0.0) / problem.duration)) * problem.duration**2
    return square(piece.derivative(3))


def usual_effort(problem: Problem) -> float:
    """About the effort of a motion within limits, in the units of `effort_form`: more than a quintic's.

    Programs end when their cost is right to an absolute tolerance, or a relative one, so it must be about 1.
    """
    if problem.effort == "reference":
        return USUAL_ACCELERATION * problem.duration**2 + USUAL_JERK * (problem.tau or 0.0) ** 2
    return USUAL_JERK


def cost(
    transcription: Transcription, effort: Entries, sway_cost: SwayCost, iterate: Iterate, maps: IntervalMaps
) -> tuple[Entries, Array]:
    """Expand eq. (26) about an iterate to second order: P and q of ``½ xᵀ P x + qᵀ x``.

    Parameters
    ----------
    effort : Entries
        Twice the effort as a quadratic form, dimensionless.
    sway_cost : SwayCost
        Divided by the cost's scale.
    """
    quadratic, linear = effort, np.zeros(transcription.variables, dtype=np.float64)
    if sway_cost.beta > 0.0:
        sway, blocks, offset = transcription.end_sway(iterate, maps)
        weights = transcription.quadrature()
        slope, curvature = sway_cost.derivatives(sway)
        slope, curvature = weights[:, None] * slope, weights[:, None, None] * curvature
        slope = slope + np.einsum("pab,pb->pa", curvature, offset.reshape(sway.shape) - sway)
        intervals, _, width = blocks.shape
        by_point = blocks.reshape(*sway.shape, width)
        curved = np.einsum("pab,pbx->pax", curvature, by_point).reshape(blocks.shape)
        with one_thread:
            quadratic = quadratic + squares(blocks.swapaxes(1, 2) @ curved, transcription.coupled)
        pulls = np.einsum("kax,ka->kx", blocks, slope.reshape(intervals, -1))
        summed = np.bincount(transcription.coupled.ravel(), pulls.ravel(), transcription.variables)
        linear = summed.astype(np.float64)
    return quadratic, linear


def held(
    quadratic: Entries, linear: Array, transcription: Transcription, iterate: Iterate
) -> tuple[Entries, Array]:
    """Let it cost a little to leave the last motion's highest derivative.

    An effort that sees lower derivatives only leaves programs nearly singular. With this proximal term they
    are not, and end at the same motion (R. T. Rockafellar, Monotone operators and the proximal point
    algorithm, 1976).
    """
    piece, columns = transcription.piece, transcription.intervals * transcription.breadth
    sizes = transcription.units[:columns].reshape(-1, piece.size)
    weights = np.where(np.arange(piece.size) < piece.order, 0.0, HELD / sizes**2).ravel()
    padding = (0, len(linear) - columns)
    diagonal = np.arange(columns)
    whole = Entries(rows=diagonal, columns=diagonal, values=weights)
    return quadratic + whole, linear - np.pad(weights * iterate.local.ravel(), padding)


@attrs.frozen(kw_only=True, eq=False)
class AxisLimit:
    """Bounds of what Bézier coefficients say of one axis.

    Attributes
    ----------
    place : str
        In the spec, such as ``limits.jerk``.
    axis : int
    rows : (intervals, coefficients, size) array
        From the local coordinates.
    low, high : float
        Dimensionless.
    give : float
        By how much either is widened for every time that the limit is, beyond the first.
    """

    place: str
    axis: int
    rows: Array
    low: float
    high: float
    give: float


def axis_limits(problem: Problem, transcription: Transcription) -> Iterator[AxisLimit]:
    """List the limits of every axis' command, and of its travel."""
    duration = problem.duration
    lag = (problem.tau or 0.0) / duration
    for axis, reach in enumerate(axis_reach(problem)):
        limits = problem.limits.of(axis)
        for order, name in DERIVATIVES.items():
            limit = getattr(limits, name)
            if limit is None:
                continue
            if order == 0:
                low, high = ((edge - problem.start[axis]) / reach for edge in limit)
                give = high - low
            else:
                give = high = WITHIN * limit * duration**order / reach
                low = -high
            rows = transcription.piece.leading(order, lag)
            place = problem.limits.place(axis, name)
            yield AxisLimit(place=place, axis=axis, rows=rows, low=low, high=high, give=give)


def keep_limits(
    program: ConicProgram, problem: Problem, transcription: Transcription, widened: Container[str] = ()
) -> None:
    """Bound the command of every axis, and its travel, at every instant.

    Parameters
    ----------
    widened : container of str
        Places of limits that the program's last variable widens so many times, such as ``limits.jerk``;
        travel at either end by so many times its width, less one.
    """
    for limit in axis_limits(problem, transcription) if problem.limits.stated() else ():
        give = limit.give if limit.place in widened else 0.0
        transcription.bound(program, limit.rows, (limit.low, limit.high), limit.axis, give)


def keep_sway(
    program: ConicProgram,
    transcription: Transcription,
    limit: float,
    iterate: Iterate,
    maps: IntervalMaps,
    *,
    widened: bool = False,
) -> None:
    """Bound the end load's sway of the nominal machine at the collocation points.

    Parameters
    ----------
    limit : float
        m.
    widened : bool
        Whether the program's last variable widens it so many times.
    """
    sway, blocks, offset = transcription.end_sway(iterate, maps)
    points, directions = sway.shape
    give, matrix = float(widened), transcription.of_coupled(blocks / limit)
    if directions == 1:
        program.at_most(matrix, 1.0 - offset / limit, give)
        program.at_most(-matrix, 1.0 + offset / limit, give)
        return
    below = matrix.rows + matrix.rows // directions + 1  # the first row of each cone is empty
    sides = np.column_stack([np.ones(points), offset.reshape(points, directions) / limit])
    program.within_cones(attrs.evolve(-matrix, rows=below), sides, give)


def passed(transcription: Transcription, iterate: Iterate, problem: Problem) -> Array:
    """Tell how far in m the end load is past its targets at the collocation points, (targets, points)."""
    sway, axes = transcription.end_sway_found(iterate), transcription.axes(iterate.local)
    return beyond(problem.targets, axes.reshape(len(sway), -1), sway)


def keep_behind(
    program: ConicProgram,
    targets: Sequence[BoundedTarget],
    transcription: Transcription,
    iterate: Iterate,
    maps: IntervalMaps,
    *,
    limit: float,
    widened: bool = False,
) -> None:
    """Bound how far the nominal machine's end load passes its targets at the collocation points.

    Parameters
    ----------
    limit : float
        m.
    widened : bool
        Whether the program's last variable widens it, by the way for every time beyond the first.
    """
    sway, blocks, offset = transcription.end_sway(iterate, maps)
    directions, axes = sway.shape[1], transcription.axes
    for target in targets:
        axis, component = target.direction.axis, target.direction.component
        rows = -blocks[:, component::directions]
        rows[:, :, : transcription.breadth] += axes.matrix[:, :, axis]
        behind = np.tile(target.at - axes.offset[:, axis], transcription.intervals)
        sides = limit / abs(target.way) + (behind + offset[component::directions]) / target.way
        program.at_most(transcription.of_coupled(rows / target.way), sides, float(widened))


@attrs.frozen(kw_only=True, eq=False)
class Amplitudes:
    """How the modes of a machine show in its loads, in fractions of the loads' limits.

    Attributes
    ----------
    rows : (modes, 2, n) array
        From the dimensionless state at the end to the two quadratures of every mode.
    fractions : (loads, modes) array
        What the unit amplitude of a mode takes of the limit of a load.
    """

    rows: Array
    fractions: Array


def amplitudes(
    problem: Problem, parameters: Mapping[str, float], load_limits: Sequence[float], scale: Array
) -> Amplitudes:
    """Linearise a machine about its rest at the target."""
    linear = linearize(problem.plant, parameters, problem.target)
    n_u = len(linear.frequencies)
    inverse = np.linalg.inv(linear.modes)
    gains = np.abs(linear.sway_gain @ linear.modes) / np.asarray(load_limits)[:, None]
    greatest = gains.max(axis=0)
    rows = np.zeros((n_u, 2, 2 * n_u))
    rows[:, 0, :n_u] = greatest[:, None] * inverse
    rows[:, 1, n_u:] = (greatest / linear.frequencies)[:, None] * inverse
    return Amplitudes(rows=rows * scale[: 2 * n_u], fractions=gains / greatest)


def bound_worst(
    program: ConicProgram,
    transcription: Transcription,
    tried: Sequence[Amplitudes],
    maps: Sequence[IntervalMaps],
    most: float | None = None,
) -> None:
    """Bound what every load of every machine can swing to by one variable.

    The program must have been posed with `worst_case_variables` extra ones, the first of its goal's.

    Parameters
    ----------
    most : float, optional
        Bound of that variable itself: the worst fraction of a limit.
    """
    column = transcription.variables
    worst = column + worst_case_variables(tried) - 1
    for index, machine in enumerate(tried):
        block, first, offset = transcription.end_state(index, maps)
        modes = np.arange(column, column + len(machine.rows))
        for mode, rows in zip(modes, machine.rows, strict=True):
            radius = place(-np.ones((1, 1, 1)), np.array([mode]))
            sides = np.append(0.0, rows @ offset)
            with one_thread:
                ends = place(-(rows @ block)[None], first)
            program.within_cones(radius + ends.below(1), sides[None])
        sums = place(machine.fractions[None], modes[:1])
        all_fractions = place(-np.ones((1, len(machine.fractions), 1)), np.array([worst]))
        program.at_most(sums + all_fractions, np.zeros(len(machine.fractions)))
        column += len(modes)
    if most is not None:
        program.at_most(place(np.ones((1, 1, 1)), np.array([worst])), np.array([most]))


def worst_case_variables(tried: Sequence[Amplitudes]) -> int:
    """Count the extra variables that `bound_worst` needs."""
    return sum(len(machine.rows) for machine in tried) + 1
