"""Specs of a planner block with a sensor that are refused in a sentence."""

import pytest
from test_planner_sensor import GANTRY, JOINT, LIVE, MEASURED, SENSOR, TANK

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import SpecError

OTHERS_REFUSED = {
    "late": (
        "flexible-joint",
        [*JOINT, "planner.sensor.delay=[0.03, 0.05]"],
        "at most 0.036 s, known to 0.026",
    ),
    "load": ("slosh-tank", [*TANK, 'planner.sensor.of="theta1"'], r"sensor\.of: no load of the machine"),
    "unseen": (
        "slosh-tank",
        [
            *TANK,
            'planner.sensor={quantity="angle", of="theta1", noise=0.001}',
            "planner.disturbance.gust.acceleration=1.0",
        ],
        "theta1 does not show the faster swings .* measure another coordinate, or the sway of a load",
    ),
}


@pytest.mark.parametrize("name", OTHERS_REFUSED)
def test_what_a_sensor_cannot_show_is_refused_in_a_sentence(name):
    machine, changes, words = OTHERS_REFUSED[name]
    with pytest.raises(SpecError, match=words):
        planner_block(preset_spec(machine, changes))


REFUSED = {
    "live": (
        ["planner.live={L1=[3.0, 9.0], m2=[0.0, 2000.0]}"],
        "planner.live: over these ranges what the sensor shows",
    ),
    "of": (['planner.sensor.of="theta3"'], "planner.sensor.of: no coordinate that swings"),
    "noise": (["planner.sensor.noise=0.02"], "planner.sensor.noise: .* take a better sensor"),
    "delay": (["planner.sensor.delay=[0.0, 0.5]"], "planner.sensor.delay: at most 0.45 s, known to 0.32 s"),
    "zones": (["planner.zones=true"], "not together with planner.zones"),
    "travel": (
        ["limits.travel=[0.0, 1.0]", "move={start=0.0, target=1.0, duration=8.0}"],
        "must be longer than",
    ),
    "swing": (["planner.disturbance.swing={}"], "must name a load"),
}


@pytest.mark.parametrize(
    "name", [pytest.param("live", marks=pytest.mark.slow), *(name for name in REFUSED if name != "live")]
)
def test_what_cannot_be_served_is_refused_in_a_sentence(name):
    changes, words = REFUSED[name]
    with pytest.raises(SpecError, match=words):
        planner_block(preset_spec("bay-crane", [*MEASURED, *changes]))


def test_a_sensor_needs_a_disturbance():
    with pytest.raises(SpecError, match=r"planner\.disturbance: required by planner.sensor"):
        preset_spec("bay-crane", [LIVE, SENSOR])


GANTRIES_REFUSED = {
    "twice": ("gantry-crane", ['planner.sensor.of=["theta_x", "theta_x"]'], "along the same axis; name one"),
    "none": (
        "gantry-crane",
        ["planner.sensor.of=[]"],
        "planner.sensor.of: must name a coordinate that swings",
    ),
    "unknown": ("gantry-crane", ['planner.sensor.of=["theta_x", "y"]'], "of: no coordinate that swings"),
    "swing": (
        "gantry-crane",
        ["planner.disturbance.swing={payload-x=0.5}"],
        "must name a load that theta_y shows; state it for payload-y",
    ),
    "curved": (
        "tower-crane",
        [
            'planner.sensor={quantity="angle", of="theta_r", noise=0.001}',
            "planner.disturbance={swing={payload-radial=0.5}, settle=15.0}",
        ],
        "axes that lead straight",
    ),
}


@pytest.mark.parametrize("name", GANTRIES_REFUSED)
def test_what_several_sensors_cannot_do_is_refused_in_a_sentence(name):
    machine, changes, words = GANTRIES_REFUSED[name]
    shared = GANTRY[:1] if machine == "tower-crane" else GANTRY
    with pytest.raises(SpecError, match=words):
        planner_block(preset_spec(machine, [*shared, *changes]))
