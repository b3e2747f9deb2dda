"""A problem's boundary value problem in dimensionless, modal coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import attrs
import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import NDArray

from gen_profile.dynamics.problem.cost import SwayCost, axis_reach, effort_weights
from gen_profile.dynamics.problem.initial_state import initial_state
from gen_profile.dynamics.problem.linearization import Linearization, linearize
from gen_profile.dynamics.problem.pontryagin import OptimalitySystem, RuntimeParameters, StateLayout
from gen_profile.dynamics.problem.problem import AUTO_EFFORT, AUTO_SWAY, Problem
from gen_profile.dynamics.problem.reachability import independent_states
from gen_profile.methods.solvers.collocation import Scheme, Trajectory, newton_step, sampled
from gen_profile.motion.metrics import peak
from gen_profile.motion.profile import Array

# Shares of a state's response outside the span of the others', below which its end condition is implied.
# What a sensitivity left at a thousandth of itself adds to the sway is far less than what second order does.
# Ten times or a tenth of these three led to the same motions on ten moves.
DEPENDENT = 1e-8
INSENSITIVE = 1e-3
PROMINENT = 1e-4  # sway left by a mode, as a fraction of the sway that another may leave
NEGLIGIBLE = 1e-7  # sway left by a mode, as a fraction of the move
SWAY_SAMPLES = 1001  # of the sway that γ is scaled by: n periods of a harmonic are met to (π n / 1000)² / 2
QUINTIC = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])  # from rest to rest, acceleration 0 at both ends
QUINTIC_JERK = 60.0  # with which a quintic move starts, in distances per cube of its duration


@attrs.frozen(kw_only=True)
class IndirectOptions:
    """How exactly the indirect method solves, and how far it goes; see docs/solvers.md for the evidence.

    Attributes
    ----------
    intervals : int
        Of the simplified Newton's method to begin with, at least; nine Gauss points on each.
    radians_per_interval : float
        rad of the fastest mode that matters, likewise.
    max_intervals : int
        After refinement.
    tolerance : float
        Distance of either Newton's method to the solution, relative to the motion.
    max_iterations : int
        Of either Newton's method; more only circle.
    drift_tolerance : float
        Of the Hamiltonian over an interval, relative to its size.
    defect_tolerance : float
        Of the state equations between collocation points, as a fraction of a state's size (see
        `refinement.defect`); the sway is off by its square.
    """

    intervals: int = 8
    radians_per_interval: float = 6.0
    max_intervals: int = 480
    tolerance: float = 1e-7
    max_iterations: int = 20
    drift_tolerance: float = 1e-7
    defect_tolerance: float = 3e-3


USUAL = IndirectOptions()


@attrs.frozen(kw_only=True, eq=False)
class BoundaryValueProblem:
    """A boundary value problem whose unknowns ζ are modal coordinates ξ and their costates.

    Angles, rates and sensitivities of coupled pendulums are nearly dependent on one another; the amplitudes
    of the linear model's modes are not, and make linear equations that are well conditioned.

    Attributes
    ----------
    system : OptimalitySystem
    data : RuntimeParameters
    basis : (n, n) array
        The states of `system` are ``basis @ ξ``.
    initial, final : (n,) arrays
        ξ at the start and at the end; NaN where no end condition is asked for.
    shown : (n,) array
        Sway in m, of the load that sways most, per unit of each state of `system` that is a mode's; 0 where
        the mode is too fast to be excited, and for the axes.
    phase : float
        Of the fastest mode that is excited as much as others, over the whole move in rad.
    options : IndirectOptions
    """

    system: OptimalitySystem
    data: RuntimeParameters
    basis: Array
    initial: Array
    final: Array
    shown: Array
    phase: float
    options: IndirectOptions = USUAL

    @cached_property
    def transform(self) -> Array:
        """Matrix from ζ to states and costates: canonical, so that the equations keep their form."""
        return _diagonal(self.basis, np.asarray(np.linalg.inv(self.basis)).T)

    @cached_property
    def inverse_transform(self) -> Array:
        """Matrix from states and costates to ζ."""
        return _diagonal(np.asarray(np.linalg.inv(self.basis)), self.basis.T)

    def unknowns(self, points: Array) -> Array:
        """Turn ζ into states and costates as `system` knows them, shape (points, 2 n)."""
        return points @ self.transform.T

    def flow(self, points: Array) -> Array:
        """Evaluate ζ' and beside it its Jacobian, shape (points, 2 n, 1 + 2 n).

        Raises
        ------
        numpy.linalg.LinAlgError
            When they overflow.
        """
        flow = _finite(self.system.flow(self.unknowns(points), self.data.row()))
        with np.errstate(over="ignore", invalid="ignore"):  # of an iterate that diverges
            modal = self.inverse_transform @ flow
            modal[:, :, 1:] = modal[:, :, 1:] @ self.transform
        return _finite(modal)

    def slopes(self, points: Array) -> tuple[Array, Array]:
        """Evaluate ζ' alone, and the end load's sway in m: (points, 2 n) and (points, sways).

        Raises
        ------
        numpy.linalg.LinAlgError
            When they overflow.
        """
        values = _finite(self.system.slopes(self.unknowns(points), self.data.row()))[:, :, 0]
        size = points.shape[1]
        with np.errstate(over="ignore", invalid="ignore"):
            modal = values[:, :size] @ self.inverse_transform.T
        return _finite(modal), values[:, size:]

    def linear(self, points: Array) -> tuple[Array, Array]:
        """Differentiate ξ' by ζ, and by ξ the end load's sway in m and what else costs half its square.

        Shapes (points, n, 2 n) and (points, sways + …, n).
        """
        n = len(self.final)
        linear = self.system.linear(self.unknowns(points), self.data.row()) @ self.transform
        return self.inverse_transform[:n, :n] @ linear[:, :n], linear[:, n:, :n]

    @property
    def sway_cost(self) -> SwayCost:
        """The same as `data` holds, in units of the cost's scale."""
        return SwayCost(beta=self.data.beta / self.data.cost_scale, gamma=self.data.gamma)

    def solve_linear(self, flow: Array, trajectory: Trajectory) -> Trajectory:
        """Solve the equations linearised about a trajectory, at whose points `flow` was evaluated.

        Raises
        ------
        numpy.linalg.LinAlgError
            When they have no solution.
        """
        return newton_step(flow, trajectory, self.initial, self.final)

    def quantities(self, points: Array) -> Array:
        """H, g, highest derivatives, sways and angles; see `OptimalitySystem`."""
        return self.system.quantities(self.unknowns(points), self.data.row())[:, :, 0]

    def rescaled(self, solution: Trajectory) -> tuple[BoundaryValueProblem, Trajectory]:
        """Measure every coordinate by its own greatest value, which conditions the linear equations best."""
        largest = self._greatest(solution)
        return (
            attrs.evolve(
                self,
                basis=self.basis * largest,
                initial=self.initial / largest,
                final=self.final / largest,
                shown=self.shown * largest,
            ),
            solution.scaled(np.concatenate([1.0 / largest, largest])),
        )

    @property
    def resolved(self) -> bool:
        """Whether every mode is asked to rest: none is so fast that no mesh could follow it."""
        return not np.isnan(self.final[: 2 * self.system.layout.n_u]).any()

    def weights(self, *solutions: Trajectory) -> Array:
        """Tell how much each coordinate counts, shape (n,).

        An axis' motion counts relative to its own greatest value, a mode's relative to the sway of the modes
        that sways most, as much as it shows in that.
        """
        largest = self._greatest(*solutions)
        weights = 1.0 / largest
        for states, _ in self.system.layout.kinds:
            sway = (self.shown * largest)[states].max()
            weights[states] = self.shown[states] / sway if sway > 0.0 else 0.0
        return weights

    def distance(self, one: Trajectory, other: Trajectory) -> float:
        """Root mean square difference of the coordinates at the nodes, each with its weight.

        Costates are left out: those of hardly excited modes carry rounding noise that no state feels.
        """
        difference = (other.nodes - one.nodes)[:, : len(self.final)]
        return float(np.sqrt(np.mean((self.weights(one, other) * difference) ** 2)))

    def implied_residual(self, solution: Trajectory) -> float:
        """Greatest fraction by which an end condition fails that was not asked for, as others imply it."""
        own = slice(0, 2 * self.system.layout.n_u)
        implied = np.isnan(self.final[own])
        left = np.abs(self.weights(solution) * solution.nodes[-1, : len(self.final)])
        return float(left[own][implied].max(initial=0.0))

    def greatest_angle(self, solution: Trajectory) -> float:
        """Greatest rope angle at the collocation points in rad."""
        loads = len(self.system.plant.loads)
        return float(np.abs(self.quantities(solution.points)[:, -loads:]).max())

    def _greatest(self, *solutions: Trajectory) -> Array:
        """Greatest magnitude of each coordinate at the nodes, 1 where that is zero."""
        nodes = np.concatenate([solution.nodes[:, : len(self.final)] for solution in solutions])
        largest = np.abs(nodes).max(axis=0)
        return np.where(largest > 0.0, largest, 1.0)


