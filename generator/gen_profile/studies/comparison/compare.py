"""Optimal motions and shapers side by side, on the same machines, and which of them to take."""

from collections.abc import Mapping, Sequence
from typing import Any

import attrs

from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation, evaluate, keeps_residual_sway
from gen_profile.dynamics.evaluation.phrases import mm, number
from gen_profile.motion.profile import Profile
from gen_profile.spec.model import Spec
from gen_profile.studies.comparison.candidates import Candidate, candidates
from gen_profile.support.errors import GenProfileError, InfeasibleProblem
from gen_profile.support.phrase import Phrase, joined
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.summary import Drawable, Tabled

SAME = 1e-3  # relative difference of figures that says nothing
# what one would like less of
OBJECTIVES = ("duration_s", "acceleration_max_m_per_s2", "sway_transient_peak_m", "sway_residual_worst_m")

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
    beaten = {name for name, row in rows.items() if any(_dominates(other, row) for other in rows.values())}
    return frozenset(rows.keys() - beaten)


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
        Of the axis.
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
        second, kind = best(others), "shaper" if winner in optimal else "optimal motion"
        words += f"; the best {kind}, {second}: {figure(second)}"
    kept = f"Of the methods that keep the residual sway below {limit} on all machines, it"
    return Recommendation(method=winner, reason=f"{kept} {does} ({words}).", aim=aim, figures=words)


def _dominates(one: Figures, other: Figures) -> bool:
    """Tell whether one row is nowhere worse than the other, and better somewhere."""
    pairs = [(one[objective], other[objective]) for objective in OBJECTIVES]
    return all(a <= b * (1.0 + SAME) for a, b in pairs) and any(a < b * (1.0 - SAME) for a, b in pairs)


