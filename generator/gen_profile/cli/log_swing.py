"""The command that logs a swing: of a phone, or of a node of a controller."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from typing import TYPE_CHECKING, Protocol

import click

from gen_profile.cli.commands import cli
from gen_profile.cli.deployment.access import Access, access_options
from gen_profile.cli.options import OutputFile, output_options
from gen_profile.cli.outcome import print_outcome, print_warnings
from gen_profile.errors import OutputError, SpecError

if TYPE_CHECKING:
    from pathlib import Path

    from gen_profile.motion.profile import Array

EVERY, FETCHED, DRAWN = 0.02, 0.3, 30.0  # s between samples of a node, between looks, and that a curve shows
HEIGHT, MARGIN = 8, 12


class Sensor(Protocol):
    """What is logged."""

    columns: tuple[str, ...]

    def begin(self) -> None:
        """Begin; what was before does not count."""

    def rows(self) -> Array:
        """Give what came since the last time: times in s, and values."""

    def shown(self, table: Array) -> Array:
        """Make the log's columns of all rows: times from 0, what swings, and more."""

    def end(self) -> None:
        """End."""


@cli.command("log-swing", epilog="Example: gen-profile log-swing http://192.168.0.42:8080 --out run.csv")
@click.argument("source")
@click.option("--out", type=OutputFile(), default="swing.csv", help="Log to write; ./swing.csv by default.")
@click.option(
    "--for",
    "seconds",
    type=click.FloatRange(min=1.0),
    metavar="SECONDS",
    help="Log so long, not until Ctrl-C.",
)
@click.option("--node", metavar="NODEID", help="Of an OPC UA server, as ns=4;s=GVL.rAngle.")
@click.option(
    "--unit", default="rad", metavar="UNIT", help="Of its values, for the column's name; rad by default."
)
@click.option("--fingerprint", default="", metavar="SHA256", help="Of the server's certificate, as compared.")
@access_options
@click.option(
    "--security",
    type=click.Choice(["sign-and-encrypt", "sign", "none"]),
    default="sign-and-encrypt",
    help="Of the connection to an OPC UA server; sign-and-encrypt by default.",
)
@output_options
def log_swing(
    source: str,
    *,
    out: Path,
    seconds: float | None,
    node: str | None,
    unit: str,
    fingerprint: str,
    user: str,
    certificate: Path | None,
    security: str,
    as_json: bool,
) -> None:
    """Log how a load swings, for identify and learn, until Ctrl-C.

    SOURCE is a phone with phyphox, by the address that its remote access shows, or an OPC UA server.
    """
    if source.startswith("opc.tcp:"):
        if node is None:
            raise SpecError("--node: name the node whose value swings, as ns=4;s=GVL.rAngle.")
        access = Access(
            url=source,
            instance="",
            fingerprint=fingerprint,
            certificate=certificate,
            user=user,
            security=security,
            data_block=None,
        )
        with closing(_Node(access, node, unit)) as number:
            columns, table = number.columns, _logged(number, seconds)
    else:
        if node or user or fingerprint or certificate:
            raise SpecError(
                "--node, --user, --fingerprint, --certificate: are for OPC UA, opc.tcp://HOST:PORT."
            )
        from gen_profile.identification.phone import Phone

        phone = Phone(source)
        columns, table = phone.columns, _logged(phone, seconds)
    _write(out, columns, table)
    lasts = float(table[-1, 0])
    document = {"path": str(out), "samples": len(table), "lasts_s": lasts, "columns": list(columns)}
    print_outcome(document, f"{len(table)} samples in {lasts:.1f} s: {out}", as_json)


class _Node:
    """A number of an OPC UA server, asked for over and over."""

    def __init__(self, access: Access, node: str, unit: str) -> None:
        from gen_profile.deployment.opcua import OpcUaNode

        self.columns: tuple[str, ...] = (f"Value ({unit})",)
        self._link, self._last = OpcUaNode(access.opcua(), node), 0.0

    def begin(self) -> None:
        """Begin after the value of now."""
        self._last, _ = self._link.number()

    def rows(self) -> Array:
        """Ask for some tenths of a second."""
        import numpy as np

        rows = []
        for _ in range(round(FETCHED / EVERY)):
            at, value = self._link.number()
            if at > self._last:
                rows.append((at, value))
                self._last = at
            time.sleep(EVERY)
        return np.array(rows).reshape(-1, 2)

    def shown(self, table: Array) -> Array:
        """Count times from the first."""
        import numpy as np

        return np.asarray(table - np.array([table[0, 0], 0.0]))

    def end(self) -> None:
        """Leave the server as it is."""

    def close(self) -> None:
        """End the connection."""
        self._link.close()


def _logged(sensor: Sensor, seconds: float | None) -> Array:
    """Log until Ctrl-C, or for so long by the sensor's clock."""
    import numpy as np

    from gen_profile.deployment.mailbox import LinkLostError
    from gen_profile.identification.measurements import LEAST_SAMPLES
    from gen_profile.interrupts import interrupts_collected

    sensor.begin()
    click.echo("Logging." if seconds else "Logging. Ctrl-C ends it.", err=True)
    tables: list[Array] = []
    try:
        with _curve() as draw, interrupts_collected() as came:
            while not came and (seconds is None or not tables or _lasts(tables) < seconds):
                if len(rows := sensor.rows()):
                    tables.append(rows)
                    draw(sensor.shown(np.concatenate(tables)))
                time.sleep(FETCHED)
    except KeyboardInterrupt:  # which is how it ends
        pass
    except (LinkLostError, OutputError) as error:
        print_warnings([f"{error}; the log ends there"])
    with suppress(OutputError):
        sensor.end()
    count = sum(map(len, tables))
    if count < LEAST_SAMPLES:
        raise OutputError(
            f"Only {count} samples came, and a swing needs {LEAST_SAMPLES}; nothing was written."
        )
    return sensor.shown(np.concatenate(tables))


def _lasts(tables: list[Array]) -> float:
    return float(tables[-1][-1, 0] - tables[0][0, 0])


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

    from gen_profile.streaming.live_terminal import curves

    console = Console(stderr=True)
    with Live(console=console, auto_refresh=False) as live:

        def draw(table: Array) -> None:
            late = table[table[:, 0] > table[-1, 0] - DRAWN, 1]
            blank = np.full_like(late, np.nan)
            picture = curves(blank, late, max(10, console.width - MARGIN), HEIGHT)
            live.update(Group(Text(f"{table[-1, 0]:.1f} s, {len(table)} samples"), *picture), refresh=True)

        yield draw


def _write(path: Path, columns: tuple[str, ...], table: Array) -> None:
    from gen_profile.artefacts.writing import deliver

    lines = (",".join(f"{value:.9g}" for value in row) for row in table.tolist())
    deliver(path, "\n".join([",".join(("Time (s)", *columns)), *lines, ""]).encode("utf-8"))
