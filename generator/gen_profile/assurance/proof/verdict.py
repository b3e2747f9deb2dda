"""What the proof of a planner block found: values only, no work."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from gen_profile.assurance.proof.exercised import Pairs, never, table
from gen_profile.assurance.proof.followed import LATENESS
from gen_profile.assurance.proof.histories import History
from gen_profile.assurance.proof.lateness import Promptness
from gen_profile.assurance.proof.numbering import CORNERS, DRAWS, LONG, RHYTHMS, SEARCH
from gen_profile.assurance.proof.obedience import LATE, WORDS
from gen_profile.assurance.proof.promptness import Obeyed
from gen_profile.assurance.verification.verdict import QUANTILES, Examination
from gen_profile.support.summary import Summarised

GROUPS = {
    CORNERS: "ends of all live and uncertain ranges at once",
    DRAWS: "drawn from all ranges and commands",
    SEARCH: "steps that climb from the worst of these",
    RHYTHMS: "many commands in one rhythm, and steps that climb from the worst",
    LONG: "eight hours of commands",
}
HISTORIES = 200  # that a proof takes; fewer are a trial
RULE_OF_THREE = 3.0
AGREEMENT = 1e-9  # m, by which FMPy may find another sway
LISTED = 10  # of the worst histories
TAKEN_BACK = "the block takes its promise back"


@attrs.frozen(kw_only=True, eq=False)
class JudgedHistory:
    """One history, and what became of it.

    Attributes
    ----------
    number : int
    group : str
        One of `GROUPS`.
    history : History
    cycles : int
    rests_after : float or None
        Time in s from the last command to standstill.
    promise : bool
        Whether the block promises at the end, by what it knows itself, that no sway remains.
    residual, on_the_way : mapping of str to float
        Greatest sway of every load in m: once the axes stand, and at any time.
    limits : mapping of str to float
        Of every axis the greatest velocity, acceleration and jerk, each as a share of its limit, and by how
        much, in m (or rad), the travel was left.
    faults : tuple of str
        What else is wrong, in words that end a sentence.
    left : float
        m, that stated errors leave at most on the linear machine, as long as the block promises.
    overstated : float
        `fSwayLeft` by what stated errors leave if each axis and mode has a worst machine of its own, at most.
    obeyed : tuple of Obeyed
        How soon its commands were carried out.
    exercised : mapping
        How often inputs changed, and outputs came, in which state.
    """

    number: int
    group: str
    history: History
    cycles: int
    rests_after: float | None
    promise: bool
    residual: Mapping[str, float]
    on_the_way: Mapping[str, float]
    limits: Mapping[str, float]
    faults: tuple[str, ...]
    left: float = 0.0
    overstated: float = 0.0
    obeyed: tuple[Obeyed, ...] = ()
    exercised: Pairs = attrs.field(factory=dict)

    def fraction(self, limit: Mapping[str, float], error_bound: float) -> float:
        """Share of the limits of residual sway that it takes up; 0 where the block promises nothing."""
        if not self.promise:
            return 0.0
        return max((self.residual[load] + error_bound) / most for load, most in limit.items())

    def compared(self) -> "JudgedHistory":
        """Ask the linear programme how soon the latest of its commands could have been obeyed."""
        latest = max(self.obeyed, key=lambda one: one.overdue(LATENESS), default=None)
        return attrs.evolve(
            self, obeyed=tuple(one.compared() if one is latest else one for one in self.obeyed)
        )

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "number": self.number,
            "group": self.group,
            **self.history.starts,
            "live": dict(self.history.live),
            "parameters": dict(self.history.parameters),
            "commands": [self.history.described(command) for command in self.history.commands],
            "changes": self.history.other_inputs,
            **({} if self.history.sensed is None else {"sensor": self.history.sensed.to_dict()}),
            "hoisting": {
                name: [{"time_s": time, "value": value} for time, value in corners]
                for name, corners in self.history.hoisting.items()
            },
            "promise": self.promise,
            "rests_after_s": self.rests_after,
            "residual_peaks_m": dict(self.residual),
            "sway_peaks_m": dict(self.on_the_way),
            "limits": dict(self.limits),
            "faults": list(self.faults),
        }


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Proof(Summarised, Examination):
    """Verdict on a planner block; on fewer than `HISTORIES` it is called a trial.

    Attributes
    ----------
    limit : mapping of str to float
        Allowed residual sway of every load in m.
    error_bound : float
        No residual is further than this from the truth, in m.
    seed, count : int
        With which the histories were drawn, and how many.
    parents : sequence of sequences of int
        From which histories each round of the search began.
    judged : tuple of JudgedHistory
    by_fmpy : tuple of int
        Numbers of the histories that FMPy's own importer co-simulated, too.
    apart : float
        m, by which it found another sway at most.
    sway_limit : float or None
        Allowed sway of the end load at any time in m, which no planner block keeps.
    overshoot_limit : float or None
        Likewise, how far it may pass its target.
    demanded : float or None
        Times what is possible that a command may take, as the spec states.
    required : sequence of (str, str)
        Inputs or outputs, and states, that must have been tried together.
    faults : tuple of str
        What else is wrong with the file, a sentence each.
    """

    limit: Mapping[str, float]
    error_bound: float
    seed: int
    count: int
    parents: Sequence[Sequence[int]]
    judged: tuple[JudgedHistory, ...]
    by_fmpy: tuple[int, ...]
    apart: float
    sway_limit: float | None = None
    overshoot_limit: float | None = None
    demanded: float | None = None
    required: Sequence[tuple[str, str]] = ()
    faults: tuple[str, ...] = ()

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {
            self.kind: "passed" if self.passed else "failed",
            "prompt": self.lateness.words(),
            "histories": self.carried_by,
            "worst": f"history {self.worst.number}, {100.0 * self.fraction(self.worst):.3g} % of the limit",
        }

    def fraction(self, judged: JudgedHistory) -> float:
        """Share of the limit of residual sway that a history takes up, the error bound included."""
        return judged.fraction(self.limit, self.error_bound)

    @property
    def kind(self) -> str:
        """What it is called: a proof, or a trial."""
        return "proof" if self.count >= HISTORIES else "trial"

    @property
    def promised(self) -> int:
        """In how many of the histories the block promises at the end that no sway remains."""
        return sum(one.promise for one in self.judged)

    @property
    def carried_by(self) -> str:
        """Say by how many histories it is carried."""
        of = "" if self.kind == "proof" else f" of the {HISTORIES} that make a proof"
        return f"{len(self.judged)} histories{of}, {self.promised} of them promised"

    @property
    def worst(self) -> JudgedHistory:
        """The history that takes up the greatest share of the limit."""
        return max(self.judged, key=self.fraction)

    @property
    def lateness(self) -> Promptness:
        """How prompt the block is."""
        return Promptness(
            demanded=self.demanded,
            commands=[(one.number, command) for one in self.judged for command in one.obeyed],
        )

    @property
    def loosest(self) -> JudgedHistory | None:
        """The history, rhythms excepted, in which `fSwayLeft` is overstated most; none without any."""
        judged = [one for one in self.judged if one.group not in (RHYTHMS, LONG) and one.overstated]
        return max(judged, key=lambda one: one.overstated, default=None)

    def tightness(self) -> str:
        """Say how much higher than what stated errors leave the block says that they may."""
        if (one := self.loosest) is None:
            return "fSwayLeft was compared in no history"
        times = f"fSwayLeft states at most {one.overstated:.3g} times what errors may leave"
        return f"{times}, in history {one.number}: safe, but where that is much, promises are given up early"

    def reasons(self) -> tuple[str, ...]:
        """Say why the proof failed, a sentence each; none when it passed."""
        return (*self.unsafe(), *self.lateness.reasons())

    @property
    def exercised(self) -> Counter[tuple[str, str]]:
        """How often inputs changed, and outputs came, in which state, in all histories."""
        return sum((Counter(one.exercised) for one in self.judged), Counter())

    @property
    def bound(self) -> tuple[int, float]:
        """Count the histories that were drawn by chance, and bound the share of such that would fail.

        Where none of n fails, less than 3/n would, at 95 % (the rule of three).
        """
        drawn = len(self._of(DRAWS))
        return drawn, min(1.0, RULE_OF_THREE / max(drawn, 1))

    def sureness(self) -> str:
        """Say what the histories that were drawn by chance bound."""
        drawn, share = self.bound
        failed = sum(bool(one.faults) for one in self._of(DRAWS))
        if failed or not drawn:
            return f"{failed} of {drawn} drawn by chance fail, with the seed {self.seed}"
        return (
            f"none of {drawn} drawn by chance fails: fewer than {100.0 * share:.3g} % of such would (at 95 %)"
        )

    def unsafe(self) -> tuple[str, ...]:
        """Say why the block is not safe, a sentence each."""
        sentences = []
        if self.fraction(self.worst) > 1.0:
            load = max(self.limit, key=lambda name: self.worst.residual[name] / self.limit[name])
            sentences.append(
                f"The {load} sways by {1e3 * self.worst.residual[load]:.4g} mm after history "
                f"{self.worst.number} of {self.count}, and {1e3 * self.limit[load]:.4g} mm are allowed "
                "(check.residual_sway): narrow check.uncertain, allow more, or accelerate less."
            )
        by_kind: dict[str, list[JudgedHistory]] = {}
        for judged in self.judged:
            for fault in judged.faults:
                by_kind.setdefault(kind_of(fault), []).append(judged)
        for kind, those in by_kind.items():
            first = next(fault for fault in those[0].faults if kind_of(fault) == kind)
            others = f", and likewise in {len(those) - 1} others" if len(those) > 1 else ""
            cure = CURES.get(kind, "")
            sentences.append(f"In history {those[0].number} of {self.count} {first}{others}{cure}.")
        if not sentences and len(self.judged) == self.count and not self.promised:
            sentences.append(
                f"None of the {self.count} histories ends with a promise, so no sway was judged: try more, "
                f"as {HISTORIES} make a proof."
            )
        if missing := never(self.exercised, self.required):
            sentences.append(
                f"No history tried {', '.join(missing)}: prove it on more (--histories), or draw others "
                "(check.seed)."
            )
        if not self.apart <= AGREEMENT:
            sentences.append(
                f"FMPy co-simulates another sway, by {self.apart:.2g} m; this is an error of gen-profile: "
                "please report it."
            )
        return (*sentences, *self.faults)

    def warnings(self) -> tuple[str, ...]:
        """Say what is wrong without counting: sway on the way, and a limit that is not looked at."""
        if self.overshoot_limit is not None:
            return (*self._swaying(), "limits.overshoot is stated, which a planner block does not look at.")
        return self._swaying()

    def _swaying(self) -> tuple[str, ...]:
        end_load = list(self.limit)[-1]
        swaying = max(self.judged, key=lambda one: one.on_the_way[end_load])
        if self.sway_limit is None or swaying.on_the_way[end_load] <= self.sway_limit:
            return ()
        return (
            f"The {end_load} sways by {1e3 * swaying.on_the_way[end_load]:.4g} mm on the way in history "
            f"{swaying.number}, and {1e3 * self.sway_limit:.4g} mm are stated (limits.sway), which a planner "
            "block does not look at: accelerate less.",
        )

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON and the manifest."""
        ranked = sorted(self.judged, key=self.fraction, reverse=True)
        return {
            "passed": self.passed,
            "trial": self.kind == "trial",
            "safe": not self.unsafe(),
            "prompt": self.lateness.to_dict(),
            "tight": (one := self.loosest) and {"history": one.number, "sway_left": one.overstated},
            "limits_m": dict(self.limit),
            "error_bound_m": self.error_bound,
            "histories": self.count,
            "promised": self.promised,
            "seed": self.seed,
            "slowed": True,  # as those of the first manifests were not
            "habits": True,
            "search_parents": [list(numbers) for numbers in self.parents],
            "share": self.fraction(self.worst),
            "worst": self.described(self.worst),
            "next_worst": [
                {"number": one.number, "share": self.fraction(one), "promise": one.promise}
                for one in ranked[1:LISTED]
            ],
            "groups": [self._group(name) for name in GROUPS if self._of(name)],
            "limits": {name: max(one.limits[name] for one in self.judged) for name in self.judged[0].limits},
            "longest_rest_s": max((one.rests_after or 0.0 for one in self.judged), default=0.0),
            "bound": dict(zip(("drawn", "fewer_than"), self.bound, strict=True)),
            "exercised": table(self.exercised),
            "fmpy": {"histories": list(self.by_fmpy), "apart_m": self.apart},
            "reasons": list(self.reasons()),
        }

    def described(self, judged: JudgedHistory) -> dict[str, Any]:
        """Nest plain values of a history for JSON, its share of the limit among them."""
        return {**judged.to_dict(), "share": self.fraction(judged)}

    def _of(self, group: str) -> list[JudgedHistory]:
        return [one for one in self.judged if one.group == group]

    def _group(self, name: str) -> dict[str, Any]:
        shares = [self.fraction(one) for one in self._of(name)]
        quantiles = np.quantile(shares, QUANTILES)
        return {
            "group": name,
            "what": GROUPS[name],
            "histories": len(shares),
            "worst_share": max(shares),
            "quantiles": {f"{part:g}": float(q) for part, q in zip(QUANTILES, quantiles, strict=True)},
        }


def kind_of(fault: str) -> str:
    """Leave out the numbers of a fault."""
    return re.split(" by |, at ", fault, maxsplit=1)[0]


CURES = {
    kind_of(WORDS[what]): "; where the controller can do more in a cycle, raise planner.operations, as plans "
    "then come sooner"
    for what in LATE
} | {WORDS["given up"]: ": narrow check.uncertain, allow more (check.residual_sway), or accelerate less"}
