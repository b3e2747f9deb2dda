"""The curves of a report: the motion, the loads, and other methods beside them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import attrs
import numpy as np

from gen_profile.charts.figure import PALETTE, PLAIN, Band, Figure, Level, Line, Panel, Style
from gen_profile.charts.method_styles import method_styles
from gen_profile.comparison.candidates import own_method
from gen_profile.comparison.compare import ComparedMethod, Comparison
from gen_profile.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.evaluation.phrases import machine, place_unit
from gen_profile.evaluation.residual_sway import RESIDUAL_SAMPLES
from gen_profile.evaluation.scenarios import extremes
from gen_profile.evaluation.simulation import Response
from gen_profile.evaluation.spectrum import DECADES, natural_frequencies, spectrum
from gen_profile.motion.metrics import length, peak
from gen_profile.motion.profile import Array, Profile
from gen_profile.spec.model import Spec

SAMPLES = 800
COMPARED = 500  # samples of each curve where there are many methods
FREQUENCIES = 500
TWINS = 7  # machines beside the nominal one whose sway is drawn
NEAR = 2.5  # times a curve's peak within which a limit is drawn; beyond, it would flatten the curve
ORDERS = (("Position", "{}"), ("Velocity", "{}/s"), ("Acceleration", "{}/s²"), ("Jerk", "{}/s³"))
LIMITED = ("travel", "velocity", "acceleration", "jerk")
PAPERS = ("nzv", "zvd")  # the shapers that the paper compares with
TIME = "time (s)"
FOLLOWED = Style(colour=PALETTE[1], dash="dash")


@attrs.frozen(kw_only=True)
class Shown:
    """One of the evaluation's machines, as it is drawn; the nominal one has rank 0, the worst one rank 1."""

    index: int
    rank: int
    name: str
    style: Style


def select_machines(evaluation: MotionEvaluation) -> list[Shown]:
    """Choose the nominal machine and those that leave the most sway, in the check's order."""
    duration = evaluation.motion.duration
    after = evaluation.swing.at(np.linspace(duration, duration + evaluation.watch, RESIDUAL_SAMPLES))
    end_load = evaluation.swing.plant.end_load
    residuals = [float(peak(length(response.sway[:, end_load]))[0]) for response in after]
    by_rank = [0, *sorted(range(1, len(residuals)), key=lambda index: -residuals[index])][: TWINS + 1]
    return [
        Shown(
            index=index,
            rank=by_rank.index(index),
            name=machine(evaluation.machines[index].name),
            style=Style(colour=colour, width=1.3 if index else 2.2),
        )
        for index, colour in zip(sorted(by_rank), PALETTE, strict=False)
    ]


def motion_figure(spec: Spec, evaluation: MotionEvaluation) -> Figure:
    """Draw what the drives are asked for, and its derivatives, with limits that are near."""
    lagging = evaluation.command is not evaluation.motion
    panels = []
    for column, axis in enumerate(spec.machine().actuated):
        place, factor = place_unit(spec, column)
        for order, (quantity, unit) in enumerate(ORDERS):
            lines = [_derivative("command", evaluation.command, order, column)]
            if lagging:
                lines.append(_derivative("motion of the axis", evaluation.motion, order, column, FOLLOWED))
            greatest = max(float(np.abs(line.y).max()) for line in lines)
            levels = tuple(near_limits(spec, column, order, NEAR * greatest))
            if order == 0:
                lines = [attrs.evolve(line, y=factor * line.y) for line in lines]
                levels = tuple(attrs.evolve(level, value=factor * level.value) for level in levels)
            panels.append(
                Panel(
                    title=f"{quantity} of {axis.name}",
                    x_label=TIME,
                    y_label=f"{quantity.lower()} ({unit.format(axis.unit if order else place)})",
                    lines=lines,
                    levels=levels,
                )
            )
    drawn = "The command of each drive leads its lag" if lagging else "The drives follow it as it is"
    return Figure(
        caption=f"The reference and its derivatives. {drawn}. Dashed in red: limits of the spec.",
        panels=panels,
    )


