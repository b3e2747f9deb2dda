"""Judging files again: as exported, altered, cut, damaged, alone, or with another spec."""

import json
import re
import shutil

import numpy as np
import pytest
from command_line import error_of, run_here, run_process
from fmu import absolute_angle_crane as oracle

from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.spec.reading import preset_spec
from gen_profile.support.artefacts.manifest import SEAL, seal_of

CYCLE = 0.004


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    words = [word for format_ in ("csv", "plc", "can") for word in ("--export", format_)]
    assert run_here(*words, "--cycle-time", str(CYCLE), "--out", folder).code == 0
    return folder


@pytest.fixture
def folder(exported, tmp_path):
    return shutil.copytree(exported, tmp_path / "deploy")


def altered_row(text, row, factor):
    """Multiply the position in one line of a CSV table."""
    lines = text.split("\n")
    cells = lines[row].split(",")
    lines[row] = ",".join([cells[0], repr(factor * float(cells[1])), *cells[2:]])
    return "\n".join(lines)


def column(text):
    return np.array([float(line.split(",")[1]) for line in text.splitlines()[1:]])


def sway_after(positions, machine):
    """Greatest sway of hook and payload when a drive interpolates the positions linearly, and then holds."""
    states, _ = oracle.swing_in_steps(positions, CYCLE, 0.0, machine)
    velocity = (positions[-1] - positions[-2]) / CYCLE  # the last push brings the cart to rest
    phi, rate = states[-1, :2], states[-1, 2:]
    rate = rate - np.linalg.solve(oracle.mass_matrix(phi, machine), oracle.lever(phi, machine)) * velocity
    free = oracle._integrate(np.concatenate((phi, rate)), lambda _: 0.0, np.linspace(0.0, 4.0, 4001), machine)
    return np.abs(oracle.sway(free[:, :2], machine)).max(axis=0)


