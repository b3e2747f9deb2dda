"""Drives that count velocities and accelerations in rpm, or in m/s, in place of their positions' counts."""

import csv
import io
import math
import re
import struct
from fractions import Fraction

import cantools
import numpy as np
import pytest
from exporters.can.bench import QUICK_STOP, Bench
from exporters.motions import quintic, target

from gen_profile.spec.can import CanSpec
from gen_profile.support.errors import ExportError, SpecError
from gen_profile_exporters.can.drive_units import ACCELERATION_UNIT, VELOCITY_UNIT, DriveUnit, unit_of
from gen_profile_exporters.can.export import exporter
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.record import Phase

TURN = 4096  # counts to a revolution
INCREMENTS, MILLI_RPM, RPM, RPM_PER_S = 0x00B5_0000, 0xFDB4_4700, 0x00B4_4700, 0x00C0_0300
# as maxon's EPOS4 holds them, which lets neither be changed
MAXON = DriveVariant(units=(INCREMENTS, RPM, RPM_PER_S), fixed_units=True, encoder=(TURN, 1), miss="hold")
# as Festo's CMMT holds them: µm, mm/s and mm/s²
FESTO = DriveVariant(units=(0xFA01_0000, 0xFD01_0300, 0xFD01_5700), counts_per_si=1e6, miss="hold")
IN_RPM = {"velocity_unit": "rpm", "acceleration_unit": "rpm/s", "counts_per_revolution": float(TURN)}
IN_MILLIMETRES = {"velocity_unit": "0.001 m/s", "acceleration_unit": "0.001 m/s^2"}
CSV = {"mode": "csv", "following_error": 0.02, "sync_period": 0.01}
MOVE = quintic((0.0, 0.3), duration=2.0)


@pytest.mark.parametrize(
    ("index", "value", "unit"),
    [
        (VELOCITY_UNIT, RPM, DriveUnit(0, "rpm")),
        (VELOCITY_UNIT, MILLI_RPM, DriveUnit(-3, "rpm")),
        (VELOCITY_UNIT, 4244701952, DriveUnit(-3, "m/s")),
        (ACCELERATION_UNIT, 4244723456, DriveUnit(-3, "m/s^2")),
        (ACCELERATION_UNIT, RPM_PER_S, DriveUnit(0, "rpm/s")),
        (VELOCITY_UNIT, 0x00B5_0300, DriveUnit(0, "counts/s")),
        (VELOCITY_UNIT, 0x0000_0300, DriveUnit(0, "counts/s")),
        (VELOCITY_UNIT, 0x00C1_0300, None),
        (VELOCITY_UNIT, 0, None),
    ],
)
def test_what_makers_write_into_the_objects(index, value, unit):
    assert unit_of(index, value) == unit


@pytest.mark.parametrize("make", [MAXON, FESTO], ids=["rpm", "mm/s"])
@pytest.mark.parametrize("mode", [CSV, {"feed_forward": "velocity", "sync_period": 0.01}], ids=["csv", "csp"])
def test_units_that_the_spec_does_not_state_are_refused(make, mode):
    """The axis would go 15 times too fast, or its quick stop brake by other than the ramp."""
    with Bench(profile=MOVE, make=make, **mode) as bench:
        record = bench.run()
        assert record.phase is Phase.ABORTED
        assert not bench.drive.was_enabled
    assert "the drive counts in" in record.reason
    assert "state can.velocity_unit = " in record.reason


def test_an_acceleration_alone_counts_too():
    with Bench(profile=MOVE, make=MAXON, sync_period=0.01) as bench:
        record = bench.run()
    assert "counts in rpm/s where the spec has counts/s^2 (60AAh is 00C00300h)" in record.reason
    assert "state can.acceleration_unit = 'rpm/s', and export again" in record.reason


