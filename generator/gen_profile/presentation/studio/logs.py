"""What was measured on the machine: a swing that tells its parameters, or a move beside the plan."""

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.motion_evaluation import sketch
from gen_profile.methods.solvers.plan import draft
from gen_profile.methods.solvers.solution import Status
from gen_profile.presentation.charts.figure import Figure
from gen_profile.presentation.charts.identification import identification_figure, table_figure
from gen_profile.presentation.report.log import MeasuredLog, column_meanings, parse_log
from gen_profile.presentation.report.measured import compare_measured
from gen_profile.presentation.report.measured_section import measured_section, measured_verdict
from gen_profile.presentation.studio.curves_json import curves_json
from gen_profile.presentation.studio.orders import LogQuestion
from gen_profile.presentation.studio.state import command_of
from gen_profile.presentation.studio.workers import Part
from gen_profile.spec.model import Spec
from gen_profile.studies.identification.estimation import CONFIDENCE
from gen_profile.studies.identification.identify import Identification, identify
from gen_profile.studies.identification.log_table import decoded, read_table
from gen_profile.studies.identification.measurements import SwingLog, cut_swing
from gen_profile.support.errors import GenProfileError, InfeasibleProblem, OutputError
from gen_profile.support.work import OutOfWork

MOST_COLUMNS = 64  # of a table that are offered
MOVED = 0.3  # of the planned way, from which on a log is one of a move


def log(asked: LogQuestion) -> Iterator[Part]:
    """Read a log, say how, and what follows from it."""
    text = ""
    try:
        spec = asked.question.spec()
        text = decoded(asked.content, asked.name)
        columns = column_meanings(text, asked.name, spec)[:MOST_COLUMNS]
        usual = tuple(spec.robustness.uncertain) or (spec.machine().parameters[0].name,)
        asked = attrs.evolve(asked, free=asked.free or usual)  # what the spec does not know well
        try:
            read = parse_log(text, asked.name, spec, asked.columns)
        except OutputError as error:
            yield _reading(asked, spec, columns, asked.use or "swing")
            yield _unread(error.sentences, text, asked.name)
            return
        use = asked.use or ("move" if _is_move(spec, read) else "swing")
        yield _reading(asked, spec, columns, use)
        places = _places(asked.columns, columns)
        yield _move(asked, spec, read) if use == "move" else _swing(asked, spec, read, places)
    except OutOfWork:
        yield _unread([Status.GIVEN_UP.value], text, asked.name)
    except GenProfileError as error:
        yield _unread(error.sentences, text, asked.name)


def _unread(sentences: Sequence[str], text: str, source: str) -> Part:
    """Say why nothing follows from a log, and draw its columns, which show a wrong one or a wrong unit."""
    panels: list[dict[str, Any]] = []
    with suppress(OutputError):  # of what is no table
        panels = curves_json(table_figure(read_table(text, source)))
    return {"part": "unread", "sentences": [*sentences], "panels": panels}


def _is_move(spec: Spec, read: MeasuredLog) -> bool:
    """Tell whether an axis goes a good part of its way."""
    ways = np.abs(np.subtract(spec.move.target, spec.move.start))
    names = [axis.name for axis in spec.machine().actuated]
    return any(
        float(np.ptp(values)) > MOVED * ways[names.index(name)] > 0.0
        for name, values in read.positions.items()
    )


def _reading(asked: LogQuestion, spec: Spec, columns: list[tuple[str, str]], use: str) -> Part:
    """Tell how a log is read, and how else it may be."""
    plant = spec.machine()
    angles = [f"{load}_{quantity}" for load in plant.loads for quantity in ("sway", "angle")]
    return {
        "part": "log",
        "source": asked.name,
        "use": use,
        "named": asked.columns is None,
        "columns": [{"name": name, "meaning": meaning} for name, meaning in columns],
        "meanings": ["time", *(f"{axis.name}_position" for axis in plant.actuated), *angles],
        "after": asked.after,
        "at": [*(asked.at or spec.move.target)],
        "axes": [{"name": axis.name, "unit": axis.unit} for axis in plant.actuated],
        "free": list(asked.free),
        "parameters": [
            {"name": one.name, "about": one.description, "unit": one.unit} for one in plant.parameters
        ],
    }


