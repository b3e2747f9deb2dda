"""A result as a picture, whichever result it is, in a file or in a notebook."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

import attrs
import numpy as np

from gen_profile.assurance.verification.check import Judgement
from gen_profile.assurance.verification.verdict import Check
from gen_profile.delivery.designs.design import Design
from gen_profile.delivery.designs.planner import Deployment
from gen_profile.dynamics.evaluation.phrases import number
from gen_profile.methods.solvers.draft import Plan
from gen_profile.motion.profile import Profile
from gen_profile.presentation.charts.comparison import comparison_figure
from gen_profile.presentation.charts.curves import (
    motion_figure,
    profile_figure,
    select_machines,
    sway_figure,
)
from gen_profile.presentation.charts.figure import PLAIN, Bars, Figure
from gen_profile.presentation.charts.identification import (
    identification_figure,
    log_figure,
    table_figure,
)
from gen_profile.presentation.charts.machine import draw_machine
from gen_profile.presentation.charts.picture import require_drawable, save
from gen_profile.presentation.charts.proof import draw
from gen_profile.presentation.charts.robustness import robustness_figure
from gen_profile.presentation.charts.side_view import path_figure
from gen_profile.spec.model import Spec
from gen_profile.studies.comparison.compare import Comparison
from gen_profile.studies.comparison.robustness import Robustness
from gen_profile.studies.identification.identify import Identification
from gen_profile.studies.identification.log_table import LogTable
from gen_profile.studies.identification.measurements import SwingLog
from gen_profile.support.errors import OutputError, SpecError
from gen_profile.support.suggestion import found

MOST_BARS = 12  # machines of a check


@attrs.frozen
class Picture:
    """A picture that a notebook shows."""

    svg: str = attrs.field(repr=False)

    def _repr_svg_(self) -> str:
        return self.svg


Drawn = (
    Spec
    | Plan
    | Design
    | Profile
    | Check
    | Judgement
    | Comparison
    | Robustness
    | Identification
    | SwingLog
    | LogTable
    | Deployment
)


def picture(result: Drawn, *, every: bool = False) -> Picture:
    """Draw a result for a notebook to show; raises as `plot`."""
    with TemporaryDirectory() as folder:
        drawn = Path(folder) / "picture.svg"
        plot(result, drawn, every=every)
        return Picture(drawn.read_text("utf-8"))


def plot(result: Drawn, path: Path, *, every: bool = False) -> None:
    """Draw a result into a PNG, SVG or PDF file; the curves of all methods of a comparison, if asked.

    Raises
    ------
    SpecError
        There is no picture of what is given.
    OutputError
        The file cannot be written, Matplotlib is not installed, or there is nothing to draw.
    """
    require_drawable(path)
    match result:
        case Spec(plant=plant):
            draw_machine(result.machine(), plant.parameters, path, f"{result.name}: {plant.type}")
        case Deployment(spec=spec, block=block, proof=proof):
            if proof is None:
                raise OutputError("There is nothing to draw: the block was not proved.")
            draw(spec, block.text, proof, path)
        case Design(plan=part) | Judgement(check=part):
            plot(part, path)
        case _:
            figures, name, title = _figures(result, every)
            save(figures, path, name, title)


def _figures(result: object, every: bool) -> tuple[list[Figure], str, str]:
    """Choose the figures of a result, with a name and a title."""
    match result:
        case Plan(spec=spec, evaluation=evaluation):
            arrival = evaluation.motion.duration
            sway = sway_figure(spec, evaluation, select_machines(evaluation), arrival)
            if spec.path is not None:
                over = path_figure(spec, evaluation)
                sway = Figure(f"{over.caption} {sway.caption}", [*over.panels, *sway.panels])
            title = f"{spec.name}: {spec.plant.type}"
            return [motion_figure(spec, evaluation), sway], spec.name, title
        case Profile(method=method):
            return [profile_figure(result)], method, method
        case Check():
            return [_check_figure(result)], "check", "The check"
        case Comparison(spec=spec):
            return [comparison_figure(result, every)], spec.name, f"{spec.name}: {spec.plant.type}"
        case Robustness(spec=spec):
            load = "loads" if len(result.errors) > 1 else spec.machine().end_load_name  # a map is of all
            title = f"{spec.name}: residual sway of the {load} on machines that are not as specified"
            return [robustness_figure(result)], spec.name, title
        case Identification(logs=()):
            raise OutputError("There is nothing to draw: no log was identified from.")
        case SwingLog(load=load):
            return [log_figure(result)], load, f"Log of {load}"
        case LogTable(source=source):
            return [table_figure(result)], source, source
        case Identification(spec=spec):
            names = ", ".join(result.estimate.values)
            return [identification_figure(result)], spec.name, f"{spec.name}: {names} identified"
        case _:
            drawn = ", ".join(kind.__name__ for kind in get_args(Drawn))
            raise SpecError(f"There is no picture of {found(result)}; give one of {drawn}.")


def _check_figure(check: Check) -> Figure:
    """Draw how much of its limit the worst load of each machine takes up, of the worst machines."""
    ranked = sorted(check.judged, key=check.fraction_after, reverse=True)
    shown = {}
    for finding in ranked[:MOST_BARS]:
        load, _ = check.worst_of([finding])
        shown[f"{finding.scenario.name}, {load}"] = finding, finding.residual[load]
    left_out = len(ranked) - len(shown)
    more = f" Not drawn, as they sway less: {left_out}." if left_out else ""
    bars = Bars(
        title="Residual sway",
        x_label="share of the allowed residual sway (%)",
        values=np.array([100.0 * check.fraction_after(finding) for finding, _ in shown.values()]),
        names=list(shown),
        styles=[PLAIN] * len(shown),
        texts=[f"{number(1e3 * sway)} mm" for _, sway in shown.values()],
        limit=100.0,
    )
    return Figure(f"Dashed in red: what is allowed.{more}", [bars])
