"""Continuation around folds: where the solutions of ever longer moves turn back, they are followed there.

Shares of the move and solutions make a curve, which starts at rest. Newton's method keeps to points of it at
given distances along the curve, not at given shares, and so passes points at which the share turns
(pseudo-arclength continuation: Keller, 1977; Allgower and Georg, Numerical Continuation Methods, 1990).
"""

from __future__ import annotations

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.solvers.collocation import Trajectory, linearize
from gen_profile.solvers.indirect.boundary_value_problem import BoundaryValueProblem
from gen_profile.solvers.indirect.continuation import Advance
from gen_profile.solvers.indirect.newton import solve_newton

FIRST_STEP = 0.25
SMALLEST_STEP = 1e-4
QUICK = 4  # Newton iterations after which the next step may be twice as long
CLOSE = 1e-6  # last step of Newton's iteration on a point
MAX_CORRECTIONS = 8
MAX_ITERATIONS = 600
FARTHEST = 5.0  # correction of a point that belongs to another branch


@attrs.frozen(kw_only=True, eq=False)
class _Point:
    share: float
    solution: Trajectory

    def along(self, other: _Point, length: float) -> _Point:
        """Move towards another point; 1 is there."""
        return _Point(
            share=self.share + length * (other.share - self.share),
            solution=self.solution.blend(other.solution, length),
        )


def follow(problem: BoundaryValueProblem, guess: Trajectory, widest: float) -> Advance:
    """Solve a problem by following the solutions of shares of its move from rest.

    Parameters
    ----------
    problem : BoundaryValueProblem
    guess : Trajectory
        Solution of the linearised problem, the direction in which the curve begins.
    widest : float
        Greatest angle of a rope in rad, beyond which there is nothing to be found.

    Returns
    -------
    Advance
        That reached 1, or nothing.
    """
    curve = _Curve(problem=problem, weights=problem.weights(guess))
    latest = _Point(share=0.0, solution=guess.scaled(0.0))
    ahead = _Point(share=1.0, solution=guess)
    length, iterations = FIRST_STEP, 0
    while length >= SMALLEST_STEP and iterations < MAX_ITERATIONS:
        point, spent = curve.point(latest, ahead, length)
        iterations += spent
        if point is None:
            length /= 2.0
            continue
        if problem.greatest_angle(point.solution) > widest:
            break
        if latest.share < 1.0 <= point.share:
            here = latest.along(point, (1.0 - latest.share) / (point.share - latest.share))
            outcome = solve_newton(problem, here.solution)
            iterations += outcome.iterations
            if outcome.solution is not None:
                return Advance(
                    solution=outcome.solution, reached=1.0, iterations=iterations, residual=outcome.residual
                )
        ahead = latest.along(point, 2.0)
        latest = point
        if spent <= QUICK:
            length *= 2.0
    return Advance(solution=latest.solution, reached=0.0, iterations=iterations, residual=float("inf"))


@attrs.frozen(kw_only=True, eq=False)
class _Curve:
    """Points (share, solution), and distances between them."""

    problem: BoundaryValueProblem
    weights: Array

    def point(self, latest: _Point, ahead: _Point, length: float) -> tuple[_Point | None, int]:
        """Find the point in the plane at a distance from the latest one, across the way ahead."""
        start, way = self._coordinates(latest), self._coordinates(ahead) - self._coordinates(latest)
        way /= np.linalg.norm(way)
        scale = length / np.linalg.norm(self._coordinates(ahead) - start)
        current, last = latest.along(ahead, float(scale)), float("inf")
        for iteration in range(1, MAX_CORRECTIONS + 1):
            try:
                none, whole = self._ends(current.solution)
            except np.linalg.LinAlgError:
                return None, iteration
            # the Newton step is a line from `none` to `whole`; the plane cuts it
            base, span = self._coordinates(none) - start, self._coordinates(whole) - self._coordinates(none)
            following = none.along(whole, float((length - way @ base) / (way @ span)))
            step = float(np.linalg.norm(self._coordinates(following) - self._coordinates(current)))
            current = following
            if step < CLOSE:
                return current, iteration
            if step > 2.0 * last or step > FARTHEST:
                return None, iteration
            last = step
        return None, MAX_CORRECTIONS

    def _ends(self, solution: Trajectory) -> tuple[_Point, _Point]:
        """Solve the problem, linearised about a solution, for no share of the move and for all of it."""
        problem = self.problem
        linear = linearize(problem.flow(solution.points), solution)
        none = problem.towards(0.0)
        return (
            _Point(share=0.0, solution=linear.solve(none.initial, none.final)),
            _Point(share=1.0, solution=linear.solve(problem.initial, problem.final)),
        )

    def _coordinates(self, point: _Point) -> Array:
        """Root mean square of the weighted states at the nodes, and the share, as a vector's length."""
        states = self.weights * point.solution.nodes[:, : len(self.weights)]
        return np.append(states.ravel() / np.sqrt(states.size), point.share)
