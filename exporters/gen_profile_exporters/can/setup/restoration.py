"""What the drives were set to before they were set up for a motion, kept to be put back afterwards."""

import struct
from collections.abc import Callable, Container, Iterable, Iterator, Mapping

from canopen import SdoAbortedError
from canopen.sdo.exceptions import SdoError

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can import frames, pdos
from gen_profile_exporters.can.cia402 import MOVING, state_of
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.host.link import Link
from gen_profile_exporters.can.setup.standing import Standing
from gen_profile_exporters.can.startup import OFF, PDO_PARAMETERS

MAPPING = 0x200  # from a PDO's parameters to its mapping
MOST_MAPPED = 64  # entries of a mapping (CiA 301); greater counts are of another kind of PDO
HEARTBEAT_WATCHED, SYNC_PERIOD, SYNC_COUNTER = (0x1016, 1), (0x1006, 0), (0x1019, 0)
STANDSTILL_TIMEOUT = 2 * NANOSECONDS  # for a drive to come to rest
SILENCE = (StreamAborted, SdoError, struct.error)  # no answer, or none that means anything

Place = tuple[int, int]  # index and subindex
Setting = tuple[int, int, bytes]


class Restoration:
    """The settings of all drives as they were found, by node."""

    def __init__(self) -> None:
        self._found: dict[int, list[Setting]] = {}

    @property
    def any(self) -> bool:
        """Whether there is anything to put back."""
        return any(self._found.values())

    def remember(self, node: int, settings: Iterable[Setting]) -> None:
        """Keep what a drive held, in the order in which it is to be put back."""
        self._found.setdefault(node, []).extend(settings)

    def remember_watch(self, node: int, watched: bytes | None) -> None:
        """Keep whose heartbeat a drive watched, unless that was ours, of a stream that was killed."""
        if watched is not None and not time_of_ours(watched) and int.from_bytes(watched[:2], "little"):
            self.remember(node, [(*HEARTBEAT_WATCHED, watched)])

    def put_back(self, link: Link, trembling: Mapping[int, int]) -> tuple[str, ...]:
        """Set the drives to what they held, once their axes stand; tell what did not go, a sentence each.

        An axis that still moves needs the ramp of the motion.

        Parameters
        ----------
        link : Link
        trembling : mapping of int to int
            By how many counts the axis of each node may tremble while it stands.
        """
        at_rest = _at_rest(link, {node: Standing(trembling[node]) for node in self._found})
        return tuple(words for node in self._found for words in self._put_back_one(link, node, at_rest))

    def _put_back_one(self, link: Link, node: int, at_rest: Container[int]) -> Iterator[str]:
        if node not in at_rest:
            yield f"Node {node} is not known to stand; its settings stay those of the motion."
            return
        for index, sub, data in self._found[node]:
            try:
                link.sdo(node).download(index, sub, data)
            except SdoAbortedError:
                yield f"Node {node} does not take back what it held in {index:04X}h:{sub:02X}."
            except SILENCE:
                yield f"Node {node} stopped answering; its settings stay those of the motion, in part."
                return


def _at_rest(link: Link, measured: Mapping[int, Standing]) -> set[int]:
    """Wait until drives are not powered to move and their axes stand; asked by SDO, not believed."""
    waiting, at_rest, deadline = set(measured), set[int](), link.clock.now() + STANDSTILL_TIMEOUT
    while waiting and link.clock.now() < deadline:
        for node in sorted(waiting):
            try:
                if state_of(_asked(link, node, pdos.STATUSWORD)) not in MOVING:
                    measured[node].take(_asked(link, node, pdos.ACTUAL_POSITION), link.clock.now())
                    at_rest |= {node} if measured[node].proved() else set()
            except SILENCE:
                waiting.discard(node)
        waiting -= at_rest
        link.wait_until(link.clock.now() + STANDSTILL_TIMEOUT // 100)
    return at_rest


def _asked(link: Link, node: int, field: pdos.Field) -> int:
    answer = link.sdo(node).upload(field.index, field.sub)
    (value,) = pdos.packing([field]).unpack_from(answer)
    return int(value)


def time_of_ours(watched: bytes | None) -> int:
    """Tell for how long in ns a drive waits for our heartbeat, by its 1016h:01; 0 where for none of ours."""
    value = int.from_bytes(watched or b"", "little")
    return (value & 0xFFFF) * NANOSECONDS // 1000 if value >> 16 & 0x7F == frames.MASTER else 0


def pdo_of(index: int) -> int:
    """Tell with what an object changes: a mapping with its PDO, the counter of SYNC with its period."""
    if index == SYNC_COUNTER[0]:
        return SYNC_PERIOD[0]
    return index - MAPPING if index - MAPPING in PDO_PARAMETERS else index


def settings_of(
    held: Mapping[Place, bytes | None], changed: Iterable[Place], read: Callable[[int, int], bytes | None]
) -> Iterator[Setting]:
    """List what puts a drive back: PDOs whole, in the order that CiA 301 asks for, then single objects.

    Parameters
    ----------
    held : mapping of (int, int) to bytes or None
        What the drive holds now; None where it has no such object.
    changed : iterable of (int, int)
        What is about to be changed of it.
    read : callable
        Reads another object of the drive.
    """
    changed = [place for place in changed if place != HEARTBEAT_WATCHED]
    if SYNC_COUNTER in changed and held[SYNC_PERIOD] is not None:  # which changes only while no period is set
        yield *SYNC_PERIOD, bytes(4)
        changed = [place for place in changed if place != SYNC_PERIOD] + [SYNC_PERIOD]
    pdos = {pdo_of(index) for index, _ in changed} & PDO_PARAMETERS
    pdos = {index for index in pdos if held.get((index + MAPPING, 0)) is not None}
    for index in sorted(pdos):
        remapped = any(place[0] == index + MAPPING for place in changed)
        yield from _pdo(index, held, read, remapped=remapped)
    for index, sub in changed:
        data = held[index, sub]
        if data is not None and pdo_of(index) not in pdos:
            yield index, sub, data


def _pdo(
    index: int,
    held: Mapping[Place, bytes | None],
    read: Callable[[int, int], bytes | None],
    *,
    remapped: bool,
) -> Iterator[Setting]:
    cob_id, count = held[index, 1], held[index + MAPPING, 0]
    assert cob_id is not None and count is not None  # a PDO with a mapping has a COB-ID
    yield index, 1, (int.from_bytes(cob_id, "little") | OFF).to_bytes(4, "little")
    if remapped:
        yield from _mapping(index + MAPPING, count, read)
    for (of, sub), data in held.items():
        if of == index and sub != 1 and data is not None:
            yield index, sub, data
    yield index, 1, cob_id


def _mapping(index: int, count: bytes, read: Callable[[int, int], bytes | None]) -> Iterator[Setting]:
    yield index, 0, b"\0"
    if count[0] <= MOST_MAPPED:
        for sub in range(1, count[0] + 1):
            entry = read(index, sub)
            if entry is not None:
                yield index, sub, entry
        yield index, 0, count
