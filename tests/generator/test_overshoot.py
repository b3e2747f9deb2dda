"""How far loads may pass their targets (`limits.overshoot`), against a simulation of its own."""

import re
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gen_profile as gp
from gen_profile.plants.registry import find_plant
from gen_profile.spec.passed_target import EXACT, directions

PAID_OUT, ROPE, GRAVITY, WAY, SWING = 1.0, 7.5, 9.81, 1.5, 0.12
SKEWED = (
    f"plant.L0={ROPE - PAID_OUT}", "plant.m=1000", f"plant.g={GRAVITY}", "plant.c=0",
    "move.duration=10", "cost.sway_weight=0", "export.cycle_time=0.01",
    "robustness.uncertain={L0 = 0.03}", "check.residual_sway=0.02",
)  # fmt: skip
NOMINAL = "check.uncertain={}"
GREAT = 100.0  # m, a limit that no load reaches


def skewed(limit, *overrides, way=WAY):
    """A load that is picked up askew: it swings past its target, unless that is limited."""
    places = [f"move.start=[0, {PAID_OUT}]", f"move.target=[{way}, {PAID_OUT}]"]
    initial = f"move.initial={{phi = {SWING if way > 0.0 else -SWING}}}"
    limited = [f"limits.overshoot={limit}"]
    return gp.preset_spec("single-pendulum-crane", [*SKEWED, *places, initial, *limited, *overrides])


def farthest(motion, rope=ROPE, way=WAY, until=30.0):
    """How far a pendulum goes past the target in m, by its equation, the cart's acceleration as input."""
    edges, sign = [*motion.knots[:-1].tolist(), motion.duration, until], 1.0 if way > 0.0 else -1.0
    state, most = [sign * SWING, 0.0], -np.inf
    for begin, end in pairwise(edges):  # it jerks in between
        inner = 0.5 * (begin + end)

        def rates(time, at, inner=inner):
            near = inner + (time - inner) * (1.0 - 1e-12)
            pull = motion.derivative(np.array([near]), 2)[0, 0]
            return [at[1], (pull * np.cos(at[0]) - GRAVITY * np.sin(at[0])) / rope]

        times = np.linspace(begin, end, 50 if end < until else 2000)
        found = solve_ivp(rates, (begin, end), state, rtol=1e-10, atol=1e-12, t_eval=times, max_step=0.1)
        place = motion.derivative(times, 0)[:, 0] - rope * np.sin(found.y[0])
        state, most = found.y[:, -1], max(most, float((sign * (place - way)).max()))
    return most


@pytest.mark.slow
@pytest.mark.parametrize(("limit", "way"), [(0.05, WAY), (0.0, WAY), (0.0, -WAY)])
def test_no_load_passes_its_target_by_more_than_the_limit(limit, way):
    free, kept = (gp.plan(skewed(one, NOMINAL, way=way)) for one in (GREAT, limit))
    assert farthest(free.motion, way=way) > 1.0
    assert farthest(kept.motion, way=way) == pytest.approx(limit, abs=EXACT * WAY)
    assert kept.figures["load_overshoot_peak_m"] == pytest.approx(limit, abs=EXACT * WAY)
    assert kept.solution.optimum.cost > free.solution.optimum.cost


@pytest.mark.slow
@pytest.mark.parametrize("limit", [0.06, 0.03])
def test_the_limit_holds_on_all_machines_and_no_more_is_held_back_than_needed(limit):
    kept = gp.plan(skewed(limit))
    worst = max(
        farthest(kept.motion, PAID_OUT + (ROPE - PAID_OUT) * share) for share in np.linspace(0.97, 1.03, 7)
    )
    assert 0.99 * limit < worst <= 1.01 * limit
    assert kept.figures["load_overshoot_worst_m"] == pytest.approx(worst, rel=1e-2)


@pytest.mark.slow
def test_the_check_finds_how_far_loads_pass_and_refuses_a_motion_that_lets_them(tmp_path):
    free = gp.design(skewed(GREAT, "check.samples=20"), "csv", tmp_path)
    shown = {row["name"]: row for row in free.check.to_dict()["scenarios"]}
    assert len(shown) > 20
    assert shown["nominal"]["overshoot_m"] == pytest.approx(farthest(free.plan.motion), abs=1e-4)
    assert all(row["overshoot_m"] > 1.0 for row in shown.values())
    table = tmp_path / free.artefacts[0].path
    judged = gp.check_artefact(table, skewed(0.03)).check
    assert any(re.search(r"passes its target by 1328 mm .*limits.overshoot", one) for one in judged.reasons())


