"""How loads that do not hang on ropes sway over a slot, beside matrix exponentials of the machine's modes."""

import numpy as np
import pytest
from scipy.linalg import expm
from test_planner_sensor import JOINT, TANK

from gen_profile.planner.design import planner_constants
from gen_profile.planner.directions import driven_modes, linearized
from gen_profile.planner.execution import BlockInstance
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.planner.blocks.followed import account_texts
from gen_profile_exporters.planner.blocks.sizes import ENDS, LEFT_OUT, between, terms

MACHINES = {"flexible-joint": [*JOINT, "plant.c=0.04"], "slosh-tank": TANK}
CALLED = """FUNCTION_BLOCK Called
VAR_INPUT fTime : LREAL; END_VAR
VAR_OUTPUT
    aSame : ARRAY [0..{turn}] OF LREAL; aOther : ARRAY [0..{turn}] OF LREAL;
    aPush : ARRAY [0..{push}] OF LREAL; aRead : ARRAY [0..{matrix}] OF LREAL;
END_VAR
VAR
    model : {name}_rope_model; aBack : ARRAY [0..{turn}] OF LREAL; aLive : ARRAY [0..0] OF LREAL;
    aMatrix : ARRAY [0..{matrix}] OF LREAL; aShape : ARRAY [0..{matrix}] OF LREAL;
    aSquare : ARRAY [0..{mode}] OF LREAL;
END_VAR
model(bLive := TRUE, bModes := TRUE, fTime := fTime, nTerms := {terms}, aLive := aLive, aMatrix := aMatrix,
    aSame := aSame, aOther := aOther, aBack := aBack, aPush := aPush, aRead := aRead, aShape := aShape,
    aSquare := aSquare);
END_FUNCTION_BLOCK
"""


def over_a_slot(frequency, decay, time):
    """What x and x' + d x become, of x'' + 2 d x' + w² x = a: of themselves, and of a that fades or comes."""
    rates = np.zeros((4, 4))
    rates[:2, :2] = [[-decay, 1.0], [decay**2 - frequency**2, -decay]]
    rates[1, 2], rates[2, 3] = 1.0, 1.0  # acceleration, and its slope
    found = expm(rates * time)[:2]
    return found[:, :2], np.column_stack([found[:, 2] - found[:, 3] / time, found[:, 3] / time])


@pytest.mark.parametrize("machine", MACHINES)
def test_modes_turn_fade_and_are_pushed_as_they_are(machine):
    spec = preset_spec(machine, MACHINES[machine])
    constants = planner_constants(spec)[1]
    n, machines, at = constants.modes, 1 + len(ENDS) + len(between(constants)), linearized(spec, [])
    sizes = {"turn": machines * n * n - 1, "push": 4 * machines * n - 1, "matrix": n * n - 1, "mode": n - 1}
    name, time = constants.name.replace("-", "_"), constants.periods[0] / 20.0
    sizes["terms"] = terms(constants, time)
    block = BlockInstance(account_texts(constants) + CALLED.format(name=name, **sizes))
    issued = np.split(block.call(np.array([[time]]))[0], np.cumsum([s + 1 for s in sizes.values()][:1] * 2))
    same, other, rest = issued
    push, read = rest[: 4 * machines * n].reshape(machines, n, 4), rest[4 * machines * n :].reshape(n, n)
    same, other = same.reshape(machines, n, n), other.reshape(machines, n, n)
    gains = np.abs(at.sway_gain @ driven_modes(at, 0)).max(axis=0)
    assert read == pytest.approx(np.diag(gains), rel=1e-9, abs=1e-12)
    for mode, (frequency, ratio) in enumerate(
        zip(at.distinct_frequencies, at.distinct_damping_ratios, strict=True)
    ):
        turn, pushed = over_a_slot(frequency, ratio * frequency, time)
        assert same[0, mode, mode] == pytest.approx(turn[0, 0], abs=LEFT_OUT)
        assert other[0, mode, mode] == pytest.approx(turn[0, 1], abs=LEFT_OUT * time)
        scale = np.array([[time**2], [time]])
        assert np.abs((push[0, mode].reshape(2, 2) - pushed) / scale).max() < 3e-4
