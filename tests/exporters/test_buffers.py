"""Playback blocks whose numbers are variables: what they play, take and refuse, in a strict interpreter."""

import math
import re

import numpy as np
import pytest
from motions import bang_bang, quintic, target
from playing import IDLE, checked, column, play
from st_interpreter import FunctionBlock

from gen_profile.planner.execution import BlockInstance
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.playback import buffers, structured_text
from gen_profile_exporters.playback.library import LibraryEntry, library_source, read_library
from gen_profile_exporters.playback.table import tabulate
from gen_profile_exporters.registry import containers, find_container
from gen_profile_exporters.vendors import twincat

CYCLE = 0.05
ONE, OTHER, TWO = bang_bang(), bang_bang(0.6), quintic((0.1, 0.4), (1.2, -0.7), duration=0.5)
READ, WRITE, SWITCH, RELEASE = 0.0, 1.0, 2.0, 3.0
MOVES, UNFIT, HELD = 2.0, 3.0, 1.0
LAYOUTS = ["segments", "samples", "counts"]


def goal_of(profile, layout="segments", tables="variables"):
    names = ("bridge", "trolley")[: profile.axes]
    return target(*names, cycle_time=CYCLE, export={"plc_layout": layout, "plc_tables": tables})


def text_of(profile, layout="segments"):
    return structured_text.block_text(profile, goal_of(profile, layout))


def library_of(*profiles, layout="segments"):
    goal = goal_of(profiles[0], layout)
    entries = [
        LibraryEntry(source=parse_function_block(text_of(profile, layout)), label=f"move {number}")
        for number, profile in enumerate(profiles)
    ]
    return library_source(entries, goal).text()


def values_of(text):
    return [float(value) for value in buffers.buffer_texts(parse_function_block(text))]


class Client:
    """Requests to an instance, one a cycle."""

    def __init__(self, fb, owner=1.0):
        self.fb, self.owner = fb, owner

    def ask(self, command, buffer=0.0, place=0, data=(), count=None, checksum=0.0):
        number = self.fb["aReply"][0] + 1.0
        head = [number, self.owner, command, buffer, float(place), float(count or len(data)), checksum]
        row = [*head, *[0.0] * 9, *data]
        self.fb.call(aRequest=[*row, *[0.0] * (255 - len(row)), number])
        reply = self.fb["aReply"]
        assert reply[0] == reply[255] == number
        return reply

    def write(self, values):
        for place in range(0, len(values), 239):
            part = values[place : place + 239]
            reply = self.ask(WRITE, 1.0, place, part)
            assert (reply[1], reply[16 : 16 + len(part)]) == (0.0, part)

    def in_use(self, length):
        return self.ask(READ, count=length)[16 : 16 + length]


def started(fb):
    fb.call(**IDLE)
    return fb.call(bExecute=True, fActPosition=fb["tStart"], fCycleTime=CYCLE)


