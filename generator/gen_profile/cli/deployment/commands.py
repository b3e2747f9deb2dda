"""The commands that put a table into a running controller, and a simulated controller to try that on."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli.commands import cli
from gen_profile.cli.options import Count, InputFile, PathType, output_options
from gen_profile.cli.outcome import print_outcome
from gen_profile.cli.progress import progress
from gen_profile.cli.signing import require_signature, signed_by_option, signing_key
from gen_profile.errors import SpecError
from gen_profile.plugins import require_installed

if TYPE_CHECKING:
    from pathlib import Path

_URL = re.compile(r"opc\.tcp://[^\s/@]+:(\d{1,5})(/\S*)?", re.ASCII)
MOST_PORT = 65535
PASSWORD = "GEN_PROFILE_PASSWORD"  # of the environment: command lines are seen by all


def _access_options(command: Callable[..., Any]) -> Callable[..., Any]:
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


@cli.command(
    epilog="Example: gen-profile deploy deploy/bay-3.st --to opc.tcp://10.0.0.5:4840 --certificate me.pem"
)
@click.argument("artefact", type=PathType())
@click.option("--to", "url", metavar="URL", required=True, help="Controller, as opc.tcp://HOST:PORT.")
@click.option("--instance", default="", metavar="PATH", help="Which block, where the server shows several.")
@click.option("--fingerprint", default="", metavar="SHA256", help="Of the server's certificate, as compared.")
@_access_options
@click.option(
    "--security",
    type=click.Choice(["sign-and-encrypt", "sign", "none"]),
    default="sign-and-encrypt",
    help="Of the connection; sign-and-encrypt by default.",
)
@click.option("--verify", is_flag=True, help="Only tell whether the controller uses this table.")
@click.option("--rollback", is_flag=True, help="Go back to this table, which the idle buffer holds.")
@click.option("--by", default="", metavar="NAME", help="Who deploys, for the record; the user by default.")
@click.option(
    "--sign",
    "key_path",
    type=InputFile(),
    help="Sign the record with this secret key, made by minisign -GW.",
)
@signed_by_option
@output_options
def deploy(
    artefact: Path, *, url: str, verify: bool, rollback: bool, by: str, key_path: Path | None, **options: Any
) -> None:
    """Put a playback block's table into a running controller.

    Read back and checked before the controller uses it.
    """
    as_json, public_path = options.pop("as_json"), options.pop("public_path")
    if verify and (rollback or key_path is not None or by):
        raise SpecError("--verify: changes and records nothing; leave --rollback, --by and --sign out.")
    _require_consistent(url, options)
    require_installed("OPC UA needs the package asyncua", "opcua", "asyncua", "cryptography")
    key = signing_key(key_path)
    require_signature(artefact, public_path)
    from gen_profile.artefacts.writing import require_place
    from gen_profile.deployment.mailbox import Mailbox
    from gen_profile.deployment.opcua import OpcUaAccess, OpcUaLink
    from gen_profile.deployment.record import RECORD, append_record, read_record, recorded
    from gen_profile.deployment.table import read_table

    access = OpcUaAccess(url=url, password=_password(options["user"]), **options)
    with progress() as tell:
        tell("reading the artefact")
        table = read_table(artefact)
        if not verify:
            read_record(artefact.parent)
            require_place(artefact.parent / RECORD)
        tell("connecting")
        with OpcUaLink(access) as link:
            if verify:
                from gen_profile.deployment.deploy import verify as run_verify

                run_verify(table, Mailbox(link))
                entry = recorded(artefact.parent, table.hashes["table_sha256"], link.server)
                document = {"action": "verified", "controller": link.server, **table.hashes, "record": entry}
            else:
                from gen_profile.deployment.deploy import deploy as run

                done = run(table, Mailbox(link), rollback=rollback, progress=tell)
                document = append_record(artefact.parent, done.to_dict(), link.server, by or _user())
    print_outcome(document, _words(artefact, document), as_json)
    if key is not None:
        from gen_profile.artefacts.signature import sign_file

        comment = f"deployments of {table.spec.name}, the latest at {document['at']}"
        click.echo(f"Signed by {key.identity}: {sign_file(artefact.parent / RECORD, comment, key)}", err=True)


def _require_consistent(url: str, options: Mapping[str, Any]) -> None:
    security, own = options["security"], options["certificate"]
    found = _URL.fullmatch(url)
    if found is None or int(found[1]) > MOST_PORT:
        raise SpecError(f"--to {url}: is no address such as opc.tcp://10.0.0.5:4840.")
    if security == "none" and (own is not None or options["fingerprint"]):
        raise SpecError("--certificate, --fingerprint: mean nothing with --security none; leave them out.")
    if security != "none" and own is None:
        raise SpecError(
            "--certificate: name the PEM file of this computer's certificate and key (it is made where it is "
            "not there), or ask for --security none where any client may write to the controller."
        )
    if security != "sign-and-encrypt" and options["user"]:
        raise SpecError(f"--user: its password would not be encrypted with --security {security}.")


def _words(artefact: Path, document: dict[str, Any]) -> str:
    where = f"{document['controller']['url']} {document['controller']['instance']}"
    if document["action"] == "verified":
        entry = document["record"]
        since = (
            f"deployed {entry['at']} by {entry['by']}" if entry else "no deployment there is recorded here"
        )
        return f"{where} uses {artefact}, bit for bit; {since}."
    return (
        f"{where}: {artefact} {document['action']}, {document['values']} values read back bit for bit and "
        f"checked, checksum {document['checksum']} (before: {document['checksum_before']})."
    )


def _password(user: str) -> str:
    if not user:
        return ""
    given = os.environ.get(PASSWORD)
    return click.prompt(f"Password of {user}", hide_input=True, err=True) if given is None else given


def _user() -> str:
    import getpass
    import socket

    try:
        return f"{getpass.getuser()}@{socket.gethostname()}"
    except (OSError, KeyError):  # a number without a name, as in containers
        return socket.gethostname()


@cli.command("plc-sim", epilog="Example: gen-profile plc-sim deploy/bay-3.st")
@click.argument("artefact", type=PathType())
@click.option(
    "--port", type=Count(1, MOST_PORT), default=4840, help="Port on the loopback interface; 4840 by default."
)
@_access_options
@click.option("--no-security", is_flag=True, help="Let any program of this computer in.")
@output_options
def plc_sim(
    artefact: Path, *, port: int, certificate: Path | None, user: str, no_security: bool, as_json: bool
) -> None:
    """Simulate a controller that runs a playback block, behind an OPC UA server."""
    if no_security and (user or certificate is not None):
        raise SpecError("--no-security: lets everybody in; leave --user and --certificate out.")
    require_installed("OPC UA needs the package asyncua", "opcua", "asyncua", "cryptography")
    import asyncio

    from gen_profile.deployment.plc_sim import PlcSimOptions, SimulatedController
    from gen_profile.deployment.table import read_table

    options = PlcSimOptions(
        port=port, secure=not no_security, certificate=certificate, user=user, password=_password(user)
    )
    with progress() as tell:
        tell("compiling the block")
        controller = SimulatedController(read_table(artefact), options)

    def ready(address: str, fingerprint: str) -> None:
        document = {"address": address, "instance": controller.name, "fingerprint": fingerprint}
        shown = f"\nSHA-256 of its certificate: {fingerprint}" if fingerprint else ""
        print_outcome(document, f"{controller.name} runs behind {address}{shown}\nCtrl-C ends it.", as_json)

    try:
        asyncio.run(controller.serve(ready))
    except KeyboardInterrupt:
        click.echo("The simulated controller is switched off.", err=True)
