"""Every fault of a spec: found, placed, and all of them at once."""

import datetime
import re
from copy import deepcopy

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen_profile.spec.reading import parse_spec, preset_spec, spec_from_dict
from gen_profile.spec.structure import Faults
from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import suggestion

PAPER = preset_spec("paper").to_dict()
MISSING = object()


def with_value(place, value):
    """Copy the paper's document with one value set or removed."""
    document = deepcopy(PAPER)
    *outer, key = place.split(".")
    table = document
    for step in outer:
        table = table[step]
    if value is MISSING:
        del table[key]
    else:
        table[key] = value
    return document


def faults_of(document):
    with pytest.raises(SpecError) as caught:
        spec_from_dict(document)
    assert "\n".join(caught.value.faults) == str(caught.value)
    return caught.value.faults


FAULTS = [
    # what is missing
    ("plant", MISSING, r"plant: the spec must state \[plant\]; a real machine has no default here\."),
    ("move", MISSING, r"move: the spec must state \[move\]; .*\."),
    ("plant", {}, r"plant\.type: must name a machine, found nothing .known: double-pendulum-crane, .*\."),
    (
        "move",
        {"duration": 3.0},
        r"move\.distance: required, but missing; state distance, or start and target\.",
    ),
    ("move.duration", MISSING, r"move\.duration: required, but missing\."),
    # unknown words
    (
        "plant.type",
        "double-pendulum-cran",
        r"plant\.type: unknown machine 'double-pendulum-cran'; did you mean .*\?",
    ),
    ("plant.type", 3, r"plant\.type: must name a machine, found 3 .*\."),
    ("check.residual", 1.0, r"check\.residual: unknown key; did you mean 'residual_sway'\?"),
    ("check.residual_sway.hok", 1.0, r"check\.residual_sway\.hok: unknown load; did you mean 'hook'\?"),
    ("axis.crat", {}, r"axis\.crat: unknown axis; did you mean 'cart'\?"),
    ("axis.unit", "mm", r"axis\.unit: stands in axis\.cart, too; state one of them\."),
    ("axis.cart.unit", "inch", r"axis\.cart\.unit: unknown value, found text 'inch' .known: m, mm, .*"),
    ("axis.cart.sign", 0, r"axis\.cart\.sign: unknown value, found 0 .known: 1, -1.\."),
    # words of other trades and products, and keys of other tables
    ("limits.vel", 1.0, r"limits\.vel: unknown key; did you mean 'velocity'\?"),
    ("limits.beschleunigung", 1.0, r"limits\.beschleunigung: unknown key; did you mean 'acceleration'\?"),
    (
        "plant.type",
        "bridge-crane",
        r"plant\.type: .*; did you mean 'double-pendulum-crane', 'gantry-crane' or 'hall-crane'\?",
    ),
    ("plant.L", 6.0, r"plant\.L: unknown key; did you mean 'L1' or 'L2'\?"),
    ("plant.seil", 6.0, r"plant\.seil: unknown key; did you mean 'L1'\?"),
    ("L1", 6.0, r"L1: unknown key; did you mean 'plant\.L1'\?"),
    ("distance", 6.0, r"distance: unknown key; did you mean 'move\.distance'\?"),
    ("move.velocity", 6.0, r"move\.velocity: unknown key; did you mean 'limits\.velocity'\?"),
    ("robustness.L1", 0.1, r"robustness\.L1: unknown key; did you mean 'robustness\.uncertain\.L1'\?"),
    ("solver.method", "2h-ei", r"solver\.method: .* found text '2h-ei'; did you mean '2hump-ei'\?"),
    ("solver.method", "2 m", r"solver\.method: unknown value, found text '2 m' .known: auto, .*"),
    ("move.duration", "min", r"move\.duration: .*, found text 'min'; did you mean 'minimum'\?"),
    # numbers as people write them
    ("plant.L1", "6,0", r"plant\.L1: .*, found text '6,0'; write a decimal point: 6\.0\."),
    ("plant.L1", "1.000,5", r"plant\.L1: .*; write a decimal point, and nothing between thousands\."),
    ("plant.L1", "6.0 m", r"plant\.L1: .*; write the number alone, in SI units \(m, s, kg, rad\)\."),
    ("robustness.uncertain.L1", "10 %", r"robustness\.uncertain\.L1: .*; write a share: 0\.1\."),
    ("plant.L1", 6000, r"plant\.L1: must be a number .* m, found 6000; did you mean 6\?"),
    ("plant.L1", "−3", r"plant\.L1: .* text '−3'; write the minus of the keyboard: -3\."),
    ("plant.L1", ".5", r"plant\.L1: .*; write a digit on both sides of the decimal point\."),
    # numbers that are none, or too large, or too small
    ("move.target", 1e-300, r"move\.distance: must be zero, or at least 1e-12 m .or rad.\."),
    ("plant.m1", -0.2, r"plant\.m1: must be a number from 0\.0001 to 1e\+06 kg, found -0\.2\."),
    ("plant.L1", "0.47", r"plant\.L1: must be a number .*, found text '0\.47'; write it without quotes\."),
    ("plant.L1", float("nan"), r"plant\.L1: must be a number .*, found nan\."),
    ("plant.L1", True, r"plant\.L1: must be a number .*, found true\."),
    ("plant.L1", 10**400, r"plant\.L1: must be a number .*, found a whole number of more than 18 digits\."),
    ("plant.L1", datetime.date(2024, 1, 1), r"plant\.L1: must be a number .*, found a date or time\."),
    ("move.target", ["far"], r"move\.target: must be a finite number, found text 'far'\."),
    (
        "move.target",
        [0.1, 0.2],
        r"move\.target: must hold one number per axis .cart., such as \[0\.1\], found 2\.",
    ),
    (
        "move.target",
        [1e6],
        r"move\.target\.0: must be at least -100000 and at most 100000 m .or rad., found 1000000\.0\.",
    ),
    ("move.start", {}, r"move\.start: must be a finite number, found a table\."),
    ("move.target", [0.0], r"move\.distance: must not be zero on every axis\."),
    ("move.distance", 0.3, r"move\.distance: state either distance, or start and target, not both\."),
    ("move.duration", 0, r"move\.duration: must be at least 0\.001 and at most 100000 s, found 0\.0\."),
    (
        "move.duration",
        "3 s",
        r"move\.duration: must be a number of seconds, or .minimum., found text '3 s'; write .*\.",
    ),
    (
        "move.duration",
        "minimum",
        r"move\.duration: \"minimum\" needs a limit: state limits\.acceleration, or velocity or jerk\.",
    ),
    ("limits.jerk", 0, r"limits\.jerk: must be greater than 0, found 0\.0\."),
    ("cost.sway_weight", -1, r"cost\.sway_weight: must be at least 0, found -1\.0\."),
    ("check.residual_sway", 0, r"check\.residual_sway: must be a finite number greater than 0, found 0\."),
    (
        "robustness.uncertain.L1",
        1.5,
        r"robustness\.uncertain\.L1: must be greater than 0 and at most 0\.9 .0\.1 is 10 %., found 1\.5\.",
    ),
    (
        "robustness.uncertain.c1",
        0.1,
        r"robustness\.uncertain\.c1: its value is 0, so a relative range is empty\.",
    ),
    (
        "export.cycle_time",
        4,
        r"export\.cycle_time: must be .* at most 1 s \(4 ms are 0\.004\), found 4\.0\.",
    ),  # meant as ms
    ("can.node", 128, r"can\.node: must be at least 1 and at most 127, found 128\."),
    ("can.node", 1.5, r"can\.node: must be a whole number, found 1\.5\."),
    ("can", {"eds": __file__, "eds_sha256": [1]}, r"can\.eds_sha256: must be text, found \[1\]\."),
    ("can", {"eds_sha256": "0a"}, r"can\.eds: must name an EDS or DCF, such as drive\.eds, found nothing\."),
    # things of another kind
    ("move", 3, r"move: must be a table, found 3\."),
    (
        "robustness.uncertain",
        ["L1"],
        r"robustness\.uncertain: must be a table such as \{ NAME = 0\.2 \}, found an array\.",
    ),
    ("name", 7, r"name: must be text, found 7\."),
    ("robustness.nominal_zero", 1, r"robustness\.nominal_zero: must be true or false, found 1\."),
    ("limits.travel", [0.0], r"limits\.travel: must be an array of 2 numbers, found \[0\.0\]\."),
    # what contradicts
    (
        "limits.travel",
        [10, 0],
        r"limits\.travel: must be two rising numbers, such as \[0\.0, 10\.0\], found \[10, 0\]\.",
    ),
    ("move.shortest", True, r"move\.shortest: unknown key; write duration = \"minimum\"\."),
    (
        "limits.travel",
        [0.0, 0.2],
        r"limits\.travel: must contain move\.target of cart \(0\.3\), found \[0\.0, 0\.2\]\.",
    ),
    ("robustness.nominal_zero", True, r"robustness\.nominal_zero: only with method = \"range\"\."),
    (
        "robustness",
        {"method": "range", "order": 2, "uncertain": {"L1": 0.2}},
        r"robustness\.order: only with method = \"sensitivity\"\.",
    ),
    ("robustness", {"method": "range"}, r"robustness\.uncertain: required with method = \"range\", .*\."),
    ("actuator", {"type": "first-order"}, r"actuator\.tau: required with type = \"first-order\" .*\."),
    ("actuator.tau", 0.1, r"actuator\.tau: only with type = \"first-order\"; .*\."),
    ("cost.effort", "reference", r"cost\.effort: \"reference\" weighs the reference of a lagging drive .*\."),
    ("robustness.uncertain", {}, r"robustness\.uncertain: required with method = \"sensitivity\", .*\."),
    ("axis.cart.unit", "deg", r"axis\.cart\.unit: 'deg' does not measure an axis that moves in m\."),
]


