"""Wrappers on a vendor's axes: they play, and notice when an axis does not go along."""

import re

import numpy as np
import pytest
from motions import quintic, target
from vendor_axes import VENDORS, PlaybackBench

from gen_profile.motion.profile import sample
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.playback.structured_text import block_text
from gen_profile_exporters.vendors import codesys, siemens_scl, twincat

CYCLE = 0.02
ONE, TWO = quintic((0.1, 0.4)), quintic((0.1, 0.4), (1.2, -0.7))
STARTS = [0.1, 1.2]
ERROR, OFF, WORK, AWAY = 20, 21, 22, 23


def bench_of(vendor, move=ONE):
    goal = target(*("bridge", "trolley")[: move.axes], cycle_time=CYCLE)
    return PlaybackBench(VENDORS[vendor], parse_function_block(block_text(move, goal)), STARTS[: move.axes])


def under_way(vendor, move=ONE, cycles=20):
    """A bench in the midst of the motion."""
    bench = bench_of(vendor, move)
    for _ in range(cycles):
        assert bench.cycle(bExecute=True)["bbusy"]
    assert np.ptp(bench.commanded, axis=0).min() > 0.01
    return bench


def steps(bench):
    """Greatest step of the setpoints from cycle to cycle, per axis."""
    return np.abs(np.diff(bench.commanded, axis=0)).max(axis=0)


# What happens to an axis, and the errors that tell it; a block may notice before its axis's state does.
MISHAPS = {
    "in error": (lambda bench: bench.put(bench.axes[-1], bench.vendor.error), {ERROR}),
    "without power": (lambda bench: bench.put(bench.axes[-1], bench.vendor.off), {OFF}),
    "taken by another": (lambda bench: bench.axes[-1].call(bAway=True), {AWAY}),
}


@pytest.fixture(params=VENDORS)
def vendor(request):
    return request.param


@pytest.mark.parametrize("move", [ONE, TWO], ids=["one", "two"])
def test_a_healthy_axis_gets_every_setpoint_and_is_let_go_at_the_end(vendor, move):
    bench = bench_of(vendor, move)
    outputs = bench.until(lambda row: row["bdone"], bExecute=True)
    assert not outputs["bbusy"] and outputs["nerrorid"] == 0
    np.testing.assert_allclose(bench.commanded[-1], move.target, rtol=0, atol=1e-12)
    path = sample(move, CYCLE).position
    begin = next(k for k, row in enumerate(bench.commanded) if row != bench.commanded[0]) - 1
    np.testing.assert_allclose(bench.commanded[begin : begin + 51], path, rtol=0, atol=1e-9)
    for _ in range(5):
        assert bench.cycle(bExecute=True)["bdone"]
    outputs = bench.until(lambda row: not row["bdone"], bExecute=False)
    assert not outputs["berror"]
    for axis in bench.axes:  # another block may have it now
        axis.call(bAway=True)
    for _ in range(10):
        outputs = bench.cycle(bExecute=False)
    assert not outputs["bbusy"] and not outputs["berror"]