@pytest.mark.slow
@pytest.mark.parametrize("profile", [ONE, TWO], ids=["one axis", "two axes"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_it_plays_what_the_block_of_constants_plays(layout, profile):
    text, table = text_of(profile, layout), tabulate(profile, goal_of(profile, layout))
    fb = checked(text)
    rows = play(fb, started(fb))
    for quantity in ("position", "velocity", "acceleration"):
        np.testing.assert_array_equal(column(rows, quantity), getattr(table.played, quantity))
    replayed = structured_text.read_table(text, goal_of(profile, layout)).motion()
    assert replayed.payload_hash() == table.motion().payload_hash()


@pytest.mark.slow
@pytest.mark.parametrize("profile", [ONE, TWO], ids=["one axis", "two axes"])
@pytest.mark.parametrize("form", containers())
def test_every_format_carries_it(form, profile):
    goal, container = goal_of(profile, "counts"), find_container(form)
    content = container.encode(profile, goal)[0].content
    assert values_of(container.unwrap(content, goal).text()) == values_of(text_of(profile, "counts"))
    expected = structured_text.read_table(text_of(profile, "counts"), goal).motion()
    assert container.replay(content, goal).payload_hash() == expected.payload_hash()


def test_a_wrapper_leaves_requests_to_the_block():
    """They are reached in its instance, so that there is one block only to be found."""
    block, wrapper = twincat.encode(ONE, goal_of(ONE))[:2]
    assert b"aRequest" in block.content and b"aRequest" not in wrapper.content
    assert b"aReply" in block.content and b"aReply" not in wrapper.content


def test_it_takes_another_table_and_goes_back():
    new, old = text_of(OTHER), text_of(ONE)
    fb = checked(old)
    client, values, before = Client(fb), values_of(new), values_of(old)
    assert client.in_use(len(before)) == before
    client.write(values)
    assert client.in_use(len(before)) == before  # until it is switched to
    for wanted, profile in ((values, OTHER), (before, ONE)):
        assert client.ask(SWITCH, checksum=wanted[1])[1] == 0.0
        while not fb["bChecked"]:
            fb.call()
        assert client.in_use(len(wanted)) == wanted and client.ask(READ)[9] == 2.0
        rows = play(fb, started(fb))
        expected = tabulate(profile, goal_of(profile)).played.position
        np.testing.assert_array_equal(column(rows, "position"), expected)


def test_a_start_waits_until_the_new_table_is_checked():
    fb = checked(text_of(ONE))
    client, values = Client(fb), values_of(text_of(OTHER))
    client.write(values)
    fb.call(**IDLE)
    client.ask(SWITCH, checksum=values[1])
    row = fb.call(bExecute=True, fActPosition=fb["tStart"], fCycleTime=CYCLE)
    assert row["bbusy"] and not fb["bChecked"]
    rows = play(fb, row)
    assert rows[-1]["bdone"] and column(rows, "position")[-1] == OTHER.target


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "start_first", "library"),
    [
        *((place, k % 2 == 0, False) for k, place in enumerate((0, 2, 3, 5, 9, 13, 17, 40, -1))),
        *((3, True, True), (5, False, True), (-1, True, True)),
    ],
)
def test_a_wrong_table_is_left_again_and_never_played(place, start_first, library):
    old, new = (library_of(ONE, ONE), library_of(OTHER, ONE)) if library else (text_of(ONE), text_of(OTHER))
    fb = checked(old)
    client, values, before = Client(fb), values_of(new), values_of(old)
    values[place] += 1.0
    client.write(values)
    fb.call(**IDLE)
    assert client.ask(SWITCH, checksum=values[1])[1] == 0.0
    if start_first:
        start = {"bExecute": True, "fActPosition": fb["tStart"], "fCycleTime": CYCLE}
        rows = [fb.call(**start), *(fb.call() for _ in range(60))]
        assert rows[-1]["nerrorid"] in (2, 5, 6) and len({row["fposition"] for row in rows}) == 1
    while not (fb["bChecked"] and not fb["bTrial"]):
        fb.call()
    assert client.in_use(len(before)) == before and fb["bIntact"]
    assert client.ask(READ)[9] == 3.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "value"),
    [
        *((0, math.nan), (2, -1.0), (3, 1e300), (4, 2e9), (7, 2000.0)),
        *((0, 2000.0), (2, math.nan), (3, -1.0), (4, 1e300), (7, 2e9)),
    ],
)
def test_sizes_that_lead_out_of_the_buffer_are_never_used(place, value):
    """Those of the buffer, of a library, of a motion; the interpreter refuses such an index."""
    fb = checked(library_of(ONE, OTHER))
    client, values = Client(fb), values_of(library_of(OTHER, ONE, ONE))
    values[place] = value
    client.write(values)
    client.ask(SWITCH, checksum=values[1])
    for number in (2, 1, 0, 1_000_000, 2040, -1):
        fb.call(nProfile=number)
    while not fb["bChecked"] or fb["bTrial"]:
        fb.call()
    assert fb["bIntact"] and fb["nBase"] == 0
    fb.call(nProfile=0)
    assert column(play(fb, started(fb)), "position")[-1] == ONE.target


def test_numbers_that_were_taken_from_the_buffer_are_taken_again_after_each_round():
    fb = checked(text_of(ONE))
    before = {name: fb[name] for name in ("tRows", "tLast", "tSlope", "tTarget", "nLength", "nTable")}
    for name, value in before.items():
        fb.alter(name, None, value + 1)
    for _ in range(2 * len(values_of(text_of(ONE)))):
        fb.call()
    assert {name: fb[name] for name in before} == before and fb["bIntact"]


def test_another_table_than_was_asked_for_is_not_switched_to():
    fb = checked(text_of(ONE))
    client, values = Client(fb), values_of(text_of(OTHER))
    client.write(values)
    assert client.ask(SWITCH, checksum=values[1] + 1.0)[1] == UNFIT


