"""Optimal motions and shapers side by side, on the same machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs

from gen_profile.comparison.candidates import Candidate, candidates
from gen_profile.comparison.recommendation import Recommendation, efficient, recommend
from gen_profile.errors import GenProfileError, InfeasibleProblem
from gen_profile.evaluation.motion_evaluation import MotionEvaluation, evaluate, keeps_residual_sway
from gen_profile.evaluation.phrases import mm
from gen_profile.motion.profile import Profile
from gen_profile.phrase import Phrase, joined
from gen_profile.progress import Progress, no_progress
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.summary import Drawable, Tabled


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
        By which a spec asks for the method, as of `gen_profile.comparison.candidates.Candidate`.
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


def compare(
    spec: Spec | Path | str, progress: Progress = no_progress, *, own: Sequence[Profile] | Profile = ()
) -> Comparison:
    """Try every shaper and variants of the optimal motion on the machines of a spec.

    Parameters
    ----------
    spec : Spec, or the path of one
    progress : callable
        Told what is being done.
    own : sequence of Profile, or Profile
        Further motions of the axes, each of a ``method`` of its own.

    Examples
    --------
    >>> gp.compare(gp.preset_spec("paper"))
    <Comparison name: paper, methods: nzv, zv, ... fastest: optimal-beta0, gentlest: optimal-beta50>
    """
    spec = as_spec(spec)
    rows: list[ComparedMethod] = []
    left_out: dict[str, str] = {}
    too_slow: dict[str, float] = {}
    impossible: dict[str, str] = {}
    listed = tuple(candidates(spec, (own,) if isinstance(own, Profile) else own))
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
    return Comparison(
        spec=spec,
        rows=tuple(rows),
        left_out=left_out,
        too_slow=too_slow,
        efficient=efficient(figures),
        recommended=recommend(
            {row.method: row.figures for row in rows if row.safe},
            limit=_limit_in_words(spec),
            unit=spec.machine().actuated[0].unit,
            optimal=[method for method in figures if method.startswith("optimal")],
        ),
    )


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
