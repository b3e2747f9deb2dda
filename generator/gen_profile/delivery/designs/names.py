"""Names of files and function blocks that one folder's motions and libraries must not share."""

import json
from collections.abc import Callable, Iterator
from contextlib import suppress

from gen_profile.spec.values import ascii_name
from gen_profile.support.artefacts.manifest import FILENAME, Manifest, parse_manifest
from gen_profile.support.errors import OutputError
from gen_profile_exporters.playback.structured_text import block_name

WITHOUT_BLOCKS = {"csv", "can"}  # formats that name nothing in a controller after the motion
# what names of blocks end in beside the motion's own: wrappers, and planner blocks with theirs
BLOCKS = ("", "_Axis", "_Velocity", "_planner", "_planner_Axis", "_planner_Velocity")

Earlier = Callable[[str], bytes | None]  # reads a file of the folder, if there is one of this name


def require_own_names(name: str | None, taken: set[str], earlier: Earlier) -> Manifest | None:
    """Refuse names of files and blocks that another motion of the folder has, and give its manifest.

    Parameters
    ----------
    name : str, optional
        Of the motion to be written; none for a library.
    taken : set of str
        What it would be called, in lower case: neither Windows nor IEC 61131-3 tells case apart.
    earlier : callable

    Raises
    ------
    OutputError
        With the name that both would have. A damaged manifest holds none.
    """
    previous, content = None, earlier(FILENAME)
    with suppress(OutputError):
        previous = None if content is None else parse_manifest(content, FILENAME)
    own = "the library" if name is None else repr(name)
    for other, theirs in _others(name, previous, earlier):
        if shared := taken & theirs:
            raise OutputError(
                f"The folder holds {other}, and {own} would share {min(shared)} with it; "
                "give it another name, or another folder. Nothing was written."
            )
    return previous


def names_of(manifest: Manifest) -> set[str]:
    """List the names of an export's files and blocks."""
    blocks: tuple[str, ...] = ()
    if any(known.format not in WITHOUT_BLOCKS for known in manifest.artefacts):
        blocks = BLOCKS
    files = [known.path for known in manifest.artefacts]
    return {
        *(file.casefold() for file in files),
        *_names_of_block(block_name(ascii_name(manifest.name)), blocks),
    }


def names_of_library(block: str, *files: str) -> set[str]:
    """List the names of a library's files and blocks."""
    return {*(file.casefold() for file in files), *_names_of_block(block, BLOCKS)}


def _names_of_block(block: str, ends: tuple[str, ...]) -> set[str]:
    return {(block + end).casefold() for end in ends}


def _others(name: str | None, previous: Manifest | None, earlier: Earlier) -> Iterator[tuple[str, set[str]]]:
    """List motions of other names, and the library that a motion of this name would meet."""
    for one in (previous, *previous.earlier) if previous else ():
        if one.name != name:
            yield repr(one.name), names_of(one)
    for stem in (ascii_name(name), block_name(ascii_name(name))) if name else ():
        content = earlier(f"{stem}.json")
        with suppress(ValueError):
            document = json.loads(content or b"null")
            if (
                isinstance(document, dict)
                and isinstance(document.get("block"), str)
                and "profiles" in document
            ):
                yield f"the library of {stem}.json", names_of_library(document["block"])
