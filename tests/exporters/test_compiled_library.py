"""A library's block, compiled by matiec and run, against the blocks of its motions and the interpreter.

Collected only where the environment variables IEC2C and MATIEC_LIB name matiec's compiler and library.
"""

import subprocess
import sys

import numpy as np
import pytest
from motions import quintic, target
from playing import checked, play, start
from st_interpreter import FunctionBlock
from test_compiled_block import (
    AXES,
    FLAGS,
    HARNESS,
    LAYOUTS,
    SCALARS,
    SWITCHES,
    UNREAD,
    compile_text,
    elements,
    outputs_of,
)
from test_profile_library import DURATIONS, blocks, goal_of, together

from gen_profile_exporters.playback import structured_text
from gen_profile_exporters.playback.table import MOST_SAMPLES


def compiled(text, axes, folder):
    """Compile a library; returns a function from rows of inputs to rows of outputs."""
    library = compile_text(text, folder)
    reals = [f"{name.upper()}.value" for name in SCALARS] + [e for name in AXES for e in elements(name, axes)]
    issued = [e for q in ("fPosition", "fVelocity", "fAcceleration") for e in elements(q, axes)]
    reads = ['scanf("%d", &on);\n'.join(f"fb.{name.upper()}.value = on;\n" for name in SWITCHES)]
    reads += ['scanf("%d", &on); fb.NPROFILE.value = on;\n']
    parts = {
        "SWITCHES": "".join(reads),
        "REALS": "".join(f'scanf("%lf", &value); fb.{name} = value;\n' for name in reals),
        "OUTPUTS": "".join(f'printf("%a ", fb.{name});\n' for name in issued)
        + "".join(f'printf("%d ", fb.{name.upper()}.value);\n' for name in FLAGS),
    }
    source = HARNESS
    for name, part in parts.items():
        source = source.replace(f"        {name}\n", part)
    (folder / "main.c").write_text(source, encoding="ascii")
    flags = ["-O1", "-ffp-contract=off", "-w", "-I", str(library / "C"), "-o", "player", "main.c", "-lm"]
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *flags], cwd=folder, check=True)

    def call(rows):
        lines = []
        for row in rows:
            given = [row[name] for name in SCALARS] + [v for name in AXES for v in row[name]]
            given = [repr(float(value)) for value in given]
            words = [*(str(int(row[name])) for name in SWITCHES), str(row["nProfile"]), *given]
            lines.append(" ".join(words))
        done = subprocess.run(
            [folder / "player"], input="\n".join(lines), check=True, capture_output=True, text=True
        )
        return [outputs_of(line.split(), axes) for line in done.stdout.splitlines()]

    return call


def inputs(number, starts, **given):
    axes = len(starts[0])
    row = dict.fromkeys(SWITCHES, False) | {"rOverride": 1.0, "fCycleTime": 0.02}
    row |= {name: [0.0] * axes for name in AXES} | {"bMirror": [False] * axes, "fScale": [1.0] * axes}
    return row | {"fActPosition": starts[number % len(starts)], "nProfile": number} | given


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("axes", [1, 2])
def test_every_motion_plays_as_its_own_block_and_as_interpreted(layout, axes, tmp_path):
    texts = blocks(goal_of(layout, axes))
    text = together(texts, goal_of(layout, axes))
    starts = [np.ravel(FunctionBlock(own)["cStart"]).tolist() for own in texts]
    rows, spans = [], []
    for number in (2, 0, 3, 1, 4, 2):
        rows += [inputs(number, starts)] * 100
        spans.append((number, len(rows)))
        rows += [inputs(number, starts, bExecute=True)] * 72
    outputs = compiled(text, axes, tmp_path)(rows)
    fb = FunctionBlock(text)
    for row, found in zip(rows, outputs, strict=True):
        given = row if axes > 1 else row | {name: row[name][0] for name in AXES}
        due = fb.call(**given)
        assert found == {name: value for name, value in due.items() if name not in UNREAD}
    for number, at in spans:
        if number == 4:
            assert outputs[at]["nerrorid"] == 6
            continue
        own = checked(texts[number])
        for found, due in zip(outputs[at:], play(own, start(own)), strict=False):
            assert found == {name: value for name, value in due.items() if name not in UNREAD}
        assert outputs[at + round(DURATIONS[number] / 0.02)]["bdone"]


def test_the_largest_library_compiles(tmp_path):
    goal = target(cycle_time=0.001, export={"plc_layout": "samples"})
    text = structured_text.block_text(quintic((0.0, 1.0), duration=1.0), goal)
    count = MOST_SAMPLES // 1001
    library = together([text] * count, goal)
    assert f"cProfiles : DINT := {count};" in library
    compile_text(library, tmp_path)
