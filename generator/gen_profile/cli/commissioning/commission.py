"""The command that leads from a tape measure to a controller: the other commands, one after the other."""

from __future__ import annotations

import sys
from contextlib import nullcontext, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli, design
from gen_profile.cli.commissioning.identify import identify
from gen_profile.cli.commissioning.log_swing import log_swing
from gen_profile.cli.deployment.commands import deploy
from gen_profile.cli.options import Number, PathType, SpecChoice, option
from gen_profile.cli.outcome import as_json, print_outcome, say
from gen_profile.cli.report import report
from gen_profile.support.errors import GenProfileError, OutputError
from gen_profile.support.plugins import require_installed

if TYPE_CHECKING:
    from collections.abc import Callable

    from gen_profile.spec.model import Spec

# what it takes of each of the others
TAKEN: dict[click.Command, tuple[str, ...]] = {
    identify: ("readings", "periods", "columns", "signal", "unit", "time_unit", "after", "free"),
    design: ("folder",),
    deploy: ("data_block", "instance", "fingerprint", "user", "certificate", "security", "by", "key_path"),
}
ASKED: dict[str, tuple[str, Callable[[Spec], object]]] = {  # of a machine with one axis; what stands there
    "move.distance": ("How far it shall go, in m", lambda spec: spec.move.distance[0]),
    "move.duration": ("in how many s", lambda spec: spec.move.duration),
    "limits.velocity": ("The drive's greatest velocity, in m/s", lambda spec: spec.limits.velocity),
    "limits.acceleration": ("and acceleration, in m/s²", lambda spec: spec.limits.acceleration),
    "check.residual_sway": (
        "Sway that may remain, in m",
        lambda spec: min(spec.check.residual_sway.values()),
    ),
}
Words = tuple[str, ...]


@cli.command(epilog="Example: gen-profile commission crane.toml --export plc --to opc.tcp://10.0.0.5:4840")
@click.argument("path", metavar="SPEC.toml", type=PathType())
@options.preset("Preset that a new spec starts from.")
@options.repeatable("--set KEY=VALUE", "Override a key of the spec.", into="overrides")
@option("--swing CSV|URL", "Log of a free swing, or a phone's address, as for log-swing.")
@option(
    "--for SECONDS",
    "How long to log the phone; 60 s by default.",
    Number(min=1.0),
    into="seconds",
    default=60.0,
)
@options.repeatable("--export FORMAT", "Format to write.", into="formats")
@option("--to URL", "Controller to deploy to, as for deploy; an empty text for none.", into="url")
@option("--yes", "Ask nothing: what no option answers stays as it is.")
@options.output
def commission(path: Path, *, yes: bool, **given: Any) -> None:
    """Go from a tape measure to a controller, step by step.

    Measure, log a swing, identify, design, prove, report, deploy, and record it. What no option answers is
    asked; an existing SPEC.toml is continued, a missing one is created.
    """
    require_installed("A report needs Plotly", "report", "plotly")
    run = _Guide(click.get_current_context(), given, yes)
    options.require_formats(given["formats"])
    run.require_log(given["swing"] or "")
    with redirect_stdout(sys.stderr) if as_json() else nullcontext():
        run.announce("The machine, by tape, scale and data sheet")
        overrides, readings = run.measured(path)
        run.write(path, overrides)  # what was answered so far is not asked again
        run.announce("A swing, which tells where the rope's pendulum really ends")
        log, signal = run.logged(path)
        url = run.answer("url", "Controller to deploy to, as opc.tcp://HOST:PORT; nothing for none", "")
        run.write(path, ('export.plc_tables="variables"',) * bool(url))
        if log is not None or readings or given["periods"]:
            run.announce("What that tells of the machine")
            run.call(
                identify,
                spec_path=path,
                out=path,
                logs=() if log is None else (log,),
                readings=readings,
                **signal,
            )
        run.announce("The motion, proved on every machine of the ranges")
        formats = given["formats"] or run.answer("", "Formats (gen-profile formats)", "plc").split()
        run.call(design, spec_path=path, formats=formats)
        files = run.files()
        page = path.with_suffix(".html")
        run.call(report, spec_path=files[0], path=page, no_compare=True)
        record = None
        question = f"Does the axis stand still, and may {files[0]} be put to use?"
        if url and (yes or click.confirm(question, err=True)):
            run.announce("Into the controller")
            run.call(deploy, artefact=files[0], url=url)
            record = files[0].parent / "deployments.json"
    document = {
        "spec": str(path),
        "artefacts": [str(one) for one in files],
        "report": str(page),
        "record": record and str(record),
    }
    written = ", ".join(str(one) for one in (path, *files, page, record) if one)
    print_outcome(document, f"Done: {written}. Each later run tells more: gen-profile learn.")


