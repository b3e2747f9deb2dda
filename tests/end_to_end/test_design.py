"""The main job by the installed program: what it writes, and what it says about it."""

import hashlib
import json
import re
from itertools import combinations

import can
import numpy as np
import pytest
from command_line import run_here, run_process

from gen_profile.spec.reading import spec_from_dict
from gen_profile.support.artefacts.manifest import parse_manifest

SUFFIXES = {"csv": ".csv", "plc": ".st", "can": ".log"}
FIGURES = {
    "duration_s",
    "velocity_max_m_per_s",
    "acceleration_max_m_per_s2",
    "acceleration_rms_m_per_s2",
    "jerk_max_m_per_s3",
    "jerk_rms_m_per_s3",
    "sway_transient_peak_m",
    "sway_transient_rms_m",
    "sway_residual_peak_m",
    "sway_residual_peak_perturbed_m",
    "sway_residual_worst_m",
    "sway_transient_worst_m",
}


def exports(formats):
    return [word for format_ in formats for word in ("--export", format_)]


@pytest.mark.slow
@pytest.mark.parametrize("formats", [c for n in (1, 2, 3) for c in combinations(SUFFIXES, n)], ids="+".join)
def test_every_choice_of_formats_is_written_and_recorded(tmp_path, monkeypatch, formats):
    monkeypatch.chdir(tmp_path)
    outcome = run_here(*exports(formats), "--out", "deploy", "--json")
    assert (outcome.code, outcome.errors) == (0, [])
    manifest = json.loads((tmp_path / "deploy" / "manifest.json").read_text("utf-8"))
    rows = outcome.document["artefacts"]
    assert list(dict.fromkeys(row["format"] for row in rows)) == list(formats)
    for row, recorded in zip(rows, manifest["artefacts"], strict=True):
        content = (tmp_path / row["path"]).read_bytes()
        assert row["path"] == f"deploy/{recorded['path']}"
        assert row["format"] == recorded["format"]
        assert row["bytes"] == recorded["bytes"] == len(content)
        assert row["sha256"] == recorded["sha256"] == hashlib.sha256(content).hexdigest()
    written = {f"deploy/{path.name}" for path in (tmp_path / "deploy").iterdir()}
    assert written == {"deploy/manifest.json", *(row["path"] for row in rows)}
    for format_ in formats:  # the first file of each format is the one that can be checked
        first = next(row["path"] for row in rows if row["format"] == format_)
        assert first == f"deploy/paper{SUFFIXES[format_]}"


def test_other_names_of_a_format_are_recorded_as_the_listed_one(tmp_path):
    outcome = run_here("--export", "st", "--export", "plc", "--out", tmp_path, "--no-check", "--json")
    assert [row["format"] for row in outcome.document["artefacts"]] == ["plc"]


@pytest.mark.slow
def test_the_installed_program_keeps_the_json_contract(tmp_path):
    outcome = run_process("--export", "csv", "--json", cwd=tmp_path)
    assert (outcome.code, outcome.errors) == (0, [])
    document = outcome.document
    assert {"name", "spec_sha256", "solver", "figures", "check", "artefacts"} <= document.keys()
    assert {"status", "method", "iterations", "residual", "time_s", "cost"} <= document["solver"].keys()
    assert document["figures"].keys() == FIGURES
    assert {"passed", "limit_m", "error_bound_m", "scenarios"} <= document["check"].keys()
    for scenario in document["check"]["scenarios"]:
        assert {"name", "parameters", "residual_peak_m", "passed"} <= scenario.keys()
    (artefact,) = document["artefacts"]
    assert artefact.keys() == {"format", "path", "sha256", "bytes"}
    assert (document["name"], document["solver"]["status"]) == ("paper", "converged")
    assert document["check"]["passed"] is True
    assert document["check"]["limit_m"] == 0.003
    assert artefact["path"] == "gen-profile-out/paper.csv"


def test_the_manifest_holds_the_whole_spec_and_the_verdict(tmp_path):
    outcome = run_here("--out", tmp_path, "--json", "--set", "robustness.uncertain={L1=0.1}").document
    manifest = parse_manifest((tmp_path / "manifest.json").read_bytes(), "manifest.json")
    spec = spec_from_dict(manifest.spec)
    assert spec.sha256() == manifest.spec_sha256 == outcome["spec_sha256"]
    assert spec.robustness.uncertain == {"L1": 0.1}
    assert manifest.check == outcome["check"]
    assert manifest.versions["numpy"] == np.__version__
    assert manifest.versions.keys() == {"gen-profile", "casadi", "fmpy", "numpy", "scipy"}


