import re

import numpy as np
import pytest
from blark.parse import parse_source_code
from motions import quintic, target
from st_interpreter import FunctionBlock

from gen_profile.errors import ExportError
from gen_profile.profile import Profile, sample
from gen_profile_exporters import structured_text

MOVE = quintic((0.1, 0.4))
TWO_MOVES = quintic((0.1, 0.4), (1.2, -0.7))
CYCLE = 0.02


def encoded(profile=MOVE, *names, **options):
    (file,) = structured_text.encode(profile, target(*names, **{"cycle_time": CYCLE, **options}))
    return file.content.decode("ascii")


def replayed(text, *names, **options):
    return structured_text.replay(text.encode("latin-1"), target(*names, **options))


def started(text, cycle_time=CYCLE, **inputs):
    """An instance after the cycle that starts it, and that cycle's outputs."""
    fb = FunctionBlock(text)
    return fb, fb.call(bExecute=True, fCycleTime=cycle_time, **{"fActPosition": 0.1, **inputs})


class TestText:
    def test_uses_only_what_compilers_have_in_common(self):
        text = encoded(TWO_MOVES, "bridge", "trolley")
        assert text.isascii()
        assert "\r" not in text
        assert "\t" not in text
        program = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
        assert "//" not in program
        assert not re.search(r"__|_\W|\{|'|\"|#", program.replace("FB_bay_3", ""))
        for literal in re.findall(r"(?<![\w.])\d[\d.]*(?:E[+-]?\d+)?", program):
            assert re.fullmatch(r"\d+|\d+\.\d+(E[+-]\d+)?|0\.\.\d+", literal), literal

    def test_blark_parses_it(self):
        for text in (encoded(cycle_time=0.05), encoded(TWO_MOVES, "bridge", "trolley", cycle_time=0.1)):
            (block,) = parse_source_code(text).transform().items
            assert block.name == "FB_bay_3"
            sections = [type(section).__name__ for section in block.declarations]
            assert sections == [
                "InputDeclarations",
                "OutputDeclarations",
                "VariableDeclarations",
                "VariableDeclarations",
            ]

    def test_literals_read_back_to_the_same_double(self):
        awkward = np.array(
            [0.1, -1 / 3, 5e-324, 1.7976931348623157e308, 123456789.0, 1e22, -0.30000000000000004, 0]
        )
        literals = [structured_text._literal(value) for value in awkward]
        assert [float(literal) for literal in literals] == awkward.tolist()
        assert all(re.fullmatch(r"-?\d\.\d+E[+-]\d+", literal) for literal in literals)

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

    def test_axis_names_stay_apart(self):
        outputs = FunctionBlock(encoded(TWO_MOVES, "y.1", "Y 1")).call()
        assert {"fposition_y_11", "fposition_y_12"} <= set(outputs)

    def test_header_tells_what_the_block_holds(self):
        text = encoded(unit="mm")
        header = text[: text.index("FUNCTION_BLOCK")]
        assert "51 samples, one per cycle of 0.02 s, 1.22 kB" in header
        assert "Axis cart, mm: 100 to 400, peaks 562.5 mm/s and" in header
        digest = re.search(r"SHA-256 of cycle time and positions: ([0-9a-f]{64})\n", header)
        assert digest[1] == replayed(text, unit="mm").payload_hash()

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


