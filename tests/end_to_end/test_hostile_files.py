"""Files that mean harm: without an end, nested without an end, or such that a parser would go over them again
and again (then a test here does not come to an end)."""

import errno
import io
import json
import zipfile
from pathlib import Path

import pytest
from command_line import run_here

from gen_profile.presentation.studio.state import opened_start
from gen_profile.support.artefacts.manifest import FILENAME
from gen_profile.support.bounded_file import read_bounded
from gen_profile.support.errors import CosimulationError, SpecError
from gen_profile_fmu.running.safe_archive import unpack

HUGE = 100_000_000_000  # bytes, none of which the disk holds
DOTS = "a" + ".a" * 100_000 + " = 1"
FOREIGN = '{fmu="foreign.fmu", input={acceleration="u"}, output={sway="y"}, parameters={L1="L1"}}'
SCL = 'FUNCTION_BLOCK "a" { x } VERSION : 0.1\n'


@pytest.fixture(scope="module")
def deployed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("deployed")
    assert run_here("--preset", "paper", "--no-check", "--out", folder).code == 0
    return folder


def huge(path):
    with path.open("wb") as file:
        file.truncate(HUGE)
    return path


def the_sentence(outcome):
    (error,) = outcome.errors
    assert error.startswith("Error: ") and "Internal" not in error
    return error


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("spec.toml", ["FILE"]),
        ("paper.csv", ["check", "FILE", "--preset", "paper"]),
        ("paper.st", ["check", "FILE", "--preset", "paper"]),
        ("manifest.json", ["check", "paper.csv"]),
        ("manifest.json", ["--preset", "paper", "--no-check", "--out", "."]),
        ("c.cert", ["check", "paper.csv", "--certificate", "FILE"]),
        ("own.py", ["--preset", "paper", "--set", 'plant.file="own.py"']),
        (
            "foreign.fmu",
            ["spec.toml", "--set", f"check={FOREIGN}"],
        ),
        (
            "swing.csv",
            ["identify", "--preset", "paper", "--swing", "FILE", "--columns", "1,2", "--free", "L1"],
        ),
        ("block.st", ["planner", "play", "FILE", "--commands", "spec.toml", "--out", "x.csv"]),
        ("sweep.json", ["sweep", "spec.toml", "--vary", "move.distance=0.1,0.2", "--out", "."]),
        ("sweep.json", ["library", ".", "--out", "x.st"]),
    ],
)
def test_a_file_is_read_up_to_a_size(tmp_path, monkeypatch, deployed, name, words):
    monkeypatch.chdir(tmp_path)
    for file in deployed.iterdir():
        Path(file.name).write_bytes(file.read_bytes())
    Path("spec.toml").write_text(run_here("presets", "paper").out, "utf-8")
    huge(Path(name))
    outcome = run_here(*(name if word == "FILE" else word for word in words))
    assert outcome.code == 2
    assert f"{name}" in (error := the_sentence(outcome))
    assert "larger than" in error or "more than" in error


def test_a_device_that_never_ends_is_no_file():
    with pytest.raises(OSError, match="larger than 3 MiB") as caught:
        read_bounded(Path("/dev/zero"), 3 << 20)
    assert caught.value.errno == errno.EFBIG


@pytest.mark.parametrize("more", [-1, 0, 1])
@pytest.mark.parametrize("most", [1, 1 << 20, 5 << 19])
def test_a_file_is_read_whole_or_not_at_all(tmp_path, most, more):
    content = bytes(range(256)) * (most // 256 + 1)
    (tmp_path / "file").write_bytes(content[: most + more])
    if more > 0:
        with pytest.raises(OSError, match="larger than"):
            read_bounded(tmp_path / "file", most)
    else:
        assert read_bounded(tmp_path / "file", most) == content[: most + more]


@pytest.mark.parametrize("content", ["[" * 200_000, '{"a":' * 200_000, "Infinity", "[1e999]"])
def test_brackets_in_json_are_no_manifest_and_no_certificate(tmp_path, deployed, content):
    for file in deployed.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / FILENAME).write_text(content)
    assert "not a manifest" in the_sentence(run_here("check", tmp_path / "paper.csv"))
    (tmp_path / "c.cert").write_text(content)
    words = ["check", deployed / "paper.csv", "--certificate", tmp_path / "c.cert"]
    error = the_sentence(run_here(*words, "--json"))
    assert "of another version of gen-profile (arrays or objects" in error or "no finite number" in error
    assert run_here("--preset", "paper", "--no-check", "--out", tmp_path).code == 0  # and writes another one
    assert json.loads((tmp_path / FILENAME).read_text())["earlier"] == []


