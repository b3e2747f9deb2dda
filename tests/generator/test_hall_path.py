"""Bridge, trolley and hoist together over boxes in plan view, against two masses on rods in space."""

from pathlib import Path

import attrs
import numpy as np
import pytest
from generator.hall import BOXES, LIMITS, MACHINE, RAIL, hall, shortage, two_masses
from generator.quay import quay

import gen_profile as gp
from gen_profile.assurance.verification.batch import Feed, many_machines, residual_peaks
from gen_profile.dynamics.evaluation.clearance import nearest
from gen_profile.dynamics.evaluation.simulation import body_places
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.methods.solvers.over_stacks.bay import bay_of
from gen_profile.motion.profile import sample
from gen_profile.presentation.charts.side_view import path_figure, standing_on
from gen_profile.presentation.studio.curves_json import side_json
from gen_profile.spec.plan_view import Area, StraightWay
from gen_profile_fmu.running.cosimulation import PlantCosimulation

BESIDE = [8.0, 10.0, 6.0, 9.0, 8.0]  # ropes run past it, and the load is below it in part
NEARER = 5e-4  # m, by which no machine may come nearer to a stack than the clearance
EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def plan():
    return gp.plan(hall())


@pytest.fixture(scope="module")
def folder(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("deploy")
    assert gp.design(plan.spec, ["csv", "plc", "can"], folder).passed
    return folder


def worst_of(plan, motion, ropes=(0.9, 0.95, 1.0, 1.05, 1.1)):
    """The greatest shortage of hook and load of some ropes, on the way and while they swing on."""
    times = np.linspace(0.0, motion.duration + 15.0, 12001)
    ends = plan.spec.move.start[:2], plan.spec.move.target[:2]
    found = []
    for rope in ropes:
        values = {**plan.spec.plant.parameters, "L0": rope * MACHINE["L0"]}
        for body, places in enumerate(two_masses(motion, values, times)):
            found.append(shortage(places, plan.spec.path.size(body, 2), plan.spec.path, ends))
    return max(found)


def with_spec(plan, spec):
    return attrs.evolve(plan, spec=spec)


class TestMotion:
    @pytest.mark.slow
    def test_no_rope_lets_hook_or_load_nearer_than_the_clearance(self, plan):
        assert worst_of(plan, plan.motion) <= NEARER
        lower = gp.evolve_spec(plan.spec, path={"clearance": [0.3, 0.54]})
        assert worst_of(with_spec(plan, lower), plan.motion) > 0.01  # the equations see what is missing

    @pytest.mark.slow
    @pytest.mark.parametrize("rope", [0.9, 1.0, 1.1])
    def test_no_machine_sways_on(self, plan, rope):
        motion, values = plan.motion, {**MACHINE, "L0": rope * MACHINE["L0"]}
        times = np.linspace(0.0, motion.duration + 15.0, 4001)
        after = times >= motion.duration
        for places in two_masses(motion, values, times):
            apart = places[after, :2] - np.array(plan.spec.move.target[:2])
            assert np.abs(apart).max() <= (1e-4 if rope == 1.0 else 0.05)

    @pytest.mark.slow
    def test_both_axes_are_in_step_and_keep_their_limits(self, plan):
        motion, times = plan.motion, np.linspace(0.0, plan.motion.duration, 20001)
        start, target = np.array(motion.start), np.array(motion.target)
        x, y, _ = (motion.derivative(times, 0) - start).T
        way = target - start
        np.testing.assert_allclose(x * way[1], y * way[0], atol=1e-7)
        for order, name in enumerate(("velocity", "acceleration", "jerk"), start=1):
            allowed = np.array([axis[name] for axis in LIMITS["axis"].values()])
            assert (np.abs(motion.derivative(times, order)).max(axis=0) <= allowed * (1.0 + 1e-6)).all()
        at_end = motion.duration * (1.0 - 1e-12)
        for order, expected in enumerate((target, 0.0, 0.0)):
            np.testing.assert_allclose(motion.derivative([at_end], order)[0], expected, atol=1e-7)
        assert motion.duration < 0.65 * plan.passage.one_by_one

    def test_only_what_the_way_meets_is_in_it(self):
        assert {zone.obstacle for zone in bay_of(hall()).zones} == {0, 1}
        across = hall(path={"stacks": [[8.0, 12.0, 4.0], *BOXES[1:]]})
        assert {zone.obstacle for zone in bay_of(across).zones} == {0, 1}
        along = hall(
            move={"target": [26.0, 2.0, 5.0]}
        )  # past the first by a metre less than it would have to
        assert {zone.obstacle for zone in bay_of(along).zones} == {0, 2}

    @pytest.mark.slow
    @pytest.mark.parametrize(
        "move",
        [
            {"target": [17.5, 10.0, 2.0]},  # set down on the second box
            {"target": [2.0, 11.0, 5.0]},  # along y alone
            {"target": [2.0, 2.0, 3.0]},  # the hoist alone
            {"start": [26.0, 11.0, 5.0], "target": [2.0, 2.0, 6.0]},  # back
        ],
    )
    def test_other_ways(self, move):
        plan = gp.plan(hall(move=move))
        assert worst_of(plan, plan.motion, (0.9, 1.0, 1.1)) <= NEARER

    @pytest.mark.slow
    def test_a_slow_hoist_has_an_answer_as_well(self):
        hoist = {**LIMITS["axis"]["hoist"], "velocity": 0.05}
        spec = hall(limits={"sway": 0.6, "axis": {**LIMITS["axis"], "hoist": hoist}})
        plan = gp.plan(spec)
        assert worst_of(plan, plan.motion, (0.9, 1.1)) <= NEARER
        assert plan.motion.duration <= 1.01 * bay_of(spec).quickest_pass()

    @pytest.mark.slow
    def test_without_robustness(self):
        found = gp.plan(hall(robustness={"method": None, "uncertain": None}))
        assert worst_of(found, found.motion, (1.0,)) <= NEARER

    @pytest.mark.slow
    def test_below_what_is_overhead_beside_the_way(self):
        spec = hall(path={"overhead": [BESIDE], "stacks": [BOXES[1]]})
        plan = gp.plan(spec)
        times, (wide, deep, high) = np.linspace(0.0, plan.motion.duration, 12001), spec.path.size(1, 2)
        west, east, south, north, under = BESIDE
        for rope in (0.9, 1.0, 1.1):
            _, load = two_masses(plan.motion, {**MACHINE, "L0": rope * MACHINE["L0"]}, times)
            x, y, z = load.T
            gaps = [west - x - wide / 2.0, x - wide / 2.0 - east]
            gaps += [south - y - deep / 2.0, y - deep / 2.0 - north]
            below = under - RAIL - (z + high / 2.0) - 0.5
            assert np.maximum(np.maximum.reduce(gaps) - 0.3, below).min() >= -NEARER
        assert worst_of(plan, plan.motion, (0.9, 1.1)) <= NEARER

    @pytest.mark.slow
    def test_a_gantry_without_a_hook(self):
        """Its load is a hook block of the oracle's with next to nothing below it."""
        document, axes = hall().to_dict(), ("bridge", "trolley", "hoist")
        kept = {table: document[table] for table in ("name", "move", "robustness", "export")}
        spec = gp.evolve_spec(
            {
                **kept,
                "plant": {"file": str(EXAMPLES / "hoisting_gantry.py"), "L0": 3.0},
                "path": {**document["path"], "hook": None},
                "limits": {"axis": dict(zip(axes, LIMITS["axis"].values(), strict=True))},
                "check": {"residual_sway": 0.05},
            }
        )
        plan = gp.plan(spec)
        times = np.linspace(0.0, plan.motion.duration + 10.0, 8001)
        for rope in (0.9, 1.0, 1.1):
            values = {"L0": 3.0 * rope, "L2": 1.0, "m1": 5000.0, "m2": 1e-3}
            load, _ = two_masses(plan.motion, values, times)
            ends = spec.move.start[:2], spec.move.target[:2]
            assert shortage(load, spec.path.size(0, 1), spec.path, ends) <= NEARER


class TestCheck:
    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["hall.csv", "hall.st", "hall.log"])
    def test_every_format_holds_three_axes_in_step(self, folder, name):
        judged = gp.check_artefact(folder / name)
        assert judged.passed
        assert -NEARER <= judged.check.nearest.room <= 0.02

    @pytest.mark.slow
    def test_a_higher_box_fails_with_its_place_and_by_how_much(self, folder, plan):
        higher = [BOXES[0], [*BOXES[1][:4], 5.8], BOXES[2]]
        spec = hall(path={"stacks": higher}, move={"duration": plan.motion.duration})
        judged = gp.check_artefact(folder / "hall.csv", spec)
        assert not judged.passed
        (sentence,) = (one for one in judged.check.reasons() if "path.clearance" in one)
        assert "the stack from 16 to 19 m in x and 6 to 14 m in y, 5.8 m high, after" in sentence
        worst = worst_of(with_spec(plan, spec), plan.motion, (0.9, 1.1))
        assert -judged.check.nearest.room == pytest.approx(worst, abs=2e-3)

    @pytest.mark.slow
    @pytest.mark.parametrize("overhead", [[], [BESIDE]])
    def test_the_compiled_loop_finds_the_same_room(self, plan, overhead):
        spec, setpoints = gp.evolve_spec(plan.spec, path={"overhead": overhead}), sample(plan.command, 0.01)
        plant, feed = spec.machine(), Feed(times=setpoints.times, position=setpoints.position)
        machines = [{**spec.plant.parameters, "L0": rope * MACHINE["L0"]} for rope in (0.9, 1.1)]
        rows = parameter_rows(plant, machines)
        with many_machines(plant) as runs:
            peaks = residual_peaks(runs, spec, feed, rows, tau=np.zeros(2), max_step=1e-3, since=1e9)
        with PlantCosimulation(plant) as fmu:
            for values, row, (found, time, _) in zip(machines, rows, peaks[:, -3:], strict=True):
                response = fmu.run(setpoints, values, max_step=1e-3, settle=0.01)
                near = nearest(spec, response.times, body_places(plant, response.q_u, response.position, row))
                assert near.room == pytest.approx(found, abs=1e-6)
                assert near.time == pytest.approx(time, abs=0.011)


