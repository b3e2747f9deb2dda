"""Curves of a design: the motion, its spectrum, and the loads."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.dynamics.evaluation.phrases import machine, place_unit
from gen_profile.dynamics.evaluation.residual_sway import RESIDUAL_SAMPLES
from gen_profile.dynamics.evaluation.simulation import Response
from gen_profile.dynamics.evaluation.spectrum import DECADES, natural_frequencies, spectrum
from gen_profile.dynamics.evaluation.static_deflection import StaticDeflection, in_wind
from gen_profile.motion.metrics import length, peak
from gen_profile.motion.profile import Array, Profile
from gen_profile.presentation.charts.figure import (
    PALETTE,
    PLAIN,
    Band,
    Figure,
    Level,
    Line,
    Panel,
    Style,
)
from gen_profile.spec.model import Spec
from gen_profile.support.phrase import Phrase

SAMPLES = 800
FREQUENCIES = 500
TWINS = 7  # machines beside the nominal one whose sway is drawn
LEAST_SPAN = 1e-3  # m (or rad) and its derivatives, either way: what changes less is not drawn larger
NEAR = 2.5  # times what is shown, up to which a limit is drawn; beyond, it would flatten the curves
ORDERS = (("Position", "{}"), ("Velocity", "{}/s"), ("Acceleration", "{}/s²"), ("Jerk", "{}/s³"))
LIMITED = ("travel", "velocity", "acceleration", "jerk")
FOLLOWED = Style(colour=PALETTE[1], dash="dash")
WINDY = Style(colour=PALETTE[-1], dash="dot")


@attrs.frozen(kw_only=True)
class Shown:
    """One of the evaluation's machines, as it is drawn; the nominal one has rank 0, the worst one rank 1."""

    index: int
    rank: int
    name: str
    style: Style


def select_machines(evaluation: MotionEvaluation, samples: int = RESIDUAL_SAMPLES) -> list[Shown]:
    """Choose the nominal machine and those that leave the most sway, in the check's order."""
    duration = evaluation.motion.duration
    after = evaluation.swing.at(np.linspace(duration, duration + evaluation.watch, samples))
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


def motion_figure(spec: Spec, evaluation: MotionEvaluation, samples: int = SAMPLES) -> Figure:
    """Draw what the drives are asked for, and its derivatives, with limits that are near."""
    lagging = evaluation.command is not evaluation.motion
    panels = []
    for column, axis in enumerate(spec.machine().actuated):
        for order, (quantity, unit) in enumerate(ORDERS):
            lines = [derivative_line("command", evaluation.command, order, column, samples=samples)]
            if lagging:
                followed = ("motion of the axis", evaluation.motion, order, column, FOLLOWED)
                lines.append(derivative_line(*followed, samples=samples))
            own, factor = (axis.unit, 1.0) if order else place_unit(spec, column)
            levels = [Level(factor * one.value) for one in near_limits(spec, column, order, extent(lines))]
            lines = [attrs.evolve(line, y=factor * line.y) for line in lines]
            span = None if levels else _span(lines, factor * LEAST_SPAN)
            title = Phrase("{quantity} of {name}", quantity=quantity, name=axis.name)
            label = Phrase("{quantity} ({unit})", quantity=quantity.lower(), unit=unit.format(own))
            panels.append(Panel(title, label, lines, levels=levels, span=span))
    drawn = "The command of each drive leads its lag" if lagging else "The drives follow it as it is"
    caption = f"The reference and its derivatives. {drawn}. Dashed in red: limits of the spec."
    return Figure(caption, panels)


def profile_figure(profile: Profile) -> Figure:
    """Draw a motion and its derivatives by themselves, in SI units, each axis a line."""
    panels = []
    for order, (quantity, unit) in enumerate(ORDERS):
        lines = [
            derivative_line(f"axis {axis + 1}", profile, order, axis, Style(colour=colour))
            for axis, colour in zip(range(profile.axes), cycle(PALETTE), strict=False)
        ]
        label = f"{quantity.lower()} ({unit.format('m')} or {unit.format('rad')})"
        panels.append(Panel(quantity, label, lines))
    return Figure("The motion and its derivatives.", panels)


def spectrum_figure(spec: Spec, evaluation: MotionEvaluation) -> Figure:
    """Draw the spectrum of the acceleration over the natural frequencies of all machines."""
    natural = natural_frequencies(spec, evaluation.machines)
    if natural.varying:
        meaning = "They are those at the target, and others on the way: this does not tell what is left."
    elif any(spec.move.initial.values()):
        meaning = "What the motion holds there takes the initial swing away."
    else:
        meaning = "The less the motion holds there, the less the loads swing on."
    caption = f"Dotted: natural frequencies of the nominal machine; shaded: those of the others. {meaning}"
    panel = spectrum_panel(spec, evaluation, {"motion": evaluation.motion}, {"motion": PLAIN})
    return Figure(caption, [panel])


