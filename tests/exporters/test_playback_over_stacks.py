"""How a playback block stops on a way over stacks: on that way, and on this crane clear of them."""

import numpy as np
import pytest
from generator.hall import BOXES, MACHINE, hall
from generator.quay import ROPE, SIDEWAYS, quay
from playing import checked, column, play, start

import gen_profile as gp
from gen_profile.dynamics.evaluation.clearance import nearest
from gen_profile.dynamics.evaluation.simulation import body_places
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.registry import find_exporter
from gen_profile_fmu.running.cosimulation import PlantCosimulation

LESS = 0.15  # m, by which a load may come nearer to a stack than the clearance where it is stopped


@pytest.mark.slow
@pytest.mark.parametrize("rope", [0.9, 1.0, 1.1])
def test_an_abort_of_the_playback_block_stays_on_the_way_and_clear(rope):
    """What docs/over-stacks.md says of this crane; the block is executed by the language's interpreter."""
    plan = gp.plan(quay(export={"cycle_time": 0.04}))
    passed = plan.spec.path.stacks[:-1]  # it is set down on the last one
    bare = gp.evolve_spec(plan.spec, path={"clearance": 0.0, "stacks": passed})
    plant, cycles = plan.spec.machine(), int(plan.motion.duration / 0.04)
    (block, *_) = find_exporter("plc").encode(plan.command, target_of(plan.spec))
    values = {**plan.spec.plant.parameters, "L0": rope * ROPE}
    way = plan.motion.derivative(np.linspace(0.0, plan.motion.duration, 20001), 0)
    with PlantCosimulation(plant) as fmu:
        for cycle in range(40, cycles, 80):
            fb = checked(block.content.decode("utf-8"))
            rows = [start(fb), *(fb.call() for _ in range(cycle - 1))]
            rows += play(fb, fb.call(bAbort=True))
            position = column(rows, "position")
            assert max(np.abs(way - at).sum(axis=1).min() for at in position) < 0.01  # between its points
            setpoints = gp.SampledProfile(cycle_time=0.04, position=position)
            response = fmu.run(setpoints, values, max_step=1e-3, settle=20.0)
            bodies = body_places(plant, response.q_u, response.position, parameter_rows(plant, [values]))
            assert nearest(plan.spec, response.times, bodies).room >= -LESS
            assert nearest(bare, response.times, bodies).room >= 0.5 * SIDEWAYS


@pytest.mark.slow
@pytest.mark.parametrize(("height", "seconds", "most"), [(BOXES[1][4], 5.0, 0.11), (9.0, 15.2, 0.43)])
def test_an_abort_of_a_hall_crane_stays_on_the_way_and_swings_as_the_docs_say(height, seconds, most):
    stacks = [BOXES[0], [*BOXES[1][:4], height], BOXES[2]]
    plan = gp.plan(hall(path={"stacks": stacks}, export={"cycle_time": 0.05}))
    plant, found = plan.spec.machine(), []
    (block, *_) = find_exporter("plc").encode(plan.command, target_of(plan.spec))
    way = plan.motion.derivative(np.linspace(0.0, plan.motion.duration, 20001), 0)
    fb = checked(block.content.decode("utf-8"))
    rows = [start(fb), *(fb.call() for _ in range(round(seconds / 0.05) - 1))]
    position = column([*rows, *play(fb, fb.call(bAbort=True))], "position")
    assert max(np.abs(way - at).sum(axis=1).min() for at in position) < 0.01
    with PlantCosimulation(plant) as fmu:
        for rope in (0.9, 1.1):
            values = {**plan.spec.plant.parameters, "L0": rope * MACHINE["L0"]}
            setpoints = gp.SampledProfile(cycle_time=0.05, position=position)
            response = fmu.run(setpoints, values, max_step=1e-3, settle=15.0)
            bodies = body_places(plant, response.q_u, response.position, parameter_rows(plant, [values]))
            found.append(nearest(plan.spec, response.times, bodies).room)
    assert -most <= min(found) <= 0.02 - most
