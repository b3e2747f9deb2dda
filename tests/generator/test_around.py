"""Ways in plan view around what the hoist cannot lift loads over, against two masses on rods in space."""

from itertools import pairwise

import attrs
import numpy as np
import pytest
from generator.hall import BOXES, LIMITS, MACHINE, hall, shortage, two_masses

import gen_profile as gp
from gen_profile.methods.solvers.over_stacks.around import route_around, way_of
from gen_profile.methods.solvers.over_stacks.guide import blocks, guide_along, parting
from gen_profile.methods.solvers.over_stacks.plan import sketched
from gen_profile.methods.solvers.over_stacks.program import resting
from gen_profile.methods.solvers.over_stacks.searches import StackSearch, stretched, with_others
from gen_profile.methods.solvers.over_stacks.swing import followed as swing
from gen_profile.presentation.charts.side_view import gone_around, path_figure
from gen_profile.presentation.studio.curves_json import side_json
from gen_profile.spec.plan_view import Area

NEARER = 5e-4  # m, by which no machine may come nearer to a stack than the clearance
WALL = [12.0, 14.0, 0.0, 8.0, 11.0]  # the hoist lifts no load over it
NO_RANGES = {"method": None, "uncertain": None}
EVERYWHERE = [(-100.0, 100.0), (-100.0, 100.0)]


def past_a_wall(**tables):
    path = {"stacks": [WALL, [20.0, 22.0, 0.0, 15.0, 3.5]]}
    move = {"start": [2.0, 4.0, 6.0], "target": [26.0, 5.0, 5.0]}
    return hall(**{"path": path, "move": move, "robustness": NO_RANGES, **tables})


@pytest.fixture(scope="module")
def plan():
    return gp.plan(past_a_wall())


def worst_of(plan, ropes):
    times = np.linspace(0.0, plan.motion.duration + 15.0, 12001)
    ends = plan.spec.move.start[:2], plan.spec.move.target[:2]
    found = []
    for rope in ropes:
        bodies = two_masses(plan.motion, {**MACHINE, "L0": rope * MACHINE["L0"]}, times)
        found += [
            shortage(at, plan.spec.path.size(k, 2), plan.spec.path, ends) for k, at in enumerate(bodies)
        ]
    return max(found)


class TestRoute:
    def test_it_leads_past_the_nearer_corner(self):
        wall = Area((4.0, 6.0), (-1.0, 3.0))
        ways = [((0.0, 0.0), (10.0, 0.0)), ((0.0, 2.5), (10.0, 2.0))]
        for (start, target), across in zip(ways, (-1.0, 3.0), strict=True):
            route = route_around([wall], start, target, (1.0, 1.0), EVERYWHERE)
            assert route == (start, (4.0, across), (6.0, across), target)

    def test_travel_decides_on_which_side(self):
        wall = Area((4.0, 6.0), (-1.0, 3.0))
        route = route_around([wall], (0.0, 0.0), (10.0, 0.0), (1.0, 1.0), [(-1.0, 11.0), (0.0, 5.0)])
        assert [y for _, y in route] == [0.0, 3.0, 3.0, 0.0]
        assert route_around([wall], (0.0, 0.0), (10.0, 0.0), (1.0, 1.0), [(-1.0, 11.0), (0.0, 2.0)]) is None

    def test_no_leg_of_a_random_one_leads_through_an_area(self):
        random, legs = np.random.default_rng(3), 0
        for _ in range(40):
            corners = random.uniform(2.0, 16.0, (6, 2))
            areas = [Area((x, x + 2.0), (y, y + 3.0)) for x, y in corners]
            route = route_around(areas, (0.0, 8.0), (20.0, 9.0), (1.0, 0.5), EVERYWHERE)
            legs += len(route) - 1
            for start, target in pairwise(route):
                for share in np.linspace(0.0, 1.0, 200):
                    place = np.array(start) * (1.0 - share) + np.array(target) * share
                    assert max(-float(area.outside(*place)) for area in areas) < 1e-9
        assert legs > 100

    def test_an_edge_is_no_way_through(self):
        area = Area((4.0, 6.0), (-1.0, 3.0))
        assert not blocks(area, (0.0, 3.0), (10.0, 3.0))
        assert blocks(area, (0.0, 2.9), (10.0, 2.9))
        assert not blocks(area, (0.0, 0.0), (3.0, 0.0))


