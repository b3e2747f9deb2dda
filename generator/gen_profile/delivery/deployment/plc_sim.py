"""A simulated controller: an OPC UA server with a playback block that runs behind it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import attrs
import numpy as np
from asyncua import Server, ua
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.sync import ThreadLoop

from gen_profile.delivery.deployment.certificates import fingerprint, own_certificate
from gen_profile.delivery.deployment.opcua import POLICIES
from gen_profile.delivery.deployment.simulated_block import LOOPBACK, SimulatedController
from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.support.errors import OutputError

NAMESPACE = "urn:gen-profile:plc-sim"


@attrs.frozen(kw_only=True)
class PlcSimOptions:
    """How the server may be reached: its port, its certificate (made for the time if None), a user.

    Without security, any program on this computer is let in.
    """

    port: int = 4840
    secure: bool = True
    certificate: Path | None = None
    user: str = ""
    password: str = attrs.field(default="", repr=False)


class SimulatedOpcUaController(SimulatedController):
    """The server.

    Parameters
    ----------
    table : BlockTable
    options : PlcSimOptions
    """

    def __init__(self, table: BlockTable, options: PlcSimOptions) -> None:
        super().__init__(table, table.source.name, options.port)
        self._options, self._loop = options, ThreadLoop()
        self._inputs: dict[str, Any] = {}
        self._outputs: dict[str, Any] = {}

    @contextmanager
    def _served(self) -> Iterator[str]:
        server = Server(user_manager=_Users(self._options) if self._options.user else None)
        address = f"opc.tcp://{LOOPBACK}:{self.port}"
        with self._loop:
            self._loop.post(self._start(server, address))
            try:
                yield address
            finally:
                self._loop.post(server.stop())

    def turn(self, cycles: int) -> None:
        """Take the inputs over, call the block, show the outputs."""
        self._loop.post(self._turn(cycles))

    async def _start(self, server: Any, address: str) -> None:
        await server.init()
        server.set_endpoint(address)
        server.set_server_name("gen-profile plc-sim")
        await self._secure(server)
        await self._show(server)
        try:
            await server.start()
        except OSError as error:
            raise OutputError(f"port {self.port}: {error.strerror}; name another one.") from error

    async def _secure(self, server: Any) -> None:
        if not self._options.secure:
            server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
            return
        with TemporaryDirectory() as folder:
            own = own_certificate(self._options.certificate or Path(folder) / "own.pem")
        await server.set_application_uri(own.uri)
        await server.load_certificate(own.der)
        await server.load_private_key(own.key, format="pem")
        self.fingerprint = fingerprint(own.der)
        server.set_security_policy(
            [getattr(ua.SecurityPolicyType, f"{policy}_SignAndEncrypt") for policy in POLICIES]
        )
        user = ua.UserNameIdentityToken if self._options.user else ua.AnonymousIdentityToken
        server.set_identity_tokens([user])

    async def _show(self, server: Any) -> None:
        """Add the instance, with its inputs, which clients write, and its outputs."""
        space = await server.register_namespace(NAMESPACE)
        instance = await server.nodes.objects.add_object(space, self.instance)
        for name in self.block.names:
            node = await instance.add_variable(space, name, _shown(name, self.block.get(name)))
            await node.set_writable()
            self._inputs[name] = node
        for name, values in self.block.outputs.items():
            self._outputs[name] = await instance.add_variable(space, name, _shown(name, values))

    async def _turn(self, cycles: int) -> None:
        for name, node in self._inputs.items():
            given = np.ravel(np.asarray(await node.read_value(), dtype=np.float64))
            if len(given) == len(self.block.inputs[name]):
                self.block.set(name, given)
        before = self.block.outputs
        self.block.run(cycles)
        for name, values in self.block.outputs.items():
            if not np.array_equal(values, before[name]):
                await self._outputs[name].write_value(_shown(name, values))


class _Users:
    """Lets one user in."""

    def __init__(self, options: PlcSimOptions) -> None:
        self._options = options

    def get_user(self, _server: Any, username: str = "", password: str = "", **_: Any) -> Any:
        known = (username, password) == (self._options.user, self._options.password)
        return User(role=UserRole.User) if known else None


def _shown(name: str, values: np.ndarray[Any, Any]) -> Any:
    """Give a variable of the block the type that its name tells."""
    others = {"b": (ua.VariantType.Boolean, bool), "n": (ua.VariantType.Int32, int)}
    type_, convert = others.get(name[0], (ua.VariantType.Double, float))
    listed = [convert(value) for value in values.tolist()]
    return ua.Variant(listed if len(listed) > 1 else listed[0], type_)
