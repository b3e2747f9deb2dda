"""What a motion leaves swinging, against a quadrature of its own."""

import numpy as np
import pytest
from scipy.linalg import eigh

from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.left_swinging import USUAL, GivenModes
from gen_profile.methods.quickest.modes import SwayModes
from gen_profile.spec.reading import parse_spec, preset_spec

STACKER = """
name = "stacker"
plant = { type = "mass-spring-chain-2", m1 = 2500.0, m2 = 1200.0, k1 = 250000.0, k2 = 120000.0 }
move = { distance = 20.0, duration = 10.0 }
limits = { velocity = 4.0, acceleration = 0.6, jerk = 2.0, travel = [0.0, 100.0] }
robustness = { uncertain = { m2 = 0.1 } }
planner = { live = { m2 = [300.0, 1500.0] } }
"""


def test_what_is_left_swinging_is_an_integral_of_the_velocity():
    random, poles, cycle, ends = np.random.default_rng(1), np.array([[-0.1 + 1.3j]]), 0.05, [150, 400]
    acceleration = random.normal(size=(2, 401)) * (np.arange(401) % 50 != 0)
    fine = np.arange(0, 400 * 200 + 1) / 200
    modes = GivenModes(modes=SwayModes(poles=poles, gains=np.array([[[[1.0], [2.0]], [[-1.0], [0.5]]]])))
    as_given, at_most, _ = modes.left(acceleration, ends, cycle)
    for end, found in zip(ends, as_given, strict=True):
        time, swings = fine[: end * 200 + 1], []
        for knots in acceleration:
            rate = np.interp(time, np.arange(401), knots)
            swings.append(np.trapezoid(rate * np.exp(poles * cycle * (end - time)), time * cycle).item())
        one, other = swings
        assert found == pytest.approx(max(abs(one + 2.0 * other), abs(0.5 * other - one)), rel=1e-5)
    assert at_most == pytest.approx(as_given)


def test_what_has_been_moved_is_known_in_any_cycle():
    """Also where the axis speeds up: the half of the last cycle that is still to come does not count."""
    cycle, count = 0.05, 90
    acceleration = np.sin(0.1 * np.arange(count + 1))[None]
    modes = SwayModes(poles=np.array([[-0.1 + 1.3j]]), gains=np.ones((1, 1, 1, 1)))
    fine = np.arange(0, count * 200 + 1) / 200
    rate = np.interp(fine, np.arange(count + 1), acceleration[0])
    expected = np.trapezoid(rate * np.exp(modes.poles[0, 0] * cycle * (count - fine)), fine * cycle)
    assert modes.moved(acceleration, [count], cycle).item() == pytest.approx(expected, rel=1e-6)


def test_machines_between_those_that_the_block_watches_are_tried_where_a_history_is_long():
    spec = preset_spec("bay-crane")
    lines = Histories.of(spec).machines_of_errors({"L1": 9.0, "m2": 2000.0})
    short, long = (GivenModes.of(spec.machine(), [0], lines, (), seconds) for seconds in (60.0, 1600.0))
    assert len(short.modes.poles) == 1 + 2 * USUAL
    turns = np.diff(np.unique(long.modes.poles[:, 0].imag)) * 1600.0
    assert turns.max() < 0.46


def test_each_wrong_machine_sways_in_its_own_shape():
    """Of two springs, by a generalised eigenproblem of mass and stiffness."""
    spec = parse_spec(STACKER)
    histories = Histories.of(spec)
    modes = GivenModes.of(spec.machine(), [0], histories.machines_of_errors({"m2": 1000.0})).modes
    parameters = spec.plant.parameters
    for ratio, gains, poles in ((1.0, modes.gains[0], modes.poles[0]), (0.9, modes.gains[9], modes.poles[9])):
        m1, m2, k1, k2 = parameters["m1"], ratio * 1000.0, parameters["k1"], parameters["k2"]
        mass, stiffness = np.diag([m1, m2]), np.array([[k1 + k2, -k2], [-k2, k2]])
        squares, shapes = eigh(stiffness, mass)
        # relative to the axis, each mass is pushed by −m: modal force −(shape · m), shown by the shape itself
        expected = np.abs(shapes * (shapes.T @ mass @ np.ones(2))) / np.sqrt(squares)
        assert np.abs(poles) == pytest.approx(np.sqrt(squares), rel=1e-3)
        assert np.abs(gains[:, 0]) == pytest.approx(expected, rel=2e-3)
