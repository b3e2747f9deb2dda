"""Signed manifests, made and verified by this program and by minisign itself."""

import shutil
import subprocess

import pytest
from command_line import error_of, run_here
from system_parts import program

BARE = ("--preset", "paper", "--set", "export.cycle_time=0.01")
FILES = ("paper.csv", "manifest.json", "manifest.json.minisig")


def minisign(*words):
    done = subprocess.run(
        [program("minisign", "minisign"), *words], capture_output=True, text=True, check=False
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """A pair of keys, and another one."""
    folder = tmp_path_factory.mktemp("keys")
    for name in ("own", "other"):
        code, _ = minisign("-GW", "-p", folder / f"{name}.pub", "-s", folder / f"{name}.key")
        assert code == 0
    return folder


@pytest.fixture(scope="module")
def signed(keys, tmp_path_factory):
    """A folder whose manifest was signed by the program."""
    folder = tmp_path_factory.mktemp("signed")
    made = run_here(*BARE, "--out", folder, "--sign", keys / "own.key")
    assert made.code == 0 and "Signed by" in made.err
    return folder


@pytest.fixture
def copied(signed, tmp_path):
    for name in FILES:
        shutil.copy(signed / name, tmp_path)
    return tmp_path


def checked(folder, keys, name="own", file="paper.csv"):
    return run_here("check", folder / file, "--signed-by", keys / f"{name}.pub")


def test_minisign_verifies_what_the_program_signs(signed, keys):
    code, printed = minisign("-Vm", signed / "manifest.json", "-p", keys / "own.pub")
    assert code == 0 and "Signature and comment signature verified" in printed
    assert "Trusted comment: manifest of paper" in printed
    assert minisign("-Vm", signed / "manifest.json", "-p", keys / "other.pub")[0] != 0


def test_the_program_verifies_what_it_and_minisign_sign(copied, keys):
    assert checked(copied, keys).code == 0
    for how in ((), ("-l",)):  # of the hash, and of the file itself as older versions do
        code, _ = minisign("-S", *how, "-s", keys / "own.key", "-m", copied / "manifest.json")
        assert code == 0
        found = checked(copied, keys)
        assert found.code == 0 and "Signed by" in found.err


def test_the_same_manifest_has_the_same_signature(signed, keys, tmp_path):
    assert run_here(*BARE, "--out", tmp_path, "--sign", keys / "own.key").code == 0
    assert (tmp_path / FILES[2]).read_bytes() == (signed / FILES[2]).read_bytes()


def swap(path, old, new):
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")


ALTERED = {
    "does not fit": lambda folder: swap(folder / FILES[1], "paper", "Paper"),
    "comment does not fit": lambda folder: swap(folder / FILES[2], "of paper", "of bay-3"),
    "none of the files": lambda folder: swap(folder / FILES[0], "0.3", "0.4"),
    "Cannot read": lambda folder: (folder / FILES[2]).unlink(),
    "no signature": lambda folder: (folder / FILES[2]).write_text("nothing"),
}


@pytest.mark.parametrize("why", ALTERED)
def test_whatever_was_altered_is_refused_and_nothing_run(copied, keys, why):
    ALTERED[why](copied)
    refused = checked(copied, keys)
    assert refused.code in (2, 4) and why.removeprefix("comment ") in refused.errors[0], refused.err
    assert "co-simulation" not in refused.err


def test_a_signed_deliverys_altered_wrapper_is_refused(keys, tmp_path):
    assert run_here(*BARE, "--export", "twincat", "--out", tmp_path, "--sign", keys / "own.key").code == 0
    assert checked(tmp_path, keys, file="FB_paper.TcPOU").code == 0
    swap(tmp_path / "FB_paper_Axis.TcPOU", "nCause := 23", "nCause := 0")
    refused = checked(tmp_path, keys, file="FB_paper.TcPOU")
    assert refused.code == 4 and "FB_paper_Axis.TcPOU is not the one" in refused.err


def test_another_key_a_file_beside_and_no_key_are_refused(copied, keys):
    refused = checked(copied, keys, "other")
    assert refused.code == 4 and "by another key" in refused.errors[0]
    (copied / "else.csv").write_bytes((copied / "paper.csv").read_bytes() + b"\n")
    assert "none of the files" in checked(copied, keys, file="else.csv").errors[0]
    none = run_here("check", copied / "paper.csv", "--signed-by", copied / "paper.csv")
    assert none.code == 2 and "no public key" in none.errors[0]
    none = run_here(*BARE, "--out", copied / "new", "--sign", keys / "own.pub")
    assert none.code == 2 and "no secret key" in none.errors[0] and not (copied / "new").exists()


# by `minisign -G` with the password a, which takes seconds and a GiB
ENCRYPTED = """untrusted comment: minisign encrypted secret key
RWRTY0IyNi7mspluzaoeCr6M1ZJUGLY4qwAX9R/DXa9LbMyqyLAAAAACAAAAAAAAAEAAAAAANyjLxCjF9lqGLR758aSoQNvPyGBypck1WpS6sze\
+Q8uDVNBAngYBxFMZEOJC9rqiOGUxK3ND9QaVriNhteIJyjnvNlohmXMyJr8mXctK7yaHiDV2kX30PC88drubuWmFAECCFASnt1Y=
"""


def test_an_encrypted_key_is_left_to_minisign(tmp_path):
    (tmp_path / "key").write_text(ENCRYPTED)
    words = error_of(*BARE, "--out", tmp_path / "new", "--sign", tmp_path / "key")
    assert "minisign -Sm manifest.json" in words


def test_what_failed_its_check_is_not_signed(keys, tmp_path):
    tight = ("--set", "check.residual_sway=1e-6", "--keep-failed")
    assert run_here(*BARE, *tight, "--out", tmp_path, "--sign", keys / "own.key").code == 4
    assert (tmp_path / FILES[1]).exists() and not (tmp_path / FILES[2]).exists()
