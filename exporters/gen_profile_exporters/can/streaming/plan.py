"""What a stream sends cycle by cycle: the setpoints of a log, or of any other source."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from functools import cached_property
from typing import Protocol

import attrs
import can
import numpy as np

from gen_profile.motion.profile import SampledProfile
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can import frames, pdos
from gen_profile_exporters.can.export.exporter import played, read_setpoints
from gen_profile_exporters.can.frames import Integers, SetpointFrame, message
from gen_profile_exporters.can.scaling import Demand, Setpoints, demand_of
from gen_profile_exporters.exporter import Target

Cycle = tuple[can.Message, ...]


@attrs.frozen(kw_only=True, eq=False)
class Step:
    """The setpoints of one cycle.

    Attributes
    ----------
    messages : tuple of can.Message
        Axis by axis; SYNC follows them.
    position, at_sync : (axes,) integer array
        Where they lead the axes, and where these are to be by the instant of SYNC, in counts.
    words : str
        What there is to tell.
    """

    messages: Cycle
    position: Integers
    at_sync: Integers
    words: str = ""


class SetpointSource(Protocol):
    """Where setpoints come from: a log that was written beforehand, or a planner that issues them now."""

    @property
    def target(self) -> Target:
        """The drives."""

    @property
    def demand(self) -> Demand:
        """What is asked of them."""

    @property
    def planned(self) -> int | None:
        """How many cycles there will be, where that is known beforehand."""

    @property
    def most(self) -> int:
        """How many cycles there can be."""

    @property
    def at_sync(self) -> Integers:
        """Where the axes are led to by each SYNC, as far as known, in counts, shape (cycles, axes)."""

    @property
    def goal(self) -> Integers | None:
        """Where they are led to at last, as far as known, in counts, shape (axes,)."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """What there is to say afterwards, a sentence each."""

    @property
    def columns(self) -> Mapping[str, Integers]:
        """What else is known of every cycle, by name."""

    @property
    def failure(self) -> str:
        """Why the motion ended before its end though all was well, a sentence; empty where it did not."""

    def operated(self) -> AbstractContextManager[object]:
        """Hold what commands are taken from, as long as axes may move."""

    def begin(self, rest_counts: Sequence[int]) -> Step:
        """Begin where the axes stand, in counts; return the first cycle's setpoints."""

    def step(self, cycle: int) -> Step | None:
        """Give the setpoints of a cycle, or None where the motion is over; the numbers never fall."""

    def take(self, message: can.Message) -> None:
        """Take in what any node sends meanwhile."""

    def end(self) -> bool:
        """End the motion early without sway, if that is possible."""


@attrs.frozen(kw_only=True, eq=False)
class StreamPlan:
    """A motion in frames: a `SetpointSource` that is known beforehand.

    Attributes
    ----------
    target : Target
    motion : Setpoints
    cycles : tuple of tuple of can.Message
        The setpoints of each cycle, axis by axis; SYNC follows them.
    """

    target: Target
    motion: Setpoints
    cycles: tuple[Cycle, ...]
    remarks: tuple[str, ...] = ()
    columns: Mapping[str, Integers] = attrs.field(factory=dict)
    failure: str = ""

    @cached_property
    def demand(self) -> Demand:
        """What the motion asks of the drives."""
        return demand_of(self.motion, self.target)

    @property
    def planned(self) -> int:
        """How many cycles there are."""
        return len(self.cycles)

    most = planned

    @cached_property
    def at_sync(self) -> Integers:
        """Where the axes are led to by each SYNC, in counts."""
        return self.motion.at_sync

    @property
    def goal(self) -> Integers:
        """Where they are led to at last, in counts."""
        return np.asarray(self.motion.position[-1])

    def operated(self) -> AbstractContextManager[object]:
        """Take no commands."""
        return nullcontext()

    def begin(self, rest_counts: Sequence[int]) -> Step:
        """Begin where the motion does; the axes were led there."""
        return self._step(0)

    def step(self, cycle: int) -> Step | None:
        """Give the setpoints of a cycle, or None behind the last."""
        return self._step(cycle) if cycle < len(self.cycles) else None

    def take(self, message: can.Message) -> None:
        """Know everything beforehand."""

    def end(self) -> bool:
        """End nowhere but at its own end."""
        return False

    def _step(self, cycle: int) -> Step:
        return Step(
            messages=self.cycles[cycle], position=self.motion.position[cycle], at_sync=self.at_sync[cycle]
        )


def preload(target: Target, position: Sequence[int]) -> Cycle:
    """Make setpoints at which the axes stand still where they are, in counts."""
    rest = [0] * len(pdos.setpoint_fields(target.can))
    held = [rest if target.can.mode == "csv" else [at, *rest[1:]] for at in position]
    return cycle_of(frames.setpoint_frames(target), held)


def plan_of(content: bytes, target: Target) -> StreamPlan:
    """Read a log that `gen_profile_exporters.can.export.exporter.encode` wrote.

    Raises
    ------
    ExportError
        It is none, is damaged, or has another period than the target.
    """
    taken, stamps = read_setpoints(content, target)
    motion = played(taken, stamps, target)
    if motion.cycle_time != target.can.sync_period:
        raise ExportError(
            f"can.sync_period: the log's cycle is {motion.cycle_time:g} s and the spec's "
            f"{target.can.sync_period:g} s; export the log again."
        )
    setpoints = _setpoints(taken, motion, target)
    return StreamPlan(target=target, motion=setpoints, cycles=cycles_of(setpoints, target))


def cycles_of(motion: Setpoints, target: Target) -> tuple[Cycle, ...]:
    """Encode every cycle of a motion."""
    layout = frames.setpoint_frames(target)
    return tuple(cycle_of(layout, values) for values in motion.sent.tolist())


def cycle_of(layout: Sequence[SetpointFrame], setpoints: Sequence[Sequence[int]]) -> Cycle:
    """Encode one cycle: what each axis is sent."""
    return tuple(message(frame.cob_id, frame.pack(setpoints)) for frame in layout)


def _setpoints(taken: Integers, motion: SampledProfile, target: Target) -> Setpoints:
    first, others = taken[:, :, 0], taken[:, :, 1:]
    if target.can.mode != "csv":
        return Setpoints(period=motion.cycle_time, position=first, offsets=others)
    counts_per_si = np.array([axis.counts_per_si for axis in target.axes])
    position = np.rint(motion.position * counts_per_si).astype(np.int64)
    return Setpoints(period=motion.cycle_time, position=position, offsets=others, velocity=first)
