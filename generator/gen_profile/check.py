"""What a check found: values only, no work."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import attrs


@attrs.frozen(kw_only=True)
class Scenario:
    """A machine that the check moves.

    Attributes
    ----------
    name : str
        Such as ``"nominal"`` or ``"L1 +20 %"``.
    parameters : mapping of str to float
        Value of every plant parameter.
    """

    name: str
    parameters: Mapping[str, float]


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
    """

    limit: Mapping[str, float]
    error_bound: float
    arrival: float
    findings: tuple[Finding, ...]
    directions: int = 1
    faults: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every load keeps its limit in every scenario, the error bound included."""
        return not self.reasons()

    def keeps_limit(self, finding: Finding) -> bool:
        """Whether every load keeps its limit in one scenario, the error bound included."""
        return all(finding.residual[load] + self.error_bound <= limit for load, limit in self.limit.items())

    @property
    def worst(self) -> tuple[str, Finding]:
        """The load that takes up the greatest share of its limit, and where."""
        pairs = [(load, finding) for finding in self.findings for load in self.limit]
        return max(pairs, key=lambda pair: pair[1].residual[pair[0]] / self.limit[pair[0]])

    @property
    def demand(self) -> float:
        """Share of its limit that the worst load takes up; infinite where something else is wrong."""
        load, finding = self.worst
        share = (finding.residual[load] + self.error_bound) / self.limit[load]
        return float("inf") if self.faults else share

    def reasons(self) -> tuple[str, ...]:
        """Say why the check failed, a sentence each; none when it passed."""
        if all(self.keeps_limit(finding) for finding in self.findings):
            return self.faults
        load, finding = self.worst
        return (
            f"The {load} sways by {1e3 * finding.residual[load]:.4g} mm after the move "
            f"({finding.scenario.name}), and {1e3 * self.limit[load]:.4g} mm are allowed "
            f"(check.residual_sway; numerical error up to {1e6 * self.error_bound:.2g} µm).",
            *self.faults,
        )

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON and the manifest."""
        end_load = list(self.limit)[-self.directions :]
        return {
            "passed": self.passed,
            "limit_m": self.limit[end_load[-1]],
            "limits_m": dict(self.limit),
            "error_bound_m": self.error_bound,
            "arrival_s": self.arrival,
            "scenarios": [
                {
                    "name": finding.scenario.name,
                    "parameters": dict(finding.scenario.parameters),
                    "residual_peak_m": max(finding.residual[load] for load in end_load),
                    "residual_peaks_m": dict(finding.residual),
                    "residual_modal_m": dict(finding.modal),
                    "passed": self.keeps_limit(finding),
                }
                for finding in self.findings
            ],
            "reasons": list(self.reasons()),
        }
