"""Log of CAN frames in candump's format: setpoints for CiA 402 drives in cyclic synchronous position mode.

::

    (0000000000.000000) can0 301#00000000
    (0000000000.000000) can0 080#
    (0000000000.004000) can0 301#01000000
    (0000000000.004000) can0 080#

Each SYNC period holds one RPDO2 per axis (COB-ID 300h + node; nodes count up from ``can.node``) with the
target position 607Ah, a 32-bit little-endian integer, and after them one SYNC (COB-ID 080h, no data) that
makes the drives take it. Frames of one period carry the stamp of its SYNC; they are sent in the file's order.
Between two SYNCs the drive interpolates over its interpolation period 60C2h, which is the SYNC period.

Formats and objects: CiA 301 (COB-IDs, SYNC), CiA 402-2 (607Ah, 60C2h), ``candump -L`` of can-utils.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from decimal import Decimal
from itertools import pairwise

import attrs
import numpy as np

from gen_profile.errors import ExportError
from gen_profile.profile import Profile, SampledProfile
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.setpoints import counts, in_si, plausible_cycle_time, sampled, two_digits_up

CHANNEL = "can0"
SYNC = 0x080
RPDO2 = 0x300
LAST_NODE = 127
MICROSECONDS = 1_000_000

POSITION_BYTES = 4  # of an RPDO2: 607Ah
FEEDBACK_BYTES = 6  # of a drive's answer: statusword 6041h and actual position 6064h
MOST_LOAD = Decimal(
    "0.7"
)  # of the bus, in the worst case; the rest is for SDOs, heartbeats and repeated frames

_FRAME = re.compile(r"\((\d{1,12})\.(\d{6})\) (\S+) ([0-9A-F]{3})#((?:[0-9A-F]{2}){0,8})")


@attrs.frozen(kw_only=True)
class _Frame:
    line: int
    stamp: int  # µs
    channel: str
    cob_id: int
    data: bytes


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the frames of the motion, sampled at the SYNC period.

    Raises
    ------
    ExportError
        The bus is too slow, there are too few node ids, drives cannot be set to the period, a position does
        not fit 32 bits, or there are too many samples.
    """
    period = _period(target)
    _check_load(target)
    motion = sampled(profile, target, target.can.sync_period, "can.sync_period")
    columns = [
        counts(motion.position[:, column], axis, motion.cycle_time).astype("<i4")
        for column, axis in enumerate(target.axes)
    ]
    lines = []
    for cycle, setpoints in enumerate(zip(*columns, strict=True)):
        seconds, microseconds = divmod(cycle * period, MICROSECONDS)
        begin = f"({seconds:010d}.{microseconds:06d}) {CHANNEL}"
        lines += [
            f"{begin} {cob_id:03X}#{setpoint.tobytes().hex().upper()}"
            for cob_id, setpoint in zip(_cob_ids(target), setpoints, strict=True)
        ]
        lines.append(f"{begin} {SYNC:03X}#")
    return (File(filename=f"{target.name}.log", content=("\n".join(lines) + "\n").encode("ascii")),)


def replay(content: bytes, target: Target) -> SampledProfile:
    """Read the positions that the drives take at each SYNC.

    Raises
    ------
    ExportError
        The text is no such log, was cut off, or is for other nodes than the target's.
    """
    cob_ids = _cob_ids(target)
    setpoints: list[list[int]] = []
    syncs: list[_Frame] = []
    pending: dict[int, int] = {}
    for frame in _frames(content):
        if frame.cob_id == SYNC:
            _require_complete(pending, cob_ids, frame)
            setpoints.append([pending[cob_id] for cob_id in cob_ids])
            syncs.append(frame)
            pending = {}
        else:
            _require_expected(frame, pending, cob_ids)
            pending[frame.cob_id] = int.from_bytes(frame.data, "little", signed=True)
    if pending:
        raise ExportError("The CAN log ends without a SYNC after its last setpoint; export it again.")
    if len(syncs) < 2:
        raise ExportError(f"The CAN log holds {len(syncs)} SYNCs, a motion needs 2 or more; export it again.")
    counts_per_si = np.array([axis.counts_per_si for axis in target.axes])
    return SampledProfile(
        cycle_time=_cycle_time(syncs),
        position=in_si(np.array(setpoints, dtype=np.float64), counts_per_si),
        resolution=in_si(np.ones(len(target.axes)), np.abs(counts_per_si)),
    )


def frame_bits(data_bytes: int) -> int:
    """Count the bits of the longest classical frame with an 11-bit identifier, interframe space included.

    47 bits frame the data; of them 34, and all data bits, are subject to stuffing: one more bit for every
    four after the first (ISO 11898-1; Davis et al., *Controller Area Network schedulability analysis*, 2007).
    """
    return 47 + 8 * data_bytes + (33 + 8 * data_bytes) // 4


