"""Files that go with the one that is named, as wrappers: altered, swapped, missing, or named themselves."""

import json
import shutil

import pytest
from command_line import run_here
from simulated_blocks import deliver_planner

from gen_profile.assurance.certificate.from_file import certify_artefact
from gen_profile.assurance.proof.check import check_block, is_planner_block
from gen_profile.assurance.verification.check import check_artefact
from gen_profile.delivery.deployment.table import read_table
from gen_profile.delivery.designs.design import design
from gen_profile.delivery.streaming.stream import verified, verified_block
from gen_profile.planner.design import planner_block
from gen_profile.planner.forms import PROGRAMS, block_files
from gen_profile.presentation.report.build import artefact_report
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import CheckFailed, ExportError
from gen_profile_exporters.registry import containers, formats

SPEC = preset_spec("paper", ["export.cycle_time=0.01"])
COMPANIONS = {
    "paper.log": ["paper.asc", "paper.blf", "paper.dbc", "paper.startup.csv", "paper.node1.cdcf"],
    "paper.scl": ["paper_velocity.scl", "paper_cam.scl"],
    "FB_paper.TcPOU": ["FB_paper_Axis.TcPOU", "GVL_paper.TcGVL"],
}
PAIRS = [(main, one) for main, names in COMPANIONS.items() for one in names]
PLANNED = preset_spec("bay-crane", ["planner.zones=false", "planner.events=false"])


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    design(SPEC, list(formats()), folder, check=False)
    return folder


@pytest.fixture
def folder(exported, tmp_path):
    return shutil.copytree(exported, tmp_path / "deploy")


