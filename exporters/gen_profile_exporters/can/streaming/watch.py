"""What the drives say on the bus, and which of it must end a stream."""

from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from functools import partial

import attrs
import can

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can import frames, pdos, startup
from gen_profile_exporters.can.cia402 import FAULTS, FOLLOWING_ERROR, FOLLOWS, MOVING, State, state_of
from gen_profile_exporters.can.host.clock import NANOSECONDS, Clock
from gen_profile_exporters.can.pdos import Field
from gen_profile_exporters.can.scaling import start_counts
from gen_profile_exporters.can.setup.standing import Standing, trembling
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.modulo import nearest, turn_counts

OPERATIONAL = 5
# command specifiers of SDO requests (CiA 301) that change nothing: upload, its segments, abort, block upload
READING = {2, 3, 4, 5}
HEARTBEATS_MISSED = 3
LEFT_ALONE = {0x8130, 0x8250}  # emergencies of CiA 301: no heartbeat came any more, no setpoint
BUS_OFF, CONTROLLER_STATE, PASSIVE = 0x40, 0x04, 0x30  # of SocketCAN's error frames (linux/can/error.h)


class SupervisionLevel(IntEnum):
    """How much is demanded of the drives; each level includes those before."""

    LISTENING = 0  # no one else in command
    CONFIGURING = 1  # no reset
    CYCLIC = 2  # answers to every SYNC, heartbeats
    FOLLOWING = 3  # enabled and following


@attrs.define
class WatchedAxis:
    """Last words of one drive.

    Attributes
    ----------
    name : str
    node : int
    feedback : mapping of int to tuple of Field
        What the drive tells at each SYNC, by COB-ID: statusword and position, together or apart.
    standstill : Standing
        Whether it stands, by the positions that it reported.
    position : int
        The latest in counts, whole turns included; the motion's start before the first one.
    turn : int or None
        Counts after which the axis begins anew.
    statusword : int
        The latest; 0 before the first one.
    stated, placed, beat : int
        Instants in ns of the latest statusword, position and heartbeat; 0 before the first ones.
    """

    name: str
    node: int
    feedback: Mapping[int, tuple[Field, ...]]
    standstill: Standing
    position: int = 0
    turn: int | None = None
    statusword: int = 0
    stated: int = 0
    placed: int = 0
    beat: int = 0

    @property
    def heard(self) -> int:
        """Instant in ns since when nothing is missing of its feedback."""
        return min(self.stated, self.placed)

    @property
    def state(self) -> State:
        """State that the statusword tells."""
        return state_of(self.statusword)

    def take(self, field: Field, value: int, now: int) -> None:
        """Take down what it reported."""
        if field == pdos.STATUSWORD:
            self.statusword, self.stated = value, now
        elif field == pdos.ACTUAL_POSITION:
            self.position, self.placed = nearest(value, self.turn, self.position), now
            self.standstill.take(self.position, now)

    def stands(self, since: int) -> bool:
        """Whether the drive said after an instant that it is not powered to move, and the axis stood."""
        return self.stated > since and self.state not in MOVING and self.standstill.proved(since)

    def braked(self, since: int) -> bool:
        """Whether the drive said after an instant that it no longer moves, and the axis stood."""
        at_rest = self.state is State.QUICK_STOP or self.state not in MOVING
        return self.stated > since and at_rest and self.standstill.proved(since)

    def obeys(self, since: int) -> bool:
        """Whether the drive said after an instant that it no longer follows setpoints."""
        return self.stated > since and self.state not in {State.ENABLED, State.UNKNOWN}

    def known(self, since: int) -> str:
        """Say what is known of an axis since an instant that does not stand, as far as is known."""
        if self.heard <= since:
            return "no answer"
        if self.state is State.UNKNOWN:
            return f"statusword {self.statusword:04X}h, which is no state of CiA 402"
        unproved = "" if self.state in MOVING else ", but not seen to stand"
        return f"{self.state.words!r}{unproved}"


