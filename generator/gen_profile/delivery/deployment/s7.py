"""A playback block in a Siemens controller, reached by the S7 protocol through a data block.

The protocol has no security, and cannot be browsed: the data block's number must be known. What is longer
than a PDU (240 to 960 bytes) is read and written in parts, from the first to the last. A request has its
number at both ends, and what it asks for in its first part: half of one is none, and values that another
client wrote in between are found out by their echo.
"""

import logging
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

import numpy as np
from snap7.client import Client
from snap7.error import S7Error, S7PacketLostError, S7ProtocolError, S7StalePacketError

from gen_profile.delivery.deployment.block_state import read_state
from gen_profile.delivery.deployment.mailbox import UNSECURED, LinkLostError, first_connected
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.motion.profile import Array
from gen_profile.support.errors import DeploymentError
from gen_profile_exporters.playback.buffers import LENGTH, state_length

DOUBLE = np.dtype(">f8")  # LREAL, as these controllers keep it
REPLY_AT = LENGTH * DOUBLE.itemsize  # bytes from the data block's beginning, where the request stands
STATE_AT = 2 * REPLY_AT
READ_AGAIN = 10  # times, a state of two cycles
TCP_PORT = 102  # of RFC 1006

Given = TypeVar("Given")
logging.getLogger("snap7").addHandler(logging.NullHandler())  # else its warnings go to stderr


class S7Link:
    """A connection to the data block of one playback block.

    Parameters
    ----------
    url : str
        As it was asked for.
    place : (str, int, int, int)
        Host, rack and slot of the processor, and TCP port.
    block : int
        Number of the data block with the three arrays.
    table : BlockTable
        What is to be in the controller. Nothing is written to a data block that shows no block of its kind.

    Raises
    ------
    DeploymentError
        The controller cannot be reached, or refuses, or the data block is another one.
    """

    def __init__(self, url: str, place: tuple[str, int, int, int], block: int, table: BlockTable) -> None:
        self._url, self._place, self._block, self._client = url, place, block, Client()
        self._axes, self._kind, self._name = table.constant("cAxes"), table.constant("cKind"), table.path.name
        self._state = table.state
        self.server = {"url": url, "instance": f"DB{block}", **UNSECURED}
        with first_connected(self, url, "the address, rack and slot, and the network"):
            self._connect()

    def close(self) -> None:
        """End the connection, if it stands."""
        with suppress(S7Error, OSError):
            self._client.disconnect()

    def write(self, request: Array) -> None:
        """Write the whole request, from its beginning."""
        content = bytearray(request.astype(DOUBLE).tobytes())
        self._run(lambda: self._client.db_write(self._block, 0, content))

    def read(self) -> Array:
        """Read the whole reply."""
        return self._doubles(REPLY_AT, LENGTH)

    def state(self) -> Array:
        """Read the whole of what the block shows of itself."""
        return self._doubles(STATE_AT, state_length(self._axes))

    def reopen(self) -> None:
        """Connect again."""
        self.close()
        self._connect()

    def _connect(self) -> None:
        self._run(lambda: self._client.connect(*self._place))
        self._require_block()

    def _require_block(self) -> None:
        """Find the block's state in the data block, before anything is written there."""
        for _ in range(READ_AGAIN):
            if (state := read_state(self.state(), self._axes, self._state)) is not None:
                break
        if state is None or state.kind != self._kind:
            raise DeploymentError(
                f"DB{self._block} of {self._url} is not of a running block that takes "
                f"{self._name}: name the data block that was exported with such a block, and look whether it "
                "is wired to the block and the block is called."
            )

    def _doubles(self, at: int, count: int) -> Array:
        size = count * DOUBLE.itemsize
        content = bytes(self._run(lambda: self._client.db_read(self._block, at, size)))
        if len(content) != size:
            raise DeploymentError(
                f"The controller gives {len(content)} bytes in place of {size}; run this again."
            )
        return np.frombuffer(content, DOUBLE).astype(np.float64)

    def _run(self, work: Callable[[], Given]) -> Given:
        try:
            return work()
        except (S7PacketLostError, S7StalePacketError) as error:
            raise LinkLostError(str(error)) from error
        except S7ProtocolError as error:
            raise DeploymentError(
                f"The controller refuses DB{self._block} ({error}); look whether the data block is "
                "there, its access is not optimised, and PUT/GET is permitted."
            ) from error
        except (S7Error, OSError) as error:
            raise LinkLostError(str(error) or type(error).__name__) from error