class TestPlayback:
    """The block, executed cycle by cycle by an interpreter of the language."""

    @pytest.mark.parametrize("unit", ["m", "mm", "deg", "counts"])
    @pytest.mark.parametrize("sign", [1, -1])
    def test_issues_bit_for_bit_what_replay_says(self, unit, sign):
        options = {"unit": unit, "sign": sign}
        text = encoded(**options)
        motion = replayed(text, **options)
        factor = target(**options).axes[0].factor
        fb, outputs = started(text, fActPosition=0.1 * factor)
        played = []
        while outputs["bbusy"]:
            played.append(outputs)
            outputs = fb.call()
        played.append(outputs)
        for quantity in ("position", "velocity", "acceleration"):
            issued = np.array([[row[f"f{quantity}"]] for row in played]) / factor + 0.0
            np.testing.assert_array_equal(issued, getattr(motion, quantity))

    def test_issues_two_axes_together(self):
        text = encoded(TWO_MOVES, "bridge", "trolley")
        fb = FunctionBlock(text)
        start = {"fActPosition_bridge": 0.1, "fActPosition_trolley": 1.2}
        played = [fb.call(bExecute=True, fCycleTime=CYCLE, **start)] + [fb.call() for _ in range(50)]
        motion = sample(TWO_MOVES, CYCLE)
        np.testing.assert_array_equal([row["fposition_bridge"] for row in played], motion.position[:, 0])
        np.testing.assert_array_equal(
            [row["facceleration_trolley"] for row in played], motion.acceleration[:, 1]
        )
        assert played[-1]["bdone"]

    def test_is_done_with_the_last_sample_and_holds_it_while_execute_lasts(self):
        fb, outputs = started(encoded())
        for _ in range(49):
            outputs = fb.call()
            assert (outputs["bbusy"], outputs["bdone"]) == (True, False)
        for _ in range(3):
            outputs = fb.call()
            assert (outputs["bbusy"], outputs["bdone"], outputs["fposition"]) == (False, True, 0.4)
            assert outputs["fvelocity"] == outputs["facceleration"] == 0.0
        outputs = fb.call(bExecute=False)
        assert not (outputs["bbusy"] or outputs["bdone"] or outputs["baborted"] or outputs["berror"])
        assert outputs["fposition"] == 0.4

    def test_dropping_execute_does_not_stop_and_done_shows_for_one_cycle(self):
        fb, _ = started(encoded())
        outputs = [fb.call(bExecute=False) for _ in range(52)]
        assert [row["bdone"] for row in outputs] == [False] * 49 + [True, False, False]
        assert outputs[49]["fposition"] == 0.4

    def test_a_second_edge_during_the_motion_is_ignored(self):
        fb, _ = started(encoded())
        for _ in range(10):
            fb.call(bExecute=False)
        outputs = fb.call(bExecute=True)
        assert outputs["fposition"] == sample(MOVE, CYCLE).position[11, 0]

    def test_it_starts_again_only_where_the_table_begins(self):
        fb, _ = started(encoded())
        for _ in range(50):
            fb.call()
        fb.call(bExecute=False)
        assert fb.call(bExecute=True, fActPosition=0.4)["nerrorid"] == 2
        assert fb.call(bExecute=False)["nerrorid"] == 0
        again = fb.call(bExecute=True, fActPosition=0.1)
        assert (again["bbusy"], again["fposition"]) == (True, 0.1)

    def test_stands_still_without_execute(self):
        fb = FunctionBlock(encoded())
        for _ in range(3):
            outputs = fb.call(fCycleTime=CYCLE, fActPosition=0.1)
            assert not (outputs["bbusy"] or outputs["bdone"] or outputs["baborted"] or outputs["berror"])
            assert (outputs["fposition"], outputs["fvelocity"]) == (0.1, 0.0)


class TestRefusals:
    @pytest.mark.parametrize(
        ("error", "inputs"),
        [
            (1, {"cycle_time": 0.0}),
            (1, {"cycle_time": 0.01}),
            (1, {"cycle_time": 0.02001}),
            (1, {"cycle_time": float("nan")}),
            (2, {"fActPosition": 0.1011}),
            (2, {"fActPosition": 0.0}),
            (2, {"fActPosition": float("nan")}),
            (2, {"fActPosition": 0.1005, "fStartTolerance": 0.0004}),
            (3, {"fStopDeceleration": 0.0}),
            (3, {"fStopDeceleration": -1.0}),
            (3, {"fStopDeceleration": float("nan")}),
            (4, {"bAbort": True}),
        ],
    )
    def test_nothing_moves_and_the_reason_shows(self, error, inputs):
        fb, outputs = started(encoded(), **inputs)
        for _ in range(2):
            assert (outputs["berror"], outputs["nerrorid"], outputs["bbusy"]) == (True, error, False)
            assert (outputs["fposition"], outputs["fvelocity"]) == (0.1, 0.0)
            outputs = fb.call()
        assert not fb.call(bExecute=False)["berror"]

    @pytest.mark.parametrize(
        "inputs", [{"cycle_time": 0.02000000001}, {"fActPosition": 0.1009}, {"fStopDeceleration": 1e308}]
    )
    def test_what_is_near_enough_starts(self, inputs):
        assert started(encoded(), **inputs)[1]["bbusy"]

    def test_every_axis_is_checked(self):
        for bridge, trolley in ((0.1, 0.0), (0.0, 1.2)):
            fb = FunctionBlock(encoded(TWO_MOVES, "bridge", "trolley"))
            outputs = fb.call(
                bExecute=True, fCycleTime=CYCLE, fActPosition_bridge=bridge, fActPosition_trolley=trolley
            )
            assert outputs["nerrorid"] == 2


