"""Searches over convex programs for the quickest course over stacks, or the calmest of a duration."""

import math
from collections.abc import Callable
from functools import partial

import attrs
import numpy as np

from gen_profile.methods.solvers.draft import in_cycles
from gen_profile.methods.solvers.over_stacks.bay import Bay
from gen_profile.methods.solvers.over_stacks.guide import Guide
from gen_profile.methods.solvers.over_stacks.hoist import Pieces
from gen_profile.methods.solvers.over_stacks.program import (
    FEW_STEPS,
    MISSING,
    STEPS,
    Course,
    Program,
    resting,
)
from gen_profile.methods.solvers.over_stacks.swing import CARRIED
from gen_profile.methods.solvers.search import Search, least
from gen_profile.spec.values import LONGEST_MOVE
from gen_profile.support.errors import Code, Reason, SolverDiverged
from gen_profile.support.phrase import Phrase

ENOUGH = 4e-4  # m that may be missing to it, less than the check allows
# how much room is missing falls with the duration by about the trolley's speed
ROUGH = Search(precision=4e-3, close=8e-3, slope=2.0, believed=(0.2, 20.0), longest=0.4, downward=True)
FIRST = attrs.evolve(ROUGH, close=math.inf, downward=False)
EXACT = attrs.evolve(ROUGH, precision=8e-4, close=1e-3)
DECIDED_BY_HOIST = 0.3  # s, beyond the hoist's own least time, up to which no other height is quicker
SPARE = 0.02  # m above the height that is needed, for clearance that is asked for later
LOWER = (0.0, 0.25, 0.5, 0.75)  # of the way from the height that is needed to the top, as other heights
WAITS = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (3.0, 0.0))  # s before the hoist starts, and after it ends
WORTH = 2e-3  # of the duration, that another height must save; then twice as much, and so on
SETTLED = 1e-7  # m, rad and their rates, by which a machine may be elsewhere after an interval
NEARLY = (
    0.3  # m that may be missing where machines are linear about rest: as they swing, they have more or less
)
NEARER = 0.05  # likewise where they are linear about how the nominal one swings
STILL_LACKING = 0.9  # of what a course lacked, from which on turning lines past corners is no help any more
SHORTER, LEAST_SHORTER = 0.12, 4e-3  # of the duration, by which a way around something is shortened at once
MORE, LESS = 1.3, 0.4  # times as much next, where it has room or has not
LENGTHENED = 1.005  # times as long, where asking for more clearance gives none
LEAST_WINDOW = 0.4  # s, by which loads may pass corners early or late

Lifted = Callable[[float], Pieces | None]  # from a duration in s to the hoist's motion


# course of the least duration, with a little less clearance, and the way around something it was found on
Chosen = tuple[Course, Lifted, Guide | None]


@attrs.frozen(kw_only=True)
class StackOptions:
    """How long a motion over stacks is looked for; see docs/solvers.md for the evidence.

    Attributes
    ----------
    answer : (float, float)
        s of work, as it is counted, for all that a spec asks for or would do instead, and of the processor.
    rounds : int
        Of linearising anew, of turning lines past corners, and of asking for more clearance, at most.
    tries : int
        Durations, where the machines themselves have too little room,
    longer : float
        by which fraction the second is longer than the first,
    growth : float
        and times as large from one to the next.
    """

    answer: tuple[float, float] = (24.0, 40.0)
    rounds: int = 8
    tries: int = 12
    longer: float = 2e-3
    growth: float = 1.3


OPTIONS = StackOptions()


