"""The stop when more than one thing is wrong: dead PDOs, dead drives, a bus that is down, no listener."""

import os
import signal
import subprocess
import sys
import threading

import can
import pytest
from exporters.can.bench import QUICK_STOP, Bench
from motions import quintic

from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.host import console
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.record import Phase

PERIOD = 4  # ms
STOP_BY_SDO = bytes.fromhex("2b40600002000000")
VELOCITY = {"profile": quintic((0.0, 0.3)), "mode": "csv", "following_error": 0.005}
HOLDING = DriveVariant(miss="hold")


def leave_operational(bench):
    """Let the drive fall to pre-operational: no PDO reaches it; in csv it keeps its last velocity."""
    bench.drive.local.nmt.state = "PRE-OPERATIONAL"


def deaf(bench, *cob_ids):
    """Let some frames not reach the drives."""
    bench.drive_end.receiving = lambda message: (
        None if message is not None and message.arbitration_id in cob_ids else message
    )


def quick_stops(bench):
    return [frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP]


class TestADriveThatTakesNoPdos:
    def test_it_is_stopped_by_sdo(self):
        with Bench(make=HOLDING, **VELOCITY) as bench:
            bench.at_cycle(120, lambda: leave_operational(bench))
            record = bench.run()
            by_sdo = [frame.at for frame in bench.of(0x601) if frame.data == STOP_BY_SDO]
        assert "left the NMT state operational. The axes were stopped." in record.reason
        assert by_sdo[0] - bench.fault_at <= 3 * PERIOD
        assert bench.drive.state is State.SWITCH_ON_DISABLED
        assert not bench.of(0x081)

    def test_it_stops_by_itself_when_it_takes_no_sdos_either(self):
        def fail():
            leave_operational(bench)
            deaf(bench, 0x601)

        with Bench(make=HOLDING, timeout=0.02, **VELOCITY) as bench:
            bench.at_cycle(120, fail)
            record = bench.run()
            beats = [frame.at for frame in bench.of(0x77F)]
            (emergency,) = bench.of(0x081)
        assert "left the NMT state" in record.reason
        assert "(cart: no answer)" in record.reason
        assert beats[-1] <= quick_stops(bench)[0] + 20 + PERIOD
        assert emergency.at <= beats[-1] + 20 + 1
        assert bench.drive.state is State.SWITCH_ON_DISABLED

    def test_one_that_obeys_at_once_gets_no_sdo(self):
        with Bench(timeout=0.02) as bench:
            bench.at_cycle(120, lambda: bench.streamer.ask_to_stop("Interrupted."))
            record = bench.run()
        assert record.reason == "Interrupted. The axes were stopped."
        assert not [frame for frame in bench.of(0x601) if frame.data == STOP_BY_SDO]
        assert quick_stops(bench)[-1] - quick_stops(bench)[0] > 20  # it brakes for a while


def in_phase(bench, phase, act):
    """Do something once a phase has begun."""

    def look():
        if bench.fault_at is None and phase in bench.phases:
            bench.fault_at = bench.now
            act()

    bench.clock.actors.insert(0, look)


def test_a_dead_drive_confirms_nothing():
    """What it said last, before it was enabled, was that it is switched off."""
    with Bench() as bench:
        in_phase(bench, "enable", lambda: setattr(bench, "drives_alive", False))
        record = bench.run()
    assert "no feedback" in record.reason
    assert "Not every axis is known to stand (cart: no answer)" in record.reason


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["configure", "align", "enable", "hold", "disable"])
@pytest.mark.parametrize("ways", [("sending",), ("sending", "receiving")], ids=["sending", "both ways"])
def test_an_interface_that_is_down_is_a_sentence_whenever_it_goes_down(phase, ways):
    def down(message):
        raise can.CanOperationError("Network is down [Error Code 100]")

    with Bench() as bench:
        in_phase(bench, phase, lambda: [setattr(bench.streamer_end, way, down) for way in ways])
        record = bench.run()
    assert record.phase is Phase.ABORTED
    assert "Network is down" in record.reason
    assert ("Not every axis is known to stand" in record.reason) == (phase != "configure")


def test_a_stop_needs_no_listener():
    def gone(_):
        raise BrokenPipeError

    with Bench() as bench:
        bench.streamer._tell = gone
        bench.at_cycle(120, lambda: bench.say(0x081, bytes.fromhex("2031010000000000")))
        record = bench.run()
    assert "emergency 3120h" in record.reason
    assert quick_stops(bench)[0] <= bench.fault_at + PERIOD


def test_the_stop_comes_before_anything_is_said():
    with Bench() as bench:
        stopped = []
        bench.streamer._tell = lambda phase: stopped.append((phase, bench.drive.state))
        bench.at_cycle(120, lambda: bench.streamer.ask_to_stop("Interrupted."))
        bench.run()
    assert stopped[-1] == ("aborted", State.SWITCH_ON_DISABLED)


class TestConsole:
    @pytest.mark.parametrize("number", console.STOPS)
    def test_every_signal_that_would_end_the_streamer_stops_the_axes(self, number):
        asked = []
        with console.stopped_by_signals(asked.append):
            os.kill(os.getpid(), number)
        named = {each.value: each.name for each in signal.Signals}
        assert asked == [f"Stopped by {named.get(number, f'signal {number}')}."]

    def test_no_signal_ends_it_that_can_be_caught(self):
        """A process that gets all of them but those that tell of its own fault lives to its end."""
        program = """
import os, signal
from gen_profile_exporters.can.host.console import stopped_by_signals
faults = {getattr(signal, f"SIG{name}") for name in "SEGV BUS FPE ILL ABRT TRAP SYS".split()}
asked = []
with stopped_by_signals(asked.append):
    for number in signal.valid_signals() - faults - {signal.SIGKILL, signal.SIGSTOP}:
        os.kill(os.getpid(), number)
print(*asked)
"""
        done = subprocess.run([sys.executable, "-c", program], check=False, capture_output=True, text=True)
        assert done.returncode == 0
        for name in ("SIGVTALRM", "SIGRTMIN", "SIGPROF", "SIGIO", "signal 50", "SIGTERM"):
            assert f"Stopped by {name}." in done.stdout

    def test_they_are_what_they_were_afterwards(self):
        before = [signal.getsignal(number) for number in console.STOPS]
        with console.stopped_by_signals(print):
            pass
        assert [signal.getsignal(number) for number in console.STOPS] == before

    def test_nohup_is_heeded(self):
        asked, before = [], signal.signal(signal.SIGHUP, signal.SIG_IGN)
        try:
            with console.stopped_by_signals(asked.append):
                os.kill(os.getpid(), signal.SIGHUP)
        finally:
            signal.signal(signal.SIGHUP, before)
        assert asked == []

    def test_a_terminal_that_takes_nothing_holds_nobody_up(self, monkeypatch):
        monkeypatch.setattr(console, "LAST_WORDS", 0.01)
        freed = threading.Event()
        with console.told_aside(lambda _: freed.wait()) as tell:
            tell("stream")
            tell("aborted")
        freed.set()

    def test_what_is_told_arrives_in_order_even_after_a_failure(self):
        heard = []

        def hear(said):
            if said == "align":
                raise BrokenPipeError
            heard.append(said)

        with console.told_aside(hear) as tell:
            for said in ("configure", "align", "enable"):
                tell(said)
        assert heard == ["configure", "enable"]
