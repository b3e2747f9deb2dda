"""Drives that are not fit to be moved: nothing is commanded, and a sentence says why."""

import re

import attrs
import pytest
from canopen import SdoAbortedError
from exporters.can.bench import OTHER_MAKE, Bench
from motions import quintic, target

from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.export.exporter import encode
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.plan import plan_of
from gen_profile_exporters.can.streaming.record import Phase


def refused(bench, reason):
    record = bench.run()
    assert record.phase is Phase.ABORTED
    assert re.search(reason, record.reason), record.reason
    assert not bench.of(0x201)
    assert not bench.of(0x301)
    assert bench.drive.actual == bench.drive.command


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (
            {"stand": [110_000]},
            r"stands at 0\.11, and the motion starts at 0\.1 \(10000 counts apart, 1000 allowed",
        ),
        (
            {"make": DriveVariant(following_error=0xFFFF_FFFF)},
            r"does not watch its following error \(6065h is 4294967295 \(FFFFFFFFh\)",
        ),
        (
            {"make": DriveVariant(following_error=0x7FFF_FFFF)},
            r"window of 2\.15e\+03 \(6065h is 2147483647 \(7FFFFFFFh\)\) is wider than .* "
            r"set 0\.132 \(132\d{3} counts\)",
        ),
        (
            {"vendor": 1},
            r"node 1 is another drive: its vendor is 000002E5h, and can\.vendor asks for 00000001h",
        ),
        ({"product": 1}, r"another drive: its product"),
    ],
    ids=["position", "monitoring off", "monitoring wide", "vendor", "product"],
)
@pytest.mark.parametrize("other", [False, True], ids=["usual", "other"])
def test_unfit_drives(options, reason, other):
    make = options.get("make", DriveVariant())
    if other:
        make = attrs.evolve(make, own_mapping=True, miss="hold", fixed_period=OTHER_MAKE.fixed_period)
    with Bench(**{**options, "make": make}) as bench:
        refused(bench, reason)


def test_a_window_that_is_off_can_be_stated():
    with Bench(make=DriveVariant(following_error=0xFFFF_FFFF), following_error=0.01) as bench:
        held = []
        bench.at_cycle(100, lambda: held.append(bench.drive.value(0x6065)))
        assert bench.run().phase is Phase.DONE
    assert held == [10_000]


def test_a_device_of_another_kind():
    with Bench() as bench:
        bench.drive.store(0x1000, 0, 0x0002_0191)
        refused(bench, r"node 1 is no CiA 402 drive \(1000h is 00020191h\)")


@pytest.mark.parametrize(
    ("state", "cure"),
    [
        (State.FAULT, "or ask for it [(]reset_fault[)]"),
        (State.ENABLED, r"switched off there \(controlword 6040h = 0\)"),
        (State.QUICK_STOP, r"switched off there \(controlword 6040h = 0\)"),
    ],
)
def test_a_drive_in_another_state(state, cure):
    with Bench() as bench:
        bench.drive.store(0x6041, 0, state.bits)
        refused(bench, f"in the state '{state.words}'.*{cure}")


def test_answers_that_do_not_state_their_size():
    """Command 42h of CiA 301: four bytes come, and only the object's type tells how many count."""

    def sizeless(message):
        command = message.data[0] if message.arbitration_id == 0x581 else 0
        if command & 0xE3 == 0x43:  # expedited, of a stated size
            used = 8 - (command >> 2 & 3)
            message.data = bytearray([0x42, *message.data[1:used], *[0xAA] * (8 - used)])
        send(message)

    with Bench(vendor=0x2E5) as bench:
        send, bench.drive_end.send = bench.drive_end.send, sizeless
        record = bench.run()
        assert bench.drive.value(0x1016, 1) == 0
    assert (record.phase, record.reason) == (Phase.DONE, "")


def in_fault(bench):
    """Let the first drive have had a fault, of which everybody has already heard."""
    bench.drive.fault(0x3210)
    while bench.streamer_end.recv(0) is not None:
        pass


