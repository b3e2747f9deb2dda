"""Unpacking an archive from outside."""

import lzma
import stat
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from gen_profile.support.errors import CosimulationError

LARGEST = 1 << 30  # bytes, of all files unpacked
MOST_FILES = 10_000
DAMAGED = (
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    RuntimeError,
    ValueError,
)


def unpack(path: Path, folder: Path) -> None:
    """Unpack an FMU.

    Parameters
    ----------
    path : Path
        The archive.
    folder : Path
        Where to: nothing is written outside of it.

    Raises
    ------
    CosimulationError
        The archive cannot be read, is damaged or too large, or would write elsewhere.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            _require_harmless(path, archive)
            for member in archive.infolist():
                member.filename = member.filename.replace("\\", "/")
                archive.extract(member, folder)  # which gives no more bytes than the archive states
    except DAMAGED as error:
        raise CosimulationError(f"{path.name}: not an FMU, or damaged ({error}); get it again.") from error
    except (OSError, NotImplementedError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CosimulationError(f"{path.name}: the FMU cannot be read ({reason}).") from error


def _require_harmless(path: Path, archive: zipfile.ZipFile) -> None:
    members = archive.infolist()
    if len(members) > MOST_FILES or sum(member.file_size for member in members) > LARGEST:
        raise CosimulationError(
            f"{path.name}: the archive is too large: at most {MOST_FILES} files of together 1 GiB are taken."
        )
    for member in members:
        name = PurePosixPath(member.filename.replace("\\", "/"))
        is_link = stat.S_ISLNK(member.external_attr >> 16)
        if name.is_absolute() or ".." in name.parts or ":" in member.filename or is_link:
            raise CosimulationError(
                f"{path.name}: the archive would write outside of its folder ({member.filename[:80]!r}); "
                "do not use it."
            )
