"""What stated errors leave over hours: a promise for a while without damping, for hours with a little."""

import numpy as np
import pytest
from exporters.driven_block import G

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.machine import OVERSTATED
from gen_profile.spec.reading import preset_spec

pytestmark = pytest.mark.slow

CYCLE, LIMIT, ERROR, VELOCITY, HIGH = 0.02, 0.05, 0.05, 1.1, 40.0
M1, L2 = 350.0, 1.5
UNKNOWN = 2.0  # nPromise: what no motion makes up for was forgotten
ERRORS_OF_FREQUENCIES = 0.3  # rad, by which machines next to each other differ at the end
DAMPED = ["plant.c1=1150.0", "plant.c2=10.0"]  # 0.5 % with 6 m of rope


@pytest.fixture(scope="module")
def text():
    return planner_block(preset_spec("bay-crane", [f"export.cycle_time={CYCLE}"])).text


class Crane:
    """An instance, its inputs, and what it issued."""

    def __init__(self, text, rope, load, place=20.0):
        self.block, self.parts = BlockInstance(text), []
        self.given = self.block.inputs | {"bEnable": 1.0, "fL1": rope, "fm2": load, "fActPosition": place}
        self.hold(4.0)

    def hold(self, seconds, **inputs):
        self.given |= inputs
        rows = np.tile([*self.given.values()], (max(1, round(seconds / CYCLE)), 1))
        issued = dict(zip(self.block.outputs, self.block.call(rows).T, strict=True))
        kept = ("fVelocity", "fAcceleration", "fSwayLeft", "bPromise", "nPromise", "bDone")
        self.parts.append({name: issued[name].copy() for name in kept})
        return self

    def works(self, random, seconds, pause):
        """Move to places and throw the stick about, with pauses."""
        end = sum(len(part["bDone"]) for part in self.parts) + seconds / CYCLE
        while sum(len(part["bDone"]) for part in self.parts) < end:
            self.hold(CYCLE, bExecute=0.0, bVelocity=0.0)
            if random.random() < 0.75:
                self.hold(1.0, bExecute=1.0, fTarget=random.uniform(0.0, HIGH))
                while not self.parts[-1]["bDone"][-1]:
                    self.hold(1.0)
            else:
                self.hold(CYCLE, bVelocity=1.0, fVelocityCommand=0.0)
                for _ in range(3):
                    self.hold(random.uniform(1.0, 10.0), fVelocityCommand=random.uniform(-VELOCITY, VELOCITY))
                self.hold(15.0, fVelocityCommand=0.0)
            self.hold(random.exponential(pause))
        return self

    @property
    def outputs(self):
        return {name: np.concatenate([part[name] for part in self.parts]) for name in self.parts[0]}


def modes(rope, load):
    """Frequencies of two masses on ropes, and how the load that shows each most sways by it."""
    ratio = load / M1
    matrix = np.array([[(1.0 + ratio) * G / rope + ratio * G / L2, -ratio * G / L2], [-G / L2, G / L2]])
    squares, shapes = np.linalg.eig(matrix)  # sway'' = -acceleration - matrix sway
    order = np.argsort(squares)
    gains = np.abs(shapes * np.linalg.solve(shapes, np.ones(2))).max(axis=0)
    return np.sqrt(squares[order]), gains[order]


def worst(velocity, rope, load, decay=0.0, watched=False):
    """Greatest sway that a rope of any length within the error leaves, the modes each at its worst.

    `watched`: on the machines alone that the block watches, and as given.
    """
    from scipy.signal import czt  # noqa: PLC0415  (half a second in each process that collects these tests)

    low, high = (modes(rope * (1.0 + error), load)[0] for error in (ERROR, -ERROR))
    if watched:
        low, high = (modes(rope, load)[0] + 0.5 * sign * (high - low) for sign in (-1.0, 1.0))
    time, sways = CYCLE * np.arange(len(velocity)), []
    for first, last, gain in zip(low, high, modes(rope, load)[1], strict=True):
        count = 9 if watched else 2 + int((last - first) * time[-1] / ERRORS_OF_FREQUENCIES)
        step = (last - first) / (count - 1)
        waves = czt(
            velocity * np.exp(decay * (time - time[-1])),
            count,
            np.exp(-1j * step * CYCLE),
            np.exp(1j * first * CYCLE),
        )
        sways.append(gain * np.abs(waves).max() * CYCLE)
    return sum(sways)


