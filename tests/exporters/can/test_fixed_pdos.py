"""Drives whose PDOs cannot be mapped anew, so that controlword and setpoint may share one."""

import csv

import cantools
import pytest
from exporters.can.bench import MS, Bench
from exporters.motions import quintic, target
from numpy.testing import assert_array_equal

from gen_profile.spec.can import CobIdsSpec, FixedPdosSpec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.export.exporter import encode, replay
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.record import Phase

PROFILE = quintic((0.1, 0.4))
CONTROLWORD, STATUSWORD, MODE, POSITION, ACTUAL = 0x60400010, 0x60410010, 0x60600008, 0x607A0020, 0x60640020
TOGETHER = FixedPdosSpec(rpdo3=(CONTROLWORD, POSITION), tpdo3=(STATUSWORD, ACTUAL))
APART = FixedPdosSpec(
    rpdo2=(CONTROLWORD, MODE), rpdo3=(0x00050008, POSITION), tpdo1=(ACTUAL, 0x606C0010, STATUSWORD)
)
FIXED = DriveVariant(fixed_pdos=TOGETHER)
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP = 0x06, 0x07, 0x0F, 0x02


def words(bench, cob_id=0x401):
    return [int.from_bytes(frame.data[:2], "little") for frame in bench.of(cob_id)]


