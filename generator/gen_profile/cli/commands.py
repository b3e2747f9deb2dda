"""The commands. Each imports what it runs once its spec is read: no fault or ``--help`` waits for CasADi."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli.group import DefaultGroup
from gen_profile.cli.options import (
    OutputFile,
    as_overrides,
    block_plot_option,
    chosen_spec,
    complete_presets,
    debug_option,
    export_option,
    json_option,
    plot_option,
    require_formats,
    spec_options,
)
from gen_profile.cli.outcome import fail, print_outcome, warn
from gen_profile.errors import OutputError, SpecError

if TYPE_CHECKING:
    from gen_profile.proof.check import BlockJudgement
    from gen_profile.spec.model import Spec
    from gen_profile.verification.check import Judgement


@click.group(cls=DefaultGroup, epilog="Example: gen-profile crane.toml --export plc --out deploy")
@click.version_option(package_name="gen-profile", message="%(version)s")
def cli() -> None:
    """Design motion profiles that leave no sway, prove them by co-simulation, and export them.

    Without a command: design, export and verify.
    """


@cli.command(epilog="Example: gen-profile --preset paper --export plc --export can --out deploy")
@spec_options
@export_option("Format to write")
@click.option(
    "--out",
    "folder",
    metavar="DIR",
    type=click.Path(path_type=Path),
    default=Path("gen-profile-out"),
    help="Folder to write to; ./gen-profile-out by default.",
)
@click.option("--cycle-time", metavar="SECONDS", help="Cycle of the controller, and SYNC period of the bus.")
@click.option("--plc-layout", metavar="LAYOUT", help="Table of a PLC block: segments, samples or counts.")
@click.option("--csv-dialect", metavar="NAME", help="rfc4180, excel-de, sew, kollmorgen or lenze.")
@click.option(
    "--csv-columns", metavar="NAME,…", help="Of position, velocity, acceleration, jerk; all by default."
)
@click.option("--method", metavar="NAME", help="Solver (auto, indirect or direct), or a shaper such as zvd.")
@click.option("--no-check", is_flag=True, help="Skip the co-simulation; the manifest then says unverified.")
@click.option("--keep-failed", is_flag=True, help="Write the artefacts even where the check fails.")
@json_option
@debug_option
def design(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    formats: tuple[str, ...],
    folder: Path,
    cycle_time: str | None,
    plc_layout: str | None,
    csv_dialect: str | None,
    csv_columns: str | None,
    method: str | None,
    no_check: bool,
    keep_failed: bool,
    as_json: bool,
) -> None:
    """Design, export and verify (the default)."""
    columns = None if csv_columns is None else [name.strip() for name in csv_columns.split(",")]
    overrides += as_overrides(
        {
            "export.cycle_time": cycle_time,
            "can.sync_period": cycle_time,
            "export.plc_layout": plc_layout,
            "export.csv_dialect": csv_dialect,
            "export.csv_columns": columns,
            "solver.method": method,
        }
    )
    spec = chosen_spec(spec_path, preset, overrides)
    require_formats(formats)
    from gen_profile.artefacts.manifest import FILENAME
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.designs.design import design as run

    with progress() as tell:
        outcome = run(spec, formats, folder, check=not no_check, keep_failed=keep_failed, progress=tell)
    print_outcome(outcome.to_dict(), words.design(outcome), as_json)
    warn(outcome.check)
    if not outcome.passed and outcome.check is not None:
        before = f"; {folder} still holds what an earlier run wrote" if (folder / FILENAME).exists() else ""
        kept = "The files were kept." if outcome.artefacts else f"Nothing was written{before}."
        fail(outcome.check.reasons(), kept)


@cli.command(epilog="Example: gen-profile compare --preset paper --plot comparison.png")
@spec_options
@plot_option
@click.option(
    "--base",
    type=click.Choice(["quintic", "septic", "jerk-limited"]),
    help="What the shapers are fed with, in place of solver.base; jerk-limited needs limits.jerk.",
)
@json_option
@debug_option
def compare(
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    picture: Path | None,
    base: str | None,
    as_json: bool,
) -> None:
    """Compare optimal profiles with shapers."""
    spec = chosen_spec(spec_path, preset, overrides + as_overrides({"solver.base": base}))
    from gen_profile.cli import words
    from gen_profile.cli.progress import progress
    from gen_profile.comparison.compare import compare as run

    if picture is not None:
        from gen_profile.charts.picture import require_drawable
        from gen_profile.charts.plot import plot

        require_drawable(picture)
    with progress() as tell:
        comparison = run(spec, tell)
        if picture is not None:
            tell("drawing")
            plot(comparison, picture)
    print_outcome(comparison.to_dict(), words.comparison(comparison), as_json)


@cli.command(epilog="Example: gen-profile check deploy/paper.st")
@click.argument("artefact", type=click.Path(path_type=Path))
@spec_options
@click.option(
    "--samples",
    metavar="N",
    type=click.IntRange(0, 1_000_000),
    help="Draw N machines, in place of check.samples.",
)
@click.option("--scenario", metavar="N", type=int, help="Try only the scenario of this number (row).")
@click.option("--strict", is_flag=True, help="Let faults in the timing of setpoints count as well.")
@click.option(
    "--scale",
    metavar="AXIS=FACTOR",
    multiple=True,
    help="Judge the motion smaller along an axis, as a playback block plays it. Repeatable.",
)
@click.option(
    "--mirror",
    metavar="AXIS",
    multiple=True,
    help="Judge the motion the other way along an axis. Repeatable.",
)
@click.option(
    "--offset",
    metavar="AXIS=DISTANCE",
    multiple=True,
    help="Judge the motion begun elsewhere along an axis, in m or rad. Repeatable.",
)
@click.option(
    "--csv",
    "table_path",
    metavar="FILE",
    type=OutputFile(),
    help="Write all scenarios as a table, one row each.",
)
@click.option(
    "--histories",
    metavar="N",
    type=click.IntRange(1, 1_000_000),
    help="Prove a planner block on N histories of commands.",
)
@click.option("--history", metavar="N", type=int, help="Run only this history of a planner block's proof.")
@block_plot_option
@json_option
@debug_option
def check(
    artefact: Path,
    spec_path: Path | None,
    preset: str | None,
    overrides: tuple[str, ...],
    *,
    as_json: bool,
    **options: Any,
) -> None:
    """Replay, co-simulate and judge an artefact.

    The spec comes from the manifest beside the artefact unless one is named.
    """
    given = spec_path is not None or preset is not None
    if overrides and not given:
        raise SpecError("--set: changes a spec that is named; the manifest's own stays as it is.")
    spec = chosen_spec(spec_path, preset, overrides) if given else None
    from gen_profile.cli import words
    from gen_profile.proof.check import is_planner_block

    judgement: Judgement | BlockJudgement
    if is_planner_block(artefact):
        _require_only(options, BLOCK_OPTIONS, "a motion, and this is a planner block")
        judgement = _check_block(artefact, spec, **{name: options[name] for name in BLOCK_OPTIONS})
        text = words.block_judgement(judgement)
    else:
        _require_only(options, MOTION_OPTIONS, "a planner block, and this is none")
        judgement = _check_motion(artefact, spec, **{name: options[name] for name in MOTION_OPTIONS})
        text = words.judgement(judgement)
    print_outcome(judgement.to_dict(), text, as_json)
    warn(judgement.check)
    if not judgement.check.passed:
        fail(judgement.check.reasons(), "Do not deploy it.")


MOTION_OPTIONS = ("samples", "scenario", "strict", "scale", "mirror", "offset", "table_path")
BLOCK_OPTIONS = ("histories", "history", "picture")


def _require_only(options: Mapping[str, Any], known: Sequence[str], other: str) -> None:
    """Refuse options that mean nothing here."""
    for name, value in options.items():
        if name not in known and value not in (None, False, ()):
            option = {"table_path": "csv", "picture": "plot"}.get(name, name)
            raise SpecError(f"--{option}: is for {other}.")


def _check_motion(
    artefact: Path, spec: Spec | None, *, scenario: int | None, table_path: Path | None, **options: Any
) -> Judgement:
    from gen_profile.artefacts.writing import deliver, require_place
    from gen_profile.cli.progress import progress
    from gen_profile.verification.check import check_artefact
    from gen_profile.verification.scenario_table import table

    if table_path is not None:
        require_place(table_path)
    with progress() as tell:
        tell("checking by co-simulation")
        judgement = check_artefact(
            artefact,
            spec,
            lambda: tell("compiling the plant's FMU, once"),
            row=scenario,
            progress=lambda done, total: tell("checking by co-simulation", done, total),
            **options,
        )
    if table_path is not None:
        deliver(table_path, table(judgement.spec, judgement.check).encode("utf-8"))
    return judgement


def _check_block(
    artefact: Path, spec: Spec | None, *, histories: int | None, history: int | None, picture: Path | None
) -> BlockJudgement:
    from gen_profile.cli.progress import progress
    from gen_profile.proof.check import check_block

    if picture is not None:
        from gen_profile.charts.picture import require_drawable
        from gen_profile.charts.proof import draw

        require_drawable(picture)
    with progress() as tell:
        judgement = check_block(artefact, spec, histories=histories, history=history, progress=tell)
        if picture is not None:
            draw(judgement.spec, judgement.text, judgement.check, picture, tell)
    return judgement


@cli.command(epilog="Example: gen-profile formats")
@json_option
@debug_option
def formats(as_json: bool) -> None:
    """List the export formats."""
    from gen_profile_exporters.registry import formats as known

    rows = {name: f"{form.summary} ({form.suffix}; {form.proof})" for name, form in known().items()}
    print_outcome(
        {"formats": {name: form._asdict() for name, form in known().items()}}, _definitions(rows), as_json
    )


@cli.command(epilog="Example: gen-profile plants")
@json_option
@debug_option
def plants(as_json: bool) -> None:
    """List the machines with their axes, loads and parameters."""
    from gen_profile.plants.registry import find_plant, plant_types

    document, blocks = {}, []
    for type_ in plant_types():
        plant = find_plant(type_)
        document[type_] = {
            "summary": plant.summary,
            "axes": {axis.name: axis.unit for axis in plant.actuated},
            "swinging": {free.name: free.unit for free in plant.unactuated},
            "loads": list(plant.loads),
            "parameters": {
                q.name: {"unit": q.unit, "nominal": q.nominal, "lower": q.lower, "upper": q.upper}
                for q in plant.parameters
            },
        }
        values = {
            q.name: f"{q.description}, {q.nominal:g} {q.unit} ({q.lower:g} to {q.upper:g})"
            for q in plant.parameters
        }
        named = {
            "axes": ", ".join(f"{axis.name} ({axis.unit})" for axis in plant.actuated),
            "swinging": ", ".join(f"{free.name} ({free.unit})" for free in plant.unactuated),
            "loads": ", ".join(plant.loads),
        }
        names = "".join(f"  {kind}: {listed}\n" for kind, listed in named.items())
        blocks.append(f"{type_}: {plant.summary}\n{names}{_definitions(values)}")
    print_outcome({"plants": document}, "\n\n".join(blocks), as_json)


@cli.command(epilog="Example: gen-profile presets double-pendulum-crane --out bay-4.toml")
@click.argument("name", metavar="[NAME]", required=False, shell_complete=complete_presets)
@click.option(
    "--out",
    "path",
    metavar="FILE",
    type=OutputFile(),
    help="Write it to a new file, in place of stdout.",
)
@json_option
@debug_option
def presets(name: str | None, path: Path | None, as_json: bool) -> None:
    """List the built-in specs, or print one to begin your own with."""
    from gen_profile.spec.reading import preset_text
    from gen_profile.spec.reading import presets as known

    if name is None:
        if path is not None:
            raise SpecError("--out: name the preset to write, as gen-profile presets paper does.")
        print_outcome({"presets": known()}, _definitions(known()), as_json)
        return
    text = words = preset_text(name)
    if path is not None:
        _write_new(path, text)
        words = f"{path} is a copy of the preset {name}. Change it, then: gen-profile {path}"
    print_outcome({"preset": name, "toml": text}, words.rstrip("\n"), as_json)


def _write_new(path: Path, text: str) -> None:
    from gen_profile.artefacts.writing import deliver

    if path.exists():
        raise OutputError(f"Cannot write {path}: it exists already; choose another name.")
    deliver(path, text.encode("utf-8"))


def _definitions(rows: dict[str, str]) -> str:
    formatter = click.HelpFormatter(width=110)
    formatter.indent()
    formatter.write_dl(list(rows.items()))
    return formatter.getvalue().rstrip("\n")