def sway_figure(
    spec: Spec, evaluation: MotionEvaluation, shown: Sequence[Shown], arrival: float, samples: int = SAMPLES
) -> Figure:
    """Draw the sway of every load on the nominal machine and on perturbed ones."""
    times = np.linspace(0.0, evaluation.motion.duration + evaluation.watch, samples)
    responses = evaluation.swing.at(times)
    left_out = len(evaluation.machines) - len(shown)
    more = f" Machines that sway less after the move and are not drawn: {left_out}." if left_out else ""
    wind = in_wind(spec, evaluation.machines)
    more += "" if wind is None else " Dotted lines: how far the wind holds the loads aside, on top of that."
    end, panels = float(times[-1]), []
    for number, load in enumerate(spec.machine().loads):
        sways = [1e3 * responses[one.index].sway[:, number] for one in shown]
        lines = [Line(one.name, times, sway, one.style) for one, sway in zip(shown, sways, strict=True)]
        panel = Panel(
            Phrase("Sway of the {load}", load=load),
            "sway (mm)",
            lines + wind_lines(wind, load, arrival, end),
            levels=sway_levels(spec, load, arrival, end),
            bands=[Band(arrival, arrival)],
        )
        panels.append(panel)
    caption = f"Dotted: the arrival. Dashed in red: what is allowed from then on.{more}"
    return Figure(caption, panels)


def hamiltonian_figure(times: Array, hamiltonian: Array) -> Figure:
    """Draw how far the Hamiltonian is from constant.

    It does not depend on time explicitly, so along the exact optimum it is constant.
    """
    change = (hamiltonian - hamiltonian.mean()) / np.abs(hamiltonian).max()
    lines = [Line("change", times, change)]
    caption = "Change of the Hamiltonian at the mesh's nodes, relative: the exact optimum has none."
    panel = Panel("Hamiltonian", "relative change", lines)
    return Figure(caption, [panel])


def sway_levels(spec: Spec, load: str, arrival: float, end: float) -> list[Level]:
    """List the limits of a load's sway in mm: after the arrival, and the end load's on the way."""
    residual = 1e3 * spec.check.residual_sway[load]
    levels = [Level(sign * residual, (arrival, end)) for sign in (1.0, -1.0)]
    plant = spec.machine()
    if spec.limits.sway is not None and load in plant.loads[plant.end_load]:
        transient = 1e3 * spec.limits.sway
        levels += [Level(sign * transient, (0.0, arrival)) for sign in (1.0, -1.0)]
    return levels


def wind_lines(wind: StaticDeflection | None, load: str, arrival: float, end: float) -> list[Line]:
    """Draw how far a wind holds a load aside after the arrival, either way; nothing without wind."""
    if wind is None:
        return []
    aside = 1e3 * wind.loads[load]
    span = np.array([arrival, end])
    name = f"wind, {wind.force:g} N"
    return [Line(name, span, np.full(2, sign * aside), WINDY) for sign in (1.0, -1.0)]


def end_load_sway(spec: Spec, response: Response) -> Array:
    """Sway of the end load in m, shape (samples,): its length where it has two directions."""
    return length(response.sway[:, spec.machine().end_load])[:, 0]


def derivative_line(  # noqa: PLR0917  # name, then what, then how
    name: str, profile: Profile, order: int, column: int, style: Style = PLAIN, samples: int = SAMPLES
) -> Line:
    """Draw a derivative of one axis, its jumps between segments included."""
    points = max(2, samples // (len(profile.knots) - 1))
    times, values = profile.within_segments(points, order)
    return Line(name, times, values[:, column], style)


def extent(lines: Sequence[Line]) -> tuple[float, float]:
    """Find the least and the greatest value of some curves."""
    return min(float(np.nanmin(line.y)) for line in lines), max(float(np.nanmax(line.y)) for line in lines)


def _span(lines: Sequence[Line], least: float) -> tuple[float, float] | None:
    """Choose ends around what changes less than that, as an axis that is held; none around anything else."""
    low, high = extent(lines)
    middle = 0.5 * (low + high)
    return None if high - low > 2.0 * least else (middle - least, middle + least)


def near_limits(spec: Spec, column: int, order: int, shown: tuple[float, float]) -> Iterator[Level]:
    """List the limits of one quantity of one axis that are near enough to what is shown to be drawn."""
    allowed = getattr(spec.limits.of(column), LIMITED[order])
    if allowed is None:
        return
    low, high = shown if order else (-max(map(abs, shown)), max(map(abs, shown)))
    for value in allowed if order == 0 else (allowed, -allowed):
        if NEAR * low <= value <= NEAR * high:
            yield Level(value)


def spectrum_panel(
    spec: Spec, evaluation: MotionEvaluation, motions: Mapping[str, Profile], styles: Mapping[str, Style]
) -> Panel:
    """Draw spectra of the leading axis's acceleration over the natural frequencies of all machines."""
    axis = spec.machine().actuated[evaluation.motion.leading]
    natural = natural_frequencies(spec, evaluation.machines)
    frequencies = natural.span(FREQUENCIES)
    ranges = zip(natural.lowest.tolist(), natural.highest.tolist(), strict=True)
    bands = [Band(low, high) for low, high in ranges if high > low]
    spectra = {name: spectrum(motion, frequencies) for name, motion in motions.items()}
    lines = [Line(name, frequencies, magnitude, styles[name]) for name, magnitude in spectra.items()]
    return Panel(
        Phrase("Spectrum of the acceleration of {name}", name=axis.name),
        Phrase("magnitude ({unit}/s)", unit=axis.unit),
        lines,
        x_label="frequency (rad/s)",
        bands=bands + [Band(frequency, frequency) for frequency in natural.nominal.tolist()],
        decades=DECADES,
    )
