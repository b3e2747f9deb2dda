"""The quickest motion over stacks, or the calmest within a time: searches over convex programs."""

import math
import time
from collections.abc import Callable, Mapping
from functools import partial, reduce
from typing import Any

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.clearance import Nearest, nearest
from gen_profile.dynamics.evaluation.residual_sway import observation_time
from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.dynamics.problem.parameter_box import machines_of
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers.draft import Passage, Plan, in_cycles, lasting, suggested
from gen_profile.methods.solvers.over_stacks.bay import Bay, bay_of
from gen_profile.methods.solvers.over_stacks.hoist import Pieces
from gen_profile.methods.solvers.over_stacks.program import INTERVAL, Course, Program, resting
from gen_profile.methods.solvers.search import Search, least
from gen_profile.motion.profile import Array, Profile
from gen_profile.spec.model import Spec
from gen_profile.spec.stacks import StackZone
from gen_profile.spec.values import LONGEST_MOVE
from gen_profile.support.errors import (
    Code,
    InfeasibleProblem,
    NoMotion,
    Reason,
    SolverDiverged,
    Suggestion,
    rounded_down,
    rounded_up,
)
from gen_profile.support.phrase import Phrase
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.work import OutOfWork

METHOD = "over stacks"
RESERVE = 2e-3  # m of clearance, for what lies between the steps of programs
ENOUGH = 4e-4  # m that may be missing to it, less than the check allows
# how much room is missing falls with the duration by about the trolley's speed
ROUGH = Search(precision=4e-3, close=8e-3, slope=2.0, believed=(0.2, 20.0), longest=0.4, downward=True)
EXACT = attrs.evolve(ROUGH, precision=8e-4, close=1e-3)
DECIDED_BY_HOIST = 0.3  # s, beyond the hoist's own least time, up to which no other height is quicker
SPARE = 0.02  # m above the height that is needed, for clearance that is asked for later
LOWER = (0.0, 0.25, 0.5, 0.75)  # of the way from the height that is needed to the top, as other heights
WAITS = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (3.0, 0.0))  # s before the hoist starts, and after it ends
WORTH = 2e-3  # of the duration, that another height must save; then twice as much, and so on
ROUNDS = 8  # of linearising anew
SETTLED = 1e-7  # m, rad and their rates, by which a machine may be elsewhere after an interval
LONGER = 2e-3  # of the duration that is added where the machines themselves have too little room
TRIES = 12
WATCHED = 4001  # times at which machines are looked at
NEARLY = (
    0.3  # m that may be missing where machines are linear about rest: as they swing, they have more or less
)
ACCURACY = 1e-7  # of machines that are looked at, relative
CLOSE = 1e-9  # s, between knots that are one
OVERALL = 1e-3  # m of clearance that is asked for beyond what another machine of the ranges lacked

Lifted = Callable[[float], Pieces | None]  # from a duration in s to the hoist's motion


