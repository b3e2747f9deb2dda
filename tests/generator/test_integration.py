"""The integration of many machines: an exact swing, SciPy's integrator, and what cannot be integrated."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from gen_profile.dynamics.evaluation import simulation
from gen_profile.dynamics.evaluation.integration import MOST, NODES, integrate
from gen_profile.methods.solvers.shape import shaped_motion
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import CosimulationError

TIGHT = {"accuracy": 1e-10, "least": 1e-13, "what": "test"}


def constant(stiffness, damping):
    terms = np.array(stiffness, float), np.array(damping, float)
    return lambda _: terms


def test_pendulums_that_swing_far_follow_jacobi_s_elliptic_functions():
    squares, starts = np.array([1.0, 4.0, 90.0]), np.array([0.1, 1.5, 3.0])
    found = integrate(
        lambda _: lambda q, _rate: -squares * np.sin(q),
        constant(squares[:, None, None], np.zeros((3, 1, 1))),
        np.array([starts, np.zeros(3)]),
        np.array([0.0, 10.0]),
        fastest=np.sqrt(90.0),
        **TIGHT,
    )
    times = np.linspace(0.0, 10.0, 1001)
    positions, velocities = found(times)
    for number, (square, start) in enumerate(zip(squares, starts, strict=True)):
        modulus = np.sin(start / 2.0)
        quarter = ellipk(modulus**2)
        sine, cosine, _, _ = ellipj(quarter - np.sqrt(square) * times, modulus**2)
        np.testing.assert_allclose(positions[:, number], 2.0 * np.arcsin(modulus * sine), atol=2e-8)
        np.testing.assert_allclose(
            velocities[:, number], -2.0 * np.sqrt(square) * modulus * cosine, atol=2e-7
        )


def test_coupled_and_damped_machines_with_a_kink_agree_with_scipy():
    stiffness = np.array([[[30.0, -10.0], [-8.0, 25.0]], [[60.0, 5.0], [2.0, 9.0]]])
    damping = np.array([[[0.5, 0.1], [0.0, 2.0]], [[20.0, 0.0], [0.3, 0.1]]])
    start = np.array([[0.1, -0.2, 0.0, 0.3], [0.0, 1.0, -1.0, 0.0]])

    def push(time):
        return np.where(time < 1.3, time**2, 2.0 - time)

    def rates(q, v, time):
        forces = np.einsum("muv,...mv->...mu", stiffness, q) + np.einsum("muv,...mv->...mu", damping, v)
        return push(time)[..., None, None] - forces - 3.0 * q**3

    found = integrate(
        lambda times: lambda q, v: rates(q.reshape(-1, 2, 2), v.reshape(-1, 2, 2), times).reshape(q.shape),
        constant(stiffness, damping),
        start,
        np.array([0.0, 1.3, 4.0]),
        fastest=20.0,
        **TIGHT,
    )

    def slope(time, state):
        q, v = state.reshape(2, 2, 2)
        return np.concatenate([v.ravel(), rates(q, v, np.array(time)).ravel()])

    given = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
    first = solve_ivp(slope, (0.0, 1.3), start.ravel(), t_eval=(0.4, 1.3), **given)
    second = solve_ivp(slope, (1.3, 4.0), first.y[:, -1], t_eval=(2.0, 4.0), **given)
    theirs = np.concatenate([first.y, second.y], axis=1).T
    ours = found(np.array([0.4, 1.3, 2.0, 4.0])).swapaxes(0, 1).reshape(4, -1)
    np.testing.assert_allclose(ours, theirs, atol=1e-10)


def test_what_runs_away_is_a_sentence():
    with pytest.raises(CosimulationError, match=r"The test cannot be integrated beyond 1 s"):
        integrate(
            lambda _: lambda q, v: 2.0 * q * v,  # q = 1 / (1 - t)
            constant(np.zeros((1, 1, 1)), np.zeros((1, 1, 1))),
            np.array([[1.0], [1.0]]),
            np.array([0.0, 2.0]),
            fastest=1.0,
            **TIGHT,
        )


def test_however_many_machines_and_steps_there_are_few_are_taken_at_once():
    asked = []

    def accelerations(times):
        asked.append(len(times))
        return lambda q, _: -(q**3)

    integrate(
        accelerations,
        constant(np.ones((900, 1, 1)), np.zeros((900, 1, 1))),
        np.full((2, 900), 0.1),
        np.array([0.0, 20.0]),
        fastest=1.0,
        accuracy=1e-6,
        least=1e-9,
        what="test",
    )
    assert len(asked) > 2 and max(asked) * 900 <= NODES * MOST


def test_loads_that_swing_too_far_to_be_followed_sway_without_bound(monkeypatch):
    def lost(*_, **__):
        raise CosimulationError("The machine cannot be integrated beyond 1 s.")

    monkeypatch.setattr(simulation, "PlantSimulation", lost)
    plant = preset_spec("paper").machine()
    motion = shaped_motion(preset_spec("paper"), "zv")
    assert np.isinf(simulation.greatest_sway(plant, motion, [plant.nominal()] * 2)).tolist() == [True, True]
