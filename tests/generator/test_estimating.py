"""By how much an estimate of sway may be off, against the equations of a double pendulum, integrated."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from gen_profile.assurance.proof.estimating import estimation_error, unknown
from gen_profile.assurance.proof.histories import Histories
from gen_profile.planner.directions import sensed_directions
from gen_profile.spec.reading import preset_spec

G, M1, L2 = 9.81, 350.0, 1.5
ROPE, LOAD, ERROR, GUST, SWING, OFFSET, LATE = 9.0, 500.0, 0.05, 0.1, 0.5, 0.005, 0.05
MEASURED = [
    f"planner.live={{L1=[3.0, {ROPE}], m2=[{LOAD}, 2000.0]}}",
    'planner.sensor={quantity="angle", of="theta1", noise=0.002}',
    f"planner.sensor.offset={OFFSET}",
    f"planner.sensor.delay=[0.05, {0.05 + 2 * LATE}]",
    f"planner.disturbance={{swing={{payload={SWING}}}, settle=12.0}}",
    f"planner.disturbance.gust={{acceleration={GUST}, longest=5.0}}",
]


@pytest.fixture(scope="module")
def spec():
    return preset_spec("bay-crane", MEASURED)


def of_machines(spec, *ropes):
    machines = [({**spec.plant.parameters, "L1": rope, "m2": LOAD}, [0.0]) for rope in ropes]
    return unknown(spec, machines, sensed_directions(spec)[0])


def impulse(rope, lasts=None):
    """Times of a slow period; the payload's sway and its rate after a step of the trolley's velocity."""
    mass = np.array([[(M1 + LOAD) * rope**2, LOAD * rope * L2], [LOAD * rope * L2, LOAD * L2**2]])
    matrix = np.linalg.solve(mass, np.diag([(M1 + LOAD) * G * rope, LOAD * G * L2]))
    rates = np.linalg.solve(mass, [-(M1 + LOAD) * rope, -LOAD * L2])
    period = 2.0 * np.pi / np.sqrt(np.linalg.eigvals(matrix).real.min())
    times = np.linspace(0.0, lasts or period, 4001)
    start = [0.0, 0.0, *rates]
    swung = solve_ivp(
        lambda _, y: [*y[2:], *(-matrix @ y[:2])], times[[0, -1]], start, t_eval=times, rtol=1e-9, atol=1e-12
    ).y
    return times, rope * swung[0] + L2 * swung[1], rope * swung[2] + L2 * swung[3]


def test_gusts_delay_and_offset_act_for_a_slow_period(spec):
    times, sway, speed = impulse(ROPE)
    found, own = of_machines(spec, ROPE), spec.limits.acceleration
    assert found.gusts == pytest.approx(GUST * np.trapezoid(np.abs(sway), times), rel=2e-3)
    fastest = own * np.trapezoid(np.abs(speed), times) + SWING * 2.0 * np.pi / times[-1]
    assert found.delay == pytest.approx(LATE * fastest, rel=2e-3)
    assert found.errors == 0.0
    assert OFFSET * ROPE < found.offset < OFFSET * (ROPE + 2.0 * L2)  # as the hook hangs above the payload
    assert 0.06 < found.shown < 0.2  # rad: 0.5 m of swing below 10.5 m of rope, and what gusts add


def test_another_rope_acts_on_what_swings_and_on_the_axis_own_motions(spec):
    (times, sway, _), (other, *_) = impulse(ROPE), impulse(ROPE * (1.0 - ERROR))
    apart = sway - impulse(ROPE * (1.0 - ERROR), times[-1])[1]
    out_of_phase = SWING * 2.0 * np.sin(np.pi * (times[-1] / other[-1] - 1.0))
    moved = spec.limits.acceleration * np.trapezoid(np.abs(apart), times)
    assert of_machines(spec, ROPE, ROPE * (1.0 - ERROR)).errors == pytest.approx(
        out_of_phase + moved, rel=2e-3
    )


def test_a_block_may_state_less_than_the_machine_allows_and_no_more(spec):
    text = "fSwayUncertainty : LREAL; (* m; current gusts and stated errors add up to {} m *)"
    machines = Histories.of(spec).machines_of_errors
    most = estimation_error(spec, "", machines)
    assert most == estimation_error(spec, text.format(9.0), machines)
    assert estimation_error(spec, text.format(0.3), machines) == 0.3
    longest = of_machines(spec, ROPE)
    assert longest.gusts + longest.delay + longest.offset < most < 2.0 * longest.sway
