"""`gen-profile fmu` as a user calls it."""

import zipfile
from itertools import cycle

import numpy as np
import pytest
from command_line import run_here
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from gen_profile.cli import fmu as command
from gen_profile.delivery.designs.fmu_kinds import KINDS
from gen_profile_fmu.building.platforms import PLATFORMS, host_platform
from gen_profile_fmu.model.plant_variables import InputKind

FAST = ("--set", "plant.L1=0.5")
LIMITS = ("--set", "limits={velocity=0.5, acceleration=1.0, jerk=20.0, travel=[-1.0, 1.0]}")
LIMITS += ("--set", "planner.live={L1=[0.4, 0.5]}", "--set", "check.uncertain={L1=0.02}")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "version"),
    [*zip([kind for kind in KINDS if not kind.endswith("ssp")], cycle("23"), strict=False)],
)
def test_writes_an_fmu_that_others_run(tmp_path, kind, version):
    path = tmp_path / "a.fmu"
    plans = kind in {"planner", "planned-system"}
    changes = (*FAST, *LIMITS) if plans else FAST
    done = run_here("fmu", kind, "--fmi", version, *changes, "--out", path, "--json")
    assert (done.code, done.errors) == (0, [])
    document = done.document
    assert document["path"] == str(path)
    assert document["platforms"] == [{"name": host_platform(), "runs_here": True}]
    assert document["bytes"] == path.stat().st_size
    assert validate_fmu(str(path)) == []
    description = read_model_description(str(path))
    assert description.modelName == document["model_identifier"] == f"paper_{kind.replace('-', '_')}"
    starts = {variable.name: variable.start for variable in description.modelVariables}
    if kind != "profile":
        assert float(starts["live.L1" if kind == "planner" else "L1"]) == 0.5
    orders = {"enable": True, "execute": True, "target": 0.3} if plans else {}
    result = simulate_fmu(
        str(path), stop_time=5.0, output_interval=0.01, fmi_type="CoSimulation", start_values=orders
    )
    if kind in {"profile", "planner"}:
        assert result["cart.setpoint"][-1] == pytest.approx(0.3, abs=1e-12)
    if kind in {"system", "planned-system"}:
        assert result["cart.position"][-1] == pytest.approx(0.3, abs=1e-12)
        ends = 4.0 if plans else 3.0  # s
        assert abs(result["sway.payload"][result["time"] > ends]).max() < (1e-4 if plans else 1e-6)


@pytest.mark.slow
def test_a_system_begins_with_the_swing_and_goes_on_at_speed(tmp_path):
    path = tmp_path / "a.fmu"
    swung = ("--set", 'move.initial={theta1=0.05, "theta1.rate"=-0.1}', "--set", "move.final_velocity=0.1")
    assert run_here("fmu", "system", *swung, "--out", path).code == 0
    result = simulate_fmu(str(path), stop_time=5.0, output_interval=0.01, fmi_type="CoSimulation")
    after = result["time"] > 3.0
    assert result["sway.hook"][0] == pytest.approx(0.47 * np.sin(0.05))
    assert abs(result["sway.payload"][after]).max() < 1e-6
    expected = 0.3 + 0.1 * (result["time"][after] - 3.0)
    np.testing.assert_allclose(result["cart.position"][after], expected, rtol=0.0, atol=1e-12)


def test_is_named_after_the_spec(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run_here("fmu", "plant", "--source-only", "--input", "acceleration")
    assert done.code == 0
    assert done.out.startswith("paper_plant.fmu: FMI 2, sources only, ")
    with zipfile.ZipFile("paper_plant.fmu") as archive:
        names = archive.namelist()
    assert "sources/fmu.c" in names
    assert not [name for name in names if name.startswith("binaries/")]
    names = [variable.name for variable in read_model_description("paper_plant.fmu").modelVariables]
    assert "cart.setpoint_acceleration" in names


@pytest.mark.slow
def test_a_velocity_of_ideal_drives_has_no_lag(tmp_path):
    """The motion's own velocity, held in steps of 4 ms at its mean, calms the loads as its setpoints do."""
    motion, plant = tmp_path / "motion.fmu", tmp_path / "plant.fmu"
    assert run_here("fmu", "profile", "--out", motion).code == 0
    assert run_here("fmu", "plant", "--input", "velocity", "--out", plant).code == 0
    starts = {variable.name: variable.start for variable in read_model_description(str(plant)).modelVariables}
    assert float(starts["tau"]) == 0.0
    planned = simulate_fmu(str(motion), stop_time=6.0, output_interval=0.004, fmi_type="CoSimulation")
    fed = np.zeros(len(planned), dtype=[("time", float), ("cart.setpoint_velocity", float)])
    fed["time"] = planned["time"]
    fed["cart.setpoint_velocity"][:-1] = np.diff(planned["cart.setpoint"]) / 0.004
    outputs = ["cart.position", "sway.payload"]
    found = simulate_fmu(
        str(plant), stop_time=6.0, output_interval=0.004, fmi_type="CoSimulation", input=fed, output=outputs
    )
    assert found["cart.position"][-1] == pytest.approx(0.3, abs=1e-9)
    assert abs(found["sway.payload"][found["time"] > 3.0]).max() < 3e-5


@pytest.mark.slow
def test_other_platforms_are_labelled(tmp_path):
    done = run_here("fmu", "plant", "--platform", "linux-arm64", "--out", tmp_path / "a.fmu", "--json")
    assert done.document["platforms"] == [{"name": "linux-arm64", "runs_here": False}]
    again = run_here("fmu", "plant", "--platform", "linux-arm64", "--out", tmp_path / "a.fmu")
    assert "linux-arm64 (not run)" in again.out


def test_choices_are_those_of_the_workflow():
    assert set(command.INPUTS) == {kind.value for kind in InputKind}
    assert ("host", *PLATFORMS, "all") == command.PLATFORMS


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("fmu",), 2, "Missing argument"),
        (("fmu", "crane"), 2, "'crane' is not one of"),
        (("fmu", "plant", "--fmi", "1"), 2, "'1' is not one of"),
        (("fmu", "profile", "--input", "velocity"), 2, "--input: the inputs of a profile are its own"),
        (("fmu", "plant", "--source-only", "--platform", "all"), 2, "--source-only puts no binary in"),
        (("fmu", "plant", "--set", "plant.L1=-1"), 2, "plant.L1: must be a number"),
        (("fmu", "plant", "--out", "a.zip"), 2, "--out a.zip: name a file that ends in .fmu"),
        (("fmu", "ssp", "--out", "a.fmu"), 2, "--out a.fmu: name a file that ends in .ssp"),
        (("fmu", "plant", "--out", "/proc/none/a.fmu"), 2, "there is no folder /proc/none; make it"),
    ],
)
def test_bad_input_ends_in_sentences(arguments, code, words):
    done = run_here(*arguments)
    assert done.code == code
    assert words in done.err
    assert "Traceback" not in done.err


def test_a_foreign_fmu_that_fails_ends_in_exit_code_4(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "customer.fmu").write_bytes(b"nothing")
    (tmp_path / "crane.toml").write_text(
        """
        [plant]
        type = "double-pendulum-crane"
        [move]
        distance = 0.3
        duration = 3.0
        [check]
        fmu = "customer.fmu"
        input.acceleration = "u"
        output.sway = "load.dx"
        """
    )
    done = run_here("crane.toml", "--out", "deploy")
    assert done.code == 4
    assert done.errors == [
        "Error: customer.fmu: not an FMU, or damaged (File is not a zip file); get it again."
    ]
    assert not (tmp_path / "deploy").exists()
