"""A playback block behind an OPC UA server: found by browsing, reached through its arrays."""

import asyncio
import logging
import time
from collections.abc import Coroutine, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, TypeVar

import attrs
import numpy as np
from asyncua import Client, ua
from asyncua.crypto import security_policies
from asyncua.crypto.uacrypto import CertProperties, x509_from_der

from gen_profile.delivery.deployment.certificates import fingerprint, own_certificate, require_current
from gen_profile.delivery.deployment.mailbox import LinkLostError, first_connected
from gen_profile.motion.profile import Array
from gen_profile.support.errors import DeploymentError
from gen_profile_exporters.playback.buffers import LENGTH, REPLY, REQUEST, STATE

Security = Literal["sign-and-encrypt", "sign", "none"]
MODES = {"sign-and-encrypt": "SignAndEncrypt", "sign": "Sign", "none": "None_"}
POLICIES = ("Aes256Sha256RsaPss", "Basic256Sha256", "Aes128Sha256RsaOaep")  # the strongest first
TIMEOUT, SESSION = 4.0, 600  # s of a single service, and that a server keeps a silent session
DEPTH, MOST_NODES = 10, 50_000  # that are browsed
REFUSED = (  # what the server has decided, and would decide again
    ua.uaerrors.BadUserAccessDenied,
    ua.uaerrors.BadIdentityTokenInvalid,
    ua.uaerrors.BadIdentityTokenRejected,
    ua.uaerrors.BadNotWritable,
    ua.uaerrors.BadNotReadable,
    ua.uaerrors.BadTypeMismatch,
    ua.uaerrors.BadWriteNotSupported,
    ua.uaerrors.BadSecurityChecksFailed,
    ua.uaerrors.BadCertificateUntrusted,
    ua.uaerrors.BadCertificateTimeInvalid,
)

Given = TypeVar("Given")
logging.getLogger("asyncua").addHandler(logging.NullHandler())  # else its warnings go to stderr


@attrs.frozen(kw_only=True)
class OpcUaAccess:
    """How a server is reached.

    Attributes
    ----------
    url : str
        ``opc.tcp://…``
    security : str
    certificate : Path or None
        PEM file with this program's certificate and key; made where it is not there.
    fingerprint : str
        SHA-256 of the server's certificate, which was compared.
    user, password : str
        Empty for none.
    instance : str
        End of the path of the block's instance, where the server shows several.
    """

    url: str
    security: Security = "sign-and-encrypt"
    certificate: Path | None = None
    fingerprint: str = ""
    user: str = ""
    password: str = attrs.field(default="", repr=False)
    instance: str = ""


