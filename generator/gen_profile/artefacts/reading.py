"""Reading what was delivered: an artefact, and the manifest beside it."""

from pathlib import Path

from gen_profile.artefacts.manifest import FILENAME, PLANNER, Manifest, parse_manifest, sha256
from gen_profile.bounded_file import DOCUMENT, MOST, read_bounded
from gen_profile.errors import OutputError, SpecError


def read_artefact(path: Path, most: int = MOST, what: str = "") -> bytes:
    """Read a file of so many bytes at most; errors say what it is.

    Raises
    ------
    OutputError
    """
    try:
        return read_bounded(path, most)
    except OSError as error:
        raise OutputError(f"Cannot read {what}{path}: {error.strerror or error}.") from error


def read_motion(path: Path) -> bytes:
    """Read a file that is to hold a motion, or a planner block.

    Raises
    ------
    OutputError
    SpecError
        By the manifest beside it, it only goes with the file that holds the motion, as a wrapper does.
    """
    content = read_artefact(path)
    try:
        manifest = parse_manifest(read_artefact(path.parent / FILENAME, DOCUMENT), FILENAME)
    except OutputError:
        return content
    for artefacts in (one.artefacts for one in (manifest, *manifest.earlier)):
        own = next((known for known in artefacts if known.path == path.name), None)
        if own is not None and own.format != PLANNER:
            holds = next(known.path for known in artefacts if known.format == own.format)
            if holds != own.path:
                raise SpecError(f"{path}: it goes with {holds}, which holds the motion; name that.")
    return content


def decoded(content: bytes, path: Path, what: str) -> str:
    """Decode what a file holds; errors say what it is.

    Raises
    ------
    OutputError
        It is no UTF-8 text.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise OutputError(f"Cannot read {what}{path}: it is no UTF-8 text.") from error


def manifest_beside(path: Path, content: bytes, *, planner: bool = False) -> Manifest:
    """Read what the manifest beside an artefact says of the export that it comes from.

    Parameters
    ----------
    path : Path
    content : bytes
    planner : bool
        Whether it is a planner block.

    Raises
    ------
    OutputError
        There is none, it cannot be read, or it is of other files.
    """
    beside = path.parent / FILENAME
    if not beside.is_file():
        raise OutputError(
            f"There is no {FILENAME} beside {path}; put the one there that was written with it."
        )
    manifest = parse_manifest(read_artefact(beside, DOCUMENT), str(beside))
    covering = manifest.covering(path.name, sha256(content), planner=planner)
    if covering is None:
        kind = "planner block" if planner else "motion"
        raise OutputError(
            f"{beside} is of {manifest.words()}, not of the {kind} {path.name}; put the one there that was "
            "written with it."
        )
    return covering