class TestFaultReset:
    def test_it_is_asked_for(self):
        with Bench(reset_fault=True) as bench:
            in_fault(bench)
            assert bench.run().phase is Phase.DONE

    def test_a_drive_that_stays_in_fault(self):
        with Bench(reset_fault=True) as bench:
            in_fault(bench)
            bench.drive._obey = lambda word: None
            refused(bench, r"in the state 'fault'; .* or ask for it [(]reset_fault[)]")

    def test_a_drive_that_is_not_in_fault_is_left_alone(self):
        with Bench(reset_fault=True) as bench:
            assert bench.run().phase is Phase.DONE
        assert not [frame for frame in bench.of(0x601) if frame.data[1:3] == b"\x40\x60"]

    def test_a_drive_that_does_not_take_it(self):
        with Bench(reset_fault=True) as bench:
            in_fault(bench)
            bench.drive.local.object_dictionary[0x6040].access_type = "ro"
            refused(bench, r"does not answer properly")


@pytest.mark.parametrize(("held", "fits"), [(0x05, True), (0x04, False)])
def test_the_drives_own_word_for_homed(held, fits):
    with Bench(homed=(0x1001, 0, 0x05)) as bench:
        bench.drive.store(0x1001, 0, held)
        if fits:
            assert bench.run().phase is Phase.DONE
        else:
            refused(bench, r"is not homed, as can\.homed asks \(1001h:00 is 4h\); home it")


@pytest.mark.parametrize(
    ("ends", "fits"), [((0, 350_000), False), ((100_000, 400_000), True), ((5, -5), True)]
)
def test_the_drives_own_travel(ends, fits):
    with Bench() as bench:
        for sub, end in enumerate(ends, start=1):
            bench.drive.store(0x607D, sub, end)
        if fits:
            assert bench.run().phase is Phase.DONE
        else:
            refused(bench, r"from 100000 to 400000 counts leaves the drive's travel of 0 to 350000 counts")


def drop(bench, index):
    del bench.drive.local.object_dictionary[index]


def test_a_missing_object_that_safety_needs():
    with Bench() as bench:
        drop(bench, 0x6007)
        refused(
            bench,
            r"the drive has no 6007h\. Without 6007h, it reacts to a lost connection as its maker chose",
        )


def test_a_missing_identity():
    with Bench(vendor=0x2E5) as bench:
        drop(bench, 0x1018)
        refused(bench, r"has no object 1018h:01")


def test_an_object_that_drives_need_not_have():
    with Bench() as bench:
        drop(bench, 0x1006)
        assert bench.run().phase is Phase.DONE


@pytest.mark.parametrize(("index", "fits"), [(0x1006, True), (0x607D, True), (0x6007, False)])
def test_a_general_error_tells_of_an_object_that_is_not_there(index, fits):
    def refuse(**of):
        if of["index"] == index:
            raise SdoAbortedError(0x0800_0000)

    with Bench() as bench:
        for sub in (1, 2):
            bench.drive.value(0x607D, sub)  # which it knows itself
        bench.drive.local.add_read_callback(refuse)
        bench.drive.local.add_write_callback(refuse)
        if fits:
            assert bench.run().phase is Phase.DONE
        else:
            refused(bench, r"refuses to give 6007h:00")


@pytest.mark.parametrize(("kind", "fits"), [(254, True), (1, False)])
def test_the_transmission_type_of_a_controlword_may_be_either_that_is_event_driven(kind, fits):
    with Bench() as bench:
        bench.drive.store(0x1400, 2, kind)
        bench.drive.local.object_dictionary[0x1400][2].access_type = "ro"
        if fits:
            assert bench.run().phase is Phase.DONE
        else:
            refused(
                bench,
                r"1400h:02 \(controlword: at once\) must hold 255 \(FFh\), but the drive keeps 1 \(1h\)",
            )


def test_an_object_that_may_not_be_read():
    with Bench() as bench:
        bench.drive.local.object_dictionary[0x6502].access_type = "wo"
        refused(bench, r"refuses to give 6502h:00")


def test_a_mode_that_is_not_taken():
    with Bench() as bench:
        written = bench.drive._written
        bench.drive.local._write_callbacks.remove(written)
        bench.drive.local.add_write_callback(lambda **of: of["index"] != 0x6060 and written(**of))
        refused(bench, r"shows mode 0 \(6061h\) instead of 8")


@pytest.mark.parametrize("after", [0, 6])
def test_a_silent_drive(after):
    with Bench() as bench:
        answers = bench.drive_end

        def silent(message):
            answers.left -= message.arbitration_id == 0x581
            return message.arbitration_id != 0x581 or answers.left >= 0

        answers.left, answers.sending = after, silent
        refused(bench, r"node 1 does not answer properly")


