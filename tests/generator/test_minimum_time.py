"""Shortest moves against bisections on linear programs, of several machines and axes."""

import math
import re
from random import Random

import attrs
import numpy as np
import pytest
from generator.crane_problems import CRANE, crane_problem
from generator.oracles.crane_linear_program import feasible, modes
from scipy.linalg import eigvalsh

from gen_profile.dynamics.problem.limits import Breach
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers import shortest as searching
from gen_profile.methods.solvers.direct import relaxation
from gen_profile.methods.solvers.plan import draft, plan
from gen_profile.methods.solvers.search import least
from gen_profile.motion.metrics import greatest
from gen_profile.spec.model import LimitsSpec
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import Code, CosimulationError, InfeasibleProblem, SolverDiverged
from gen_profile.support.work import OutOfWork, budget, spend


def shortest(frequencies, distances, guess, desensitized, **limits):
    """Bisect between half and twice a guess; all axes arrive together, each by an acceleration of its own."""
    low, high = 0.5 * guess, 2.0 * guess
    while high - low > 1e-3 * guess:
        middle = (low + high) / 2.0
        if all(
            feasible(frequencies, distance, middle, desensitized=desensitized, **limits)
            for distance in distances
        ):
            high = middle
        else:
            low = middle
    return high


@pytest.mark.slow
@pytest.mark.parametrize(
    ("limits", "desensitized"),
    [
        ({"acceleration": 0.3}, ("L1",)),
        ({"velocity": 0.15, "acceleration": 0.5, "jerk": 10.0}, ()),
        ({"velocity": 0.15, "acceleration": 0.5, "jerk": 10.0}, ("L1",)),
        ({"jerk": 5.0}, ()),
    ],
)
def test_of_the_papers_crane(limits, desensitized):
    problem = crane_problem(desensitized=desensitized, limits=LimitsSpec(**limits))
    shortest_found = relaxation.refined(problem, choice.minimum_time(problem)).duration
    frequencies, _ = modes(CRANE.nominal())
    best = shortest(frequencies, [0.3], shortest_found, frequencies if desensitized else [], **limits)
    # the linear programs' acceleration leaps less quickly than the motion's
    assert 0.99 * best < shortest_found < 1.001 * best


def test_a_travel_that_ends_where_the_move_does_takes_no_longer():
    limits = LimitsSpec(velocity=0.15, acceleration=0.5, jerk=10.0)
    free, bounded = (
        choice.minimum_time(crane_problem(desensitized=("L1",), limits=own)).duration
        for own in (limits, attrs.evolve(limits, travel=(0.0, 0.3)))
    )
    assert bounded == pytest.approx(free, rel=2e-3)


@pytest.mark.slow
def test_with_a_limit_of_the_sway_on_the_way():
    limits = LimitsSpec(acceleration=0.5, sway=0.02)
    shortest_found = choice.minimum_time(crane_problem(desensitized=("L1",), limits=limits)).duration
    frequencies, _ = modes(CRANE.nominal())
    swung = (CRANE.nominal(), 0.02)
    best = shortest(frequencies, [0.3], shortest_found, frequencies, acceleration=0.5, sway=swung)
    loose = shortest(frequencies, [0.3], shortest_found, frequencies, acceleration=0.5)
    assert loose < 0.95 * best  # the sway is what it waits for
    assert 0.998 * best < shortest_found < 1.02 * best


def of_the_chain(p):
    """Masses in a row, the first one tied to the axis."""
    k = [p[f"k{i}"] for i in (1, 2, 3)]
    stiffness = np.diag(np.add(k, [*k[1:], 0.0])) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    return np.sqrt(eigvalsh(stiffness, np.diag([p[f"m{i}"] for i in (1, 2, 3)])))


def of_the_liquid(p):
    waves = np.pi / p["a"] * np.array([1.0, 3.0])
    return np.sqrt(p["g"] * waves * np.tanh(waves * p["h"]))


