"""A sample of the battery: what is found keeps its limits and costs least, what is refused has a cure."""

import json

import numpy as np
import pytest
from generator.random_specs import random_spec

from gen_profile.dynamics.evaluation.motion_evaluation import keeps_residual_sway
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.direct.relaxation import Relaxation
from gen_profile.methods.solvers.direct.set_up import DirectOptions
from gen_profile.methods.solvers.plan import plan
from gen_profile.spec.reading import overridden, spec_from_dict
from gen_profile.support.errors import NoMotion

SOLVED = [3, 13, 19, 20, 25, 29, 35, 45]  # tower, joint, chain, double pendulum, tower, chain, tank, gantry
ORDERS = {"velocity": 1, "acceleration": 2, "jerk": 3}


@pytest.mark.slow
@pytest.mark.parametrize("index", SOLVED)
def test_what_is_found_keeps_its_limits_and_costs_least(index):
    spec = spec_from_dict(random_spec(f"now-{index}"))
    found = plan(spec)
    for name, order in ORDERS.items():
        limit = getattr(spec.limits, name)
        if limit is not None:
            assert np.abs(found.command.within_segments(33, order)[1]).max() <= limit * (1.0 + 1e-9)
    if spec.limits.sway is not None:
        assert found.figures["sway_transient_peak_m"] <= spec.limits.sway
    fine = direct.solve(problem_of(spec), options=DirectOptions(intervals=120)).raise_for_status()
    assert found.solution.raise_for_status().cost == pytest.approx(fine.cost, rel=2e-4)


def test_efforts_that_do_not_see_the_highest_derivative_have_programs_that_can_be_solved():
    """A drive with lag whose jerk is limited, and the effort of its setpoints."""
    problem = problem_of(spec_from_dict(random_spec("fresh-33")))
    assert problem.effort == "reference"
    easiest = Relaxation(problem).least(tuple(problem.limits.stated()))
    assert easiest.wider == pytest.approx(0.4685, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("index", "passing"), [(28, None), (36, [True, False])])
def test_what_is_refused_is_told_values_that_work_and_whether_the_check_will_pass(index, passing):
    document = random_spec(f"now-{index}")
    with pytest.raises(NoMotion) as refusal:
        plan(spec_from_dict(document))
    if passing is not None:
        assert [one.passes for one in refusal.value.suggestions] == passing
        assert str(refusal.value).endswith("there is a motion, but the check will not pass.")
    assert refusal.value.suggestions
    for one in refusal.value.suggestions:
        changes = [f"{place}={json.dumps(value)}" for place, value in one.values.items()]
        assert one.spec == spec_from_dict(overridden(document, changes))
        assert keeps_residual_sway(one.spec, plan(one.spec).evaluation) == one.passes
