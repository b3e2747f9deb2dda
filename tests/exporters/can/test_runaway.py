"""An axis that goes elsewhere than it is led, and says so truly: the streamer stops it, in every mode."""

import attrs
import pytest
from exporters.can.bench import MS, QUICK_STOP, Bench, RigidLoad
from exporters.motions import quintic, target

from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.export.exporter import encode
from gen_profile_exporters.can.following_window import windows
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.plan import plan_of
from gen_profile_exporters.can.streaming.record import Phase
from gen_profile_exporters.exporter import target_of

MOVE = quintic((0.0, 0.3), duration=3.0)
FASTEST = 15 / 8 * 0.1  # m/s, of that quintic
RUNAWAY = 0.3  # m/s
PERIOD = 0.004  # s
WINDOW = 1.5 * FASTEST * (0.03 + 2 * PERIOD) + 0.001  # m, as docs/can.md has it where nothing is stated
NEVER = 1 << 30  # counts, of a drive that stops nothing by itself


def run_away(bench, drive=0):
    bench.drives.drives[drive].runaway = 1e6 * RUNAWAY


def blind(bench):
    """Have the drive's own window stop nothing, once it was read."""
    bench.drive.store(0x6065, 0, NEVER)
    bench.drive._values.pop((0x6065, 0), None)


def assert_stopped(bench, record, window):
    """Stopped by the streamer, as soon as the axis was off by the window."""
    assert record.phase is Phase.ABORTED
    assert "off the motion, more than can.following_error" in record.reason
    assert record.reason.endswith("The axes were stopped.")
    stop = next(frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP)
    slowest = window / (RUNAWAY - FASTEST) + 3 * PERIOD
    assert stop - bench.fault_at <= 1e3 * slowest
    assert bench.drive.state is State.SWITCH_ON_DISABLED


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "window"),
    [
        ({}, WINDOW),
        ({"following_error": 0.005}, 0.005),
        ({"mode": "ip"}, WINDOW),
        ({"mode": "ip", "following_error": 0.005}, 0.005),
        ({"mode": "csv", "following_error": 0.005}, 0.005),
    ],
)
def test_it_is_stopped_within_the_window(options, window):
    with Bench(profile=MOVE, **options) as bench:
        bench.at_cycle(100, lambda: (blind(bench), run_away(bench)))
        assert_stopped(bench, bench.run(), window)


@pytest.mark.parametrize("mode", ["csp", "csv"])
def test_answers_that_come_just_before_the_next_cycle_count(mode):
    """They are never there yet when the cycle after them is judged."""
    with Bench(profile=MOVE, mode=mode, following_error=0.005) as bench:
        send, waiting = bench.drive_end.send, []
        later = lambda message: waiting.append((bench.clock.now() + 3.5 * MS, message))  # noqa: E731
        bench.drive_end.send = lambda m: later(m) if m.arbitration_id == 0x181 else send(m)
        bench.clock.actors.append(
            lambda: [send(waiting.pop(0)[1]) for at, _ in tuple(waiting) if at <= bench.clock.now()]
        )
        bench.at_cycle(100, lambda: (blind(bench), run_away(bench)))
        assert_stopped(bench, bench.run(), 0.005)


def test_one_that_runs_off_while_another_drive_still_starts_up():
    """A drive may take seconds to switch on its brake; the others are enabled by then."""
    with Bench("bridge", "trolley", profile=quintic((0.0, 0.3), (0.0, 0.2), duration=3.0)) as bench:
        other = bench.drives.drives[1]
        obey = other._obey
        other._obey = lambda word: obey(word if word != 0x0F else 0x07)
        run_away(bench)
        record = bench.run()
        went = abs(bench.drive.actual) / 1e6
    assert "axis bridge: it is" in record.reason
    assert went < 0.15


@pytest.mark.slow
def test_an_axis_that_lags_as_the_spec_says_is_no_runaway():
    """A first-order lag; the drive of another make that lags more is stopped."""
    for lag, stated in ((0.02, 0.03), (0.1, 0.1), (0.1, 0.03)):
        own = attrs.evolve(target(), lag=stated)
        plan = plan_of(encode(MOVE, own)[0].content, own)
        load = RigidLoad([0.0], lag=lag / (lag + PERIOD))
        with Bench(source=plan, stand=[0], load=load) as bench:
            record = bench.run()
        assert (record.phase is Phase.DONE) == (lag <= stated), record.reason


def test_the_lag_is_what_the_spec_states():
    def lag(*overrides):
        return target_of(preset_spec("paper", overrides)).lag

    assert lag("actuator.type='first-order'", "actuator.tau=0.05") == 0.05
    assert lag() == 0.03
    assert lag("check.path.latency=0.01") == pytest.approx(0.04)
    assert lag("check.path.lag=[0.01, 0.02]", "check.path.latency=0.004") == pytest.approx(0.024)


class TestWidth:
    def test_as_the_page_has_it(self):
        own = target()
        plan = plan_of(encode(MOVE, own)[0].content, own)
        assert windows(plan.demand, own) == (pytest.approx(1e6 * WINDOW, rel=1e-3),)

    @pytest.mark.parametrize(("stated", "fits"), [(0.05, True), (0.051, False), (1.0, False)])
    def test_one_that_is_too_wide_is_refused_before_anything_is_written(self, stated, fits):
        own = target(following_error=stated)
        if fits:
            assert encode(MOVE, own)
            return
        with pytest.raises(
            ExportError, match=r"can\.following_error: .* wider than is useful .* state 0\.05 at"
        ):
            encode(MOVE, own)

    @pytest.mark.parametrize(("window", "fits"), [(50_000, True), (50_001, False), (1_000_000, False)])
    def test_so_is_the_drives_own(self, window, fits):
        with Bench(profile=MOVE, make=DriveVariant(following_error=window)) as bench:
            record = bench.run()
        assert (record.phase is Phase.DONE) == fits
        assert fits or "is wider than is useful for this motion" in record.reason
        assert fits or not bench.of(0x301)


def test_what_was_told_once_counts_once_when_an_axis_settles():
    """The drive stops answering at the target, and the time-out is long."""
    with Bench(profile=MOVE, timeout=0.5, step=MS) as bench:
        bench.drive_end.sending = lambda message: (
            message.arbitration_id != 0x181 or "hold" not in bench.phases
        )
        record = bench.run()
    assert "no feedback" in record.reason
    assert "disable" not in bench.phases
