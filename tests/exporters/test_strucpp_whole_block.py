"""The planner block, compiled by STruC++, against the block's own compiled form.

Collected only where the environment variable STRUCPP names the folder of STruC++ (with ``dist`` and
its runtime); WHOLE_BLOCK_CYCLES asks for another number of random cycles.
"""

import os
import subprocess
from pathlib import Path

import numpy as np
from system_parts import program
from test_whole_block import random_rows

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.st_to_c import translate

CYCLES = int(os.environ.get("WHOLE_BLOCK_CYCLES", "30000"))
HARNESS = r"""
#include "block.hpp"
#include <cstdio>
int main() {
    static strucpp::BLOCK fb;
    double value;
    while (true) {
        READ
        fb();
        WRITTEN
    }
}
"""


def played(text, rows, folder):
    """Outputs of a block, cycle by cycle: doubles in, doubles out."""
    tool, own = Path(os.environ["STRUCPP"]), translate(text)
    (folder / "block.st").write_text(text, encoding="ascii")
    cli = [
        program("node", "nodejs"),
        tool / "dist/node/cli.js",
        folder / "block.st",
        "-o",
        folder / "block.cpp",
    ]
    subprocess.run([*cli, "--no-default-libs"], check=True, capture_output=True)
    read = "".join(
        f"if (std::fread(&value, 8, 1, stdin) != 1) return 0; fb.{v.name.upper()} = value;\n"
        for v in own.inputs
    )
    written = "".join(
        f"value = fb.{v.name.upper()}; std::fwrite(&value, 8, 1, stdout);\n" for v in own.outputs
    )
    source = HARNESS.replace("BLOCK", own.name.upper()).replace("READ", read).replace("WRITTEN", written)
    (folder / "main.cpp").write_text(source, encoding="ascii")
    flags = ["-std=c++17", "-O1", "-ffp-contract=off", "-w", "-I", tool / "src/runtime/include"]
    command = [program("g++", "g++"), *flags, "main.cpp", "block.cpp", "-o", "player"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run([folder / "player"], input=rows.tobytes(), check=True, capture_output=True)
    return np.frombuffer(done.stdout).reshape(len(rows), -1)


def test_strucpp_s_whole_block_issues_the_same_bits(tmp_path):
    text = planner_block(preset_spec("bay-crane", ["planner.zones=true", "planner.events=true"])).text
    oracle = BlockInstance(text)
    rows = random_rows(oracle.inputs, CYCLES, seed=23)
    assert np.array_equal(played(text, rows, tmp_path), oracle.call(rows))
