"""Identification against simulated machines whose parameters are known."""

import math
import re
from functools import partial

import numpy as np
import pytest
from command_line import error_of, run_here
from generator.free_swings import periods, swing
from generator.lagrangian_machines import Lagrange
from scipy.integrate import solve_ivp

from gen_profile.dynamics.evaluation.simulation import free_swing
from gen_profile.plants.registry import find_plant
from gen_profile.spec.reading import preset_spec, read_spec
from gen_profile.studies.identification.identify import identify, write_spec
from gen_profile.studies.identification.measurements import (
    DirectReading,
    Period,
    parse_period,
    parse_reading,
    parse_swing,
)
from gen_profile.support.errors import CosimulationError, OutputError, SpecError

CRANE, HOIST = find_plant("double-pendulum-crane"), find_plant("single-pendulum-crane")


# ── from text ────────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("sign", ["±", "+-", "+/-", " ± "])
def test_readings(sign):
    reading = parse_reading(f"L1=0.47{sign}5e-3")
    assert reading == DirectReading(parameter="L1", value=0.47, uncertainty=0.005)
    assert parse_period(f"17.3{sign}0.2/10") == Period(mode=1, seconds=1.73, uncertainty=0.02)
    assert parse_period(f"2:0.7{sign}.01") == Period(mode=2, seconds=0.7, uncertainty=0.01)


@pytest.mark.parametrize("text", ["L1=0.47", "0.47±0.1", "L1=0.47±0", "L1=±0.1", "L1=0.47±-1", ""])
def test_faulty_readings(text):
    with pytest.raises(SpecError, match=r"^measured"):
        parse_reading(text)


@pytest.mark.parametrize("text", ["1.7", "1.7±0", "0:1.7±0.1", "1.7±0.1/0", "0±1", "a:1±1", "1.7±0.1/2.5"])
def test_faulty_periods(text):
    with pytest.raises(SpecError, match=r"^period"):
        parse_period(text)


def log_of(text, columns=("1", "2"), after=0.0):
    return parse_swing(
        text,
        "swing.csv",
        columns=columns,
        per_second=1.0,
        per_unit=180.0 / np.pi,
        after=after,
        quantity="angle",
        load="hook",
    )


ROWS = [(0.1 * k, 10.0 * (-1) ** k) for k in range(40)]


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), ("\t", "."), (" ; ", "."), (";", ","), ("\t", ",")]
)
def test_logs_with_and_without_a_header(separator, decimal):
    bare = "\n".join(f"{t:.1f}~{v}".replace(".", decimal).replace("~", separator) for t, v in ROWS)
    headed = log_of(f'"t"{separator}angle\n\n{bare}\n', ("t", "angle"))
    for log in (headed, log_of(bare), log_of(f"t{separator}angle\n{bare}")):
        np.testing.assert_allclose(log.times, [t for t, _ in ROWS])
        np.testing.assert_allclose(log.values, np.radians([v for _, v in ROWS]))
    late = log_of(bare, after=1.0)
    assert (len(late.times), late.times[0]) == (30, 0.0)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "the log is empty"),
        ("t;a\n1;2\n", "needs at least 16 samples, found 1"),
        ("t;a\n1;x\n", "row 2: a holds 'x', which is no number"),
        (
            "\n".join("0;1" for _ in range(20)),
            r"found 1 \(19 rows that were logged twice, the first .* row 2",
        ),
        (
            "\n".join(f"0;{k}" for k in range(20)),
            "row 2: the times must rise from row to row, and 0 follows 0",
        ),
        (
            "Logger 3\n\nt;a\n"
            + "".join(f"{time};{k}\n" for k, time in enumerate([*range(9), *([5, 9] * 4), *range(10, 40)])),
            "row 13: the times must rise from row to row, and 5 follows 8; .* where the clock was set back",
        ),
    ],
)
def test_faulty_logs(text, why):
    with pytest.raises(OutputError, match=why):
        log_of(text)


