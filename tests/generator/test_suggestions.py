"""Of an infeasible problem, the requirement to blame, and values that work and are the nearest."""

import json
import re
from itertools import pairwise

import attrs
import numpy as np
import pytest

from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers import suggestions, transient_sway
from gen_profile.methods.solvers.direct import relaxation
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.draft import lasting
from gen_profile.methods.solvers.plan import plan
from gen_profile.methods.solvers.shortest import timed
from gen_profile.methods.solvers.solution import Status
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import InfeasibleProblem, LimitViolation, NoMotion
from gen_profile.support.work import OutOfWork, budget, spend

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("coarse")]

HOIST = "limits.axis.hoist={travel=[0.9, 7.1], acceleration=0.3}"
LAG = "actuator={type='first-order', tau=0.1}"


def refused(preset, *overrides):
    """Solve what cannot be solved; the changes that are named then, each a list of settings."""
    asked = preset_spec(preset, overrides)
    solution = suggestions.solve(asked)
    assert solution.optimum is None
    changes = []
    for one in solution.suggestions:
        changes.append(
            [
                f"{place}={value if isinstance(value, str) else json.dumps(value)}"
                for place, value in one.values.items()
            ]
        )
        assert one.spec == preset_spec(preset, [*overrides, *changes[-1]])
    return changes


def works(preset, *overrides):
    spec = preset_spec(preset, overrides)
    solution = transient_sway.attempt(spec)
    return choice.keeps_limits(solution) and transient_sway.keeps_sway(solution, 1.01)


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


@pytest.mark.parametrize(("preset", "overrides", "blamed"), REFUSED.values(), ids=REFUSED)
def test_every_change_that_is_named_works_and_a_quarter_of_it_does_not(preset, overrides, blamed):
    changes = refused(preset, *overrides)
    assert [change.partition("=")[0] for (change,) in changes] == blamed
    for (change,) in changes:
        assert works(preset, *overrides, change)
        assert not works(preset, *overrides, nearer(preset, overrides, change, 0.75))


def test_a_hoist_is_no_way_out_where_its_travel_is_limited():
    overrides = ["limits.sway=0.08", HOIST]
    changes = refused("single-pendulum-crane", *overrides)
    assert changes[0][0].startswith("move.duration=")
    assert not any("travel" in change for (change, *others) in changes if not others)
    assert all(works("single-pendulum-crane", *overrides, *change) for change in changes)


@pytest.mark.slow
def test_a_travel_that_begins_where_the_move_does_is_not_to_blame_for_a_short_duration():
    overrides = ["move.duration=9", "limits.travel=[0, 8]"]
    (longer,), *others = refused("bay-crane", *overrides)
    assert float(longer.partition("=")[2]) < 14.0  # 15.8 was named; the shortest takes 12.75 s
    assert others
    assert not any("travel" in place for change in others for place in change)
    assert works("bay-crane", *overrides, longer)


def test_limits_that_no_single_one_is_to_blame_for_are_widened_together():
    overrides = ["limits.velocity=0.09", "limits.acceleration=0.1"]
    changes = refused("paper", *overrides)
    assert [len(change) for change in changes] == [1, 2]
    assert all(works("paper", *overrides, *change) for change in changes)


def test_what_was_found_before_the_work_is_used_up_is_told(monkeypatch):
    spec, tries = preset_spec("paper", ["limits.sway=0.01"]), []

    def least_change(asked, change, *_, **__):
        if tries:
            raise OutOfWork
        tries.append(suggestions._tried(asked, change(1.5)))
        return tries[0]

    monkeypatch.setattr(suggestions, "least_change", least_change)
    found = suggestions.remedy(spec)
    assert tries[0] in found.suggestions
    assert list(tries[0].values) == ["move.duration"]


def test_where_nothing_that_was_tried_will_do_it_is_told_how_long_it_would_take(monkeypatch):
    given_up = lambda spec, **_: choice.given_up(problem_of(spec))  # noqa: E731
    monkeypatch.setattr(suggestions, "tried", given_up)
    advice = suggestions.remedy(preset_spec("paper", ["limits.acceleration=0.01"])).advice
    (estimate,) = re.findall(r"^By an estimate that was not tried, it takes some ([\d.]+) s", advice)
    assert works("paper", "limits.acceleration=0.01", f"move.duration={1.1 * float(estimate)}")
    assert not works("paper", "limits.acceleration=0.01", f"move.duration={0.9 * float(estimate)}")


def test_no_limits_are_named_that_no_machine_has():
    """Without the machine's sway all limits together would do, 37 times as wide."""
    spec = preset_spec(
        "double-pendulum-crane", ["move.duration=5.0", "limits={velocity=1.5, acceleration=0.6}"]
    )
    with pytest.raises(InfeasibleProblem) as refusal:
        plan(spec)
    assert [list(one.values) for one in refusal.value.suggestions] == [["move.duration"]]