# frequencies from textbooks; damping none; and limits for all axes
MACHINES = {
    "gantry-crane": (lambda p: [np.sqrt(p["g"] / p["L"])], ["plant.c=0"], {"acceleration": 0.4, "jerk": 0.5}),
    "flexible-joint": (
        lambda p: [np.sqrt(p["k"] / p["J"])],
        ["plant.c=0"],
        {"velocity": 6.0, "acceleration": 60.0},
    ),
    "mass-spring-chain": (
        of_the_chain,
        ["plant.c1=0", "plant.c2=0", "plant.c3=0"],
        {"velocity": 0.8, "acceleration": 2.0},
    ),
    "slosh-tank": (of_the_liquid, ["plant.mu=0"], {"acceleration": 0.6, "jerk": 6.0}),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "method"), [*zip(MACHINES, ["none", "sensitivity", "sensitivity", "none"], strict=True)]
)
def test_of_other_machines(preset, method):
    frequencies, undamped, limits = MACHINES[preset]
    spec = preset_spec(
        preset,
        [
            *undamped,
            f"robustness.method={method}",
            *(f"limits.{name}={value}" for name, value in limits.items()),
        ],
    )
    problem, found = problem_of(spec), frequencies(spec.plant.parameters)
    duration = choice.minimum_time(problem).duration
    uncertain = [] if method == "none" else found
    best = shortest(found, np.abs(problem.distance), duration, uncertain, **limits)
    assert 0.998 * best < duration < 1.02 * best


@pytest.mark.slow
def test_a_hoisting_machine_s_shortest_move_is_not_that_of_the_rope_at_the_start():
    """Programs linearised at rest find nothing in less than 11.4 s."""
    problem = problem_of(preset_spec("single-pendulum-crane", ["limits.acceleration=0.5"]))
    duration = choice.minimum_time(problem).duration
    assert duration < 10.5
    assert choice.keeps_limits(choice.attempt(attrs.evolve(problem, duration=duration + 0.01)))


def in_cycles(duration):
    return math.ceil(1e3 * duration - 1e-6) / 1e3


def searched(excess, start=10.0, most=100.0, search=searching.EXACT_DURATION):
    """Look for the least duration whose excess is not positive; also list what was tried."""
    tried = []

    def listed(duration):
        tried.append(duration)
        return excess(duration)

    least_value = least(listed, start, search, most, in_cycles)
    assert len(set(tried)) == len(tried)
    return least_value, tried


@pytest.mark.parametrize(("upper", "tries"), [(10.001, 3), (10.03, 7), (10.5, 13), (13.0, 15)])
def test_a_duration_of_which_only_is_known_whether_it_will_do_is_found_by_bisection(upper, tries):
    """Every try is a design of seconds."""
    value, tried = searched(lambda duration: -math.inf if duration >= upper else math.inf)
    assert upper <= value <= upper * math.exp(searching.EXACT_DURATION.precision) + 0.001
    assert len(tried) <= tries


def test_no_duration_is_looked_for_without_end():
    assert searched(lambda _: math.inf)[0] is None


def test_where_the_excess_falls_no_more_no_duration_is_looked_for():
    value, tried = searched(lambda duration: 0.3 + 0.1 / duration, 1.0, 1e9, relaxation.LEAST_WIDENING)
    assert value is None
    assert len(tried) <= 12


@pytest.mark.parametrize("upper", [8.0, 9.99, 10.001, 10.03, 10.5, 13.0])
@pytest.mark.parametrize("power", [1.0, 4.0, 30.0])
def test_an_excess_that_is_known_leads_to_the_duration_in_few_tries(upper, power):
    def excess(duration):
        return power * math.log(upper / duration)

    value, tried = searched(excess)
    assert upper <= value
    assert excess(value) >= -searching.EXACT_DURATION.close or value <= upper * math.exp(
        searching.EXACT_DURATION.precision
    )
    assert len(tried) <= 5


def test_an_excess_that_falls_ever_more_slowly_is_followed_with_few_tries():
    """They take half a second each."""
    value, tried = searched(lambda d: (3.0 - d) + 0.5 * (3.0 - d) ** 2, 2.7, 30.0)
    assert 3.0 <= value < 3.01
    assert len(tried) <= 5


def test_the_least_value_found_before_the_work_is_used_up_is_taken():
    def excess(value):
        spend(1.0)
        return -math.inf if value >= 12.0 else math.inf

    search = attrs.evolve(searching.EXACT_DURATION, stride=math.log(1.5), growth=1.0)
    with budget(4.5):
        assert 12.0 <= least(excess, 10.0, search) <= 16.0
    with pytest.raises(OutOfWork), budget(0.5):
        least(excess, 10.0, search)


