"""What an infeasible problem is told: the requirement to blame, and values that work and are the nearest."""

import re
from itertools import pairwise

import attrs
import numpy as np
import pytest

from gen_profile.designs.plan import plan, timed
from gen_profile.errors import InfeasibleProblem, LimitViolation
from gen_profile.problem.problem import problem_of
from gen_profile.solvers import method_selection as choice
from gen_profile.solvers.direct import relaxation, set_up
from gen_profile.solvers.direct import solver as direct
from gen_profile.solvers.infeasibility import CandidateTest, cures
from gen_profile.spec.reading import preset_spec
from gen_profile.work import OutOfWork

HOIST = "limits.axis.hoist={travel=[0.9, 7.1], acceleration=0.3}"
LAG = "actuator={type='first-order', tau=0.1}"
SETTING = r"[a-z_.0-9]+ = (?:\[[^]]*\]|\"[a-z]+\"|[\d.]+\d)"


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Half the intervals do: what is refused, what is named and what works are found on the same mesh."""
    monkeypatch.setattr(set_up, "INTERVALS", 20)


def refused(preset, *overrides):
    """Solve what cannot be solved; the changes that are named then, each a list of settings."""
    solution = choice.solve(problem_of(preset_spec(preset, overrides)))
    assert solution.optimum is None
    longer = re.findall(r"at least ([\d.]+) s \(move\.duration\)", solution.cure)
    changes = [[f"move.duration={duration}"] for duration in longer]
    named = re.findall(rf"with ({SETTING}(?: and {SETTING})*)", solution.cure)
    changes.extend([setting.replace(" = ", "=") for setting in together.split(" and ")] for together in named)
    return changes


def works(preset, *overrides):
    return choice.keeps_limits(choice.attempt(problem_of(preset_spec(preset, overrides))))


def nearer(preset, overrides, change, share):
    """Take back a share of what a change of one number changed."""
    key, _, value = change.partition("=")
    asked = preset_spec(preset, overrides)
    before = asked.move.duration if key == "move.duration" else asked.limits.stated()[key]
    return f"{key}={before + (1.0 - share) * (float(value) - before)}"


REFUSED = {
    "two axes' sway": ("gantry-crane", ["limits.sway=0.15"], ["move.duration", "limits.sway"]),
    "an axis of several": (
        "gantry-crane",
        ["limits.axis.y.velocity=0.3"],
        ["move.duration", "limits.axis.y.velocity"],
    ),
    "what swings at the start": (
        "paper",
        ["limits.sway=0.01", "move.initial={theta1=0.02}"],
        ["limits.sway"],
    ),
    "a lagging drive": (
        "paper",
        ["limits.jerk=1.5", LAG, "cost.effort=reference"],
        ["move.duration", "limits.jerk"],
    ),
    "a whole range": (
        "paper",
        ["robustness.method=range", "limits.velocity=0.09"],
        ["move.duration", "limits.velocity"],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(("preset", "overrides", "blamed"), REFUSED.values(), ids=REFUSED)
def test_every_change_that_is_named_works_and_half_of_it_does_not(preset, overrides, blamed):
    changes = refused(preset, *overrides)
    assert [change.partition("=")[0] for (change,) in changes] == blamed
    for (change,) in changes:
        assert works(preset, *overrides, change)
        assert not works(preset, *overrides, nearer(preset, overrides, change, 0.5))


@pytest.mark.slow
def test_a_hoist_is_no_way_out_where_its_travel_is_limited():
    overrides = ["limits.sway=0.08", HOIST]
    changes = refused("single-pendulum-crane", *overrides)
    assert [change[0].partition("=")[0] for change in changes[:2]] == ["move.duration", "limits.sway"]
    assert all(works("single-pendulum-crane", *overrides, *change) for change in changes)


def test_limits_that_no_single_one_is_to_blame_for_are_widened_together():
    overrides = ["limits.velocity=0.09", "limits.acceleration=0.1"]
    changes = refused("paper", *overrides)
    assert [len(change) for change in changes] == [1, 2]
    assert all(works("paper", *overrides, *change) for change in changes)


def test_what_was_found_before_the_work_is_used_up_is_told():
    problem = problem_of(preset_spec("paper", ["limits.sway=0.01"]))
    told = []

    def solve(other, easiest):
        if told:
            raise OutOfWork
        told.append(choice.attempt(other, "direct", easiest=easiest))
        return told[0]

    trial = CandidateTest(solve=solve, keeps=choice.keeps_limits, welcome=lambda _: False)
    named = cures(problem, trial)
    assert named == f"In 3 s it would do with limits.sway = {told[0].problem.limits.sway:g}."


@pytest.mark.parametrize(("order", "less"), [(1, 'robustness.method = "none"'), (2, "robustness.order = 1")])
def test_robustness_is_to_blame_where_nothing_else_is(order, less):
    problem = problem_of(preset_spec("paper", [f"robustness.order={order}"]))

    def solve(other, _):
        hard = bool(other.desensitized) and other.order == order
        return choice.attempt(attrs.evolve(other, duration=0.3) if hard else other, "direct")

    trial = CandidateTest(solve=solve, keeps=choice.keeps_limits, welcome=lambda _: True)
    assert cures(problem, trial) == f"In 3 s it would do with {less}."


@pytest.mark.slow
def test_too_short_a_move_with_limits_is_told_a_duration_that_keeps_them():
    overrides = ["move.duration=1.0", "limits.acceleration=0.3"]
    changes = refused("paper", *overrides)
    assert changes[0][0].startswith("move.duration")
    assert works("paper", *overrides, *changes[0])


@pytest.mark.slow
def test_the_least_sway_of_a_pendulum_is_what_its_load_needs_to_get_there():
    """A load is accelerated by ω² times its sway: full ahead, then full astern, s = 4 d / (ω T)²."""
    free = ["plant.c=0", 'robustness={method="none", uncertain={}}', "move.duration=10"]
    spec = preset_spec("gantry-crane", [*free, "limits.sway=0.01"])
    omega = np.sqrt(spec.plant.parameters["g"] / spec.plant.parameters["L"])
    least = 4.0 * np.hypot(*spec.move.distance) / (omega * spec.move.duration) ** 2
    changes = refused("gantry-crane", *free, "limits.sway=0.01")
    named = {change.partition("=")[0]: float(change.partition("=")[2]) for (change,) in changes}
    assert 0.999 * least < named["limits.sway"] < 1.1 * least
    longest = spec.move.duration * np.sqrt(least / 0.01)
    assert 0.999 * longest < named["move.duration"] < 1.1 * longest


def test_the_share_falls_with_the_duration():
    shares = [
        relaxation.Relaxation(
            problem_of(preset_spec("paper", ["limits.sway=0.01", f"move.duration={t}"]))
        ).least(("limits.sway",))
        for t in (2.5, 3.0, 4.0, 6.0)
    ]
    assert all(later.share < earlier.share for earlier, later in pairwise(shares))


@pytest.mark.slow
def test_the_indirect_method_which_knows_no_limits_is_told_how_to_keep_them():
    overrides = ["solver.method=indirect", "limits.acceleration=0.5"]
    with pytest.raises(LimitViolation) as violation:
        plan(preset_spec("paper", overrides))
    told = str(violation.value)
    assert told.startswith("limits.acceleration: 0.5 is allowed, the motion needs 0.7")
    (duration,) = re.findall(r"at least ([\d.]+) s \(move\.duration\)", told)
    (limit,) = re.findall(r"with limits\.acceleration = ([\d.]+\d)", told)
    assert 'solver.method = "auto"' in told
    for change in ("solver.method=auto", f"move.duration={duration}", f"limits.acceleration={limit}"):
        plan(preset_spec("paper", [*overrides, change]))


def test_a_speed_that_leads_out_of_an_axis_range_is_told_one_that_does_not():
    with pytest.raises(InfeasibleProblem) as refusal:
        plan(preset_spec("single-pendulum-crane", ["move.final_velocity=[0.0, -0.2]"]))
    (speed,) = re.findall(r"end at (-[\d.]+) m/s or slower\.", str(refusal.value))
    plan(preset_spec("single-pendulum-crane", [f"move.final_velocity=[0.0, {speed}]"]))
    with pytest.raises(InfeasibleProblem):
        plan(preset_spec("single-pendulum-crane", [f"move.final_velocity=[0.0, {1.02 * float(speed)}]"]))


@pytest.mark.slow
def test_where_no_duration_will_do_the_limit_to_blame_is_named():
    overrides = ["limits.acceleration=1", "limits.sway=0.01", "move.initial={theta1=0.02}"]
    with pytest.raises(InfeasibleProblem, match=r"^move\.duration: no duration keeps the limits") as refusal:
        timed(preset_spec("paper", [*overrides, "move.duration=minimum"]))
    ((duration, limit),) = re.findall(
        r"In ([\d.]+) s it would do with limits\.sway = ([\d.]+\d)", str(refusal.value)
    )
    cured = plan(preset_spec("paper", [*overrides, f"limits.sway={limit}", f"move.duration={duration}"]))
    assert cured.figures["sway_transient_peak_m"] <= float(limit)


@pytest.mark.slow
def test_the_sway_between_collocation_points_is_within_the_limit_over_a_range_too():
    overrides = ["robustness.method=range", "limits.sway=0.02"]
    assert plan(preset_spec("paper", overrides)).figures["sway_transient_worst_m"] <= 1.01 * 0.02


def test_redundant_sensitivities_are_left_out_here_too():
    uncertain = ["robustness.uncertain={L1=0.2, L2=0.2}"]
    problem = problem_of(preset_spec("paper", [*uncertain, "limits.sway=0.016"]))
    easiest = relaxation.Relaxation(problem).least(("limits.sway",))
    alone = relaxation.Relaxation(attrs.evolve(problem, desensitized=("L1",))).least(("limits.sway",))
    assert easiest.share == pytest.approx(alone.share, rel=1e-6)
    begun_there = direct.solve(problem, easiest.iterate)
    assert begun_there.redundant == ("L2",)
    assert begun_there.raise_for_status().cost == pytest.approx(
        direct.solve(problem).raise_for_status().cost, rel=1e-6
    )