@pytest.mark.slow
def test_a_limit_is_kept_by_machines_whose_sway_hardly_follows_the_nominal_one_s():
    """Supposing that the worst one's sway falls as the nominal one's does took less and less of it."""
    ways = ["move.distance=[-2.5, 3.53]", "move.duration=7.41", 'cost={effort="snap", sway_weight=0.0}']
    machine = ["plant.m=32.0", "plant.L=8.52", "plant.c=0.0"]
    unsure = "robustness={method='none', uncertain={L=0.204}}"
    spec = preset_spec("gantry-crane", [*ways, *machine, unsure, "limits={acceleration=9.46, sway=0.66}"])
    assert plan(spec).figures["sway_transient_worst_m"] <= 1.01 * 0.66


@pytest.mark.parametrize(
    ("order", "less"), [(1, {"robustness.method": "none"}), (2, {"robustness.order": 1})]
)
def test_robustness_is_to_blame_where_nothing_else_is(monkeypatch, order, less):
    spec = preset_spec("paper", [f"robustness.order={order}", "check.residual_sway=0.1"])

    def tried(other, **_):
        hard = other.robustness.method == "sensitivity" and other.robustness.order == order
        return choice.attempt(problem_of(lasting(other, 0.3) if hard else other), "direct")

    monkeypatch.setattr(suggestions, "tried", tried)
    assert [one.values for one in suggestions.remedy(spec).suggestions] == [less]


def test_too_short_a_move_with_limits_is_told_a_duration_that_keeps_them():
    overrides = ["move.duration=1.0", "limits.acceleration=0.3"]
    changes = refused("paper", *overrides)
    assert changes[0][0].startswith("move.duration")
    assert works("paper", *overrides, *changes[0])


def test_the_least_sway_of_a_pendulum_is_what_its_load_needs_to_get_there():
    """A load is accelerated by ω² times its sway: full ahead, then full astern, s = 4 d / (ω T)²."""
    free = ["plant.c=0", 'robustness={method="none", uncertain={}}', "move.duration=10"]
    spec = preset_spec("gantry-crane", [*free, "limits.sway=0.01"])
    omega = np.sqrt(spec.plant.parameters["g"] / spec.plant.parameters["L"])
    least = 4.0 * np.hypot(*spec.move.distance) / (omega * spec.move.duration) ** 2
    changes = refused("gantry-crane", *free, "limits.sway=0.01")
    named = {change.partition("=")[0]: float(change.partition("=")[2]) for (change,) in changes}
    assert 0.999 * least < named["limits.sway"] < 1.12 * least
    longest = spec.move.duration * np.sqrt(least / 0.01)
    assert 0.999 * longest < named["move.duration"] < 1.1 * longest


def test_the_share_falls_with_the_duration():
    shares = [
        relaxation.Relaxation(
            problem_of(preset_spec("paper", ["limits.sway=0.01", f"move.duration={t}"]))
        ).least(("limits.sway",))
        for t in (2.5, 3.0, 4.0, 6.0)
    ]
    assert all(later.wider < earlier.wider for earlier, later in pairwise(shares))


def test_the_indirect_method_which_knows_no_limits_is_told_how_to_keep_them():
    overrides = ["solver.method=indirect", "limits.acceleration=0.5"]
    with pytest.raises(LimitViolation) as violation:
        plan(preset_spec("paper", overrides))
    message = str(violation.value)
    assert message.startswith("limits.acceleration: 0.5 is allowed, the motion needs 0.7")
    assert message.endswith('It can be done with solver.method = "auto".')
    (reason,), (suggestion,) = violation.value.reasons, violation.value.suggestions
    assert (reason.code, reason.place, reason.allowed) == ("limit_broken", "limits.acceleration", 0.5)
    assert suggestion.spec == preset_spec("paper", [*overrides, "solver.method=auto"])
    plan(suggestion.spec)


def test_no_hint_of_the_indirect_method_is_told_where_there_are_limits(monkeypatch):
    """It knows none: its duration would break them."""
    monkeypatch.setattr(suggestions, "tried", lambda other, **_: choice.given_up(problem_of(other)))
    spec = preset_spec("paper", ["limits.acceleration=0.1"])
    unlimited = attrs.evolve(choice.given_up(problem_of(spec)), method="indirect", advice="Allow 1.42 s.")
    assert suggestions.explained(spec, unlimited).advice.startswith("By an estimate that was not tried")
    monkeypatch.setattr(suggestions, "remedy", lambda *_: suggestions.Remedy())
    assert suggestions.explained(spec, unlimited).advice == suggestions.IN_VAIN


