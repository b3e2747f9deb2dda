"""What is to be streamed, how and where, as the options state it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import attrs

from gen_profile.cli.options import SpecChoice
from gen_profile.cli.planner import planned, status_line
from gen_profile.cli.progress import progress
from gen_profile.cli.streaming.words import lateness_words
from gen_profile.errors import SpecError
from gen_profile.progress import Progress, no_progress

if TYPE_CHECKING:
    from gen_profile.spec.can import CanSpec
    from gen_profile.streaming.outcome import Source
    from gen_profile_exporters.can.host.port import Port
    from gen_profile_exporters.can.streaming.record import Book

VIRTUAL = ("virtual", "gen-profile")


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
        for option, value in given.items():
            if value:
                raise SpecError(f"{option}: {wrong}.")

    def source(self, tell: Progress) -> Source:
        """Take an artefact or a planner block, or design a motion for a spec, once there is a bus for it.

        Raises
        ------
        GenProfileError
        """
        from gen_profile.streaming.stream import designed, require_rest, verified
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
        from gen_profile.streaming import slow_motion

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
        from gen_profile.streaming.stream import rehearsed_cycles, self_test

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
        from gen_profile.streaming import live_page, live_terminal
        from gen_profile.streaming.live import watched

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
