"""The studio without a browser: states and their address, knobs, and what a page gets."""

import base64
import json
import random
import shlex
import zlib
from pathlib import Path

import numpy as np
import pytest
import tomlkit
from generator.quay import quay

from gen_profile.methods.solvers.plan import plan
from gen_profile.presentation.studio.depth import depth
from gen_profile.presentation.studio.knobs import knobs
from gen_profile.presentation.studio.orders import Question
from gen_profile.presentation.studio.state import (
    MOST_ADDRESS,
    MOST_STATE,
    StudioState,
    WrittenSpec,
    command_of,
    document_of,
    preset_start,
    text_of,
)
from gen_profile.presentation.studio.views import picture
from gen_profile.spec.reading import parse_spec, preset_spec, preset_text, presets, spec_from_dict
from gen_profile.support.errors import SpecError

PAPER = preset_start("paper")
LIMITED = {"limits.velocity": 0.3, "limits.acceleration": 0.8, "limits.jerk": 40.0}
EDITS = [
    {},
    {
        "move.duration": 3.2,
        "plant.L1": 0.5,
        "solver.method": "zvd",
        "robustness.method": "range",
        "robustness.nominal_zero": True,
    },
    {"move.target": [0.4], "name": "bay 3"},
    {
        "robustness.uncertain": None,
        "robustness.method": "none",
        "check.samples": 5,
        "cost.sway_scale": None,
        "limits.travel": [-0.1, 0.4],
    },
    {**LIMITED, "move.duration": "minimum", "limits.jerk": None},
    {
        "planner.live.L1": [0.4, 0.5],
        "planner.live_rate.L1": 0.01,
        "check.spans.c1": [0.0, 0.02],
        "can.node": 5,
        "can.mode": "csv",
        "can.following_error": 0.01,
    },
]


def of(preset, edits):
    return Question(start=preset_start(preset), state=StudioState(preset=preset, edits=edits))


def parts(answer):
    return {part["part"]: part for part in json.loads(json.dumps(list(answer), allow_nan=False))}


@pytest.mark.parametrize("edits", EDITS)
def test_an_address_brings_a_state_back(edits):
    state = StudioState(preset="paper", edits=edits)
    assert StudioState.from_address(state.address) == state
    assert state.address.replace("-", "").replace("_", "").isalnum()


def packed(text):
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    return base64.urlsafe_b64encode(packer.compress(text) + packer.flush()).decode()


@pytest.mark.parametrize(
    "address",
    [
        "x",
        "not base64!",
        StudioState(preset="paper", edits=EDITS[1]).address[:-9],
        "A" * (2 * MOST_ADDRESS),
        packed(b"[" * 100_000),
        packed(b'{"preset": 1}'),
        packed(b"null"),
        packed(b'{"edits": {"move.duration": NaN}}'),
        packed(b'{"edits": {"__class__": 1}}'),
        packed(b'{"edits": {"plant.file": "/tmp/evil.py"}}'),
        packed(b'{"edits": {"check.fmu": "evil.fmu"}}'),
        packed(b'{"edits": {"move.target": [[1.0]]}}'),
        packed(b'{"edits": {"name": "' + b"a" * (2 * MOST_STATE) + b'"}}'),
    ],
)
def test_an_address_that_no_page_wrote_is_a_sentence(address):
    with pytest.raises(SpecError):
        StudioState.from_address(address)


@pytest.mark.parametrize("edits", EDITS)
def test_page_command_line_and_spec_file_state_the_same(edits):
    spec = spec_from_dict(document_of(PAPER, edits))
    words = shlex.split(command_of(PAPER, edits))
    assert words[:3] == ["gen-profile", "--preset", "paper"] and set(words[3::2]) <= {"--set"}
    assert parse_spec(preset_text("paper"), words[4::2]) == spec
    text = text_of(PAPER, edits)
    assert parse_spec(text) == spec
    assert "# kg, hook mass" in text  # what its author wrote stays


