"""A CiA 402 drive on the bus, simulated: object dictionary, state machine, PDOs, and what it does in trouble.

It takes its setpoint at each SYNC and leads its axis there within its interpolation period 60C2h, as real
drives in csp and ip do; a velocity, in csv, is kept for that period. Without SYNC it goes on by its own
clock.
"""

import math
from collections.abc import Callable, Iterator
from typing import Any

import canopen

from gen_profile_exporters.can import frames
from gen_profile_exporters.can.cia402 import (
    FOLLOWING_ERROR,
    FOLLOWS,
    IP_ENABLE,
    LIMIT_ACTIVE,
    MODES,
    REMOTE,
    VOLTAGE,
    Controlword,
    State,
)
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.setup.data_sheet import NO_OBJECT
from gen_profile_exporters.can.simulation.drive_dictionary import (
    MAPPED,
    OWN,
    PDOS,
    DriveVariant,
    dictionary,
    refusal,
    supports,
)
from gen_profile_exporters.can.startup import AT_ONCE, OFF, SLOW_DOWN_THEN_DISABLE
from gen_profile_exporters.modulo import nearest

HEARTBEAT_LOST, SYNC_LENGTH, SETPOINT_LOST = 0x8130, 0x8240, 0x8250  # EMCY codes of CiA 301
FOLLOWING, SYNC_LOST = 0x8611, 0x8700  # and of CiA 402
STAYS = 5  # of 605Ah: from here on a drive stays in quick stop
MOST_SYNCS = 240  # a transmission type up to this is the number of SYNCs from one TPDO to the next
INHIBIT_UNIT = NANOSECONDS // 10_000
SETPOINTS = {0x607A, 0x60C1, 0x60FF}
POWERED = {State.SWITCHED_ON, State.ENABLED, State.QUICK_STOP, State.FAULT_REACTION}


