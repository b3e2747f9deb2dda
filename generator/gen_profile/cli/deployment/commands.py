"""The commands that put a table into a running controller, and a simulated controller to try that on."""

from __future__ import annotations

from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.deployment.access import (
    MOST_BLOCKS,
    MOST_PORT,
    Access,
    access_options,
    controller_options,
    password,
    require_protocol,
)
from gen_profile.cli.options import Count, Number, OutputFile, PathType, option
from gen_profile.cli.outcome import print_outcome, say
from gen_profile.cli.progress import progress
from gen_profile.cli.signing import require_signature, signed_by_option, signing_key, signing_option
from gen_profile.support.errors import OutputError, SpecError

if TYPE_CHECKING:
    from collections.abc import Callable

    from gen_profile.delivery.deployment.mailbox import ControllerLink
    from gen_profile.delivery.deployment.simulated_block import SimulatedController
    from gen_profile.delivery.deployment.table import BlockTable
    from gen_profile.support.artefacts.signature import Key
    from gen_profile.support.progress import Progress


@cli.command(
    epilog="Example: gen-profile deploy deploy/bay-3.st --to opc.tcp://10.0.0.5:4840 --certificate me.pem"
)
@click.argument("artefact", type=PathType())
@controller_options(required=True)
@option("--verify", "Only tell whether the controller uses this table.")
@option("--watch", "Verify, then compare every setpoint with the proved table until Ctrl-C.")
@option("--for SECONDS", "How long to watch.", Number(min=0.1), into="seconds")
@option("--log CSV", "Write what is watched, one row per cycle seen.", OutputFile())
@option("--rollback", "Switch back to this table, which the idle buffer holds.")
@option("--trial", "Accept a planner that was judged on fewer histories than a proof needs.")
@option("--by NAME", "Who deploys, for the record; the user by default.", default="")
@signing_option("record")
@signed_by_option
@options.output
def deploy(
    artefact: Path,
    *,
    verify: bool,
    watch: bool,
    seconds: float | None,
    log: Path | None,
    rollback: bool,
    trial: bool,
    by: str,
    key_path: Path | None,
    public_path: Path | None,
    **given: Any,
) -> None:
    """Put a playback block's table, a library's, or a planner's numbers into a controller.

    Read back and checked before the controller uses it.
    """
    if verify and watch:
        raise SpecError("--verify: --watch begins with that; leave one of the two out.")
    if (verify or watch) and (rollback or trial or key_path is not None or by):
        raise SpecError(
            "--verify, --watch: change and record nothing; leave --rollback, --trial, --by and --sign out."
        )
    if not watch and (seconds is not None or log is not None):
        raise SpecError("--for, --log: are for --watch; add that, or leave them out.")
    key = signing_key(key_path)
    require_signature(artefact, public_path)
    if watch:
        _watch(artefact, given, seconds, log)
    elif verify:
        _verify(artefact, given)
    else:
        document = _deploy(artefact, given, by or _user(), rollback=rollback, trial=trial)
        print_outcome(document, _words(artefact, document))
        if key is not None:
            _sign(artefact, document, key)


def _deploy(artefact: Path, given: dict[str, Any], by: str, *, rollback: bool, trial: bool) -> dict[str, Any]:
    """Have the table used, and record it."""
    from gen_profile.delivery.deployment.deploy import deploy as run
    from gen_profile.delivery.deployment.mailbox import Mailbox
    from gen_profile.delivery.deployment.record import RECORD, append_record, read_record
    from gen_profile.delivery.deployment.table import read_table
    from gen_profile.support.artefacts.writing import require_place

    with progress() as tell:
        tell("reading the artefact")
        table = read_table(artefact)
        if not trial:
            table.require_proved()
        read_record(artefact.parent)
        require_place(artefact.parent / RECORD)
        access = Access(**given)  # after the file, whose fault no access cures
        tell("connecting")
        with closing(access.opened(table)) as link:
            done = run(table, Mailbox(link), rollback=rollback, trial=trial, progress=tell)
            try:
                return append_record(artefact.parent, done.to_dict(), link.server, by)
            except OutputError as error:
                words = f"The controller uses {artefact} all the same; that is not recorded."
                raise OutputError(str(error), words) from error


def _verify(artefact: Path, given: dict[str, Any]) -> None:
    """Tell whether the controller uses the table."""
    from gen_profile.delivery.deployment.record import recorded

    with ExitStack() as stack, progress() as tell:
        table, link = verified(artefact, given, stack, tell)
        entry = recorded(artefact.parent, table.hashes["table_sha256"], link.server)
        document = {"action": "verified", "controller": link.server, **table.hashes, "record": entry}
    print_outcome(document, _words(artefact, document))


def verified(
    artefact: Path, given: dict[str, Any], stack: ExitStack, tell: Progress
) -> tuple[BlockTable, ControllerLink]:
    """Connect to a controller, by what `Access` takes, that uses a file's table."""
    from gen_profile.delivery.deployment.deploy import verify
    from gen_profile.delivery.deployment.mailbox import Mailbox
    from gen_profile.delivery.deployment.table import read_table

    tell("reading the artefact")
    table = read_table(artefact)
    access = Access(**given)
    tell("connecting")
    link = stack.enter_context(closing(access.opened(table)))
    tell("reading the table")
    verify(table, Mailbox(link))
    return table, link


