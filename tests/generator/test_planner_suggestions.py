"""What is suggested where a planner block leaves too much sway."""

from types import SimpleNamespace

import pytest
from command_line import run_here
from generator.planned_machines import BAY, HOIST

from gen_profile.delivery.designs import planner_suggestions as suggestions
from gen_profile.delivery.designs.planner_suggestions import planner_suggestions
from gen_profile.spec.reading import parse_spec
from gen_profile.support.errors import SpecError


def history(faults=(), promise=True, came=(), takes=1.0, **rest):
    """A history, whose command could be obeyed in 1 s."""
    kinds = ("brakes", "disturbed", "misinformed")
    return SimpleNamespace(
        faults=faults,
        promise=promise,
        exercised=dict.fromkeys(came, 1),
        obeyed=(SimpleNamespace(is_late=lambda lateness: takes > lateness),),
        history=SimpleNamespace(**{kind: kind in rest for kind in kinds}),
    )


def proof(fraction, faults=(), judged=None):
    judged = judged or history()
    return SimpleNamespace(
        fraction=lambda _: fraction,
        faults=faults,
        judged=(judged,),
        worst=judged,
        passed=fraction <= 1.0,
        count=200,
    )


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_each_change_is_made_as_large_as_it_must_be(power):
    """Whatever power of the errors, the velocity, and the allowed sway the sway goes with."""
    spec = parse_spec(BAY)

    def swaying(changed, count):
        limits, check = changed.limits, changed.check
        assert limits.acceleration / limits.velocity == pytest.approx(0.3, rel=0.1)
        uncertain = changed.checked_ranges()["L1"][1] / 6.0 - 1.0
        fraction = 5.0 * (uncertain / 0.05) ** (2.0 * power) * limits.velocity**power
        return proof(fraction * (0.05 / check.residual_sway["hook"]) ** power)

    surer, slower, more = planner_suggestions(spec, proof(5.0), swaying)
    assert surer.values["check.uncertain.L1"] < 0.05
    assert set(slower.values) == {"limits.velocity", "limits.acceleration", "limits.jerk"}
    assert more.values["check.residual_sway"] > 0.05
    assert all(suggestion.fraction <= 1.0 for suggestion in (surer, slower, more))


def test_nothing_is_named_that_does_not_help_or_cannot_be():
    spec = parse_spec(HOIST, ["check.uncertain={}"])
    assert planner_suggestions(spec, proof(5.0), lambda *_: proof(3.0)) == ()

    def refused(changed, count):
        if changed.limits != spec.limits:
            raise SpecError("too slow")
        return proof(0.5)

    assert [list(one.values) for one in planner_suggestions(spec, proof(5.0), refused)] == [
        ["check.residual_sway"]
    ]
    assert planner_suggestions(spec, proof(5.0, faults=("altered",)), lambda *_: proof(0.5)) == ()


def test_few_histories_tell_what_fails_and_all_what_passes():
    spec, counts = parse_spec(HOIST, ["check.uncertain={}"]), []

    def needs_more(_, count):
        counts.append(count)
        return proof(0.5 if count < 200 or len(counts) > 2 else 3.0)

    assert planner_suggestions(spec, proof(5.0), needs_more)
    assert counts[:4] == [40, 200, 40, 200]


def test_cures_are_tried_on_one_history_at_least():
    counts = []

    def passes(_, count):
        counts.append(count)
        return proof(0.5)

    one = proof(5.0)
    one.count = 1
    assert planner_suggestions(parse_spec(HOIST, ["check.uncertain={}"]), one, passes)
    assert set(counts) == {1}


@pytest.mark.parametrize(
    ("values", "tried"),
    [
        ({}, False),
        ({"promise": False}, True),
        ({"promise": False, "brakes": True}, False),  # after which nothing is promised
        ({"promise": False, "misinformed": True}, False),
        ({"came": [("nErrorId 9", "standing")]}, True),
        ({"came": [("nErrorId 3", "standing"), ("nPromise 1", "position")]}, False),
        ({"takes": 100.0}, True),
    ],
)
def test_whether_faults_may_come_of_sway_is_told_by_values(values, tried):
    """Whatever the words of a fault are."""
    spec = parse_spec(HOIST, ["check.uncertain={}"])
    failed = proof(0.5, judged=history(faults=("by and by, at times",), **values))
    assert bool(planner_suggestions(spec, failed, lambda *_: proof(0.5))) == tried


@pytest.mark.slow
def test_what_a_refusal_names_passes(tmp_path, monkeypatch):
    first, *_ = suggestions.CHANGES.items()  # one is tried as the others are
    monkeypatch.setattr(suggestions, "CHANGES", dict([first]))
    swaying = BAY.replace("residual_sway = 0.05", "residual_sway = 0.005").replace("L1 = 0.05", "L1 = 0.2")
    (tmp_path / "bay.toml").write_text(swaying)
    options = ("planner", "write", tmp_path / "bay.toml", "--out", tmp_path / "out", "--histories", 8)
    failed = run_here(*options, "--json")
    assert failed.code == 4
    assert "It would pass" in failed.err
    named = failed.document["cures"]
    assert [next(iter(cure["values"])) for cure in named] == ["check.uncertain.L1"]
    ((place, share),) = named[0]["values"].items()
    passed = run_here(*options, "--set", f"{place}={share}", "--json")
    assert passed.code == 0
    assert passed.document["proof"]["share"] == named[0]["share"]