def assert_sways_as(check, positions):
    machines = [scenario["parameters"] for scenario in check["scenarios"]]
    assert machines[:3] == [machine.parameters for machine in scenarios(preset_spec("paper"))]
    expected = [sway_after(positions, machine) for machine in machines]
    found = [list(scenario["residual_peaks_m"].values()) for scenario in check["scenarios"]]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-7)
    return np.array(expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper.csv", "paper.st", "paper.log"])
def test_every_artefact_passes_as_it_was_exported(folder, name):
    outcome = run_here("check", folder / name, "--json")
    assert (outcome.code, outcome.errors) == (0, [])
    document = outcome.document
    assert {"name", "spec_sha256", "artefact", "check"} <= document.keys()
    assert document["artefact"]["manifest"] == "matches"
    assert document["check"]["passed"] is True
    assert document["check"]["scenarios"][0]["residual_peak_m"] < 10e-6


@pytest.mark.slow
def test_the_check_of_a_file_sways_as_its_linear_interpolation(folder):
    check = run_here("check", folder / "paper.csv", "--json").document["check"]
    assert_sways_as(check, column((folder / "paper.csv").read_text("utf-8")))


@pytest.mark.slow
def test_an_altered_renamed_file_gives_its_own_sway_in_a_fresh_process(folder):
    text = (folder / "paper.csv").read_text("utf-8")
    altered = altered_row(text, len(text.splitlines()) // 2, 1.02)
    (folder / "renamed.csv").write_text(altered, "utf-8")
    outcome = run_process("check", "renamed.csv", "--json", cwd=folder)
    assert outcome.code == 4
    document = outcome.document
    assert document["artefact"] == {
        "format": "csv",
        "path": "renamed.csv",
        "manifest": "differs",
        "companions": {},
    }
    sway = assert_sways_as(document["check"], column(altered))
    assert (np.abs(sway[:3] - sway_after_export(folder)) > 1e-6).any()
    assert any("manifest.json" in line for line in outcome.errors)
    assert any("velocity" in line and "altered" in line for line in outcome.errors)
    assert outcome.errors[-1] == "Do not deploy it."


def sway_after_export(folder):
    positions = column((folder / "paper.csv").read_text("utf-8"))
    return [sway_after(positions, machine.parameters) for machine in scenarios(preset_spec("paper"))]


@pytest.mark.slow
def test_a_stretch_of_altered_positions_fails_by_its_sway(folder):
    text = (folder / "paper.csv").read_text("utf-8")
    for row in range(300, 420):
        text = altered_row(text, row, 1.02)
    (folder / "paper.csv").write_text(text, "utf-8")
    outcome = run_here("check", folder / "paper.csv", "--json")
    assert outcome.code == 4
    sway = assert_sways_as(outcome.document["check"], column(text))
    assert sway.max() > 0.003
    assert any("are allowed (check.residual_sway" in line for line in outcome.errors)


@pytest.mark.slow
def test_altered_counts_in_a_can_log_give_their_own_sway(folder):
    lines = (folder / "paper.log").read_text("ascii").splitlines()
    positions = []
    for number, line in enumerate(lines):
        frame = re.fullmatch(r"(.* 301#)([0-9A-F]{8})", line)
        if frame:
            count = int.from_bytes(bytes.fromhex(frame[2]), "little", signed=True)
            if 600 <= number < 840:
                count = round(1.02 * count)
            positions.append(count * 1e-6)
            lines[number] = frame[1] + count.to_bytes(4, "little", signed=True).hex().upper()
    (folder / "paper.log").write_text("\n".join(lines) + "\n", "ascii")
    outcome = run_here("check", folder / "paper.log", "--json")
    assert outcome.code == 4
    assert outcome.document["artefact"]["manifest"] == "differs"
    assert_sways_as(outcome.document["check"], np.array(positions))


def test_people_are_told_machine_by_machine(folder):
    outcome = run_here("check", folder / "paper.st")
    assert outcome.code == 0
    assert "the file is the one that was exported" in outcome.out
    (row,) = (line for line in outcome.out.splitlines() if line.strip().startswith("L1 -20 %"))
    assert row.split("  ")[-1].strip().startswith("hook 2.19")


def test_a_cut_table_names_the_line(folder):
    content = (folder / "paper.csv").read_bytes()
    (folder / "paper.csv").write_bytes(content[: len(content) // 2])
    outcome = run_here("check", folder / "paper.csv")
    assert (outcome.code, outcome.out) == (5, "")
    (error,) = outcome.errors
    assert re.fullmatch(r"Error: line 37\d: .*\.", error)


def test_a_shorter_but_clean_table_does_not_arrive(folder):
    lines = (folder / "paper.csv").read_text("utf-8").split("\n")
    (folder / "paper.csv").write_text("\n".join(lines[:500]) + "\n", "utf-8")
    outcome = run_here("check", folder / "paper.csv")
    assert outcome.code == 4
    assert any("Axis cart ends at" in line and "asks for 0.3 m" in line for line in outcome.errors)


def test_one_cycle_less_fails_too(folder):
    """The same motion without its first sample begins and arrives a cycle early: only the start tells."""
    lines = (folder / "paper.csv").read_text("utf-8").split("\n")
    times = [line.split(",")[0] for line in lines[1:-1]]
    moved = [",".join([time, *line.split(",")[1:]]) for time, line in zip(times, lines[200:-1], strict=False)]
    (folder / "paper.csv").write_text("\n".join([lines[0], *moved]) + "\n", "utf-8")
    outcome = run_here("check", folder / "paper.csv")
    assert outcome.code == 4
    assert any("Axis cart starts at" in line for line in outcome.errors)


def test_an_odd_and_an_even_number_of_setpoints_are_judged_alike(folder):
    """Holding the target for one cycle more changes nothing."""
    content = (folder / "paper.log").read_text("ascii").splitlines()
    content += [line.replace("0000000003.000000", "0000000003.004000") for line in content[-2:]]
    (folder / "longer.log").write_text("\n".join(content) + "\n", "ascii")
    longer, exported = (
        run_here("check", folder / name, "--json").document["check"] for name in ("longer.log", "paper.log")
    )
    assert longer["arrival_s"] == pytest.approx(exported["arrival_s"] + CYCLE)
    for one, other in zip(longer["scenarios"], exported["scenarios"], strict=True):
        assert one["residual_peak_m"] == pytest.approx(other["residual_peak_m"], abs=2e-7)
    assert longer["error_bound_m"] == pytest.approx(exported["error_bound_m"], rel=0.5)


def test_without_a_manifest_the_spec_must_be_named(folder):
    (folder / "manifest.json").unlink()
    outcome = run_here("check", folder / "paper.csv")
    assert (outcome.code, outcome.out) == (2, "")
    (error,) = outcome.errors
    assert "There is no manifest.json beside" in error
    assert error.endswith("SPEC.toml")


@pytest.mark.slow
@pytest.mark.parametrize("how", ["preset", "file"])
def test_with_a_spec_a_lone_artefact_can_be_judged(folder, how):
    (folder / "manifest.json").unlink()
    (folder / "bay.toml").write_text(
        '[plant]\ntype = "double-pendulum-crane"\ng = 9.81\n[move]\ndistance = 0.3\nduration = 3\n', "utf-8"
    )
    spec = ["--preset", "paper"] if how == "preset" else [folder / "bay.toml"]
    outcome = run_here("check", folder / "paper.csv", *spec, "--json")
    assert outcome.code == 0
    assert outcome.document["artefact"]["manifest"] == "none"
    assert "no manifest of this spec" in run_here("check", folder / "paper.csv", *spec).out


def test_another_spec_judges_otherwise(folder):
    stricter = ("--preset", "paper", "--set", "check.residual_sway=0.001")
    outcome = run_here("check", folder / "paper.csv", *stricter, "--json")
    assert outcome.code == 4
    assert outcome.document["check"]["limit_m"] == 0.001
    farther = run_here("check", folder / "paper.csv", "--preset", "paper", "--set", "move.distance=0.4")
    assert farther.code == 4
    assert any("asks for 0.4 m" in line for line in farther.errors)
    assert "line 1: column position_m is in m" in error_of(
        "check", folder / "paper.csv", "--preset", "paper", "--set", "axis.cart.unit=mm", code=5
    )


def test_a_set_without_a_named_spec_is_refused(folder):
    outcome = run_here("check", folder / "paper.csv", "--set", "check.residual_sway=1")
    assert outcome.code == 2
    assert outcome.errors == [
        "Error: --set: changes a spec that is named; the manifest's own stays as it is."
    ]


def damaged(key, value):
    def damage(folder):
        document = json.loads((folder / "manifest.json").read_text("utf-8"))
        document[key] = value
        (folder / "manifest.json").write_text(json.dumps(document), "utf-8")

    return damage


DAMAGES = {
    "no JSON": lambda folder: (folder / "manifest.json").write_bytes(b"{"),
    "binary": lambda folder: (folder / "manifest.json").write_bytes(bytes(range(256))),
    "no object": lambda folder: (folder / "manifest.json").write_bytes(b"[1]"),
    "spec is a number": damaged("spec", 3),
    "spec is a text": damaged("spec", "paper"),
    "spec is empty": damaged("spec", {}),
    "spec without a move": damaged("spec", {"plant": {"type": "double-pendulum-crane"}}),
    "spec of a plant that is not installed": damaged("spec", {"plant": {"type": "x"}, "move": {}}),
    "a hash is a list": damaged(
        "artefacts", [{"format": "csv", "path": "paper.csv", "sha256": [], "bytes": 1}]
    ),
    "artefacts is a number": damaged("artefacts", 3),
    "another version": damaged("format_version", 99),
}


@pytest.mark.slow
@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES.keys())
def test_a_damaged_manifest_is_a_sentence(folder, damage):
    damage(folder)
    outcome = run_here("check", folder / "paper.csv")
    assert (outcome.code, outcome.out) == (2, "")
    assert "manifest.json" in outcome.errors[0]
    assert all(not line.startswith("Error: Internal") for line in outcome.errors)


def empty(path):
    path.write_bytes(b"")


def binary(path):
    path.write_bytes(np.random.default_rng(1).bytes(5000))


def a_folder(path):
    path.unlink()
    path.mkdir()


def gone(path):
    path.unlink()


@pytest.mark.parametrize("name", ["paper.csv", "paper.st", "paper.log"])
@pytest.mark.parametrize(("ruin", "code"), [(empty, 5), (binary, 5), (a_folder, 2), (gone, 2)])
def test_what_is_no_artefact_is_one_sentence(folder, name, ruin, code):
    ruin(folder / name)
    outcome = run_here("check", folder / name)
    assert (outcome.code, outcome.out) == (code, "")
    (error,) = outcome.errors
    assert re.match(r"Error: (?!Internal).*\.$", error)


def test_a_suffix_that_no_format_has_is_a_sentence(folder):
    for name in ("paper.txt", "paper"):
        if not (folder / name).exists():
            (folder / name).write_bytes(b"")
        outcome = run_here("check", folder / name)
        assert outcome.code == 2
        assert "no format has the suffix" in outcome.errors[0]


def test_a_file_that_goes_with_a_motion_names_the_one_that_holds_it(folder):
    assert run_here("report", folder / "paper.asc").errors[-1].endswith("which holds the motion; name that.")


def test_a_setpoint_that_no_machine_can_follow_is_named(folder):
    table = folder / "paper.csv"
    table.write_text(altered_row(table.read_text(), 100, 1e8))
    outcome = run_here("check", table)
    assert (outcome.code, outcome.out) == (4, "")
    assert "The setpoint of cart at 0.396 s lies off the others" in outcome.errors[0]


def test_the_folder_itself_is_no_artefact(folder):
    named = f"Is a directory; name a file in it, such as {folder / 'paper.csv'}."
    for command in ("check", "report", "deploy --to opc.tcp://127.0.0.1:9", "stream --channel none"):
        outcome = run_here(*command.split(), folder)
        assert (outcome.code, outcome.errors) == (2, [f"Error: Cannot read {folder}: {named}"])


def test_a_folder_whose_manifest_lists_nothing_is_no_artefact_either(folder, tmp_path):
    document = json.loads((folder / "manifest.json").read_text("utf-8")) | {"artefacts": []}
    del document[SEAL]
    (tmp_path / "manifest.json").write_text(json.dumps(document | {SEAL: seal_of(document)}), "utf-8")
    outcome = run_here("check", tmp_path)
    assert outcome.errors == [f"Error: Cannot read {tmp_path}: Is a directory; name a file in it."]


@pytest.mark.slow
def test_two_specs_may_share_a_folder(tmp_path):
    """Each artefact keeps its own spec and verdict; a second export of one format keeps the first's."""
    short = ("--set", "name=short", "--set", "move.distance=0.1")
    assert run_here("--export", "csv", "--out", tmp_path).code == 0
    assert run_here(*short, "--export", "csv", "--out", tmp_path).code == 0
    assert run_here(*short, "--export", "plc", "--out", tmp_path).code == 0
    for file, name in (("paper.csv", "paper"), ("short.csv", "short"), ("short.st", "short")):
        outcome = run_here("check", tmp_path / file, "--json")
        found = (outcome.code, outcome.document["name"], outcome.document["artefact"]["manifest"])
        assert found == (0, name, "matches")
    (tmp_path / "paper.csv").write_text(altered_row((tmp_path / "paper.csv").read_text(), 1000, 1.02))
    outcome = run_here("check", tmp_path / "paper.csv", "--json")
    assert (outcome.code, outcome.document["name"]) == (4, "paper")
    assert outcome.document["artefact"]["manifest"] == "differs"


@pytest.mark.slow
def test_a_variant_of_a_motion_with_hoist_is_judged_as_the_block_would_play_it(tmp_path):
    done = run_here("--preset", "single-pendulum-crane", "--export", "plc", "--out", tmp_path)
    assert done.code == 0
    (block,) = tmp_path.glob("*.st")
    assert re.search(
        r"Axis 1, cart: [^.]*\.[^;]*; on the way 0 to 12000 mm; allows fScale from 0, bMirror, "
        r"fStartOffset\.",
        block.read_text(),
    )
    assert "allows no variants." in block.read_text()
    found = {}
    for words in (
        "",
        "--scale cart=0.5",
        "--mirror cart",
        "--scale cart=0.5 --scale hoist=0.5",
        "--offset hoist=3",
    ):
        done = run_here("check", block, *words.split(), "--scenario", "1", "--json")
        document = json.loads(done.out)
        assert (document["variant"] is None) == (words == "")
        found[words] = document["check"]["scenarios"][0]["residual_peaks_m"]["payload"], done.code
    planned, code = found.pop("")
    assert code == 0
    assert found.pop("--mirror cart") == (pytest.approx(planned, abs=1e-8), 0)
    smaller, code = found.pop("--scale cart=0.5")
    assert smaller < 0.6 * planned and code == 0
    assert all(sway > 0.05 and code == 4 for sway, code in found.values())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--scale crat=0.5", "no axis 'crat'; did you mean 'cart'"),
        ("--scale 1.5", "--scale cart=1.5: a playback block takes 0 to 1"),
        ("--scale 0,5", "'0,5' is no number; write a decimal point: 0.5."),
        ("--offset cart=far", "'far' is no number"),
        ("--mirror 7", "no axis '7'"),
    ],
)
def test_a_variant_that_is_none_is_refused(folder, words, message):
    assert message in error_of("check", folder / "paper.csv", *words.split())
