"""Running `gen-profile`: in this process, quickly, or in one of its own, as a user does."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import sysconfig
from contextlib import redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any
from unittest.mock import patch

import attrs
import click
from json_page import require_documented

from gen_profile.cli import main
from gen_profile.cli.entry import cli
from gen_profile.cli.group import DefaultGroup


def commands_of(group: click.Group, before: str = "") -> dict[str, click.Command]:
    """List the commands of a group by their words, those of groups within it among them."""
    found = {}
    commands = group.load() if isinstance(group, DefaultGroup) else group.commands
    for name, command in commands.items():
        if isinstance(command, click.Group):
            found |= commands_of(command, f"{before}{name} ")
        else:
            found[before + name] = command
    return found


COMMANDS = commands_of(cli)
STANDALONE = os.environ.get("STANDALONE")  # a folder of standalone/build.py, to be tried in place of this
PROGRAM = Path(STANDALONE or sysconfig.get_path("scripts")) / "gen-profile"


@attrs.frozen
class Outcome:
    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        """The one JSON document on stdout."""
        return json.loads(self.out)

    @property
    def errors(self) -> list[str]:
        """Lines on stderr that are no progress."""
        return [line for line in self.err.splitlines() if not line.endswith(" …")]


def run_here(*arguments: str | Path) -> Outcome:
    """Call the entry point in this process, where coverage sees it; hold its JSON to the documentation."""
    if STANDALONE:
        return run_process(*arguments)
    out, err = (TextIOWrapper(BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    code: Any = 0
    with (
        patch.object(sys, "argv", ["gen-profile", *map(str, arguments)]),
        patch.object(sys, "unraisablehook", sys.unraisablehook),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as stop:
            code = stop.code
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
    outcome = Outcome(code or 0, _text(out), _text(err))
    if "--json" in arguments and outcome.out:
        words = [" ".join(map(str, arguments[:count])) for count in (1, 2)]
        require_documented(next((name for name in words if name in COMMANDS), cli.default), outcome.document)
    return outcome


def error_of(*arguments: str | Path, code: int = 2) -> str:
    """Call the entry point with what ends in an exit code other than 0; what it says of that."""
    outcome = run_here(*arguments)
    assert outcome.code == code, outcome.err
    return outcome.err


def run_process(*arguments: str | Path, cwd: Path | None = None, **environment: str) -> Outcome:
    """Start the installed program, with some environment variables changed."""
    done = subprocess.run(
        [PROGRAM, *map(str, arguments)],
        check=False,
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
    )
    return Outcome(done.returncode, done.stdout.decode("utf-8"), done.stderr.decode("utf-8"))


def _text(stream: TextIOWrapper) -> str:
    buffer = stream.buffer
    assert isinstance(buffer, BytesIO)
    return buffer.getvalue().decode("utf-8")
