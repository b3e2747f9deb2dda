"""Logs of real moves: what is read of them, and what is refused."""

import numpy as np
import pytest
from command_line import run_here

from gen_profile.presentation.report.log import parse_log, read_log
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.identification.log_table import read_table
from gen_profile.support.errors import OutputError, SpecError

TIMES = [0.02 * k for k in range(20)]
MILLIMETRES = ("axis.unit=mm", "axis.sign=-1")


def table(head, *columns, separator=",", decimal="."):
    rows = [[f"{value:.6f}".replace(".", decimal) for value in row] for row in zip(*columns, strict=True)]
    return "\n".join([separator.join(head), *(separator.join(row) for row in rows), ""])


def paper(*overrides):
    return preset_spec("paper", overrides)


@pytest.mark.parametrize("separator, decimal", [(",", "."), (";", "."), (";", ","), ("\t", ","), ("\t", ".")])
def test_columns_are_told_by_their_names_and_units(separator, decimal):
    head = ["time_s", "cart_position_mm", "payload sway [mm]", "hook_angle_deg", "hook_sway"]
    columns = (TIMES, [10.0 * t for t in TIMES], [2.0] * 20, [90.0] * 20, [0.003] * 20)
    log = parse_log(table(head, *columns, separator=separator, decimal=decimal), "log.csv", paper())
    np.testing.assert_allclose(log.times, TIMES)
    np.testing.assert_allclose(log.positions["cart"], 1e-2 * np.array(TIMES))
    np.testing.assert_allclose(log.sways["payload"], 2e-3)
    np.testing.assert_allclose(log.sways["hook"], 3e-3)
    np.testing.assert_allclose(log.angles["hook"], np.pi / 2.0)
    assert (list(log.positions), list(log.angles), log.ignored) == (["cart"], ["hook"], ())


def test_names_may_be_left_out_where_one_axis_and_the_end_load_are_meant():
    log = parse_log(table(["time", "Position", "SWAY (mm)"], TIMES, TIMES, TIMES), "log.csv", paper())
    np.testing.assert_allclose(log.positions["cart"], TIMES)
    np.testing.assert_allclose(log.sways["payload"], 1e-3 * np.array(TIMES))


def test_an_axis_counts_as_the_spec_says():
    text = table(["time_ms", "position", "sway"], [1e3 * t for t in TIMES], [300.0] * 20, TIMES)
    log = parse_log(text, "log.csv", paper(*MILLIMETRES))
    np.testing.assert_allclose(log.times, TIMES)
    np.testing.assert_allclose(log.positions["cart"], -0.3)
    counted = table(["time", "position_counts"], TIMES, [1000.0] * 20)
    np.testing.assert_allclose(parse_log(counted, "log.csv", paper(*MILLIMETRES)).positions["cart"], -1e-3)
    metres = table(["time", "position_m"], TIMES, [0.1] * 20)
    np.testing.assert_allclose(parse_log(metres, "log.csv", paper(*MILLIMETRES)).positions["cart"], -0.1)


def test_an_angle_s_axis_may_be_logged_in_degrees():
    text = table(["time", "slew_position_deg", "trolley_position"], TIMES, [180.0] * 20, [5000.0] * 20)
    log = parse_log(text, "log.csv", preset_spec("tower-crane", ["axis.trolley.unit=mm"]))
    np.testing.assert_allclose(log.positions["slew"], np.pi)
    np.testing.assert_allclose(log.positions["trolley"], 5.0)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("turn", [360.0, 30.0])
def test_an_axis_that_begins_anew_goes_on(sign, turn):
    moved = np.linspace(3.0, 7.0, len(TIMES))
    overrides = ["move.start=3.0", "move.target=7.0", f"axis.sign={sign}", f"axis.modulo={turn}"]
    spec = preset_spec("flexible-joint", overrides)
    for head, place in (("position", sign * np.rad2deg(moved) % turn), ("position_rad", sign * moved)):
        log = parse_log(table(["time", head], TIMES, place), "log.csv", spec)
        np.testing.assert_allclose(log.positions["hub"], moved, atol=1e-6)


def test_other_columns_are_left_alone_and_named():
    text = table(["time", "sway", "torque", "crab_sway_mm", "position_per_s"], *[TIMES] * 5)
    assert parse_log(text, "log.csv", paper()).ignored == ("torque", "crab_sway_mm", "position_per_s")