class TestLines:
    @pytest.mark.parametrize("area", [Area((4.0, 6.0), (-1.0, 3.0)), Area((4.0, 6.0))])
    def test_what_is_beyond_one_is_outside(self, area):
        outward, level = parting(area)
        places = np.random.default_rng(1).uniform(-5.0, 12.0, (4000, 2))
        beyond = (places @ outward.T - level).max(axis=1)
        outside = area.outside(*places.T)
        assert (outside[beyond >= 0.0] >= 0.0).all()
        assert (beyond[outside >= 0.0] >= -1e-12).all()

    def test_they_turn_with_the_load_and_allow_for_its_being_late(self):
        area, route = Area((4.0, 6.0), (-1.0, 3.0)), ((0.0, 0.0), (4.0, 3.0), (6.0, 3.0), (10.0, 0.0))
        guide = guide_along(route, [2.0, 1.0, 2.0], 1, 0.02)
        normals, most = guide.lines(area, 0, 1.0, 0.0)
        beyond = (normals * guide.places[:, 0]).sum(axis=1) - most
        assert beyond.max() <= 0.05
        assert normals[0][0] > 0.5 and normals[200] == pytest.approx((0.0, -1.0)) and normals[-1][0] < -0.5

    def test_a_body_that_is_lifted_over_keeps_the_side_it_comes_from(self):
        area = Area((4.0, 6.0), (-9.0, 9.0))
        guide = guide_along(((0.0, 0.0), (10.0, 0.0)), [1.0], 1, 0.05)
        normals, _ = guide.lines(area, 0, 0.4, 0.6)
        assert normals[:200] == pytest.approx(np.tile((1.0, 0.0), (200, 1)))
        assert normals[-200:] == pytest.approx(np.tile((-1.0, 0.0), (200, 1)))


