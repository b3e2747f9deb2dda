"""Shapers and variants of the optimal motion, designed for a spec's limits."""

import re

import attrs
import numpy as np
import pytest

from gen_profile.dynamics.evaluation.motion_evaluation import evaluate
from gen_profile.dynamics.problem.limits import SWAY_TOLERANCE, breaches
from gen_profile.methods.shapers.base_moves import BASES
from gen_profile.methods.shapers.impulses import SHAPERS
from gen_profile.motion.actuator import lag_compensated
from gen_profile.spec.model import CheckSpec, LimitsSpec, RobustnessSpec
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.comparison.candidates import candidates
from gen_profile.studies.comparison.compare import compare
from gen_profile.support.errors import InfeasibleProblem

PAPER = preset_spec("paper")
TIGHT = LimitsSpec(velocity=0.3, acceleration=0.5, jerk=8.0)


def limited(limits, **move):
    return attrs.evolve(PAPER, limits=limits, move=attrs.evolve(PAPER.move, **move))


def designs(spec):
    return {contender.method: contender.design for contender in candidates(spec)}


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("tau", [None, 0.1])
def test_every_shaper_takes_its_own_shortest_time(base, tau):
    spec = limited(TIGHT, shortest=True)
    spec = attrs.evolve(spec, actuator=attrs.evolve(spec.actuator, tau=tau))
    methods = designs(attrs.evolve(spec, solver=attrs.evolve(spec.solver, base=base)))
    durations = set()
    for name in SHAPERS:
        motion = methods[name]()
        assert breaches(TIGHT, lag_compensated(motion, tau), 0.0) == ()
        assert motion.duration / spec.export.cycle_time == pytest.approx(
            round(motion.duration / spec.export.cycle_time)
        )
        durations.add(motion.duration)
    assert len(durations) > len(SHAPERS) / 2


def test_a_limit_that_a_shaper_breaks_is_named_with_a_duration_that_keeps_it():
    with pytest.raises(InfeasibleProblem) as refusal:
        designs(limited(TIGHT))["zvd"]()
    sentence = str(refusal.value)
    assert "limits.acceleration: 0.5 is allowed" in sentence
    assert "limits.jerk: 8 is allowed" in sentence
    (needed,) = re.findall(r"With this shaper the move takes at least ([\d.]+) s\.", sentence)
    motion = designs(limited(TIGHT, duration=float(needed)))["zvd"]()
    assert breaches(TIGHT, motion, 0.0) == ()


def test_the_sway_on_the_way_is_a_limit_too():
    limits = LimitsSpec(sway=0.03)
    with pytest.raises(InfeasibleProblem, match=r"^limits\.sway: 0\.03 is allowed") as refusal:
        designs(limited(limits))["zv"]()
    (needed,) = re.findall(r"at least ([\d.]+) s", str(refusal.value))
    spec = limited(limits, duration=float(needed))
    found = evaluate(spec, designs(spec)["zv"]()).figures
    assert 0.0299 < found["sway_transient_worst_m"] <= 0.03 * SWAY_TOLERANCE


def test_travel_that_no_duration_keeps():
    for shortest in (False, True):
        with pytest.raises(InfeasibleProblem, match=r"limits\.travel|no duration keeps the limits"):
            designs(limited(LimitsSpec(travel=(0.0, 0.2)), shortest=shortest))["zvd"]()


def test_variants_are_what_the_spec_does_not_ask_for_itself():
    def optimal(**changes):
        spec = attrs.evolve(PAPER, robustness=attrs.evolve(PAPER.robustness, **changes))
        return [method.removeprefix("optimal-") for method in designs(spec) if method not in SHAPERS]

    betas = ["beta0", "beta20", "beta50"]
    assert optimal() == [*betas, "order2", "range"]
    assert optimal(order=2) == [*betas, "order1", "range"]
    assert optimal(method="range") == [*betas, "order1", "order2"]
    assert optimal(method="none") == [*betas, "order1", "order2", "range"]
    assert optimal(method="none", uncertain={}) == betas
    automatic = attrs.evolve(PAPER, cost=attrs.evolve(PAPER.cost, sway_weight=5.0, sway_scale=None))
    assert [method for method in designs(automatic) if method.startswith("optimal")][:4] == [
        "optimal-beta0",
        "optimal",
        "optimal-beta20",
        "optimal-beta50",
    ]


def test_the_spec_s_own_motion_is_designed_once(monkeypatch):
    calls = []

    def solve(spec):
        calls.append(spec)
        raise InfeasibleProblem("limits.velocity: too little.")

    monkeypatch.setattr("gen_profile.studies.comparison.candidates.suggestions.solve", solve)
    loads = CheckSpec(residual_sway={"hook": 0.01, "payload": 0.003})
    found = compare(attrs.evolve(PAPER, robustness=RobustnessSpec(), check=loads))
    assert len(calls) == 1  # what is impossible for β = 0 is so for any β
    refused = {method: reason for method, reason in found.left_out.items() if method not in SHAPERS}
    assert refused == dict.fromkeys(
        ["optimal-beta0", "optimal-beta20", "optimal-beta50"], "limits.velocity: too little."
    )


@pytest.mark.slow
def test_variants_take_no_more_acceleration_than_the_spec_s_own_motion():
    spec = preset_spec("slosh-tank")
    methods = designs(spec)
    times = np.linspace(0.0, spec.move.duration, 4001)
    peaks = [np.abs(methods[name]().derivative(times, 2)).max() for name in ("optimal", "optimal-range")]
    assert peaks[1] <= peaks[0] * (1.0 + 1e-4)
    with pytest.raises(InfeasibleProblem, match=r"no more acceleration .* \(0\.7\d* m/s²\) there is no such"):
        designs(PAPER)["optimal-order2"]()
