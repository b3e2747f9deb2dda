"""Setpoints that a written planner block issues while they are streamed, called cycle by cycle."""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import attrs
import can
import numpy as np

from gen_profile.delivery.streaming.keyboard import Keyboard
from gen_profile.delivery.streaming.status import StatusLine
from gen_profile.motion.profile import SampledProfile
from gen_profile.planner.commands import STANDSTILL_TIME, Command, inputs_of, start_cycles_of
from gen_profile.planner.directions import planned_axes, sensed_directions
from gen_profile.planner.events import error_words
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.interface import ISSUED, LOST, SENSOR, BlockAxis, live_inputs
from gen_profile.planner.stated import quick_limits
from gen_profile.spec.can import CanSpec
from gen_profile.spec.model import Spec
from gen_profile.support.errors import GenProfileError, SpecError, StreamAborted
from gen_profile.support.suggestion import suggestion
from gen_profile.support.units import AxisScale
from gen_profile_exporters.can import frames, scaling
from gen_profile_exporters.can.drive_units import exact
from gen_profile_exporters.can.frames import Integers
from gen_profile_exporters.can.sensor_frame import values_in
from gen_profile_exporters.can.streaming.plan import Step, cycle_of
from gen_profile_exporters.exporter import Target, target_of
from gen_profile_exporters.setpoints import INT32, TOO_FAR, require_within

MOST_CYCLES = 900_000  # cycles after which the axis is stopped without sway: an hour at 4 ms
STOP_CYCLES = 100_000  # cycles for that stop
PERIOD_TOLERANCE = 1e-9  # relative, of a period counted in the block's cycles


class CommandList:
    """Commands that are known beforehand, in the place of a `Keyboard`.

    Parameters
    ----------
    commands : sequence of Command
    cycle : float
        The block's, in s.
    """

    attends, commanded = False, ""

    def __init__(self, commands: Sequence[Command], cycle: float) -> None:
        self._left = list(zip(start_cycles_of(commands, cycle), commands, strict=True))

    @property
    def over(self) -> bool:
        """Whether no further command will come."""
        return not self._left

    def operated(self) -> AbstractContextManager[object]:
        """Need no operator."""
        return nullcontext()

    def due(self, cycle: int) -> Iterable[Command]:
        """Give the commands that begin in a cycle of the block."""
        while self._left and self._left[0][0] <= cycle:
            yield self._left.pop(0)[1]


Operator = Keyboard | CommandList


