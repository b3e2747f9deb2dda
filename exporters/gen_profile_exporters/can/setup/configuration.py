"""Set the drives up by SDO before anything moves, and read back that they are.

Whatever matters to safety is read back from the drive, not believed: identity, mode, mapping, interpolation
period, what it does when setpoints cease, the window of the following error, limits, and where the
axis stands.
"""

import json
import struct
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from contextlib import suppress
from decimal import Decimal

import attrs
import can
from canopen.sdo.exceptions import SdoError

from gen_profile.support.errors import StreamAborted
from gen_profile.support.units import AxisScale
from gen_profile_exporters.can import drive_units, frames, startup
from gen_profile_exporters.can.cia402 import (
    CIA_402,
    FAULTS,
    MODES,
    MOVING,
    Controlword,
    State,
    state_of,
)
from gen_profile_exporters.can.following_window import useful
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.host.link import Link
from gen_profile_exporters.can.scaling import Demand, magnitude_counts, start_counts
from gen_profile_exporters.can.setup.node import Node
from gen_profile_exporters.can.setup.restoration import (
    HEARTBEAT_WATCHED,
    Place,
    Restoration,
    pdo_of,
    settings_of,
    time_of_ours,
)
from gen_profile_exporters.can.setup.standing import trembling
from gen_profile_exporters.can.setup.units import require_position_unit, require_units
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.modulo import least, nearest, turn_counts, within

COB_ID_BITS = 0x8000_07FF  # of a PDO's COB-ID entry: what must come back as it was set
START, PRE_OPERATIONAL = 0x01, 0x80  # NMT commands
WINDOW_OFF = 0xFFFF_FFFF  # of 6065h
STOP_PATIENCE = 2 * NANOSECONDS  # for one that lost its streamer to brake
LOOK_AGAIN = NANOSECONDS // 50  # at its state
SCALING = {0x608F, 0x6091, 0x6092}  # of positions, in the drive
PERIOD_DIGITS, PERIOD_EXPONENT = (0x60C2, 1), (0x60C2, 2)


def configure(
    link: Link,
    target: Target,
    demand: Demand,
    restoration: Restoration,
    meanwhile: Callable[[], None],
    *,
    reset_fault: bool = False,
) -> tuple[int, ...]:
    """Set up all drives and find each of them fit to follow.

    A drive may watch our heartbeat as soon as 1016h says so, or still from a stream that was killed. So no
    drive watches it before the first one, and `meanwhile` sends it from then on.

    Parameters
    ----------
    link : Link
    target : Target
    demand : Demand
    restoration : Restoration
        Remembers what the drives were set to, as far as that is changed.
    meanwhile : callable
        What must go on while an answer is awaited, once no drive watches our heartbeat any more.
    reset_fault : bool
        Whether a drive that is in fault is reset first.

    Returns
    -------
    tuple of int
        Where the axes stand, in counts.

    Raises
    ------
    StreamAborted
        A drive is another one, in fault, cannot be set up, watches nothing, or stands elsewhere.
    """
    lists = startup.startup_lists(demand, target)
    for node in (nodes := _nodes(link, target)):
        link.send(nmt(PRE_OPERATIONAL, node.number))
        _require_identity(node, target)
        if reset_fault:
            _reset_fault(node, target)
        watched = node.upload(*HEARTBEAT_WATCHED, optional=True)
        if patience := time_of_ours(watched):  # its streamer was killed just now, and it stops by itself
            _wait_while(node, MOVING, patience + STOP_PATIENCE)
        _require_rest(node)
        restoration.remember_watch(node.number, watched)
        node.download(*HEARTBEAT_WATCHED, bytes(4))  # as a stream that was killed has set it
    link.meanwhile = meanwhile
    for node in nodes:
        require_position_unit(node, target.axes[node.column])
        require_units(node, target)
        _set(node, lists[node.number], restoration)
    return tuple(_require_fit(node, target, demand) for node in nodes)


