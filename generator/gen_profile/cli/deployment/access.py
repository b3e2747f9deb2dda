"""How the command line names a controller, and what must be known to reach it."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import click

from gen_profile.cli.options import PathType
from gen_profile.errors import SpecError
from gen_profile.plugins import require_installed

if TYPE_CHECKING:
    from gen_profile.deployment.opcua import OpcUaLink

_URL = re.compile(r"opc\.tcp://[^\s/@]+:(\d{1,5})(/\S*)?", re.ASCII)
MOST_PORT = 65535
PASSWORD = "GEN_PROFILE_PASSWORD"  # of the environment: command lines are seen by all


def access_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Take a user, and the certificate of this side."""
    for decorate in (
        click.option(
            "--user", default="", metavar="NAME", help=f"User there; password in {PASSWORD}, or asked."
        ),
        click.option(
            "--certificate",
            type=PathType(),
            metavar="FILE",
            help="PEM file with the certificate and key of this side; made if it is not there.",
        ),
    ):
        command = decorate(command)
    return command


@attrs.frozen(kw_only=True)
class Access:
    """What was asked for of a connection; refused where it does not go together."""

    url: str
    instance: str
    fingerprint: str
    certificate: Path | None
    user: str
    security: str

    def __attrs_post_init__(self) -> None:
        found = _URL.fullmatch(self.url)
        if found is None or int(found[1]) > MOST_PORT:
            raise SpecError(f"--to {self.url}: is no address such as opc.tcp://10.0.0.5:4840.")
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
        require_opcua()

    def opened(self) -> OpcUaLink:
        """Connect; a context.

        Raises
        ------
        DeploymentError
        """
        from gen_profile.deployment.opcua import OpcUaAccess, OpcUaLink

        return OpcUaLink(OpcUaAccess(**attrs.asdict(self), password=password(self.user)))


def require_opcua() -> None:
    """Refuse to begin without the packages."""
    require_installed("OPC UA needs the package asyncua", "opcua", "asyncua", "cryptography")


def password(user: str) -> str:
    """Take it from the environment, or ask."""
    if not user:
        return ""
    given = os.environ.get(PASSWORD)
    return click.prompt(f"Password of {user}", hide_input=True, err=True) if given is None else given
