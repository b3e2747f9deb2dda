"""How soon and how far the planner block obeys, beside the quickest motions that keep the same promise.

Times from the command on, planning included, and ways, as ratios: stops and new targets at random
moments, and sticks from rest to a speed.
"""

import os
from collections import defaultdict

import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting

from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.left_swinging import GivenModes
from gen_profile.methods.quickest.axis_alone import AxisLimits
from gen_profile.methods.quickest.motion import AxisGoal, AxisState, Promise, motion, quickest
from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import preset_spec

STATES, LITTLE = int(os.environ.get("ORDERS", "60")), 0.02
PAPER = (
    "limits={velocity=0.3, acceleration=0.7, jerk=20.0, travel=[0.0, 2.0]}",
    "planner.live={L1=[0.3, 0.6]}",
    "check.residual_sway=0.01",
)
SLOW = "limits={velocity=2.0, acceleration=0.2, jerk=0.5, travel=[0.0, 80.0]}"
MACHINES = {
    "bay, 4 ms": ("bay-crane", ()),
    "bay, 4 ms, quick controller": ("bay-crane", ("planner.operations=60000",)),
    "bay, 20 ms": ("bay-crane", ("export.cycle_time=0.02",)),
    "slow drive, 4 ms": ("bay-crane", (SLOW,)),
    "paper, 1 ms": ("paper", PAPER),
}


class Axis:
    """A block at a random place, rope and load, and what it issued."""

    def __init__(self, spec, histories, compiled, random):
        self.spec, self.issued, limits = spec, [], spec.limits.of(0)
        live = {name: random.uniform(*ends) for name, ends in spec.planner.live.items()}
        self.modes = GivenModes.of(spec.machine(), [0], histories.machines_of_errors(live))
        self.rows = [0, *self.modes.ends]
        self.promise = Promise(
            poles=self.modes.modes.poles[self.rows],
            gains=np.abs(self.modes.modes.gains[self.rows, :, 0]).max(axis=1),
            left=spec.planner.sway_share * min(spec.check.residual_sway.values()),
            limits=AxisLimits(velocity=limits.velocity, acceleration=limits.acceleration, jerk=limits.jerk),
            travel=limits.travel,
        )
        inputs = {f"f{name}": value for name, value in live.items()}
        self.block = CountedBlock(compiled, fActPosition=random.uniform(*limits.travel), **inputs)
        self.cycle = spec.export.cycle_time
        self.period = self.modes.modes.periods[0]
        self.hold(1.0 * self.period)

    def hold(self, seconds, **inputs):
        issued = self.block.hold(max(2, round(seconds / self.cycle)), **inputs)
        self.issued.append(issued)
        return issued

    def state(self):
        named = ("fPosition", "fVelocity", "fAcceleration")
        x, v, a = (np.concatenate([part[name] for part in self.issued]) for name in named)
        ((moved,),) = self.modes.modes.moved(a[None], [len(a) - 1], self.cycle)
        return AxisState(place=x[-1], velocity=v[-1], acceleration=a[-1], moved=moved[self.rows])

    def soonest(self, state, goal):
        """Least time and, of a stop, least way of all that is possible; none where nothing is."""
        time = quickest(self.promise, state, goal, 60.0 * self.period)
        if time is None:
            return None
        pieces = round(time / self.promise.piece)
        return time, motion(self.promise, state, goal, pieces, shortest=True)[2, -1]

    def moves(self, random):
        """Move in some way for a while; whether it goes then."""
        low, high = self.spec.limits.of(0).travel
        while_ = random.uniform(0.2, 2.5) * self.period
        if random.integers(2):
            self.hold(while_, bExecute=1.0, fTarget=random.uniform(low, high))
        else:
            self.hold(0.0, bVelocity=1.0, fVelocityCommand=0.0)
            self.hold(while_, fVelocityCommand=self.promise.limits.velocity * random.choice([-1.0, 0.2, 1.0]))
        return abs(self.state().velocity) > LITTLE * self.promise.limits.velocity


def _rests(issued, cycle):
    """Time in s after which the axis stands, and how far it came."""
    moving = np.flatnonzero(issued["fVelocity"])
    return cycle * (moving[-1] + 1), issued["fPosition"][-1]


def _orders(axis, random):
    """Give an order at a random moment: by name the ratios of its time and way."""
    limits, period = axis.spec.limits.of(0), axis.period
    speed = limits.velocity * random.choice([0.2, 1.0])
    state = axis.state()
    if abs(state.place - sum(limits.travel) / 2) < 0.2 * (limits.travel[1] - limits.travel[0]):
        axis.hold(0.0, bVelocity=1.0, fVelocityCommand=0.0)
        starts = axis.hold(3.0 * period, fVelocityCommand=speed)
        soonest = axis.soonest(state, AxisGoal(speed=speed))
        has = starts["bInVelocity"] > 0.0
        if soonest and has.any():
            reached = np.argmax(has) * axis.cycle
            yield f"stick to {speed / limits.velocity:.0%}", reached / soonest[0], 1.0
        axis.hold(6.0 * period, bVelocity=0.0, bStop=1.0)
        axis.hold(0.0, bStop=0.0)
    if not axis.moves(random):
        return
    state = axis.state()
    if random.integers(2):
        time, place = _rests(axis.hold(12.0 * period, bStop=1.0, bVelocity=0.0), axis.cycle)
        soonest = axis.soonest(state, AxisGoal())
        if soonest:
            yield (
                "stop",
                time / soonest[0],
                abs(place - state.place) / max(abs(soonest[1] - state.place), 1e-3),
            )
    else:
        low, high = limits.travel
        target = float(np.clip(state.place + 0.15 * (high - low) * random.normal(), low, high))
        time, place = _rests(
            axis.hold(30.0 * period, bExecute=1.0, fTarget=target, bVelocity=0.0), axis.cycle
        )
        soonest = axis.soonest(state, AxisGoal(place=target))
        assert abs(place - target) < 1e-9
        if soonest:
            yield "new target", time / soonest[0], 1.0


@pytest.mark.parametrize("name", MACHINES)
def test_orders_at_random_moments(name):
    preset, changes = MACHINES[name]
    spec = preset_spec(preset, list(changes))
    random, found = np.random.default_rng(26), defaultdict(list)
    histories, compiled = Histories.of(spec), compile_counting(planner_block(spec).text)
    for _ in range(STATES):
        axis = Axis(spec, histories, compiled, random)
        for order, *ratios in _orders(axis, random):
            found[order].append(ratios)
    for order, ratios in sorted(found.items()):
        times, ways = np.transpose(ratios)
        way = f", way {ways.mean():.2f}, at most {ways.max():.2f}" if order == "stop" else ""
        print(
            f"{name}, {len(times)} {order}: time {times.mean():.2f} of the quickest,"
            f" at most {times.max():.2f}{way}"
        )
