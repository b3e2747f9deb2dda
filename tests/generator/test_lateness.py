"""How prompt a block is beside what is possible, and which sentences tell of it."""

import attrs
import numpy as np
import pytest
from generator.test_proof_obedience import CYCLE, MOVE, REST, STICKS, STOPS, obedient, with_orders

from gen_profile.assurance.proof.followed import LATENESS, PLANNING
from gen_profile.assurance.proof.lateness import Promptness, chosen
from gen_profile.assurance.proof.orders import POSITION, STOP, VELOCITY
from gen_profile.assurance.proof.promptness import FIRST, WAY, Obeyed, obeyed
from gen_profile.spec.reading import preset_spec

SLOW = Obeyed(
    kind=STOP, begin=3.0, takes=9.0, alone=1.0, bounded=5.0, period=2.0, state="at 1 m, 1 m/s", possible=4.0
)


def timed(followed):
    return {one.kind: one for one in obeyed(followed)}


def test_commands_are_timed_beside_the_axis_alone_and_a_period_of_each_mode():
    """At 0.5 m/s² and 5 m/s³ a ramp to 1 m/s takes 2.1 s; 5 m take 5 s at 1 m/s, and such a ramp more."""
    found = timed(attrs.evolve(obedient(), periods=(2.0, 0.5)))
    move, stick, stop = found[FIRST], found[VELOCITY], found[STOP]
    assert (move.takes, stick.takes, stop.takes) == pytest.approx((7.2, 2.2, 2.2), abs=2.1 * CYCLE)
    assert (move.alone, stick.alone, stop.alone) == pytest.approx((5.0 + 2.1, 1.7, 1.7))
    assert move.bounded - move.alone == pytest.approx(2.5)
    assert stop.bounded - stop.alone == pytest.approx(2.5)
    assert POSITION in timed(attrs.evolve(obedient(), periods=(0.3,)))  # long after it was enabled


def test_on_the_way_to_one_target_another_takes_the_rest_of_a_motion_too():
    again = with_orders(REST, attrs.evolve(MOVE, end=250), attrs.evolve(MOVE, begin=250), STICKS, STOPS)
    move = timed(again)[WAY]
    assert move.bounded - move.alone == 2.0 * again.period
    assert move.takes == pytest.approx(8.2 - 2.5, abs=2.1 * CYCLE)


def test_what_takes_longer_than_so_many_times_the_quickest_and_a_second_is_late():
    bound = LATENESS * 4.0 + PLANNING
    assert [attrs.evolve(SLOW, takes=bound + by).is_late(LATENESS) for by in (-0.01, 0.01)] == [False, True]
    assert not attrs.evolve(SLOW, possible=None, takes=LATENESS * 5.0 + 0.9).is_late(LATENESS)


def test_a_late_block_is_refused_only_where_the_spec_demands_it():
    quick = attrs.evolve(SLOW, takes=4.0)
    lateness = Promptness(demanded=None, commands=[(7, SLOW), (8, quick)])
    assert lateness.reasons() == []
    assert lateness.words().startswith(
        "1 of 2 commands takes more than 1.5 times the quickest and 1 s; the latest:"
    )
    closed = Promptness(demanded=None, commands=[(7, attrs.evolve(quick, possible=None))])
    assert "all 1 commands within 1.5 times the quickest and 1 s, all by the closed form" in closed.words()
    (reason,) = Promptness(demanded=1.2, commands=[(7, SLOW), (8, quick)]).reasons()
    assert reason.startswith(
        "In history 7, one of the stops (at 1 m, 1 m/s) takes 9 s at 3.00 s, where 4 s are possible, "
        "and 1.2 times that and 1 s are demanded (planner.lateness)"
    )
    assert Promptness(demanded=2.0, commands=[(7, SLOW)]).reasons() == []
    (row,) = lateness.table()
    assert (row["commands"], row["late"], row["compared"]) == (2, 1, 2)
    assert row["by_quickest"] == {"0.5": 1.625, "0.9": pytest.approx(2.125), "1": 2.25}
    assert (row["worst"]["history"], row["worst"]["takes_s"], row["worst"]["quickest_s"]) == (7, 9.0, 4.0)


def test_the_latest_of_each_kind_are_compared_and_some_by_chance():
    commands = [attrs.evolve(SLOW, takes=float(k), case="any", possible=None) for k in range(40)]
    commands += [attrs.evolve(SLOW, kind=POSITION, takes=99.0, possible=None)]  # nothing is known of its load
    places = chosen(commands, 0)
    assert {36, 37, 38, 39} <= {*places} <= {*range(40)}
    assert 4 < len(places) <= 8
    assert places != chosen(commands, 1)


def test_a_spec_states_how_late_commands_may_be():
    assert preset_spec("bay-crane").planner.lateness is None
    assert preset_spec("bay-crane", ["planner.lateness=1.2"]).planner.lateness == 1.2
    assert np.isfinite(SLOW.ratio)
