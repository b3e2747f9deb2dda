"""Streaming an artefact to the drives on a CAN bus, or to simulated ones, and telling what became of it."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import attrs

from gen_profile.delivery.streaming.outcome import Source, StreamOutcome
from gen_profile.spec.can import read_data_sheet
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import received_spec
from gen_profile.support.artefacts.manifest import FILENAME, PLANNER, sha256
from gen_profile.support.artefacts.reading import manifest_beside, read_motion, require_companions
from gen_profile.support.errors import CheckFailed, ExportError, SpecError, StreamAborted
from gen_profile.support.progress import Progress, no_progress
from gen_profile_exporters.can import drive_units, frames
from gen_profile_exporters.can.following_window import LEAST_USEFUL, useful
from gen_profile_exporters.can.host.clock import NANOSECONDS, Clock, SharedClock, SystemClock
from gen_profile_exporters.can.host.console import stopped_by_signals, told_aside
from gen_profile_exporters.can.host.lateness import Lateness, rehearse
from gen_profile_exporters.can.host.port import Port
from gen_profile_exporters.can.host.realtime import PEER_PRIORITY, priority, real_time
from gen_profile_exporters.can.scaling import magnitude_counts
from gen_profile_exporters.can.startup import startup_lists
from gen_profile_exporters.can.streaming.plan import plan_of
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.registry import format_of

if TYPE_CHECKING:
    import can

    from gen_profile.delivery.streaming.load import CraneLoad
    from gen_profile.planner.execution import BlockInstance
    from gen_profile_exporters.can.simulation.drive_bank import DriveBank
    from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
    from gen_profile_exporters.can.streaming.record import Book, Record

SELF_TEST = 20.0  # s
SPIN = 200_000  # ns before each cycle, where a processor can be spared for it


def require_rest(spec: Spec) -> None:
    """Refuse a motion that begins with a swing: it would meet the load in another phase of it.

    Raises
    ------
    SpecError
    """
    if spec.move.initial:
        raise SpecError(
            "move.initial: drives need a while to start up, and it is not known how the load swings by then; "
            "let it come to rest, leave move.initial out, and export again."
        )


def verified(path: Path, *, accept_unverified: bool = False) -> Source:
    """Read an artefact, and require that its manifest covers it.

    Raises
    ------
    OutputError
        It or its manifest cannot be read.
    SpecError
        It is no CAN log, was altered, failed its check or never had one, or begins with a swing.
    ExportError
        It is damaged.
    """
    content = read_motion(path)
    if format_of(path) != "can":
        raise SpecError(f"{path}: only the log of the format can is streamed; export that.")
    spec = _covered_spec(path, content, "can", accept_unverified)
    require_rest(spec)
    return Source(spec=spec, plan=plan_of(content, target_of(spec)))


def verified_block(path: Path, *, accept_unverified: bool = False) -> tuple[Spec, BlockInstance]:
    """Read a planner block, and require that its manifest covers it.

    Raises
    ------
    OutputError
        It or its manifest cannot be read.
    SpecError
        It is no planner block, was altered, failed its proof or never had one.
    ExportError, CosimulationError
        It cannot be executed.
    """
    from gen_profile.assurance.proof.check import is_planner_block  # noqa: PLC0415
    from gen_profile.planner.execution import BlockInstance  # noqa: PLC0415  # FMPy
    from gen_profile.planner.forms import block_in  # noqa: PLC0415

    if not is_planner_block(path):
        raise SpecError(f"{path}: it holds no planner block that can be executed; C cannot be.")
    content = read_motion(path)
    spec = _covered_spec(path, content, PLANNER, accept_unverified)
    return spec, BlockInstance(block_in(path, content))


def _covered_spec(path: Path, content: bytes, format_: str, accept_unverified: bool) -> Spec:
    """Take the spec of an artefact that its manifest covers."""
    manifest, beside = manifest_beside(path, content, planner=format_ == PLANNER), path.parent / FILENAME
    if sha256(content) not in {known.sha256 for known in manifest.artefacts if known.format == format_}:
        raise SpecError(f"{path} is not the file that {beside} covers; export and check it again.")
    require_companions(manifest, path, content)
    if manifest.check is None and not accept_unverified:
        raise SpecError(
            f"{path} is unverified: export it with its check, or accept it as it is (accept_unverified)."
        )
    if manifest.check is not None and not manifest.check.get("passed"):
        raise SpecError(f"{path} failed its check, as {beside} tells; it is not streamed.")
    return received_spec(manifest.spec, path.parent)


def designed(spec: Spec, tell: Progress) -> Source:
    """Design a motion, check it, and take the log that was written of it.

    Raises
    ------
    CheckFailed
        The load sways too much.
    GenProfileError
        As `gen_profile.delivery.designs.design.design` and `verified`.
    """
    from gen_profile.delivery.designs.design import design  # noqa: PLC0415  # CasADi, 0.2 s

    with TemporaryDirectory(prefix="gen-profile-") as folder:
        outcome = design(spec, ("can",), Path(folder), progress=tell)
        if not outcome.artefacts:
            raise CheckFailed("\n".join(outcome.check.reasons() if outcome.check else ()))
        return verified(Path(folder) / outcome.artefacts[0].path)


def actual_positions(source: Source, port: Port, tell: Progress) -> tuple[float, ...]:
    """Ask the drives where their axes stand, in m (or rad); changes nothing.

    Raises
    ------
    SpecError
        The interface cannot be opened.
    StreamAborted
        Another master is in command, or a drive does not tell.
    """
    from gen_profile_exporters.can.host.link import Link  # noqa: PLC0415
    from gen_profile_exporters.can.setup.configuration import positions  # noqa: PLC0415  # canopen
    from gen_profile_exporters.can.streaming.discovery import listen  # noqa: PLC0415  # is an extra
    from gen_profile_exporters.can.streaming.joint_bus import opened  # noqa: PLC0415

    target = source.plan.target
    tell("asking where the axes stand")
    with opened(port, target) as bus:
        link = Link(bus, SystemClock(), target.can.sdo_timeout)
        listen(link)
        counts = positions(link, target, source.plan.demand)
    return tuple(at / axis.counts_per_si for at, axis in zip(counts, target.axes, strict=True))


def summary(source: Source) -> dict[str, Any]:
    """List what a stream will do, without doing it."""
    plan, target, period = source.plan, source.plan.target, source.spec.can.sync_period
    none = [None] * len(target.axes)
    starts = none if plan.demand.start is None else source.si(plan.demand.start).tolist()
    goals = none if plan.goal is None else source.si(plan.goal).tolist()
    return {
        "state": "planned",
        "cycles_sent": 0,
        "cycles_planned": plan.planned,
        "period_s": period,
        "bus_load": frames.cycle_bits(target) / target.can.bitrate / period,
        "axes": [
            {"name": axis.name, "node": node, "start_m": start, "target_m": goal}
            for axis, node, start, goal in zip(target.axes, frames.nodes(target), starts, goals, strict=True)
        ],
        "startup": [
            {"node": node, "object": f"{e.index:04X}h:{e.sub:02X}", "value": e.value, "meaning": e.meaning}
            for node, entries in startup_lists(plan.demand, target).items()
            for e in entries
        ],
    }


def require_fit(source: Source, path: Path | None) -> None:
    """Require that drives can be set up for a motion, by an EDS or DCF: the one named here, or the spec's.

    Raises
    ------
    ExportError
    """
    from gen_profile_exporters.can.setup import data_sheet  # noqa: PLC0415  # canopen is an extra

    try:
        sheet = source.plan.target.can.eds if path is None else read_data_sheet(path)
    except OSError as error:
        raise ExportError(f"{path} cannot be read ({error.strerror}).") from error
    if sheet is not None:
        data_sheet.require_fit(sheet, source.plan.demand, source.plan.target)


def rehearsed_cycles(source: Source) -> int:
    """Count the cycles of a self-test."""
    return source.plan.planned or round(SELF_TEST / source.spec.can.sync_period)


def self_test(source: Source) -> Lateness:
    """Keep the cycle without a bus for as long as the motion lasts, and refuse what this machine cannot hold.

    Where it is not known how long that is, for `SELF_TEST`.

    Raises
    ------
    StreamAborted
    """
    period = frames.period_microseconds(source.spec.can) * 1000
    with real_time() as refused:
        lateness = rehearse(_clock(refused), period, rehearsed_cycles(source))
    if lateness.percentile(100) * 1e3 >= period / 2:
        raise StreamAborted(
            f"This machine cannot hold a cycle of {period / 1e6:g} ms: it was late by up to "
            f"{lateness.percentile(100) / 1e3:.3g} ms (half a cycle is allowed). {' '.join(refused)} "
            "Choose a longer can.sync_period, or run less on the machine."
        )
    return lateness


def stream(
    source: Source,
    port: Port,
    *,
    simulate_drive: bool = False,
    reset_fault: bool = False,
    notes: tuple[str, ...] = (),
    tell: Progress = no_progress,
    book: Book | None = None,
) -> StreamOutcome:
    """Stream a motion, and stop the axes whatever happens.

    Parameters
    ----------
    source : Source
    port : Port
    simulate_drive : bool
        Put simulated drives on the bus, which move the spec's nominal machine.
    reset_fault : bool
        Whether drives that are in fault are reset first.
    notes : tuple of str
        What there is to say beforehand.
    tell : callable
        Told each phase.
    book : Book, optional
        Where to take down how it goes, for those who watch.

    Raises
    ------
    SpecError
        The interface cannot be opened.
    CosimulationError
        The simulated machine cannot be built.
    """
    from gen_profile_exporters.can.streaming.joint_bus import opened  # noqa: PLC0415  # canopen is an extra
    from gen_profile_exporters.can.streaming.streamer import Streamer  # noqa: PLC0415

    with ExitStack() as stack:
        simulation = stack.enter_context(_simulated(source, port, tell)) if simulate_drive else None
        bus = opened(port, source.plan.target)
        stack.callback(_shut_down, bus)
        aside = stack.enter_context(told_aside(tell))
        refused = stack.enter_context(real_time())
        clock = _clock(refused) if simulation is None else simulation.clock
        streamer = Streamer(bus, clock, source.plan, aside, reset_fault=reset_fault, book=book)
        stack.enter_context(stopped_by_signals(streamer.ask_to_stop))
        stack.enter_context(source.plan.operated())
        before = 0 if simulation is None else simulation.clock.catch_up()
        record = streamer.run()
    if simulation is None:
        several = frames.buses(source.plan.target) if source.spec.can.channels else ()
        sway, remarks = None, port.remarks(record.launched, several)
    else:
        sway, remarks = simulation.sway, _stalls(simulation.clock.stalled - before)
    said = (*notes, *refused, *remarks, *source.plan.remarks, *_afterwards(record))
    return StreamOutcome(source=source, record=record, notes=said, sway=sway)


def _shut_down(bus: can.BusABC) -> None:
    """Close a bus that may have failed, which must not hide what became of the stream."""
    with suppress(Exception):
        bus.shutdown()


def serve(bank: DriveBank, stop: Callable[[], bool]) -> None:
    """Have simulated drives answer until told to stop, as promptly as the machine permits."""
    with priority(PEER_PRIORITY):
        bank.run(stop)


def drive_bank(
    source_spec: Spec,
    bus: can.BusABC,
    load: CraneLoad,
    make: DriveVariant,
    clock: Clock | None = None,
    *,
    windows: Mapping[str, int] | None = None,
) -> DriveBank:
    """Put a simulated drive on the bus for every axis, at rest at the start of the move.

    They are those that the spec asks for, by vendor, product, serial number, fixed mapping and units.
    Their following error windows in counts are those given by axis, or so narrow that every motion may have
    them.
    """
    from gen_profile_exporters.can.simulation.drive_bank import DriveBank  # noqa: PLC0415  # canopen is an extra
    from gen_profile_exporters.can.simulation.simulated_drive import SimulatedDrive  # noqa: PLC0415

    target, stated = target_of(source_spec), source_spec.can
    scales = [axis.counts_per_si for axis in target.axes]
    own = {axis.name: magnitude_counts(LEAST_USEFUL, axis) for axis in target.axes} | dict(windows or {})
    axes = zip(target.axes, frames.nodes(target), source_spec.move.start, strict=True)
    drives = [
        SimulatedDrive(
            node,
            attrs.evolve(
                make,
                vendor=stated.vendor or make.vendor,
                product=stated.product or make.product,
                serial=stated.serial.get(axis.name, make.serial),
                fixed_pdos=stated.fixed_pdos,
                following_error=own[axis.name],
                units=drive_units.codes(stated),
                encoder=drive_units.encoder(stated),
                counts_per_si=abs(axis.counts_per_si),
            ),
            round(at * axis.counts_per_si),
        )
        for axis, node, at in axes
    ]
    channels = frames.channels(target) if stated.channels else ()
    others = load.sensor_frames
    return DriveBank(bus, clock or SystemClock(), drives, scales, load, channels=channels, others=others)


@attrs.define
class _Simulation:
    """Simulated drives: the clock that they share with the streamer, and what they leave behind."""

    clock: SharedClock
    sway: float | None = None


def _afterwards(record: Record) -> tuple[str, ...]:
    """Say what went wrong when the motion was done, which the next stream may meet."""
    return (f"When the drives were switched off: {record.aftermath}",) if record.aftermath else ()


def _stalls(stalled: int) -> tuple[str, ...]:
    """Say how long a simulation stood still, in ns, if it did."""
    milliseconds = round(1e3 * stalled / NANOSECONDS)
    if milliseconds == 0:
        return ()
    return (f"This machine stalled for {milliseconds} ms in all, and the simulation with it.",)


@contextmanager
def _simulated(source: Source, port: Port, tell: Progress) -> Iterator[_Simulation]:
    """Have simulated drives work on the bus whenever the streamer sleeps."""
    from gen_profile.delivery.streaming.load import CraneLoad  # noqa: PLC0415  # FMPy and CasADi, 0.5 s
    from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant  # noqa: PLC0415  # canopen is an extra
    from gen_profile_exporters.can.streaming.joint_bus import opened  # noqa: PLC0415

    period = frames.period_microseconds(source.spec.can) * 1000
    with CraneLoad(source.spec, tell) as load, opened(port, target_of(source.spec)) as bus:
        clock = SharedClock(longest=period // 4)
        target = source.plan.target
        names = [axis.name for axis in target.axes]
        windows = dict(zip(names, useful(source.plan.demand, target), strict=True))
        clock.work = drive_bank(source.spec, bus, load, DriveVariant(), clock, windows=windows).poll
        simulation = _Simulation(clock)
        yield simulation
        simulation.sway = load.residual_sway()


def _clock(refused: tuple[str, ...]) -> SystemClock:
    """Spin before each cycle where that takes the processor from no other work."""
    spare = not refused and sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1
    return SystemClock(SPIN if spare else 0)
