"""The limit of sway on the way, which holds for every machine of a check's ranges.

Solvers know the nominal machine, so it is allowed so much less as the worst machine sways more. How much that
is, the spread, hardly depends on the motion: it is measured on one, and tried on the next; where it does
depend on it, two motions tell by how much.
"""

import math
from collections.abc import Callable
from functools import partial

import attrs

from gen_profile.dynamics.evaluation.simulation import greatest_overshoot, greatest_sway
from gen_profile.dynamics.problem.overshoot import excess
from gen_profile.dynamics.problem.parameter_box import machines_of
from gen_profile.dynamics.problem.problem import Problem, problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers.direct.relaxation import Relaxed
from gen_profile.methods.solvers.indirect.extremal import METHOD as INDIRECT
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.methods.solvers.search import Search, least
from gen_profile.methods.solvers.solution import Solution, Status
from gen_profile.motion.profile import Profile
from gen_profile.spec.model import Spec
from gen_profile.spec.values import SolverName
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.remembered import remembered
from gen_profile.support.work import left

ACCEPTED = 1.005  # times the limit that the worst machine may sway
NEARLY_ACCEPTED = 1.008  # likewise where solving again takes long
# the first spread that will do is taken; aimed at is a little more, for what lies between machines and times
# looked at, and the worst machine's sway falls by at least a tenth as much as the nominal one's
SPREAD = Search(precision=1e-3, aim=-2e-3, believed=(0.1, 10.0), tries=5)
OVERSHOOT_ROUNDS = 4  # to find by how much less the nominal machine's load may pass its target
SWAY_ACCURACY = 1e-6  # of the machines' integration, relative
SAMPLES = 1001  # over the motion: n periods of a harmonic are met to (π n / 1000)² / 2


