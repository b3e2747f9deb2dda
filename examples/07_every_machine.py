"""The preset of every machine with every kind of robustness, solved, written and checked: a Markdown table.

The table in docs/machines.md is made by it. Where the indirect method applies, the direct one solves the same
problem by other means; the last column is how far apart their costs are.

    python examples/07_every_machine.py
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from gen_profile.problem.problem import problem_of
from gen_profile.solvers import direct
from gen_profile.spec_reading import preset_spec, presets
from gen_profile.workflows.design import design


def row(name: str, robustness: str) -> list[str]:
    """Design one motion and have it checked; raise where either fails."""
    spec = preset_spec(name, [f"robustness.method={robustness}"])
    with TemporaryDirectory() as folder:
        outcome = design(spec, ["csv"], Path(folder))
    if not outcome.passed:
        sys.exit(f"{name}, {robustness}: " + "\n".join(outcome.check.reasons()))
    load, finding = outcome.check.worst
    solution, figures = outcome.plan.solution, outcome.plan.figures
    apart = ""
    if solution.method == "indirect":
        other = direct.solve(problem_of(spec)).raise_for_status()
        apart = f"{abs(other.cost / solution.optimum.cost - 1.0):.0e}"
    return [
        name,
        robustness,
        f"{figures['acceleration_max_m_per_s2']:.3g} {spec.machine().actuated[0].unit}/s²",
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
for preset in presets():
    if not preset.startswith("paper"):  # has a page of its own
        for method in ("none", "sensitivity", "range"):
            print("", *row(preset, method), "", sep="|")
