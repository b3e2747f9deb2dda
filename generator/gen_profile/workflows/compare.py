"""Optimal motions and shapers side by side, on the same machines."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import attrs

from gen_profile.errors import GenProfileError
from gen_profile.problem.linearization import linearize
from gen_profile.problem.problem import problem_of
from gen_profile.profile import Profile
from gen_profile.shapers.impulses import SHAPERS
from gen_profile.shapers.shaped_move import shaped_profile
from gen_profile.solvers import choice
from gen_profile.solvers.motion import optimal_profile
from gen_profile.spec import Spec
from gen_profile.workflows.planning import Trial, figures, timed, try_motion

SWAY_WEIGHTS = (0.0, 20.0, 50.0)  # the paper's

Progress = Callable[[str], None]


@attrs.frozen(kw_only=True, eq=False)
class Row:
    """One method.

    Attributes
    ----------
    method : str
    trial : Trial or None
        None when the method has no motion for this move.
    figures : dict of str to float
        Empty without a motion.
    reason : str
        Why there is no motion.
    """

    method: str
    trial: Trial | None
    figures: dict[str, float]
    reason: str = ""


@attrs.frozen(kw_only=True, eq=False)
class Comparison:
    """All rows, and which to take.

    Attributes
    ----------
    spec : Spec
    rows : tuple of Row
    recommended : dict of str to (str or None)
        ``fastest`` and ``gentlest``.
    reasons : dict of str to str
    """

    spec: Spec
    rows: tuple[Row, ...]
    recommended: dict[str, str | None]
    reasons: dict[str, str]

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON; see the command-line contract."""
        return {
            "name": self.spec.name,
            "spec_sha256": self.spec.sha256(),
            "rows": [{"method": row.method, "figures": row.figures} for row in self.rows if row.trial],
            "left_out": [{"method": row.method, "reason": row.reason} for row in self.rows if not row.trial],
            "recommended": self.recommended,
            "reasons": self.reasons,
        }


def compare(spec: Spec, progress: Progress = lambda _: None) -> Comparison:
    """Try every shaper and the optimal motion with several weights of sway on the machines of a spec."""
    spec = timed(spec)
    rows = []
    for method, make in _methods(spec):
        progress(method)
        try:
            trial = try_motion(spec, make())
            rows.append(Row(method=method, trial=trial, figures=figures(trial)))
        except GenProfileError as error:
            rows.append(Row(method=method, trial=None, figures={}, reason=str(error)))
    recommended, reasons = _recommend(spec, [row for row in rows if row.trial])
    return Comparison(spec=spec, rows=tuple(rows), recommended=recommended, reasons=reasons)


def _methods(spec: Spec) -> Iterator[tuple[str, Callable[[], Profile]]]:
    """Name every method, with the function that designs its motion."""
    for name in SHAPERS:
        yield name, partial(_shaped, spec, name)
    for weight in sorted({*SWAY_WEIGHTS, spec.cost.sway_weight}):
        yield f"optimal-beta{weight:g}", partial(_optimal, spec, weight)


def _shaped(spec: Spec, name: str) -> Profile:
    move = spec.move
    # where the load would swing on; a shaper knows one frequency per mode, whatever the hoist does on the way
    linear = linearize(spec.machine(), spec.plant.parameters, move.target)
    return shaped_profile(
        name,
        start=move.start,
        target=move.target,
        duration=move.duration,
        frequencies=linear.distinct_frequencies,
    )


def _optimal(spec: Spec, sway_weight: float) -> Profile:
    problem = attrs.evolve(problem_of(spec), sway_weight=sway_weight)
    return optimal_profile(choice.solve(problem, spec.solver.method))


def _recommend(spec: Spec, rows: list[Row]) -> tuple[dict[str, str | None], dict[str, str]]:
    """Choose among the methods whose worst residual sway keeps the limit.

    All rows take the same time, so the fastest is the one that a given drive could shorten most.
    """
    limit = list(spec.check.residual_sway.values())[-1]
    safe = [row for row in rows if row.figures["sway_residual_worst_m"] <= limit]
    if not safe:
        reason = f"No method keeps the residual sway below {1e3 * limit:.3g} mm on all machines."
        return {"fastest": None, "gentlest": None}, {"fastest": reason, "gentlest": reason}
    fastest = min(safe, key=lambda row: row.figures["acceleration_max_m_per_s2"])
    acceleration, unit = fastest.figures["acceleration_max_m_per_s2"], spec.machine().actuated[0].unit
    gentlest = min(safe, key=lambda row: row.figures["sway_transient_peak_m"])
    return {"fastest": fastest.method, "gentlest": gentlest.method}, {
        "fastest": (
            f"Of the methods that keep the residual sway below {1e3 * limit:.3g} mm on all machines, "
            f"it asks for the least acceleration ({acceleration:.3g} {unit}/s²): "
            "the same drive could make the move in the shortest time with it."
        ),
        "gentlest": (
            f"Of the same methods, it swings the load least on the way "
            f"({1e3 * gentlest.figures['sway_transient_peak_m']:.3g} mm)."
        ),
    }