@pytest.mark.slow
class TestMotion:
    def test_hook_and_load_keep_the_clearance(self, plan):
        assert worst_of(plan, (1.0,)) <= NEARER
        assert plan.passage.nearest.room >= -NEARER

    def test_it_passes_corners_without_stopping(self, plan):
        assert plan.motion.duration < 0.7 * plan.passage.one_by_one
        times = np.linspace(0.0, plan.motion.duration, 4001)
        x, y, _ = plan.motion.derivative(times, 0).T
        fast = np.hypot(*plan.motion.derivative(times, 1)[:, :2].T)
        past = (x > 9.0) & (x < 17.0)
        assert fast[past].min() > 0.8
        assert y[past].max() > 8.5  # beside the wall, whose end is at 8 m

    def test_limits_and_ends(self, plan):
        motion, limits = plan.motion, plan.spec.limits
        times = np.linspace(0.0, motion.duration, 20001)
        for order, name in enumerate(("velocity", "acceleration", "jerk"), start=1):
            allowed = np.array([getattr(limits.of(axis), name) for axis in range(3)])
            assert (np.abs(motion.derivative(times, order)).max(axis=0) <= allowed * (1.0 + 1e-6)).all()
        at_end = motion.duration * (1.0 - 1e-12)
        for order, expected in enumerate((plan.spec.move.target, 0.0, 0.0)):
            np.testing.assert_allclose(motion.derivative([at_end], order)[0], expected, atol=1e-7)
        bodies = two_masses(motion, MACHINE, np.linspace(0.0, motion.duration + 15.0, 8001))
        x, y, _ = motion.derivative(np.minimum(np.linspace(0.0, motion.duration + 15.0, 8001), at_end), 0).T
        sway = np.hypot(bodies[1][:, 0] - x, bodies[1][:, 1] - y)
        assert sway.max() <= 1.005 * limits.sway
        assert sway[-3000:].max() <= 1e-4

    def test_pictures_and_the_sketch_show_what_is_gone_around(self, plan):
        side, above = path_figure(plan.spec, plan.evaluation).panels
        (wall,) = (line for line in side.lines if str(line.name) == "gone around")
        assert wall.y.max() == WALL[-1]
        assert max(line.y.max() for line in side.lines if str(line.name) == "stacks") == 3.5
        (swept,) = (line for line in above.lines if str(line.name) == "swept by the payload")
        points = np.stack([swept.x, swept.y], axis=1)
        gaps = np.flatnonzero(np.isnan(swept.x))
        hulls = [points[first + 1 : last] for first, last in pairwise([-1, *gaps])]
        assert len(hulls) > 10
        for hull in hulls:  # of parts do not cover the wall, as one hull of all would
            assert Area(tuple(WALL[:2]), tuple(WALL[2:4])).outside(*hull.mean(axis=0)) > 0.5
            x, y = hull.T
            turning = x * np.roll(y, -1) - y * np.roll(x, -1)
            assert turning.sum() > 0.0  # all alike, so they are one shape
        places = sketched(plan.spec)
        assert gone_around(plan.spec, places[None]) == {0}
        assert [one["number"] for one in side_json(plan.spec, places[None])["stacks"]] == [0, 1]

    def test_no_rope_of_the_range_comes_nearer(self):
        spec = hall(path={"stacks": [BOXES[0], [*BOXES[1][:4], 9.0]]})
        plan = gp.plan(spec)
        assert worst_of(plan, (0.9, 0.95, 1.0, 1.05, 1.1)) <= NEARER
        times = np.linspace(plan.motion.duration, plan.motion.duration + 15.0, 1001)
        for rope in (0.9, 1.1):
            whole = np.concatenate([np.linspace(0.0, times[0], 4000, endpoint=False), times])
            _, load = two_masses(plan.motion, {**MACHINE, "L0": rope * MACHINE["L0"]}, whole)
            assert np.abs(load[-1001:, :2] - np.array(spec.move.target[:2])).max() <= 0.05

    def test_more_time_is_used_for_less_jerk(self, plan):
        longer = gp.plan(
            past_a_wall(move={"start": [2.0, 4.0, 6.0], "target": [26.0, 5.0, 5.0], "duration": 40.0})
        )
        assert worst_of(longer, (1.0,)) <= NEARER
        jerks = []
        for one in (longer, plan):
            times = np.linspace(0.0, one.motion.duration, 5001)
            jerks.append(np.square(one.motion.derivative(times, 3)[:, :2]).mean())
        assert jerks[0] < 0.5 * jerks[1]


def test_derivatives_of_what_machines_do_are_those_of_differences():
    """But for a hundredth, as those in the middle of a step are taken once."""
    bay, random = way_of(past_a_wall()), np.random.default_rng(2)
    up = bay.lifted(20.0, bay.top)
    hoist = np.array([6.0, 0.0, 0.0]) - up.at(np.linspace(8.0, 8.4, 17))[:, :3]
    node = np.concatenate([random.normal(size=6), random.normal(size=bay.nominal.states - 6) * 0.05])
    jerk, size = random.normal(size=2), 1e-5

    def end(change):
        moved = change[: len(node)] + node, change[len(node) :] + jerk
        return swing(
            bay.nominal,
            moved[0][None, None],
            bay.machines[:1],
            jerks=moved[1][None],
            hoist=hoist[None],
            step=0.05,
        )

    slopes = end(np.zeros(len(node) + 2))
    columns = np.eye(len(node) + 2) * size
    for known, along in (("states", slopes.along), ("seen", slopes.seen_along)):
        both = [[getattr(end(sign * one), known)[0, 0, -1] for sign in (1.0, -1.0)] for one in columns]
        differences = np.array([(more - less) / (2.0 * size) for more, less in both]).T
        scale = 1.0 + np.abs(differences).max(axis=1, keepdims=True)
        assert (np.abs(along[0, 0, -1] - differences) <= 1e-2 * scale).all()


