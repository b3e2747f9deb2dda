"""The command that logs a swing: of a phone, of a node of a controller, or of an encoder on a CAN bus."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.deployment.access import Access, client_options
from gen_profile.cli.options import Count, Number, OutputFile, option
from gen_profile.cli.outcome import print_outcome, print_warnings
from gen_profile.support.errors import OutputError, SpecError

if TYPE_CHECKING:
    from gen_profile.motion.profile import Array
    from gen_profile.studies.identification.encoder import Encoder

MOST_NODE = 127
DRAWN, HEIGHT, MARGIN = 30.0, 8, 12  # s that a curve shows, its lines, and columns beside it


@cli.command("log-swing", epilog="Example: gen-profile log-swing http://192.168.0.42:8080 --out run.csv")
@click.argument("source")
@option("--out", "Log to write; ./swing.csv by default.", OutputFile(), default="swing.csv")
@option("--for SECONDS", "How long to log, instead of until Ctrl-C.", Number(min=1.0), into="seconds")
@option(
    "--node NODEID", "Node to read: of an OPC UA server, as ns=4;s=GVL.rAngle; on CAN the encoder's number."
)
@option("--counts", "Counts per revolution of the encoder; read from it by default.", Count(1, 2**32))
@options.bitrate("CAN channel")
@option("--unit UNIT", "Unit of the values, for the column's name; rad by default.", default="rad")
@client_options
@options.output
def log_swing(
    source: str,
    *,
    out: Path,
    seconds: float | None,
    node: str | None,
    counts: int | None,
    bitrate: int,
    unit: str,
    **security: Any,
) -> None:
    """Log how a load swings, for identify and learn, until Ctrl-C.

    SOURCE is a phone with phyphox, by the address that its remote access shows, an OPC UA server, or a CAN
    bus, as can:socketcan:can0.
    """
    from gen_profile.studies.identification.phone import COLUMNS, Phone
    from gen_profile.support.artefacts.writing import deliver

    if counts is not None and not source.startswith("can:"):
        raise SpecError("--counts: is for an encoder on a CAN bus, as can:socketcan:can0; leave it out.")
    if source.startswith("opc.tcp:"):
        if node is None:
            raise SpecError("--node: name the node whose value swings, as ns=4;s=GVL.rAngle.")
        access = Access(url=source, instance="", data_block=None, **security).opcua()
        from gen_profile.delivery.deployment.opcua import OpcUaNode

        with closing(OpcUaNode(access, node)) as link:
            table = _logged(link.tables(), seconds)
    elif source.startswith("can:"):
        if unit != "rad" or security["user"] or security["fingerprint"] or security["certificate"]:
            raise SpecError(
                "--unit, --user, --fingerprint, --certificate: mean nothing with CAN; leave them out."
            )
        table = _logged(_encoder(source, node, counts, bitrate).tables(), seconds)
    else:
        if node or security["user"] or security["fingerprint"] or security["certificate"]:
            raise SpecError(
                "--node, --user, --fingerprint, --certificate: are for OPC UA, opc.tcp://HOST:PORT."
            )
        table = _logged(Phone(source).tables(), seconds)
    columns = COLUMNS if node is None else (f"Value ({unit})",)
    lines = (",".join(f"{value:.9g}" for value in row) for row in table.tolist())
    deliver(out, "\n".join([",".join(("Time (s)", *columns)), *lines, ""]).encode("utf-8"))
    lasts = float(table[-1, 0])
    document = {"path": str(out), "samples": len(table), "lasts_s": lasts, "columns": list(columns)}
    print_outcome(document, f"{len(table)} samples in {lasts:.1f} s: {out}")


def _encoder(source: str, node: str | None, counts: int | None, bitrate: int) -> Encoder:
    from gen_profile.support.plugins import require_installed

    _, interface, channel = (*source.split(":", 2), "", "")[:3]
    if not interface or not channel:
        raise SpecError(
            f"{source}: name interface and channel, as can:socketcan:can0 (gen-profile can list)."
        )
    if node is None or not node.isdecimal() or not 1 <= int(node) <= MOST_NODE:
        raise SpecError(f"--node: name the encoder's number on the bus, from 1 to {MOST_NODE}.")
    require_installed("CAN needs canopen", "can", "canopen")
    from gen_profile.studies.identification.encoder import Encoder
    from gen_profile_exporters.can.host.port import Port

    port = Port(interface=interface, channel=channel)
    return Encoder(port=port, node=int(node), counts=counts, bitrate=bitrate)


def _logged(tables: Iterator[Array], seconds: float | None) -> Array:
    """Log until Ctrl-C, or for so long by the sensor's clock."""
    import numpy as np

    from gen_profile.delivery.deployment.mailbox import LinkLostError
    from gen_profile.studies.identification.log_columns import LEAST_SAMPLES
    from gen_profile.studies.identification.phone import about_its_axis
    from gen_profile.support.interrupts import interrupts_collected

    table = np.empty((0, 0))
    try:
        with _curve() as draw, interrupts_collected() as came, closing(cast("Any", tables)):
            for rows in tables:
                if len(rows):
                    table = np.concatenate([table, rows]) if len(table) else rows
                    draw(about_its_axis(table))
                if came or (seconds is not None and len(table) and np.ptp(table[:, 0]) >= seconds):
                    break
    except KeyboardInterrupt:  # which is how it ends
        pass
    except (LinkLostError, OutputError) as error:
        if not len(table):
            raise OutputError(str(error)) from error
        print_warnings([f"{str(error).rstrip('.')}; the log ends there"])
    if len(table) < LEAST_SAMPLES:
        raise OutputError(
            f"Only {len(table)} samples came, and a swing needs {LEAST_SAMPLES}; nothing was written."
        )
    return about_its_axis(table)


@contextmanager
def _curve() -> Iterator[Callable[[Array], None]]:
    """Draw what swings on stderr, where that is a terminal."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    import numpy as np
    from rich.console import Console, Group
    from rich.live import Live
    from rich.text import Text

    from gen_profile.delivery.streaming.live_terminal import curves

    console = Console(stderr=True)
    with Live(console=console, auto_refresh=False) as live:

        def draw(table: Array) -> None:
            late = table[table[:, 0] > table[-1, 0] - DRAWN, 1]
            blank = np.full_like(late, np.nan)
            picture = curves(blank, late, max(10, console.width - MARGIN), HEIGHT)
            live.update(Group(Text(f"{table[-1, 0]:.1f} s, {len(table)} samples"), *picture), refresh=True)

        yield draw
