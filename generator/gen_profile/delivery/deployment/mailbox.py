"""Requests to a playback block whose numbers are variables, and its replies (of ``requests.st``)."""

import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.support.errors import DeploymentError
from gen_profile_exporters.playback.buffers import FIRST, LENGTH, RESULTS, TRIALS, WINDOW

READ, WRITE, SWITCH, RELEASE = range(4)
IN_USE, IDLE = 0, 1  # buffers
ACCEPTED, HELD, MOVES, UNFIT = range(len(RESULTS))
UNTRIED, TRIED, PASSED, REJECTED = range(len(TRIALS))
UNCHECKED, RIGHT, WRONG = range(3)  # the checksum of the buffer in use
REFUSALS = {
    HELD: "Another deployment is under way, or broke off within the last 30 s; run this again after it.",
    MOVES: "The block moves, waits to, or is trying another table; run this again when it stands still.",
    UNFIT: "The block finds another table in its idle buffer than was written there, as if something else "
    "wrote to it; find out what does, and run this again.",
}
SHOWN = "let the controller show aRequest and aReply as arrays of LREAL"
KEPT = "look whether it was started anew, or another client writes to it"
UNSECURED = {"security": "none", "policy": "None", "certificate_sha256": "", "user": ""}
REOPENED, SENT, LOOKS = 3, 4, 200  # times that a connection, a request, and a reply to it are tried
POLL_INTERVAL = 0.005  # s between two looks for a reply


class LinkLostError(Exception):
    """The connection to a controller broke."""


class BlockRefusedError(DeploymentError):
    """The block declined a request, and uses the table that it had."""


class MailboxLink(Protocol):
    """A way to the three arrays of a block."""

    def write(self, request: Array) -> None:
        """Write the whole of ``aRequest``; raises `LinkLostError`, or `DeploymentError` if it is refused."""

    def read(self) -> Array:
        """Read the whole of ``aReply``; raises likewise."""

    def state(self) -> Array:
        """Read the whole of ``aState``, for which nothing is written; raises likewise."""

    def reopen(self) -> None:
        """Connect again; raises likewise."""


class ControllerLink(MailboxLink, Protocol):
    """One that stands, and knows its other end: address, instance and security, for the record."""

    server: dict[str, str]

    def close(self) -> None:
        """End the connection, if it stands."""


@contextmanager
def first_connected(link: ControllerLink, url: str, look_at: str) -> Iterator[None]:
    """Close a link whose first connection fails, and say what to look at where nothing answers.

    Raises
    ------
    DeploymentError
    """
    try:
        yield
    except LinkLostError as error:
        link.close()
        raise DeploymentError(f"{url} cannot be reached ({error}); look at {look_at}.") from error
    except BaseException:
        link.close()
        raise


def _whole() -> Any:
    """Take a whole number that came as a double."""
    return attrs.field(converter=int)


@attrs.frozen(kw_only=True)
class BlockStatus:
    """What a block says of itself with every reply."""

    result: int
    interface: int = _whole()
    kind: int = _whole()
    layout: int = _whole()
    axes: int = _whole()
    cycle_time: float
    capacity: int = _whole()
    state: int = _whole()
    trial: int = _whole()
    buffer: int = _whole()
    checked: int = _whole()
    checksum: float


