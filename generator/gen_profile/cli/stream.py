"""The commands that put a motion on a CAN bus, and a drive that follows it."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli.commands import cli
from gen_profile.cli.options import (
    OutputFile,
    as_overrides,
    chosen_spec,
    debug_option,
    json_option,
    spec_options,
)
from gen_profile.cli.outcome import print_outcome
from gen_profile.cli.planner import (
    planned,
    planner_options,
    require_no_others,
    require_planner,
    status_line,
)
from gen_profile.cli.progress import progress
from gen_profile.errors import OutputError, SpecError, StreamAborted

if TYPE_CHECKING:
    from gen_profile.progress import Progress
    from gen_profile.spec.can import CanSpec
    from gen_profile.streaming.outcome import Source, StreamOutcome
    from gen_profile_exporters.can.host.lateness import Lateness
    from gen_profile_exporters.can.host.port import Port
    from gen_profile_exporters.can.streaming.record import Book
    from gen_profile_exporters.exporter import Target

VIRTUAL = ("virtual", "gen-profile")
_MISSES = ("extrapolate", "hold", "stop")


def _bus_options(command: Callable[..., Any]) -> Callable[..., Any]:
    for decorate in (
        click.option("--channel", metavar="NAME", help="Channel of that interface, such as can0."),
        click.option(
            "--interface",
            metavar="NAME",
            help="Interface as python-can names it: socketcan, pcan, slcan …",
        ),
    ):
        command = decorate(command)
    return command


@cli.command(epilog="Example: gen-profile stream deploy/paper.log --interface socketcan --channel can0")
@spec_options
@_bus_options
@planner_options
@click.option("--mode", type=click.Choice(["csp", "ip", "csv"]), help="Mode of the drives, for a spec.")
@click.option("--node", metavar="N", type=int, help="CANopen node of the first axis, for a spec.")
@click.option("--simulate-drive", is_flag=True, help="Let simulated drives move the machine's FMU.")
@click.option("--to-start", is_flag=True, help="Move slowly to the motion's start from anywhere, and end.")
@click.option(
    "--jog",
    metavar="AXIS=DISTANCE",
    multiple=True,
    help="Move slowly by a distance in m (or rad) from anywhere, and end. Repeatable.",
)
@click.option("--reset-fault", is_flag=True, help="Reset drives in fault first; know why they were.")
@click.option(
    "--self-test",
    is_flag=True,
    help="First measure, for as long as the motion lasts, whether this machine can hold the cycle.",
)
@click.option(
    "--live",
    type=click.Choice(["terminal", "browser"]),
    help="Draw the motion while it runs: here, or on a page of this machine.",
)
@click.option("--dry-run", is_flag=True, help="Print the plan, and touch no bus.")
@click.option("--accept-unverified", is_flag=True, help="Stream what was exported without its check.")
@click.option(
    "--log",
    "table",
    metavar="CSV",
    type=OutputFile(),
    help="Write planned and actual positions side by side.",
)
@json_option
@debug_option
def stream(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    interface: str | None,
    channel: str | None,
    block: Path | None,
    commands_path: Path | None,
    live_parameters: tuple[str, ...],
    mode: str | None,
    node: int | None,
    simulate_drive: bool,
    to_start: bool,
    jog: tuple[str, ...],
    reset_fault: bool,
    self_test: bool,
    live: str | None,
    dry_run: bool,
    accept_unverified: bool,
    table: Path | None,
    as_json: bool,
) -> None:
    """Stream setpoints to CiA 402 drives, and stop them safely.

    Takes the log that --export can wrote, with its manifest beside it, a spec, which is designed and checked
    first, or a planner block, which plans under commands. No safety function: emergency stop and STO stay in
    hardware.
    """
    from gen_profile.artefacts.writing import require_place
    from gen_profile.streaming import stream as run
    from gen_profile_exporters.can.host.port import Port

    run.require_extra()
    if live == "terminal":
        _require_terminal()
    overrides += as_overrides({"can.mode": mode, "can.node": node})
    if block is not None:
        specs = {"A spec or log": spec_path, "--preset": preset, "--set, --mode or --node": overrides}
        require_no_others({**specs, "--to-start": to_start, "--jog": jog, "--live": live})
    from gen_profile_exporters.can.streaming import joint_bus

    with progress() as tell:

        def port_of(can: CanSpec) -> Port:
            return Port(**_port(interface, channel, simulate_drive, can))

        def require_bus(target: Target) -> None:
            if not dry_run:
                joint_bus.opened(port_of(target.can), target).shutdown()

        if block is not None:
            source = planned(block, commands_path, live_parameters, accept_unverified=accept_unverified)
        else:
            require_planner(commands_path, live_parameters)
            source = _source(
                spec_path,
                preset,
                overrides,
                accept_unverified=accept_unverified,
                require_bus=require_bus,
                tell=tell,
            )
        if to_start or jog:
            _require_moving_alone(to_start, jog, dry_run)
            port = port_of(source.spec.can)
            slow = _slow(source, port, jog, simulate_drive, tell)
            if slow is None:
                print_outcome(*_at_start(source), as_json)
                return
            source = slow
        if dry_run:
            plan = run.summary(source)
            print_outcome(plan, _plan_words(plan, _units(source)), as_json)
            return
        port = port_of(source.spec.can)
        if table is not None:
            require_place(table)  # the log of a motion that was made must not be lost
        notes: tuple[str, ...] = ()
        if self_test:
            notes = (_self_test(source, tell),)
    by_hand = block is not None and commands_path is None
    with _shown(source, live, by_hand=by_hand) as (tell_phase, book):
        outcome = run.stream(
            source,
            port,
            simulate_drive=simulate_drive,
            reset_fault=reset_fault,
            notes=notes,
            tell=tell_phase,
            book=book,
        )
    _conclude(outcome, table, as_json)


@cli.command(
    "drive-sim", epilog="Example: gen-profile drive-sim --preset paper --interface socketcan --channel vcan0"
)
@spec_options
@_bus_options
@click.option(
    "--miss", type=click.Choice(_MISSES), default="extrapolate", help="What it does without a setpoint."
)
@click.option("--own-mapping", is_flag=True, help="Start with another PDO mapping than CiA 402 proposes.")
@click.option("--eds", metavar="FILE", type=OutputFile(), help="Write its EDS, and end.")
@json_option
@debug_option
def drive_sim(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    interface: str | None,
    channel: str | None,
    miss: str,
    own_mapping: bool,
    eds: Path | None,
    as_json: bool,
) -> None:
    """Simulate CiA 402 drives that move the machine's FMU.

    Ends after one stream, when all drives have been switched off again, and tells how far the load sways.
    """
    from gen_profile.streaming import stream as run

    run.require_extra()
    from gen_profile.artefacts.writing import deliver
    from gen_profile.evaluation.phrases import mm, number
    from gen_profile.streaming.load import CraneLoad
    from gen_profile_exporters.can.host.port import Port
    from gen_profile_exporters.can.simulation import drive_dictionary
    from gen_profile_exporters.can.streaming import joint_bus
    from gen_profile_exporters.exporter import target_of

    spec = chosen_spec(spec_path, preset, overrides)
    make = drive_dictionary.DriveVariant(miss=miss, own_mapping=own_mapping)
    if eds is not None:
        deliver(eds, drive_dictionary.eds(spec.can.node, make, eds.name).encode("utf-8"))
        return
    port = Port(**_port(interface, channel, False, spec.can))
    with (
        progress() as tell,
        CraneLoad(spec, lambda: tell("compiling the plant's FMU, once")) as load,
        joint_bus.opened(port, target_of(spec)) as bus,
    ):
        bank = run.drive_bank(spec, bus, load, make)
        tell("waiting for a stream, or serving it")
        run.serve(bank, lambda: bank.finished)
        sway = load.residual_sway()
    scales = [axis.counts_per_si for axis in spec.axis_scales()]
    places = [drive.actual / scale for drive, scale in zip(bank.drives, scales, strict=True)]
    document = {
        "position_m": places,
        "states": [drive.state.words for drive in bank.drives],
        "sway_residual_peak_m": sway,
    }
    axes = spec.machine().actuated
    at = [f"{axis.name} at {number(place)} {axis.unit}" for axis, place in zip(axes, places, strict=True)]
    print_outcome(document, f"{', '.join(at)}, residual sway {mm(sway)}", as_json)


for parameter in stream.params:
    if parameter.name == "spec_path":
        parameter.metavar = "[ARTEFACT|SPEC.toml]"


def _conclude(outcome: StreamOutcome, table: Path | None, as_json: bool) -> None:
    """Report what became of a stream, by every way that still takes it, and end in the exit code of that."""
    import attrs

    from gen_profile.artefacts.writing import deliver

    code, complaints = (0, []) if outcome.done else (StreamAborted.exit_code, [_aborted(outcome)])
    if table is not None:
        try:
            deliver(table, outcome.table())
        except OutputError as error:
            outcome = attrs.evolve(outcome, notes=(*outcome.notes, str(error)))
            code, complaints = code or OutputError.exit_code, [*complaints, f"Error: {error}"]
    said = [_refusal(print_outcome, outcome.to_dict(), _outcome_words(outcome), as_json)]
    said += [_refusal(click.echo, complaint, err=True) for complaint in complaints]
    refusals = [refusal for refusal in said if refusal is not None]
    if refusals and not code:
        raise refusals[0]
    if refusals:
        _lead_nowhere()
    if code:
        sys.exit(code)


def _aborted(outcome: StreamOutcome) -> str:
    return f"Stream aborted: {outcome.record.reason}"


def _refusal(say: Callable[..., None], *arguments: Any, **options: Any) -> Exception | None:
    """Say something, and return why it was not taken, if it was not."""
    try:
        say(*arguments, **options)
    except (OSError, OutputError) as error:
        return error
    return None


def _lead_nowhere() -> None:
    """Give up streams that took nothing: Python would try again at its end, and end in a code of its own."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for number in (1, 2):
        os.dup2(nowhere, number)


