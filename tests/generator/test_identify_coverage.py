"""Identification against simulated machines whose parameters are known: how often their ranges hold them."""

from types import SimpleNamespace

import numpy as np
import pytest
from generator.free_swings import inside, periods, states, swing
from generator.lagrangian_machines import MACHINES

from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.plants.registry import find_plant
from gen_profile.studies.identification.estimation import estimate
from gen_profile.studies.identification.measurements import DirectReading, Period, SwingLog
from gen_profile.studies.identification.swing_model import SwingingMachine
from gen_profile.support.errors import InfeasibleProblem

CRANE, HOIST = find_plant("double-pendulum-crane"), find_plant("single-pendulum-crane")


@pytest.mark.slow
def test_tape_and_stopwatch_hold_the_machine_in_their_ranges():
    """Read with stated noise, 300 times: the box of the ranges misses the machine in one of a hundred."""
    true = CRANE.nominal() | {"L1": 0.52, "L2": 0.36, "m2": 0.25}
    machine = SwingingMachine(plant=CRANE, parameters=CRANE.nominal() | {"m2": 0.25}, q_a=(0.0,))
    slow, fast = periods(**true)
    random, hits, errors = np.random.default_rng(7), 0, []
    for _ in range(300):
        readings = [
            DirectReading(parameter="L1", value=random.normal(0.52, 0.005), uncertainty=0.005),
            Period(mode=1, seconds=random.normal(slow, 0.01), uncertainty=0.01),
            Period(mode=2, seconds=random.normal(fast, 0.004), uncertainty=0.004),
        ]
        estimated = estimate(machine, ["L1", "L2"], readings)
        hits += inside(estimated, true)
        errors.append(
            [(estimated.values[n] - true[n]) / estimated.standard_uncertainty[n] for n in ("L1", "L2")]
        )
    assert hits >= 0.98 * 300
    np.testing.assert_allclose(np.std(errors, axis=0), 1.0, atol=0.12)  # neither too wide nor too narrow
    np.testing.assert_allclose(np.mean(errors, axis=0), 0.0, atol=0.2)


@pytest.mark.slow
def test_a_logged_swing_holds_the_machine_in_its_ranges():
    """Rope and damping from 12 noisy logs of a crane that is a fifth off, zero error included."""
    true = HOIST.nominal() | {"L0": 2.3, "c": 300.0}
    machine = SwingingMachine(plant=HOIST, parameters=HOIST.nominal() | {"c": 100.0}, q_a=(0.0, 4.0))
    times = np.arange(0.0, 25.0, 0.1)
    exact = swing(true, times, [0.15, -0.1])
    random, errors, hits = np.random.default_rng(11), [], 0
    for _ in range(12):
        values = exact + 0.03 + random.normal(0.0, 3e-3, len(times))
        log = SwingLog(times=times, values=values, quantity="angle", load="payload")
        estimated = estimate(machine, ["L0", "c"], [], [log])
        hits += inside(estimated, true)
        errors.append(
            [(estimated.values[n] - true[n]) / estimated.standard_uncertainty[n] for n in ("L0", "c")]
        )
        assert estimated.noise[0] == pytest.approx(3e-3, rel=0.25)
    assert hits >= 11
    np.testing.assert_allclose(np.std(errors, axis=0), 1.0, atol=0.45)


@pytest.mark.slow
def test_a_log_and_a_tape_together_find_both_ropes_of_a_double_pendulum():
    true = CRANE.nominal() | {"L1": 0.52, "L2": 0.36, "c1": 2e-3}
    times = np.sort(np.random.default_rng(3).uniform(0.0, 12.0, 500))  # unevenly spaced
    exact = swing(true, times, [0.1, -0.05, 0.2, 0.3], (0.0,), "double-pendulum-crane")
    noisy = exact + np.random.default_rng(5).normal(0.0, 2e-3, len(times))
    log = SwingLog(times=times, values=noisy, quantity="angle", load="hook")
    machine = SwingingMachine(plant=CRANE, parameters=CRANE.nominal(), q_a=(0.0,))
    tape = DirectReading(parameter="L1", value=0.523, uncertainty=0.005)
    estimated = estimate(machine, ["L1", "L2", "c1"], [tape], [log])
    assert inside(estimated, true)
    assert estimated.half_range["L2"] < 0.005


# what a swing tells, how far it is off the spec's
TOLD = {
    "double-pendulum-crane": "L1",
    "single-pendulum-crane": "L0",
    "gantry-crane": "L",
    "hall-crane": "L0",
    "tower-crane": "L",
    "flexible-joint": "k",
    "mass-spring-chain-1": "k1",
    "mass-spring-chain-4": "m4",
    "slosh-tank": "h",
}