def rests(out):
    """Cycles in which the axis comes to rest."""
    stands = (out["fVelocity"] == 0.0) & (out["fAcceleration"] == 0.0)
    return (np.flatnonzero(stands[1:] & ~stands[:-1]) + 1)[1:]


def require_true(out, at, rope, load, decay=0.0):
    """Require that no more is left than is stated, and no more than allowed while the block promises."""
    if out["nPromise"][at] == UNKNOWN:
        return
    found = worst(out["fVelocity"][:at], rope, load, decay)
    counted = 0.92 * found if decay else found  # the decays are 8 % and 60 % greater
    assert counted <= out["fSwayLeft"][at]
    assert counted <= LIMIT or not out["bPromise"][at]
    assert out["nPromise"][at] == (5.0 if out["fSwayLeft"][at] > LIMIT else 0.0)


@pytest.mark.parametrize(("rope", "load", "promised"), [(6.0, 1500.0, 540.0), (3.0, 100.0, 240.0)])
def test_nothing_is_forgotten_without_damping(text, rope, load, promised):
    """With eight machines 90 mm were left of 40 that were stated after half an hour."""
    out = Crane(text, rope, load).works(np.random.default_rng(1), 2000.0, 3.0).outputs
    ends = rests(out)
    for at in ends[:: -(len(ends) // 5)]:
        require_true(out, at, rope, load)
    for at in ends[ends < 80.0 / CYCLE]:  # what is between the machines watched is known
        known = worst(out["fVelocity"][:at], rope, load)
        assert out["fSwayLeft"][at] <= 1.065 * (1.0 + OVERSTATED) * known  # interpolated over live ranges
    assert out["bPromise"][200 : round(promised / CYCLE)].all()


@pytest.mark.parametrize("seed", [5, 6])
def test_an_axis_without_a_promise_moves_on_as_soon(text, seed):
    """A metre took up to 12 s: each plan that left a millimetre more than was left already was refused."""
    crane, random = Crane(text, 6.0, 1500.0), np.random.default_rng(seed)
    while crane.parts[-1]["bPromise"][-1]:
        crane.hold(CYCLE, bExecute=0.0, bVelocity=1.0, fVelocityCommand=0.0)
        speed = VELOCITY * random.choice([-1.0, -0.5, 0.5, 1.0])
        crane.hold(random.uniform(0.5, 7.0), fVelocityCommand=speed)
        target = random.uniform(0.0, HIGH)
        crane.hold(random.uniform(0.5, 9.0), bVelocity=0.0, bExecute=1.0, fTarget=target)
    crane.hold(20.0, bExecute=0.0, bStop=1.0).hold(CYCLE, bStop=0.0)
    for target, seconds in ((20.0, 40.0), (21.0, 9.6), (20.0, 9.6), (21.0, 9.6)):
        crane.hold(CYCLE, bExecute=0.0).hold(seconds, bExecute=1.0, fTarget=target)
        assert crane.parts[-1]["bDone"][-1]


def test_what_motions_leave_between_the_machines_watched_is_stated(text):
    """Where they take each other away on these: 2 % above the worst of them would be too little."""
    crane = Crane(text, 6.0, 1500.0).hold(0.1, bVelocity=1.0, fVelocityCommand=0.0)
    for speed, lasts, wait in ((1.024, 2.222, 69.885), (0.377, 4.168, 68.604), (0.671, 3.181, 12.0)):
        for command, seconds in ((speed, lasts), (-speed, lasts), (0.0, wait)):
            crane.hold(seconds, fVelocityCommand=command)
    out = crane.outputs
    at = rests(out)[-1]
    velocity = out["fVelocity"][:at]
    assert worst(velocity, 6.0, 1500.0) > 1.03 * worst(velocity, 6.0, 1500.0, watched=True)
    require_true(out, at, 6.0, 1500.0)


def test_pauses_are_counted_to_the_cycle(text):
    """Each motion from rest was booked a cycle early: what was stated was 0.78 to 1.08 times the truth."""
    crane, random, place = Crane(text, 3.8, 850.0), np.random.default_rng(4), 20.0
    for _ in range(12):
        place = np.clip(place + random.choice((-1.0, 1.0)) * random.uniform(1.0, 6.0), 1.0, HIGH - 1.0)
        crane.hold(CYCLE, bExecute=0.0).hold(12.0 + random.exponential(2.0), bExecute=1.0, fTarget=place)
    out = crane.outputs
    shares = [out["fSwayLeft"][at] / worst(out["fVelocity"][:at], 3.8, 850.0) for at in rests(out)]
    assert len(shares) == 11
    assert min(shares) >= 1.0
    assert np.median(shares) <= 1.0 + OVERSTATED


def test_a_hand_in_time_with_the_swing_breaks_no_promise(text):
    """Slopes of zero left 92 mm after 64 reversals, eight machines 62 mm after 512, with the promise held."""
    crane = Crane(text, 9.0, 2000.0).hold(0.1, bVelocity=1.0, fVelocityCommand=0.0)
    for number in range(512):
        crane.hold(3.125, fVelocityCommand=VELOCITY * (-1.0) ** number)
    out = crane.hold(40.0, fVelocityCommand=0.0).outputs
    require_true(out, len(out["bPromise"]) - 1, 9.0, 2000.0)


def test_a_report_that_the_load_hangs_still_begins_anew(text):
    crane = Crane(text, 3.0, 100.0).works(np.random.default_rng(1), 500.0, 3.0)
    crane.hold(60.0, bVelocity=0.0)
    assert crane.outputs["fSwayLeft"][-1] > 0.4 * LIMIT
    crane.hold(1.0, bLoadAtRest=1.0)
    begin = len(crane.outputs["bPromise"])
    assert crane.outputs["fSwayLeft"][-1] == 0.0
    out = crane.works(np.random.default_rng(2), 120.0, 3.0).outputs
    for at in rests(out)[-1:]:
        require_true({name: values[begin:] for name, values in out.items()}, at - begin, 3.0, 100.0)


def test_a_plan_that_leaves_too_much_is_not_made_longer_than_what_can_be_committed(text):
    """It was, slot by slot, and wrote beyond the end of an array."""
    crane = Crane(text, 4.0, 100.0, 2.0).hold(0.1, bVelocity=1.0, fVelocityCommand=0.0)
    for number in range(9):
        crane.hold(3.16, fVelocityCommand=VELOCITY * (-1.0) ** number)
    crane.hold(20.0, fVelocityCommand=0.0).hold(0.12, bVelocity=0.0).hold(0.5, bExecute=1.0, fTarget=2.0)
    while not crane.parts[-1]["bDone"][-1]:
        crane.hold(0.5)
    crane.hold(3.5, bExecute=0.0).hold(50.0, bExecute=1.0, fTarget=25.0)
    assert crane.outputs["bDone"][-1]


def test_a_little_damping_keeps_the_promise_for_hours():
    """What is left has decayed after a few minutes, so that a longer time adds nothing."""
    spec = preset_spec("bay-crane", [f"export.cycle_time={CYCLE}", *DAMPED])
    out = Crane(planner_block(spec).text, 6.0, 1500.0).works(np.random.default_rng(3), 5400.0, 30.0).outputs
    assert out["bPromise"][200:].all()
    ends = rests(out)
    assert len(ends) > 75
    for at in ends[:: -(len(ends) // 4)]:
        kept = slice(max(0, at - round(2400.0 / CYCLE)), None)  # what is older has decayed
        recent = {name: values[kept] for name, values in out.items()}
        require_true(recent, at - kept.start, 6.0, 1500.0, 0.005 * modes(6.0, 1500.0)[0][0])


def test_moves_in_a_row_stay_quick_and_promised(text):
    """Plans that made up for what those before had left took longer than ones that add nothing, by 8 %."""
    quiet = planner_block(
        preset_spec("bay-crane", [f"export.cycle_time={CYCLE}", "planner.sway_share=0.0"])
    ).text
    total = {}
    for name, block in {"quick": text, "quiet": quiet}.items():
        random, crane, place, cycles = np.random.default_rng(3), Crane(block, 6.0, 2000.0), 20.0, 0
        for _ in range(60):
            place = np.clip(place + random.choice((-1.0, 1.0)) * random.uniform(0.3, 3.0), 1.0, HIGH - 1.0)
            crane.hold(CYCLE, bExecute=0.0).hold(CYCLE, bExecute=1.0, fTarget=place)
            while not crane.parts[-1]["bDone"][-1]:
                crane.hold(5 * CYCLE)
                cycles += 5
            crane.hold(random.uniform(1.0, 10.0))
        total[name] = cycles * CYCLE
        assert crane.outputs["bPromise"][200 : round(540.0 / CYCLE)].all()
    assert total["quick"] <= 1.04 * total["quiet"]
