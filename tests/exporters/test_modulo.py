"""Axes that begin anew after a turn: what is written lies within one, and what is read back goes on."""

import struct

import attrs
import numpy as np
import pytest
from exporters.can.bench import Bench
from exporters.motions import quintic, target
from hypothesis import given
from hypothesis import strategies as st

from gen_profile.delivery.designs.design import design
from gen_profile.delivery.designs.planner import deploy_planner
from gen_profile.motion.profile import sample
from gen_profile.spec.reading import preset_spec, spec_from_dict
from gen_profile.support.errors import ExportError
from gen_profile_exporters import csv_table
from gen_profile_exporters.can.export import candump, exporter
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.record import Phase
from gen_profile_exporters.modulo import unwrapped, wrapped

COUNTS = 65536
RING = {"unit": "rad", "counts_per_si": COUNTS / (2.0 * np.pi), "modulo": 2.0 * np.pi}
NARROW = {"following_error": 1000}  # counts
MOVES = [(5.0, 14.0), (-0.1, -30.0), (40.0, 55.5), (6.0, 6.5)]  # rad


def setpoints(log):
    """Read every target position 607Ah of node 1 as the drive does."""
    return [struct.unpack("<i", frame.data)[0] for frame in candump.read(log) if frame.cob_id == 0x301]


@given(
    st.lists(st.floats(-170.0, 170.0), min_size=1, max_size=50),
    st.floats(-1e4, 1e4),
    st.sampled_from([360.0, 359.7, 2.0**32]),
)
def test_motions_are_read_back_as_numpy_unwraps_them(steps, start, turn):
    motion = start + np.cumsum([0.0, *steps])
    places = wrapped(motion, turn)
    low = -(2.0**31) if turn == 2.0**32 else 0.0
    assert (places >= low).all() and (places < low + turn).all()
    back = unwrapped(places, turn, start)
    assert np.abs(back - motion).max() < 1e-9 * (turn + np.abs(motion).max())
    assert np.abs(np.diff(back) - np.diff(np.unwrap(places, period=turn))).max() < 1e-9 * turn


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("move", MOVES)
def test_a_drive_gets_whole_counts_within_the_turn(move, sign):
    profile, goal = quintic(move, duration=4.0), target(start=move[0], sign=sign, **RING)
    log = exporter.encode(profile, goal)[0].content
    places, motion = setpoints(log), sample(profile, goal.can.sync_period)
    scale = sign * COUNTS / (2.0 * np.pi)
    assert [round(at) % COUNTS for at in motion.position[:, 0] * scale] == places
    back = exporter.replay(log, goal).position[:, 0]
    assert np.abs(back - motion.position[:, 0]).max() <= 0.5001 / abs(scale)


@pytest.mark.parametrize("unit", ["rad", "deg", "counts"])
@pytest.mark.parametrize("move", MOVES)
def test_a_table_holds_places_within_the_turn(move, unit):
    turn = {"rad": 2.0 * np.pi, "deg": 360.0, "counts": COUNTS}[unit]
    goal = target(start=move[0], **{**RING, "unit": unit, "modulo": turn})
    profile = quintic(move, duration=4.0)
    (file,) = csv_table.encode(profile, goal)
    places = np.array([float(line.split(b",")[1]) for line in file.content.splitlines()[1:]])
    assert (places >= 0.0).all() and (places < turn).all()
    motion = sample(profile, goal.cycle_time).position[:, 0]
    unwound = np.unwrap(places, period=turn) * 2.0 * np.pi / turn
    assert np.ptp(unwound - motion) < (1e-9 if unit != "counts" else 1.01 * 2.0 * np.pi / COUNTS)
    back = csv_table.replay(file.content, goal).position[:, 0]
    assert np.abs(back - motion).max() < (1e-9 if unit != "counts" else 0.51 * 2.0 * np.pi / COUNTS)


@pytest.mark.parametrize("mode", ["csp", "ip"])
def test_a_position_may_pass_the_end_of_32_bits(mode):
    """As the encoder of an axis that never comes home does."""
    goal = target(start=2147.0, unit="m", modulo=2.0**32 / 1e6, mode=mode)
    profile = quintic((2147.0, 2149.0), duration=4.0)
    log = exporter.encode(profile, goal)[0].content
    places = setpoints(log)
    assert (places[0], places[-1]) == (2_147_000_000, 2_149_000_000 - 2**32)
    assert exporter.replay(log, goal).position[-1, 0] == pytest.approx(2149.0, abs=1e-6)
    with pytest.raises(ExportError, match="lie outside 32 bits"):
        exporter.encode(profile, attrs.evolve(goal, axes=(attrs.evolve(goal.axes[0], modulo=None),)))


def test_a_table_of_counts_may_pass_the_end_of_32_bits():
    goal = target(start=2147.0, unit="counts", modulo=2.0**32)
    (file,) = csv_table.encode(quintic((2147.0, 2149.0), duration=4.0), goal)
    places = [int(line.split(b",")[1]) for line in file.content.splitlines()[1:]]
    assert (places[0], places[-1]) == (2_147_000_000, 2_149_000_000 - 2**32)
    assert csv_table.replay(file.content, goal).position[-1, 0] == pytest.approx(2149.0, abs=1e-6)


