"""A measured move, in figures and curves beside the plan."""

from collections.abc import Iterator

import numpy as np

from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.dynamics.evaluation.phrases import machine, mm, number, place_unit
from gen_profile.motion.profile import Array
from gen_profile.presentation.charts.curves import sway_levels
from gen_profile.presentation.charts.figure import PALETTE, Band, Figure, Line, Panel, Style
from gen_profile.presentation.report.content import Section, Share, Table, TableRow, Verdict
from gen_profile.presentation.report.measured import Measured, MeasuredSway, Signal
from gen_profile.spec.model import Spec
from gen_profile.support.phrase import AND_THE, Phrase, joined

NOISY = 0.05  # of the limit, RMS, that noise of a sensor is worth a sentence
DRAWN = 1500  # samples of a log that are drawn; all of them are judged
PLANNED = Style(colour=PALETTE[0], width=2.0)
MEASURED = Style(colour=PALETTE[1], width=1.4)
NEAREST = Style(colour=PALETTE[2], dash="dash", width=1.3)


def measured_verdict(measured: Measured) -> Verdict:
    """Say whether the machine did as it should."""
    judged = {load: sway for load, sway in measured.sways.items() if sway.residual is not None}
    if not judged:
        template = "{source} shows no sway for the length of one slow swing after the arrival."
        if measured.angles and not measured.sways:
            template = (
                "{source} shows no sway for the length of one slow swing after the arrival, nor do the "
                "angles in it alone: log those of all ropes."
            )
        sentence = Phrase(template, source=measured.log.source)
        return Verdict(word="Measured, not judged.", passed=None, sentences=[sentence])
    load, worst = max(judged.items(), key=lambda pair: _share(pair[1]))
    passed = bool(measured.passed)
    others = [name for name in measured.loads if name not in judged]
    residual, limit = mm(worst.residual or 0.0), mm(worst.limit)
    template = (
        "On the machine the {load} swings by {residual} after the arrival, and {limit} are allowed "
        "({source})."
    )
    sentences = [Phrase(template, load=load, residual=residual, limit=limit, source=measured.log.source)]
    if worst.noise > NOISY * worst.limit:
        template = "Noise of the sensor, {noise} RMS, counts as sway."
        sentences.append(Phrase(template, noise=mm(worst.noise)))
    if others:
        template = "Not measured: the sway of the {others}."
        sentences.append(Phrase(template, others=joined(AND_THE, others)))
    word = "Measured: kept." if passed else "Measured: exceeded."
    return Verdict(word=word, passed=passed, sentences=sentences)


def measured_section(spec: Spec, evaluation: MotionEvaluation, measured: Measured) -> Section:
    """Draw what was measured over what was planned, with the deviations."""
    template = "The move begins at {start} s in {source}."
    words: list[str] = [Phrase(template, start=number(measured.start), source=measured.log.source)]
    words += _likeness(evaluation, measured)
    words += [Phrase("As read: {note}.", note=note) for note in measured.log.notes]
    if ignored := ", ".join(measured.log.ignored):
        words.append(Phrase("Columns that were not used: {ignored}.", ignored=ignored))
    caption = "Measured over planned. Dotted: the arrival; dashed in red: what is allowed from then on."
    figure = Figure(caption, [*_panels(spec, evaluation, measured)])
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
    judged = (mm(sway.residual), mm(sway.limit), Share(_share(sway)))
    return TableRow(cells=[*cells, *judged], mark="" if sway.passed else "failed")


def _share(sway: MeasuredSway) -> float:
    return (sway.residual or 0.0) / sway.limit


def _panels(spec: Spec, evaluation: MotionEvaluation, measured: Measured) -> Iterator[Panel]:
    bands = [Band(measured.arrival, measured.arrival)]
    names = [axis.name for axis in spec.machine().actuated]
    for axis, signal in measured.positions.items():
        unit, factor = place_unit(spec, names.index(axis))
        title, label = Phrase("Position of {axis}", axis=axis), Phrase("position ({unit})", unit=unit)
        yield Panel(title, label, _lines(signal, factor), bands=bands)
        title = Phrase("Deviation of {axis}", axis=axis)
        label = Phrase("deviation (m{unit})", unit=signal.unit)
        deviation = _line("measured", signal.times, 1e3 * signal.deviation, MEASURED)
        yield Panel(title, label, [deviation], bands=bands)
    loads = list(spec.machine().loads)
    for load, sway in measured.sways.items():
        lines = _lines(sway.signal, 1e3)
        times = lines[0].x
        if measured.nearest:
            like = evaluation.swing.at(times)[measured.nearest].sway[:, loads.index(load)]
            name = Phrase("planned, {name}", name=machine(evaluation.machines[measured.nearest].name))
            lines.append(Line(name, times, 1e3 * like, NEAREST))
        levels = sway_levels(spec, load, measured.arrival, float(times[-1]))
        title = Phrase("Sway of the {load}", load=load)
        yield Panel(title, "sway (mm)", lines, levels=levels, bands=bands)
    for load, signal in measured.angles.items():
        title = Phrase("Angle of the {load}", load=load)
        yield Panel(title, "angle (mrad)", _lines(signal, 1e3), bands=bands)


def _lines(signal: Signal, factor: float) -> list[Line]:
    planned = _line("planned", signal.times, factor * signal.planned, PLANNED)
    return [planned, _line("measured", signal.times, factor * signal.measured, MEASURED)]


def _line(name: str, times: Array, values: Array, style: Style) -> Line:
    """Draw a signal without samples that no screen would show."""
    kept = np.unique(np.linspace(0, len(times) - 1, DRAWN).round().astype(int))
    return Line(name, times[kept], values[kept], style)
