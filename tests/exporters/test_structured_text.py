import re

import numpy as np
import pytest
from motions import bang_bang, quintic, target
from st_interpreter import FunctionBlock

from gen_profile.support.errors import ExportError
from gen_profile_exporters.playback import structured_text

MOVE = quintic((0.1, 0.4))
TWO_MOVES = quintic((0.1, 0.4), (1.2, -0.7))
CYCLE = 0.02
LAYOUTS = ["segments", "samples", "counts"]


def encoded(profile=MOVE, *names, **options):
    (file,) = structured_text.encode(profile, target(*names, **{"cycle_time": CYCLE, **options}))
    return file.content.decode("ascii")


def replayed(text, *names, **options):
    return structured_text.replay(text.encode("latin-1"), target(*names, **options))


class TestText:
    def test_uses_only_what_compilers_have_in_common(self):
        text = encoded(TWO_MOVES, "bridge", "trolley")
        assert text.isascii()
        assert "\r" not in text
        assert "\t" not in text
        program = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
        assert "//" not in program
        assert not re.search(r"__|_\W|\{|'|\"|(?<!16)#", program)
        for literal in re.findall(r"(?<![\w.#])\d[\d.]*(?:E[+-]?\d+)?(?!#)", program):
            assert re.fullmatch(r"\d+|\d+\.\d+(E[+-]\d+)?|[01]\.\.\d+", literal), literal

    def test_literals_read_back_to_the_same_double(self):
        awkward = np.array(
            [0.1, -1 / 3, 5e-324, 1.7976931348623157e308, 123456789.0, 1e22, -0.30000000000000004, 0]
        )
        literals = [structured_text.literal(value) for value in awkward.tolist()]
        assert [float(literal) for literal in literals] == awkward.tolist()
        assert all(re.fullmatch(r"-?\d+\.\d+(E[+-]\d+)?", literal) for literal in literals)

    @pytest.mark.parametrize(
        ("name", "block"),
        [
            ("bay-3", "FB_bay_3"),
            ("a..b__c_", "FB_a_b_c"),
            ("7 IF", "FB_7_IF"),
            ("--", "FB_motion"),
            ("x*)y", "FB_x_y"),
            ("Kran Süd", "FB_Kran_S_d"),
        ],
    )
    def test_names_become_identifiers(self, name, block):
        assert FunctionBlock(encoded(name=name)).name == block

    def test_several_axes_are_arrays_in_their_order(self):
        text = encoded(TWO_MOVES, "bridge", "trolley")
        assert FunctionBlock(text).call()["fposition"] == [0.1, 1.2]
        assert "Axis 1, bridge: 0.1 to 0.4 m" in text
        assert "Axis 2, trolley: 1.2 to -0.7 m" in text

    def test_header_tells_what_the_block_holds(self):
        text = encoded(unit="mm")
        header = text[: text.index("FUNCTION_BLOCK")]
        assert "50 cycles of 0.02 s. Table: 1 quintic segments, 0.048 kB." in header
        assert "Axis 1, cart: 100 to 400 mm, peaks 562.5 mm/s and 1732 mm/s2,\n        stop jerk" in header
        assert "Fit error at the cycles below\n    1e-09 m and 1e-06 m/s2." in header
        digest = re.search(r"Payload SHA-256: ([0-9a-f]{64})\n", header)
        assert digest[1] == replayed(text, unit="mm").payload_hash()

    @pytest.mark.parametrize("layout", LAYOUTS)
    def test_the_checksum_is_a_polynomial_of_the_numbers_parts(self, layout):
        text = encoded(TWO_MOVES, "bridge", "trolley", export={"plc_layout": layout})
        names = "cPower0 cPower1 cPower2 cPower3 cPower4 cPower5" if layout == "segments" else ""
        block = FunctionBlock(text)
        values = [
            value for name in (names or "cPosition cVelocity cAcceleration").split() for value in block[name]
        ]
        if layout == "segments":
            values += [first for first in block["cFirst"] for _ in range(2)]
        tables = ("cpower", "cfirst", "cposition", "cvelocity", "cacceleration", "cchecksum")
        single = [
            block[name]
            for name, section in block.sections.items()
            if section == "CONSTANT" and not name.startswith(tables)
        ]
        for axis in range(2):
            values += [value[axis] if isinstance(value, list) else value for value in single]
        total = 0
        for value in map(float, values):
            # 0x1.<52 bits>p<exponent>: the hexadecimal text of a double shows its parts
            digits, exponent = abs(value).hex().split("p") if value else ("0x0.0", "-1")
            mantissa = int(digits[2:].replace(".", "").ljust(14, "0"), 16)
            for word in (2 * (int(exponent) + 1 + 2048) + (value < 0), mantissa >> 27, mantissa % 2**27):
                total = (total * 1_999_993 + word) % (2**31 - 1)
        assert block["cChecksum"] == total

    def test_refuses_numbers_that_compilers_refuse(self):
        with pytest.raises(ExportError, match="which compilers refuse"):
            encoded(
                quintic((0.0, 1e35), duration=0.02),
                unit="um",
                cycle_time=1e-5,
                export={"plc_layout": "segments"},
                counts_per_si=1.0,
            )

    @pytest.mark.parametrize("quantity", ["velocity", "acceleration"])
    def test_refuses_derivatives_of_more_than_32_bits(self, quantity):
        distance = 100.0 if quantity == "acceleration" else 1000.0
        with pytest.raises(
            ExportError, match=rf"axis cart: its {quantity} reaches .* more than 32 bits hold"
        ):
            encoded(quintic((0.0, distance), duration=0.2), export={"plc_layout": "counts"})

    def test_refuses_tables_too_long_to_compile(self):
        with pytest.raises(
            ExportError, match=r"export\.cycle_time: 1000001 samples .* set it to 0\.001 s or more"
        ):
            encoded(quintic((0, 1), duration=100.0), cycle_time=0.0001)

    def test_takes_the_cycle_time_that_its_refusal_names(self):
        move = quintic((0, 1), duration=123.4)
        with pytest.raises(ExportError, match=r"set it to 0\.0013 s or more"):
            encoded(move, cycle_time=0.0001)
        assert encoded(move, cycle_time=0.0013)