@attrs.frozen(kw_only=True, eq=False)
class ComparedMethod:
    """A method that has a motion for the move.

    Attributes
    ----------
    method : str
    evaluation : MotionEvaluation
    figures : dict of str to float
    safe : bool
        Whether every load keeps its limit of residual sway on all machines.
    changes : mapping of str to value
        By which a spec asks for the method, as of `gen_profile.studies.comparison.candidates.Candidate`.
    """

    method: str
    evaluation: MotionEvaluation
    figures: dict[str, float]
    safe: bool
    changes: Mapping[str, Any]


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Comparison(Drawable, Tabled):
    """All methods, and which to take.

    Attributes
    ----------
    spec : Spec
    rows : tuple of ComparedMethod
    left_out : dict of str to str
        Methods without a motion for the move, and why.
    too_slow : dict of str to float
        Of these the ones that would have a motion in more time: how much in s.
    efficient : frozenset of str
        Methods on the Pareto front.
    recommended : dict of str to Recommendation
        ``fastest`` and ``gentlest``.
    """

    spec: Spec
    rows: tuple[ComparedMethod, ...]
    left_out: dict[str, str]
    too_slow: dict[str, float]
    efficient: frozenset[str]
    recommended: dict[str, Recommendation]

    @property
    def leading(self) -> int:
        """Number of the axis that figures and curves are of."""
        return self.rows[0].evaluation.motion.leading if self.rows else 0

    @property
    def unit(self) -> str:
        """Its unit."""
        return self.spec.machine().actuated[self.leading].unit

    def records(self) -> list[dict[str, object]]:
        """List the methods with their figures, and whether every load keeps its limit."""
        return [{"method": row.method, **row.figures, "safe": row.safe} for row in self.rows]

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {
            "name": self.spec.name,
            "methods": ", ".join(row.method for row in self.rows),
            "left out": ", ".join(self.left_out) or "none",
            **{kind: advice.method for kind, advice in self.recommended.items()},
        }

    def advice(self) -> tuple[str, ...]:
        """Say which methods to take, in short; or that none will do."""
        given = self.recommended.values()
        named = [f"{one.aim.capitalize()}: {one.method} ({one.figures})" for one in given if one.method]
        if not named:
            return tuple(dict.fromkeys(one.reason for one in given))
        limit = _limit_in_words(self.spec)
        return (f"Recommended, of those that keep the residual sway below {limit} on all machines:", *named)

    def missing(self) -> tuple[str, ...]:
        """Say which methods have no motion: those that want more time together, others with the reason."""
        by_time: dict[float, list[str]] = {}
        for method, least in self.too_slow.items():
            by_time.setdefault(least, []).append(method)
        slow = [
            Phrase("{methods} (at least {duration:g} s)", methods=", ".join(methods), duration=duration)
            for duration, methods in by_time.items()
        ]
        missing = [
            Phrase("{method}: {reason}", method=name, reason=reason)
            for name, reason in self.left_out.items()
            if name not in self.too_slow
        ]
        if slow:
            template, duration = "Need more than {duration:g} s: {methods}", self.spec.move.duration
            missing.insert(0, Phrase(template, duration=duration, methods=joined("{first}; {others}", slow)))
        return tuple(missing)

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON; see the command-line contract."""
        return {
            "name": self.spec.name,
            "spec_sha256": self.spec.sha256(),
            "base": self.spec.solver.base,
            "rows": [
                {
                    "method": row.method,
                    "figures": row.figures,
                    "keeps_residual_sway": row.safe,
                    "pareto": row.method in self.efficient,
                }
                for row in self.rows
            ],
            "left_out": [{"method": method, "reason": reason} for method, reason in self.left_out.items()],
            "recommended": {kind: advice.method for kind, advice in self.recommended.items()},
            "reasons": {kind: advice.reason for kind, advice in self.recommended.items()},
        }


def compare(spec: Spec, progress: Progress = no_progress, *, own: Sequence[Profile] = ()) -> Comparison:
    """Try every shaper, variants of the optimal motion, and own motions on the machines of a spec."""
    rows: list[ComparedMethod] = []
    left_out: dict[str, str] = {}
    too_slow: dict[str, float] = {}
    impossible: dict[str, str] = {}
    listed = tuple(candidates(spec, own))
    for done, candidate in enumerate(listed):
        progress("comparing", done, len(listed), candidate.method)
        try:
            if candidate.requirements in impossible:
                left_out[candidate.method] = impossible[candidate.requirements]
            else:
                rows.append(_row(spec, candidate))
        except GenProfileError as error:
            left_out[candidate.method] = joined("{first} {others}", error.sentences)
            if isinstance(error, InfeasibleProblem) and error.least_duration is not None:
                too_slow[candidate.method] = error.least_duration
            elif isinstance(error, InfeasibleProblem) and candidate.requirements:
                impossible[candidate.requirements] = left_out[candidate.method]
    figures = {row.method: row.figures for row in rows}
    safe = {row.method: row.figures for row in rows if row.safe}
    optimal = [name for name in figures if name.startswith("optimal")]
    compared = Comparison(
        spec=spec,
        rows=tuple(rows),
        left_out=left_out,
        too_slow=too_slow,
        efficient=efficient(figures),
        recommended={},
    )
    advice = recommend(safe, limit=_limit_in_words(spec), unit=compared.unit, optimal=optimal)
    return attrs.evolve(compared, recommended=advice)


def _row(spec: Spec, candidate: Candidate) -> ComparedMethod:
    evaluation = evaluate(spec, candidate.design())
    return ComparedMethod(
        method=candidate.method,
        evaluation=evaluation,
        figures=evaluation.figures,
        safe=keeps_residual_sway(spec, evaluation),
        changes=candidate.changes,
    )


def _limit_in_words(spec: Spec) -> str:
    limits = spec.check.residual_sway
    if len(set(limits.values())) == 1:
        return mm(next(iter(limits.values())))
    return ", ".join(f"{mm(limit)} ({load})" for load, limit in limits.items())
