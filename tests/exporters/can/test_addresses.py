"""Node ids, COB-IDs and serial numbers as a spec states them, and who else may ask the drives."""

import csv

import attrs
import cantools
import pytest
from exporters.can.bench import QUICK_STOP, Bench
from exporters.motions import quintic, target

from gen_profile.spec.can import CobIdsSpec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.export.exporter import encode
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.record import Phase

PROFILE = quintic((0.1, 0.4), (1.2, -0.7))
NODES = {"bridge": 9, "trolley": 4}
COB_IDS = {"trolley": CobIdsSpec(command=0x22A, setpoint=0x33A, feed_forward=0x40A, feedback=0x19A)}
ADDRESSES = {"nodes": NODES, "cob_ids": COB_IDS}
BOTH = {"feed_forward": "both", "torque_per_acceleration": 50.0}


def test_a_stream_to_stated_nodes_and_cob_ids():
    with Bench("bridge", "trolley", profile=PROFILE, **ADDRESSES, **BOTH) as bench:
        record = bench.run()
    assert (record.reason, record.final) == ("", (400_000, -700_000))
    heard = {frame.cob_id for frame in bench.heard}
    assert heard == {
        *(0x000, 0x080, 0x77F, 0x209, 0x309, 0x409, 0x189, 0x22A, 0x33A, 0x40A, 0x19A),
        *(base + node for base in (0x580, 0x600, 0x700) for node in (4, 9)),
    }


def test_every_fault_of_such_a_drive_stops_both():
    with Bench("bridge", "trolley", profile=PROFILE, **ADDRESSES) as bench:
        bench.at_cycle(100, lambda: setattr(bench.drives.drives[1], "feedback", list))
        record = bench.run()
    assert record.phase is Phase.ABORTED
    assert "axis trolley: no feedback" in record.reason
    assert {QUICK_STOP} < {frame.data for cob_id in (0x209, 0x22A) for frame in bench.of(cob_id)}
    assert all(bench.of(cob_id)[-1].data == QUICK_STOP for cob_id in (0x209, 0x22A))


@pytest.mark.parametrize("cob_id", [0x33A, 0x22A])
def test_nobody_else_may_send_them(cob_id):
    with Bench("bridge", "trolley", profile=PROFILE, **ADDRESSES) as bench:
        bench.at_cycle(100, lambda: bench.say(cob_id, bytes(4)))
        assert f"Frame {cob_id:03X}h came from another node" in bench.run().reason


def test_files_tell_them():
    files = {
        file.filename: file.content for file in encode(PROFILE, target("bridge", "trolley", **ADDRESSES))
    }
    database = cantools.database.load_string(files["bay-3.dbc"].decode(), "dbc")
    identifiers = {message.name: message.frame_id for message in database.messages}
    assert {identifiers[f"trolley_{what}"] for what in ("Command", "Setpoint", "Feedback")} == {
        0x22A,
        0x33A,
        0x19A,
    }
    assert {identifiers[f"bridge_{what}"] for what in ("Command", "Setpoint", "Feedback")} == {
        0x209,
        0x309,
        0x189,
    }
    rows = csv.DictReader(files["bay-3.startup.csv"].decode().splitlines())
    on = [row["value"] for row in rows if (row["node"], row["meaning"]) == ("4", "setpoint: on")]
    assert on == ["0x0000033A"]
    assert "bay-3.node9.cdcf" in files


@pytest.mark.parametrize(
    ("stated", "reason"),
    [
        (
            {"cob_ids": {"trolley": CobIdsSpec(setpoint=0x301)}},
            r"can\.cob_ids\.trolley\.setpoint: 301h is can\.cob_ids\.bridge\.setpoint already",
        ),
        ({"nodes": {"bridge": 1, "trolley": 127}}, r"can\.nodes: 127 is the master's own"),
    ],
)
def test_addresses_that_cannot_be(stated, reason):
    with pytest.raises(ExportError, match=reason):
        encode(PROFILE, target("bridge", "trolley", **stated))


@pytest.mark.parametrize(("serial", "fits"), [(77, True), (78, False)])
def test_a_profile_names_its_machine(serial, fits):
    with Bench(make=attrs.evolve(DriveVariant(), serial=77), serial={"cart": serial}) as bench:
        record = bench.run()
    if fits:
        assert record.phase is Phase.DONE
    else:
        assert "its serial is 0000004Dh, and can.serial asks for 0000004Eh" in record.reason
        assert not bench.of(0x201)


class TestOthersSdos:
    @pytest.mark.slow
    @pytest.mark.parametrize("command", [0x40, 0x60, 0x80, 0xA0])
    def test_they_may_read_while_axes_move(self, command):
        with Bench() as bench:
            bench.at_cycle(100, lambda: bench.say(0x601, bytes([command, 0x41, 0x60, 0, 0, 0, 0, 0])))
            record = bench.run()
        assert (record.phase, record.reason) == (Phase.DONE, "")

    @pytest.mark.parametrize("command", [0x2B, 0x00, 0x21, 0xC0])
    def test_they_may_not_write(self, command):
        with Bench() as bench:
            bench.at_cycle(100, lambda: bench.say(0x601, bytes([command, 0x40, 0x60, 0, 0, 0, 0, 0])))
            assert "Frame 601h came from another node" in bench.run().reason

    def test_they_may_not_read_while_drives_are_set_up(self):
        """A drive serves one client at a time: its answers would be taken for ours."""
        with Bench() as bench:
            bench.say(0x601, bytes([0x40, 0x41, 0x60, 0, 0, 0, 0, 0]))
            assert "Frame 601h came from another node" in bench.run().reason
