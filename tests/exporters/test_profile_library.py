"""Libraries of motions in one block: each plays as its own block does, and nothing else."""

import re

import attrs
import numpy as np
import pytest
from motions import bang_bang, quintic, target
from playing import IDLE, QUANTITIES, checked, column, play, start
from st_interpreter import FunctionBlock

from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.playback import structured_text
from gen_profile_exporters.playback.library import LibraryEntry, library_source, read_library
from gen_profile_exporters.registry import BUILT_IN, find_container

LAYOUTS = ["segments", "samples", "counts"]
ENDS = [
    ((0.1, 0.4), (1.2, -0.7)),
    ((-0.2, 0.3), (0.0, 0.1)),
    ((0.1, 0.2), (1.2, 1.3)),
    ((0.0, -1.0), (0.5, 0.6)),
]
DURATIONS = [1.0, 0.5, 1.4, 0.22]


def goal_of(layout="segments", axes=1, **options):
    return target(*("bridge", "trolley")[:axes], cycle_time=0.02, export={"plc_layout": layout}, **options)


def blocks(goal):
    """Texts of four motions."""
    axes = len(goal.axes)
    return [
        structured_text.block_text(quintic(*ends[:axes], duration=duration), goal)
        for ends, duration in zip(ENDS, DURATIONS, strict=True)
    ]


def words(variable):
    return " ".join(map(str, attrs.astuple(variable))).split()


def entries_of(texts):
    return [LibraryEntry(source=parse_function_block(text), label=f"L1 {n}") for n, text in enumerate(texts)]


def together(texts, goal):
    return library_source(entries_of(texts), goal).text()


def read(text, goal):
    return read_library(parse_function_block(text), goal)


def selected(fb, number):
    """The library's block, standing still, once the table of a motion was found right."""
    fb.call(**IDLE, nProfile=number)
    while not fb["bChecked"]:
        fb.call()
    return fb


def started(fb, number, **inputs):
    """Raise bExecute where a motion begins; that cycle's outputs."""
    axes = len(fb["cStart"]) // fb["cProfiles"]
    at = fb["cStart"][number * axes : (number + 1) * axes]
    fb.call(**IDLE)
    given = {"fCycleTime": fb["cCycleTime"], "fActPosition": at if axes > 1 else at[0], **inputs}
    return fb.call(bExecute=True, **given)


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("axes", [1, 2])
def test_every_motion_plays_bit_for_bit_as_its_own_block(layout, axes):
    goal = goal_of(layout, axes)
    texts = blocks(goal)
    fb = FunctionBlock(together(texts, goal))
    for number in (2, 0, 3, 1, 1, 2):
        own = checked(texts[number])
        due = play(own, start(own))
        assert play(fb, started(selected(fb, number), number)) == due
        assert due[-1]["bdone"] and len(due) == round(DURATIONS[number] / 0.02) + 1


def test_held_mirrored_and_slowed_down_it_does_the_same():
    texts = [structured_text.block_text(m, goal_of()) for m in (bang_bang(), bang_bang(0.4))]
    fb = selected(FunctionBlock(together(texts, goal_of())), 1)
    own = checked(texts[1])
    inputs = {"fScale": 0.5, "bMirror": True, "fStartOffset": 0.0}
    rows = [(started(fb, 1, **inputs), start(own, **inputs))]
    for cycle in range(200):
        now = {"bHold": 10 < cycle < 40, "rOverride": 0.7 if cycle > 60 else 1.0, "bAbort": cycle > 75}
        rows.append((fb.call(**now), own.call(**now)))
    assert all(one == other for one, other in rows)
    assert rows[-1][0]["baborted"]


def test_another_motion_is_taken_over_only_while_none_is_played():
    texts = blocks(goal_of())
    fb = selected(FunctionBlock(together(texts, goal_of())), 0)
    rows = [started(fb, 0)]
    while rows[-1]["bbusy"]:
        rows.append(fb.call(nProfile=1))
    np.testing.assert_array_equal(column(rows, "position"), column(play_of(texts[0]), "position"))
    assert fb["nSelected"] == 0 and not fb["bError"]
    assert fb.call()["fposition"] == rows[-1]["fposition"]  # the target is held all the same
    assert fb["nSelected"] == 1
    assert play(fb, started(selected(fb, 1), 1)) == play_of(texts[1])


def play_of(text):
    own = checked(text)
    return play(own, start(own))