class PlannedMotion:
    """A planner block that drives its axes: a `gen_profile_exporters.can.streaming.plan.SetpointSource`.

    Parameters
    ----------
    spec : Spec
        The block's.
    block : BlockInstance
        Of the written text.
    operator : Operator
    live : mapping of str to float
        Live parameters by name that differ from what the block takes them for.
    watched : bool
        Whether feedback of the axes is read, now and then.

    Raises
    ------
    SpecError
        The block's cycle does not fit that of SYNC, its travel leaves the drive's, or there is no such
        parameter, or not of this value.
    ExportError
        The bus is too slow, or a position does not fit 32 bits.
    """

    def __init__(
        self,
        spec: Spec,
        block: BlockInstance,
        operator: Operator,
        live: Mapping[str, float],
        *,
        watched: bool = True,
    ) -> None:
        everything, numbers = target_of(spec), planned_axes(spec)
        self.target = attrs.evolve(
            everything,
            axes=tuple(everything.axes[number] for number in numbers),
            start=tuple(everything.start[number] for number in numbers),
        )
        frames.period_digits(spec.can)
        frames.require_load(self.target)
        self.demand = _demand(spec, self.target, tuple(numbers))
        self.planned: int | None = None
        self.most = MOST_CYCLES + STOP_CYCLES
        self._block, self._axes, self._operator = block, block.axes, operator
        self._values = block.inputs | {"bEnable": 1.0} | _live_values(block, live, spec.planner.live)
        self._calls = _calls(spec, self._values["fCycleTime"])
        self._sensor, self._heard = spec.can.sensor, -math.inf  # which of the block's cycles had news of it
        self._shown, self._fresh = _sensor_inputs(spec, block.axes, self._values["fCycleTime"])
        self._status = StatusLine(self._axes, self._values["fCycleTime"]) if watched else None
        self._still_enough = round(STANDSTILL_TIME / spec.can.sync_period)
        self._frames = frames.setpoint_frames(self.target)
        self._outputs = {name: place for place, name in enumerate(block.outputs)}
        self._rows: list[Any] = []  # outputs at the start, one cycle ago, and now
        self._log = np.zeros((self.most, len(numbers) + 2), dtype=np.int64)  # setpoints, promise, error
        self._lost: set[int] = set()
        self._called = self._cycle = -1  # latest cycle of the block, and of the bus
        self._waiting: list[Command] = []
        self._still = 0
        self._ends = False  # whether it is to stand, whatever the operator wants
        self._error, self._shown_at = 0, 0  # what the block shows, and since which of its cycles
        self._failure = ""
        self._step: Step | None = None

    @property
    def at_sync(self) -> Integers:
        """Where the axes were led to by each SYNC so far, in counts."""
        return self._log[: self._cycle + 1, :-2]

    @property
    def goal(self) -> Integers | None:
        """Where the latest setpoint leads them."""
        return None if self._step is None else self._step.position

    @property
    def columns(self) -> Mapping[str, Integers]:
        """Promise and error of every cycle so far."""
        *_, promise, error = self._log[: self._cycle + 1].T
        return {"promise": promise, "error_id": error}

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the block showed beside setpoints."""
        remarks = []
        if shown := [error_words(one) for one in dict.fromkeys(self.columns["error_id"].tolist()) if one]:
            remarks.append(f"The block showed {'; '.join(shown)}.")
        if lost := [LOST[number] for number in sorted(self._lost)]:
            remarks.append(f"The load may sway, because {' and '.join(lost)}.")
        return tuple(remarks)

    @property
    def failure(self) -> str:
        """Why the commands were not carried out to their end, a sentence; empty where they were."""
        return self._failure or (self._refusal if self._error else "")

    def operated(self) -> AbstractContextManager[object]:
        """Hold what commands are taken from."""
        return self._operator.operated()

    def begin(self, rest_counts: Sequence[int]) -> Step:
        """Enable the block where the axes stand, in counts."""
        for axis, scale, counts in zip(self._axes, self.target.axes, rest_counts, strict=True):
            self._values[axis.of("fActPosition")] = counts / scale.counts_per_si
        first = self.step(0)
        assert first is not None  # an axis stands for a while before a motion is over
        return first

    def step(self, cycle: int) -> Step | None:
        """Call the block up to a cycle of the bus; None once it stands and nothing more is asked of it.

        Raises
        ------
        StreamAborted
            The block did what none of ours does.
        """
        while self._cycle < cycle:
            if self._still >= self._still_enough:
                return None
            try:
                self._advance()
            except GenProfileError as error:
                raise StreamAborted(str(error)) from error
        return self._step

    def take(self, message: can.Message) -> None:
        """Take what the load's sensors show; frames of others are none of ours."""
        if self._sensor is not None and (values := values_in(message, self._sensor)) is not None:
            self._heard = self._called
            self._values |= dict(zip(self._shown, values, strict=True))

    def end(self) -> bool:
        """Stop without sway, whatever the operator wants."""
        self._values |= inputs_of(Command(time=0.0, command="stop"), self._axes)
        self._ends = True
        return True

    def _advance(self) -> None:
        """Call the block for one period of SYNC; its latest call is that of the next cycle."""
        if self._cycle + 1 == MOST_CYCLES:
            self._give_up(f"A stream lasts {MOST_CYCLES} cycles at most.")
        calls = self._calls if self._rows else 1
        rows = self._block.call(np.array([self._inputs() for _ in range(calls)]))
        issued, shown = rows[-1], rows[:, self._outputs["nErrorId"]]
        first, before = (self._rows[0], self._rows[-1]) if self._rows else (issued, issued)
        self._rows = [first, before, issued]
        self._cycle += 1
        before, self._error = self._error, int(next((error for error in shown if error), 0))
        if self._error != before:
            self._shown_at = self._called
        if self._error and not self._operator.attends:
            self._give_up(self._refusal)
        if self._cycle == self.most:
            raise StreamAborted("The stop without sway took too long.")
        number = int(self._of("nPromise"))
        self._lost |= {number} & LOST.keys()
        self._scale()

    def _inputs(self) -> list[float]:
        """Give the inputs of the block's next cycle."""
        self._called += 1
        due = [] if self._ends else [*self._waiting, *self._operator.due(self._called)]
        self._values["bReset"], self._waiting = float(bool(due)), []
        heard = float(self._called - self._heard <= self._fresh)
        self._values |= {name.replace(*SENSOR[:2]): heard for name in self._shown}
        for command in due:
            self._still = 0
            if command.command == "position" and self._values["bExecute"]:
                self._values["bExecute"], self._waiting = 0.0, [command]  # falls, so that there is an edge
            else:
                self._values |= inputs_of(command, self._axes)
        return [self._values[name] for name in self._block.inputs]

    def _give_up(self, failure: str) -> None:
        """End, as what was asked for cannot be carried out; the first reason holds."""
        self._failure = self._failure or failure
        self.end()

    @property
    def _refusal(self) -> str:
        at = self._shown_at * self._values["fCycleTime"]
        return f"At {at:.6g} s the block refused its commands: {error_words(self._error)}."

    def _of(self, output: str) -> float:
        return float(self._rows[-1][self._outputs[output]])

    def _scale(self) -> None:
        """Scale what was issued, and count for how long the axis stands."""
        columns = [
            np.array([[row[self._outputs[axis.of(name)]] for axis in self._axes] for row in self._rows])
            for name in ISSUED
        ]
        period, csv = self.target.can.sync_period, self.target.can.mode == "csv"
        sampled = SampledProfile(
            cycle_time=period, position=columns[0], velocity=columns[1], acceleration=columns[2]
        )
        scaled = scaling.setpoints(sampled, self.target)
        row = 1 if csv else 2  # a velocity leads from one position to the next
        at_sync = scaled.position[1]
        over = self._ends or self._operator.over
        moves = self._of("bBusy") > 0.0 or bool(columns[1][-1].any())
        self._still = self._still + 1 if over and not moves else 0
        self._log[self._cycle] = *at_sync, self._of("bPromise"), self._error
        self._step = Step(
            messages=cycle_of(self._frames, scaled.sent[row].tolist()),
            position=scaled.position[2],
            at_sync=at_sync,
            words=self._words(),
        )

    def _words(self) -> str:
        if self._status is None:
            return ""
        commanded = (
            "stopping without sway, at once when asked again" if self._ends else self._operator.commanded
        )
        return self._status.words(
            self._called, dict(zip(self._outputs, self._rows[-1], strict=True)), commanded
        )