def _source(
    path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    *,
    accept_unverified: bool,
    require_bus: Callable[[Target], None],
    tell: Progress,
) -> Source:
    """Take an artefact, or design one for a spec, once there is a bus for it."""
    from gen_profile.streaming.stream import designed, require_rest, verified
    from gen_profile_exporters.exporter import target_of

    if path is not None and path.suffix.lower() != ".toml":
        if preset is not None or overrides:
            raise SpecError(
                f"{path}: an artefact is streamed as it is; --preset, --set, --mode and --node are for specs."
            )
        return verified(path, accept_unverified=accept_unverified)
    spec = chosen_spec(path, preset, overrides)
    if spec.can.nodes and any(override.startswith("can.node=") for override in overrides):
        raise SpecError("--node: the spec states every node in can.nodes; change these.")
    require_rest(spec)
    require_bus(target_of(spec))
    return designed(spec, tell)


@contextmanager
def _shown(
    source: Source, live: str | None, *, by_hand: bool
) -> Iterator[tuple[Callable[[str], None], Book | None]]:
    """Show a stream: by its phases, and by curves, which need the terminal for themselves."""
    if by_hand:
        with status_line() as tell:
            yield tell, None
        return
    if live is None:
        with progress() as tell:
            yield tell, None
        return
    from gen_profile.streaming import live_page, live_terminal
    from gen_profile.streaming.live import watched

    if live == "browser":
        with progress() as tell, watched(source, live_page.show) as book:
            yield tell, book
    else:
        with watched(source, live_terminal.show) as book:
            yield lambda _: None, book


