"""The block that brakes at once: limits, rest, way and time, held to what was found by other means."""

import numpy as np
import pytest
from counted_block import require_interpreted
from scipy.optimize import linprog

from gen_profile.planner.execution import BlockInstance
from gen_profile_exporters.planner.blocks.texts import filled

TEXT = filled("quick_stop", quick_stop="FB_quick_stop")
CYCLE, CYCLES = 0.02, 600
BEGIN = ("bBegin", "fBeginAt", "fBeginVelocity", "fBeginAcceleration", "fDeceleration", "fJerk", "fCycle")


def states(count, seed):
    """Random states and limits, as rows: place, velocity, acceleration, deceleration, jerk."""
    draw = np.random.default_rng(seed)
    most, jerk = draw.uniform(0.5, 3.0, count), np.exp(draw.uniform(np.log(0.3), np.log(30.0), count))
    velocity = draw.uniform(-2.0, 2.0, count) * draw.choice([0.0, 0.01, 0.3, 1.0], count)
    # within the limit, at it, none, or as of limits that were higher
    acceleration = most * draw.choice([0.0, 1.0, -1.0, 1.5, 0.4], count) * draw.uniform(-1.0, 1.0, count)
    acceleration = np.clip(acceleration, -np.sqrt(2.0 * jerk), np.sqrt(2.0 * jerk))  # worth 1 m/s at most
    return np.array([draw.uniform(-30.0, 30.0, count), velocity, acceleration, most, jerk]).T


def braked(rows):
    """Play each state until it rests: outputs by name, (states, cycles + 1) with the state itself first."""
    given = np.zeros((len(rows), CYCLES, len(BEGIN)))
    given[:, 0, 0], given[:, :, 1:6], given[:, :, 6] = 1.0, rows[:, None, :], CYCLE
    block = BlockInstance(TEXT)
    issued = block.call(given.reshape(-1, len(BEGIN))).reshape(len(rows), CYCLES, -1)
    columns = {name: issued[:, :, number] for number, name in enumerate(block.outputs)}
    end, time = columns["fEnd"][:, 0], columns["fTimeToGo"][:, 0] + CYCLE
    before = dict(
        zip(columns, [*rows[:, :3].T, end, columns["fLow"][:, 0], columns["fHigh"][:, 0], time], strict=True)
    )
    return {name: np.column_stack([before[name], column]) for name, column in columns.items()}


def fed_back(rows, step):
    """Where and when it ends by the law of feedback: the jerk is -J where v + a |a| / 2 J > 0."""
    place, velocity, acceleration, most, jerk = rows.T.copy()
    ends = np.zeros(len(rows))
    sign = np.sign(velocity + 0.5 * acceleration * np.abs(acceleration) / jerk)
    for number in range(round(CYCLES * CYCLE / step)):
        toward = sign * acceleration
        more = sign * velocity + 0.5 * toward * np.abs(toward) / jerk > 0.0
        turn = np.where(more, np.where(toward > -most, -jerk, np.where(toward < -most, jerk, 0.0)), jerk)
        turn = np.where(more & (np.abs(toward + most) < jerk * step), (-most - toward) / step, turn)
        turn = sign * np.where(~more & (toward >= -jerk * step), -toward / step, turn)
        rests = ~more & (np.abs(toward) < 1e-12)
        ends = np.where(rests, ends, (number + 1) * step)
        place = place + np.where(rests, 0.0, step * (velocity + step * (acceleration / 2 + step * turn / 6)))
        velocity = velocity + np.where(rests, 0.0, step * (acceleration + step * turn / 2))
        acceleration = acceleration + np.where(rests, 0.0, step * turn)
    return place, ends


@pytest.fixture(scope="module")
def played():
    rows = states(10_000, 5)
    return rows, braked(rows)


@pytest.mark.slow
def test_limits_are_kept_and_every_state_ends_at_rest_where_it_was_said(played):
    rows, issued = played
    _, velocity, acceleration, most, jerk = rows.T
    assert np.all(issued["fVelocity"][:, -1] == 0.0) and np.all(issued["fAcceleration"][:, -1] == 0.0)
    assert np.all(issued["fTimeToGo"][:, -1] == 0.0)
    assert np.array_equal(issued["fPosition"][:, -1], issued["fEnd"][:, -1])
    assert np.all(issued["fEnd"] == issued["fEnd"][:, :1])
    begun = np.maximum(most, np.abs(acceleration))
    assert np.all(np.abs(issued["fAcceleration"]) <= begun[:, None] * (1.0 + 1e-12))
    assert np.all(np.abs(np.diff(issued["fAcceleration"])) <= (jerk * CYCLE * (1.0 + 1e-9) + 1e-12)[:, None])
    reached = np.abs(velocity) + 0.5 * acceleration**2 / jerk  # what no jerk within J could avoid
    assert np.all(np.abs(issued["fVelocity"]) <= (reached * (1.0 + 1e-12))[:, None])


