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
from collections.abc import Callable, Container, Iterator, Mapping
from math import ceil

import attrs

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import BlockSource, BlockVariable, initialiser
from gen_profile_exporters.planner import numbers_within as within
from gen_profile_exporters.planner.layout import narrow, with_while_loops
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
    """Put variables in place of a planner block's numbers, and of those of the blocks within it."""
    own, distinct = _own(source)
    (table,) = (one.type for one in own if one.name == buffers.TABLE)
    types = within.with_variables(source.within, _places(source), _statements, table)
    taken = {one.name for one in within.numbers_of(source)}
    variables = [attrs.evolve(one, section="VAR") if one.name in taken else one for one in source.variables]
    before, behind = _around(source, types, distinct)
    body = _ENABLE.sub("bMayEnable", within.given_table(source, types))
    return attrs.evolve(
        source, variables=(*variables, *own), body=before + body + behind, within=tuple(types.values())
    )


def constant_planner(source: BlockSource) -> BlockSource:
    """Undo `buffered_planner`: give the block of constants that holds the first buffer's numbers.

    Raises
    ------
    ExportError
        The block is none that `buffered_planner` gives.
    """
    there = {one.name for one in source.variables}
    names = [one.name for one in buffers.declared([], 0, 1, _MEMBERS, cKind=0, cLayout=0, cPatience=0)]
    ours = {f"{name}{OURS}" if f"{name}{OURS}" in there else name for name in names}
    texts = iter(buffers.buffer_texts(source)[len(buffers.HEAD) :])
    try:
        back = _of_constants(source, texts, ours)
        inner = {
            one.name: _of_constants(one, texts, within.ADDED)
            for one in sorted(source.within, key=lambda one: one.name.lower())
        }
        back = attrs.evolve(back, within=tuple(inner[one.name] for one in source.within))
        places, types = _places(back), {one.name.lower(): one for one in source.within}
        originals = [
            _unwrapped(one, within.before(one, types, places[one.name], _statements), within.BEHIND)
            for one in back.within
        ]
        back = attrs.evolve(back, within=tuple(originals))
        back = _unwrapped(back, *_around(back, types, _own(back)[1]))
        back = attrs.evolve(back, body=back.body.replace("bMayEnable", "bEnable"))
        same = buffered_planner(back).program() == source.program()
    except (StopIteration, ValueError, KeyError) as error:
        raise ExportError(buffers.ALTERED) from error
    if not same:
        raise ExportError(
            "The block does not take its numbers from its buffers as it should: it was altered; export it "
            "again."
        )
    return back


def _of_constants(source: BlockSource, texts: Iterator[str], added: Container[str]) -> BlockSource:
    """Make constants of a block's variables that are numbers, and leave out what was added."""
    kept = [one for one in source.variables if one.name not in added]
    constants = {
        one.name: attrs.evolve(one, section="VAR CONSTANT")
        for one in kept
        if one.section == "VAR" and _NUMBER.fullmatch(one.name)
    }
    block = attrs.evolve(source, variables=tuple(constants.get(one.name, one) for one in kept))
    found = {one.name: _constant(one, [next(texts) for _ in one.values]) for one in within.numbers_of(block)}
    return attrs.evolve(block, variables=tuple(found.get(one.name, one) for one in block.variables))


def _unwrapped(source: BlockSource, before: str, behind: str) -> BlockSource:
    """Give a block the statements that it had before others were put around them."""
    body, given = source.body, within.GIVEN
    if not body.startswith(before):  # out of a format that has white space of its own
        body, before, behind, given = (" ".join(text.split()) for text in (body, before, behind, given))
        given += " "
    return attrs.evolve(source, body=body.removeprefix(before).removesuffix(behind).replace(given, "("))


def _places(source: BlockSource) -> dict[str, int]:
    """Say where the numbers of the blocks within a block stand in a buffer: behind its own."""
    own = sum(len(one.values) for one in within.numbers_of(source))
    return within.places_of(source.within, len(buffers.HEAD) + own)


def _suffixes(source: BlockSource) -> list[str]:
    """Give what the names of each axis's outputs end with."""
    outputs = [one.name for one in source.variables if one.section == "VAR_OUTPUT"]
    return [name.removeprefix("fPosition") for name in outputs if name.startswith("fPosition")]


