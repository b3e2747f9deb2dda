"""What a page shows once the hand rests: the spectrum, other methods, sway over parameters' errors."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.profile import Profile
from gen_profile.presentation.charts.curves import spectrum_figure
from gen_profile.presentation.charts.figure import Map
from gen_profile.presentation.charts.method_styles import method_styles
from gen_profile.presentation.charts.plotly_json import rounded
from gen_profile.presentation.charts.robustness import curves_figure, maps_figure
from gen_profile.presentation.studio.curves_json import curves_json
from gen_profile.presentation.studio.orders import Question
from gen_profile.presentation.studio.views import point
from gen_profile.presentation.studio.workers import Part
from gen_profile.spec.model import Spec
from gen_profile.studies.comparison.candidates import own_method
from gen_profile.studies.comparison.compare import ComparedMethod, Comparison, compare
from gen_profile.studies.comparison.robustness import error_grid, robustness_of
from gen_profile.support.errors import GenProfileError

CURVES = 3  # parameters that have a robustness curve
MAP_POINTS = 15  # of each parameter's error
RIVALS = 3  # methods beside the design's own in it


def depth(question: Question) -> Iterator[Part]:
    """Show what takes longer: the spectrum, other methods, and residual sway over the parameters' errors."""
    try:
        planned = plan(question.spec())
        spec, evaluation = planned.spec, planned.evaluation
        yield {"part": "spectrum", "panels": curves_json(spectrum_figure(spec, evaluation))}
        own = own_method(spec)
        yield _robustness(spec, own, {own: evaluation.motion})
        yield _maps(spec, {own: evaluation.motion})
        comparison = compare(spec)
        yield _comparison(comparison, own)
        rivals = {row.method: row.evaluation.motion for row in _rivals(comparison, own)}
        yield _robustness(spec, own, {own: evaluation.motion, **rivals})
    except GenProfileError:  # the picture says why
        return


def _comparison(compared: Comparison, own: str) -> Part:
    spec, advised = compared.spec, compared.recommended.values()
    return {
        "part": "comparison",
        "own": own,
        "limit": min(spec.check.residual_sway.values()),
        "unit": compared.unit,
        "rows": [
            {
                **point(row.method, row.figures),
                "safe": row.safe,
                "pareto": row.method in compared.efficient,
                "edits": dict(row.changes),
            }
            for row in compared.rows
        ],
        "missing": compared.missing(),
        "recommended": {advice.aim: advice.method for advice in advised if advice.method},
    }


def _rivals(compared: Comparison, own: str) -> Sequence[ComparedMethod]:
    """Choose the methods that leave the least sway, the best shaper among them."""
    others = [row for row in compared.rows if row.method != own]
    others.sort(key=lambda row: row.figures["sway_residual_worst_m"])
    shapers = [row for row in others if not row.method.startswith("optimal")]
    return list({row.method: row for row in [*shapers[:1], *others]}.values())[:RIVALS]


def _maps(spec: Spec, motions: Mapping[str, Profile]) -> Part:
    """Show what is left where two parameters are off at once; no map where fewer are uncertain."""
    names = list(spec.robustness.uncertain)[:2]
    if len(names) < 2:
        return {"part": "maps", "maps": []}
    figure = maps_figure(robustness_of(spec, motions, error_grid(spec, names, MAP_POINTS)))
    return {"part": "maps", "maps": [_map(panel) for panel in figure.panels if isinstance(panel, Map)]}


def _map(panel: Map) -> dict[str, Any]:
    return {
        "title": panel.title,
        "x_label": panel.x_label,
        "y_label": panel.y_label,
        "x": rounded(panel.x),
        "y": rounded(panel.y),
        "values": [rounded(row) for row in panel.values],
        "frame": panel.frame,
    }


def _robustness(spec: Spec, own: str, motions: Mapping[str, Profile]) -> Part:
    names = list(spec.robustness.uncertain)[:CURVES]
    curves = {name: robustness_of(spec, motions, error_grid(spec, (name,))) for name in names}
    styles = method_styles(motions, [own])
    return {"part": "robustness", "panels": curves_json(curves_figure(curves, styles)) if curves else []}
