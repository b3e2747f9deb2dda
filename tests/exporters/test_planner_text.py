"""The planner block's text, as the engineer reads it who is to trust it."""

import re
from collections import Counter

import pytest
from generator.planned_machines import GANTRY

from gen_profile.planner.design import planner_block
from gen_profile.planner.events import WORDS
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile_exporters.planner.block import TEXT

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
CODED = (
    "nState",
    "nJob",
    "nNext",
    "nPhase",
    "nCommand",
    "nAborted",
    "nErrorId",
    "nFault",
    "nPromise",
    "nEvent",
    "nKind",
)


@pytest.fixture(scope="module", params=[*VARIANTS, "gantry"])
def text(request):
    changes = VARIANTS.get(request.param)
    return planner_block(parse_spec(GANTRY) if changes is None else preset_spec("bay-crane", changes)).text


def statements(text):
    return re.sub(r"\(\*.*?\*\)", "", text[text.rindex("END_VAR") :], flags=re.DOTALL)


def declared(text):
    found = re.findall(r"(?m)^\s*(\w+) : (?:BOOL|DINT|LREAL|ARRAY)", text)
    return dict.fromkeys(found)


@pytest.mark.slow
def test_states_jobs_phases_and_codes_have_names(text):
    bare = rf"\b(?:{'|'.join(CODED)}) (?:<>|[<>:]?=|[<>]) -?\d+\b"
    assert not re.findall(bare, statements(text))
    assert not re.findall(r"\bCASE\b", statements(text))  # whose labels matiec takes as numbers only


def test_names_are_used_and_differ_by_more_than_their_case(text):
    names = declared(text)
    assert len({name.lower() for name in names}) == len(names)
    words = re.findall(r"\w+", statements(text))
    phases = [name for name in names if name.startswith("cPhase")]
    assert not {*phases} - {*words}


def test_no_variable_serves_for_many_things(text):
    """One that did was assigned at 101 places; most now are what a complex product is made with."""
    assigned = Counter(re.findall(r"\b(f\w+) :=", statements(text)))
    assert max(assigned.values()) <= 16, assigned.most_common(3)
    assert not {"fValue", "fHalf", "fSum", "fDelta", "fSquare", "fRe", "fIm", "nOther"} & {*declared(text)}


def test_every_variable_is_used(text):
    words = {*re.findall(r"\w+", statements(text))}
    assert not {name for name in declared(text) if name[0] != "c"} - words


def test_a_phase_has_a_number_of_its_own(text):
    numbers = re.findall(r"\bcPhase\w+ : DINT := (\d+);", text)
    assert len(numbers) > 20
    assert len({*numbers}) == len(numbers)


def test_each_part_has_a_heading_and_numbers_of_equations_that_the_documentation_has(request):
    page = (request.config.rootpath / "docs/planner-algorithm.md").read_text("utf-8")
    known = dict(re.findall(r"(?m)^\| \((\d+)\) \| .* \| (.*) \|$", page))
    assert list(known) == [str(number) for number in range(1, len(known) + 1)]
    parts_by_number = dict.fromkeys(known, "")
    for path in sorted(TEXT.rglob("*.st")):
        if path.stem in ("block", "interface") or path.parent.name == "formulas":
            continue
        text = path.read_text("ascii")
        assert re.match(r"\s*(@where_\w+\s*)?\(\* =====", text), path.name
        for heading in re.findall(r"\(\* =====.*?\*\)", text, re.DOTALL):
            for number in re.findall(r"\((\d+)\)", heading):
                parts_by_number[number] += f"`{path.name}`, "
    for number, parts in parts_by_number.items():
        assert {*parts.split(", ")} >= {*known[number].split(", ")}, number


@pytest.mark.slow
def test_every_code_of_an_event_is_one_that_is_said_in_words():
    texts = [
        planner_block(preset_spec("bay-crane", VARIANTS[name])).text
        for name in ("zones and events", "a load that is measured")
    ]
    numbers = {
        name: int(number) for text in texts for name, number in re.findall(r"\b(c\w+) : DINT := (\d+);", text)
    }
    kinds = {
        "cEventState": ("cDisabled", "cStanding", "cMoving", "cBraking"),
        "cEventCommand": ("cCommandNone", "cCommandPosition", "cCommandVelocity"),
        "cEventPlan": ("cJobMove", "cJobStop", "cJobReach"),  # the last one of a plan to a velocity
        "cEventAborted": ("cCommandPosition", "cCommandVelocity", "cCommandReplaced"),
        "cEventError": [name for name in numbers if name.startswith("cError")],
        "cEventPromise": [name for name in numbers if name.startswith("cPromise")],
    }
    codes = {numbers[event] + numbers[name] for event, names in kinds.items() for name in names}
    codes |= {numbers[name] for name in ("cEventHeld", "cEventGoesOn", "cEventDone")}
    assert codes == WORDS.keys()