class OpcUaLink:
    """A connection to one instance of a block.

    Parameters
    ----------
    access : OpcUaAccess

    Raises
    ------
    DeploymentError
        The server cannot be reached or trusted, refuses, or shows no block, or several.
    """

    def __init__(self, access: OpcUaAccess) -> None:
        self._access, self._runner = access, asyncio.Runner()
        self._client: Any = None
        self.instance = ""
        self.server: dict[str, str] = {}
        with first_connected(self, access.url, "the address, the port and the network"):
            self._run(self._connect())

    def close(self) -> None:
        """End the connection, if it stands."""
        with suppress(LinkLostError, DeploymentError):
            self._run(self._disconnect())
        self._runner.close()

    def write(self, request: Array) -> None:
        """Write the whole request; without time stamps, which some servers refuse."""
        value = ua.DataValue(ua.Variant(request.tolist(), ua.VariantType.Double))
        self._run(self._request.write_value(value))

    def read(self) -> Array:
        """Read the whole reply."""
        return _doubles(self._run(self._reply.read_data_value()), REPLY)

    def state(self) -> Array:
        """Read the whole of what the block shows of itself."""
        if self._state is None:
            raise DeploymentError(
                f"{self.instance} shows no {STATE}: let the server show it beside {REPLY}, or export the "
                "block again and load it, if it has none."
            )
        return _doubles(self._run(self._state.read_data_value()), STATE)

    def reopen(self) -> None:
        """Connect again."""
        with suppress(LinkLostError, DeploymentError):
            self._run(self._disconnect())
        self._run(self._connect())

    def _run(self, work: Coroutine[Any, Any, Given]) -> Given:
        try:
            return self._runner.run(work)
        except REFUSED as error:
            raise DeploymentError(f"The server refuses: {error}; look at the rights of this user.") from error
        except (OSError, TimeoutError, ua.UaError) as error:
            raise LinkLostError(str(error) or type(error).__name__) from error

    async def _connect(self) -> None:
        access, client = self._access, await self._connected()
        instances = [one async for one in _instances(client)]
        path, nodes = _chosen(instances, access.instance, access.url)
        self._request, self._reply, self._state = nodes
        self.instance = path
        for node, name in ((self._request, REQUEST), (self._reply, REPLY)):
            if (length := len(_doubles(await node.read_data_value(), name))) != LENGTH:
                raise DeploymentError(
                    f"{path}/{name} has {length} values there in place of {LENGTH}: an earlier client "
                    "shortened it, or the block is of another version. Restart the controller's server."
                )
        self.server = {"url": access.url, "instance": path, "security": access.security, **self.server}

    async def _connected(self) -> Any:
        access = self._access
        self._client = client = Client(access.url, timeout=TIMEOUT)
        client.session_timeout = 1000 * SESSION
        await self._secure(client)
        if access.user:
            client.set_user(access.user)
            client.set_password(access.password)
        await client.connect()
        return client

    async def _secure(self, client: Any) -> None:
        """Choose an endpoint, and hold its certificate to the fingerprint that was compared."""
        access = self._access
        offered = await client.connect_and_get_server_endpoints()
        mode = getattr(ua.MessageSecurityMode, MODES[access.security])
        by_policy = {one.SecurityPolicyUri.rpartition("#")[2].replace("_", ""): one for one in offered
                 if one.SecurityMode == mode}  # fmt: skip
        name = next((name for name in POLICIES if name in by_policy), None)
        if access.certificate is None and "None" in by_policy:
            self.server = {"policy": "None", "certificate_sha256": "", "user": ""}
            return
        if access.certificate is None or name is None:
            modes = sorted({one.SecurityMode.name.rstrip("_") for one in offered})
            raise DeploymentError(
                f"{access.url} offers no {access.security} with a policy that is still held to be safe, only "
                f"{', '.join(modes)}; enable it there, or ask for the security that there is."
            )
        der = by_policy[name].ServerCertificate
        shown = fingerprint(der)
        if shown != _plain(access.fingerprint):
            asked = "another one than was named" if access.fingerprint else "not known here yet"
            raise DeploymentError(
                f"The certificate of {access.url} is {asked}: its SHA-256 is {shown}. Compare that with what "
                f"the controller itself shows, and name it as the fingerprint."
            )
        require_current(x509_from_der(der), f"The certificate of {access.url}")
        own = own_certificate(access.certificate)
        client.application_uri = own.uri
        await client.set_security(
            getattr(security_policies, f"SecurityPolicy{name}"),
            CertProperties(own.der),
            CertProperties(own.key, extension="pem"),
            server_certificate=CertProperties(der),
            mode=mode,
        )
        self.server = {"policy": name, "certificate_sha256": shown, "user": access.user}

    async def _disconnect(self) -> None:
        if self._client is not None:
            client, self._client = self._client, None
            await client.disconnect()


