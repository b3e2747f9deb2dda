"""A simulated TwinCAT controller: an ADS server with a playback block that runs behind it.

Telegrams are those of Beckhoff's "ADS-TCP" specification: as much of it as access by names needs.
"""

import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from socketserver import StreamRequestHandler, ThreadingTCPServer

import numpy as np

from gen_profile.delivery.deployment.simulated_block import LOOPBACK, SimulatedController
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.support.errors import OutputError

NET_ID, AMS_PORT, INSTANCE = f"{LOOPBACK}.1.1", 851, "MAIN.fbMotion"
TCP = struct.Struct("<HI")  # reserved, length of what follows
AMS = struct.Struct("<8s8sHHIII")  # target, source, command, flags, length, error, number of the request
REPLY_FLAGS = 5
READ, WRITE, READ_WRITE = 2, 3, 9  # commands
HANDLE, VALUE, RELEASE, UPLOAD, UPLOAD_INFO = 0xF003, 0xF005, 0xF006, 0xF00B, 0xF00F  # index groups
UNKNOWN_COMMAND, UNKNOWN_GROUP, BAD_SIZE, NO_SYMBOL, OLD_SYMBOL = 0x8, 0x702, 0x705, 0x710, 0x711
STRUCTURE, LARGEST = 65, 1 << 20  # data type of the entry of an instance; bytes of a telegram
POLL = 0.02  # s, within which the server notices that it is to end
TYPES = {"b": np.dtype("?"), "n": np.dtype("<i4")}  # of variables, by their first letter; others are LREAL


class AdsError(Exception):
    """A request cannot be answered; with the protocol's error code."""


class _Server(ThreadingTCPServer):
    allow_reuse_address = True
    daemon_threads = True


class SimulatedAdsController(SimulatedController):
    """The server: the block as ``MAIN.fbMotion``, with its inputs, which clients write, and its outputs.

    Parameters
    ----------
    table : BlockTable
    port : int
    """

    def __init__(self, table: BlockTable, port: int) -> None:
        super().__init__(table, INSTANCE, port)
        self._type = table.source.name
        self.lock = threading.Lock()
        self.handles: dict[int, str] = {}

    @contextmanager
    def _served(self) -> Iterator[str]:
        try:
            server = _Server((LOOPBACK, self.port), self._handler())
        except OSError as error:
            raise OutputError(f"port {self.port}: {error.strerror}; name another one.") from error
        with server:
            threading.Thread(target=server.serve_forever, args=(POLL,), daemon=True).start()
            try:
                yield f"ads://{LOOPBACK}:{self.port}/{NET_ID}:{AMS_PORT}"
            finally:
                server.shutdown()

    def turn(self, cycles: int) -> None:
        """Call the block, with which its variables are shown."""
        with self.lock:
            self.block.run(cycles)

    def answer(self, command: int, content: bytes) -> bytes:
        """Answer the content of a request.

        Raises
        ------
        AdsError
        """
        if command not in {READ, WRITE, READ_WRITE}:
            raise AdsError(UNKNOWN_COMMAND)
        group, offset, size = struct.unpack_from("<III", content)
        with self.lock:
            if command == WRITE:
                self._write(group, offset, content[12:])
                return b""
            if command == READ_WRITE:
                found = self._handle(group, content[16:])
            else:
                found = self._read(group, offset)[:size]
        return struct.pack("<I", len(found)) + found

    def _handle(self, group: int, content: bytes) -> bytes:
        """Give a number by which a variable is known from now on."""
        path = content.rstrip(b"\0").decode("ascii", "replace")
        instance, _, name = path.rpartition(".")
        if group != HANDLE or instance != INSTANCE or name not in {**self.block.inputs, **self.block.outputs}:
            raise AdsError(UNKNOWN_GROUP if group != HANDLE else NO_SYMBOL)
        handle = len(self.handles) + 1
        self.handles[handle] = name
        return struct.pack("<I", handle)

    def _read(self, group: int, offset: int) -> bytes:
        entry = self._entry()
        if group == UPLOAD_INFO:
            return struct.pack("<6I", 1, len(entry), 0, 0, 0, 0)
        if group == UPLOAD:
            return entry
        name = self._named(group, offset)
        values = self.block.outputs.get(name)
        if values is None:
            values = self.block.get(name)
        return values.astype(_type(name)).tobytes()

    def _write(self, group: int, offset: int, content: bytes) -> None:
        if group == RELEASE:
            return
        name = self._named(group, offset)
        places, type_ = self.block.inputs.get(name, []), _type(name)
        if len(content) != len(places) * type_.itemsize:
            raise AdsError(BAD_SIZE)
        self.block.set(name, np.frombuffer(content, type_).astype(np.float64))

    def _named(self, group: int, handle: int) -> str:
        if group != VALUE:
            raise AdsError(UNKNOWN_GROUP)
        if handle not in self.handles:
            raise AdsError(OLD_SYMBOL)
        return self.handles[handle]

    def _entry(self) -> bytes:
        """List the one instance, as a symbol table does."""
        name, kind = INSTANCE.encode(), self._type.encode()
        text = name + b"\0" + kind + b"\0\0"
        head = struct.pack("<6I3H", 30 + len(text), 0x4040, 0, 0, STRUCTURE, 0, len(name), len(kind), 0)
        return head + text

    def _handler(self) -> type[StreamRequestHandler]:
        """Make a class of handlers that answer for this controller."""
        answer = self.answer

        class Handler(StreamRequestHandler):
            def handle(self) -> None:
                while head := self.rfile.read(TCP.size + AMS.size):
                    target, source, command, _, length, _, number = AMS.unpack_from(head, TCP.size)
                    if length > LARGEST:
                        return
                    content, error = b"", 0
                    try:
                        content = answer(command, self.rfile.read(length))
                    except AdsError as refused:
                        (error,) = refused.args
                        content = b"" if command == WRITE else bytes(4)  # of no length
                    except struct.error:
                        return
                    content = struct.pack("<I", error) + content
                    back = AMS.pack(source, target, command, REPLY_FLAGS, len(content), 0, number)
                    self.wfile.write(TCP.pack(0, len(back) + len(content)) + back + content)

        return Handler


def _type(name: str) -> np.dtype[np.generic]:
    return TYPES.get(name[0], np.dtype("<f8"))
