"""Several CAN buses as one: a drive's frames go by its own, SYNC and our heartbeat by all, back to back."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack

import attrs
import can

from gen_profile_exporters.can import frames
from gen_profile_exporters.can.host.link import Launching
from gen_profile_exporters.can.host.port import Port
from gen_profile_exporters.exporter import Target

OF_NODE = (frames.EMCY, frames.SDO_ANSWER, frames.SDO_REQUEST, frames.HEARTBEAT)  # and a node id
FAILURES = (can.CanError, OSError)


class JointBus(can.BusABC):
    """Buses by the names of their channels.

    A bus that fails keeps no frame from the others: it is reported once they have theirs.

    Parameters
    ----------
    buses : mapping of str to can.BusABC
        Opened; they are shut down with this one.
    target : Target
        Tells which drive is on which.
    """

    def __init__(self, buses: Mapping[str, can.BusABC], target: Target) -> None:
        super().__init__(channel=", ".join(buses))
        self.buses = dict(buses)
        self._order = list(buses)
        self._owners, self._nodes = _owners(target)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame by each bus that it is for.

        Raises
        ------
        can.CanOperationError
            A bus fails; those that do not have got it.
        """
        self._for_each(self._ways(msg), lambda bus: bus.send(msg, timeout))

    def keeps_instants(self) -> bool:
        """Try whether all buses send at given instants by themselves."""
        return all(isinstance(bus, Launching) and bus.keeps_instants() for bus in self.buses.values())

    def send_at(self, message: can.Message, instant: int) -> None:
        """Have a frame sent at an instant by each bus that it is for.

        Raises
        ------
        can.CanOperationError
            A bus fails; those that do not have got it.
        """

        def send(bus: can.BusABC) -> None:
            assert isinstance(bus, Launching)  # else it is not asked for
            bus.send_at(message, instant)

        self._for_each(self._ways(message), send)

    def shutdown(self) -> None:
        """Shut all of them down."""
        self._for_each(self.buses, lambda bus: bus.shutdown())
        super().shutdown()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        """Take a frame from any bus, each in its turn; what else waits on one that works comes first."""
        failure: can.CanOperationError | None = None
        for name in tuple(self._order):
            try:
                message = self._received(name)
            except FAILURES as error:
                failure = failure or can.CanOperationError(f"{name}: {error}")
                continue
            if message is not None:
                self._order.remove(name)
                self._order.append(name)
                return message, True
        if failure is not None:
            raise failure
        if timeout:
            message = self._received(self._order[0], timeout)
            self._order.append(self._order.pop(0))
            return message, True
        return None, True

    def _received(self, name: str, timeout: float = 0.0) -> can.Message | None:
        """Take a frame from a bus, unless a drive has that COB-ID which is on another one."""
        while (message := self.buses[name].recv(timeout)) is not None:
            message.channel = name
            if self._owners.get(message.arbitration_id, name) == name or message.is_extended_id:
                return message
        return None

    def _ways(self, message: can.Message) -> Iterable[str]:
        owner = self._owners.get(message.arbitration_id)
        if message.arbitration_id == frames.NMT and len(message.data) == 2:
            owner = self._nodes.get(message.data[1])
        return self.buses if owner is None else (owner,)

    def _for_each(self, names: Iterable[str], act: Callable[[can.BusABC], None]) -> None:
        failure: can.CanOperationError | None = None
        for name in names:
            try:
                act(self.buses[name])
            except FAILURES as error:
                failure = failure or can.CanOperationError(f"{name}: {error}")
        if failure is not None:
            raise failure


def opened(port: Port, target: Target) -> can.BusABC:
    """Open the bus of a target's drives, or all of their buses.

    Raises
    ------
    SpecError
        As `Port.open`.
    """
    if not target.can.channels:
        return port.open(target.can.bitrate)
    with ExitStack() as stack:
        buses = {}
        for channel in frames.buses(target):
            buses[channel] = attrs.evolve(port, channel=channel).open(target.can.bitrate)
            stack.callback(buses[channel].shutdown)
        stack.pop_all()
        return JointBus(buses, target)


def _owners(target: Target) -> tuple[dict[int, str], dict[int, str]]:
    """Tell by COB-ID, and by node id, on which channel each drive is."""
    cob_ids, nodes = dict[int, str](), dict[int, str]()
    for channel, node, own in zip(
        frames.channels(target), frames.nodes(target), frames.cob_ids(target), strict=True
    ):
        nodes[node] = channel
        cob_ids |= dict.fromkeys([*own.values(), *(base + node for base in OF_NODE)], channel)
    return cob_ids, nodes