def test_a_pulse_is_enough_and_another_motion_can_follow(vendor):
    bench = bench_of(vendor)
    bench.cycle(bExecute=True)
    bench.until(lambda row: row["bdone"], bExecute=False)
    for _ in range(10):
        bench.cycle(bExecute=False)
    back = {"bMirror": True, "fStartOffset": 0.3}
    bench.until(lambda row: row["bdone"], bExecute=True, **back)
    np.testing.assert_allclose(bench.commanded[-1], 0.1, rtol=0, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("move", [ONE, TWO], ids=["one", "two"])
@pytest.mark.parametrize("mishap", MISHAPS)
def test_a_mishap_on_the_way_is_told_and_never_followed_by_a_jump(vendor, mishap, move):
    happen, due = MISHAPS[mishap]
    bench = under_way(vendor, move)
    fastest = steps(bench)
    happen(bench)
    outputs = bench.cycle(bExecute=True)
    assert outputs["berror"] and outputs["nerrorid"] in due
    stood = bench.commanded[-1][-1]
    outputs = bench.until(lambda row: not row["bbusy"], bExecute=True)
    assert outputs["berror"] and not outputs["bdone"]
    # The lost axis is commanded no more; the others stopped where the motion leads.
    assert bench.commanded[-1][-1] == stood
    assert (steps(bench) <= fastest.max() * 1.6).all()
    for _ in range(50):
        assert bench.cycle(bExecute=True)["nerrorid"] in due
    assert bench.commanded[-1] == bench.commanded[-50]

    # All is well again: nothing moves before another edge, and then the start is checked.
    for axis in bench.axes:
        bench.put(axis, bench.vendor.fit)
        axis.call(bAway=False)
    for _ in range(20):
        assert bench.cycle(bExecute=True)["berror"]
    assert not bench.cycle(bExecute=False)["berror"]
    outputs = bench.until(lambda row: not row["bbusy"], bExecute=True)
    assert (outputs["berror"], outputs["nerrorid"]) == (True, 2)
    assert bench.commanded[-1] == bench.commanded[-50]

    # Brought back to the start, it plays.
    bench.cycle(bExecute=False)
    bench.bring(STARTS)
    bench.until(lambda row: row["bdone"], bExecute=True)
    np.testing.assert_allclose(bench.commanded[-1], move.target, rtol=0, atol=1e-12)


def test_another_edge_while_the_others_still_stop_waits_for_them(vendor):
    bench = under_way(vendor, TWO, cycles=28)
    bench.put(bench.axes[1], bench.vendor.error)
    bench.cycle(bExecute=True)
    bench.put(bench.axes[1], bench.vendor.fit)
    stood = bench.commanded[-1][1]
    assert bench.cycle(bExecute=False)["bbusy"]
    outputs = bench.until(lambda row: row["berror"], bExecute=True)
    assert outputs["nerrorid"] == 2
    assert bench.commanded[-1][1] == stood
    assert bench.commanded[-1][0] != pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("mishap", MISHAPS)
def test_an_axis_that_cannot_be_taken_is_an_error_at_once(vendor, mishap):
    """TwinCAT's Enable fails, too; what follows the axis is commanded nothing."""
    happen, due = MISHAPS[mishap]
    bench = bench_of(vendor)
    happen(bench)
    outputs = bench.until(lambda row: row["berror"], most=3, bExecute=True)
    assert outputs["nerrorid"] in due | {WORK}
    outputs = bench.until(lambda row: not row["bbusy"], most=3, bExecute=True)
    assert outputs["berror"] and bench.commanded[-1] == bench.commanded[0]


def test_an_axis_is_taken_where_it_stands_and_let_go_if_the_start_is_refused(vendor):
    bench = bench_of(vendor)
    bench.bring([7.0])
    bench.commanded = []
    outputs = bench.until(lambda row: row["berror"], bExecute=True)
    assert (outputs["bbusy"], outputs["nerrorid"]) == (False, 2)
    assert {row[0] for row in bench.commanded} == {7.0}
    bench.axes[0].call(bAway=True)
    for _ in range(5):
        assert bench.cycle(bExecute=True)["nerrorid"] == 2


def test_an_axis_that_is_not_where_it_is_told_to_be_is_not_started(vendor):
    bench = bench_of(vendor)
    bench.part(bench.axes[0]).call(**{bench.vendor.actual: 0.15})
    outputs = bench.cycle(bExecute=True)
    assert (outputs["berror"], outputs["nerrorid"]) == (True, 2)


def test_abort_stops_and_holds_and_at_the_start_is_refused(vendor):
    bench = under_way(vendor)
    outputs = bench.until(lambda row: not row["bbusy"], bExecute=True, bAbort=True)
    for _ in range(5):
        assert outputs["baborted"] and not outputs["berror"]
        stood, outputs = bench.commanded[-1], bench.cycle(bExecute=True, bAbort=True)
    assert bench.commanded[-1] == stood
    bench.cycle(bExecute=False)
    bench.bring(STARTS)
    outputs = bench.until(lambda row: not row["bbusy"], bExecute=True, bAbort=True)
    assert (outputs["berror"], outputs["nerrorid"]) == (True, 4)


def test_the_way_that_is_left_is_played_on_while_held_and_after_it_was_let_go(vendor):
    for release in (False, True):
        bench = under_way(vendor)
        bench.until(lambda row: row["baborted"], bExecute=True, bAbort=True)
        if release:
            for _ in range(10):
                outputs = bench.cycle(bExecute=False, bAbort=False)
            assert not outputs["baborted"]
        stood = bench.commanded[-1][0]
        outputs = bench.until(lambda row: not row["bbusy"], bAbort=False, bContinue=True)
        assert outputs["bdone"], outputs
        assert 0.12 < stood < 0.39 and bench.commanded[-1][0] == pytest.approx(0.4, abs=1e-12)
        assert steps(bench) < 0.013  # 0.5625 m/s for a cycle


def test_the_way_that_is_left_is_not_played_on_from_elsewhere(vendor):
    bench = under_way(vendor)
    bench.put(bench.axes[0], bench.vendor.error)
    bench.until(lambda row: not row["bbusy"], bExecute=True)
    bench.put(bench.axes[0], bench.vendor.fit)
    bench.bring([0.15])
    count = len(bench.commanded)
    outputs = bench.until(lambda row: not row["bbusy"], bExecute=False, bContinue=True)
    assert (outputs["berror"], outputs["nerrorid"]) == (True, 2)
    assert {row[0] for row in bench.commanded[count:]} == {0.15}


def test_a_block_that_ends_without_telling_an_error_is_noticed():
    bench = under_way("codesys")
    bench.wrapper["fbFollow"].call(Axis=bench.axes[0], bAbort=True)
    assert bench.cycle(bExecute=True)["nerrorid"] == WORK


@pytest.mark.parametrize("move", [ONE, TWO], ids=["one", "two"])
def test_the_containers_carry_these_very_statements(move):
    """What was run above is what is exported; SCL marks names."""
    goal = target(*("bridge", "trolley")[: move.axes], cycle_time=CYCLE)
    source = parse_function_block(block_text(move, goal))
    texts = {
        "twincat": twincat.encode(move, goal)[1].content.decode(),
        "codesys": codesys.encode(move, goal)[0].content.decode().replace("&lt;", "<").replace("&gt;", ">"),
        "siemens": re.sub("#", "", siemens_scl.encode(move, goal)[0].content.decode()),
    }
    for name, text in texts.items():
        wrapper = PlaybackBench(VENDORS[name], source, STARTS[: move.axes]).source
        assert wrapper.body.strip() in text