@pytest.mark.parametrize(
    "text", [DOTS, f"[{DOTS[:-4]}]", "x = {" + DOTS + "}", '"a\\"" . ' * 100_000 + "b = 1"]
)
def test_a_key_of_many_parts_is_no_toml(tmp_path, text):
    (tmp_path / "spec.toml").write_text(f"\n{text}\n")
    error = the_sentence(run_here(tmp_path / "spec.toml"))
    assert error.endswith("spec.toml: not valid TOML: a key of more than 32 parts (at line 2).")
    with pytest.raises(SpecError, match="a key of more than 32 parts"):
        opened_start("spec.toml", text[-200_000:].encode(), tmp_path)


def test_a_key_of_many_parts_is_no_value_either():
    assert "found text '1" in the_sentence(run_here("--preset", "paper", "--set", f"plant.L1=1\n{DOTS}"))
    sweep = ["sweep", "--preset", "paper", "--vary", f"plant.L1=1]\n{DOTS}\nb=[1,2"]
    assert run_here(*sweep).code == 2


def test_a_ruler_of_dots_is_a_comment(tmp_path):
    text = f"# {200 * '.'}\n# {200 * '. '}\n{run_here('presets', 'paper').out}"
    (tmp_path / "spec.toml").write_text(text, "utf-8")
    assert run_here(tmp_path / "spec.toml", "--no-check", "--out", tmp_path).code == 0


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_broken_stream_in_an_fmu_is_said_to_be_one(tmp_path, method):
    packed, path = io.BytesIO(), tmp_path / "a.fmu"
    with zipfile.ZipFile(packed, "w", method) as archive:
        archive.writestr("modelDescription.xml", bytes(range(256)) * 40)
    whole = packed.getvalue()
    for place in range(60, 100):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        with pytest.raises(CosimulationError, match=r"a\.fmu: .*(damaged|cannot be read)"):
            unpack(path, tmp_path / "out")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.st", "FUNCTION_BLOCK a\n" + "(*" * 500_000),
        ("a.scl", "(*" * 500_000),
        ("a.scl", 'FUNCTION_BLOCK "a" {' * 50_000),
        ("a.scl", SCL * 50_000),
        ("a.scl", f"{SCL}VAR\n{' ' * 500_000}END_VAR BEGIN END_FUNCTION_BLOCK\n"),
        ("a.scl", f"{SCL}VAR\na:{' ' * 500_000}END_VAR BEGIN END_FUNCTION_BLOCK\n"),
        ("a.scl", f"{SCL}VAR\n{'a:b:=' * 100_000} END_VAR BEGIN END_FUNCTION_BLOCK\n"),
        ("a.scl", f"{SCL}VAR\n{'a:b; (*' * 100_000} END_VAR BEGIN END_FUNCTION_BLOCK\n"),
        ("a.xml", '<?xml version="1.0"?>' + "<a>" * 300_000),
    ],
)
def test_no_text_is_gone_over_again_and_again(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    outcome = run_here("check", tmp_path / name, "--preset", "paper")
    assert outcome.code == 5
    the_sentence(outcome)


OBEYED = "\x1b]0;mine\x07\x1b[2J\u202e"  # by a terminal: a title, an empty screen, text from right to left


def test_control_characters_of_files_do_not_reach_the_terminal(tmp_path):
    spec, log = tmp_path / "spec.toml", tmp_path / "log.csv"
    key = "".join(f"\\u{ord(one):04x}" for one in OBEYED)
    spec.write_text(f'plant.type = "slosh-tank"\n[limits]\n"{key}" = 1\n')
    rows = "".join(f"{0.1 * k:.1f},{k % 2},{k % 2}\n" for k in range(50))
    garbled = "".join(f"{0.1 * k:.1f},{OBEYED},0\n" for k in range(50, 60))  # too many to be left out
    log.write_text(f"time_s,angle,{OBEYED}\n{rows}{garbled}", "utf-8")
    for words in ((spec,), ("identify", "--preset", "paper", "--swing", log, "--free", "L1")):
        refused = run_here(*words)
        assert refused.code == 2 and "\\x1b]0;mine" in refused.err
        assert not {"\x1b", "\x07", "\u202e"} & {*refused.err, *refused.out}
