"""Simplified Newton's method on Pontryagin's conditions, for machines that swing little.

With states x, costates λ, controls u and the cost ½ R u² + ℓ(x), Pontryagin's conditions are::

    ẋ = f(x, u)    −λ̇ = (∂f/∂x)ᵀ λ + ∂ℓ/∂x    R u = −Bᵀ λ    x(0), x(1) given (λ(1) = 0 where x(1) is free)

They are evaluated exactly. What an iterate misses, r of the first and s of the second, is corrected with the
machine's Jacobian A as it hangs at rest along the way, not as it swings: that makes Newton's method a
simplified one (Deuflhard, Newton Methods for Nonlinear Problems, 2004, section 2.1)::

    δẋ = A δx + B δu + r    −δλ̇ = Aᵀ δλ + δ(∂ℓ/∂x) + s    R δu = −Bᵀ δλ

These are the conditions of a convex problem, a linear machine with the cost as it is. Its states are
eliminated (`linear_response`), so that only the controls are left to solve for (`least_cost`): some eighty
unknowns in place of some two thousand. The less the machine swings, the nearer A is to the Jacobian, and the
faster the iteration converges: its error shrinks by a nearly constant factor, which two steps tell. A machine
that differs from place to place, as a crane that hoists, is linearised anew in every iteration.
"""

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.methods.solvers.collocation import IntArray, Trajectory
from gen_profile.methods.solvers.indirect.boundary_value_problem import BoundaryValueProblem
from gen_profile.methods.solvers.indirect.least_cost import LinearMachine, least_cost
from gen_profile.methods.solvers.indirect.linear_response import LinearResponse, linear_response
from gen_profile.methods.solvers.indirect.newton import NewtonOutcome
from gen_profile.motion.profile import Array
from gen_profile.support.work import spend

BELIEVED_RATE = 0.01  # least quotient of steps that is taken for the rate of convergence
SLOW_SIMPLIFIED = 0.5  # fraction of the step before beyond which another method is the better one
# step from which on a machine that changes on the way is linearised anew; the later models change convergence
# no more, for what they lack is the curvature of the equations
MODELLED = 0.03
CONTROLS_WORK = 1e-7  # s of work for the square of the number of controls
MOST_CONTROLS = 1200  # up to which to solve for all of them at once; above 1500 the full method is as quick


@attrs.frozen(kw_only=True, eq=False)
class _SimplifiedIterate:
    """A trajectory, and its slopes at the collocation points."""

    trajectory: Trajectory
    slopes: Array


@attrs.frozen(kw_only=True, eq=False)
class _Model:
    """The machine, linearised.

    Attributes
    ----------
    response : LinearResponse
    driven_states : (m,) array of int
        States that the controls drive.
    costed : (intervals, stages, outputs, n) array
        Derivative by the states of the end load's sway, and of what else costs half its square.
    asked : (n,) array of bool
        Whether a final state is given.
    machine : LinearMachine
        The same, as its controls see it.
    is_uniform : bool
        Whether the machine is the same everywhere.
    """

    response: LinearResponse
    driven_states: IntArray
    costed: Array
    asked: NDArray[np.bool_]
    machine: LinearMachine
    is_uniform: bool


def solve_simplified(problem: BoundaryValueProblem, start: Trajectory) -> NewtonOutcome:
    """Iterate from a start until the solution is near, as `BoundaryValueProblem.distance` measures it.

    There is no solution where the iteration does not converge well, or has too many controls.

    Parameters
    ----------
    problem : BoundaryValueProblem
    start : Trajectory
        Of a scheme of Gauss's.

    Raises
    ------
    numpy.linalg.LinAlgError
        When equations are singular or overflow.
    """
    iteration, step = 0, 1.0  # of the motion's size
    if len(start.points) * problem.system.layout.m > MOST_CONTROLS:
        return NewtonOutcome(solution=None, iterations=iteration, residual=step)
    model, current = _model(problem, start, _hanging(problem, start)), _consistent(problem, start)
    for iteration in range(1, problem.options.max_iterations + 1):
        spend(CONTROLS_WORK * (len(start.points) * problem.system.layout.m) ** 2)
        following = _corrected(problem, model, current)
        before, step = step, problem.distance(current.trajectory, following.trajectory)
        current, shrinkage = following, step / before
        # to the solution, as the last steps let it be foreseen
        distance = step * max(shrinkage, BELIEVED_RATE)
        if shrinkage < SLOW_SIMPLIFIED and distance < problem.options.tolerance:
            return NewtonOutcome(solution=current.trajectory, iterations=iteration, residual=step)
        if not shrinkage < 1.0:
            break
        if not model.is_uniform and step > MODELLED:
            model = _model(problem, current.trajectory, current.trajectory.points)
    return NewtonOutcome(solution=None, iterations=iteration, residual=step)


