"""The planner of the folder of blocks under random targets and stops: limits, ends, and what errors leave."""

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting, require_interpreted
from played_planner import played_text

from gen_profile.planner.design import planner_constants
from gen_profile.planner.machine import frequencies, left_by_errors, live_modes
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.sizes import operations

PAPER = (
    "limits={velocity=0.3, acceleration=0.7, jerk=20.0, travel=[0.0, 2.0]}",
    "planner.live={L1=[0.3, 0.6]}",
    "check.residual_sway=0.01",
)
SLOW = ("limits={velocity=2.0, acceleration=0.2, jerk=0.5, travel=[0.0, 80.0]}",)
MACHINES = {"bay": ("bay-crane", ()), "paper": ("paper", PAPER), "slow drive": ("bay-crane", SLOW)}
ROUNDING = 1.0 + 1e-9


@pytest.fixture(scope="module", params=MACHINES)
def spec(request):
    preset, changes = MACHINES[request.param]
    return preset_spec(preset, list(changes))


@pytest.fixture(scope="module")
def compiled(spec):
    return compile_counting(played_text(spec))


class History:
    """A planner at random live parameters that is given commands, and all that it issued."""

    def __init__(self, spec, compiled, random):
        self.spec, self.issued, self.limits = spec, [], spec.limits.of(0)
        live = {name: random.uniform(*ends) for name, ends in spec.planner.live.items()}
        self.point = [
            (2.0 * live[n] - sum(ends)) / (ends[1] - ends[0]) for n, ends in spec.planner.live.items()
        ]
        inputs = {f"f{name}": value for name, value in live.items()}
        self.place = random.uniform(*self.limits.travel)
        self.block = CountedBlock(compiled, fActPosition=self.place, **inputs)
        self.cycle = spec.export.cycle_time
        self.hold(0.5)

    def hold(self, seconds, **inputs):
        self.issued.append(self.block.hold(max(2, round(seconds / self.cycle)), **inputs))
        return self.issued[-1]

    def all(self, name):
        return np.concatenate([part[name] for part in self.issued])

    def left(self):
        """Sway in m, modes added: of the machine as given, the worse one at the errors' ends, the worst."""
        modes = live_modes(self.spec)
        rates = np.sort(frequencies(modes.interpolant(self.point)[: modes.modes]))
        errors, gains = np.split(left_by_errors(self.spec, self.point), [modes.modes])
        velocity = self.all("fVelocity")
        times = self.cycle * np.arange(len(velocity))
        sways = {
            share: gains
            @ np.abs(self.cycle * np.exp(1j * np.outer(rates * (1.0 + share * errors), times)) @ velocity)
            for share in (0.0, -1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)
        }
        return sways[0.0], max(sways[-1.0], sways[1.0]), max(sways.values())

    def keeps(self):
        """Limits and travel are kept, all outputs are of one motion, and each cycle is short."""
        limits, x, v, a = self.limits, *(self.all(n) for n in ("fPosition", "fVelocity", "fAcceleration"))
        jerk = np.diff(a) / self.cycle
        assert np.abs(v).max() <= limits.velocity * ROUNDING
        assert np.abs(a).max() <= limits.acceleration * ROUNDING
        assert np.abs(jerk).max() <= limits.jerk * (1.0 + 1e-6)
        assert limits.travel[0] - 1e-7 <= x.min() and x.max() <= limits.travel[1] + 1e-7
        assert np.allclose(
            np.diff(x), self.cycle * (v[1:] + v[:-1]) / 2, rtol=0, atol=limits.jerk * self.cycle**3
        )
        assert np.allclose(
            np.diff(v), self.cycle * (a[1:] + a[:-1]) / 2, rtol=0, atol=1e-9 + limits.jerk * self.cycle**2 / 8
        )
        spent = self.all("nSpent")
        assert np.all(self.all("operations") <= spent)
        assert spent.max() <= operations(planner_constants(self.spec)[1])


def random_commands(history, random, count):
    """Give commands at random moments; the last one, a target or none where it is a stop or a speed."""
    period = 2.0 * np.pi / 1.8
    low, high = history.limits.travel
    for _ in range(count):
        while_ = random.uniform(0.05, 3.0) * period
        kind = random.random()
        if kind < 0.2:
            target = None
            history.hold(while_, bStop=1.0, bVelocity=0.0)
            history.hold(2 * history.cycle, bStop=0.0)
        elif kind < 0.5:
            target = None
            speed = float(history.limits.velocity * random.choice([-1.0, 1.0, random.uniform(-1.0, 1.0)]))
            history.hold(while_, bVelocity=1.0, fVelocityCommand=speed)
        else:
            target = float(random.choice([low, high, random.uniform(low, high), random.uniform(low, high)]))
            history.hold(while_, bExecute=1.0, fTarget=target, bVelocity=0.0)
    return target


