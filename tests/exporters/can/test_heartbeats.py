"""Drives that watch our heartbeat and setpoints strictly: in every state, at once, and into a fault."""

import pytest
from exporters.can.bench import MS, Bench

from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.simulation.simulated_drive import HEARTBEAT_LOST, SETPOINT_LOST, SimulatedDrive
from gen_profile_exporters.can.streaming.record import Phase

ANSWER = 20  # ms that a slow drive takes for an SDO


class StrictDrive(SimulatedDrive):
    """Watches the heartbeat from the write of 1016h on; setpoints while operational, unless it brakes."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self._armed = None

    def _written(self, index, subindex, od, data):
        super()._written(index, subindex, od, data)
        if index == 0x1016:
            self._armed = self._master_heard = None

    def watch(self, now):
        wait = self.value(0x1016, 1) & 0xFFFF
        self._armed = self._armed or now
        if wait and now - (self._master_heard or self._armed) > wait * MS:
            self._armed = self._master_heard = now
            self.fault(HEARTBEAT_LOST)
        wait = self.value(0x1401, 5)
        if self.state is State.QUICK_STOP or not self.operational:
            self._setpoint_heard = None
        if self._setpoint_heard is not None and now - self._setpoint_heard > wait * MS:
            self._setpoint_heard = None
            self.fault(SETPOINT_LOST)


def answer_slowly(bench):
    """Have each SDO answered 20 ms late."""
    send, waiting = bench.drive_end.send, []

    def later(message):
        if message.arbitration_id == 0x581:
            waiting.append((bench.clock.now() + ANSWER * MS, message))
        else:
            send(message)

    def answer():
        while waiting and waiting[0][0] <= bench.clock.now():
            send(waiting.pop(0)[1])

    bench.drive_end.send = later
    bench.clock.actors.append(answer)


@pytest.mark.slow
@pytest.mark.parametrize("timeout", [None, 0.05])
def test_a_slow_strict_drive_reports_nothing_from_the_first_frame_to_the_last(timeout):
    with Bench(kind=StrictDrive, timeout=timeout) as bench:
        answer_slowly(bench)
        record = bench.run()
        bench.wait(200)
        assert bench.drive.state is State.SWITCH_ON_DISABLED
    assert (record.phase, record.reason, record.aftermath) == (Phase.DONE, "", "")
    assert not bench.of(0x081)


def test_a_stop_leaves_it_ready_for_the_next_stream():
    with Bench(kind=StrictDrive) as bench:
        answer_slowly(bench)
        bench.at_cycle(120, lambda: bench.streamer.ask_to_stop("Interrupted."))
        assert bench.run().reason == "Interrupted. The axes were stopped."
        bench.wait(200)
        assert bench.drive.state is State.SWITCH_ON_DISABLED
        assert bench.drive.value(0x1016, 1) == 0


def test_a_refusal_leaves_no_drive_waiting_for_a_heartbeat():
    with Bench(kind=StrictDrive, homed=(0x1001, 0, 0x01)) as bench:
        assert "is not homed" in bench.run().reason
        bench.wait(200)
    assert not bench.of(0x081)


@pytest.mark.parametrize("timeout_of_the_killed", [20, 8])
def test_a_stream_begins_after_one_that_was_killed(timeout_of_the_killed):
    with Bench(kind=StrictDrive, stand=[100_000]) as bench:
        bench.drive.store(0x1016, 1, 127 << 16 | timeout_of_the_killed)
        bench.drive._master_heard = bench.clock.now()
        bench.wait(100)
        assert bench.drive.state is State.FAULT
        while bench.streamer_end.recv(0) is not None:  # nothing listens yet
            pass
        bench.renew(reset_fault=True)
        bench.heard.clear()
        record = bench.run()
    assert (record.phase, record.reason) == (Phase.DONE, "")
    assert not bench.of(0x081)


def test_nothing_is_sent_where_somebody_else_streams():
    """Not even the frame that tries launch times, while cycles are 20 ms apart."""
    with Bench(launching=True) as bench:
        bench.streamer_end.keeps_instants = pytest.fail
        bench.clock.actors.append(lambda: bench.now % 20 < 0.25 and bench.now > 30 and bench.say(0x080))
        record = bench.run()
    assert "a second controller is on the bus" in record.reason
    assert {frame.cob_id for frame in bench.heard} <= {0x080, 0x701}
