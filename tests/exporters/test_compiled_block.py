"""The playback block, compiled by matiec and run, against replay and against the interpreter.

Collected only where the environment variables IEC2C and MATIEC_LIB name matiec's compiler and library.
"""

import os
import random
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from motions import bang_bang, quintic, target
from playing import QUANTITIES
from st_interpreter import FunctionBlock

from gen_profile_exporters.playback import structured_text
from gen_profile_exporters.playback.table import MOST_SAMPLES, tabulate

CYCLE = 0.02
MOVES = {"one": quintic((0.1, 0.4)), "rough": bang_bang(), "two": quintic((0.1, 0.4), (1.2, -0.7))}
LAYOUTS = ["segments", "samples", "counts"]
SCALARS = ("rOverride", "fCycleTime")
AXES = ("fActPosition", "fStartOffset", "fScale", "bMirror", "fStopDeceleration", "fStopJerk")
SWITCHES = ("bExecute", "bAbort", "bHold", "bContinue")
FLAGS = ("bBusy", "bDone", "bAborted", "bError", "bOffNominal")

UNREAD = {"nposition", "ftimetogo", "fdistancetogo"}

# One line of inputs in, one line of outputs out; hexadecimal floats lose nothing.
HARNESS = r"""
#include <stdio.h>
#include "POUS.h"
#include "POUS.c"
TIME __CURRENT_TIME;
BOOL __DEBUG = 0;
int main(void) {
    static FB_BAY_3 fb;
    int on;
    double value;
    FB_BAY_3_init__(&fb, 0);
    while (scanf("%d", &on) == 1) {
        SWITCHES
        REALS
        FB_BAY_3_body__(&fb);
        OUTPUTS
        printf("%d\n", __GET_VAR(fb.NERRORID,));
    }
    return 0;
}
"""


def goal_of(profile, layout):
    names = ("bridge", "trolley")[: profile.axes]
    return target(*names, cycle_time=CYCLE, export={"plc_layout": layout})


def elements(name, axes):
    """How C names an input or output of each axis."""
    return (
        [f"{name.upper()}.value.table[{k}]" for k in range(axes)] if axes > 1 else [f"{name.upper()}.value"]
    )


def harness(axes):
    switches = [f"{name.upper()}.value" for name in SWITCHES]
    reals = [f"{name.upper()}.value" for name in SCALARS] + [e for name in AXES for e in elements(name, axes)]
    issued = [e for quantity in QUANTITIES for e in elements(f"f{quantity}", axes)]
    on = '        scanf("%d", &on);\n'.join(f"        fb.{name} = on;\n" for name in switches)
    lines = {
        "SWITCHES": on,
        "REALS": "".join(f'        scanf("%lf", &value); fb.{name} = value;\n' for name in reals),
        "OUTPUTS": "".join(f'        printf("%a ", fb.{name});\n' for name in issued)
        + "".join(f'        printf("%d ", fb.{name.upper()}.value);\n' for name in FLAGS),
    }
    return re.sub(r" +(SWITCHES|REALS|OUTPUTS)\n", lambda part: lines[part[1]], HARNESS)


def compile_text(text, folder):
    library = Path(os.environ["MATIEC_LIB"])
    (folder / "block.st").write_text(text, encoding="ascii")
    subprocess.run(
        # arrays of the same bounds are of one type (-l), as Beremiz and OpenPLC call it
        [os.environ["IEC2C"], "-l", "-I", str(library), "-T", str(folder), str(folder / "block.st")],
        check=True,
        capture_output=True,
    )
    # matiec ends with 0 and an empty file on some faults.
    assert "_body__" in (folder / "POUS.c").read_text(encoding="ascii")
    return library


def compiled(text, axes, folder):
    """Compile a block; returns a function from rows of inputs to rows of outputs."""
    library = compile_text(text, folder)
    (folder / "main.c").write_text(harness(axes), encoding="ascii")
    flags = ["-O1", "-ffp-contract=off", "-w", "-I", str(library / "C"), "-o", "player", "main.c", "-lm"]
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *flags], cwd=folder, check=True)

    def call(rows):
        lines = []
        for row in rows:
            reals = [row[name] for name in SCALARS] + np.ravel([row[name] for name in AXES]).tolist()
            words = [str(int(row[name])) for name in SWITCHES] + [repr(float(value)) for value in reals]
            lines.append(" ".join(words))
        done = subprocess.run(
            [folder / "player"], input="\n".join(lines), check=True, capture_output=True, text=True
        )
        return [outputs_of(line.split(), axes) for line in done.stdout.splitlines()]

    return call


