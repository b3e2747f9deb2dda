"""The format ``can``: setpoints for CiA 402 drives as logs, with a DBC and what the drives must be set to.

Each cycle holds the setpoints of every axis and after them one SYNC, which makes the drives take them.
Between two SYNCs a drive interpolates over its interpolation period 60C2h, which is the SYNC period. See
`gen_profile_exporters.can.frames` for the frames.
"""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from importlib import import_module
from itertools import pairwise
from types import ModuleType

import numpy as np

from gen_profile.motion.profile import Profile, SampledProfile
from gen_profile.support.errors import ExportError
from gen_profile.support.plugins import require_installed
from gen_profile_exporters.can import frames, pdos, startup
from gen_profile_exporters.can.drive_units import VELOCITY_UNIT, per_count
from gen_profile_exporters.can.export import candump, database, traces
from gen_profile_exporters.can.export.candump import Frame, altered
from gen_profile_exporters.can.frames import MICROSECONDS, SYNC, SetpointFrame
from gen_profile_exporters.can.scaling import (
    Demand,
    Setpoints,
    demand_of,
    setpoints,
    start_counts,
    travelled,
)
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.modulo import least, turn_counts, unwrapped, within
from gen_profile_exporters.setpoints import in_si, plausible_cycle_time, sampled


def require_target(target: Target) -> None:
    """Refuse what no motion could be exported for, before there is one.

    Raises
    ------
    ExportError
        The bus is too slow, there are too few node ids, drives cannot be set to the period, a fixed mapping
        lacks what is needed, or the drives' file is none, or of drives that cannot follow.
    """
    frames.period_digits(target.can)
    frames.require_load(target)
    frames.setpoint_frames(target)
    if target.can.eds is not None:
        _data_sheet().require_able(target.can.eds, target)


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the frames of the motion, sampled at the SYNC period, and what belongs to them.

    Raises
    ------
    ExportError
        The bus is too slow, there are too few node ids, drives cannot be set to the period, a position does
        not fit 32 bits or the axis's travel, or there are too many samples.
    """
    frames.period_digits(target.can)
    frames.require_load(target)
    motion = setpoints(sampled(profile, target, target.can.sync_period, "can.sync_period"), target)
    cycles = tuple(cyclic_frames(motion, target))
    lists = _startup_lists(demand_of(motion, target), target)
    contents = {
        ".log": candump.write(cycles),
        ".asc": traces.asc(cycles),
        ".blf": traces.blf(cycles),
        ".dbc": database.dbc(target),
        ".startup.csv": startup.table(lists),
        **{f".node{node}.cdcf": startup.concise_dcf(entries) for node, entries in lists.items()},
    }
    return tuple(File(f"{target.name}{suffix}", content) for suffix, content in contents.items())


def _startup_lists(demand: Demand, target: Target) -> startup.Lists:
    """List what the drives must be set to; where their file is stated, they must fit, and it is for them."""
    lists, sheet = startup.startup_lists(demand, target), target.can.eds
    if sheet is None:
        return lists
    _data_sheet().require_fit(sheet, demand, target)
    fitted: startup.Lists = _data_sheet().fitted(sheet, lists, target)
    return fitted


def _data_sheet() -> ModuleType:
    """Load what reads a drive's file."""
    require_installed("can.eds needs canopen", "can", "canopen")
    return import_module("gen_profile_exporters.can.setup.data_sheet")  # canopen is an extra


def replay(content: bytes, target: Target) -> SampledProfile:
    """Read the positions that the drives take at each SYNC, or that the velocities lead them to.

    Raises
    ------
    ExportError
        The text is no such log, was cut off, or is for other nodes than the target's.
    """
    return played(*read_setpoints(content, target), target)


def played(taken: frames.Integers, stamps: Sequence[Frame], target: Target) -> SampledProfile:
    """Tell where setpoints of all cycles lead the axes, by the stamps of their SYNCs."""
    counts_per_si = np.array([axis.counts_per_si for axis in target.axes])
    rates = np.array([float(per_count(VELOCITY_UNIT, target.can, axis)) for axis in target.axes])
    period, least, velocity = _cycle_time(stamps), np.ones(len(target.axes)), None
    if target.can.mode == "csv":  # velocities, which are kept from each SYNC to the next one
        position = np.array(target.start) + in_si(travelled(taken[:, :, 0], period, target), counts_per_si)
        least = period / rates
    else:
        position = in_si(taken[:, :, 0].astype(np.float64), counts_per_si)
    if pdos.VELOCITY_OFFSET in pdos.setpoint_fields(target.can):
        velocity = in_si(taken[:, :, 1] / rates, counts_per_si)
    return SampledProfile(
        cycle_time=period,
        position=position,
        velocity=velocity,
        resolution=in_si(least, np.abs(counts_per_si)),
    )


def cyclic_frames(motion: Setpoints, target: Target) -> Iterator[Frame]:
    """List the frames of all cycles in the order in which they are sent."""
    period = frames.period_microseconds(target.can)
    expected, buses = frames.setpoint_frames(target), frames.buses(target)
    for cycle, values in enumerate(motion.sent.tolist()):
        stamp = cycle * period
        for frame in expected:
            yield Frame(stamp, frame.cob_id, frame.pack(values), channel=frame.channel)
        for channel in buses:
            yield Frame(stamp, SYNC, b"", channel=channel)


