"""The command line by itself: lists, help, where the default command steps in, and its streams."""

import io
import json
import logging
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete
from command_line import PROGRAM, run_here, run_process

from gen_profile.cli import progress
from gen_profile.cli.entry import LATER, cli

COMMANDS = sorted(cli.commands)


@pytest.mark.parametrize("command", [[], *([name] for name in COMMANDS)], ids="".join)
def test_help_ends_with_an_example(command):
    outcome = run_here(*command, "--help")
    assert (outcome.code, outcome.err) == (0, "")
    (example,) = (line.strip() for line in outcome.out.splitlines() if line.strip().startswith("Example: "))
    assert example.startswith("Example: gen-profile")


def test_the_root_s_help_shows_the_default_command_s_options_and_all_commands():
    text = run_here("--help").out
    assert "[SPEC.toml] [OPTIONS]" in text
    assert "COMMAND [ARGS]" in text
    for option in ("--preset", "--set", "--export", "--out", "--cycle-time", "--no-check", "--keep-failed"):
        assert option in text
    for option in ("--json", "--version", "--help"):
        assert option in text
    for command in COMMANDS:
        assert re.search(rf"^  {command} +\S", text, re.MULTILINE)


def test_the_version_is_that_of_the_distribution():
    outcome = run_here("--version")
    assert outcome.code == 0
    assert re.fullmatch(r"\d+\.\d+\.\d+\S*\n", outcome.out)


@pytest.mark.parametrize("command", ["formats", "plants", "presets"])
def test_lists_say_the_same_to_people_and_programs(command):
    document = run_here(command, "--json").document[command]
    text = run_here(command).out
    assert len(document) >= 1
    for name in document:
        assert re.search(rf"^ *{re.escape(name)}\b", text, re.MULTILINE)


def test_formats_tell_suffix_and_proof():
    known = run_here("formats", "--json").document["formats"]
    assert {"csv", "plc", "can"} <= known.keys()
    assert known["csv"]["suffix"] == ".csv"
    assert {"summary", "proof", "suffix"} <= known["plc"].keys()


def test_plants_tell_parameters_with_units_and_bounds():
    crane = run_here("plants", "--json").document["plants"]["double-pendulum-crane"]
    assert crane["loads"] == ["hook", "payload"]
    assert crane["parameters"]["L1"]["unit"] == "m"
    assert crane["parameters"]["L1"]["lower"] < crane["parameters"]["L1"]["nominal"]


def test_plants_tell_every_name_that_a_spec_may_need():
    """Axes for [axis] and [limits.axis], coordinates for move.initial, loads for [check]."""
    for type_, plant in run_here("plants", "--json").document["plants"].items():
        words = run_here("plants").out.partition(f"{type_}:")[2].partition("\n\n")[0]
        assert plant["swinging"]
        for name in (*plant["axes"], *plant["swinging"], *plant["loads"], *plant["parameters"]):
            assert re.search(rf"(?<!\w){re.escape(name)}(?!\w)", words)


@pytest.mark.parametrize(
    ("words", "incomplete", "offered"),
    [
        ([], "com", {"commission", "compare"}),
        ([], "--ex", {"--export"}),
        (["--export"], "p", {"plc", "plcopen-xml"}),
        (["compare", "--preset"], "paper-beta5", {"paper-beta50"}),
    ],
)
def test_completes_commands_options_formats_and_presets(words, incomplete, offered):
    completion = ShellComplete(cli, {}, "gen-profile", "_GEN_PROFILE_COMPLETE")
    assert {item.value for item in completion.get_completions(words, incomplete)} == offered


def test_design_can_be_named(tmp_path):
    assert run_here("design", "--no-check", "--out", tmp_path).code == 0
    assert run_here("--no-check", "--out", tmp_path / "again").code == 0
    assert (tmp_path / "paper.csv").read_bytes() == (tmp_path / "again" / "paper.csv").read_bytes()


def test_a_spec_with_the_name_of_a_command_is_given_with_a_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = '[plant]\ntype = "double-pendulum-crane"\n[move]\ndistance = 0.3\nduration = 3\n'
    (tmp_path / "compare").write_text(text, "utf-8")
    assert run_here("./compare", "--no-check", "--json").document["name"]


def test_json_is_all_that_stdout_gets(tmp_path):
    outcome = run_here("--out", tmp_path, "--json")
    json.loads(outcome.out)
    assert "solving" in outcome.err


