"""How the command line names a controller, and what must be known to reach it."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import click

from gen_profile.cli import options
from gen_profile.cli.options import Count, PathType, option
from gen_profile.support.errors import SpecError
from gen_profile.support.plugins import require_installed

if TYPE_CHECKING:
    from gen_profile.delivery.deployment.mailbox import ControllerLink
    from gen_profile.delivery.deployment.opcua import OpcUaAccess
    from gen_profile.delivery.deployment.table import BlockTable

_OPC_UA = re.compile(r"opc\.tcp://[^\s/@]+:(\d{1,5})(/\S*)?", re.ASCII)
_S7 = re.compile(r"s7://([^\s/@:]+)(?::(\d{1,5}))?/([0-7])/(\d{1,2})", re.ASCII)
_ADS = re.compile(r"ads://(?:([^\s/@]+)/)?((?:\d{1,3}\.){5}\d{1,3}):(\d{1,5})", re.ASCII)
MOST_PORT, MOST_SLOT, MOST_BLOCKS, MOST_BYTE = 65535, 31, 65535, 255
PASSWORD = "GEN_PROFILE_PASSWORD"  # of the environment: command lines are seen by all
# what speaks a protocol: a package, the extra that brings it, and its modules
PACKAGES = {
    "OPC UA": ("asyncua", "opcua", "asyncua", "cryptography"),
    "S7": ("python-snap7", "s7", "snap7"),
    "ADS": ("pyads", "ads", "pyads"),
}


# a user, and the certificate of this side
access_options = options.together(
    option(
        "--certificate FILE",
        "PEM file with the client's certificate and key; created if missing.",
        PathType(),
    ),
    option(
        "--user NAME", f"User on the server; the password is taken from {PASSWORD}, or asked for.", default=""
    ),
)
# what a server is trusted by, and how it is spoken to
client_options = options.together(
    option(
        "--fingerprint SHA256", "SHA-256 of the server's certificate, once you have compared it.", default=""
    ),
    access_options,
    option(
        "--security",
        "Security of the connection; sign-and-encrypt by default.",
        click.Choice(["sign-and-encrypt", "sign", "none"]),
        default="sign-and-encrypt",
    ),
)


def controller_options(*, required: bool) -> Callable[[Any], Any]:
    """Take which controller, which block in it, and how it is reached, as `Access` has them."""
    return options.together(
        option(
            "--to URL",
            "Controller, as opc.tcp://HOST:PORT, ads://NETID:PORT or s7://HOST/RACK/SLOT.",
            into="url",
            required=required,
        ),
        option("--db", "Data block of the block's arrays, for S7.", Count(1, MOST_BLOCKS), into="data_block"),
        option("--instance PATH", "Path of the block, where the server has several.", default=""),
        client_options,
    )


@attrs.frozen(kw_only=True)
class Access:
    """What was asked for of a connection; refused where it does not go together."""

    url: str
    instance: str
    fingerprint: str
    certificate: Path | None
    user: str
    security: str
    data_block: int | None

    def __attrs_post_init__(self) -> None:
        if self.url.startswith("s7:"):
            self._require_s7()
        elif self.url.startswith("ads:"):
            self._require_ads()
        else:
            self._require_opcua()

    def opened(self, table: BlockTable) -> ControllerLink:
        """Connect to a controller that is to hold a table.

        Raises
        ------
        DeploymentError
        """
        if self.url.startswith("ads:"):
            from gen_profile.delivery.deployment.ads import AdsLink

            host, net_id, port = _groups(_ADS, self.url)
            place = (net_id, int(port), host or ".".join(net_id.split(".")[:4]))
            return AdsLink(self.url, place, self.instance, table)
        if self.data_block is None:
            from gen_profile.delivery.deployment.opcua import OpcUaLink

            return OpcUaLink(self.opcua())
        from gen_profile.delivery.deployment.s7 import TCP_PORT, S7Link

        host, tcp, rack, slot = _groups(_S7, self.url)
        processor = (host, int(rack), int(slot), int(tcp or TCP_PORT))
        return S7Link(self.url, processor, self.data_block, table)

    def opcua(self) -> OpcUaAccess:
        """Say how an OPC UA server is reached; ask for the password, if there is to be one."""
        from gen_profile.delivery.deployment.opcua import OpcUaAccess

        values = attrs.asdict(self, filter=attrs.filters.exclude("data_block"))
        return OpcUaAccess(**values, password=password(self.user))

    def _require_s7(self) -> None:
        match = _S7.fullmatch(self.url)
        if match is None or int(match[2] or 1) > MOST_PORT or int(match[4]) > MOST_SLOT:
            raise SpecError(f"--to {self.url}: is no address such as s7://10.0.0.5/0/1 (rack 0, slot 1).")
        if self.data_block is None:
            raise SpecError(
                "--db: S7 cannot be browsed; name the number of the data block that was exported with the "
                "block."
            )
        self._require_no_security("S7")
        if self.instance:
            raise SpecError("--instance: means nothing with S7, where --db names the block; leave it out.")
        require_protocol("S7")

    def _require_ads(self) -> None:
        match = _ADS.fullmatch(self.url)
        if match is None or int(match[3]) > MOST_PORT or max(map(int, match[2].split("."))) > MOST_BYTE:
            raise SpecError(
                f"--to {self.url}: is no address such as ads://10.0.0.5.1.1:851 (AMS NetId and port), or "
                "ads://10.0.0.5/5.80.2.1.1.1:851 where the NetId does not begin with the address."
            )
        if self.data_block is not None:
            raise SpecError("--db: is for S7; leave it out, since ADS finds the block by its name.")
        self._require_no_security("ADS")
        require_protocol("ADS")

    def _require_no_security(self, protocol: str) -> None:
        if self.security != "none":
            raise SpecError(
                f"--security: {protocol} has none, and any client may write to the controller; ask for "
                "--security none if its network is kept apart, or use OPC UA."
            )
        if self.certificate is not None or self.fingerprint or self.user:
            raise SpecError(
                f"--certificate, --fingerprint, --user: mean nothing with {protocol}; leave them out."
            )

    def _require_opcua(self) -> None:
        match = _OPC_UA.fullmatch(self.url)
        if match is None or int(match[1]) > MOST_PORT:
            raise SpecError(
                f"--to {self.url}: is no address such as opc.tcp://10.0.0.5:4840, ads://10.0.0.5.1.1:851 or "
                "s7://10.0.0.5/0/1."
            )
        if self.data_block is not None:
            raise SpecError("--db: is for S7; leave it out, since OPC UA finds the block by itself.")
        if self.security == "none" and (self.certificate is not None or self.fingerprint):
            raise SpecError(
                "--certificate, --fingerprint: mean nothing with --security none; leave them out."
            )
        if self.security != "none" and self.certificate is None:
            raise SpecError(
                "--certificate: name the PEM file of this computer's certificate and key (it is made where "
                "it is not there), or ask for --security none where any client may write to the controller."
            )
        if self.security != "sign-and-encrypt" and self.user:
            raise SpecError(f"--user: its password would not be encrypted with --security {self.security}.")
        require_protocol("OPC UA")


def _groups(pattern: re.Pattern[str], text: str) -> tuple[str, ...]:
    match = pattern.fullmatch(text)
    return () if match is None else match.groups()


def require_protocol(name: str) -> None:
    """Refuse to begin without the packages that speak it."""
    package, extra, *modules = PACKAGES[name]
    require_installed(f"{name} needs the package {package}", extra, *modules)


def password(user: str) -> str:
    """Take it from the environment, or ask."""
    if not user:
        return ""
    given = os.environ.get(PASSWORD)
    return click.prompt(f"Password of {user}", hide_input=True, err=True) if given is None else given