@pytest.mark.parametrize("method", ["auto", "indirect"])
def test_suggestions_name_a_method_that_knows_limits(method):
    spec = preset_spec("paper", ["limits.acceleration=0.2", f"solver.method={method}"])
    with pytest.raises(NoMotion) as refusal:
        plan(spec)
    named = {one.values.get("solver.method") for one in refusal.value.suggestions}
    assert named == ({"auto"} if method == "indirect" else {None})


def test_a_limit_that_the_next_run_refuses_as_implausible_is_not_named():
    spec = preset_spec("single-pendulum-crane", ["limits.sway=0.2"])
    wide = spec.changed({"limits.sway": 40.0})
    assert choice.keeps_limits(choice.attempt(problem_of(wide), "direct"))
    assert not choice.keeps_limits(suggestions.tried(wide))


@pytest.mark.parametrize(("limit", "longest"), [(0.02, 60.0), (0.05, 47.0)])
def test_where_a_hoist_without_limits_misleads_programs_what_smooth_motions_need_is_named(limit, longest):
    """A load on hardly any rope hardly sways: so the relaxation finds a motion in 16 s."""
    changes = refused("single-pendulum-crane", f"limits.sway={limit}")
    values = {key: float(value) for (change,) in changes for key, _, value in [change.partition("=")]}
    assert 16.0 < values["move.duration"] < longest
    assert 0.1 < values["limits.sway"] < 0.27  # what the motion without limits takes
    for (change,) in changes:
        assert works("single-pendulum-crane", f"limits.sway={limit}", change)


def test_no_duration_is_tried_that_a_spec_cannot_state():
    """So little sway would take the smooth motion 685,000 s."""
    with pytest.raises(NoMotion) as refusal:
        plan(preset_spec("tower-crane", ["limits.sway=1e-9"]))
    assert [list(one.values) for one in refusal.value.suggestions] == [["limits.sway"]]


def test_values_are_skipped_that_leave_no_room_for_the_sway_of_the_worst_machine(monkeypatch):
    spec, asked = preset_spec("paper", ["limits.sway=0.01"]), []

    def tried(other, **_):
        asked.append(other.move.duration)
        failed = attrs.evolve(problem_of(other), sway_spread=1.2)
        return attrs.evolve(choice.given_up(failed), status=Status.INFEASIBLE)

    monkeypatch.setattr(suggestions, "tried", tried)
    assert suggestions.least_change(spec, lambda factor: {"move.duration": factor}) is None
    assert asked[:2] == pytest.approx([1.03, 1.2 * 1.03])
    assert all(later > 1.19 * earlier for earlier, later in pairwise(asked))


def test_a_value_that_takes_too_much_work_leaves_enough_for_an_ample_one(monkeypatch):
    spec = preset_spec("paper")
    smooth = choice.attempt(problem_of(spec), "indirect")

    def tried(other, **_):
        spend(1.0 if other.move.duration >= 1.3 else 9.0)
        return smooth

    monkeypatch.setattr(suggestions, "tried", tried)
    with budget(16.0):
        found = suggestions.least_change(spec, lambda factor: {"move.duration": factor})
    assert 1.3 <= found.values["move.duration"] < 1.4


def test_a_longer_move_is_tried_without_binding_limits_first(monkeypatch):
    spec = preset_spec("paper", ["limits.sway=0.02"])
    monkeypatch.setattr(transient_sway, "kept_by_all", lambda *_, **__: pytest.fail("limits do not bind"))
    found = suggestions.tried(lasting(spec, 8.0))
    assert found.method == "indirect"
    assert choice.keeps_limits(found)


def test_a_range_whose_nominal_machine_cannot_keep_the_limits_is_not_searched(monkeypatch):
    monkeypatch.setattr(choice.worst_case, "solve", lambda *_: pytest.fail("searched"))
    problem = problem_of(preset_spec("paper", ["robustness.method=range", "limits.velocity=0.05"]))
    assert choice.attempt(problem).status is Status.INFEASIBLE


@pytest.mark.parametrize("needed", [30.0, 3000.0])
def test_the_least_duration_is_found_in_few_steps_however_far_it_is(monkeypatch, needed):
    tried = []

    class Quadratic:
        def __init__(self, problem):
            self.problem = problem

        def least(self, _):
            tried.append(self.problem.duration)
            return relaxation.Relaxed(wider=(needed / self.problem.duration) ** 2, sequence_result=None)

    monkeypatch.setattr(relaxation, "Relaxation", Quadratic)
    problem = problem_of(preset_spec("paper", ["limits.sway=0.01", "move.duration=3"]))
    assert needed < relaxation.least_duration(Quadratic(problem)) < 1.05 * needed
    assert len(tried) <= 5


