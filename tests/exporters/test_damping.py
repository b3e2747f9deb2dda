"""When the planner damps what a sensor shows: the block that decides it, alone."""

import numpy as np
import pytest

from gen_profile.planner.execution import BlockInstance
from gen_profile_exporters.planner.blocks.texts import LITTLE, filled

FROM, TO = 0.035, 0.0135  # m


@pytest.fixture
def decides():
    """Give forgetting, whether it is measured and what is left, slot by slot, to whether it is damped."""
    constants = f"cDampsFrom : LREAL := {FROM}; cDampsTo : LREAL := {TO};"
    block = BlockInstance(
        filled("damping", damping="Damping", damping_constants=constants, calm_slots=LITTLE)
    )

    def played(*slots):
        rows = [dict(zip(block.inputs, (*slot, 0.0), strict=True)) for slot in slots]
        assert list(rows[0])[:3] == ["bForget", "bMeasured", "fSlow"]
        issued = block.call(np.array([list(row.values()) for row in rows]))
        return issued[:, list(block.outputs).index("bUncalm")].tolist()

    return played


def test_what_swings_much_is_damped_to_little_and_then_left(decides):
    assert decides((0.0, 1.0, 0.03), (0.0, 1.0, 0.036), (0.0, 1.0, 0.03), (0.0, 1.0, 0.013)) == [0, 1, 1, 0]
    assert decides((0.0, 1.0, 0.02)) == [1]  # so soon again
    assert sum(decides(*LITTLE * [(0.0, 1.0, 0.01)], (0.0, 1.0, 0.03))) == 0


def test_it_does_not_hunt_at_a_sway_that_comes_again_and_again(decides):
    left = decides((0.0, 1.0, 0.05), *400 * [(0.0, 1.0, 0.03)])
    assert left[100] == 1.0 and not any(left[200:])


def test_what_is_not_measured_or_forgotten_is_not_damped(decides):
    assert decides((0.0, 1.0, 0.05), (0.0, 0.0, 0.05), (0.0, 1.0, 0.02)) == [1, 0, 1]
    decides((1.0, 1.0, 0.0))
    assert decides((0.0, 1.0, 0.02)) == [0]
