"""Profiles against SciPy's piecewise polynomials, and cycle grids against decimal arithmetic."""

import math
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PPoly

from gen_profile.motion.profile import Profile, SampledProfile, grid_length, grid_times, sample
from gen_profile.support.errors import GenProfileError

NUMBERS = st.floats(-10.0, 10.0, allow_subnormal=False)
EXACT_DECIMALS = st.integers(1, 10**6).map(lambda n: n / 10**6)


def arrays(*shape):
    count = int(np.prod(shape))
    return st.lists(NUMBERS, min_size=count, max_size=count).map(lambda v: np.reshape(v, shape))


@st.composite
def profiles(draw):
    segments, order, axes = draw(st.integers(1, 5)), draw(st.integers(1, 7)), draw(st.integers(1, 3))
    lengths = draw(st.lists(st.floats(0.01, 2.0), min_size=segments, max_size=segments))
    return Profile(
        knots=np.concatenate([[0.0], np.cumsum(lengths)]),
        coefficients=draw(arrays(segments, order, axes)),
        target=draw(arrays(axes)),
        method="drawn",
    )


def quintic(distance=0.3, duration=3.0):
    shape = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * distance / duration ** np.arange(6)
    return Profile(
        knots=[0.0, duration], coefficients=shape[None, :, None], target=[distance], method="quintic"
    )


def as_scipy(profile):
    return PPoly(np.moveaxis(profile.coefficients, 1, 0)[::-1], profile.knots)


@pytest.mark.slow
@given(profiles(), st.integers(0, 8), st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=1))
def test_every_derivative_agrees_with_scipy(profile, order, shares):
    times = np.append(np.array(shares) * profile.duration, profile.knots[:-1])
    times = times[times < profile.duration]
    np.testing.assert_allclose(
        profile.derivative(times, order), as_scipy(profile)(times, nu=order), rtol=1e-9, atol=1e-9
    )


@pytest.mark.slow
@given(profiles(), st.floats(0.0, 100.0), st.floats(1e-6, 100.0))
def test_it_stands_at_both_ends(profile, after, before):
    motion = profile(np.array([profile.duration + after, -before]))
    np.testing.assert_array_equal(motion.position, [profile.target, profile.start])
    for derivative in (motion.velocity, motion.acceleration, motion.jerk):
        np.testing.assert_array_equal(derivative, np.zeros((2, profile.axes)))


@pytest.mark.slow
@given(profiles(), st.integers(0, 4))
def test_segments_are_seen_from_within(profile, order):
    times, values = profile.within_segments(3, order)
    assert times.shape == (3 * (len(profile.knots) - 1),)
    for k, (a, b) in enumerate(pairwise(profile.knots)):
        np.testing.assert_allclose(times[3 * k : 3 * k + 3], [a, (a + b) / 2.0, b], rtol=1e-15)
        alone = PPoly(profile.coefficients[k, ::-1][:, None], [0.0, b - a])
        expected = alone([0.0, (b - a) / 2.0, b - a], nu=order)
        np.testing.assert_allclose(values[3 * k : 3 * k + 3], expected, rtol=1e-9, atol=1e-9)


def test_a_jump_shows_from_within():
    step = Profile(knots=[0.0, 1.0, 2.0], coefficients=[[[1.0]], [[2.0]]], target=[2.0], method="step")
    _, values = step.within_segments(2, 0)
    np.testing.assert_array_equal(values[:, 0], [1.0, 1.0, 2.0, 2.0])
    assert step.derivative(np.array([1.0]), 0) == 2.0  # right-continuous


@pytest.mark.parametrize(
    "faulty",
    [
        {"knots": [0.0, 1.0, 2.0]},
        {"knots": [0.5, 1.0]},
        {"knots": [0.0, 0.0]},
        {"knots": [0.0, float("nan")]},
        {"target": [1.0, 2.0]},
        {"target": [float("inf")]},
        {"coefficients": [[[float("nan")]]]},
    ],
)
def test_a_broken_profile_is_refused(faulty):
    sound = {"knots": [0.0, 1.0], "coefficients": [[[0.0]]], "target": [1.0], "method": "sound"}
    Profile(**sound)
    with pytest.raises(GenProfileError):
        Profile(**sound | faulty)


def test_values_cannot_be_altered():
    profile = quintic()
    with pytest.raises(ValueError, match="read-only"):
        profile.coefficients[0, 0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        sample(profile, 0.1).position[0, 0] = 1.0


@given(profiles())
def test_the_hash_tells_motions_apart_and_nothing_else(profile):
    parts = {"knots": profile.knots, "coefficients": profile.coefficients, "target": profile.target}
    renamed = Profile(**parts, method="renamed")
    assert renamed.payload_hash() == profile.payload_hash()
    nudged = np.nextafter(profile.target, np.inf)
    assert Profile(**parts | {"target": nudged}, method="drawn").payload_hash() != profile.payload_hash()
    stopped, onward = (np.full(profile.axes, speed) for speed in (0.0, 0.1))
    assert Profile(**parts, final_velocity=stopped, method="drawn").payload_hash() == profile.payload_hash()
    assert Profile(**parts, final_velocity=onward, method="drawn").payload_hash() != profile.payload_hash()


@given(st.integers(1, 2000), EXACT_DECIMALS)
def test_a_whole_number_of_cycles_is_counted_exactly(count, cycle):
    duration = float(Decimal(repr(cycle)) * count)
    assert grid_length(duration, cycle) == count


def test_the_cases_that_floats_miscount():
    assert math.ceil(0.07 / 0.005) == 15
    assert grid_length(0.07, 0.005) == 14
    assert grid_length(3.0, 0.007) == 429
    assert grid_length(3.0000001, 0.001) == 3001


@given(st.floats(1e-5, 10.0), st.integers(1, 500))
def test_grid_times_are_correctly_rounded(cycle, cycles):
    step = Fraction(repr(cycle))
    assert list(grid_times(cycles, cycle)) == [float(k * step) for k in range(cycles + 1)]


@given(st.floats(1e-3, 0.5), st.floats(0.5, 5.0))
def test_samples_lie_on_the_motion_and_end_on_the_target(cycle, duration):
    profile = quintic(duration=duration)
    setpoints = sample(profile, cycle)
    assert setpoints.times[-2] < duration <= setpoints.times[-1]
    np.testing.assert_array_equal(setpoints.position, profile(setpoints.times).position)
    assert setpoints.position[-1] == profile.target
    assert setpoints.velocity[-1] == setpoints.acceleration[-1] == setpoints.jerk[-1] == 0.0


@pytest.mark.parametrize(
    "faulty",
    [
        {"position": [[0.0]]},
        {"position": [0.0, 1.0], "resolution": [0.0]},
        {"position": [[0.0], [float("nan")]]},
        {"velocity": [[0.0]]},
        {"jerk": [[0.0], [float("inf")]]},
        {"cycle_time": 0.0},
        {"cycle_time": float("nan")},
    ],
)
def test_broken_samples_are_refused(faulty):
    sound = {"cycle_time": 0.001, "position": [[0.0], [1.0]]}
    assert SampledProfile(**sound).resolution == 0.0
    with pytest.raises(GenProfileError):
        SampledProfile(**sound | faulty)


def test_setpoints_with_another_cycle_are_another_payload():
    positions = [[0.0], [1.0]]
    slow, fast = (SampledProfile(cycle_time=c, position=positions) for c in (0.002, 0.001))
    assert slow.payload_hash() != fast.payload_hash()
