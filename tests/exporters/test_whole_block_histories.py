"""The whole block of the folder of blocks under the histories of today's proof, judged by its verdicts."""

import pytest
from generator.planned_machines import GANTRY, HOIST
from test_next_planner import PAPER as WIDE_ERRORS
from test_whole_block import whole_text

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.spec.reading import parse_spec, preset_spec

pytestmark = pytest.mark.slow
ZONED = ["planner.zones=true", "planner.events=true"]
PAPER = [
    "limits={velocity=0.3, acceleration=0.7, jerk=20.0, travel=[0.0, 2.0]}",
    *("planner.live={L1=[0.3, 0.6]}", "planner.live_rate={L1=0.05}", "plant.c1=0.0", "plant.c2=0.0"),
    *("check.residual_sway=0.01", "check.uncertain={L1=0.01}"),
]
MACHINES = {
    "bay": lambda: preset_spec("bay-crane", []),
    "zones": lambda: preset_spec("bay-crane", ZONED),
    "gantry": lambda: parse_spec(GANTRY, [*ZONED, "export.cycle_time=0.004"]),
    "hoisting": lambda: preset_spec("bay-crane", ["planner.live_rate={L1=0.3}", "check.uncertain={L1=0.01}"]),
    "hoisting gantry": lambda: parse_spec(GANTRY, ["planner.live_rate={L=0.1}", "export.cycle_time=0.004"]),
    "hoist of its own": lambda: parse_spec(HOIST, ["planner.live_rate={hoist=0.1}"]),
    "wide errors": lambda: preset_spec("paper", list(WIDE_ERRORS)),
    "quick hoisting": lambda: preset_spec("paper", PAPER),
}
FIRST = {"wide errors": 9}  # histories of each, 30 else, and those that were refused
FORMER = {
    "bay": (157, 222),  # stated ends of a stop as far as an axis had been beyond its travel
    "zones": (6, 56),  # a slot of rounding behind the end of a motion, where its target came again
    "gantry": (97, 114),  # a stop 0.9 mm beyond its stated ends, a target from rest lost
    "wide errors": (2, 90, 122, 145, 217),  # from rest nothing was found for seconds
}


@pytest.mark.parametrize("machine", MACHINES)
def test_all_verdicts_hold(machine):
    spec = MACHINES[machine]()
    histories = Histories.of(spec)
    drawn = Numbering.of(histories, 800, 11)
    with ClosedLoop(spec, whole_text(spec), histories) as loop:
        judged = loop.judged(drawn, [*range(FIRST.get(machine, 30)), *FORMER.get(machine, ())])
    faults = [(one.number, fault) for one in judged for fault in one.faults]
    assert not faults
    for one in judged:
        assert one.rests_after is not None
        limits = spec.check.residual_sway
        assert not one.promise or all(sway <= limits[load] for load, sway in one.residual.items())
