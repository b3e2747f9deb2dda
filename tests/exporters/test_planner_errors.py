"""What errors of the frequencies leave of a planner block's motions, where the spec states them."""

import re

import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting
from generator.planned_machines import BAY

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec

pytestmark = pytest.mark.slow

CYCLE = 0.004
PAPER = f"""
name = "paper"
plant = {{ type = "double-pendulum-crane", m1 = 0.192, m2 = 0.203, L1 = 0.47, L2 = 0.391 }}
move = {{ distance = 0.3, duration = 3.0 }}
limits = {{ velocity = 0.3, acceleration = 0.7, jerk = 20.0, travel = [0.0, 2.0] }}
planner = {{ live = {{ L1 = [0.3, 0.6] }} }}
check = {{ residual_sway = 0.01 }}
export = {{ cycle_time = {CYCLE} }}
"""


def played(uncertain, orders, start):
    """What a block whose spec states these errors issues in all cycles."""
    text = planner_block(parse_spec(PAPER, [f"check.uncertain={uncertain}"])).text
    block = CountedBlock(compile_counting(text), fL1=0.366, fActPosition=start)
    parts = [block.hold(500)]
    for seconds, target in orders:
        cycles = round(seconds / CYCLE)
        parts.append(block.hold(cycles, bExecute=1.0, fTarget=target))
    assert parts[-1]["bDone"][-1]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def left(out, L1, m1=0.192, m2=0.183, L2=0.391, g=9.81):
    """Greatest sway in m that each mode of a linear double pendulum is left with, the faster one last."""
    mass = np.array([[(m1 + m2) * L1**2, m2 * L1 * L2], [m2 * L1 * L2, m2 * L2**2]])
    squares, shapes = np.linalg.eig(np.linalg.solve(mass, np.diag([(m1 + m2) * g * L1, m2 * g * L2])))
    driven = np.linalg.solve(shapes, np.linalg.solve(mass, [(m1 + m2) * L1, m2 * L2]))
    shown = np.abs(np.array([[L1, 0.0], [L1, L2]]) @ shapes).max(axis=0) * np.abs(driven)
    rates = np.sqrt(squares)
    phasors = np.exp(1j * np.outer(rates, CYCLE * np.arange(len(out["fAcceleration"]))))
    found = shown / rates * np.abs(np.trapezoid(out["fAcceleration"] * phasors, dx=CYCLE))
    return found[np.argsort(rates)]


@pytest.mark.parametrize(("distance", "longer"), [(0.15, 1.25), (0.6, 1.08), (1.2, 1.08)])
def test_less_sensitive_motions_take_little_longer(distance, longer):
    """And as stated, nothing is left."""
    orders = [(15.0, distance)]
    unaware, aware = (played(errors, orders, 0.0) for errors in ("{}", "{L1=0.05, m2=0.1}"))
    assert np.argmax(aware["bDone"]) - 500 <= longer * (np.argmax(unaware["bDone"]) - 500)
    assert left(aware, 0.366, m2=0.203).max() < 1e-9


@pytest.fixture(scope="module")
def refusing():
    """A block that finds no motion from rest, and its patience."""
    text, found = planner_block(parse_spec(BAY)).text, "bFails := programme.nResult > 1;"
    assert text.count(found) == 1
    text = text.replace(found, f"{found} IF bStands THEN bFails := TRUE; END_IF;")
    block = CountedBlock(compile_counting(text), fL1=6.8, fm2=1000.0, fActPosition=1.0)
    block.hold(500)
    patience = float(re.search(r"cGivesUp : LREAL := ([^;]+);", text)[1])
    assert f"no motion was found for {patience:.3g} s" in text
    return block, round(patience / CYCLE)


def test_a_command_that_no_motion_obeys_is_given_up_in_the_stated_time(refusing):
    """Not while it is held; at rest, until it is acknowledged; and the same again after that."""
    block, patience = refusing
    held = block.hold(patience + 500, bExecute=1.0, fTarget=5.0, rOverride=0.0)
    assert held["bBusy"][1:].all()
    assert not held["bError"].any()
    for _ in range(2):
        out = block.hold(patience + 500, bExecute=1.0, rOverride=1.0)
        given_up = np.argmax(out["nErrorId"] == 9)
        assert given_up == pytest.approx(patience, abs=5)
        assert out["bBusy"][1:given_up].all()
        assert not out["bBusy"][given_up:].any()
        assert (out["bCommandAborted"] == out["bError"]).all()
        assert (out["nErrorId"][given_up:] == 9).all()
        assert not out["fVelocity"].any()
        refused = block.hold(200, bExecute=1.0)
        assert (refused["bCommandAborted"][-1], refused["nErrorId"][-1]) == (1.0, 9.0)
        assert not block.hold(100, bReset=1.0)["bError"].any()
        block.hold(100, bReset=0.0)
