"""Planner blocks beside a manifest that is not theirs: one true sentence, no proof, nothing written."""

import re

import pytest
from command_line import error_of, run_here

from gen_profile.delivery.deployment.table import read_table
from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile.support.artefacts.manifest import Artefact, Manifest, sha256
from gen_profile.support.errors import OutputError
from gen_profile.support.progress import no_progress

BAY = """
name = "bay"
plant = { type = "double-pendulum-crane", m1 = 350.0, m2 = 2000.0, L1 = 6.0, L2 = 1.5 }
move = { distance = 8.0, duration = 14.0 }
limits = { velocity = 1.0, acceleration = 0.3, jerk = 1.0, travel = [0.0, 40.0] }
planner = { live = { L1 = [5.0, 7.0] } }
export = { cycle_time = 0.004 }
"""


def manifest(spec, path, format_, sha256="0" * 64, **written):
    return Manifest(
        name=spec.name,
        spec=spec.to_dict(),
        spec_sha256=spec.sha256(),
        profile_sha256="",
        versions={},
        artefacts=(Artefact(format=format_, path=path, sha256=sha256, bytes=1),),
        check={"passed": True, **written},
    ).to_json()


BLOCK = planner_block(parse_spec(BAY)).text
OF_ANOTHER = (
    r"manifest\.json is of the {}, not of the planner block bay\.st; put the one there that was written"
)
FOREIGN = {
    "a motion's": (manifest(preset_spec("paper"), "paper.st", "plc"), OF_ANOTHER.format("motion paper.st")),
    "a motion's of its name": (
        manifest(parse_spec(BAY), "bay.st", "plc"),
        OF_ANOTHER.format("motion bay.st"),
    ),
    "another block's": (
        manifest(parse_spec(BAY), "quay.st", "planner"),
        OF_ANOTHER.format("planner block quay.st"),
    ),
    "a web page's": (b'{"name": "app", "icons": []}', "not a manifest of this version of gen-profile"),
    "a list": (b"[1, 2]", "not a manifest of this version of gen-profile"),
    "no JSON": (b"\xff\xfe", "not a manifest of this version of gen-profile"),
    "none": (None, r"There is no manifest\.json beside bay\.st; put the one there that was written with it"),
}
COMMANDS = {
    "check": ("check", "bay.st"),
    "report": ("report", "bay.st", "--out", "bay.html"),
    "stream": (
        *("stream", "--planner", "bay.st", "--commands", "commands.csv"),
        *("--interface", "virtual", "--channel", "foreign", "--simulate-drive"),
    ),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bay.st").write_text(BLOCK)
    (tmp_path / "bay.toml").write_text(BAY)
    (tmp_path / "commands.csv").write_text("time_s,command,value\n0,position,0.1\n")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("whose", FOREIGN)
@pytest.mark.parametrize("command", COMMANDS)
def test_it_is_told_whose_the_manifest_is(folder, whose, command):
    content, words = FOREIGN[whose]
    if content is not None:
        (folder / "manifest.json").write_bytes(content)
    before = sorted(folder.iterdir())
    refused = run_here(*COMMANDS[command])
    assert (refused.code, len(refused.errors)) == (2, 1)
    assert re.search(words, refused.err)
    named = "or name its spec: gen-profile check bay.st SPEC.toml" in refused.err
    assert named == (command != "stream")
    assert sorted(folder.iterdir()) == before


def test_a_motion_beside_a_block_s_manifest_is_not_judged_by_its_spec(folder):
    (folder / "manifest.json").write_bytes(FOREIGN["another block's"][0])
    (folder / "paper.csv").write_text("")
    refused = run_here("check", "paper.csv")
    assert (refused.code, len(refused.errors)) == (2, 1)
    assert "is of the planner block quay.st, not of the motion paper.csv" in refused.err


@pytest.mark.slow
@pytest.mark.parametrize("whose", ["a motion's of its name", "a web page's"])
def test_a_spec_that_is_named_needs_no_manifest(folder, whose):
    (folder / "manifest.json").write_bytes(FOREIGN[whose][0])
    judged = run_here("check", "bay.st", "bay.toml", "--histories", 2, "--json")
    assert (judged.code, judged.document["artefact"]["manifest"]) == (0, "none")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"L1 = [5.0, 7.0]": "L2 = [1.4, 1.6]"}, "bay.st is no block of this spec: only one .* input fL1;"),
        ({"acceleration = 0.3, ": ""}, "limits.acceleration: required for a planner block"),
    ],
)
def test_a_spec_of_something_else_is_refused(folder, changes, words):
    other = BAY
    for old, new in changes.items():
        other = other.replace(old, new)
    (folder / "other.toml").write_text(other)
    refused = run_here("check", "bay.st", "other.toml")
    assert (refused.code, len(refused.errors)) == (2, 1)
    assert re.search(words, refused.err)


@pytest.mark.slow
@pytest.mark.parametrize("count", ["many", 0, -5, None, 1.5, True])
def test_a_number_of_histories_that_means_nothing_is_refused(tmp_path, count):
    (tmp_path / "bay.st").write_text(BLOCK)
    written = manifest(parse_spec(BAY), "bay.st", "planner", sha256(BLOCK.encode()), histories=count)
    (tmp_path / "manifest.json").write_bytes(written)
    assert f"check.histories must be a whole number from 1 on, found {count!r}" in error_of(
        "check", tmp_path / "bay.st"
    )
    table = read_table(tmp_path / "bay.st")
    with pytest.raises(OutputError, match="whole number from 1 on"):
        table.check(table.values, no_progress)


RECORDS = [{}, {"seed": "x", "search_parents": []}, {"seed": 0, "search_parents": [[9]]}]


@pytest.mark.slow
@pytest.mark.parametrize("record", RECORDS)
def test_what_a_record_lacks_to_replay_a_history_is_found_anew(tmp_path, record):
    (tmp_path / "bay.st").write_text(BLOCK)
    written = manifest(parse_spec(BAY), "bay.st", "planner", sha256(BLOCK.encode()), histories=2, **record)
    (tmp_path / "manifest.json").write_bytes(written)
    outcome = run_here("check", tmp_path / "bay.st", "--history", 1)
    assert outcome.code == 0, outcome.err