def _diagonal(first: Array, second: Array) -> Array:
    """Put two square matrices on the diagonal; SciPy's function for it takes a tenth of a whole solve."""
    n = len(first)
    whole = np.zeros((2 * n, 2 * n))
    whole[:n, :n], whole[n:, n:] = first, second
    return whole


def canonical_problem(problem: Problem, system: OptimalitySystem) -> BoundaryValueProblem:
    """State the problem with β = 0.

    Lengths are measured by the move, angles by what its mean acceleration holds statically.
    """
    layout, duration = system.layout, problem.duration
    distance, reach = np.array(problem.distance), axis_reach(problem)
    weights = effort_weights(reach)
    middle = tuple((np.array(problem.start) + np.array(problem.target)) / 2.0)
    linear = linearize(problem.plant, problem.parameters, middle)
    static = np.abs(np.linalg.solve(linear.stiffness, linear.input @ (reach / duration**2))).max()
    scale = np.ones(layout.size)
    scale[: layout.n_u] = static
    scale[layout.n_u : 2 * layout.n_u] = static / duration
    for order in range(layout.orders):
        scale[layout.axis(order)] = reach / duration**order
    scale[layout.sensitivities] = [scale[row] for _, row in layout.sensitivity_rows]
    offset, final = np.zeros(layout.size), np.zeros(layout.size)
    offset[layout.axis(0)] = problem.start
    final[layout.axis(0)] = distance / reach
    final[layout.axis(1)] = np.array(problem.final_velocity) * duration / reach
    swung = np.zeros(layout.size)
    swung[: 2 * layout.n_u] = initial_state(problem.plant, problem.initial)
    data = RuntimeParameters(
        parameters=np.array([problem.parameters[q.name] for q in problem.plant.parameters]),
        beta=0.0,
        gamma=0.0,  # where β is zero, too, an overflowing exponential would make NaN
        tau=problem.tau or 1.0,
        duration=duration,
        cost_scale=float(weights @ reach**2) / duration**6,
        effort_weights=weights,
        offset=offset,
        scale=scale,
    )
    excited, seen = _excited(linear, swung[: 2 * layout.n_u], reach, duration)
    basis, shown = _modal(layout, linear, seen)
    final[[state for states, _ in layout.kinds for state in states if shown[state] == 0.0]] = np.nan
    initial = np.asarray(np.linalg.solve(basis, swung / scale), dtype=np.float64)
    return BoundaryValueProblem(
        system=system,
        data=data,
        basis=basis,
        initial=initial,
        final=final,
        shown=shown,
        phase=float(duration * linear.frequencies[excited >= PROMINENT * excited.max()].max()),
    )


