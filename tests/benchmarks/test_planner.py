"""The planner block's times from rest to rest, beside the shortest motions and ZVD."""

import numpy as np
import pytest
from exporters.counted_block import CountedBlock, compile_counting
from exporters.farthest_motion import farthest

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec

G, CYCLE, MEASURING = 9.81, 0.001, 900
MACHINES = {  # hook mass, lower rope, upper ropes, loads, (velocity, acceleration, jerk), distances
    "paper": (0.192, 0.391, (0.3, 0.47, 0.7), (0.1, 0.203), (0.3, 0.7, 20.0), (0.1, 0.3, 0.6, 1.0, 2.0)),
    "bay": (350.0, 1.5, (3.0, 6.0, 7.7), (0.0, 2000.0), (1.0, 0.3, 1.0), (1.0, 2.0, 4.0, 8.0, 15.0)),
    "quay": (15e3, 3.0, (12.0, 21.0, 30.0), (0.0, 40e3), (4.0, 0.6, 1.0), (5.0, 10.0, 20.0, 50.0)),
}


def frequencies(hook, lower, rope, load):
    load = max(load, 1e-3 * hook)
    mass = np.array([[(hook + load) * rope**2, load * rope * lower], [load * rope * lower, load * lower**2]])
    stiffness = np.diag([(hook + load) * G * rope, load * G * lower])
    return np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real)


def shortest(distance, rates, limits, longest):
    """Bisect from a duration that is enough."""
    low, high = longest / 1.5, longest
    while high - low > 2e-3 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if farthest(middle, rates, limits) >= distance else (middle, high)
    return high


def zvd(distance, rates, limits):
    """Two-mode ZVD on the quickest trapezoid, its jerk unlimited."""
    velocity, acceleration, _ = limits
    ramps = 2 * np.sqrt(distance / acceleration)
    if distance > velocity**2 / acceleration:
        ramps = distance / velocity + velocity / acceleration
    return ramps + 2 * np.pi * np.sum(1 / rates)


@pytest.mark.parametrize("name", MACHINES)
def test_times_from_rest_to_rest(name):
    hook, lower, ropes, loads, limits, distances = MACHINES[name]
    velocity, acceleration, jerk = limits
    live = f"L1 = [{ropes[0]}, {1.3 * ropes[-1]}], m2 = [{loads[0]}, {loads[-1]}]"
    spec = parse_spec(f"""
name = "{name}"
plant = {{ type = "double-pendulum-crane", m1 = {hook}, m2 = {loads[-1]}, L1 = {ropes[1]}, L2 = {lower} }}
move = {{ distance = {distances[0]}, duration = 30.0 }}
limits = {{ velocity = {velocity}, acceleration = {acceleration}, jerk = {jerk}, travel = [0.0, 100.0] }}
planner = {{ live = {{ {live} }} }}
export = {{ cycle_time = {CYCLE} }}
""")
    compiled = compile_counting(planner_block(spec).text)
    ratios, most, latest = [], 0.0, 0
    for rope in ropes:
        for load in (*loads, np.mean(loads)):
            rates = frequencies(hook, lower, rope, load)
            for distance in distances:
                block = CountedBlock(compiled, fL1=rope, fm2=load, fActPosition=0.0)
                block.hold(MEASURING)
                out = block.hold(60_000, bExecute=1.0, fTarget=distance)
                duration = CYCLE * np.argmax(out["bDone"])
                assert 0.0 < duration < zvd(distance, rates, limits)
                ratios.append(duration / shortest(distance, rates, limits, duration))
                most = max(most, out["operations"].max())
                latest = max(latest, np.argmax(out["fVelocity"] != 0.0))
    print(
        f"{name:6} {min(ratios):.3f} to {max(ratios):.3f} times the shortest, {np.mean(ratios):.3f} on"
        " average;"
        f" {latest} cycles to begin, {most:.0f} operations"
    )
    assert max(ratios) <= 1.10
    assert np.mean(ratios) <= 1.06
    assert latest <= 24
