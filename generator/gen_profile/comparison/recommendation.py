"""Which of several motions to take, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import attrs

from gen_profile.evaluation.phrases import number

SAME = 1e-3  # relative difference of figures that says nothing
# what one would like less of
OBJECTIVES = (
    "duration_s",
    "acceleration_max_m_per_s2",
    "sway_transient_peak_m",
    "sway_residual_worst_m",
)

# what a method may be best at: objective, how many of the unit make one of it, unit, what it does
AIMS = {
    "least time": ("duration_s", 1.0, "s", "takes the least time"),
    "least acceleration": ("acceleration_max_m_per_s2", 1.0, "{}/s²", "asks for the least acceleration"),
    "least sway on the way": ("sway_transient_peak_m", 1e3, "mm", "swings the load least on the way"),
}

Figures = Mapping[str, float]


@attrs.frozen(kw_only=True)
class Recommendation:
    """A method, and the reason for it.

    Attributes
    ----------
    method : str or None
        None where no method will do.
    reason : str
        A sentence.
    aim : str
        What it is best at: ``least time``, ``least acceleration`` or ``least sway on the way``.
    figures : str
        What it takes there, and the best method of the other kind.
    """

    method: str | None
    reason: str
    aim: str = ""
    figures: str = ""


def efficient(rows: Mapping[str, Figures]) -> frozenset[str]:
    """Find the Pareto front: methods that no other one beats in some objective without losing in another."""
    return frozenset(
        method for method, row in rows.items() if not any(_dominates(other, row) for other in rows.values())
    )


def recommend(
    safe: Mapping[str, Figures], *, limit: str, unit: str, optimal: Sequence[str]
) -> dict[str, Recommendation]:
    """Choose the ``fastest`` and the ``gentlest`` of the methods that leave little enough sway.

    Parameters
    ----------
    safe : mapping of str to figures
    limit : str
        How much sway that is, in words.
    unit : str
        Of the first axis.
    optimal : sequence of str
        Which of the methods are optimal motions; the others are shapers.
    """
    if not safe:
        nothing = f"No method keeps the residual sway below {limit} on all machines."
        return dict.fromkeys(("fastest", "gentlest"), Recommendation(method=None, reason=nothing))
    durations = [row["duration_s"] for row in safe.values()]
    timed = max(durations) - min(durations) > SAME * min(durations)
    chosen = {"fastest": "least time" if timed else "least acceleration", "gentlest": "least sway on the way"}
    return {kind: _least(safe, aim, unit, optimal, limit) for kind, aim in chosen.items()}


def _least(
    rows: Mapping[str, Figures], aim: str, unit: str, optimal: Sequence[str], limit: str
) -> Recommendation:
    """Take the method of the least figure, and tell it beside that of the best method of the other kind."""
    objective, factor, of, does = AIMS[aim]

    def best(among: list[str]) -> str:
        least = min(rows[method][objective] for method in among)
        tied = [method for method in among if rows[method][objective] <= least * (1.0 + SAME)]
        return min(tied, key=lambda method: rows[method]["sway_residual_worst_m"])

    def figure(method: str) -> str:
        return f"{number(factor * rows[method][objective])} {of.format(unit)}"

    winner = best(list(rows))
    words = figure(winner)
    others = [method for method in rows if (method in optimal) != (winner in optimal)]
    if others:
        second = best(others)
        words += (
            f"; the best {'optimal motion' if second in optimal else 'shaper'}, {second}: {figure(second)}"
        )
    kept = f"Of the methods that keep the residual sway below {limit} on all machines, it"
    return Recommendation(method=winner, reason=f"{kept} {does} ({words}).", aim=aim, figures=words)


def _dominates(one: Figures, other: Figures) -> bool:
    """Tell whether one row is nowhere worse than the other, and better somewhere."""
    pairs = [(one[objective], other[objective]) for objective in OBJECTIVES]
    return all(a <= b * (1.0 + SAME) for a, b in pairs) and any(a < b * (1.0 - SAME) for a, b in pairs)
