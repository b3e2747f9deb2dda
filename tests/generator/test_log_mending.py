"""Logs as loggers leave them: repaired and told, or refused with the place; never another machine.

Swings come from a textbook's equation of a pendulum, integrated by scipy; clocks and faults from here.
"""

import zipfile
from datetime import UTC, datetime, timedelta
from functools import cache

import numpy as np
import pytest
from command_line import error_of
from scipy.integrate import solve_ivp

from gen_profile.spec.reading import preset_spec
from gen_profile.studies.identification.identify import identify, read_swing
from gen_profile.studies.identification.log_clock import seconds_of
from gen_profile.studies.identification.log_signal import jumps
from gen_profile.support.errors import GenProfileError, InfeasibleProblem, OutputError

SPEC = preset_spec("single-pendulum-crane", ["plant.c=0"])
ROPE, HOISTED, DECAY = 4.3, 1.0, 0.004  # m, m that the hoist adds at the move's target, 1/s
NOON = datetime(2026, 7, 27, 23, 59, 50, tzinfo=UTC)


@cache
def swing(rate=20.0, lasts=40.0, angle=0.06, friction=0.0):
    """Times and angles of a pendulum, damped by its rate and by its rate's direction."""
    times = np.arange(0.0, lasts, 1.0 / rate)

    def rates(_, x):
        dry = friction * np.tanh(x[1] / 1e-4)
        return [x[1], -9.81 / (ROPE + HOISTED) * np.sin(x[0]) - 2.0 * DECAY * x[1] - dry]

    found = solve_ivp(rates, (0.0, lasts), [angle, 0.0], "DOP853", times, rtol=1e-9, atol=1e-11)
    noise = np.random.default_rng(5).normal(0.0, 3e-4, (2, len(times)))
    return times, *(found.y + noise)


def written(folder, times, *columns, head="time [s],angle [rad]"):
    rows = zip(times, *columns, strict=True)
    text = "\n".join(
        [head, *(",".join(v if isinstance(v, str) else f"{v:.6g}" for v in row) for row in rows)]
    )
    (folder / "log.csv").write_text(f"{text}\n", "utf-8")
    return folder / "log.csv"


def rope_of(log, spec=SPEC, free=("L0", "c")):
    return identify(spec, [log], list(free)).estimate


def holds(estimate, widest=0.01):
    assert abs(estimate.values["L0"] - ROPE) <= estimate.half_range["L0"] < widest
    return True


def notes(log):
    return " ".join(log.notes)


# ── clocks ───────────────────────────────────────────────────────────────────────────────────────────────

CLOCKS = {
    "ms since 1970": lambda t: f"{1785170901062 + round(1e3 * t)}",
    "µs since 1970": lambda t: f"{1785170901062000 + round(1e6 * t)}",
    "ns since 1970": lambda t: f"{1785170901062000000 + round(1e9 * t)}",
    "s since 1970": lambda t: f"{1785170901.062 + t:.3f}",
    "100 ns since 1601": lambda t: f"{134296445010620000 + round(1e7 * t)}",
    "days since 1900": lambda t: f"{46230.5 + t / 86400.0:.10f}",
    "ms since the start": lambda t: f"{12345 + 1e3 * t:.0f}",
    "µs since the start": lambda t: f"{12345 + 1e6 * t:.0f}",
    "ns since the start": lambda t: f"{12345 + 1e9 * t:.0f}",
    "a counter of 32 bits": lambda t: f"{(4294967296 - 3000000 + round(1e6 * t)) % 4294967296}",
    "ISO": lambda t: (NOON + timedelta(seconds=t)).isoformat(timespec="milliseconds"),
    "midnight": lambda t: (NOON + timedelta(seconds=t)).strftime("%H:%M:%S.%f"),
    "AM and PM": lambda t: (NOON + timedelta(seconds=t)).strftime("%m/%d/%Y %I:%M:%S.%f %p"),
    "noon": lambda t: (NOON + timedelta(hours=12, seconds=t)).strftime("%d-%b-%Y %I:%M:%S.%f %p"),
    "twelve hours": lambda t: (NOON + timedelta(hours=12, seconds=t)).strftime("%I:%M:%S.%f"),
    "seconds of the day": lambda t: f"{(86390.0 + t) % 86400.0:.3f}",
    "Siemens": lambda t: (NOON + timedelta(seconds=t)).strftime("DT#%Y-%m-%d-%H:%M:%S.%f"),
    "before the trigger": lambda t: f"{t - 30.0:.3f}",
}