def _require_terminal() -> None:
    if not sys.stderr.isatty():
        raise SpecError(
            "--live terminal: standard error is no terminal to draw on; leave it out, or use --live browser."
        )


def _require_moving_alone(to_start: bool, jog: tuple[str, ...], dry_run: bool) -> None:
    if to_start and jog:
        raise SpecError("--to-start and --jog: choose one of them.")
    if dry_run:
        raise SpecError(
            "--dry-run touches no bus, and so cannot tell where a slow motion begins; leave it out."
        )


def _slow(
    source: Source, port: Port, jog: tuple[str, ...], simulate_drive: bool, tell: Progress
) -> Source | None:
    from gen_profile.streaming import slow_motion

    if jog:
        return slow_motion.jog(source, port, jog, simulate_drive=simulate_drive, tell=tell)
    return slow_motion.to_start(source, port, simulate_drive=simulate_drive, tell=tell)


def _at_start(source: Source) -> tuple[dict[str, Any], str]:
    tolerance = source.spec.can.start_tolerance
    words = (
        f"The axes stand at the start already, within can.start_tolerance ({tolerance:g}); nothing was moved."
    )
    return {"state": "at start", "reason": ""}, words


def _self_test(source: Source, tell: Progress) -> str:
    """Measure this machine, and say before anything moves what came of it."""
    from gen_profile.streaming.stream import rehearsed_cycles, self_test

    seconds = rehearsed_cycles(source) * source.spec.can.sync_period
    tell(f"measuring this machine for {seconds:.3g} s")
    found = f"Self-test: {_lateness_words(self_test(source))}."
    tell(found)
    return found


