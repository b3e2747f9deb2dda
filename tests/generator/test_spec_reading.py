"""Specs from files, presets and overrides."""

import re

import attrs
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen_profile.spec.reading import parse_spec, preset_spec, presets, read_spec, spec_from_dict
from gen_profile.support.errors import OutputError, SpecError
from gen_profile.support.suggestion import finite_number

LEAST = """
[plant]
type = "double-pendulum-crane"
[move]
distance = 0.3
duration = 3.0
"""


def test_the_least_spec_is_filled_in(tmp_path):
    file = tmp_path / "least.toml"
    file.write_text(LEAST, "utf-8")
    spec = read_spec(file)
    assert spec.plant.parameters == spec.machine().nominal()
    assert spec.plant.defaults == tuple(spec.machine().nominal())
    assert (spec.move.start, spec.move.target, spec.move.distance) == ((0.0,), (0.3,), (0.3,))
    assert spec.check.default
    assert spec.check.residual_sway == pytest.approx({"hook": 0.003, "payload": 0.003})
    assert (spec.robustness.method, spec.actuator.type, spec.cost.effort) == ("none", "ideal", "jerk")
    assert spec.export.cycle_time == 0.001


@pytest.mark.parametrize("bom", [b"", b"\xef\xbb\xbf"], ids=["plain", "byte order mark"])
@pytest.mark.parametrize("newline", [b"\n", b"\r\n"])
def test_editors_of_any_kind_will_do(tmp_path, bom, newline):
    file = tmp_path / "spec.toml"
    file.write_bytes(bom + LEAST.encode().replace(b"\n", newline))
    assert read_spec(file) == parse_spec(LEAST)


def test_a_stated_parameter_is_no_default():
    spec = parse_spec(LEAST.replace("[move]", "m1 = 2.0\nm2 = 3.0\nL1 = 0.5\nL2 = 0.1\n[move]"))
    assert spec.plant.parameters["L1"] == 0.5
    assert spec.plant.defaults == ("g", "c1", "c2")


@pytest.mark.parametrize(
    ("machine", "stated", "missing"),
    [
        ("double-pendulum-crane", "L1 = 6", "L1|m1 = 0.192 kg, m2 = 0.203 kg, L2 = 0.391 m"),
        ("double-pendulum-crane", "m1 = 2\nm2 = 3", "m1, m2|L1 = 0.47 m, L2 = 0.391 m"),
        ("single-pendulum-crane", "m = 3", "m|L0 = 2 m"),
        ("single-pendulum-crane", "L0 = 3\nc = 2", "L0|m = 1000 kg"),  # which then matters
        ("single-pendulum-crane", "L0 = 3", ""),
        ("gantry-crane", "m = 3\nc = 2", "m|L = 5 m"),
        ("tower-crane", "L = 3", ""),
        ("flexible-joint", "J = 0.01\nk = 20", "J, k|R = 0.3 m"),
        ("mass-spring-chain-2", "m1 = 1\nm2 = 1\nk2 = 50", "m1, m2, k2|k1 = 100 N/m"),
        ("slosh-tank", "a = 1", "a|h = 0.25 m"),
        ("slosh-tank", "mu = 0.1", ""),
        ("double-pendulum-crane", "g = 9.8", ""),
    ],
)
def test_what_decides_the_swing_is_stated_together(machine, stated, missing):
    """A machine is the user's or the type's nominal one, not partly either."""
    way = "[1.0, 0.0]" if machine in ("single-pendulum-crane", "gantry-crane", "tower-crane") else "1.0"
    text = (
        f'[plant]\ntype = "{machine}"\n{stated}\n[move]\ndistance = {way}\nduration = 9\n'
        "[check]\nresidual_sway = 0.01\n"
    )
    if not missing:
        parse_spec(text)
        return
    own, others = missing.split("|")
    with pytest.raises(SpecError) as caught:
        parse_spec(text)
    assert caught.value.faults == (
        f"plant: states {own}, so it must state what else decides the swing: {others} (the values of the "
        "type's nominal machine).",
    )


# ── files ───────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("text", ["", "\n\n", "# a comment only\n"])
def test_an_empty_file(tmp_path, text):
    file = tmp_path / "empty.toml"
    file.write_text(text, "utf-8")
    with pytest.raises(
        SpecError, match=r"empty\.toml: the spec is empty; it must state .*\[plant\].*\[move\]"
    ):
        read_spec(file)


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ('name = "a"\n[plant\ntype = 1', "line 2, column 7"),
        ("[move]\ndistance = 0.3 m", "line 2, column 16"),
        ("name = 'a'\nname = 'b'", "line 2, column 11"),
        ("\ndistance = [1.0,", "line 2, column 17"),
        ("name =", "line 1, column 7"),
    ],
)
def test_malformed_toml_is_located(text, where):
    with pytest.raises(SpecError, match=rf"^bay\.toml: not valid TOML: .*{where}\)(; write .*)?\.$"):
        parse_spec(text, source="bay.toml")


