"""The second verdict on a planner block: how prompt it is, beside what is possible."""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from gen_profile.assurance.proof.followed import LATENESS, PLANNING
from gen_profile.assurance.proof.promptness import KINDS, Obeyed

COMPARED = 4  # commands of each kind that are beside the linear programme, of the latest, and again by chance
QUANTILES = (0.5, 0.9)


@attrs.frozen(kw_only=True)
class Promptness:
    """How late commands are carried out, and what the spec demands.

    Attributes
    ----------
    demanded : float or None
        Times what is possible that a command may take, as the spec states.
    commands : sequence of (int, Obeyed)
        With the numbers of their histories.
    """

    demanded: float | None
    commands: Sequence[tuple[int, Obeyed]] = attrs.field(repr=False)

    @property
    def factor(self) -> float:
        """Times what is possible, from which on a command counts as late."""
        return self.demanded or LATENESS

    @property
    def late(self) -> list[tuple[int, Obeyed]]:
        """The late ones, the latest first."""
        late = [one for one in self.commands if one[1].is_late(self.factor)]
        return sorted(late, key=lambda one: -one[1].overdue(self.factor))

    @property
    def latest(self) -> tuple[int, Obeyed] | None:
        """The latest of those that are compared with the linear programme; without any, of all."""
        compared = [one for one in self.commands if one[1].possible is not None]
        return max(compared or self.commands, key=lambda one: one[1].overdue(self.factor), default=None)

    def reasons(self) -> list[str]:
        """Say what the spec demands and the block does not do; a sentence for each kind of command."""
        if self.demanded is None:
            return []
        by_kind: dict[str, list[tuple[int, Obeyed]]] = {}
        for one in self.late:
            by_kind.setdefault(one[1].kind, []).append(one)
        return [
            f"{_sentence(those[0])}, and {self.factor:g} times that and {PLANNING:g} s are demanded "
            f"(planner.lateness){f'; {len(those) - 1} others are late, too' if those[1:] else ''}: demand "
            "less, or raise planner.operations where the controller can do more in a cycle."
            for those in by_kind.values()
        ]

    def words(self) -> str:
        """Say in a line how prompt the block is."""
        if self.latest is None:
            return "no command held long enough to be timed"
        late = len(self.late)
        found = f"{late} of {len(self.commands)} commands" if late else f"all {len(self.commands)} commands"
        within = f"{self.factor:g} times the quickest and {PLANNING:g} s"
        number, one = self.latest
        worst = f"the latest: {_sentence((number, one))[3:]}"
        if not any(one.possible for _, one in self.commands):
            within += ", all by the closed form, as zones, ropes that change and sensors leave no other"
        take = f"take{'s' * (late == 1)} more than" if late else "within"
        return f"{found} {take} {within}; {worst}"

    def table(self) -> list[dict[str, Any]]:
        """Give plain values by kind of command, for JSON: shares that are late, and times by the quickest."""
        return [row for kind in KINDS if (row := self._row(kind))]

    def _row(self, kind: str) -> dict[str, Any]:
        those = [(number, one) for number, one in self.commands if one.kind == kind]
        if not those:
            return {}
        compared = [one.ratio for _, one in those if one.possible is not None]
        number, worst = max(those, key=lambda one: (one[1].overdue(self.factor), one[1].possible is not None))
        late = sum(one.is_late(self.factor) for _, one in those)
        return {
            "command": KINDS[kind],
            "commands": len(those),
            "late": late,
            "compared": len(compared),
            "by_quickest": {
                f"{part:g}": float(np.quantile(compared, part)) for part in (*QUANTILES, 1.0) if compared
            },
            "worst": {"history": number, **worst.to_dict()},
        }

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            "passed": not self.reasons(),
            "demanded": self.demanded,
            "lateness": self.factor,
            "planning_s": PLANNING,
            "late": len(self.late),
            "commands": self.table(),
        }


def _sentence(numbered: tuple[int, Obeyed]) -> str:
    number, command = numbered
    how = "possible" if command.possible is not None else "possible by the closed form"
    one = f"one of the {KINDS[command.kind]} ({command.state}) takes {command.takes:.3g} s"
    possible = f"where {command.quickest:.3g} s are {how}"
    return f"In history {number}, {one} at {command.begin:.2f} s, {possible}"


def chosen(commands: Sequence[Obeyed], seed: int) -> list[int]:
    """Choose of each kind the latest by the closed form, and some by chance, that can be compared."""
    random, places = np.random.default_rng(seed), set[int]()
    for kind in KINDS:
        own = [k for k, one in enumerate(commands) if one.kind == kind and one.case is not None]
        latest = sorted(own, key=lambda k: -commands[k].overdue(LATENESS))[:COMPARED]
        places |= {*latest, *random.permutation(own)[:COMPARED].tolist()}
    return sorted(places)
