"""A simulated Siemens controller: an S7 server with a playback block that runs behind it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

import numpy as np
from snap7.error import S7Error
from snap7.server import Server
from snap7.type import SrvArea

from gen_profile.deployment.s7 import DOUBLE, REPLY_AT, STATE_AT
from gen_profile.deployment.simulated_block import LOOPBACK, SimulatedBlock
from gen_profile.deployment.table import BlockTable
from gen_profile.errors import OutputError
from gen_profile_exporters.playback.buffers import REPLY, REQUEST, STATE, state_length


class SimulatedS7Controller:
    """The server: the block's arrays in a data block, `bExecute` in the first bit of the bit memory (M0.0).

    Parameters
    ----------
    table : BlockTable
    number : int
        Of the data block.
    port : int
        On the loopback interface.
    """

    def __init__(self, table: BlockTable, number: int, port: int) -> None:
        self.block, self._port, self._number = SimulatedBlock(table), port, number
        self._cycle = table.spec.export.cycle_time
        self.data = bytearray(STATE_AT + DOUBLE.itemsize * state_length(table.constant("cAxes")))
        self.memory = bytearray(1)
        self.ended = threading.Event()

    def serve(self, ready: Callable[[str], None]) -> None:
        """Play until `ended` is set; report the address once it answers.

        Raises
        ------
        OutputError
            The port cannot be had.
        """
        server = Server(log=False)
        server.register_area(SrvArea.DB, self._number, self.data)
        server.register_area(SrvArea.MK, 0, self.memory)
        self.turn(server, 1)
        try:
            server.start_to(LOOPBACK, self._port)
        except (S7Error, OSError) as error:
            raise OutputError(f"port {self._port}: cannot be had; name another one.") from error
        try:
            ready(f"s7://{LOOPBACK}:{self._port}/0/1")
            self.block.play(partial(self.turn, server), self._cycle, self.ended)
        finally:
            server.stop()

    def turn(self, server: Server, cycles: int) -> None:
        """Take the request over, call the block, show the reply and the state."""
        server.lock_area(SrvArea.DB, self._number)
        try:
            self.block.set(REQUEST, np.frombuffer(bytes(self.data[:REPLY_AT]), DOUBLE))
            self.block.set("bExecute", np.array([float(self.memory[0] & 1)]))
            self.block.run(cycles)
            for at, name in ((REPLY_AT, REPLY), (STATE_AT, STATE)):
                content = self.block.outputs[name].astype(DOUBLE).tobytes()
                self.data[at : at + len(content)] = content
        finally:
            server.unlock_area(SrvArea.DB, self._number)
