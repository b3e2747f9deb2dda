"""The planner whose rope changes on the way, on a nonlinear crane: limits, targets, stops, what is left."""

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting, require_interpreted
from exporters.swinging_crane import Hoist, SwingingCrane
from played_planner import played_text

from gen_profile.planner.design import planner_constants
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.sizes import operations

CYCLE, ALLOWED = 0.004, 0.05  # s, m


@pytest.fixture(scope="module")
def spec():
    return preset_spec(
        "bay-crane",
        ["planner.live_rate={L1=0.3}", "check.uncertain={L1=0.01}", "limits.travel=[-100.0, 140.0]"],
    )


@pytest.fixture(scope="module")
def compiled(spec):
    return compile_counting(played_text(spec))


class Played:
    """The planner, and a crane that swings by its setpoints on the rope that is given, or a wrong one."""

    def __init__(self, compiled, hoist, *, error=0.0, load=2000.0):
        self.hoist, self.error, self.time, self.before = hoist, error, 0.0, 0.0
        self.crane = SwingingCrane(hoist(0.0, error)[0], load=load)
        self.block = CountedBlock(compiled, fActPosition=20.0, fL1=hoist(0.0)[0], fm2=load)
        self.block.hold(100)
        self.rows = []

    def run(self, seconds, **inputs):
        """Outputs and the load's sway, until then; a target's edge is given once."""
        self.block.inputs |= {"bExecute": 0.0} | inputs
        first = len(self.rows)
        for _ in range(round(seconds / CYCLE)):
            self.block.inputs["fL1"] = self.hoist(self.time + CYCLE)[0]
            out = self.block.step()
            ropes = [self.hoist(self.time + share * CYCLE, self.error) for share in (0.0, 0.5, 1.0)]
            self.crane.advance(self.before, out["fAcceleration"], ropes, CYCLE)
            self.before, self.time = out["fAcceleration"], self.time + CYCLE
            self.rows.append(out | {"sway": self.crane.sway})
        return {name: np.array([row[name] for row in self.rows[first:]]) for name in self.rows[-1]}

    def all(self):
        return {name: np.array([row[name] for row in self.rows]) for name in self.rows[-1]}


def hoisting(random):
    """Legs of a hoist for a minute, and the rope that it begins with."""
    rope = now = float(random.uniform(3.5, 8.5))
    legs, time = [], 0.0
    while time < 50.0:
        rate = float(random.choice([-0.3, 0.3, 0.15]))
        way = min(float(random.uniform(0.5, 2.5)), (8.95 - now) if rate > 0 else (now - 3.05))
        if way > 0.25:
            legs.append((time, rate, way))
            now, time = now + np.sign(rate) * way, time + way / abs(rate) + 0.8
        time += float(random.uniform(0.0, 3.0))
    return Hoist(rope, *legs)


def require_limits(spec, issued):
    limits = spec.limits.of(0)
    jerk = np.diff(issued["fAcceleration"]) / CYCLE
    assert np.abs(issued["fVelocity"]).max() <= limits.velocity * (1.0 + 1e-9)
    assert np.abs(issued["fAcceleration"]).max() <= limits.acceleration * (1.0 + 1e-9)
    assert np.abs(jerk).max() <= limits.jerk * (1.0 + 1e-6)
    assert np.all(issued["operations"] <= issued["nSpent"])
    assert issued["nSpent"].max() <= operations(planner_constants(spec)[1])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_random_commands_while_hoisting_end_with_a_load_that_hangs_still(spec, compiled, seed):
    random = np.random.default_rng([47, seed])
    played = Played(compiled, hoisting(random), error=(0.0, 0.01, -0.01, 0.0)[seed])
    target = None
    for _ in range(6):
        kind, seconds = random.random(), random.uniform(1.0, 12.0)
        if kind < 0.3:
            played.run(seconds, bStop=1.0, bVelocity=0.0)
        elif kind < 0.6:
            played.run(seconds, bStop=0.0, bVelocity=1.0, fVelocityCommand=random.choice([-1.1, 0.4, 1.1]))
        else:
            target = float(random.uniform(5.0, 35.0))
            played.run(2 * CYCLE, bStop=0.0, bVelocity=0.0, bExecute=0.0)
            played.run(CYCLE, bExecute=1.0, fTarget=target)
            played.run(seconds)
    if seed % 2:
        played.run(CYCLE, bVelocity=0.0, bStop=0.0, bExecute=1.0, fTarget=20.0)
    last = played.run(60.0, **({} if seed % 2 else {"bStop": 1.0, "bVelocity": 0.0}))
    assert not last["bMoving"][-1000:].any()
    assert np.abs(last["sway"][-1500:]).max() <= (0.01 if seed in {0, 3} else 0.5 * ALLOWED)
    if seed % 2:
        assert last["fPosition"][-1] == pytest.approx(20.0, abs=1e-9)
    require_limits(spec, played.all())


@pytest.mark.slow
@pytest.mark.parametrize(("rope", "rate"), [(6.0, 0.3), (8.0, -0.3), (4.0, 0.3)])
def test_stops_while_hoisting_end_within_eight_seconds(spec, compiled, rope, rate):
    for moment in (2.0, 4.0, 7.0):
        played = Played(compiled, Hoist(rope, (0.5, rate, 2.9)))
        played.run(CYCLE, bExecute=1.0, fTarget=80.0)
        played.run(moment)
        stop = played.run(25.0, bStop=1.0)
        rests = (np.flatnonzero(stop["bMoving"])[-1] + 1) * CYCLE
        assert rests <= 8.0
        assert np.abs(stop["sway"][-2500:]).max() <= 0.01
        require_limits(spec, played.all())


@pytest.mark.slow
def test_the_interpreter_issues_the_same_bits(spec, compiled):
    block = CountedBlock(compiled, fActPosition=20.0, fL1=6.0, fm2=2000.0)
    orders = [(3, {}), (80, {"bExecute": 1.0, "fTarget": 23.0}), (40, {"fL1": 6.01}), (60, {"bStop": 1.0})]
    require_interpreted(played_text(spec), block, orders)