def test_a_start_right_after_selection_waits_for_the_checksum():
    texts = blocks(goal_of("samples"))
    fb = selected(FunctionBlock(together(texts, goal_of("samples"))), 0)
    fb.call(**IDLE)
    given = {"fCycleTime": 0.02, "fActPosition": 0.1}
    rows = [fb.call(bExecute=True, nProfile=2, **given)]
    while not fb["bChecked"]:
        rows.append(fb.call())
        assert rows[-1]["bbusy"] and rows[-1]["fposition"] == 0.1
    assert play(fb, rows[-1])[-71:] == play_of(texts[2])[-71:]


@pytest.mark.parametrize("number", [-1, 4, 2**31 - 1])
def test_a_number_of_no_motion_is_refused(number):
    fb = selected(FunctionBlock(together(blocks(goal_of()), goal_of())), 2)
    outputs = started(fb, 2, nProfile=number)
    assert (outputs["berror"], outputs["nerrorid"]) == (True, 6)
    assert started(selected(fb, 2), 2)["bbusy"]


def test_an_altered_table_is_found_and_the_others_still_play():
    texts = blocks(goal_of())
    fb = FunctionBlock(together(texts, goal_of()))
    fb.alter("cPower3", fb["cFirstRow"][2], 0.5)
    assert started(selected(fb, 2), 2)["nerrorid"] == 5
    for number in (0, 1, 3):
        assert play(fb, started(selected(fb, number), number)) == play_of(texts[number])


def test_starts_where_the_selected_motion_starts():
    fb = selected(FunctionBlock(together(blocks(goal_of()), goal_of())), 1)
    assert started(fb, 1, fActPosition=0.1)["nerrorid"] == 2
    assert started(selected(fb, 1), 1)["fposition"] == -0.2


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("axes", [1, 2])
@pytest.mark.parametrize("unit", ["mm", "counts"])
def test_reads_back_to_the_motions_that_were_put_in(layout, axes, unit):
    goal = goal_of(layout, axes, unit=unit, sign=-1)
    texts = blocks(goal)
    for motion, text in zip(read(together(texts, goal), goal), texts, strict=True):
        due = structured_text.replay(text.encode("ascii"), goal)
        assert motion.payload_hash() == due.payload_hash()
        for quantity in QUANTITIES:
            np.testing.assert_array_equal(getattr(motion, quantity), getattr(due, quantity))


def test_one_motion_is_a_library_too():
    goal = goal_of()
    (motion,) = read(together(blocks(goal)[:1], goal), goal)
    assert motion.position[-1, 0] == 0.4


CONTAINERS = [name for name, form in BUILT_IN.items() if form.holds_block]


@pytest.mark.slow
@pytest.mark.parametrize("name", CONTAINERS)
@pytest.mark.parametrize(("layout", "axes"), [("segments", 2), ("counts", 1)])
def test_every_container_of_a_block_holds_a_library(name, layout, axes):
    goal, container = goal_of(layout, axes), find_container(name)
    library = library_source(entries_of(blocks(goal)), goal)
    first, *others = container.wrap(library, goal)
    again = container.unwrap(first.content, goal)
    due = [motion.payload_hash() for motion in read_library(library, goal)]
    assert [motion.payload_hash() for motion in read_library(again, goal)] == due
    assert [v.comment for v in again.variables if v.name == "nProfile"] == ["which motion, 0 to 3"]
    assert "nProfile  checksum  motion" in again.header
    # The wrapper, where there is one, lets the motion be chosen.
    rest = "".join(file.content.decode() for file in (first, *others)).partition("_Axis")[2]
    assert bool(rest) == ("wrapper" in BUILT_IN[name].summary)
    assert not rest or re.search(r"nProfile := #?nProfile", rest)


def test_a_library_is_made_of_any_containers_blocks():
    """The same whichever they came out of."""
    goal = goal_of()
    due = library_source(entries_of(blocks(goal)), goal)
    for name in CONTAINERS:
        container = find_container(name)
        sources = [
            container.unwrap(container.wrap(entry.source, goal)[0].content, goal)
            for entry in entries_of(blocks(goal))
        ]
        entries = [LibraryEntry(source=source, label=f"L1 {n}") for n, source in enumerate(sources)]
        found = library_source(entries, goal)
        assert found.body.split() == due.body.split()
        assert found.header.split() == due.header.split()
        assert sorted(map(words, found.variables)) == sorted(map(words, due.variables))


