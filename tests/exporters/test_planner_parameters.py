"""Planner blocks whose numbers are variables: they plan as blocks of constants do, whatever was switched."""

import re

import numpy as np
import pytest
from test_planner_sensor import MEASURED

from gen_profile.planner.design import planner_constants
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.planner.blocks.whole import whole_block
from gen_profile_exporters.planner.parameters import buffered_planner, constant_planner
from gen_profile_exporters.playback.buffers import FIRST, LENGTH, WINDOW, buffer_texts

CHANGES = ("limits.velocity=0.9", "plant.m1=2500", "planner.live.L1=[3.2,9.0]")
PARTS = {
    "followed": ("planner.live_rate.L1=0.2",),
    "zones and events": ("planner.zones=true", "planner.events=true"),
}


def source_of(*changes):
    return parse_function_block(whole_block(planner_constants(preset_spec("bay-crane", [*changes]))[1]))


@pytest.fixture(scope="module")
def sources():
    return source_of(), source_of(*CHANGES)


def kind_of(source):
    return next(one.initial for one in buffered_planner(source).variables if one.name == "cKind")


@pytest.mark.parametrize(
    "changes", [*PARTS.values(), pytest.param(MEASURED, marks=pytest.mark.slow)], ids=[*PARTS, "measured"]
)
def test_whatever_the_block_holds_it_reads_back_to_its_constants(changes):
    source = source_of(*changes)
    block = buffered_planner(source)
    for one in (*block.within, block):
        names = [variable.name.lower() for variable in one.variables]
        assert len(names) == len(set(names))
    assert constant_planner(block).program() == source.program()


def test_blocks_that_differ_in_numbers_only_take_each_others(sources):
    first, second = sources
    assert kind_of(first) == kind_of(second)
    others = {kind_of(source_of(change)) for change in ("planner.zones=true", "planner.events=true")}
    assert len({kind_of(first), *others}) == 3


NUMBERS = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?:E[+-]\d+)?(?!\w)")


@pytest.mark.slow
def test_altered_numbers_and_statements_are_refused(sources):
    text = buffered_planner(sources[0]).text()
    program = re.sub(r"\(\*.*?\*\)", lambda found: " " * len(found[0]), text, flags=re.DOTALL)
    found = list(NUMBERS.finditer(program, program.index("END_VAR")))
    due = sum(
        parse_function_block(text).program() != parse_function_block(_altered(text, one)).program()
        for one in found[::499]
    )
    refused = 0
    for one in found[::499]:
        try:
            constant_planner(parse_function_block(_altered(text, one)))
        except ExportError:
            refused += 1
    assert refused == due > 5


def _altered(text, number):
    return f"{text[: number.start()]}9{number[0]}{text[number.end() :]}"


class Block:
    """An instance whose inputs hold until they are changed, and its client."""

    def __init__(self, source):
        self.instance = BlockInstance(source.text())
        self.given = dict(self.instance.inputs)
        self.places = {name: place for place, name in enumerate(self.instance.outputs)}
        self.number = 0.0

    def call(self, cycles, **inputs):
        self.given.update(inputs)
        return self.instance.call(np.tile(list(self.given.values()), (cycles, 1)))

    def ask(self, command, values=(), place=0, checksum=0.0):
        self.number += 1.0
        request = np.zeros(LENGTH)
        request[:7] = self.number, 1.0, command, 1.0, place, len(values), checksum
        request[FIRST : FIRST + len(values)] = values
        request[-1] = self.number
        row = self.call(1, **{f"aRequest[{k}]": value for k, value in enumerate(request)})[0]
        return row[self.places["aReply[1]"]]

    def write(self, values, first=0):
        for place in range(0, len(values), WINDOW):
            assert self.ask(1.0, values[place : place + WINDOW], place) == 0.0

    def state(self, place):
        return self.call(1)[0][self.places[f"aState[{place}]"]]

    def journey(self, names):
        """Give outputs while it is enabled, goes to targets and follows a stick."""
        steps = [
            {"fActPosition": 0.0, "fActVelocity": 0.0, "fL1": 5.0, "bEnable": 0.0, "bExecute": 0.0},
            {"bLoadAtRest": 0.0},
            {"bEnable": 1.0},
            {"bLoadAtRest": 1.0},
            {"bExecute": 1.0, "fTarget": 6.0},
            {"bExecute": 0.0, "bVelocity": 1.0, "fVelocityCommand": 0.5},
            {"fVelocityCommand": -0.4},
            {"bVelocity": 0.0},
            {"bExecute": 1.0, "fTarget": 2.0},
        ]
        rows = np.concatenate([self.call(800, **step) for step in steps])
        return rows[:, [self.places[name] for name in names]]


@pytest.mark.slow
def test_after_a_switch_it_plans_as_a_block_that_was_just_loaded(sources):
    """To the last bit, once the load was seen at rest; enabled, or by a wrong checksum, it takes nothing."""
    usual, changed = sources
    due, block = Block(usual), Block(buffered_planner(changed))
    names = list(due.places)
    there, other = (
        np.array(list(map(float, buffer_texts(buffered_planner(source))))) for source in (changed, usual)
    )
    assert block.call(2, bEnable=1.0)[-1][block.places["bEnabled"]] == 0.0  # its checksum is not known yet
    assert block.call(200)[-1][block.places["bEnabled"]] == 1.0
    block.journey(names)
    block.write(other)
    assert block.ask(2.0, checksum=other[1]) == 2.0  # it moves, or may
    block.call(10, bEnable=0.0, fActVelocity=0.1)
    assert block.ask(2.0, checksum=other[1]) == 2.0  # the axis moves
    block.call(10, fActVelocity=0.0)
    wrong = other.copy()
    wrong[40] += 1e-9
    block.write(wrong)
    assert block.ask(2.0, checksum=other[1]) == 0.0
    block.call(300)
    assert (block.state(4), block.state(5), block.state(6)) == (0.0, 1.0, there[1])
    block.write(other)
    assert block.ask(2.0, checksum=other[1]) == 0.0
    block.call(300)
    assert (block.state(4), block.state(5), block.state(6)) == (1.0, 1.0, other[1])
    after, new = block.journey(names), due.journey(names)
    promise = names.index("bPromise")
    assert (after[2300, promise], new[2300, promise], after[2800, promise]) == (0.0, 1.0, 1.0)
    np.testing.assert_array_equal(after[2500:], new[2500:])
