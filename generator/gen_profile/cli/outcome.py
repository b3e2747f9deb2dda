"""Outcomes and errors, for people and for programs."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NoReturn

import click

from gen_profile.support.errors import CertificateError, CheckFailed, GenProfileError, NoMotion, OutputError

if TYPE_CHECKING:
    from pathlib import Path

    from gen_profile.assurance.proof.verdict import Proof
    from gen_profile.assurance.verification.verdict import Check

# what a terminal obeys, or hides, in place of showing it; files and servers of strangers may hold it
UNSHOWN = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069]|\r(?!\n)")
INTERRUPTED = 128 + signal.SIGINT  # as shells count it


def say(text: str, *, err: bool = True) -> None:
    """Print a text for people, control characters in it as Python writes them."""
    click.echo(UNSHOWN.sub(lambda found: found[0].encode("unicode_escape").decode(), text), err=err)


def as_json() -> bool:
    """Whether the command is to print one JSON document."""
    return bool(click.get_current_context().params["as_json"])


def print_outcome(document: dict[str, Any], text: str) -> None:
    """Print an outcome for people, or for programs, as the command was asked to.

    Raises
    ------
    OutputError
        stdout does not take it, as on a full disk.
    """
    try:
        say(_json(document) if as_json() else text, err=False)
    except BrokenPipeError:  # a reader that left early, which click knows
        raise
    except OSError as error:
        raise unprinted(error) from error


def unprinted(error: OSError) -> OutputError:
    """Say why stdout did not take what was printed, and have what it still holds go nowhere."""
    lead_nowhere(1)
    return OutputError(f"Cannot print the outcome: {error.strerror}.")


def lead_nowhere(*streams: int) -> None:
    """Have what streams of these numbers still hold go nowhere: Python tries again as it ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in streams:
        os.dup2(nowhere, number)
    os.close(nowhere)


def warn(check: Check | Proof | None) -> None:
    """Say what is wrong without counting."""
    print_warnings(() if check is None else check.warnings())


def print_warnings(sentences: Iterable[str]) -> None:
    """Say what a user should know, once in a run."""
    said = click.get_current_context().meta.setdefault(f"{__name__}.said", set())
    for sentence in sentences:
        if sentence not in said:
            say(f"Warning: {sentence}")
        said.add(sentence)


def not_written(folder: Path) -> str:
    """Say that nothing was delivered to a folder now."""
    from gen_profile.support.artefacts.manifest import FILENAME

    before = f"; {folder} still holds what an earlier run wrote" if (folder / FILENAME).exists() else ""
    return f"Nothing was written{before}."


def fail(reasons: Sequence[str], consequence: str = "") -> NoReturn:
    """Say why a check failed and what follows from that, and end the program."""
    for sentence in reasons:
        say(f"Check failed: {sentence}")
    if consequence:
        say(consequence)
    sys.exit(CheckFailed.exit_code)


def leave_unproved(reasons: Sequence[str]) -> NoReturn:
    """Say why there is no certificate, though the check passed, and end the program."""
    for sentence in reasons:
        say(f"Not proved: {sentence}")
    click.echo("The check by co-simulation passed; what is not proved has no certificate.", err=True)
    sys.exit(CertificateError.exit_code)


def print_error(error: Exception, as_json: bool) -> int:
    """Tell an error in sentences, and in JSON where that was asked for; return its exit code."""
    match error:
        case GenProfileError():
            code, message = error.exit_code, str(error)
        case click.ClickException():
            code, message = error.exit_code, error.format_message()
        case click.Abort(__cause__=None, __context__=EOFError()):
            code, message = INTERRUPTED, "Standard input ended before an answer; give it by an option."
        case click.Abort():
            code, message = INTERRUPTED, "Interrupted."
        case OSError(filename=str(path)):  # of a path that cannot even be looked at
            code, message = OutputError.exit_code, f"Cannot use {path}: {error.strerror}."
        case _:
            code, message = 1, f"Internal error ({type(error).__name__}: {error}). Run again with --debug."
    if as_json:
        details = error.to_dict() if isinstance(error, NoMotion) else {}
        document = {"error": {"type": type(error).__name__, "message": message, "exit_code": code, **details}}
        with suppress(OSError):  # the error may be that stdout takes nothing
            click.echo(_json(document))
    if isinstance(error, click.ClickException):
        error.show()
    else:
        for line in message.splitlines():
            say(f"Error: {line}")
    return code


def _json(document: Mapping[str, Any]) -> str:
    import json

    return json.dumps(document, indent=2, allow_nan=False)
