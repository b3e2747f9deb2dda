"""The commands. Each imports what it runs once its spec is read: no fault or ``--help`` waits for CasADi."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli import options
from gen_profile.cli.group import DefaultGroup
from gen_profile.cli.options import Count, InputFile, Number, OutputFile, PathType, SpecChoice, option
from gen_profile.cli.outcome import fail, leave_unproved, not_written, print_outcome, print_warnings, warn
from gen_profile.cli.progress import draw, progress
from gen_profile.cli.signing import require_signature, sign, signed_by_option, signing_key, signing_option
from gen_profile.support.errors import CertificateError, OutputError, SpecError
from gen_profile.support.suggestion import suggestion

if TYPE_CHECKING:
    from gen_profile.assurance.certificate.document import Certificate
    from gen_profile.assurance.proof.check import BlockJudgement
    from gen_profile.assurance.verification.check import Judgement
    from gen_profile.delivery.designs.design import Design
    from gen_profile.plants.plant import Plant
    from gen_profile.spec.model import Spec


@click.group(cls=DefaultGroup, epilog="Example: gen-profile crane.toml --export plc --out deploy")
@options.version
def cli() -> None:
    """Design motion profiles that leave no sway, prove them by co-simulation, and export them.

    Without a command: design, export and verify.
    """
    from gen_profile.support.same_bits import choose_common_kernels

    choose_common_kernels()


@cli.command(epilog="Example: gen-profile --preset paper --export plc --export can --out deploy")
@options.spec
@options.export("Format to write (see gen-profile formats)")
@options.folder
@option("--cycle-time SECONDS", "Cycle of the controller, and SYNC period of the bus.")
@option("--plc-layout LAYOUT", "Table of a PLC block: segments, samples or counts.")
@option("--csv-dialect NAME", "rfc4180, excel-de, sew, kollmorgen or lenze.")
@option("--csv-columns NAME,…", "Of position, velocity, acceleration, jerk; all by default.")
@option("--method NAME", "Solver (auto, indirect or direct), or a shaper such as zvd.")
@option("--no-check", "Skip the co-simulation; the manifest then says unverified.")
@option("--keep-failed", "Write the artefacts even where the check fails.")
@options.certify
@options.plot
@signing_option("manifest")
@options.output
def design(
    chosen: SpecChoice,
    formats: tuple[str, ...],
    folder: Path,
    *,
    method: str | None,
    no_check: bool,
    keep_failed: bool,
    certify: bool,
    picture: Path | None,
    key_path: Path | None,
    **export: str | None,
) -> None:
    """Design, export and verify (the default)."""
    if certify and no_check:
        raise SpecError("--certify: proves what the check has passed; leave --no-check out.")
    stated: dict[str, object] = {f"export.{key}": value for key, value in export.items()}
    if (columns := export["csv_columns"]) is not None:
        stated["export.csv_columns"] = [name.strip() for name in columns.split(",")]
    stated |= {"can.sync_period": export["cycle_time"], "solver.method": method}
    spec = chosen.changed(stated).spec()
    options.require_formats(formats)
    key = signing_key(key_path)
    from gen_profile.cli import words
    from gen_profile.delivery.designs.design import design as run

    with progress() as tell:
        outcome = run(spec, formats, folder, check=not no_check, keep_failed=keep_failed, progress=tell)
        draw(outcome, picture, tell)
    if outcome.passed:
        sign(folder, key)
    certificates, refusals = _certificates(outcome) if certify and outcome.passed else ({}, [])
    worst = max(certificates.values(), key=lambda certificate: certificate.demand, default=None)
    document = outcome.to_dict() | {"certificate": worst and worst.to_dict()}
    print_outcome(document, words.design(outcome, certificates))
    warn(outcome.check)
    print_warnings(words.alone(outcome))
    if spec.move.shortest:
        print_warnings(words.abrupt(outcome))
    if not outcome.passed:
        fail(outcome.reasons(), "The files were kept." if outcome.artefacts else not_written(folder))
    if refusals:
        leave_unproved(refusals)


def _certificates(outcome: Design) -> tuple[dict[Path, Certificate], list[str]]:
    """Prove the first file of each format, which is the one that holds the motion; say what is not proved."""
    firsts = {artefact.format: artefact.path for artefact in reversed(outcome.artefacts)}
    certificates: dict[Path, Certificate] = {}
    reasons: dict[str, None] = {}  # each once, in order
    for name in reversed(firsts.values()):
        path = outcome.folder / name
        try:
            certificates[path] = _certified(path, outcome.spec)
        except CertificateError as error:
            reasons[str(error)] = None
        else:
            reasons |= dict.fromkeys(certificates[path].reasons())
    return certificates, list(reasons)


@cli.command(epilog="Example: gen-profile compare --preset paper --plot comparison.png")
@options.spec
@options.plot
@option("--all", "Draw all methods, not only the most instructive ones.", into="every")
@option(
    "--base",
    "Move that the shapers filter, in place of solver.base; jerk-limited needs limits.jerk.",
    click.Choice(["quintic", "septic", "jerk-limited"]),
)
@options.output
def compare(chosen: SpecChoice, picture: Path | None, every: bool, base: str | None) -> None:
    """Compare optimal profiles with shapers."""
    spec = chosen.changed({"solver.base": base}).spec()
    from gen_profile.cli import words
    from gen_profile.studies.comparison.compare import compare as run

    with progress() as tell:
        comparison = run(spec, tell)
        draw(comparison, picture, tell, every=every)
    print_outcome(comparison.to_dict(), words.comparison(comparison))


@cli.command(epilog="Example: gen-profile robustness crane.toml --parameter L1 --plot robustness.png")
@options.spec
@option(
    "--parameter NAME",
    "Parameter that deviates: once for a curve, twice for a map; the first uncertain parameter by default.",
    into="parameters",
    multiple=True,
)
@option(
    "--method NAME",
    "Method to try, as compare names them. Repeatable; all by default.",
    into="methods",
    multiple=True,
)
@option(
    "--range SHARE",
    "Greatest relative error, such as 0.3; one and a half times the spec's range by default.",
    Number(0.0, 0.9, min_open=True),
    into="half_range",
)
@option("--points", "Errors to try per parameter; 61 for a curve, 25 for a map by default.", Count(3, 1001))
@options.plot
@option("--csv", "Write the numbers as a table.", OutputFile(), into="path")
@options.output
def robustness(chosen: SpecChoice, *, picture: Path | None, path: Path | None, **given: Any) -> None:
    """Show residual sway over one or two parameters, optimal motions beside shapers."""
    spec = chosen.spec()
    from gen_profile.cli import words
    from gen_profile.studies.comparison.robustness import robustness as run
    from gen_profile.support.artefacts.writing import deliver

    with progress() as tell:
        curves = run(spec, **given, progress=tell)
        draw(curves, picture, tell)
        if path is not None:
            deliver(path, curves.table().encode("utf-8"))
    print_outcome(curves.to_dict(), words.robustness(curves))


@cli.command(epilog="Example: gen-profile check deploy/paper.st")
@click.argument("artefact", type=PathType())
@options.spec
@option("--samples", "Draw N random machines, in place of check.samples.", Count(0, 1_000_000))
@option("--scenario N", "Try only the scenario of this number (row).", int)
@option("--strict", "Let timing faults of setpoints count as well.")
@options.repeatable(
    "--scale AXIS=FACTOR", "Judge the motion scaled along an axis, as a playback block plays it."
)
@options.repeatable("--mirror AXIS", "Judge the motion mirrored along an axis.")
@options.repeatable("--offset AXIS=DISTANCE", "Judge the motion shifted along an axis, in m or rad.")
@option("--csv", "Write all scenarios as a table, one row each.", OutputFile(), into="table_path")
@options.certify
@option("--certificate", "Check a certificate again, and nothing else.", InputFile())
@options.histories("Prove a planner block on N histories of commands.")
@option("--history N", "Run only this history of a planner block's proof.", int)
@options.scheduler("run a planner block's histories")
@options.block_plot
@signed_by_option
@options.output
def check(artefact: Path, chosen: SpecChoice, *, public_path: Path | None, **given: Any) -> None:
    """Replay, co-simulate and judge an artefact.

    The spec comes from the manifest beside the artefact unless one is named.
    """
    if chosen.overrides and not chosen.stated:
        raise SpecError("--set: changes a spec that is named; the manifest's own stays as it is.")
    require_signature(artefact, public_path)
    spec = chosen.spec() if chosen.stated else None
    from gen_profile.assurance.proof.check import is_planner_block
    from gen_profile.cli import words

    judgement: Judgement | BlockJudgement
    unproved: Sequence[str] = ()
    if given["certificate"] is not None:
        _require_only(given, ("certificate",), "a check by co-simulation, without --certificate")
        _repeat_proof(artefact, spec, given["certificate"])
        return
    if is_planner_block(artefact):
        _require_only(given, BLOCK_OPTIONS, "a motion, and this is a planner block")
        judgement = _check_block(artefact, spec, **{name: given[name] for name in BLOCK_OPTIONS})
        text, document = words.block_judgement(judgement), judgement.to_dict()
    else:
        _require_only(given, (*MOTION_OPTIONS, "certify"), "a planner block, and this is none")
        judgement = _check_motion(artefact, spec, **{name: given[name] for name in MOTION_OPTIONS})
        if given["certify"] and judgement.variant is not None:
            raise SpecError(
                "--certify: is for the motion as planned, without --scale, --mirror and --offset."
            )
        certify = given["certify"] and judgement.check.passed
        certificate = _certified(judgement.path, spec) if certify else None
        text, document = words.judgement(judgement, certificate), judgement.to_dict()
        document["certificate"] = certificate and certificate.to_dict()
        unproved = certificate.reasons() if certificate else ()
    print_outcome(document, text)
    warn(judgement.check)
    if not judgement.check.passed:
        fail(judgement.check.reasons(), "Do not deploy it.")
    if unproved:
        leave_unproved(unproved)


MOTION_OPTIONS = ("samples", "scenario", "strict", "scale", "mirror", "offset", "table_path")
BLOCK_OPTIONS = ("histories", "history", "scheduler", "picture")


def _require_only(given: Mapping[str, Any], known: Sequence[str], other: str) -> None:
    """Refuse options that mean nothing here."""
    for name, value in given.items():
        if name not in known and value not in (None, False, ()):
            option = {"table_path": "csv", "picture": "plot"}.get(name, name)
            raise SpecError(f"--{option}: is for {other}.")


def _check_motion(
    artefact: Path, spec: Spec | None, *, scenario: int | None, table_path: Path | None, **given: Any
) -> Judgement:
    from gen_profile.assurance.verification.check import check_artefact, scenario_table
    from gen_profile.support.artefacts.writing import deliver

    with progress() as tell:
        tell("checking by co-simulation")
        judgement = check_artefact(artefact, spec, row=scenario, progress=tell, **given)
    if table_path is not None:
        deliver(table_path, scenario_table(judgement).encode("utf-8"))
    return judgement


def _certified(path: Path, spec: Spec | None) -> Certificate:
    from gen_profile.assurance.certificate.from_file import certify_artefact

    with progress() as tell:
        certificate = certify_artefact(path, spec, progress=partial(tell, "proving it for boxes of machines"))
    print_warnings(certificate.warnings())
    return certificate


def _repeat_proof(artefact: Path, spec: Spec | None, certificate: Path) -> None:
    from gen_profile.assurance.certificate.from_file import check_certificate
    from gen_profile.cli import words

    with progress() as tell:
        stage = "proving it again for boxes of machines"
        proved = check_certificate(artefact, certificate, spec, progress=partial(tell, stage))
    print_outcome({"certificate": proved.to_dict()}, words.certificate(artefact, proved))


def _check_block(artefact: Path, spec: Spec | None, *, picture: Path | None, **given: Any) -> BlockJudgement:
    from gen_profile.assurance.proof.check import check_block

    with progress() as tell:
        judgement = check_block(artefact, spec, **given, progress=tell)
        if picture is not None:
            from gen_profile.presentation.charts.proof import draw

            draw(judgement.spec, judgement.text, judgement.check, picture, tell)
    return judgement


@cli.command(epilog="Example: gen-profile formats")
@options.output
def formats() -> None:
    """List the export formats."""
    from gen_profile_exporters.registry import formats as known

    rows = {name: f"{form.summary} ({form.suffix}; {form.proof})" for name, form in known().items()}
    document = {name: form._asdict() for name, form in known().items()}
    print_outcome({"formats": document}, _definitions(rows))


@cli.command(epilog="Example: gen-profile plants gantry-crane --plot crane.png")
@click.argument("name", metavar="[NAME]", required=False)
@options.plot
@options.output
def plants(name: str | None, picture: Path | None) -> None:
    """List the machines with their axes, loads and parameters, or a single one."""
    from gen_profile.plants.registry import find_plant, plant_types

    if name is None and picture is not None:
        raise SpecError("--plot: name the machine to draw, as gen-profile plants gantry-crane does.")
    try:
        known = [find_plant(type_) for type_ in ([name] if name else plant_types())]
    except KeyError as error:
        hint = suggestion(str(name), plant_types())
        raise SpecError(f"plants {str(name)[:60]}: unknown machine{hint}") from error
    if picture is not None:
        from gen_profile.presentation.charts.machine import draw_machine

        (plant,) = known
        draw_machine(plant, plant.nominal(), picture, f"{plant.type}: {plant.summary}")
    document = {plant.type: _plant_document(plant) for plant in known}
    print_outcome({"plants": document}, "\n\n".join(map(_plant_words, known)))


def _plant_document(plant: Plant) -> dict[str, Any]:
    return {
        "summary": plant.summary,
        "axes": {axis.name: axis.unit for axis in plant.actuated},
        "swinging": {coordinate.name: coordinate.unit for coordinate in plant.unactuated},
        "loads": list(plant.loads),
        "parameters": {
            q.name: {"unit": q.unit, "nominal": q.nominal, "lower": q.lower, "upper": q.upper}
            for q in plant.parameters
        },
    }


def _plant_words(plant: Plant) -> str:
    values = {
        q.name: f"{q.description}, {q.nominal:g} {q.unit} ({q.lower:g} to {q.upper:g})"
        for q in plant.parameters
    }
    named = {
        "axes": ", ".join(f"{axis.name} ({axis.unit})" for axis in plant.actuated),
        "swinging": ", ".join(f"{coordinate.name} ({coordinate.unit})" for coordinate in plant.unactuated),
        "loads": ", ".join(plant.loads),
    }
    names = "".join(f"  {kind}: {listed}\n" for kind, listed in named.items())
    return f"{plant.type}: {plant.summary}\n{names}{_definitions(values)}"


@cli.command(epilog="Example: gen-profile presets double-pendulum-crane --out bay-4.toml")
@click.argument("name", metavar="[NAME]", required=False, shell_complete=options.complete_presets)
@option("--out", "Write it to a new file, in place of stdout.", OutputFile(), into="path")
@options.output
def presets(name: str | None, path: Path | None) -> None:
    """List the built-in specs, or print one to begin your own with."""
    from gen_profile.spec.reading import preset_text
    from gen_profile.spec.reading import presets as known

    if name is None:
        if path is not None:
            raise SpecError("--out: name the preset to write, as gen-profile presets paper does.")
        print_outcome({"presets": known()}, _definitions(known()))
        return
    text = words = preset_text(name)
    if path is not None:
        from shlex import quote

        from gen_profile.support.artefacts.writing import deliver

        if path.exists():
            raise OutputError(f"Cannot write {path}: it exists already; choose another name.")
        deliver(path, text.encode("utf-8"))
        words = f"{path} is a copy of the preset {name}. Change it, then: gen-profile {quote(str(path))}"
    print_outcome({"preset": name, "toml": text}, words.rstrip("\n"))


def _definitions(rows: dict[str, str]) -> str:
    formatter = click.HelpFormatter(width=110)
    formatter.indent()
    formatter.write_dl(list(rows.items()))
    return formatter.getvalue().rstrip("\n")
