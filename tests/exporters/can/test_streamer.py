"""Whole streams on a fake clock, judged by what a witness on the bus took down."""

import re
from types import SimpleNamespace

import attrs
import can
import numpy as np
import pytest
from exporters.can.bench import MS, OTHER_MAKE, QUICK_STOP, Bench, RigidLoad
from motions import quintic

from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.export.candump import read
from gen_profile_exporters.can.export.exporter import encode
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.record import Phase

PHASES = ["configure", "align", "enable", "stream", "hold", "disable"]
PERIOD = 4  # ms


def sent(bench, cob_ids=(0x301,)):
    """Setpoints and SYNCs in the order in which they were on the bus."""
    return [(frame.cob_id, frame.data) for frame in bench.heard if frame.cob_id in {*cob_ids, 0x080}]


def exported(profile, target):
    return [(frame.cob_id, frame.data) for frame in read(encode(profile, target)[0].content)]


def find(haystack, needle):
    return [k for k in range(len(haystack) - len(needle) + 1) if haystack[k : k + len(needle)] == needle]


class TestWholeStream:
    @pytest.mark.parametrize("make", [DriveVariant(), OTHER_MAKE])
    def test_every_setpoint_once_in_order_byte_for_byte(self, make):
        with Bench(make=make) as bench:
            record = bench.run()
        assert (record.phase, record.reason, record.sent) == (Phase.DONE, "", 251)
        assert bench.phases == PHASES
        frames, log = sent(bench), exported(quintic((0.1, 0.4)), bench.target)
        (begin, *_) = find(frames, log)
        before, after = frames[:begin], frames[begin + len(log) :]
        assert {data for cob_id, data in before if cob_id == 0x301} == {log[0][1]}
        assert {data for cob_id, data in after if cob_id == 0x301} == {log[-2][1]}
        assert [cob_id for cob_id, _ in frames] == [0x301, 0x080] * (len(frames) // 2)

    def test_syncs_are_even(self):
        with Bench() as bench:
            bench.run()
        instants = np.array([frame.at for frame in bench.of(0x080)])
        np.testing.assert_allclose(np.diff(instants[:-1]), PERIOD, atol=1e-9)

    def test_the_axis_arrives(self):
        with Bench() as bench:
            record = bench.run()
        assert record.final == (400_000,)
        np.testing.assert_array_equal(record.actual[1:, 0], bench.plan.motion.position[:-1, 0])
        assert record.answered.all()
        assert bench.positions()[-1][1] == 400_000

    def test_several_axes_in_interpolated_position_mode(self):
        profile = quintic((0.1, 0.4), (1.2, -0.7))
        with Bench("bridge", "trolley", profile=profile, node=5, mode="ip") as bench:
            record = bench.run()
        assert (record.reason, record.final) == ("", (400_000, -700_000))
        assert len(find(sent(bench, (0x305, 0x306)), exported(profile, bench.target))) == 1

    @pytest.mark.parametrize(
        "options", [{"feed_forward": "velocity"}, {"feed_forward": "torque", "torque_per_acceleration": 50.0}]
    )
    def test_feed_forward_goes_along(self, options):
        with Bench(**options) as bench:
            record = bench.run()
            index = 0x60B1 if options["feed_forward"] == "velocity" else 0x60B2
            assert bench.drive.value(index) == 0
        assert record.phase is Phase.DONE
        assert len(find(sent(bench), exported(quintic((0.1, 0.4)), bench.target))) == 1

    def test_velocity_and_torque_go_along_in_a_third_rpdo(self):
        options = {"node": 5, "feed_forward": "both", "torque_per_acceleration": 50.0}
        with Bench("bridge", "trolley", profile=quintic((0.1, 0.4), (1.2, -0.7)), **options) as bench:
            held = []
            bench.at_cycle(60, lambda: held.extend(bench.drive.value(index) for index in (0x60B1, 0x60B2)))
            record = bench.run()
            rest = [drive.value(index) for drive in bench.drives.drives for index in (0x60B1, 0x60B2)]
        assert (record.reason, record.final) == ("", (400_000, -700_000))
        at = 58 * PERIOD / 1e3  # the frames of the latest cycle are still on their way
        velocity, acceleration = (quintic((0.1, 0.4)).derivative([at], order).item() for order in (1, 2))
        assert held == pytest.approx([1e6 * velocity, 50.0 * acceleration], abs=0.51)
        assert rest == [0, 0, 0, 0]
        frames = sent(bench, (0x305, 0x306, 0x405, 0x406))
        assert len(find(frames, exported(quintic((0.1, 0.4), (1.2, -0.7)), bench.target))) == 1

    def test_a_lagging_axis_is_waited_for(self):
        load = RigidLoad([0.1], lag=0.97)
        with Bench(load=load, following_error=0.1) as bench:
            record = bench.run()
        assert record.phase is Phase.DONE
        assert abs(record.final[0] - 400_000) < 1000
        assert len(bench.of(0x080)) > 251 + 100

    @pytest.mark.slow
    def test_an_axis_that_never_arrives_is_stopped(self):
        class Leaning(RigidLoad):
            def advance(self, position, duration):
                return [0.99 * at for at in super().advance(position, duration)]

        with Bench(load=Leaning([0.1]), stand=[99_500], step=MS) as bench:
            record = bench.run()
        assert record.phase is Phase.ABORTED
        assert "do not settle" in record.reason

    @pytest.mark.slow
    def test_no_drift_in_twenty_minutes(self):
        long = quintic((0.0, 1.0), duration=1200.0)
        with Bench(profile=long, sync_period=1.0, step=500 * MS) as bench:
            record = bench.run()
        assert record.sent == 1201
        assert abs(record.lateness.drift) < 1e-12
        assert record.lateness.percentile(100) == 0.0

    def test_drives_are_left_alone_afterwards(self):
        with Bench() as bench:
            bench.run()
            assert bench.drive.value(0x1016, 1) == 0
            assert bench.drive.local.nmt.state == "PRE-OPERATIONAL"
            heard = len(bench.of(0x081))
            bench.wait(1000)
            assert len(bench.of(0x081)) == heard == 0


VELOCITY = {"mode": "csv", "following_error": 0.005}


class TestVelocities:
    """Drives that take speed only (60FFh)."""

    @pytest.mark.slow
    @pytest.mark.parametrize("make", [DriveVariant(), OTHER_MAKE])
    def test_they_lead_the_axes_to_the_target(self, make):
        profile = quintic((0.0, 0.3), (0.0, -0.7))
        with Bench("bridge", "trolley", profile=profile, make=make, **VELOCITY) as bench:
            modes = []
            bench.at_cycle(100, lambda: modes.append(bench.drive.value(0x6061)))
            record = bench.run()
        assert modes == [9]
        assert (record.reason, record.final) == ("", (300_000, -700_000))
        assert len(find(sent(bench, (0x301, 0x302)), exported(profile, bench.target))) == 1
        assert bench.of(0x301)[0].data == bench.of(0x301)[-1].data == bytes(4)
        np.testing.assert_allclose(record.actual, bench.plan.motion.at_sync, atol=1)

    @pytest.mark.slow
    @pytest.mark.parametrize("fault", ["EMCY", "bit 12 lost", "TPDO late", "drive killed", "axis blocked"])
    def test_every_fault_stops_the_axis(self, fault):
        act, cycles, reason = FAULTS[fault]
        reason = "off the motion, more than can.following_error" if fault == "axis blocked" else reason
        with Bench(profile=quintic((0.0, 0.3)), timeout=0.02, **VELOCITY) as bench:
            bench.at_cycle(120, lambda: act(bench))
            record = bench.run()
        assert re.search(reason, record.reason), record.reason
        assert_quick_stop_is_last(bench)
        stops = [frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP]
        assert stops[0] <= bench.fault_at + cycles * PERIOD

    def test_a_drive_that_is_fed_no_more_stops_by_itself(self):
        """It would go on at its last velocity without end."""
        with Bench(profile=quintic((0.0, 0.3)), make=DriveVariant(miss="hold"), **VELOCITY) as bench:
            bench.at_cycle(120, lambda: setattr(bench.streamer_end, "sending", lambda _: False))
            bench.streamer.run()
            bench.wait(300)
            emergencies, at = bench.of(0x081), bench.drive.actual
            bench.wait(100)
        assert emergencies[0].at <= bench.fault_at + 20 + PERIOD
        assert bench.drive.actual == at


class TestLaunchTimes:
    """A bus that sends at given instants by itself, and a machine that wakes up late."""

    @pytest.mark.parametrize("launching", [True, False])
    def test_frames_are_as_even_as_the_bus_sends_them(self, launching):
        with Bench(launching=launching, sluggish=True) as bench:
            record = bench.run()
        assert (record.phase, record.final) == (Phase.DONE, (400_000,))
        assert len(find(sent(bench), exported(quintic((0.1, 0.4)), bench.target))) == 1
        instants = np.array([frame.at for frame in bench.of(0x080)])
        uneven = np.abs(np.diff(instants[20:-20]) - PERIOD).max()
        assert (uneven < 1e-9) == launching
        assert (record.lateness.percentile(100) == 0.0) == launching

    def test_no_setpoint_waits_behind_the_stop(self):
        """A frame that cannot be sent ends the stream when another one already waits for its instant."""
        axes = ("bridge", "trolley")
        with Bench(*axes, profile=quintic((0.1, 0.4), (1.2, -0.7)), launching=True) as bench:

            def refuse(message, instant):
                if message.arbitration_id == 0x302 and bench.streamer.cycles_sent == 120:
                    raise OSError("No buffer space available")
                send_at(message, instant)

            send_at, bench.streamer_end.send_at = bench.streamer_end.send_at, refuse
            record = bench.run()
        assert "transmit buffer is full" in record.reason
        assert_quick_stop_is_last(bench)
        assert [frame.data for frame in bench.of(0x301)][-1] == bytes(bench.plan.cycles[120][0].data)


def say(cob_id, data):
    return lambda bench: bench.say(cob_id, data)


def emergency(bench):
    bench.say(0x081, bytes.fromhex("2031010000000000"))


def tamper_feedback(change):
    """Change the statusword that the drive tells."""

    def act(bench):
        plain_feedback = bench.drive.feedback
        bench.drive.feedback = lambda: [
            (cob_id, change(int.from_bytes(data[:2], "little")).to_bytes(2, "little") + data[2:])
            for cob_id, data in plain_feedback()
        ]

    return act


def block(bench):
    at = bench.drives.load.position
    bench.drives.load = SimpleNamespace(advance=lambda position, duration: at)


def lose_sync(bench):
    bench.drive_end.receiving = lambda message: (
        None if message is not None and message.arbitration_id == 0x080 else message
    )


def bus_error(flags, data):
    def act(bench):

        bench.streamer_end.inbox.append(can.Message(is_error_frame=True, arbitration_id=flags, data=data))

    return act


def buffer_full(bench):

    left = [3]

    def refuse(message):
        if left[0]:
            left[0] -= 1
            raise can.CanOperationError("No buffer space available", 105)
        return True

    bench.streamer_end.sending = refuse


def kill_drives(bench):
    bench.drives_alive = False


def silence(bench):
    bench.drive.feedback = list


# what goes wrong, cycles until the quick stop is on the bus, what the reason says
FAULTS = {
    "EMCY": (emergency, 1, r"emergency 3120h"),
    "fault bit": (tamper_feedback(lambda word: word & ~0x6F | 0x08), 2, r"state 'fault'"),
    "bit 12 lost": (tamper_feedback(lambda word: word & ~0x1000), 2, r"no longer follows"),
    "bit 13 set": (tamper_feedback(lambda word: word | 0x2000), 2, r"following error"),
    "limit of the drive: switched off": (tamper_feedback(lambda word: 0x0250), 2, r"'switch on disabled'"),
    "axis blocked": (block, 8, r"following error|emergency 8611h"),
    "heartbeat lost": (lambda bench: bench.drive.local.nmt.stop_heartbeat(), 17, r"no heartbeat"),
    "NMT stopped": (say(0x701, b"\x04"), 1, r"left the NMT state"),
    "TPDO late": (silence, 7, r"no feedback"),
    "TPDO cut short": (say(0x181, b"\x37\x12"), 1, r"feedback of 2 bytes"),
    "bus-off": (bus_error(0x40, b""), 1, r"bus-off"),
    "error-passive": (bus_error(0x04, bytes([0, 0x20, 0, 0, 0, 0, 0, 0])), 1, r"error-passive"),
    "transmit buffer full": (buffer_full, 2, r"transmit buffer is full"),
    "node reset": (lambda bench: bench.drive.reset(), 1, r"was reset"),
    "drive killed": (kill_drives, 7, r"no feedback"),
    "SYNC lost": (lose_sync, 7, r"no feedback|emergency"),
    "second master's setpoint": (say(0x301, bytes(4)), 1, r"second controller"),
    "second master's SYNC": (say(0x080, b""), 1, r"second controller"),
    "second master's NMT": (say(0x000, b"\x80\x01"), 1, r"second controller"),
    "asked to stop": (lambda bench: bench.streamer.ask_to_stop("Interrupted."), 1, r"^Interrupted\."),
}


@pytest.mark.slow
@pytest.mark.parametrize("make", [DriveVariant(), OTHER_MAKE], ids=["usual", "other"])
@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_stops_the_axis(fault, make):
    act, cycles, reason = FAULTS[fault]
    with Bench(make=attrs.evolve(make, following_error=2000), timeout=0.02) as bench:
        bench.at_cycle(120, lambda: act(bench))
        record = bench.run()
        bench.drive_end.receiving = lambda message: message
        bench.wait(300)
        stood = bench.asked(0x6064)
        bench.wait(50)
        stands = bench.asked(0x6064)
    assert record.phase is Phase.ABORTED
    assert re.search(reason, record.reason), record.reason
    stops = [frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP]
    assert stops[0] <= bench.fault_at + cycles * PERIOD
    ours = [frame for frame in bench.of(0x301) if frame.data != bytes(4)]
    assert max(frame.at for frame in ours) <= stops[0]
    if fault == "drive killed":
        assert stands is None
    else:
        assert stands == stood
        assert 100_000 < stands < 350_000


class TestLateness:
    def late(self, cycle, milliseconds):
        """Have this machine busy for a while, just before a cycle is due."""
        bench = Bench()
        sleep_until, done = bench.clock.sleep_until, []

        def oversleep(instant):
            sleep_until(instant)
            if bench.streamer.cycles_sent == cycle and not done and instant == bench.streamer._pacer.due:
                done.append(True)
                bench.clock.stall(int(milliseconds * 1e6))

        bench.clock.sleep_until = oversleep
        with bench:
            return bench, bench.run()

    def test_a_little_late_is_sent_and_told(self):
        _, record = self.late(125, 1.5)
        assert (record.phase, record.sent) == (Phase.DONE, 251)
        assert record.lateness.percentile(100) == pytest.approx(1500)
        assert record.lateness.histogram()["< 2000"] == 1

    def test_one_setpoint_may_be_left_out_where_it_makes_no_great_step(self):
        bench, record = self.late(20, 3)
        assert (record.phase, record.sent) == (Phase.DONE, 250)
        left_out = bench.plan.cycles[20][0].data
        assert bytes(left_out) not in {frame.data for frame in bench.of(0x301)}
        assert min(np.diff([frame.at for frame in bench.of(0x080)])) >= PERIOD - 0.3

    @pytest.mark.parametrize(("cycle", "milliseconds"), [(125, 3), (20, 7)])
    def test_a_great_step_is_an_abort(self, cycle, milliseconds):
        bench, record = self.late(cycle, milliseconds)
        assert record.phase is Phase.ABORTED
        assert f"late at cycle {cycle}" in record.reason
        assert_quick_stop_is_last(bench)

    def test_a_frozen_streamer(self):
        bench, record = self.late(125, 500)
        assert record.phase is Phase.ABORTED
        assert_quick_stop_is_last(bench)


def assert_quick_stop_is_last(bench):
    stops = [frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP]
    assert max(frame.at for frame in bench.of(0x301)) <= stops[0]


@pytest.mark.slow
def test_a_drive_that_does_not_switch_on():
    with Bench(step=MS) as bench:
        tamper_feedback(lambda word: 0x0250)(bench)
        record = bench.run()
    assert re.search(
        r"do not reach 'ready to switch on' within 5 s \(can.state_timeout\) \(cart: switch on disabled\)",
        record.reason,
    )
    assert len(bench.of(0x301)) > 1000
    assert_quick_stop_is_last(bench)


@pytest.mark.parametrize(
    "make",
    [DriveVariant(), DriveVariant(miss="hold"), DriveVariant(miss="stop")],
    ids=["extrapolate", "hold", "stop"],
)
def test_a_killed_streamers_drive_stops_by_itself(make):
    """The streamer is gone between two frames; whatever the drive's make, it stops within the time-out."""

    class Killed(BaseException):
        pass

    def die(message):
        if bench.streamer.cycles_sent >= 120:
            bench.fault_at = bench.fault_at or bench.now
            raise Killed
        return True

    with Bench(make=make) as bench:
        bench.streamer_end.sending = die
        with pytest.raises(Killed):
            bench.run()
        bench.wait(300)
        emergencies = bench.of(0x081)
    assert bench.drive.state in {State.SWITCH_ON_DISABLED, State.FAULT}
    assert abs(bench.drive.actual - 400_000) > 50_000
    if make.miss != "stop":  # which needs no time-out
        assert emergencies[0].at <= bench.fault_at + 20 + 1


def test_even_a_bug_stops_the_axis():
    with Bench() as bench:
        bench.at_cycle(120, lambda: setattr(bench.streamer, "_judge", None))
        with pytest.raises(TypeError):
            bench.run()
        bench.wait(2)
    assert_quick_stop_is_last(bench)
    assert bench.drive.state is State.SWITCH_ON_DISABLED


def test_a_drive_that_no_longer_answers_once_it_is_off_is_no_fault():
    with Bench() as bench:
        bench.drive_end.sending = lambda message: (
            message.arbitration_id != 0x581 or "hold" not in bench.phases
        )
        record = bench.run()
    assert (record.phase, record.reason) == (Phase.DONE, "")
