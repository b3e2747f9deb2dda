"""A planner block whose numbers are variables in two buffers, of which one is in use, as in a playback block.

What a spec decides by its structure stands in the block's text: how many modes and axes there are, how long
its arrays are, what inputs it has. What it decides by numbers are constants. So another spec's numbers fit a
block if all else is the same, to the letter.

The numbers become variables of the same names, which take the buffer's values over while the block is
disabled, and only once the checksum over the buffer was found right; the statements that plan stay as they
are. A switch makes the block forget all that it knows: it begins as after a cold start, but promises nothing
before the load was seen to hang still.
"""

import re
import zlib
from collections.abc import Callable, Iterator
from math import ceil

import attrs

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, BlockVariable, initialiser
from gen_profile_exporters.planner.block import narrow, with_while_loops
from gen_profile_exporters.playback import buffers
from gen_profile_exporters.templates import filled, left_open

OURS = "OfBuffer"  # behind names that the block has already
_WORD = re.compile(r"\w+")
_ENABLE = re.compile(r"\bbEnable\b")
_NUMBER = re.compile(r"c[A-Z]\w*")
_MORE = {
    "DINT": ("nCheck", "nCheckRow", "nHead", "nUpper", "nWord"),
    "LREAL": ("fValue", "fMantissa", "fWord", "fSum"),
    "BOOL": ("bChecked", "bIntact", "bForget", "bMayEnable"),
}
_MEMBERS = {type_: (*buffers.VARIABLES[type_], *names) for type_, names in _MORE.items()}
_HOLE = re.compile(r"@(\w+)")
_NOTHING = {"LREAL": "0.0", "DINT": "0", "BOOL": "FALSE"}


def buffered_planner(source: BlockSource) -> BlockSource:
    """Put variables in place of a planner block's numbers.

    Raises
    ------
    ExportError
        It has other blocks within it, whose numbers no buffer reaches yet.
    """
    if source.within:
        words = "blocks within a block take their numbers as constants alone"
        raise ExportError(f'export.plc_tables: {words}; take "constants".')
    numbers = [one for one in source.variables if _is_number(one)]
    own, distinct = _own(source, numbers)
    taken = {one.name for one in numbers}
    variables = [attrs.evolve(one, section="VAR") if one.name in taken else one for one in source.variables]
    before, behind = _around(source, numbers, distinct)
    return attrs.evolve(
        source, variables=(*variables, *own), body=before + _ENABLE.sub("bMayEnable", source.body) + behind
    )


def constant_planner(source: BlockSource) -> BlockSource:
    """Undo `buffered_planner`: give the block of constants that holds the first buffer's numbers.

    Raises
    ------
    ExportError
        The block is none that `buffered_planner` gives.
    """
    texts = iter(buffers.buffer_texts(source)[len(buffers.HEAD) :])
    there = {one.name for one in source.variables}
    names = [one.name for one in buffers.declared([], 0, 1, _MEMBERS, cKind=0, cLayout=0, cPatience=0)]
    ours = {f"{name}{OURS}" if f"{name}{OURS}" in there else name for name in names}
    try:
        variables = [
            _constant(one, [next(texts) for _ in one.values])
            if one.section == "VAR" and _NUMBER.fullmatch(one.name)
            else one
            for one in source.variables
            if one.name not in ours
        ]
        back = attrs.evolve(source, variables=tuple(variables))
        numbers = [one for one in variables if _is_number(one)]
        before, behind = _around(back, numbers, _own(back, numbers)[1])
        body = source.body
        if not body.startswith(before):  # out of a format that has white space of its own
            body, before, behind = (" ".join(text.split()) for text in (body, before, behind))
        body = body.removeprefix(before).removesuffix(behind)
        back = attrs.evolve(back, body=body.replace("bMayEnable", "bEnable"))
        same = buffered_planner(back).program() == source.program()
    except (StopIteration, ValueError, KeyError) as error:
        raise ExportError(buffers.ALTERED) from error
    if not same:
        raise ExportError(
            "The block does not take its numbers from its buffers as it should: it was altered; export it "
            "again."
        )
    return back


def _is_number(variable: BlockVariable) -> bool:
    return variable.section == "VAR CONSTANT" and variable.scalar_type != "BOOL"


def _initial(numbers: list[BlockVariable], name: str) -> str:
    return {one.name: one.initial for one in numbers}[name]


