"""Bad input: its exit code, one clear sentence per fault, no traceback, and nothing written."""

import re

import pytest
from command_line import run_here, run_process

WHOLE = '[plant]\ntype = "double-pendulum-crane"\n[move]\ndistance = 0.3\nduration = 3.0\n'


def without(text, line):
    assert line in text
    return text.replace(line, "")


# content of the spec file, and a pattern for every fault
FILES = {
    "empty file": ("", [r"spec\.toml: the spec is empty; .*\[plant\] type and \[move\]\."]),
    "malformed": ("[plant\n", [r"spec\.toml: not valid TOML: .*line 1, column \d+.*\."]),
    "all at once": (
        WHOLE.replace("0.3", '"far"').replace("3.0", "0")
        + "[limits]\njerk = -1\n[expert]\n[can]\nnode = 200\n",
        [
            r"move\.distance: .*text 'far'\.",
            r"move\.duration: .*found 0(\.0)?\.",
            r"limits\.jerk: .*found -1(\.0)?\.",
            r"expert: unknown key; did you mean 'export'\?",
            r"can\.node: .*found 200\.",
        ],
    ),
}
# arguments, and a pattern for every fault
ARGUMENTS = {
    "no key": (["--set", "0.5"], [r"--set '0\.5': write KEY=VALUE, .*\."]),
    "decimal comma": (
        ["--cycle-time", "0,001"],
        [r"export\.cycle_time: .*'0,001'; write .* 0\.001\.", r"can\.sync_period: .*'0,001'; write .*\."],
    ),
    "unknown preset": (
        ["--preset", "papre"],
        [r".* unknown preset 'papre'; did you mean 'paper'\?.*"],
    ),
    "unknown format": (["--export", "cvs"], [r"--export: unknown format 'cvs'; did you mean 'csv'\?.*"]),
    "command of a group": (
        ["explain", "events.csv"],
        [r"There is no command or spec explain; did you mean 'planner explain'\?"],
    ),
    "command that is none": (
        ["draw", "bay.st"],
        [r"There is no command or spec draw \(known: .*check, .*\)\."],
    ),
    "missing file": (["bay.toml"], [r"Cannot read the spec bay\.toml: No such file or directory\."]),
    "name too long": ([300 * "x"], [r"Cannot read the spec x+: File name too long\."]),
    "folder as spec": (["."], [r"Cannot read the spec \.: Is a directory; name a file in it\."]),
    "both": (["spec.toml", "--preset", "paper"], [r"--preset: name either .*, not both\."]),
    "mistyped command": (["compar"], [r".* compar; did you mean 'compare'\?"]),
    "options first": (
        ["--json", "compare"],
        [r".*; a command comes before its options: .* compare …"],
    ),
}


def assert_faults(outcome, folder, patterns, code=2):
    assert outcome.code == code
    assert "Traceback" not in outcome.err
    errors = [line for line in outcome.err.splitlines() if line.startswith("Error: ")]
    assert len(errors) == len(outcome.err.splitlines()) == len(patterns)
    for pattern in patterns:
        assert any(re.fullmatch(f"Error: (.*/)?{pattern}", error) for error in errors), (pattern, errors)
    assert {path.name for path in folder.iterdir()} <= {"spec.toml"}


@pytest.mark.parametrize(("text", "patterns"), FILES.values(), ids=FILES.keys())
def test_a_faulty_spec_file(tmp_path, monkeypatch, text, patterns):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spec.toml").write_text(text, "utf-8")
    assert_faults(run_here("spec.toml"), tmp_path, patterns)


@pytest.mark.parametrize(("words", "patterns"), ARGUMENTS.values(), ids=ARGUMENTS.keys())
def test_faulty_arguments(tmp_path, monkeypatch, words, patterns):
    monkeypatch.chdir(tmp_path)
    assert_faults(run_here(*words), tmp_path, patterns)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"name = '\xe9'\n"])
