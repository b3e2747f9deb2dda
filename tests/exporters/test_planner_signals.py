"""The planner block's signals, by the rules of PLCopen Motion Control Part 1 (2.0, section 2.4).

`RULES` are those of the standard, `DEVIATIONS` what the block does otherwise; `docs/planner.md` lists both.
A step gives inputs, cycles, and what shows in each of them: a letter for each output that is TRUE. ``B>D``
goes on until D shows, with B before.
"""

import re

import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting
from exporters.driven_block import BAY

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec

pytestmark = pytest.mark.slow

SHOWN = {"B": "bBusy", "D": "bDone", "A": "bCommandAborted", "E": "bError", "V": "bInVelocity"}
START, MOST = 10.0, 20_000
MOVE = {"bExecute": 1, "fTarget": 12.0}
OTHER = {"bExecute": 1, "fTarget": 8.0}
NOWHERE = {"bExecute": 1, "fTarget": 99.0}
LOW, STOP, GO_ON = {"bExecute": 0}, {"bStop": 1}, {}
STICK, DEFLECTED = {"bVelocity": 1, "fVelocityCommand": 0.0}, {"fVelocityCommand": 0.3}
RULES = {
    "Busy from the rising edge of Execute on, until Done; Done as long as Execute": [
        (MOVE, 1, "B"),
        (GO_ON, 1, "B>D"),
        (GO_ON, 200, "D"),
        (LOW, 200, ""),
    ],
    "One of Busy, Done, Error and CommandAborted at a time, while a motion goes to its end": [
        (MOVE, 1, "B>D"),
        (LOW, 1, ""),
        (OTHER, 1, "B>D"),
    ],
    "A falling edge of Execute does not stop the motion, and Done then lasts for a cycle": [
        (MOVE, 1, "B"),
        (LOW, 1, "B>D"),
        (GO_ON, 200, ""),
    ],
    "Inputs are taken over with the edge: later ones are not": [
        (MOVE, 1, "B"),
        ({"fTarget": 30.0}, 1, "B>D"),
        ({"fTarget": 5.0}, 200, "D"),
    ],
    "A target that is reached already is Done at once": [({"bExecute": 1, "fTarget": START}, 50, "D")],
    "CommandAborted by another command, and as long as Execute": [
        (MOVE, 200, "B"),
        (STICK, 20, "BA"),
        (LOW, 20, "B"),
    ],
    "Done of a command that was interrupted does not come": [
        (MOVE, 200, "B"),
        (STOP, 50, "BA"),
        (GO_ON, 1, "BA>A"),
        (GO_ON, 50, "A"),
        (LOW, 50, ""),
    ],
    "An axis that is stopping takes no other command": [
        (MOVE, 200, "B"),
        (LOW, 1, "B"),
        (STOP, 1, "BA"),
        (GO_ON, 10, "B"),
        (OTHER, 10, "BA"),
        (LOW, 1, "B>"),
        (OTHER, 50, "A"),
        (LOW, 1, ""),
        ({"bStop": 0}, 1, ""),
        (OTHER, 1, "B>D"),
    ],
    "Error and its number with the cycle that finds it, until Execute falls": [
        (NOWHERE, 50, "AE"),
        (LOW, 1, ""),
        (MOVE, 1, "B>D"),
    ],
    "An error of the axis lasts until it is reset, and no command is taken before": [
        (MOVE, 200, "B"),
        ({"rOverride": -1.0}, 1, "B>BAE"),
        ({"rOverride": 1.0}, 1, "BAE>AE"),
        (LOW, 50, "E"),
        (MOVE, 50, "AE"),
        (LOW, 1, "E"),
        ({"bReset": 1}, 1, ""),
        ({"bReset": 0} | MOVE, 1, "B>D"),
    ],
    "InVelocity where the velocity is that of the command, and no longer": [
        (STICK, 1, "V"),
        (DEFLECTED, 1, "B>BV"),
        (GO_ON, 50, "BV"),
        ({"fVelocityCommand": 0.2}, 1, "B>BV"),
    ],
    "InVelocity ends with CommandAborted": [
        (STICK, 1, "V"),
        (DEFLECTED, 1, "B>BV"),
        (STOP, 50, "BA"),
        ({"bVelocity": 0}, 1, "B>"),
    ],
    "A velocity limit is positive or 0, a position may be either": [
        ({"fVelocityLimit": -0.1}, 1, ">E"),
        ({"fVelocityLimit": 0.0}, 1, "E>"),
        ({"bExecute": 1, "fTarget": -1.0}, 1, "AE"),
    ],
}
DEVIATIONS = {
    "Busy is the axis's: it shows beside CommandAborted and Error until the axis stands": [
        (MOVE, 300, "B"),
        (STOP, 100, "BA"),
        (GO_ON, 1, "BA>A"),
    ],
    "Busy does not show where a stick keeps the axis standing": [(STICK, 100, "V")],
    "CommandAborted shows beside Error: that a command ended, and why": [
        (MOVE, 300, "B"),
        (LOW, 1, "B"),
        (NOWHERE, 100, "BAE"),
        (LOW, 1, "B>"),
    ],
    "A new target before the former one is reached: CommandAborted for a cycle, beside Busy": [
        (MOVE, 300, "B"),
        (LOW, 1, "B"),
        (OTHER, 1, "BA"),
        (GO_ON, 1, "B>D"),
    ],
    "The same target again, before it is reached, is no new command": [
        (MOVE, 300, "B"),
        (LOW, 1, "B"),
        (MOVE, 1, "B>D"),
    ],
    "Done ends where another command begins, though Execute stays": [
        (MOVE, 1, "B>D"),
        (STOP, 50, ""),
    ],
    "A stop has no Done: Busy falls": [(MOVE, 300, "B"), (LOW, 1, "B"), (STOP, 1, "BA"), (GO_ON, 1, "B>")],
    "Velocity, stop, quick stop and reset are levels, not edges": [
        (STICK, 1, "V"),
        (DEFLECTED, 1, "B>BV"),
        ({"bVelocity": 0}, 1, "B>"),
        ({"bReset": 1}, 50, ""),
        (NOWHERE, 1, "AE"),
        (GO_ON, 50, "A"),
        (LOW, 1, ""),
    ],
    "A target beside a stick is an error, and the axis stops": [
        (STICK, 1, "V"),
        (DEFLECTED, 1, "B>BV"),
        (MOVE, 50, "BAE"),
        (LOW, 50, "BAE"),
        ({"bVelocity": 0}, 1, "B>"),
    ],
    "Execute without Enable is not answered": [({"bEnable": 0}, 1, ""), (MOVE, 50, ""), (LOW, 1, "")],
}
STATES = {  # of the standard's diagram, and how the axis gets there
    "Disabled": [({"bEnable": 0}, 50)],
    "Standstill": [],
    "DiscreteMotion": [({"bExecute": 1, "fTarget": 20.0}, 800), (LOW, 1)],
    "ContinuousMotion": [(STICK, 1), (DEFLECTED, 2000)],
    "Stopping": [(MOVE, 800), (LOW, 1), (STOP, 1)],
    "ErrorStop": [(MOVE, 300), (LOW, 1), ({"rOverride": -1.0}, 60), ({"rOverride": 1.0}, 1)],
}
COMMANDS = {
    "position": [({"bExecute": 1, "fTarget": 9.0}, 1)],
    "position, stick let go": [({"bVelocity": 0, "bExecute": 1, "fTarget": 9.0}, 1)],
    "stick": [({"bExecute": 0} | STICK, 1), (DEFLECTED, 1)],
    "stop": [(STOP, 1)],
    "quick stop": [({"bQuickStop": 1}, 1), ({"bQuickStop": 0}, 1)],
    "reset": [({"bReset": 1}, 1), ({"bReset": 0}, 1)],
    "disable": [({"bEnable": 0}, 1)],
}
BECOMES = {  # by the diagram; and after * what the block does otherwise
    "Disabled": "off off off off off off off",
    "Standstill": "there there moves stands stands stands off",
    "DiscreteMotion": "there there moves stands stands arrives off",
    "ContinuousMotion": "*stands there moves stands stands moves off",
    "Stopping": "stands stands stands stands stands stands off",
    "ErrorStop": "error error error error error stands off",
}