class OpcUaNode(OpcUaLink):
    """A connection to one node, whose value is a number.

    Parameters
    ----------
    access : OpcUaAccess
    node : str
        As in ``ns=4;s=GVL.rAngle``.

    Raises
    ------
    DeploymentError
        The server cannot be reached or trusted, or has no such number.
    """

    def __init__(self, access: OpcUaAccess, node: str) -> None:
        self._name = node
        super().__init__(access)

    def tables(self, every: float = 0.02, fetched: int = 15) -> Iterator[Array]:
        """Give times in s by the server's clock, and values, shape (samples, 2), over and over.

        Parameters
        ----------
        every : float
            s between two reads, of which those of one time count once.
        fetched : int
            Reads for each table.
        """
        last = -np.inf
        while True:
            rows = []
            for _ in range(fetched):
                value = self._run(self._node.read_data_value())
                number = None if value.Value is None else value.Value.Value
                if not isinstance(number, int | float):
                    raise DeploymentError(f"{self._name} holds no number.")
                stamp = value.SourceTimestamp or value.ServerTimestamp
                at = time.time() if stamp is None else stamp.timestamp()
                if at > last:
                    rows.append((last := at, float(number)))
                time.sleep(every)
            yield np.array(rows, dtype=np.float64).reshape(-1, 2)

    async def _connect(self) -> None:
        client = await self._connected()
        try:
            self._node = client.get_node(self._name)
            await self._node.read_data_value()
        except (ua.UaStringParsingError, ua.uaerrors.BadNodeIdUnknown, ValueError) as error:
            raise DeploymentError(
                f"{self._access.url} has no node {self._name}; write it as in ns=4;s=GVL.rAngle."
            ) from error


def _plain(text: str) -> str:
    """Leave out what a fingerprint is written with."""
    return "".join(sign for sign in text.lower() if sign.isalnum()).removeprefix("sha256")


def _doubles(value: Any, name: str) -> Array:
    """Take an array of doubles, and nothing that was converted to another type."""
    variant = value.Value
    if variant is None or variant.VariantType != ua.VariantType.Double or not isinstance(variant.Value, list):
        kind = (
            "nothing" if variant is None else f"{'array' if isinstance(variant.Value, list) else 'value'} of "
        )
        type_ = "" if variant is None else variant.VariantType.name
        raise DeploymentError(
            f"{name} is {kind}{type_} there, not an array of Double; let the server show it as LREAL."
        )
    return np.array(variant.Value, dtype=np.float64)


async def _instances(client: Any) -> Any:
    """Browse for what has both arrays, level by level; give paths, the two nodes, and that of the state."""
    level: list[tuple[str, Any]] = [("", client.nodes.objects)]
    seen: set[Any] = {client.nodes.server.nodeid}
    for _ in range(DEPTH):
        below: list[tuple[str, Any]] = []
        for path, node in level:
            children = await node.get_children_descriptions()
            named = {one.BrowseName.Name: one.NodeId for one in children}
            if REQUEST in named and REPLY in named:
                state = client.get_node(named[STATE]) if STATE in named else None
                yield path, (client.get_node(named[REQUEST]), client.get_node(named[REPLY]), state)
            for one in children:
                if one.NodeId not in seen and one.NodeClass != ua.NodeClass.Method:
                    seen.add(one.NodeId)
                    name = one.BrowseName.Name
                    below.append((f"{path}/{name}" if path else name, client.get_node(one.NodeId)))
        level = below if len(seen) < MOST_NODES else []


def _chosen(instances: list[tuple[str, Any]], instance: str, url: str) -> tuple[str, Any]:
    fitting = [one for one in instances if f"/{one[0]}".endswith(f"/{instance}" if instance else "")]
    if len(fitting) == 1:
        return fitting[0]
    paths = ", ".join(one[0] for one in instances)
    if not instances:
        raise DeploymentError(
            f"{url} shows no block with {REQUEST} and {REPLY}: load one that was exported with "
            'export.plc_tables = "variables", and let the server show these two arrays of its instance.'
        )
    words = f"none that ends in {instance}" if instance and not fitting else "several"
    raise DeploymentError(f"{url} shows {words} ({paths}); name one as the instance.")