def read_setpoints(content: bytes, target: Target) -> tuple[frames.Integers, list[Frame]]:
    """Read a log: what drives are sent in each cycle, shape (cycles, axes, fields), and its last SYNC."""
    expected = {frame.cob_id: frame for frame in frames.setpoint_frames(target)}
    width = len(pdos.setpoint_fields(target.can))
    taken: list[list[int]] = []
    syncs: list[Frame] = []
    pending: dict[int, tuple[int, ...]] = {}
    synced: list[str] = []
    for frame in _on_their_channels(candump.read(content), expected, target):
        if frame.cob_id != SYNC:
            _require_expected(frame, pending, expected)
            pending[frame.cob_id] = expected[frame.cob_id].packing.unpack(frame.data)
            continue
        _require_complete(pending, expected, frame)
        synced.append(frame.channel)
        if _all_synced(synced, frame, target):
            taken.append(_setpoints(pending, expected.values()))
            syncs.append(frame)
            pending, synced = {}, []
    if pending:
        raise ExportError("The CAN log ends without a SYNC after its last setpoint; export it again.")
    if len(syncs) < 2:
        raise ExportError(f"The CAN log holds {len(syncs)} SYNCs, a motion needs 2 or more; export it again.")
    setpoints = np.array(taken, dtype=np.int64).reshape(len(taken), len(target.axes), width)
    return _continuous(setpoints, target), syncs


def _continuous(setpoints: frames.Integers, target: Target) -> frames.Integers:
    """Go on where positions of an axis begin anew."""
    if target.can.mode == "csv":
        return setpoints
    for column, (axis, near) in enumerate(zip(target.axes, start_counts(target), strict=True)):
        turn, places = turn_counts(axis), setpoints[:, column, 0]
        if turn is None:
            continue
        outside = [place for place in places.tolist() if within(place, turn) != place]
        if outside:
            raise ExportError(
                f"axis {axis.name}: a setpoint of {outside[0]} counts lies outside the turn of axis.modulo "
                f"({int(least(turn))} to {int(least(turn)) + turn - 1}); export the log again."
            )
        setpoints[:, column, 0] = np.rint(unwrapped(places.astype(np.float64), turn, near))
    return setpoints


def _on_their_channels(
    frames: Iterable[Frame], expected: Mapping[int, SetpointFrame], target: Target
) -> Iterator[Frame]:
    """Require each frame on its drive's channel; drives that are all on one bus may be on any."""
    only: str | None = None
    for frame in frames:
        own = frame.channel
        if not target.can.channels:
            own = only = only or frame.channel
        elif frame.cob_id in expected:
            own = expected[frame.cob_id].channel
        if frame.channel != own:
            there = f"is on the channel {frame.channel} instead of {own}"
            raise altered(frame.line, f"frame {frame.cob_id:03X}h {there}")
        yield frame


def _all_synced(synced: Sequence[str], latest: Frame, target: Target) -> bool:
    """Tell whether a cycle's SYNC was sent on every bus, and require that it was once on each, in turn."""
    buses = frames.buses(target)
    if target.can.channels and tuple(synced) != buses[: len(synced)]:
        raise altered(latest.line, f"SYNC on {latest.channel} out of turn")
    return len(synced) == len(buses)


def _setpoints(pending: Mapping[int, tuple[int, ...]], layout: Iterable[SetpointFrame]) -> list[int]:
    """Put the setpoints of one cycle in the axes' order."""
    by_place = {
        frame.column * frame.width + place: value
        for frame in layout
        for place, value in zip(frame.places, pending[frame.cob_id], strict=True)
        if place < frame.width
    }
    return [by_place[place] for place in range(len(by_place))]


def _require_complete(pending: Container[int], expected: Iterable[int], sync: Frame) -> None:
    if sync.data:
        raise altered(sync.line, "SYNC with data, which this format does not have")
    missing = [cob_id for cob_id in expected if cob_id not in pending]
    if missing:
        raise ExportError(
            f"line {sync.line}: SYNC without a setpoint {missing[0]:03X}h before it; "
            "export the log again, or check it with the spec that it was exported with."
        )


def _require_expected(frame: Frame, pending: Container[int], expected: Mapping[int, SetpointFrame]) -> None:
    if frame.cob_id not in expected:
        known = ", ".join(f"{cob_id:03X}h" for cob_id in (*expected, SYNC))
        raise ExportError(
            f"line {frame.line}: frame {frame.cob_id:03X}h is none of this target's ({known}); "
            "check the log with the spec that it was exported with, or export it again."
        )
    setpoint, size = f"setpoint {frame.cob_id:03X}h", expected[frame.cob_id].packing.size
    if frame.cob_id in pending:
        raise altered(frame.line, f"second {setpoint} before a SYNC")
    if len(frame.data) != size:
        raise altered(frame.line, f"{setpoint} with {len(frame.data)} data bytes instead of {size}")
    if not expected[frame.cob_id].keeps_constants(frame.data):
        wrong = "another controlword or mode than a drive that follows gets"
        raise altered(frame.line, f"{setpoint} with {wrong}")


def _cycle_time(syncs: Sequence[Frame]) -> float:
    """Step of the SYNCs' stamps in s, which must all be equal."""
    period = syncs[1].stamp - syncs[0].stamp
    for before, sync in pairwise(syncs):
        if sync.stamp - before.stamp != period:
            due = f"where {period} µs lie between the first two"
            raise altered(sync.line, f"SYNC {sync.stamp - before.stamp} µs after the one before, {due}")
    return plausible_cycle_time(float(Decimal(period) / MICROSECONDS), syncs[1].line)
