"""Stops of a planner block whose rope changes on the way, on a nonlinear crane of other equations."""

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting
from driven_block import most_operations
from exporters.swinging_crane import Hoist, SwingingCrane

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import preset_spec

CYCLE = 0.004  # s
SPEC = preset_spec(
    "bay-crane",
    ["planner.live_rate={L1=0.3}", "check.uncertain={L1=0.01}", "limits.travel=[-100.0, 140.0]"],
)


@pytest.mark.slow
@pytest.mark.parametrize(("rope", "rate"), [(6.0, 0.3), (8.0, -0.3), (4.0, 0.3)])
def test_stops_while_hoisting_end_within_eight_seconds(rope, rate):
    compiled, hoist, limits = (
        compile_counting(planner_block(SPEC).text),
        Hoist(rope, (0.5, rate, 2.9)),
        SPEC.limits.of(0),
    )
    for moment in (2.0, 4.0, 7.0):
        crane, rows, before = SwingingCrane(rope), [], 0.0
        block = CountedBlock(compiled, fActPosition=20.0, fL1=rope, fm2=2000.0)
        block.hold(100)
        for number in range(round((moment + 25.0) / CYCLE)):
            time = number * CYCLE
            stops = {"bStop": 1.0, "bExecute": 0.0} if time >= moment else {"bExecute": 1.0, "fTarget": 80.0}
            block.inputs |= stops | {"fL1": hoist(time + CYCLE)[0]}
            out = block.step()
            ropes = [hoist(time + share * CYCLE) for share in (0.0, 0.5, 1.0)]
            crane.advance(before, out["fAcceleration"], ropes, CYCLE)
            before = out["fAcceleration"]
            rows.append((out["fVelocity"], before, out["operations"], crane.sway))
        velocity, acceleration, spent, sway = np.transpose(rows)
        assert moment < (np.flatnonzero(velocity)[-1] + 1) * CYCLE <= moment + 8.0
        assert np.abs(sway[-2500:]).max() <= 0.01
        assert np.abs(velocity).max() <= limits.velocity * (1.0 + 1e-9)
        assert np.abs(acceleration).max() <= limits.acceleration * (1.0 + 1e-9)
        assert np.abs(np.diff(acceleration)).max() <= limits.jerk * CYCLE * (1.0 + 1e-6)
        assert spent.max() <= most_operations(SPEC)
