"""The planner block as C99: the same statements, between structures of inputs, outputs and state."""

import re
from collections.abc import Iterable, Mapping

from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.exporter import File
from gen_profile_exporters.st_to_c import Statements, c_parts, translate_statements
from gen_profile_exporters.st_variables import StVariable, c_constants, c_initials, c_member
from gen_profile_exporters.templates import filled, indented

OWNERS = {"VAR_INPUT": "in->", "VAR_OUTPUT": "state->out.", "VAR": "state->"}


def c_name(name: str) -> str:
    """Begin the names of functions and types: the spec's name with what C takes."""
    return re.sub(r"\W|^(?=\d)", "_", name, flags=re.ASCII)


def c_files(text: str, file: str) -> tuple[File, File]:
    """Write a planner block as a C file and its header.

    Parameters
    ----------
    text : str
        The block.
    file : str
        Name of both files without suffix; functions and types are named after it.

    Raises
    ------
    ExportError
        The text is no function block of the subset that is translated.
    """
    source, (*within, statements) = parse_function_block(text), translate_statements(text, OWNERS)
    names = {"file": file, "name": c_name(file), "guard": c_name(file).upper(), "block": source.name}
    by_section = {section: [v for v in statements.variables if v.section == section] for section in OWNERS}
    code = filled(
        "c/planner.c",
        **names,
        blocks="".join(
            filled("c/planner_within.c", **c_parts(block, within=True)) + "\n" for block in within
        ),
        constants="\n".join(c_constants(statements.variables, statements.body)),
        initials=indented(c_initials(statements.variables, OWNERS)),
        body=indented(statements.body),
    )
    positions = [f"out.{v.name}" for v in by_section["VAR_OUTPUT"] if v.name.startswith("fPosition")]
    sizes: dict[str, int] = {}
    for block in (*within, statements):
        sizes[block.name] = sum(_bytes(v, sizes) for v in block.variables if v.section != "VAR CONSTANT")
    header = filled(
        "c/planner.h",
        **names,
        positions=" and ".join(positions) + (" are the setpoints" if positions[1:] else " is the setpoint"),
        kilobytes=f"{sizes[statements.name] / 1000.0:.0f}",
        structures="".join(map(_structure, within)),
        words="\n".join(f" * {line}".rstrip() for line in _words(source).splitlines()),
        inputs=_members(by_section["VAR_INPUT"], source),
        outputs=_members(by_section["VAR_OUTPUT"], source),
        memory=indented(f"{c_member(v)};" for v in by_section["VAR"]),
    )
    return (File(f"{file}.c", code.encode("ascii")), File(f"{file}.h", header.encode("ascii")))


def _structure(block: Statements) -> str:
    members = indented(f"{c_member(v)};" for v in block.variables if v.section != "VAR CONSTANT")
    return f"typedef struct {{\n{members}\n}} {block.name};\n\n"


def _members(variables: Iterable[StVariable], source: BlockSource) -> str:
    comments = {v.name: v.comment for v in source.variables}
    return indented(
        f"{c_member(v)};" + (f" /* {comments[v.name]} */" if comments[v.name] else "") for v in variables
    )


def _words(source: BlockSource) -> str:
    """Take the block's header out of its comment."""
    words = source.header.strip().removeprefix("(*").removesuffix("*)").strip("\n")
    return "\n".join(line.removeprefix("    ").rstrip() for line in words.splitlines())


def _bytes(variable: StVariable, blocks: Mapping[str, int]) -> int:
    sizes = {"BOOL": 1, "DINT": 4, "LREAL": 8, **blocks}
    return 8 if variable.section == "VAR_IN_OUT" else sizes[variable.type] * max(1, variable.length)
