"""From a spec to a motion and its figures, before anything is written."""

from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers.draft import Plan, solved
from gen_profile.methods.solvers.over_stacks.plan import over_stacks
from gen_profile.methods.solvers.over_stacks.searches import OPTIONS
from gen_profile.methods.solvers.shortest import short_enough, shortest
from gen_profile.methods.solvers.solution import SIMPLER, Status, no_motion
from gen_profile.methods.solvers.suggestions import Remedy, explained, remedy
from gen_profile.spec.model import Spec
from gen_profile.support.errors import LimitViolation
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.work import OutOfWork, budget

EXPLAINING = "looking for what would do"


def plan(spec: Spec, progress: Progress = no_progress) -> Plan:
    """Solve a spec, or shape a move for it, and try the motion on all machines.

    Raises
    ------
    InfeasibleProblem, SolverDiverged, LimitViolation
    """
    try:
        with budget(*answer_of(spec)):
            return judged(draft(spec, progress), progress)
    except OutOfWork as error:
        raise no_motion(Status.GIVEN_UP, SIMPLER) from error


def answer_of(spec: Spec) -> tuple[float, float]:
    """Tell how much work in s, and of the processor, all takes at most that a spec asks for."""
    return choice.ANSWER if spec.path is None else OPTIONS.answer


def draft(spec: Spec, progress: Progress = no_progress) -> Plan:
    """Solve a spec, or shape a move for it, and look no further: nothing holds the motion to the limits.

    Raises
    ------
    InfeasibleProblem, SolverDiverged
        No duration, or no shaped move, was found.
    OutOfWork
        Nothing is left of a budget.
    """
    if spec.path is not None:
        return short_enough(spec, over_stacks(spec, progress))
    if spec.move.shortest:
        return shortest(spec, progress)
    progress("solving")
    return solved(spec, progress)


def judged(drafted: Plan, progress: Progress = no_progress) -> Plan:
    """Try a drafted motion on all machines; say what would help where there is none within the limits.

    Raises
    ------
    InfeasibleProblem, SolverDiverged, LimitViolation
    OutOfWork
        Nothing is left of a budget.
    """
    spec = drafted.spec
    if drafted.found is None:
        assert drafted.solution is not None  # a shaper has a motion, or raises
        progress(EXPLAINING)
        explained(spec, drafted.solution).raise_for_status()
    if drafted.broken:
        progress(EXPLAINING)
        better = Remedy() if spec.path is not None else remedy(spec)  # which knows no stacks
        raise LimitViolation(
            *(one.sentence() for one in drafted.broken),
            *filter(None, [better.advice]),
            reasons=[one.reason() for one in drafted.broken],
            suggestions=better.suggestions,
        )
    return drafted
