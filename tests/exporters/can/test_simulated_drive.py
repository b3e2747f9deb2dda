"""The simulated drive by itself: states, faults, and what it does when setpoints stop."""

import gc
import itertools
import os
import struct

import can
import canopen
import pytest
from exporters.can.bench import Bench

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can.cia402 import MOVING, Controlword, State, state_of
from gen_profile_exporters.can.host.realtime import real_time
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant, dictionary
from gen_profile_exporters.can.simulation.simulated_drive import SimulatedDrive


@pytest.fixture
def bench():
    with Bench() as found:
        yield found


def command(drive, *words):
    for word in words:
        drive.store(0x6040, 0, word)
    return drive.state


class TestStates:
    # CiA 402-2: transitions by number
    @pytest.mark.parametrize(
        ("words", "state"),
        [
            ((0x06,), State.READY),
            ((0x06, 0x07), State.SWITCHED_ON),
            ((0x06, 0x07, 0x0F), State.ENABLED),
            ((0x06, 0x07, 0x0F, 0x07), State.SWITCHED_ON),
            ((0x06, 0x07, 0x0F, 0x06), State.READY),
            ((0x06, 0x07, 0x06), State.READY),
            ((0x06, 0x07, 0x0F, 0x00), State.SWITCH_ON_DISABLED),
            ((0x06, 0x07, 0x0F, 0x02), State.QUICK_STOP),
            ((0x06, 0x07, 0x0F, 0x02, 0x0F), State.QUICK_STOP),
            ((0x06, 0x07, 0x02), State.SWITCH_ON_DISABLED),
            ((0x0F,), State.SWITCH_ON_DISABLED),
            ((0x07,), State.SWITCH_ON_DISABLED),
        ],
    )
    def test_controlwords(self, bench, words, state):
        assert command(bench.drive, *words) is state
        assert state_of(bench.drive.value(0x6041)) is state

    def test_a_fault_is_left_by_a_rising_edge_only(self, bench):
        bench.drive.fault(0x3210)
        assert bench.drive.state is State.FAULT
        assert command(bench.drive, Controlword.SHUTDOWN) is State.FAULT
        assert command(bench.drive, Controlword.FAULT_RESET) is State.SWITCH_ON_DISABLED

    def test_a_fault_reaction_is_not_interrupted(self, bench):
        command(bench.drive, 0x06, 0x07, 0x0F)
        bench.drive.fault(0x3210)
        assert command(bench.drive, 0x0F) is State.FAULT_REACTION
        bench.drive.fault(0x3211)
        bench.drive.next_command()
        bench.wait(1)
        assert bench.drive.state is State.FAULT
        assert [frame.data[:2] for frame in bench.of(0x081)] == [b"\x10\x32"]

    def test_of_a_statusword_that_no_state_matches_nothing_is_known(self):
        assert state_of(0x0001) is State.UNKNOWN
        masks = [(0x4F, {0x00, 0x40, 0x0F, 0x08}), (0x6F, {0x21, 0x23, 0x27, 0x07})]  # of CiA 402-2
        for word in range(1 << 7):
            known = any(word & mask in patterns for mask, patterns in masks)
            assert (state_of(word) is not State.UNKNOWN) == known
            assert known or state_of(word) in MOVING


def enabled(bench, **settings):
    drive = bench.drive
    drive.store(0x6060, 0, 8)
    command(drive, 0x06, 0x07, 0x0F)
    drive.velocity = 100_000.0
    for index, value in settings.items():
        drive.store(int(index[1:], 16), 0, value)
    drive.store(0x1016, 1, 127 << 16 | 20)
    drive.local.nmt.state = "OPERATIONAL"
    bench.say(0x77F, b"\x05")
    return drive


class TestConnection:
    @pytest.mark.parametrize(
        ("option", "state", "code"),
        [
            (1, State.FAULT, b"\x30\x81"),
            (2, State.SWITCH_ON_DISABLED, b"\x30\x81"),
            (3, State.SWITCH_ON_DISABLED, b"\x30\x81"),
        ],
    )
    def test_a_lost_heartbeat(self, option, state, code):
        with Bench(make=DriveVariant(miss="hold")) as bench:
            drive = enabled(bench, x6007=option, x6085=10_000_000)
            bench.wait(19)
            assert drive.state is State.ENABLED
            bench.wait(30)
            assert drive.state is state
            assert bench.of(0x081)[0].data[:2] == code

    def test_no_reaction_where_none_is_asked_for(self):
        with Bench(make=DriveVariant(miss="hold")) as bench:
            drive = enabled(bench, x6007=0)
            bench.wait(50)
            assert drive.state is State.ENABLED