HEADS = {
    "units": ["t;angle", "s;deg"],
    "remarks": ["Logger 3, 2026-05-01", "station=bay 3", "t;angle", "[s];[deg]"],
    "numbers among the remarks": ["12;34;logger", "t;angle;remark"],
}


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
def test_what_loggers_write_above_the_numbers_is_passed_over(head):
    rows = [f"{t:.1f};{v}" for t, v in ROWS]
    log = log_of("\n".join([*head, *rows]), ("t", "angle"))
    np.testing.assert_allclose(log.times, [t for t, _ in ROWS])
    np.testing.assert_allclose(log.values, np.radians([v for _, v in ROWS]))
    assert np.array_equal(log_of("\n".join(["# bay 3", "", *rows]), ("1", "2")).values, log.values)


def test_rows_without_a_value_are_left_out():
    rows = [f"{t:.1f};{v if k % 3 else ''}" for k, (t, v) in enumerate(ROWS)]
    log = log_of("\n".join(["t;angle", *rows]))
    np.testing.assert_allclose(log.times, [t - ROWS[1][0] for k, (t, _) in enumerate(ROWS) if k % 3])


@pytest.mark.parametrize(
    "mark", ["2026-03-29T01:59:58.{}Z", "2026-03-29 01:59:58,{}", "29.3.2026 01:59:58,{}", "01:59:58.{}"]
)
def test_dates_count_from_the_first(mark):
    """In the night in which clocks are put forward in Europe, too."""
    rows = [f"{mark.format(f'{40 * k:03d}')};{v}" for k, (_, v) in enumerate(ROWS[:25])]
    log = log_of("\n".join(["t;angle", *rows]), after=0.1)
    np.testing.assert_allclose(log.times, 0.04 * np.arange(22), atol=1e-6)


def test_readings_that_no_such_machine_shows():
    """A rope of 1,200 m swings so slowly."""
    preset = ("--preset", "single-pendulum-crane")
    outcome = run_here("identify", *preset, "--period=695±0.3/10", "--free", "L0")
    assert outcome.code == 3
    assert re.search(r"With no L0 .* not even with \d+, the most that it takes; look for", outcome.errors[-1])


def test_readings_that_cannot_all_be_right():
    readings = "--measured=L1=0.47±0.005", "--period=17.3±0.2/10", "--period=2:2.1±0.02"
    outcome = run_here("identify", *readings, "--free", "L2")
    assert outcome.code == 3
    assert re.search(r"contradict one another by \d+ times .* look for the wrong one", outcome.errors[-1])


def test_readings_beyond_what_the_machine_can_have():
    outcome = run_here("identify", "--measured=L1=-0.47±0.005", "--measured=m1=0.2±0.1")
    assert outcome.code == 2
    assert outcome.errors[-1] == "Error: --measured L1: must be from 0.01 to 200 m, found -0.47."


EXTREMES = ("0", "-1", "1e308", "5e-324", "1e400", "99999999999999999999", "nan", "1.7", "0.47")
COUNTS = ("", "/0", "/10", "/99999999999999999999", f"/{'9' * 400}")


def extreme_words(random, folder):
    """Readings, logs and options as a slip of the hand, or an enemy, writes them."""

    def one(choices):
        return str(random.choice(choices))

    words = [f"--period={one(EXTREMES)}±{one(EXTREMES)}{one(COUNTS)}" for _ in range(random.integers(2))]
    words += [f"--measured=L1={one(EXTREMES)}±{one(EXTREMES)}" for _ in range(random.integers(2))]
    if random.random() < 0.4:
        step, size = (
            float(one(("0.1", "1e-9", "1e300"))),
            float(one(("0", "0.1", "1e308", "1e-310", "inf", "nan"))),
        )
        rows = [f"{k * step!r};{size * (-1) ** k!r}" for k in range(20)]
        (folder / "log.csv").write_text("\n".join(rows), "utf-8")
        words += ["--swing", folder / "log.csv"]
        words += one(
            ("", "--at=nan", "--at=1e308", "--after=nan", "--unit=1e300deg", "--signal=sway")
        ).split()
    return [*words, "--free", one(("L1", "g", "c1"))]


