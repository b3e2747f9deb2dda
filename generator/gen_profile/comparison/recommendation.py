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

Figures = Mapping[str, float]


@attrs.frozen(kw_only=True)
class Recommendation:
    """A method, and the reason for it.

    Attributes
    ----------
    method : str or None
        None where no method will do.
    reason : str
        One or more sentences.
    """

    method: str | None
    reason: str


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
    together = f"Of the methods that keep the residual sway below {limit} on all machines, it "
    if max(durations) - min(durations) > SAME * min(durations):
        fastest = _least(safe, "duration_s", 1.0, "s", optimal)
        speed = Recommendation(method=fastest[0], reason=f"{together}takes the least time {fastest[1]}.")
    else:
        fastest = _least(safe, "acceleration_max_m_per_s2", 1.0, f"{unit}/s²", optimal)
        speed = Recommendation(
            method=fastest[0],
            reason=f"{together}asks for the least acceleration {fastest[1]}: "
            "it leaves the drive the most room to make the move in less time "
            '(with move.duration = "minimum" each method takes its own shortest time).',
        )
    gentlest = _least(safe, "sway_transient_peak_m", 1e3, "mm", optimal)
    calm = Recommendation(
        method=gentlest[0], reason=f"{together}swings the load least on the way {gentlest[1]}."
    )
    return {"fastest": speed, "gentlest": calm}


def _least(
    rows: Mapping[str, Figures], objective: str, factor: float, unit: str, optimal: Sequence[str]
) -> tuple[str, str]:
    """Name the method of the least figure, and tell it beside that of the best method of the other kind."""

    def best(among: list[str]) -> str:
        least = min(rows[method][objective] for method in among)
        alike = [method for method in among if rows[method][objective] <= least * (1.0 + SAME)]
        return min(alike, key=lambda method: rows[method]["sway_residual_worst_m"])

    winner = best(list(rows))
    words = f"({number(factor * rows[winner][objective])} {unit}"
    others = [method for method in rows if (method in optimal) != (winner in optimal)]
    if others:
        second = best(others)
        kind = "optimal motion" if second in optimal else "shaper"
        words += f"; the best {kind}, {second}: {number(factor * rows[second][objective])} {unit}"
    return winner, words + ")"


def _dominates(one: Figures, other: Figures) -> bool:
    """Tell whether one row is nowhere worse than the other, and better somewhere."""
    pairs = [(one[objective], other[objective]) for objective in OBJECTIVES]
    return all(a <= b * (1.0 + SAME) for a, b in pairs) and any(a < b * (1.0 - SAME) for a, b in pairs)
