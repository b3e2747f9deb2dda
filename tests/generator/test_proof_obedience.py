"""Judging whether a block obeys: synthetic motions, each fault by itself, and blocks that disobey."""

import attrs
import numpy as np
import pytest

from gen_profile.assurance.proof.followed import Followed, Zone, runs_of
from gen_profile.assurance.proof.left_swinging import GivenModes
from gen_profile.assurance.proof.obedience import WORDS, faults, measured
from gen_profile.assurance.proof.orders import (
    DISABLED,
    POSITION,
    QUICK_STOP,
    STOP,
    VELOCITY,
    Ends,
    ReceivedOrders,
    TimedOrder,
)
from gen_profile.assurance.proof.statements import OVERSTATED
from gen_profile.assurance.proof.stopping import far, stops
from gen_profile.assurance.proof.verdict import kind_of
from gen_profile.methods.quickest.modes import SwayModes
from gen_profile.planner.interface import BlockAxis

CYCLE, CYCLES = 0.01, 6000
TARGET, TOLD, STICK, STOPPED = 5.0, 100, 2500, 4000  # m; cycles in which commands come
LIMITS = Ends(velocity=1.0, acceleration=0.5, jerk=5.0, targets=(-100.0, 100.0), quick=(1.0, 10.0))


def order(begin, end, kind, *values, top=1.0):
    return TimedOrder(begin=begin, end=end, kind=kind, values=values, tops=(top,), edge=begin)


def as_told(*orders):
    """Orders that replace each other without a word, and no errors."""
    holds, error = np.zeros(CYCLES, dtype=bool), np.zeros(CYCLES, dtype=int)
    for one in orders:
        holds[one.begin : one.end] = one.kind in (POSITION, VELOCITY)
    return ReceivedOrders(orders=orders, aborted=np.zeros(CYCLES, dtype=bool), error=error, holds=holds)


def obedient():
    """A move of 5 m, a stick of 0.8 m/s and a stop, by ramps that meet their commands exactly."""
    time = CYCLE * np.arange(CYCLES)
    corners = [(0, 0), (1.2, 0), (3.2, 1), (6.2, 1), (8.2, 0), (25.2, 0), (27.2, 0.8), (40.2, 0.8), (42.2, 0)]
    velocity = np.interp(time, *np.transpose(corners))
    velocity[820:2521] = velocity[4220:] = 0.0
    acceleration = np.gradient(velocity, CYCLE) * (velocity != 0.0)
    position = np.concatenate([[0.0], np.cumsum(0.5 * CYCLE * (velocity[1:] + velocity[:-1]))])
    position[820:2521] = TARGET  # but for rounding
    stands = (velocity == 0.0) & (acceleration == 0.0)
    cycle = np.arange(CYCLES)
    goes, sticks = (cycle >= TOLD) & (cycle < STICK), (cycle >= STICK) & (cycle < STOPPED)
    there = goes & stands & (cycle > 800)
    ends = np.maximum(position[-1] - position, 0.0) * (cycle >= STICK)
    left = np.where(cycle < 820, (820 - cycle) * CYCLE, np.maximum(4220 - cycle, 0) * CYCLE)
    issued = {
        "fPosition": position,
        "fVelocity": velocity,
        "fAcceleration": acceleration,
        "bBusy": 1.0 * (~stands | (goes & ~there) | sticks),
        "bDone": 1.0 * there,
        "bInVelocity": 1.0 * (sticks & (np.abs(velocity - 0.8) < 1e-9)),
        **{name: np.zeros(CYCLES) for name in ("bCommandAborted", "bError", "nErrorId", "nPromise")},
        **{name: np.ones(CYCLES) for name in ("bEnabled", "bPromise")},
        "fDistanceToGo": np.where(goes, TARGET - position, 0.0),
        "fTimeToGo": left * ~stands,
        "fStopDistance": ends,
        "fStopLow": position.copy(),
        "fStopHigh": position + ends,
    }
    return Followed(
        cycle=CYCLE,
        periods=(2.0,),
        reaction=1.5,
        axes=[BlockAxis(name="")],
        limits=[LIMITS],
        received=as_told(
            order(0, TOLD, STOP),
            order(TOLD, STICK, POSITION, TARGET),
            order(STICK, STOPPED, VELOCITY, 0.8),
            order(STOPPED, CYCLES, STOP),
        ),
        issued=issued,
        steps=np.zeros((1, CYCLES)),
        speeds=np.zeros((1, CYCLES)),
    )