@pytest.mark.parametrize(("place", "value", "sentence"), FAULTS, ids=[place for place, _, _ in FAULTS])
def test_one_fault_is_one_sentence(place, value, sentence):
    (fault,) = faults_of(with_value(place, value))
    assert re.fullmatch(sentence, fault)


def test_faults_name_what_the_machine_has():
    gantry = preset_spec("gantry-crane").to_dict()
    gantry |= {"axis": {"unit": "mm"}, "robustness": {"method": "range"}}
    assert set(faults_of(gantry)) == {
        "axis.unit: state it of each axis: axis.x.unit, axis.y.unit.",
        'robustness.uncertain: required with method = "range", such as { L = 0.2 }.',
    }


NAMES = [
    "*) END_PROGRAM (*",
    "../escape",
    "<script>alert(1)</script>",
    "",
    " ",
    ".hidden",
    "a" * 65,
    "ends.",
    "ends ",
]
NAMES += [
    "line\nbreak",
    "nul\0",
    "slash/",
    "back\\slash",
    "quo'te",
    'quo"te',
    "½ t",  # 1/2 in ASCII
    "ＣＯＮ",  # a device's name in ASCII
    "Bru\u0308cke",
    "三" * 40,  # longer in ASCII
    "\x1b[31mred",
    "name\n",
    "con",
    "Lpt1.bay",
]


