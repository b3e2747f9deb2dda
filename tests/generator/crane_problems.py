"""Problems of the paper's crane, as the tests vary them."""

from __future__ import annotations

from typing import Any

from gen_profile.dynamics.problem.problem import Problem
from gen_profile.plants.registry import find_plant

CRANE = find_plant("double-pendulum-crane")
EFFORTS = [("jerk", None), ("snap", None), ("reference", 0.1)]


def crane_problem(machine: dict[str, float] | None = None, **changes: Any) -> Problem:
    """0.3 m in 3 s with β = 50, insensitive to L1, but for what is changed."""
    task = {
        "plant": CRANE,
        "parameters": CRANE.nominal() | (machine or {}),
        "start": (0.0,),
        "target": (0.3,),
        "duration": 3.0,
        "tau": None,
        "desensitized": ("L1",),
        "effort": "jerk",
        "sway_weight": 50.0,
        "sway_scale": 50.0,
    }
    return Problem(**(task | changes))
