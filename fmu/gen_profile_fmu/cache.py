"""A per-user cache of built files: entries by content hash, verified when read, written atomically.

Builds are reproducible, so two processes that write the same entry at once write the same bytes, and each
file takes its place by a rename: whoever reads sees whole files only. The list of checksums comes last.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import platformdirs

from gen_profile.errors import CosimulationError

ENVIRONMENT_VARIABLE = "GEN_PROFILE_CACHE"
_CHECKSUMS = "checksums.json"
_logger = logging.getLogger(__name__)


def cache_folders() -> Iterator[Path]:
    """List folders to look in and to write to, the preferred one first.

    That is what the environment variable `GEN_PROFILE_CACHE` names, else the cache folder of the user; then,
    for users without a home or with one that cannot be written, a private folder among the temporary files.
    """
    named = os.environ.get(ENVIRONMENT_VARIABLE, "").strip()
    preferred = Path(named).absolute() if named else _users_folder()
    if preferred is not None:
        yield preferred
    private = _private_temporary_folder()  # made only when the first folder will not do
    if private is not None:
        yield private


def _users_folder() -> Path | None:
    """Find the user's cache folder; None for a user without a home."""
    try:
        folder = platformdirs.user_cache_path("gen-profile", appauthor=False)
    except RuntimeError:
        return None
    return folder if folder.is_absolute() else None  # "~" stays where some versions find no home


def _private_temporary_folder() -> Path | None:
    """Make a folder that only this user can write; None when somebody else has taken its name."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    folder = Path(tempfile.gettempdir()) / f"gen-profile-{user}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError as error:
        _logger.debug("No cache in %s: %s", folder, error)
        return None
    if not stat.S_ISDIR(status.st_mode):
        return None
    if hasattr(os, "getuid") and (status.st_uid != os.getuid() or stat.S_IMODE(status.st_mode) & 0o077):
        _logger.warning("The folder %s is not this user's alone; it is not used as a cache.", folder)
        return None
    return folder


def cached(name: str, make: Callable[[Path], Mapping[str, bytes]]) -> Path:
    """Find an entry, or make it.

    Parameters
    ----------
    name : str
    make : Path → mapping of str to bytes
        Makes the files, with the cache's folder for what it needs on the way.

    Returns
    -------
    Path
        The entry's folder.

    Raises
    ------
    CosimulationError
        When there is no folder to keep it in.
    """
    refusals = []
    for cache in cache_folders():
        try:
            if not is_intact(cache / name):
                cache.mkdir(parents=True, exist_ok=True, mode=0o700)
                write_entry(cache / name, make(cache))
        except OSError as error:
            refusals.append(f"{cache}: {error.strerror or error}")
        else:
            return cache / name
    raise CosimulationError(
        f"There is no folder to keep the plant's FMU in ({'; '.join(refusals)}). "
        f"Name one that can be written in the environment variable {ENVIRONMENT_VARIABLE}."
    )


def is_intact(entry: Path) -> bool:
    """Whether an entry is complete and every file as it was written."""
    try:
        checksums = json.loads((entry / _CHECKSUMS).read_text(encoding="utf-8"))
        return bool(checksums) and all(
            _sha256((entry / name).read_bytes()) == checksum for name, checksum in checksums.items()
        )
    except (OSError, ValueError, AttributeError, TypeError):
        return False


def write_entry(entry: Path, files: Mapping[str, bytes]) -> None:
    """Write the files of an entry, by name relative to it.

    Raises
    ------
    OSError
        When the folder cannot be written.
    """
    checksums = {name: _sha256(content) for name, content in sorted(files.items())}
    listing = (json.dumps(checksums, indent=1) + "\n").encode("utf-8")
    for name, content in (*sorted(files.items()), (_CHECKSUMS, listing)):
        _write_atomically(entry / name, content)


def _write_atomically(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".new-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