@pytest.mark.parametrize(("make", "units"), [(MAXON, IN_RPM), (FESTO, IN_MILLIMETRES)], ids=["rpm", "mm/s"])
@pytest.mark.parametrize("mode", [CSV, {"feed_forward": "velocity", "sync_period": 0.01}], ids=["csv", "csp"])
def test_stated_units_lead_the_axis_along_the_motion(make, units, mode):
    with Bench(profile=MOVE, make=make, **mode, **units) as bench:
        record = bench.run()
        assert record.phase is Phase.DONE, record.reason
        unit = TURN / 60 if make is MAXON else 1e3  # counts/s
        assert abs(bench.drive.actual - 300_000) <= unit * 0.01
        at, position = np.array(bench.positions()).T
    speed = np.abs(np.diff(position) / np.diff(at)).max() * 1e3  # counts/s
    assert speed == pytest.approx(1.875 * 300_000 / 2.0, rel=0.01)


@pytest.mark.parametrize(
    ("make", "units", "ramp"),
    [(MAXON, IN_RPM, TURN / 60), (FESTO, IN_MILLIMETRES, 1e3)],
    ids=["rpm", "mm/s"],
)
def test_a_quick_stop_brakes_by_the_ramp_of_the_spec(make, units, ramp):
    """By what the axis does on the bus, not by what was written."""
    with Bench(profile=MOVE, make=make, sync_period=0.01, quick_stop=0.9, **units) as bench:
        bench.at_cycle(120, lambda: bench.say(0x081, struct.pack("<HB5x", 0x2310, 1)))
        bench.run()
        (begun, *_) = [frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP]
        at, position = np.array(bench.positions()).T
        written = bench.asked(0x6085)
    speed = np.diff(position) / np.diff(at) * 1e3
    braking = speed[(at[1:] > begun + 30) & (at[1:] < begun + 150)]
    slope = -np.polyfit(np.arange(len(braking)) * 0.01, braking, 1)[0]
    assert slope == pytest.approx(0.9e6, rel=0.02)
    assert written is None or written != math.ceil(0.9e6 / ramp)  # put back once the axis stands


def test_start_up_lists_hold_the_drives_own_units():
    written = {
        file.filename: file.content for file in exporter.encode(MOVE, target(quick_stop=0.93, **IN_RPM))
    }
    rows = list(csv.DictReader(io.StringIO(written["bay-3.startup.csv"].decode())))
    values = {row["object"]: row for row in rows}
    assert int(values["6085h"]["value"]) == math.ceil(0.93e6 / (TURN / 60))  # 13 624 rpm/s, no 930 000
    assert values["6085h"]["meaning"] == "deceleration of a quick stop (rpm/s)"
    assert values["60A9h"]["value"] == "0x00B44700"
    assert values["60AAh"]["value"] == "0x00C00300"
    assert [row["object"] for row in rows].index("60AAh") < [row["object"] for row in rows].index("6085h")


@pytest.mark.parametrize("options", [CSV, {"feed_forward": "velocity"}], ids=["csv", "csp"])
@pytest.mark.parametrize("units", [IN_RPM, IN_MILLIMETRES, {}], ids=["rpm", "mm/s", "counts"])
def test_logs_databases_and_replays_agree(options, units):
    """cantools decodes m/s of the frames; the replayed motion is the planned one."""
    goal = target(**options, **units)
    written = {file.filename: file.content for file in exporter.encode(MOVE, goal)}
    replayed = exporter.replay(written["bay-3.log"], goal)
    times = np.arange(len(replayed.position)) * replayed.cycle_time
    unit = {"rpm": TURN / 60, "0.001 m/s": 1e3}.get(units.get("velocity_unit"), 1.0) / 1e6  # m/s
    path = MOVE(np.minimum(times, MOVE.duration))
    near = unit * replayed.cycle_time if options is CSV else 1e-6
    np.testing.assert_allclose(
        replayed.position[:, 0] - replayed.position[0, 0], path.position[:, 0], atol=near
    )
    database = cantools.database.load_string(written["bay-3.dbc"].decode(), "dbc")
    message = database.get_message_by_name("cart_Setpoint")
    frames = [line.split()[2] for line in written["bay-3.log"].decode().splitlines() if " 301#" in line]
    (name,) = [signal.name for signal in message.signals if "Velocity" in signal.name]
    decoded = [message.decode(bytes.fromhex(frame.split("#")[1]))[name] for frame in frames]
    means = np.diff(path.position[:, 0]) / replayed.cycle_time if options is CSV else path.velocity[:-1, 0]
    np.testing.assert_allclose(decoded[: len(means)], means, atol=1.01 * unit)


