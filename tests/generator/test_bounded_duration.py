"""Durations that are found between bounds."""

import re

import pytest

from gen_profile.assurance.verification.plausibility import implausibilities
from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.profile import sample
from gen_profile.spec.reading import preset_spec, spec_from_dict
from gen_profile.support.errors import InfeasibleProblem, SpecError

BOUNDED = ["limits.acceleration=0.7", "limits.jerk=20"]  # 2.615 s at least


def bounded(bounds, *overrides):
    return preset_spec("paper", [*BOUNDED, f"move.duration={bounds}", *overrides])


@pytest.mark.slow
def test_a_duration_between_bounds_is_the_shortest_one_or_the_least_allowed():
    found = [plan(bounded(bounds)) for bounds in ("minimum", "{most = 2.7}", "{least = 3.0005, most = 4}")]
    free, below, above = (one.motion.duration for one in found)
    assert below == free < 2.7 and above == pytest.approx(3.001)  # a cycle's end
    fixed = plan(bounded(3.001))
    assert found[2].solution.optimum.cost == pytest.approx(fixed.solution.optimum.cost, rel=1e-3)
    assert not found[2].spec.move.shortest


@pytest.mark.slow
def test_a_motion_that_takes_longer_than_allowed_is_refused_with_how_long_it_takes():
    with pytest.raises(InfeasibleProblem, match=r"takes 2\.6\d* s, and at most 2.5 s are allowed") as error:
        plan(bounded("{least = 1.0, most = 2.5}"))
    (one,) = error.value.suggestions
    assert plan(one.spec).motion.duration == one.values["move.duration"] < 2.7


def test_a_shaped_motion_keeps_to_the_bounds_of_its_duration():
    free, later = (plan(bounded(b, "solver.method=zvd")).motion.duration for b in ("{}", "{least = 4.0}"))
    assert free < 4.0 == pytest.approx(later)
    with pytest.raises(InfeasibleProblem, match="at most 1 s are allowed"):
        plan(bounded("{most = 1.0}", "solver.method=zvd"))


def test_bounds_of_a_duration_survive_in_a_manifest_and_are_checked_in_a_file():
    spec = bounded("{least = 3.0, most = 4.0}")
    assert spec_from_dict(spec.to_dict()) == spec
    assert "bounds" not in spec.to_dict()["move"]
    setpoints = sample(plan(bounded(2.8)).motion, 0.01)
    (fault,) = implausibilities(spec, setpoints)
    assert fault == "The motion arrives at 2.8 s, and the spec asks for at least 3 s (move.duration)."
    (fault,) = implausibilities(bounded("{most = 2.5}"), setpoints)
    assert "and the spec asks for at most 2.5 s" in fault
    assert implausibilities(bounded("{least = 2.5, most = 2.9}"), setpoints) == ()


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ("{least = 5, most = 2}", "move.duration.most: must be at least 5, the least one"),
        ("{leest = 5}", "move.duration.leest: unknown key; did you mean 'least'?"),
        ("{most = 0}", "move.duration.most: must be at least 0.001"),
    ],
)
def test_bounds_that_mean_nothing_are_refused(bounds, words):
    with pytest.raises(SpecError, match=re.escape(words)):
        bounded(bounds)
