"""A planner block driven on the studio's page: it arrives, stops, and its machines swing as they should."""

import json

import numpy as np
import pytest
from generator.free_swings import states

from gen_profile.presentation.studio.driving import MOMENT, Drive, drive
from gen_profile.presentation.studio.orders import DriveQuestion, Question
from gen_profile.presentation.studio.state import StudioState, preset_start

pytestmark = pytest.mark.slow  # blocks are compiled

LIMITS = {
    "limits.velocity": 0.5,
    "limits.acceleration": 1.0,
    "limits.jerk": 20.0,
    "limits.travel": [-1.0, 1.0],
}
EDITS = {**LIMITS, "export.cycle_time": 0.01, "planner.live.L1": [0.4, 0.5], "check.residual_sway": 0.02}
GANTRY = {**LIMITS, "limits.travel": [0.0, 20.0], "check.residual_sway": 0.2}


SENSED = {
    "export.cycle_time": 0.03,
    "limits.travel": [-10.0, 30.0],
    "planner.live.m2": [500.0, 2000.0],
    "planner.sensor.quantity": "angle",
    "planner.sensor.of": "theta1",
    "planner.sensor.noise": 0.002,
    "planner.sensor.delay": [0.05, 0.15],
    "planner.disturbance.swing.payload": 0.3,
    "planner.disturbance.gust.acceleration": 0.1,
    "planner.disturbance.gust.longest": 5.0,
    "planner.disturbance.settle": 15.0,
}


def asked(preset="paper", edits=EDITS, **how):
    question = Question(start=preset_start(preset), state=StudioState(preset=preset, edits=edits))
    return DriveQuestion(
        **{
            "question": question,
            "drive": 1,
            "command": "",
            "values": (),
            "live": {},
            "sensor": {},
            "wind": (),
            **how,
        }
    )


def moments(count, **how):
    found = [json.loads(json.dumps(list(drive(asked(**how))), allow_nan=False)) for _ in range(count)]
    return [part for (part,) in found]


def test_a_drive_arrives_without_sway_and_begins_anew():
    """At 0.45 m of rope, which the block is given, and for the nominal machine, which has it."""
    moments(10, drive=1, live={"L1": 0.45})
    away = moments(60, drive=1, command="target", values=(0.6,))
    assert away[-1]["axes"][0]["position"] == pytest.approx(0.6) and not away[-1]["busy"]
    sway = {actor["name"]: actor["sway_mm"] for actor in away[-1]["animation"]["actors"]}
    assert list(sway) == ["nominal", "L1 −20\N{NO-BREAK SPACE}%", "L1 +20\N{NO-BREAK SPACE}%"]
    assert max(map(abs, sway["nominal"])) < 0.1 < max(map(abs, sway["L1 −20\N{NO-BREAK SPACE}%"]))
    assert away[-1]["promise"] is True and away[-1]["live"][0]["value"] == 0.45
    (anew,) = moments(1, drive=2)
    assert anew["axes"][0]["position"] == 0.0


def test_a_stick_is_followed_and_a_stop_leaves_no_sway():
    moments(10, drive=3)
    pulled = moments(15, drive=3, command="velocity", values=(0.3,))
    assert pulled[-1]["axes"][0]["velocity"] > 0.1
    before = pulled[-1]["axes"][0]
    stopping = moments(40, drive=3, command="stop")
    stopped = stopping[-1]
    places = [place for part in stopping for place in part["trace"]["position"][0]]
    assert before["stop_low"] - 1e-6 <= min(places) and max(places) <= before["stop_high"] + 1e-6
    assert before["position"] < stopped["axes"][0]["position"] and not stopped["busy"]
    assert max(map(abs, stopped["animation"]["actors"][0]["sway_mm"])) < 0.3


def test_a_moment_tells_what_curves_of_the_last_minute_show():
    moments(3, drive=8)
    (part,) = moments(1, drive=8, command="velocity", values=(0.3,))
    trace, axis = part["trace"], part["axes"][0]
    assert (
        trace["times"] == pytest.approx([0.03, 0.05, 0.08, 0.1], abs=0.011) and trace["times"][-1] == MOMENT
    )
    assert trace["position"][0][-1] == axis["position"] and trace["velocity"][0][-1] == axis["velocity"]
    assert (trace["low"][0][-1], trace["high"][0][-1]) == (axis["stop_low"], axis["stop_high"])
    assert all(len(actor["sway_mm"]) >= len(trace["times"]) for actor in part["animation"]["actors"])
    low, high = (ends[0] for ends in part["stops"])  # places of the load in the first picture
    assert low[0] == pytest.approx(axis["stop_low"]) and high[0] == pytest.approx(axis["stop_high"])


def test_a_moment_lasts_a_whole_number_of_cycles():
    (part,) = moments(1, preset="bay-crane", edits=SENSED, drive=9)
    assert part["seconds"] == part["trace"]["times"][-1] == pytest.approx(0.09)


