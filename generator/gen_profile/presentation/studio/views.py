"""From a changed spec to what a page shows of it, part by part: what is found soonest comes first.

Every part is a mapping of plain values with its name under ``"part"``. What takes longer is in
`gen_profile.presentation.studio.depth`.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.demands import axis_demands
from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation, keeps_residual_sway, sketch
from gen_profile.dynamics.evaluation.phrases import machine, move, place_unit
from gen_profile.dynamics.problem.limits import LIMIT_TOLERANCE
from gen_profile.methods.solvers.draft import Plan
from gen_profile.methods.solvers.over_stacks.plan import sketched
from gen_profile.methods.solvers.plan import answer_of, draft, judged
from gen_profile.methods.solvers.solution import Status
from gen_profile.motion.metrics import extremes, peak
from gen_profile.presentation.charts.curves import motion_figure, select_machines, sway_figure
from gen_profile.presentation.report.animation import animation
from gen_profile.presentation.studio.curves_json import curves_json, side_json
from gen_profile.presentation.studio.knobs import knobs
from gen_profile.presentation.studio.manual import help_on
from gen_profile.presentation.studio.orders import Question
from gen_profile.presentation.studio.state import command_of, text_of
from gen_profile.presentation.studio.workers import Part, failure
from gen_profile.spec.model import Spec
from gen_profile.spec.plausibility import plausibility_warnings
from gen_profile.studies.comparison.candidates import own_method
from gen_profile.support.errors import GenProfileError, NoMotion, SpecError
from gen_profile.support.phrase import PLACED, Phrase
from gen_profile.support.work import OutOfWork, budget

SAMPLES = 300  # of a curve: as many as a panel has pixels
RANKED = 401  # instants after the move by which machines are ranked for the picture
SHOWN = 2  # machines beside the nominal one
FIGURES = {
    "duration": "duration_s",
    "acceleration": "acceleration_max_m_per_s2",
    "sway": "sway_transient_peak_m",
    "residual": "sway_residual_worst_m",
}
SEARCHING = "Looking for what would help …"


def picture(question: Question) -> Iterator[Part]:
    """Solve a spec and show it: curves and the machine first, then knobs and the verdict."""
    try:
        spec = question.spec()
        with budget(*answer_of(spec)):
            yield from _sketched(spec)
            drafted = draft(spec)
            if drafted.found is None:
                yield failure("none", [SEARCHING])
            else:
                yield from _shown(drafted.spec, sketch(drafted.spec, drafted.motion))
            yield _setting(question, spec)
            yield _verdict(judged(drafted))
    except (GenProfileError, OutOfWork) as error:
        yield from _failure(question, error)


def _shown(spec: Spec, evaluation: MotionEvaluation) -> Iterator[Part]:
    """Draw the motion, and the machines under it."""
    arrival = evaluation.motion.duration
    shown = [one for one in select_machines(evaluation, RANKED) if one.rank <= SHOWN]
    if spec.path is not None:
        yield _side(spec, evaluation)
    yield {
        "part": "curves",
        "duration": arrival,
        "motion": curves_json(motion_figure(spec, evaluation, SAMPLES)),
        "sway": curves_json(sway_figure(spec, evaluation, shown, arrival, SAMPLES)),
        "margins": [*_margins(spec, evaluation)],
    }
    yield {"part": "animation", "animation": animation(spec, evaluation, shown, arrival).to_json()}


def _sketched(spec: Spec) -> Iterator[Part]:
    """Show about how the load goes over stacks, before the motion is known that all machines can follow."""
    if spec.path is not None and (places := sketched(spec)) is not None:
        yield {"part": "sketch", **side_json(spec, places[None])}


def _side(spec: Spec, evaluation: MotionEvaluation) -> Part:
    times = np.linspace(0.0, evaluation.motion.duration, SAMPLES)
    places = np.asarray(evaluation.swing.bodies(times))
    return {"part": "side", **side_json(spec, places)}


def _setting(question: Question, spec: Spec) -> Part:
    """Tell the knobs, and how else the same is stated."""
    start, state = question.start, question.state
    return {
        "part": "setting",
        "name": spec.name,
        "summary": spec.machine().summary,
        "machine": spec.plant.type,
        "knobs": [_json(knob) for knob in knobs(spec, question.document(), question.beginning())],
        "command": command_of(start, state.edits),
        "text": text_of(start, state.edits),
        "address": state.address,
        "warnings": [fault(sentence) for sentence in plausibility_warnings(spec)],
    }


def _json(knob: Any) -> dict[str, Any]:
    """Leave out what is as by default, which the page knows, and say where the manual explains it."""
    pairs = ((field, getattr(knob, field.name)) for field in attrs.fields(type(knob)))
    stated = {one.name: value for one, value in pairs if value != one.default or one.name == "value"}
    return {**stated, "help": help_on(knob.words)}


def _margins(spec: Spec, evaluation: MotionEvaluation) -> Iterator[dict[str, Any]]:
    """Hold what the drives are asked for against the limits."""
    for column, axis in enumerate(spec.machine().actuated):
        limits, name = spec.limits.of(column), axis.name if len(spec.axis) > 1 else ""
        taken: list[tuple[str, str, float, float | None]]
        asked = axis_demands(spec, evaluation.command, column)
        taken = [(one.quantity, one.unit, one.asked, one.allowed) for one in asked]
        least, most = extremes(evaluation.command, 0, column)
        way, allowed, (unit, factor) = most - least, None, place_unit(spec, column)
        if limits.travel is not None:
            low, high = limits.travel
            beyond = max(low - least, most - high)
            allowed = factor * (high - low)
            way = high - low + beyond if beyond > LIMIT_TOLERANCE * (high - low) else way
        taken.append(("travel", unit, factor * way, allowed))
        for quantity, unit, takes, allowed in taken:
            yield {
                "place": spec.limits.place(column, quantity),
                "quantity": quantity,
                "axis": name,
                "unit": unit,
                "takes": takes,
                "allowed": allowed,
            }


def _verdict(planned: Plan) -> Part:
    """Judge the motion on all machines of the ranges; a file that is written is judged by the check alone."""
    spec, evaluation = planned.spec, planned.evaluation
    begin, limits = evaluation.motion.duration, np.array(list(spec.check.residual_sway.values()))
    times = np.linspace(begin, begin + evaluation.watch, RANKED)
    peaks = np.array([peak(one.sway) for one in evaluation.swing.at(times)])
    worst, load = np.unravel_index((peaks / limits).argmax(), peaks.shape)
    figures = planned.figures
    passage = planned.passage
    inside = load in range(*spec.machine().end_load.indices(len(limits)))
    return {
        "part": "verdict",
        "passed": keeps_residual_sway(spec, evaluation),
        "load": list(spec.check.residual_sway)[load],
        "machine": machine(evaluation.machines[worst].name),
        "move": move(spec),
        "duration": begin,
        "residual": max(float(peaks[worst, load]), figures["sway_residual_worst_m"] if inside else 0.0),
        "allowed": float(limits[load]),
        "sway": figures["sway_transient_peak_m"],
        "sway_worst": figures["sway_transient_worst_m"],
        "sway_allowed": spec.limits.sway,
        "point": point(own_method(spec), figures),
        "one_by_one": None if passage is None else passage.one_by_one,
        "room": None if passage is None else passage.nearest.room,
        "solver_time": planned.solver_time,
        "iterations": None if planned.solution is None else planned.solution.iterations,
    }


def _failure(question: Question, error: Exception) -> Iterator[Part]:
    """Say why there is no motion, what would help, and keep the knobs usable."""
    sentences = error.sentences if isinstance(error, GenProfileError) else (Status.GIVEN_UP.value,)
    answer = "none" if isinstance(error, NoMotion | OutOfWork) else "unanswered"
    if isinstance(error, SpecError):
        answer = "faulty"
        yield {"part": "faults", "faults": [fault(sentence) for sentence in sentences]}
        if question.state.edits:
            return
    suggestions = error.suggestions if isinstance(error, NoMotion) else ()
    yield failure(answer, sentences, [one.values for one in suggestions])


def fault(sentence: str) -> Part:
    """Tell the place in a spec from what is wrong there."""
    if not isinstance(sentence, Phrase) or sentence.template != PLACED:
        return {"place": "", "sentence": sentence}
    rest = {name: value for name, value in sentence.values.items() if name != "place"}
    return {"place": sentence.values["place"], "sentence": Phrase("{problem}{end}", **rest)}


def point(method: str, figures: Mapping[str, float]) -> dict[str, Any]:
    """Tell a design by the figures that designs are compared by."""
    return {"method": method, **{name: figures[key] for name, key in FIGURES.items()}}