def positions(link: Link, target: Target, demand: Demand) -> tuple[int, ...]:
    """Ask the drives where their axes stand, in counts; changes nothing.

    Raises
    ------
    StreamAborted
        A drive is another one, or counts in other units than the spec says.
    """
    lists = startup.startup_lists(demand, target)
    for node in (nodes := _nodes(link, target)):
        _require_identity(node, target)
        require_position_unit(node, target.axes[node.column])
        for entry in lists[node.number]:
            held = node.upload(entry.index, entry.sub) if entry.index in SCALING else entry.data
            if held != entry.data:
                raise node.unfit(
                    f"the drive holds another {entry.index:04X}h:{entry.sub:02X} than the "
                    f"spec ({entry.meaning}), and counts in other units; set that in the drive."
                )
    near = start_counts(target)
    return tuple(_actual(node, target, near[node.column]) for node in nodes)


def start(link: Link, target: Target) -> None:
    """Command all nodes to the NMT state operational."""
    for number in frames.nodes(target):
        link.send(nmt(START, number))


def release(link: Link, target: Target, restoration: Restoration) -> tuple[str, ...]:
    """Let the drives be alone again: no PDOs taken, no heartbeat of ours watched, set as they were found.

    One that does not listen reports a lost heartbeat; that does no harm to the others.

    Returns
    -------
    tuple of str
        What could not be put back, a sentence each.
    """
    for number in frames.nodes(target):
        with suppress(StreamAborted):
            link.send(nmt(PRE_OPERATIONAL, number))  # first: it would miss setpoints while it answers
    for number in frames.nodes(target):
        with suppress(StreamAborted, SdoError, struct.error):
            link.sdo(number).download(*HEARTBEAT_WATCHED, bytes(4))
    allowed = [trembling(axis) for axis in target.axes]
    return restoration.put_back(link, dict(zip(frames.nodes(target), allowed, strict=True)))


def nmt(command: int, node: int) -> can.Message:
    """Make an NMT command."""
    return frames.message(frames.NMT, bytes([command, node]))


def _nodes(link: Link, target: Target) -> list[Node]:
    return [
        Node(link, number, column, axis.name)
        for column, (number, axis) in enumerate(zip(frames.nodes(target), target.axes, strict=True))
    ]


def _require_fit(node: Node, target: Target, demand: Demand) -> int:
    """Find a drive that was set up fit to follow; return where its axis stands."""
    _require_mode(node, target)
    if target.can.mode != "csv":  # in which the streamer watches, not the drive
        _require_window(node, target, demand)
    _require_travel(node, target, demand)
    _require_homed(node, target)
    return _require_start(node, target, demand)


def _require_mode(node: Node, target: Target) -> None:
    """Require the mode that was set, which drives may take seconds to change to."""
    mode, clock = MODES[target.can.mode], node.link.clock
    deadline = clock.now() + state_patience(target)
    while (shown := _signed(node.read(0x6061, bits=8), 8)) != mode:
        if clock.now() > deadline:
            raise node.unfit(
                f"the drive shows mode {shown} (6061h) instead of {mode}, still {target.can.state_timeout:g} "
                "s after it was set (can.state_timeout)."
            )
        node.link.wait_until(clock.now() + LOOK_AGAIN)


def state_patience(target: Target) -> int:
    """Tell how long a drive may take to change its state, in ns."""
    return round(target.can.state_timeout * NANOSECONDS)


def _require_identity(node: Node, target: Target) -> None:
    device = node.read(0x1000)
    if device & 0xFFFF != CIA_402:
        raise node.unfit(f"node {node.number} is no CiA 402 drive (1000h is {device:08X}h).")
    serial = target.can.serial.get(node.name)
    identity = ((1, target.can.vendor, "vendor"), (2, target.can.product, "product"), (4, serial, "serial"))
    for sub, wanted, what in identity:
        if wanted is not None and (actual := node.read(0x1018, sub)) != wanted:
            raise node.unfit(
                f"node {node.number} is another drive: its {what} is {actual:08X}h, and "
                f"can.{what} asks for {wanted:08X}h; check node ids and cabling."
            )
    if not node.read(0x6502) >> (MODES[target.can.mode] - 1) & 1:
        raise node.unfit(
            f"the drive does not know the mode {target.can.mode} (6502h); choose another one in can.mode."
        )


