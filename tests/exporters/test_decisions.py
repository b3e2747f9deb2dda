"""The planner's table of decisions and its setpoints, each called alone."""

import re

import numpy as np
import pytest
from generator.planned_machines import GANTRY
from scipy.interpolate import BSpline

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import parse_spec, preset_spec

BEGIN, COMMAND, CHOOSE, FAILED, FOUND, SLOT, AGAIN = range(7)
STOP, TARGET, SPEED, PROMPT = 1, 2, 3, 4
NONE, REST, THERE, RAMP, DECLINE, PROMPTLY = range(6)
SLOTS = 64


@pytest.fixture(scope="module")
def blocks():
    return blocks_of(planner_block(preset_spec("bay-crane")).text)


@pytest.fixture(scope="module")
def two():
    return blocks_of(planner_block(parse_spec(GANTRY)).text)


def blocks_of(text):
    whole = re.findall(r"(?s)FUNCTION_BLOCK \w+\n.*?END_FUNCTION_BLOCK\n", text)
    return {block.split(maxsplit=2)[1].rpartition("_")[2]: block for block in whole}


class Table:
    """The table for an axis of 1 m/s that takes 20 slots of 0.25 m to full speed, on a way of 0 to 50 m."""

    def __init__(self, blocks):
        self.block = BlockInstance(blocks["decisions"])
        self.names = list(self.block.outputs)
        self.given = dict.fromkeys(self.block.inputs, 0.0)
        self.given |= {"fUnit": 1.0, "fLimit": 1.0, "fHighest": 50.0, "fLength": 0.25, "fReach": 10.0}
        self.given |= {"fMostChange": 0.05, "fBuildUp": 0.8}
        self.ask(BEGIN)

    def ask(self, order, **given):
        self.given |= given | {"nOrder": order}
        return dict(zip(self.names, self.block.call(np.array([[*self.given.values()]]))[0], strict=True))

    def command(self, kind, goal=0.0, **given):
        return self.ask(COMMAND, nCommand=kind, fGoal=goal, bNew=1.0, **given)

    def fails(self, tried, **given):
        return self.ask(
            FAILED, nOfKind=tried["nKind"], nOfLength=tried["nLength"], nOfRamp=tried["nRamp"], **given
        )


@pytest.mark.parametrize(("command", "kind", "first"), [(STOP, REST, 20), (TARGET, THERE, 30)])
def test_a_motion_is_sought_in_fewer_slots_until_none_is_left_between(blocks, command, kind, first):
    """The fewest slots that are found are those at which a search by halves ends, whatever they are."""
    for fewest in range(3, 40):
        table, now, failed = Table(blocks), 40, []
        table.command(command, 20.0)
        assert table.ask(CHOOSE, nNow=now, bLeadsNow=1.0)["nLength"] == first
        while (tried := table.ask(CHOOSE, nNow=now, bLeadsNow=1.0))["nKind"]:
            assert tried["nKind"] == kind and tried["nLength"] < now and tried["nLength"] not in failed
            if tried["nLength"] >= fewest:
                now = tried["nLength"]
                table.ask(FOUND, nOfKind=kind)
            else:
                failed.append(tried["nLength"])
                table.fails(tried)
        assert now == fewest


def test_a_stop_that_is_not_found_quietly_is_a_prompt_one_once(blocks):
    """A load that may hardly sway more kept an axis on its way of 23 m."""
    table = Table(blocks)
    table.command(STOP)
    given = {"nNow": 150.0, "bLeadsNow": 1.0, "bLeads": 1.0, "fSpeed": 0.1}
    tried = table.ask(CHOOSE, **given)
    assert (tried["nKind"], tried["nLength"]) == (REST, SLOTS)
    table.fails(tried)
    assert table.ask(CHOOSE)["bNoRoom"]  # what is committed leads there no more
    prompt = table.ask(CHOOSE, bLeadsNow=0.0, bLeads=0.0)
    assert (prompt["nKind"], prompt["nLength"]) == (PROMPTLY, 11)
    while (prompt := table.ask(CHOOSE))["nKind"] == PROMPTLY:
        table.fails(prompt)
    assert table.ask(CHOOSE)["nDoes"] == STOP
    short = Table(blocks)
    short.command(STOP)
    short.fails(short.ask(CHOOSE, **given | {"nNow": 40.0}) | {"nLength": 39})
    assert short.ask(CHOOSE)["nDoes"] == STOP


