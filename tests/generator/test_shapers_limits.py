"""Base moves, and the shortest shaped moves within limits."""

import attrs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import polynomial

from gen_profile.methods.shapers.base_moves import BASES, QUINTIC, SEPTIC, jerk_limited
from gen_profile.methods.shapers.impulses import SHAPERS
from gen_profile.methods.shapers.shaped_move import shaped_move
from gen_profile.methods.solvers.shape import shaped_motion, shortest_duration
from gen_profile.motion.metrics import greatest
from gen_profile.spec.model import AxisLimitsSpec, LimitsSpec
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import InfeasibleProblem, OutputError, SpecError

FREQUENCIES = (3.64, 9.017)
LIMITS = (0.3, 1.0, 4.0)
POSITIVE = st.floats(0.1, 10.0)


def ends(base, order):
    """A derivative of a base move at both ends of every segment."""
    coefficients = polynomial.polyder(base.coefficients.T, order)
    lengths = np.diff(base.knots)
    return polynomial.polyval(0.0 * lengths, coefficients, tensor=False), polynomial.polyval(
        lengths, coefficients, tensor=False
    )


def check_smooth(base, orders, rounding=1e-12):
    for order in range(orders):
        left, right = ends(base, order)
        np.testing.assert_allclose(left[1:], right[:-1], atol=rounding * 10.0**order)
        np.testing.assert_allclose(left[0], 0.0, atol=rounding * 10.0**order)
        np.testing.assert_allclose(right[-1], float(order == 0), atol=rounding * 10.0**order)


@pytest.mark.parametrize(("base", "orders"), [(QUINTIC, 3), (SEPTIC, 4)])
def test_polynomials_rest_at_both_ends(base, orders):
    check_smooth(base, orders)


def seven_segments(velocity, acceleration, jerk):
    """Duration of the fastest unit move, by the textbook's cases (Biagiotti and Melchiorri, 2008)."""
    if velocity * jerk < acceleration**2:
        acceleration = np.sqrt(velocity * jerk)
    if velocity * (velocity / acceleration + acceleration / jerk) > 1.0:  # the velocity is not reached
        ramp = acceleration / jerk
        velocity = (-acceleration * ramp + np.sqrt((acceleration * ramp) ** 2 + 4.0 * acceleration)) / 2.0
        if velocity * jerk < acceleration**2:  # nor the acceleration
            acceleration = (jerk**2 / 2.0) ** (1.0 / 3.0)
            velocity = acceleration**2 / jerk
    return 1.0 / velocity + velocity / acceleration + acceleration / jerk


@given(velocity=POSITIVE, acceleration=POSITIVE, jerk=POSITIVE)
def test_the_jerk_limited_move_is_the_textbook_s(velocity, acceleration, jerk):
    base = jerk_limited(LimitsSpec(velocity=velocity, acceleration=acceleration, jerk=jerk), [1.0])
    check_smooth(base, 3, rounding=1e-9)
    duration = seven_segments(velocity, acceleration, jerk)
    jerks = 6.0 * np.abs(base.coefficients[:, 3])
    np.testing.assert_allclose(jerks[jerks > 0.0], jerk * duration**3, rtol=1e-6)


def test_the_slowest_axis_sets_the_pace():
    own = {"x": AxisLimitsSpec(jerk=8.0), "y": AxisLimitsSpec(), "z": AxisLimitsSpec(jerk=1e-9)}
    base = jerk_limited(LimitsSpec(jerk=3.0, axis=own), [4.0, -2.0, 0.0])
    assert 6.0 * base.coefficients[0, 3] == pytest.approx(32.0)  # jerk alone: T³ = 32 / j for any j
    alone = jerk_limited(LimitsSpec(velocity=1.0, jerk=1.5), [1.0])
    both = jerk_limited(LimitsSpec(velocity=2.0, jerk=3.0), [0.5, 2.0])
    np.testing.assert_allclose(both.coefficients, alone.coefficients, atol=1e-12)


def test_a_jerk_limited_move_needs_a_limit():
    with pytest.raises(SpecError, match=r"^limits\.jerk: a jerk-limited base move needs it"):
        jerk_limited(LimitsSpec(velocity=1.0), [1.0])


def test_without_ruckig_the_sentence_tells_what_to_install(monkeypatch):
    monkeypatch.setattr("gen_profile.support.plugins.find_spec", lambda _: None)
    with pytest.raises(OutputError, match=r"pip install 'gen-profile\[ruckig\]'"):
        jerk_limited(LimitsSpec(jerk=1.0), [1.0])


def keeps(profile):
    return all(greatest(profile, order) <= limit for order, limit in enumerate(LIMITS, start=1))


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", SHAPERS)
def test_the_shortest_move_keeps_all_limits_and_a_shorter_one_does_not(name, base):
    limits = LimitsSpec(velocity=LIMITS[0], acceleration=LIMITS[1], jerk=LIMITS[2])
    move = shaped_move(
        name, start=[0.0], target=[0.3], frequencies=FREQUENCIES, base=BASES[base](limits, [0.3])
    )
    spec = preset_spec(
        "paper", [f"limits={{velocity={LIMITS[0]}, acceleration={LIMITS[1]}, jerk={LIMITS[2]}}}"]
    )
    spec = attrs.evolve(preset_spec("paper"), limits=limits)
    shortest = shortest_duration(spec, move)
    assert shortest > move.shaper.delay
    assert keeps(move.profile(shortest))
    assert not keeps(move.profile(shortest * (1.0 - 2e-4) - 2.0 * spec.export.cycle_time))


def test_limits_that_no_duration_keeps(monkeypatch):
    monkeypatch.setattr("gen_profile.methods.solvers.shape._breaches", lambda *_: ("whatever",))
    spec = preset_spec("paper", ["move.duration=minimum", "limits.velocity=0.3"])
    with pytest.raises(InfeasibleProblem, match=r"^move\.duration: no duration keeps the limits"):
        shaped_motion(spec, "zvd")


@given(name=st.sampled_from(["zvd", "ei", "zvdd", "mzv"]), order=st.integers(1, 3), spare=st.floats(0.3, 3.0))
def test_positive_shapers_never_exceed_the_peaks_of_their_base(name, order, spare):
    move = shaped_move(name, start=[0.0], target=[0.3], frequencies=FREQUENCIES)
    profile = move.profile(move.shaper.delay + spare)
    peak = {1: 15.0 / 8.0, 2: 10.0 / np.sqrt(3.0), 3: 60.0}[order]
    assert greatest(profile, order) <= 0.3 * peak / spare**order * (1.0 + 1e-9)