def test_what_is_mended_is_told():
    rows = table(["time_s", "sway_mm"], TIMES, TIMES) + "0.36,x\n0.36,0.36\n"
    log = parse_log(rows, "log.csv", paper())
    np.testing.assert_allclose(log.times, TIMES)
    assert [note.partition(",")[0] for note in log.notes] == [
        "1 rows that hold no number", "1 rows that were logged twice"
    ]  # fmt: skip


def test_the_exported_table_is_such_a_log(tmp_path):
    assert run_here("--preset", "paper", "--out", tmp_path, "--no-check").code == 0
    log = read_log(tmp_path / "paper.csv", paper())
    assert log.positions["cart"][[0, -1]] == pytest.approx([0.0, 0.3], abs=1e-12)


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("", "the log is empty"),
        ("\n \n", "the log is empty"),
        (f"time_s,{'x' * 200_000}\n", "it is no table (field larger than field limit"),
        (
            table(["position", "sway"], TIMES, TIMES),
            "there is no column time_s (or time_ms); found position, sway; name the column of times, as",
        ),
        (table(["time_s", "velocity"], TIMES, TIMES), "there is no column of this machine (cart_position, "),
        (
            table(["time_s", "sway_deg"], TIMES, TIMES),
            "column 'sway_deg' is in deg, which does not measure it",
        ),
        (table(["time_s", "sway_s"], TIMES, TIMES), "column 'sway_s' is in s, which does not measure it"),
        (table(["time_s", "sway", "sway"], *[TIMES] * 3), "two columns are called 'sway'"),
        (
            table(["time_s", "sway_m", "payload_sway_mm"], *[TIMES] * 3),
            "column 'sway_m' is there twice, in two units",
        ),
        (table(["time_s", "sway"], TIMES[:5], TIMES[:5]), "needs at least 16 samples, found 5"),
        (
            table(["time_s", "sway"], [0.0] * 20, TIMES),
            "row 3: the times must rise from row to row, and 0 follows 0; sort the rows, remove",
        ),
        (
            table(["time_s", "sway"], TIMES, TIMES) + "0.5,x\n" * 2,
            "row 22: sway holds 'x', which is no number",
        ),
        (
            table(["time_s", "sway"], TIMES, TIMES) + "0.5,1e300\n" * 2,
            "row 22: sway holds '1e300', which is no",
        ),
        (
            table(["time_s", "sway"], TIMES, TIMES) + "0.5,nan\n" * 21,
            "which is no number of a log; leave the cell",
        ),
        (
            "\n" + table(["time_s", "sway"], TIMES, TIMES) + "\n\n0.5,1 mm\n0.6,1 mm\n",
            "row 25: sway holds '1 mm', which",
        ),
        ('time_s,sway\n"0,0","0,5"\n' * 9, "row 3: time_s holds 'time_s', which is no number of a log."),
        (
            "time_s,sway\n0,00,0,50\n" + "0,02,0,50\n" * 20,
            "row 2: holds 4 numbers below 2 names;",
        ),
        ("time_s,sway\n0,0,5\n" * 9, "row 3: time_s holds 'time_s'"),
    ],
)
def test_what_is_no_such_table_is_refused_with_a_sentence(text, complaint):
    with pytest.raises(OutputError) as raised:
        parse_log(text, "log.csv", paper())
    message = str(raised.value)
    assert message.startswith("measured log.csv") and complaint in message and message.endswith(".")


def test_degrees_without_a_unit_are_asked_about():
    with pytest.raises(SpecError, match="more than half a turn; is it in deg"):
        parse_log(table(["time_s", "angle"], TIMES, [9.0 * time for time in TIMES]), "log.csv", paper())


def test_a_file_that_cannot_be_read_is_refused_with_a_sentence(tmp_path):
    with pytest.raises(OutputError, match=r"measured: cannot read the log .*log\.csv: "):
        read_log(tmp_path / "log.csv", paper())
    (tmp_path / "log.csv").write_bytes(b"time_s,sway\n\xff\xfe,1\n")
    with pytest.raises(OutputError, match="row 2: time_s holds 'ÿþ', which is no number"):
        read_log(tmp_path / "log.csv", paper())


def test_a_huge_file_is_refused_unread(tmp_path, monkeypatch):
    monkeypatch.setattr("gen_profile.studies.identification.log_table.MOST_BYTES", 10)
    (tmp_path / "log.csv").write_text("time_s,sway\n0,0\n", "utf-8")
    with pytest.raises(OutputError, match="cut the move out of it"):
        read_log(tmp_path / "log.csv", paper())