def test_a_bug_is_told_without_a_traceback(monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("broken")

    monkeypatch.setattr("gen_profile.delivery.designs.design.plan", broken)
    outcome = run_here("--json")
    assert outcome.code == 1
    assert outcome.errors == ["Error: Internal error (ZeroDivisionError: broken). Run again with --debug."]
    assert outcome.document["error"]["exit_code"] == 1
    monkeypatch.setattr(logging, "basicConfig", lambda **_: None)
    with pytest.raises(ZeroDivisionError):
        run_here("--debug")


def test_help_says_of_commands_that_are_not_imported_what_they_say_themselves():
    stated = {name: summary for summaries in LATER.values() for name, summary in summaries.items()}
    assert stated == {name: " ".join(cli.load()[name].help.split("\n\n")[0].split()) for name in stated}
    own = {command.callback.__module__ for command in cli.load().values()}
    assert own == {*LATER, "gen_profile.cli.commands"}


ONLY_HELP = """
import sys
sys.argv = ["gen-profile", "--help"]
from gen_profile.cli import main
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""


def test_help_loads_no_command_s_module():
    done = subprocess.run(
        [sys.executable, "-c", ONLY_HELP], capture_output=True, encoding="utf-8", check=True
    )
    loaded = set(done.stderr.split())
    assert "gen_profile.cli.commands" in loaded
    assert not loaded & {*LATER, "attrs", "numpy"}


def test_an_interrupt_is_no_bug(monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("gen_profile.delivery.designs.design.plan", interrupted)
    outcome = run_here("--json")
    assert outcome.code == outcome.document["error"]["exit_code"] == 130
    assert outcome.errors[-1] == "Error: Interrupted."


INTERRUPTED = """
import signal, sys

class Watched:
    def find_spec(name, *_):
        if name == "gen_profile.cli.commands":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Watched)
sys.argv = ["gen-profile", "formats", "--json"]
from gen_profile.cli import main
main()
"""


def test_an_interrupt_while_the_program_loads_ends_in_a_sentence():
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, encoding="utf-8", check=False
    )
    assert (done.returncode, done.stderr) == (130, "Error: Interrupted.\n")
    assert json.loads(done.stdout)["error"]["exit_code"] == 130


@pytest.mark.slow
def test_debugging_logs_what_libraries_tell(tmp_path):
    outcome = run_process("--debug", "--no-check", "--out", tmp_path)
    assert outcome.code == 0
    assert "Traceback" not in outcome.err


def test_a_reader_that_leaves_early_is_no_error():
    """As in ``gen-profile plants | head -1``."""
    with subprocess.Popen([PROGRAM, "plants"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
        process.wait()


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_sees_a_spinner_and_nothing_stays(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with progress.progress() as tell:
        tell("solving", 3, 14, "zvd")
    assert "solving, 3 of 14, zvd …" in terminal.getvalue()
    assert not terminal.getvalue().endswith("…\n")


def test_a_log_hears_of_work_that_lasts(monkeypatch, capsys):
    monkeypatch.setattr(progress, "FIRST_LINE", 0.02)
    reminder, heard = r"^sweeping, 4 of 10, 1 failed, \d+ s, about \d+ s left …$", ""
    with progress.progress() as tell:
        tell("sweeping", 2, 10)
        tell("sweeping", 4, 10, "1 failed")
        while not re.search(reminder, heard, re.MULTILINE):
            time.sleep(0.01)
            heard += capsys.readouterr().err
    assert heard.startswith("sweeping, 2 of 10 …\n")


@pytest.mark.slow
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_output_does_not_stop_the_work(tmp_path, closed):
    """As in ``gen-profile >&-``."""
    command = f'"{PROGRAM}" --no-check --out out {closed}'
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, check=False)
    assert done.returncode == 0
    assert (tmp_path / "out" / "manifest.json").exists()


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [["plants"], ["plants", "--json"], ["--help"]])
def test_an_output_that_takes_nothing_is_told_in_a_sentence(arguments, monkeypatch):
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)  # else Python does not try again as it ends
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [PROGRAM, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert done.stderr == "Error: Cannot print the outcome: No space left on device.\n"


INTERRUPTED_IN_A_FINALIZER = """
import signal, sys, time
from gen_profile.cli import entry, main

class Dropped:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)

def working(**_):
    del Dropped.last
    time.sleep(600)

Dropped.last = Dropped()
entry.cli.main = working
main()
"""


def test_an_interrupt_that_python_drops_comes_again():
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED_IN_A_FINALIZER], capture_output=True, encoding="utf-8", check=False
    )
    assert (done.returncode, done.stderr) == (130, "Error: Interrupted.\n")


@pytest.mark.slow
def test_a_cure_is_named_once():
    refused = run_here("--set", "move.duration=1", "--set", "limits.acceleration=1")
    assert refused.err.count("It can be done with") == 1
