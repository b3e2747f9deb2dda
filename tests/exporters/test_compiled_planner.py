"""The planner block, compiled by matiec and run, against the block's own compiled form.

Collected only where the environment variables IEC2C and MATIEC_LIB name matiec's compiler and library.
"""

import subprocess
import sys

import numpy as np
from test_compiled_block import HARNESS, compile_text
from test_planner_forms import SPEC, planner_commands

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance


def played(text, inputs, outputs, rows, folder):
    """Outputs of a block that matiec compiled, cycle by cycle."""
    library = compile_text(text, folder)
    read = "".join(f'scanf("%lf", &value); fb.{name.upper()}.value = value;\n' for name in inputs)
    written = "".join(f'printf("%a ", (double) fb.{name.upper()}.value);\n' for name in outputs)
    source = HARNESS.replace("FB_BAY_3", "FB_BAY_3_PLANNER").replace("__GET_VAR(fb.NERRORID,)", "0")
    for name, part in {"SWITCHES": "", "REALS": read, "OUTPUTS": written}.items():
        source = source.replace(f"        {name}\n", part)
    (folder / "main.c").write_text(source, encoding="ascii")
    flags = ["-O1", "-ffp-contract=off", "-w", "-I", str(library / "C"), "-o", "player", "main.c", "-lm"]
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *flags], cwd=folder, check=True)
    lines = "\n".join(" ".join(map(repr, (1, *row))) for row in rows.tolist())
    done = subprocess.run([folder / "player"], input=lines, check=True, capture_output=True, text=True)
    return [[*map(float.fromhex, line.split()[: len(outputs)])] for line in done.stdout.splitlines()]


def test_matiec_s_planner_issues_the_same_bits(tmp_path):
    text = planner_block(SPEC).text
    oracle = BlockInstance(text)
    rows = np.concatenate(list(planner_commands(oracle.inputs)))
    assert played(text, oracle.inputs, oracle.outputs, rows, tmp_path) == oracle.call(rows).tolist()