def test_a_spec_that_is_no_utf_8(tmp_path, monkeypatch, content):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spec.toml").write_bytes(content)
    assert_faults(run_here("spec.toml"), tmp_path, [r"spec\.toml: not UTF-8 text .byte \d.; save the .*\."])


@pytest.mark.parametrize(
    "words", [("--set", "plant.m1=-1", "--set", "move.duration=0"), ("--preset", "papre")]
)
@pytest.mark.parametrize("command", [(), ("design",), ("compare",)])
def test_errors_are_one_json_document_too(tmp_path, monkeypatch, command, words):
    monkeypatch.chdir(tmp_path)
    outcome = run_here(*command, *words, "--json")
    error = outcome.document["error"]
    assert outcome.code == error["exit_code"] == 2
    assert error["type"] == "SpecError"
    assert [f"Error: {line}" for line in error["message"].splitlines()] == outcome.errors


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["design", "--expor", "csv"], "No such option"),
        (["design", "--cycle-time"], "requires an argument"),
        (["design", "spec.toml", "other.toml"], "unexpected extra argument"),
        (["compare", "--plott", "x"], "No such option"),
        (["check"], "Missing argument 'ARTEFACT'"),
        (["formats", "csv"], "unexpected extra argument"),
        (["robustness", "--range", "nan"], "'nan' is no finite number"),
        (["deploy", "a.st", "--to", "opc.tcp://127.0.0.1:1", "--for", "nan"], "'nan' is no finite number"),
        (["identify", "--after", "inf"], "'inf' is no finite number"),
    ],
)
def test_misused_arguments(tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    outcome = run_here(*words)
    assert outcome.code == 2
    assert message in outcome.errors[-1]
    assert outcome.out == ""
    command, *others = words
    outcome = run_here(command, "--json", *others)
    assert outcome.code == outcome.document["error"]["exit_code"] == 2
    assert message in outcome.document["error"]["message"]
    assert "Traceback" not in outcome.err


@pytest.mark.parametrize("words", [("report", "name.csv"), ("compare", "--plot", "name.png")])
def test_a_path_that_no_system_takes_is_named(words):
    *options, last = words
    found = run_here(*options, last.replace("name", 300 * "n"))
    assert found.code == 2
    assert re.fullmatch(r"Error: Cannot use n+\.\w+: File name too long\.\n", found.err)


def test_a_block_that_is_not_there_is_said_before_what_else_is_missing():
    outcome = run_here("planner", "play", "missing.st")
    assert outcome.code == 2 and "'missing.st' does not exist" in outcome.errors[-1]


@pytest.mark.slow
def test_what_a_target_cannot_take_is_refused_with_the_cure(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bus = ("--export", "can", "--set", "can.bitrate=10000")
    refused = run_here(*bus)
    assert refused.code == 5
    (error,) = refused.errors
    period = re.search(r"set ([\d.]+) s or more", error)[1]
    assert list(tmp_path.iterdir()) == []
    assert run_here(*bus, "--set", f"can.sync_period={period}").code in (0, 4)


@pytest.mark.slow
def test_an_impossible_move_is_refused_with_the_cure(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused = run_here("--preset", "flexible-joint", "--set", "move.duration=0.1")
    assert refused.code == 3
    assert all(line.startswith("Error: ") for line in refused.errors)
    assert "move." in refused.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_installed_program_shows_no_traceback(tmp_path):
    (tmp_path / "spec.toml").write_text(FILES["all at once"][0], "utf-8")
    outcome = run_process("spec.toml", cwd=tmp_path)
    assert_faults(outcome, tmp_path, FILES["all at once"][1])


@pytest.mark.slow
def test_debugging_shows_the_traceback(tmp_path):
    outcome = run_process("--preset", "papre", "--debug", cwd=tmp_path)
    assert outcome.code == 1
    assert "Traceback" in outcome.err
    assert "SpecError" in outcome.err
