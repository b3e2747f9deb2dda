"""The entry point: streams, signals, and whatever a command ends in."""

import atexit
import gc
import os
import signal
import sys
import threading
from io import TextIOWrapper
from typing import Any

import click

from gen_profile.cli.commands import cli
from gen_profile.cli.group import Later
from gen_profile.cli.outcome import print_error, unprinted
from gen_profile.support.errors import UnknownProgram

# Commands of modules that are imported once one of theirs is called, and what the help says of them.
LATER = {
    "gen_profile.cli.can": {"can": "Look at CAN buses."},
    "gen_profile.cli.commissioning.commission": {
        "commission": "Go from a tape measure to a controller, step by step."
    },
    "gen_profile.cli.commissioning.identify": {
        "identify": "Find parameters from measurements on site, and write a spec.",
        "learn": "Narrow a spec's ranges by what runs of a motion showed.",
    },
    "gen_profile.cli.commissioning.log_swing": {
        "log-swing": "Log how a load swings, for identify and learn, until Ctrl-C."
    },
    "gen_profile.cli.deployment.commands": {
        "deploy": "Put a playback block's table, a library's, or a planner's numbers into a controller.",
        "plc-sim": "Simulate a controller that runs a playback block, behind an OPC UA, ADS or S7 server.",
    },
    "gen_profile.cli.fmu": {
        "fmu": "Write an FMU of a plant, profile, planner, or a plant with either; or two of them as an SSP."
    },
    "gen_profile.cli.planner": {
        "planner": "Write a PLC block that plans every motion itself, and execute it."
    },
    "gen_profile.cli.report": {
        "report": "Write everything about a design, or about a planner block and its proof, into one HTML "
        "file."
    },
    "gen_profile.cli.streaming.commands": {
        "stream": "Stream setpoints to CiA 402 drives, and stop them safely.",
        "drive-sim": "Simulate CiA 402 drives that move the machine's FMU.",
    },
    "gen_profile.cli.studio": {
        "studio": "Turn every knob of a spec in the browser, and see the swing at once."
    },
    "gen_profile.cli.sweep": {
        "sweep": "Design, check and export every combination of some values.",
        "lookup": "Find the nearest safe profile of a sweep.",
        "library": "Combine a sweep's PLC blocks into one.",
    },
}
for module, summaries in LATER.items():
    for name, summary in summaries.items():
        cli.add_command(Later(name, module, summary))


def run() -> None:
    """Run the command line."""
    # for matrices this small, threads that wait for one another cost several times what they save
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    atexit.register(gc.freeze)  # else Python looks for garbage among all that it loaded, just before it ends
    _open_streams()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal may lack β
    interruptions = _interruptible()
    debug, as_json = "--debug" in sys.argv, "--json" in sys.argv
    if debug:
        import logging

        logging.basicConfig(level=logging.DEBUG, format="%(name)s: %(message)s")
    try:
        sys.exit(_done())
    except Exception as error:
        if debug:
            raise
        # what is interrupted while compiled code runs may end in an error of that code's own
        sys.exit(print_error(click.Abort() if interruptions else _refusal() or error, as_json))


def _done() -> Any:
    """Run the command; once more where it met a program that the user lets run when he is asked."""
    try:
        return cli.main(prog_name="gen-profile", standalone_mode=False)
    except UnknownProgram as error:
        if not (sys.stdin and sys.stdin.isatty() and sys.stderr.isatty()):
            raise
        hashes = ", ".join(f"{path.name} (SHA-256 {sha256})" for path, sha256 in error.programs.items())
        if not click.confirm(f"{error}\nLet {hashes} run?", err=True):
            raise
        from gen_profile.support.private_folder import agree

        for sha256 in error.programs.values():
            agree(sha256)
        return cli.main(prog_name="gen-profile", standalone_mode=False)


def refuse_interrupted() -> int:
    """Tell that it was interrupted; return the exit code."""
    return print_error(click.Abort(), "--json" in sys.argv)


def _refusal() -> Exception | None:
    """Tell that stdout does not take what click printed itself, such as help."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:  # a reader that left early
        return None
    except OSError as error:
        return unprinted(error)
    return None


def _open_streams() -> None:
    """Lead streams that the caller closed nowhere: a file that is opened would get their number."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(number)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8")


def _interruptible() -> list[int]:
    """Clean up on SIGTERM as on Ctrl-C; list the signals that come."""
    signals: list[int] = []

    def interrupt(number: int, _frame: object) -> None:
        signals.append(number)
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # and not ignored, as in the background
        signal.signal(signal.SIGINT, interrupt)
    unraisable = sys.unraisablehook

    def come_again(ignored: "sys.UnraisableHookArgs") -> None:
        if signals and ignored.exc_type is KeyboardInterrupt:  # in a finalizer, which Python lets go on
            threading.Timer(0.1, os.kill, (os.getpid(), signals[-1])).start()
        else:
            unraisable(ignored)

    if sys.platform != "win32":
        sys.unraisablehook = come_again
    return signals