def _constant(variable: BlockVariable, texts: list[str]) -> BlockVariable:
    if variable.scalar_type == "DINT":
        texts = [text.removesuffix(".0") for text in texts]
    return attrs.evolve(variable, initial=initialiser(texts) if variable.array else texts[0])


def _own(source: BlockSource) -> tuple[list[BlockVariable], Callable[[str], str]]:
    """Declare what is added, and give what renames it in statements where the block has such names."""
    (cycle,) = (float(one.initial) for one in source.variables if one.name == "cCycle")
    blocks = [source, *sorted(source.within, key=lambda one: one.name.lower())]
    numbers = [one for block in blocks for one in within.numbers_of(block)]
    content = [text if "." in text else f"{text}.0" for one in numbers for text in one.values]
    texts = buffers.with_head(content, cycle)
    own = buffers.declared(
        texts,
        len(texts),
        len(_suffixes(source)),
        _MEMBERS,
        cKind=_kind(source),
        cLayout=buffers.LAYOUT_NAMES.index(buffers.PLANNER),
        cPatience=ceil(buffers.CLIENT_TIMEOUT / cycle),
    )
    taken = {one.name.lower() for one in source.variables}
    renamed = {one.name: f"{one.name}{OURS}" for one in own if one.name.lower() in taken}

    def distinct(text: str) -> str:
        return _WORD.sub(lambda word: renamed.get(word[0], word[0]), text)

    return [attrs.evolve(one, name=distinct(one.name)) for one in own], distinct


def _kind(source: BlockSource) -> int:
    """Hash all of a block but its numbers, which is what two must have in common."""
    parts = [_structure(one) for one in (source, *sorted(source.within, key=lambda one: one.name.lower()))]
    return zlib.crc32(repr(parts).encode()) >> 1


def _structure(source: BlockSource) -> tuple[object, ...]:
    names = {one.name for one in within.numbers_of(source)}
    variables = sorted(
        (one.section, one.name, one.type, "" if one.name in names else "".join(one.initial.split()))
        for one in source.variables
    )
    return variables, source.body.split()


def _around(
    source: BlockSource, types: Mapping[str, BlockSource], distinct: Callable[[str], str]
) -> tuple[str, str]:
    """Write what stands ahead of the statements that plan, and behind them."""
    suffixes = _suffixes(source)
    moving = "".join(f" OR (ABS(fVelocity{of}) > cStill{of})" for of in suffixes)
    base, counter = map(distinct, ("nBase", "nCheck"))
    taken, begun = _statements(source, base, counter, len(buffers.HEAD))
    anew = distinct("bForget")
    values = {
        "moves": f"(bEnable OR (nState <> cDisabled){moving})",
        "plays": "(nState <> cDisabled)",
        "taken": "\n".join(f"        {line}" for line in (*taken, *within.calls(source, types, anew, base))),
        "begun": "\n".join(f"            {line}" for line in begun),
        "unknown": "nLost := cPromiseSway",
    }
    # what is put in has the block's names, which are not ours
    text = distinct(left_open("planner/requests.st")).replace("cCycleTime", "cCycle")
    text = _HOLE.sub(lambda hole: values[hole[1]], text.replace("cAxes", str(len(suffixes))))
    names = ("Position", "Velocity", "Acceleration", "Goal", "Order")
    shown = [[f"f{name}{of}" for name in names] for of in suffixes]
    state = distinct(filled("planner/state.st", last=buffers.state_length(len(suffixes)) - 1, axes=shown))
    return narrow(with_while_loops(text)), narrow(with_while_loops(state))


def _statements(source: BlockSource, base: str, counter: str, first: int) -> tuple[list[str], list[str]]:
    """Write what takes a block's numbers over from a buffer, and what makes it as after a cold start."""
    taken = _taken(within.numbers_of(source), base, counter, first)
    return [*taken], [*_begun(source, counter)]


def _taken(numbers: list[BlockVariable], base: str, counter: str, place: int) -> Iterator[str]:
    """Take the numbers over from the buffer in use, from a place on."""
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
        if one.section not in ("VAR", "VAR_OUTPUT") or one.scalar_type not in _NOTHING:
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