class Signals:
    """A block, and what it shows."""

    def __init__(self, text):
        self.block = CountedBlock(compile_counting(text), bEnable=0.0, fActPosition=START)
        self.play({}, 1)
        self.play({"bEnable": 1}, 600)

    def play(self, inputs, cycles):
        self.block.inputs |= {name: float(value) for name, value in inputs.items()}
        return self.block.play_on(cycles)

    def shows(self, inputs, cycles):
        """Letters of each cycle."""
        issued = self.play(inputs, cycles)
        rows = zip(*(issued[name] > 0.0 for name in SHOWN.values()), strict=True)
        assert ((issued["nErrorId"] > 0.0) == (issued["bError"] > 0.0)).all()
        return ["".join(letter for letter, on in zip(SHOWN, row, strict=True) if on) for row in rows]

    def step(self, inputs, cycles, shown):
        before, until, after = shown.partition(">")
        if not until:
            assert {*self.shows(inputs, cycles)} == {before}
            return
        (now,) = self.shows(inputs, 1)
        for _ in range(MOST):
            if now == after:
                return
            assert now == before
            (now,) = self.shows({}, 1)
        raise AssertionError(f"it never shows {after!r}")


@pytest.fixture(scope="module")
def text():
    return planner_block(parse_spec(BAY)).text


