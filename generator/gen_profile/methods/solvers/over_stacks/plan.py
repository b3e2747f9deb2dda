"""The quickest motion over stacks, or the calmest within a time: searches over convex programs."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial, reduce
from itertools import pairwise
from typing import Any

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.clearance import Nearest, nearest
from gen_profile.dynamics.evaluation.residual_sway import observation_time
from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.dynamics.problem.parameter_box import machines_of
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers.draft import Passage, Plan, lasting, suggested
from gen_profile.methods.solvers.over_stacks.around import way_of
from gen_profile.methods.solvers.over_stacks.bay import Bay, bay_of
from gen_profile.methods.solvers.over_stacks.guide import Place
from gen_profile.methods.solvers.over_stacks.hoist import Pieces
from gen_profile.methods.solvers.over_stacks.program import (
    INTERVAL,
    Course,
    Program,
    resting,
)
from gen_profile.methods.solvers.over_stacks.searches import (
    ENOUGH,
    FIRST,
    OPTIONS,
    ROUGH,
    Chosen,
    StackSearch,
    none_found,
)
from gen_profile.motion.profile import Array, Profile
from gen_profile.spec.model import Spec
from gen_profile.spec.stacks import StackZone
from gen_profile.support.errors import (
    Code,
    InfeasibleProblem,
    NoMotion,
    Reason,
    Suggestion,
    rounded_down,
    rounded_up,
)
from gen_profile.support.phrase import Phrase
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.work import OutOfWork

METHOD = "over stacks"
RESERVE = 2e-3  # m of clearance, for what lies between the steps of programs
WATCHED = 4001  # times at which machines are looked at
ACCURACY = 1e-7  # of machines that are looked at, relative
CLOSE = 1e-9  # s, between knots that are one
OVERALL = 1e-3  # m of clearance that is asked for beyond what another machine of the ranges lacked


def over_stacks(spec: Spec, progress: Progress = no_progress, chosen: Chosen | None = None) -> Plan:
    """Find the motion of trolley and hoist over what stands there.

    Parameters
    ----------
    spec : Spec
    progress : callable
    chosen : Chosen, optional
        Of the same move in another duration, where that was found already.

    Raises
    ------
    InfeasibleProblem, SolverDiverged
        With what is in the way, and by how much.
    """
    began, reserve, before = time.perf_counter(), RESERVE, -math.inf
    progress("solving")
    planner = StackSearch(bay=way_of(spec, reserve), chosen=chosen)
    _require_height(planner.bay)
    for _ in range(OPTIONS.rounds):
        try:
            course = planner.course()
        except OutOfWork as error:
            raise none_found(planner.bay) from error
        if course is None:
            raise _refusal(planner)
        motion = _profile(planner.bay, course)
        near = _nearest(spec, motion)
        if near.room >= -ENOUGH:
            break
        if near.room < before + ENOUGH:
            planner.lengthen()
        reserve, before = reserve + OVERALL - near.room, near.room
        planner.bay = bay_of(spec, reserve, planner.bay.guide)
    else:
        raise none_found(planner.bay)
    passage = Passage(
        lift=course.up.peak(),
        one_by_one=_one_by_one(planner.bay),
        nearest=near,
        programs=planner.programs,
    )
    return Plan(
        spec=lasting(spec, motion.duration) if spec.move.shortest else spec,
        solution=None,
        found=motion,
        solver_time=time.perf_counter() - began,
        passage=passage,
    )


def sketched(spec: Spec) -> Array | None:
    """Find about where the nominal machine's bodies go, in some hundredths of a second; none if not found.

    Returns
    -------
    (samples, bodies, 3) array
        m.
    """
    bay = way_of(spec, RESERVE).alone()
    bay = attrs.evolve(bay, nominal=bay.others)  # without sensitivities
    planner, lifted = StackSearch(bay=bay), partial(bay.lifted, top=bay.top)
    course: Course | None = None
    if spec.move.shortest:
        start = max(bay.quickest_pass(), bay.quickest_travel())
        course = planner.quickest(lifted, start, ROUGH if bay.guide is None else FIRST)
    elif (up := lifted(spec.move.duration)) is not None:
        course = planner.solved(resting(bay, up))
    if course is None:
        return None
    along = Program(bay=bay, about=course).places
    places = sum(np.array(line.origin) + along[:, :, k, None] * line.way for k, line in enumerate(bay.lines))
    times = np.linspace(0.0, course.up.duration, len(along))
    z = bay.hang[0] + course.up.at(times)[:, :1]
    return np.concatenate([places, z[:, :, None]], axis=2)


def _nearest(spec: Spec, motion: Profile) -> Nearest:
    """Look for the least room of machines all over the ranges, on the way and while they swing on."""
    named = machines_of(problem_of(spec, whole=True))
    until = motion.duration + observation_time(spec)
    swing = PlantSimulation(spec.machine(), motion, named, until, spec.move.initial, accuracy=ACCURACY)
    times = np.linspace(0.0, until, WATCHED)
    return min((nearest(spec, times, bodies) for bodies in swing.bodies(times)), key=lambda one: one.room)


def _one_by_one(bay: Bay) -> float | None:
    """Tell how long lifting, travelling without sway and lowering take one after the other, in s."""
    total, legs = bay.quickest_lift(bay.needed), [bay] if bay.guide is None else _legs(bay, bay.guide.route)
    for one in legs:
        alone = attrs.evolve(one.alone(), zones=())
        held = StackSearch(bay=alone).quickest(partial(_held, bay.needed), one.directly() + INTERVAL, ROUGH)
        if held is None:
            return None
        total += held.up.duration
    return total


def _legs(bay: Bay, route: Sequence[Place]) -> Iterator[Bay]:
    """Take every straight part of a way around something by itself."""
    axes, move = bay.axes.along, bay.spec.move
    for leg in pairwise(route):
        start, target = ([*move.start], [*move.start])
        for end, place in zip((start, target), leg, strict=True):
            for axis, at in zip(axes, place, strict=True):
                end[axis] = at
        yield bay_of(bay.spec.changed({"move.start": start, "move.target": target}))


def _held(lift: float, duration: float) -> Pieces:
    return Pieces(lengths=np.array([duration]), jerks=np.zeros(1), start=lift)


def _profile(bay: Bay, course: Course) -> Profile:
    """Write the course as polynomials of all axes, with ends that are exact."""
    lengths, move = np.full(len(course.jerks), course.up.duration / len(course.jerks)), bay.spec.move
    ways = np.array([line.way for line in bay.lines])
    axes = {
        axis: _to_rest(lengths, course.jerks @ ways[:, k], move.start[axis], move.target[axis])
        for k, axis in enumerate(bay.axes.along)
    }
    axes[bay.hoist] = _to_rest(
        course.up.lengths, -course.up.jerks, move.start[bay.hoist], move.target[bay.hoist]
    )
    knots = reduce(np.union1d, [one.knots for one in axes.values()])
    knots = knots[np.append(np.diff(knots) > CLOSE, True)]
    knots[0], knots[-1] = 0.0, course.up.duration
    columns = {axis: one.at(knots[:-1]) for axis, one in axes.items()}
    taylor = np.stack([columns[axis] for axis in sorted(columns)], axis=2)
    return Profile(
        knots=knots,
        coefficients=taylor / np.array([1.0, 1.0, 2.0, 6.0])[:, None],
        target=np.array(bay.spec.move.target),
        method=METHOD,
    )


def _to_rest(lengths: Array, jerks: Array, start: float, target: float) -> Pieces:
    """Change jerks by as little as ends the motion at rest at its target, to rounding."""
    knots = np.concatenate([[0.0], np.cumsum(lengths)])
    left = knots[-1] - knots
    powers = [-np.diff(left**order) / math.factorial(order) for order in (3, 2, 1)]
    ends = np.array(powers)
    off = np.array([target - start, 0.0, 0.0]) - ends @ jerks
    weights = lengths[:, None] * ends.T
    return Pieces(lengths=lengths, jerks=jerks + weights @ np.linalg.solve(ends @ weights, off), start=start)


def _require_height(bay: Bay) -> None:
    """Refuse stacks that the hoist cannot lift the load over, at its top or below what is overhead."""
    lacking = bay.needed - bay.top
    if lacking <= 0.0:
        return
    path, passed = bay.spec.path, [zone for zone in bay.zones if bay.passes(zone)]
    assert path is not None
    stack = max((zone for zone in passed if not zone.overhead), key=lambda zone: zone.top)
    lowest = min(passed, key=bay.headroom)
    beam = lowest if bay.headroom(lowest) <= bay.top else None
    if beam is not None:
        lacking = bay.needed - bay.headroom(beam)  # the top is no lower than start and target
    sideways, above = path.clearances
    values = {
        "stack": path.named(stack.obstacle),
        "body": bay.plant.bodies[stack.body],
        "lacking": lacking,
    }
    if beam is None:
        place, less = "path.stacks", above - lacking - RESERVE
        template = (
            "path.stacks: {stack} is in the way: at the hoist's top the {body} is {lacking:.3g} m too low to "
            "pass it with path.clearance."
        )
        if len(bay.axes.along) == 2:
            template = (
                "path.stacks: {stack} is in the way: at the hoist's top the {body} is {lacking:.3g} m too "
                "low to pass it with path.clearance, and the travel leaves no way around."
            )
    else:
        place, less = "path.overhead", above - lacking / 2.0 - RESERVE
        values["beam"] = path.named(beam.obstacle)
        template = (
            "path.overhead: {beam} is in the way: below it the {body} is {lacking:.3g} m too low to pass "
            "{stack}, with path.clearance to both; a load that passes one before the other goes by two moves."
        )
    less = rounded_down(max(less, 1e-9))
    raise InfeasibleProblem(
        Phrase(template, **values),
        reasons=[Reason(code=Code.INFEASIBLE, place=place, found=bay.needed, allowed=bay.top)],
        suggestions=_tried(bay.spec, {"path.clearance": (sideways, less)}) if less > 1e-3 else (),
    )


def _refusal(planner: StackSearch) -> InfeasibleProblem:
    """Say what is in the way in the time that is asked for, by how much, and which time was found to do."""
    bay, asked = planner.bay, planner.bay.spec.move.duration
    up = bay.lifted(asked, bay.top)
    course = None if up is None else planner.solved(resting(bay, up))
    sentence = Phrase("move.duration: the hoist alone takes longer than {asked:g} s.", asked=asked)
    if course is not None:
        (zone, missing), path = _in_the_way(bay, course), bay.spec.path
        wall = next(filter(bay.goes_around, bay.zones), None)
        assert path is not None
        if zone is None or course.miss > max(missing, ENOUGH):
            template = "move.duration: in {asked:g} s the trolley stays {miss:.3g} m away from its target."
            sentence = Phrase(template, asked=asked, miss=course.miss)
            if wall is not None:
                template = (
                    "move.duration: in {asked:g} s the trolley stays {miss:.3g} m away from its target, on "
                    "its way around {obstacle}."
                )
                around = path.named(wall.obstacle)
                sentence = Phrase(template, asked=asked, miss=course.miss, obstacle=around)
        else:
            template = "move.duration: in {asked:g} s the {body} is {missing:.3g} m too near to {obstacle}."
            body, obstacle = bay.plant.bodies[zone.body], path.named(zone.obstacle)
            sentence = Phrase(template, asked=asked, body=body, missing=missing, obstacle=obstacle)
    needed = rounded_up(planner.shortest().up.duration)
    values = {"move.duration": needed}
    return InfeasibleProblem(
        sentence,
        reasons=[Reason(code=Code.TOO_SHORT, place="move.duration", found=asked, allowed=needed)],
        suggestions=_tried(bay.spec, values, planner.chosen),
    )


def _tried(spec: Spec, values: Mapping[str, Any], chosen: Chosen | None = None) -> tuple[Suggestion, ...]:
    """Suggest values where they give a motion."""
    try:
        return (suggested(values, over_stacks(spec.changed(values), chosen=chosen)),)
    except NoMotion:
        return ()


def _in_the_way(bay: Bay, course: Course) -> tuple[StackZone | None, float]:
    """Find the stack that a course comes too near to, and by how much in m; none if nothing is there."""
    places = Program(bay=bay, about=course).places
    times = np.linspace(0.0, course.up.duration, len(places))[1:]

    def missing(zone: StackZone) -> float:
        rows, normals, most = attrs.evolve(bay, zones=(zone,)).sides(0, zone.body, course.up, times)
        at = places[1:][rows, zone.body]
        return float(((normals * at).sum(axis=1) - most).max(initial=-math.inf))

    each = ((zone, missing(zone)) for zone in bay.zones)
    return max(each, key=lambda pair: pair[1], default=(None, 0.0))