def test_nothing_is_switched_while_it_moves_or_waits():
    fb = FunctionBlock(text_of(ONE))
    client, values = Client(fb), values_of(text_of(OTHER))
    started(fb)  # and waits for the checksum
    client.write(values)
    assert client.ask(SWITCH, checksum=values[1])[1] == MOVES
    while fb["nState"] != fb["cMoving"]:
        fb.call()
    client.write(values)
    assert client.ask(SWITCH, checksum=values[1])[1] == MOVES
    rows = play(fb, fb.call())
    assert rows[-1]["bdone"] and column(rows, "position")[-1] == ONE.target
    assert client.ask(SWITCH, checksum=values[1])[1] == 0.0


def test_an_aborted_motion_is_not_continued_on_another_table():
    fb = checked(text_of(quintic((0.1, 0.4))))
    client, values = Client(fb), values_of(text_of(OTHER))
    started(fb)
    client.write(values)
    row = fb.call(bAbort=True, bExecute=False)
    while row["bbusy"]:
        row = fb.call()
    assert row["baborted"] and fb["bLeft"]
    client.ask(SWITCH, checksum=values[1])
    fb.call(bAbort=False)
    assert fb.call(bContinue=True)["nerrorid"] == 8


def test_one_client_at_a_time_writes():
    fb = checked(text_of(ONE))
    one, other, values = Client(fb), Client(fb, owner=2.0), values_of(text_of(OTHER))
    one.write(values)
    assert other.ask(WRITE, 1.0, 0, [7.0])[1] == HELD and other.ask(SWITCH, checksum=values[1])[1] == HELD
    assert other.ask(READ, 1.0, count=1)[16] == values[0]
    one.ask(RELEASE)
    assert other.ask(WRITE, 1.0, 0, [7.0])[1] == 0.0
    for _ in range(int(buffers.CLIENT_TIMEOUT / CYCLE) + 1):
        fb.call()
    assert one.ask(WRITE, 1.0, 0, values[:1])[1] == 0.0  # the other one is silent


def test_half_a_request_and_places_beyond_the_buffer_do_nothing():
    fb = checked(text_of(ONE))
    before = (fb["aTable"], fb["aReply"])
    fb.call(aRequest=[5.0, 1.0, WRITE, 1.0, 0.0, 3.0, *[9.0] * 250])
    assert (fb["aTable"], fb["aReply"]) == before
    client = Client(fb)
    for place, count in ((-1.0, 1.0), (1e9, 1.0), (2040.0, 100.0), (float("nan"), 1.0), (0.0, 300.0)):
        client.ask(WRITE, 1.0, place, [9.0], count=count)
    assert fb["aTable"][2049:] == before[0][2049:] and fb["aTable"][:2048] == before[0][:2048]


NUMBERS = re.compile(r"(?<![\w.])(?:\d+\.\d+(?:E[+-]\d+)?|\d+|TRUE|FALSE)(?!\w)")