@pytest.mark.parametrize("clock", CLOCKS.values(), ids=CLOCKS)
def test_clocks_are_read(tmp_path, clock):
    times, angles, _ = swing()
    log = read_swing(
        written(tmp_path, map(clock, times.tolist()), angles, head="timestamp,angle [rad]"), SPEC
    )
    assert log.times == pytest.approx(times, abs=2e-4)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("12:30:00 AM", 1800.0),
        ("12:30:00 pm", 45000.0),
        ("1:02:03,5", 3723.5),
        ("02:03.25", 123.25),
        ("10:00:00:250", 36000.25),
        ("11/27/2026 11:00:00 p.m.", 82800.0),
    ],
)
def test_times_of_day(text, seconds):
    assert seconds_of(text) == pytest.approx(seconds)


def test_a_clock_that_tells_whole_seconds_only(tmp_path):
    times, angles, _ = swing()
    stamps = ((NOON + timedelta(seconds=t + 0.3)).strftime("%H:%M:%S") for t in times.tolist())
    log = read_swing(written(tmp_path, stamps, angles, head="t,angle [rad]"), SPEC)
    assert "taken to be 0.05 s apart" in notes(log)
    assert np.diff(log.times) == pytest.approx(0.05, abs=1e-9) and holds(rope_of(log))


# ── controllers ──────────────────────────────────────────────────────────────────────────────────────────

CONTROLLERS = {  # rows of a second column that is not the swing, as controllers and their tools export them
    "CODESYS 2.3, trace in an ASCII file": (
        "CoDeSys Trace\nC:\\PROJECTS\\CRANE.PRO\nCycle PLC_PRG.fAngle PLC_PRG.fLift\n",
        lambda n, t, a: f"{1e3 * t:.0f} {a:.6f} 0.5",
    ),
    "a time beside each variable": (
        "Timestamp [us];PLC_PRG.fAngle [rad];Timestamp [us];PLC_PRG.fLift\n",
        lambda n, t, a: f"{1e6 * t:.0f};{a:.6f};{1e6 * t:.0f};0.5",
    ),
    "TIA Portal, rows that are counted": (
        "Sample;Timestamp;fAngle [rad]\n",
        lambda n, t, a: f"{n};{NOON + timedelta(seconds=t):%Y-%m-%d %H:%M:%S.%f};{a:.6f}".replace(".", ","),
    ),
    "S7 data log, past midnight": (
        "Record,Date,UTC Time,fAngle [rad]\n",
        lambda n, t, a: f"{n},{NOON + timedelta(seconds=t):%m/%d/%Y,%H:%M:%S.%f},{a:.6f}",
    ),
    "S7 data log, variables called otherwise": (
        "Record,Date,UTC Time,Tag_1\n",
        lambda n, t, a: f"{n},{NOON + timedelta(seconds=t):%m/%d/%Y,%H:%M:%S},{a:.6f}",
    ),
}


@pytest.mark.parametrize("head, row", CONTROLLERS.values(), ids=CONTROLLERS)
def test_exports_of_controllers(tmp_path, head, row):
    times, angles, _ = swing()
    rows = (row(n, t, a) for n, (t, a) in enumerate(zip(times.tolist(), angles.tolist(), strict=True)))
    (tmp_path / "trace.csv").write_text(head + "\n".join(rows) + "\n", "utf-8")
    assert holds(rope_of(read_swing(tmp_path / "trace.csv", SPEC)))


# ── faults of rows ───────────────────────────────────────────────────────────────────────────────────────


