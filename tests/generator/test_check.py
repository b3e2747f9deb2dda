"""Verdicts: which load, which machine, and the numerical error that counts against the artefact."""

import attrs
import pytest

from gen_profile.assurance.verification.verdict import Check, Finding
from gen_profile.dynamics.evaluation.scenarios import Scenario

LIMIT = {"hook": 0.004, "payload": 0.002}


def finding(name, hook, payload):
    residual = {"hook": hook, "payload": payload}
    return Finding(scenario=Scenario(name=name, parameters={"L1": 1.0}), residual=residual, modal=residual)


def check(*findings, error_bound=0.0, faults=()):
    return Check(limit=LIMIT, error_bound=error_bound, arrival=3.0, findings=findings, faults=faults)


def test_passes_when_every_load_keeps_its_limit_everywhere():
    judged = check(finding("nominal", 0.0, 0.0), finding("longer", 0.004, 0.002))
    assert judged.passed
    assert judged.reasons() == ()
    assert judged.demand == 1.0


@pytest.mark.parametrize(("hook", "payload"), [(0.0041, 0.0), (0.0, 0.0021)])
def test_one_load_on_one_machine_fails_it(hook, payload):
    judged = check(finding("nominal", 0.0, 0.0), finding("longer", hook, payload))
    assert not judged.passed
    assert [judged.keeps_limit(each) for each in judged.findings] == [True, False]
    assert judged.demand > 1.0


def test_the_error_bound_counts_against_it():
    assert check(finding("nominal", 0.0039, 0.0), error_bound=0.0001 - 1e-9).passed
    (reason,) = check(finding("nominal", 0.0039, 0.0), error_bound=0.00011).reasons()
    assert "sways by 3.9 mm after the move (nominal), which keeps the 4 mm" in reason
    assert "may be off by 110 µm; allow more" in reason


def test_the_worst_takes_up_the_greatest_share_of_its_own_limit():
    judged = check(finding("nominal", 0.003, 0.001), finding("longer", 0.001, 0.0018))
    load, worst = judged.worst
    assert (load, worst.scenario.name) == ("payload", "longer")
    assert judged.demand == pytest.approx(0.9)


def test_the_reason_names_load_machine_figure_limit_key_and_error():
    judged = check(finding("nominal", 0.0, 0.0), finding("L1 +20 %", 0.0, 0.00345), error_bound=2.5e-7)
    assert judged.reasons() == (
        "The payload sways by 3.45 mm after the move (L1 +20 %), and 2 mm are allowed "
        "(check.residual_sway; integration error up to 0.25 µm).",
    )


def test_a_large_error_is_told_without_powers_of_ten():
    (reason,) = check(finding("nominal", 1.0, 0.0), error_bound=0.0228).reasons()
    assert "integration error up to 23 mm" in reason


def test_faults_fail_it_whatever_the_sway():
    judged = check(finding("nominal", 0.0, 0.0), faults=("Something is wrong.",))
    assert not judged.passed
    assert judged.reasons() == ("Something is wrong.",)
    assert judged.demand == float("inf")
    assert len(check(finding("nominal", 1.0, 0.0), faults=("Something is wrong.",)).reasons()) == 2


def test_the_document_holds_the_contract_s_keys():
    judged = check(finding("nominal", 0.003, 0.001), finding("longer", 0.001, 0.0025), error_bound=1e-6)
    document = judged.to_dict()
    assert {key: document[key] for key in ("passed", "limit_m", "error_bound_m", "arrival_s")} == {
        "passed": False,
        "limit_m": 0.002,
        "error_bound_m": 1e-6,
        "arrival_s": 3.0,
    }
    assert [row["name"] for row in document["scenarios"]] == ["nominal", "longer"]
    assert [row["residual_peak_m"] for row in document["scenarios"]] == [0.001, 0.0025]
    assert [row["passed"] for row in document["scenarios"]] == [True, False]
    assert document["scenarios"][0]["parameters"] == {"L1": 1.0}
    assert document["reasons"] == list(judged.reasons())


def timed(name, hook, payload, group, row):
    judged = finding(name, hook, payload)
    return attrs.evolve(judged, scenario=attrs.evolve(judged.scenario, group=group, row=row))


def test_faults_of_timing_count_only_where_that_is_asked_for():
    rows = (finding("nominal", 0.0, 0.0), timed("lost", 0.0, 0.0025, "timing", 1))
    lenient = check(*rows)
    assert lenient.passed and lenient.worst[1].scenario.name == "nominal"
    (warning,) = lenient.warnings()
    assert warning.startswith("The payload sways by 2.5 mm after the move (lost)")
    assert warning.endswith("It counts where the check is strict.")
    strict = attrs.evolve(lenient, strict=True)
    assert not strict.passed and strict.warnings() == ()
    assert check(finding("nominal", 0.0, 0.0)).warnings() == ()
    assert not check(rows[1]).passed  # asked for alone, it is what is judged


def test_sway_on_the_way_counts_on_every_machine():
    rows = [
        attrs.evolve(timed(name, 0.0, 0.0, "machines", row), on_the_way=sway)
        for row, (name, sway) in enumerate({"nominal": 0.03, "longer": 0.0302, "shorter": 0.0304}.items())
    ]
    judged = attrs.evolve(check(*rows), sway_limit=0.03)
    assert [judged.keeps_limit(row) for row in rows] == [True, True, False]  # 1 % is the search's own error
    assert not judged.passed and judged.demand == pytest.approx(0.0304 / 0.0303)
    (reason,) = judged.reasons()
    assert reason.startswith(
        "The payload sways by 30.4 mm on the way (shorter), and 30 mm are allowed (limits"
    )
    assert attrs.evolve(check(*rows[:2]), sway_limit=0.03).passed


def test_each_group_has_its_verdict_worst_row_and_quantiles():
    rows = [timed(f"sample {n}", 0.0, 1e-5 * n, "samples", 1 + n) for n in range(201)]
    judged = check(finding("nominal", 0.0, 0.0), *rows)
    machines, samples = judged.to_dict()["groups"]
    assert (machines["group"], machines["rows"], machines["passed"]) == ("machines", 1, True)
    assert (samples["rows"], samples["passed"], samples["counts"]) == (201, True, True)
    assert samples["worst"] == {"load": "payload", "row": 201, "residual_peak_m": pytest.approx(0.002)}
    assert samples["quantiles_m"] == {
        "0.5": pytest.approx(1e-3),
        "0.9": pytest.approx(1.8e-3),
        "0.99": pytest.approx(1.98e-3),
    }
    listed = [row["row"] for row in judged.to_dict()["scenarios"]]
    assert listed == [0, 1, *range(153, 202)]  # the first, and the 49 worst
