"""The preset of every machine with every kind of robustness, solved, written and checked: a Markdown table.

The table in docs/machines.md is made by it. Where there are no limits and no range, the indirect and the
direct method solve the same problem by different means: both motions are checked, and the last column is how
far apart their costs are.

    python examples/07_every_machine.py [PRESET …]
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import gen_profile as gp

AGREEMENT = 2e-6  # relative, of the costs


def checked(name: str, robustness: str, method: str) -> gp.Design:
    """Design a motion and have it checked; stop where either fails."""
    spec = gp.preset_spec(name, robustness={"method": robustness}, solver={"method": method})
    with TemporaryDirectory() as folder:
        outcome = gp.design(spec, ["csv"], Path(folder))
    if not outcome.passed:
        sys.exit(f"{name}, {robustness}, {method}: " + "\n".join(outcome.check.reasons()))
    return outcome


def row(name: str, robustness: str) -> list[str]:
    """Design one motion by each method that knows how."""
    outcomes = [checked(name, robustness, "direct")]
    apart = ""
    if robustness != "range":
        outcomes.insert(0, checked(name, robustness, "indirect"))
        one, other = (outcome.plan.solution.raise_for_status().cost for outcome in outcomes)
        if abs(other / one - 1.0) > AGREEMENT:
            sys.exit(f"{name}, {robustness}: the methods' costs differ, {one} and {other}.")
        apart = f"{abs(other / one - 1.0):.0e}"
    outcome = outcomes[0]
    load, finding = outcome.check.worst
    figures = outcome.plan.figures
    return [
        name,
        robustness,
        f"{figures['acceleration_max_m_per_s2']:.3g} {outcome.spec.machine().actuated[0].unit}/s²",
        f"{1e3 * figures['sway_transient_peak_m']:.0f}",
        f"{1e3 * finding.residual[load]:.2f} ({load}, {finding.scenario.name})",
        f"{1e3 * outcome.check.limit[load]:g}",
        apart,
    ]


HEAD = [
    "preset",
    "robustness",
    "peak acceleration",
    "sway on the way, mm",
    "worst residual, mm",
    "allowed, mm",
    "direct against indirect",
]
print("", *HEAD, "", sep="|")
print("", *("---" for _ in HEAD), "", sep="|")
for preset in sys.argv[1:] or gp.presets():
    if not preset.startswith("paper"):  # has a page of its own
        for method in ("none", "sensitivity", "range"):
            print("", *row(preset, method), "", sep="|")