def independence(canonical: BoundaryValueProblem) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Find the end conditions to ask for, and the parameters whose sensitivities vanish with those."""
    layout = canonical.system.layout
    n, first = layout.size, layout.sensitivities.start
    rest = np.zeros((1, 2 * n))
    rest[:, layout.axis(0)] = canonical.final[layout.axis(0)] / 2.0
    A = canonical.linear(rest)[0][0, :, :n]
    B = np.eye(n)[:, layout.axis(layout.orders - 1)]
    # the axes' conditions first, the sensitivities', which are to give way, last
    order = np.concatenate([np.arange(2 * layout.n_u, first), np.arange(2 * layout.n_u), np.arange(first, n)])
    order = order[~np.isnan(canonical.final[order])]
    asked = np.zeros(n, dtype=bool)
    thresholds = np.where(order < first, DEPENDENT, INSENSITIVE)
    asked[order] = independent_states(A, B, order, thresholds)
    kept = zip(layout.sensitivity_rows, asked[layout.sensitivities], strict=True)
    useful = {name for (names, _), keep in kept if keep for name in names}
    every = dict.fromkeys(name for names, _ in layout.sensitivity_rows for name in names)
    return asked, tuple(name for name in every if name not in useful)


def without(problem: Problem, redundant: Sequence[str]) -> Problem:
    """Ask for fewer sensitivities."""
    kept = tuple(name for name in problem.desensitized if name not in redundant)
    return attrs.evolve(problem, desensitized=kept)


def quintic(canonical: BoundaryValueProblem, mesh: Array, scheme: Scheme) -> Trajectory:
    """Guess that the axes move by a quintic, and that everything else rests."""
    layout = canonical.system.layout

    def states(times: Array) -> Array:
        z = np.zeros((len(times), 2 * layout.size))
        for order in range(layout.orders):
            values = polynomial.polyval(times, polynomial.polyder(QUINTIC, order))
            z[:, layout.axis(order)] = values[:, None] * canonical.final[layout.axis(0)]
        return z

    return sampled(states, scheme, mesh)


def with_sway_cost(
    problem: Problem, unweighted: BoundaryValueProblem, solution: Trajectory
) -> BoundaryValueProblem:
    """Pose the same problem with the β asked for; an automatic γ is scaled by a solution without."""
    beta, gamma = problem.sway_weight, problem.sway_scale
    if beta == 0.0:
        return unweighted
    if gamma is None:
        _, sway = unweighted.slopes(solution(np.linspace(0.0, 1.0, SWAY_SAMPLES)))
        largest = float(peak(np.linalg.norm(sway, axis=1, keepdims=True))[0])
        if largest == 0.0:  # a hoist alone swings nothing
            return unweighted
        gamma = AUTO_SWAY / largest
        beta *= 2.0 * solution.integral(unweighted.quantities(solution.points)[:, 1]) / AUTO_EFFORT**2
    return attrs.evolve(unweighted, data=attrs.evolve(unweighted.data, beta=beta, gamma=gamma))


def _modal(layout: StateLayout, linear: Linearization, shown: Array) -> tuple[Array, Array]:
    """Basis in which everything that swings is written in modes, and the sway that each state shows."""
    basis, sway = np.eye(layout.size), np.zeros(layout.size)
    for states, coordinates in layout.kinds:
        if len(coordinates) == layout.n_u:
            basis[np.ix_(states, states)] = linear.modes
            sway[states] = shown
        else:  # a parameter that does not reach all coordinates
            sway[states] = np.abs(linear.sway_gain).max(axis=0)[coordinates]
    return basis, sway


def _excited(linear: Linearization, swung: Array, reach: Array, duration: float) -> tuple[Array, Array]:
    """Sway in m that each mode may be left with, and per unit of it, each of shape (n_u,).

    The jerk with which a move of distance D in time T begins leaves a fast mode swinging by its gain times
    60 D / (ω T)³; it otherwise follows the axes statically, and swings as at the start. Modes that are too
    fast to be excited noticeably count as showing nothing: asking those to rest would only spoil the
    equations' condition.
    """
    drive = np.abs(np.linalg.solve(linear.modes, linear.input)) @ reach
    z, dz = np.linalg.solve(linear.modes, swung.reshape(2, -1).T).T
    begun = np.hypot(z, dz / linear.frequencies)
    left = QUINTIC_JERK * drive / (linear.frequencies * duration) ** 3 + begun
    shown = np.abs(linear.sway_gain @ linear.modes).max(axis=0)
    excited = shown * left
    # a mode that no axis drives is not too fast: whether it rests must be seen
    return excited, np.where((drive > 0.0) & (excited < NEGLIGIBLE * reach.max()), 0.0, shown)


def _finite(values: Array) -> Array:
    if not np.isfinite(values).all():
        raise np.linalg.LinAlgError("the canonical equations overflow")
    return values