class TestReplay:
    def test_takes_other_comments_spaces_and_cases(self):
        text = encoded()
        edited = (
            text.replace("VAR_INPUT", "var_input (* Eingänge\n *)\n\n")
            .replace("    ", "\t")
            .replace("\n", "\r\n")
        )
        assert replayed(edited).payload_hash() == replayed(text).payload_hash()

    def test_takes_other_defaults_and_names(self):
        text = encoded()
        edited = re.sub(r"(fStartTolerance : LREAL := )\S+;", r"\g<1>2.5;", text).replace(
            "FB_bay_3", "FB_Kran"
        )
        assert replayed(edited).payload_hash() == replayed(text).payload_hash()

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ("nCycle := nCycle + 1;", "nCycle := nCycle + 2;", r"line \d+: '2' stands where .* '1'"),
            ("cMoving : DINT := 2", "cMoving : DINT := 1", r"'1' stands where .* '2'"),
            ("fFraction + 0.5 *", "fFraction +", r"'\(' stands where .* '0.5'"),
            ("bDone := (nState = cDone) AND (nErrorId = 0);", "", r"'bAborted' stands where .* 'bDone'"),
            ("END_FUNCTION_BLOCK\n", "", "breaks off or goes on"),
            ("END_FUNCTION_BLOCK\n", "END_FUNCTION_BLOCK\nEND_VAR\n", "breaks off or goes on"),
            ("FUNCTION_BLOCK FB", "\u00ef\u00bb\u00bfFUNCTION_BLOCK FB", r"stands where .* 'FUNCTION_BLOCK'"),
            (
                "cCycleTime : LREAL := 0.02",
                "cCycleTime : LREAL := 200.0",
                "cycle time of 200 s lies outside",
            ),
            ("cCycleTime : LREAL := 0.02", "cCycleTime : LREAL := cLast", "'cLast' is no finite number"),
            ("cLast : DINT := 50", "cLast : DINT := 0", "cLast = 0 does not belong to the table"),
            ("cLast : DINT := 50", "cLast : DINT := 50.5", "cLast = 50.5 does not belong to the table"),
            ("[0..0]", "[0..49]", r"\[0..49\] stands where the table asks for \[0..0\]"),
            ("cTarget : LREAL := 0.4", "cTarget : LREAL := 0.41", "checksum of the constants is"),
            ("LREAL := 0.001", "LREAL := 1.0E+999", "'1.0E\\+999' is no finite number"),
            ("FB_bay_3", ";", "';' stands where a name is due"),
        ],
    )
    def test_refuses_another_program(self, old, new, message):
        text = encoded()
        assert old in text
        with pytest.raises(ExportError, match=message):
            replayed(text.replace(old, new, 1))

    def test_names_the_line_of_a_bad_number(self):
        lines = encoded(export={"plc_layout": "samples"}).split("\n")
        row = next(k for k, line in enumerate(lines) if "cVelocity :" in line) + 3
        lines[row] = re.sub(r"\S+$", "NaN", lines[row].rstrip(","), count=1) + ","
        with pytest.raises(ExportError, match=rf"line {row + 1}: 'NaN' is no finite number"):
            replayed("\n".join(lines))

    def test_refuses_a_table_that_lost_a_line(self):
        lines = encoded(export={"plc_layout": "samples"}).split("\n")
        del lines[next(k for k, line in enumerate(lines) if "cPosition :" in line) + 3]
        with pytest.raises(ExportError, match=r"47 values in an array \[0..50\] for 1 axes"):
            replayed("\n".join(lines))

    def test_refuses_segments_out_of_order(self):
        text = encoded(bang_bang())
        with pytest.raises(ExportError, match="does not belong to the table"):
            replayed(re.sub(r"(cFirst : [^;]*?0, )\d+", r"\g<1>0", text))

    def test_refuses_another_number_of_targets(self):
        text = encoded(TWO_MOVES, "bridge", "trolley").replace("LREAL := [0.4, -0.7]", "LREAL := [0.4]")
        with pytest.raises(ExportError, match=r"line \d+: 1 targets for 2 axes"):
            replayed(text, "bridge", "trolley")

    def test_refuses_a_block_for_other_axes(self):
        with pytest.raises(ExportError, match=r"'LREAL' stands where .* 'ARRAY'"):
            replayed(encoded(), "x", "y")

    def test_refuses_an_empty_file(self):
        with pytest.raises(ExportError, match="breaks off"):
            replayed("")
