"""All of an exported block counts: an altered number stops the block, and replay refuses any change."""

import re

import pytest
from motions import bang_bang, quintic, target
from playing import IDLE, start
from st_interpreter import FunctionBlock, StError
from test_profile_library import started, together

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.playback import structured_text
from gen_profile_exporters.playback.library import read_library
from gen_profile_exporters.vendors import codesys, plcopen_xml, siemens_scl, twincat

LAYOUTS = ["segments", "samples", "counts"]
ONE, TWO = bang_bang(), quintic((0.1, 0.4), (1.2, -0.7), duration=0.4)
CONTAINERS = [codesys, plcopen_xml, siemens_scl, twincat]
# What the commissioning engineer may set to something else: a default of an input.
FREE = re.compile(r"fStartTolerance : [^;]*;")
COMMENT = re.compile(r"\(\*.*?\*\)", re.DOTALL)
CONSTANTS = re.compile(r"VAR CONSTANT\n.*?END_VAR", re.DOTALL)
PIECE = re.compile(r"\[[^\[\]]*\]|[\w.]+|:=|\S")
NUMBER = re.compile(r"(?<![\w.])(?:\d+\.\d+(?:E[+-]\d+)?|\d+|TRUE|FALSE)(?!\w)")


def goal_of(profile, layout, tables="constants"):
    names = ("bridge", "trolley")[: profile.axes]
    return target(*names, cycle_time=0.1, export={"plc_layout": layout, "plc_tables": tables})


def without_what_is_free(text):
    """The program at its places, blanks in place of what may be edited."""
    for left_out in (COMMENT, FREE):
        text = left_out.sub(lambda found: " " * len(found[0]), text)
    return text


def other(value):
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value - 1 if value > 1000 else value + 1
    return value * (1.0 + 1e-9) + 1e-7


def text_of(value):
    return str(value).upper() if isinstance(value, bool) else structured_text.literal(value)


def refuses(fb, begin):
    """Whether the block stands still although it is commanded to start, and is not done either."""
    try:
        for _ in range(60):
            fb.call(**IDLE)
        rows = [begin(fb), *(fb.call() for _ in range(8))]
    except StError as error:
        return "index" in str(error)  # it reads beyond its table: controllers stop, or read what is no table
    moved = any(row["fposition"] != rows[0]["fposition"] for row in rows)
    return not moved and not any(row["bdone"] or row["baborted"] for row in rows)


