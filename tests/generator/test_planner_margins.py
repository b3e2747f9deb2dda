"""Margins of damping by a sensor, held against the block on an independent nonlinear crane."""

import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting
from exporters.measured_machines import MeasuredCrane

from gen_profile.planner.design import planner_block
from gen_profile.planner.margins import WATCHES, sensor_margins
from gen_profile.spec.reading import preset_spec

ROPE, AGE = 4.0, 0.1
SENSOR = f'planner.sensor={{quantity="angle", of="theta1", noise=0.002, delay=[{AGE}, {AGE}]}}'
SWING = "planner.disturbance={swing={payload=0.5}, settle=12.0}"
CYCLE = 0.02
UNPROVEN = 8  # cSensorUnproven, which holds no damping off
CHANGES = ["planner.live={}", f"plant.L1={ROPE}", SENSOR, SWING, "export.cycle_time=0.02"]


@pytest.fixture(scope="module")
def spec():
    return preset_spec("bay-crane", CHANGES)


@pytest.fixture(scope="module")
def text(spec):
    return planner_block(spec).text


@pytest.mark.slow
def test_damping_fails_beyond_the_margins_and_not_within(spec, text):
    margins = sensor_margins(spec, text)
    compiled = compile_counting(WATCHES.sub(r"\1 1.0E+9", text))

    def left(late, gain):
        """By how much the load sways after a minute, from 0.2 m."""
        crane = MeasuredCrane(CountedBlock(compiled), ROPE, swing=(0.2, 1.0), cycle=CYCLE)
        crane.inputs |= {"bEnable": 1.0, "fActPosition": 20.0}
        issued = crane.run(60.0, delay=AGE + late, sensor=lambda _, value: gain * value)
        assert set(issued["nSensorFault"]) <= {0, UNPROVEN}  # which never takes a sensor for faulty
        return np.abs(issued["sway"][-400:]).max()

    assert 0.3 < margins.delay < 2.0 and 1.5 < margins.gain < 6.0
    assert left(0.8 * margins.delay, 1.0) < 0.08 < 0.1 < left(1.25 * margins.delay, 1.0)
    assert left(0.0, 0.8 * margins.gain) < 0.08 < 0.1 < left(0.0, 1.3 * margins.gain)


def test_there_are_none_without_a_sensor():
    assert sensor_margins(preset_spec("bay-crane"), "") is None