class Watch:
    """Take in every frame, keep the first fault found.

    Parameters
    ----------
    target : Target
        Whose drives are watched.
    clock : Clock
    """

    def __init__(self, target: Target, clock: Clock) -> None:
        self.axes = _watched(target)
        self.alert = SupervisionLevel.LISTENING
        self.fault: str | None = None
        self._clock, self._period = clock, frames.period_microseconds(target.can) * 1000
        self._heartbeat = startup.heartbeat_ms(target.can) * NANOSECONDS // 1000
        self._beating = "1017h" not in target.can.without
        self._timeout = startup.timeout_ms(target.can) * NANOSECONDS // 1000  # for an answer to SYNC
        self._demanded = 0  # instant since when drives are to answer
        self._takers: dict[int, Callable[[bytes], None]] = {}
        for axis in self.axes:
            for cob_id, fields in axis.feedback.items():
                self._takers[cob_id] = partial(self._take_feedback, axis, fields)
            self._takers[frames.EMCY + axis.node] = partial(self._take_emergency, axis)
            self._takers[frames.HEARTBEAT + axis.node] = partial(self._take_heartbeat, axis)
            self._takers[frames.SDO_REQUEST + axis.node] = partial(self._take_request, axis)
        commands = pdos.layout(target.can).received
        commanding = {own[pdo] for own in frames.cob_ids(target) for pdo in commands}
        self._ours = {frames.NMT, frames.SYNC, frames.HEARTBEAT + frames.MASTER} | commanding

    def take(self, message: can.Message) -> None:
        """Take in one frame, whatever it is."""
        if message.is_error_frame:
            self._take_error(message)
        elif not (message.is_extended_id or message.is_remote_frame):
            if message.arbitration_id in self._ours:
                self._find_second_controller(message.arbitration_id)
            elif message.arbitration_id in self._takers:
                self._takers[message.arbitration_id](bytes(message.data))

    def raise_alert(self, alert: SupervisionLevel) -> None:
        """Demand more from now on."""
        if self.alert < SupervisionLevel.CYCLIC <= alert:
            self._demanded = self._clock.now()
        self.alert = alert

    def require_well(self) -> None:
        """Raise the first fault found, or what is overdue now.

        Raises
        ------
        StreamAborted
        """
        if self.alert >= SupervisionLevel.CYCLIC:
            self._look_for_silence()
        if self.fault is not None:
            raise StreamAborted(self.fault)

    def _find(self, fault: str) -> None:
        self.fault = self.fault or fault

    def _find_second_controller(self, cob_id: int) -> None:
        self._find(
            f"Frame {cob_id:03X}h came from another node: a second controller is on the bus; disconnect it, "
            "or choose other nodes."
        )

    def _take_request(self, axis: WatchedAxis, data: bytes) -> None:
        """Let others read by SDO while we do not; a drive serves one at a time."""
        if self.alert < SupervisionLevel.CYCLIC or not data or data[0] >> 5 not in READING:
            self._find_second_controller(frames.SDO_REQUEST + axis.node)

    def _take_feedback(self, axis: WatchedAxis, fields: Sequence[Field], data: bytes) -> None:
        packing = pdos.packing(fields)
        if len(data) == packing.size:
            used = [field for field in fields if field.used]
            for field, value in zip(used, packing.unpack(data), strict=True):
                axis.take(field, value, self._clock.now())
            if pdos.STATUSWORD in used:
                self._look_at(axis)
        elif self.alert >= SupervisionLevel.CYCLIC:
            self._find(
                f"axis {axis.name}: feedback of {len(data)} bytes instead of {packing.size}; "
                "the drive's mapping was changed."
            )

    def _take_emergency(self, axis: WatchedAxis, data: bytes) -> None:
        code = int.from_bytes(data[:2], "little")
        left = code in LEFT_ALONE and self.alert < SupervisionLevel.CYCLIC  # by a stream that was killed
        if code and not left:
            self._find(f"axis {axis.name}: the drive reports emergency {code:04X}h; see its manual.")

    def _take_heartbeat(self, axis: WatchedAxis, data: bytes) -> None:
        axis.beat = self._clock.now()
        state = data[0] & 0x7F if data else None
        if state == 0 and self.alert >= SupervisionLevel.CONFIGURING:
            self._find(f"axis {axis.name}: the drive was reset; find out why before moving it again.")
        elif state != OPERATIONAL and self.alert >= SupervisionLevel.FOLLOWING:
            self._find(f"axis {axis.name}: the drive left the NMT state operational.")

    def _take_error(self, message: can.Message) -> None:
        flags, data = message.arbitration_id, bytes(message.data)
        if flags & BUS_OFF:
            self._find("The CAN controller is bus-off; check cable, termination and bit rate.")
        elif flags & CONTROLLER_STATE and len(data) > 1 and data[1] & PASSIVE:
            self._find("The CAN controller is error-passive; check cable, termination and bit rate.")

    def _look_for_silence(self) -> None:
        now = self._clock.now()
        for axis in self.axes:
            heard, beat = max(axis.heard, self._demanded), max(axis.beat, self._demanded)
            if now - heard > self._timeout + self._period:
                self._find(
                    f"axis {axis.name}: no feedback for {(now - heard) / NANOSECONDS * 1e3:.3g} ms; "
                    "the drive, the cable or SYNC failed."
                )
            if self._beating and now - beat > HEARTBEATS_MISSED * self._heartbeat + self._period:
                self._find(f"axis {axis.name}: no heartbeat; the drive or the cable failed.")

    def _look_at(self, axis: WatchedAxis) -> None:
        if axis.state in FAULTS:
            self._find(f"axis {axis.name}: the drive is in the state {axis.state.words!r}.")
        if self.alert < SupervisionLevel.FOLLOWING:
            return
        if axis.statusword & FOLLOWING_ERROR:
            self._find(f"axis {axis.name}: following error; the axis is blocked, or too slow for the motion.")
        if axis.state is not State.ENABLED:
            self._find(f"axis {axis.name}: the drive went to the state {axis.state.words!r}.")
        elif not axis.statusword & FOLLOWS:
            self._find(f"axis {axis.name}: the drive no longer follows the setpoints (statusword bit 12).")


def _watched(target: Target) -> tuple[WatchedAxis, ...]:
    """Make an axis to be watched for each of a target's."""
    transmitted = pdos.layout(target.can).transmitted
    drives = zip(target.axes, frames.nodes(target), frames.cob_ids(target), start_counts(target), strict=True)
    return tuple(
        WatchedAxis(
            name=axis.name,
            node=node,
            feedback={own[pdo]: fields for pdo, fields in transmitted.items()},
            standstill=Standing(trembling(axis)),
            position=start,
            turn=turn_counts(axis),
        )
        for axis, node, own, start in drives
    )