@pytest.mark.slow
@pytest.mark.parametrize("preset", presets())
def test_every_knob_says_what_the_spec_says(preset):
    """Set to the value that it shows, each one by itself leaves the spec as it is."""
    start = preset_start(preset)
    document = document_of(start, {})
    spec = spec_from_dict(document)
    listed = knobs(spec, document, spec)
    for knob in listed:
        value = json.loads(json.dumps(knob.value))  # as the page has it
        if knob.kind == "interval" and value is not None:
            value = (value[1] - value[0]) / (value[1] + value[0])
        if knob.index is not None:
            value = [other.value for other in listed if other.path == knob.path]
        if value is None:
            assert knob.optional
            continue
        changed = spec_from_dict(document_of(start, {knob.path: value}))
        before, after = spec.to_dict(), changed.to_dict()
        if knob.kind == "interval":
            assert after["robustness"]["uncertain"] == pytest.approx(before["robustness"]["uncertain"])
        else:
            assert after == before, knob.path


@pytest.mark.parametrize("preset", ["paper", "gantry-crane", "tower-crane", "slosh-tank"])
def test_a_knob_s_bounds_are_the_spec_s(preset):
    start = preset_start(preset)
    document = document_of(start, {})
    spec = spec_from_dict(document)
    bounded = [knob for knob in knobs(spec, document, spec) if knob.kind == "number" and knob.index is None]
    assert len(bounded) > 10
    for knob in bounded:
        for bound, outward in ((knob.least, -1.0), (knob.most, 1.0)):
            if bound is not None:
                with pytest.raises(SpecError, match=knob.path.replace("axis.", "axis.(.*[.])?")):
                    spec_from_dict(document_of(start, {knob.path: bound + outward * (abs(bound) + 1.0)}))
        if knob.span is not None:
            low, high = knob.span
            assert low < high and low <= knob.value <= high if isinstance(knob.value, float) else True


def test_live_ranges_and_spans_have_knobs():
    by_part = {knob["path"]: knob for knob in parts(picture(of("paper", EDITS[-1])))["setting"]["knobs"]}
    assert by_part["planner.live.L1"]["value"] == [0.4, 0.5]
    assert by_part["planner.live_rate.L1"]["value"] == 0.01 and "planner.live_rate.L2" not in by_part
    assert by_part["check.spans.c1"]["value"] == [0.0, 0.02] and by_part["check.spans.c2"]["value"] is None
    assert by_part["can.node"]["value"] == 5 and by_part["can.node"]["whole"] is True


def test_axes_that_may_help_have_a_knob():
    by_part = parts(picture(of("tower-crane", {"move.free": ["slew"]})))
    (knob,) = [one for one in by_part["setting"]["knobs"] if one["path"] == "move.free"]
    assert knob["value"] == ["slew"] and knob["choices"] == ["slew", "trolley"]
    assert not [
        one for one in parts(picture(of("paper", {})))["setting"]["knobs"] if one["path"] == "move.free"
    ]


def test_what_is_shown_is_what_a_design_finds():
    by_part = parts(picture(of("paper", {"move.duration": 3.2})))
    assert list(by_part) == ["curves", "animation", "setting", "verdict"]
    design = plan(spec_from_dict(document_of(PAPER, {"move.duration": 3.2})))
    sway = next(panel for panel in by_part["curves"]["sway"] if panel["title"] == "Sway of the payload")
    nominal = next(curve for curve in sway["curves"] if curve["name"] == "nominal")
    peak = 1e3 * design.figures["sway_transient_peak_m"]
    assert max(map(abs, nominal["y"])) == pytest.approx(peak, rel=2e-3)
    takes = {row["quantity"]: row["takes"] for row in by_part["curves"]["margins"]}
    assert takes["jerk"] == pytest.approx(design.figures["jerk_max_m_per_s3"])
    assert by_part["verdict"]["passed"] is True
    assert by_part["verdict"]["point"]["residual"] == pytest.approx(design.figures["sway_residual_worst_m"])
    assert by_part["setting"]["command"] == "gen-profile --preset paper --set move.duration=3.2"