def test_values_of_several_axes_read_as_they_were_varied():
    entries = [
        LibraryEntry(source=e.source, label="move.start [-12.0, 1.0]  m2 1e+20 *)")
        for e in entries_of(blocks(goal_of()))
    ]
    assert (
        "  move.start [-12.0, 1.0]  m2 1e+20 __: 1 s, 50 cycles\n"
        in library_source(entries, goal_of()).header
    )


def test_the_header_tells_which_is_which():
    texts = blocks(goal_of())
    header = together(texts, goal_of(name="crane 7 *) x")).partition("FUNCTION_BLOCK")[0]
    assert header.count("*)") == 1 and header.isascii()
    for number, text in enumerate(texts):
        total = re.search(r"cChecksum : DINT := (\d+);", text)[1]
        cycles = round(DURATIONS[number] / 0.02)
        own = re.search(r"Axis 1, bridge: .*\n +stop jerk .*\.\n", text)[0].split()
        row, *axis = re.search(rf"     {number}  +{total}  .*\n.*\n.*\n", header)[0].splitlines()
        assert row.endswith(f"  L1 {number}: {DURATIONS[number]:g} s, {cycles} cycles")
        assert " ".join(axis).split() == own
    longest = max(int(re.search(r"(\d+) cycles after power-up", text)[1]) for text in texts)
    assert f"({longest} cycles after power-up or another nProfile, in the background)" in header
    assert "6 nProfile counts no motion" in header
    assert "peaks above" not in header
    assert max(map(len, header.splitlines())) <= 120


@pytest.mark.parametrize(
    ("find", "put"),
    [
        ("cFirstRow[nSelected] + nRow", "nRow"),
        ("nSelected := nProfile;", "nSelected := nProfile + 1;"),
        ("IF nProfile <> nSelected THEN nErrorId := 6; END_IF;", ""),
        ("cTarget[nSelected]", "cTarget[0]"),
        ("fGain := -fScale;", "fGain := fScale;"),
        (re.compile(r"cPower1 : ARRAY \[0\.\.\d+\] OF LREAL := \[\s*[^,]+,"), None),
        (re.compile(r"cLast : ARRAY \[0\.\.3\] OF DINT := \[\s*50"), "cLast : ARRAY [0..3] OF DINT := [ 51"),
        (re.compile(r"cRows : ARRAY \[0\.\.3\] OF DINT := \[\s*\d+"), "cRows : ARRAY [0..3] OF DINT := [ 2"),
        (re.compile(r"cRows : ARRAY \[0\.\.3\] OF DINT := \[\s*\d+"), "cRows : ARRAY [0..3] OF DINT := [ x"),
        (re.compile(r"cFirstRow"), "cFirstRows"),
        (
            re.compile(r"cChecksum : ARRAY \[0\.\.3\] OF DINT := \["),
            "cChecksum : ARRAY [0..3] OF DINT := [ 1",
        ),
    ],
)
def test_an_altered_library_is_refused(find, put):
    goal = goal_of()
    text = together(blocks(goal), goal)
    if isinstance(find, str):
        assert find in text
        altered = text.replace(find, put)
    else:
        altered, count = find.subn(
            lambda hit: put or f"{hit[0]} 1.5,", text, count=0 if put == "cFirstRows" else 1
        )
        assert count >= 1
    with pytest.raises(ExportError):
        read(altered, goal)


def test_a_single_block_is_no_library():
    goal = goal_of()
    with pytest.raises(ExportError, match="no library of motions"):
        read(blocks(goal)[0], goal)
    with pytest.raises(ExportError, match="no FUNCTION_BLOCK"):
        read("", goal)


@pytest.mark.parametrize(
    "other",
    [goal_of("samples"), goal_of(unit="mm"), target("bridge", cycle_time=0.01), goal_of(axes=2)],
)
def test_motions_for_another_target_are_refused(other):
    with pytest.raises(ExportError, match=r"Profile 1 \(L1 1\) is for other axes"):
        together([blocks(goal_of())[0], blocks(other)[1]], goal_of())


def test_too_many_rows_to_compile_are_refused(monkeypatch):
    monkeypatch.setattr("gen_profile_exporters.playback.library.MOST_SAMPLES", 3)
    with pytest.raises(ExportError, match="split them into several libraries"):
        together(blocks(goal_of()), goal_of())