@pytest.mark.parametrize("name", NAMES)
def test_names_that_could_break_out_of_a_comment_a_path_or_a_page(name):
    (fault,) = faults_of(with_value("name", name))
    assert fault.startswith("name: must be 1 to 64 letters, digits, dots, underscores, hyphens and spaces")
    assert fault.isprintable()


FINE = ["a", "bay-3", "Bay 3.1_new", "7", "a" * 64, "console", "com-1", "Halle 3 Brücke", "三号桥"]


@pytest.mark.parametrize("name", FINE)
def test_names_that_are_fine(name):
    assert spec_from_dict(with_value("name", name)).name == name


@pytest.mark.parametrize(
    ("name", "plain"), [("Halle 3 Brücke", "Halle 3 Bruecke"), ("Grúa 2", "Grua 2"), ("Bay 3", "Bay 3")]
)
def test_files_and_blocks_are_named_in_ascii(name, plain):
    assert spec_from_dict(with_value("name", name)).ascii_name == plain


def test_all_faults_are_told_at_once():
    document = deepcopy(PAPER)
    document |= {"name": "../x", "extra": 1, "can": {"node": 0}}
    document["plant"] |= {"m1": -1, "L9": 1}
    document["move"] = {"distance": "far", "duration": 0}
    document["limits"] = {"jerk": float("nan"), "sawy": 1}
    document["check"] = {"residual_sway": {"hook": -1, "hok": 1}}
    places = [fault.partition(":")[0] for fault in faults_of(document)]
    assert set(places) == {
        "name", "extra", "can.node", "plant.m1", "plant.L9", "move.distance", "move.duration",
        "limits.jerk", "limits.sawy", "check.residual_sway.hook", "check.residual_sway.hok",
    }  # fmt: skip
    assert len(places) == len(set(places))