def test_a_path_outside_is_told_from_here(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    (row,) = run_here("--out", tmp_path / "there", "--json").document["artefacts"]
    assert row["path"] == "../there/paper.csv"


def test_later_runs_leave_other_files_alone(tmp_path):
    assert run_here("--out", tmp_path).code == 0
    first = (tmp_path / "paper.csv").read_bytes()
    assert run_here("--out", tmp_path, "--set", "name=bay 3", "--set", "move.duration=4").code == 0
    assert (tmp_path / "paper.csv").read_bytes() == first
    assert {path.name for path in tmp_path.iterdir()} == {"paper.csv", "bay 3.csv", "manifest.json"}
    assert run_here("check", tmp_path / "bay 3.csv").code == 0


def test_the_same_format_twice_is_written_once(tmp_path):
    rows = run_here(*exports(["csv", "csv"]), "--out", tmp_path, "--json").document["artefacts"]
    assert [row["format"] for row in rows] == ["csv"]


def test_a_spec_file_states_the_move(tmp_path):
    (tmp_path / "bay.toml").write_text(
        'name = "bay"\n[plant]\ntype = "double-pendulum-crane"\nm1 = 90.0\nm2 = 4e2\nL1 = 5.0\nL2 = 1.0\n'
        "[move]\ndistance = 4.0\n"
        'duration = 12.0\n[axis]\nunit = "mm"\n[export]\ncycle_time = 0.01\n',
        "utf-8",
    )
    outcome = run_here(tmp_path / "bay.toml", "--out", tmp_path)
    assert outcome.code == 0
    (defaults,) = (line for line in outcome.out.splitlines() if "defaults used" in line)
    assert defaults.split("used")[1].strip() == (
        "plant.g = 9.81 m/s^2, plant.c1 = 0 N m s/rad, plant.c2 = 0 N m s/rad"
    )
    header, *_, last = (tmp_path / "bay.csv").read_text("utf-8").splitlines()
    assert header.startswith("time_s,position_mm,")
    assert last.split(",")[:2] == ["12.00", "4000.0"]


def test_the_cycle_time_is_the_controller_s_and_the_bus_s(tmp_path):
    assert run_here(*exports(["csv", "can"]), "--cycle-time", "0.01", "--out", tmp_path).code == 0
    assert (tmp_path / "paper.csv").read_text("utf-8").splitlines()[2].startswith("0.01,")
    stamps = {message.timestamp for message in can.LogReader(tmp_path / "paper.log")}
    assert len(stamps) == 301
    assert sorted(stamps)[1] == pytest.approx(0.01)


def test_a_cycle_time_that_does_not_divide_the_duration_ends_at_the_target(tmp_path):
    assert run_here("--cycle-time", "0.007", "--out", tmp_path).code == 0
    *_, last = (tmp_path / "paper.csv").read_text("utf-8").splitlines()
    assert list(map(float, last.split(","))) == [3.003, 0.3, 0.0, 0.0, 0.0]


def test_without_a_check_the_manifest_says_unverified(tmp_path):
    outcome = run_here("--no-check", "--out", tmp_path, "--json")
    assert outcome.code == 0
    assert outcome.document["check"] is None
    assert json.loads((tmp_path / "manifest.json").read_text("utf-8"))["check"] == "unverified"
    assert "UNVERIFIED" in run_here("--no-check", "--out", tmp_path).out


def test_people_get_a_short_table(tmp_path):
    outcome = run_here("--out", tmp_path)
    rows = dict(line.strip().split("  ", 1) for line in outcome.out.splitlines()[1:])
    assert outcome.out.startswith("paper\n")
    assert rows["sway on the way"].strip() == "payload 19.36 mm"
    assert rows["peak motion"].strip().startswith("0.1803 m/s, 0.703 m/s²")
    assert "passed: hook 2.193 mm at worst (L1 -20 %), 3 mm allowed" in rows["check"]
    assert rows["wrote"].strip() == str(tmp_path / "paper.csv")
    stages = dict.fromkeys(re.split(",| …", line)[0] for line in outcome.err.splitlines())
    assert list(stages)[:3] == ["solving", "exporting", "checking by co-simulation"]


@pytest.mark.slow
def test_a_sensitivity_that_the_others_imply_is_said_to_be_left_out(tmp_path):
    uncertain = "robustness.uncertain={L1=0.05, g=0.05, L2=0.05}"
    outcome = run_here("--set", uncertain, "--set", "check.residual_sway=0.1", "--out", tmp_path)
    assert outcome.code == 0
    assert "left out" in outcome.out
    document = run_here("--set", uncertain, "--set", "check.residual_sway=0.1", "--out", tmp_path, "--json")
    assert document.document["solver"]["redundant"]


@pytest.mark.parametrize(
    ("names", "formats", "shared"),
    [
        (("bay-3", "bay_3"), "plc", "fb_bay_3"),
        (("bay", "bay Axis"), "plc", "fb_bay_axis"),
        (("Bay", "bay"), "csv", "bay.csv"),
        (("bay-3", "bay_3"), "rockwell-l5x", "fb_bay_3"),
        (("Brücke", "Bruecke"), "csv", "bruecke.csv"),
        (("bay-3", "bay_3"), "csv", None),
        (("bay-3", "bay-4"), "plc", None),
    ],
)
def test_motions_that_would_share_files_or_blocks_are_kept_apart(tmp_path, names, formats, shared):
    def exported(name):
        words = ("--preset", "paper-beta0", "--set", f"name={name}", "--set", "export.cycle_time=0.01")
        return run_here(*words, "--export", formats, "--no-check", "--out", tmp_path)

    first, second = names
    assert exported(first).code == 0
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    done = exported(second)
    if shared is None:
        assert done.code == 0
        return
    assert done.code == 2 and f"would share {shared} with it; give it another name" in done.err
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert exported(first).code == 0  # again, as its own files are no others'
