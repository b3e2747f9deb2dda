"""A measured move, in figures and curves beside the plan."""

from collections.abc import Iterator

import numpy as np

from gen_profile.charts.curves import sway_levels
from gen_profile.charts.figure import PALETTE, Band, Figure, Level, Line, Panel, Style
from gen_profile.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.evaluation.phrases import machine, mm, number, place_unit
from gen_profile.motion.profile import Array
from gen_profile.phrase import AND_THE, Phrase, joined
from gen_profile.report.content import Section, Share, Table, TableRow, Verdict
from gen_profile.report.measured import Measured, MeasuredSway, Signal
from gen_profile.spec.model import Spec

DRAWN = 1500  # samples of a log that are drawn; all of them are judged
PLANNED = Style(colour=PALETTE[0], width=2.0)
MEASURED = Style(colour=PALETTE[1], width=1.4)
NEAREST = Style(colour=PALETTE[2], dash="dash", width=1.3)


def measured_verdict(measured: Measured) -> Verdict:
    """Say whether the machine did as it should."""
    judged = {load: sway for load, sway in measured.sways.items() if sway.residual is not None}
    if not judged:
        template = "{source} tells no sway for as long as one slow swing after the arrival."
        if measured.angles and not measured.sways:
            template = (
                "{source} tells no sway for as long as one slow swing after the arrival, nor do the angles "
                "in it alone: log those of all ropes."
            )
        return Verdict(
            word="Measured, not judged.",
            passed=None,
            sentences=(Phrase(template, source=measured.log.source),),
        )
    load, worst = max(judged.items(), key=lambda pair: _share(pair[1]))
    passed = bool(measured.passed)
    others = [name for name in measured.loads if name not in judged]
    residual, limit = mm(worst.residual or 0.0), mm(worst.limit)
    template = (
        "On the machine the {load} swings by {residual} after the arrival, and {limit} are allowed "
        "({source})."
    )

    return Verdict(
        word="Measured: kept." if passed else "Measured: exceeded.",
        passed=passed,
        sentences=(
            Phrase(template, load=load, residual=residual, limit=limit, source=measured.log.source),
            *(
                [Phrase("Not measured: the sway of the {others}.", others=joined(AND_THE, others))]
                if others
                else []
            ),
        ),
    )


def measured_section(spec: Spec, evaluation: MotionEvaluation, measured: Measured) -> Section:
    """Draw what was measured over what was planned, with the deviations."""
    template = "The move begins at {start} s in {source}."
    words = [
        Phrase(template, start=number(measured.start), source=measured.log.source),
        *_likeness(evaluation, measured),
    ]
    if measured.log.ignored:
        words.append(
            Phrase("Columns that were left alone: {ignored}.", ignored=", ".join(measured.log.ignored))
        )
    figure = Figure(
        caption="Measured over planned. Dotted: the arrival; dashed in red: what is allowed from then on.",
        panels=[*_panels(spec, evaluation, measured)],
    )
    return Section(title="What the machine did", words=[" ".join(words)], blocks=[_table(measured), figure])


def _likeness(evaluation: MotionEvaluation, measured: Measured) -> Iterator[str]:
    """Say which of the machines that were tried the real one is most like."""
    if measured.nearest is not None and len(evaluation.machines) > 1:
        nearest = machine(evaluation.machines[measured.nearest].name)
        yield Phrase("Of the machines tried, {nearest} swings most like it.", nearest=nearest)
    computed = [load for load, sway in measured.sways.items() if sway.from_angles]
    if computed:
        template = "Sway computed from the ropes' angles and nominal lengths: {computed}."
        yield Phrase(template, computed=", ".join(computed))


def _table(measured: Measured) -> Table:
    rows = [
        *(_row(f"position of {axis}", signal) for axis, signal in measured.positions.items()),
        *(_row(f"sway of the {load}", sway.signal, sway) for load, sway in measured.sways.items()),
        *(_row(f"angle of the {load}", signal) for load, signal in measured.angles.items()),
    ]
    return Table(head=("", "off the plan, RMS", "at most", "residual", "allowed", "share"), rows=rows)


def _row(name: str, signal: Signal, sway: MeasuredSway | None = None) -> TableRow:
    cells = [name, *(f"{number(1e3 * value)} m{signal.unit}" for value in (signal.rms, signal.peak))]
    if sway is None or sway.residual is None:
        return TableRow(cells=[*cells, "", "", ""])
    fraction = Share(_share(sway))
    return TableRow(
        cells=[*cells, mm(sway.residual), mm(sway.limit), fraction], mark="" if sway.passed else "failed"
    )


def _share(sway: MeasuredSway) -> float:
    return (sway.residual or 0.0) / sway.limit


def _panels(spec: Spec, evaluation: MotionEvaluation, measured: Measured) -> Iterator[Panel]:
    arrival = Band(low=measured.arrival, high=measured.arrival)
    names = [axis.name for axis in spec.machine().actuated]
    for axis, signal in measured.positions.items():
        times, position, planned, deviation = _thinned(signal)
        unit, factor = place_unit(spec, names.index(axis))
        yield Panel(
            title=Phrase("Position of {axis}", axis=axis),
            y_label=Phrase("position ({unit})", unit=unit),
            lines=[_planned(times, factor * planned), _measured(times, factor * position)],
            bands=[arrival],
        )
        yield Panel(
            title=Phrase("Deviation of {axis}", axis=axis),
            y_label=Phrase("deviation (m{unit})", unit=signal.unit),
            lines=[_measured(times, 1e3 * deviation)],
            bands=[arrival],
        )
    loads = list(spec.machine().loads)
    for load, sway in measured.sways.items():
        times, values, planned, _ = _thinned(sway.signal)
        lines = [_planned(times, 1e3 * planned), _measured(times, 1e3 * values)]
        if measured.nearest:
            like = evaluation.swing.at(times)[measured.nearest].sway[:, loads.index(load)]
            name = machine(evaluation.machines[measured.nearest].name)
            lines.append(
                Line(name=Phrase("planned, {name}", name=name), x=times, y=1e3 * like, style=NEAREST)
            )
        levels = sway_levels(spec, load, measured.arrival, float(times[-1]))
        yield _swinging(Phrase("Sway of the {load}", load=load), "sway (mm)", lines, levels, arrival)
    for load, signal in measured.angles.items():
        times, values, planned, _ = _thinned(signal)
        lines = [_planned(times, 1e3 * planned), _measured(times, 1e3 * values)]
        yield _swinging(Phrase("Angle of the {load}", load=load), "angle (mrad)", lines, [], arrival)


def _swinging(title: str, label: str, lines: list[Line], levels: list[Level], arrival: Band) -> Panel:
    return Panel(title=title, y_label=label, lines=lines, levels=levels, bands=[arrival])


def _planned(times: Array, values: Array) -> Line:
    return Line(name="planned", x=times, y=values, style=PLANNED)


def _measured(times: Array, values: Array) -> Line:
    return Line(name="measured", x=times, y=values, style=MEASURED)


def _thinned(signal: Signal) -> tuple[Array, Array, Array, Array]:
    """Leave out samples that no screen would show: times, measured, planned and deviation."""
    kept = np.unique(np.linspace(0, len(signal.times) - 1, DRAWN).round().astype(int))
    return signal.times[kept], signal.measured[kept], signal.planned[kept], signal.deviation[kept]
