"""Judging an artefact that lies on disk, whatever wrote it, as planned or smaller, mirrored or elsewhere."""

import csv
import math
from collections.abc import Sequence
from io import StringIO
from itertools import chain
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from gen_profile.assurance.verification.cosimulation import cosimulate
from gen_profile.assurance.verification.judging import verdict
from gen_profile.assurance.verification.origin import JudgedFile, origin_of, spec_and_manifest
from gen_profile.assurance.verification.plausibility import implausibilities
from gen_profile.assurance.verification.setpoint_path import lag_of, path_taken
from gen_profile.assurance.verification.time_scales import sample_spacing
from gen_profile.assurance.verification.verdict import Check
from gen_profile.assurance.verification.worst_machines import worst_machines
from gen_profile.dynamics.evaluation.scenarios import Scenario, further_scenarios, scenarios
from gen_profile.dynamics.evaluation.simulation import Response, Sway
from gen_profile.motion.profile import SampledProfile, columns_of
from gen_profile.spec.model import Spec
from gen_profile.spec.values import require_whole
from gen_profile.support.artefacts.reading import read_motion
from gen_profile.support.errors import CosimulationError, ExportError, OutputError, SpecError
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.suggestion import finite_number, number_meant, suggestion
from gen_profile.support.summary import Drawable
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.registry import find_exporter, format_of


def varied(
    spec: Spec, setpoints: SampledProfile, scale: Sequence[str], mirror: Sequence[str], offset: Sequence[str]
) -> tuple[Spec, SampledProfile, str | None]:
    """Change a motion, and the move that it is judged by, and say how in words; None where nothing is asked.

    Parameters
    ----------
    spec : Spec
    setpoints : SampledProfile
    scale : sequence of str
        Factors of the distance, 0 to 1, as ``AXIS=FACTOR``; a machine of one axis needs no name.
    mirror : sequence of str
        Axes that go the other way.
    offset : sequence of str
        Where they begin, in m (or rad) from the start as planned, as ``AXIS=DISTANCE``.

    Raises
    ------
    SpecError
    """
    axes = list(spec.axis)
    factors = dict(_entry("scale", text, axes) for text in scale)
    for name, value in factors.items():
        if not 0.0 <= value <= 1.0:
            raise SpecError(f"scale {name}={value:g}: a playback block takes 0 to 1.")
    mirrored = [_axis("mirror", name, axes) for name in mirror]
    offsets = dict(_entry("offset", text, axes) for text in offset)
    words = [f"{name} {value:g} times as far" for name, value in factors.items()]
    words += [f"{name} the other way" for name in mirrored]
    words += [f"{name} begins {value:+g} from its start" for name, value in offsets.items()]
    if not words:
        return spec, setpoints, None
    start, signs = np.array(spec.move.start), dict.fromkeys(mirrored, -1.0)
    gain = np.array([signs.get(name, 1.0) * factors.get(name, 1.0) for name in axes])
    shift = np.array([offsets.get(name, 0.0) for name in axes])
    move = attrs.evolve(
        spec.move,
        start=tuple((start + shift).tolist()),
        target=tuple((start + shift + gain * np.array(spec.move.distance)).tolist()),
        final_velocity=tuple((gain * np.array(spec.move.final_velocity)).tolist()),
    )
    columns: dict[str, Any] = {name: values * gain for name, values in columns_of(setpoints).items()}
    columns["position"] = start + shift + gain * (setpoints.position - start)
    return attrs.evolve(spec, move=move), attrs.evolve(setpoints, **columns), ", ".join(words)


def _entry(option: str, text: str, axes: Sequence[str]) -> tuple[str, float]:
    name, equals, number = text.rpartition("=")
    if not equals and len(axes) > 1:
        raise SpecError(f"{option} {text}: say of which axis, as {axes[0]}={text} ({', '.join(axes)}).")
    value = finite_number(number)
    if math.isnan(value):
        raise SpecError(f"{option} {text}: {number!r} is no number{number_meant(number)}.")
    return _axis(option, name, axes) if equals else axes[0], value


def _axis(option: str, name: str, axes: Sequence[str]) -> str:
    if name not in axes:
        raise SpecError(f"{option}: the machine has no axis {name!r}{suggestion(name, axes)}")
    return name


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Judgement(Drawable, JudgedFile):
    """A check of one file, and what its manifest says about it.

    Attributes
    ----------
    format : str
    check : Check
    variant : str or None
        What was changed of the motion, in words.
    """

    format: str
    check: Check
    variant: str | None = None

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {"file": self.path, "format": self.format, "manifest": self.manifest, **self.check.summary()}

    @property
    def passed(self) -> bool:
        """Whether every load keeps its limit in every scenario, and nothing else is wrong."""
        return self.check.passed

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {**self.identity(self.format), "variant": self.variant, "check": self.check.to_dict()}


