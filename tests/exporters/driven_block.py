"""The planner block of a bay crane, driven: what it issues, its limits, and what it leaves swinging."""

import re

import numpy as np
from exporters.counted_block import CountedBlock, compile_counting

from gen_profile.planner.design import planner_constants
from gen_profile_exporters.planner.blocks.sizes import operations

G = 9.81
VELOCITY, ACCELERATION, JERK, LOW, HIGH = 1.0, 0.3, 1.0, 0.0, 40.0
CYCLE = 0.004
BAY = f"""
name = "bay 3"
plant = {{ type = "double-pendulum-crane", m1 = 350.0, m2 = 2000.0, L1 = 6.0, L2 = 1.5 }}
move = {{ distance = 8.0, duration = 14.0 }}
limits = {{ velocity = {VELOCITY}, acceleration = {ACCELERATION}, jerk = {JERK}, travel = [{LOW}, {HIGH}] }}
planner = {{ live = {{ L1 = [3.0, 9.0], m2 = [0.0, 2000.0] }} }}
export = {{ cycle_time = {CYCLE} }}
"""


class Driver:
    """An instance that is given inputs by name, and all that it issued."""

    def __init__(self, text, **inputs):
        self.block = CountedBlock(compile_counting(text), **inputs)
        self.parts = []

    def hold(self, seconds, **inputs):
        """Hold inputs; bExecute is an edge."""
        self.parts.append(self.block.hold(max(1, round(seconds / CYCLE)), **inputs))
        return self

    @property
    def outputs(self):
        return {name: np.concatenate([part[name] for part in self.parts]) for name in self.block.outputs}


def most_operations(spec):
    """Those that a cycle may take."""
    return operations(planner_constants(spec)[1])


def reaction(text):
    """Time in s within which a new command is obeyed, as the block's header states it."""
    return float(re.search(r"obeyed\s+within ([\d.e+-]+) s", text)[1])


def frequencies(L1, m2, m1=350.0, L2=1.5):
    mass = np.array([[(m1 + m2) * L1**2, m2 * L1 * L2], [m2 * L1 * L2, m2 * L2**2]])
    stiffness = np.diag([(m1 + m2) * G * L1, m2 * G * L2])
    return np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)


def require_limits(out, rounding=1e-9, limits=(VELOCITY, ACCELERATION, JERK, HIGH)):
    velocity, acceleration, position = out["fVelocity"], out["fAcceleration"], out["fPosition"]
    assert np.abs(velocity).max() <= limits[0] + rounding
    assert np.abs(acceleration).max() <= limits[1] + rounding
    assert np.abs(np.diff(acceleration)).max() <= (limits[2] + rounding) * CYCLE
    assert position.min() >= LOW - rounding
    assert position.max() <= limits[3] + rounding
    # the three agree: acceleration is linear within a slot
    advance = CYCLE * (velocity[1:] + velocity[:-1]) / 2 - CYCLE**2 * np.diff(acceleration) / 12
    assert np.abs(np.diff(position) - advance).max() < rounding


def residual(out, rates):
    """Amplitude that each mode is left with, relative to that of a step to the greatest velocity."""
    phasors = np.exp(1j * np.outer(rates, CYCLE * np.arange(len(out["fVelocity"]))))
    left = np.trapezoid(out["fAcceleration"] * phasors, dx=CYCLE)
    return np.abs(left).max() / max(np.abs(out["fVelocity"]).max(), 1e-3)