def test_an_axis_that_a_ramp_would_lead_beyond_its_target_is_not_slowed_to_the_pace_of_others(two):
    cases = ((0.6, 2.0, THERE), (0.6, -2.0, THERE), (-0.6, 4.0, THERE), (0.0, 4.0, RAMP), (0.6, 5.0, RAMP))
    for speed, way, kind in cases:
        table = Table(two)
        table.command(TARGET, 20.0 + way, fPlace=20.0, fSpeed=speed, bStands=float(speed == 0.0))
        assert table.ask(CHOOSE, nOthers=130.0)["nKind"] == kind, (speed, way)


def test_what_failed_counts_a_slot_less_in_each_slot(blocks):
    table = Table(blocks)
    table.command(STOP)
    table.fails(table.ask(CHOOSE, nNow=40.0))
    assert table.ask(CHOOSE, nNow=40.0)["nLength"] == 30
    table.ask(SLOT)
    assert table.ask(CHOOSE, nNow=39.0)["nLength"] == 29


def test_a_target_is_sought_in_more_slots_than_the_axis_takes_and_then_by_its_speed(blocks):
    table = Table(blocks)
    table.command(TARGET, 2.0)
    lengths = []
    while (tried := table.ask(CHOOSE))["nKind"] == THERE:
        lengths.append(tried["nLength"])
        table.fails(tried)
    assert lengths[0] == round(2 * np.sqrt(2 * 8.0 * 10.0) + 12)  # 8 slots at full speed away
    assert lengths == sorted(lengths) and lengths[-1] == SLOTS
    assert tried["nKind"] == RAMP and 0.0 < tried["fRamp"] < 1.0
    assert table.ask(FOUND, nOfKind=DECLINE)["nLater"] == 12
    assert table.ask(CHOOSE)["nKind"] == NONE  # once in a slot
    table.ask(SLOT)
    assert table.ask(CHOOSE)["nKind"] in (THERE, RAMP)


def test_a_speed_is_another_one_beyond_its_band_and_the_end_where_there_is_no_room(blocks):
    table = Table(blocks)
    begun = table.command(SPEED, 0.5, fPlace=20.0)
    assert begun["bChange"] and begun["nDoes"] == SPEED
    assert not table.ask(COMMAND, bNew=0.0, fGoal=0.53)["bChange"]
    assert table.ask(COMMAND, fGoal=0.55)["bChange"]
    assert table.ask(COMMAND, fGoal=0.55, fLimit=0.3)["fAim"] == 0.3
    ramp = table.ask(CHOOSE)
    assert (ramp["nKind"], ramp["fRamp"], ramp["nRamp"]) == (RAMP, 0.3, 10)
    assert table.ask(COMMAND, fGoal=-0.55)["bChange"]
    table.ask(COMMAND, fPlace=0.5)
    ends = table.ask(CHOOSE)
    assert ends["bNoRoom"] and ends["nDoes"] == TARGET and ends["fAim"] == 0.0 and ends["fTop"] == 0.3
    assert table.command(SPEED, 0.0)["nDoes"] == STOP


def test_a_prompt_stop_that_fails_may_take_ten_slots_more_then_leave_16_times_as_much_and_then_is_a_quiet_one(
    blocks,
):
    table, found = Table(blocks), []
    assert table.command(PROMPT)["fEase"] == 2.0  # half of what is allowed is for plans
    while (tried := table.ask(CHOOSE, nNow=50.0, fSpeed=1.0))["nKind"] == PROMPTLY:
        found.append((tried["fEase"], tried["nLength"]))
        table.fails(tried)
    assert found == [(ease, slots) for ease in (2.0, 32.0, 512.0) for slots in (29, 34, 39)]
    assert (tried["nDoes"], tried["nKind"], tried["bThere"]) == (STOP, REST, 1.0)