@pytest.mark.parametrize(
    "text", ["time_s,position_m\n0.0,0.0\n", "FUNCTION_BLOCK FB_bay\nVAR x : LREAL; END_VAR"]
)
def test_an_artefact_in_place_of_a_spec_is_told_where_it_belongs(text):
    with pytest.raises(SpecError, match=r"^deploy/bay\.st: a \.st file is no spec, .* check and report take"):
        parse_spec(text, source="deploy/bay.st")


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("L1 = 6,0", "; write a decimal point: 6.0."),
        ("uncertain = { L1 = 0,1 }", "; write a decimal point: 0.1."),
        ("uncertain = { L1 = 10 % }", "; write a share: 0.1."),
        ("L1 = 6.0 m  # rope", "; write the number alone, in SI units (m, s, kg, rad)."),
        ("L1 = .5", "; write a digit on both sides of the decimal point."),
        ("g = −9.81", "; write the minus of the keyboard: -9.81."),
        ("travel = [−1.0, 2.0]", "; write the minus of the keyboard, -."),
        ("L1: 6.0", "; write = between a key and its value."),
        ("L1 = 6.0;", "; a comment begins with #."),
        ("L1 = 6.0 // rope", "; a comment begins with #."),
        ("type = tower-crane", "; a text stands in quotes."),
        ("type = “tower-crane”", '; write the straight quotes of the keyboard, ".'),
        ("type = „tower-crane“  # Turm", '; write the straight quotes of the keyboard, ".'),
        ('axes = ["x", ‘y’]', '; write the straight quotes of the keyboard, ".'),
        ("L1 =\u00a06.0", "; a space there is none of the keyboard's, type it again."),
        ("L1\u2003= 6.0", "; a space there is none of the keyboard's, type it again."),
        ("travel = [0, 1  #\u00a0m", "."),
        ("travel = [0, 1", "."),
    ],
)
def test_what_was_taken_for_toml_is_told(line, hint):
    with pytest.raises(SpecError) as caught:
        parse_spec(f"[plant]\n{line}\n")
    assert re.sub(r".*\(at [^)]*\)", "", str(caught.value)) == hint


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[move]\ndistance = 1.0\ndistance = 2.0", "move.distance is stated twice"),
        ("name = 'a'\nname = 'b'\n", "name is stated twice"),
        (
            "[limits.axis.x]\ntravel = [0.0,\n 1.0]\ntravel = [0.0,\n 2.0]\n",
            "limits.axis.x.travel is stated twice",
        ),
        ("[move]\nduration = 1.0\n[ move ]\ndistance = 2.0", r"\[move\] is stated twice"),
        ("name = 'a'\n[name.b]\n", "Cannot overwrite a value"),  # not twice, but otherwise
        ("move = { duration = 1.0, duration = 2.0 }", "Duplicate inline table key 'duration'"),
    ],
)
def test_what_is_stated_twice_is_named(text, said):
    with pytest.raises(SpecError, match=rf"^spec: not valid TOML: {said} \(at .*line \d, column \d+\)\.$"):
        parse_spec(text)


def test_a_mistyped_file_is_told(tmp_path):
    (tmp_path / "bay-3.toml").write_text("", "utf-8")
    with pytest.raises(OutputError, match=r"No such file or directory; did you mean 'bay-3\.toml'\?"):
        read_spec(tmp_path / "bay-3.tml")


@pytest.mark.parametrize(
    ("text", "why"),
    [("a = " + "9" * 5000, "thousands of digits"), ("a = " + "[" * 50000, "nested too deeply")],
)
def test_what_the_toml_parser_stumbles_over(text, why):
    with pytest.raises(SpecError, match=f"not valid TOML: .*{why}"):
        parse_spec(text)


# ── presets ─────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("name", presets())
def test_presets_are_valid_and_carry_their_name(name):
    spec = preset_spec(name)
    assert spec.name == name
    assert spec.plant.defaults == ()
    assert presets()[name]


def test_the_papers_presets_differ_in_beta_only():
    base = attrs.evolve(preset_spec("paper"), name="same")
    for beta in (0, 20, 50):
        other = preset_spec(f"paper-beta{beta}", ["name=same", "cost.sway_weight=50"])
        assert preset_spec(f"paper-beta{beta}").cost.sway_weight == beta
        assert other == base


def test_a_preset_is_no_path():
    with pytest.raises(SpecError, match="unknown preset"):
        preset_spec("../presets/paper")


# ── overrides ───────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("override", "found"),
    [
        ("plant.L1=0.5", lambda spec: spec.plant.parameters["L1"] == 0.5),
        (" plant . L1 = 0.5 ", lambda spec: spec.plant.parameters["L1"] == 0.5),
        ("name=bay 3", lambda spec: spec.name == "bay 3"),
        ('name="7"', lambda spec: spec.name == "7"),
        ("cost.effort=snap", lambda spec: spec.cost.effort == "snap"),
        ("cost.sway_scale=auto", lambda spec: spec.cost.sway_scale is None),
        ("robustness.uncertain={ L2 = 0.1 }", lambda spec: spec.robustness.uncertain == {"L2": 0.1}),
        ("robustness.uncertain.L2=0.1", lambda spec: spec.robustness.uncertain == {"L1": 0.2, "L2": 0.1}),
        ("limits.jerk=40", lambda spec: spec.limits.jerk == 40.0),
        ("move.distance=[2.0]", lambda spec: spec.move.distance == (2.0,)),
        ("can.node=3", lambda spec: spec.can.node == 3),
    ],
)
def test_an_override_is_toml_or_else_text(override, found):
    assert found(preset_spec("paper", [override]))


