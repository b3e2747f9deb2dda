"""The side view of a path over stacks, against places that are finely divided."""

import numpy as np
import pytest
from generator.quay import HEIGHT, RAIL, ROPE, STACKS, WIDTH, followed, quay

import gen_profile as gp
from gen_profile.presentation.charts.side_view import path_figure, skyline, standing_on, swept
from gen_profile.spec.plan_view import StraightWay

FINE = np.linspace(0.0, 1.0, 20001)


def test_what_boxes_sweep_is_what_finely_divided_ways_cover():
    t = np.linspace(0.0, 1.0, 60)
    ways = np.stack(
        [np.stack([30.0 * t - 9.0 * t**2 + k, 10.0 * np.sin(4.0 * t) + k], 1) for k in (0.0, 0.4)]
    )
    x, z = swept(ways, (2.5, 2.6))
    columns = len(x) // 2
    xs, zs = (np.concatenate([np.interp(FINE, t, way[:, axis]) for way in ways]) for axis in (0, 1))
    for place, low, high in zip(x[1 : columns - 1], z[1:], z[::-1][1:], strict=False):
        covered = zs[np.abs(xs - place) <= 1.25]
        assert low == pytest.approx(covered.min() - 1.3, abs=5e-3)
        assert high == pytest.approx(covered.max() + 1.3, abs=5e-3)


def test_a_box_that_goes_straight_up_sweeps_its_own_width():
    x, z = swept(np.array([[[2.0, 1.0], [2.0, 4.0]]]), (1.0, 0.6))
    assert (x.min(), x.max()) == pytest.approx((1.5, 2.5))
    assert (z.min(), z.max()) == pytest.approx((0.7, 4.3))


def test_the_skyline_is_the_highest_stack_with_its_clearance():
    path = quay().path
    x, z = skyline([*standing_on(path, StraightWay(), path.clearances).values()], 0.0)
    assert np.all(np.diff(x) >= 0.0)
    for place in np.linspace(15.0, 40.0, 211):
        heights = [top + 1.0 for low, high, top in STACKS if low - 0.5 <= place <= high + 0.5]
        between = z[np.searchsorted(x, place) - 1] if x[0] < place < x[-1] else 0.0
        assert between == pytest.approx(max(heights, default=0.0))


@pytest.mark.slow
def test_the_picture_has_the_load_of_every_machine():
    plan = gp.plan(quay())
    (panel,) = path_figure(plan.spec, plan.evaluation).panels
    lines = {str(line.name): line for line in panel.lines}
    x, z = lines["swept by the payload"].x, lines["swept by the payload"].y
    low = dict(zip(x[: len(x) // 2], z, strict=False))
    high = dict(zip(x[len(x) // 2 :], z[len(x) // 2 :], strict=True))
    times = np.linspace(0.0, plan.motion.duration, 4001)
    lowest, highest = np.inf, -np.inf
    middle = min(low, key=lambda place: abs(place - 26.0))
    for rope in (0.9, 1.0, 1.1):
        places, heights, _ = followed(plan.motion, rope * ROPE, times)
        there = heights[np.abs(places - middle) <= WIDTH / 2.0] + RAIL
        lowest, highest = min(lowest, there.min() - HEIGHT / 2.0), max(highest, there.max() + HEIGHT / 2.0)
    assert low[middle] == pytest.approx(lowest, abs=0.02)
    assert high[middle] == pytest.approx(highest, abs=0.02)
    assert panel.even and lines["clearance"].y.max() == 18.2 + 1.0