def test_a_stick_that_is_let_go_stops_promptly_where_that_is_asked_for(blocks):
    for prompt, does in ((0.0, STOP), (1.0, PROMPT)):
        table = Table(blocks)
        table.command(SPEED, 0.5, fPlace=20.0, bPrompt=prompt)
        table.ask(COMMAND, bNew=0.0)
        assert table.ask(COMMAND, fGoal=0.0)["nDoes"] == does


def test_a_prompt_stop_takes_no_more_slots_than_are_committed(blocks):
    table = Table(blocks)
    table.command(PROMPT)
    assert table.ask(CHOOSE, nNow=12.0, fSpeed=1.0)["nLength"] == 12


def test_a_prompt_stop_that_leaves_what_plans_may_is_sought_in_fewer_slots_until_none_is_left_between(blocks):
    for fewest in range(4, 29):
        table, now = Table(blocks), 29
        table.command(PROMPT)
        table.ask(CHOOSE, nNow=40.0, fSpeed=1.0)
        table.ask(FOUND, nOfKind=PROMPTLY)
        while (tried := table.ask(CHOOSE, nNow=now, bLeadsNow=1.0))["nKind"]:
            assert tried["nKind"] == PROMPTLY and tried["nLength"] < now and tried["fEase"] == 1.0
            if tried["nLength"] >= fewest:
                now = tried["nLength"]
                table.ask(FOUND, nOfKind=PROMPTLY)
            else:
                table.fails(tried)
        assert now == fewest


def test_a_prompt_stop_that_leaves_more_is_sought_with_half_the_sway_until_that_fails(blocks):
    table = Table(blocks)
    table.command(PROMPT)
    table.fails(table.ask(CHOOSE, nNow=29.0, fSpeed=1.0))
    table.ask(CHOOSE)
    assert table.ask(FOUND, nOfKind=PROMPTLY)["fEase"] == 16.0
    tried = table.ask(CHOOSE, nNow=29.0, bLeadsNow=1.0)
    assert (tried["nKind"], tried["nLength"]) == (PROMPTLY, 29)
    table.fails(tried)
    assert table.ask(CHOOSE, nNow=28.0)["nKind"] == NONE


def test_a_decline_that_fails_is_sought_longer_and_then_behind_a_ramp_to_less(blocks):
    table = Table(blocks)
    table.command(SPEED, 0.5, fPlace=20.0)
    tried = table.ask(CHOOSE)
    longer = table.fails({**tried, "nKind": DECLINE, "nLength": 50}, nOfBefore=15)
    assert longer["bLonger"] and longer["nLater"] == 18
    less = table.fails({**tried, "nKind": DECLINE, "nLength": 15 + SLOTS}, nOfBefore=15)
    assert not less["bLonger"] and less["nLater"] == 12
    again = table.ask(CHOOSE)
    assert again["nRamp"] > tried["nRamp"] and again["fRamp"] == pytest.approx(0.3)
    table.ask(FOUND, nOfKind=DECLINE)
    assert table.ask(CHOOSE)["fRamp"] == 0.5


@pytest.mark.parametrize(("command", "next_"), [(SPEED, RAMP), (TARGET, THERE)])
def test_a_motion_that_leads_beyond_the_places_of_now_is_stopped_first(blocks, command, next_):
    table = Table(blocks)
    table.command(command, 0.5, fPlace=0.0)
    tried = table.ask(CHOOSE, nNow=40, bOutside=1.0)
    assert (tried["nKind"], tried["nLength"]) == (REST, 20)
    assert table.ask(CHOOSE, nNow=20, bOutside=0.0)["nKind"] == next_


def test_a_tap_leads_two_slots_of_its_speed_and_begins_within_two_slots(blocks):
    """An axis that had waited for 3.4 s set out half a second after its stick was let go, for 2 m."""
    table, slot = Table(blocks), {"fCycle": 0.05, "fPlace": 10.0, "bStands": 1.0}
    for _ in range(68):
        table.command(SPEED, -0.6, **slot)
    tapped = table.command(SPEED, 0.0)
    assert tapped["nDoes"] == TARGET
    assert tapped["fAim"] == pytest.approx(10.0 - 2.0 * 0.25 * 0.6)
    does = [table.ask(COMMAND, bNew=0.0)["nDoes"] for _ in range(20)]
    assert does[:9] == [TARGET] * 9 and does[11:] == [STOP] * 9


