"""What operators and controllers order: read from a block's inputs, and drawn for histories."""

import attrs
import numpy as np
import pytest
from generator.planned_machines import BAY

from gen_profile.assurance.proof.habits import GENTLE, ROUGH
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.orders import (
    BLOCKED,
    DISABLED,
    POSITION,
    QUICK_STOP,
    STOP,
    VELOCITY,
    ZONES,
    Ends,
    Facts,
    Inputs,
    read_orders,
)
from gen_profile.planner.interface import BlockAxis
from gen_profile.spec.reading import parse_spec, preset_spec

CYCLE = 0.01
LIMITS = Ends(velocity=1.0, acceleration=0.5, jerk=5.0, targets=(-100.0, 100.0), quick=(1.0, 10.0))
NAMES = [
    *("bEnable", "bExecute", "bVelocity", "bStop", "bQuickStop", "rOverride", "fTarget", "fVelocityCommand"),
    *("fVelocityLimit", "fL", "bReset", "fCycleTime", "fActPosition", "fActVelocity", "fFollowingLimit"),
]
INPUTS = Inputs(
    names=NAMES, axes=[BlockAxis(name="")], limits=[LIMITS], live={"L": (1.0, 2.0)}, held=20, cycle=CYCLE
)


def read(*rows, facts=None):
    """What is commanded by cycles and inputs that differ from those before."""
    begin = {"bEnable": 1.0, "rOverride": 1.0, "fL": 1.5, "fCycleTime": CYCLE}
    values, given = dict.fromkeys(NAMES, 0.0) | begin, []
    for _, changes in rows:
        values |= changes
        given.append(list(values.values()))
    return read_orders([begin for begin, _ in rows], np.array(given), INPUTS, 1000, facts)


def test_orders_are_read_from_inputs():
    received = read(
        (0, {}),
        (10, {"bExecute": 1.0, "fTarget": 5.0}),
        (20, {"bExecute": 0.0}),
        (30, {"bExecute": 1.0}),
        (40, {"bExecute": 0.0, "rOverride": 0.5}),
        (50, {"bVelocity": 1.0, "fVelocityCommand": -0.3, "rOverride": 1.0, "fVelocityLimit": 0.2}),
        (60, {"bVelocity": 0.0, "fVelocityLimit": 0.0}),
        (70, {"bExecute": 1.0, "fTarget": 1000.0}),
        (80, {"bExecute": 0.0, "bQuickStop": 1.0, "rOverride": np.nan}),
    )
    assert [(one.begin, one.kind, one.values, one.tops, one.edge) for one in received.orders] == [
        (0, STOP, (), (1.0,), 0),
        (10, POSITION, (5.0,), (1.0,), 10),  # and nothing new with the second edge
        (40, POSITION, (5.0,), (0.5,), 10),
        (50, VELOCITY, (-0.3,), (0.2,), 50),
        (60, STOP, (), (1.0,), 60),
        (80, QUICK_STOP, (), (1.0,), 80),
    ]
    assert [one.end for one in received.orders] == [*(one.begin for one in received.orders[1:]), 1000]
    assert changes(received.error) == {70: 3, 80: 0, 100: 5}
    assert changes(received.aborted) == {50: 1, 60: 0, 70: 1, 80: 0}


def changes(flags):
    """Values from the cycles in which they change on."""
    return {int(at) + 1: int(flags[at + 1]) for at in np.flatnonzero(np.diff(flags.astype(int)))}


def test_what_cannot_be_obeyed_is_read_from_inputs():
    received = read(
        (0, {"bStop": 1.0}),
        (10, {"bExecute": 1.0}),
        (20, {"bExecute": 0.0, "bStop": 0.0}),
        (30, {"fCycleTime": 0.02, "bExecute": 1.0}),
        (40, {"fCycleTime": CYCLE}),
        (50, {"fActPosition": 1e6, "bExecute": 0.0}),
        (60, {"fFollowingLimit": 0.1}),
        (70, {"fFollowingLimit": 0.0}),
        (80, {"bReset": 1.0}),
        (90, {"bReset": 0.0, "bVelocity": 1.0, "bExecute": 1.0}),
        (95, {"bExecute": 0.0}),
        (97, {"bVelocity": 0.0}),
    )
    assert [(one.begin, one.kind) for one in received.orders] == [(0, STOP), (60, QUICK_STOP), (80, STOP)]
    assert changes(received.error) == {30: 1, 40: 0, 60: 7, 80: 0, 90: 6, 97: 0}
    assert changes(received.aborted) == {10: 1, 20: 0, 30: 1, 50: 0}


