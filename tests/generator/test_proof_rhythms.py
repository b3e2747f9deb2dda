"""Histories of many commands in one rhythm, and of a whole shift; what they find."""

import attrs
import numpy as np
import pytest
from generator.planned_machines import BAY

from gen_profile.assurance.proof.closed_loop import ClosedLoop
from gen_profile.assurance.proof.histories import SHIFT, Histories
from gen_profile.assurance.proof.numbering import DRAWS, LONG, RHYTHMS, SEARCH, Numbering
from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec, preset_spec

COARSE = ["export.cycle_time=0.02"]
REVERSALS = np.array([0.0, 0.4, 0.5, 1.0, 0.5, 1.0])  # kind, wait, uneven, size, place, share of an axis


@pytest.fixture(scope="module")
def spec():
    return preset_spec("bay-crane", COARSE)


def numbered(spec, count):
    """A numbering whose search has nothing to climb from."""
    numbering = Numbering.of(Histories.of(spec), count, 0)
    return attrs.evolve(numbering, parents=((),) * len(numbering.rounds))


def groups(numbering):
    return [numbering.group(number) for number in range(numbering.count)]


@pytest.mark.slow
def test_a_few_histories_of_many_are_rhythms_and_one_is_a_shift(spec):
    assert groups(numbered(spec, 20)).count(RHYTHMS) == 0
    usual, deep = numbered(spec, 200), numbered(spec, 2000)
    assert [groups(usual).count(kind) for kind in (DRAWS, SEARCH, RHYTHMS, LONG)] == [142, 42, 8, 0]
    assert [groups(deep).count(kind) for kind in (SEARCH, RHYTHMS, LONG)] == [419, 80, 1]
    assert [number for numbers in deep.rounds for number in numbers] == list(range(1500, 2000))
    hoisting = parse_spec(BAY, ["planner.live_rate={L1=0.1}"])
    assert LONG not in groups(numbered(hoisting, 2000))  # each of its cycles has inputs of its own
    shift = deep.history(1999)
    assert SHIFT <= shift.commands[-1].time < SHIFT + 1000.0
    assert len(shift.commands) > 1000
    assert {command.command for command in shift.commands} == {"position", "velocity", "stop"}


def test_rhythms_are_even_or_uneven_and_last_for_hundreds_of_commands(spec):
    deep, counts, waits = numbered(spec, 2000), [], []
    for number in range(1919, 1999):
        _, *commands, last = deep.history(number).commands
        assert last.command == "stop"
        times = np.array([command.time for command in commands])
        steps = np.diff(times)
        assert steps[::2] == pytest.approx(steps[0])
        assert steps[1::2] == pytest.approx(steps[1])
        counts.append(len(commands))
        waits.append(steps[0] / steps[1])
        low, high = ((0.0, 40.0), (-1.1, 1.1))[commands[0].command == "velocity"]
        assert all(low <= value <= high for command in commands for value in command.values)
    assert max(counts) > 512
    assert 0.2 < np.mean(np.isclose(waits, 1.0)) < 0.5


@pytest.fixture(scope="module")
def thrown_over(spec):
    """The stick of a crane with a long rope, for 32 periods in time with the swing."""
    histories = Histories.of(spec)
    choices = np.full(histories.choices, 0.5)
    choices[1:3] = 1.0  # rope and load
    choices[sum(histories.sizes[:4]) :][:6] = REVERSALS
    return histories, histories.history(choices, 32.0 * histories.period)


@pytest.mark.slow
def test_a_block_that_forgets_what_was_left_is_found_by_a_rhythm(spec, thrown_over):
    histories, history = thrown_over
    text, keeps = planner_block(spec).text, "aFade[nSwing] * aPastRe[nSwing] + aUnitRe[nSwing] * fTaken"
    assert text.count(keeps) == 1
    found = []
    for written in (text, text.replace(keeps, f"0.7 * {keeps}")):
        with ClosedLoop(spec, written, histories) as loop:
            found.append(loop.watched(history, loop.known(history)))
    sound, forgetful = found
    assert sound.faults == ()
    assert 0.01 < sound.left < 0.05
    assert any("fSwayLeft states" in fault for fault in forgetful.faults)