@attrs.define(kw_only=True)
class StackSearch:
    """Searches over programs, and counts them."""

    bay: Bay
    options: StackOptions = OPTIONS
    programs: int = 0
    chosen: Chosen | None = None

    def solved(self, about: Course, steps: int = STEPS) -> Course | None:
        """Solve a program about a course, for the most room."""
        self.programs += 1
        return Program(bay=self.bay, about=about, steps=steps).solve(smooth=False)

    def quickest(
        self, lifted: Lifted, start: float, search: Search, near: Course | None = None
    ) -> Course | None:
        """Find the course of least duration that has room, machines being linear about rest or another."""
        found: dict[float, Course] = {}

        def excess(duration: float) -> float:
            up = lifted(duration)
            about = None if up is None else stretched(near, up) if near else resting(self.bay, up)
            steps = STEPS if search is EXACT else FEW_STEPS
            course = None if about is None else self.solved(about, steps)
            if course is None:
                return math.inf
            found[duration] = course
            missing = max(-course.room, course.miss) if course.miss > ENOUGH else -course.room
            return (missing - ENOUGH) / max(self.bay.way, 1.0)

        duration = least(excess, start, search, LONGEST_MOVE)
        return None if duration is None else found[duration]

    def course(self) -> Course | None:
        """Find what the spec asks for; none where its duration is too short.

        Raises
        ------
        SolverDiverged
        """
        move = self.bay.spec.move
        found = self.shortest() if move.shortest else self.in_time(move.duration)
        least = move.bounds.least or 0.0
        if found is not None and found.up.duration < least:
            found = self.in_time(in_cycles(self.bay.spec, least))
        return found

    def shortest(self) -> Course:
        """Find the quickest course that machines themselves follow with room; it ends on a cycle."""
        course, lifted = self.choose()
        bay = self.bay
        duration, longer = course.up.duration, self.options.longer
        for _ in range(self.options.tries):
            up = lifted(in_cycles(bay.spec, duration))
            assert up is not None  # in more time than before
            if (settled := self.settled(stretched(course, up))) is not None:
                return settled
            duration *= 1.0 + longer
            longer *= self.options.growth
        raise none_found(bay)

    def lengthen(self) -> None:
        """Take more time than the least that was found: its machines lack what no greater clearance gives."""
        if self.chosen is not None:
            course, lifted, guide = self.chosen
            up = lifted(LENGTHENED * course.up.duration)
            self.chosen = course if up is None else stretched(course, up), lifted, guide

    def choose(self) -> tuple[Course, Lifted]:
        """Find what `linear` does, once."""
        if self.chosen is None:
            self.chosen = (*self.linear(), self.bay.guide)
        course, lifted, guide = self.chosen
        self.bay = attrs.evolve(self.bay, guide=guide)
        return course, lifted

    def linear(self) -> tuple[Course, Lifted]:
        """Find how the hoist lifts, and the quickest course of machines that are linear about another."""
        bay, alone = self.bay, StackSearch(bay=self.bay.alone())
        start = max(alone.bay.quickest_pass(), bay.quickest_travel())
        lifted: Lifted = partial(bay.lifted, top=bay.top)
        if bay.guide is None:
            rough = _there(bay, alone.quickest(lifted, start, ROUGH))
        else:
            rough = alone.shortened(_there(bay, alone.quickest(lifted, start, FIRST)), lifted)
            self.bay = bay = attrs.evolve(bay, guide=alone.bay.guide)
        if rough.up.duration > bay.quickest_lift(bay.needed) + DECIDED_BY_HOIST:
            rough, lifted = alone.otherwise_lifted(rough, lifted, bay.needed)
        self.programs += alone.programs
        rough = with_others(bay, rough)
        near = self.solved(rough) or rough
        if len(bay.machines) > 1:
            start = max(bay.quickest_pass(), near.up.duration)
            near = _there(bay, self.quickest(lifted, start, ROUGH, near))
        return self.quickest(lifted, near.up.duration, EXACT, near) or near, lifted

    def shortened(self, course: Course, lifted: Lifted) -> Course:
        """Shorten a way around something; lines past corners turn when loads pass them."""
        shorter, least = SHORTER, max(self.bay.quickest_pass(), self.bay.directly())
        while shorter > LEAST_SHORTER:
            duration = max((1.0 - shorter) * course.up.duration, least)
            up = lifted(duration)
            window = max(shorter * course.up.duration / 2.0, LEAST_WINDOW)
            before, self.bay = self.bay, self.guided(course, window / course.up.duration)
            again = None if up is None else self.solved(stretched(course, up), FEW_STEPS)
            if again is not None and has_room(again):
                course, shorter = again, MORE * shorter
            else:
                self.bay, shorter = before, LESS * shorter
        self.bay = self.guided(course, LEAST_WINDOW / course.up.duration)
        return course

    def in_turns(self, course: Course) -> Course:
        """Let lines past corners turn as loads pass them, until a course around something has room."""
        for _ in range(self.options.rounds):
            if has_room(course):
                break
            before, self.bay = self.bay, self.guided(course, LEAST_WINDOW / course.up.duration)
            again = self.solved(course, FEW_STEPS)
            if again is None or lacking(again) > STILL_LACKING * lacking(course):
                self.bay = before
                break
            course = again
        return course

    def guided(self, course: Course, window: float) -> Bay:
        """Let lines past corners turn with the nominal machine's bodies on a course."""
        return self.bay.guided_by(Program(bay=self.bay, about=course).places, window)

    def otherwise_lifted(self, best: Course, lifted: Lifted, needed: float) -> tuple[Course, Lifted]:
        """Look for a lower top, then for waits of the hoist, that are quicker: where the trolley decides.

        Parameters
        ----------
        best : Course
        lifted : Lifted
        needed : float
            m, how far all machines have to be lifted.
        """
        bay, top = self.bay, self.bay.top
        least = min(needed + SPARE, bay.top)
        tops = [least + share * (bay.top - least) for share in LOWER]
        for lower, waits in [*((lower, WAITS[0]) for lower in tops), *((None, waits) for waits in WAITS[1:])]:
            way: Lifted = partial(bay.lifted, top=top if lower is None else lower, waits=waits)
            saved = WORTH
            while (up := way(best.up.duration * (1.0 - saved))) is not None:
                course = self.solved(resting(bay, up), FEW_STEPS)
                if course is None or not has_room(course):
                    break
                best, lifted, top = course, way, top if lower is None else lower
                saved *= 2.0
        return best, lifted

    def in_time(self, duration: float) -> Course | None:
        """Find the smoothest course of a duration that lifts little; none where it is too short."""
        bay = self.bay
        for top in (*(bay.needed + share * (bay.top - bay.needed) for share in LOWER), bay.top):
            up, alone = bay.lifted(duration, top), StackSearch(bay=bay.alone())
            course = None if up is None else alone.solved(resting(alone.bay, up), FEW_STEPS)
            if course is not None and bay.guide is not None:
                course = alone.in_turns(course)
            self.programs += alone.programs
            if course is not None and -course.room < NEARLY and course.miss < NEARLY:
                self.bay = attrs.evolve(bay, guide=alone.bay.guide)
                course = self.solved(with_others(self.bay, course))
                settled = None if course is None or course.room < -NEARER else self.settled(course)
                if settled is not None:
                    return settled
                self.bay = bay  # lines that turned with a course which is none would mislead the next one
        quickest, lifted = self.choose()
        up = lifted(duration) if quickest.up.duration <= duration else None
        return None if up is None else self.settled(stretched(quickest, up))

    def settled(self, course: Course) -> Course | None:
        """Linearise anew until machines do what the program says; the smoothest such course, with room."""
        for _ in range(self.options.rounds):
            program = Program(bay=self.bay, about=course)
            if course.smooth and program.defect < SETTLED:
                break
            self.programs += 1
            smoother = program.solve(smooth=True)
            if smoother is None or (
                course.smooth and not has_room(smoother) and smoother.room < course.room + ENOUGH
            ):
                return None
            course = smoother
        return course if has_room(course) else None


