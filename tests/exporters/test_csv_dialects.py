import csv
import io
import random
import warnings
from contextlib import suppress

import attrs
import numpy as np
import pytest
from motions import quintic, target

from gen_profile.motion.profile import sample
from gen_profile.spec.reading import parse_spec
from gen_profile.support.errors import ExportError, SpecError
from gen_profile_exporters import csv_table
from gen_profile_exporters.csv_dialects import DIALECTS

MOVE = quintic((0.1, 0.4))
PAIRS = ["sew", "kollmorgen", "lenze"]
SPEC = '[plant]\ntype = "double-pendulum-crane"\n[move]\ndistance = 0.3\nduration = 3.0\n[export]\n'


def goal_of(dialect, *columns, **options):
    export = {"csv_dialect": dialect}
    if columns or dialect in PAIRS:
        export["csv_columns"] = columns or ("position",)
    return target(cycle_time=0.02, unit="mm", export=export, **options)


def encoded(dialect, *columns, profile=MOVE):
    (file,) = csv_table.encode(profile, goal_of(dialect, *columns))
    return file.content.decode("utf-8")


class TestText:
    def test_excel_de_has_semicolons_commas_and_windows_lines(self):
        lines = encoded("excel-de").split("\r\n")
        assert lines[0] == "time_s;position_mm;velocity_mm_per_s;acceleration_mm_per_s2;jerk_mm_per_s3"
        assert lines[1].startswith("0,00;100,0;0,0;0,0;18000,0")
        assert lines[-1] == ""

    def test_numpy_reads_excel_de_with_a_decimal_comma(self):
        table = np.loadtxt(
            io.StringIO(encoded("excel-de")),
            delimiter=";",
            skiprows=1,
            encoding="utf-8",
            converters=lambda text: float(text.replace(",", ".")),
        )
        np.testing.assert_allclose(table[:, 1], 1e3 * sample(MOVE, 0.02).position[:, 0], rtol=1e-15)

    def test_sew_begins_with_the_number_of_pairs(self):
        lines = encoded("sew").splitlines()
        assert lines[0] == "51"
        assert lines[1] == "0.00;100.0"
        assert len(lines) == 52

    def test_kollmorgen_is_framed(self):
        lines = encoded("kollmorgen").split("\r\n")
        assert lines[:3] == ["CYCLIC;NO;", "TABLE_BEGIN;;", "0.00;100.0;SPLINE"]
        assert lines[-2:] == ["TABLE_END;;", ""]
        assert all(line.endswith(";SPLINE") for line in lines[2:-2])

    def test_lenze_is_what_splits_at_white_space(self):
        rows = [tuple(map(float, line.split())) for line in encoded("lenze").splitlines()]
        assert rows[0] == (0.0, 100.0)
        assert rows[-1] == (1.0, 400.0)

    @pytest.mark.parametrize("dialect", DIALECTS)
    def test_no_dialect_begins_with_a_byte_order_mark(self, dialect):
        assert encoded(dialect, "position").isascii()


class TestReplay:
    @pytest.mark.parametrize("dialect", DIALECTS)
    def test_positions_come_back(self, dialect):
        goal = goal_of(dialect, "position")
        found = csv_table.replay(encoded(dialect, "position").encode(), goal)
        np.testing.assert_allclose(found.position, sample(MOVE, 0.02).position, rtol=1e-15)
        assert (found.cycle_time, found.velocity, found.jerk) == (0.02, None, None)

    @pytest.mark.parametrize("dialect", ["rfc4180", "sew"])
    def test_velocities_alone_are_summed(self, dialect):
        goal = target(cycle_time=0.001, export={"csv_dialect": dialect, "csv_columns": ("velocity",)})
        move = quintic((0.0, 0.3))
        (file,) = csv_table.encode(move, goal)
        found = csv_table.replay(file.content, goal)
        np.testing.assert_allclose(found.position, sample(move, 0.001).position, atol=2e-7)
        assert abs(found.position[-1, 0] - 0.3) < 1e-12
        np.testing.assert_array_equal(found.velocity, sample(move, 0.001).velocity)

    def test_velocities_alone_begin_where_the_axis_stands(self):
        goal = attrs.evolve(goal_of("rfc4180", "velocity"), start=(0.1,))
        found = csv_table.replay(encoded("rfc4180", "velocity").encode(), goal)
        assert found.position[0, 0] == pytest.approx(0.1)
        assert found.position[-1, 0] == pytest.approx(0.4)

    def test_a_choice_of_columns_comes_back(self):
        goal = goal_of("rfc4180", "acceleration", "position")
        text = encoded("rfc4180", "acceleration", "position")
        assert next(csv.reader(io.StringIO(text))) == ["time_s", "acceleration_mm_per_s2", "position_mm"]
        found = csv_table.replay(text.encode(), goal)
        np.testing.assert_allclose(found.acceleration, sample(MOVE, 0.02).acceleration, rtol=1e-15)
        assert found.velocity is None

    @pytest.mark.parametrize(
        ("dialect", "old", "new", "message"),
        [
            ("excel-de", "100,0;", "100.0;", r"line 2: position_mm holds '100thousands 0'"),
            ("excel-de", "\r\n0,04;", "\r\n0,05;", "line 4: time 0.05 s stands where 0.04 s is due"),
            ("excel-de", ";", ",", "column time_s is missing"),
            ("sew", "51\r\n", "50\r\n", "line 1: '50' stands where '51' is due"),
            ("sew", "0.00;100.0\r\n", "", "line 1: '51' stands where '50' is due"),
            ("sew", "100.0", "100,0", "line 2: .* holds '100,0'"),
            (
                "kollmorgen",
                "CYCLIC;NO;",
                "CYCLIC;YES;",
                "line 1: 'CYCLIC;YES;' stands where 'CYCLIC;NO;' is due",
            ),
            ("kollmorgen", "TABLE_END;;\r\n", "", "'1.00;400.0;SPLINE' stands where 'TABLE_END;;' is due"),
            ("kollmorgen", "0.02;", "0.02;SPLINE;", "line 4: 3 cells instead of 2"),
            ("kollmorgen", "100.0;SPLINE", "100.0;LINE", "line 3: SPLINE is missing"),
            ("lenze", "0.00\t", "0.00 ", "line 1: 1 cells instead of 2"),
        ],
    )
    def test_refuses_what_changes_the_meaning(self, dialect, old, new, message):
        text = encoded(dialect)
        assert old in text
        with pytest.raises(ExportError, match=message):
            csv_table.replay(text.replace(old, new, 1 if old != ";" else -1).encode(), goal_of(dialect))

    @pytest.mark.parametrize("dialect", PAIRS)
    @pytest.mark.parametrize("text", ["", "\r\n", "3\r\n", "CYCLIC;NO;\r\nTABLE_BEGIN;;\r\n"])
    def test_refuses_fragments(self, dialect, text):
        with pytest.raises(ExportError):
            csv_table.replay(text.encode(), goal_of(dialect))


