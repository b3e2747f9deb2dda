"""The commands that put a motion on a CAN bus, and a drive that follows it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.options import OutputFile, SpecChoice, option
from gen_profile.cli.outcome import lead_nowhere, print_outcome
from gen_profile.cli.planner import planned, planner_options, status_line
from gen_profile.cli.progress import progress
from gen_profile.cli.streaming.words import at_start, lateness_words, outcome_words, plan_words
from gen_profile.support.errors import OutputError, SpecError, StreamAborted
from gen_profile.support.plugins import require_installed
from gen_profile.support.progress import Progress, no_progress

if TYPE_CHECKING:
    from gen_profile.delivery.streaming.outcome import Source, StreamOutcome
    from gen_profile.spec.can import CanSpec
    from gen_profile_exporters.can.host.port import Port
    from gen_profile_exporters.can.streaming.record import Book

FEW_ROWS, CELL = 10_000, 16  # of a log of unknown length, and bytes of a number in it
_MISSES = ("extrapolate", "hold", "stop")
VIRTUAL = ("virtual", "gen-profile")


_bus_options = options.together(
    option("--interface NAME", "Interface as python-can names it: socketcan, pcan, slcan …"),
    option("--channel NAME", "Channel of that interface, such as can0."),
)


@cli.command(epilog="Example: gen-profile stream deploy/paper.log --interface socketcan --channel can0")
@options.spec_shown_as("[ARTEFACT|SPEC.toml]")
@_bus_options
@planner_options
@option("--mode", "Mode of operation of the drives, for a spec.", click.Choice(["csp", "ip", "csv"]))
@option("--node N", "CANopen node of the first axis, for a spec.", int)
@option("--simulate-drive", "Stream to simulated drives that move the machine's FMU.")
@option("--to-start", "Move slowly to the motion's start from anywhere, and exit.")
@options.repeatable("--jog AXIS=DISTANCE", "Move slowly by a distance in m (or rad) from anywhere, and exit.")
@option("--reset-fault", "First reset drives that are in fault; know the cause before you do.")
@option(
    "--self-test", "First measure, for as long as the motion lasts, whether this machine can hold the cycle."
)
@option(
    "--live",
    "Plot the motion while it runs: in the terminal, or on a page on this computer.",
    click.Choice(["terminal", "browser"]),
)
@option("--eds FILE", "First try the drives' settings on their EDS or DCF.", options.InputFile())
@option("--dry-run", "Print the plan, without touching the bus.")
@option("--accept-unverified", "Stream a file that was exported without its check.")
@option("--log CSV", "Write planned and actual positions side by side.", OutputFile(), into="table")
@options.output
def stream(table: Path | None, **given: Any) -> None:
    """Stream setpoints to CiA 402 drives, and stop them safely.

    Takes the log that --export can wrote, with its manifest beside it, a spec, which is designed and checked
    first, or a planner block, which plans under commands. No safety function: emergency stop and STO stay in
    hardware.
    """
    from gen_profile.delivery.streaming import stream as run

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
        run.require_fit(source, request.eds)
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
@option("--miss", "What a drive does without a setpoint.", click.Choice(_MISSES), default="extrapolate")
@option("--own-mapping", "Start with a PDO mapping other than CiA 402's default.")
@option("--eds", "Write the drive's EDS, and exit.", OutputFile())
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
    from gen_profile.delivery.streaming import stream as run

    require_installed("Streaming needs canopen", "can", "canopen")
    from gen_profile.delivery.streaming.load import CraneLoad
    from gen_profile.dynamics.evaluation.phrases import mm, number
    from gen_profile.support.artefacts.writing import deliver
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


@attrs.frozen(kw_only=True)
class StreamRequest:
    """The options of `gen-profile stream` by their names, but those for its outcome."""

    chosen: SpecChoice
    interface: str | None
    channel: str | None
    block: Path | None
    commands_path: Path | None
    live_parameters: tuple[str, ...]
    mode: str | None
    node: int | None
    simulate_drive: bool
    to_start: bool
    jog: tuple[str, ...]
    reset_fault: bool
    self_test: bool
    live: str | None
    eds: Path | None
    dry_run: bool
    accept_unverified: bool

    def require_sense(self) -> None:
        """Refuse options that do not go together, before anything is begun.

        Raises
        ------
        SpecError
        """
        if self.live == "terminal" and not sys.stderr.isatty():
            raise SpecError(
                "--live terminal: standard error is no terminal to draw on; "
                "leave it out, or use --live browser."
            )
        wrong = "commands a planner block; name it by --planner"
        given: dict[str, object] = {
            "--commands": self.commands_path,
            "--live-parameter": self.live_parameters,
        }
        if self.block is not None:
            wrong = "not with --planner; leave one of them out"
            given = {
                "A spec or log": self.chosen.path,
                "--preset": self.chosen.preset,
                "--set, --mode or --node": self._changed().overrides,
                "--to-start": self.to_start,
                "--jog": self.jog,
                "--live": self.live,
            }
        for named, value in given.items():
            if value:
                raise SpecError(f"{named}: {wrong}.")

    def source(self, tell: Progress) -> Source:
        """Take an artefact or a planner block, or design a motion for a spec, once there is a bus for it.

        Raises
        ------
        GenProfileError
        """
        from gen_profile.delivery.streaming.stream import designed, require_rest, verified
        from gen_profile_exporters.can.streaming import joint_bus
        from gen_profile_exporters.exporter import target_of

        path, changed = self.chosen.path, self._changed()
        if self.block is not None:
            commands, unverified = self.commands_path, self.accept_unverified
            return planned(self.block, commands, self.live_parameters, accept_unverified=unverified)
        if path is not None and path.suffix.lower() != ".toml":
            if changed.preset is not None or changed.overrides:
                raise SpecError(
                    f"{path}: an artefact is streamed as it is; "
                    "--preset, --set, --mode and --node are for specs."
                )
            return verified(path, accept_unverified=self.accept_unverified)
        spec = changed.spec()
        if spec.can.nodes and any(override.startswith("can.node=") for override in changed.overrides):
            raise SpecError("--node: the spec states every node in can.nodes; change these.")
        require_rest(spec)
        if not self.dry_run:  # else there must be a bus
            joint_bus.opened(self.port(spec.can), target_of(spec)).shutdown()
        return designed(spec, tell)

    def slow_motion(self, source: Source, tell: Progress) -> Source | None:
        """Plan the slow motion from where the axes stand; None where they stand at its end already.

        Raises
        ------
        GenProfileError
        """
        from gen_profile.delivery.streaming import slow_motion

        if self.to_start and self.jog:
            raise SpecError("--to-start and --jog: choose one of them.")
        if self.dry_run:
            raise SpecError(
                "--dry-run touches no bus, and so cannot tell where a slow motion begins; leave it out."
            )
        port = self.port(source.spec.can)
        if self.jog:
            return slow_motion.jog(source, port, self.jog, simulate_drive=self.simulate_drive, tell=tell)
        return slow_motion.to_start(source, port, simulate_drive=self.simulate_drive, tell=tell)

    def port(self, can: CanSpec) -> Port:
        """Name the bus.

        Raises
        ------
        SpecError
        """
        return chosen_port(self.interface, self.channel, can, simulated=self.simulate_drive)

    def measured(self, source: Source, tell: Progress) -> tuple[str, ...]:
        """Measure this machine if that is asked for, and say before anything moves what came of it."""
        from gen_profile.delivery.streaming.stream import rehearsed_cycles, self_test

        if not self.self_test:
            return ()
        seconds = rehearsed_cycles(source) * source.spec.can.sync_period
        tell(f"measuring this machine for {seconds:.3g} s")
        sentence = f"Self-test: {lateness_words(self_test(source))}."
        tell(sentence)
        return (sentence,)

    @contextmanager
    def shown(self, source: Source) -> Iterator[tuple[Progress, Book | None]]:
        """Show a stream: by its phases, and by curves, which need the terminal for themselves."""
        from gen_profile.delivery.streaming import live_page, live_terminal
        from gen_profile.delivery.streaming.live import watched

        if self.block is not None and sys.stderr.isatty():  # where the axes are, and how far a stop leads
            with status_line() as tell:
                yield tell, None
        elif self.live == "terminal":
            with watched(source, live_terminal.show) as book:
                yield no_progress, book
        elif self.live == "browser":
            with progress() as tell, watched(source, live_page.show) as book:
                yield tell, book
        else:
            with progress() as tell:
                yield tell, None

    def _changed(self) -> SpecChoice:
        return self.chosen.changed({"can.mode": self.mode, "can.node": self.node})


def chosen_port(interface: str | None, channel: str | None, can: CanSpec, *, simulated: bool) -> Port:
    """Name the bus that options and a spec ask for, which for simulated drives is a virtual one.

    Raises
    ------
    SpecError
    """
    from gen_profile_exporters.can.host.port import Port

    if can.channels:
        if channel is not None:
            raise SpecError("--channel: the spec states every axis's in can.channels; change these.")
        channel = ""
        interface = interface or (VIRTUAL[0] if simulated else None)
    if interface is None and channel is None and simulated:
        interface, channel = VIRTUAL
    if interface is None or channel is None:
        raise SpecError("--interface and --channel: name the bus, as --interface socketcan --channel can0.")
    return Port(interface=interface, channel=channel)


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
    from gen_profile.support.artefacts.writing import deliver

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