class Mailbox:
    """A client of a block, which the block knows by a number.

    Parameters
    ----------
    link : MailboxLink
    pause : callable
        Waits for so many seconds.
    """

    def __init__(self, link: MailboxLink, pause: Callable[[float], None] = time.sleep) -> None:
        self._link, self._pause = link, pause
        self._owner = 1 + secrets.randbelow(2**31 - 2)
        self._number = 1 + secrets.randbelow(2**30)
        self._kind: tuple[Any, ...] | None = None  # of the block

    def status(self) -> BlockStatus:
        """Ask how the block stands."""
        return self._exchange(READ)[0]

    def settled(self) -> BlockStatus:
        """Ask until the checksum of the buffer in use was worked out, a second or two.

        Raises
        ------
        DeploymentError
            It is not.
        """
        for _ in range(20 * LOOKS):
            status = self.status()
            if status.trial != TRIED and status.checked != UNCHECKED:
                return status
            self._pause(POLL_INTERVAL)
        raise DeploymentError("The block does not work out its table's checksum; check its task.")

    def read(self, buffer: int, length: int) -> Array:
        """Read a buffer's first values."""
        parts = [
            self._exchange(READ, buffer=buffer, place=place, count=min(WINDOW, length - place))[1]
            for place in range(0, length, WINDOW)
        ]
        return np.concatenate(parts)

    def write(self, values: Array) -> None:
        """Write to the idle buffer, and hold every part to its echo.

        Raises
        ------
        DeploymentError
        """
        for place in range(0, len(values), WINDOW):
            part = values[place : place + WINDOW]
            _, echo = self._exchange(WRITE, buffer=IDLE, place=place, count=len(part), data=part)
            require_same(echo, part, place)

    def switch(self, checksum: float) -> None:
        """Have the idle buffer used, if it is the one of a checksum; wait until the block has tried it.

        Raises
        ------
        BlockRefusedError
            The block moves or holds another table, or finds it wrong and uses the former one again.
        DeploymentError
        """
        self._exchange(SWITCH, checksum=checksum)
        status = self.settled()
        if status.checksum != checksum:
            raise BlockRefusedError(
                "The block found the new table's checksum wrong: a value was altered in the controller. Run "
                "this again; if that recurs, its memory is at fault."
            )

    def release(self) -> None:
        """Let others write."""
        self._exchange(RELEASE)

    def _exchange(
        self,
        command: int,
        *,
        buffer: int = IN_USE,
        place: int = 0,
        count: int = 0,
        checksum: float = 0.0,
        data: Array | None = None,
    ) -> tuple[BlockStatus, Array]:
        """Send a request until its reply comes; all of them may be sent again."""
        self._number += 1
        request = np.zeros(LENGTH)
        request[:7] = (self._number, self._owner, command, buffer, place, count, checksum)
        if data is not None:
            request[FIRST : FIRST + len(data)] = data
        request[-1] = self._number
        lost = 0
        for _ in range(SENT):
            while True:
                try:
                    if (reply := self._answered(request)) is not None:
                        return self._understood(reply, count)
                    break
                except LinkLostError:
                    lost += 1
                    if lost > REOPENED:
                        raise
                    self._pause(POLL_INTERVAL)
                    self._link.reopen()
        raise DeploymentError(
            "The block does not answer, as if it were not called in any task, or another client wrote to it "
            "all the time; check the task, and run this again."
        )

    def _answered(self, request: Array) -> Array | None:
        self._link.write(request)
        for _ in range(LOOKS):
            reply = self._link.read()
            if len(reply) != LENGTH:
                raise DeploymentError(
                    f"aReply has {len(reply)} values there in place of {LENGTH}: something shortened it. "
                    "Restart the controller's server, and run this again."
                )
            if reply[0] == reply[-1] == request[0]:
                return reply
            self._pause(POLL_INTERVAL)
        return None

    def _understood(self, reply: Array, count: int) -> tuple[BlockStatus, Array]:
        """Read a reply; raises DeploymentError where it refuses, or another block replies than before."""
        result, *rest = reply[1:13].tolist()
        if result in REFUSALS:
            raise BlockRefusedError(REFUSALS[int(result)])
        names = [field.name for field in attrs.fields(BlockStatus)][1:]
        status = BlockStatus(result=int(result), **dict[str, Any](zip(names, rest, strict=True)))
        kind = (status.interface, status.kind, status.layout, status.axes, status.cycle_time, status.capacity)
        if self._kind not in {None, kind}:
            raise DeploymentError("The controller's program was replaced meanwhile; run this again.")
        self._kind = kind
        return status, reply[FIRST : FIRST + count].copy()


def differing(held: Array, due: Array) -> list[int]:
    """List the places where values differ in any bit."""
    return np.flatnonzero(held.view(np.uint64) != due.view(np.uint64)).tolist()


def require_same(held: Array, due: Array, place: int = 0, cure: str = SHOWN) -> None:
    """Hold values that were read back to those that were written, bit for bit; else say what to do.

    Raises
    ------
    DeploymentError
    """
    places = differing(held, due)
    if not places:
        return
    first = places[0]
    words = f"value {place + first} is {float(held[first])!r} there, not {float(due[first])!r}"
    if (held == due.astype(np.float32)).all():
        words += ": something on the way rounds to REAL"
    raise DeploymentError(
        f"{len(places)} of {len(due)} values are not those that were written ({words}); {cure}, and run this "
        "again."
    )
