"""A problem's boundary value problem in dimensionless numbers."""

from __future__ import annotations

import attrs
import numpy as np

from gen_profile.problem.axis_reach import axis_reach, effort_weights
from gen_profile.problem.linearization import linearize
from gen_profile.problem.pontryagin import Data, OptimalitySystem
from gen_profile.problem.problem import Problem
from gen_profile.problem.reachability import independent_states
from gen_profile.profile import Array
from gen_profile.solvers.collocation import Trajectory, newton_iterate


@attrs.frozen(kw_only=True, eq=False)
class Canonical:
    """A boundary value problem in dimensionless numbers.

    Attributes
    ----------
    system : OptimalitySystem
    data : Data
    final : (n,) array
        States at the end; NaN where an end condition is implied by the others. At the start all are zero.
    """

    system: OptimalitySystem
    data: Data
    final: Array

    def iterate(self, current: Trajectory) -> Trajectory:
        """Solve the equations linearised about a trajectory."""
        data = self.data.row()
        return newton_iterate(
            lambda points: self.system.flow(points, data), current, np.zeros(len(self.final)), self.final
        )

    def quantities(self, points: Array) -> Array:
        """H, g, highest derivatives, sways and angles; see `OptimalitySystem`."""
        return self.system.quantities(points, self.data.row())[:, :, 0]

    def rescaled(self, solution: Trajectory) -> tuple[Canonical, Trajectory]:
        """Measure every state by its own greatest value, which conditions the linear equations best."""
        n = len(self.final)
        largest = np.abs(solution.nodes[:, :n]).max(axis=0)
        largest = np.where(largest > 0.0, largest, 1.0)
        data = attrs.evolve(self.data, scale=self.data.scale * largest)
        factor = np.concatenate([1.0 / largest, largest])
        return (
            attrs.evolve(self, data=data, final=self.final / largest),
            Trajectory(mesh=solution.mesh, nodes=solution.nodes * factor, stages=solution.stages * factor),
        )

    def greatest_angle(self, solution: Trajectory) -> float:
        """Greatest rope angle at the collocation points in rad."""
        loads = len(self.system.plant.loads)
        return float(np.abs(self.quantities(solution.points)[:, -loads:]).max())


def canonical_problem(problem: Problem, system: OptimalitySystem) -> Canonical:
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
    data = Data(
        parameters=np.array([problem.parameters[q.name] for q in problem.plant.parameters]),
        beta=0.0,
        gamma=1.0,
        tau=problem.tau or 1.0,
        duration=duration,
        cost_scale=float(weights @ reach**2) / duration**6,
        effort_weights=weights,
        offset=offset,
        scale=scale,
    )
    return Canonical(system=system, data=data, final=final)


def independence(canonical: Canonical) -> tuple[Array, tuple[str, ...]]:
    """Find the end conditions to ask for, and the parameters whose sensitivities vanish with those."""
    layout = canonical.system.layout
    n = layout.size
    rest = np.zeros((1, 2 * n))
    rest[:, layout.axis(0)] = canonical.final[layout.axis(0)] / 2.0
    A = canonical.system.flow(rest, canonical.data.row())[0, :n, 1 : 1 + n]
    # plants' own conditions first: a sensitivity is what gives way
    order = np.concatenate([np.arange(2 * layout.n_u, layout.sensitivities.start), np.arange(2 * layout.n_u)])
    order = np.concatenate([order, np.arange(layout.sensitivities.start, n)])
    independent = np.empty(n, dtype=bool)
    independent[order] = independent_states(
        A[np.ix_(order, order)], np.eye(n)[order][:, layout.axis(layout.orders - 1)]
    )
    asked = independent[layout.sensitivities]
    names = [name for name, _ in layout.sensitivity_rows]
    useful = {name for name, keep in zip(names, asked, strict=True) if keep}
    return independent, tuple(name for name in dict.fromkeys(names) if name not in useful)
