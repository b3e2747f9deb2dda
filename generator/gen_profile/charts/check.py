"""The machines of a check, as shares of what their loads may sway."""

import numpy as np

from gen_profile.charts.figure import PALETTE, Bars, Figure
from gen_profile.evaluation.phrases import number
from gen_profile.verification.verdict import Check, Finding

MOST_BARS = 12


def check_figure(check: Check) -> Figure:
    """Draw how much of its limit the worst load of each machine takes up, of the worst machines."""
    ranked = sorted((_worst(check, finding) for finding in check.judged), key=lambda one: -one[0])
    shown = {f"{name}, {load}": (share, sway) for share, name, load, sway in ranked[:MOST_BARS]}
    left_out = len(ranked) - len(shown)
    more = f" {left_out} that sway less are not drawn." if left_out else ""
    bars = Bars(
        title="Residual sway",
        x_label="share of the allowed residual sway (%)",
        values=np.array([100.0 * share for share, _ in shown.values()]),
        names=list(shown),
        colours=[PALETTE[0]] * len(shown),
        texts=[f"{number(1e3 * sway)} mm" for _, sway in shown.values()],
        limit=100.0,
    )
    return Figure(caption=f"Dashed in red: what is allowed.{more}", panels=[bars])


def _worst(check: Check, finding: Finding) -> tuple[float, str, str, float]:
    """Find the load that takes up most, with its share, where, and its sway in m."""
    load, _ = check.worst_of([finding])
    sway = finding.residual[load]
    return (sway + check.error_bound) / check.limit[load], finding.scenario.name, load, sway
