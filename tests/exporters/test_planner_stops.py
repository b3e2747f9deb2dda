"""A planner block's stops: one is planned before it is ordered, and in less time while it is under way."""

import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import preset_spec

CYCLE, SLOT = 0.004, 0.272  # s, that of a rope of 6 m
MOMENTS = np.linspace(3.0, 10.0, 9)  # s, on the way


def stopped(compiled, moment):
    """When a stop is first obeyed, how long it takes from then on as it states, and as it takes."""
    issued = []
    for order in ({}, {"bStop": 1.0}):
        block = CountedBlock(compiled, fActPosition=2.0, fL1=6.0, fm2=2000.0)
        block.hold(round(5.0 / CYCLE))
        block.hold(round(moment / CYCLE), bExecute=1.0, fTarget=35.0)
        issued.append(block.hold(round(20.0 / CYCLE), **order))
    goes_on, stops = issued
    begun = int(np.flatnonzero(np.abs(stops["fPosition"] - goes_on["fPosition"]) > 1e-9)[0])
    rests = int(np.flatnonzero(stops["fVelocity"])[-1]) + 1
    assert stops["operations"].max() <= 12_000
    return begun * CYCLE, stops["fTimeToGo"][begun], (rests - begun) * CYCLE


@pytest.mark.slow
def test_a_stop_begins_with_the_next_slot_and_ends_no_later_than_first_stated():
    """It begins with the slot after its programme is found, 0.15 s later at most."""
    compiled = compile_counting(planner_block(preset_spec("bay-crane")).text)
    delays, stated, took = np.transpose([stopped(compiled, moment) for moment in MOMENTS])
    assert delays.max() <= SLOT + 0.15
    assert delays.mean() <= 0.75 * SLOT
    assert (took <= stated + CYCLE).all()
    assert (took < stated - SLOT / 2).any()


@pytest.mark.slow
def test_a_rope_that_changes_before_a_quick_stop_is_known_after_it():
    """Dropped in one of two cycles of a slot, it stayed half that of another rope: 2 % too fast."""
    changes = ["planner.live_rate={L1=0.2}", "check.residual_sway=0.02"]
    compiled = compile_counting(planner_block(preset_spec("bay-crane", changes)).text)
    for hoisted in range(739, 743):
        block = CountedBlock(compiled, fActPosition=5.0, fL1=3.0, fm2=300.0)
        block.hold(7, bVelocity=1.0)
        for cycle in range(hoisted):
            block.hold(1, fVelocityCommand=0.6, fL1=3.0 + 0.0008 * (cycle + 1))
        block.hold(1, bQuickStop=1.0)
        block.hold(1200, bQuickStop=0.0, bVelocity=0.0, bReset=1.0)
        block.hold(3, bReset=0.0, bVelocity=1.0, fVelocityCommand=0.0)
        assert block.hold(3000, fVelocityCommand=0.6)["fVelocity"][-1] == pytest.approx(0.6)
