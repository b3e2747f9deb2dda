"""What a motion leaves swinging, against a quadrature of its own."""

import numpy as np
import pytest

from gen_profile.planner.left_swinging import ERRORS, GivenModes
from gen_profile.spec.reading import preset_spec


def test_what_is_left_swinging_is_an_integral_of_the_velocity():
    random, poles, cycle, ends = np.random.default_rng(1), np.array([[-0.1 + 1.3j]]), 0.05, [150, 400]
    acceleration = random.normal(size=(2, 401)) * (np.arange(401) % 50 != 0)
    fine = np.arange(0, 400 * 200 + 1) / 200
    modes = GivenModes(poles=poles, gains=np.array([[1.0], [2.0]]), damped=True)
    as_given, at_most = modes.left(acceleration, ends, cycle)
    for end, found in zip(ends, as_given, strict=True):
        time, expected = fine[: end * 200 + 1], 0.0
        for gain, knots in zip((1.0, 2.0), acceleration, strict=True):
            rate = np.interp(time, np.arange(401), knots)
            # of a velocity that goes on, what an oscillator at rest in it does not do
            swing = np.trapezoid(rate * np.exp(poles * cycle * (end - time)), time * cycle) / poles
            expected += gain * abs(swing.item())
        assert found == pytest.approx(expected, rel=1e-5)
    assert at_most == pytest.approx(as_given)


def test_machines_between_those_that_the_block_watches_are_tried_where_a_history_is_long():
    spec = preset_spec("bay-crane")
    short, long = (GivenModes.of(spec, {"L1": 9.0, "m2": 2000.0}, seconds) for seconds in (60.0, 1600.0))
    assert short.poles.shape[1] == len(ERRORS)
    turns = np.diff(np.unique(long.poles[0].imag)) * 1600.0
    assert turns.max() < 0.46
    assert short.turns == pytest.approx(np.ptp(long.poles.imag, axis=1).max() / 2.0)
