"""What a stream will send: read from the artefact, encoded before the first cycle."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import can
import numpy as np

from gen_profile.errors import ExportError
from gen_profile.profile import SampledProfile
from gen_profile_exporters.can import frames
from gen_profile_exporters.can.exporter import read_setpoints, replay, setpoint_ids
from gen_profile_exporters.can.frames import Integers
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
        The setpoints of each cycle, one per axis; SYNC follows them.
    """

    target: Target
    motion: Setpoints
    cycles: tuple[Cycle, ...]

    def preload(self, position: Sequence[int]) -> Cycle:
        """Make setpoints at which the axes stand still where they are."""
        fields = frames.setpoint_fields(self.target.can)
        pack = frames.packing(fields).pack
        rest = [0] * (len(fields) - 1)
        return tuple(
            message(cob_id, pack(0 if self.motion.velocity is not None else at, *rest))
            for cob_id, at in zip(setpoint_ids(self.target), position, strict=True)
        )


def plan_of(content: bytes, target: Target) -> StreamPlan:
    """Read a log that `gen_profile_exporters.can.exporter.encode` wrote.

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
    fields = frames.packing(frames.setpoint_fields(target.can))
    cob_ids = setpoint_ids(target)
    return StreamPlan(
        target=target,
        motion=_setpoints(taken, motion, target),
        cycles=tuple(
            tuple(
                message(cob_id, fields.pack(*map(int, values)))
                for cob_id, values in zip(cob_ids, cycle, strict=True)
            )
            for cycle in taken
        ),
    )


def _setpoints(taken: Integers, motion: SampledProfile, target: Target) -> Setpoints:
    first, *others = np.moveaxis(taken, 2, 0)
    if target.can.mode != "csv":
        return Setpoints(period=motion.cycle_time, position=first, offset=others[0] if others else None)
    counts_per_si = np.array([axis.counts_per_si for axis in target.axes])
    position = np.rint(motion.position * counts_per_si).astype(np.int64)
    return Setpoints(period=motion.cycle_time, position=position, velocity=first)


def message(cob_id: int, data: bytes) -> can.Message:
    """Make a frame with an 11-bit identifier."""
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)
