"""The playback block, compiled by matiec and run, against replay and against the interpreter.

Collected only where the environment variables IEC2C and MATIEC_LIB name matiec's compiler and library.
"""

import os
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from motions import quintic, target
from st_interpreter import FunctionBlock

from gen_profile.profile import sample
from gen_profile_exporters import structured_text

MOVE = quintic((0.1, 0.4))
CYCLE = 0.02
INPUTS = ("bExecute", "bAbort", "fCycleTime", "fActPosition", "fStopDeceleration")
REALS = ("fposition", "fvelocity", "facceleration")
FLAGS = ("bbusy", "bdone", "baborted", "berror")
START = {
    "bExecute": True,
    "bAbort": False,
    "fCycleTime": CYCLE,
    "fActPosition": 0.1,
    "fStopDeceleration": 2.0,
}

# One line of inputs in, one line of outputs out; hexadecimal floats lose nothing.
HARNESS = r"""
#include <stdio.h>
#include "POUS.h"
#include "POUS.c"
TIME __CURRENT_TIME;
BOOL __DEBUG = 0;
int main(void) {
    static FB_BAY_3 fb;
    int execute, abort_;
    double cycle, position, deceleration;
    FB_BAY_3_init__(&fb, 0);
    while (scanf("%d %d %lf %lf %lf", &execute, &abort_, &cycle, &position, &deceleration) == 5) {
        __SET_VAR(fb., BEXECUTE,, execute);
        __SET_VAR(fb., BABORT,, abort_);
        __SET_VAR(fb., FCYCLETIME,, cycle);
        __SET_VAR(fb., FACTPOSITION,, position);
        __SET_VAR(fb., FSTOPDECELERATION,, deceleration);
        FB_BAY_3_body__(&fb);
        printf("%a %a %a %d %d %d %d %d\n",
            __GET_VAR(fb.FPOSITION,), __GET_VAR(fb.FVELOCITY,), __GET_VAR(fb.FACCELERATION,),
            __GET_VAR(fb.BBUSY,), __GET_VAR(fb.BDONE,), __GET_VAR(fb.BABORTED,), __GET_VAR(fb.BERROR,),
            __GET_VAR(fb.NERRORID,));
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def text():
    return structured_text.encode(MOVE, target(cycle_time=CYCLE))[0].content.decode("ascii")


@pytest.fixture(scope="module")
def run(text, tmp_path_factory):
    """Compile the block; returns a function from input rows to output rows."""
    folder = tmp_path_factory.mktemp("matiec")
    library = Path(os.environ["MATIEC_LIB"])
    compile_text(text, folder, library)
    (folder / "main.c").write_text(HARNESS, encoding="ascii")
    flags = ["-O1", "-ffp-contract=off", "-w", "-I", str(library / "C"), "-o", "player", "main.c", "-lm"]
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *flags], cwd=folder, check=True)

    def call(rows):
        lines = "".join(
            f"{row['bExecute']:d} {row['bAbort']:d} "
            + " ".join(repr(float(row[name])) for name in INPUTS[2:])
            + "\n"
            for row in rows
        )
        done = subprocess.run([folder / "player"], input=lines, check=True, capture_output=True, text=True)
        return [outputs_of(line.split()) for line in done.stdout.splitlines()]

    return call


def compile_text(text, folder, library):
    (folder / "block.st").write_text(text, encoding="ascii")
    subprocess.run(
        [os.environ["IEC2C"], "-I", str(library), "-T", str(folder), str(folder / "block.st")],
        check=True,
        capture_output=True,
    )
    # matiec ends with 0 and an empty file on some faults.
    assert "_body__" in (folder / "POUS.c").read_text(encoding="ascii")


def outputs_of(words):
    reals = dict(zip(REALS, map(float.fromhex, words[:3]), strict=True))
    flags = dict(zip(FLAGS, (word == "1" for word in words[3:7]), strict=True))
    return reals | flags | {"nerrorid": int(words[7])}


def interpreted(text, rows):
    fb = FunctionBlock(text)
    return [fb.call(**row) for row in rows]


def test_plays_bit_for_bit_what_replay_says(run, text):
    motion = structured_text.replay(text.encode("ascii"), target())
    played = run([START] * 51)
    for name in REALS:
        np.testing.assert_array_equal([row[name] for row in played], getattr(motion, name[1:])[:, 0])
    assert [row["bdone"] for row in played] == [False] * 50 + [True]


def test_agrees_with_the_interpreter_whatever_the_inputs(run, text):
    choices = random.Random(5)
    rows = []
    for _ in range(40):
        position = choices.choice([0.1, 0.1, 0.1, 0.4, float("nan")])
        start = START | {
            "fActPosition": position,
            "fStopDeceleration": choices.choice([0.5, 2.0, 1e3, 0.0]),
            "fCycleTime": choices.choice([CYCLE, CYCLE, CYCLE, 0.01]),
        }
        rows += [start | {"bExecute": False}] * choices.randint(1, 2)
        rows += [start | {"bAbort": choices.random() < 0.3}] * choices.choice([1, 20, 40, 70])
        rows += [start | {"bAbort": True, "bExecute": choices.random() < 0.5}] * choices.randint(0, 60)
    outputs = run(rows)
    assert outputs == interpreted(text, rows)
    assert {row["nerrorid"] for row in outputs} == {0, 1, 2, 3, 4}
    assert all(any(row[flag] for row in outputs) for flag in FLAGS)


@pytest.mark.parametrize("unit", ["mm", "counts"])
def test_every_variant_compiles(unit, tmp_path):
    moves = quintic((0.1, 0.4), (1.2, -0.7))
    for name, axes in (("bay", ("bridge", "trolley")), ("7 IF", ("y.1", "Y 1"))):
        goal = target(*axes, unit=unit, sign=-1, name=name)
        text = structured_text.encode(moves, goal)[0].content.decode("ascii")
        compile_text(text, tmp_path, Path(os.environ["MATIEC_LIB"]))


def test_the_longest_table_compiles(tmp_path):
    move = quintic((0.0, 1.0), duration=100.0)
    text = structured_text.encode(move, target(cycle_time=0.001))[0].content.decode("ascii")
    assert len(sample(move, 0.001).position) == structured_text.MOST_SAMPLES
    compile_text(text, tmp_path, Path(os.environ["MATIEC_LIB"]))
