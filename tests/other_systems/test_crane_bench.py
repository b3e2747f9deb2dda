"""The planner block in others' benchmark: their crane, their wind, their scores."""

import pytest
from other_systems.crane_bench import PlannerBlock, figures


@pytest.mark.slow
def test_the_block_stands_and_damps_in_their_wind():
    block = PlannerBlock()
    ((wind, (residual, deviation, apart)),) = figures(block, 1, ["kaimal"])
    assert wind == "kaimal" and block.issued["bSensorUsed"] == 1.0
    assert residual > deviation  # the mean wind deflects the load
    assert deviation < 0.2  # degrees
    assert apart < 0.06  # m
