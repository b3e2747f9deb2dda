"""Certificates as files: made beside the artefact, checked again, and refused when anything is altered."""

import json
import shutil

import numpy as np
import pytest
from command_line import run_here

import gen_profile as gp
from gen_profile.support.errors import CertificateError, OutputError, SpecError

pytestmark = pytest.mark.slow

PRESET, CYCLE, ON_THE_WAY = "single-pendulum-crane", "export.cycle_time=0.01", "limits.sway=0.25"
BARE = ("--preset", PRESET, "--set", CYCLE)
AXES = "limits.acceleration=0.9"
SPEC = (*BARE, "--set", ON_THE_WAY, "--set", AXES, "--set", "limits.jerk=3")


@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    """A file with its manifest and certificate, made on the command line, and what was printed."""
    folder = tmp_path_factory.mktemp("certified")
    assert run_here(*SPEC, "--out", folder, "--json").code == 0
    artefact = folder / "single-pendulum-crane.csv"
    return artefact, run_here("check", artefact, "--certify", "--json")


@pytest.fixture
def copied(certified, tmp_path):
    shutil.copytree(certified[0].parent, tmp_path, dirs_exist_ok=True)
    artefact = tmp_path / certified[0].name
    return artefact, artefact.with_name(f"{artefact.name}.certificate.json")


def test_a_certificate_is_made_beside_the_file_and_holds_when_checked_again(certified):
    artefact, made = certified
    beside = artefact.with_name(f"{artefact.name}.certificate.json")
    assert made.code == 0 and beside.is_file()
    said, check = made.document["certificate"], made.document["check"]
    worst = max(row["residual_peaks_m"]["payload"] for row in check["scenarios"])
    assert said["proved"] and said["share_proved"] == 1.0 and said["reasons"] == []
    assert worst <= said["bounds_m"]["payload"] <= 1.05 * worst < said["limits_m"]["payload"]
    swung = max(row["sway_peak_m"] for row in check["scenarios"])
    way = said["on_the_way"]
    assert way["load"] == "payload" and way["limit_m"] == 1.01 * check["sway_limit_m"]
    assert swung <= way["bound_m"] <= 1.05 * swung < way["limit_m"]
    assert said["ranges"] == {"L0": pytest.approx([2.7, 3.3])}
    again = run_here("check", artefact, "--certificate", beside, "--json")
    assert again.code == 0 and again.document["certificate"] == said
    text = run_here("check", artefact, "--certificate", beside).out
    assert "all with L0 from 2.7 to 3.3" in text and f"{1e3 * said['bounds_m']['payload']:.4g} mm" in text
    assert f"payload {1e3 * way['bound_m']:.4g} mm at any time" in text


def test_what_the_setpoints_ask_of_the_axes_is_what_differences_of_the_file_say(certified):
    artefact, made = certified
    table, said = (
        np.genfromtxt(artefact, delimiter=",", names=True),
        made.document["certificate"]["setpoints"],
    )
    for axis in ("cart", "hoist"):
        position = 1e-3 * np.pad(table[f"{axis}_position_mm"], 2, mode="edge")
        for order, kind, limit in ((2, "acceleration", 0.9), (3, "jerk", 3.0)):
            found, claim = np.abs(np.diff(position, order)).max() / 0.01**order, said[axis][kind]
            assert claim["bound"] == pytest.approx(found, rel=1e-6) and claim["limit"] == limit
        assert said[axis]["acceleration"]["unit"] == "m/s²" and "velocity" not in said[axis]


def test_setpoints_that_break_a_limit_are_not_certified(copied):
    spec = gp.preset_spec(PRESET, [CYCLE, "limits.velocity=0.5"])
    with pytest.raises(CertificateError, match=r"ask cart for 1\.468 m/s, and limits\.velocity allows 0\.5"):
        gp.certify_artefact(copied[0], spec)