REACTIONS = {TOLD: 20, STICK: 20, STOPPED: 20}


def kinds(followed, reactions=REACTIONS):
    return {kind_of(fault) for fault in faults(measured(followed, reactions), CYCLE)}


def with_output(name, within, value):
    followed = obedient()
    for one in [name] if isinstance(name, str) else name:
        followed.issued.setdefault(one, np.zeros(CYCLES))[within] = value
    return followed


def with_orders(*given, moved=0.0, **changes):
    followed = attrs.evolve(obedient(), received=as_told(*given), **changes)
    followed.issued["fPosition"][510:] += moved
    return followed


def with_told(name, within, value):
    followed = obedient()
    getattr(followed.received, name)[within] = value
    return followed


def with_zone(**changes):
    zone = {"axis": 0, "low": 2.0, "high": 4.0, "limit": 0.0, "begin": 0, "end": CYCLES, "number": 1}
    followed = attrs.evolve(obedient(), zones=[Zone(**zone | changes)])
    followed.issued["nZone"] = np.ones(CYCLES)
    followed.issued["nErrorId"][300] = 8.0 * (zone | changes)["number"] - 8.0
    return followed


def disabled(**changes):
    """Not guided while it stands at its target."""
    rest, move, *others = obedient().orders
    off = order(1000, 1100, DISABLED)
    orders = (rest, attrs.evolve(move, end=1000), off, order(1100, STICK, STOP), *others)
    followed = attrs.evolve(obedient(), received=as_told(*orders), **changes)
    for name, value in (("bEnabled", 0.0), ("bPromise", 0.0), ("nPromise", 4.0)):
        followed.issued[name][1000:1100] = value
    followed.issued["bDone"][1000:STICK] = 0.0
    followed.issued["fDistanceToGo"][1000:STICK] = 0.0
    return followed


def idle(error=0.0):
    """Standing though a stick is deflected, until it moves or reports an error."""
    followed = with_orders(REST, attrs.evolve(MOVE, end=2000), attrs.evolve(STICKS, begin=2000), STOPS)
    followed.issued["nErrorId"][2521] = error
    return followed


def test_a_block_that_obeys_has_no_fault():
    assert kinds(obedient()) == set()
    twice = with_orders(REST, attrs.evolve(MOVE, end=821), attrs.evolve(MOVE, begin=821), STICKS, STOPS)
    twice.issued["fTimeToGo"][820] = 9.0  # another motion begins in the cycle in which one ends
    assert not kinds(twice)