class TestRefusals:
    @pytest.mark.parametrize(
        ("tables", "sentence"),
        [
            ({"path": {"stacks": [[12.0, 8.0, 2.0, 9.0, 4.0]]}}, "path.stacks.0: must begin left of where"),
            ({"path": {"stacks": [[8.0, 12.0, 9.0, 2.0, 4.0]]}}, "path.stacks.0: must begin before where"),
            ({"path": {"stacks": [[8.0, 12.0, 9.0, 2.0]]}}, "path.stacks.0: must be three numbers in m"),
            ({"path": {"load": [1.0, 2.0, 3.0, 4.0]}}, "path.load: must be two numbers in m"),
            (
                {"path": {"overhead": [[20.0, 21.0, 10.0]]}},
                "path.overhead.0: ropes would run through it, from 18.9 m on along the straight way of 25.6",
            ),
            ({"path": {"overhead": [[*BESIDE[:2], 5.2, *BESIDE[3:]]]}}, "path.overhead.0: ropes would run"),
            ({"move": {"initial": {"theta1_x": 0.1}}}, "move.initial: a path of two horizontal axes begins"),
            (
                {"move": {"start": [10.0, 5.0, 6.0]}},
                "move.start: the payload is too near to the stack from 8 to 12 m in x and 2 to 9 m in y, 4 m",
            ),
        ],
    )
    def test_they_name_the_place(self, tables, sentence):
        with pytest.raises(gp.SpecError) as refusal:
            hall(**tables)
        assert any(fault.startswith(sentence) for fault in refusal.value.faults), refusal.value.faults

    def test_ropes_run_past_what_is_overhead_beside_the_way_or_behind_its_ends(self):
        beyond = [[0.0, 1.0, 10.0], [28.0, 30.0, 10.0]]
        assert len(hall(path={"overhead": [*beyond, BESIDE]}).path.overhead) == 3

    def test_boxes_are_not_for_one_horizontal_axis(self):
        with pytest.raises(gp.SpecError, match=r"path\.stacks\.0: the machine has one horizontal axis"):
            quay([[20.0, 22.0, 1.0, 2.0, 10.4]])

    @pytest.mark.slow
    def test_too_quick_names_the_box_and_a_time_that_does(self, plan):
        with pytest.raises(gp.InfeasibleProblem) as refusal:
            gp.plan(hall(move={"duration": 0.95 * plan.motion.duration}))
        assert "too near to the stack from" in refusal.value.sentences[0]
        (suggestion,) = refusal.value.suggestions
        assert suggestion.values["move.duration"] == pytest.approx(plan.motion.duration, abs=0.2)


