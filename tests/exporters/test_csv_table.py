import csv
import io

import numpy as np
import pytest
from motions import quintic, target

from gen_profile.motion.profile import sample
from gen_profile.support.errors import ExportError
from gen_profile_exporters import csv_table

MOVE = quintic((0.1, 0.4))


def encoded(profile=MOVE, **options):
    names = options.pop("names", ())
    (file,) = csv_table.encode(profile, target(*names, **options))
    return file


def lines_of(content):
    return content.decode("utf-8").splitlines()


def replayed(lines, **options):
    names = options.pop("names", ())
    return csv_table.replay(("\n".join(lines) + "\n").encode("utf-8"), target(*names, **options))


class TestEncode:
    def test_header_and_file_name(self):
        file = encoded(unit="mm")
        assert file.filename == "bay-3.csv"
        assert lines_of(file.content)[0] == (
            "time_s,position_mm,velocity_mm_per_s,acceleration_mm_per_s2,jerk_mm_per_s3"
        )

    def test_columns_of_several_axes_begin_with_their_names(self):
        header = lines_of(encoded(quintic((0, 1), (0, 2)), names=("bridge", "trolley")).content)[0].split(",")
        assert header[1] == "bridge_position_m"
        assert header[-1] == "trolley_jerk_m_per_s3"
        assert len(header) == 9

    def test_bytes_are_plain(self):
        content = encoded().content
        assert content.isascii()
        assert content.endswith(b"\n")
        assert b"\r" not in content
        assert b" " not in content

    def test_times_are_exact_decimals(self):
        lines = lines_of(encoded(quintic((0, 0.1), duration=0.0003), cycle_time=0.00001).content)
        assert lines[4].startswith("0.00003,")
        assert lines[-1].startswith("0.00030,")

    def test_a_short_last_cycle_ends_at_the_held_target(self):
        lines = lines_of(encoded(quintic((0, 0.1), duration=0.95), cycle_time=0.1).content)
        assert lines[-1] == "1.0,0.1,0.0,0.0,0.0"

    def test_stdlib_reader_gets_the_same_doubles(self):
        rows = list(csv.DictReader(io.StringIO(encoded(unit="mm", sign=-1).content.decode("utf-8"))))
        motion = sample(MOVE, 0.01)
        for quantity, column in (
            ("position", "position_mm"),
            ("velocity", "velocity_mm_per_s"),
            ("acceleration", "acceleration_mm_per_s2"),
            ("jerk", "jerk_mm_per_s3"),
        ):
            found = [float(row[column]) for row in rows]
            np.testing.assert_array_equal(found, -1e3 * getattr(motion, quantity)[:, 0])

    def test_numpy_reads_it(self):
        table = np.genfromtxt(io.BytesIO(encoded().content), delimiter=",", names=True)
        motion = sample(MOVE, 0.01)
        np.testing.assert_array_equal(table["time_s"], motion.times)
        np.testing.assert_array_equal(table["position_m"], motion.position[:, 0])
        np.testing.assert_array_equal(table["jerk_m_per_s3"], motion.jerk[:, 0])

    def test_counts_are_whole_and_within_half_a_count(self):
        rows = list(
            csv.DictReader(io.StringIO(encoded(unit="counts", counts_per_si=12345.6).content.decode()))
        )
        found = np.array([int(row["position_counts"]) for row in rows])
        assert np.abs(found - 12345.6 * sample(MOVE, 0.01).position[:, 0]).max() <= 0.5
        assert rows[50]["velocity_counts_per_s"] == repr(float(sample(MOVE, 0.01).velocity[50, 0] * 12345.6))

    def test_counts_round_half_to_even(self):
        content = encoded(quintic((0.5, 2.5)), unit="counts", counts_per_si=1.0).content
        assert lines_of(content)[1].split(",")[1] == "0"
        assert lines_of(content)[-1].split(",")[1] == "2"

    def test_counts_beyond_32_bits_are_refused_with_numbers(self):
        with pytest.raises(
            ExportError, match=r"axis cart: 214\d+ counts at .* outside 32 bits .*-2147483648"
        ):
            encoded(quintic((0.0, 3000.0)), unit="counts", counts_per_si=1e6)

    def test_negative_zero_is_written_as_zero(self):
        assert b"-0.0," not in encoded(quintic((0.0, 0.3)), sign=-1).content

    def test_refuses_more_samples_than_fit(self):
        with pytest.raises(ExportError, match=r"export\.cycle_time: 10000001 samples .* set it to 0\.0001 s"):
            encoded(quintic((0, 1), duration=100.0), cycle_time=0.00001)

    def test_refuses_a_motion_with_other_axes(self):
        with pytest.raises(ExportError, match="has 1 axes, the target 2"):
            encoded(names=("x", "y"))

    def test_refuses_scales_that_overflow(self):
        with pytest.raises(ExportError, match="too large to convert"):
            encoded(quintic((0, 1e5)), unit="counts", counts_per_si=1e305)


class TestReplayTolerates:
    reference = csv_table.replay(encoded().content, target())

    def same(self, content):
        motion = csv_table.replay(content, target())
        assert motion.payload_hash() == self.reference.payload_hash()
        np.testing.assert_array_equal(motion.jerk, self.reference.jerk)

    def test_byte_order_mark(self):
        self.same(b"\xef\xbb\xbf" + encoded().content)

    def test_carriage_returns(self):
        self.same(encoded().content.replace(b"\n", b"\r\n"))
        self.same(encoded().content.replace(b"\n", b"\r"))

    def test_blank_lines_at_the_end(self):
        self.same(encoded().content + b"\n\n,,,,\n")

    def test_spaces_and_quotes(self):
        self.same(encoded().content.replace(b",", b", "))
        self.same(
            b"\n".join(b'"' + line.replace(b",", b'","') + b'"' for line in encoded().content.split()) + b"\n"
        )

    def test_columns_in_another_order(self):
        rows = [line.split(b",") for line in encoded().content.split()]
        self.same(b"".join(b",".join(row[::-1]) + b"\n" for row in rows))

    def test_rounded_times(self):
        motion = replayed([*lines_of(encoded().content)[:-1], "1.0000000001,0.4,0,0,0"])
        assert motion.cycle_time == 0.01

    def test_a_table_that_ends_early_plays_short(self):
        motion = replayed(lines_of(encoded().content)[:40])
        assert len(motion.position) == 39


