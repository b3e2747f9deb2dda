"""Machines under a motion: our integration beside SciPy's of the same equations, to the same accuracy."""

from time import process_time

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gen_profile as gp
from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.dynamics.evaluation.simulation import PlantSimulation, equations_of, motion_of
from gen_profile.dynamics.problem.dynamics import parameter_rows

ROUNDS = 5


@pytest.mark.parametrize("preset", ["paper", "flexible-joint", "gantry-crane", "mass-spring-chain"])
def test_machines_of_a_preset(preset, capsys):
    spec = gp.preset_spec(preset)
    plan, plant = gp.plan(spec), spec.machine()
    machines = [machine.parameters for machine in scenarios(spec)]
    until = plan.motion.duration + plan.evaluation.watch
    times = np.linspace(0.0, until, 4001)

    def ours():
        return np.array([one.q_u for one in PlantSimulation(plant, plan.motion, machines, until).at(times)])

    acceleration, motion = equations_of(plant)[0], motion_of(plan.motion)
    parameters = parameter_rows(plant, machines)
    shape = (2, len(machines), len(plant.unactuated))

    def slope(time, state):
        q, v = state.reshape(shape)
        return np.concatenate([v.ravel(), acceleration(q, v, motion(np.array([time])), parameters).ravel()])

    def theirs():
        found = solve_ivp(
            slope,
            (0.0, until),
            np.zeros(np.prod(shape)),
            method="DOP853",
            t_eval=times,
            rtol=1e-10,
            atol=1e-13,
            max_step=until / 20.0,
        )
        return found.y.reshape(*shape, -1)[0].transpose(0, 2, 1)

    np.testing.assert_allclose(ours(), theirs(), atol=1e-9)
    seconds = {}
    for way in (ours, theirs):
        began = process_time()
        for _ in range(ROUNDS):
            way()
        seconds[way] = (process_time() - began) / ROUNDS
    ratio = seconds[theirs] / seconds[ours]
    with capsys.disabled():
        print(f"\n{preset}: {1e3 * seconds[ours]:.1f} ms; SciPy's DOP853 takes {ratio:.1f} times as long")
    assert ratio > 2.0
