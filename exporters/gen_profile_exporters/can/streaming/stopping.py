"""The quick stop: the one place that stops axes, and does nothing else.

It is sent at once by PDO and repeated every cycle until every drive says, after it was sent, that it is not
powered to move, and has reported one place for a while. The drives brake on their own ramp (6085h), which
needs nothing more from a controller or a bus that just proved unreliable; drives without 605Ah, which may
stay powered, are switched off once all axes stand. A drive that does not obey at once, such as one that left
the NMT state operational and takes no PDOs, gets it by SDO as well; and when one still does not after its
time-out, our heartbeat ends, and it stops by itself, as it was set up to. What happened is given by a value,
to be reported afterwards.
"""

import itertools
import struct
from collections.abc import Mapping
from contextlib import suppress

import attrs
import can

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can import frames, pdos
from gen_profile_exporters.can.cia402 import Controlword
from gen_profile_exporters.can.host.clock import NANOSECONDS
from gen_profile_exporters.can.pdos import Field
from gen_profile_exporters.can.streaming.pacer import Pacer
from gen_profile_exporters.can.streaming.watch import Watch, WatchedAxis

AGAIN = NANOSECONDS // 20  # after which an SDO counts as lost
_SDO = struct.Struct("<BHB4s")  # an expedited transfer: command, index, subindex, data (CiA 301)
_WRITE, _READ, _READ_ANSWER = 0x2B, 0x40, 0x40  # commands; of an answer the upper three bits


@attrs.frozen(kw_only=True)
class Stop:
    """What became of a quick stop.

    Attributes
    ----------
    watched : bool
        Whether the drives watch our heartbeat.
    unconfirmed : mapping of str to str
        What is known of each axis that is not known to stand.
    """

    watched: bool
    unconfirmed: Mapping[str, str]

    @property
    def words(self) -> str:
        """A sentence."""
        if not self.unconfirmed:
            return "The axes were stopped."
        known = "; ".join(f"{name}: {what}" for name, what in self.unconfirmed.items())
        ended = "our heartbeat ended, without which a drive is to stop by itself; " if self.watched else ""
        return (
            f"Not every axis is known to stand ({known}): {ended}make sure that the axes stand before you "
            "approach them."
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
        unconfirmed = [axis for axis in watch.axes if not axis.stands(begun)]
        if not unconfirmed or clock.now() - begun > patience:
            return Stop(
                watched=pacer.watched, unconfirmed={axis.name: axis.known(begun) for axis in unconfirmed}
            )
        if pacer.left_powered and all(axis.braked(begun) for axis in watch.axes):
            stop = [*pacer.commands(Controlword.DISABLE_VOLTAGE), frames.message(frames.SYNC)]
        for service in services:
            if service.begun or not service.axis.obeys(begun):
                service.ask()


class _Service:
    """Quick stop by SDO, then statusword and position, in turn, for a drive that takes no PDOs."""

    def __init__(self, pacer: Pacer, axis: WatchedAxis) -> None:
        self.axis = axis
        self._pacer, self._clock = pacer, pacer.link.clock
        self.begun = False
        self._asked: int | None = None  # when the request was sent that is not answered yet
        stop = _request(_WRITE, pdos.CONTROLWORD, Controlword.QUICK_STOP)
        looks = (_request(_READ, entry) for entry in (pdos.STATUSWORD, pdos.ACTUAL_POSITION))
        self._requests = itertools.cycle([stop, *looks])
        pacer.link.subscribe(self._take)

    def ask(self) -> None:
        """Send the next request, unless one is on its way."""
        self.begun = True
        if self._asked is None or self._clock.now() - self._asked > AGAIN:
            self._asked = self._clock.now()
            _try(self._pacer, frames.message(frames.SDO_REQUEST + self.axis.node, next(self._requests)))

    def _take(self, message: can.Message) -> None:
        if message.arbitration_id != frames.SDO_ANSWER + self.axis.node or len(message.data) != _SDO.size:
            return
        self._asked = None
        command, index, sub, data = _SDO.unpack(message.data)
        for field in (pdos.STATUSWORD, pdos.ACTUAL_POSITION):
            if command & 0xE0 == _READ_ANSWER and (index, sub) == (field.index, field.sub):
                (value,) = pdos.packing([field]).unpack_from(data)
                self.axis.take(field, value, self._clock.now())


def _request(command: int, field: Field, value: int = 0) -> bytes:
    return _SDO.pack(command, field.index, field.sub, value.to_bytes(4, "little"))


def _try(pacer: Pacer, frame: can.Message) -> None:
    """Send a frame; if it cannot be sent, the next cycle's may be."""
    with suppress(StreamAborted):
        pacer.link.send(frame)