def test_wrong_values_count_once_they_have_lasted():
    received = read(
        (0, {"bExecute": 1.0, "fTarget": 5.0}),
        (10, {"fL": 3.0}),
        (25, {"fL": 1.0}),
        (40, {"rOverride": 2.0}),
        (70, {"rOverride": 1.0}),
        (80, {"bExecute": 0.0}),
        (90, {"bExecute": 1.0}),
        (95, {"bExecute": 0.0, "bReset": 1.0}),
        (99, {"bExecute": 1.0, "bReset": 0.0}),
    )
    assert [(one.begin, one.kind) for one in received.orders] == [(0, POSITION), (60, STOP), (99, POSITION)]
    assert changes(received.error) == {60: 5, 95: 0}
    assert changes(received.aborted) == {60: 1, 80: 0, 90: 1, 95: 0}


def test_values_that_are_wrong_as_the_block_is_enabled_count_since_they_are():
    lasting = read((0, {"bEnable": 0.0}), (10, {"fL": 3.0}), (60, {"bEnable": 1.0}), (80, {"fL": 1.5}))
    assert changes(lasting.error) == {60: 2, 80: 0}
    fresh = read((0, {"bEnable": 0.0}), (50, {"fL": 3.0}), (60, {"bEnable": 1.0}), (80, {"fL": 1.5}))
    assert changes(fresh.error) == {70: 2, 80: 0}


def test_what_commands_mean_depends_on_what_the_block_did():
    rows = (
        (0, {"bExecute": 1.0, "fTarget": 5.0}),
        (200, {"bExecute": 0.0}),
        (300, {"bEnable": 0.0}),
        (310, {"bEnable": 1.0, "fVelocityCommand": 0.1, "bVelocity": 1.0}),
    )
    none = np.zeros(1000, dtype=bool)
    far = np.zeros((1, 1000))
    facts = {"done": none, "stands": none, "withdrawn": none, "errors": 1.0 * none}
    facts |= dict.fromkeys(("position", "low", "high"), far)
    assert changes(read(*rows, facts=Facts(**facts)).holds) == {300: 0}
    done = none.copy()
    done[150:200] = True
    received = read(*rows, facts=Facts(**facts | {"done": done}))
    assert changes(received.holds) == {200: 0}
    assert [one.kind for one in received.orders] == [POSITION, STOP, DISABLED, STOP]  # deflected when enabled
    assert not received.aborted.any()


@pytest.mark.parametrize(("low", "ahead", "is_so"), [(2, 0, 1), (-2, 0, 0), (6, 0, 0), (-0.5, -0.5, 1)])
def test_an_interval_is_in_the_way_where_it_lies_before_the_target(low, ahead, is_so):
    names = [*NAMES, *(f"aBlocked{end}[{k}]" for end in ("Low", "High") for k in range(ZONES))]
    values = dict.fromkeys(names, 0.0)
    values |= {"bEnable": 1.0, "rOverride": 1.0, "fL": 1.5, "fCycleTime": CYCLE}
    values |= {"bExecute": 1.0, "fTarget": 5.0}
    closed = values | {"aBlockedLow[0]": low, "aBlockedHigh[0]": low + 1.0}
    errors, still, place = np.zeros(1000), np.zeros(1000, dtype=bool), np.zeros((1, 1000))
    errors[101:] = BLOCKED
    facts = Facts(
        done=still,
        stands=still,
        errors=errors,
        position=place,
        low=place + ahead,
        high=place + ahead,
        withdrawn=still,
    )
    inputs = attrs.evolve(INPUTS, names=names)
    rows = np.array([list(values.values()), list(closed.values())])
    assert (read_orders([0, 100], rows, inputs, 1000, facts).error[200] == BLOCKED) == is_so


def test_histories_hold_what_operators_and_controllers_do():
    histories = Histories.of(parse_spec(BAY))
    drawn = [histories.history(choices) for choices in histories.drawn(400, seed=1)]
    assert all(
        history.commands == tuple(sorted(history.commands, key=lambda one: one.time)) for history in drawn
    )
    inputs = {name for history in drawn for change in history.changes for name in change.inputs}
    assert inputs == {
        *("rOverride", "fVelocityLimit", "fL1", "fm2", "bReset", "bExecute", "bLoadAtRest", "bEnable"),
        *("fCycleTime", "fFollowingLimit", "fActPosition", "fActVelocity", "fVelocityCommand", "fTarget"),
        *("bVelocity", "bStop", "bQuickStop", "bPromptStop"),
    }
    again = [sum(map(_same, history.commands, history.commands[1:])) for history in drawn]
    assert max(again) > 10
    assert len({*GENTLE, *ROUGH}) == 21
    zoned = Histories.of(preset_spec("bay-crane", ["planner.zones=true"]))
    drawn = [zoned.history(choices) for choices in zoned.drawn(40, seed=1)]
    closed = {name for history in drawn for change in history.changes for name in change.inputs}
    assert {"aBlockedLow[0]", "aSlowLimit[1]", "aBlockedHigh[7]", "aSlowHigh[7]"} <= closed


def _same(first, second):
    return first.command == second.command == "position" and first.values == second.values
