"""The preset of every machine, through the whole job, and against separately written machines."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import run_here
from generator.lagrangian_machines import Lagrange
from scipy.integrate import solve_ivp

from gen_profile.dynamics.evaluation.residual_sway import observation_time
from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.metrics import greatest, peak
from gen_profile.spec.reading import preset_spec, presets
from gen_profile.studies.comparison.candidates import candidates

PRESETS = [name for name in presets() if not name.startswith("paper")]


@pytest.mark.slow
@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_solves_and_passes_its_check(tmp_path, preset):
    designed = run_here("--preset", preset, "--out", tmp_path, "--export", "csv", "--json")
    assert (designed.code, designed.errors) == (0, [])
    check = designed.document["check"]
    assert check["passed"]
    nominal, *others = check["scenarios"]
    assert nominal["residual_peak_m"] < 0.01 * check["limit_m"]
    assert [row["group"] for row in others[:2]] == ["machines"] * 2
    assert all(0.0 < row["residual_peak_m"] < check["limit_m"] for row in others)

    judged = run_here("check", tmp_path / f"{preset}.csv", "--json")
    assert (judged.code, judged.errors) == (0, [])
    again = [row["residual_peak_m"] for row in judged.document["check"]["scenarios"]]
    np.testing.assert_allclose(
        again, [row["residual_peak_m"] for row in check["scenarios"]], rtol=1e-4, atol=1e-7
    )


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["single-pendulum-crane", "gantry-crane", "tower-crane"])
def test_machines_of_several_axes_sway_as_lagrange_says(preset):
    spec = preset_spec(preset)
    lagrange, plant = Lagrange(spec.plant.type), spec.machine()
    found = plan(spec)
    motion, machines = found.evaluation.motion, scenarios(spec)
    n_u, until = len(plant.unactuated), motion.duration + observation_time(spec)
    after = np.linspace(motion.duration, until, 1001)
    residuals = []
    for machine in machines:
        values = dict(machine.parameters)

        def rates(t, x, values=values):
            now = motion(np.array([t]))
            q, dq = np.concatenate([x[:n_u], now.position[0]]), np.concatenate([x[n_u:], now.velocity[0]])
            return np.concatenate([x[n_u:], lagrange.accelerations(q, dq, now.acceleration[0], values)])

        swing = solve_ivp(
            rates, (0.0, until), np.zeros(2 * n_u), "DOP853", after, rtol=1e-8, atol=1e-11, max_step=0.5
        )
        sway = [
            np.linalg.norm(plant.outputs(x[:n_u], motion.target, SimpleNamespace(**values)).sway)
            for x in swing.y.T
        ]
        residuals.append(peak(np.array(sway)[:, None])[0])
    expected = found.evaluation.figures
    assert residuals[0] < 1e-6
    assert residuals[1] == pytest.approx(expected["sway_residual_peak_perturbed_m"], rel=1e-4)
    assert max(residuals) == pytest.approx(expected["sway_residual_worst_m"], rel=1e-4)


def test_shapers_of_a_spherical_pendulum_shape_its_one_frequency_once():
    designs = {method.method: method.design for method in candidates(preset_spec("gantry-crane"))}
    period = 2.0 * np.pi * np.sqrt(5.0 / 9.81)
    for name, delay in (("nzv", period / 3.0), ("zvd", period)):
        base = 12.0 - delay  # the quintic's share of the time; its greatest velocity bounds the shaped one's
        fastest = greatest(designs[name](), 1)
        assert 12.0 / base < fastest <= 15.0 / 8.0 * 12.0 / base * (1.0 + 1e-6)


def test_figures_of_a_turning_axis_are_in_its_own_unit(tmp_path):
    designed = run_here("--preset", "flexible-joint", "--no-check", "--out", tmp_path)
    assert "rad/s²" in designed.out
    assert " m/s²" not in designed.out


def test_a_machine_too_stiff_to_be_followed_is_refused(tmp_path):
    outcome = run_here(
        "--preset", "paper-beta0", "--set", "plant.c1=1e5", "--method", "direct", "--out", tmp_path / "new"
    )
    assert outcome.code == 3
    assert re.search(
        r"changes within 3e-07 s, too fast to be followed for 7\.\d+ s; look at", outcome.errors[-1]
    )
    assert not (tmp_path / "new").exists()
