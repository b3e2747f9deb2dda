"""The commands that put a motion on a CAN bus, and a drive that follows it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.options import OutputFile, SpecChoice, option
from gen_profile.cli.outcome import lead_nowhere, print_outcome
from gen_profile.cli.planner import planner_options
from gen_profile.cli.progress import progress
from gen_profile.cli.streaming.words import at_start, outcome_words, plan_words
from gen_profile.errors import OutputError, StreamAborted
from gen_profile.plugins import require_installed

if TYPE_CHECKING:
    from gen_profile.streaming.outcome import Source, StreamOutcome

FEW_ROWS, CELL = 10_000, 16  # of a log of unknown length, and bytes of a number in it
_MISSES = ("extrapolate", "hold", "stop")


_bus_options = options.together(
    option("--interface NAME", "Interface as python-can names it: socketcan, pcan, slcan …"),
    option("--channel NAME", "Channel of that interface, such as can0."),
)


@cli.command(epilog="Example: gen-profile stream deploy/paper.log --interface socketcan --channel can0")
@options.spec_shown_as("[ARTEFACT|SPEC.toml]")
@_bus_options
@planner_options
@option("--mode", "Mode of the drives, for a spec.", click.Choice(["csp", "ip", "csv"]))
@option("--node N", "CANopen node of the first axis, for a spec.", int)
@option("--simulate-drive", "Let simulated drives move the machine's FMU.")
@option("--to-start", "Move slowly to the motion's start from anywhere, and end.")
@options.repeatable("--jog AXIS=DISTANCE", "Move slowly by a distance in m (or rad) from anywhere, and end.")
@option("--reset-fault", "Reset drives in fault first; know why they were.")
@option(
    "--self-test", "First measure, for as long as the motion lasts, whether this machine can hold the cycle."
)
@option(
    "--live",
    "Draw the motion while it runs: here, or on a page of this machine.",
    click.Choice(["terminal", "browser"]),
)
@option("--dry-run", "Print the plan, and touch no bus.")
@option("--accept-unverified", "Stream what was exported without its check.")
@option("--log CSV", "Write planned and actual positions side by side.", OutputFile(), into="table")
@options.output
def stream(table: Path | None, **given: Any) -> None:
    """Stream setpoints to CiA 402 drives, and stop them safely.

    Takes the log that --export can wrote, with its manifest beside it, a spec, which is designed and checked
    first, or a planner block, which plans under commands. No safety function: emergency stop and STO stay in
    hardware.
    """
    from gen_profile.cli.streaming.request import StreamRequest
    from gen_profile.streaming import stream as run

    require_installed("Streaming needs canopen", "can", "canopen")
    request = StreamRequest(**given)
    request.require_sense()
    with progress() as tell:
        source = request.source(tell)
        if request.to_start or request.jog:
            slow = request.slow_motion(source, tell)
            if slow is None:
                print_outcome(*at_start(source))
                return
            source = slow
        if request.dry_run:
            plan = run.summary(source)
            print_outcome(plan, plan_words(plan, [axis.unit for axis in source.axes]))
            return
        port = request.port(source.spec.can)
        if table is not None:
            _require_room(table, source)
        notes = request.measured(source, tell)
    with request.shown(source) as (tell_phase, book):
        outcome = run.stream(
            source,
            port,
            simulate_drive=request.simulate_drive,
            reset_fault=request.reset_fault,
            notes=notes,
            tell=tell_phase,
            book=book,
        )
    _conclude(outcome, table)


@cli.command(
    "drive-sim", epilog="Example: gen-profile drive-sim --preset paper --interface socketcan --channel vcan0"
)
@options.spec
@_bus_options
@option("--miss", "What it does without a setpoint.", click.Choice(_MISSES), default="extrapolate")
@option("--own-mapping", "Start with another PDO mapping than CiA 402 proposes.")
@option("--eds", "Write its EDS, and end.", OutputFile())
@options.output
def drive_sim(
    chosen: SpecChoice,
    interface: str | None,
    channel: str | None,
    miss: str,
    own_mapping: bool,
    eds: Path | None,
) -> None:
    """Simulate CiA 402 drives that move the machine's FMU.

    Ends after one stream, when all drives have been switched off again, or by Ctrl-C, and tells how far the
    load sways.
    """
    from gen_profile.streaming import stream as run

    require_installed("Streaming needs canopen", "can", "canopen")
    from gen_profile.artefacts.writing import deliver
    from gen_profile.cli.streaming.request import chosen_port
    from gen_profile.evaluation.phrases import mm, number
    from gen_profile.streaming.load import CraneLoad
    from gen_profile_exporters.can.simulation import drive_dictionary
    from gen_profile_exporters.can.streaming import joint_bus
    from gen_profile_exporters.exporter import target_of

    spec = chosen.spec()
    make = drive_dictionary.DriveVariant(miss=miss, own_mapping=own_mapping)
    if eds is not None:
        deliver(eds, drive_dictionary.eds(spec.can.node, make, eds.name).encode("utf-8"))
        return
    port = chosen_port(interface, channel, spec.can, simulated=False)
    with progress() as tell, CraneLoad(spec, tell) as load, joint_bus.opened(port, target_of(spec)) as bus:
        bank = run.drive_bank(spec, bus, load, make)
        tell("waiting for a stream, or serving it")
        try:
            run.serve(bank, lambda: bank.finished)
        except KeyboardInterrupt:
            if not any(drive.was_enabled for drive in bank.drives):
                raise
        sway = load.residual_sway()
    scales = [axis.counts_per_si for axis in spec.axis_scales()]
    places = [drive.actual / scale for drive, scale in zip(bank.drives, scales, strict=True)]
    states = [drive.state.words for drive in bank.drives]
    document = {"position_m": places, "states": states, "sway_residual_peak_m": sway}
    at = [
        f"{axis.name} at {number(place)} {axis.unit} ({state})"
        for axis, place, state in zip(spec.machine().actuated, places, states, strict=True)
    ]
    print_outcome(document, f"{', '.join(at)}, residual sway {mm(sway)}")


def _require_room(table: Path, source: Source) -> None:
    """Refuse to begin where the disk cannot take the log; later, the motion would be done without it.

    Raises
    ------
    OutputError
    """
    import shutil

    try:
        free = shutil.disk_usage(table.parent).free
    except OSError:  # writing it will tell
        return
    rows, columns = source.plan.planned or FEW_ROWS, 1 + 2 * len(source.axes)
    if free < rows * columns * CELL:
        raise OutputError(f"--log {table}: its disk has no room for it ({free} bytes); choose another place.")


def _conclude(outcome: StreamOutcome, table: Path | None) -> None:
    """Report what became of a stream, by every way that still takes it, and end in the exit code of that."""
    import attrs

    from gen_profile.artefacts.writing import deliver

    aborted = f"Stream aborted: {outcome.record.reason}"
    code, complaints = (0, []) if outcome.done else (StreamAborted.exit_code, [aborted])
    unwritten: dict[str, Any] | None = None
    if table is not None:
        try:
            deliver(table, outcome.table())
        except OutputError as error:
            sentences = f"{error} The motion is done all the same." if outcome.done else str(error)
            outcome = attrs.evolve(outcome, notes=(*outcome.notes, str(error)))
            code, complaints = code or OutputError.exit_code, [*complaints, f"Error: {sentences}"]
            unwritten = {"type": type(error).__name__, "message": sentences, "exit_code": code}
    document = {**outcome.to_dict(), "error": unwritten}
    said = [_refusal(print_outcome, document, outcome_words(outcome))]
    said += [_refusal(click.echo, complaint, err=True) for complaint in complaints]
    refusals = [refusal for refusal in said if refusal is not None]
    if refusals and not code:
        raise refusals[0]
    if refusals:
        lead_nowhere(1, 2)
    if code:
        sys.exit(code)


def _refusal(say: Callable[..., None], *arguments: Any, **given: Any) -> Exception | None:
    """Say something, and return why it was not taken, if it was not."""
    try:
        say(*arguments, **given)
    except (OSError, OutputError) as error:
        return error
    return None