def test_a_design_within_the_limit_passes_its_check(tmp_path):
    kept = gp.design(skewed(0.03, "check.samples=5"), "csv", tmp_path)
    document = kept.check.to_dict()
    assert document["passed"] and document["overshoot_limit_m"] == 0.03
    worst = max(row["overshoot_m"] for row in document["scenarios"])
    assert 0.99 * 0.03 < worst <= 1.01 * 0.03


def test_a_load_may_pass_by_as_much_as_may_remain_of_its_sway(tmp_path):
    check = gp.design(skewed(0.0), "csv", tmp_path).check
    assert check.passed and check.overshoot_limit == check.limit["payload"] == 0.02
    assert 0.0 < max(finding.overshoot for finding in check.findings) < 0.02


@pytest.mark.slow
def test_the_shortest_motion_keeps_it():
    task = ["move.duration=minimum", "limits.axis.cart={velocity = 1.0, acceleration = 0.5, jerk = 2.0}"]
    free, kept = (gp.plan(skewed(limit, NOMINAL, *task)) for limit in (GREAT, 0.0))
    assert kept.motion.duration >= free.motion.duration * (1.0 - 1e-3)
    assert farthest(kept.motion) <= 2.0 * EXACT * WAY


@pytest.mark.slow
def test_every_direction_has_a_target_of_its_own():
    task = ["move.distance=[1, -1]", "move.duration=8", "move.initial={theta_x = 0.1, theta_y = -0.1}"]
    free, kept = (
        gp.plan(gp.preset_spec("gantry-crane", [*task, f"limits.overshoot={one}"])) for one in (GREAT, 0)
    )
    times = np.linspace(0.0, 8.0, 2001)

    def passed(plan):
        sway = plan.evaluation.swing.sway(times)[0]
        place = plan.motion.derivative(times, 0) - sway
        return (place - [1.0, -1.0]) @ np.diag([1.0, -1.0])

    assert (passed(free).max(axis=0) > 0.1).all()
    assert (passed(kept).max(axis=0) < 1e-4).all()


def test_a_shaped_motion_that_breaks_it_is_refused_with_a_duration_that_does():
    task = ["solver.method=zv", "move.duration=2", "limits.overshoot=0.005"]
    with pytest.raises(
        gp.InfeasibleProblem, match=r"(?s)limits.overshoot: 0.005 is allowed.*at least 3\."
    ) as error:
        gp.plan(gp.preset_spec("paper", task))
    longer = error.value.suggestions[0].spec
    assert gp.plan(longer).figures["load_overshoot_worst_m"] <= 1.01 * 0.005


@pytest.mark.parametrize(
    ("machine", "overrides", "words"),
    [
        ("slosh-tank", (), "no axis carries the surface straight to a target"),
        ("flexible-joint", (), "no axis carries the tip straight to a target"),
        ("tower-crane", (), "no axis carries the load straight to a target"),
        ("gantry-crane", ("move.final_velocity=[0.1, 0]",), "reaches its target at a speed"),
    ],
)
def test_it_is_refused_where_it_says_nothing(machine, overrides, words):
    with pytest.raises(gp.SpecError, match=f"limits.overshoot: .*{words}"):
        gp.preset_spec(machine, ["limits.overshoot=0", *overrides])


def test_axes_and_loads_are_matched_by_what_the_machine_says_of_its_bodies():
    pairs = {
        "double-pendulum-crane": [(0, 0, 1, 0)],
        "single-pendulum-crane": [(0, 0, 0, 0)],
        "gantry-crane": [(0, 0, 0, 0), (1, 1, 0, 1)],
        "hall-crane": [(0, 0, 1, 0), (1, 1, 1, 1)],
        "mass-spring-chain-3": [(0, 0, 2, 0)],
    }
    for machine, expected in pairs.items():
        found = directions(find_plant(machine))
        assert [(one.axis, one.component, one.body, one.coordinate) for one in found] == expected


def test_a_certificate_says_that_it_does_not_speak_of_it(tmp_path):
    design = gp.design(skewed(0.03, NOMINAL), "csv", tmp_path)
    certificate = gp.certify_artefact(tmp_path / design.artefacts[0].path)
    assert any("limits.overshoot: nothing is proved of it" in words for words in certificate.warnings())
