"""The files that a planner block is written to, and its text out of any of them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from gen_profile.bounded_file import read_bounded
from gen_profile.errors import ExportError, OutputError, SpecError
from gen_profile.planner.design import PlannerBlock
from gen_profile.spec.can import CanSpec
from gen_profile.spec.model import ExportSpec, Spec
from gen_profile.suggestion import suggestion
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.exporter import File, Target, target_of
from gen_profile_exporters.planner.c_source import c_files
from gen_profile_exporters.registry import container_of, containers, find_container, format_named

PORTABLE = "plc"
C = "c"
_PLANNER = re.compile(r"^\s*FUNCTION_BLOCK\s+\w+_planner\s*$", re.MULTILINE | re.IGNORECASE)


def require_forms(formats: Iterable[str]) -> None:
    """Refuse formats that carry no function block and are not C.

    Raises
    ------
    SpecError
    """
    known = (*containers(), C)
    for name in formats:
        if format_named(name) not in known:
            raise SpecError(f"export: a planner block has no form {name!r}{suggestion(name, known)}")


def is_c(filename: str) -> bool:
    """Whether a file of a block is C, out of which its text cannot be read."""
    return Path(filename).suffix in (".c", ".h")


def refuse_c(path: Path) -> None:
    """Refuse a file that is C.

    Raises
    ------
    ExportError
    """
    if is_c(path.name):
        raise ExportError(f"{path}: C is not read back; name its block, in Structured Text or a form of it.")


def block_files(block: PlannerBlock, spec: Spec, formats: Iterable[str]) -> tuple[File, ...]:
    """Write a planner block in every form that is asked for, and read each back.

    Parameters
    ----------
    block : PlannerBlock
    spec : Spec
        Its spec.
    formats : iterable of str
        Names of formats that carry function blocks, or `C`.

    Raises
    ------
    SpecError
        A format carries no function block.
    ExportError
        A format cannot take this block.
    """
    names = dict.fromkeys(map(format_named, formats))
    return tuple(file for name in names for file in _files(block, spec, name))


def _files(block: PlannerBlock, spec: Spec, format_: str) -> tuple[File, ...]:
    if format_ == PORTABLE:
        return (File(filename=block.filename, content=block.text.encode("ascii")),)
    if format_ == C:
        return c_files(block.text, spec.name)
    container, target = find_container(format_), target_of(spec)
    source = parse_function_block(block.text)
    files = container.wrap(source, target)
    if container.unwrap(files[0].content, target).program() != source.program():
        raise ExportError(f"{format_}: what was written reads back as another block; export {PORTABLE}.")
    return files


def is_planner(text: str) -> bool:
    """Whether a text is a planner block's, by the name that it has."""
    return _PLANNER.search(text) is not None


def read_block(path: Path) -> str:
    """Read a planner block's text out of a written file, whichever the format.

    Parameters
    ----------
    path : Path
        Whose suffix tells the format; Structured Text where no format has it.

    Raises
    ------
    OutputError
        The file cannot be read.
    ExportError
        It holds no planner block, or one in C.
    """
    try:
        content = read_bounded(path)
    except OSError as error:
        raise OutputError(f"Cannot read the block {path}: {error.strerror}.") from error
    refuse_c(path)
    text = block_in(path, content)
    if not is_planner(text):
        raise ExportError(f"{path} holds no planner block; name a file that gen-profile planner wrote.")
    return text


def block_in(path: Path, content: bytes) -> str:
    """Read a function block's text out of what a file holds; raises as `read_block` does."""
    try:
        format_ = container_of(path)
    except SpecError:
        format_ = PORTABLE
    if format_ == PORTABLE:
        return _decoded(path, content)
    target = Target(name=path.stem, axes=(), start=(), export=ExportSpec(), can=CanSpec())
    return find_container(format_).unwrap(content, target).text()


def _decoded(path: Path, content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise OutputError(f"Cannot read the block {path}: it is no UTF-8 text.") from error
