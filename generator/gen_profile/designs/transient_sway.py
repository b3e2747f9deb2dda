"""The limit of sway on the way, which holds for every machine of a check's ranges.

Solvers know the nominal machine, so it is allowed so much less as the worst machine sways more. How much that
is hardly depends on the motion: it is measured on one, and tried on the next.
"""

from __future__ import annotations

from collections.abc import Callable

import attrs

from gen_profile.evaluation.scenarios import scenarios
from gen_profile.evaluation.simulation import greatest_sway
from gen_profile.motion.profile import Profile
from gen_profile.problem.parameter_box import machines_inside
from gen_profile.problem.problem import Problem, problem_of
from gen_profile.progress import Progress, untold
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Solution
from gen_profile.spec.model import Spec
from gen_profile.work import OutOfWork, budget

ROUNDS = 3  # of measuring and solving again
ENOUGH = 1.005  # times the limit that the worst machine may sway
MARGIN = 1.002  # for what lies between the machines and the times looked at
ACCURACY = 1e-6  # of the machines' integration, relative
SAMPLES = 1001


def solve(spec: Spec) -> Solution:
    """Solve a spec so that all machines keep its limits; where that fails, find out what would help."""
    try:
        with budget(*choice.ANSWER):
            return choice.diagnosed(attempt(spec), spec.solver.solver)
    except OutOfWork:
        return choice.given_up(problem_of(spec))


def measured_spread(spec: Spec, spread: float) -> float:
    """Tell how many times as much as the nominal machine the worst one sways, where that breaks the limit.

    Returns
    -------
    float
        The spread that was supposed where all keep the limit with it, and where nothing is known.
    """
    limit = spec.limits.sway
    if limit is None or not spec.checked_ranges():
        return spread
    solution = choice.attempt(attrs.evolve(problem_of(spec), sway_spread=spread), spec.solver.solver)
    if solution.optimum is None:
        return spread
    nominal, worst = sways(spec, optimal_profile(solution))
    return spread if worst <= max(ENOUGH * limit, nominal) else MARGIN * worst / nominal


def attempt(spec: Spec, progress: Progress = untold, spread: float = 1.0) -> Solution:
    """Solve a spec so that no machine of its ranges sways more on the way than its limit.

    Parameters
    ----------
    spec : Spec
        With a duration.
    progress : Progress
    spread : float
        How many times as much as the nominal machine the worst one sways, as far as that is known.

    Returns
    -------
    Solution
        Without an optimum where there is none; its problem says how much less the nominal machine is allowed.
    """
    problem, method, limit = problem_of(spec), spec.solver.solver, spec.limits.sway
    if limit is None or not spec.checked_ranges():
        return choice.attempt(problem, method)
    if problem.worst_case is not None:  # the least residual of the worst machine takes longest to find
        quick = attempt(attrs.evolve(spec, robustness=attrs.evolve(spec.robustness, method="none")))
        spread = max(spread, quick.problem.sway_spread)
    problem = attrs.evolve(problem, sway_spread=spread)
    solution = kept_by_all(spec, problem, lambda asked: choice.attempt(asked, method), progress)
    if solution.optimum is None and solution.problem.sway_spread == 1.0:
        return attrs.evolve(solution, problem=with_usual_spread(spec, problem))
    return solution


def kept_by_all(
    spec: Spec, problem: Problem, solve: Callable[[Problem], Solution], progress: Progress = untold
) -> Solution:
    """Solve a problem again with less sway of the nominal machine, until all of a spec's keep its limit.

    Parameters
    ----------
    spec : Spec
    problem : Problem
        Of that spec, whatever else it asks for.
    solve : callable
    progress : Progress
    """
    solution, limit = solve(problem), spec.limits.sway
    if limit is None or not spec.checked_ranges():
        return solution
    for _ in range(ROUNDS):
        if solution.optimum is None:
            break
        nominal, worst = sways(spec, optimal_profile(solution))
        if worst <= max(ENOUGH * limit, nominal):
            break
        spread = MARGIN * worst / nominal
        progress("solving", remark=f"for the machine that sways {spread:.3g} times as much on the way")
        solution = solve(attrs.evolve(problem, sway_spread=spread))
    return solution


def with_usual_spread(spec: Spec, problem: Problem) -> Problem:
    """Tell a problem without a motion what spread one without the limit has, for what is named to help."""
    if spec.limits.sway is None or not spec.checked_ranges():
        return problem
    limits = attrs.evolve(problem.limits, sway=None)
    free = choice.attempt(attrs.evolve(problem, limits=limits, worst_case=None), "direct")
    if free.optimum is None:
        return problem
    nominal, worst = sways(spec, optimal_profile(free))
    return attrs.evolve(problem, sway_spread=MARGIN * worst / nominal) if nominal > 0.0 else problem


def sways(spec: Spec, motion: Profile) -> tuple[float, float]:
    """Find the greatest sway of the end load during a motion in m: nominal, and of the worst machine."""
    inside = machines_inside(problem_of(spec), spec.checked_ranges())
    machines = [*(row.parameters for row in scenarios(spec)), *inside]
    found = greatest_sway(
        spec.machine(), motion, machines, spec.move.initial, accuracy=ACCURACY, samples=SAMPLES
    )
    return float(found[0]), float(found.max())