class SimulatedDrive:
    """One node.

    Parameters
    ----------
    node : int
    make : DriveVariant
    position : int
        Where the axis stands, in counts.

    Attributes
    ----------
    runaway : float or None
        Velocity in counts/s with which the axis goes off while it is enabled, whatever is asked of it; the
        drive tells truly where it is, and brakes when it is to stop.
    """

    def __init__(self, node: int, make: DriveVariant, position: int) -> None:
        self.node, self.make = node, make
        self.state = State.SWITCH_ON_DISABLED
        self.command = self.actual = float(position)
        self.velocity = 0.0  # counts/s, of the command
        self.runaway: float | None = None
        self.was_enabled = False
        self._misses, self._fresh, self._flags, self._late = 0, False, 0, 0.0
        self._controlword = 0
        self._values: dict[tuple[int, int], int] = {}  # as `value` read them, until they are written
        self._waiting: dict[int, bytes] = {}  # by RPDO: what counts from the next SYNC on
        self._heard: dict[int, int] = {}  # by RPDO, when
        self._master_heard: int | None = None
        self._syncs = 0
        self._recounts = False
        self._mode_asked: tuple[int, int | None] | None = None  # and since when
        self._last_sent: dict[int, tuple[int, bytes]] = {}  # by TPDO that is sent on change: when, and what
        self.local: Any = _Node(node, make, self.value)
        self.local.add_write_callback(self._written)
        self._pack_feedback()

    @property
    def period(self) -> float:
        """Interpolation period 60C2h in s."""
        return float(self.value(0x60C2, 1) * 10.0 ** self.value(0x60C2, 2))

    @property
    def operational(self) -> bool:
        """Whether PDOs are exchanged."""
        return bool(self.local.nmt.state == "OPERATIONAL")

    def value(self, index: int, sub: int = 0) -> int:
        """Read an object."""
        if (index, sub) not in self._values:
            entry = self.local.object_dictionary.get_variable(index, sub)
            if entry is None:
                return OWN.get((index, sub), 0)
            self._values[index, sub] = int(entry.decode_raw(self.local.get_data(index, sub)))
        return self._values[index, sub]

    def store(self, index: int, sub: int, value: int) -> None:
        """Set an object, as the drive itself does."""
        entry = self.local.object_dictionary.get_variable(index, sub)
        self.local.set_data(index, sub, entry.encode_raw(value))

    def boot(self) -> None:
        """Begin as after power-on: boot-up message, then pre-operational."""
        self.local.nmt.state = "INITIALISING"
        self.local.nmt.state = "PRE-OPERATIONAL"

    def reset(self) -> None:
        """Drop power and settings, and boot again."""
        self.state, self.velocity = State.SWITCH_ON_DISABLED, 0.0
        self.local.data_store.clear()
        self._values.clear()
        self.local.nmt.stop_heartbeat()
        self._waiting, self._heard, self._master_heard = {}, {}, None
        self._syncs = 0
        self.boot()

    def receive(self, cob_id: int, data: bytes, now: int) -> None:
        """Take a frame that may be one of its RPDOs, or the master's heartbeat."""
        if cob_id == frames.HEARTBEAT + (self.value(0x1016, 1) >> 16 & 0x7F):
            self._master_heard = now
        if not self.operational:
            return
        for pdo in PDOS:
            if self.value(0x1400 + pdo, 1) == cob_id:
                self._heard[pdo] = now
                if self.value(0x1400 + pdo, 2) in AT_ONCE:
                    self._take(pdo, data)
                else:
                    self._waiting[pdo] = data

    def synchronise(self, length: int) -> None:
        """Take what was sent for this SYNC, which has a byte of data where it counts."""
        if length != bool(self.value(0x1019)):
            self.local.emcy.send(SYNC_LENGTH, 1)
            return
        waiting, self._waiting = self._waiting, {}
        for pdo, data in waiting.items():
            self._take(pdo, data)

    def _take(self, pdo: int, data: bytes) -> None:
        for index, sub, value in _unpacked(self._mapping(0x1600 + pdo), data):
            if index not in self.local.object_dictionary:  # it stands for unused bits
                continue
            self.store(index, sub, value)
            self._fresh |= index in SETPOINTS

    def watch(self, now: int) -> None:
        """Look for a master that stopped sending, and change to the mode that was asked for."""
        if self._recounts:
            self._recounts = False
            self._pack_feedback()
        if self._mode_asked is not None:
            mode, since = self._mode_asked
            since = now if since is None else since
            self._mode_asked = mode, since
            if now - since >= self.make.mode_delay * NANOSECONDS:
                self.store(0x6061, 0, mode)
                self._mode_asked = None
        if self.state is not State.ENABLED:
            return
        wait = self.value(0x1016, 1) & 0xFFFF
        if wait and self._master_heard is not None and _over(now, self._master_heard, wait):
            self._lose_connection(HEARTBEAT_LOST)
        for pdo, heard in self._heard.items():
            if (wait := self.value(0x1400 + pdo, 5)) and _over(now, heard, wait):
                self._lose_connection(SETPOINT_LOST)

    def next_command(self) -> float:
        """Advance the command by one period and return it, in counts."""
        before = self.command
        if self.state is State.ENABLED:
            self._follow()
        if self.runaway is not None and self.state is State.ENABLED:
            self.velocity = self.runaway
            return self.actual + self.runaway * self.period
        if self.runaway is not None:
            self.command = self.actual
        if self.state in {State.QUICK_STOP, State.FAULT_REACTION}:
            self._brake()
        elif self.state is not State.ENABLED:
            self.command = self.actual
        if self.state is State.ENABLED:
            self.velocity = (self.command - before) / self.period
        return self.command

    def arrive(self, actual: float) -> None:
        """Take where the axis is at the end of the period."""
        self.actual = actual
        self._watch_following_error()
        self._pack_feedback()

    def feedback(self) -> list[tuple[int, bytes]]:
        """List the TPDOs due after a SYNC: every one, or every so many."""
        self._syncs += 1
        due = self._tpdos(lambda kind: 0 < kind <= MOST_SYNCS and self._syncs % kind == 0)
        return [(cob_id, data) for _, cob_id, data in due]

    def events(self, now: int) -> list[tuple[int, bytes]]:
        """List the TPDOs due at an event: a change, but for the inhibit time, or the event timer's end."""
        sent, last_sent = [], self._last_sent
        self._last_sent = {}
        for pdo, cob_id, data in self._tpdos(AT_ONCE.__contains__):
            inhibit, timer = self.value(0x1800 + pdo, 3), self.value(0x1800 + pdo, 5)
            at, last = last_sent.get(pdo, (now, None))
            changed = data != last and now - at >= inhibit * INHIBIT_UNIT
            if last is None or changed or (timer and _over(now, at, timer)):
                sent.append((cob_id, data))
                at, last = now, data
            self._last_sent[pdo] = at, last
        return sent

    def fault(self, code: int) -> None:
        """Report an emergency, brake, and stay in fault."""
        if self.state not in {State.FAULT, State.FAULT_REACTION}:
            self.local.emcy.send(code, 1)
            self.state = State.FAULT_REACTION if self.state in POWERED else State.FAULT
            self._pack_feedback()

    def _written(self, index: int, subindex: int, od: object, data: bytes) -> None:
        self._values.pop((index, subindex), None)
        if index == 0x1016:
            self._master_heard = None  # the next heartbeat is the first one
        elif index == 0x607B:
            self._recounts = True  # within another turn, once this is stored
        elif index == 0x6040:
            self._obey(int.from_bytes(data, "little"))
        elif index == 0x6060:
            mode = int.from_bytes(data, "little", signed=True)
            if not self.make.mode_delay and (mode == 0 or supports(self.value(0x6502), mode)):
                self.store(0x6061, 0, mode)
            elif self.make.mode_delay:
                self._mode_asked = mode, None

    def _obey(self, word: int) -> None:
        """Change state as a controlword commands (CiA 402-2, table of transitions)."""
        rising = word & ~self._controlword
        self._controlword = word
        state = self.state
        if state is State.FAULT:
            if rising & Controlword.FAULT_RESET:
                self.state = State.SWITCH_ON_DISABLED
        elif state is State.FAULT_REACTION:
            pass
        elif not word & 0x02:
            self.state = State.SWITCH_ON_DISABLED
        elif not word & 0x04:
            self.state = (
                State.QUICK_STOP if state in {State.ENABLED, State.QUICK_STOP} else State.SWITCH_ON_DISABLED
            )
        elif state is not State.QUICK_STOP:
            self._obey_switch(word)
        self._pack_feedback()

    def _obey_switch(self, word: int) -> None:
        match word & 0x0F:
            case Controlword.SHUTDOWN:
                self.state = State.READY
            case Controlword.SWITCH_ON if self.state is not State.SWITCH_ON_DISABLED:
                self.state = State.SWITCHED_ON
            case Controlword.ENABLE if self.state in {State.SWITCHED_ON, State.ENABLED}:
                if self.state is State.SWITCHED_ON:
                    self.command, self.velocity, self._misses = self.actual, 0.0, 0
                self.state, self.was_enabled = State.ENABLED, True
            case _:
                pass

    def _follow(self) -> None:
        if self._fresh:
            self._fresh, self._misses = False, 0
            self.command = self._within_travel(self._setpoint())
            return
        self._misses += 1
        if self.make.miss == "extrapolate" or self.value(0x6061) == MODES["csv"]:  # which holds a velocity
            self.command = self._within_travel(self.command + self.velocity * self.period)
        if self._misses > self.make.misses:
            if self.make.miss == "extrapolate":
                self.fault(SYNC_LOST)
            elif self.make.miss == "stop":
                self.state = State.QUICK_STOP

    def _setpoint(self) -> float:
        """Where the axis is to be one period later, in counts."""
        mode = self.value(0x6061)
        if mode == MODES["csv"]:
            return self.command + self.value(0x60FF) * self._counts(0x60A9) * self.period
        asked = self.value(0x60C1, 1) if mode == MODES["ip"] else self.value(0x607A)
        return float(nearest(asked, self._turn, round(self.command)))

    @property
    def _turn(self) -> int | None:
        """Counts after which positions begin anew (607Bh); None where they do not."""
        low, high = self.value(0x607B, 1), self.value(0x607B, 2)
        return high - low + 1 if low < high else None

    def _told(self) -> int:
        """Where the axis is, as the drive counts."""
        actual, low = round(self.actual), self.value(0x607B, 1)
        if self._turn is not None:
            return (actual - low) % self._turn + low
        return min(max(actual, -(2**31)), 2**31 - 1)

    def _counts(self, unit: int) -> float:
        """Tell how many counts/s (or counts/s²) make one unit of 60A9h (or 60AAh)."""
        held = self.value(unit)
        turn, metre = self.make.encoder[0] / self.make.encoder[1], self.make.counts_per_si
        of_one = {0xB4: turn, 0xC0: turn / 60, 0x01: metre, 0x10: metre, 0x41: math.radians(metre)}
        per_minute = 60.0 if held >> 8 & 0xFF == 0x47 else 1.0
        return 10.0 ** _signed_byte(held >> 24) * of_one.get(held >> 16 & 0xFF, 1.0) / per_minute

    def _brake(self) -> None:
        slowly = self.value(0x605A) == SLOW_DOWN_THEN_DISABLE and self.state is State.QUICK_STOP
        change = self.value(0x6084 if slowly else 0x6085) * self._counts(0x60AA) * self.period
        speed = max(0.0, abs(self.velocity) - change)
        self.velocity = speed if self.velocity > 0 else -speed
        self.command += self.velocity * self.period
        if not speed and self.state is State.FAULT_REACTION:
            self.state = State.FAULT
        elif not speed and self.value(0x605A) < STAYS:
            self.state = State.SWITCH_ON_DISABLED

    def _within_travel(self, position: float) -> float:
        low, high = self.value(0x607D, 1), self.value(0x607D, 2)
        within = min(max(position, low), high) if low < high else position
        self._flags = LIMIT_ACTIVE if within != position else 0
        return within

    def _watch_following_error(self) -> None:
        window = self.value(0x6065)
        apart = abs(self.command - self.actual) > window and window != 0xFFFF_FFFF
        self._late = self._late + self.period if apart and self.state is State.ENABLED else 0.0
        if self._late * 1e3 > self.value(0x6066):
            self._flags |= FOLLOWING_ERROR
            self.fault(FOLLOWING)

    def _lose_connection(self, code: int) -> None:
        """React as 6007h asks."""
        match self.value(0x6007):
            case 1:
                self.fault(code)
            case 2:
                self.local.emcy.send(code, 1)
                self.state = State.SWITCH_ON_DISABLED
            case 3:
                self.local.emcy.send(code, 1)
                self.state = State.QUICK_STOP

    def _pack_feedback(self) -> None:
        interpolating = self.value(0x6061) != MODES["ip"] or self._controlword & IP_ENABLE
        follows = FOLLOWS if self.state is State.ENABLED and interpolating else 0
        voltage = VOLTAGE if self.state in POWERED else 0
        self.store(0x6041, 0, self.state.bits | follows | voltage | REMOTE | self._flags)
        self.store(0x6064, 0, self._told())

    def _tpdos(self, due: Callable[[int], bool]) -> Iterator[tuple[int, int, bytes]]:
        """Go through the TPDOs that are on and whose transmission type is due: number, COB-ID, content."""
        for pdo in PDOS if self.operational else ():
            cob_id = self.value(0x1800 + pdo, 1)
            if cob_id & OFF or not due(self.value(0x1800 + pdo, 2)):
                continue
            if mapping := self._mapping(0x1A00 + pdo):
                yield pdo, cob_id & 0x7FF, self._packed(mapping)

    def _mapping(self, index: int) -> list[int]:
        return [self.value(index, sub) for sub in range(1, min(self.value(index), MAPPED) + 1)]

    def _packed(self, mapping: list[int]) -> bytes:
        parts = []
        for entry in mapping:
            there = entry >> 16 in self.local.object_dictionary
            data = self.local.get_data(entry >> 16, entry >> 8 & 0xFF) if there else bytes(8)
            parts.append(data[: (entry & 0xFF) // 8])
        return b"".join(parts)


class _Node(canopen.LocalNode):
    """canopen's node, which refuses by SDO what a drive does."""

    def __init__(self, node: int, make: DriveVariant, held: Callable[[int, int], int]) -> None:
        super().__init__(node, dictionary(node, make))
        self._make, self._held = make, held

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        if check_readable and index in self._make.lacks:
            raise canopen.SdoAbortedError(NO_OBJECT)
        return bytes(super().get_data(index, subindex, check_readable))

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        if check_writable:
            self._require_taken(index, subindex, data)
        super().set_data(index, subindex, data, check_writable)

    def _require_taken(self, index: int, sub: int, data: bytes) -> None:
        entry = self.object_dictionary.get_variable(index, sub)
        if entry is None or len(entry) != 8 * len(data):
            return  # which canopen refuses by itself
        written = int.from_bytes(data, "little")
        code = refusal(self._make, self.object_dictionary, self._held, (index, sub), written)
        if code is not None:
            raise canopen.SdoAbortedError(code)


def _unpacked(mapping: list[int], data: bytes) -> list[tuple[int, int, int]]:
    """Split a PDO: index, subindex and value of each object; nothing from one that is too short."""
    if 8 * len(data) < sum(entry & 0xFF for entry in mapping):
        return []
    parts, start = [], 0
    for entry in mapping:
        length = (entry & 0xFF) // 8
        signed = entry >> 16 in {*SETPOINTS, 0x60B1, 0x60B2, 0x6060}
        value = int.from_bytes(data[start : start + length], "little", signed=signed)
        parts.append((entry >> 16, entry >> 8 & 0xFF, value))
        start += length
    return parts


def _signed_byte(value: int) -> int:
    return (value + 128) % 256 - 128


def _over(now: int, since: int, milliseconds: int) -> bool:
    return now - since > milliseconds * NANOSECONDS // 1000