@pytest.mark.slow
def test_what_takes_longer_comes_afterwards_and_can_be_taken():
    by_part = parts(depth(of("paper", {})))
    assert list(by_part) == ["spectrum", "robustness", "maps", "comparison"] and by_part["maps"]["maps"] == []
    (panel,) = by_part["robustness"]["panels"]
    assert panel["curves"][0]["name"] == "optimal-beta50"
    rows = {row["method"]: row for row in by_part["comparison"]["rows"]}
    for method in ("zv", "optimal-beta20"):
        taken = parts(picture(of("paper", rows[method]["edits"])))["verdict"]["point"]
        figures = {name: rows[method][name] for name in ("duration", "acceleration", "sway", "residual")}
        assert {name: taken[name] for name in figures} == pytest.approx(figures)


def test_two_uncertain_parameters_make_a_map():
    """Whose middle lines are the curves of either parameter alone."""
    edits = {"robustness.uncertain.L2": 0.1, "solver.method": "zvd", "move.duration": 4.0}
    answer = depth(of("paper", edits))
    by_part = {part["part"]: part for part in (next(answer) for _ in range(3))}
    (drawn,) = by_part["maps"]["maps"]
    curve = by_part["robustness"]["panels"][0]
    limit = 1e3 * preset_spec("paper").check.residual_sway["payload"]
    assert drawn["frame"] == pytest.approx([20.0, 10.0]) and len(drawn["values"]) == len(drawn["y"])
    middle = [value * limit / 100.0 for value in drawn["values"][len(drawn["y"]) // 2]]
    along = np.interp(drawn["x"], curve["x"], curve["curves"][0]["y"])
    assert np.all(np.array(middle) >= 0.9 * along) and max(middle) > 0.0


@pytest.mark.slow
def test_what_cannot_be_says_why_and_what_would_help():
    edits = {"move.duration": 1.5, "limits.velocity": 0.15}
    by_part = parts(picture(of("paper", edits)))
    assert by_part["failure"]["sentences"] and by_part["failure"]["cures"]
    assert by_part["failure"]["answer"] == "none"
    (cure,) = by_part["failure"]["cures"]
    healed = parts(picture(of("paper", {**edits, **cure})))
    assert "verdict" in healed and "failure" not in healed


@pytest.mark.parametrize(("travel", "share"), [([0.0, 0.6], 0.5), ([-0.3, 0.3], 0.5), ([-0.1, 0.35], 2 / 3)])
def test_a_margin_of_travel_is_the_share_of_it_that_is_used(travel, share):
    margins = next(picture(of("paper", {"limits.travel": travel})))["margins"]
    (row,) = [row for row in margins if row["quantity"] == "travel"]
    assert row["takes"] / row["allowed"] == pytest.approx(share, rel=0.01)


def test_a_value_that_does_not_fit_is_told_at_its_knob():
    by_part = parts(picture(of("paper", {"plant.m1": -1.0, "limits.velocity": "fast"})))
    assert {fault["place"] for fault in by_part["faults"]["faults"]} == {"plant.m1", "limits.velocity"}


def test_a_spec_that_does_not_fit_is_not_called_a_motion_that_cannot_be():
    start = WrittenSpec(words=("x.toml",), text='plant.type = "cran"', folder=PAPER.folder)
    by_part = parts(picture(Question(start=start, state=StudioState())))
    assert by_part["failure"]["answer"] == "faulty" and "cran" in by_part["failure"]["sentences"][1]


def test_a_start_that_is_no_spec_is_a_sentence():
    start = WrittenSpec(words=("x.toml",), text="plant = 3 3", folder=PAPER.folder)
    with pytest.raises(SpecError, match=r"x\.toml: not valid TOML"):
        _ = start.document


def test_a_program_that_changed_since_the_user_agreed_is_not_run(tmp_path):
    (tmp_path / "machine.py").write_text("raise SystemExit('it ran')", "utf-8")
    start = WrittenSpec(words=("x.toml",), text='plant.file = "machine.py"', folder=tmp_path)
    agreed = {"plant.file": "0" * 64}
    question = Question(start=start, state=StudioState(), agreed=agreed)
    for read in (question.spec, question.beginning):
        with pytest.raises(SpecError, match="it was not run"):
            read()


def random_edits(chance, listed):
    """Turn some knobs as a hand might, within their bounds and beyond."""
    edits = {}
    for knob in chance.sample(listed, chance.randint(1, 4)):
        match knob.kind:
            case "choice":
                edits[knob.path] = chance.choice(knob.choices)
            case "switch":
                edits[knob.path] = chance.random() < 0.5
            case "number":
                value = (knob.value or 0.1) * chance.uniform(0.8, 1.25)
                if chance.random() < 0.05:
                    value = chance.choice([0.0, -1.0, 1e9])
                edits[knob.path] = value if knob.index is None else [value] * chance.randint(1, 2)
            case "several":
                edits[knob.path] = chance.sample(knob.choices, chance.randint(0, len(knob.choices)))
            case "interval":
                edits[knob.path] = chance.choice([None, 0.1])
            case "pair":
                edits[knob.path] = [-0.1, chance.uniform(0.0, 1.0)]
    return edits


@pytest.mark.slow
def test_whatever_is_turned_is_answered_without_a_traceback():
    chance, listed = random.Random(1), knobs(spec := spec_from_dict(PAPER.document), PAPER.document, spec)
    # limits and ranges can make a search take seconds
    quick = [
        knob
        for knob in listed
        if knob.group != "limits" and knob.words not in ("robustness.method", "move.duration")
    ]
    ends = {"verdict": 0, "failure": 0, "faults": 0}
    for _ in range(25):
        by_part = parts(picture(of("paper", random_edits(chance, quick))))
        (end,) = ends.keys() & by_part.keys()
        ends[end] += 1
        assert "Internal error" not in json.dumps(by_part)
    assert min(ends["verdict"], ends["faults"]) > 1


class TestOverStacks:
    @pytest.mark.slow
    def test_the_way_is_sketched_before_it_is_found_for_all_machines(self):
        document = quay().to_dict()
        start = WrittenSpec(words=("quay.toml",), text=tomlkit.dumps(document), folder=Path())
        state = StudioState(edits={"path.stacks.2": [25.0, 27.5, 16.4]})
        answer = picture(Question(start=start, state=state))
        first = next(answer)
        assert first["part"] == "sketch"
        found = {part["part"]: part for part in answer}
        verdict = found["verdict"]
        assert verdict["one_by_one"] > verdict["duration"] and 0.0 < verdict["room"] < 0.1
        assert verdict["passed"] and found["side"]["stacks"][2]["row"] == (25.0, 27.5, 16.4)
        assert found["setting"]["command"].endswith("--set 'path.stacks.2=[25.0, 27.5, 16.4]'")
        ways = [{str(line["name"]): line for line in part["lines"]} for part in (first, found["side"])]
        about, exact = (way["middle of the payload, nominal"] for way in ways)
        between = np.linspace(2.0, 35.0, 50)
        apart = np.interp(between, about["x"], about["y"]) - np.interp(between, exact["x"], exact["y"])
        assert 0.0 < np.abs(apart).max() < 1.0
        shaded = [np.ptp(way["swept by the payload"]["y"]) for way in ways]
        assert shaded[1] > shaded[0] + 0.2  # ropes of other lengths

    def test_what_is_known_of_the_load_has_knobs(self):
        spec = quay()
        shown = {(one.path, one.index): one.value for one in knobs(spec, spec.to_dict(), spec)}
        assert shown["path.rail", None] == 36.0
        assert ("move.final_velocity", 0) not in shown  # which a path over stacks refuses
        assert [shown["path.load", 0], shown["path.load", 1]] == [2.5, 2.6]
        assert [shown["path.clearance", 0], shown["path.clearance", 1]] == [0.5, 1.0]