def alter(path):
    """Change one character in the middle."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def test_all_companions_of_all_formats_are_tried(exported):
    by_format = {}
    for one in json.loads((exported / "manifest.json").read_bytes())["artefacts"]:
        by_format.setdefault(one["format"], []).append(one["path"])
    assert by_format.keys() == formats().keys()
    assert {first: others for first, *others in by_format.values() if others} == COMPANIONS


@pytest.mark.slow
@pytest.mark.parametrize(("main", "companion"), PAIRS)
def test_one_altered_character_of_a_companion_fails_the_check(folder, main, companion):
    due = dict.fromkeys(COMPANIONS[main], "matches")
    assert check_artefact(folder / main, row=0).companions == due
    alter(folder / companion)
    judged = check_artefact(folder / main, row=0)
    assert (judged.manifest, judged.companions) == ("matches", due | {companion: "differs"})
    (fault,) = judged.check.faults
    assert fault.startswith(f"{companion} is not the one that was exported with {main}: ")
    assert not judged.passed


@pytest.mark.parametrize(
    ("main", "use"),
    [
        ("FB_paper.TcPOU", read_table),
        ("FB_paper.TcPOU", certify_artefact),
        ("FB_paper.TcPOU", artefact_report),
        ("paper.log", lambda path: verified(path, accept_unverified=True)),
    ],
)
def test_nothing_else_takes_a_file_with_an_altered_companion(folder, main, use):
    alter(folder / COMPANIONS[main][0])
    with pytest.raises(
        CheckFailed, match=f"^{COMPANIONS[main][0]} is not the one that was exported with {main}"
    ):
        use(folder / main)


def test_a_companion_that_is_named_is_compared_before_its_file_is_named(folder):
    words = "; it goes with paper.log, which holds the motion; name that."
    intact, altered = folder / "paper.dbc", folder / "paper.startup.csv"
    alter(altered)
    outcome = run_here("check", intact)
    assert (outcome.code, outcome.errors) == (2, [f"Error: {intact} is the one that was exported{words}"])
    outcome = run_here("check", altered)
    assert (outcome.code, outcome.errors) == (
        4,
        [f"Error: {altered} is NOT the one that was exported{words}"],
    )


def test_a_missing_companion_is_noted_and_one_of_another_delivery_fails(folder, tmp_path):
    """The second motion is farther, and lies in the same folder and another one."""
    other = preset_spec("paper", ["export.cycle_time=0.01", "move.distance=0.31", "name='other'"])
    for place in (folder, tmp_path / "other"):
        design(other, ["twincat"], place, check=False)
    alone = folder / "copy.TcPOU"
    (folder / "FB_paper.TcPOU").rename(alone)
    (folder / "GVL_paper.TcGVL").unlink()
    outcome = run_here("check", alone, "--scenario", 0)
    assert outcome.code == 0
    assert "FB_paper_Axis.TcPOU as exported; GVL_paper.TcGVL missing, not compared" in outcome.out
    shutil.copy(tmp_path / "other/GVL_other.TcGVL", folder / "GVL_paper.TcGVL")
    outcome = run_here("check", alone, "--scenario", 0, "--json")
    document = outcome.document
    assert (outcome.code, document["check"]["passed"]) == (4, False)
    due = {"FB_paper_Axis.TcPOU": "matches", "GVL_paper.TcGVL": "differs"}
    assert document["artefact"]["companions"] == due
    assert check_artefact(folder / "FB_other.TcPOU", row=0).passed
    spec = ("--preset", "paper", "--set", "export.cycle_time=0.01", "--set", "limits.velocity=0.5")
    named = run_here("check", alone, *spec, "--scenario", 0)
    assert "no manifest of this spec" in named.out and named.code == 4


def test_two_motions_whose_files_changed_places_fail_the_check(tmp_path):
    """Each was found in the manifest by its content, and passed as the other."""
    other = preset_spec("paper", ["export.cycle_time=0.01", "move.distance=0.31", "name='other'"])
    for spec in (SPEC, other):
        design(spec, ["csv"], tmp_path, check=False)
    paths = [tmp_path / f"{name}.csv" for name in ("paper", "other")]
    assert all(check_artefact(path, row=0).passed for path in paths)
    contents = [path.read_bytes() for path in paths]
    for path, content in zip(paths, reversed(contents), strict=True):
        path.write_bytes(content)
    for path in paths:
        judged = check_artefact(path, row=0)
        assert (judged.manifest, judged.spec.name, judged.passed) == ("differs", path.stem, False)
        due = f"{path.name} is not what manifest.json beside it lists"
        assert any(fault.startswith(due) for fault in judged.check.faults)
    copy = tmp_path / "copy.csv"
    copy.write_bytes(contents[1])
    assert check_artefact(copy, row=0).spec.name == "other"
    copy.write_bytes(contents[1] + b"\n")
    *_, fault = check_artefact(copy, row=0).check.faults
    assert fault.startswith(
        "copy.csv is none of the files that manifest.json beside it lists, which is of the motion other.csv"
    )


def test_a_companion_that_only_an_earlier_export_wrote_is_noted(tmp_path):
    """It was neither compared nor mentioned."""
    for node in (1, 2):
        design(
            preset_spec("paper", ["export.cycle_time=0.01", f"can.node={node}"]),
            ["can"],
            tmp_path,
            check=False,
        )
    outcome = run_here("check", tmp_path / "paper.log", "--scenario", 0)
    assert outcome.code == 0
    assert "; paper.node1.cdcf NOT of this export but left over from an earlier one" in outcome.out
    assert "paper.node2.cdcf as exported" in outcome.out
    (tmp_path / "paper.node1.cdcf").unlink()
    assert "paper.node1" not in run_here("check", tmp_path / "paper.log", "--scenario", 0).out


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    """A planner block in all forms that take it, as if it were proved."""
    folder = tmp_path_factory.mktemp("planned")
    names = [*containers(), *PROGRAMS]
    files = block_files(planner_block(PLANNED), PLANNED, names)
    deliver_planner(folder, PLANNED, files, passed=True, histories=1)
    return folder, [file.filename for file in files]


@pytest.mark.slow
def test_no_file_of_a_planner_block_may_be_altered(planned):
    folder, (main, *others) = planned
    assert len(others) > 10
    for name in others:
        content = (folder / name).read_bytes()
        alter(folder / name)
        for use in (verified_block, read_table)[: 1 + (name == others[0])]:
            with pytest.raises(CheckFailed, match=f"^{name} is not the one that was exported with {main}"):
                use(folder / main)
        (folder / name).write_bytes(content)
    assert verified_block(folder / main)[0] == PLANNED


@pytest.mark.slow
def test_a_planner_blocks_wrapper_or_program_that_is_named_is_compared(planned):
    folder, names = planned
    path = folder / next(name for name in names if name.endswith("_Axis.TcPOU"))
    program = folder / next(name for name in names if name.endswith(".c"))
    for one, words in ((path, "it holds a planner block's wrapper"), (program, "a program is not read back")):
        content = one.read_bytes()
        with pytest.raises(ExportError, match=f" is the one that was exported; {words}"):
            is_planner_block(one)
        one.write_bytes(content.replace(b"cUnits", b"cUnity").replace(b"0", b"1"))
        with pytest.raises(CheckFailed, match=f" is NOT the one that was exported; {words}"):
            is_planner_block(one)
        one.write_bytes(content)


@pytest.mark.slow
def test_an_altered_wrapper_fails_the_proof_of_its_block(planned):
    folder, (main, *others) = planned
    content = (folder / others[0]).read_bytes()
    alter(folder / others[0])
    judged = check_block(folder / main)
    (folder / others[0]).write_bytes(content)
    due = dict.fromkeys(others, "matches") | {others[0]: "differs"}
    assert judged.to_dict()["artefact"]["companions"] == due and not judged.check.passed
    assert any(reason.startswith(f"{others[0]} is not the one") for reason in judged.check.reasons())
