"""Histories in which a planner block failed once, and some that are seldom drawn."""

from functools import cache

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


@cache
def text_of(name):
    return planner_block(MACHINES[name]).text


def kinds_by_history(name, drawn):
    spec = MACHINES[name]
    return [kinds_of(spec, one) for _, one in judged(spec, text_of(name), Histories.of(spec), drawn)]


@pytest.mark.parametrize("name", sorted(FORMER.keys() | SELDOM))
def test_a_block_obeys_where_it_once_did_not(name):
    found = kinds_by_history(name, histories_apart(name, Histories.of(MACHINES[name])))
    assert {number for number, kinds in enumerate(found) if kinds} == set()


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


@pytest.mark.parametrize("after", [0.1, 0.6])
def test_an_axis_whose_stick_is_at_zero_is_stopped_where_another_takes_over(after):
    """Its trolley went on for 3 m: what led to the target was removed as it would have been executed."""
    changes = [f"limits.axis={FAST}", "planner.live={L=[3.0, 9.0]}", "export.cycle_time=0.004"]
    spec = preset_spec("gantry-crane", changes)
    text, histories = planner_block(spec).text, Histories.of(spec)
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
    [(_, one)] = judged(spec, text, histories, [history])
    assert not kinds_of(spec, one)