def _constant(variable: BlockVariable, texts: list[str]) -> BlockVariable:
    if variable.scalar_type == "DINT":
        texts = [text.removesuffix(".0") for text in texts]
    initial = initialiser(texts) if variable.array else texts[0]
    return attrs.evolve(variable, section="VAR CONSTANT", initial=initial)


def _own(
    source: BlockSource, numbers: list[BlockVariable]
) -> tuple[list[BlockVariable], Callable[[str], str]]:
    """Declare what is added, and give what renames it in statements where the block has such names."""
    cycle = float(_initial(numbers, "cCycle"))
    content = [text if "." in text else f"{text}.0" for one in numbers for text in one.values]
    texts = buffers.with_head(content, cycle)
    own = buffers.declared(
        texts,
        len(texts),
        int(_initial(numbers, "cAxes")),
        _MEMBERS,
        cKind=_kind(source, numbers),
        cLayout=buffers.LAYOUT_NAMES.index(buffers.PLANNER),
        cPatience=ceil(buffers.CLIENT_TIMEOUT / cycle),
    )
    taken = {one.name.lower() for one in source.variables}
    renamed = {one.name: f"{one.name}{OURS}" for one in own if one.name.lower() in taken}

    def distinct(text: str) -> str:
        return _WORD.sub(lambda word: renamed.get(word[0], word[0]), text)

    return [attrs.evolve(one, name=distinct(one.name)) for one in own], distinct


def _kind(source: BlockSource, numbers: list[BlockVariable]) -> int:
    """Hash all of a block but its numbers, which is what two must have in common."""
    names = {one.name for one in numbers}
    variables = sorted(
        (one.section, one.name, one.type, "" if one.name in names else "".join(one.initial.split()))
        for one in source.variables
    )
    return zlib.crc32(repr((variables, source.body.split())).encode()) >> 1


def _around(
    source: BlockSource, numbers: list[BlockVariable], distinct: Callable[[str], str]
) -> tuple[str, str]:
    """Write what stands ahead of the statements that plan, and behind them."""
    axes = int(_initial(numbers, "cAxes"))
    moving = "".join(f" OR (ABS(aVelocity[{axis}]) > cStill[{axis}])" for axis in range(axes))
    values = {
        "moves": f"(bEnable OR (nState <> cDisabled){moving})",
        "plays": "(nState <> cDisabled)",
        "taken": "\n".join(
            f"        {line}" for line in _taken(numbers, *map(distinct, ("nBase", "nCheck")))
        ),
        "begun": "\n".join(f"            {line}" for line in _begun(source, distinct("nCheck"))),
    }
    # what is put in has the block's names, which are not ours
    text = distinct(left_open("planner/requests.st")).replace("cCycleTime", "cCycle")
    text = _HOLE.sub(lambda hole: values[hole[1]], text)
    state = distinct(filled("planner/state.st", last=buffers.state_length(axes) - 1))
    return narrow(with_while_loops(text)), narrow(with_while_loops(state))


def _taken(numbers: list[BlockVariable], base: str, counter: str) -> Iterator[str]:
    """Take the numbers over from the buffer in use."""
    place = len(buffers.HEAD)
    for one in numbers:
        convert = "LREAL_TO_DINT({})" if one.scalar_type == "DINT" else "{}"
        count = len(one.values)
        if one.array:
            value = convert.format(f"{buffers.TABLE}[{base} + {counter} + {place}]")
            yield from _loop(counter, count, f"{one.name}[{counter}] := {value};")
        else:
            yield f"{one.name} := {convert.format(f'{buffers.TABLE}[{base} + {place}]')};"
        place += count


def _begun(source: BlockSource, counter: str) -> Iterator[str]:
    """Set all that the block knows to what it is after a cold start."""
    for one in source.variables:
        if one.section not in ("VAR", "VAR_OUTPUT"):
            continue
        nothing = _NOTHING[one.scalar_type]
        if not one.array:
            yield f"{one.name} := {one.initial or nothing};"
        elif one.initial:
            yield from (f"{one.name}[{k}] := {text};" for k, text in enumerate(one.elements))
        else:
            yield from _loop(counter, int(one.array[1]) + 1, f"{one.name}[{counter}] := {nothing};")


def _loop(counter: str, count: int, statement: str) -> tuple[str, str, str]:
    return f"FOR {counter} := 0 TO {count - 1} DO", f"    {statement}", "END_FOR;"
