"""The planner block's text, as the engineer reads it who is to trust it."""

import re

import pytest
from generator.planned_machines import GANTRY

from gen_profile.planner.design import planner_block
from gen_profile.planner.events import WORDS
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.playback.structured_text import literal

VARIANTS = {
    "as it comes": [],
    "zones and events": ["planner.zones=true", "planner.events=true"],
    "a rope that changes": ["planner.live_rate={L1=0.1}", "planner.events=true"],
    "a load that is measured": [
        "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}",
        'planner.sensor={quantity="angle", of="theta1", noise=0.002, delay=[0.0, 0.1]}',
        "planner.disturbance={swing={payload=0.5}, settle=12.0}",
        "planner.events=true",
    ],
}
CODED = ("nState", "nAborted", "nErrorId", "nFault", "nPromise", "nPhase", "nKind")
SHARED = {"nAxis", "fSteady"}  # of both accounts, which one of them does not need


@pytest.fixture(scope="module", params=[*VARIANTS, "gantry"])
def text(request):
    changes = VARIANTS.get(request.param)
    return planner_block(parse_spec(GANTRY) if changes is None else preset_spec("bay-crane", changes)).text


@pytest.fixture
def blocks(text):
    source = parse_function_block(text)
    return (*source.within, source)


def test_states_phases_and_codes_have_names(blocks):
    """All but the labels of CASE, which matiec takes as numbers only."""
    bare = re.compile(rf"\b(?:{'|'.join(CODED)}) (?:<>|[<>:]?=|[<>]) -?[1-9]\d*\b")
    for one in blocks[-1], *(one for one in blocks if one.name.endswith("_motion")):
        found = {*bare.findall(re.sub(r"\(\*.*?\*\)", "", one.body, flags=re.DOTALL))}
        assert not found, one.name


def test_each_block_uses_what_it_declares_and_names_differ_by_more_than_their_case(blocks):
    for one in blocks:
        names = [variable.name for variable in one.variables]
        assert len({name.lower() for name in names}) == len(names), one.name
        unused = {name for name in names if name[0] != "c"} - {*re.findall(r"\w+", one.body)}
        assert unused <= SHARED, one.name


def test_numbers_read_back_from_a_controller_are_written_as_they_were(blocks):
    for one in blocks:
        for variable in one.variables:
            if variable.section == "VAR CONSTANT" and variable.scalar_type == "LREAL":
                assert [literal(float(text)) for text in variable.values] == [*variable.values], variable.name


def test_each_block_has_a_heading_that_says_what_it_does_and_never_does(text):
    headings = re.findall(r"\(\*((?:(?!\*\)).)*)\*\)\s*FUNCTION_BLOCK (\w+)", text, re.DOTALL)
    assert len(headings) == text.count("\nFUNCTION_BLOCK") + text.startswith("FUNCTION_BLOCK")
    for heading, name in headings:
        assert len(heading.split()) > 20, name


@pytest.mark.slow
def test_every_code_of_an_event_is_one_that_is_said_in_words():
    texts = [
        planner_block(preset_spec("bay-crane", VARIANTS[name])).text
        for name in ("zones and events", "a load that is measured")
    ]
    numbers = {
        name: int(number) for text in texts for name, number in re.findall(r"\b(c\w+) : DINT := (\d+);", text)
    }
    bases = re.search(r"cBase : [^;]*:= \[([^]]*)\];", texts[0])[1].split(",")
    names = {  # of what is logged, in the order of the bases
        "error": [name for name in numbers if name.startswith("cError")],
        "aborted": ("cCommandPosition", "cCommandVelocity", "cCommandReplaced"),
        "command": ("cCommandNone", "cCommandPosition", "cCommandVelocity"),
    }
    values = {kind: [numbers[name] for name in own] for kind, own in names.items()}
    values |= {"held": (0, 1), "plan to target, rest or speed": (2, 3, 4)}
    values["state"] = [numbers[name] for name in ("cDisabled", "cStanding", "cMoving", "cBraking")]
    values["promise"] = [number for name, number in numbers.items() if name.startswith("cPromise")]
    values["done"] = (0,)
    assert {
        int(base) + n for base, own in zip(bases, values.values(), strict=True) for n in own
    } == WORDS.keys()
