"""Trolley and hoist together over stacks, against another integrator, and as written to files."""

import re
from pathlib import Path

import attrs
import numpy as np
import pytest
from generator.quay import (
    ABOVE,
    HEIGHT,
    LIMITS,
    RAIL,
    ROPE,
    SIDEWAYS,
    STACKS,
    WIDTH,
    followed,
    quay,
    shortage,
)
from scipy.integrate import solve_ivp

import gen_profile as gp
from gen_profile.assurance.verification.batch import Feed, many_machines, residual_peaks
from gen_profile.dynamics.evaluation.clearance import nearest
from gen_profile.dynamics.evaluation.simulation import body_places
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.methods.solvers.over_stacks.bay import bay_of
from gen_profile.methods.solvers.over_stacks.program import MOST_INTERVALS, Program, resting
from gen_profile.motion.profile import sample
from gen_profile.presentation.charts.side_view import path_figure
from gen_profile.presentation.report.build import report
from gen_profile_fmu.running.cosimulation import PlantCosimulation

pytestmark = pytest.mark.slow

NEARER = 5e-4  # m, by which no machine may come nearer to a stack than the clearance


@pytest.fixture(scope="module")
def plan():
    return gp.plan(quay())


@pytest.fixture(scope="module")
def folder(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("deploy")
    spec = attrs.evolve(plan.spec, check=attrs.evolve(plan.spec.check, samples=20))
    assert gp.design(spec, ["csv", "plc", "can"], folder).passed
    return folder


def ends(plan):
    return plan.spec.move.start[0], plan.spec.move.target[0]


class TestMotion:
    @pytest.mark.parametrize("rope", [0.9, 0.93, 0.97, 1.0, 1.05, 1.1])
    def test_no_machine_of_the_range_comes_nearer_than_the_clearance(self, plan, rope):
        times = np.linspace(0.0, plan.motion.duration, 20001)
        x, z, sway = followed(plan.motion, rope * ROPE, times)
        assert shortage(x, z, plan.spec.path, *ends(plan)) <= NEARER
        assert np.abs(sway).max() <= 1.01 * 1.5

    @pytest.mark.parametrize("rope", [0.9, 1.0, 1.1])
    def test_no_machine_sways_on(self, plan, rope):
        times = np.linspace(0.0, plan.motion.duration + 20.0, 4001)
        _, _, sway = followed(plan.motion, rope * ROPE, times)
        left = np.abs(sway[times >= plan.motion.duration]).max()
        assert left <= (1e-4 if rope == 1.0 else 0.1)

    def test_limits_are_kept_and_ends_exact(self, plan):
        motion, limits = plan.motion, plan.spec.limits
        times = np.linspace(0.0, motion.duration, 40001)
        for order, name in enumerate(("velocity", "acceleration", "jerk"), start=1):
            greatest = np.abs(motion.derivative(times, order)).max(axis=0)
            allowed = [getattr(limits.of(axis), name) for axis in (0, 1)]
            assert (greatest <= np.array(allowed) * (1.0 + 1e-6)).all()
        before_end = motion.duration * (1.0 - 1e-12)
        for order, expected in enumerate((motion.target, 0.0, 0.0)):
            np.testing.assert_allclose(motion.derivative([before_end], order)[0], expected, atol=1e-7)

    def test_it_is_quicker_than_one_axis_after_the_other(self, plan):
        assert plan.motion.duration < 0.7 * plan.passage.one_by_one

    def test_more_time_is_used_for_less_lifting_and_less_jerk(self, plan):
        longer = gp.plan(quay(move={"duration": 1.2 * plan.motion.duration}))
        assert longer.passage.lift <= plan.passage.lift + 1e-6
        times = np.linspace(0.0, 1.0, 5001)
        jerks = [
            np.square(one.motion.derivative(times * one.motion.duration, 3)[:, 0]) for one in (longer, plan)
        ]
        assert jerks[0].mean() < 0.5 * jerks[1].mean()

    def test_it_swings_at_the_start(self):
        plan = gp.plan(quay(move={"initial": {"phi": 0.02}}, limits={"sway": None}))
        assert plan.figures["sway_residual_worst_m"] <= 0.1
        assert plan.passage.nearest.room >= 0.0

    def test_the_other_way(self):
        back = gp.plan(quay(move={"start": [36.0, 18.7], "target": [0.0, 30.1]}))
        times = np.linspace(0.0, back.motion.duration, 20001)
        x, z, _ = followed(back.motion, ROPE, times)
        assert shortage(x, z, back.spec.path, 36.0, 0.0) <= NEARER


class TestSlowHoists:
    @pytest.mark.parametrize("velocity", [1.5, 0.05])
    def test_the_least_time_is_known_about(self, plan, velocity):
        """The lowest load is above the highest stack as long as the trolley takes past it, hardly longer."""
        hoist = {**LIMITS["axis"]["hoist"], "velocity": velocity}
        bay = bay_of(quay(limits={"sway": 1.5, "axis": {**LIMITS["axis"], "hoist": hoist}}))
        low, high, top = STACKS[2]
        level = RAIL - 1.1 * ROPE - 30.1 - HEIGHT / 2.0 - ABOVE

        def held(duration):
            times = np.linspace(0.0, duration, 200001)
            return float((level + bay.lifted(duration, bay.top).at(times)[:, 0] >= top).mean() * duration)

        least, past = bay.quickest_pass(), (high - low + WIDTH + 2.0 * SIDEWAYS) / 4.0
        assert held(0.995 * least) < past <= held(1.005 * least)
        if velocity == 1.5:
            assert least == pytest.approx(plan.motion.duration, rel=0.03)

    def test_long_intervals_are_integrated_as_finely(self):
        bay = bay_of(quay(robustness={"method": None, "uncertain": None}))
        programs = [
            Program(bay=bay, about=resting(bay, bay.lifted(duration, bay.top))) for duration in (40.0, 400.0)
        ]
        assert [len(one.about.jerks) for one in programs] == [100, MOST_INTERVALS]
        assert programs[1].step <= programs[0].step
        assert [one.followed[0].states.shape[2] - 1 for one in programs] == [8, 40]


class TestLook:
    def test_the_picture_shows_a_way_that_keeps_out_of_what_is_dashed(self, plan):
        (panel,) = path_figure(plan.spec, plan.evaluation).panels
        lines = {str(line.name): line for line in panel.lines}
        swept, dashed = lines["swept by the payload"], lines["clearance"]
        x, low = swept.x[: len(swept.x) // 2], swept.y[: len(swept.x) // 2]
        over = (x > STACKS[0][0]) & (x < STACKS[3][1])  # the last one is what the load is set down on
        assert over.sum() > 20
        heights = np.array([dashed.y[np.searchsorted(dashed.x, place) - 1] for place in x[over]])
        assert (low[over] >= heights - 0.02).all() and (low[over] - heights).min() < 0.1

    def test_report_and_picture_tell_of_the_stacks(self, plan, tmp_path):
        spec = attrs.evolve(plan.spec, check=attrs.evolve(plan.spec.check, samples=0))
        made = report(spec, ["csv"])
        page = made.content.decode("utf-8")
        assert "Over the stacks" in page
        assert "less than one axis after the other" in page
        assert 'class="failed"' not in page  # limits that are used up, but for rounding
        gp.plot(plan, tmp_path / "way.png")
        assert (tmp_path / "way.png").stat().st_size > 10_000


class TestRefusals:
    def test_too_quick_names_the_stack_and_a_time_that_does(self, plan):
        with pytest.raises(gp.InfeasibleProblem) as refusal:
            gp.plan(quay(move={"duration": 0.95 * plan.motion.duration}))
        assert "too near to the stack from 25 to 27.5 m" in refusal.value.sentences[0]
        (suggestion,) = refusal.value.suggestions
        assert suggestion.passes
        assert plan.motion.duration <= suggestion.values["move.duration"] + 0.1
        gp.plan(suggestion.spec)

    def test_a_wall_names_itself_and_a_clearance_that_does(self):
        stacks = [*STACKS[:2], [25.0, 27.5, 30.9], *STACKS[3:]]
        with pytest.raises(
            gp.InfeasibleProblem, match=r"25 to 27\.5 m, 30\.9 m high is in the way"
        ) as refusal:
            gp.plan(quay(stacks))
        (suggestion,) = refusal.value.suggestions
        assert gp.plan(suggestion.spec).passage.nearest.room >= 0.0

    def test_a_slot_that_loads_would_swing_out_of_is_named(self):
        walls = [[20.1, 22.5, 20.4], [22.5 + WIDTH + 2.0 * SIDEWAYS, 28.0, 19.0]]
        spec = quay(
            walls,
            move={"start": [0.0, 30.1], "target": [22.5 + WIDTH / 2.0 + SIDEWAYS, 26.0]},
            check={"residual_sway": 0.005},
            robustness={"uncertain": {"L0": 0.8}},
        )
        with pytest.raises(gp.SolverDiverged, match=r"stack from 20\.1 to 22\.5 m.* it has 0 m more at the"):
            gp.plan(spec)

    def test_a_wall_higher_than_the_rail_has_no_cure(self):
        with pytest.raises(gp.InfeasibleProblem) as refusal:
            gp.plan(quay([[20.0, 21.0, RAIL + 1.0]]))
        assert refusal.value.suggestions == ()


class TestCheck:
    @pytest.mark.parametrize("name", ["quay.csv", "quay.st", "quay.log"])
    def test_every_format_holds_both_axes_in_step(self, folder, name, plan):
        judged = gp.check_artefact(folder / name)
        assert judged.passed
        near = judged.check.nearest
        assert -NEARER <= near.room <= 0.05
        document = judged.to_dict()["check"]
        assert document["nearest"]["room_m"] == near.room
        assert all(row["room_m"] is not None for row in document["scenarios"])
        assert set(judged.check.groups) >= {"machines", "search", "samples"}

    def test_a_higher_stack_fails_with_its_place_and_time(self, folder, plan):
        higher = [*STACKS[:2], [25.0, 27.5, 18.7], *STACKS[3:]]
        spec = quay(higher, move={"duration": plan.motion.duration})
        judged = gp.check_artefact(folder / "quay.csv", spec)
        assert not judged.passed
        (sentence,) = (one for one in judged.check.reasons() if "path.clearance" in one)
        assert "too near: payload at the stack from 25 to 27.5 m, 18.7 m high, after" in sentence
        times = np.linspace(0.0, plan.motion.duration, 20001)
        worst = max(
            shortage(*followed(plan.motion, rope * ROPE, times)[:2], spec.path, *ends(plan))
            for rope in (0.9, 1.1)
        )
        assert -judged.check.nearest.room == pytest.approx(worst, abs=1e-3)

    def test_a_drawn_machine_tells_where_it_is_nearest(self, folder, plan):
        found = gp.check_artefact(folder / "quay.csv").check.findings
        drawn = [one for one in found if one.scenario.group == "samples"]
        times = np.linspace(0.0, plan.motion.duration + 20.0, 20001)
        for finding in drawn:
            x, z, _ = followed(plan.motion, finding.scenario.parameters["L0"], times)
            then = np.abs(times - finding.nearest.time) < 0.02
            missing = shortage(x[then], z[then], plan.spec.path, *ends(plan))
            assert -missing == pytest.approx(finding.room, abs=2e-3)
        assert len({one.nearest.time for one in drawn}) > 1

    @pytest.mark.parametrize("overhead", [[], [[8.0, 14.0, 15.0]]])
    def test_the_compiled_loop_finds_the_same_room(self, plan, overhead):
        path = {"overhead": overhead}
        spec, setpoints = gp.evolve_spec(plan.spec, path=path), sample(plan.command, 0.01)
        plant, feed = spec.machine(), Feed(times=setpoints.times, position=setpoints.position)
        machines = [{**spec.plant.parameters, "L0": rope * ROPE} for rope in (0.9, 1.0, 1.1)]
        rows = parameter_rows(plant, machines)
        with many_machines(plant) as runs:
            peaks = residual_peaks(runs, spec, feed, rows, tau=np.zeros(3), max_step=1e-3, since=1e9)
        with PlantCosimulation(plant) as fmu:
            for values, row, (found, time, number) in zip(machines, rows, peaks[:, -3:], strict=True):
                response = fmu.run(setpoints, values, max_step=1e-3, settle=0.01)
                bodies = body_places(plant, response.q_u, response.position, row)
                near = nearest(spec, response.times, bodies)
                assert near.room == pytest.approx(found, abs=1e-6)
                assert near.time == pytest.approx(time, abs=0.011)
                assert near.obstacle == int(number)  # of one body, zones are numbered as obstacles
                assert (near.obstacle >= len(STACKS)) == bool(overhead)


class TestOverhead:
    @pytest.mark.parametrize(
        "beam",
        [
            [12.0, 17.0, 23.6],  # it is passed below
            [33.0, 39.0, 23.6],  # over the target
            [-8.0, -1.76, 12.0],  # behind the start, lower than the load is lifted
            [37.76, 42.0, 15.0],  # behind the target
        ],
    )
    def test_every_rope_keeps_the_clearance(self, beam):
        plan = gp.plan(quay(path={"overhead": [beam]}))
        times = np.linspace(0.0, plan.motion.duration + 20.0, 40001)
        for rope in (0.9, 0.95, 1.0, 1.05, 1.1):
            x, z, _ = followed(plan.motion, rope * ROPE, times)
            assert shortage(x, z, plan.spec.path, 0.0, 36.0) <= NEARER

    def test_it_costs_height_and_so_time(self):
        free = gp.plan(quay()).motion.duration
        assert free < gp.plan(quay(path={"overhead": [[12.0, 17.0, 23.6]]})).motion.duration < 1.1 * free

    def test_too_little_height_names_both_and_a_clearance_that_was_tried(self):
        with pytest.raises(gp.InfeasibleProblem) as refusal:
            gp.plan(quay(path={"overhead": [[12.0, 17.0, 22.9]]}))
        sentence = str(refusal.value)
        assert (
            "what is overhead from 12 to 17 m, 22.9 m high is in the way: below it the payload is" in sentence
        )
        assert "too low to pass the stack from 25 to 27.5 m" in sentence
        (cure,) = refusal.value.suggestions
        clearance = list(cure.values["path.clearance"])
        found = gp.plan(quay(path={"overhead": [[12.0, 17.0, 22.9]], "clearance": clearance}))
        assert found.passage.nearest.room >= -NEARER

    @pytest.mark.parametrize("lower", [4.0, 10.0, 25.0])  # the target hangs higher than the last two let it
    def test_as_much_height_is_missing_as_a_beam_is_lower(self, lower):
        def missing(height):
            with pytest.raises(gp.InfeasibleProblem) as refusal:
                gp.plan(quay(path={"overhead": [[12.0, 17.0, height]]}))
            return float(re.search(r"is ([\d.]+) m too low", str(refusal.value))[1])

        assert missing(22.0 - lower) == pytest.approx(missing(22.0) + lower, abs=0.1)

    def test_the_check_names_it(self, folder, plan):
        spec = quay(path={"overhead": [[12.0, 17.0, 20.0]]}, move={"duration": plan.motion.duration})
        judged = gp.check_artefact(folder / "quay.csv", spec)
        assert not judged.passed
        assert any(
            "payload at what is overhead from 12 to 17 m, 20 m high" in one for one in judged.check.reasons()
        )
        place = judged.to_dict()["check"]["nearest"]
        assert (place["stack"], place["overhead"]) == (None, 0)


@pytest.mark.parametrize(("key", "low", "high"), [("path.rail", 36.0, 33.0), ("path.stacks.1.2", 20.0, 23.0)])
def test_a_library_gives_no_profile_for_lower_stacks(tmp_path, key, low, high):
    """A rail that is lower by a metre has all stacks higher by one; one stack may be higher by itself."""
    stacks = [[2.0, 4.0, 1.0], [8.0, 10.5, 20.0]]
    yard = quay(stacks, move={"start": [0.0, 26.0], "target": [20.0, 26.0]})
    assert gp.run_sweep(yard, {key: sorted((low, high))}, ["csv"], tmp_path).statuses == {"passed": 2}
    between = (2.0 * low + high) / 3.0
    for asked, used in ((high, high), (between, high), (low, low)):
        assert gp.lookup(tmp_path, {key: asked}).used == {key: used}
    (reason,) = gp.lookup(tmp_path, {key: between}).passed_over.values()
    assert "path.clearance" in reason


@pytest.mark.parametrize("end", ["start", "target"])
def test_a_load_may_begin_and_end_at_the_clearance_itself(end):
    beside = 20.1 - WIDTH / 2.0 - SIDEWAYS
    ends = {"start": [beside, 30.1], "target": [36.0, 18.7]}
    if end == "target":
        ends = {"start": [0.0, 30.1], "target": [22.5 + WIDTH / 2.0 + SIDEWAYS, 26.0]}
    plan = gp.plan(quay([[20.1, 22.5, 10.4]], move=ends))
    times = np.linspace(0.0, plan.motion.duration + 20.0, 40001)  # it swings on beside the stack
    for rope in (0.9, 1.0, 1.1):
        x, z, _ = followed(plan.motion, rope * ROPE, times)
        assert shortage(x, z, plan.spec.path, *(ends[key][0] for key in ends)) <= NEARER
    assert plan.motion.duration < 23.0  # a centimetre farther away it takes 21 s


def test_hook_and_load_of_a_machine_of_ones_own_keep_the_clearance(tmp_path):
    """Against the motion of two masses on rods, by their places, with the rods' forces as unknowns."""
    folder = Path(__file__).parents[2] / "examples"
    (text,) = re.findall(r'SPEC = """(.*?)"""', (folder / "13_over_stacks.py").read_text("utf-8"), re.DOTALL)
    plan = gp.plan(gp.parse_spec(text, folder=folder))
    times = np.linspace(0.0, plan.motion.duration, 8001)
    for scale in (0.9, 1.0, 1.1):
        parameters = {**plan.spec.plant.parameters, "L0": 2.0 * scale}
        bodies = two_masses(plan.motion, parameters, times)
        for body, size in enumerate((plan.spec.path.hook, plan.spec.path.load)):
            path = attrs.evolve(plan.spec.path, load=size)
            assert shortage(*bodies[body], path, *ends(plan)) <= NEARER


def two_masses(motion, p, times):
    """Integrate places and velocities of hook and load, with accelerations by the rods' two forces."""

    def rates(t, state):
        x1, z1, x2, z2, vx1, vz1, vx2, vz2 = state
        (y, h), (v, paid), (a, pull) = (motion.derivative([t], order)[0] for order in range(3))
        upper, lower = np.array([y - x1, -z1]), np.array([x1 - x2, z1 - z2])
        fast, slow = np.array([v - vx1, -vz1]), np.array([vx1 - vx2, vz1 - vz2])
        down, top = np.array([0.0, -p["g"]]), np.array([a, 0.0])
        rope = p["L0"] + h
        # |upper| = rope and |lower| = d, twice derived, are linear in the forces per length
        matrix = [
            [upper @ upper / p["m1"], -(upper @ lower) / p["m1"]],
            [-(lower @ upper) / p["m1"], lower @ lower * (1.0 / p["m1"] + 1.0 / p["m2"])],
        ]
        side = [upper @ (top - down) + fast @ fast - paid**2 - rope * pull, slow @ slow]
        above, below = np.linalg.solve(matrix, side)
        first = (above * upper - below * lower) / p["m1"] + down
        second = below * lower / p["m2"] + down
        return [vx1, vz1, vx2, vz2, *first, *second]

    y, h = motion.start
    low = -(p["L0"] + h)
    begin = [y, low, y, low - p["d"], 0.0, 0.0, 0.0, 0.0]
    x1, z1, x2, z2, *_ = solve_ivp(
        rates, (0.0, times[-1]), begin, t_eval=times, rtol=1e-9, atol=1e-10, max_step=0.05
    ).y
    return (x1, z1), (x2, z2)
