"""Folders that come from someone else, and name programs of his: nothing of them runs unasked."""

import json
import os
import pty
import shutil
import subprocess
from pathlib import Path

import pytest
from command_line import PROGRAM, error_of, run_here
from fmu.caches import share_zig

from gen_profile.plants.machine_file import plant_of_file
from gen_profile.spec.reading import received_spec
from gen_profile.support.artefacts.manifest import SEAL, seal_of
from gen_profile.support.errors import UnknownProgram

EXAMPLE = Path(__file__).parents[2] / "examples" / "inclined_crane.py"
SPEC = """
plant = { file = "machine.py", s = 0.3 }
move = { distance = 2.0, duration = 9.0 }
export.cycle_time = 0.05
check.residual_sway = 0.1
"""
COMMANDS = {
    "check": ("check", "profile.st"),
    "report": ("report", "profile.st", "--out", "report.html"),
    "deploy": ("deploy", "profile.st", "--to", "opc.tcp://127.0.0.1:1", "--security", "none"),
    "stream": (
        "stream",
        "profile.log",
        "--interface",
        "virtual",
        "--channel",
        "0",
        "--dry-run",
        "--accept-unverified",
    ),
}


@pytest.fixture(scope="module")
def sent(tmp_path_factory):
    """What a sender exported; his machine tells when it is run."""
    folder = tmp_path_factory.mktemp("sent")
    ran = folder / "ran"
    code = f"from pathlib import Path\nPath({str(ran)!r}).touch()\n"
    (folder / "machine.py").write_text(EXAMPLE.read_text("utf-8") + code, "utf-8")
    (folder / "spec.toml").write_text(SPEC, "utf-8")
    formats = ("--export", "plc", "--export", "can")
    done = run_here(folder / "spec.toml", *formats, "--no-check", "--out", folder / "out")
    assert done.code == 0, done.err
    assert ran.exists()
    return folder


@pytest.fixture
def received(sent, tmp_path, monkeypatch):
    """The same, at someone who has never run it."""
    shutil.copytree(sent / "out", tmp_path / "received")
    (sent / "ran").unlink(missing_ok=True)
    plant_of_file.cache_clear()
    monkeypatch.chdir(tmp_path / "received")
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "received"


def resealed(folder, change):
    """Alter a manifest, and seal it as its sender can."""
    document = json.loads((folder / "manifest.json").read_text("utf-8"))
    change(document)
    del document[SEAL]
    document[SEAL] = seal_of(document)
    (folder / "manifest.json").write_text(json.dumps(document), "utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_machine_s_file_from_elsewhere_is_not_run_unasked(command, sent, received):
    assert "machine.py would run with your rights, and never did" in error_of(*COMMANDS[command])
    assert not (sent / "ran").exists()


@pytest.mark.slow
def test_what_the_user_names_himself_is_run_from_then_on(sent, received, cache, monkeypatch):
    assert run_here("check", "profile.st").code == 2
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(cache))  # of the sender
    assert run_here("report", "profile.st", "--out", "report.html").code == 0
    assert (sent / "ran").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["../machine.py", "/machine.py", "..\\machine.py", 3])
def test_one_outside_the_folder_is_refused_even_if_it_was_run_before(
    name, sent, received, cache, monkeypatch
):
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(cache))
    shutil.copy(received / "machine.py", received.parent)
    resealed(received, lambda document: document["spec"]["plant"].update(file=name))
    assert "received files name programs beside them only" in error_of("check", "profile.st")
    assert not (sent / "ran").exists()


@pytest.mark.slow
def test_one_without_its_hash_is_refused(sent, received, cache, monkeypatch):
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(cache))
    resealed(received, lambda document: document["spec"]["plant"].pop("file_sha256"))
    assert "with plant.file_sha256" in error_of("check", "profile.st")
    assert not (sent / "ran").exists()


@pytest.mark.slow
@pytest.mark.parametrize("answer", ["n", "y"])
def test_a_terminal_is_asked(answer, sent, received, cache):
    share_zig(cache, received.parent / "cache")
    ours, theirs = pty.openpty()
    words = (PROGRAM, "report", "profile.st", "--no-compare", "--out", "report.html")
    with subprocess.Popen(words, stdin=theirs, stderr=theirs, stdout=subprocess.PIPE) as process:
        os.close(theirs)
        said = b""
        while b"[y/N]" not in said:
            said += os.read(ours, 4096)
        os.write(ours, f"{answer}\n".encode())
        try:
            while more := os.read(ours, 4096):
                said += more
        except OSError:  # its end, in Linux
            pass
    os.close(ours)
    assert b"never did" in said and b"SHA-256" in said
    assert process.returncode == (0 if answer == "y" else 2)
    assert (sent / "ran").exists() == (answer == "y")
    assert (run_here("check", "profile.st").code == 0) == (answer == "y")


@pytest.mark.parametrize("key", [("plant", "file"), ("check", "fmu")])
def test_programs_of_both_kinds_are_asked_for_before_any_is_read(key, tmp_path, monkeypatch):
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(tmp_path / "cache"))
    table, name = key
    with pytest.raises(UnknownProgram) as caught:
        received_spec({table: {name: "x", f"{name}_sha256": "0" * 64}}, tmp_path)
    assert caught.value.programs == {tmp_path / "x": "0" * 64}