def test_a_speed_that_leads_out_of_an_axis_range_is_told_one_that_does_not():
    with pytest.raises(InfeasibleProblem) as refusal:
        plan(preset_spec("single-pendulum-crane", ["move.final_velocity=[0.0, -0.2]"]))
    (speed,) = re.findall(r"end at (-[\d.]+) m/s or slower\.", str(refusal.value))
    plan(preset_spec("single-pendulum-crane", [f"move.final_velocity=[0.0, {speed}]"]))
    with pytest.raises(InfeasibleProblem):
        plan(preset_spec("single-pendulum-crane", [f"move.final_velocity=[0.0, {1.02 * float(speed)}]"]))


def test_where_no_duration_will_do_the_limit_to_blame_is_named():
    overrides = ["limits.acceleration=1", "limits.sway=0.01", "move.initial={theta1=0.02}"]
    with pytest.raises(InfeasibleProblem, match=r"^move\.duration: no duration keeps the limits") as refusal:
        timed(preset_spec("paper", [*overrides, "move.duration=minimum"]))
    (one,) = refusal.value.suggestions
    assert list(one.values) == ["move.duration", "limits.sway"]
    cured = plan(preset_spec("paper", [*overrides, *(f"{key}={value}" for key, value in one.values.items())]))
    assert cured.spec == one.spec
    assert cured.figures["sway_transient_peak_m"] <= one.values["limits.sway"]


@pytest.mark.parametrize("others", [[], ["limits.velocity=0.05"]])
def test_cures_leave_room_for_the_machine_that_sways_most_whatever_else_is_infeasible(others):
    spec = preset_spec("paper", ["limits.sway=0.02", *others])
    assert suggestions.usual_spread(problem_of(spec)) == pytest.approx(1.18, abs=0.06)


def test_a_limit_of_the_sway_that_is_named_is_kept_by_every_machine():
    overrides = ["robustness={method='none', uncertain={L1=0.5}}", "check.residual_sway=0.1"]
    with pytest.raises(NoMotion) as refusal:
        plan(preset_spec("paper", [*overrides, "limits.sway=0.014"]))
    (one,) = (one for one in refusal.value.suggestions if "limits.sway" in one.values)
    cured = plan(preset_spec("paper", [*overrides, f"limits.sway={one.values['limits.sway']}"]))
    assert cured.figures["sway_transient_worst_m"] <= 1.01 * one.values["limits.sway"]


def test_a_duration_is_guessed_where_programs_settle_for_shorter_ones_only(monkeypatch):
    class Settling:
        def __init__(self, problem):
            self.problem = problem

        def least(self, _):
            duration = self.problem.duration
            return (
                None
                if duration > 20.0
                else relaxation.Relaxed(wider=900.0 / duration**2, sequence_result=None)
            )

    monkeypatch.setattr(relaxation, "Relaxation", Settling)
    problem = problem_of(preset_spec("paper", ["limits.sway=0.01"]))
    guess = relaxation.least_duration(Settling(problem))
    assert 20.0 < guess == pytest.approx(30.0, rel=0.4)


def test_redundant_sensitivities_are_left_out_here_too():
    uncertain = ["robustness.uncertain={L1=0.2, L2=0.2}"]
    problem = problem_of(preset_spec("paper", [*uncertain, "limits.sway=0.016"]))
    easiest = relaxation.Relaxation(problem).least(("limits.sway",))
    alone = relaxation.Relaxation(attrs.evolve(problem, desensitized=("L1",))).least(("limits.sway",))
    assert easiest.wider == pytest.approx(alone.wider, rel=1e-6)
    begun_there = direct.solve(problem, easiest.start(problem))
    assert begun_there.redundant == ("L2",)
    assert begun_there.raise_for_status().cost == pytest.approx(
        direct.solve(problem).raise_for_status().cost, rel=1e-6
    )


def test_a_motion_whose_loads_cannot_be_followed_is_none(monkeypatch):
    monkeypatch.setattr(
        "gen_profile.methods.solvers.direct.transient_sway.greatest_sway", lambda *_: np.array([np.inf])
    )
    solution = direct.solve(problem_of(preset_spec("paper", ["limits.sway=0.02"])))
    assert solution.optimum is None


def test_a_cost_that_is_too_steep_is_lowered_by_a_value_that_works():
    (change,) = refused("paper", "cost.sway_scale=5000")
    assert change == ["cost.sway_weight=0.0"]
    assert works("paper", "cost.sway_scale=5000", *change)


def test_a_move_in_far_too_little_time_is_told_how_long_it_takes():
    change = refused("mass-spring-chain", "solver.method=direct", "limits.sway=0.3", "move.duration=0.375")
    assert any(one.startswith("move.duration=") for (one, *_) in change)