def _reset_fault(node: Node, target: Target) -> None:
    """Reset a fault, by a rising edge, and give the drive time for it."""
    if state_of(node.read(0x6041, bits=16)) is not State.FAULT:
        return
    channel = node.link.sdo(node.number)
    try:
        for word in (Controlword.DISABLE_VOLTAGE, Controlword.FAULT_RESET, Controlword.DISABLE_VOLTAGE):
            channel.download(0x6040, 0, word.to_bytes(2, "little"))
    except (SdoError, struct.error) as error:
        raise node.silent(error) from error
    _wait_while(node, FAULTS, state_patience(target))


def _wait_while(node: Node, states: Container[State], patience: int) -> None:
    """Wait as long as a drive is in one of some states, at most for so long, in ns."""
    clock = node.link.clock
    deadline = clock.now() + patience
    while state_of(node.read(0x6041, bits=16)) in states and clock.now() < deadline:
        node.link.wait_until(clock.now() + LOOK_AGAIN)


def _require_rest(node: Node) -> None:
    state = state_of(word := node.read(0x6041, bits=16))
    if state is State.UNKNOWN:
        raise node.unfit(
            f"the drive reports the statusword {word:04X}h, which is no state of CiA 402; "
            "find out in its manual what it means."
        )
    if state in FAULTS:
        raise node.unfit(
            f"the drive is in the state {state.words!r}; find out why, and reset it there "
            "or ask for it (reset_fault)."
        )
    if state in MOVING:
        raise node.unfit(
            f"the drive is in the state {state.words!r}: another controller commands it, "
            "or left it so; have it switched off there (controlword 6040h = 0)."
        )


def _set(node: Node, entries: Sequence[startup.Entry], restoration: Restoration) -> None:
    """Write the list in its order where something differs, and require what the drive then holds."""
    entries, held = fitted(node, entries)
    final = {(entry.index, entry.sub): entry for entry in entries}
    changed = [(entry.index, entry.sub) for entry, _ in _differing(held, final)]
    if not changed:
        return

    def read(index: int, sub: int) -> bytes | None:
        return node.upload(index, sub, optional=True)

    restoration.remember(node.number, settings_of(held, changed, read))
    touched = {pdo_of(index) for index, _ in changed}  # and so put back, whole where they are PDOs
    for entry in entries:
        if pdo_of(entry.index) in touched and not entry.fixed:
            node.download(entry.index, entry.sub, _written(entry, held))
    if differing := _differing(_held(node, final), final):
        _require_there(node, [entry.index for entry, kept in differing if kept is None])
        entry, kept = differing[0]
        show = "{:X}h".format if entry.is_code else _shown
        holds = "nothing" if kept is None else show(int.from_bytes(kept, "little"))
        raise node.unfit(
            f"{entry.index:04X}h:{entry.sub:02X} ({entry.meaning}) must hold "
            f"{show(int.from_bytes(entry.data, 'little'))}, but the drive keeps {holds} there; set the "
            "drive, or adapt the spec to it."
        )


def _require_there(node: Node, lacking: Iterable[int]) -> None:
    """Refuse a drive that lacks objects which have a substitute, and say what is lost with them."""
    lost = {f"{index:04X}h": startup.SUBSTITUTES.get(index, "") for index in lacking}
    if lost and all(lost.values()):
        without = "; ".join(f"{name}, {what}" for name, what in lost.items())
        raise node.unfit(
            f"the drive has no {', '.join(lost)}. Without {without}. If that will do, list "
            f"{json.dumps([*lost])[1:-1]} in can.without, and export again."
        )