def test_a_speed_below_a_limit_that_fell_is_ramped_to_in_part_where_all_of_it_is_not_found(blocks):
    """Where what was committed was to become a little faster, the same ramp was tried on and on."""
    table, committed = Table(blocks), {"nNow": 80.0, "nDeclineNow": 30.0, "fKeptNow": 0.9, "fSpeed": 0.5}
    table.command(SPEED, -0.8, fLimit=0.85, fPlace=25.0)
    tried = table.ask(CHOOSE, **committed)
    assert (tried["nKind"], tried["fRamp"]) == (RAMP, pytest.approx(-0.8))
    for _ in range(4):
        table.fails(tried)
        tried = table.ask(CHOOSE, **committed)
    assert -0.7 < tried["fRamp"] < 0.5


def test_a_target_that_creeps_is_led_to_by_what_failed_for_the_one_before(blocks):
    """Each was sought from the first guess on again, so none was found, and the axis went on for 3 s."""
    table, committed = Table(blocks), {"nNow": 80.0, "nDeclineNow": 30.0, "fKeptNow": 0.9, "fSpeed": 0.5}
    tries = []
    for step in range(4):
        table.command(TARGET, 5.0 - 0.02 * step, fPlace=40.0)
        tried = table.ask(CHOOSE, **committed)
        assert tried["nKind"] == RAMP
        tries.append((tried["nRamp"], tried["fRamp"]))
        table.fails(tried)
    assert len(set(tries)) == 4
    table.command(TARGET, 45.0)
    assert table.ask(CHOOSE, **committed)["fRamp"] > 0.0


def test_a_target_to_which_the_axis_is_led_already_is_taken_while_another_one_is_sought(blocks):
    """It went away from there, to a target that had been given for 40 ms."""
    for end, taken in ((30.0, 1.0), (12.0, 0.0)):
        table = Table(blocks)
        table.command(TARGET, 20.0, fEnd=end)
        found = table.command(TARGET, 30.0, bSeeks=1.0)
        assert found["bChange"] == taken and found["fAim"] == (30.0 if taken else 20.0)


def test_from_rest_what_swings_is_left_where_it_cannot_be_calmed(blocks):
    table = Table(blocks)
    table.command(SPEED, 0.5, fPlace=20.0, bStands=1.0)
    tried, calming = table.ask(CHOOSE), []
    while not (left := table.fails(tried, bSwings=1.0))["bQuiet"]:
        calming.append(tried["nRamp"])
        tried = table.ask(CHOOSE)
    assert calming[0] == 14 and max(calming) < 30  # the axis alone takes 10
    quiet = table.ask(CHOOSE)
    assert (quiet["nKind"], quiet["nRamp"], left["nLater"]) == (RAMP, 30, 20)
    slower = table.fails({**quiet, "nKind": DECLINE, "nLength": 62}, nOfBefore=32)
    assert slower["bQuiet"] and slower["nLater"] == 25
    again = table.ask(CHOOSE)
    assert again["nRamp"] == 30 and again["fRamp"] == pytest.approx(0.3)
    for _ in range(20):  # and where none is found, it ends in this slot, whatever speed was kept before
        tried = table.ask(CHOOSE, fKeptNow=1.5)
        if not tried["nKind"]:
            break
        later = table.fails({**tried, "nKind": DECLINE, "nLength": 62}, nOfBefore=32)["nLater"]
    assert not tried["nKind"] and later < 200
    assert not table.ask(FOUND, nOfKind=DECLINE)["bQuiet"]