@pytest.mark.parametrize("rule", [*RULES, *DEVIATIONS])
def test_signals_are_those_of_the_table(text, rule):
    signals = Signals(text)
    for step in {**RULES, **DEVIATIONS}[rule]:
        signals.step(*step)


def test_the_page_lists_each_rule_and_each_deviation(request):
    page = (request.config.rootpath / "docs/planner.md").read_text("utf-8")
    listed = re.findall(r"(?m)^\| (.*?) \| (yes|no: .*?) \|$", page)
    assert [rule for rule, kept in listed if kept == "yes"] == [*RULES]
    assert [rule for rule, kept in listed if kept != "yes"] == [*DEVIATIONS]


@pytest.mark.parametrize("state", STATES)
def test_commands_lead_from_state_to_state_as_in_the_diagram(text, state):
    for (command, steps), becomes in zip(COMMANDS.items(), BECOMES[state].split(), strict=True):
        signals = Signals(text)
        for inputs, cycles in [*STATES[state], *steps]:
            signals.play(inputs, cycles)
        assert found(signals.play({}, 6000)) == becomes.removeprefix("*"), command


def found(issued):
    """What has become of the axis."""
    last = {name: values[-1] for name, values in issued.items()}
    if not last["bEnabled"]:
        return "off"
    if last["bError"] and last["nErrorId"] != 6.0:
        return "error"
    if last["bInVelocity"]:
        return "moves"
    assert last["fVelocity"] == 0.0
    return {9.0: "there", 20.0: "arrives"}.get(last["fPosition"], "stands")


def test_what_lasts_as_long_as_a_level_lasts_in_any_history(text):
    """Done never beside Busy or Error; CommandAborted and Done no longer than their command's input."""
    random = np.random.default_rng(8)
    signals, over = Signals(text), 0
    for _ in range(300):
        inputs = {
            "bExecute": random.integers(2),
            "bVelocity": random.random() < 0.2,
            "bStop": random.random() < 0.15,
            "bQuickStop": random.random() < 0.05,
            "bReset": random.random() < 0.5,
            "fTarget": random.choice([START, 12.0, 13.0, 99.0]),
            "fVelocityCommand": random.choice([0.0, 0.2, -0.2]),
            "rOverride": random.choice([1.0, 1.0, 0.5, 0.0]),
        }
        shown = signals.shows(inputs, int(random.choice([1, 2, 50, 1500])))
        assert not [one for one in shown if "D" in one and {*"BE"} & {*one}]
        if not inputs["bExecute"] and not inputs["bVelocity"]:
            assert not [one for one in shown[1:] if "A" in one and one != shown[0]]
            over += "A" in "".join(shown)
    assert over