def with_cell(row, column, text):
    lines = lines_of(encoded().content)
    cells = lines[row].split(",")
    cells[column] = text
    lines[row] = ",".join(cells)
    return lines


class TestReplayRefuses:
    @pytest.mark.parametrize("text", ["nan", "inf", "-Infinity", "", "1_0", "abc", "1e999", "0x1", "１"])
    def test_cells_that_are_no_finite_numbers(self, text):
        with pytest.raises(ExportError, match=r"line 8: velocity_m_per_s holds .* no finite number"):
            replayed(with_cell(7, 2, text))

    def test_a_truncated_last_line(self):
        content = encoded().content
        with pytest.raises(ExportError, match=r"line 102: .* breaks off"):
            csv_table.replay(content[:-1], target())
        with pytest.raises(ExportError, match=r"line 102: .* breaks off"):
            csv_table.replay(content[:-4], target())

    @pytest.mark.parametrize("separator", [";", "\t"])
    def test_other_separators(self, separator):
        with pytest.raises(ExportError, match=r"line 1: .* semicolons or tabs"):
            csv_table.replay(encoded().content.replace(b",", separator.encode()), target())

    def test_decimal_commas(self):
        with pytest.raises(ExportError, match=r"line 2: 10 cells instead of 5"):
            lines = lines_of(encoded().content)
            replayed([lines[0], *(line.replace(".", ",") for line in lines[1:])])

    def test_missing_extra_and_double_columns(self):
        lines = lines_of(encoded().content)
        with pytest.raises(ExportError, match=r"line 1: column jerk_m_per_s3 is missing"):
            replayed([line.rpartition(",")[0] for line in lines])
        with pytest.raises(ExportError, match=r"line 1: column 'torque' is not one"):
            replayed([lines[0] + ",torque", *(line + ",0" for line in lines[1:])])
        with pytest.raises(ExportError, match=r"line 1: column time_s appears twice"):
            replayed([lines[0] + ",time_s", *(line + ",0" for line in lines[1:])])

    def test_units_of_another_spec(self):
        with pytest.raises(
            ExportError, match=r"line 1: column position_mm is in mm, but axis cart counts in m"
        ):
            csv_table.replay(encoded(unit="mm").content, target(unit="m"))

    def test_cells_too_many_or_too_few(self):
        with pytest.raises(ExportError, match=r"line 4: 6 cells instead of 5"):
            replayed(with_cell(3, 1, "0,0"))
        with pytest.raises(ExportError, match=r"line 4: 0 cells instead of 5"):
            replayed([*lines_of(encoded().content)[:3], "", *lines_of(encoded().content)[3:]])

    def test_times_that_do_not_rise_evenly_from_zero(self):
        lines = lines_of(encoded().content)
        with pytest.raises(ExportError, match=r"line 2: times must rise from 0"):
            replayed([lines[0], *lines[2:]])
        with pytest.raises(ExportError, match=r"line 6: time 0.05 s stands where 0.04 s is due"):
            replayed([*lines[:5], *lines[6:]])
        with pytest.raises(ExportError, match=r"line 102: time 1.00000001 s"):
            replayed(with_cell(101, 0, "1.00000001"))
        with pytest.raises(ExportError, match=r"line 3: a cycle time of -0.01 s lies outside"):
            replayed(with_cell(2, 0, "-0.01"))
        with pytest.raises(ExportError, match=r"line 3: a cycle time of 1e-310 s lies outside"):
            replayed(with_cell(2, 0, "1e-310"))

    def test_fewer_than_two_samples(self):
        lines = lines_of(encoded().content)
        with pytest.raises(ExportError, match="holds 1 samples"):
            replayed(lines[:2])
        with pytest.raises(ExportError, match="holds 0 samples"):
            replayed(lines[:1])
        with pytest.raises(ExportError, match="is empty"):
            csv_table.replay(b"", target())

    def test_bytes_that_are_no_text(self):
        with pytest.raises(ExportError, match=r"not UTF-8 text \(byte 2\)"):
            csv_table.replay(b"ti\xff\n", target())

    def test_broken_quotes(self):
        with pytest.raises(ExportError, match=r"line \d+: not comma-separated values"):
            replayed(with_cell(7, 2, '"0'))

    @pytest.mark.parametrize("text", ["12.5", "2147483648", "-2147483649"])
    def test_counts_that_are_none(self, text):
        (file,) = csv_table.encode(MOVE, target(unit="counts"))
        lines = lines_of(file.content)
        cells = lines[4].split(",")
        with pytest.raises(ExportError, match=r"line 5: axis cart: .* is no whole 32-bit count"):
            replayed([*lines[:4], ",".join([cells[0], text, *cells[2:]]), *lines[5:]], unit="counts")

    def test_numbers_too_large_for_the_scale(self):
        with pytest.raises(ExportError, match="too large to convert"):
            lines = lines_of(encoded(unit="counts", counts_per_si=1e-300).content)
            replayed([*lines[:2], "0.01,0,1e99,0,0"], unit="counts", counts_per_si=1e-300)