class TestLimits:
    def test_sew_takes_16383_points(self):
        with pytest.raises(ExportError, match=r"20001 samples .* more than the format holds \(16383\)"):
            csv_table.encode(
                quintic((0, 1), duration=20.0),
                target(cycle_time=0.001, export={"csv_dialect": "sew", "csv_columns": ("position",)}),
            )

    def test_kollmorgen_wants_four_segments(self):
        with pytest.raises(ExportError, match="kollmorgen needs 5 points or more, the motion has 4"):
            encoded("kollmorgen", profile=quintic((0, 1), duration=0.06))

    @pytest.mark.parametrize("dialect", PAIRS)
    def test_pairs_hold_one_quantity_of_one_axis(self, dialect):
        with pytest.raises(
            ExportError, match=f"export.csv_dialect: {dialect} holds one quantity of one axis"
        ):
            encoded(dialect, "position", "velocity")
        goal = target("x", "y", export={"csv_dialect": dialect, "csv_columns": ("position",)})
        with pytest.raises(ExportError, match="one axis"):
            csv_table.encode(quintic((0, 1), (0, 1)), goal)


class TestSpec:
    @pytest.mark.parametrize(
        ("line", "message"),
        [
            ("csv_columns = 'position'", "must be a list"),
            ("csv_columns = ['position', 'position']", "names a column twice"),
            ("csv_columns = ['jerk']", 'must hold "position" or "velocity"'),
            ("csv_columns = []", 'must hold "position" or "velocity"'),
            ("csv_columns = ['position', 'time']", "unknown value, found text 'time'"),
            ("csv_columns = [['position'], 'position']", "unknown value"),
            ("csv_dialect = 'excel'", "unknown value, found text 'excel'"),
            ("plc_layout = 'table'", "unknown value, found text 'table'"),
        ],
    )
    def test_faults_are_said(self, line, message):
        with pytest.raises(SpecError, match=message):
            parse_spec(SPEC + line)

    def test_columns_keep_their_order(self):
        spec = parse_spec(SPEC + "csv_columns = ['velocity', 'position']")
        assert spec.export.csv_columns == ("velocity", "position")
        assert spec.to_dict()["export"]["csv_columns"] == ["velocity", "position"]


JUNK = [
    "",
    "nan",
    "inf",
    "1e308",
    "1e-320",
    "9" * 400,
    "\x00",
    '"',
    ";",
    ",",
    "\t",
    "\r",
    "\n",
    "--",
    "٣",
    "−1",
]


def altered(text, draw):
    """A table with some characters or lines lost, doubled or replaced; line ends are kept."""
    for _ in range(draw.randint(1, 3)):
        lines = text.splitlines(keepends=True) or [""]
        row, at = draw.randrange(len(lines)), draw.randrange(len(text) + 1)
        changed = [
            [*lines[:row], *lines[row + 1 :]],
            [*lines[:row], lines[draw.randrange(len(lines))], *lines[row:]],
            lines[: draw.randrange(4)],
            [text[:at], draw.choice(JUNK), text[at + draw.randint(0, 8) :]],
            [*lines[:row], "\r\n", *lines[row:]],
        ]
        text = "".join(draw.choice(changed))
    return text


@pytest.mark.parametrize("dialect", DIALECTS)
def test_an_altered_table_is_read_or_refused_in_a_sentence(dialect):
    text, draw = encoded(dialect), random.Random(7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(150):
            with suppress(ExportError):
                setpoints = csv_table.replay(altered(text, draw).encode("utf-8"), goal_of(dialect))
                assert np.isfinite(np.diff(setpoints.position, 2, axis=0) / setpoints.cycle_time**2).all()
