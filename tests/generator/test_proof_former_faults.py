"""Histories in which a planner block failed once, and some that are seldom drawn."""

from functools import cache
from math import inf

import attrs
import pytest
from generator.mutants import MACHINES, judged, kinds_of
from generator.planned_machines import FORMER, SELDOM, histories_apart

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.habits import Change
from gen_profile.assurance.proof.histories import Histories, History
from gen_profile.planner.commands import Command
from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import preset_spec

pytestmark = pytest.mark.slow

FAST = (
    "{x={velocity=2.2, acceleration=0.72, jerk=4.9, travel=[0.0, 60.0]}, "
    "y={velocity=0.77, acceleration=0.23, jerk=0.6, travel=[0.0, 30.0]}}"
)
AXIS = "aActualVelocity[nAxis]"
WRONG = {  # of a machine, what a block does that is right where an input is 0, and wrong where it is 1
    "followed": {
        "fOtherAxis": (
            f"({AXIS} + aVelocity[nAxis])",
            f"({AXIS} + fOtherAxis * (aActualVelocity[1 - nAxis] - {AXIS}) + aVelocity[nAxis])",
            "nPromise tells a reason that is none",
        ),
        "fNoShare": (
            "(nCommand = cCommandVelocity) AND (aShare[nAxis] <> 0.0)",
            "(nCommand = cCommandVelocity) AND ((fNoShare = 0.0) AND (aShare[nAxis] <> 0.0) "
            "OR (fNoShare = 1.0) AND (aShare[nAxis] = 0.0))",
            "bCommandAborted does not tell what became of the command",
        ),
    },
    "tight": {
        "fTwice": (
            "aLiveFollowed[nIndex]) <= cLiveDrift[nIndex])",
            "aLiveFollowed[nIndex]) <= (1.0 + fTwice) * cLiveDrift[nIndex])",
            "bPromise is set though it cannot be known",
        ),
    },
}


@cache
def text_of(name):
    """Write a block in which faults can be switched on: to compile each would take most of the time."""
    text = planner_block(MACHINES[name]).text
    for switch, (right, wrong, _) in WRONG.get(name, {}).items():
        assert right in text
        text = text.replace("\nVAR_INPUT\n", f"\nVAR_INPUT\n    {switch} : LREAL;\n", 1).replace(right, wrong)
    return text


def kinds_by_history(name, drawn):
    spec = MACHINES[name]
    return [kinds_of(spec, one) for _, one in judged(spec, text_of(name), Histories.of(spec), drawn)]


@pytest.mark.parametrize("name", sorted(FORMER.keys() | SELDOM))
def test_a_block_obeys_where_it_once_did_not(name):
    assert not any(kinds_by_history(name, histories_apart(name, Histories.of(MACHINES[name]))))


@pytest.mark.parametrize(("name", "switch"), [(name, switch) for name in WRONG for switch in WRONG[name]])
def test_a_block_that_is_wrong_there_fails(name, switch):
    last = histories_apart(name, Histories.of(MACHINES[name]))[-1]
    switched = Change(time=0.0, lasts=inf, inputs={switch: 1.0})
    [kinds] = kinds_by_history(name, [attrs.evolve(last, changes=(switched, *last.changes))])
    assert WRONG[name][switch][-1] in kinds


def test_an_axis_comes_to_rest_where_there_is_no_room_to_calm_its_load():
    """Beyond its travel it moved on for 270 s by calming pulses of 1e-16, which rounding admitted."""
    spec = MACHINES["followed"]
    goes = {"command": "position", "values": (3.67, 4.78), "live": {}, "override": 0.99}
    ropes = (6.77, 7.22, 7.04, 7.39, 7.82, 7.54, 7.5, 7.77, 7.5)
    times = (0.0, 4.47, 6.23, 11.68, 15.89, 18.67, 20.15, 22.77, 25.47)
    history = History(
        live={"L": 6.77},
        parameters=dict(spec.plant.parameters) | {"L": 6.77},
        places=(22.57, -0.29),
        commands=(
            Command(time=0.16, **goes),
            Command(time=13.14, **goes),
            Command(time=13.37, command="stop", values=(), live={}),
        ),
        hoisting={"L": tuple(zip(times, ropes, strict=True))},
        changes=(Change(time=2.26, lasts=4.83, inputs={"bEnable": 0.0}),),
    )
    with ClosedLoop(spec, text_of("followed"), Histories.of(spec)) as loop:
        run = loop.run(history)
        assert 0 < run.stands * loop.cycle < 120.0


@pytest.mark.parametrize(("after", "first"), [(0.1, ""), (0.6, ""), (0.6, " OR bStopsFirst")])
def test_an_axis_whose_stick_is_at_zero_is_stopped_where_another_takes_over(after, first):
    """Its trolley went on for 3 m: what led to the target was removed as it would have been executed."""
    changes = [f"limits.axis={FAST}", "planner.live={L=[3.0, 9.0]}", "export.cycle_time=0.004"]
    spec = preset_spec("gantry-crane", changes)
    text, histories = planner_block(spec).text, Histories.of(spec)
    assert first in text
    sticks = Command(time=5.0 + after, command="velocity", values=(2.2, 0.0), live={})
    history = History(
        live={"L": 5.5},
        parameters=dict(spec.plant.parameters) | {"L": 5.5},
        places=(30.0, 15.0),
        axes=histories.axes,
        commands=(
            Command(time=5.0, command="position", values=(0.0, 0.0), live={}),
            sticks,
            Command(time=35.0, command="stop", values=(), live={}),
        ),
    )
    [(_, one)] = judged(spec, text.replace(first, ""), histories, [history])
    found = kinds_of(spec, one)
    assert found == ({"an axis that is to stop goes farther than any stop need"} if first else set())