@pytest.mark.parametrize("seed", range(4))
def test_random_commands_are_obeyed_within_limits_and_promise(spec, compiled, seed):
    random = np.random.default_rng([71, seed])
    history = History(spec, compiled, random)
    target = random_commands(history, random, 8)
    last = history.hold(40.0, bStop=1.0, bVelocity=0.0) if target is None else history.hold(100.0)
    assert last["fVelocity"][-1] == 0.0 and last["bMoving"][-1] == 0.0
    if target is not None:
        assert last["fPosition"][-1] == pytest.approx(target, abs=1e-9)
    history.keeps()
    nominal, ends, worst = history.left()
    limit = min(spec.check.residual_sway.values())
    assert nominal <= 0.02 * spec.planner.sway_share * limit  # which the sums of sampled velocities add
    assert ends <= 0.82 * limit  # that stops may leave
    assert worst <= limit  # the machines between the ends are not watched yet


def test_a_stop_ends_sooner_than_the_committed_motion_and_a_target_that_is_reached_stays(spec, compiled):
    random = np.random.default_rng(3)
    history = History(spec, compiled, random)
    low, high = history.limits.travel
    target = low + 0.2 * (high - low) if history.place > (low + high) / 2 else high - 0.2 * (high - low)
    history.hold(2.0, bExecute=1.0, fTarget=target)
    state = history.hold(history.cycle * 2)
    ahead = state["nAhead"][-1]
    stop = history.hold(60.0, bStop=1.0)
    assert np.flatnonzero(stop["fVelocity"])[-1] > 0
    assert stop["nAhead"].max() <= ahead
    assert abs(stop["fPosition"][-1] - target) > 0.05 * (high - low)
    history.hold(100.0, bExecute=1.0, fTarget=target, bStop=0.0)
    stays = history.hold(10.0, bExecute=1.0, fTarget=target)
    assert np.all(np.abs(stays["fPosition"] - target) < 1e-9)
    assert stays["bLeads"][-1] == 1.0


def test_a_speed_is_kept_until_the_stick_is_let_go_and_a_far_target_is_corrected_at_speed(spec, compiled):
    """The speed stays as it is while the swing behind the ramp turns against the decline."""
    random = np.random.default_rng(9)
    history = History(spec, compiled, random)
    low, high = history.limits.travel
    target = low + 0.05 * (high - low) if history.place > (low + high) / 2 else high - 0.05 * (high - low)
    away = np.sign(target - history.place)
    history.hold(100.0, bExecute=1.0, fTarget=(low if away > 0 else high))
    speed = 0.5 * away * history.limits.velocity
    kept = history.hold(0.35 * (high - low) / abs(speed), bVelocity=1.0, fVelocityCommand=speed)
    has = np.argmax(kept["bSteady"] > 0)
    assert has > 0
    assert np.allclose(kept["fVelocity"][has:], speed, rtol=0, atol=0.0026 * history.limits.velocity)
    stop = history.hold(60.0, bVelocity=0.0, bStop=1.0)
    assert abs(stop["fVelocity"][-1]) == 0.0
    end = history.place = stop["fPosition"][-1]
    whole = history.hold(
        history.cycle + 0.4 * abs(target - end) / history.limits.velocity,
        bStop=0.0,
        bExecute=1.0,
        fTarget=target,
    )
    slowest = np.abs(whole["fVelocity"][-1])
    corrected = history.hold(100.0, bExecute=1.0, fTarget=target - 0.02 * away * (high - low))
    near = np.abs(corrected["fPosition"] - (target - 0.02 * away * (high - low)))
    far_off = near > 0.25 * abs(target - end)
    assert np.abs(corrected["fVelocity"][far_off]).min() > 0.5 * slowest
    assert near[-1] < 1e-9
    history.keeps()


@pytest.fixture(scope="module")
def bay():
    spec = preset_spec("bay-crane", [])
    return spec, compile_counting(played_text(spec))


@pytest.mark.parametrize(
    ("kind", "asked"),
    [
        ("target", lambda t, k: 5.0 + 0.001 * (-1) ** k),
        ("target", lambda t, k: 0.2 * t),
        ("stick", lambda t, k: min(1.0, 0.5 * t) * (1.0 + 0.05 * (-1) ** k)),
    ],
    ids=["trembling target", "creeping target", "trembling stick"],
)
def test_a_command_that_changes_every_three_cycles_is_followed(bay, kind, asked):
    spec, compiled = bay
    history = History(spec, compiled, np.random.default_rng(3))
    begin, away = history.place, 1.0 if history.place < 20.0 else -1.0
    span = 3 * history.cycle
    for k in range(1000):
        goal = away * asked(k * span, k)
        if kind == "target":
            history.hold(span, bExecute=1.0, fTarget=begin + goal)
        else:
            history.hold(span, bVelocity=1.0, fVelocityCommand=goal)
    way = np.abs(history.all("fPosition") - begin)
    assert way[int(2.0 / history.cycle)] > 0.001
    if kind == "target":
        assert way[-1] > 0.7 * abs(goal)
        assert history.hold(60.0)["fPosition"][-1] == pytest.approx(begin + goal, abs=1e-9)
    else:
        assert abs(history.all("fVelocity")[-1]) > 0.9 * abs(goal)
    history.keeps()


