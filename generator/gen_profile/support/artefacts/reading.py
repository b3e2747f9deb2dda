"""Reading what was delivered: an artefact, and the manifest beside it."""

from collections.abc import Mapping
from pathlib import Path, PureWindowsPath

from gen_profile.support.artefacts.manifest import (
    FILENAME,
    PLANNER,
    Artefact,
    Manifest,
    parse_manifest,
    sha256,
)
from gen_profile.support.bounded_file import DOCUMENT, MOST_BYTES, is_folder, read_bounded
from gen_profile.support.errors import CheckFailed, GenProfileError, OutputError, SpecError


def read_artefact(path: Path, most: int = MOST_BYTES, what: str = "") -> bytes:
    """Read a file of so many bytes at most; errors say what it is.

    Raises
    ------
    OutputError
    """
    try:
        return read_bounded(path, most)
    except OSError as error:
        cure = _file_in(path) if is_folder(error, path) else "."
        raise OutputError(f"Cannot read {what}{path}: {error.strerror or error}{cure}") from error


def _file_in(folder: Path) -> str:
    """End a sentence about a folder in a file's place with a file in it, of its manifest if there is one."""
    try:
        listed = parse_manifest(read_artefact(folder / FILENAME, DOCUMENT), FILENAME).artefacts
    except OutputError:
        listed = ()
    return f"; name a file in it, such as {folder / listed[0].path}." if listed else "; name a file in it."


def read_motion(path: Path) -> bytes:
    """Read a file that is to hold a motion, or a planner block.

    Raises
    ------
    OutputError
    SpecError, CheckFailed
        By the manifest beside it, it only goes with the file that holds the motion, as a wrapper does.
    """
    content = read_artefact(path)
    for own, artefacts in _listed(path):
        holds = next(known.path for known in artefacts if known.format == own.format)
        if own.format != PLANNER and holds != own.path:
            words = f"it goes with {holds}, which holds the motion; name that."
            raise refusal(path, content, words, SpecError)
    return content


def refusal(path: Path, content: bytes, words: str, kind: type[GenProfileError]) -> GenProfileError:
    """Refuse a file that is not read itself, and say first whether it is the one of the manifest beside it.

    Returns
    -------
    GenProfileError
        Of that kind, or `CheckFailed` where the manifest lists another file of its name.
    """
    known = {own.sha256 for own, _ in _listed(path)}
    if not known:
        return kind(f"{path}: {words}")
    if sha256(content) in known:
        return kind(f"{path} is the one that was exported; {words}")
    return CheckFailed(f"{path} is NOT the one that was exported; {words}")


def _listed(path: Path) -> list[tuple[Artefact, tuple[Artefact, ...]]]:
    """Find a file's name in the manifest beside it, if that can be read, and all files of the same export."""
    try:
        manifest = parse_manifest(read_artefact(path.parent / FILENAME, DOCUMENT), FILENAME)
    except OutputError:
        return []
    exports = [one.artefacts for one in (manifest, *manifest.earlier)]
    return [(known, files) for files in exports for known in files if known.path == path.name]


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


def compared(folder: Path, listed: Mapping[str, str]) -> dict[str, str]:
    """Tell of files by name and SHA-256 whether each ``"matches"``, ``"differs"`` or is ``"missing"``."""
    return {name: _compared(folder, name, digest) for name, digest in listed.items()}


def _compared(folder: Path, name: str, digest: str) -> str:
    if PureWindowsPath(name).name != name:
        return "differs"  # a path in a stranger's list could lead to another computer
    if not (folder / name).is_file():
        return "missing"
    return "matches" if sha256(read_artefact(folder / name)) == digest else "differs"


def companions_of(manifest: Manifest | None, path: Path, content: bytes) -> dict[str, str]:
    """Tell as `compared` does of each file that was exported with one, as its wrapper.

    Files beside it that only an ``"earlier"`` export of it had are among them.
    """
    if manifest is None:
        return {}
    own = (path.name, sha256(content))
    left_over = (name for name in manifest.left_over(*own) if PureWindowsPath(name).name == name)
    earlier = {name: "earlier" for name in left_over if (path.parent / name).is_file()}
    return {**compared(path.parent, manifest.companions(*own)), **earlier}


def strays(path: Path, companions: Mapping[str, str]) -> tuple[str, ...]:
    """Say which files beside one are not those that were exported with it."""
    return tuple(
        f"{name} is not the one that was exported with {path.name}: it was altered after its export, or "
        "comes from another; export again."
        for name, found in companions.items()
        if found == "differs"
    )


def require_companions(manifest: Manifest | None, path: Path, content: bytes) -> None:
    """Refuse a file where one beside it is not the one that was exported with it.

    Raises
    ------
    CheckFailed
    """
    for sentence in strays(path, companions_of(manifest, path, content)):
        raise CheckFailed(sentence)