def outputs_of(words, axes):
    reals = np.array([float.fromhex(word) for word in words[: 3 * axes]]).reshape(3, axes).tolist()
    rows = {f"f{q}": values if axes > 1 else values[0] for q, values in zip(QUANTITIES, reals, strict=True)}
    flags = {name.lower(): word == "1" for name, word in zip(FLAGS, words[3 * axes : -1], strict=True)}
    return rows | flags | {"nerrorid": int(words[-1])}


def interpreted(text, rows):
    fb = FunctionBlock(text)
    outputs = [fb.call(**row) for row in rows]
    return [{name: value for name, value in row.items() if name not in UNREAD} for row in outputs]


def inputs_of(table, **given):
    axes = len(table.axes)
    row = dict.fromkeys(SWITCHES, False) | {"rOverride": 1.0, "fCycleTime": CYCLE}
    row |= {name: [0.0] * axes for name in AXES} | {"bMirror": [False] * axes, "fScale": [1.0] * axes}
    row |= {"fActPosition": table.start.tolist()} | given
    return row if axes > 1 else row | {name: row[name][0] for name in AXES}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("name", MOVES)
def test_it_plays_replay_and_agrees_with_the_interpreter(name, layout, tmp_path):
    profile, goal = MOVES[name], goal_of(MOVES[name], layout)
    text, table = structured_text.block_text(profile, goal), tabulate(profile, goal)
    run = compiled(text, profile.axes, tmp_path)
    waiting = [inputs_of(table)] * 100
    played = run([*waiting, *[inputs_of(table, bExecute=True)] * 51])[100:]
    for quantity in QUANTITIES:
        issued = np.array([row[f"f{quantity}"] for row in played]).reshape(51, -1)
        np.testing.assert_array_equal(issued + 0.0, getattr(table.played, quantity))
    assert [row["bdone"] for row in played] == [False] * 50 + [True]
    rows = waiting + scenes(table, random.Random(5))
    outputs = run(rows)
    assert outputs == interpreted(text, rows)
    assert {row["nerrorid"] for row in outputs} >= {0, 1, 2, 3, 4, 8}
    assert all(any(row[flag.lower()] for row in outputs) for flag in FLAGS)


def scenes(table, choices):
    """Random motions: starts right and wrong, holds, overrides, aborts, drops of bExecute."""
    rows = []
    for _ in range(60):
        shift = choices.choice([0.0, 0.0, 0.3])
        begin = table.start + choices.choice([shift, shift, shift + 7e-4, shift + 1e7, float("nan")])
        common = {
            "fActPosition": begin.tolist(),
            "fStartOffset": [shift] * len(table.axes),
            "fCycleTime": choices.choice([CYCLE, CYCLE, CYCLE, CYCLE, 0.01]),
            "fScale": [choices.choice([1.0, 1.0, 0.3, 1.5]) for _ in table.axes],
            "bMirror": [choices.random() < 0.3 for _ in table.axes],
            "fStopDeceleration": [choices.choice([0.0, 100.0])] * len(table.axes),
            "fStopJerk": [choices.choice([0.0, 1e4])] * len(table.axes),
        }
        rows += [inputs_of(table, **common)] * choices.randint(1, 2)
        rows += [inputs_of(table, bExecute=True, bAbort=choices.random() < 0.4, **common)]
        for _ in range(choices.choice([1, 20, 70, 120])):
            if choices.random() < 0.05:
                standing = {"bContinue": True, "fActPosition": (table.start + shift).tolist()}
                rows += [inputs_of(table, **common), inputs_of(table, **(common | standing))]
            row = inputs_of(
                table,
                bExecute=choices.random() < 0.95,
                bHold=choices.random() < 0.1,
                bAbort=choices.random() < 0.005,
                rOverride=choices.choice([1.0, 1.0, 0.5, choices.random(), float("nan")]),
                **common,
            )
            rows += [row] * choices.randint(1, 8)
    return rows


@pytest.mark.parametrize("tables", ["constants", "variables"])
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("unit", ["mm", "counts"])
def test_every_variant_compiles(unit, layout, tables, tmp_path):
    for name, axes in (("bay", ("bridge", "trolley")), ("7 IF", ("y.1", "Y 1"))):
        export = {"plc_layout": layout, "plc_tables": tables}
        goal = target(*axes, unit=unit, sign=-1, name=name, export=export)
        compile_text(structured_text.block_text(MOVES["two"], goal), tmp_path)


def test_the_longest_table_compiles(tmp_path):
    move = quintic((0.0, 1.0), duration=100.0)
    goal = target(cycle_time=0.001, export={"plc_layout": "samples"})
    assert len(tabulate(move, goal).columns[0]) == MOST_SAMPLES
    compile_text(structured_text.block_text(move, goal), tmp_path)