@pytest.mark.parametrize("option", [("report", "--measured"), ("identify", "--free", "L1", "--swing")])
def test_a_workbook_is_told_how_to_become_a_log(tmp_path, option):
    (tmp_path / "log.xlsx").write_bytes(b"\xd0\xcf\x11\xe0 and so on")
    outcome = run_here(*option, tmp_path / "log.xlsx")
    assert outcome.code == 2
    assert outcome.errors[-1].endswith("open it and save the sheet as CSV.")


def test_the_log_of_a_stream_is_such_a_log():
    """Planned and actual side by side; nothing in the cycles in which no drive answered."""
    rows = [f"{t},{t},{'' if k < 2 else t + 0.5}" for k, t in enumerate(TIMES)]
    text = "\n".join(["time_s,cart_planned_m,cart_actual_m", *rows])
    log = parse_log(text, "log.csv", paper())
    np.testing.assert_allclose(log.positions["cart"], np.array(TIMES[2:]) + 0.5)
    assert log.ignored == ("cart_planned_m",)


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        (["Messung 3;;", "Zeit;Pendel 2;M", "[ms];[mm];Nm"], "time_ms=Zeit,payload_sway_mm=2"),
        (["Logger 3;;", "Zeit;Payload Auslenkung;M", "[ms];[mm];Nm"], None),
        (["Zeit [ms];payload Auslenkung [mm];M"], None),
        ([], "time_ms=1,sway_mm=2"),
    ],
)
def test_heads_in_other_languages_and_places(head, columns):
    rows = [f"{1e3 * t:.0f};{5.5 + k};7".replace(".", ",") for k, t in enumerate(TIMES)]
    text = "\n".join([*head, *rows]).replace("Payload", "payload")
    log = parse_log(text, "log.csv", paper(), columns)
    np.testing.assert_allclose(log.times, TIMES)
    np.testing.assert_allclose(log.sways["payload"], 1e-3 * (5.5 + np.arange(20)))


@pytest.mark.parametrize("head", ["Winkel [°]", "Winkel (Grad)", "angle_degrees", "hook_angle [deg]"])
def test_units_are_told_as_loggers_spell_them(head):
    log = parse_log(table(["Zeit", head], TIMES, [9.0] * 20), "log.csv", paper(), None)
    np.testing.assert_allclose(next(iter(log.angles.values())), np.radians(9.0))


HEAD = "t [ms];angle (°)"


@pytest.mark.parametrize(
    "head", [[HEAD], ["# 3", HEAD], ["Hall 3;27.11.2026", HEAD], ["Hall 3;1", "t;angle", "ms;[deg]"]]
)
def test_columns_by_number_have_the_units_that_stand_right_above_the_values(head):
    cells = read_table("\n".join([*head, "0;", "40;1,5", "80;nan"]), "log.csv")
    row = cells.head(("1", "2"))
    assert [cells.unit(row, place) for place in (0, 1)] == ["ms", "deg"]


def test_counts_are_as_large_as_is_said():
    text = table(["a", "b", "c"], TIMES, [100.0] * 20, [-40.0] * 20)
    log = parse_log(text, "log.csv", paper(), "time_s=a,hook_angle_0.09deg=b,payload_sway_.5 mm=c")
    np.testing.assert_allclose(log.angles["hook"], np.radians(9.0))
    np.testing.assert_allclose(log.sways["payload"], -0.02)


@pytest.mark.parametrize(
    "columns",
    ["Zeit", "time_s=", "time_s=1,speed=2", "time_s=1,sway=9", "sway=2", "time_s=1,payload_sway_0mm=2"],
)
def test_columns_that_are_not_there(columns):
    with pytest.raises(OutputError, match=r"(MEANING=COLUMN|no quantity of this machine|no column).*[.]$"):
        parse_log(table(["a", "b"], TIMES, TIMES), "log.csv", paper(), columns)


def test_a_chosen_column_is_in_the_unit_that_its_name_states():
    rows = "\n".join(f"{index},{0.1 * index}" for index in range(20))
    text = f"Zeit [ms],Gyroscope x (rad/s)\n{rows}"
    chosen = "time=1,payload_angle=2"
    with pytest.raises(OutputError, match="payload_angle is in rad/s, which measures no angle"):
        parse_log(text, "log.csv", paper(), chosen)
    log = parse_log(text.replace("rad/s", "deg"), "log.csv", paper(), chosen)
    assert log.times[1] == pytest.approx(1e-3)
    assert log.angles["payload"][1] == pytest.approx(np.radians(0.1))
    assert parse_log(text, "log.csv", paper(), "time=1,payload_angle_rad=2").angles["payload"][1] == 0.1