def spectrum_figure(spec: Spec, evaluation: MotionEvaluation) -> Figure:
    """Draw the spectrum of the acceleration over the natural frequencies of all machines."""
    natural = natural_frequencies(spec, evaluation.machines)
    if natural.varying:
        meaning = "They are those at the target, and others on the way: this does not tell what is left."
    elif any(spec.move.initial.values()):
        meaning = "What the motion holds there takes the initial swing away."
    else:
        meaning = "The less the motion holds there, the less the loads swing on."
    return Figure(
        caption=f"Dotted: natural frequencies of the nominal machine; shaded: those of the others. {meaning}",
        panels=[_spectrum(spec, evaluation, {"motion": evaluation.motion}, {"motion": PLAIN})],
    )


def sway_figure(spec: Spec, evaluation: MotionEvaluation, shown: Sequence[Shown], arrival: float) -> Figure:
    """Draw the sway of every load on the nominal machine and on perturbed ones."""
    times = np.linspace(0.0, evaluation.motion.duration + evaluation.watch, SAMPLES)
    responses = evaluation.swing.at(times)
    left_out = len(evaluation.machines) - len(shown)
    more = f" {left_out} machines that sway less after the move are not drawn." if left_out else ""
    return Figure(
        caption=f"Dotted: the arrival. Dashed in red: what is allowed from then on.{more}",
        panels=[
            Panel(
                title=f"Sway of the {load}",
                x_label=TIME,
                y_label="sway (mm)",
                lines=[
                    Line(
                        name=one.name, x=times, y=1e3 * responses[one.index].sway[:, number], style=one.style
                    )
                    for one in shown
                ],
                levels=sway_levels(spec, load, arrival, float(times[-1])),
                bands=[Band(low=arrival, high=arrival)],
            )
            for number, load in enumerate(spec.machine().loads)
        ],
    )


def other_methods(comparison: Comparison) -> Figure:
    """Draw all methods: the motion, its spectrum, and the end load's sway (the paper's figures 2 to 5)."""
    spec, rows = comparison.spec, comparison.rows
    styles = compared_styles(comparison)
    first = spec.machine().actuated[0]
    panels = [
        Panel(
            title=f"{quantity} of {first.name}",
            x_label=TIME,
            y_label=f"{quantity.lower()} ({unit.format(first.unit)})",
            lines=[
                _derivative(row.method, row.evaluation.motion, order, 0, styles[row.method], COMPARED)
                for row in rows
            ],
        )
        for order, (quantity, unit) in enumerate(ORDERS)
    ]
    motions = {row.method: row.evaluation.motion for row in rows}
    panels.append(_spectrum(spec, rows[0].evaluation, motions, styles))
    return Figure(
        caption=(
            "Optimal motions solid, shapers dashed, extra-insensitive ones dotted. "
            "Click on a method's name to show or hide its curves."
        ),
        panels=[*panels, *_sways(comparison, styles)],
    )


def _sways(comparison: Comparison, styles: Mapping[str, Style]) -> Iterator[Panel]:
    """Draw the end load under every method, on the nominal machine and on those with all parameters off."""
    spec, rows = comparison.spec, comparison.rows
    plant, last = spec.machine(), max(row.evaluation.motion.duration for row in rows)
    seen = {row.method: row.evaluation.swing.at(_until(row)) for row in rows}
    allowed = 1e3 * spec.check.residual_sway[plant.loads[-1]]
    signs = (1.0, -1.0) if plant.directions == 1 else (1.0,)  # the sway in two directions is a length
    for index in extremes(spec):
        lines = [
            Line(
                name=method,
                x=responses[index].times,
                y=1e3 * end_load_sway(spec, responses[index]),
                style=styles[method],
            )
            for method, responses in seen.items()
        ]
        end = max(float(line.x[-1]) for line in lines)
        yield Panel(
            title=f"Sway of the {plant.end_load_name}, {machine(rows[0].evaluation.machines[index].name)}",
            x_label=TIME,
            y_label="sway (mm)",
            lines=lines,
            levels=[Level(value=sign * allowed, between=(last, end)) for sign in signs],
            bands=[Band(low=last, high=last)],
        )