REST, MOVE, STICKS, STOPS = obedient().orders
MODES = GivenModes(
    modes=SwayModes(poles=1j * np.array([[2.0], [2.1], [1.9]]), gains=np.full((3, 1, 1, 1), 0.5)),
    ends=(1, 2),
    near=1,
)
FAULTS = {
    POSITION: with_orders(
        REST, attrs.evolve(MOVE, values=(5.1,)), STICKS, STOPS, periods=(0.1,), reaction=0.1
    ),
    VELOCITY: with_orders(REST, MOVE, attrs.evolve(STICKS, values=(0.9,)), STOPS),
    STOP: with_orders(
        REST, attrs.evolve(MOVE, end=150), order(150, CYCLES, STOP), periods=(0.1,), reaction=0.1
    ),
    "left": with_output("fPosition", slice(1500, 1600), 5.01),
    "against": with_orders(REST, attrs.evolve(MOVE, values=(-5.0,)), STICKS, STOPS),
    "idle": idle(),
    "given up": idle(error=9.0),
    "ends": attrs.evolve(
        with_output("fStopHigh", STOPPED, obedient().issued["fPosition"][-1] - 0.01), sway_limit=0.05
    ),
    "loose": with_output("fStopHigh", STOPPED, 100.0),
    "far": with_orders(
        REST, attrs.evolve(MOVE, end=350), order(350, CYCLES, STOP), periods=(0.1,), reaction=0.1
    ),
    "hurries": with_orders(
        REST,
        attrs.evolve(MOVE, end=150),
        order(150, CYCLES, STOP),
        reaction=0.1,
        prompt=np.ones(CYCLES, dtype=bool),
    ),
    "outside": attrs.evolve(obedient(), limits=[attrs.evolve(LIMITS, targets=(-100.0, 4.9))]),
    "fast": with_orders(
        REST,
        attrs.evolve(MOVE, end=150),
        attrs.evolve(MOVE, begin=150, tops=(0.3,)),
        STICKS,
        STOPS,
        reaction=0.2,
    ),
    "done": with_output("bDone", slice(780, 800), 1.0),
    "not done": with_output("bDone", slice(0, None), 0.0),
    "busy": with_output("bBusy", 500, 0.0),
    "not busy": with_output("bBusy", slice(4000, None), 1.0),
    "vanished": with_output("bBusy", 110, 0.0),
    "in velocity": with_output("bInVelocity", 2600, 1.0),
    "not in velocity": with_output("bInVelocity", 3500, 0.0),
    "aborted": with_output("bCommandAborted", 300, 1.0),
    "error": with_output("bError", 300, 1.0),
    "wrong error": with_output(("bError", "nErrorId"), slice(300, 400), 1.0),
    "blocked": with_zone(),
    "zone": with_zone(low=-2.0, high=-1.0, number=2),
    "taken over": disabled(steps=np.full((1, CYCLES), 0.1)),
    QUICK_STOP: with_orders(REST, attrs.evolve(MOVE, end=500), order(500, CYCLES, QUICK_STOP)),
    "jump": with_orders(REST, attrs.evolve(MOVE, end=500), order(500, CYCLES, QUICK_STOP), moved=0.001),
    "no way": with_zone(),
    "disabled": with_output("bEnabled", 300, 0.0),
    "distance": with_output("fDistanceToGo", 300, 1.0),
    "time": with_output("fTimeToGo", slice(720, 820), 3.0),
    "stop distance": with_output("fStopDistance", 300, 1.0),
    "back": with_output("fVelocity", slice(300, 310), -0.2),
    "beyond": with_orders(REST, MOVE, attrs.evolve(STICKS, values=(0.7,)), STOPS),
    "unasked": with_orders(REST, attrs.evolve(MOVE, values=(0.0,)), STICKS, STOPS),
    "swings": attrs.evolve(obedient(), modes=MODES, sway_limit=0.05),
    "understated": attrs.evolve(with_output("fSwayLeft", 0, 0.0), modes=MODES, sway_limit=0.05),
    "event": with_output("nEvents", 0, 0.0),
    "promise": with_output("bPromise", 300, 0.0),
    "lost": with_output("nPromise", slice(2000, 3000), 1.0),
    "kept": with_orders(REST, attrs.evolve(MOVE, end=300), order(300, CYCLES, QUICK_STOP)),
}


@pytest.mark.parametrize("what", FAULTS)
def test_every_fault_is_found(what):
    assert kind_of(WORDS[what]) in kinds(FAULTS[what])


def test_a_block_that_states_a_shorter_reaction_is_not_held_to_shorter_stops():
    """Ways of stops, and how wide their stated ends may be, are measured by the machine's own time."""
    limits = [
        [(one.what, one.needed, one.allowed) for judge in (stops, far) for one in judge(run)]
        for run in (obedient(), attrs.evolve(obedient(), reaction=0.1))
    ]
    assert limits[0] == limits[1]
    assert {"far", "loose"} <= {what for what, *_ in limits[0]}


