"""What a stream will send: read from the artefact, encoded before the first cycle."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import can
import numpy as np

from gen_profile.errors import ExportError
from gen_profile.motion.profile import SampledProfile
from gen_profile_exporters.can import frames, pdos
from gen_profile_exporters.can.export.exporter import read_setpoints, replay
from gen_profile_exporters.can.frames import Integers, SetpointFrame, message
from gen_profile_exporters.can.scaling import Setpoints
from gen_profile_exporters.exporter import Target

Cycle = tuple[can.Message, ...]


@attrs.frozen(kw_only=True, eq=False)
class StreamPlan:
    """A motion in frames.

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

    def preload(self, position: Sequence[int]) -> Cycle:
        """Make setpoints at which the axes stand still where they are."""
        rest = [0] * len(pdos.setpoint_fields(self.target.can))
        held = [rest if self.motion.velocity is not None else [at, *rest[1:]] for at in position]
        return _cycle(frames.setpoint_frames(self.target), held)


def plan_of(content: bytes, target: Target) -> StreamPlan:
    """Read a log that `gen_profile_exporters.can.export.exporter.encode` wrote.

    Raises
    ------
    ExportError
        It is none, is damaged, or has another period than the target.
    """
    motion = replay(content, target)
    if motion.cycle_time != target.can.sync_period:
        raise ExportError(
            f"can.sync_period: the log's cycle is {motion.cycle_time:g} s and the spec's "
            f"{target.can.sync_period:g} s; export the log again."
        )
    taken, _ = read_setpoints(content, target)
    found = _setpoints(taken, motion, target)
    return StreamPlan(target=target, motion=found, cycles=cycles_of(found, target))


def cycles_of(motion: Setpoints, target: Target) -> tuple[Cycle, ...]:
    """Encode every cycle of a motion."""
    layout = frames.setpoint_frames(target)
    return tuple(_cycle(layout, values) for values in motion.sent.tolist())


def _cycle(layout: Sequence[SetpointFrame], setpoints: Sequence[Sequence[int]]) -> Cycle:
    return tuple(message(frame.cob_id, frame.pack(setpoints)) for frame in layout)


def _setpoints(taken: Integers, motion: SampledProfile, target: Target) -> Setpoints:
    first, others = taken[:, :, 0], taken[:, :, 1:]
    if target.can.mode != "csv":
        return Setpoints(period=motion.cycle_time, position=first, offsets=others)
    counts_per_si = np.array([axis.counts_per_si for axis in target.axes])
    position = np.rint(motion.position * counts_per_si).astype(np.int64)
    return Setpoints(period=motion.cycle_time, position=position, offsets=others, velocity=first)