def test_machines_swing_by_the_equations():
    """After a quick stop they swing freely, as others integrate them."""
    going = Drive(asked().question.spec())
    for command, count in (("", 5), ("velocity", 12), ("quick_stop", 20)):
        for _ in range(count):
            going.moment(asked(command=command, values=(0.4,)))
    times = np.arange(0.0, MOMENT * 5, 0.01)
    before = going._state[:, 0].ravel()
    for _ in range(5):
        going.moment(asked())
    parameters = going._parameters()[0]
    place = tuple(going._axes[0])
    free = states(parameters, np.append(times, MOMENT * 5), before, place, "double-pendulum-crane")
    assert np.abs(before).max() > 0.05
    assert going._state[:, 0].ravel() == pytest.approx(free[:, -1], abs=1e-5)


def test_what_is_no_command_is_a_sentence():
    for how in ({"command": "fly"}, {"command": "target", "values": (float("nan"),)}, {"command": "target"}):
        ((part,),) = [list(drive(asked(drive=3, **how)))]
        assert part["part"] == "undriven" and part["faults"]
    (part,) = drive(asked(drive=3, live={"m1": 3.0}))
    assert "no live parameter" in part["faults"][0]["sentence"]
    (part,) = drive(asked(drive=4, edits={}))
    assert {fault["place"] for fault in part["faults"]} == LIMITS.keys()


def test_several_axes_take_a_value_each():
    (part,) = drive(asked("gantry-crane", GANTRY, drive=5))
    assert [axis["name"] for axis in part["axes"]] == ["x", "y"]
    (part,) = drive(asked("gantry-crane", GANTRY, drive=5, command="velocity", values=(0.1,)))
    assert [one["sentence"] for one in part["faults"]] == ["The planner takes 2 values, one for each axis."]


@pytest.mark.parametrize(
    ("preset", "edits", "view"),
    [("paper", EDITS, 0), ("gantry-crane", GANTRY, -1)],
)
def test_the_target_is_where_the_load_hangs_in_the_picture_that_is_pointed_at(preset, edits, view):
    going = Drive(asked(preset, edits).question.spec())
    view %= len(going._bounds)
    there = np.array([0.4] if preset == "paper" else [3.0, 1.2])
    place = going._marks(there)[view]
    part = going.moment(asked(command="point", values=(view, *place)))
    assert part["target"] == pytest.approx(there, abs=1e-6)
    assert part["marks"][view] == pytest.approx(place, abs=1e-6)
    going._axes[0, going._columns] = 3e-6  # hardly away from where it began
    beyond = going.moment(asked(command="point", values=(view, 1e3, 1e3)))["target"]
    assert beyond == pytest.approx(np.full(len(there), {"paper": 1.0}.get(preset, 20.0)))
    assert going.moment(asked(command="stop"))["target"] is None


def test_a_load_that_swings_is_damped_while_the_sensor_is_heard():
    def swung(drive, count, **how):
        parts = moments(count, preset="bay-crane", edits=SENSED, drive=drive, **how)
        return parts, [max(map(abs, part["animation"]["actors"][0]["sway_mm"])) for part in parts]

    parts, sway = swung(11, 200)
    assert len(parts[0]["animation"]["actors"]) == 1  # only one load can be measured
    assert sway[0] == pytest.approx(300.0, rel=0.05) and max(sway[-30:]) < 50.0
    assert parts[-1]["promise"] and parts[-1]["sensor"]["used"] and parts[-1]["sensor"]["fault"] == 0
    assert any(part["sensor"]["damping"] for part in parts)
    parts, sway = swung(12, 30, sensor={"lost": 1.0})
    assert max(sway) == pytest.approx(300.0, rel=0.05) and not parts[-1]["sensor"]["used"]
    wrong = (swung(13, 1, sensor={"scale": -1.0, "age": 0.04})[0] for _ in range(120))
    assert any(part["sensor"]["fault"] for (part,) in wrong)


def test_wind_holds_a_load_where_it_balances_its_weight():
    """Both ropes in one line; a load that hangs before its axis sways by less than nothing."""
    going = Drive(asked("bay-crane", SENSED).question.spec())
    leaning = np.array([[-np.arctan(0.1 / 9.81), 0.0]])
    going._state = np.stack([leaning, 0.0 * leaning])
    for _ in range(20):
        part = going.moment(asked(wind=(0.1,), sensor={"lost": 1.0}))
    assert going._state[0] == pytest.approx(leaning, abs=1e-5)
    sway = 1e3 * (6.0 + 1.5) * np.sin(leaning[0, 0])
    assert part["animation"]["actors"][0]["sway_mm"][-1] == pytest.approx(sway, abs=0.1)
    (refused,) = drive(asked("bay-crane", SENSED, drive=11, wind=(0.1, 0.1)))
    assert "Wind takes 1 values, one for each axis." in refused["faults"][0]["sentence"]