@pytest.mark.parametrize(("faster", "found"), [(0.0, False), (0.03, False), (0.3, True)])
def test_a_prompt_stop_is_no_faster_from_when_it_is_obeyed_on(faster, found):
    """A ramp goes on for one and a half slots at most, and corrections may add a little."""
    stopping = with_orders(
        REST,
        attrs.evolve(MOVE, end=250),
        order(250, CYCLES, STOP),
        prompt=np.ones(CYCLES, dtype=bool),
    )
    velocity = stopping.issued["fVelocity"]
    velocity[820:] = 0.0
    velocity[280:] = np.minimum(velocity[280:], velocity[279] + faster)
    stopping.issued["fAcceleration"] = np.gradient(velocity, CYCLE)
    assert (kind_of(WORDS["hurries"]) in kinds(stopping, {TOLD: 20, 250: 30})) == found
    assert kind_of(WORDS["hurries"]) not in kinds(stopping, {TOLD: 20, 250: CYCLES})  # it ended before


def test_busy_tells_of_a_stick_that_is_about_to_be_followed():
    """A slow machine's axis, planned for longer than a fifth of a period, was said to have come to rest."""
    slow = with_orders(REST, attrs.evolve(MOVE, end=2000), attrs.evolve(STICKS, begin=2000), STOPS)
    slow.issued["bDone"][2000:] = slow.issued["fDistanceToGo"][2000:] = 0.0
    slow.issued["bBusy"][2000:STICK] = 1.0
    waits = {kind_of(WORDS[what]) for what in ("idle", "reaction", VELOCITY)}
    assert kinds(slow) <= waits
    slow.issued["bBusy"][2100] = 0.0
    assert kind_of(WORDS["vanished"]) in kinds(slow)
    at_the_end = attrs.evolve(slow, limits=[attrs.evolve(LIMITS, targets=(-100.0, TARGET))])
    at_the_end.issued["bBusy"][2000:STICK] = 0.0
    assert kind_of(WORDS["vanished"]) not in kinds(at_the_end)


def test_what_is_planned_for_another_rope_is_not_held_against_that_of_the_beginning():
    assert kinds(attrs.evolve(FAULTS["swings"], retold=np.ones(CYCLES, dtype=bool))) == set()
    last = attrs.evolve(obedient(), last_modes=MODES, last_known=50, sway_limit=0.05)
    assert kinds(last) == {kind_of(WORDS["swings"])}


@pytest.mark.parametrize(("left", "found"), [(0.02, True), (0.03, False)])
def test_a_stop_that_errors_left_half_of_the_sway_for_may_use_it(left, found):
    """Axes went on to their target, as no stop without any sway was to be found."""
    for stop in (order(700, CYCLES, STOP), order(700, CYCLES, VELOCITY, 0.0)):
        stopping = attrs.evolve(FAULTS["swings"], received=as_told(REST, attrs.evolve(MOVE, end=700), stop))
        stopping.issued["fSwayLeft"] = np.full(CYCLES, left)
        assert (kind_of(WORDS["swings"]) in kinds(stopping)) == found


@pytest.mark.parametrize(("room", "found"), [(40.0, True), (0.5, False)])
def test_a_stop_just_before_the_end_of_the_travel_may_leave_the_load_swinging(room, found):
    """In half a metre no motion from 1 m/s leaves nothing."""
    orders = (REST, attrs.evolve(MOVE, end=700), order(700, CYCLES, STOP))
    stopping = attrs.evolve(FAULTS["swings"], received=as_told(*orders))
    stopping.issued["fSwayLeft"] = np.full(CYCLES, 0.02)
    end = float(stopping.position[0, 699]) + room
    stopping = attrs.evolve(stopping, limits=[attrs.evolve(LIMITS, targets=(-100.0, end))])
    assert (kind_of(WORDS["swings"]) in kinds(stopping)) == found


def test_the_time_to_go_may_change_as_a_stop_is_to_be_another_one():
    """A quiet stop took the place of a prompt one 4 s before the end, and was 2 s quicker."""
    moving = with_orders(REST, attrs.evolve(MOVE, end=700), order(700, CYCLES, STOP))
    rests = int(np.flatnonzero(~moving.stands[700:])[-1]) + 701
    moving.issued["fTimeToGo"][700 : rests - 100] += 3.0
    wrong_time = kind_of(WORDS["time"])
    assert wrong_time in kinds(moving)
    prompt = np.arange(CYCLES) < rests - 100
    assert wrong_time not in kinds(attrs.evolve(moving, prompt=prompt))


def test_a_block_that_is_disabled_and_taken_over_has_no_fault():
    assert kinds(disabled()) == set()