def test_a_limit_below_the_bound_is_not_proved_though_the_check_passes(copied):
    artefact, beside = copied
    beside.unlink()
    worst = run_here("check", artefact, "--json").document["check"]["scenarios"]
    limit = max(row["residual_peaks_m"]["payload"] for row in worst) * 1.0005
    refused = run_here(
        "check", artefact, *BARE, "--set", f"check.residual_sway={limit}", "--certify", "--json"
    )
    assert refused.code == 4 and not beside.exists()
    assert refused.document["check"]["passed"] and not refused.document["certificate"]["proved"]
    assert refused.errors[0].startswith("Not proved: The payload is proved to sway by at most")
    limit = max(row["sway_peak_m"] for row in worst) / 1.0095
    refused = run_here("check", artefact, *BARE, "--set", f"limits.sway={limit}", "--certify", "--json")
    assert refused.code == 4 and refused.document["check"]["passed"]
    assert "mm on the way" in refused.errors[0] and "(1.01 of limits.sway)" in refused.errors[0]
    failed = run_here("check", artefact, *SPEC, "--set", "check.residual_sway=0.003", "--certify", "--json")
    assert failed.code == 4 and failed.document["certificate"] is None


def test_what_is_no_certificate_or_of_something_else_is_refused(copied):
    artefact, beside = copied
    with pytest.raises(CertificateError, match="is no certificate"):
        gp.check_certificate(artefact, artefact.with_name("manifest.json"))
    with pytest.raises(OutputError, match="Cannot read"):
        gp.check_certificate(artefact, artefact.with_name("none.json"))
    wider = gp.preset_spec(PRESET, [CYCLE, ON_THE_WAY, AXES, "robustness.uncertain={L0=0.11}"])
    with pytest.raises(CertificateError, match="about another spec"):
        gp.check_certificate(artefact, beside, wider)
    artefact.write_text(artefact.read_text().replace("1.0", "1.1", 1))
    with pytest.raises((CertificateError, gp.ExportError)):
        gp.check_certificate(artefact, beside)


def test_limits_that_the_file_breaks_are_not_proved_by_a_certificate_that_is_silent_of_them(copied):
    """Of a spec without these limits, with the other spec's hash written into it."""
    artefact, beside = copied
    stricter = gp.preset_spec(PRESET, [CYCLE, "limits.velocity=0.5", "limits.acceleration=0.1"])
    document = json.loads(beside.read_text())
    silent = {**document, "spec_sha256": stricter.sha256(), "on_the_way": None, "setpoints": {}}
    beside.write_text(json.dumps(silent))
    with pytest.raises(CertificateError, match=r"ask cart for 1\.468 m/s"):
        gp.check_certificate(artefact, beside, stricter)


def test_a_file_that_does_not_make_the_move_is_not_certified(copied):
    """One that stands still leaves no sway."""
    artefact, _ = copied
    rows = artefact.read_text().splitlines()
    still = [rows[0], *(",".join([row.split(",")[0], *rows[1].split(",")[1:]]) for row in rows[1:])]
    artefact.write_text("\n".join(still) + "\n")
    with pytest.raises(CertificateError, match=r"Axis cart ends at 0 m, and the spec asks for 12 m\."):
        gp.certify_artefact(artefact)


def test_where_no_certificate_can_lie_none_is_sought(copied):
    artefact, beside = copied
    beside.unlink()
    beside.mkdir()
    with pytest.raises(OutputError, match="no regular file"):
        gp.certify_artefact(artefact, progress=lambda *_: pytest.fail("the proof began"))


def test_a_file_that_leaves_the_travel_is_not_certified(copied):
    artefact, beside = copied
    rows = artefact.read_text().splitlines()
    cells = rows[800].split(",")
    cells[1] = str(float(cells[1]) + 9000.0)
    artefact.write_text("\n".join([*rows[:800], ",".join(cells), *rows[801:]]) + "\n")
    spec = gp.preset_spec(PRESET, [CYCLE, "limits.axis.cart.travel=[-0.1, 12.1]"])
    for certified_again in (gp.certify_artefact, lambda path, spec: gp.check_certificate(path, beside, spec)):
        with pytest.raises(
            CertificateError, match=r"cart is at 1\d\.\d+ m at 7\.99 s, and limits\.axis\.cart\.travel"
        ):
            certified_again(artefact, spec)
    assert any(
        "limits.axis.cart.travel allows" in fault for fault in gp.check_artefact(artefact, spec).check.faults
    )


