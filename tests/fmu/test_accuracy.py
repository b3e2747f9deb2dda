"""The FMU against equations that were written separately and are integrated by SciPy."""

import numpy as np
import pytest
from fmu import absolute_angle_crane as oracle
from fmu.hoisting_pendulum import PLANT as WINCH
from scipy.integrate import solve_ivp

from gen_profile.motion.profile import Profile, SampledProfile, sample
from gen_profile_fmu.running.cosimulation import PlantCosimulation

OTHER_CRANE = {"m1": 0.5, "m2": 0.1, "L1": 0.6, "L2": 0.25, "g": 9.7, "c1": 0.01, "c2": 0.02}


def hold(position, cycle, cycles):
    return SampledProfile(cycle_time=cycle, position=np.full((cycles + 1, 1), position))


@pytest.mark.slow
@pytest.mark.parametrize(("cycle", "bound"), [(0.001, 0.06e-6), (0.004, 0.9e-6), (0.01, 6e-6)])
def test_positions_alone_carry_the_motion(cosimulation, crane, quintic, cycle, bound):
    """Linear interpolation between setpoints is all that is lost; it falls with the cycle's square."""
    parameters = crane.nominal()
    response = cosimulation.run(
        sample(quintic, cycle), parameters, max_step=1e-3, settle=4.0, output_step=cycle
    )
    angles = oracle.swing(
        lambda time: quintic.derivative(np.array([time]), 2)[0, 0], response.times, parameters
    )
    error = np.abs(response.sway - oracle.sway(angles, parameters)).max()
    assert bound / 10.0 < error < bound
    np.testing.assert_allclose(response.angle, angles, rtol=0.0, atol=100.0 * bound)