def test_a_drive_that_falls_silent_while_it_is_set_up():
    with Bench() as bench:
        written = []
        bench.drive_end.sending = lambda message: (
            message.data[:1] != b"\x60" or written.append(1) or len(written) < 9
        )
        refused(bench, r"does not answer properly")


@pytest.mark.parametrize(
    ("cob_id", "data", "reason"),
    [
        (0x080, b"", "second controller"),
        (0x081, b"\x20\x31" + bytes(6), "emergency 3120h"),
        (0x601, bytes(8), "second"),
    ],
)
def test_others_are_heard_before_anything_is_sent(cob_id, data, reason):
    with Bench() as bench:
        bench.say(cob_id, data)
        refused(bench, reason)
    assert not bench.of(0x601) or cob_id == 0x601


def test_another_cycle_than_the_logs():
    log = encode(quintic((0.1, 0.4)), target())[0].content
    with pytest.raises(
        ExportError, match=r"can\.sync_period: the log's cycle is 0\.004 s and the spec's 0\.002 s"
    ):
        plan_of(log, target(sync_period=0.002, bitrate=1_000_000))


NO_REMOTE = DriveVariant(remote_requests=False)


@pytest.mark.parametrize("make", [NO_REMOTE, attrs.evolve(NO_REMOTE, own_mapping=True)], ids=["usual", "own"])
def test_a_drive_that_forbids_remote_requests(make):
    """It takes no COB-ID of a TPDO with bit 30 clear (CiA 301)."""
    with Bench(make=make) as bench:
        record = bench.run()
    assert (record.phase, record.reason, record.aftermath) == (Phase.DONE, "", "")


def test_pdos_that_are_off_already_are_left_alone():
    """Whatever COB-ID waits in them; and what is switched off keeps the rest of its entry."""
    with Bench(make=NO_REMOTE) as bench:
        found = {index: bench.drive.value(index, 1) for index in (0x1801, 0x1802, 0x1803, 0x1402)}
        bench.drive.store(0x1803, 1, 0xC000_0123)
        bench.drive._values.clear()
        held = {}
        bench.at_cycle(100, lambda: held.update({index: bench.drive.value(index, 1) for index in found}))
        bench.run()
        after = {index: bench.drive.value(index, 1) for index in found}
    assert found[0x1801] >> 30 == 1
    assert held == found | {0x1801: found[0x1801] | 1 << 31, 0x1803: 0xC000_0123}
    assert after == found | {0x1803: 0xC000_0123}


def test_a_statusword_that_no_state_matches():
    with Bench() as bench:
        bench.drive.store(0x6041, 0, 0x0001)
        refused(bench, "reports the statusword 0001h, which is no state of CiA 402")


class TestAfterAStreamThatWasKilled:
    """The drive still follows, or brakes, until it misses our heartbeat; the next stream waits for that."""

    TIMEOUT = 0.4  # s

    @pytest.mark.slow
    @pytest.mark.parametrize("after", [5, 250, 420])
    def test_it_begins_without_being_asked_twice(self, after):
        class Killed(BaseException):
            pass

        def die(message):
            if bench.streamer.cycles_sent >= 120:
                raise Killed
            return True

        with Bench(make=DriveVariant(miss="hold"), timeout=self.TIMEOUT, start_tolerance=1.0) as bench:
            bench.streamer_end.sending = die
            with pytest.raises(Killed):
                bench.run()
            bench.streamer_end.sending = lambda message: True
            bench.wait(after)
            assert bench.drive.state is State.ENABLED or after > 400
            while bench.streamer_end.recv(0) is not None:  # before it was there
                pass
            bench.renew()
            record = bench.run()
            lost = [frame for frame in bench.of(0x081) if frame.data[:2] in (b"\x30\x81", b"\x50\x82")]
        assert lost, record.reason
        assert (record.phase, record.reason) == (Phase.DONE, ""), record.reason

    def test_one_that_another_controller_has_enabled_is_refused_at_once(self):
        with Bench() as bench:
            bench.drive.store(0x1016, 1, 5 << 16 | 500)
            bench.drive.store(0x6041, 0, State.ENABLED.bits)
            refused(bench, "another controller commands it")
            assert bench.now < 200
