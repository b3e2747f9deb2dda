"""The quick stop: the one place that stops axes, and does nothing else.

It is sent at once by PDO and repeated every cycle until every drive says, after it was sent, that it is not
powered to move. The drives brake on their own ramp (6085h), which needs nothing more from a controller or a
bus that just proved unreliable. A drive that does not obey at once, such as one that left the NMT state
operational and takes no PDOs, gets it by SDO as well; and when one still does not after its time-out, our
heartbeat ends, and it stops by itself, as it was set up to. What happened is told by a value; whoever reports
it does so afterwards.
"""

from __future__ import annotations

import itertools
import struct
from contextlib import suppress

import attrs
import can

from gen_profile.errors import StreamAborted
from gen_profile_exporters.can import frames, pdos
from gen_profile_exporters.can.cia402 import Controlword
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.streaming.pacer import Pacer
from gen_profile_exporters.can.streaming.watch import Watch, WatchedAxis

AGAIN = NANOSECONDS // 20  # after which an SDO counts as lost
_SDO = struct.Struct("<BHBHxx")  # an expedited transfer of 16 bits: command, index, subindex, data (CiA 301)
_WRITE, _READ, _READ_ANSWER = 0x2B, 0x40, 0x40  # commands; of an answer the upper three bits
CONTROLWORD = (pdos.CONTROLWORD.index, pdos.CONTROLWORD.sub)
STATUSWORD = (pdos.STATUSWORD.index, pdos.STATUSWORD.sub)


@attrs.frozen(kw_only=True)
class Stop:
    """What became of a quick stop.

    Attributes
    ----------
    unconfirmed : tuple of str
        Axes whose drives did not say that they are switched off.
    """

    unconfirmed: tuple[str, ...]

    @property
    def words(self) -> str:
        """A sentence."""
        if not self.unconfirmed:
            return "The axes were stopped."
        return (
            f"Not every drive confirmed the quick stop (missing: {', '.join(self.unconfirmed)}): they stop "
            "by their own time-outs; make sure that the axes stand before you approach them."
        )


def quick_stop(pacer: Pacer, watch: Watch, patience: int) -> Stop:
    """Stop all axes, and find out whether they did.

    Parameters
    ----------
    pacer : Pacer
    watch : Watch
    patience : int
        How long to wait until they stand, in ns.

    Returns
    -------
    Stop
    """
    pacer.outlast()
    clock = pacer.link.clock
    begun = clock.now()
    services = [_Service(pacer, axis) for axis in watch.axes]
    stop = [*pacer.commands(Controlword.QUICK_STOP), frames.message(frames.SYNC)]
    while True:
        for frame in stop:
            _try(pacer, frame)
        obeyed = all(axis.obeys(begun) for axis in watch.axes)
        if obeyed or clock.now() - begun <= pacer.timeout:
            with suppress(StreamAborted):
                pacer.beat()
        with suppress(StreamAborted):
            pacer.link.wait_until(clock.now() + pacer.period)
        unconfirmed = tuple(axis.name for axis in watch.axes if not axis.stands(begun))
        if not unconfirmed or clock.now() - begun > patience:
            return Stop(unconfirmed=unconfirmed)
        for service in services:
            if service.begun or not service.axis.obeys(begun):
                service.ask()


class _Service:
    """Quick stop by SDO and what the statusword then is, in turn, for a drive that takes no PDOs."""

    def __init__(self, pacer: Pacer, axis: WatchedAxis) -> None:
        self.axis = axis
        self._pacer, self._clock = pacer, pacer.link.clock
        self.begun = False
        self._asked: int | None = None  # when the request was sent that is not answered yet
        self._requests = itertools.cycle(
            [(_WRITE, *CONTROLWORD, Controlword.QUICK_STOP), (_READ, *STATUSWORD, 0)]
        )
        pacer.link.subscribe(self._take)

    def ask(self) -> None:
        """Send the next request, unless one is on its way."""
        self.begun = True
        if self._asked is None or self._clock.now() - self._asked > AGAIN:
            self._asked = self._clock.now()
            request = _SDO.pack(*next(self._requests))
            _try(self._pacer, frames.message(frames.SDO_REQUEST + self.axis.node, request))

    def _take(self, message: can.Message) -> None:
        if message.arbitration_id != frames.SDO_ANSWER + self.axis.node or len(message.data) != _SDO.size:
            return
        self._asked = None
        command, index, sub, value = _SDO.unpack(message.data)
        if command & 0xE0 == _READ_ANSWER and (index, sub) == STATUSWORD:
            self.axis.statusword, self.axis.heard = value, self._clock.now()


def _try(pacer: Pacer, frame: can.Message) -> None:
    """Send a frame; if it cannot be sent, the next cycle's may be."""
    with suppress(StreamAborted):
        pacer.link.send(frame)