def has_room(course: Course) -> bool:
    """Whether a course reaches its target with nearly as much room as it shall have."""
    return course.room >= -ENOUGH and course.miss <= ENOUGH


def lacking(course: Course) -> float:
    """Weigh what a course lacks as programs do: room to stacks, and its way to the target, which is dear."""
    return MISSING * max(course.miss, 0.0) + max(-course.room, 0.0)


def with_others(bay: Bay, course: Course) -> Course:
    """Let all machines be linear about hanging below the trolley of a course of the nominal one."""
    nominal = course.nodes[0]
    others = np.tile(bay.begin[: bay.others.states], (len(bay.machines) - 1, len(nominal), 1))
    others[..., : bay.others.carried] = nominal[:, : bay.others.carried]
    return attrs.evolve(course, nodes=(nominal, others))


def stretched(course: Course, up: Pieces) -> Course:
    """Let a course last as long as another motion of the hoist."""
    ratio, lines = course.up.duration / up.duration, course.jerks.shape[1]
    slower = np.ones(course.nodes[0].shape[-1])
    slower[: CARRIED * lines] = np.tile(ratio ** np.arange(float(CARRIED)), lines)
    nominal, others = course.nodes
    nodes = (nominal * slower, others * slower[: others.shape[-1]])
    return attrs.evolve(course, up=up, jerks=course.jerks * ratio**3, nodes=nodes)


def _there(bay: Bay, course: Course | None) -> Course:
    if course is None:
        raise none_found(bay)
    return course


def none_found(bay: Bay) -> SolverDiverged:
    """Say that no motion was found: the likeliest cause is an end beside which loads swing on too far."""
    template = "move.duration: no duration was found in which the load passes the stacks; widen the limits."
    if not bay.spec.move.shortest:
        template = (
            "move.duration: no motion of {asked:g} s was found in which the load passes the stacks; try "
            "another duration, or widen the limits."
        )
    sentence = Phrase(template, asked=bay.spec.move.duration)
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
