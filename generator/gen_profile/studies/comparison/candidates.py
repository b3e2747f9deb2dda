"""Who takes part in a comparison: every shaper, and variants of the optimal motion."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from typing import Any

import attrs

from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.shapers.impulses import SHAPERS
from gen_profile.methods.solvers import suggestions, transient_sway
from gen_profile.methods.solvers.motion import whole_motion
from gen_profile.methods.solvers.shape import shaped_motion
from gen_profile.methods.solvers.shortest import timed
from gen_profile.motion.actuator import lag_compensated
from gen_profile.motion.metrics import greatest
from gen_profile.motion.profile import Profile
from gen_profile.spec.model import Spec
from gen_profile.spec.stack_rules import refuse_stacks
from gen_profile.spec.values import NONE
from gen_profile.support.errors import GenProfileError, InfeasibleProblem, SpecError

SWAY_WEIGHTS = (0.0, 20.0, 50.0)  # the paper's
# what a robustness method is called, and its keys in the spec
ROBUST: dict[str, Mapping[str, Any]] = {
    "order1": {"method": "sensitivity", "order": 1},
    "order2": {"method": "sensitivity", "order": 2},
    "range": {"method": "range"},
}


@attrs.frozen(kw_only=True, eq=False)
class Candidate:
    """A method that takes part.

    Attributes
    ----------
    method : str
    design : () → Profile
        Raises a `GenProfileError` where the method has no motion for the move.
    requirements : str
        Candidates of the same requirements have a motion all or none; empty where that says nothing.
    changes : mapping of str to value
        By which a spec asks for the method, by their places in it; none for its own one.
    """

    method: str
    design: Callable[[], Profile]
    requirements: str = ""
    changes: Mapping[str, Any] = NONE


def own_method(spec: Spec) -> str:
    """Name the spec's own method as a comparison does."""
    if spec.solver.shaper is not None:
        return spec.solver.shaper
    # β means the same as in the paper only together with a γ
    return "optimal" if spec.cost.sway_scale is None else f"optimal-beta{spec.cost.sway_weight:g}"


def candidates(spec: Spec, own: Sequence[Profile] = ()) -> Iterator[Candidate]:
    """List shapers, then optimal motions, then motions that were made elsewhere.

    Parameters
    ----------
    spec : Spec
        Each method takes the spec's duration, or its own shortest one where the spec asks for that; every
        shaper is fed with the spec's base move.
    own : sequence of Profile
        Each of a ``method`` of its own.

    Raises
    ------
    SpecError
        Two have the same name; or there is a path over stacks.
    """
    refuse_stacks(spec, "a comparison of methods")
    known = [*SHAPERS, *(candidate.method for candidate in _optimal_candidates(spec))]
    for motion in own:
        if motion.method in known:
            raise SpecError(f"Two motions are called {motion.method!r}; give yours another method.")
        known.append(motion.method)
    for name in SHAPERS:
        changes = {} if name == spec.solver.shaper else {"solver.method": name}
        yield Candidate(method=name, design=partial(shaped_motion, spec, name), changes=changes)
    yield from _optimal_candidates(spec)
    for motion in own:
        yield Candidate(method=motion.method, design=partial(_given, motion))


def _optimal_candidates(spec: Spec) -> Iterator[Candidate]:
    unshaped = {} if spec.solver.shaper is None else {"solver.method": "auto"}
    spec = spec.changed(unshaped)
    once = cache(partial(timed, spec))  # the shortest duration does not depend on β
    of_spec = cache(partial(_attempt, once))
    weight = spec.cost.sway_weight
    for other in sorted({*SWAY_WEIGHTS, weight}):
        name = own_method(spec) if other == weight else f"optimal-beta{other:g}"
        design = partial(_result, of_spec) if other == weight else partial(_weighed, once, other)
        changes = unshaped if other == weight else {**unshaped, "cost.sway_weight": other}
        yield Candidate(method=name, design=design, requirements="the spec's own", changes=changes)
    for kind, keys in _other_robustness(spec).items():
        robust = attrs.evolve(spec, robustness=attrs.evolve(spec.robustness, **keys))
        changes = {**unshaped, **{f"robustness.{key}": value for key, value in keys.items()}}
        design = partial(_optimal_within, robust, of_spec)
        yield Candidate(method=f"optimal-{kind}", design=design, changes=changes)


def _given(motion: Profile) -> Profile:
    return motion


def _other_robustness(spec: Spec) -> dict[str, Mapping[str, Any]]:
    """Choose from `ROBUST` what the spec does not ask for anyway."""
    asked = spec.robustness
    different = {kind: keys for kind, keys in ROBUST.items() if attrs.evolve(asked, **keys) != asked}
    return different if asked.uncertain else {}


def _optimal(spec: Spec) -> Profile:
    return whole_motion(spec, suggestions.solve(spec))


def _weighed(timed_spec: Callable[[], Spec], sway_weight: float) -> Profile:
    spec = timed_spec()
    return _optimal(attrs.evolve(spec, cost=attrs.evolve(spec.cost, sway_weight=sway_weight)))


def _optimal_within(spec: Spec, own: Callable[[], Profile | GenProfileError]) -> Profile:
    """Design an optimal motion with β = 0 at no more acceleration than the spec's own design takes.

    Nothing else would keep the least residual of the worst machine from taking any acceleration.
    """
    spec = attrs.evolve(spec, cost=attrs.evolve(spec.cost, sway_weight=0.0))
    motion = own()
    if spec.move.shortest or isinstance(motion, GenProfileError):
        return _optimal(timed(spec))
    command = lag_compensated(motion, spec.actuator.tau)
    taken = max(greatest(command, 2, axis) for axis in range(command.axes))
    problem = problem_of(attrs.evolve(spec, limits=attrs.evolve(spec.limits, acceleration=taken)))
    solution = transient_sway.kept_by_all(problem, "direct")
    if solution.optimum is None:
        unit = spec.machine().actuated[0].unit
        raise InfeasibleProblem(
            f"With no more acceleration than the spec's own design takes ({taken:.3g} {unit}/s²) "
            f"there is no such motion in {spec.move.duration:g} s."
        )
    return whole_motion(spec, solution)


def _attempt(timed_spec: Callable[[], Spec]) -> Profile | GenProfileError:
    """Design the spec's own motion, or say why there is none: it is asked for more than once."""
    try:
        return _optimal(timed_spec())
    except GenProfileError as error:
        return error


def _result(attempt: Callable[[], Profile | GenProfileError]) -> Profile:
    outcome = attempt()
    if isinstance(outcome, GenProfileError):
        raise outcome
    return outcome