@pytest.mark.slow
@pytest.mark.parametrize("library", [False, True])
def test_replay_refuses_altered_numbers_and_statements(library):
    text, goal = library_of(ONE, OTHER) if library else text_of(ONE), goal_of(ONE)
    program = re.sub(r"\(\*.*?\*\)", lambda found: " " * len(found[0]), text, flags=re.DOTALL)
    program = re.sub(r"fStartTolerance : [^;]*;", lambda found: " " * len(found[0]), program)
    found = list(NUMBERS.finditer(program))
    table = re.search(r"aTable : ", program).start()
    chosen = [one for one in found if one.start() < table] + found[len(found) // 3 :: 197] + found[-300::13]
    for number in chosen:
        new = {"TRUE": "FALSE", "FALSE": "TRUE"}.get(number[0], f"9{number[0]}")
        altered = text[: number.start()] + new + text[number.end() :]
        with pytest.raises(ExportError):
            if library:
                read_library(parse_function_block(altered), goal)
            else:
                structured_text.read_table(altered, goal)


@pytest.mark.parametrize(
    ("layout", "names", "other"),
    [
        ("segments", ["slewing"], {}),
        ("segments", ["bridge"], {"sign": -1}),
        ("segments", ["bridge"], {"unit": "mm"}),
        ("counts", ["bridge"], {"counts_per_si": 2e6}),
    ],
)
def test_it_is_for_its_own_axes_only(layout, names, other):
    export = {"plc_layout": layout, "plc_tables": "variables"}
    elsewhere = target(*names, cycle_time=CYCLE, export=export, **other)
    with pytest.raises(ExportError, match="for other axes"):
        structured_text.read_table(text_of(ONE, layout), elsewhere)


@pytest.mark.slow
@pytest.mark.parametrize("profile", [(ONE, OTHER), (TWO, TWO)], ids=["one axis", "two axes"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_library_plays_each_of_its_motions_and_takes_another_one(layout, profile):
    """Selected while nothing moves; the one that is selected and is not in the other library is refused."""
    goal = goal_of(profile[0], layout)
    fb = checked(library_of(*profile, layout=layout))
    others = values_of(library_of(profile[1], layout=layout))
    for number, motion in enumerate(profile):
        fb.call(**IDLE, nProfile=number)
        rows = play(fb, started(fb))
        assert fb["aState"][9] == float(number)
        expected = tabulate(motion, goal).played.position
        np.testing.assert_array_equal(column(rows, "position")[-len(expected) :], expected)
    client = Client(fb)
    client.write(others)
    fb.call(**IDLE)
    assert client.ask(SWITCH, checksum=others[1])[1] == 0.0
    assert fb["nSelected"] == 0 and started(fb)["nerrorid"] == 6
    fb.call(**IDLE, nProfile=0)
    rows = play(fb, started(fb))
    np.testing.assert_array_equal(column(rows, "position")[-1], tabulate(profile[1], goal).target)


def test_a_library_reads_back_to_what_was_put_in():
    text, goal = library_of(ONE, OTHER), goal_of(ONE)
    hashes = [structured_text.read_table(text_of(one), goal).motion().payload_hash() for one in (ONE, OTHER)]
    found = read_library(parse_function_block(text), goal)
    assert [motion.payload_hash() for motion in found] == hashes
    with pytest.raises(ExportError, match="is a library of motions"):
        structured_text.read_table(text, goal)


@pytest.mark.slow
def test_a_table_beyond_a_buffer_is_refused():
    long = goal_of(quintic((0.0, 1.0), duration=3000.0), "samples")
    with pytest.raises(ExportError, match="do not fit a buffer"):
        structured_text.block_text(quintic((0.0, 1.0), duration=3000.0), long)


@pytest.mark.slow
def test_the_compiled_block_issues_the_same():
    """Arrays that begin with 1, and INT, which no planner block has."""
    text = text_of(TWO)
    block, fb = BlockInstance(text), FunctionBlock(text)
    given = block.inputs | {"fCycleTime": CYCLE, "fActPosition[0]": 0.1, "fActPosition[1]": 1.2}
    rows = [dict(given)] * 60 + [given | {"bExecute": 1.0}] * 15
    issued = dict(
        zip(block.outputs, block.call(np.array([list(row.values()) for row in rows])).T, strict=True)
    )
    fb.call(**IDLE, fCycleTime=CYCLE, fActPosition=[0.1, 1.2])
    due = [fb.call() for _ in range(59)] + [fb.call(bExecute=True) for _ in range(15)]
    for axis in (0, 1):
        expected = [row["fposition"][axis] for row in due]
        assert issued[f"fPosition[{axis}]"][1:].tolist() == expected
    assert issued["nErrorId"].tolist() == [0.0] * 75 and issued["bDone"][-1] == 1.0


@pytest.mark.parametrize("name", ["cCapacity", "cAxes", "cOwn", "cLayout", "aTable"])
def test_hostile_sizes_are_refused_at_once(name):
    """What memory is taken for follows from the target and the file's own length."""
    text, count = re.subn(rf"({name} : DINT := )\d+", r"\g<1>999999999", text_of(TWO))
    if name == "aTable":
        text, count = re.subn(r"(aTable : [^:]*:= \[\s*)[\d.]+", r"\g<1>1.0E+30", text)
    assert count == 1
    with pytest.raises(ExportError):
        structured_text.read_table(text, goal_of(TWO))


def test_no_comment_decides_what_a_block_with_buffers_is():
    goal = goal_of(ONE, tables="constants")
    plain = structured_text.block_text(ONE, goal)
    (words,) = re.findall(r" *\(\* A double as whole numbers.*?\*\)\n", plain)
    bare = plain.replace(words, "")
    both = [
        buffers.buffered([parse_function_block(text)], goal, library=False).text() for text in (plain, bare)
    ]
    assert both[0] == both[1] and words.strip() in both[0]
