"""Axes that stand off the first setpoint are led to it; what was sent is judged by its differences."""

import struct

import numpy as np
import pytest
from exporters.can.bench import MS, Bench
from motions import quintic

from gen_profile_exporters.can.streaming.record import Phase

PERIOD = 0.004


def approached(bench, node):
    """Setpoints up to the beginning of the motion's own, which is the first that is held after the way."""
    sent = [struct.unpack("<i", frame.data)[0] for frame in bench.of(0x300 + node)]
    return np.array(sent[: len(sent) - len(bench.plan.cycles)])


def greatest(position, order):
    return np.abs(np.diff(position.astype(float), order)).max() / PERIOD**order


@pytest.mark.slow
@pytest.mark.parametrize("stand", [100_900, 99_100, 100_001])
@pytest.mark.parametrize("mode", ["csp", "ip"])
def test_it_goes_there_at_a_tenth_of_the_motions_speed(stand, mode):
    with Bench(stand=[stand], mode=mode) as bench:
        record = bench.run()
    assert (record.phase, record.final) == (Phase.DONE, (400_000,))
    assert bench.phases[2:5] == ["enable", "approach", "stream"]
    sent, motion = approached(bench, 1), bench.plan.motion.position[:, 0]
    begin = np.flatnonzero(sent != stand)[0]
    end = begin + np.flatnonzero(sent[begin:] == 100_000)[0]
    way = sent[begin - 1 : end + 3]
    assert (sent[:begin] == stand).all()
    assert (np.diff(way) * np.sign(100_000 - stand) >= 0).all()
    assert greatest(way, 1) <= 0.1 * greatest(motion, 1) + 1 / PERIOD  # a count of rounding
    assert greatest(way, 2) <= 0.1 * greatest(motion, 2) + 2 / PERIOD**2


def test_velocities_lead_there_too():
    options = {"mode": "csv", "following_error": 0.0005}
    with Bench(stand=[900], profile=quintic((0.0, 0.3)), **options) as bench:
        record = bench.run()
    assert (record.phase, record.reason) == (Phase.DONE, "")
    assert record.final == pytest.approx((300_000,), abs=2)
    np.testing.assert_allclose(record.actual, bench.plan.motion.at_sync, atol=2)


def test_an_axis_that_the_motion_leaves_at_rest_creeps():
    profile = quintic((0.1, 0.4), (0.5, 0.5))
    with Bench("bridge", "trolley", profile=profile, stand=[100_000, 500_500], step=MS) as bench:
        record = bench.run()
    assert record.final == (400_000, 500_000)
    way = approached(bench, 2)
    assert 0 < np.abs(np.diff(way)).max() <= 4 + 1  # 1 mm/s
    assert (approached(bench, 1) == 100_000).sum() > 100


def test_a_stop_on_the_way_there():
    with Bench(stand=[100_900]) as bench:

        def look():
            if "approach" in bench.phases and bench.drive.actual < 100_600:
                bench.streamer.ask_to_stop("Interrupted.")

        bench.clock.actors.append(look)
        record = bench.run()
    assert record.reason == "Interrupted. The axes were stopped."
    assert 100_500 < bench.drive.actual < 100_600


def test_who_stands_there_goes_nowhere():
    with Bench() as bench:
        bench.run()
    assert "approach" not in bench.phases
