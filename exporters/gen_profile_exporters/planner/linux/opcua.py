"""OPC UA server of the planner that runs in this Linux machine as $name, from gen-profile.

    pip install asyncua
    python3 "${file}_opcua.py" [--port 4840] [--certificate me.der --key me.pem --user NAME]

The object $name has the planner's inputs, which clients write, and its outputs; Row, which is all of one
cycle at once (its number, then what Names says); and a method Rows(first), which gives 1000 rows at most from
a number on: a client that asks often enough misses no cycle. Inputs are taken over in the order of writing.

Without a certificate, programs of this machine are served, and no others. With one, messages are signed and
encrypted, and the user's password is the environment's OPCUA_PASSWORD.
"""

from __future__ import annotations

import argparse
import asyncio
import hmac
import mmap
import os
import struct
import sys
from itertools import zip_longest
from pathlib import Path
from typing import Any

from asyncua import Server, ua, uamethod
from asyncua.common.callback import CallbackType
from asyncua.crypto.permission_rules import User, UserRole

NAME = "$name"
HEAD = struct.Struct("16s4id")  # kind, inputs, columns, rows, process, s of a cycle
KIND = b"gen-profile 1"
LETTERS = 48  # of a name
MOST = 1000  # rows at once
INTERVAL = 0.05  # s between two looks
ENDED = 2.0  # s without a cycle
KINDS = {"b": (bool, ua.VariantType.Boolean), "n": (int, ua.VariantType.Int32)}  # by the names' first letter


class Image:
    """What the planner shares.

    Raises
    ------
    OSError
        It does not run.
    """

    def __init__(self) -> None:
        with Path(f"/dev/shm/{NAME}").open("r+b") as file:
            memory = memoryview(mmap.mmap(file.fileno(), 0))
        kind, inputs, self._columns, self._kept, _, self.cycle_time = HEAD.unpack_from(memory)
        if kind.rstrip(b"\0") != KIND:
            raise OSError("it is just starting, or of another version")
        cycles, given, rows = (HEAD.size + 8 * k for k in (0, 1, 1 + inputs))
        names = rows + 8 * self._columns * self._kept
        self._cycles = memory[cycles:given].cast("q")
        self.given = memory[given:rows].cast("d")
        self._rows = memory[rows:names].cast("d")
        packed = (bytes(memory[at : at + LETTERS]) for at in range(names, len(memory), LETTERS))
        self.names = [one.rstrip(b"\0").decode("ascii") for one in packed][: self._columns]

    @property
    def cycles(self) -> int:
        """Rows that were written so far."""
        return int(self._cycles[0])

    def rows(self, first: int) -> list[float]:
        """Give the number of the first row, then rows from there on, or from the oldest that is kept.

        A negative number counts from the next one.
        """
        while True:
            end = self.cycles
            begin = max(first if first >= 0 else end + first, end - self._kept + MOST, 0)
            values = [float(begin)]
            for row in range(begin, min(end, begin + MOST)):
                place = row % self._kept * self._columns
                values += self._rows[place : place + self._columns]
            if self.cycles - begin < self._kept:  # none was written over meanwhile
                return values


class Users:
    """Lets one user in."""

    def __init__(self, name: str, password: str) -> None:
        self._known = f"{name}\n{password}".encode()

    def get_user(self, _: Any, username: str = "", password: str = "", **__: Any) -> User | None:
        """Compare, in a time that tells nothing."""
        given = f"{username}\n{password}".encode()
        return User(role=UserRole.User) if hmac.compare_digest(given, self._known) else None


async def server_of(options: argparse.Namespace) -> Any:
    """Make a server that lets in whom the options name."""
    secure = options.certificate is not None
    server = Server(user_manager=Users(options.user, os.environ["OPCUA_PASSWORD"]) if secure else None)
    await server.init()
    server.set_endpoint(f"opc.tcp://{'0.0.0.0' if secure else '127.0.0.1'}:{options.port}")
    server.set_server_name(NAME)
    if secure:
        await server.set_application_uri(f"urn:{NAME}")
        await server.load_certificate(options.certificate)
        await server.load_private_key(options.key)
        kinds = ("Aes256Sha256RsaPss", "Basic256Sha256", "Aes128Sha256RsaOaep")
        policies = [getattr(ua.SecurityPolicyType, f"{kind}_SignAndEncrypt") for kind in kinds]
        server.set_security_policy(policies)
        server.set_identity_tokens([ua.UserNameIdentityToken])
    else:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        server.set_identity_tokens([ua.AnonymousIdentityToken])
    return server


def shown(name: str, value: float) -> ua.Variant:
    """Give a number the type that its name tells."""
    convert, type_ = KINDS.get(name[0], (float, ua.VariantType.Double))
    return ua.Variant(convert(value), type_)


async def serve(image: Image, options: argparse.Namespace) -> None:
    """Serve until the planner ends."""
    server = await server_of(options)
    space = await server.register_namespace(f"urn:{NAME}")
    block = await server.nodes.objects.add_object(space, NAME)
    inputs = len(image.given)
    start = [value or 0.0 for _, value in zip_longest(image.names, image.given)]
    nodes = [
        await block.add_variable(space, one, shown(one, value))
        for one, value in zip(image.names, start, strict=True)
    ]
    places = {node.nodeid: place for place, node in enumerate(nodes[:inputs])}
    for node in nodes[:inputs]:
        await node.set_writable()
    whole = await block.add_variable(space, "Row", [0.0, *start])
    await block.add_variable(space, "Names", image.names)

    @uamethod  # type: ignore[untyped-decorator]
    def rows(_: Any, first: int) -> ua.Variant:
        return ua.Variant(image.rows(first), ua.VariantType.Double, is_array=True)

    def take(event: Any, _: Any) -> None:
        for wanted, outcome in zip(event.request_params.NodesToWrite, event.response_params, strict=True):
            if event.is_external and wanted.NodeId in places and outcome.is_good():
                image.given[places[wanted.NodeId]] = float(wanted.Value.Value.Value)

    await block.add_method(space, "Rows", rows, [ua.VariantType.Int64], [ua.VariantType.Double])
    server.subscribe_server_callback(CallbackType.PostWrite, take)
    async with server:
        before, still = start, 0.0
        print(f"{NAME} at {server.endpoint.geturl()}", flush=True)  # noqa: T201
        while still < ENDED:
            await asyncio.sleep(INTERVAL)
            number, *row = image.rows(-1)
            still = still + INTERVAL if row in ([], before) else 0.0
            for place in range(inputs, len(row)):
                if row[place] != before[place]:
                    await nodes[place].write_value(shown(image.names[place], row[place]))
            if row:
                before = row
                await whole.write_value([number, *row])


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=f"OPC UA server of {NAME}.")
    parser.add_argument("--port", type=int, default=4840)
    parser.add_argument("--certificate", help="of this machine, DER or PEM; its URI is urn:$name")
    parser.add_argument("--key", help="of the certificate, PEM")
    parser.add_argument("--user", help="who is let in, by the environment's OPCUA_PASSWORD")
    options = parser.parse_args()
    given = (options.certificate, options.key, options.user)
    if any(given) and not (all(given) and "OPCUA_PASSWORD" in os.environ):
        parser.error("--certificate, --key, --user and the environment's OPCUA_PASSWORD belong together")
    try:
        asyncio.run(serve(Image(), options))
        sys.exit(f"{NAME} has ended.")
    except OSError as error:
        sys.exit(f"{NAME} cannot be served: {error.strerror or error}; start it first, and take a free port.")
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