def aborted(fb, outputs, cycles):
    """Play some cycles, then abort until standstill; every cycle's outputs from the last one played on."""
    for _ in range(cycles):
        outputs = fb.call()
    rows = [outputs]
    while not rows[-1]["baborted"]:
        rows.append(fb.call(bAbort=True))
        assert rows[-1]["bbusy"] != rows[-1]["baborted"]
    return rows


def check_braking(position, velocity, acceleration, deceleration):
    """The laws that a stop at constant deceleration obeys, sample by sample."""
    steps = np.diff(velocity)
    rounding = 1e-12 * max(1.0, np.abs(velocity).max())
    assert np.abs(steps).max() <= deceleration * CYCLE + rounding
    np.testing.assert_allclose(acceleration[1:], steps / CYCLE, atol=rounding / CYCLE)
    assert (velocity * velocity[0] >= 0.0).all()
    assert (np.diff(np.abs(velocity)) <= 0.0).all()
    assert velocity[-1] == 0.0
    np.testing.assert_allclose(np.diff(position), (velocity[1:] + velocity[:-1]) / 2 * CYCLE, atol=rounding)


class TestAbort:
    @pytest.mark.parametrize("deceleration", [None, 0.5, 8.0, 1e6])
    def test_brakes_from_any_cycle_within_the_stated_deceleration(self, deceleration):
        text = encoded()
        given = {} if deceleration is None else {"fStopDeceleration": deceleration}
        limit = deceleration or np.abs(sample(MOVE, CYCLE).acceleration).max()
        for cycles in range(50):
            fb, outputs = started(text, **given)
            rows = aborted(fb, outputs, cycles)
            position, velocity, acceleration = (
                np.array([row[name] for row in rows]) for name in ("fposition", "fvelocity", "facceleration")
            )
            check_braking(position, velocity, acceleration, limit)
            expected = np.abs(velocity[0]) / limit / CYCLE
            assert len(rows) - 1 <= max(1.0, np.ceil(expected - 1e-9))

    def test_the_default_stop_stays_within_the_move_even_of_the_hardest_motion(self):
        # Full acceleration, then full deceleration: any later braking would overrun the target.
        a = 1.2
        move = Profile(
            knots=[0.0, 0.5, 1.0],
            coefficients=[[[0.1], [0.0], [a / 2]], [[0.1 + a / 8], [a / 2], [-a / 2]]],
            target=[0.1 + a / 4],
            method="bang-bang",
        )
        text = encoded(move)
        for cycles in range(50):
            fb, outputs = started(text)
            position = [row["fposition"] for row in aborted(fb, outputs, cycles)]
            assert max(position) <= 0.1 + a / 4 + a * CYCLE**2 / 8 + 1e-12
            assert min(position) >= 0.1

    def test_every_axis_brakes_with_its_own_deceleration(self):
        text = encoded(TWO_MOVES, "bridge", "trolley")
        peaks = np.abs(sample(TWO_MOVES, CYCLE).acceleration).max(axis=0)
        for cycles in range(0, 50, 7):
            fb = FunctionBlock(text)
            start = {"fActPosition_bridge": 0.1, "fActPosition_trolley": 1.2}
            outputs = fb.call(bExecute=True, fCycleTime=CYCLE, **start)
            rows = aborted(fb, outputs, cycles)
            for axis, peak in zip(("bridge", "trolley"), peaks, strict=True):
                check_braking(
                    *(
                        np.array([row[f"f{q}_{axis}"] for row in rows])
                        for q in ("position", "velocity", "acceleration")
                    ),
                    peak,
                )

    def test_holds_where_it_stopped_until_execute_drops(self):
        fb, outputs = started(encoded())
        stopped = aborted(fb, outputs, 20)[-1]
        for abort in (True, False):
            outputs = fb.call(bAbort=abort)
            assert (outputs["baborted"], outputs["fposition"]) == (True, stopped["fposition"])
            assert outputs["fvelocity"] == outputs["facceleration"] == 0.0
        assert not fb.call(bExecute=False)["baborted"]

    def test_braking_goes_on_when_abort_or_execute_drop_or_the_deceleration_changes(self):
        text = encoded()
        fb, outputs = started(text)
        expected = [row["fposition"] for row in aborted(fb, outputs, 20)][1:]
        fb, _ = started(text)
        for _ in range(20):
            fb.call()
        rows = [fb.call(bAbort=True)] + [
            fb.call(bAbort=False, bExecute=False, fStopDeceleration=0.0) for _ in expected[1:]
        ]
        assert [row["fposition"] for row in rows] == expected
        assert rows[-1]["baborted"]

    def test_abort_after_the_end_changes_nothing(self):
        fb, _ = started(encoded())
        for _ in range(50):
            fb.call()
        assert fb.call(bAbort=True)["bdone"]

    def test_an_axis_that_stays_can_abort(self):
        text = encoded(quintic((0.1, 0.4), (0.5, 0.5)), "x", "y")
        fb = FunctionBlock(text)
        outputs = fb.call(bExecute=True, fCycleTime=CYCLE, fActPosition_x=0.1, fActPosition_y=0.5)
        rows = aborted(fb, outputs, 25)
        assert {row["fposition_y"] for row in rows} == {0.5}


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
        edited = re.sub(r"(fStopDeceleration : LREAL := )\S+;", r"\g<1>2.5;", text).replace(
            "FB_bay_3", "FB_Kran"
        )
        assert replayed(edited).payload_hash() == replayed(text).payload_hash()

    def test_issues_altered_numbers_as_the_block_would(self):
        text = encoded()
        motion = replayed(text)
        literal = structured_text._literal(motion.position[20, 0])
        altered = replayed(text.replace(literal, "0.25", 1))
        assert altered.position[20, 0] == 0.25
        assert altered.payload_hash() != motion.payload_hash()

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ("nIndex := nIndex + 1;", "nIndex := nIndex + 2;", r"line \d+: '2' stands where .* '1'"),
            ("cPlaying : INT := 1", "cPlaying : INT := 2", r"'2' stands where .* '1'"),
            ("0.5 * fVelocityStep", "fVelocityStep", r"'fVelocityStep' stands where .* '0.5'"),
            ("bDone := nState = cDone;", "", r"'bAborted' stands where .* 'bDone'"),
            ("END_FUNCTION_BLOCK\n", "", "breaks off or goes on"),
            ("END_FUNCTION_BLOCK\n", "END_FUNCTION_BLOCK\nEND_VAR\n", "breaks off or goes on"),
            ("FUNCTION_BLOCK FB", "\u00ef\u00bb\u00bfFUNCTION_BLOCK FB", r"stands where .* 'FUNCTION_BLOCK'"),
            (
                "cCycleTime : LREAL := 2.0E-2",
                "cCycleTime : LREAL := 2.0E+2",
                "cycle time of 200 s lies outside",
            ),
            ("cCycleTime : LREAL := 2.0E-2", "cCycleTime : LREAL := cLast", "'cLast' is no finite number"),
            ("cLast : DINT := 50", "cLast : DINT := 49", r"51 values in an array \[0..50\] with cLast = 49"),
            ("[0..50]", "[0..49]", r"'\[0..50\]' stands where .* '\[0..49\]'"),
            ("1.0E-3", "1.0E+999", "'1.0E\\+999' is no finite number"),
            ("FB_bay_3", ";", "';' stands where a name is due"),
        ],
    )
    def test_refuses_another_program(self, old, new, message):
        text = encoded()
        assert old in text
        with pytest.raises(ExportError, match=message):
            replayed(text.replace(old, new, 1))

    def test_names_the_line_of_a_bad_number(self):
        lines = encoded().split("\n")
        row = next(k for k, line in enumerate(lines) if "aVelocity" in line) + 3
        lines[row] = re.sub(r"[\d.]+E\S\d+$", "NaN", lines[row].rstrip(","), count=1) + ","
        with pytest.raises(ExportError, match=rf"line {row + 1}: 'NaN' is no finite number"):
            replayed("\n".join(lines))

    def test_refuses_a_table_that_lost_a_line(self):
        lines = encoded().split("\n")
        del lines[next(k for k, line in enumerate(lines) if "aPosition :" in line) + 3]
        with pytest.raises(ExportError, match=r"47 values in an array \[0..50\] with cLast = 50"):
            replayed("\n".join(lines))

    def test_refuses_a_block_for_other_axes(self):
        with pytest.raises(ExportError, match=r"'fActPosition' stands where .* 'fActPosition_x'"):
            replayed(encoded(), "x", "y")

    def test_refuses_an_empty_file(self):
        with pytest.raises(ExportError, match="breaks off"):
            replayed("")