@pytest.mark.slow
def test_it_says_between_which_places_it_stays(played):
    """One that comes back had its turn beyond both its beginning and its end."""
    rows, issued = played
    low, high = issued["fPosition"].min(axis=1), issued["fPosition"].max(axis=1)
    said = issued["fLow"][:, 1], issued["fHigh"][:, 1]
    assert np.all(said[0] <= low + 1e-12) and np.all(said[1] >= high - 1e-12)
    ends = np.sort([rows[:, 0], issued["fEnd"][:, 0]], axis=0)
    reversed_ = said[1] - said[0] > ends[1] - ends[0] + 1e-9
    assert reversed_.sum() > 100
    a = np.abs(rows[:, 2]) + rows[:, 3] + rows[:, 4] * CYCLE  # between cycles by less than these leave
    assert np.all(low - said[0] <= a * CYCLE**2) and np.all(said[1] - high <= a * CYCLE**2)


@pytest.mark.slow
def test_setpoints_are_one_motion(played):
    """By Simpson's rule and the trapezoids, but where a cycle has a change of jerk within it."""
    rows, issued = played
    bound = rows[:, 4, None]
    place, velocity, acceleration = (issued[f"f{name}"] for name in ("Position", "Velocity", "Acceleration"))
    slope = np.diff(velocity) - CYCLE * (acceleration[:, 1:] + acceleration[:, :-1]) / 2
    assert np.all(np.abs(slope) <= bound * CYCLE**2 / 4 + 1e-12)
    way = np.diff(place) - CYCLE * (velocity[:, 1:] + velocity[:, :-1]) / 2
    assert np.all(np.abs(way) <= CYCLE**2 / 6 * np.abs(np.diff(acceleration)) + bound * CYCLE**3 / 4 + 1e-9)


@pytest.mark.slow
def test_way_and_time_are_those_of_the_law_of_feedback(played):
    rows, issued = played
    step = 2e-3
    chosen = np.flatnonzero(issued["fTimeToGo"][:, 1] > 0.0)[:300]
    place, ends = fed_back(rows[chosen], step)
    assert np.abs(ends - issued["fTimeToGo"][chosen, 0]).max() < 4.0 * step
    assert np.all(np.abs(place - issued["fEnd"][chosen, 0]) < 2e-2)
    assert np.abs(place - issued["fEnd"][chosen, 0]).mean() < 2e-3


def test_no_linear_programme_rests_sooner():
    """Rest in time T by jerks of 100 steps: found a little later than the block, and not a little sooner."""
    rows = states(20, 8)
    rows = rows[np.abs(rows[:, 2]) <= rows[:, 3]]
    times = braked(rows)["fTimeToGo"][:, 0]
    for (_, velocity, acceleration, most, jerk), time in zip(
        rows[times > 0.05], times[times > 0.05], strict=True
    ):
        for factor, found in ((1.05, 0), (0.95, 2)):
            step = factor * time / 100
            sums = step * np.tril(np.ones((100, 100)))
            rest = np.array([sums[-1], step * (step / 2 + np.arange(99, -1, -1) * step)])
            limits = [*(most - acceleration + 0 * sums[:, 0]), *(most + acceleration + 0 * sums[:, 0])]
            result = linprog(
                np.zeros(100), A_ub=np.vstack([sums, -sums]), b_ub=limits, A_eq=rest,
                b_eq=[-acceleration, -velocity - 100 * step * acceleration], bounds=(-jerk, jerk),
            )  # fmt: skip
            assert result.status == found


def test_it_begins_anew_wherever_it_is_asked_to_and_the_interpreter_issues_the_same_bits():
    block = BlockInstance(TEXT)
    names = list(block.inputs)

    class Held:
        inputs = dict.fromkeys(names, 0.0)

        def hold(self, cycles, **given):
            self.inputs |= given
            issued = block.call(np.tile([self.inputs[name] for name in names], (cycles, 1)))
            return dict(zip(block.outputs, issued.T, strict=True))

    orders = []
    for place, velocity, acceleration, most, jerk in states(60, 3).tolist():
        values = (1.0, place, velocity, acceleration, most, jerk, CYCLE)
        orders += [(1, dict(zip(BEGIN, values, strict=True))), (15, {"bBegin": 0.0})]
    assert require_interpreted(TEXT, Held(), orders)["fTimeToGo"] >= 0.0
