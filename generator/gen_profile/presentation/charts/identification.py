"""A fitted swing: the log and the machine's, what is left, and its spectrum; or a log as it was read."""

import math

import numpy as np

from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.presentation.charts.figure import INK, PALETTE, Band, Figure, Line, Panel, Style
from gen_profile.studies.identification.identify import Identification
from gen_profile.studies.identification.log_table import LogTable
from gen_profile.studies.identification.measurements import SwingLog
from gen_profile.studies.identification.misfit import spectrum
from gen_profile.support.errors import OutputError
from gen_profile.support.phrase import Phrase

LOGGED, FOUND = Style(colour=PALETTE[1], dash="points"), Style(colour=PALETTE[0], width=1.0)
LEFT, CHANCE = Style(colour=PALETTE[1], width=1.0), Style(colour=INK, dash="dash", width=1.0)
GAP = 10.0  # times as long as samples are apart: over it no curve is drawn
BELOW = 1.5  # decades that are shown below what chance does
MOST_ROWS, MOST_COLUMNS, LONGEST_NAME = 2000, 8, 60  # of a table that was refused, and characters


def log_figure(log: SwingLog) -> Figure:
    """Draw a log as it was read, which shows a wrong column or unit at once."""
    logged = Line("logged", log.times, log.values, LOGGED)
    return Figure("As it was read.", [_panel(log, [logged])], columns=1)


def table_figure(table: LogTable) -> Figure:
    """Draw the numbers of a log that was refused, column by column.

    Raises
    ------
    OutputError
        It holds none.
    """
    rows = np.unique(np.linspace(0, len(table.rows) - 1, MOST_ROWS).astype(int)).tolist()
    head = table.head(("1", "2"))
    panels = []
    for place in range(max(len(table.rows[row]) for row in rows)):
        values = np.array([table.seconds(row, place) for row in rows])
        if np.isfinite(values).any():
            name: str = table.cell(head, place)[:LONGEST_NAME] if table.is_head(head) else ""
            name = name or Phrase("column {number}", number=place + 1)
            row = Line("logged", np.array(rows) + 1.0, values, LOGGED)
            panels.append(Panel(name, "as it stands there", [row], x_label="row"))
    if not panels:
        raise OutputError("{source}: there is nothing to draw: no cell holds a number.", source=table.source)
    return Figure("Refused; its columns as they were read.", panels[:MOST_COLUMNS], columns=1)


def _panel(log: SwingLog, lines: list[Line]) -> Panel:
    label = Phrase("{quantity} of {load} ({unit})", quantity=log.quantity, load=log.load, unit=log.unit)
    return Panel(Phrase("Swing of the {load}", load=log.load), label, lines)


def identification_figure(identified: Identification) -> Figure:
    """Draw the first log beside the identified machine."""
    log, swing = identified.logs[0], identified.estimate.swings[0]
    left = log.values - swing
    spec = identified.spec
    natural = linearize(spec.machine(), spec.plant.parameters, identified.q_a).frequencies
    shown = spectrum(log.times, left, float(natural[-1]))
    amplitude, chance = (2.0 * np.sqrt(power / len(left)) for power in (shown.power, shown.threshold))
    greatest = max(float(amplitude.max()), float(np.max(chance)))
    steps = np.diff(log.times)
    gaps = np.flatnonzero(steps > GAP * np.median(steps)) + 1
    times = np.insert(log.times, gaps, 0.5 * (log.times[gaps - 1] + log.times[gaps]))
    values, swing, left = (np.insert(row, gaps, np.nan) for row in (log.values, swing, left))
    logged = Line("logged", times, values, LOGGED)
    found = Line("machine found", times, swing, FOUND)
    rest = Line("left", times, left, LEFT)
    of_rest = Phrase("left of it ({unit})", unit=log.unit)
    spectral = [
        Line("left", shown.frequencies, amplitude, LEFT),
        Line("noise stays below", shown.frequencies, chance, CHANCE),
    ]
    panels = [
        _panel(log, [logged, found]),
        Panel("What is left of the log", of_rest, [rest]),
        Panel(
            "Spectrum of what is left",
            Phrase("amplitude ({unit})", unit=log.unit),
            spectral,
            x_label="frequency (rad/s)",
            bands=[Band(frequency, frequency) for frequency in natural.tolist()],
            decades=BELOW + math.log10(greatest / float(np.min(chance))),
        ),
    ]
    caption = "Dotted in the spectrum: natural frequencies of the machine found."
    return Figure(caption, panels, columns=1)