@pytest.mark.slow
@pytest.mark.parametrize("type_", MACHINES)
def test_every_machine_is_told_by_its_swing(type_):
    """Logged in the direction of the last load; a gantry's payload shows nothing of the other there."""
    plant, name = find_plant(type_), TOLD[type_]
    given = plant.nominal()
    true = given | {name: 1.08 * given[name]}
    axes, n = [2.0] * len(plant.actuated), len(plant.unactuated)
    linear = linearize(plant, given, axes)
    across = np.tile([0.0, 0.05], n // 2)
    start = np.r_[across if plant.directions == 2 else 0.05 * linear.modes[:, 0], np.zeros(n)]
    times = np.linspace(0.0, 16.0 * np.pi / linear.frequencies[0], 160)
    q_u = states(true, times, start, axes, type_)[:n]
    exact = np.array([plant.outputs(q, axes, SimpleNamespace(**true)).sway[-1] for q in q_u.T])
    noise = np.random.default_rng(1).normal(0.0, 0.03 * np.abs(exact).max(), len(times))
    log = SwingLog(times=times, values=exact + noise, quantity="sway", load=plant.loads[-1])
    estimated = estimate(SwingingMachine(plant=plant, parameters=given, q_a=tuple(axes)), [name], [], [log])
    assert inside(estimated, true)
    assert estimated.half_range[name] < 0.02 * true[name]


@pytest.mark.slow
def test_a_gyroscope_on_the_hook_tells_both_ropes():
    """Of swings as large as they come on site, with a phone's noise and bias."""
    given = CRANE.nominal()
    true, times = given | {"L1": 1.06 * given["L1"], "L2": 0.95 * given["L2"]}, np.arange(0.0, 20.0, 0.02)
    rates = states(true, times, [0.35, 0.1, 0.0, 0.4], [0.0], "double-pendulum-crane")[2]
    values = rates + 0.02 + np.random.default_rng(3).normal(0.0, 5e-3, len(times))
    log = SwingLog(times=times, values=values, quantity="rate", load="hook")
    machine = SwingingMachine(plant=CRANE, parameters=given, q_a=(0.0,))
    estimated = estimate(machine, ["L1", "L2"], [], [log])
    assert inside(estimated, true)
    assert max(estimated.half_range[name] / true[name] for name in ("L1", "L2")) < 2e-3
    assert estimated.noise[0] == pytest.approx(5e-3, rel=0.1)


@pytest.mark.slow
def test_steps_of_an_encoder_do_not_average_out():
    """One degree of resolution and 4° of swing: errors repeat with the swing, wherever the zero lies."""
    true = HOIST.nominal() | {"L0": 2.3, "c": 300.0}
    machine = SwingingMachine(plant=HOIST, parameters=true | {"c": 100.0}, q_a=(0.0, 4.0))
    times, step = np.arange(0.0, 25.0, 0.1), np.radians(1.0)
    exact = swing(true, times, [0.07, 0.0])
    errors = []
    for zero in np.arange(12) / 12.0:
        values = np.round(exact / step + zero) * step
        log = SwingLog(times=times, values=values, quantity="angle", load="payload")
        estimated = estimate(machine, ["c"], [], [log])
        assert inside(estimated, true)
        errors.append((estimated.values["c"] - true["c"]) / estimated.standard_uncertainty["c"])
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.5


def test_ranges_that_are_not_straight_reach_as_far_as_the_measurement_allows():
    """Damping from a period that it lengthens by its square: the range's ends follow from a textbook."""
    length, given = 6.3, HOIST.nominal()
    inertia = given["m"] * length**2
    slow, T, spread = np.sqrt(9.81 / length), 5.07, 0.01

    def damping(period):
        return 2.0 * inertia * np.sqrt(slow**2 - (2.0 * np.pi / period) ** 2)

    machine = SwingingMachine(
        plant=HOIST, parameters=given | {"L0": 2.3, "c": 0.8 * damping(T)}, q_a=(0.0, 4.0)
    )
    estimated = estimate(machine, ["c"], [Period(mode=1, seconds=T, uncertainty=spread)])
    assert estimated.values["c"] == pytest.approx(damping(T), rel=1e-5)
    slope, reach = (damping(T + 1e-5) - damping(T - 1e-5)) / 2e-5, 2.576 * spread
    assert damping(T) - damping(T - reach) > 1.3 * slope * reach
    assert estimated.half_range["c"] == pytest.approx(damping(T) - damping(T - reach), rel=0.06)


@pytest.mark.slow
def test_what_part_of_a_log_does_not_tell_stays_near_the_spec_meanwhile():
    """One period hardly tells a tank's fill height, and beyond a half of its length nothing does."""
    plant = find_plant("slosh-tank")
    given = plant.nominal()
    true, times = given | {"h": 1.2 * given["h"]}, np.arange(0.0, 20.0, 0.05)
    q_u = states(true, times, [0.03, 0.01, 0.0, 0.0], [0.0], "slosh-tank")[:2]
    exact = np.array([plant.outputs(q, [0.0], SimpleNamespace(**true)).sway[0] for q in q_u.T])
    random = np.random.default_rng(0)
    noises = [random.normal(0.0, 1e-3, len(times)) for _ in range(4)]
    log = SwingLog(times=times, values=exact + noises[3], quantity="sway", load="surface")
    estimated = estimate(SwingingMachine(plant=plant, parameters=given, q_a=(0.0,)), ["h"], [], [log])
    assert inside(estimated, true)


def test_noise_that_lasts_from_sample_to_sample_counts_for_less():
    times = np.arange(0.0, 25.0, 0.05)
    exact = swing(HOIST.nominal() | {"c": 300.0}, times, [0.15, 0.0])
    machine = SwingingMachine(plant=HOIST, parameters=HOIST.nominal() | {"c": 300.0}, q_a=(0.0, 4.0))
    white = np.random.default_rng(2).normal(0.0, 3e-3, len(times) + 9)
    lasting = np.convolve(white, np.full(10, 10**-0.5), "valid")  # as strong, but alike over ten samples

    def range_of(noise):
        log = SwingLog(times=times, values=exact + noise, quantity="angle", load="payload")
        return estimate(machine, ["L0"], [], [log]).half_range["L0"]

    assert range_of(lasting) > 2.0 * range_of(white[: len(times)])


def test_an_exact_log_is_identified_exactly():
    times = np.arange(0.0, 20.0, 0.1)
    log = SwingLog(
        times=times, values=swing(HOIST.nominal(), times, [0.3, 0.0]), quantity="angle", load="payload"
    )
    machine = SwingingMachine(plant=HOIST, parameters=HOIST.nominal() | {"L0": 1.5}, q_a=(0.0, 4.0))
    assert estimate(machine, ["L0"], [], [log]).values["L0"] == pytest.approx(2.0, abs=1e-6)


def test_contradictory_readings_widen_the_ranges():
    machine = SwingingMachine(plant=HOIST, parameters=HOIST.nominal(), q_a=(0.0, 0.0))

    def read(*lengths):
        tape = [DirectReading(parameter="L0", value=length, uncertainty=0.01) for length in lengths]
        return estimate(machine, ["L0"], tape)

    agreeing, torn = read(2.0, 2.01, 1.99), read(2.0, 2.2, 1.8)
    assert agreeing.contradiction == 1.0
    assert torn.contradiction == pytest.approx(20.0, rel=1e-6)
    assert torn.standard_uncertainty["L0"] == pytest.approx(20.0 * 0.01 / np.sqrt(3.0), rel=1e-4)


@pytest.mark.parametrize(
    ("names", "readings", "blamed"),
    [
        (["L1", "L2"], [Period(mode=1, seconds=1.7, uncertainty=0.01)], "L1 and L2"),
        (["L1", "c1"], [Period(mode=1, seconds=1.7, uncertainty=0.01)], "L1 and c1"),
        (
            ["L1", "m1", "m2"],
            [Period(mode=n, seconds=s, uncertainty=0.01) for n in (1, 2) for s in (1.7 / n, 1.71 / n)],
            "m1 and m2",
        ),
        (["g"], [DirectReading(parameter="L1", value=0.5, uncertainty=0.1)], "g"),
    ],
)
def test_what_is_not_determined_is_named(names, readings, blamed):
    machine = SwingingMachine(plant=CRANE, parameters=CRANE.nominal(), q_a=(0.0,))
    with pytest.raises(InfeasibleProblem, match=rf"do not determine {blamed};"):
        estimate(machine, names, readings)


@pytest.mark.parametrize("pace", [0.001, 1000.0])
def test_a_log_in_another_unit_of_time_is_refused(pace):
    times = np.arange(0.0, 25.0, 0.1)
    log = SwingLog(times=pace * times, values=np.sin(times), quantity="angle", load="payload")
    machine = SwingingMachine(plant=HOIST, parameters=HOIST.nominal(), q_a=(0.0, 4.0))
    with pytest.raises(
        InfeasibleProblem, match=r"swings once in 4\.9\d s: look at the unit of the log's times"
    ):
        estimate(machine, ["L0"], [], [log])