class TestOneFrame:
    def test_a_whole_stream(self):
        with Bench(profile=PROFILE, make=FIXED, fixed_pdos=TOGETHER) as bench:
            record = bench.run()
            sent = [frame.data for frame in bench.of(0x401)]
        assert (record.reason, record.aftermath, record.final) == ("", "", (400_000,))
        assert {0x381, 0x401} == {f.cob_id for f in bench.heard if 0x180 < f.cob_id < 0x580}
        changes = [
            word for before, word in zip([None, *words(bench)], words(bench), strict=False) if word != before
        ]
        assert changes == [0, SHUTDOWN, SWITCH_ON, ENABLE, SWITCH_ON, SHUTDOWN, 0]
        motion = [cycle[0].data for cycle in bench.plan.cycles]
        assert motion in [sent[begin : begin + len(motion)] for begin in range(len(sent))]
        positions = [int.from_bytes(data[2:], "little", signed=True) for data in motion]
        assert positions == bench.plan.motion.position[:, 0].tolist()
        assert (positions[0], positions[-1]) == (100_000, 400_000)

    def test_two_frames_one_with_the_mode(self):
        with Bench(profile=PROFILE, make=DriveVariant(fixed_pdos=APART), fixed_pdos=APART) as bench:
            record = bench.run()
        assert (record.reason, record.aftermath, record.final) == ("", "", (400_000,))
        assert bench.of(0x301)[0].data == bytes([SHUTDOWN, 0, 8])
        assert {frame.data[0] for frame in bench.of(0x401)} == {0}

    def test_what_the_drive_cannot_change_is_not_written_nor_put_back(self):
        with Bench(make=FIXED, fixed_pdos=TOGETHER) as bench:
            assert bench.run().aftermath == ""
            written = {int.from_bytes(f.data[1:3], "little") for f in bench.of(0x601) if f.data[0] >> 5 == 1}
            assert bench.asked(0x6041) is not None
        assert {0x1402, 0x1802} <= written
        assert not written & {0x1602, 0x1A02}

    def test_a_fault_stops_it_in_the_same_frames(self):
        with Bench(profile=PROFILE, make=FIXED, fixed_pdos=TOGETHER, step=MS // 4) as bench:
            bench.at_cycle(100, lambda: bench.say(0x081, bytes.fromhex("2031010000000000")))
            record = bench.run()
        stop = words(bench).index(QUICK_STOP)
        frames = bench.of(0x401)
        assert record.reason.endswith("reports emergency 3120h; see its manual. The axes were stopped.")
        assert frames[stop].at - bench.fault_at <= 4
        assert set(words(bench)[stop:]) == {QUICK_STOP}
        assert {frame.data[2:] for frame in frames[stop:]} == {frames[stop - 1].data[2:]}
        assert bench.drive.state is State.SWITCH_ON_DISABLED

    def test_no_velocity_goes_with_a_stop(self):
        fixed = FixedPdosSpec(rpdo3=(CONTROLWORD, 0x60FF0020), tpdo3=(STATUSWORD, ACTUAL))
        make = DriveVariant(fixed_pdos=fixed)
        with Bench(profile=PROFILE, make=make, fixed_pdos=fixed, mode="csv", following_error=0.01) as bench:
            bench.at_cycle(100, lambda: bench.streamer.ask_to_stop("Interrupted."))
            record = bench.run()
        assert record.reason == "Interrupted. The axes were stopped."
        stopped = [
            f.data[2:] for f, word in zip(bench.of(0x401), words(bench), strict=True) if word == QUICK_STOP
        ]
        assert set(stopped) == {bytes(4)}
        assert any(frame.data[2:] != bytes(4) for frame in bench.of(0x401))

    def test_nobody_else_may_send_it(self):
        with Bench(make=FIXED, fixed_pdos=TOGETHER) as bench:
            bench.at_cycle(100, lambda: bench.say(0x401, bytes(6)))
            assert "Frame 401h came from another node" in bench.run().reason


SPLIT = FixedPdosSpec(
    rpdo2=(CONTROLWORD, POSITION), tpdo1=(STATUSWORD, 0x60610008), tpdo2=(ACTUAL,), tpdo3=(0x606C0020,)
)


class TestTwoAnswers:
    """Statusword in one TPDO, actual position in another: the commonest default of drives."""

    @pytest.fixture
    def bench(self):
        with Bench(profile=PROFILE, make=DriveVariant(fixed_pdos=SPLIT), fixed_pdos=SPLIT) as bench:
            yield bench

    def test_a_whole_stream(self, bench):
        record = bench.run()
        assert (record.reason, record.aftermath, record.final) == ("", "", (400_000,))
        assert_array_equal(record.actual[1:, 0], bench.plan.motion.position[:-1, 0])
        assert {0x181, 0x281, 0x301} == {f.cob_id for f in bench.heard if 0x180 < f.cob_id < 0x580}

    @pytest.mark.parametrize("lost", [0x181, 0x281])
    def test_either_is_missed(self, bench, lost):
        bench.at_cycle(
            100, lambda: setattr(bench.drive_end, "sending", lambda message: message.arbitration_id != lost)
        )
        record = bench.run()
        assert "axis cart: no feedback for" in record.reason

    def test_its_files(self):
        own = target(fixed_pdos=SPLIT, sync_period=0.01, cob_ids={"cart": CobIdsSpec(position=0x2AA)})
        files = {file.filename.partition(".")[2]: file.content for file in encode(PROFILE, own)}
        database = cantools.database.load_string(files["dbc"].decode(), "dbc")
        messages = [database.get_message_by_name(f"cart_{name}") for name in ("Feedback", "Position")]
        assert [(m.frame_id, m.length) for m in messages] == [(0x181, 3), (0x2AA, 4)]
        rows = {
            (r["object"], r["meaning"]): r["value"]
            for r in csv.DictReader(files["startup.csv"].decode().splitlines())
        }
        assert rows["1801h", "actual position: on"] == "0x400002AA"
        assert rows["1802h", "not used: off"] == "0xC0000381"


def test_a_drive_with_another_mapping_is_not_moved():
    fixed = FixedPdosSpec(rpdo3=(POSITION, CONTROLWORD), tpdo3=(STATUSWORD, ACTUAL))
    with Bench(make=FIXED, fixed_pdos=fixed) as bench:
        record = bench.run()
    assert record.phase is Phase.ABORTED
    assert (
        "1602h:01 (setpoint: TargetPosition) must hold 607A0020h, but the drive keeps 60400010h"
        in record.reason
    )
    assert not bench.of(0x401)


@pytest.mark.parametrize(
    ("fixed", "frames"),
    [
        (TOGETHER, {"Setpoint": (0x401, 6, {"Controlword": 0, "TargetPosition": 16})}),
        (
            APART,
            {
                "Command": (0x301, 3, {"Controlword": 0, "ModeOfOperation": 16}),
                "Setpoint": (0x401, 5, {"TargetPosition": 8}),
                "Feedback": (0x181, 8, {"ActualPosition": 0, "Statusword": 48}),
            },
        ),
    ],
    ids=["one frame", "two frames"],
)
def test_files_agree(fixed, frames):
    own = target(fixed_pdos=fixed, sync_period=0.01)
    files = {file.filename.partition(".")[2]: file.content for file in encode(PROFILE, own)}
    database = cantools.database.load_string(files["dbc"].decode(), "dbc")
    for name, (cob_id, size, starts) in frames.items():
        message = database.get_message_by_name(f"cart_{name}")
        assert (message.frame_id, message.length) == (cob_id, size)
        assert {signal.name: signal.start for signal in message.signals} == starts
    mapped = target(sync_period=0.01)
    assert_array_equal(
        replay(files["log"], own).position, replay(encode(PROFILE, mapped)[0].content, mapped).position
    )
    setpoint = database.get_message_by_name("cart_Setpoint")
    lines = [line.split()[2].split("#") for line in files["log"].decode().splitlines()]
    decoded = [setpoint.decode(bytes.fromhex(data)) for cob_id, data in lines if cob_id == "401"]
    assert decoded[-1]["TargetPosition"] == pytest.approx(0.4)
    rows = list(csv.DictReader(files["startup.csv"].decode().splitlines()))
    assert "as can.fixed_pdos has them" in next(r["meaning"] for r in rows if r["object"] == "1602h")
    assert b"\x02\x16\x00" not in files["node1.cdcf"]  # which a manager would write


def test_a_log_whose_controlword_was_altered():
    own = target(fixed_pdos=TOGETHER)
    log = encode(PROFILE, own)[0].content
    with pytest.raises(ExportError, match="line 1: setpoint 401h with another controlword"):
        replay(log.replace(b"401#0F00", b"401#0700", 1), own)


@pytest.mark.parametrize(
    ("fixed", "reason"),
    [
        (
            FixedPdosSpec(rpdo3=(CONTROLWORD,), tpdo3=(STATUSWORD, ACTUAL)),
            r"one RPDO with 607Ah \(607A0020h\), found 0",
        ),
        (FixedPdosSpec(rpdo3=(CONTROLWORD, POSITION)), r"no TPDO holds 6041h \(60410010h\), by which"),
        (
            FixedPdosSpec(rpdo3=(CONTROLWORD, POSITION), rpdo4=(CONTROLWORD,), tpdo3=(STATUSWORD, ACTUAL)),
            r"one RPDO with 6040h \(60400010h\), found 2",
        ),
        (
            FixedPdosSpec(rpdo3=(CONTROLWORD, POSITION, 0x60710010), tpdo3=(STATUSWORD, ACTUAL)),
            r"rpdo3: cannot tell what to send as 6071h:00",
        ),
        (
            FixedPdosSpec(rpdo3=(CONTROLWORD, POSITION), tpdo2=(STATUSWORD,)),
            r"no TPDO holds 6064h \(60640020h\), by which",
        ),
        (
            FixedPdosSpec(rpdo3=(CONTROLWORD, POSITION), tpdo3=(STATUSWORD, ACTUAL, 0x606C0020)),
            r"tpdo3: 80 bits are more than a PDO holds",
        ),
        (
            FixedPdosSpec(rpdo3=(CONTROLWORD, POSITION), tpdo3=(STATUSWORD, ACTUAL, 0x20000001)),
            r"tpdo3: 20000001h has 1 bits, and only whole bytes",
        ),
    ],
)
def test_mappings_that_do_not_do(fixed, reason):
    with pytest.raises(ExportError, match=reason):
        encode(PROFILE, target(fixed_pdos=fixed))