@attrs.define(kw_only=True)
class _Planner:
    """Searches over programs, and counts them."""

    bay: Bay
    programs: int = 0
    chosen: tuple[Course, Lifted] | None = None  # of the least duration, with a little less clearance

    def solved(self, about: Course, *, smooth: bool = False) -> Course | None:
        """Solve a program about a course."""
        self.programs += 1
        return Program(bay=self.bay, about=about).solve(smooth=smooth)

    def quickest(
        self, lifted: Lifted, start: float, search: Search, near: Course | None = None
    ) -> Course | None:
        """Find the course of least duration that has room, machines being linear about rest or another."""
        found: dict[float, Course] = {}

        def excess(duration: float) -> float:
            up = lifted(duration)
            about = None if up is None else stretched(near, up) if near else resting(self.bay, up)
            course = None if about is None else self.solved(about)
            if course is None:
                return math.inf
            found[duration] = course
            lacking = max(-course.room, course.miss) if course.miss > ENOUGH else -course.room
            return (lacking - ENOUGH) / max(self.bay.way, 1.0)

        duration = least(excess, start, search, LONGEST_MOVE)
        return None if duration is None else found[duration]

    def course(self) -> Course:
        """Find what the spec asks for.

        Raises
        ------
        InfeasibleProblem, SolverDiverged
        """
        _require_height(self.bay)
        move = self.bay.spec.move
        found = self.shortest() if move.shortest else self.in_time(move.duration)
        least = move.bounds.least or 0.0
        if found is not None and found.up.duration < least:
            found = self.in_time(in_cycles(self.bay.spec, least))
        if found is None:
            raise _refusal(self)
        return found

    def shortest(self) -> Course:
        """Find the quickest course that machines themselves follow with room; it ends on a cycle."""
        bay = self.bay
        course, lifted = self.chosen = self.chosen or self.linear()
        duration = course.up.duration
        for _ in range(TRIES):
            up = lifted(in_cycles(bay.spec, duration))
            assert up is not None  # in more time than before
            if (settled := self.settled(stretched(course, up))) is not None:
                return settled
            duration *= 1.0 + LONGER
        raise _none_found(bay)

    def linear(self) -> tuple[Course, Lifted]:
        """Find how the hoist lifts, and the quickest course of machines that are linear about another."""
        bay, alone = self.bay, _Planner(bay=self.bay.alone())
        start = max(bay.quickest_lift(bay.needed), bay.quickest_travel())
        lifted: Lifted = partial(bay.lifted, top=bay.top)
        rough = _there(bay, alone.quickest(lifted, start, ROUGH))
        if rough.up.duration > bay.quickest_lift(bay.needed) + DECIDED_BY_HOIST:
            rough, lifted = alone.otherwise_lifted(rough, lifted)
        self.programs += alone.programs
        if len(bay.machines) > 1:
            rough = _there(bay, self.quickest(lifted, rough.up.duration, ROUGH))
        near = self.solved(rough) or rough
        return self.quickest(lifted, near.up.duration, EXACT, near) or near, lifted

    def otherwise_lifted(self, best: Course, lifted: Lifted) -> tuple[Course, Lifted]:
        """Look for a lower top, then for waits of the hoist, that are quicker: where the trolley decides."""
        bay, top = self.bay, self.bay.top
        least = min(bay.needed + SPARE, bay.top)
        tops = [least + share * (bay.top - least) for share in LOWER]
        for lower, waits in [*((lower, WAITS[0]) for lower in tops), *((None, waits) for waits in WAITS[1:])]:
            way: Lifted = partial(bay.lifted, top=top if lower is None else lower, waits=waits)
            saved = WORTH
            while (up := way(best.up.duration * (1.0 - saved))) is not None:
                course = self.solved(resting(bay, up))
                if course is None or not has_room(course):
                    break
                best, lifted, top = course, way, top if lower is None else lower
                saved *= 2.0
        return best, lifted

    def in_time(self, duration: float) -> Course | None:
        """Find the smoothest course of a duration that lifts little; none where it is too short."""
        bay = self.bay
        for top in (*(bay.needed + share * (bay.top - bay.needed) for share in LOWER), bay.top):
            up = bay.lifted(duration, top)
            course = None if up is None else self.solved(resting(bay, up))
            if course is not None and -course.room < NEARLY and course.miss < NEARLY:
                settled = self.settled(self.solved(course) or course)
                if settled is not None:
                    return settled
        return None

    def settled(self, course: Course) -> Course | None:
        """Linearise anew until machines do what the program says; the smoothest such course, with room."""
        for _ in range(ROUNDS):
            program = Program(bay=self.bay, about=course)
            if course.smooth and program.defect < SETTLED:
                break
            self.programs += 1
            smoother = program.solve(smooth=True)
            if smoother is None:
                return None
            course = smoother
        return course if has_room(course) else None


def has_room(course: Course) -> bool:
    """Whether a course reaches its target with nearly as much room as it shall have."""
    return course.room >= -ENOUGH and course.miss <= ENOUGH


def stretched(course: Course, up: Pieces) -> Course:
    """Let a course last as long as another motion of the hoist."""
    ratio = course.up.duration / up.duration
    slower = np.ones(course.nodes[0].shape[-1])
    slower[:3] = ratio ** np.arange(3.0)
    nominal, others = course.nodes
    nodes = (nominal * slower, others * slower[: others.shape[-1]])
    return attrs.evolve(course, up=up, jerks=course.jerks * ratio**3, nodes=nodes)


def _there(bay: Bay, course: Course | None) -> Course:
    if course is None:
        raise _none_found(bay)
    return course


def _none_found(bay: Bay) -> SolverDiverged:
    """Say that no motion was found: the likeliest cause is an end beside which loads swing on too far."""
    sentence = Phrase(
        "move.duration: no duration was found in which the load passes the stacks; widen the limits."
    )
    zone, room = bay.tightest
    path, allowed = bay.spec.path, max(bay.spec.check.residual_sway.values())
    if len(bay.machines) > 1 and zone is not None and room < allowed:
        assert path is not None
        sentence = Phrase(
            "move.target: no motion was found after which the {body} keeps its clearance to {obstacle}, to "
            "which it has {room:.3g} m more at the target; move the target away from it, narrow the ranges, "
            "or allow a smaller path.clearance.",
            body=bay.plant.bodies[zone.body],
            obstacle=path.named(zone.obstacle),
            room=room,
        )
    place = sentence.split(":")[0]
    return SolverDiverged(sentence, reasons=[Reason(code=Code.DIVERGED, place=place)])


