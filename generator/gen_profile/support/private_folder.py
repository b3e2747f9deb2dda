"""Folders that no other user may write: whether one is, and temporary ones that end with their owner."""

import os
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp

from filelock import FileLock, Timeout

LOCK = ".lock"
ROOT, OVERFLOW_USER = 0, 65534  # the latter owns what a container's user has no number for
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def is_private(folder: Path) -> bool:
    """Whether this is a folder of this user's, no link to one, into which no other user can look.

    Windows keeps users apart by access lists, which are not judged.
    """
    try:
        status = folder.lstat()
    except OSError:
        return False
    if not stat.S_ISDIR(status.st_mode):
        return False
    return sys.platform == "win32" or (status.st_uid == os.geteuid() and not status.st_mode & 0o077)


def others_may_write(path: Path, within: Path | None = None) -> bool:
    """Whether any user but this one and root may change a file or folder, or put another in its place.

    They may where it is theirs or its mode lets them, and where they may rename one of the folders above it,
    which the sticky bit forbids. The same holds for what a link leads to. Not judged in Windows.

    Parameters
    ----------
    path : Path
    within : Path, optional
        A folder above it, which is judged elsewhere, as are those above that.

    Raises
    ------
    OSError
        It is not there.
    """
    if sys.platform == "win32":
        return False
    user = os.geteuid()
    for part in (path, *path.absolute().parents):
        if part == within:
            break
        status = part.lstat()
        if status.st_uid not in (ROOT, user) and (part is path or status.st_uid != OVERFLOW_USER):
            return True
        if stat.S_ISLNK(status.st_mode):
            if others_may_write(part.parent / part.readlink()):
                return True
            continue
        loose = status.st_mode & OTHERS_WRITE
        if status.st_gid == user:  # the user's own group, which has his number: he is alone in it
            loose &= ~stat.S_IWGRP
        if loose and (part is path or not status.st_mode & stat.S_ISVTX):
            return True
    return False


def make_private(folder: Path) -> None:
    """Make a folder and those above it, as far as they are missing, for this user alone.

    Raises
    ------
    OSError
    """
    for part in (*reversed(folder.absolute().parents), folder):
        if not part.exists():
            part.mkdir(mode=0o700, exist_ok=True)


@contextmanager
def temporary_folder(parent: Path, prefix: str) -> Iterator[Path]:
    """Make a folder in another one, which is gone afterwards.

    It is locked as long as its process lives, so that what a killed one left is recognised, and goes, too.

    Raises
    ------
    OSError
        There can be none.
    """
    _remove_abandoned(parent, prefix)
    folder, lock = _locked_folder(parent, prefix)
    try:
        yield folder
    finally:
        lock.release()
        shutil.rmtree(folder, ignore_errors=True)


def _locked_folder(parent: Path, prefix: str) -> tuple[Path, FileLock]:
    while True:
        folder = Path(mkdtemp(prefix=prefix, dir=parent))
        lock = FileLock(folder / LOCK)
        try:
            lock.acquire()
        except FileNotFoundError:
            pass
        except (OSError, NotImplementedError):  # a file system without locks, where nothing is swept up
            return folder, lock
        if (folder / LOCK).exists():  # else another process took it for abandoned before it was locked
            return folder, lock


def _remove_abandoned(parent: Path, prefix: str) -> None:
    for folder in parent.glob(f"{prefix}*"):
        if not is_private(folder) or not (folder / LOCK).is_file():
            continue
        with suppress(Timeout, OSError, NotImplementedError):
            with FileLock(folder / LOCK).acquire(blocking=False):
                shutil.rmtree(folder, ignore_errors=True)
            shutil.rmtree(folder, ignore_errors=True)  # Windows keeps files that are open
