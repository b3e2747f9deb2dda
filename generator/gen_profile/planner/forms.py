"""The files that a planner block is written to, and its text out of any of them."""

import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path, PurePath

import attrs

from gen_profile.planner.design import PlannerBlock
from gen_profile.planner.directions import planned_axes
from gen_profile.spec.can import CanSpec
from gen_profile.spec.model import ExportSpec, Spec
from gen_profile.support.artefacts.reading import decoded, read_artefact, refusal
from gen_profile.support.errors import ExportError, SpecError
from gen_profile.support.suggestion import suggestion
from gen_profile_exporters.block_source import BlockSource, is_planner, parse_function_block
from gen_profile_exporters.exporter import BlockContainer, File, Target, target_of
from gen_profile_exporters.planner.axis_wrapper import planner_wrappers
from gen_profile_exporters.planner.c_source import c_files
from gen_profile_exporters.planner.linux.host import linux_files
from gen_profile_exporters.planner.openplc import OPENPLC, openplc_files
from gen_profile_exporters.planner.parameters import buffered_planner, constant_planner
from gen_profile_exporters.playback.buffers import TABLE, is_buffered
from gen_profile_exporters.registry import container_of, containers, find_container, format_named

PORTABLE, WHAT = "plc", "the block "
PROGRAMS = {"c": c_files, "linux": linux_files, "openplc": openplc_files}
_WRAPPER = re.compile(r"^\s*FUNCTION_BLOCK\s+\w+_planner_(Axis|Velocity)\s*$", re.MULTILINE | re.IGNORECASE)


def require_forms(formats: Iterable[str]) -> None:
    """Refuse formats that carry no function block and are no programs.

    Raises
    ------
    SpecError
    """
    known = (*containers(), *PROGRAMS)
    for name in formats:
        if format_named(name) not in known:
            raise SpecError(f"export: a planner block has no form {name!r}{suggestion(name, known)}")


def is_program(filename: str) -> bool:
    """Whether a file of a block is a program, out of which its text cannot be read."""
    return filename.endswith((".c", ".h", ".py", OPENPLC))


def refuse_program(path: Path, content: bytes) -> None:
    """Refuse a file that is C, or a program around it.

    Raises
    ------
    ExportError, CheckFailed
    """
    if is_program(path.name):
        words = "a program is not read back; name its block, in Structured Text or a form of it."
        raise refusal(path, content, words, ExportError)


def refuse_wrapper(path: Path, content: bytes, text: str) -> None:
    """Refuse a file whose text is the wrapper of a planner block.

    Raises
    ------
    ExportError, CheckFailed
    """
    if _WRAPPER.search(text):
        words = "it holds a planner block's wrapper; name the block's own file beside it."
        raise refusal(path, content, words, ExportError)


def block_files(block: PlannerBlock, spec: Spec, formats: Iterable[str]) -> tuple[File, ...]:
    """Write a planner block and its wrappers in every form that is asked for, and read each back.

    Parameters
    ----------
    block : PlannerBlock
    spec : Spec
        Its spec.
    formats : iterable of str
        Names of formats that carry function blocks, or of `PROGRAMS`.

    Raises
    ------
    SpecError
        A format carries no function block.
    ExportError
        A format cannot take this block.
    """
    names = dict.fromkeys(map(format_named, formats))
    files = (file for name in names for file in _files(block, spec, name))
    return tuple({file.filename: file for file in files}.values())


def _files(block: PlannerBlock, spec: Spec, format_: str) -> tuple[File, ...]:
    """Write the block, then its wrappers, each into files of its own."""
    if format_ in PROGRAMS:
        return PROGRAMS[format_](block.text, spec.ascii_name)
    container, target = find_container(format_), target_of(spec)
    units = {axis.suffix: target.axes[number].factor for number, axis in planned_axes(spec).items()}
    source = given = parse_function_block(block.text)
    if spec.export.plc_tables == "variables":
        given = buffered_planner(source)
    files = list[File]()
    for ending, part in {"": given, **planner_wrappers(source, units, format_)}.items():
        written = container.wrap(part, attrs.evolve(target, name=f"{target.name}{ending}"))
        back = container.unwrap(written[0].content, target)
        if part.within:
            parts = {PurePath(file.filename).stem: file.content for file in written}
            back = _with_others(back, partial(_part_of, container, target, parts))
        if back.program() != part.program():
            raise ExportError(f"{format_}: what was written reads back as another block; export {PORTABLE}.")
        files += written
    if format_ == PORTABLE and given is source:  # with its comments
        files[0] = File(filename=block.filename, content=block.text.encode("ascii"))
    return tuple(files)


def _part_of(container: BlockContainer, target: Target, parts: Mapping[str, bytes], name: str) -> BlockSource:
    return container.unwrap(parts[name], target)


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
        It holds no planner block, or is a program.
    """
    content = read_artefact(path, what=WHAT)
    refuse_program(path, content)
    text = block_in(path, content)
    if not is_planner(text):
        refuse_wrapper(path, content, text)
        raise ExportError(f"{path} holds no planner block; name a file that gen-profile planner wrote.")
    return text


def block_in(path: Path, content: bytes, written: Mapping[str, bytes] | None = None) -> str:
    """Read a function block's text out of what a file holds; raises as `read_block` does.

    A planner block whose numbers are variables is given with constants, as it plans by these. Files of blocks
    within it are read beside it, where what was written does not hold them by name.
    """
    text = _text_in(path, content, written or {})
    if TABLE in text and is_planner(text) and is_buffered(source := parse_function_block(text)):
        return constant_planner(source).text()
    return text


def _text_in(path: Path, content: bytes, written: Mapping[str, bytes]) -> str:
    try:
        format_ = container_of(path)
    except SpecError:
        format_ = PORTABLE
    if format_ == PORTABLE:
        return decoded(content, path, WHAT)
    target = Target(name=path.stem, axes=(), start=(), export=ExportSpec(), can=CanSpec())
    container = find_container(format_)

    def beside(name: str) -> BlockSource:
        file = path.with_name(f"{name}{path.suffix}")
        content = written[file.name] if file.name in written else read_artefact(file, what=WHAT)
        return container.unwrap(content, target)

    source = container.unwrap(content, target)
    return (_with_others(source, beside) if is_planner(source.text()) else source).text()


def _with_others(source: BlockSource, read: Callable[[str], BlockSource]) -> BlockSource:
    """Read the blocks within one by their names, where a format has a file for each."""
    if source.within:
        return source
    asked, found = {source.name}, list[BlockSource]()

    def add(block: BlockSource) -> None:
        for variable in block.variables:
            if variable.section == "VAR" and variable.type.startswith("FB_") and variable.type not in asked:
                asked.add(variable.type)
                add(read(variable.type))
        if block is not source:
            found.append(block)

    add(source)
    return attrs.evolve(source, within=tuple(found))