def test_an_unknown_machine_does_not_hide_the_other_faults():
    document = with_value("plant.type", "tower")
    document["move"] = {"distance": [1.0, 2.0], "duration": -1.0}
    document["robustness"] = {"uncertain": {"radius": 7.0}, "order": 9}
    document["check"] = {"residual_sway": -1.0}
    places = {fault.partition(":")[0] for fault in faults_of(document)}
    assert places == {
        "plant.type", "move.duration", "robustness.uncertain.radius", "robustness.order",
        "check.residual_sway",
    }  # fmt: skip


def test_a_key_cannot_pose_as_another_line():
    (fault,) = faults_of(with_value("limits", {"jerk\nname: fine": 1.0}))
    assert fault.startswith(r"limits.'jerk\nname: fine': unknown key")


SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(),
    st.dates(),
    st.sampled_from([10**400, 1e308]),
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3)
)
PLACES = [
    f"{table}.{key}" for table, content in PAPER.items() if isinstance(content, dict) for key in content
]


@pytest.mark.slow
@given(
    st.dictionaries(
        st.sampled_from([*PAPER, *PLACES, "axis.cart.unit", "check.residual_sway.hook"]), VALUES, max_size=4
    )
)
def test_whatever_stands_there_gives_a_spec_or_sentences(changes):
    document = deepcopy(PAPER)
    for place, value in changes.items():
        *outer, key = place.split(".")
        table = document
        for step in outer:
            table = table.get(step) if isinstance(table, dict) else None
        if isinstance(table, dict):
            table[key] = value
    try:
        spec = spec_from_dict(document)
    except SpecError as error:
        assert error.faults
        assert all(re.match(r"[\w.'-]+", fault) and fault.isprintable() for fault in error.faults)
    else:
        assert spec_from_dict(spec.to_dict()) == spec


def test_a_value_out_of_bounds_is_told_once_not_its_range_too():
    with pytest.raises(SpecError) as caught:
        preset_spec("paper", ["plant.L1=-1"])
    assert [str(line) for line in str(caught.value).splitlines()] == [
        "plant.L1: must be a number from 0.01 to 200 m, found -1."
    ]


def test_thousands_of_unknown_keys_are_told_without_comparing_each_with_all_others(monkeypatch):
    compared = []

    def counted(key, known):
        compared.append(key)
        return suggestion(key, known)

    monkeypatch.setattr("gen_profile.spec.structure.suggestion", counted)
    keys = "".join(f"unknown_{number} = 1\n" for number in range(10_000))
    move = "move = { distance = 1.0, duration = 5.0 }"
    with pytest.raises(SpecError) as caught:
        parse_spec(f"plant.type = 'slosh-tank'\n{move}\n[limits]\n{keys}")
    assert len(caught.value.faults) == 10_000 and len(compared) < 200
    assert caught.value.faults[-1] == "limits.unknown_9999: unknown key."


def test_of_places_within_one_another_the_first_fault_stands():
    faults = Faults()
    first = "limits.axis.hoist.jerk"
    for place in (first, "limits", "limits.axis", f"{first}.low", "limitsx", "move"):
        faults.add(place, "is wrong")
    with pytest.raises(SpecError) as caught:
        faults.raise_any()
    assert [one.partition(":")[0] for one in caught.value.faults] == [first, "limitsx", "move"]
