"""What would let a refused planner block pass, each change by itself, tried by the same proof."""

import math
from collections.abc import Callable

import attrs

from gen_profile.assurance.proof.followed import LATENESS
from gen_profile.assurance.proof.orders import NO_MOTION
from gen_profile.assurance.proof.verdict import JudgedHistory, Proof
from gen_profile.methods.solvers.search import Search, least
from gen_profile.planner.directions import planned_axes
from gen_profile.spec.model import Spec
from gen_profile.support.errors import GenProfileError, Suggestion, rounded_down, rounded_up
from gen_profile.support.units import RATES

# stops at the first change that passes, and aims at 0.8 of the limit, as other histories may sway more
FIRST = Search(precision=0.01, aim=math.log(0.8), longest=math.inf, tries=5)
UNKNOWN = 1.25  # times the limit: at least so much a block counts that shows one of the next
FEW = 5  # first, as most fail: by so much fewer histories
GIVEN_UP = f"nErrorId {NO_MOTION:.0f}"  # a command, as any motion might leave more sway than allowed

Change = Callable[[Spec, float], tuple[Spec, dict[str, float]]]
Prove = Callable[[Spec, int], Proof]


def planner_suggestions(spec: Spec, proof: Proof, prove: Prove) -> tuple[Suggestion, ...]:
    """Look for changes that help, where sway is too much, or faults may come of it.

    What is wrong besides these may come of it: whatever is named is tried in full.

    Parameters
    ----------
    spec : Spec
    proof : Proof
        That failed.
    prove : Spec, int → Proof
        Of the block of a changed spec, on so many histories.
    """
    faulty = [judged for judged in proof.judged if judged.faults]
    if proof.faults or (faulty and not any(map(_may_come_of_sway, faulty))):
        return ()
    suggestions = (_tried(spec, proof, prove, change, power) for change, power in CHANGES.items())
    return tuple(suggestion for suggestion in suggestions if suggestion is not None)


def _may_come_of_sway(judged: JudgedHistory) -> bool:
    """Tell whether a history lost its promise, or a command was given up, or late: the block waits for it."""
    history = judged.history
    owed = not (history.brakes or history.disturbed or history.misinformed)
    given_up = any(output == GIVEN_UP for output, _ in judged.exercised)
    return (owed and not judged.promise) or given_up or any(one.is_late(LATENESS) for one in judged.obeyed)


def _tried(spec: Spec, failed: Proof, prove: Prove, change: Change, power: float) -> Suggestion | None:
    """Divide by a factor until the proof passes; the sway is taken to go with a power of it."""
    passed: list[Suggestion] = []

    def excess(factor: float) -> float:
        changed, values = change(spec, 1.0 / factor)
        proof = failed if factor == 1.0 else prove(changed, max(1, failed.count // FEW))
        if proof is not failed and proof.passed:
            proof = prove(changed, failed.count)
        fraction = proof.fraction(proof.worst)
        if proof.passed:
            passed.append(Suggestion(values=values, spec=changed, fraction=fraction))
            return -math.inf
        return math.log(max(fraction, UNKNOWN))

    try:
        if change(spec, 1.0)[1]:
            least(excess, 1.0, attrs.evolve(FIRST, slope=power, believed=(power, power)))
    except GenProfileError:  # out of what a spec or a block may be
        return None
    return passed[0] if passed else None


def _slower(spec: Spec, factor: float) -> tuple[Spec, dict[str, float]]:
    stated, axes = spec.limits.stated(), planned_axes(spec)
    places = dict.fromkeys(spec.limits.place(axis, name) for axis in axes for name in RATES)
    values = {place: rounded_down(factor * stated[place], digits=2) for place in places}
    return spec.changed(values), values


def _surer(spec: Spec, factor: float) -> tuple[Spec, dict[str, float]]:
    stated = spec.robustness.uncertain if spec.check.uncertain is None else spec.check.uncertain
    errors = {name: rounded_down(factor * error, digits=2) for name, error in stated.items()}
    values = {f"check.uncertain.{name}": error for name, error in errors.items()}
    return spec.changed({"check.uncertain": errors}), values


def _more_allowed(spec: Spec, factor: float) -> tuple[Spec, dict[str, float]]:
    sway = {load: rounded_up(most / factor, digits=2) for load, most in spec.check.residual_sway.items()}
    values = {f"check.residual_sway.{load}": most for load, most in sway.items()}
    if len(set(sway.values())) == 1:
        values = {"check.residual_sway": next(iter(sway.values()))}
    return spec.changed({"check.residual_sway": sway}), values


CHANGES: dict[Change, float] = {  # and the power of its factor that the sway goes with
    _surer: 2.0,
    _slower: 1.0,
    _more_allowed: 1.0,
}