def _cob_ids(target: Target) -> tuple[int, ...]:
    return tuple(RPDO2 + target.can.node + number for number in range(len(target.axes)))


def _period(target: Target) -> int:
    """SYNC period in µs, if object 60C2h can tell it to a drive: 1 to 255 times a power of ten of seconds."""
    period = Decimal(repr(target.can.sync_period)).normalize()
    _, digits, exponent = period.as_tuple()
    if int("".join(map(str, digits))) > 255 or not isinstance(exponent, int) or exponent < -6:
        raise ExportError(
            f"can.sync_period: drives cannot be set to an interpolation period of {period:f} s (60C2h holds "
            "1 to 255 times a power of ten, here of at least 1 µs); choose a rounder one, such as 0.004."
        )
    return int(period * MICROSECONDS)


def _check_load(target: Target) -> None:
    """Refuse what overloads the bus with SYNC and, per axis, a setpoint and an answer at their longest."""
    axes, can = len(target.axes), target.can
    if can.node + axes - 1 > LAST_NODE:
        raise ExportError(
            f"can.node: {axes} axes from node {can.node} on exceed the last node id {LAST_NODE}."
        )
    bits = frame_bits(0) + axes * (frame_bits(POSITION_BYTES) + frame_bits(FEEDBACK_BYTES))
    shortest = bits / (MOST_LOAD * can.bitrate)
    if Decimal(repr(can.sync_period)) < shortest:
        raise ExportError(
            f"can.sync_period: {axes} axes every {can.sync_period:g} s load a bus of {can.bitrate} bit/s by "
            f"{bits / can.sync_period / can.bitrate:.0%} (limit {MOST_LOAD:.0%}); "
            f"set {two_digits_up(shortest)} s or more, or raise can.bitrate."
        )


def _frames(content: bytes) -> Iterator[_Frame]:
    """Frames in the file's order; stamps never fall and all are of one channel."""
    lines = content.decode("latin-1").split("\n")
    if lines.pop().strip():
        raise ExportError(
            f"line {len(lines) + 1}: the CAN log breaks off without a line end; export it again."
        )
    before: _Frame | None = None
    for number, text in enumerate(lines, start=1):
        match = _FRAME.fullmatch(text.rstrip("\r"))
        if match is None:
            raise ExportError(
                f"line {number}: {text[:60]!r} is no frame in candump's format; export the log again."
            )
        seconds, microseconds, channel, cob_id, data = match.groups()
        frame = _Frame(
            line=number,
            stamp=int(seconds) * MICROSECONDS + int(microseconds),
            channel=channel,
            cob_id=int(cob_id, 16),
            data=bytes.fromhex(data),
        )
        if before is not None and (frame.stamp < before.stamp or frame.channel != before.channel):
            raise ExportError(f"line {number}: the stamp falls or the channel changes; export the log again.")
        yield frame
        before = frame


def _require_complete(pending: dict[int, int], cob_ids: Sequence[int], sync: _Frame) -> None:
    if sync.data:
        raise ExportError(
            f"line {sync.line}: SYNC with data, which this format has not; export the log again."
        )
    missing = [cob_id for cob_id in cob_ids if cob_id not in pending]
    if missing:
        raise ExportError(
            f"line {sync.line}: SYNC without a setpoint {missing[0]:03X}h before it; "
            "export the log again, or check it with the spec that it was exported with."
        )


def _require_expected(frame: _Frame, pending: dict[int, int], cob_ids: Sequence[int]) -> None:
    if frame.cob_id not in cob_ids:
        known = ", ".join(f"{cob_id:03X}h" for cob_id in (*cob_ids, SYNC))
        raise ExportError(
            f"line {frame.line}: frame {frame.cob_id:03X}h is none of this target's ({known}); "
            "check the log with the spec that it was exported with, or export it again."
        )
    if frame.cob_id in pending:
        raise ExportError(
            f"line {frame.line}: second setpoint {frame.cob_id:03X}h before a SYNC; export the log again."
        )
    if len(frame.data) != POSITION_BYTES:
        raise ExportError(
            f"line {frame.line}: setpoint {frame.cob_id:03X}h with {len(frame.data)} data bytes instead of "
            f"{POSITION_BYTES}; export the log again."
        )


def _cycle_time(syncs: Sequence[_Frame]) -> float:
    """Step of the SYNCs' stamps in s, which must all be equal."""
    period = syncs[1].stamp - syncs[0].stamp
    for before, sync in pairwise(syncs):
        if sync.stamp - before.stamp != period:
            raise ExportError(
                f"line {sync.line}: SYNC {sync.stamp - before.stamp} µs after the one before, where "
                f"{period} µs lie between the first two; export the log again."
            )
    return plausible_cycle_time(float(Decimal(period) / MICROSECONDS), syncs[1].line)
