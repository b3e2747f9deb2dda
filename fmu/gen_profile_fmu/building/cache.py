"""A per-user cache of built files: entries by content hash, verified when read, written atomically.

What lies there is loaded and run, so the folders are the user's own: no other user may write them. Builds are
reproducible, so two processes that write the same entry at once write the same bytes, and each file takes its
place by a rename: a reader sees whole files only. The list of checksums comes last.
"""

import errno
import json
import logging
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path

from gen_profile.support.artefacts.manifest import sha256
from gen_profile.support.errors import CosimulationError
from gen_profile.support.private_folder import (
    ENVIRONMENT_VARIABLE,
    cache_folders,
    others_may_write,
    own_folder,
    temporary_folder,
)
from gen_profile.support.strict_json import parse_json

_CHECKSUMS = "checksums.json"
_logger = logging.getLogger(__name__)
_known_intact: dict[Path, dict[str, tuple[int, ...]]] = {}  # entries read whole, and their files then


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
    for folder in cache_folders():
        try:
            own_folder(folder)
            if not is_intact(folder / name):
                write_entry(folder / name, make(folder))
        except OSError as error:
            refusals.append(f"{folder}: {error.strerror or error}")
            if error.errno == errno.EPERM:
                _warn(refusals[-1])
        else:
            return folder / name
    raise CosimulationError(
        f"There is no folder to keep the plant's FMU in ({'; '.join(refusals)}). "
        f"Name one that can be written in the environment variable {ENVIRONMENT_VARIABLE}."
    )


@cache
def _warn(refusal: str) -> None:
    """Say once why another folder is used."""
    _logger.warning("Not used as a cache: %s.", refusal)


def is_intact(entry: Path) -> bool:
    """Whether an entry is complete, and every file as it was written, where no other user may write.

    Files that have not been touched since this process read them are not read again.
    """
    try:
        if (known := _known_intact.get(entry)) and known == _stamps(entry, known):
            return True
        checksums = parse_json((entry / _CHECKSUMS).read_text(encoding="utf-8"))
        if any(others_may_write(entry / name, entry.parent) for name in (_CHECKSUMS, *checksums)):
            return False
        stamps = _stamps(entry, (_CHECKSUMS, *checksums))
        intact = bool(checksums) and all(
            sha256((entry / name).read_bytes()) == checksum for name, checksum in checksums.items()
        )
    except (OSError, ValueError, AttributeError, TypeError):
        return False
    if intact:
        _known_intact[entry] = stamps
    return intact


def _stamps(entry: Path, names: Iterable[str]) -> dict[str, tuple[int, ...]]:
    """Tell files from what they may be replaced by or changed to; whom they let write shows in them, too."""
    stats = {name: (entry / name).stat() for name in names}
    return {
        name: (status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns)
        for name, status in stats.items()
    }


def write_entry(entry: Path, files: Mapping[str, bytes]) -> None:
    """Write the files of an entry, by name relative to it.

    Raises
    ------
    OSError
        When the folder cannot be written.
    """
    checksums = {name: sha256(content) for name, content in sorted(files.items())}
    listing = (json.dumps(checksums, indent=1) + "\n").encode("utf-8")
    with temporary_folder(entry.parent, ".new-") as new:
        for name, content in (*sorted(files.items()), (_CHECKSUMS, listing)):
            own_folder((entry / name).parent, within=entry.parent)
            (new / "file").write_bytes(content)
            (new / "file").replace(entry / name)