def test_intervals_are_kept():
    assert kind_of(WORDS["blocked"]) in kinds(with_zone(begin=300))  # to which no stop led
    assert kind_of(WORDS["fast"]) in kinds(with_zone(limit=0.5))
    assert kinds(with_zone(limit=1.0)) == set()
    assert kinds(with_zone(limit=0.5, low=5.5, high=5.6, begin=800, end=2000)) == set()


def test_what_is_not_told_is_a_fault():
    assert kind_of(WORDS["aborted"]) in kinds(with_told("aborted", 300, True))
    assert kind_of(WORDS["wrong error"]) in kinds(with_told("error", slice(300, 400), 3))


def test_a_target_is_left_to_damp_what_was_measured_and_reached_again():
    left, is_left = with_output("fPosition", slice(1500, 1600), TARGET + 0.01), kind_of(WORDS["left"])
    left.issued["bDamping"] = np.zeros(CYCLES)
    assert is_left in kinds(left)
    left.issued["bDamping"][1500:1590] = 1.0
    assert not kinds(left) & {is_left, kind_of(WORDS[POSITION])}
    left.issued["fPosition"][1500:STICK] = TARGET + 0.01
    assert kind_of(WORDS[POSITION]) in kinds(attrs.evolve(left, reaction=0.01, periods=(0.01,)))


def test_every_kind_of_fault_is_tried():
    assert {*FAULTS, "reaction"} == set(WORDS)


def test_a_command_that_changes_nothing_for_too_long_is_obeyed_late():
    late = kind_of(WORDS["reaction"])
    early = with_orders(REST, attrs.evolve(MOVE, end=120), order(120, CYCLES, STOP), reaction=0.5)
    assert late not in kinds(early, {120: 49})
    assert late in kinds(early, {120: 52})
    assert kinds(obedient(), {TOLD: 152, STOPPED: 152}) == set()  # the way was the right one
    assert kinds(attrs.evolve(obedient(), reaction=1.505), {TOLD: 151}) == set()  # between two cycles
    assert kinds(obedient(), {STOPPED: None}) == set()  # what came before ended anyway, and in time


def test_faults_tell_when_and_by_how_much():
    (fault,) = faults(measured(FAULTS["distance"], REACTIONS), CYCLE)
    assert fault == "fDistanceToGo is wrong by 3.19 m, at 3.00 s"


def test_what_errors_leave_may_be_overstated_and_by_how_much_is_measured():
    """A sound block was refused by 0.05 mm, and then the limit was raised to what it stated."""
    loose = attrs.evolve(with_output("fSwayLeft", slice(0, None), 9.0), modes=MODES, sway_limit=0.05)
    assert kind_of(WORDS["understated"]) not in kinds(loose)
    ends = [begin for begin, _ in runs_of(loose.stands) if begin]
    *_, apart = MODES.left(loose.acceleration, ends, CYCLE)
    (found,) = (one.needed for one in measured(loose, {}) if one.what == OVERSTATED)
    assert found == pytest.approx(9.0 / max(min(apart), 0.01 * 0.05))


def test_an_axis_that_is_let_go_while_it_brakes_need_not_rest_where_it_would_have():
    begin, braking = 400, obedient()
    for end, still in ((402, DISABLED), (700, STOP)):
        orders = (*braking.orders[:1], order(TOLD, begin, POSITION, TARGET), order(begin, end, QUICK_STOP))
        brakes = attrs.evolve(braking, received=as_told(*orders, order(end, CYCLES, still)))
        for name in ("fVelocity", "fAcceleration"):
            brakes.issued[name][402:] = 0.0
        brakes.issued["fPosition"][402:] = brakes.issued["fPosition"][402]
        ahead = brakes.issued["fPosition"] + 0.5 * (abs(np.arange(CYCLES) - 396) < 6)
        brakes.issued.update(fStopHigh=ahead, fStopLow=brakes.issued["fPosition"].copy())
        brakes.issued["bEnabled"] = 1.0 * (np.arange(CYCLES) < end)
        assert (kind_of(WORDS["loose"]) in kinds(brakes)) == (still == STOP)