def fitted(
    node: Node, entries: Sequence[startup.Entry]
) -> tuple[tuple[startup.Entry, ...], dict[Place, bytes | None]]:
    """Leave out what a drive lacks and need not have, and tell what it holds in the rest."""
    held = _held(node, {(entry.index, entry.sub): entry for entry in entries})
    there = [entry for entry in entries if held[entry.index, entry.sub] is not None or not entry.optional]
    return _with_its_exponent(there, held), held


def _written(entry: startup.Entry, held: Mapping[Place, bytes | None]) -> bytes:
    """Tell what to write; a PDO is switched off with what it held, as that must not change before."""
    before = held[entry.index, entry.sub]
    if before is None or not _switches_off(entry):
        return entry.data
    kept = int.from_bytes(before, "little") | entry.value & startup.NO_REMOTE_REQUEST
    return (startup.OFF | kept).to_bytes(4, "little")


def _switches_off(entry: startup.Entry) -> bool:
    return entry.index in startup.PDO_PARAMETERS and entry.sub == 1 and bool(entry.value & startup.OFF)


def _held(node: Node, final: Mapping[Place, startup.Entry]) -> dict[Place, bytes | None]:
    return {place: node.upload(*place, entry.bits, optional=entry.optional) for place, entry in final.items()}


def _differing(
    held: Mapping[Place, bytes | None], final: Mapping[Place, startup.Entry]
) -> list[tuple[startup.Entry, bytes | None]]:
    wanted = {place: entry.data for place, entry in final.items()}
    same = {place for place, entry in final.items() if _same(entry, held[place])}
    if _interpolation_period(held) == _interpolation_period(wanted):  # 40 × 0.1 ms are 4 × 1 ms, too
        same |= {PERIOD_DIGITS, PERIOD_EXPONENT}
    return [(entry, held[place]) for place, entry in final.items() if place not in same]


def _same(entry: startup.Entry, data: bytes | None) -> bool:
    if data is None:
        return entry.optional
    if _switches_off(entry):
        return bool(int.from_bytes(data, "little") & startup.OFF)
    if entry.index in startup.PDO_PARAMETERS and entry.sub == 1:
        apart = int.from_bytes(data, "little") ^ int.from_bytes(entry.data, "little")
        return not apart & COB_ID_BITS
    if entry.index in startup.PDO_PARAMETERS and entry.sub == 2 and entry.value in startup.AT_ONCE:
        return data[0] in startup.AT_ONCE
    if entry.index in drive_units.KEYS:  # a code that is not known here may mean what is stated
        held = drive_units.unit_of(entry.index, int.from_bytes(data, "little"))
        return held is None or held == drive_units.unit_of(entry.index, entry.value)
    return data == entry.data


def _interpolation_period(objects: Mapping[Place, bytes | None]) -> Decimal | None:
    digits, exponent = objects.get(PERIOD_DIGITS), objects.get(PERIOD_EXPONENT)
    if digits is None or exponent is None:
        return None
    return Decimal(int.from_bytes(digits, "little")).scaleb(int.from_bytes(exponent, "little", signed=True))


def _with_its_exponent(
    entries: Sequence[startup.Entry], held: Mapping[Place, bytes | None]
) -> tuple[startup.Entry, ...]:
    """State the interpolation period by the power of ten that the drive holds, if it can be: some keep it."""
    period = _interpolation_period({(entry.index, entry.sub): entry.data for entry in entries})
    kept = held[PERIOD_EXPONENT]
    if period is None or kept is None:
        return tuple(entries)
    exponent = int.from_bytes(kept, "little", signed=True)
    digits = period.scaleb(-exponent)
    if not (1 <= digits <= frames.MOST_DIGITS and digits == int(digits)):
        return tuple(entries)
    own = {PERIOD_DIGITS: int(digits), PERIOD_EXPONENT: exponent}
    places = [(entry.index, entry.sub) for entry in entries]
    return tuple(
        attrs.evolve(entry, value=own.get(at, entry.value)) for entry, at in zip(entries, places, strict=True)
    )