@pytest.mark.slow
@pytest.mark.parametrize("profile", [ONE, TWO], ids=["one axis", "two axes"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_block_refuses_to_start_with_any_altered_constant(layout, profile):
    text = structured_text.block_text(profile, goal_of(profile, layout))
    at = {"fActPosition": FunctionBlock(text)["cStart"], "fCycleTime": 0.1}

    def begin(fb):
        return start(fb, **at)

    assert not refuses(FunctionBlock(text), begin)
    constants = list(FunctionBlock(text).constants())
    assert len(constants) > 30
    for name, index, value in constants:
        fb = FunctionBlock(text)
        fb.alter(name, index, other(value))
        assert refuses(fb, begin), (name, index, value)


@pytest.mark.slow
def test_a_library_refuses_to_start_with_any_altered_constant_of_the_motion_that_it_plays():
    texts = [structured_text.block_text(bang_bang(a), goal_of(ONE, "segments")) for a in (1.2, 0.6)]
    text = together(texts, goal_of(ONE, "segments"))
    rows = FunctionBlock(texts[0])["cRows"]

    def begin(fb):
        return started(fb, 0, fActPosition=0.1, fCycleTime=0.1)

    assert not refuses(FunctionBlock(text), begin)
    for name, index, value in FunctionBlock(text).constants():
        own = index is None or index < (rows if name.startswith(("cpower", "cfirst")) else 1)
        if (own and name not in {"cprofiles", "cfirstrow", "cfirstsegment"}) or (name, index) == (
            "cfirstrow",
            0,
        ):
            fb = FunctionBlock(text)
            fb.alter(name, index, other(value))
            assert refuses(fb, begin), (name, index, value)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("layout", "profile"), [("segments", ONE), ("samples", TWO), ("counts", ONE)], ids=LAYOUTS
)
def test_replay_refuses_any_altered_number(layout, profile):
    goal = goal_of(profile, layout)
    text = structured_text.block_text(profile, goal)
    program = without_what_is_free(text)
    # the statements are the same in all of them
    begin, end = (0, len(text)) if layout == "segments" else CONSTANTS.search(program).span()
    found = list(NUMBER.finditer(program, begin, end))
    assert len(found) > 50
    for number in found:
        old = number[0]
        value = {"TRUE": True, "FALSE": False}.get(old, float(old) if "." in old else None)
        new = str(int(old) + 1) if value is None else text_of(other(value))
        with pytest.raises(ExportError):
            structured_text.read_table(text[: number.start()] + new + text[number.end() :], goal)


@pytest.mark.slow
@pytest.mark.parametrize("container", CONTAINERS, ids=lambda module: module.__name__.rpartition(".")[2])
def test_a_container_is_refused_with_any_altered_constant(container):
    goal = goal_of(ONE, "segments")
    text = container.encode(ONE, goal)[0].content.decode()
    declared = {name for name, _, _ in FunctionBlock(structured_text.block_text(ONE, goal)).constants()}
    for name in declared:
        place = re.search(rf"\b{name}\b", text, re.IGNORECASE).end()
        number = NUMBER.search(text, place)
        new = {"TRUE": "FALSE"}.get(number[0], f"9{number[0]}")
        with pytest.raises(ExportError):
            container.replay((text[: number.start()] + new + text[number.end() :]).encode(), goal)


def single(text, goal):
    return [structured_text.read_table(text, goal).motion()]


def library(text, goal):
    return read_library(parse_function_block(text), goal)


def written(tables, read):
    """A block's text, for two axes, and what it is for."""
    goal = goal_of(TWO, "segments", tables)
    text = structured_text.block_text(TWO, goal)
    return (text if read is single else together([text, text], goal)), goal


BLOCKS = pytest.mark.parametrize("read", [single, library])
TABLES = pytest.mark.parametrize("tables", ["constants", "variables"])


@pytest.mark.slow
@BLOCKS
@TABLES
def test_replay_refuses_a_block_that_lacks_or_repeats_any_piece(tables, read):
    text, goal = written(tables, read)
    for number, piece in enumerate(list(PIECE.finditer(without_what_is_free(text)))[::61]):
        new = "" if number % 2 else f"{piece[0]} {piece[0]}"
        with pytest.raises(ExportError):
            read(text[: piece.start()] + new + text[piece.end() :], goal)


@BLOCKS
@TABLES
def test_replay_takes_other_white_space_and_comments(tables, read):
    text, goal = written(tables, read)
    hashes = [motion.payload_hash() for motion in read(text, goal)]
    edited = text.replace(" := ", ":=").replace(";", " ;").replace("    ", "\t").replace("\n", "\r\n\r\n")
    edited = edited.replace("VAR_INPUT", "VAR_INPUT (* 2 * 3 *)")
    assert [motion.payload_hash() for motion in read(edited, goal)] == hashes


@pytest.mark.slow
@pytest.mark.parametrize("container", [structured_text, twincat, siemens_scl])
@TABLES
@pytest.mark.parametrize("place", ["    nState : DINT;", "    bMoving", "VAR_INPUT\n", "    fSum : LREAL;\n"])
def test_what_stands_beside_the_declarations_is_refused(container, tables, place):
    """A compiler may take it for a part of one, as RETAIN."""
    goal = goal_of(ONE, "segments", tables)
    content = container.encode(ONE, goal)[0].content.decode()
    assert container.replay(content.encode(), goal)
    for other in ("RETAIN", ";", "x"):
        altered = content.replace(
            place, f"{place} {other} " if place.endswith("\n") else f" {other}{place}", 1
        )
        with pytest.raises(ExportError, match=f"{re.escape(repr(other))} stands "):
            container.replay(altered.encode(), goal)


@pytest.mark.slow
@pytest.mark.parametrize("container", [plcopen_xml, codesys])
@TABLES
@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("<localVars>", '<localVars retain="true">', "localVars retain"),
        ('constant="true"', 'constant="true" nonretain="true"', "localVars constant nonretain"),
        ("<inputVars>", '<inputVars constant="true">', "inputVars constant"),
        ("<localVars>", "<globalVars/><localVars>", "globalVars"),
        ('name="nState"', 'name="nState" address="%MW0"', "address"),
        ("<value>", '<value repetitionValue="2">', "repetitionValue"),
    ],
)
def test_what_an_attribute_changes_is_refused(container, tables, old, new, word):
    """It passed unseen, though a retained state goes on where it was after a restart."""
    goal = goal_of(ONE, "segments", tables)
    content = container.encode(ONE, goal)[0].content.decode()
    added = '<addData><data name="text" handleUnknown="discard"/></addData>'  # as CODESYS does beside
    for place in ("</variable>", "</interface>"):
        assert container.replay(content.replace(place, added + place).encode(), goal)
    assert container.replay(content.replace("<localVars>", '<localVars retain="false">').encode(), goal)
    with pytest.raises(ExportError, match=f"^line [0-9]+: '{word}' stands beside the declarations"):
        container.replay(content.replace(old, new, 1).encode(), goal)


@BLOCKS
@TABLES
def test_a_declaration_that_stands_twice_is_refused(tables, read):
    text, goal = written(tables, read)
    with pytest.raises(ExportError):
        read(text.replace("    nState : DINT;\n", 2 * "    nState : DINT;\n", 1), goal)