def hamiltonian_figure(times: Array, hamiltonian: Array) -> Figure:
    """Draw how far the Hamiltonian is from constant.

    It does not depend on time explicitly, so along the exact optimum it is constant.
    """
    change = (hamiltonian - hamiltonian.mean()) / np.abs(hamiltonian).max()
    return Figure(
        caption="Change of the Hamiltonian at the mesh's nodes, relative: the exact optimum has none.",
        panels=[
            Panel(
                title="Hamiltonian",
                x_label=TIME,
                y_label="relative change",
                lines=[Line(name="change", x=times, y=change)],
            )
        ],
    )


def sway_levels(spec: Spec, load: str, arrival: float, end: float) -> list[Level]:
    """List the limits of a load's sway in mm: after the arrival, and the end load's on the way."""
    residual = 1e3 * spec.check.residual_sway[load]
    levels = [Level(value=sign * residual, between=(arrival, end)) for sign in (1.0, -1.0)]
    plant = spec.machine()
    if spec.limits.sway is not None and load in plant.loads[plant.end_load]:
        transient = 1e3 * spec.limits.sway
        levels += [Level(value=sign * transient, between=(0.0, arrival)) for sign in (1.0, -1.0)]
    return levels


def end_load_sway(spec: Spec, response: Response) -> Array:
    """Sway of the end load in m, shape (samples,): its length where it has two directions."""
    return length(response.sway[:, spec.machine().end_load])[:, 0]


def _derivative(  # noqa: PLR0917  # name, then what, then how
    name: str, profile: Profile, order: int, column: int, style: Style = PLAIN, samples: int = SAMPLES
) -> Line:
    points = max(2, samples // (len(profile.knots) - 1))
    times, values = profile.within_segments(points, order)
    return Line(name=name, x=times, y=values[:, column], style=style)


def near_limits(spec: Spec, column: int, order: int, near: float) -> Iterator[Level]:
    """List the limits of one quantity of one axis that are not too far away to be drawn."""
    allowed = getattr(spec.limits.of(column), LIMITED[order])
    if allowed is None:
        return
    for value in allowed if order == 0 else (allowed, -allowed):
        if abs(value) <= near:
            yield Level(value=value)


def _spectrum(
    spec: Spec, evaluation: MotionEvaluation, motions: Mapping[str, Profile], styles: Mapping[str, Style]
) -> Panel:
    first, natural = spec.machine().actuated[0], natural_frequencies(spec, evaluation.machines)
    frequencies = natural.span(FREQUENCIES)
    ranges = zip(natural.lowest.tolist(), natural.highest.tolist(), strict=True)
    return Panel(
        title=f"Spectrum of the acceleration of {first.name}",
        x_label="frequency (rad/s)",
        y_label=f"magnitude ({first.unit}/s)",
        lines=[
            Line(name=name, x=frequencies, y=spectrum(motion, frequencies), style=styles[name])
            for name, motion in motions.items()
        ],
        bands=[
            *(Band(low=low, high=high) for low, high in ranges if high > low),
            *(Band(low=frequency, high=frequency) for frequency in natural.nominal.tolist()),
        ],
        decades=DECADES,
    )


def compared_styles(comparison: Comparison) -> dict[str, Style]:
    """Draw the spec's own method thick, and show the most telling ones."""
    own = own_method(comparison.spec)
    methods = [row.method for row in comparison.rows]
    shown = {
        own,
        *(advice.method for advice in comparison.recommended.values()),
        *PAPERS,
        *(method for method in methods if method == "optimal" or method.startswith("optimal-beta")),
    }
    styles = method_styles(methods, thick={own})
    return {method: attrs.evolve(style, shown=method in shown) for method, style in styles.items()}


def _until(row: ComparedMethod) -> Array:
    duration = row.evaluation.motion.duration
    return np.linspace(0.0, duration + row.evaluation.watch, COMPARED)
