"""Folders that no other user may write: whether one is, temporary ones, and the user's cache."""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filelock import FileLock

LOCK = ".lock"
ENVIRONMENT_VARIABLE = "GEN_PROFILE_CACHE"
_AGREED = "agreed"  # folder of empty files, named by the SHA-256 of programs that the user lets run
_SHA256 = re.compile(r"[0-9a-f]{64}")
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
    from filelock import FileLock  # noqa: PLC0415  # which waits for asyncio

    while True:
        folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
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
    from filelock import FileLock, Timeout  # noqa: PLC0415

    for folder in parent.glob(f"{prefix}*"):
        if not is_private(folder) or not (folder / LOCK).is_file():
            continue
        with suppress(Timeout, OSError, NotImplementedError):
            with FileLock(folder / LOCK).acquire(blocking=False):
                shutil.rmtree(folder, ignore_errors=True)
            shutil.rmtree(folder, ignore_errors=True)  # Windows keeps files that are open


def cache_folders() -> Iterator[Path]:
    """List folders to look in and to write to, the preferred one first.

    That is what the environment variable `GEN_PROFILE_CACHE` names, else the cache folder of the user; then,
    for users without a home or with one that will not do, a private folder among the temporary files.
    """
    named = os.environ.get(ENVIRONMENT_VARIABLE, "").strip()
    preferred = Path(named).absolute() if named else _users_folder()
    if preferred is not None:
        yield preferred
    user = "user"
    if sys.platform != "win32":
        user = str(os.geteuid())
    yield Path(tempfile.gettempdir()) / f"gen-profile-{user}"


def _users_folder() -> Path | None:
    """Find the user's cache folder; None for a user without a home."""
    import platformdirs  # noqa: PLC0415

    try:
        folder = platformdirs.user_cache_path("gen-profile", appauthor=False)
    except RuntimeError:
        return None
    return folder if folder.is_absolute() else None  # "~" stays where some versions find no home


def own_folder(folder: Path, within: Path | None = None) -> Path:
    """Make a folder unless it is there, and refuse one that others may write: what lies in it is run.

    Parameters
    ----------
    folder : Path
    within : Path, optional
        One above it that is known to be the user's own.

    Raises
    ------
    OSError
    """
    make_private(folder)
    temporary = Path(tempfile.gettempdir())  # nothing lies safer there, however it is kept
    if others_may_write(folder, within) and not (folder.parent == temporary and is_private(folder)):
        raise PermissionError(errno.EPERM, "others may write there, and what it holds is run")
    return folder


def agree(sha256: str) -> None:
    """Note a program that the user lets run; where nothing can be kept, he is asked again."""
    for folder in cache_folders():
        with suppress(OSError):
            (own_folder(folder / _AGREED, within=own_folder(folder)) / sha256).touch(mode=0o600)
            return


def is_agreed(sha256: str) -> bool:
    """Whether the user has let a program run before."""
    for folder in cache_folders() if _SHA256.fullmatch(sha256) else ():
        with suppress(OSError):
            if (own_folder(folder / _AGREED, within=own_folder(folder)) / sha256).is_file():
                return True
    return False
