"""Reading what was delivered: an artefact, and the manifest beside it."""

from __future__ import annotations

from pathlib import Path

from gen_profile.artefacts.manifest import FILENAME, Manifest, parse_manifest, sha256
from gen_profile.bounded_file import DOCUMENT, MOST, read_bounded
from gen_profile.errors import OutputError


def read_artefact(path: Path, most: int = MOST) -> bytes:
    """Read a file of so many bytes at most.

    Raises
    ------
    OutputError
    """
    try:
        return read_bounded(path, most)
    except OSError as error:
        raise OutputError(f"Cannot read {path}: {error.strerror or error}.") from error


def manifest_beside(path: Path, content: bytes) -> Manifest:
    """Read what the manifest beside an artefact says of the export that it comes from.

    Raises
    ------
    OutputError
        There is none, or it cannot be read.
    """
    beside = path.parent / FILENAME
    return parse_manifest(read_artefact(beside, DOCUMENT), str(beside)).covering(path.name, sha256(content))
