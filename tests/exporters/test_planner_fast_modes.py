"""The planner block of a crane whose hook is light: its second mode is quick beside a slot."""

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting
from scipy.optimize import brentq

from gen_profile.planner.design import planner_block
from gen_profile.planner.machine import linearized
from gen_profile.spec.reading import preset_spec

CHANGES = [
    *("plant.m1=80.0", "plant.m2=5000.0", "plant.L1=5.0", "plant.L2=1.2", "planner.live={L1=[1.5, 7.0]}"),
    *("limits.velocity=0.67", "limits.acceleration=0.2", "limits.jerk=0.4", "limits.travel=[0.0, 30.0]"),
    *("robustness.uncertain={L1=0.03}", "check.residual_sway=0.04", "export.cycle_time=0.01"),
]
LOW, HIGH = 1.5, 7.0  # m
pytestmark = pytest.mark.slow


def rates(spec, rope):
    return linearized(spec, [2.0 * (rope - LOW) / (HIGH - LOW) - 1.0]).distinct_frequencies


@pytest.mark.parametrize(("load", "turns"), [(1200.0, 0.5), (2000.0, 0.6), (5000.0, 1.0), (5000.0, 1.1)])
def test_a_mode_that_would_turn_by_half_a_turn_or_a_whole_one_in_a_slot_is_left_at_rest(load, turns):
    """A twentieth of the slow period as the slot, no coefficients of slots change one of its directions."""
    spec = preset_spec("bay-crane", [*CHANGES, f"plant.m2={load}"])
    rope = brentq(
        lambda rope: np.ptp(rates(spec, rope) / rates(spec, rope)[0]) + 1.0 - 20.0 * turns, LOW, HIGH
    )
    block = CountedBlock(compile_counting(planner_block(spec).text), fActPosition=10.0, fL1=rope)
    block.hold(50)
    parts = [block.hold(2500, bExecute=1.0, fTarget=16.0), block.hold(700, bVelocity=1.0)]
    parts += [block.hold(800, fVelocityCommand=-0.5), block.hold(1500, bVelocity=0.0, fVelocityCommand=0.0)]
    assert parts[0]["bDone"][-1]
    assert parts[2]["bInVelocity"][-1]
    acceleration, time = np.concatenate([part["fAcceleration"] for part in parts]), 0.01
    for rate in rates(spec, rope):
        swung = np.exp(-1j * rate * time * np.arange(len(acceleration))) @ acceleration * time
        assert abs(swung) < 1e-4