def test_no_motion_is_designed_twice_for_durations_that_end_on_the_same_cycle():
    assert searched(lambda duration: -math.inf if duration > 0.05 else math.inf, 0.048, 1.0)[0] == 0.051


def test_a_motion_that_no_machine_can_follow_is_passed_over(monkeypatch):
    """A hoist without limits flings the load about in the shortest motion."""
    drafted = draft(preset_spec("paper"))

    def flung(*_):
        raise CosimulationError("The motion cannot be integrated beyond 2.565 s.")

    monkeypatch.setattr("gen_profile.methods.solvers.draft.evaluate", flung)
    assert drafted.excess_sway == math.inf


def test_where_the_work_does_not_reach_for_many_intervals_the_motion_on_few_is_taken(monkeypatch):
    def solved(*_, **__):
        raise OutOfWork

    monkeypatch.setattr(searching, "solved", solved)
    limits = ["limits.acceleration=0.7", "move.duration=minimum"]
    drafted = draft(preset_spec("paper", [*limits, "check.residual_sway=0.0031"]))
    assert drafted.excess_sway <= 0.0
    assert drafted.spec.move.duration == pytest.approx(2.6, rel=0.01)
    assert drafted.solution.problem.duration == drafted.spec.move.duration


def test_limits_that_take_longer_than_a_move_may_last_are_refused():
    """By what to change, and not by the number that was tried."""
    with pytest.raises(InfeasibleProblem, match=r"some 150000 s; .* 100000 s\. Widen the limits") as refusal:
        draft(preset_spec("bay-crane", ["move.duration=minimum", "limits.sway=1e-9"]))
    (reason,) = refusal.value.reasons
    assert (reason.code, reason.place, reason.allowed) == (Code.INFEASIBLE, "move.duration", 1e5)


def test_as_much_time_as_a_move_may_last_is_tried_where_its_double_would_not_be_a_move():
    spec = preset_spec("bay-crane", ["move.duration=minimum", "limits.sway=4e-9"])
    assert searching._slow(spec, problem_of(spec)).move.duration == 1e5


# ── fixed durations beside the shortest ──────────────────────────────────────────────────────────────────

# presets, with limits that bind on the way
LIMITED = {
    "double-pendulum-crane": [
        "limits.velocity=0.9",
        "limits.acceleration=0.25",
        "robustness.uncertain={L1=0.1}",
    ],
    "single-pendulum-crane": [
        "limits.velocity=1.2",
        "limits.acceleration=0.3",
        "limits.axis.hoist.velocity=0.5",
    ],
    "gantry-crane": ["limits.velocity=1.5", "limits.acceleration=0.4", "limits.jerk=1.0"],
    "hall-crane": ["limits.velocity=1.0", "limits.acceleration=0.35"],
    "tower-crane": ["limits.axis.slew.acceleration=0.01", "limits.axis.trolley.acceleration=0.2"],
    "flexible-joint": ["limits.velocity=6", "limits.acceleration=60"],
    "mass-spring-chain": ["limits.velocity=0.8", "limits.acceleration=2.0"],
    "slosh-tank": ["limits.acceleration=0.6", "limits.jerk=6.0"],
}


@pytest.fixture
def only_counted_work(monkeypatch):
    """A hall crane's searches take most of their work: a busy computer's clock would end them."""
    monkeypatch.setattr(choice, "ANSWER", (choice.ANSWER[0], math.inf))


@pytest.mark.slow
@pytest.mark.usefixtures("only_counted_work")
@pytest.mark.parametrize("preset", LIMITED)
def test_every_duration_from_the_shortest_on_has_a_motion(preset):
    """The mesh of a fixed duration is as fine as that of the shortest, where it must be."""
    limits = LIMITED[preset]
    shortest_found = plan(preset_spec(preset, [*limits, "move.duration=minimum"])).spec.move.duration
    for times in (1.0, 1.0015, 1.006):
        spec = preset_spec(preset, [*limits, f"move.duration={times * shortest_found!r}"])
        motion = plan(spec).motion
        assert motion.duration == times * shortest_found
        for column, axis in enumerate(spec.machine().actuated):
            allowed = spec.limits.of(column)
            assert greatest(motion, 2, column) <= (1.0 + 1e-6) * allowed.acceleration, axis


