"""The whole block of the folder of blocks, compiled by matiec, against the block's own compiled form.

Collected only where the environment variables IEC2C and MATIEC_LIB name matiec's compiler and library;
WHOLE_BLOCK_CYCLES asks for another number of random cycles.
"""

import os

import numpy as np
from test_compiled_planner import played
from test_whole_block import random_rows, whole_text

from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import preset_spec

CYCLES = int(os.environ.get("WHOLE_BLOCK_CYCLES", "30000"))


def test_matiec_s_whole_block_issues_the_same_bits(tmp_path):
    text = whole_text(preset_spec("bay-crane", ["planner.zones=true", "planner.events=true"]))
    oracle = BlockInstance(text)
    rows = random_rows(oracle.inputs, CYCLES, seed=19)
    due = oracle.call(rows)
    assert np.array_equal(np.array(played(text, oracle.inputs, oracle.outputs, rows, tmp_path)), due)
    assert len(np.unique(due[:, oracle.outputs.index("nErrorId")])) > 4
    assert np.ptp(due[:, oracle.outputs.index("fPosition")]) > 5.0