def test_ranges_that_are_too_wide_for_a_certificate_are_refused(copied):
    spec = gp.preset_spec(PRESET, [CYCLE, "check.uncertain={L0=0.9, m=0.9, g=0.9, c=0.9}"])
    with pytest.raises(CertificateError, match="too wide"):
        gp.certify_artefact(copied[0], spec)


def test_options_that_do_not_go_together_are_refused(copied):
    artefact, beside = copied
    both = run_here("check", artefact, "--certificate", beside, "--strict")
    assert both.code == 2 and "--strict" in both.errors[0]
    scaled = run_here("check", artefact, "--certify", "--scale", "cart=0.5")
    assert scaled.code == 2 and "--certify" in scaled.errors[0]
    assert issubclass(SpecError, gp.GenProfileError)


def test_the_main_job_certifies_the_file_of_each_format_as_the_check_does(tmp_path):
    made = run_here(*BARE, "--export", "csv", "--export", "plc", "--certify", "--out", tmp_path, "--json")
    assert made.code == 0, made.err
    stated = {}
    for name in ("single-pendulum-crane.csv", "single-pendulum-crane.st"):
        beside = tmp_path / f"{name}.certificate.json"
        again = run_here("check", tmp_path / name, "--certificate", beside, "--json")
        assert again.code == 0, again.err
        stated[name] = again.document["certificate"]
    said = made.document["certificate"]
    assert said == max(stated.values(), key=lambda one: one["bounds_m"]["payload"]) and said["proved"]
    text = run_here(*BARE, "--certify", "--out", tmp_path)
    assert text.code == 0 and "all with L0 from 2.7 to 3.3" in text.out
    assert text.out.count("certificate.json") == 1 and "payload" in text.out.split("proved", 1)[1]


def test_the_main_job_says_what_is_not_proved_and_writes_no_certificate(tmp_path, certified):
    check = certified[1].document["check"]
    limit = max(row["residual_peaks_m"]["payload"] for row in check["scenarios"]) * 1.004
    tight = ("--set", f"check.residual_sway={limit}")
    made = run_here(*SPEC, *tight, "--certify", "--out", tmp_path, "--json")
    assert made.code == 4 and made.document["check"]["passed"] and not made.document["certificate"]["proved"]
    assert made.errors[0].startswith("Not proved: The payload is proved to sway by at most")
    assert [path.suffix for path in tmp_path.iterdir() if "certificate" in path.name] == []
    wide = ("--set", "check.uncertain={L0=0.5, m=0.9, g=0.5, c=0.9}", "--set", "check.residual_sway=1.9")
    refused = run_here(*BARE, *wide, "--certify", "--out", tmp_path, "--json")
    assert refused.code == 4 and refused.document["certificate"] is None
    assert "too wide" in refused.errors[-2] and (tmp_path / "single-pendulum-crane.csv").exists()
    failed = run_here(*BARE, "--set", "check.residual_sway=0.001", "--certify", "--out", tmp_path, "--json")
    assert failed.code == 4 and failed.document["certificate"] is None


def test_a_proof_without_a_check_is_refused_before_anything_is_designed(tmp_path):
    refused = run_here(*BARE, "--certify", "--no-check", "--out", tmp_path / "none")
    assert refused.code == 2 and "--no-check" in refused.errors[0] and not (tmp_path / "none").exists()


def test_where_counts_are_too_coarse_for_a_bound_that_is_said(tmp_path):
    coarse = ("axis.unit=counts", "axis.counts_per_metre=3000", "robustness.uncertain={L1=0.01}")
    spec = gp.preset_spec("double-pendulum-crane", [*coarse, "export.cycle_time=0.02"])
    written = gp.design(spec, ["csv"], tmp_path, check=False)
    proof = gp.certify_artefact(written.folder / written.artefacts[0].path)
    assert proof.fraction < 1.0
    assert "rounded to counts that are too coarse" in proof.reasons()[0]
    assert "axis.counts_per_metre" in proof.reasons()[0] and "export.cycle_time" in proof.reasons()[0]