class TestMotion:
    def test_the_travel_limits_the_command(self, bench):
        drive = enabled(bench)
        drive.store(0x607D, 1, 0)
        drive.store(0x607D, 2, 150_000)
        bench.say(0x201, b"\x0f\x00")
        for index, sub, value in ((0x1601, 0, 1), (0x1601, 1, 0x607A_0020), (0x1401, 2, 1)):
            drive.store(index, sub, value)
        bench.say(0x301, struct.pack("<i", 200_000))
        bench.say(0x080)
        bench.wait(1)
        assert drive.actual == 150_000
        assert drive.value(0x6041) & 1 << 11

    def test_short_frames_change_nothing(self, bench):
        drive = enabled(bench)
        bench.say(0x201, b"\x02")
        bench.wait(1)
        assert drive.state is State.ENABLED

    def test_positions_beyond_32_bits_are_clipped(self):
        drive = SimulatedDrive(1, DriveVariant(), 0)
        drive.arrive(1e12)
        assert drive.value(0x6064) == 2**31 - 1


class TestBus:
    def test_nmt_resets(self, bench):
        drive = enabled(bench)
        bench.say(0x000, b"\x81\x01")
        bench.wait(1)
        assert drive.state is State.SWITCH_ON_DISABLED
        assert drive.local.nmt.state == "PRE-OPERATIONAL"
        assert drive.value(0x1016, 1) == 0
        assert [frame.data for frame in bench.of(0x701)][-1] == b"\x00"

    def test_resets_of_other_nodes_are_not_its_own(self, bench):
        drive = enabled(bench)
        bench.say(0x000, b"\x81\x05")
        bench.say(0x000, b"\x01")
        bench.say(0x181, b"", is_remote_frame=True)
        bench.wait(1)
        assert drive.state is State.ENABLED

    def test_it_serves_until_the_bus_fails(self, bench):
        def down(message):
            raise can.CanOperationError("Network is down")

        bench.drive_end.receiving = down
        with pytest.raises(StreamAborted, match="simulated drives failed"):
            bench.drives.run(lambda: False)


class TestEvents:
    def test_canopens_own_master_sees_the_state(self, bench):
        """Without a SYNC, and with the PDOs as they come."""
        network, node = canopen.Network(), canopen.BaseNode402(1, dictionary(1, DriveVariant()))
        network.add_node(node)
        node.pdo.read(from_od=True)
        node.setup_402_state_machine(read_pdos=False)
        bench.say(0x000, b"\x01\x01")
        for word, state in ((b"\x00", "SWITCH ON DISABLED"), (b"\x06", "READY TO SWITCH ON")):
            bench.say(0x201, word + b"\x00")
            bench.wait(2)
            for frame in bench.heard:
                network.notify(frame.cob_id, bytearray(frame.data), frame.at / 1e3)
            assert node.state == state

    def test_each_change_is_told_once(self, bench):
        bench.say(0x000, b"\x01\x01")
        bench.wait(20)
        assert [frame.data for frame in bench.of(0x181)] == [b"\x40\x02"]
        bench.say(0x201, b"\x06\x00")
        bench.wait(20)
        assert [frame.data for frame in bench.of(0x181)] == [b"\x40\x02", b"\x21\x02"]
        assert [frame.data for frame in bench.of(0x281)] == [b"\x40\x02\x00", b"\x21\x02\x00"]

    def test_the_inhibit_time_keeps_changes_apart(self, bench):
        bench.drive.store(0x1800, 3, 50)  # of 0.1 ms
        bench.say(0x000, b"\x01\x01")
        for word in (b"\x06\x00", b"\x00\x00") * 10:
            bench.say(0x201, word)
            bench.wait(1.25)
        at = [frame.at for frame in bench.of(0x181)]
        assert len(at) > 3
        assert min(after - before for before, after in itertools.pairwise(at)) >= 5
        assert len(bench.of(0x281)) > 15

    def test_the_event_timer_repeats(self, bench):
        bench.drive.store(0x1800, 5, 10)  # ms
        bench.say(0x000, b"\x01\x01")
        bench.wait(50)
        assert len(bench.of(0x181)) == 5
        assert len(bench.of(0x281)) == 1

    def test_every_third_sync(self, bench):
        bench.drive.store(0x1800, 2, 3)
        bench.say(0x000, b"\x01\x01")
        for _ in range(12):
            bench.say(0x080)
            bench.wait(1)
        assert len(bench.of(0x181)) == 4


