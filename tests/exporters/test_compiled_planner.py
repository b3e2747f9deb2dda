"""The planner block, compiled by matiec and run, against the block's own compiled form.

Collected only where the environment variables IEC2C and MATIEC_LIB name matiec's compiler and library;
WHOLE_BLOCK_CYCLES asks for another number of random cycles.
"""

import os
import re
import subprocess
import sys

import numpy as np
from test_compiled_block import HARNESS, compile_text
from test_planner_forms import SPEC, planner_commands
from test_planner_parameters import CHANGES, Block, source_of
from test_whole_block import random_rows

from gen_profile.planner.design import planner_block
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.forms import block_files
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.planner.parameters import buffered_planner
from gen_profile_exporters.playback.buffers import buffer_texts

CYCLES = int(os.environ.get("WHOLE_BLOCK_CYCLES", "30000"))


def played(text, inputs, outputs, rows, folder):
    """Outputs of a block that matiec compiled, cycle by cycle."""
    library = compile_text(text, folder)
    places = {name: f"fb.{name.upper()}.value".replace("].value", "]") for name in (*inputs, *outputs)}
    places = {name: place.replace("[", ".value.table[") for name, place in places.items()}
    read = "".join(f'scanf("%lf", &value); {places[name]} = value;\n' for name in inputs)
    written = "".join(f'printf("%a ", (double) {places[name]});\n' for name in outputs)
    source = HARNESS.replace("FB_BAY_3", parse_function_block(text).name.upper()).replace(
        "__GET_VAR(fb.NERRORID,)", "0"
    )
    for name, part in {"SWITCHES": "", "REALS": read, "OUTPUTS": written}.items():
        source = source.replace(f"        {name}\n", part)
    (folder / "main.c").write_text(source, encoding="ascii")
    flags = ["-O1", "-ffp-contract=off", "-w", "-I", str(library / "C"), "-o", "player", "main.c", "-lm"]
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *flags], cwd=folder, check=True)
    lines = "\n".join(" ".join(map(repr, (1, *row))) for row in rows.tolist())
    done = subprocess.run([folder / "player"], input=lines, check=True, capture_output=True, text=True)
    return [[*map(float.fromhex, line.split()[: len(outputs)])] for line in done.stdout.splitlines()]


def test_matiec_s_planner_issues_the_same_bits(tmp_path):
    text = planner_block(preset_spec("bay-crane", ["planner.zones=true", "planner.events=true"])).text
    oracle = BlockInstance(text)
    rows = random_rows(oracle.inputs, CYCLES, seed=19)
    due = oracle.call(rows)
    assert np.array_equal(np.array(played(text, oracle.inputs, oracle.outputs, rows, tmp_path)), due)
    assert len(np.unique(due[:, oracle.outputs.index("nErrorId")])) > 4
    assert np.ptp(due[:, oracle.outputs.index("fPosition")]) > 5.0


class Recorded(Block):
    """One that keeps what it was given and issued."""

    def __init__(self, source):
        super().__init__(source)
        self.rows, self.issued = [], []

    def call(self, cycles, **inputs):
        self.issued.append(super().call(cycles, **inputs))
        self.rows.append(np.tile([*self.given.values()], (cycles, 1)))
        return self.issued[-1]


def test_matiec_s_planner_takes_other_numbers_and_issues_the_same_bits(tmp_path):
    changed, usual = (buffered_planner(source_of(*changes)) for changes in (CHANGES, ()))
    numbers = np.array(list(map(float, buffer_texts(usual))))
    block = Recorded(changed)
    block.journey([])
    block.call(10, bEnable=0.0, fActVelocity=0.0)
    block.write(numbers)
    assert block.ask(2.0, checksum=numbers[1]) == 0.0
    block.call(300)
    assert block.state(6) == numbers[1]
    block.journey([])
    rows, issued = (np.concatenate(parts) for parts in (block.rows, block.issued))
    assert played(changed.text(), block.given, block.places, rows, tmp_path) == issued.tolist()


# As a runtime does: what has an address is set and read, and the configuration is run once in every cycle.
RUNTIME = r"""
#include <stdio.h>
#include "iec_std_lib.h"
#define __LOCATED_VAR(type, name, ...) type at##name; type *name = &at##name;
#include "LOCATED_VARIABLES.h"
#undef __LOCATED_VAR
TIME __CURRENT_TIME;
BOOL __DEBUG = 0;
extern unsigned long long common_ticktime__;
void config_init__(void);
void config_run__(unsigned long tick);
int main(void) {
    unsigned long tick = 0;
    int on;
    double value;
    config_init__();
    printf("%llu\n", common_ticktime__);
    while (scanf("%d", &on) == 1) {
        GIVEN
        config_run__(tick++);
        ISSUED
        printf("\n");
    }
    return 0;
}
"""


def test_the_openplc_project_runs_as_its_task_and_issues_the_same_bits(tmp_path):
    block = planner_block(SPEC)
    (file,) = block_files(block, SPEC, ["openplc"])
    text = file.content.decode("ascii")
    assert block.text in text
    places = {
        name: f"*__{area}{place.replace('.', '_')}"
        for name, area, place in re.findall(r"(\w+) AT %(\w\w)([\d.]+) :", text)
    }
    oracle = BlockInstance(block.text)
    assert places.keys() == {*oracle.inputs, *oracle.outputs} - {"fCycleTime"} | {"nCycle"}
    assert len({*places.values()}) == len(places)
    library = compile_text(text, tmp_path)
    given = "".join(
        f'scanf("%lf", &value); {f"{places[name]} = value" if name in places else ""};\n'
        for name in oracle.inputs
    )
    issued = "".join(f'printf("%a ", (double) {places[name]});\n' for name in oracle.outputs)
    source = RUNTIME.replace("        GIVEN\n", given).replace("        ISSUED\n", issued)
    (tmp_path / "main.c").write_text(source, encoding="ascii")
    sources = ["main.c", "Config0.c", "Res0.c"]
    flags = ["-O1", "-ffp-contract=off", "-w", "-I", str(library / "C"), "-I.", "-o", "plc", *sources, "-lm"]
    subprocess.run([sys.executable, "-m", "ziglang", "cc", *flags], cwd=tmp_path, check=True)
    rows = np.concatenate(list(planner_commands(oracle.inputs)))
    rows = np.concatenate([rows, np.repeat(rows[-1:], 10_000 - len(rows), axis=0)])
    lines = "\n".join(" ".join(map(repr, (1, *row))) for row in rows.tolist())
    done = subprocess.run([tmp_path / "plc"], input=lines, check=True, capture_output=True, text=True)
    tick, *lines = done.stdout.splitlines()
    assert int(tick) == 4_000_000  # ns
    assert [[*map(float.fromhex, line.split())] for line in lines] == oracle.call(rows).tolist()
