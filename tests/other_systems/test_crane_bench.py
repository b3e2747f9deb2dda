"""The planner block in others' benchmark: their crane, their wind, their scores."""

import pytest
from cranebench.controllers import BASELINES
from cranebench.metrics import METRIC_HASH
from other_systems.crane_bench import PlannerBlock, figures

SCORED = "0ba1f32f12f2cf6d"  # by the version of the table in the docs


@pytest.mark.slow
def test_the_block_leaves_less_than_every_baseline_in_calm_air_and_little_in_wind():
    assert METRIC_HASH == SCORED
    block = PlannerBlock()
    (calm,), (wind,) = ([row for of, row in figures(block, 1) if of == known] for known in ("none", "kaimal"))
    assert block.issued["bSensorUsed"] == 1.0
    rival = next(row for of, row in figures(BASELINES["LQR"](), 1) if of == "none")
    assert calm[0] < 0.005 < rival[0]  # degrees
    assert calm[2] < 0.003  # m
    assert wind[1] < 0.2 and wind[2] < 0.06