def test_lines_that_turned_with_a_worse_course_turn_back(monkeypatch):
    search = StackSearch(bay=way_of(past_a_wall()))
    bay = search.bay
    course = attrs.evolve(resting(bay, bay.lifted(20.0, bay.top)), room=-1.0, miss=2.0)
    monkeypatch.setattr(StackSearch, "solved", lambda *_: attrs.evolve(course, room=-0.5, miss=3.0))
    assert search.in_turns(course) is course
    assert search.bay is bay


@pytest.mark.parametrize("uncertain", [{}, {"L0": 0.1}])
def test_machines_follow_a_course_that_was_shortened_at_the_same_instants(uncertain):
    method = "sensitivity" if uncertain else None
    bay = way_of(past_a_wall(robustness={"method": method, "uncertain": uncertain or None}))
    shortened = stretched(resting(bay.alone(), bay.lifted(60.0, bay.top)), bay.lifted(20.0, bay.top))
    nominal, others = with_others(bay, shortened).nodes
    assert others.shape == (len(bay.machines) - 1, len(nominal), bay.others.states)


class TestRefusals:
    def test_a_wall_across_the_hall_names_itself(self):
        with pytest.raises(gp.InfeasibleProblem, match=r"12 to 14 m in x .* the travel leaves no way around"):
            gp.plan(past_a_wall(path={"stacks": [[12.0, 14.0, 0.0, 15.0, 11.0]]}))

    @pytest.mark.slow
    @pytest.mark.parametrize("share", [0.5, 0.9])
    def test_too_short_names_the_wall_and_a_time_that_does(self, plan, share):
        move = {**plan.spec.to_dict()["move"], "duration": share * plan.motion.duration}
        with pytest.raises(
            gp.InfeasibleProblem, match=r"the stack from 12 to 14 m in x and 0 to 8 m"
        ) as refusal:
            gp.plan(past_a_wall(move=move))
        (suggestion,) = refusal.value.suggestions
        assert suggestion.values["move.duration"] == pytest.approx(plan.motion.duration, abs=0.3)

    @pytest.mark.slow
    def test_too_short_through_a_slot_with_all_machines_names_a_time_that_does(self):
        """It has the time to try it, and all heights of the hoist before."""
        slot = [[8.17, 10.29, 0.0, 4.92, 11.0], [8.17, 10.29, 8.67, 15.0, 11.0]]
        boxes = [[12.59, 14.89, 6.02, 9.71, 4.48], [18.79, 21.84, 3.52, 6.27, 2.9]]
        move = {"start": [29.2, 10.01, 3.75], "target": [2.25, 10.96, 4.28], "duration": 24.99}
        with pytest.raises(gp.InfeasibleProblem, match=r"around the stack from 8\.17 to") as refusal:
            gp.plan(hall(path={"stacks": [*slot, *boxes]}, move=move))
        (suggestion,) = refusal.value.suggestions
        assert suggestion.values["move.duration"] == pytest.approx(26.35, abs=0.15)

    @pytest.mark.slow
    def test_too_short_for_a_slow_hoist_names_a_time_that_does(self):
        axes = LIMITS["axis"]
        limits = {"sway": 0.6, "axis": {**axes, "hoist": {**axes["hoist"], "velocity": 0.05}}}
        move = {"start": [2.0, 4.0, 6.0], "target": [26.0, 5.0, 5.0], "duration": 44.3}
        with pytest.raises(gp.InfeasibleProblem, match="the stack from 20 to 22 m") as refusal:
            gp.plan(past_a_wall(limits=limits, move=move))
        (suggestion,) = refusal.value.suggestions
        assert suggestion.values["move.duration"] == pytest.approx(63.4, abs=0.3)

    def test_too_short_where_nothing_is_in_the_way_says_so(self):
        with pytest.raises(gp.InfeasibleProblem, match=r"stays 1\d\.\d m away from its target\. It can"):
            gp.plan(
                hall(
                    path={"stacks": [[4.0, 6.0, 12.0, 14.0, 3.0]]},
                    move={"duration": 13.0},
                    robustness=NO_RANGES,
                )
            )
