"""Long logs: memory that does not follow their length, and averages that tell what the whole log does."""

import re
import subprocess
import sys

import numpy as np
import pytest
from command_line import PROGRAM

from gen_profile.spec.reading import preset_spec
from gen_profile.studies.identification.identify import identify
from gen_profile.studies.identification.log_signal import resolution
from gen_profile.studies.identification.measurements import SwingLog
from gen_profile.studies.identification.swing_model import (
    MOST_SAMPLES,
    SwingingMachine,
    require_likely,
    shortened,
    swing_model,
)
from gen_profile.support.errors import InfeasibleProblem

LENGTH, DAMPING = 3.4, 0.004  # m, of the rope; 1/s
PRESET, HOISTED = "single-pendulum-crane", 1.0  # m, of rope that the hoist adds at the move's target


def swing(rate, lasts, amplitude=0.01, noise=1e-4):
    """A small swing, of which the equation is known without any model."""
    times = np.arange(0.0, lasts, 1.0 / rate)
    exact = amplitude * np.exp(-DAMPING * times) * np.cos(np.sqrt(9.81 / LENGTH - DAMPING**2) * times)
    return times, exact + noise * np.random.default_rng(0).standard_normal(len(times))


def test_averages_are_of_their_times_and_keep_the_sensors_step():
    times = np.array([0.0, 0.1, 0.2, 1.05, 1.15, 5.0, 7.0])
    log = SwingLog(times=times, values=np.round(times * 100.0), quantity="angle", load="load")
    means = log.averaged(1.0, 3)
    assert means.times == pytest.approx([0.0, 1.0, 4.9])
    assert means.values == pytest.approx([10.0, 110.0, 500.0])
    assert (means.logged, means.resolution) == (7, log.resolution)


def test_a_short_log_is_taken_as_it_is():
    spec, times = preset_spec(PRESET), np.arange(MOST_SAMPLES) / 10.0
    log = SwingLog(times=times, values=np.sin(times), quantity="angle", load="payload")
    machine = SwingingMachine(plant=spec.machine(), parameters=spec.plant.parameters, q_a=spec.move.target)
    assert shortened(log, machine) is log


def test_the_least_step_is_that_between_different_values():
    values = np.random.default_rng(1).integers(-50, 50, 400) * 0.03
    assert resolution(values) == np.diff(np.unique(values)).min()
    assert resolution(np.full(20, 0.1)) == np.inf


def log_of(times, values):
    return SwingLog(times=times, values=values, quantity="angle", load="payload")


@pytest.mark.parametrize("factor", [20.0, 0.1])
def test_a_clock_that_is_wrong_is_named_before_anything_is_searched(factor):
    times, values = swing(100.0, 40.0)
    period = 2.0 * np.pi / np.sqrt(9.81 / LENGTH)
    with pytest.raises(InfeasibleProblem, match=r"By its clock, .* unit of the log's times") as refusal:
        identify(preset_spec(PRESET), [log_of(times * factor, values)], free=["L0", "c"])
    stated = float(re.search(r"swings once in ([\d.]+) s", str(refusal.value))[1])
    assert stated == pytest.approx(factor * period, rel=0.1)  # to a bin of a spectrum of eleven swings


@pytest.mark.parametrize("beside", ["drift", "wind", "another rope", "few swings"])
def test_a_clock_is_not_blamed_for_what_may_be_so(beside):
    times, values = swing(100.0, 6.0 if beside == "few swings" else 40.0)
    drift = 0.2 * np.sin(0.02 * times)  # twenty times the swing, and over the log no whole period
    wind = 0.02 * np.cumsum(np.random.default_rng(2).standard_normal(len(times))) / 10.0
    values = values + {"drift": drift, "wind": wind}.get(beside, 0.0)
    log = log_of(times * (4.0 if beside == "another rope" else 1.0), values)  # sixteen times as long
    spec = preset_spec(PRESET)
    machine = SwingingMachine(plant=spec.machine(), parameters=spec.plant.parameters, q_a=spec.move.target)
    require_likely(swing_model(machine, shortened(log, machine)))


@pytest.mark.slow
def test_averages_tell_the_rope_as_well_as_all_samples():
    times, values = swing(500.0, 120.0)
    log = SwingLog(times=times, values=values, quantity="angle", load="payload")
    found = identify(preset_spec(PRESET), [log], free=["L0", "c"])
    (row,) = found.to_dict()["logs"]
    assert row["samples"] == len(times) > 9 * row["averages"]
    rope, known = LENGTH - HOISTED, found.estimate
    assert known.values["L0"] == pytest.approx(rope, abs=known.half_range["L0"])
    assert known.half_range["L0"] < 1e-3
    assert known.values["c"] == pytest.approx(2.0 * DAMPING * 2000.0 * LENGTH**2, abs=known.half_range["c"])


@pytest.mark.slow
def test_a_log_of_the_stated_size_takes_no_more_memory_than_a_machine_has(tmp_path):
    times, values = swing(4000.0, 300.0)  # 1.2 million rows; their square would be terabytes
    rows = (f"{time:.5f};{value:.6f}\n" for time, value in zip(times.tolist(), values.tolist(), strict=True))
    with (tmp_path / "log.csv").open("w") as file:
        file.writelines(["t;angle\n", *rows])
    words = ["identify", "--preset", PRESET, "--swing", "log.csv", "--columns", "t,angle"]
    run = subprocess.run(
        [
            sys.executable,
            "-c",
            "import resource, subprocess, sys; code = subprocess.run(sys.argv[1:], "
            "stdout=subprocess.DEVNULL).returncode; "
            "print(code, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)",
            PROGRAM,
            *words,
            *("--free", "L0", "--free", "c"),
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    code, most = map(int, run.stdout.split())
    assert code == 0
    assert most < 500_000  # kB
