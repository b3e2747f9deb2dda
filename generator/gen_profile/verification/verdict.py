"""What a check found: values only, no work."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from gen_profile.errors import CheckFailed
from gen_profile.evaluation.scenarios import GROUPS, TIMING, Scenario

QUANTILES = (0.5, 0.9, 0.99)
FINE = 1e3  # µm, up to which an error is told in these
MOST_LISTED = 50  # rows of a group; of a larger one the worst are listed, lest a manifest hold thousands


@attrs.frozen(kw_only=True)
class Finding:
    """How much one machine sways once its axes stand still.

    Attributes
    ----------
    scenario : Scenario
    residual : mapping of str to float
        Greatest sway of every load in m.
    modal : mapping of str to float
        Sum of the modes' amplitudes at standstill in m: what the sway of every load can ever reach.
    """

    scenario: Scenario
    residual: Mapping[str, float]
    modal: Mapping[str, float]


@attrs.frozen(kw_only=True)
class Check:
    """Verdict on one artefact.

    Attributes
    ----------
    limit : mapping of str to float
        Allowed residual sway of every load in m; the end load is the last one, or the last `directions`.
    error_bound : float
        No residual is further than this from the truth, in m.
    arrival : float
        When the axes stand still, in s.
    findings : tuple of Finding
    directions : int
        In how many directions the end load swings.
    faults : tuple of str
        What else is wrong with the artefact, a sentence each.
    strict : bool
        Whether faults in the timing of setpoints count as well.
    doubts : tuple of str
        What the spec states and hardly means, a sentence each.
    """

    limit: Mapping[str, float]
    error_bound: float
    arrival: float
    findings: tuple[Finding, ...]
    directions: int = 1
    faults: tuple[str, ...] = ()
    strict: bool = False
    doubts: tuple[str, ...] = ()

    @property
    def groups(self) -> dict[str, tuple[Finding, ...]]:
        """Findings by group, in the order of `GROUPS`."""
        by_name = {
            name: tuple(found for found in self.findings if found.scenario.group == name) for name in GROUPS
        }
        return {name: findings for name, findings in by_name.items() if findings}

    @property
    def judged(self) -> tuple[Finding, ...]:
        """Findings that the verdict rests on."""
        counted = tuple(found for found in self.findings if self.strict or found.scenario.group != TIMING)
        return counted or self.findings

    @property
    def passed(self) -> bool:
        """Whether every load keeps its limit in every scenario, the error bound included."""
        return not self.reasons()

    def raise_for_failure(self) -> None:
        """Do nothing where the check passed.

        Raises
        ------
        CheckFailed
            With the reasons.
        """
        if not self.passed:
            raise CheckFailed("\n".join(self.reasons()))

    def keeps_limit(self, finding: Finding) -> bool:
        """Whether every load keeps its limit in one scenario, the error bound included."""
        return all(finding.residual[load] + self.error_bound <= limit for load, limit in self.limit.items())

    @property
    def worst(self) -> tuple[str, Finding]:
        """The load that takes up the greatest share of its limit, and where."""
        return self.worst_of(self.judged)

    def worst_of(self, findings: Sequence[Finding]) -> tuple[str, Finding]:
        """Find the load that takes up the greatest share of its limit in some scenarios, and where."""
        pairs = [(load, finding) for finding in findings for load in self.limit]
        return max(pairs, key=lambda pair: pair[1].residual[pair[0]] / self.limit[pair[0]])

    @property
    def demand(self) -> float:
        """Share of its limit that the worst load takes up; infinite where something else is wrong."""
        load, finding = self.worst
        share = (finding.residual[load] + self.error_bound) / self.limit[load]
        return float("inf") if self.faults else share

    def reasons(self) -> tuple[str, ...]:
        """Say why the check failed, a sentence each; none when it passed."""
        if all(self.keeps_limit(finding) for finding in self.judged):
            return self.faults
        return (self._sentence(*self.worst), *self.faults)

    def warnings(self) -> tuple[str, ...]:
        """Say what is wrong without counting: doubtful values, and sway under faults of timing."""
        timing = () if self.strict else self.groups.get(TIMING, ())
        if all(map(self.keeps_limit, timing)):
            return self.doubts
        return (*self.doubts, self._sentence(*self.worst_of(timing)) + " It counts with --strict.")

    def _sentence(self, load: str, finding: Finding) -> str:
        micrometres = float(f"{1e6 * self.error_bound:.2g}")
        error = f"{micrometres:g} µm" if micrometres < FINE else f"{micrometres / 1e3:g} mm"
        return (
            f"The {load} sways by {1e3 * finding.residual[load]:.4g} mm after the move "
            f"({finding.scenario.name}), and {1e3 * self.limit[load]:.4g} mm are allowed "
            f"(check.residual_sway; numerical error up to {error})."
        )

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON and the manifest."""
        return {
            "passed": self.passed,
            "limit_m": self.limit[list(self.limit)[-1]],
            "limits_m": dict(self.limit),
            "error_bound_m": self.error_bound,
            "arrival_s": self.arrival,
            "strict": self.strict,
            "groups": [self._group(name, findings) for name, findings in self.groups.items()],
            "scenarios": [
                {
                    "name": finding.scenario.name,
                    "row": finding.scenario.row,
                    "group": finding.scenario.group,
                    "parameters": dict(finding.scenario.parameters),
                    "lag_s": finding.scenario.lag,
                    "residual_peak_m": self._end_load(finding),
                    "residual_peaks_m": dict(finding.residual),
                    "residual_modal_m": dict(finding.modal),
                    "passed": self.keeps_limit(finding),
                }
                for finding in self.listed()
            ],
            "reasons": list(self.reasons()),
            "warnings": list(self.warnings()),
        }

    def listed(self) -> tuple[Finding, ...]:
        """Choose the findings worth a line: all of a small group, the first and the worst of a large one."""
        kept: list[Finding] = []
        for first, *rest in self.groups.values():
            share = sorted(map(self._share, rest), reverse=True)
            least = share[MOST_LISTED - 2] if len(rest) >= MOST_LISTED else 0.0
            kept += [first, *[finding for finding in rest if self._share(finding) >= least]]
        return tuple(kept)

    def _share(self, finding: Finding) -> float:
        return max(finding.residual[load] / limit for load, limit in self.limit.items())

    def _end_load(self, finding: Finding) -> float:
        return max(finding.residual[load] for load in list(self.limit)[-self.directions :])

    def _group(self, name: str, findings: Sequence[Finding]) -> dict[str, Any]:
        load, worst = self.worst_of(findings)
        quantiles = np.quantile([self._end_load(finding) for finding in findings], QUANTILES)
        return {
            "group": name,
            "what": GROUPS[name],
            "rows": len(findings),
            "passed": all(map(self.keeps_limit, findings)),
            "counts": self.strict or name != TIMING,
            "quantiles_m": {f"{share:g}": float(q) for share, q in zip(QUANTILES, quantiles, strict=True)},
            "worst": {"load": load, "row": worst.scenario.row, "residual_peak_m": worst.residual[load]},
        }