commission.params += [one for other, names in TAKEN.items() for one in other.params if one.name in names]


class _Guide:
    """Answers by options, or else by who is asked, and the commands that are called with them."""

    def __init__(self, context: click.Context, options: dict[str, Any], yes: bool) -> None:
        self._context, self._options, self._yes, self._preset = context, options, yes, ""
        self._steps = 0

    def announce(self, step: str) -> None:
        """Say what is done next; steps that are left out are not counted."""
        self._steps += 1
        click.secho(f"\n{self._steps}. {step}", bold=True, err=True)

    def answer(self, name: str, question: str, default: str) -> str:
        """Take an option, or ask."""
        given = self._options.get(name)
        if given is not None or self._yes:
            return str(default if given is None else given)
        return str(click.prompt(question, default=default, err=True, show_default=bool(default))).strip()

    def call(self, command: click.Command, **more: Any) -> None:
        """Call another command with the options that are its own."""
        names = TAKEN.get(command, ())
        self._context.invoke(command, **{**{name: self._options[name] for name in names}, **more})

    def measured(self, path: Path) -> tuple[Words, Words]:
        """Give keys of the spec and readings; of one that is not there, ask what tape and scale say."""
        given, readings = tuple(self._options["overrides"]), tuple(self._options["readings"])
        if path.exists():
            return given, readings
        self._preset = self.answer("preset", "Most like which of gen-profile presets", "bay-crane")
        spec = SpecChoice(None, self._preset, given).spec()
        asked: dict[str, tuple[str, object]] = {}
        for q in spec.machine().parameters:
            if q.name != "g" and not any(one.startswith(f"{q.name}=") for one in readings):
                question = f"{q.name}, {q.description}, in {q.unit} (or as 6.2±0.1)"
                asked[f"plant.{q.name}"] = (question, spec.plant.parameters[q.name])
        if len(spec.machine().actuated) == 1:
            asked |= {key: (question, value(spec)) for key, (question, value) in ASKED.items()}
        for key, (question, value) in asked.items():
            if not any(one.startswith(f"{key}=") for one in given):
                unchanged = "" if value is None else f"{value}"
                given, readings = self._taken(key, question, unchanged, given, readings)
        return given, readings

    def _taken(
        self, key: str, question: str, unchanged: str, given: Words, readings: Words
    ) -> tuple[Words, Words]:
        """Add an answer to the keys or the readings, once it is one that the spec takes."""
        from gen_profile.studies.identification.measurements import parse_reading

        while (text := self.answer("", question, unchanged)) != unchanged:
            try:
                read: Words = ()
                if key.startswith("plant.") and ("±" in text or "+-" in text):
                    read = (f"{key.removeprefix('plant.')}={text}",)
                    text = f"{parse_reading(*read).value}"
                SpecChoice(None, self._preset, (*given, f"{key}={text}")).spec()
                return (*given, f"{key}={text}"), (*readings, *read)
            except GenProfileError as error:
                say(f"Error: {error}")
        return given, readings

    def require_log(self, swing: str) -> None:
        """Refuse a log that is not there."""
        if swing and not swing.startswith("http:") and not Path(swing).is_file():
            raise OutputError(f"There is no log {swing}; name its file, or a phone's address with http://.")

    def logged(self, path: Path) -> tuple[Path | None, dict[str, str]]:
        """Give the log of a swing, which a phone may write now, and what it is a log of."""
        question = "Log of a free swing: a file, or a phone's address; nothing for none"
        while True:
            swing = self.answer("swing", question, "")
            try:
                self.require_log(swing)
                break
            except OutputError as error:  # of what was asked: of an option it was looked at first
                say(f"Error: {error}")
        if not swing.startswith("http:"):
            return (Path(swing) if swing else None), {}
        log = path.with_name("swing.csv")
        self.call(log_swing, source=swing, out=log, seconds=self._options["seconds"])
        return log, {"columns": "1,2", "signal": self._options["signal"].replace("angle", "rate")}

    def write(self, path: Path, overrides: Words) -> None:
        """Write what was answered into the spec."""
        from gen_profile.spec.reading import parse_spec
        from gen_profile.spec.text import changed_text
        from gen_profile.studies.identification.identify import write_spec

        there = path.exists()
        text, source, folder = SpecChoice(path if there else None, None if there else self._preset, ()).text()
        spec = parse_spec(text, overrides, source, folder)
        write_spec(spec, path, changed_text(text, overrides, spec, spec, folder))

    def files(self) -> list[Path]:
        """List what was delivered, blocks first."""
        from gen_profile.support.artefacts.manifest import FILENAME, parse_manifest

        folder = self._options["folder"]
        manifest = parse_manifest((folder / FILENAME).read_bytes(), FILENAME)
        return sorted((folder / one.path for one in manifest.artefacts), key=lambda one: one.suffix != ".st")
