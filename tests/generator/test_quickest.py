"""The quickest motions that a promise allows, against closed forms and an integration of the machine."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gen_profile.methods.quickest.axis_alone import AxisLimits, to_place, to_velocity
from gen_profile.methods.quickest.motion import AxisGoal, AxisState, Promise, alone, motion, quickest

LIMITS = AxisLimits(velocity=1.0, acceleration=0.5, jerk=2.0)
PERIOD = 4.0
RATE = 2.0 * np.pi / PERIOD
REST = AxisState(place=0.0, velocity=0.0, acceleration=0.0, moved=np.zeros((3, 1)))


def promise(left=1e-3, error=0.05, limits=LIMITS, gain=1.0):
    rates = RATE * (1.0 + error * np.array([0.0, -1.0, 1.0]))
    return Promise(poles=1j * rates[:, None], gains=gain / rates[:, None], left=left, limits=limits)


def test_an_axis_alone_is_as_quick_as_by_its_polynomials():
    assert to_velocity(0.0, 0.0, 1.0, LIMITS) == pytest.approx(1.0 / 0.5 + 0.5 / 2.0)
    assert to_velocity(0.0, 0.0, 0.02, LIMITS) == pytest.approx(2.0 * (0.02 / 2.0) ** 0.5)
    assert to_velocity(0.6, 0.3, 0.6, LIMITS) > 0.3 / 2.0  # it must come back
    assert to_place(10.0, 0.0, 0.0, LIMITS) == pytest.approx(10.0 / 1.0 + 1.0 / 0.5 + 0.5 / 2.0)
    assert to_place(-10.0, 0.0, 0.0, LIMITS) == pytest.approx(12.25)
    assert to_place(1e-3, 0.0, 0.0, LIMITS) == pytest.approx(4.0 * (1e-3 / (2.0 * 2.0)) ** (1.0 / 3.0))
    overshoots = to_place(0.1, 0.8, 0.0, LIMITS)
    stops = to_velocity(0.8, 0.0, 0.0, LIMITS)
    assert overshoots == pytest.approx(stops + to_place(0.1 - 0.5 * 0.8 * stops, 0.0, 0.0, LIMITS), rel=0.1)


@pytest.mark.parametrize("goal", [AxisGoal(place=3.0), AxisGoal(place=0.2), AxisGoal(speed=0.8)])
def test_a_load_that_may_swing_as_it_likes_changes_nothing(goal):
    free = promise(left=1e3, gain=1e-9)
    free = Promise(poles=free.poles[1:], gains=free.gains[1:], exact=0, left=1e3, limits=LIMITS)
    state = AxisState(place=0.0, velocity=0.1, acceleration=-0.2, moved=np.zeros((2, 1)))
    found = quickest(free, state, goal, 60.0)
    assert found == pytest.approx(alone(LIMITS, state, goal), abs=1.5 * free.piece)


@pytest.mark.parametrize("place", [0.5, 2.0, 8.0])
def test_a_period_more_than_the_axis_alone_is_enough_for_any_error(place):
    """The shaper that leaves nothing to first order is a period long; exact machines need half of one."""
    time = quickest(promise(left=1e-6, error=1e-3), REST, AxisGoal(place=place), 60.0)
    assert to_place(place, 0.0, 0.0, LIMITS) <= time <= to_place(place, 0.0, 0.0, LIMITS) + PERIOD + 0.4
    sloppy = quickest(promise(left=1.0), REST, AxisGoal(place=place), 60.0)
    assert sloppy <= min(time, to_place(place, 0.0, 0.0, LIMITS) + 0.5 * PERIOD + 0.4)


def test_more_may_be_left_where_it_is_quicker_and_none_is_found_in_less():
    times = [quickest(promise(left), REST, AxisGoal(place=1.0), 60.0) for left in (0.3, 1e-2, 1e-4)]
    assert times[0] < times[1] <= times[2]
    one = promise(1e-2)
    assert motion(one, REST, AxisGoal(place=1.0), round(times[1] / one.piece)) is not None
    assert motion(one, REST, AxisGoal(place=1.0), round(times[1] / one.piece) - 1) is None


@pytest.mark.parametrize("goal", [AxisGoal(place=2.0), AxisGoal(), AxisGoal(speed=-0.5)])
def test_loads_on_a_motion_end_as_promised_on_the_way_from_any_state(goal):
    """Each machine is integrated from what it was moved before, by a general method."""
    kept, begin = promise(0.02), 1.3
    past = np.array([[-0.02, 0.3], [0.1, 0.2], [0.5, 0.0]])  # s, accelerations until now, from rest
    times, values = np.array([0.0, 0.5, begin]), past[:, 1] * np.array([0.0, 1.0, 0.4])

    def before(t):
        return np.interp(t, times, values)

    fine = np.linspace(0.0, begin, 20001)
    moved = [np.trapezoid(before(fine) * np.exp(p * (begin - fine)), fine) for p in kept.poles[:, 0]]
    velocity = np.trapezoid(before(fine), fine)
    state = AxisState(
        place=0.5, velocity=velocity, acceleration=before(begin), moved=np.array(moved)[:, None]
    )
    time = quickest(kept, state, goal, 60.0)
    found = motion(kept, state, goal, round(time / kept.piece), shortest=True)
    knots = kept.piece * np.arange(found.shape[1])
    assert np.abs(np.diff(found[0]) / kept.piece).max() <= LIMITS.jerk * (1.0 + 1e-6)
    assert (found[1, -1], found[0, -1]) == pytest.approx((goal.speed, 0.0), abs=1e-7)
    for rate, left in zip(kept.poles[:, 0].imag, (1e-4, 0.02, 0.02), strict=True):

        def push(t):
            return before(t) if t < begin else np.interp(t - begin, knots, found[0])

        swung = solve_ivp(
            lambda t, y: [y[1], -(rate**2) * y[0] - push(t)],  # noqa: B023
            (0.0, begin + time),
            [0.0, 0.0],
            max_step=0.01,
            rtol=1e-8,
            atol=1e-10,
        ).y[:, -1]
        assert np.hypot(swung[0], swung[1] / rate) <= 1.09 * left  # eight shadows allow 8 % more


def test_travel_that_is_used_up_leaves_no_motion():
    short = Promise(
        poles=1j * RATE * np.ones((1, 1)), gains=np.ones((1, 1)), left=1.0, limits=LIMITS, travel=(0.0, 1.0)
    )
    state = AxisState(place=0.99, velocity=0.9, acceleration=0.0, moved=np.zeros((1, 1)))
    assert quickest(short, state, AxisGoal(), 30.0) is None