def _hanging(problem: BoundaryValueProblem, trajectory: Trajectory) -> Array:
    """Take the axes' motion of a trajectory; everything else rests."""
    layout = problem.system.layout
    points = np.zeros_like(trajectory.points)
    for order in range(layout.orders):
        points[:, layout.axis(order)] = trajectory.points[:, layout.axis(order)]
    return points


def _model(problem: BoundaryValueProblem, like: Trajectory, points: Array) -> _Model:
    """Linearise at given states and costates, at a trajectory's points in time."""
    layout, times = problem.system.layout, like.stages.shape[:2]
    n = layout.size
    by_unknowns, costed = problem.linear(points[:: times[1]])
    is_uniform = not (np.ptp(by_unknowns, axis=0).any() or np.ptp(costed, axis=0).any())
    if is_uniform:
        by_unknowns, costed = (np.repeat(one, times[1], axis=0) for one in (by_unknowns, costed))
    else:
        by_unknowns, costed = problem.linear(points)
    A = by_unknowns[:, :, :n].reshape(*times, n, n)
    driven_states = np.arange(n)[layout.axis(layout.orders - 1)]
    response = linear_response(A, like.scheme, np.diff(like.mesh))
    costed = costed.reshape(*times, -1, n)
    gain, final_gain = response.gains(driven_states, costed)
    asked = ~np.isnan(problem.final)
    effort = -1.0 / by_unknowns[0, driven_states, n + driven_states]  # the controls are −λ / effort
    machine = LinearMachine(
        weights=response.weights.ravel(),
        effort=(response.weights * effort).ravel(),
        gain=gain,
        conditions=final_gain[asked],
    )
    return _Model(
        response=response,
        driven_states=driven_states,
        costed=costed,
        asked=asked,
        machine=machine,
        is_uniform=is_uniform,
    )


def _corrected(
    problem: BoundaryValueProblem, model: _Model, current: _SimplifiedIterate
) -> _SimplifiedIterate:
    """Solve the linear machine's problem for what the conditions miss."""
    n, response, weights = len(problem.final), model.response, model.response.weights
    slopes, sway = problem.slopes(current.trajectory.points)
    defects = slopes.reshape(current.slopes.shape) - current.slopes
    force, load = defects[..., :n], -weights * defects[..., n:]
    _, states, final = response.states(force)
    multipliers = np.zeros(n)
    slope, _ = response.costates(load, multipliers)
    controls, multipliers[model.asked], pull = least_cost(
        model.machine,
        problem.sway_cost,
        sway,
        moved=(model.costed @ states[..., None]).reshape(len(sway), -1),
        slope=slope[..., model.driven_states].ravel(),
        missing=(problem.final - current.trajectory.nodes[-1, :n] - final)[model.asked],
    )
    force[..., model.driven_states] += controls.reshape(*force.shape[:2], -1)
    rises, _, _ = response.states(force)
    load += (model.costed.swapaxes(2, 3) @ pull.reshape(*load.shape[:2], -1, 1))[..., 0]
    _, falls = response.costates(load, multipliers)
    slopes = current.slopes + np.concatenate([rises, -falls / weights], axis=-1)
    final_costates = current.trajectory.nodes[-1, n:] + multipliers
    return _integrated(current.trajectory, slopes, problem.initial, final_costates)


def _consistent(problem: BoundaryValueProblem, start: Trajectory) -> _SimplifiedIterate:
    """Begin at the initial state; costates of free final states end at zero."""
    lengths = np.diff(start.mesh)[:, None, None]
    slopes = start.scheme.slopes @ (start.stages - start.nodes[:-1, None]) / lengths
    n = len(problem.final)
    final_costates = np.where(np.isnan(problem.final), 0.0, start.nodes[-1, n:])
    return _integrated(start, slopes, problem.initial, final_costates)


def _integrated(like: Trajectory, slopes: Array, initial: Array, final_costates: Array) -> _SimplifiedIterate:
    """Integrate slopes from the initial state, and backward from the final costates, on the same mesh."""
    n, scheme, lengths = len(initial), like.scheme, np.diff(like.mesh)[:, None, None]
    nodes = np.zeros_like(like.nodes)
    np.cumsum(lengths[:, 0] * (scheme.b @ slopes), axis=0, out=nodes[1:])
    nodes[:, :n] += initial
    nodes[:, n:] += final_costates - nodes[-1, n:]
    stages = nodes[:-1, None] + lengths * (scheme.A @ slopes)
    return _SimplifiedIterate(trajectory=attrs.evolve(like, nodes=nodes, stages=stages), slopes=slopes)
