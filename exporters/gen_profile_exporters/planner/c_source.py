"""The planner block as C99: the same statements, between structures of inputs, outputs and state."""

from __future__ import annotations

import re
from collections.abc import Iterable
from textwrap import indent

from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.exporter import File
from gen_profile_exporters.st_to_c import translate_statements
from gen_profile_exporters.st_variables import StVariable, c_constants, c_initials, c_member

OWNERS = {"VAR_INPUT": "in->", "VAR_OUTPUT": "state->out.", "VAR": "state->"}

HEADER = """\
/*
 * {file}.h: a planner, which plans every motion of its axes, in C99, from gen-profile.
 *
 * Made of the function block {block} of {file}.st; setpoints are the same, bit for bit. It allocates
 * nothing and calls nothing but fabs, sqrt and nearbyint of libm; a state takes some {kilobytes:.0f} kB.
 *
 *     {name}_state state;
 *     {name}_inputs in;
 *     {name}_outputs out;
 *     {name}_init(&state, &in);
 *     {name}_step(&state, &in, &out);
 *
 * the last in every cycle, after setting what changed of `in`; then {positions}. Names
 * and behaviour are the block's. Its own words:
 *
{words}
 */
#ifndef {guard}_H
#define {guard}_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {{
#endif

typedef struct {{
{inputs}
}} {name}_inputs;

typedef struct {{
{outputs}
}} {name}_outputs;

/* Memory of the planner: to be kept from cycle to cycle, and to be changed by its functions only. */
typedef struct {{
    {name}_outputs out;
{memory}
}} {name}_state;

/* Set the state, and all inputs to their initial values. Once, before all else. */
void {name}_init({name}_state *state, {name}_inputs *in);

/* Plan and issue the next setpoint. Once in every cycle. */
void {name}_step({name}_state *state, const {name}_inputs *in, {name}_outputs *out);

#ifdef __cplusplus
}}
#endif

#endif
"""

SOURCE = """\
/* {file}.c: see {file}.h. Compile as C99 (-std=c99), without -ffast-math. */
#include "{file}.h"

#include <math.h>
#include <string.h>

#ifdef __FAST_MATH__
#error "-ffast-math: inputs that are no numbers could not be distinguished from others."
#endif
/* A product and a sum in one rounding would give other bits; GCC keeps to -std=c99 by itself. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

{constants}

void {name}_init({name}_state *state, {name}_inputs *in)
{{
    memset(state, 0, sizeof *state);
    memset(in, 0, sizeof *in);
{initials}
}}

void {name}_step({name}_state *state, const {name}_inputs *in, {name}_outputs *out)
{{
{body}
    *out = state->out;
}}
"""


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
    source, statements = parse_function_block(text), translate_statements(text, OWNERS)
    names = {"file": file, "name": c_name(file), "guard": c_name(file).upper(), "block": source.name}
    by_section = {section: [v for v in statements.variables if v.section == section] for section in OWNERS}
    initials = c_initials(statements.variables, OWNERS)
    code = SOURCE.format(
        **names,
        constants="\n".join(c_constants(statements.variables, statements.body)),
        initials=indent("\n".join(initials), "    "),
        body=indent("\n".join(statements.body), "    "),
    )
    positions = [f"out.{v.name}" for v in by_section["VAR_OUTPUT"] if v.name.startswith("fPosition")]
    header = HEADER.format(
        **names,
        positions=" and ".join(positions) + (" are the setpoints" if positions[1:] else " is the setpoint"),
        kilobytes=sum(map(_bytes, by_section["VAR"])) / 1000.0,
        words="\n".join(f" * {line}".rstrip() for line in _words(source).splitlines()),
        inputs=_members(by_section["VAR_INPUT"], source),
        outputs=_members(by_section["VAR_OUTPUT"], source),
        memory="\n".join(f"    {c_member(v)};" for v in by_section["VAR"]),
    )
    return (
        File(filename=f"{file}.c", content=code.encode("ascii")),
        File(filename=f"{file}.h", content=header.encode("ascii")),
    )


def _members(variables: Iterable[StVariable], source: BlockSource) -> str:
    comments = {v.name: v.comment for v in source.variables}
    lines = [
        f"    {c_member(v)};" + (f" /* {comments[v.name]} */" if comments[v.name] else "") for v in variables
    ]
    return "\n".join(lines)


def _words(source: BlockSource) -> str:
    """Take the block's header out of its comment."""
    words = source.header.strip().removeprefix("(*").removesuffix("*)").strip("\n")
    return "\n".join(line.removeprefix("    ").rstrip() for line in words.splitlines())


def _bytes(variable: StVariable) -> int:
    return {"BOOL": 1, "DINT": 4, "LREAL": 8}[variable.type] * max(1, variable.length)