def _swing(asked: LogQuestion, spec: Spec, read: MeasuredLog, places: Mapping[str, str]) -> Part:
    """Identify parameters."""
    swing = _only_swing(read, asked.after)
    identified = identify(spec, [swing], asked.free, asked.at or None)
    return {
        "part": "identified",
        "confidence": CONFIDENCE,
        "parameters": [{"name": name, **row} for name, row in identified.to_dict()["parameters"].items()],
        "warnings": [*swing.notes, *identified.warnings()],
        "panels": curves_json(identification_figure(identified)),
        "edits": _edits(identified),
        "command": _identify_command(asked, swing, places),
    }


def _only_swing(read: MeasuredLog, after: float) -> SwingLog:
    """Take the first angle or sway of a log; times count from its first row, as `identify` has it."""
    for quantity, signals in (("angle", read.angles), ("sway", read.sways)):
        for load, values in signals.items():
            cut = partial(cut_swing, after=after or None, quantity=quantity, load=load, notes=read.notes)
            return cut(read.times, values, read.source)
    template = "{source}: no column's name is that of a sway or an angle of a load; choose one."
    raise OutputError(template, source=read.source)


def _places(chosen: str | None, columns: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Say in which column stands what, by its number."""
    if chosen is None:
        return {meaning: str(place) for place, (_, meaning) in enumerate(columns, start=1) if meaning}
    return dict(part.strip().split("=", 1) for part in chosen.split(","))


def _identify_command(asked: LogQuestion, swing: SwingLog, places: Mapping[str, str]) -> str:
    """Write the command line that identifies the same."""
    time = next(meaning for meaning in places if meaning.startswith("time"))
    signal = f"{swing.load}_{swing.quantity}"
    pattern = re.compile(rf"{re.escape(signal)}(_[0-9.]*[a-z]+)?")
    value = next(filter(pattern.fullmatch, places))
    words = ["--swing", asked.name, "--columns", f"{places[time]},{places[value]}"]
    words += ["--signal", f"{swing.quantity}:{swing.load}"]
    words += ["--unit", value.rpartition("_")[2]] if value != signal else []
    words += ["--time-unit", time.rpartition("_")[2]] if "_" in time else []
    words += ["--after", f"{asked.after:g}"] if asked.after else []
    words += ["--at", ",".join(f"{place:g}" for place in asked.at)] if asked.at else []
    words += [word for name in asked.free for word in ("--free", name)]
    start, state = asked.question.start, asked.question.state
    return f"{command_of(start, state.edits, 'identify')} {shlex.join(words)}"


def _edits(identified: Identification) -> Mapping[str, Any]:
    """Say what to change in the spec in order to take over what was found."""
    spec, names = identified.spec, identified.estimate.values
    uncertain = spec.robustness.uncertain
    return {
        **{f"plant.{name}": spec.plant.parameters[name] for name in names},
        **{f"robustness.uncertain.{name}": uncertain[name] for name in names if name in uncertain},
        "robustness.method": spec.robustness.method,
    }


def _move(asked: LogQuestion, spec: Spec, read: MeasuredLog) -> Part:
    """Hold a move against the plan."""
    drafted = draft(spec)
    if drafted.found is None:
        raise InfeasibleProblem("There is no such motion, so nothing to hold the log against.")
    evaluation = sketch(drafted.spec, drafted.motion)
    measured = compare_measured(drafted.spec, evaluation, read, evaluation.motion.duration)
    section = measured_section(drafted.spec, evaluation, measured)
    figures = [block for block in section.blocks if isinstance(block, Figure)]
    verdict = measured_verdict(measured)
    start, state = asked.question.start, asked.question.state
    columns = [] if asked.columns is None else ["--columns", asked.columns]
    words = ["--measured", asked.name, *columns]
    return {
        "part": "measured",
        "passed": measured.passed,
        "sentences": [*verdict.sentences, *section.words],
        "panels": [panel for figure in figures for panel in curves_json(figure)],
        "command": f"{command_of(start, state.edits, 'report')} {shlex.join(words)}",
    }