def test_whatever_is_typed_ends_in_a_sentence(tmp_path):
    random = np.random.default_rng(12)
    for _ in range(80):
        words = extreme_words(random, tmp_path)
        outcome = run_here("identify", "--preset", "paper", "--out", tmp_path / "o.toml", *words)
        assert outcome.code in {0, 2, 3}, (words, outcome.errors)
        assert outcome.code == 0 or outcome.errors[-1].endswith((".", "?"))


@pytest.mark.parametrize("column", ["angel", "3", "0"])
def test_columns_that_are_not_there(column):
    with pytest.raises(OutputError, match=f"there is no column '{column}'.*angle.*[.?]$"):
        log_of("t;angle\n0;1\n", ("1", column))
    with pytest.raises(OutputError, match=f"there is no column '{column}'; there are 2, without names[.]$"):
        log_of("0;1\n", ("1", column))


# ── the whole way ────────────────────────────────────────────────────────────────────────────────────────


def test_an_identified_spec_is_designed_for(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    slow, fast = periods(**(CRANE.nominal() | {"L1": 0.5, "L2": 0.38}))
    run = run_here(
        "identify", "--preset", "paper", "--measured", "L1=0.502±0.004", "--free", "L2",
        "--period", f"{10 * slow:.2f}±0.1/10", "--period", f"2:{10 * fast:.2f}±0.1/10", "--json",
    )  # fmt: skip
    assert (run.code, run.errors) == (0, [])
    document = run.document
    assert document["path"] == "identified.toml"
    assert document["contradiction"] == 1.0
    assert document["parameters"]["L1"]["given"] == 0.47
    assert document["parameters"]["L1"]["value"] == pytest.approx(0.5, abs=0.01)
    spec = read_spec(tmp_path / "identified.toml")
    assert spec.sha256() == document["spec_sha256"]
    assert spec.plant.parameters["L2"] == pytest.approx(document["parameters"]["L2"]["value"], abs=1e-4)
    for name, row in document["parameters"].items():
        fraction = row["half_range"] / row["value"]
        stated = preset_spec("paper").robustness.uncertain.get(name, 0.0)  # is never narrowed
        assert (
            max(fraction, stated)
            <= spec.robustness.uncertain[name]
            < max(1.1 * fraction + 0.01, stated + 1e-9)
        )
    assert run_here("identified.toml", "--set", "check.residual_sway=0.02", "--no-check").code == 0


def test_a_log_is_read_and_told_of(tmp_path):
    times = np.arange(0.0, 20.0, 0.1)
    exact = swing(HOIST.nominal() | {"L0": 3.0, "c": 200.0, "m": 2000.0}, times, [0.15, 0.0], (12.0, 2.0))
    noisy = np.degrees(exact + np.random.default_rng(1).normal(0.0, 2e-3, len(times)))
    rows = "".join(f"{t:.2f};{v:.4f}\n" for t, v in zip(times + 30.0, noisy, strict=True))
    (tmp_path / "log.csv").write_text("time;angle\n29.0;80.0\n" + rows, "utf-8")
    run = run_here(
        "identify", "--preset", "single-pendulum-crane", "--set", "plant.L0=2.6", "--free", "L0",
        "--swing", tmp_path / "log.csv", "--columns", "time,angle", "--unit", "deg", "--after", "30",
        "--at", "12,2", "--out", tmp_path / "new.toml",
    )  # fmt: skip
    assert (run.code, run.errors) == (0, [])
    stages = ["reading the log", "fitting", "looking at what the fit leaves", "finding the ranges"]
    lines = [line.removesuffix(" …").partition(",")[0] for line in run.err.splitlines()]
    assert list(dict.fromkeys(lines)) == stages  # a long stage is reported again, with its seconds
    assert "log of payload" in run.out
    assert "200 samples of its angle" in run.out
    assert read_spec(tmp_path / "new.toml").plant.parameters["L0"] == pytest.approx(3.0, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("encoding", "unit", "size"),
    [("utf-16", "deg", 1.0), ("cp1252", "deg", 1.0), ("utf-8", "0.25deg", 0.25), ("utf-8", "0.25 deg", 0.25)],
)
def test_logs_of_other_computers_and_encoders(tmp_path, encoding, unit, size):
    times = np.arange(0.0, 20.0, 0.1)
    exact = np.degrees(swing(HOIST.nominal() | {"L0": 2.3, "m": 2000.0}, times, [0.15, 0.0], (12.0, 2.0)))
    counts = np.round((exact + 7.0) / 0.25) * 0.25 / size
    rows = "".join(f"{1e3 * t:.0f};{v}\n" for t, v in zip(times, counts, strict=True))
    (tmp_path / "log.csv").write_text(f"Zeit;Winkel °\n{rows}", encoding)
    run = run_here(
        "identify", "--preset", "single-pendulum-crane", "--set", "plant.c=0", "--free", "L0", "--at", "12,2",
        "--swing", tmp_path / "log.csv", "--columns", "Zeit,Winkel °", "--unit", unit, "--time-unit", "ms",
        "--out", tmp_path / "new.toml", "--json",
    )  # fmt: skip
    assert (run.code, run.errors) == (0, [])
    row = run.document["parameters"]["L0"]
    assert abs(row["value"] - 2.3) < row["half_range"] < 0.02


def test_degrees_that_are_taken_for_radians(tmp_path):
    (tmp_path / "log.csv").write_text("".join(f"{t};{v}\n" for t, v in ROWS), "utf-8")
    assert "the log's angle goes over 20 rad, more than half a turn; is it in deg?" in error_of(
        "identify", "--preset", "paper", "--free", "L1", "--swing", tmp_path / "log.csv"
    )


@pytest.mark.slow
def test_a_log_that_begins_before_the_stop(tmp_path):
    """The cart brakes for 2.5 s; the range found holds the rope all the same."""
    lagrange, true = Lagrange("single-pendulum-crane"), preset_spec("single-pendulum-crane").plant.parameters

    def rates(t, x):
        push = -0.6 if t < 2.5 else 0.0
        axes = lagrange.accelerations(
            np.array([x[0], 0.0, 4.0]), np.array([x[1], 0.0, 0.0]), np.array([push, 0.0]), true
        )
        return np.r_[x[1], axes]

    times = np.arange(0.0, 30.0, 0.1)
    exact = solve_ivp(rates, (0.0, 30.0), [0.0, 0.0], "DOP853", times, max_step=0.1).y[0]
    noisy = exact + np.random.default_rng(0).normal(0.0, 3e-3, len(times))
    (tmp_path / "log.csv").write_text(
        "".join(f"{t:.1f};{v:.5f}\n" for t, v in zip(times, noisy, strict=True)), "utf-8"
    )
    words = [
        "identify", "--preset", "single-pendulum-crane", "--set", "plant.L0=2.6", "--free", "L0",
        "--swing", tmp_path / "log.csv", "--at", "0,4", "--out", tmp_path / "new.toml",
    ]  # fmt: skip
    early, late = run_here(*words), run_here(*words, "--after", "2.5")
    assert "WARNING" in early.out
    assert "leave out what was logged before the axes stood still" in early.out
    assert "WARNING" not in late.out
    for outcome in (run_here(*words, "--json"), run_here(*words, "--after", "2.5", "--json")):
        row = outcome.document["parameters"]["L0"]
        assert abs(row["value"] - true["L0"]) <= row["half_range"]


def test_comments_stay_in_their_column(tmp_path, monkeypatch):
    """And a spec may be replaced by what was found of it."""
    monkeypatch.chdir(tmp_path)
    run_here("presets", "double-pendulum-crane", "--out", "bay.toml")
    before = (tmp_path / "bay.toml").read_text("utf-8").splitlines()
    words = ("--measured", "L1=6.123456±0.01", "--measured", "L2=1.4321±0.01", "--out", "bay.toml")
    assert run_here("identify", "bay.toml", *words).code == 0
    after = (tmp_path / "bay.toml").read_text("utf-8").splitlines()
    changed = [pair for pair in zip(before, after, strict=True) if pair[0] != pair[1]]
    assert [new.partition(" = ")[0] for _, new in changed] == ["L1", "L2", "uncertain"]
    for old, new in changed[:2]:
        assert new.index("#") == old.index("#")


def test_a_contradiction_is_told(tmp_path):
    run = run_here(
        "identify", "--measured", "L1=0.5±0.001", "--measured", "L1=0.6±0.001", "--out", tmp_path / "x.toml"
    )
    assert run.code == 0
    assert "the readings contradict one another" in run.out


@pytest.mark.parametrize(
    ("arguments", "code", "why"),
    [
        ([], 2, "Name what to identify: parameters to free (m1, m2, L1, L2, g, c1, c2), or"),
        (["--free", "L9"], 2, "--free L9: unknown parameter"),
        (["--free", "L1", "--period", "3:1±0.1"], 2, "the machine has 2 modes, found mode 3"),
        (["--free", "L1", "--period", "1±0.1", "--at", "1,2"], 2, "one position per axis (1), found 2"),
        (["--free", "L1", "--period", "1±0.1", "--at", "x"], 2, "write one number per axis"),
        (["--free", "L1", "--swing", "none.csv"], 2, "cannot read the log none.csv"),
        (["--free", "L1", "--swing", "none.csv", "--signal", "speed"], 2, "unknown signal 'speed'"),
        (["--free", "L1", "--swing", "none.csv", "--signal", "angle:crate"], 2, "unknown load 'crate'"),
        (["--free", "L1", "--swing", "none.csv", "--unit", "mm"], 2, "'mm' does not measure angle"),
        (
            ["--free", "L1", "--swing", "none.csv", "--unit", "1.2.3 deg"],
            2,
            "size of a count, as in 0.0879 deg",
        ),
        (["--free", "L1", "--swing", "none.csv", "--unit", "0 deg"], 2, "size of a count"),
        (["--free", "L1", "--swing", "none.csv", "--columns", "1"], 2, "write TIME,VALUE"),
        (["--free", "L1"], 3, "do not determine L1"),
        (["--measured", "L1=0.5±0.4"], 3, "determine L1 to ±206 % only"),
    ],
)
def test_what_cannot_be_identified(tmp_path, monkeypatch, arguments, code, why):
    monkeypatch.chdir(tmp_path)
    assert why in error_of("identify", "--preset", "paper", *arguments, code=code)
    assert list(tmp_path.iterdir()) == []


def test_a_machine_that_explodes_is_no_traceback():
    with pytest.raises(CosimulationError, match="single-pendulum-crane's swing cannot be integrated"):
        free_swing(
            HOIST,
            np.array([list((HOIST.nominal() | {"c": -1e9}).values())]),
            q_a=[0.0, 0.0],
            starts=np.array([[0.1, 0.0]]),
            times=np.linspace(0.0, 10.0, 20),
        )


def test_an_unwritable_spec(tmp_path):
    (tmp_path / "file").write_text("", "utf-8")
    with pytest.raises(OutputError, match="Cannot write"):
        write_spec(preset_spec("paper"), tmp_path / "file" / "spec.toml")


SPEC = """\
name = "bay" # ours

[plant]
type = "single-pendulum-crane"
L0 = 2.6   # m, slings
[move]
distance = [4.0, 0.0]
duration = 14.0 # s
[robustness]
uncertain = {L0 = 0.1} # of any sling
"""


@pytest.mark.slow
def test_what_the_author_of_a_spec_wrote_stays(tmp_path):
    """Comments, and a range that is wider than what one measurement leaves open."""
    (tmp_path / "bay.toml").write_text(SPEC, "utf-8")
    times = np.arange(0.0, 20.0, 0.1)
    angle = swing(HOIST.nominal() | {"L0": 3.0}, times, [0.1, 0.0], (4.0, 0.0))
    rows = "".join(f"{t:.1f};{v:.5f}\n" for t, v in zip(times, angle, strict=True))
    (tmp_path / "log.csv").write_text(rows, "utf-8")
    words = (
        "identify", tmp_path / "bay.toml", "--set", "move.duration=15.0", "--swing", tmp_path / "log.csv",
        "--free", "L0", "--out", tmp_path / "new.toml", "--plot", tmp_path / "fit.png",
    )  # fmt: skip
    run = run_here(*words)
    assert (run.code, run.errors) == (0, [])
    text = (tmp_path / "new.toml").read_text("utf-8")
    length = read_spec(tmp_path / "new.toml").plant.parameters["L0"]
    assert length == pytest.approx(3.0, abs=1e-3)
    changed = SPEC.replace("L0 = 2.6   #", f"L0 = {length} #").replace(
        "14.0", "15.0"
    )  # as far as there is room
    assert text == changed
    assert re.search(r"kept +the spec's range of L0, ±10", run.out)
    assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("preset", ["paper", "tower-crane", "mass-spring-chain"])
def test_a_written_spec_reads_back_the_same(tmp_path, preset):
    spec = preset_spec(preset)
    write_spec(spec, tmp_path / "spec.toml")
    assert read_spec(tmp_path / "spec.toml") == spec


def test_other_ranges_of_the_spec_stay_as_they_are():
    def robustness(*overrides):
        return identify(preset_spec("paper", overrides), [parse_reading("L1=0.5±0.005")]).spec.robustness

    found = robustness("robustness.uncertain={L2=0.2}", "robustness.method=none")
    assert (dict(found.uncertain), found.method) == ({"L1": 0.026, "L2": 0.2}, "none")
    assert dict(robustness("robustness.uncertain={L1=0.1}").uncertain) == {"L1": 0.1}
    assert robustness("robustness.uncertain={}", "robustness.method=none").method == "sensitivity"


@pytest.mark.parametrize(
    ("parse", "text", "cure"),
    [
        (parse_reading, "L1=6,20±0,05", "; write decimal points: L1=6.20±0.05."),
        (parse_period, "17,3±0.2/10", "; write decimal points: 17.3±0.2/10."),
    ],
)
def test_decimal_commas_are_told(parse, text, cure):
    with pytest.raises(SpecError) as refused:
        parse(text)
    assert str(refused.value).endswith(cure)


TURNED = [f"{index / 10:.1f}" for index in range(100)]


def headed(time, value, below=()):
    rows = [(seconds, f"{math.sin(float(seconds)) / 10:.6f}") for seconds in TURNED]
    text = "\n".join(";".join(row) for row in [(time, value), *below, *rows])
    places = {"columns": ("1", "2"), "after": 0.0, "quantity": "angle", "load": "payload"}
    return partial(parse_swing, text, "log.csv", **places)


@pytest.mark.parametrize(
    ("heads", "below", "second", "radian"),
    [
        (("t", "angle"), [], 1.0, 1.0),
        (("time_ms", "angle_deg"), [], 1e3, 180.0 / math.pi),
        (("Zeit [ms]", "Winkel (°)"), [], 1e3, 180.0 / math.pi),
        (("t", "angle"), [("[s]", "[deg]")], 1.0, 180.0 / math.pi),
        (("t (from the stop)", "angle (filtered)"), [], 1.0, 1.0),
    ],
)
def test_units_are_read_off_the_names(heads, below, second, radian):
    read, as_said = (
        headed(*heads, below)(per_second=a, per_unit=b) for a, b in ((None, None), (second, radian))
    )
    assert np.array_equal(read.times, as_said.times) and np.array_equal(read.values, as_said.values)


@pytest.mark.parametrize(
    ("name", "per_unit"),
    [("Gyroscope x (rad/s)", 1.0), ("rate [deg/s]", 180.0 / math.pi), ("Drehrate (°/s)", 180.0 / math.pi)],
)
def test_rates_of_a_gyroscope_are_read(name, per_unit):
    with pytest.raises(OutputError, match=r"take it for a log of the rate \(signal\)"):
        headed("Time (s)", name)(per_second=None, per_unit=None)
    read = headed("Time (s)", name)(per_second=None, per_unit=None, quantity="rate")
    assert read.unit == "rad/s"
    assert read.values[7] == pytest.approx(math.sin(0.7) / 10.0 / per_unit, abs=1e-6)


@pytest.mark.parametrize("name", ["Gyroscope x (rad/s)", "ax [m/s²]", "U (mV)", "angle_mm"])
def test_a_column_of_something_else_is_no_angle(name):
    with pytest.raises(OutputError, match=rf"column '{re.escape(name)}' is in .*, which measures no angle"):
        headed("t", name)(per_second=None, per_unit=None)
    assert len(headed("t", name)(per_second=None, per_unit=1.0).times) == len(TURNED)