@pytest.mark.parametrize("seed", range(6))
def test_a_prompt_stop_is_never_faster_than_the_axis_was_and_says_what_is_left(bay, seed):
    spec, compiled = bay
    random = np.random.default_rng([5, seed])
    history = History(spec, compiled, random)
    away = 2.0 if history.place > 20.0 else 38.0
    moving = history.hold(random.uniform(1.0, 14.0), bExecute=1.0, fTarget=away)
    speed, limits = abs(moving["fVelocity"][-1]), history.limits
    led_to = speed + abs(moving["fAcceleration"][-1]) * spec.planner.live["L1"][1] ** 0.5 / 5.0  # in a slot
    stop = history.hold(40.0, bStop=1.0, bPrompt=1.0)
    assert np.abs(stop["fVelocity"]).max() <= min(limits.velocity * ROUNDING, led_to + 0.01)
    assert stop["fVelocity"][-1] == 0.0
    history.keeps()
    _, ends, _ = history.left()
    assert stop["fSwayLeft"][-1] == pytest.approx(ends, rel=0.1, abs=0.002)
    assert stop["bPromise"][-1] == (stop["fSwayLeft"][-1] <= min(spec.check.residual_sway.values()))


@pytest.mark.parametrize("seed", range(6))
def test_a_prompt_stop_shortly_before_the_end_of_travel_stays_in_travel_and_ends(bay, seed):
    spec, compiled = bay
    before = np.random.default_rng([6, seed]).uniform(0.1, 3.0)  # s
    arrival = None
    for _ in range(2):
        history = History(spec, compiled, np.random.default_rng([6, seed]))
        end = 0.0 if history.place < 20.0 else 40.0
        moves = history.hold(90.0 if arrival is None else arrival - before, bExecute=1.0, fTarget=end)
        arrival = np.flatnonzero(moves["fVelocity"])[-1] * history.cycle
    toward, stated = np.sign(end - 20.0), (moves["fStopLow"][-1], moves["fStopHigh"][-1])
    stop = history.hold(40.0, bStop=1.0, bPrompt=1.0)
    assert not stop["fVelocity"][int((before + 0.5) / history.cycle) :].any()  # as soon as what was committed
    reached = (toward * stop["fPosition"]).max()
    assert reached <= max(toward * place for place in stated) + 1e-9
    history.keeps()


def test_after_a_prompt_stop_that_leaves_too_much_a_far_target_begins_and_leaves_no_more(bay):
    spec, compiled = bay
    random = np.random.default_rng([8, 8])
    history = History(spec, compiled, random)
    seconds, speed = random.uniform(1.0, 12.0), random.uniform(0.2, 1.0)
    speed *= 1.0 if history.place < 20.0 else -1.0
    history.hold(seconds, bVelocity=1.0, fVelocityCommand=speed)
    stop = history.hold(20.0, bVelocity=0.0, bStop=1.0, bPrompt=1.0)
    assert not stop["bPromise"][-1]
    far = 38.0 if stop["fPosition"][-1] < 20.0 else 2.0
    moves = history.hold(60.0, bStop=0.0, bPrompt=0.0, bExecute=1.0, fTarget=far)
    assert moves["fVelocity"][int(1.0 / history.cycle)] != 0.0
    assert moves["fPosition"][-1] == pytest.approx(far, abs=1e-9)
    assert moves["fSwayLeft"][-1] < 1.05 * stop["fSwayLeft"][-1]
    history.keeps()


@pytest.mark.parametrize("seed", [0, 1])
def test_an_axis_is_not_kept_standing_by_what_a_prompt_stop_left(bay, seed):
    """A stick that was thrown over, and a stop: a third of a metre swings on, also as given."""
    spec, compiled = bay
    random = np.random.default_rng([9, seed])
    history = History(spec, compiled, random)
    speed = (1.0 if history.place < 20.0 else -1.0) * random.uniform(0.2, 1.0)
    history.hold(random.uniform(2.0, 8.0), bVelocity=1.0, fVelocityCommand=speed)
    history.hold(random.uniform(0.2, 3.0), bVelocity=1.0, fVelocityCommand=-speed)
    stop = history.hold(20.0, bVelocity=0.0, bStop=1.0, bPrompt=1.0)
    assert stop["fSwayLeft"][-1] > 0.2 and not stop["bPromise"][-1]
    moves = history.hold(15.0, bStop=0.0, bPrompt=0.0, bVelocity=1.0, fVelocityCommand=speed)
    assert abs(moves["fVelocity"][-1]) > 0.9 * abs(speed)
    stop = history.hold(30.0, bVelocity=0.0, bStop=1.0)
    assert stop["fVelocity"][-1] == 0.0
    history.keeps()