def _watch(artefact: Path, given: dict[str, Any], seconds: float | None, log: Path | None) -> None:
    """Hold what the block issues to what was proved, and end with what differs."""
    from gen_profile.cli.deployment.watching import reporting, words
    from gen_profile.delivery.deployment.watching.watch import watch

    with ExitStack() as stack:
        with progress() as tell:
            table, link = verified(artefact, given, stack, tell)
        if seconds is None:
            say(f"{link.server['instance']} is watched. Ctrl-C ends it.")
        with reporting(table, log) as report:
            watched = watch(table, link, report, seconds=seconds)
    document = {"action": "watched", "controller": link.server, **table.hashes, **watched.to_dict()}
    print_outcome(document, words(watched, table))
    if watched.fault is not None:
        say(f"Error: {watched.fault}")
        raise SystemExit(watched.fault.exit_code)


def _sign(artefact: Path, document: dict[str, Any], key: Key) -> None:
    from gen_profile.delivery.deployment.record import RECORD
    from gen_profile.support.artefacts.signature import sign_file

    comment = f"deployments of {artefact.stem}, the latest at {document['at']}"
    click.echo(f"Signed by {key.identity}: {sign_file(artefact.parent / RECORD, comment, key)}", err=True)


def _words(artefact: Path, document: dict[str, Any]) -> str:
    where = f"{document['controller']['url']} {document['controller']['instance']}"
    if document["action"] == "verified":
        entry = document["record"]
        since = (
            f"deployed {entry['at']} by {entry['by']}" if entry else "no deployment there is recorded here"
        )
        return f"{where} uses {artefact}, bit for bit; {since}."
    checked = f"checked{_on_histories(document['check'])}"
    return (
        f"{where}: {artefact} {document['action']}, {document['values']} values read back bit for bit and "
        f"{checked}, checksum {document['checksum']} (before: {document['checksum_before']})."
    )


def _on_histories(check: dict[str, Any]) -> str:
    """Say how a planner was judged."""
    if "histories" not in check:
        return ""
    return f" on {check['histories']} histories{' (a trial)' if check['trial'] else ''}"


def _user() -> str:
    import getpass
    import socket

    try:
        return f"{getpass.getuser()}@{socket.gethostname()}"
    except (OSError, KeyError):  # a number without a name, as in containers
        return socket.gethostname()


@cli.command("plc-sim", epilog="Example: gen-profile plc-sim deploy/bay-3.st")
@click.argument("artefact", type=PathType())
@option("--port", "Port on the loopback interface; 4840 by default.", Count(1, MOST_PORT), default=4840)
@access_options
@option("--no-security", "Accept any program on this computer.")
@option(
    "--db",
    "Speak S7 in place of OPC UA, with the block's arrays in this data block, and bExecute in M0.0.",
    Count(1, MOST_BLOCKS),
    into="data_block",
)
@option("--ads", "Speak ADS in place of OPC UA, with the block as MAIN.fbMotion.")
@options.output
def plc_sim(artefact: Path, *, data_block: int | None, ads: bool, **given: Any) -> None:
    """Simulate a controller that runs a playback block, behind an OPC UA, ADS or S7 server."""
    if given["no_security"] and (given["user"] or given["certificate"] is not None):
        raise SpecError("--no-security: lets everybody in; leave --user and --certificate out.")
    if ads and data_block is not None:
        raise SpecError("--ads, --db: are of two protocols; leave one of them out.")
    if (ads or data_block is not None) and not given["no_security"]:
        flag, protocol = ("--ads", "ADS") if ads else ("--db", "S7")
        raise SpecError(
            f"{flag}: {protocol} has no security; add --no-security, which lets any program of this "
            "computer in."
        )
    make = _simulated(data_block, ads=ads, **given)
    from gen_profile.delivery.deployment.table import read_table

    def ready(address: str) -> None:
        name, shown = controller.instance, controller.fingerprint
        document = {"address": address, "instance": name, "fingerprint": shown}
        certified = f"\nSHA-256 of its certificate: {shown}" if shown else ""
        print_outcome(document, f"{name} runs behind {address}{certified}\nCtrl-C ends it.")

    try:
        with progress() as tell:
            tell("compiling the block")
            controller = make(read_table(artefact))
        controller.serve(ready)
    except KeyboardInterrupt:
        click.echo("The simulated controller is switched off.", err=True)


def _simulated(
    data_block: int | None, *, ads: bool, port: int, certificate: Path | None, user: str, no_security: bool
) -> Callable[[BlockTable], SimulatedController]:
    """Choose the controller that is made of a table."""
    require_protocol("ADS" if ads else "OPC UA" if data_block is None else "S7")
    if ads:
        from gen_profile.delivery.deployment.ads_sim import SimulatedAdsController

        return partial(SimulatedAdsController, port=port)
    if data_block is not None:
        from gen_profile.delivery.deployment.s7_sim import SimulatedS7Controller

        return partial(SimulatedS7Controller, number=data_block, port=port)
    from gen_profile.delivery.deployment.plc_sim import PlcSimOptions, SimulatedOpcUaController

    server = PlcSimOptions(
        port=port, secure=not no_security, certificate=certificate, user=user, password=password(user)
    )
    return partial(SimulatedOpcUaController, options=server)
