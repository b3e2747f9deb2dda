"""A simulated Siemens controller: an S7 server with a playback block that runs behind it."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from snap7.error import S7Error
from snap7.server import Server
from snap7.type import SrvArea

from gen_profile.delivery.deployment.s7 import DOUBLE, REPLY_AT, STATE_AT
from gen_profile.delivery.deployment.simulated_block import LOOPBACK, SimulatedController
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.support.errors import OutputError
from gen_profile_exporters.playback.buffers import REPLY, REQUEST, STATE, state_length


class SimulatedS7Controller(SimulatedController):
    """The server: the block's arrays in a data block, `bExecute` in the first bit of the bit memory (M0.0).

    Parameters
    ----------
    table : BlockTable
    number : int
        Of the data block.
    port : int
    """

    def __init__(self, table: BlockTable, number: int, port: int) -> None:
        super().__init__(table, f"DB{number}", port)
        self._number = number
        self.data = bytearray(STATE_AT + DOUBLE.itemsize * state_length(table.constant("cAxes")))
        self.memory = bytearray(1)
        self.server = Server(log=False)
        self.server.register_area(SrvArea.DB, number, self.data)
        self.server.register_area(SrvArea.MK, 0, self.memory)

    @contextmanager
    def _served(self) -> Iterator[str]:
        self.turn(1)
        try:
            self.server.start_to(LOOPBACK, self.port)
        except (S7Error, OSError) as error:
            raise OutputError(f"port {self.port}: is not available; name another one.") from error
        try:
            yield f"s7://{LOOPBACK}:{self.port}/0/1"
        finally:
            self.server.stop()

    def turn(self, cycles: int) -> None:
        """Take the request over, call the block, show the reply and the state."""
        self.server.lock_area(SrvArea.DB, self._number)
        try:
            self.block.set(REQUEST, np.frombuffer(bytes(self.data[:REPLY_AT]), DOUBLE))
            self.block.set("bExecute", np.array([float(self.memory[0] & 1)]))
            self.block.run(cycles)
            for at, name in ((REPLY_AT, REPLY), (STATE_AT, STATE)):
                content = self.block.outputs[name].astype(DOUBLE).tobytes()
                self.data[at : at + len(content)] = content
        finally:
            self.server.unlock_area(SrvArea.DB, self._number)
