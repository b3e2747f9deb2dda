"""How far a steady wind holds loads aside, against statics by hand."""

import math
import re

import numpy as np
import pytest
from command_line import run_here

from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.dynamics.evaluation.static_deflection import in_wind, static_deflection
from gen_profile.presentation.charts.curves import WINDY, wind_lines
from gen_profile.spec.reading import preset_spec, read_spec
from gen_profile.support.errors import SpecError

FORCE = 300.0


def deflected(preset, force=FORCE):
    spec = preset_spec(preset)
    found = static_deflection(spec.machine(), force, {"nominal": spec.plant.parameters}, spec.move.target)
    return spec.plant.parameters, found.loads


def test_of_two_ropes_each_leans_by_what_hangs_below_it():
    p, loads = deflected("double-pendulum-crane")
    upper = math.atan2(FORCE, (p["m1"] + p["m2"]) * p["g"])
    lower = math.atan2(FORCE, p["m2"] * p["g"])
    assert loads["hook"] == pytest.approx(p["L1"] * math.sin(upper), rel=1e-9)
    assert loads["payload"] == pytest.approx(loads["hook"] + p["L2"] * math.sin(lower), rel=1e-9)


def test_a_wind_as_strong_as_the_load_is_heavy_leans_the_rope_by_45_degrees():
    p = preset_spec("double-pendulum-crane").plant.parameters
    _, loads = deflected("double-pendulum-crane", p["m2"] * p["g"])
    assert loads["payload"] - loads["hook"] == pytest.approx(p["L2"] * math.sqrt(0.5), rel=1e-9)


def test_of_springs_in_a_row_each_gives_by_the_whole_force():
    p, loads = deflected("mass-spring-chain", 2.0)
    given = np.cumsum([2.0 / p[f"k{i}"] for i in (1, 2, 3)])
    assert list(loads.values()) == pytest.approx(list(given), rel=1e-9)


def test_of_two_directions_each_is_pushed_by_itself():
    p, loads = deflected("gantry-crane")
    expected = p["L"] * math.sin(math.atan2(FORCE, p["m"] * p["g"]))
    assert list(loads.values()) == pytest.approx([expected, expected], rel=1e-9)


@pytest.mark.parametrize("preset", ["bay-crane", "flexible-joint", "tower-crane", "single-pendulum-crane"])
def test_every_machine_with_bodies_stands_somewhere_in_a_wind(preset):
    _, loads = deflected(preset, 1e-3)
    assert all(0.0 < aside < 0.1 for aside in loads.values())


@pytest.mark.parametrize("preset", ["bay-crane", "flexible-joint", "mass-spring-chain", "tower-crane"])
def test_a_wind_may_be_stated_where_the_end_load_is_a_body(preset):
    assert preset_spec(preset, ["check.wind.force=5"]).check.wind.force == 5.0


def test_a_wind_on_what_is_no_body_is_refused():
    with pytest.raises(SpecError, match=r"check\.wind\.force: .*does not push the surface.*; remove it"):
        preset_spec("slosh-tank", ["check.wind.force=5"])


@pytest.mark.parametrize("bodies", [True, False])
def test_a_machine_file_takes_wind_where_it_states_bodies(tmp_path, bodies):
    left_out = "" if bodies else ", bodies=(), mechanics=without"
    (tmp_path / "own.py").write_text(
        "import attrs\nfrom gen_profile.plants.plant import Mechanics\n"
        "from gen_profile.plants.single_pendulum_crane import PLANT as known\n"
        "def without(q_u, q_a, p):\n    return Mechanics(mass=[], place=[])\n"
        f"PLANT = attrs.evolve(known, type='own'{left_out})\n"
    )
    (tmp_path / "own.toml").write_text(
        "plant = {file = 'own.py', L0 = 3.0, m = 100}\nmove = {target = [3.0, 0.0], duration = 9.0}\n"
        "check = {wind = {force = 98.1}}\n"
    )
    if bodies:
        spec = read_spec(tmp_path / "own.toml")
        assert in_wind(spec, scenarios(spec)[:1]).loads["payload"] == pytest.approx(
            3.0 * math.sin(math.atan(0.1))
        )
        return
    with pytest.raises(SpecError, match=r"check\.wind\.force: .*states no bodies.*or remove the wind"):
        read_spec(tmp_path / "own.toml")


def test_the_machine_that_is_held_farthest_aside_is_named():
    spec = preset_spec("paper", ["check.wind.force=0.1", "check.uncertain={m2=0.3}"])
    found = in_wind(spec, scenarios(spec))
    assert found.machine == "m2 -30 %"


@pytest.mark.slow
def test_the_check_reports_it_beside_the_residual_and_does_not_judge_it(tmp_path):
    arguments = ["--preset", "flexible-joint", "--set", "check.wind={force=5}", "--out", tmp_path]
    shown = run_here(*arguments)
    assert re.search(r"wind, 5 N +holds aside tip [0-9.]+ mm \(.+\); not judged", shown.out)
    outcome = run_here("check", tmp_path / "flexible-joint.csv", "--json")
    wind, p = outcome.document["check"]["wind"], preset_spec("flexible-joint").plant.parameters
    assert outcome.document["check"]["passed"]
    assert wind["force_n"] == 5.0
    assert wind["deflections_m"]["tip"] >= 0.999 * 5.0 * p["R"] ** 2 / p["k"]


def test_plots_draw_it_on_both_sides():
    spec = preset_spec("paper", ["check.wind.force=0.1"])
    lines = wind_lines(in_wind(spec, scenarios(spec)), "payload", 3.0, 7.0)
    assert [line.style for line in lines] == [WINDY, WINDY]
    assert lines[0].y[0] == -lines[1].y[0] > 0.0
    assert wind_lines(None, "payload", 3.0, 7.0) == []


def test_where_no_place_is_found_or_a_value_is_not_meant_it_is_refused(monkeypatch):
    with pytest.raises(SpecError, match=r"check\.wind\.force"):
        preset_spec("paper", ["check.wind.force=-1"])
    monkeypatch.setattr("gen_profile.dynamics.evaluation.static_deflection.ITERATIONS", 1)
    with pytest.raises(SpecError, match=r"check\.wind\.force: 300 N hold the payload nowhere"):
        deflected("double-pendulum-crane")