def test_the_last_override_counts():
    assert preset_spec("paper", ["plant.L1=0.5", "plant.L1=0.6"]).plant.parameters["L1"] == 0.6


def test_overrides_can_make_a_whole_spec():
    overrides = ["plant.type=double-pendulum-crane", "move.distance=0.3", "move.duration=3"]
    assert parse_spec("", overrides) == parse_spec(LEAST)


def test_a_move_stated_otherwise_replaces_the_files_way():
    by_target = preset_spec("paper", ["move.target=0.8", "move.start=0.5"])
    assert (by_target.move.start, by_target.move.target) == ((0.5,), (0.8,))
    from_file = LEAST.replace("distance = 0.3", "start = 1.0\ntarget = 2.0")
    assert parse_spec(from_file, ["move.distance=0.4"]).move.target == (0.4,)


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("plant.L1", r"set 'plant\.L1': write KEY=VALUE, such as"),
        ("=3", r"set '=3': write KEY=VALUE"),
        ("plant..L1=3", r"set 'plant\.\.L1=3': write KEY=VALUE"),
        ("name.first=3", r"set 'name\.first=3': 'name' is a value, not a table"),
        ("plant.L1=", r"plant\.L1: must be a number .*, found text ''"),
        ("plant.L1=half a metre", r"plant\.L1: must be a number .*, found text 'half a metre'"),
        ("name=bay\nfoo = 3", r"name: must be 1 to 64 letters"),
        ("plant.l3=1", r"plant\.l3: unknown key .known: type, m1"),
        ("L1=0.5", r"L1: unknown key"),
    ],
)
def test_faulty_overrides(override, sentence):
    with pytest.raises(SpecError, match=sentence):
        preset_spec("paper", [override])


# ── there and back ──────────────────────────────────────────────────────────────────────────────────────

POSITIVE = st.floats(1e-3, 1e3)
SMALL = st.floats(1e-6, 0.1)
OVERRIDES = st.fixed_dictionaries(
    {},
    optional={
        "name": st.from_regex(r"\A[A-Za-z][A-Za-z0-9_-]{0,20}\Z").map(lambda text: f'"{text}"'),
        "plant.L1": st.floats(0.2, 20.0),
        "move.distance": st.floats(-40.0, 40.0).filter(lambda far: abs(far) > 1e-12),
        "move.duration": st.floats(0.5, 100.0),  # at no speed beyond all machines
        "actuator": POSITIVE.map(lambda tau: f'{{ type = "first-order", tau = {tau!r} }}'),
        "robustness.uncertain": st.floats(0.01, 0.9).map(lambda r: f"{{ L2 = {r!r}, m1 = {r!r} }}"),
        "cost.sway_scale": st.one_of(st.just('"auto"'), POSITIVE),
        "limits.velocity": st.floats(1e-3, 100.0),
        "check.residual_sway": st.one_of(SMALL, SMALL.map(lambda limit: f"{{ hook = {limit!r} }}")),
        "axis.unit": st.sampled_from(["mm", "um", "counts"]),
        "export.cycle_time": st.floats(1e-4, 1.0),
    },
)


@pytest.mark.slow
@given(OVERRIDES)
def test_a_spec_survives_being_written_down(overrides):
    spec = preset_spec("paper", [f"{key}={value}" for key, value in overrides.items()])
    again = spec_from_dict(spec.to_dict())
    assert again == spec
    assert again.sha256() == spec.sha256()
    assert again.axis_scales() == spec.axis_scales()


def test_a_round_trip_keeps_apart_what_differs():
    changes = ["plant.L1=0.48", "move.distance=0.31", "limits.jerk=1", "axis.cart.sign=-1"]
    changes += ["check.residual_sway={ hook = 0.1 }", "can.node=2"]
    hashes = {preset_spec("paper", [change]).sha256() for change in changes} | {preset_spec("paper").sha256()}
    assert len(hashes) == len(changes) + 1


def test_the_order_of_keys_changes_nothing():
    forward = preset_spec("paper", ["robustness.uncertain={ L1 = 0.2, m2 = 0.1 }"])
    backward = preset_spec("paper", ["robustness.uncertain={ m2 = 0.1, L1 = 0.2 }"])
    assert list(backward.robustness.uncertain) == ["m2", "L1"]  # the machine's order
    assert forward.sha256() == backward.sha256()
    document = forward.to_dict()
    assert spec_from_dict(dict(reversed(document.items()))).sha256() == forward.sha256()


def test_whole_numbers_are_the_same_numbers():
    assert preset_spec("paper", ["move.duration=3"]).sha256() == preset_spec("paper").sha256()


def test_numbers_of_typeset_tables_are_read():
    assert finite_number("\N{MINUS SIGN}3.5e\N{MINUS SIGN}2") == -0.035