def test_what_no_axis_of_that_kind_takes_is_refused():
    goal, profile = target(start=5.0, **RING), quintic((5.0, 14.0), duration=4.0)
    log = exporter.encode(profile, goal)[0].content
    altered = log.replace(struct.pack("<i", setpoints(log)[0]).hex().upper().encode(), b"00000100", 1)
    assert altered != log
    with pytest.raises(ExportError, match=r"65536 counts lies outside the turn of axis\.modulo"):
        exporter.replay(altered, goal)
    (file,) = csv_table.encode(profile, goal)
    lines = file.content.splitlines(keepends=True)
    lines[3] = lines[3].replace(lines[3].split(b",")[1], b"6.3", 1)
    with pytest.raises(ExportError, match=r"line 4: axis cart: 6\.3 lies outside 0 to 6\.28"):
        csv_table.replay(b"".join(lines), goal)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"counts_per_si": 1000.0}, r"has 6283\.1853\d* counts, which are not whole, .* \[COUNTS, 6\.283185"),
        ({"modulo": 2.0**31, "counts_per_si": 1.5}, "has 3221225472 counts; drives count 2 to 2147483648"),
        (
            {"sync_period": 0.1, "modulo": 0.6, "counts_per_si": 10.0},
            "goes half a turn .* in a cycle",
        ),
        ({"travel": {"cart": (0.0, 15.0)}}, r"can\.travel\.cart states ends; state only one"),
    ],
)
def test_turns_that_do_not_fit(options, reason):
    goal = target(start=5.0, **RING | options)
    with pytest.raises(ExportError, match=reason):
        exporter.encode(quintic((5.0, 14.0), duration=4.0), goal)


def ring(**axis):
    document = preset_spec("flexible-joint").to_dict()
    document["axis"]["hub"] |= {"unit": "deg", "modulo": 360.0} | axis
    return spec_from_dict(document)


@pytest.mark.parametrize("dialect", ["sew", "kollmorgen", "lenze"])
def test_a_cam_that_is_interpolated_never_begins_anew(dialect):
    goal = target(start=5.0, export={"csv_dialect": dialect, "csv_columns": ("position",)}, **RING)
    with pytest.raises(ExportError, match="is interpolated through its ends"):
        csv_table.encode(quintic((5.0, 14.0), duration=4.0), goal)


def test_formats_and_blocks_that_never_begin_anew_refuse(tmp_path):
    able = "export can, csv, plc, plcopen-xml, siemens-scl, twincat, or"
    with pytest.raises(
        ExportError, match=rf"axis\.modulo = 360 deg, and codesys takes no modulo axes; {able}"
    ):
        design(ring(), ["csv", "codesys"], tmp_path)
    with pytest.raises(ExportError, match="planner blocks take no modulo axes"):
        deploy_planner(ring(), ["plc"], tmp_path)
    assert not any(tmp_path.iterdir())


def test_specs_without_a_turn_are_hashed_as_before():
    assert "modulo" not in preset_spec("flexible-joint").to_dict()["axis"]["hub"]


@pytest.mark.parametrize(
    ("move", "options"),
    [
        ((5.0, 14.0), {}),
        ((-0.5, -7.0), {}),
        ((20.0, 21.0), {"mode": "csv", "following_error": 0.1}),
        ((-6.0, -7.2), {"feed_forward": "both", "torque_per_acceleration": 40.0}),
    ],
)
def test_a_stream_passes_the_end_of_the_turn(move, options):
    with Bench(
        profile=quintic(move, duration=4.0), make=DriveVariant(**NARROW), start=move[0], **RING, **options
    ) as bench:
        record = bench.run()
        assert record.phase is Phase.DONE, record.reason
        places = [place for _, place in bench.positions()]
    assert min(places) >= 0 and max(places) < COUNTS
    assert abs(record.final[0] / (COUNTS / (2.0 * np.pi)) - move[1]) < 1e-3


def test_a_stand_on_the_other_side_of_the_turn_s_end_is_near():
    """5 counts behind 0, where the motion begins at 0."""
    with Bench(
        profile=quintic((0.0, 3.0), duration=4.0), stand=[COUNTS - 5], make=DriveVariant(**NARROW), **RING
    ) as bench:
        assert bench.run().phase is Phase.DONE
        places = [place for _, place in bench.positions()]
    assert places[0] == COUNTS - 5 and places[-1] == round(3.0 * RING["counts_per_si"])
    assert all(place >= COUNTS - 6 or place <= places[-1] + 1 for place in places)


@pytest.mark.parametrize("encoder", [csv_table, exporter])
def test_a_turn_in_counts_is_whole(encoder):
    """Else a table would hold a count that is none of the turn's, and up to one beside the motion's place."""
    goal = target(start=5.0, **RING | {"unit": "counts", "modulo": COUNTS + 0.5})
    with pytest.raises(
        ExportError, match=r"65536\.5 counts, which are not whole, .*; state all counts of a turn"
    ):
        encoder.encode(quintic((5.0, 14.0), duration=4.0), goal)


@pytest.mark.parametrize(
    ("make", "options", "reason"),
    [
        (DriveVariant(lacks=(0x607B,), **NARROW), {}, "Without 607Bh, it must begin anew by itself"),
        (DriveVariant(lacks=(0x607B,), **NARROW), {"without": ("607Bh",)}, "outside the turn of axis.modulo"),
    ],
)
def test_a_drive_that_counts_on_is_not_moved(make, options, reason):
    move = (14.0, 5.0)
    with Bench(profile=quintic(move, duration=4.0), start=14.0, make=make, **RING, **options) as bench:
        record = bench.run()
        assert record.phase is Phase.ABORTED and reason in record.reason
        assert not bench.drive.was_enabled