def texts(times, angles):
    return [f"{t:.3f}" for t in times.tolist()], [f"{v:.5f}" for v in angles.tolist()]


def put(cells, places, values):
    for place, value in zip(places, values, strict=True):
        cells[place] = value


def without_values(t, v, random):
    put(
        v,
        random.choice(len(v), len(v) // 10, replace=False),
        random.choice(["NaN", "", "-", "inf"], len(v) // 10),
    )


def garbled(t, v, random):
    put(v, random.choice(len(v), 9, replace=False), random.choice(["ERR", "0.0.1", "x", "1e99"], 9))


def twice(t, v, random):
    for place in sorted(random.choice(len(v), 15, replace=False).tolist(), reverse=True):
        t.insert(place, t[place]), v.insert(place, v[place])


def of_one_time(t, v, random):
    for place in random.choice(len(v) - 1, 9, replace=False).tolist():
        t[place + 1] = t[place]


def late(t, v, random):
    for place in random.choice(len(v) - 6, 9, replace=False).tolist():
        t.insert(place + 5, t.pop(place)), v.insert(place + 5, v.pop(place))


def gaps(t, v, random):
    for place in random.choice(len(v) - 60, 3, replace=False).tolist():
        del t[place : place + 40], v[place : place + 40]


def jumping(t, v, random):
    put(v, random.choice(len(v), 9, replace=False), random.choice(["0.9", "-0.7", "0.5"], 9))


def backwards(t, v, random):
    t.reverse(), v.reverse()


def headed_again(t, v, random):
    t.insert(len(t) // 3, "time [s]"), v.insert(len(v) // 3, "angle [rad]")


FAULTS = [without_values, garbled, twice, of_one_time, late, gaps, jumping, backwards, headed_again]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_mended_and_told(tmp_path, fault):
    t, v = texts(*swing()[:2])
    fault(t, v, np.random.default_rng(1))
    log = read_swing(written(tmp_path, t, v), SPEC)
    assert len(log.notes) == (0 if fault is gaps else 1)
    assert len(log.times) > 600 and holds(
        rope_of(log, free=["L0"], spec=preset_spec("single-pendulum-crane", [f"plant.c={DAMPING}"]))
    )


DAMPING = 2.0 * DECAY * 2000.0 * (ROPE + HOISTED) ** 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_whatever_faults_meet_the_rope_is_right_or_the_log_refused(tmp_path, seed):
    """Any clock, and faults of several kinds at once, some more often than a log may have."""
    random = np.random.default_rng(seed)
    times, angles, rates = swing(rate=float(random.choice([10.0, 20.0, 50.0])))
    signal = str(random.choice(["angle", "rate"]))
    t, v = texts(times, angles if signal == "angle" else rates)
    clock = random.choice(list(CLOCKS.values()))
    t = [clock(float(one)) for one in t]
    for fault in random.choice(np.array(FAULTS), random.integers(1, 4), replace=False):
        fault(t, v, random)
    unit = "rad" if signal == "angle" else "rad/s"
    try:
        log = read_swing(written(tmp_path, t, v, head=f"timestamp,x [{unit}]"), SPEC, signal=signal)
        found = rope_of(log)
    except GenProfileError as refusal:
        assert "row " in str(refusal) or "is not of this machine" in str(refusal)
        return
    assert abs(found.values["L0"] - ROPE) <= found.half_range["L0"], notes(log)


def test_more_faults_than_a_log_may_have_are_all_told(tmp_path):
    t, v = texts(*swing()[:2])
    random = np.random.default_rng(1)
    garbled(t, v, random)
    put(v, range(100, 150), ["x"] * 50)
    of_one_time(t, v, random)
    with pytest.raises(OutputError) as refused:
        read_swing(written(tmp_path, t, v), SPEC)
    first, second = refused.value.sentences
    assert "which is no number of a log" in first and "row " in first
    assert "the times must rise from row to row" in second and "row " in second


@pytest.mark.parametrize("apart", [-40.0, 600.0])
def test_of_several_runs_the_longest_is_taken(tmp_path, apart):
    times, angles, _ = swing()
    both = np.concatenate([times[:300], times + times[299] + apart])
    log = read_swing(written(tmp_path, both, np.concatenate([angles[300:600], angles])), SPEC)
    assert "of 2 runs in one file the longest is taken, rows 302 to 1101" in notes(log)
    assert log.times == pytest.approx(times, abs=1e-6)


def test_a_clock_that_is_set_back_is_no_late_row(tmp_path):
    """Half a second, of which the rows between two clocks would mix two places of the swing."""
    times, angles, _ = swing()
    moved = np.where(times < 15.0, times, times - 0.5)
    log = read_swing(written(tmp_path, moved, angles), SPEC)
    assert "of 2 runs" in notes(log) and len(log.times) == 500 and holds(rope_of(log))


def test_what_is_logged_before_the_trigger_is_kept_and_told(tmp_path):
    times, angles, _ = swing()
    path = written(tmp_path, times - 30.0, angles)
    kept, cut = read_swing(path, SPEC), read_swing(path, SPEC, after=0.0)
    assert "begins 30 s before its time 0" in notes(kept) and len(kept.times) == len(times)
    assert len(cut.times) == 200 and cut.notes == ()


@pytest.mark.parametrize("separator", [";", "\t", " ", ","])
def test_decimal_commas(tmp_path, separator):
    cell = '"{}"' if separator == "," else "{}"
    rows = zip(*texts(*swing()[:2]), strict=True)
    lines = [separator.join(cell.format(v.replace(".", ",")) for v in row) for row in rows]
    (tmp_path / "log.csv").write_text("\n".join(lines), "utf-8")
    log = read_swing(tmp_path / "log.csv", SPEC)
    assert log.times == pytest.approx(swing()[0], abs=1e-6) and log.values[0] == pytest.approx(0.06, abs=2e-3)


def test_jumps_are_no_steep_swings():
    """Of a clean one, however few samples a swing has, nothing jumps."""
    for rate in (0.5, 1.0, 3.0, 20.0, 500.0):
        times = np.arange(0.0, 200.0 / rate + 60.0, 1.0 / rate)
        values = np.exp(-0.02 * times) * np.cos(1.36 * times)
        assert not len(jumps(times, values, 1e-9)), rate
        values[len(values) // 2] += 3.0
        assert jumps(times, values, 1e-9).tolist() == [len(values) // 2]


# ── signals ──────────────────────────────────────────────────────────────────────────────────────────────


def rotated(signal, *angles):
    """Put a signal about one axis onto a sensor's three axes, which lie askew."""
    axis = np.array(
        [np.cos(angles[0]), np.sin(angles[0]) * np.cos(angles[1]), np.sin(angles[0]) * np.sin(angles[1])]
    )
    noise = np.random.default_rng(3).normal(0.0, 3e-4, (len(signal), 3))
    return (signal[:, None] * axis + noise + [0.01, -0.02, 0.005]).T


@pytest.mark.slow
def test_a_gyroscope_that_lies_askew_shows_the_rope_by_all_its_axes(tmp_path):
    """From one axis alone a wide swing looks small, and its longer period was taken for a longer rope."""
    times, _, rates = swing(angle=0.6)
    head = ",".join(f"Gyroscope {axis} (rad/s)" for axis in "xyz")
    path = written(tmp_path, times, *rotated(rates, 1.1, 0.7), head=f"Time (s),{head}")
    log = read_swing(path, SPEC, columns=("1", "2"), signal="rate")
    assert "the swing's own is taken" in notes(log)
    assert np.abs(log.values).max() == pytest.approx(np.abs(rates).max(), rel=0.01)
    assert holds(rope_of(log))


def test_axes_of_a_gantry_are_not_mixed(tmp_path):
    times, _, rates = swing()
    path = written(tmp_path, times, *rotated(rates, 1.1, 0.7), head="t,gyro_x,gyro_y,gyro_z")
    log = read_swing(path, preset_spec("gantry-crane"), columns=("t", "gyro_y"), signal="rate")
    assert log.notes == () and np.std(log.values) < 0.9 * np.std(rates)


def test_accelerations_of_a_phone(tmp_path):
    """Of the sway, without gravity, along axes that lie askew."""
    times, _, rates = swing()
    pulls = np.gradient(rates, times, edge_order=2) * (ROPE + HOISTED)
    head = ",".join(f"Linear Acceleration {axis} (m/s^2)" for axis in "xyz")
    path = written(tmp_path, times, *rotated(pulls, 0.6, 0.2), head=f"Time (s),{head}")
    log = read_swing(path, SPEC, signal="acceleration")
    assert holds(rope_of(log), widest=0.1)


def test_columns_are_chosen_by_their_names(tmp_path):
    times, _, rates = swing()
    stamps = [f"{1785170901062000000 + round(1e9 * t)}" for t in times.tolist()]
    path = written(tmp_path, stamps, times, 0.0 * times, rates, head="time,seconds_elapsed,z,gyro")
    log = read_swing(path, SPEC, signal="rate")
    assert "the times are those of column 1, the values those of column 4" in notes(log)
    assert log.values == pytest.approx(rates, abs=1e-5)


def test_a_column_of_names_or_channels_is_none_of_values(tmp_path):
    """Of InfluxDB's and of CAN loggers the first column beside the times was taken."""
    times, angles, _ = swing()
    names = [["", "_result", "0"]] * len(times)
    path = written(tmp_path, *zip(*names, strict=True), times, angles, head=",result,table,_time,_value")
    log = read_swing(path, SPEC, unit="rad")
    assert "the times are those of column 4, the values those of column 5" in notes(log)
    assert log.values == pytest.approx(angles, abs=1e-5)


@pytest.mark.parametrize(
    "drift", [lambda x: 8.0 * x, lambda x: 20.0 * x**2 - 5.0 * x, lambda x: 12.0 * np.sin(2.0 * x)]
)
def test_a_slow_drift_of_the_zero_is_no_other_machine(tmp_path, drift):
    times, angles, _ = swing(lasts=60.0)
    off = np.radians(drift(times / times[-1]) * 0.2)
    assert holds(rope_of(read_swing(written(tmp_path, times, angles + off), SPEC)))


@pytest.mark.slow
@pytest.mark.parametrize("after", [0.0, 2.3, 7.7, 20.0])
def test_dry_friction_widens_the_range_wherever_the_log_begins(tmp_path, after):
    """The spectrum's skirt hid the line, and the damping was 930 ± 26 or 220 ± 265 by where it began."""
    times, angles, _ = swing(lasts=60.0, angle=0.09, friction=1.2e-3)
    spec = preset_spec("single-pendulum-crane")
    found = rope_of(read_swing(written(tmp_path, times, angles), spec, after=after), spec)
    assert found.misfits[0] is not None and found.widened[0] > 2.0
    assert abs(found.values["L0"] - ROPE) <= found.half_range["L0"]


def test_a_damping_that_may_be_nothing_is_not_known_to_absurd_percents(tmp_path):
    times, angles, _ = swing(lasts=8.0, angle=0.004)
    undamped = preset_spec("single-pendulum-crane", ["plant.c=0"])
    with pytest.raises(InfeasibleProblem) as refused:
        rope_of(read_swing(written(tmp_path, times, angles * np.exp(0.02 * times)), undamped), undamped)
    assert "N m s/rad only, which may be nothing" in str(refused.value) and "%" not in str(refused.value)


# ── files ────────────────────────────────────────────────────────────────────────────────────────────────

MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"


def workbook(path, times, values, names=("Time (s)", "Gyroscope x (rad/s)")):
    """Write a workbook as ECMA-376 has it: names shared, numbers in cells that may be left out."""
    strings = "".join(f"<si><t>{name}</t></si>" for name in names)
    head = '<row r="1"><c r="A1" t="s"><v>0</v></c><c r="C1" t="s"><v>1</v></c></row>'
    rows = "".join(
        f'<row r="{k}"><c r="A{k}"><v>{t!r}</v></c><c r="C{k}"><v>{v!r}</v></c></row>'
        for k, (t, v) in enumerate(zip(times.tolist(), values.tolist(), strict=True), 2)
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/workbook.xml", f'<workbook xmlns="{MAIN}"/>')
        archive.writestr("xl/sharedStrings.xml", f'<sst xmlns="{MAIN}">{strings}</sst>')
        sheet = f'<worksheet xmlns="{MAIN}"><sheetData>{head}{rows}</sheetData></worksheet>'
        archive.writestr("xl/worksheets/sheet1.xml", sheet)


def test_a_workbook_is_read(tmp_path):
    times, _, rates = swing()
    workbook(tmp_path / "log.xlsx", times, rates)
    log = read_swing(tmp_path / "log.xlsx", SPEC, signal="rate")
    assert np.array_equal(log.times, times) and np.array_equal(log.values, rates)


def test_a_table_in_an_archive_is_read(tmp_path):
    times, angles, _ = swing()
    with zipfile.ZipFile(tmp_path / "log.zip", "w") as archive:
        archive.write(written(tmp_path, times, angles), "Raw Data.csv")
        archive.writestr("meta/device.csv", "property,value\n")
    assert read_swing(tmp_path / "log.zip", SPEC).times == pytest.approx(times)
    with zipfile.ZipFile(tmp_path / "log.zip", "a") as archive:
        archive.writestr("Accelerometer.csv", "t,a\n")
    with pytest.raises(OutputError, match=r"holds 2 tables \(Raw Data.csv, Accelerometer.csv\); unpack it"):
        read_swing(tmp_path / "log.zip", SPEC)


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("xl/worksheets/sheet1.xml", "<!DOCTYPE x [<!ENTITY a 'b'>]><x>&a;</x>", "declares a document type"),
        ("xl/worksheets/sheet1.xml", "<worksheet>", "is damaged"),
        ("readme.txt", "", "without a table"),
        ("log.csv", "0;" * 3000, "unpacks to more than 0 MiB"),
    ],
)
def test_archives_that_are_none_are_refused(tmp_path, monkeypatch, name, content, why):
    monkeypatch.setattr("gen_profile.studies.identification.log_table.MOST_BYTES", 2000)
    with zipfile.ZipFile(tmp_path / "log.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    with pytest.raises(OutputError, match=why):
        read_swing(tmp_path / "log.zip", SPEC)


def test_an_export_of_twincat_scope_is_read(tmp_path):
    """Milliseconds from the first, decimal commas, and a dozen lines of a channel's properties before."""
    times, angles, _ = swing()
    head = [
        "Name\tScope 1",
        "StartRecord\t134296445010620000\tMontag",
        "",
        "Name\tangle",
        "SampleTime[ms]\t50",
    ]
    head += ["SymbolName\tMAIN.fAngle", "Data-Type\tREAL64", "Offset\t0", "ScaleFactor\t1", "BitMask\t0"]
    rows = [f"{1e3 * t:.0f}\t{v:.6f}".replace(".", ",") for t, v in zip(times, angles, strict=True)]
    (tmp_path / "scope.csv").write_text("\r\n".join([*head, *rows, "EOF"]), "utf-8")
    log = read_swing(tmp_path / "scope.csv", SPEC)
    assert log.times == pytest.approx(times) and log.values == pytest.approx(angles, abs=1e-6)


def test_a_refused_log_is_drawn(tmp_path):
    times, angles, _ = swing()
    path = written(tmp_path, times, np.degrees(angles) * 20.0, head="t,angle")
    words = ("--swing", path, "--free", "L0", "--plot", tmp_path / "log.svg")
    assert "is it in deg?" in error_of("identify", "--preset", "single-pendulum-crane", *words)
    assert "As it was read." in (tmp_path / "log.svg").read_text("utf-8")