@pytest.mark.slow
@pytest.mark.parametrize("tau", [0.0, 0.1, 0.005, 1e-3])
@pytest.mark.parametrize("parameters", [None, OTHER_CRANE], ids=["nominal", "other"])
def test_drives_interpolate_their_setpoints(cosimulation, crane, quintic, tau, parameters):
    parameters = parameters or crane.nominal()
    setpoints = sample(quintic, 0.01)
    response = cosimulation.run(setpoints, parameters, tau=tau, max_step=1e-3, settle=0.0)
    states, carts = oracle.swing_in_steps(setpoints.position[:, 0], 0.01, tau, parameters)
    angles, rates = states[:, :2], states[:, 2:]
    np.testing.assert_allclose(response.angle, angles, rtol=0.0, atol=1e-10)
    relative = np.array([[1.0, 0.0], [-1.0, 1.0]])  # the plant counts θ2 from θ1
    np.testing.assert_allclose(response.q_u, angles @ relative.T, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(response.dq_u, rates @ relative.T, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(response.sway, oracle.sway(angles, parameters), rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(response.position[:, 0], carts, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("tau", [1e-3, 1e-4, 1e-5])
def test_drives_of_little_lag_leap_after_setpoints(cosimulation, crane, tau):
    """However short the lag is, steps of 5 ms see it through."""
    parameters = crane.nominal()
    positions = np.array([0.0, 1e-3, -2e-3, 3e-3, 3e-3, 3e-3, 0.0, -1e-3])
    setpoints = SampledProfile(cycle_time=0.01, position=positions[:, None])
    response = cosimulation.run(setpoints, parameters, tau=tau, max_step=5e-3, settle=0.0)
    states, carts = oracle.swing_in_steps(positions, 0.01, tau, parameters)
    np.testing.assert_allclose(response.angle, states[:, :2], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(response.position[:, 0], carts, rtol=0.0, atol=1e-12)
    assert np.abs(states[:, :2]).max() > 5e-3


def test_a_lag_of_nearly_nothing_is_none(cosimulation, crane, quintic):
    none, little = (
        cosimulation.run(sample(quintic, 0.01), crane.nominal(), tau=tau, max_step=5e-3, settle=4.0)
        for tau in (0.0, 1e-12)
    )
    np.testing.assert_allclose(little.sway, none.sway, rtol=0.0, atol=1e-8)


def test_integration_is_of_fourth_order(cosimulation, crane, quintic):
    setpoints = sample(quintic, 0.04)
    exact, _ = oracle.swing_in_steps(setpoints.position[:, 0], 0.04, 0.0, crane.nominal())

    def error(max_step):
        response = cosimulation.run(setpoints, crane.nominal(), max_step=max_step, settle=0.0)
        return np.abs(response.angle - exact[:, :2]).max()

    orders = np.log2([error(0.04) / error(0.02), error(0.02) / error(0.01)])
    assert (orders > 3.7).all() and (orders < 4.3).all()


def test_free_swing_has_the_small_angle_frequencies(cosimulation, crane):
    """ω² are the eigenvalues of M⁻¹ K of the linearised crane; a push excites both modes."""
    p = crane.nominal()
    pushed = SampledProfile(cycle_time=0.01, position=np.array([[0.0], [1e-6]]))
    response = cosimulation.run(pushed, p, max_step=1e-3, settle=60.0, output_step=0.01)
    free = response.angle[1:]
    mass = oracle.mass_matrix(np.zeros(2), p)
    stiffness = np.diag([p["g"] * (p["m1"] + p["m2"]) * p["L1"], p["g"] * p["m2"] * p["L2"]])
    frequencies = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, stiffness)))
    time = response.times[1:]
    modes = np.column_stack([wave(omega * time) for omega in frequencies for wave in (np.cos, np.sin)])
    fitted = modes @ np.linalg.lstsq(modes, free, rcond=None)[0]
    assert np.abs(free - fitted).max() < 1e-6 * np.abs(free).max()
    np.testing.assert_allclose(np.sort(frequencies), [3.640, 9.017], atol=5e-4)


def test_a_lagging_drive_comes_to_rest_at_the_target(cosimulation, crane, quintic):
    response = cosimulation.run(
        sample(quintic, 0.01), crane.nominal(), tau=0.1, max_step=1e-3, settle=5.0, output_step=1e-3
    )
    assert abs(response.position[300, 0] - 0.3) > 1e-4
    np.testing.assert_allclose(response.position[-1], 0.3, rtol=0.0, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("tau", [0.0, 0.05])
def test_two_axes_of_a_users_own_plant(tau):
    """A trolley that travels while its winch hoists, against the load's angular momentum h = l² φ̇."""
    duration = 2.0
    rise = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) / duration ** np.arange(6)
    start, end = np.array([0.5, 2.0]), np.array([1.5, 1.2])
    coefficients = rise[:, None] * (end - start) + np.eye(6)[:, :1] * start
    motion = Profile(knots=[0.0, duration], coefficients=coefficients[None], target=end, method="quintic")
    p = {"m": 3.0, "c": 0.02, "g": 9.81}
    setpoints = sample(motion, 0.001)
    with PlantCosimulation(WINCH) as cosimulation:
        response = cosimulation.run(setpoints, p, tau=tau, max_step=1e-3, settle=1.0)

    def rates(time, state):
        # y + tau dy/dt = setpoint, and once differentiated: the drives' lag on the exact profile
        phi, momentum, *axes = state
        given = motion(np.array([time]))
        if tau == 0.0:
            length, push = given.position[0, 1], given.acceleration[0, 0]
            lag = np.zeros(4)
        else:
            (_, length), speed = axes[:2], np.array(axes[2:])
            acceleration = (given.velocity[0] - speed) / tau
            lag, push = np.concatenate((speed, acceleration)), acceleration[0]
        rate = momentum / length**2
        torque = length * (push * np.cos(phi) - p["g"] * np.sin(phi)) - p["c"] / p["m"] * rate
        return [rate, torque, *lag]

    exact = solve_ivp(
        rates,
        (0.0, response.times[-1]),
        [0.0, 0.0, *start, 0.0, 0.0],
        method="DOP853",
        rtol=1e-10,
        atol=1e-12,
        t_eval=response.times,
    ).y
    assert np.abs(exact[0]).max() > 0.02
    np.testing.assert_allclose(response.angle[:, 0], exact[0], rtol=0.0, atol=1e-6)
    length = response.position[:, 1]
    np.testing.assert_allclose(response.sway[:, 0], length * np.sin(exact[0]), rtol=0.0, atol=1e-6)
    if tau > 0.0:
        np.testing.assert_allclose(response.position, exact[2:4].T, rtol=0.0, atol=1e-6)