def check_artefact(
    path: Path,
    spec: Spec | None = None,
    *,
    samples: int | None = None,
    row: int | None = None,
    strict: bool = False,
    scale: Sequence[str] = (),
    mirror: Sequence[str] = (),
    offset: Sequence[str] = (),
    progress: Progress = no_progress,
) -> Judgement:
    """Replay a file, co-simulate it, and compare it with its manifest.

    The spec is the manifest's where none is given; a variant of the motion is one as `varied` makes it.

    Raises
    ------
    OutputError
        The file cannot be read, or there is no spec.
    SpecError
        There is no such scenario or axis.
    ExportError
        The file is damaged.
    CosimulationError
    """
    content, format_ = read_motion(path), format_of(path)
    origin = origin_of(path, content, spec)
    spec = origin.spec
    setpoints = find_exporter(format_).replay(content, target_of(spec))
    if samples is not None:
        spec = attrs.evolve(spec, check=attrs.evolve(spec.check, samples=samples))
    asked, played, variant = varied(spec, setpoints, scale, mirror, offset)
    try:
        rows, searched = _rows(asked, played, row, progress)
        check = _verdict(asked, played, rows, progress)
    except CosimulationError as error:  # as of setpoints that no machine can follow
        raise CosimulationError(" ".join([str(error), *implausibilities(asked, played)])) from error
    check = attrs.evolve(check, strict=strict, faults=(*check.faults, *origin.faults), searched=searched)
    return Judgement(
        path=path,
        format=format_,
        spec=spec,
        check=check,
        manifest=origin.agreement,
        companions=origin.companions,
        variant=variant,
    )


def scenario_table(judgement: Judgement) -> str:
    """Write a row per scenario as CSV, numbers as exactly as they were calculated.

    Columns are the scenario's number, group and name; the machine's parameters (``plant.L1`` …) and the path
    of its setpoints (``path.lag`` …), in the spec's units; the residual sway of every load in m, the bound of
    its error in m, and whether the limits are kept: ``passed`` or ``failed``.
    """
    spec, check = judgement.spec, judgement.check
    rows: list[dict[str, object]] = []
    for finding in chain(*check.groups.values()):
        scenario = finding.scenario
        path = attrs.asdict(path_taken(spec, scenario)) | {"lag": lag_of(spec, scenario)}
        rows.append(
            {
                **{"row": scenario.row, "group": scenario.group, "name": scenario.name},
                **{f"plant.{name}": scenario.parameters[name] for name in spec.plant.parameters},
                **{f"path.{name}": value for name, value in path.items()},
                **{f"{load}_m": finding.residual[load] for load in check.limit},
                "error_bound_m": check.error_bound,
                "verdict": "passed" if check.keeps_limit(finding) else "failed",
            }
        )
    text = StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def replayed(path: Path, spec: Spec) -> SampledProfile:
    """Replay a file as the controller does, by the spec beside it, or by another one of this machine.

    Raises
    ------
    OutputError, ExportError
        It cannot be read.
    SpecError
        It moves other axes than the spec's machine.
    """
    content, exporter = read_motion(path), find_exporter(format_of(path))
    try:
        own, *_ = spec_and_manifest(path, content, None)
    except OutputError:
        own = spec
    try:
        setpoints = exporter.replay(content, target_of(own))
    except ExportError as error:
        raise ExportError(f"{path}: {error}") from error
    if setpoints.position.shape[1] != len(spec.machine().actuated):
        raise SpecError(
            f"{path} moves {setpoints.position.shape[1]} axes, and the spec's machine has others."
        )
    return setpoints


def _rows(
    spec: Spec, setpoints: SampledProfile, row: int | None, progress: Progress
) -> tuple[tuple[Scenario, ...], int]:
    """List all scenarios, or the one of a number, and say how many machines were looked at for the worst."""
    if row is not None:
        require_whole(row, 0, "scenario")
    machines = scenarios(spec)
    rows = (*machines, *further_scenarios(spec, machines))
    if row is not None and 0 <= row < len(rows):
        return (rows[row],), 0
    worst, tried = worst_machines(spec, setpoints, rows, progress)
    rows = (*rows, *worst)
    if row is None:
        return rows, tried
    if not 0 <= row < len(rows):
        raise SpecError(f"scenario {row}: the scenarios of this spec are numbered from 0 to {len(rows) - 1}.")
    return (rows[row],), tried


def _verdict(spec: Spec, setpoints: SampledProfile, rows: Sequence[Scenario], progress: Progress) -> Check:
    """Judge setpoints by themselves.

    Holding velocity over a cycle errs with the cycle's square, so setpoints of twice the cycle tell how much.
    """
    followed = _of_even_cycles(setpoints, spec)
    # every second setpoint, the first and the last among them
    coarser = attrs.evolve(followed, cycle_time=2.0 * followed.cycle_time, position=followed.position[::2])

    def half_as_often(machines: Sequence[Scenario], _: Sequence[Response]) -> Sequence[Sway]:
        spacing = sample_spacing(spec, setpoints)
        return cosimulate(spec, coarser, machines, output_step=spacing, by_fmpy=False)

    resolution = float(setpoints.resolution.max())
    return verdict(
        spec, setpoints, rows, half_as_often, followed=followed, resolution=resolution, progress=progress
    )


def _of_even_cycles(setpoints: SampledProfile, spec: Spec) -> SampledProfile:
    """Go on for one more cycle where their number is odd, as the axes do anyway after the last setpoint."""
    position = setpoints.position
    if len(position) % 2 == 0:
        onward = position[-1:] + setpoints.cycle_time * np.array(spec.move.final_velocity)
        position = np.concatenate([position, onward])
    return SampledProfile(cycle_time=setpoints.cycle_time, position=position, resolution=setpoints.resolution)