def over_stacks(spec: Spec, progress: Progress = no_progress) -> Plan:
    """Find the motion of trolley and hoist over what stands there.

    Raises
    ------
    InfeasibleProblem, SolverDiverged
        With what is in the way, and by how much.
    """
    began, reserve = time.perf_counter(), RESERVE
    progress("solving")
    planner = _Planner(bay=bay_of(spec, reserve))
    for _ in range(ROUNDS):
        try:
            course = planner.course()
        except OutOfWork as error:
            raise _none_found(planner.bay) from error
        motion = _profile(planner.bay, course)
        near = _nearest(spec, motion)
        if near.room >= -ENOUGH:
            break
        reserve += OVERALL - near.room
        planner.bay = bay_of(spec, reserve)
    else:
        raise _none_found(planner.bay)
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
    (samples, bodies, 2) array
        m, along the line and above the suspension.
    """
    bay = bay_of(spec, RESERVE).alone()
    bay = attrs.evolve(bay, nominal=bay.others)  # without sensitivities
    planner, lifted = _Planner(bay=bay), partial(bay.lifted, top=bay.top)
    course: Course | None = None
    if spec.move.shortest:
        start = max(bay.quickest_lift(bay.needed), bay.quickest_travel())
        course = planner.quickest(lifted, start, ROUGH)
    elif (up := lifted(spec.move.duration)) is not None:
        course = planner.solved(resting(bay, up))
    if course is None:
        return None
    seen = Program(bay=bay, about=course).followed[0].seen[0, :, :-1, :-1]
    x = seen.reshape(-1, seen.shape[-1])
    times = np.linspace(0.0, course.up.duration, len(x), endpoint=False)
    z = bay.hang[0] + course.up.at(times)[:, :1]
    return np.stack([x, z], axis=2)


def _nearest(spec: Spec, motion: Profile) -> Nearest:
    """Look for the least room of machines all over the ranges, on the way and while they swing on."""
    named = machines_of(problem_of(spec, whole=True))
    until = motion.duration + observation_time(spec)
    swing = PlantSimulation(spec.machine(), motion, named, until, spec.move.initial, accuracy=ACCURACY)
    times = np.linspace(0.0, until, WATCHED)
    return min((nearest(spec, times, bodies) for bodies in swing.bodies(times)), key=lambda one: one.room)


def _one_by_one(bay: Bay) -> float | None:
    """Tell how long lifting, travelling without sway and lowering take one after the other, in s."""
    lift = bay.needed
    alone = attrs.evolve(bay.alone(), zones=())
    held = _Planner(bay=alone).quickest(partial(_held, lift), bay.quickest_travel() + INTERVAL, ROUGH)
    return None if held is None else bay.quickest_lift(lift) + held.up.duration


def _held(lift: float, duration: float) -> Pieces:
    return Pieces(lengths=np.array([duration]), jerks=np.zeros(1), start=lift)


def _profile(bay: Bay, course: Course) -> Profile:
    """Write the course as polynomials of all axes, with ends that are exact."""
    lengths, move = np.full(len(course.jerks), course.up.duration / len(course.jerks)), bay.spec.move
    axes = {
        axis: _to_rest(lengths, way * course.jerks, move.start[axis], move.target[axis])
        for axis, way in zip(bay.axes.along, bay.line.way, strict=False)
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
                "low to pass it with path.clearance; the way is straight in plan view, and one around it "
                "takes two moves."
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


def _refusal(planner: _Planner) -> InfeasibleProblem:
    """Say what is in the way in the time that is asked for, by how much, and which time was found to do."""
    bay, asked = planner.bay, planner.bay.spec.move.duration
    up = bay.lifted(asked, bay.top)
    course = None if up is None else planner.solved(resting(bay, up))
    sentence = Phrase("move.duration: the hoist alone takes longer than {asked:g} s.", asked=asked)
    if course is not None:
        zone, missing = _in_the_way(bay, course)
        template = "move.duration: in {asked:g} s the {body} is {missing:.3g} m too near to {obstacle}."
        body, path = bay.plant.bodies[zone.body], bay.spec.path
        assert path is not None
        obstacle = path.named(zone.obstacle)
        sentence = Phrase(template, asked=asked, body=body, missing=missing, obstacle=obstacle)
        if course.miss > max(missing, ENOUGH):
            template = "move.duration: in {asked:g} s the trolley stays {miss:.3g} m away from its target."
            sentence = Phrase(template, asked=asked, miss=course.miss)
    needed = rounded_up(planner.shortest().up.duration)
    values = {"move.duration": needed}
    return InfeasibleProblem(
        sentence,
        reasons=[Reason(code=Code.TOO_SHORT, place="move.duration", found=asked, allowed=needed)],
        suggestions=_tried(bay.spec, values),
    )


def _tried(spec: Spec, values: Mapping[str, Any]) -> tuple[Suggestion, ...]:
    """Suggest values where they give a motion."""
    try:
        return (suggested(values, over_stacks(spec.changed(values))),)
    except NoMotion:
        return ()


def _in_the_way(bay: Bay, course: Course) -> tuple[StackZone, float]:
    """Find the stack that a course comes too near to, and by how much in m."""
    one = Program(bay=bay, about=course).followed[0]
    places = one.seen[0, :, 1:].reshape(-1, one.seen.shape[-1])
    times = np.linspace(0.0, course.up.duration, len(places) + 1)[1:]

    def missing(zone: StackZone) -> float:
        low, high = attrs.evolve(bay, zones=(zone,)).bounds(0, zone.body, course.up, times)
        x = places[:, zone.body]
        return float(np.maximum(low - x, x - high).max())

    return max(((zone, missing(zone)) for zone in bay.zones), key=lambda pair: pair[1])