@pytest.mark.slow
@pytest.mark.usefixtures("only_counted_work")
@pytest.mark.parametrize("seed", range(12))
def test_other_machines_have_a_motion_of_every_duration_from_the_shortest_on(seed):
    random = Random(seed)
    preset = random.choice([*LIMITED])
    numbers = [limit.partition("=") for limit in LIMITED[preset] if limit.startswith("limits.")]
    changes = [f"{name}={random.uniform(0.6, 1.5) * float(number)!r}" for name, _, number in numbers]
    move = preset_spec(preset).move
    share = random.uniform(0.6, 1.3)
    target = [a + share * (b - a) for a, b in zip(move.start, move.target, strict=True)]
    changes.append(f"move.target={target!r}")
    shortest_found = plan(preset_spec(preset, [*changes, "move.duration=minimum"])).spec.move.duration
    duration = random.uniform(1.0, 1.05) * shortest_found
    assert plan(preset_spec(preset, [*changes, f"move.duration={duration!r}"])).motion.duration == duration


@pytest.mark.slow
@pytest.mark.usefixtures("only_counted_work")
@pytest.mark.parametrize("duration", [13.876, 14.015])  # the shortest, and 1 % more
def test_a_motion_that_takes_many_programs_to_follow_the_equations_has_the_work_for_them(duration):
    """Thirteen on 111 intervals, half of the work that is left: no other start leads to one."""
    machine = "plant={type='hall-crane', L0=2.2237, L2=2.058, m1=309.58, m2=5867.8, c=236.04}"
    limits = ["limits.velocity=0.97901", "limits.acceleration=0.51747"]
    move = ["move.target=[10.293, 4.1172, 1.9414]", f"move.duration={duration}"]
    with budget(*choice.ANSWER):
        assert choice.keeps_limits(
            choice.attempt(problem_of(preset_spec("hall-crane", [machine, *limits, *move])))
        )


@pytest.mark.slow
def test_what_is_only_not_found_is_not_called_impossible():
    """Half a per cent below the shortest no bound says that there is none; at half of it one does."""
    limits = ["robustness.uncertain={L1=0.1}", *LIMITED["double-pendulum-crane"]]
    shortest_found = plan(preset_spec("double-pendulum-crane", [*limits, "move.duration=minimum"]))
    outcomes = {0.995: (SolverDiverged, "there may be one"), 0.7: (InfeasibleProblem, "No motion meets")}
    for times, (kind, words) in outcomes.items():
        duration = times * shortest_found.spec.move.duration
        with pytest.raises(kind, match=words):
            plan(preset_spec("double-pendulum-crane", [*limits, f"move.duration={duration!r}"]))


def test_a_limit_that_programs_break_by_their_accuracy_is_kept_with_a_reserve(monkeypatch):
    """As if they were no more accurate than to a ten-thousandth."""
    problem = crane_problem(limits=LimitsSpec(acceleration=0.3), sway_weight=0.0)
    solve, asked = choice.direct.solve, []

    def inexactly(problem, *arguments, **options):
        limit = problem.limits.of(0).acceleration
        asked.append(limit)
        loose = attrs.evolve(problem, limits=LimitsSpec(acceleration=1.0001 * limit))
        return attrs.evolve(solve(loose, *arguments, **options), problem=problem)

    monkeypatch.setattr(choice.direct, "solve", inexactly)
    solution = choice.attempt(problem, "direct")
    assert choice.keeps_limits(solution)
    assert asked == [0.3, pytest.approx(0.3 * (1.0 - 2e-4), rel=1e-5)]
    assert solution.problem.limits == problem.limits


@pytest.mark.parametrize(("found", "allowed"), [(1.2000024, 1.2), (0.30000001, 0.3), (0.71, 0.5)])
def test_a_sentence_does_not_contradict_itself_by_rounding(found, allowed):
    words = Breach(place="limits.velocity", found=found, allowed=allowed).sentence()
    stated, needed = (float(number) for number in re.findall(r"(\d+\.\d+) ?(?:is|\.$)", words))
    assert stated == allowed < needed <= found + 0.5 * 10.0 ** -len(str(needed).partition(".")[2])