def _require_window(node: Node, target: Target, demand: Demand) -> None:
    """Require a window that stops the axis soon; ours is beside it, but the drive's works without the bus."""
    held, widest = node.upload(0x6065, 0, optional=True), useful(demand, target)[node.column]
    if held is None:
        _require_there(node, {0x6065} if "6065h" not in target.can.without else ())
        return
    window = int.from_bytes(held, "little")
    scale = abs(target.axes[node.column].counts_per_si)
    cure = f"set {widest / scale:.3g} ({widest} counts) or less there, or state can.following_error"
    if window in {0, WINDOW_OFF}:
        raise node.unfit(f"the drive does not watch its following error (6065h is {_shown(window)}); {cure}.")
    if window > widest:
        raise node.unfit(
            f"the drive's following error window of {window / scale:.3g} (6065h is "
            f"{_shown(window)}) is wider than is useful for this motion; {cure}."
        )


def _require_travel(node: Node, target: Target, demand: Demand) -> None:
    ends = [node.upload(0x607D, sub, optional=True) for sub in (1, 2)]
    if ends[0] is None or ends[1] is None:
        return
    low, high = (int.from_bytes(end, "little", signed=True) for end in ends if end is not None)
    (begin, end), turn = demand.ends[node.column], turn_counts(target.axes[node.column])
    if turn is not None:  # no end of a travel may lie within the turn
        begin, end = int(least(turn)), int(least(turn)) + turn - 1
    if low < high and not (low <= begin and end <= high):
        raise node.unfit(
            f"the motion from {begin} to {end} counts leaves the drive's "
            f"travel of {low} to {high} counts (607Dh)."
        )


def _require_homed(node: Node, target: Target) -> None:
    if target.can.homed is None:
        return
    index, sub, bits = target.can.homed
    if (held := node.read(index, sub)) & bits != bits:
        raise node.unfit(
            f"it is not homed, as can.homed asks ({index:04X}h:{sub:02X} is {held:X}h); home it."
        )


def _require_start(node: Node, target: Target, demand: Demand) -> int:
    axis = target.axes[node.column]
    actual = _actual(node, target, 0 if demand.start is None else demand.start[node.column])
    if demand.start is None:
        _require_inside(actual, node, axis, demand)
        return actual
    first = demand.start[node.column]
    allowed = magnitude_counts(target.can.start_tolerance, axis)
    if abs(actual - first) > allowed:
        raise node.unfit(
            f"it stands at {actual / axis.counts_per_si:.6g}, and the motion starts at "
            f"{first / axis.counts_per_si:.6g} ({abs(actual - first)} counts apart, {allowed} allowed by "
            "can.start_tolerance); home it, or move it there."
        )
    return actual


def _actual(node: Node, target: Target, near: int) -> int:
    """Ask where the axis stands, in counts; of an axis that begins anew, as near as can be to a place.

    Raises
    ------
    StreamAborted
        It tells a place outside the turn after which it is said to begin anew.
    """
    actual, turn = _signed(node.read(0x6064)), turn_counts(target.axes[node.column])
    if turn is not None and within(actual, turn) != actual:
        low = int(least(turn))
        raise node.unfit(
            f"it stands at {actual} counts, outside the turn of axis.modulo ({low} to {low + turn - 1}), so "
            "the drive does not begin anew there; set its modulo axis up, or leave axis.modulo out."
        )
    return nearest(actual, turn, near)


def _require_inside(actual: int, node: Node, axis: AxisScale, demand: Demand) -> None:
    least, greatest = demand.ends[node.column]
    if not least <= actual <= greatest:
        ends = sorted(end / axis.counts_per_si for end in (least, greatest))
        raise node.unfit(
            f"it stands at {actual / axis.counts_per_si:.6g}, outside the planner's travel "
            f"of {ends[0]:.6g} to {ends[1]:.6g}; move it there by other means."
        )


def _signed(value: int, bits: int = 32) -> int:
    return value - (1 << bits) if value >> (bits - 1) else value


def _shown(value: int) -> str:
    """Spell a number as people and as manuals do."""
    return f"{value} ({value:X}h)"