def test_setpoints_are_the_derivatives_and_the_integral_of_one_spline(blocks):
    """Over a whole motion, beside SciPy's B-spline of the same coefficients."""
    draw, cycles, slot = np.random.default_rng(3), 20, 0.1
    size = int(re.search(r"aFuture : ARRAY \[0..(\d+)\]", blocks["setpoints"])[1]) + 1
    text = f"""{blocks["setpoints"]}
FUNCTION_BLOCK Called
VAR_INPUT nTick : DINT; fFrom : LREAL; nAhead : DINT; f0 : LREAL; f1 : LREAL; f2 : LREAL; f3 : LREAL; END_VAR
VAR_OUTPUT fPosition : LREAL; fVelocity : LREAL; fAcceleration : LREAL; fTimeToGo : LREAL; END_VAR
VAR given : FB_bay_crane_setpoints; aFuture : ARRAY [0..{size - 1}] OF LREAL; END_VAR
aFuture[0] := f0; aFuture[1] := f1; aFuture[2] := f2; aFuture[3] := f3;
given(bMoving := TRUE, nTick := nTick, nSlot := {cycles}, fSlot := {slot!r}, fFrom := fFrom, nAhead := nAhead,
    aFuture := aFuture);
fPosition := given.fPosition; fVelocity := given.fVelocity; fAcceleration := given.fAcceleration;
fTimeToGo := given.fTimeToGo;
END_FUNCTION_BLOCK
"""
    block = BlockInstance(text)
    future = np.r_[0.0, 0.0, draw.normal(size=6), np.zeros(6)]
    spline = BSpline(np.arange(-2.0, len(future) + 1) * slot, future, 2)
    place = spline.antiderivative()
    for at in range(9):
        for tick in (1, 7, 20):
            row = [tick, place(at * slot), 7 - at, *future[at : at + 4]]
            issued = block.call(np.array([row]))[0]
            time = (at + tick / cycles) * slot
            due = place(time), spline(time), spline.derivative()(time)
            assert np.allclose(issued[:3], due, rtol=0, atol=1e-9)


def test_axes_that_go_to_targets_are_led_there_in_as_many_slots_as_the_slowest_needs(two):
    table = Table(two)
    table.command(TARGET, 2.0)
    tried = table.ask(CHOOSE, nOthers=50.0)
    assert (tried["nKind"], tried["nLength"], tried["nNeeds"]) == (THERE, 50, 37)
    table.ask(FOUND, nOfKind=THERE, nOfLength=50)
    rests = {"bLeadsNow": 1.0, "nNow": 50}
    settled = table.ask(CHOOSE, **rests)  # not in fewer, and others need not go by that
    assert (settled["nKind"], settled["nNeeds"]) == (NONE, 1)
    sooner = table.ask(CHOOSE, nOthers=41.0, **rests)
    assert (sooner["nKind"], sooner["nLength"], sooner["bWaits"]) == (THERE, 41, 0)
    table.fails(sooner)
    assert table.ask(CHOOSE, **rests)["nNeeds"] == 42
    later = table.ask(CHOOSE, nOthers=53.0, **rests)
    assert (later["nKind"], later["nLength"], later["bWaits"]) == (THERE, 53, 1)
    assert later["bStraight"]
    table.fails(later)  # it is there, so it is tried in each slot
    assert table.ask(CHOOSE, **rests)["nKind"] == NONE
    table.ask(SLOT)
    assert table.ask(CHOOSE, nOthers=52.0, bLeadsNow=1.0, nNow=49)["nLength"] == 52


def test_one_motion_of_its_own_is_what_others_wait_for(two):
    table = Table(two)
    table.command(TARGET, 2.0)
    table.ask(FOUND, nOfKind=THERE, nOfLength=table.ask(CHOOSE, nOthers=5.0)["nLength"])
    assert table.ask(CHOOSE, bLeadsNow=1.0, nNow=37)["nNeeds"] == 37
    table.ask(SLOT)
    assert table.ask(COMMAND, bNew=0.0)["nNeeds"] == 36
    table.command(STOP)
    assert table.ask(CHOOSE, nNow=36)["nNeeds"] == 0


def test_beside_an_axis_that_is_far_away_the_speed_brings_it_there_together(two):
    table = Table(two)
    table.command(TARGET, 4.0)
    tried = table.ask(CHOOSE, nOthers=212.0)  # 200 at full speed: 16 slots of way
    assert tried["nKind"] == RAMP
    assert tried["fRamp"] * (200 - 2 * 10 * tried["fRamp"]) == pytest.approx(16.0)
    kept = {"nDeclineNow": 10.0, "fKeptNow": 1.1 * tried["fRamp"], "nNow": 10.0}
    assert table.ask(CHOOSE, **kept)["nKind"] == NONE
    table.ask(SLOT)
    assert table.ask(CHOOSE, **kept | {"fKeptNow": 2.0 * tried["fRamp"]})["nKind"] == RAMP
