"""Half of an output folder is never seen."""

import errno
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from filelock import FileLock

from gen_profile.support.artefacts.writing import deliver, staged
from gen_profile.support.errors import OutputError


def tree(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def test_nothing_is_seen_before_delivery_and_everything_after(tmp_path):
    out = tmp_path / "a" / "b"
    with staged(out) as staging:
        assert staging.write("one.txt", b"1") == b"1"
        assert not (out / "one.txt").exists()
        staging.deliver()
        assert (out / "one.txt").read_bytes() == b"1"
    assert tree(tmp_path) == {"a": None, "a/b": None, "a/b/one.txt": b"1"}


def test_what_is_not_delivered_is_gone_with_the_folders_made_for_it(tmp_path):
    (tmp_path / "a").mkdir()
    with staged(tmp_path / "a" / "b" / "c") as staging:
        staging.write("one.txt", b"1")
    assert tree(tmp_path) == {"a": None}


def test_other_files_stay_and_those_of_the_same_name_are_replaced(tmp_path):
    for name in ("one.txt", "two.txt"):
        (tmp_path / name).write_bytes(b"old")
    with staged(tmp_path) as staging:
        staging.write("one.txt", b"new")
        staging.deliver()
    assert tree(tmp_path) == {"one.txt": b"new", "two.txt": b"old"}


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, ValueError])
def test_an_interruption_leaves_everything_as_it_was(tmp_path, interruption):
    (tmp_path / "one.txt").write_bytes(b"old")
    with pytest.raises(interruption), staged(tmp_path) as staging:
        staging.write("one.txt", b"new")
        raise interruption
    with pytest.raises(interruption), staged(tmp_path / "new" / "folder") as staging:
        staging.write("one.txt", b"new")
        raise interruption
    assert tree(tmp_path) == {"one.txt": b"old"}


def test_an_interruption_between_two_files_waits_for_the_second(tmp_path, monkeypatch):
    replace = Path.replace

    def interrupted(path, target):
        signal.raise_signal(signal.SIGINT)
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt), staged(tmp_path) as staging:
        staging.write("one.txt", b"1")
        staging.write("two.txt", b"2")
        staging.deliver()
    assert tree(tmp_path) == {"one.txt": b"1", "two.txt": b"2"}


def test_a_full_disk_is_a_sentence_and_leaves_nothing(tmp_path, monkeypatch):
    (tmp_path / "one.txt").write_bytes(b"old")
    whole = Path.write_bytes

    def write_half(path, content):
        whole(path, content[: len(content) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", write_half)
    sentence = r"^Cannot write .*: No space left on device; choose another one\.$"
    for out in (tmp_path, tmp_path / "new"):
        full = pytest.raises(OutputError, match=sentence)
        with full, staged(out) as staging:
            staging.write("one.txt", b"new")
    assert tree(tmp_path) == {"one.txt": b"old"}


@pytest.mark.parametrize(
    ("out", "why"),
    [
        ("file", "/file is a file"),
        ("file/below", "/file is a file"),
        ("made/" + 300 * "x", "File name too long"),
        (300 * "x", "File name too long"),
    ],
)
def test_a_folder_that_cannot_be_is_a_sentence_and_leaves_nothing(tmp_path, out, why):
    (tmp_path / "file").write_bytes(b"in the way")
    with (
        pytest.raises(OutputError, match=rf"^Cannot write to the folder .*: .*{why}; choose another one\.$"),
        staged(tmp_path / out),
    ):
        pytest.fail("there is no such folder")
    assert tree(tmp_path) == {"file": b"in the way"}


def test_one_file_replaces_another_but_no_device(tmp_path):
    deliver(tmp_path / "new" / "one.txt", b"1")
    deliver(tmp_path / "new" / "one.txt", b"2")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError, match="it is no regular file"):
        deliver(tmp_path / "pipe", b"1")
    assert (tmp_path / "pipe").is_fifo()
    assert (tmp_path / "new" / "one.txt").read_bytes() == b"2"


def test_a_file_that_cannot_be_replaced_is_a_sentence(tmp_path):
    (tmp_path / "one.txt").mkdir()
    with pytest.raises(OutputError, match="Is a directory"), staged(tmp_path) as staging:
        staging.write("one.txt", b"1")
        staging.deliver()
    assert tree(tmp_path) == {"one.txt": None}


KILLED = """
import sys
from pathlib import Path
from gen_profile.support.artefacts.writing import staged
with staged(Path(sys.argv[1])) as staging:
    staging.write("one.txt", b"half")
    print(flush=True)
    sys.stdin.read()
"""


def test_what_a_killed_run_left_goes_and_what_is_at_work_stays(tmp_path):
    (tmp_path / ".gen-profile-mine").mkdir()  # no lock: made by hand, or not locked yet
    (tmp_path / ".gen-profile-mine" / "file").write_bytes(b"")
    precious = tmp_path / "precious"
    precious.mkdir(mode=0o700)
    (precious / ".lock").write_bytes(b"")
    (tmp_path / ".gen-profile-link").symlink_to(precious)
    before = tree(tmp_path)
    command = [sys.executable, "-c", KILLED, str(tmp_path)]
    with (
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as victim,
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other,
    ):
        for process in (victim, other):
            process.stdout.readline()
        both = tree(tmp_path)
        victim.kill()
        victim.wait()
        assert tree(tmp_path) == both
        deliver(tmp_path / "two.txt", b"2")
        (left,) = {path.split("/")[0] for path in tree(tmp_path).keys() - before.keys()} - {"two.txt"}
        assert (tmp_path / left / "one.txt").read_bytes() == b"half"
        other.communicate()
    assert tree(tmp_path) == before | {"two.txt": b"2"}


def test_a_folder_that_is_taken_for_abandoned_before_it_is_locked_is_made_again(tmp_path, monkeypatch):
    taken = []
    acquire = FileLock.acquire

    def late(lock, *arguments, **options):
        if not taken:
            taken.append(Path(lock.lock_file).parent)
            shutil.rmtree(taken[0])
        return acquire(lock, *arguments, **options)

    monkeypatch.setattr(FileLock, "acquire", late)
    deliver(tmp_path / "one.txt", b"1")
    assert taken
    assert tree(tmp_path) == {"one.txt": b"1"}


def test_a_file_system_without_locks_will_do(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise NotImplementedError("FileSystem does not appear to support flock")

    monkeypatch.setattr(FileLock, "acquire", refuse)
    deliver(tmp_path / "one.txt", b"1")
    assert tree(tmp_path) == {"one.txt": b"1"}
