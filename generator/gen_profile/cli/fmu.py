"""The command that writes FMUs."""

from pathlib import Path

import click

from gen_profile.cli import options
from gen_profile.cli.commands import cli
from gen_profile.cli.options import OutputFile, SpecChoice, option
from gen_profile.cli.outcome import print_outcome
from gen_profile.cli.progress import progress
from gen_profile.delivery.designs.fmu_kinds import KINDS
from gen_profile.support.errors import SpecError

# spelled out here because --help must not wait for CasADi; a test holds them against those of gen_profile_fmu
INPUTS = ("setpoint", "acceleration", "velocity")
PLATFORMS = ("host", "linux-x86_64", "linux-arm64", "windows-x86_64", "macos-x86_64", "macos-arm64", "all")


@cli.command(epilog="Example: gen-profile fmu ssp --preset paper --fmi 3 --out paper.ssp")
@click.argument("kind", type=click.Choice(KINDS))
@options.spec
@option("--fmi", "Version of FMI; 2 by default.", click.Choice(("2", "3")), into="version", default="2")
@option(
    "--input",
    "Input of a plant's drives; setpoint (interpolated positions) by default.",
    click.Choice(INPUTS),
    into="input_name",
)
@option("--platform", "Platform to compile for; this computer by default.", click.Choice(PLATFORMS))
@option("--source-only", "Include no binary, for TwinCAT and real-time targets.")
@option(
    "--out", "FMU or SSP to write; named after the spec in this folder by default.", OutputFile(), into="path"
)
@option("--author NAME", "Author of the model; gen-profile by default.")
@options.output
def fmu(
    kind: str,
    chosen: SpecChoice,
    version: str,
    input_name: str | None,
    platform: str | None,
    source_only: bool,
    path: Path | None,
    author: str | None,
) -> None:
    """Write an FMU of a plant, profile, planner, or a plant with either; or two of them as an SSP."""
    if input_name is not None and kind not in {"plant", "ssp"}:
        raise SpecError(f"--input: the inputs of a {kind} are its own; leave it out, or write a plant.")
    if source_only and platform is not None:
        raise SpecError("--source-only puts no binary in: leave it out, or --platform.")
    spec = chosen.spec()
    from gen_profile.delivery.designs.fmu import export_fmu, platform_names
    from gen_profile_fmu.description.fmu_files import Version
    from gen_profile_fmu.model.contents import AUTHOR
    from gen_profile_fmu.model.plant_variables import InputKind

    platforms = () if source_only else platform_names(platform or "host")
    with progress() as tell:
        made = export_fmu(
            spec,
            kind,
            version=Version(version),
            input_kind=InputKind(input_name or "setpoint"),
            platforms=platforms,
            path=path,
            author=author or AUTHOR,
            progress=tell,
        )
    document = made.to_dict()
    names = [one["name"] + " (not run)" * (not one["runs_here"]) for one in document["platforms"]]
    holds = ", ".join(names) or "sources only"
    text = f"{made.path}: FMI {version}, {holds}, {len(made.content)} bytes"
    print_outcome(document, text)