def answer(bench, index, sub, data):
    """Write by SDO; the abort code, or 0."""
    bench.heard.clear()
    bench.say(0x601, struct.pack("<BHB", 0x23 | 4 - len(data) << 2, index, sub) + data.ljust(4, b"\0"))
    bench.wait(1)
    (reply,) = bench.of(0x581)
    return struct.unpack("<I", reply.data[4:])[0] if reply.data[0] == 0x80 else 0


class TestRefusals:
    @pytest.mark.parametrize(
        ("off", "entries", "count", "code"),
        [
            (False, [], 0, 0x0800_0022),
            (True, [0x6040_0010, 0x607A_0020], 2, 0),
            (True, [0x2345_0010], 1, 0x0604_0041),  # is not there
            (True, [0x607A_0120], 1, 0x0604_0041),  # has no subindex
            (True, [0x607A_0010], 1, 0x0604_0041),  # is longer
            (True, [0x6041_0010], 1, 0x0604_0041),  # cannot be written
            (True, [0x6502_0020], 1, 0x0604_0041),  # fits no PDO
            (True, [0x607A_0020] * 3, 3, 0x0604_0042),
            (True, [], 9, 0x0604_0042),
        ],
    )
    def test_mappings(self, bench, off, entries, count, code):
        if off:
            assert answer(bench, 0x1400, 1, b"\x01\x02\x00\x80") == 0
            assert answer(bench, 0x1600, 0, bytes(1)) == 0
        codes = [
            answer(bench, 0x1600, sub, entry.to_bytes(4, "little"))
            for sub, entry in enumerate(entries, start=1)
        ]
        codes.append(answer(bench, 0x1600, 0, bytes([count])))
        assert next(filter(None, codes), 0) == code

    @pytest.mark.parametrize(
        ("index", "sub", "data", "code"),
        [
            (0x6060, 0, b"\x08", 0),
            (0x6060, 0, b"\x06", 0x0609_0030),  # homing, which 6502h does not list
            (0x6060, 0, b"\xff", 0x0609_0030),
            (0x1400, 2, b"\xf5", 0x0609_0030),  # reserved
            (0x1800, 2, b"\x00", 0x0609_0030),  # on SYNC after a change
            (0x1400, 2, b"\xfe", 0),
            (0x1400, 2, b"\x00", 0),
            (0x1400, 1, b"\x02\x02\x00\x00", 0x0800_0022),  # another COB-ID while the PDO is on
            (0x1800, 3, b"\x02\x00", 0x0800_0022),
            (0x1600, 1, b"\x20\x00\x7a\x60", 0x0800_0022),
            (0x1600, 9, b"\x20\x00\x7a\x60", 0x0609_0011),
            (0x6060, 0, b"\x08\x00", 0x0607_0010),
        ],
    )
    def test_single_objects(self, bench, index, sub, data, code):
        assert answer(bench, index, sub, data) == code

    def test_a_mode_that_comes_by_pdo_is_not_shown(self, bench):
        bench.say(0x000, b"\x01\x01")
        bench.say(0x301, b"\x06\x00\x06")
        bench.wait(1)
        assert bench.drive.value(0x6061) == 0


class TestRealTime:
    @pytest.mark.slow
    @pytest.mark.parametrize(("system", "cure"), [("linux", "ulimit -r 80"), ("win32", "on Linux only")])
    def test_what_is_refused_is_said(self, monkeypatch, system, cure):
        def refuse(*_, **__):
            raise PermissionError if system == "linux" else AttributeError

        monkeypatch.setattr("os.sched_setscheduler", refuse)
        monkeypatch.setattr("ctypes.CDLL", refuse if system == "win32" else lambda *_, **__: Unwilling())
        monkeypatch.setattr("sys.platform", system)
        with real_time() as refused:
            assert len(refused) == 2
        assert cure in refused[0]
        assert "ulimit -l" in refused[1]

    @pytest.mark.slow
    def test_what_is_granted_is_given_back(self, monkeypatch):
        asked = []
        monkeypatch.setattr("os.sched_setscheduler", lambda _, policy, __: asked.append(policy))
        with real_time():
            assert asked == [os.SCHED_FIFO]
        assert asked == [os.SCHED_FIFO, os.SCHED_OTHER]

    @pytest.mark.slow
    def test_collection_of_garbage_is_as_before(self):
        gc.disable()
        try:
            with real_time():
                assert not gc.isenabled()
            assert not gc.isenabled()
        finally:
            gc.enable()


class Unwilling:
    """A C library that locks no memory."""

    def mlockall(self, flags):
        return -1