def test_revolutions_must_be_known():
    with pytest.raises(ExportError, match=r"can.counts_per_revolution: required, as can.acceleration_unit"):
        exporter.encode(MOVE, target(acceleration_unit="rpm/s"))
    with pytest.raises(ExportError, match=r"can.velocity_unit: 'rad/s' does not measure the axis cart"):
        exporter.encode(MOVE, target(velocity_unit="rad/s", **CSV))


@pytest.mark.parametrize("unit", ["counts/min", "2 rpm", "0.02 rpm", "rpm/s", "-1 rpm", ""])
def test_other_units_are_sentences(unit):
    with pytest.raises(SpecError, match=r"can.velocity_unit: must be counts/s, rpm"):
        CanSpec(velocity_unit=unit)


@pytest.mark.parametrize(
    ("make", "units", "reason"),
    [
        (
            MAXON,
            {**IN_RPM, "counts_per_revolution": 2000.0},
            "is 2000 counts by can.counts_per_revolution, and 4096",
        ),
        (
            MAXON,
            {**IN_RPM, "velocity_unit": "0.001 rpm"},
            "60A9h:00 .* must hold FDB44700h, but the drive keeps B44700h",
        ),
        (
            DriveVariant(units=(0xF901_0000, 0, 0)),
            {},
            r"counts 1e\+07 to a metre .* and the spec 1e\+06; state axis",
        ),
        (
            DriveVariant(units=(INCREMENTS, 0, 0x00DD_DD00)),
            {},
            "counts in a unit that is not known here",
        ),
    ],
)
def test_what_the_drive_says_is_believed_more(make, units, reason):
    with Bench(profile=MOVE, make=make, sync_period=0.01, **units) as bench:
        record = bench.run()
        assert not bench.drive.was_enabled
    assert re.search(reason, record.reason), record.reason


def test_a_power_of_ten_is_set_and_put_back():
    make = DriveVariant(units=(INCREMENTS, RPM, RPM_PER_S), encoder=(TURN, 1), miss="hold")
    seen = set()
    with Bench(profile=MOVE, make=make, **CSV, **{**IN_RPM, "velocity_unit": "0.001 rpm"}) as bench:
        bench.clock.actors.append(lambda: seen.add(bench.drive.value(0x60A9)))
        record = bench.run()
        assert record.phase is Phase.DONE, record.reason
        assert seen == {RPM, MILLI_RPM}
        assert bench.drive.value(0x60A9) == RPM
        assert abs(bench.drive.actual - 300_000) <= 1


def test_a_code_that_is_not_known_may_mean_what_is_stated():
    make = DriveVariant(units=(INCREMENTS, 0x00DD_DD00, 0x00DD_DD00), fixed_units=True)
    with Bench(profile=MOVE, make=make, sync_period=0.01, acceleration_unit="counts/s^2") as bench:
        assert bench.run().phase is Phase.DONE


def test_a_planner_counts_in_them_as_well():
    """Scaling is one for all sources of setpoints; its rounding is carried over from cycle to cycle."""
    goal = target(**CSV, **IN_RPM)
    velocity = exporter.setpoints(exporter.sampled(MOVE, goal, 0.01, "can.sync_period"), goal).velocity
    travelled = sum(Fraction(int(v)) * TURN / 60 / 100 for v in velocity[:, 0])
    assert abs(travelled - 300_000) <= Fraction(TURN, 60) / 100
