"""Axes that are braked as an interval comes nearer than the stated ends of a stop: with a reason, in time."""

from functools import cache
from math import inf

import pytest
from generator.mutants import judged, kinds_of

from gen_profile.assurance.proof.habits import Change
from gen_profile.assurance.proof.histories import Histories, History
from gen_profile.assurance.proof.verdict import TAKEN_BACK
from gen_profile.planner.commands import Command
from gen_profile.planner.design import planner_constants
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.whole import whole_block

pytestmark = pytest.mark.slow
SPEC = preset_spec("bay-crane", ["planner.zones=true"])
SWITCHES = {  # what a block does that is right where an input is 0, and wrong where it is 1
    "fLate": ("fLiveHigh) THEN nBrake := 1;", "fLiveHigh) AND (fLate = 0.0) THEN nBrake := 1;"),
    "fGoesOn": (
        "IF (nBrake > 0) OR (nState = cBraking) THEN",
        "IF (fGoesOn = 1.0) AND (nBrake > 0) THEN nLost := cPromiseSway; nBrake := 0; END_IF;\n"
        "IF (nBrake > 0) OR (nState = cBraking) THEN",
    ),
    "fEver": (
        "IF (nBrake > 0) OR (nState = cBraking) THEN",
        "IF (fEver = 1.0) AND (ABS(fVelocity) > 0.3) AND (nState = cMoving) THEN nBrake := 1; END_IF;\n"
        "IF (nBrake > 0) OR (nState = cBraking) THEN",
    ),
}
LOST = "nPromise tells a reason that is none"
ENTERED = "the axis or the stated end of a stop lies within a blocked interval"


@cache
def text():
    before, name, shell = whole_block(planner_constants(SPEC)[1]).rpartition("\nFUNCTION_BLOCK ")
    for switch, (right, wrong) in SWITCHES.items():
        assert shell.count(right) == 1
        shell = shell.replace(right, wrong)
        shell = shell.replace("\nVAR_INPUT\n", f"\nVAR_INPUT\n    {switch} : LREAL;\n", 1)
    return before + name + shell


def kinds(command, ahead, **switches):
    """Faults where an axis at 10 m is under way for 3.4 s as an interval is blocked that much ahead of it."""
    live = {"L1": 5.514, "m2": 478.0}
    place = 10.0 + ahead
    zone = {"aBlockedLow[7]": place, "aBlockedHigh[7]": place + 3.0}
    changes = (Change(time=0.0, lasts=inf, inputs=switches), Change(time=4.0, lasts=20.0, inputs=zone))
    history = History(
        live=live,
        parameters=dict(SPEC.plant.parameters) | live,
        places=(10.0,),
        commands=(
            Command(time=0.6, live={}, **command),
            Command(time=24.0, command="stop", values=(), live={}),
        ),
        axes=Histories.of(SPEC).axes,
        changes=changes,
    )
    [(_, one)] = judged(SPEC, text(), Histories.of(SPEC), [history])
    return kinds_of(SPEC, one), one


MOVES = {  # commands, and how far ahead an interval is that braking alone keeps out of
    "target": ({"command": "position", "values": (17.0,)}, 2.6),
    "stick": ({"command": "velocity", "values": (0.9,)}, 2.0),
}
FAR = 7.0  # m ahead: a stop without sway is found


@pytest.mark.parametrize(("command", "near"), MOVES.values(), ids=MOVES)
class TestBraked:
    def test_the_promise_may_be_withdrawn_where_an_interval_comes_nearer_than_stated(self, command, near):
        found, one = kinds(command, near)
        assert not found and not one.promise
        assert one.on_the_way["payload"] > 2.0 * SPEC.check.residual_sway["payload"]
        found, one = kinds(command, FAR)
        assert not found and one.promise

    def test_an_axis_that_enters_where_braking_keeps_out_is_a_fault(self, command, near):
        """Within the time in which any stop ends, an axis might pass through an interval without a fault."""
        assert ENTERED in kinds(command, near, fLate=1.0)[0]
        assert not kinds(command, FAR, fLate=1.0)[0]

    def test_a_promise_that_is_withdrawn_without_braking_has_no_reason(self, command, near):
        assert {LOST, ENTERED, TAKEN_BACK} <= kinds(command, near, fGoesOn=1.0)[0]

    @pytest.mark.parametrize("ahead", [FAR, 20.0])
    def test_a_promise_that_is_withdrawn_without_an_interval_has_none(self, command, near, ahead):
        assert {LOST, TAKEN_BACK} <= kinds(command, ahead, fEver=1.0)[0]
