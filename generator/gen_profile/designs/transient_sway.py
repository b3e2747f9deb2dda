"""The limit of sway on the way, which holds for every machine of a check's ranges.

Solvers know the nominal machine, so it is allowed so much less as the worst machine sways more. How much that
is hardly depends on the motion: it is measured on one, and tried on the next; where it does depend on it, two
motions tell by how much.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial

import attrs

from gen_profile.errors import SpecError
from gen_profile.evaluation.scenarios import scenarios
from gen_profile.evaluation.simulation import greatest_sway
from gen_profile.motion.profile import Profile
from gen_profile.problem.limits import SWAY_TOLERANCE
from gen_profile.problem.parameter_box import machines_inside
from gen_profile.problem.problem import Problem, problem_of
from gen_profile.progress import Progress, untold
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.direct.relaxation import Relaxation, Relaxed
from gen_profile.solvers.indirect import solver as indirect
from gen_profile.solvers.motion import optimal_profile
from gen_profile.solvers.solution import Solution, Status
from gen_profile.spec.model import Spec
from gen_profile.spec.plausibility import refuse_implausible
from gen_profile.spec.values import SolverName
from gen_profile.work import OutOfWork, budget

ROUNDS = 4  # of measuring and solving again
ENOUGH = 1.005  # times the limit that the worst machine may sway
NEARLY_ENOUGH = 1.008  # likewise where solving again takes long
MARGIN = 1.002  # for what lies between the machines and the times looked at
STEEPNESS = 0.1  # least share of its own sway, by which the worst machine's falls with the nominal one's
AT_ONCE = 1.0  # s of work, in which a motion without limits is found, or is not worth the while
ACCURACY = 1e-6  # of the machines' integration, relative
SAMPLES = 1001


def solve(spec: Spec) -> Solution:
    """Solve a spec so that all machines keep its limits; where that fails, find out what would help."""
    try:
        with budget(*choice.ANSWER):
            return choice.diagnosed(attempt(spec), spec.solver.solver, tried=partial(as_asked_next, spec))
    except OutOfWork:
        return choice.given_up(problem_of(spec))


def attempt(
    spec: Spec, progress: Progress = untold, spread: float = 1.0, near: Relaxed | None = None
) -> Solution:
    """Solve a spec so that no machine of its ranges sways more on the way than its limit.

    Parameters
    ----------
    spec : Spec
        With a duration.
    progress : Progress
    spread : float
        How many times as much as the nominal machine the worst one sways, as far as that is known.
    near : Relaxed, optional
        A motion near by that takes all of the limits, so that the direct method may begin there at once.

    Returns
    -------
    Solution
        Without an optimum where there is none; its problem says how much less the nominal machine is allowed.
    """
    problem = attrs.evolve(problem_of(spec), sway_spread=spread)
    if near is not None and spec.solver.solver != "indirect":
        begun = partial(choice.attempt, method="direct", near=near)
        solution = _kept(spec, problem, begun, NEARLY_ENOUGH, progress)
    else:
        solution = kept_by_all(spec, problem, spec.solver.solver, progress)
    if solution.optimum is None and solution.problem.sway_spread == 1.0:
        return attrs.evolve(solution, problem=with_usual_spread(spec, problem))
    return solution


def as_asked_next(spec: Spec, problem: Problem, /, *, coarse: bool = False) -> Solution:
    """Solve a problem as if a spec had its duration and limits, which may not be plausible."""
    move = attrs.evolve(spec.move, duration=problem.duration, shortest=False)
    try:
        refuse_implausible(attrs.evolve(spec, move=move, limits=problem.limits))
    except SpecError:
        return choice.given_up(problem)
    problem = attrs.evolve(problem, sway_spread=1.0)
    if spec.solver.solver != "direct" and problem.worst_case is None:
        with suppress(OutOfWork), budget(AT_ONCE):
            smooth = choice.attempt(problem, "indirect")
            found = choice.keeps_limits(smooth) and _too_much(spec, smooth, ENOUGH) is None
            if found or smooth.status is Status.INFEASIBLE:
                return smooth
    if coarse:  # whether there is a motion does not depend on what it costs
        problem = attrs.evolve(problem, sway_weight=0.0)
    solution = kept_by_all(spec, problem, "direct", coarse=coarse)
    if solution.optimum is None or _too_much(spec, solution, SWAY_TOLERANCE) is None:
        return solution
    return attrs.evolve(solution, status=Status.INFEASIBLE, optimum=None)


def kept_by_all(
    spec: Spec,
    problem: Problem,
    method: SolverName,
    progress: Progress = untold,
    *,
    coarse: bool = False,
) -> Solution:
    """Solve a problem again with less sway of the nominal machine, until all of a spec's keep the limit.

    How much less is measured on motions on few intervals first.

    Parameters
    ----------
    spec : Spec
    problem : Problem
        Of that spec, or with other limits, another duration, or whatever else it asks for.
    method : str
    progress : Progress
    coarse : bool
        On few intervals only.
    """
    if not limited(spec, problem):
        return choice.attempt(problem, method, coarse=coarse)
    if method == "indirect" and problem.worst_case is None:  # which knows no limits
        return choice.attempt(problem, method)
    if coarse or problem.worst_case is None:
        found = _kept(spec, problem, partial(choice.attempt, method=method, coarse=True))
        if coarse or found.optimum is None or found.method == indirect.METHOD:
            return found
        problem = attrs.evolve(problem, sway_spread=found.problem.sway_spread)
    return _kept(spec, problem, choice.directly, NEARLY_ENOUGH, progress)


def limited(spec: Spec, problem: Problem) -> bool:
    """Whether a limit of the sway on the way holds for machines that may sway more than the nominal one."""
    return problem.limits.sway is not None and bool(spec.checked_ranges())


def _kept(
    spec: Spec,
    problem: Problem,
    solve: Callable[[Problem], Solution],
    enough: float = ENOUGH,
    progress: Progress = untold,
) -> Solution:
    """Solve a problem again until the worst machine sways no more than enough times its limit."""
    solution, before = solve(problem), (0.0, 0.0)
    for _ in range(ROUNDS):
        if solution.optimum is None:
            break
        found = _too_much(spec, solution, enough)
        if found is None:
            break
        if found[1] == math.inf:
            return attrs.evolve(solution, status=Status.INFEASIBLE, optimum=None)
        spread = _spread(problem.limits.sway or 0.0, before, found)
        progress("solving", remark=f"for the machine that sways {spread:.3g} times as much on the way")
        solution, before = solve(attrs.evolve(problem, sway_spread=spread)), found
    return solution


def _too_much(spec: Spec, solution: Solution, enough: float) -> tuple[float, float] | None:
    """Tell how much the nominal machine and the worst one sway in m, where that is too much."""
    if not limited(spec, solution.problem):
        return None
    nominal, worst = sways(spec, solution.problem, optimal_profile(solution))
    if worst <= max(enough * (solution.problem.limits.sway or 0.0), nominal) < math.inf:
        return None
    return nominal, worst


def _spread(limit: float, before: tuple[float, float], found: tuple[float, float]) -> float:
    """Extrapolate how many times as much as the nominal machine the worst one sways at the limit.

    Parameters
    ----------
    limit : float
        m, of the worst machine's sway.
    before, found : (float, float)
        m, of the nominal machine and the worst one; in two motions, or nothing and one.
    """
    nominal, worst = found
    slope = worst / nominal
    if nominal < before[0]:
        slope = min(slope, max((before[1] - worst) / (before[0] - nominal), STEEPNESS * slope))
    return MARGIN * limit / max(nominal - (worst - limit) / slope, nominal / 2.0)


def with_usual_spread(spec: Spec, problem: Problem) -> Problem:
    """Tell a problem without a motion what spread one with wider limits has, for what is named to help."""
    if not limited(spec, problem):
        return problem
    easiest = Relaxation(problem).least(tuple(problem.limits.stated()))
    return problem if easiest is None else attrs.evolve(problem, sway_spread=spread(spec, easiest.solution))


def spread(spec: Spec, solution: Solution) -> float:
    """Tell how many times as much as the nominal machine the worst one sways in a motion; 1 where unknown."""
    if not limited(spec, solution.problem) or solution.optimum is None:
        return 1.0
    nominal, worst = sways(spec, solution.problem, optimal_profile(solution))
    return worst / nominal if 0.0 < nominal <= worst < math.inf else 1.0


def sways(spec: Spec, problem: Problem, motion: Profile) -> tuple[float, float]:
    """Find the greatest sway of the end load during a motion in m: nominal, and of the worst machine."""
    inside = machines_inside(problem, spec.checked_ranges())
    machines = [*(row.parameters for row in scenarios(spec)), *inside]
    found = greatest_sway(
        spec.machine(), motion, machines, spec.move.initial, accuracy=ACCURACY, samples=SAMPLES
    )
    return float(found[0]), float(found.max())