class TestPlanView:
    def test_a_line_is_within_an_area_where_finely_divided_places_are(self):
        random, fine = np.random.default_rng(4), np.linspace(-40.0, 40.0, 80001)
        met = 0
        for _ in range(60):
            line = StraightWay.between(random.uniform(-5.0, 5.0, 2), random.uniform(-5.0, 5.0, 2))
            (a, b), (c, d) = np.sort(random.uniform(-8.0, 8.0, (2, 2)), axis=1)
            area = Area((a, b)) if random.uniform() < 0.3 else Area((a, b), (c, d))
            places = np.array(line.origin) + fine[:, None] * np.array(line.way)
            inside = fine[area.outside(*places.T) < 0.0]
            span = line.span(area)
            assert (span is None) == (not len(inside))
            if span is not None:
                met += 1
                assert np.clip(span, -40.0, 40.0) == pytest.approx(inside[[0, -1]], abs=2e-3)
        assert 20 < met < 60

    def test_a_line_along_an_axis_may_be_beside_an_area(self):
        line = StraightWay.between((0.0, 3.0), (10.0, 3.0))
        assert line.span(Area((2.0, 4.0), (0.0, 3.0))) is None  # at its edge
        assert line.span(Area((2.0, 4.0), (0.0, 3.1))) == (2.0, 4.0)

    @pytest.mark.slow
    def test_pictures_are_from_the_side_and_from_above(self, plan):
        side, above = path_figure(plan.spec, plan.evaluation).panels
        lines = {str(line.name): line for line in side.lines}
        swept, dashed = lines["swept by the payload"], lines["clearance"]
        half = len(swept.x) // 2
        over = (swept.x[:half] > dashed.x[0]) & (swept.x[:half] < dashed.x[-1])
        heights = [dashed.y[np.searchsorted(dashed.x, place) - 1] for place in swept.x[:half][over]]
        assert (swept.y[:half][over] >= np.array(heights) - 0.02).all()
        assert sum(str(line.name) == "stacks" for line in above.lines) == 3
        (covered,) = (line for line in above.lines if str(line.name) == "swept by the payload")
        assert (np.nanmin(covered.x), np.nanmax(covered.y)) == pytest.approx((1.0, 11.75), abs=0.2)

    def test_a_box_is_seen_where_the_load_meets_it(self):
        spec, line = hall(), StraightWay.between((2.0, 4.0), (26.0, 4.0))  # along x it is seen as it is
        assert standing_on(spec.path, line)[0] == pytest.approx((6.0, 10.0, 4.0))
        assert set(standing_on(spec.path, line)) == {0}

    @pytest.mark.slow
    def test_the_studio_knows_where_to_move_a_box(self, plan):
        (panel, _), way = path_figure(plan.spec, plan.evaluation).panels, np.array([24.0, 9.0])
        found = side_json(plan.spec, np.zeros((1, 2, 2, 3)))
        assert found["way"] == pytest.approx(way / np.hypot(*way))
        assert [one["number"] for one in found["stacks"]] == [0, 1]
        assert list(found["stacks"][1]["row"]) == BOXES[1]
        assert panel.title == found["title"]