def attempt(
    spec: Spec, progress: Progress = no_progress, spread: float = 1.0, near: Relaxed | None = None
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
        return _behind(problem, lambda asked: _kept(asked, begun, NEARLY_ACCEPTED, progress))
    return kept_by_all(problem, spec.solver.solver, progress)


@remembered(lambda problem, method, progress=None, *, coarse=False: (problem, method, coarse, left()))
def kept_by_all(
    problem: Problem, method: SolverName, progress: Progress = no_progress, *, coarse: bool = False
) -> Solution:
    """Solve a problem again with less sway of the nominal machine, until all in its ranges keep the limits.

    How much less is measured on motions on few intervals first.

    Parameters
    ----------
    problem : Problem
    method : str
    progress : Progress
    coarse : bool
        On few intervals only.
    """
    return _behind(problem, partial(_swaying, method=method, progress=progress, coarse=coarse))


def _swaying(problem: Problem, method: SolverName, progress: Progress, *, coarse: bool) -> Solution:
    if not limited(problem) or (method == "indirect" and problem.worst_case is None):
        return choice.attempt(problem, method, coarse=coarse)  # the indirect method knows no limits
    if coarse or problem.worst_case is None:
        solution = _kept(problem, partial(choice.attempt, method=method, coarse=True))
        if coarse or solution.optimum is None or solution.method == INDIRECT:
            return solution
        problem = attrs.evolve(problem, sway_spread=solution.problem.sway_spread)
    # where it finds a motion, so does "auto", and it is the quicker to fail
    return _kept(problem, partial(choice.attempt, method="direct"), NEARLY_ACCEPTED, progress)


def _behind(problem: Problem, solve: Callable[[Problem], Solution]) -> Solution:
    """Let the nominal machine's load pass its targets by less, until no machine's passes them too far.

    As much is taken off as the worst went too far, as far as it may pass them at all.
    """
    for _ in range(OVERSHOOT_ROUNDS):
        solution = solve(problem)
        if solution.optimum is None or not problem.targets:
            return solution
        problem = solution.problem
        margin = overshoot_margin(problem, optimal_profile(solution))
        if margin == problem.overshoot_margin:
            break
        problem = attrs.evolve(problem, overshoot_margin=margin)
    if keeps_behind(solution):
        return solution
    return attrs.evolve(solution, status=Status.DIVERGED, optimum=None)


def keeps_behind(solution: Solution) -> bool:
    """Whether no machine's load passes the targets of its problem too far."""
    targets = solution.problem.targets
    if not targets:
        return True
    return excess(targets, overshoots(solution.problem, optimal_profile(solution))[1]) <= 0.0


def overshoot_margin(problem: Problem, motion: Profile) -> float:
    """Tell by how much less the nominal machine may pass the targets in m, for what the worst one does."""
    if not problem.targets:
        return 0.0
    missing = excess(problem.targets, overshoots(problem, motion)[1], ACCEPTED)
    if missing <= 0.0:
        return problem.overshoot_margin
    return min(problem.overshoot_margin + missing, problem.limits.overshoot or 0.0)


def overshoots(problem: Problem, motion: Profile) -> tuple[float, float]:
    """Find how far the end load passes its targets in a motion in m: nominal, and on the worst machine."""
    machines = machines_of(problem)
    found = greatest_overshoot(problem, motion, machines, accuracy=SWAY_ACCURACY, samples=SAMPLES)
    return float(found[0]), float(found.max())


def limited(problem: Problem) -> bool:
    """Whether a limit of the sway on the way holds for machines that may sway more than the nominal one."""
    return problem.limits.sway is not None and bool(problem.ranges)


def _kept(
    problem: Problem,
    solve: Callable[[Problem], Solution],
    accepted: float = ACCEPTED,
    progress: Progress = no_progress,
) -> Solution:
    """Find the least spread with which the worst machine sways no more than enough times its limit."""
    solutions: list[Solution] = []

    def excess(spread: float) -> float:
        if solutions:
            progress("solving", remark=f"for the machine that sways {spread:.3g} times as much on the way")
        solution = solve(attrs.evolve(problem, sway_spread=spread))
        solutions.append(solution)
        if solution.optimum is None or not limited(problem):
            return -math.inf  # where no motion sways so little, none sways less
        nominal, worst = sways(problem, optimal_profile(solution))
        if _is_accepted(problem, nominal, worst, accepted):
            return -math.inf
        if worst == math.inf:
            solutions.append(attrs.evolve(solution, status=Status.DIVERGED, optimum=None))
            return -math.inf
        return max(math.log(worst / nominal / spread), SPREAD.precision)

    least(excess, problem.sway_spread, SPREAD)
    return solutions[-1]


def _is_accepted(problem: Problem, nominal: float, worst: float, accepted: float) -> bool:
    """Whether the worst machine sways no more than so many times the limit, or than the nominal one."""
    return worst <= max(accepted * (problem.limits.sway or 0.0), nominal) < math.inf


def keeps_sway(solution: Solution, accepted: float) -> bool:
    """Whether no machine of its problem's ranges sways more on the way than so many times the limit."""
    problem = solution.problem
    return not limited(problem) or _is_accepted(problem, *sways(problem, optimal_profile(solution)), accepted)


def spread(solution: Solution) -> float:
    """Tell how many times as much as the nominal machine the worst one sways in a motion; 1 where unknown."""
    if not limited(solution.problem) or solution.optimum is None:
        return 1.0
    nominal, worst = sways(solution.problem, optimal_profile(solution))
    return worst / nominal if 0.0 < nominal <= worst < math.inf else 1.0


def sways(problem: Problem, motion: Profile) -> tuple[float, float]:
    """Find the greatest sway of the end load during a motion in m: nominal, and of the worst machine."""
    machines = machines_of(problem)
    greatest = greatest_sway(
        problem.plant, motion, machines, problem.initial, accuracy=SWAY_ACCURACY, samples=SAMPLES
    )
    return float(greatest[0]), float(greatest.max())