def test_no_speed_is_above_a_limit_however_little_that_falls(bay):
    """Neither the ramp to it, nor one that is kept, nor the stop behind it."""
    spec, compiled = bay
    for seed in range(3):
        history = History(spec, compiled, np.random.default_rng([17, seed]))
        side, most = (1.0 if history.place < 20.0 else -1.0), history.limits.velocity
        ramp = history.hold(10.0, bVelocity=1.0, fVelocityCommand=side * most, rOverride=0.3)
        assert np.abs(ramp["fVelocity"]).max() <= 0.3 * most * ROUNDING
        for override in (0.298, 0.27):
            kept = history.hold(10.0, bVelocity=1.0, fVelocityCommand=side * most, rOverride=override)
            assert np.abs(kept["fVelocity"][-1250:]).max() <= override * most * ROUNDING
            assert kept["fVelocity"][-1] == pytest.approx(side * override * most)
        stop = history.hold(30.0, bVelocity=0.0, bStop=1.0)
        assert np.abs(stop["fVelocity"]).max() <= 0.27 * most * ROUNDING
        history.keeps()


def test_the_slowest_speed_of_a_stick_moves_the_axis(bay):
    spec, compiled = bay
    for share in (2e-3, 1e-4):
        history = History(spec, compiled, np.random.default_rng(29))
        speed = share * history.limits.velocity
        moved = history.hold(20.0, bVelocity=1.0, fVelocityCommand=speed)
        assert moved["fVelocity"][-1] == pytest.approx(speed)
        history.keeps()


def test_a_lower_limit_is_come_to_on_the_way_and_a_place_that_is_closed_too_late_is_said(bay):
    spec, compiled = bay
    history = History(spec, compiled, np.random.default_rng(100))
    away = 2.0 if history.place > 20.0 else 38.0
    history.hold(6.0, bExecute=1.0, fTarget=away)
    history.block.inputs["rOverride"] = 0.4
    history.issued.append(history.block.play_on(round(60.0 / history.cycle)))
    slow = np.abs(history.issued[-1]["fVelocity"][round(10.0 / history.cycle) :])
    assert slow.max() <= 0.4 * history.limits.velocity * 1.001
    assert history.issued[-1]["fPosition"][-1] == pytest.approx(away, abs=1e-9)
    history.keeps()
    for room, is_void in ((6.0, False), (1.0, True)):
        history = History(spec, compiled, np.random.default_rng(3))
        sign = 1.0 if history.place < 20.0 else -1.0
        moving = history.hold(5.0, bExecute=1.0, fTarget=20.0 + 18.0 * sign)
        end = moving["fPosition"][-1] + room * sign
        stop = history.hold(20.0, bStop=1.0, **{"fHighest" if sign > 0 else "fLowest": end})
        assert stop["bVoid"].any() == is_void
        assert is_void or (stop["fPosition"][-1] - end) * sign <= 0.0


@pytest.mark.parametrize(
    ("rope", "load", "seconds", "room"),
    [(7.5, 1578.0, 1.5, 0.3), (6.5, 1578.0, 1.5, 0.4), (5.0, 1000.0, 1.0, 0.4), (8.0, 500.0, 1.0, 0.6)],
)
def test_a_stop_before_a_place_that_is_closed_may_take_longer_than_the_motion(bay, rope, load, seconds, room):
    """There is none in fewer slots than were committed; in more the load is calmed as the axis comes back."""
    cycle = bay[0].export.cycle_time
    block = CountedBlock(bay[1], fActPosition=20.0, fL1=rope, fm2=load)
    block.hold(200)
    end = block.hold(round(seconds / cycle), bExecute=1.0, fTarget=22.2)["fPosition"][-1] + room
    stop = block.hold(round(16.0 / cycle), bStop=1.0, fHighest=end)
    assert not stop["bVoid"].any() and stop["bPromise"].all()
    assert stop["fPosition"].max() <= end + 1e-9
    assert stop["fVelocity"][-1] == 0.0


@pytest.mark.slow
def test_the_interpreter_issues_the_same_bits():
    spec = preset_spec("paper", list(PAPER))
    block = CountedBlock(compile_counting(played_text(spec)), fActPosition=0.5)
    require_interpreted(
        played_text(spec), block, [(3, {}), (400, {"bExecute": 1.0, "fTarget": 0.9}), (300, {"bStop": 1.0})]
    )
