"""Numbers of the blocks within a planner block, as variables that are taken over from its buffer.

Each block within gets the table and three inputs: where bTakes is set, a call takes the block's numbers over
from the buffer that begins at nNumbersAt, with bAnew the block becomes what it is after a cold start, and it
calls those that it has within it likewise; it does nothing else then. All instances of a block have the same
numbers.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping

import attrs

from gen_profile_exporters.block_source import BlockSource, BlockVariable
from gen_profile_exporters.planner.layout import narrow, with_while_loops
from gen_profile_exporters.playback.buffers import TABLE

COUNTER = "nTaken"
INPUTS = (
    BlockVariable("VAR_INPUT", "bTakes", "BOOL", comment="take numbers over, and do nothing else"),
    BlockVariable("VAR_INPUT", "bAnew", "BOOL", comment="and forget all that is known"),
    BlockVariable("VAR_INPUT", "nNumbersAt", "DINT", comment="where the buffer begins"),
)
ADDED = {TABLE, COUNTER, *(one.name for one in INPUTS)}
GIVEN = f"(bTakes := FALSE, {TABLE} := {TABLE}, "  # to all calls that take nothing
BEHIND = "END_IF;\n"

Statements = Callable[[BlockSource, str, str, int], tuple[list[str], list[str]]]


def numbers_of(block: BlockSource) -> list[BlockVariable]:
    """Give the constants of a block that are numbers: single ones first, as SCL puts arrays last."""
    found = [one for one in block.variables if one.section == "VAR CONSTANT" and one.scalar_type != "BOOL"]
    return sorted(found, key=lambda one: one.array is not None)


def instances(block: BlockSource, types: Mapping[str, BlockSource]) -> dict[str, BlockSource]:
    """Give the blocks that a block has within it, by the names of its instances."""
    return {one.name: types[one.type.lower()] for one in block.variables if one.type.lower() in types}


def calls(block: BlockSource, types: Mapping[str, BlockSource], anew: str, begin: str) -> Iterator[str]:
    """Let all instances take their numbers over; arrays are those that they are given elsewhere, too."""
    for name, of in instances(block, types).items():
        given = [f"bTakes := TRUE, bAnew := {anew}, nNumbersAt := {begin}, {TABLE} := {TABLE}"]
        for one in of.variables:
            if one.section == "VAR_IN_OUT" and one.name != TABLE:
                found = re.search(rf"\b{name}\s*\([^;]*?\b{one.name}\s*:=\s*(\w+)", block.body)
                given += [f"{one.name} := {found[1]}"] if found else []
        yield f"{name}({', '.join(given)});"


def given_table(block: BlockSource, types: Mapping[str, BlockSource]) -> str:
    """Give the table to all calls of a block's instances."""
    names = "|".join(instances(block, types))
    return re.sub(rf"\b({names})\(", rf"\1{GIVEN}", block.body) if names else block.body


def before(block: BlockSource, types: Mapping[str, BlockSource], first: int, statements: Statements) -> str:
    """Write what stands before the statements of a block within another one."""
    taken, begun = statements(block, "nNumbersAt", COUNTER, first)
    lines = [
        "IF bTakes THEN",
        *(f"    {line}" for line in taken),
        *(["    IF bAnew THEN", *(f"        {line}" for line in begun), "    END_IF;"] if begun else []),
        *(f"    {line}" for line in calls(block, types, "bAnew", "nNumbersAt")),
        "ELSE",
    ]
    return narrow(with_while_loops("\n".join(lines))) + "\n"


def with_variables(
    within: Iterable[BlockSource], places: Mapping[str, int], statements: Statements, table: str
) -> dict[str, BlockSource]:
    """Make variables of the numbers of blocks, each of which comes before those that use it.

    Parameters
    ----------
    within : iterable of BlockSource
    places : mapping of str to int
        Of each block's first number in a buffer, by the block's name.
    statements : callable
        Write what takes numbers over from a table, and what makes variables what they are at first.
    table : str
        Type of the table.

    Returns
    -------
    dict of str to BlockSource
        By their names in small letters.
    """
    types = dict[str, BlockSource]()
    for block in within:
        taken = {one.name for one in numbers_of(block)}
        variables = [
            attrs.evolve(one, section="VAR") if one.name in taken else one for one in block.variables
        ]
        added = BlockVariable("VAR_IN_OUT", TABLE, table), BlockVariable("VAR", COUNTER, "DINT")
        types[block.name.lower()] = attrs.evolve(
            block,
            variables=(*INPUTS, *added, *variables),
            body=before(block, types, places[block.name], statements) + given_table(block, types) + BEHIND,
        )
    return types


def places_of(within: Iterable[BlockSource], first: int) -> dict[str, int]:
    """Say where the numbers of blocks stand in a buffer, by the order of their names."""
    places = dict[str, int]()
    for block in sorted(within, key=lambda one: one.name.lower()):
        places[block.name] = first
        first += sum(len(one.values) for one in numbers_of(block))
    return places