def _port(interface: str | None, channel: str | None, simulated: bool, can: CanSpec) -> dict[str, str]:
    if can.channels:
        if channel is not None:
            raise SpecError("--channel: the spec states every axis's in can.channels; change these.")
        channel = ""
        interface = interface or (VIRTUAL[0] if simulated else None)
    if interface is None and channel is None and simulated:
        return dict(zip(("interface", "channel"), VIRTUAL, strict=True))
    if interface is None or channel is None:
        raise SpecError("--interface and --channel: name the bus, as --interface socketcan --channel can0.")
    return {"interface": interface, "channel": channel}


def _units(source: Source) -> list[str]:
    return [axis.unit for axis in source.axes]


def _plan_words(plan: dict[str, Any], units: Sequence[str]) -> str:
    axes = [
        f"  {axis['name']}: node {axis['node']}, {_way_words(axis, unit)}"
        for axis, unit in zip(plan["axes"], units, strict=True)
    ]
    objects = [
        f"  node {entry['node']}  {entry['object']} = {_value_words(entry)}  {entry['meaning']}"
        for entry in plan["startup"]
    ]
    many = "" if plan["cycles_planned"] is None else f"{plan['cycles_planned']} "
    head = f"{many}cycles of {1e3 * plan['period_s']:g} ms, bus load at most {plan['bus_load']:.0%}"
    return "\n".join([head, *axes, "Before anything moves, each drive is set to, and must hold:", *objects])


def _way_words(axis: dict[str, Any], unit: str) -> str:
    if axis["start_m"] is None:
        return "from where it stands"
    return f"from {axis['start_m']:g} to {axis['target_m']:g} {unit}"


def _value_words(entry: dict[str, Any]) -> str:
    """Write what is put together from bits in hexadecimal: COB-IDs, mappings and the like."""
    composed = entry["object"] < "6" and entry["value"] > 0xFFFF
    return f"{entry['value']:08X}h" if composed else str(entry["value"])


def _lateness_words(late: Lateness) -> str:
    half, most, all_ = (f"{late.percentile(share):.0f} µs" for share in (50, 99, 100))
    return f"half below {half}, 99 % below {most}, all below {all_}"


def _outcome_words(outcome: StreamOutcome) -> str:
    from gen_profile.evaluation.phrases import mm, number

    told, late = outcome.to_dict(), outcome.record.lateness
    of_all = "" if told["cycles_planned"] is None else f" of {told['cycles_planned']}"
    lines = [f"{told['state']}: {told['cycles_sent']}{of_all} setpoints sent"]
    if told["cycles_sent"]:
        lines.append(f"lateness: {_lateness_words(late)}; drift {number(1e6 * late.drift)} µs")
    lines += told["notes"]
    drive = told["drive"]
    if drive is not None:
        unit = " or ".join(f"m{unit}" for unit in dict.fromkeys(_units(outcome.source)))
        lines.append(
            f"axis: {number(1e3 * drive['position_error_m'])} {unit} off the target, at most "
            f"{number(1e3 * drive['following_error_max_m'])} {unit} off the plan on the way"
        )
        if drive["sway_residual_peak_m"] is not None:
            lines.append(f"residual sway of the simulated load: {mm(drive['sway_residual_peak_m'])}")
    return "\n".join(lines)
