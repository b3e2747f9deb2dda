"""Random bays, beside a nonlinear program with a free hoist; STACK_BAYS=100 tries as many as that."""

import os

import numpy as np
import pytest
from generator.oracles.stack_crossing import one_by_one, quickest
from generator.quay import HEIGHT, LIMITS, RAIL, ROPE, WIDTH, followed, quay, shortage

import gen_profile as gp
from gen_profile.methods.solvers.over_stacks.bay import bay_of

BAYS = int(os.environ.get("STACK_BAYS", "2"))
LOW_STACKS = 36  # a bay over which the load is best lifted no higher than it must be
NEARER = 5e-4  # m, by which no load may come nearer to a stack than the clearance
LONGER = 1.03  # times the nonlinear program's duration, which is held off stacks at some instants only
FREE = {"sway": None, "axis": {axis: {**limits, "travel": None} for axis, limits in LIMITS["axis"].items()}}
NODES = 31


def random_bay(number):
    """One to four stacks of any height and distance, and ends that are clear of them."""
    random, x, stacks = np.random.default_rng([20, number]), 5.0, []
    for _ in range(random.integers(1, 5)):
        left = x + random.uniform(2.5, 6.0)
        x = left + random.uniform(2.0, 6.0)
        stacks.append([left, x, random.uniform(5.0, 30.0)])
    start, target = (
        [0.0, random.uniform(22.0, 30.0)],
        [x + random.uniform(4.0, 10.0), random.uniform(8.0, 28.0)],
    )
    no_ranges = {"method": None, "uncertain": None}
    return quay(
        stacks,
        move={"start": start, "target": target},
        path={"clearance": 0.5},
        limits=FREE,
        robustness=no_ranges,
    )


def as_the_oracle_takes_it(spec):
    beside, above = WIDTH / 2.0 + 0.5, HEIGHT / 2.0 + 0.5
    rates = [
        [LIMITS["axis"][axis][rate] for rate in ("velocity", "acceleration", "jerk")]
        for axis in ("cart", "hoist")
    ]
    (x0, paid0), (x1, paid1) = spec.move.start, spec.move.target
    return {
        "start": (x0, ROPE + paid0),
        "target": (x1, ROPE + paid1),
        "zones": [
            (left - beside, right + beside, RAIL - top - above) for left, right, top in spec.path.stacks
        ],
        "limits": rates,
        "rope": ROPE,
    }


def guess_of(plan):
    """The states of a plan at even times, for the other program to begin at."""
    times = np.linspace(0.0, plan.motion.duration, NODES)
    (cart, hoist), (v, paid), (a, push) = (plan.motion.derivative(times, order).T for order in range(3))
    swing = plan.evaluation.swing.at(times)[0]
    return np.stack([cart, v, a, ROPE + hoist, paid, push, swing.q_u[:, 0], swing.dq_u[:, 0]]), times[-1]


def test_the_hoist_goes_through_the_height_that_is_needed_without_a_rest():
    spec = random_bay(3)
    bay = bay_of(spec)
    assert gp.plan(spec).motion.duration < 0.99 * bay.quickest_lift(bay.needed)


def test_a_duration_just_above_the_shortest_has_a_motion_where_the_hoist_waits():
    spec = random_bay(LOW_STACKS)
    duration = round(1.003 * gp.plan(spec).motion.duration, 2)
    found = gp.plan(gp.evolve_spec(spec, move={"duration": duration}))
    assert found.motion.duration == pytest.approx(duration)
    assert found.passage.nearest.room >= -NEARER


@pytest.mark.slow
@pytest.mark.parametrize("number", sorted({*range(BAYS), LOW_STACKS}))
def test_no_other_program_is_much_quicker(number):
    spec = random_bay(number)
    plan, bay = gp.plan(spec), as_the_oracle_takes_it(spec)
    times = np.linspace(0.0, plan.motion.duration, 20001)
    x, z, _ = followed(plan.motion, ROPE, times)
    assert shortage(x, z, spec.path, spec.move.start[0], spec.move.target[0]) <= NEARER
    guesses = [guess_of(plan), one_by_one(bay, plan.passage.one_by_one, NODES)]
    others = [found for guess in guesses if (found := quickest(bay, guess, NODES - 1)) is not None]
    assert others
    assert plan.motion.duration <= LONGER * min(others)