def _sensor_inputs(spec: Spec, axes: Sequence[BlockAxis], cycle: float) -> tuple[list[str], int]:
    """Name the inputs that sensors are shown to, and in how many cycles a value may be shown again.

    It may become as much older as is stated of what is not known of its age.
    """
    sensor = spec.planner.sensor
    if sensor is None or spec.can.sensor is None:
        return [], 0
    planned = list(planned_axes(spec))
    shown = [axes[planned.index(number)].of(SENSOR[0]) for number in sensed_directions(spec)]
    return shown, round((sensor.delay[1] - sensor.delay[0]) / cycle)


def _demand(spec: Spec, target: Target, numbers: Sequence[int]) -> scaling.Demand:
    """Find what the planner may ask of its axes."""
    limits, can = [spec.limits.of(number) for number in numbers], target.can
    ends, brakes = list[tuple[int, int]](), list[int]()
    for number, own, axis in zip(numbers, limits, target.axes, strict=True):
        ends.append(_ends(own.travel or (0.0, 0.0), axis, can))
        usual = scaling.magnitude_counts(quick_limits(spec, number)[0], axis)
        brakes.append(scaling.quick_stop_deceleration(usual, can, axis))
    return scaling.Demand(
        start=None,
        ends=tuple(ends),
        velocity=_counted([own.velocity for own in limits], target),
        acceleration=_counted([own.acceleration for own in limits], target),
        quick_stop=tuple(brakes),
    )


def _counted(limits: Sequence[float | None], target: Target) -> tuple[float, ...]:
    """Scale limits, which are all stated, or there would be no block."""
    return tuple(
        float(scaling.magnitude_counts(limit, axis))
        for limit, axis in zip(limits, target.axes, strict=True)
        if limit is not None
    )


def _ends(travel: tuple[float, float], axis: AxisScale, can: CanSpec) -> tuple[int, int]:
    """Scale an axis's travel, which its drive's must hold."""
    ends = scaling.exact_counts(np.array(travel), exact(axis.counts_per_si))
    require_within(INT32, ends, f"axis {axis.name}", TOO_FAR, can.sync_period)
    least, greatest = int(ends.min()), int(ends.max())
    drive = scaling.travel_counts(axis, can)
    if drive is not None and not (drive[0] <= least and greatest <= drive[1]):
        raise SpecError(
            f"can.travel.{axis.name}: it must hold the planner's travel of {travel[0]:g} to "
            f"{travel[1]:g}; narrow limits.travel, and write the block again."
        )
    return least, greatest


def _calls(spec: Spec, cycle: float) -> int:
    """Count the block's cycles in one of SYNC."""
    period = spec.can.sync_period
    calls = round(period / cycle)
    if calls < 1 or abs(calls * cycle - period) > PERIOD_TOLERANCE * period:
        raise SpecError(
            f"can.sync_period: {period:g} s are no whole number of the block's cycles of {cycle:g} s; "
            "adapt export.cycle_time, and write the block again."
        )
    return calls


def _live_values(
    block: BlockInstance, live: Mapping[str, float], ranges: Mapping[str, Sequence[float]]
) -> dict[str, float]:
    """Give live parameters by the inputs' names; refuse what the block would, before the axes are enabled."""
    known = live_inputs(block.inputs, block.axes)
    for name, value in live.items():
        if name not in known:
            raise SpecError(
                f"live_parameter: the block has no live parameter {name!r}{suggestion(name, known)}"
            )
        low, high = ranges[name]
        if not low <= value <= high:
            raise SpecError(f"live_parameter: {name} must be from {low:g} to {high:g}, found {value:g}.")
    return {known[name]: value for name, value in live.items()}
