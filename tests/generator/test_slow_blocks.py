"""Blocks that are sound and slow, each in a way of its own: the second verdict tells each of them."""

import attrs
import numpy as np
import pytest
from generator.mutants import judged
from generator.planned_machines import BAY
from generator.test_disobedient_blocks import around

from gen_profile.assurance.proof.habits import Change
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.lateness import Promptness
from gen_profile.assurance.proof.orders import POSITION, STOP, VELOCITY
from gen_profile.assurance.proof.promptness import FIRST, WAY
from gen_profile.planner.commands import Command
from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec

pytestmark = pytest.mark.slow

LATE, CYCLE = 8.0, 0.02  # s
# what a block does with its inputs before it looks at them
DELAYED = (
    "IF {on} THEN IF nSince < {cycles} THEN nSince := nSince + 1; {wait} END_IF; ELSE nSince := 0; END_IF;"
)
CYCLES = round(LATE / CYCLE)


def delayed(on, wait):
    return DELAYED.format(on=on, wait=wait, cycles=CYCLES), ""


MOVES = "(ABS(fVelocity) > 0.02)"
STOPS_DEAD = (
    "IF bExecute AND (fTarget <> fLast) THEN bHalts := {when}; fLast := fTarget; END_IF; "
    "IF bHalts THEN IF ABS(fVelocity) > 0.0 THEN bExecute := FALSE; nSince := 0; "
    "ELSIF nSince < 150 THEN bExecute := FALSE; nSince := nSince + 1; ELSE bHalts := FALSE; END_IF; END_IF;"
)
SLOW = {  # and of which commands that makes some late
    "targets are looked at late": (delayed("bExecute", "bExecute := FALSE;"), {FIRST, POSITION}),
    "a stick is looked at late": (delayed("bVelocity", "fVelocityCommand := 0.0;"), {VELOCITY}),
    "a stop is looked at late": (delayed("bStop", "bStop := FALSE;"), {STOP}),
    "at two fifths of the speed": (("rOverride := 0.4 * rOverride;", ""), {FIRST, POSITION, WAY}),
    "a far correction stops dead for three seconds": ((STOPS_DEAD.format(when=MOVES), ""), {WAY}),
    "corrections wait for a standstill": (
        (
            "IF bExecute AND (fTarget <> fLast) THEN IF ABS(fVelocity) > 0.0 THEN fTarget := fLast; "
            "ELSE fLast := fTarget; END_IF; END_IF;",
            "",
        ),
        {WAY},
    ),
    "a stick is followed in two steps": (
        (
            f"IF bVelocity THEN IF nSince < {2 * CYCLES} THEN nSince := nSince + 1; "
            "fVelocityCommand := 0.5 * fVelocityCommand; END_IF; ELSE nSince := 0; END_IF;",
            "",
        ),
        {VELOCITY},
    ),
    "from rest it crawls at first": (
        (
            f"IF bExecute THEN IF nSince < {3 * CYCLES} THEN nSince := nSince + 1; "
            "rOverride := 0.1 * rOverride; "
            "END_IF; ELSE nSince := 0; END_IF;",
            "",
        ),
        {FIRST, POSITION},
    ),
    "targets are looked at every six seconds": (
        (
            f"nSince := nSince + 1; IF nSince > {3 * CYCLES // 2} THEN nSince := 0; fLast := fTarget; "
            "bHalts := bExecute; END_IF; IF bExecute THEN fTarget := fLast; bExecute := bHalts; END_IF;",
            "",
        ),
        {FIRST, POSITION, WAY},
    ),
    "the last metres are crawled": (
        ("IF bExecute AND (ABS(fTarget - fPosition) < 3.0) THEN rOverride := 0.15 * rOverride; END_IF;", ""),
        {FIRST, POSITION, WAY},
    ),
}


@pytest.fixture(scope="module")
def late():
    """Tell of which kinds of commands some are late, of a block that is slow in a way, or in none."""
    spec = parse_spec(BAY, [f"export.cycle_time={CYCLE}"])
    text = around(
        planner_block(spec).text, [parts for parts, _ in SLOW.values()], "fLast : LREAL; bHalts : BOOL;"
    )
    histories = Histories.of(spec)
    (choices,) = histories.drawn(1, seed=2)
    plain = attrs.evolve(histories.history(choices), commands=COMMANDS, places=(10.0,))

    def kinds(name=None):
        number = 0.0 if name is None else 1.0 + list(SLOW).index(name)
        change = Change(time=0.0, lasts=np.inf, inputs={"fWrong": number})
        ((_, found),) = judged(spec, text, histories, [attrs.evolve(plain, changes=(change,))])
        verdict = Promptness(demanded=1.5, commands=[(0, one.asked(1.5)) for one in found.obeyed])
        assert bool(verdict.reasons()) == bool(verdict.late)
        return {one.kind for _, one in verdict.late}

    return kinds


def _command(time, command, *values):
    return Command(time=time, command=command, values=values)


COMMANDS = (
    _command(0.5, "position", 20.0),
    _command(8.0, "position", 30.0),  # on the way, far
    _command(60.0, "position", 32.0),
    _command(100.0, "stop"),
    _command(101.0, "velocity", 0.0),
    _command(102.0, "velocity", -0.6),
    _command(130.0, "stop"),
    _command(170.0, "position", 12.0),
    _command(176.0, "position", 18.0),
    _command(230.0, "position", 30.0),
    _command(236.0, "stop"),
)


def test_the_sound_block_is_prompt_in_these_histories(late):
    assert late() == set()


@pytest.mark.parametrize("name", SLOW)
def test_a_slow_block_is_told(late, name):
    assert late(name) & SLOW[name][1]
