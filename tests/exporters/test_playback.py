"""The playback block, executed cycle by cycle: what it issues, when it refuses, and how it stops."""

import re

import numpy as np
import pytest
from motions import bang_bang, quintic, target
from playing import QUANTITIES, checked, column, play, start
from st_interpreter import FunctionBlock

from gen_profile.motion.profile import sample
from gen_profile_exporters.playback import structured_text
from gen_profile_exporters.playback.table import tabulate

MOVE = quintic((0.1, 0.4))
TWO_MOVES = quintic((0.1, 0.4), (1.2, -0.7))
THERE_AND_BACK = {"there": quintic((0.1, 0.4)), "bang-bang": bang_bang(), "two axes": TWO_MOVES}
CYCLE = 0.02
LAYOUTS = ["segments", "samples", "counts"]


def goal_of(profile, layout="segments", **options):
    names = ("bridge", "trolley")[: profile.axes]
    return target(*names, **{"cycle_time": CYCLE, "export": {"plc_layout": layout}, **options})


def encoded(profile=MOVE, layout="segments", **options):
    return structured_text.block_text(profile, goal_of(profile, layout, **options))


class TestNominal:
    @pytest.mark.slow
    @pytest.mark.parametrize("layout", LAYOUTS)
    @pytest.mark.parametrize("unit", ["m", "mm", "deg", "counts"])
    @pytest.mark.parametrize("sign", [1, -1])
    def test_issues_bit_for_bit_what_replay_says(self, layout, unit, sign):
        for profile in THERE_AND_BACK.values():
            goal = goal_of(profile, layout, unit=unit, sign=sign)
            text = structured_text.block_text(profile, goal)
            motion = structured_text.replay(text.encode("ascii"), goal)
            fb = checked(text)
            rows = play(fb, start(fb))
            assert [row["bdone"] for row in rows] == [False] * 50 + [True]
            assert not any(row["boffnominal"] for row in rows)
            factor = tabulate(profile, goal).axes[0].factor
            for quantity in QUANTITIES:
                issued = column(rows, quantity) / factor + 0.0
                np.testing.assert_array_equal(issued, getattr(motion, quantity))

    def test_segments_are_the_motion_to_a_nanometre(self):
        fb = checked(encoded())
        rows, motion = play(fb, start(fb)), sample(MOVE, CYCLE)
        assert np.abs(column(rows, "position") - motion.position).max() <= 1e-9
        assert np.abs(column(rows, "acceleration") - motion.acceleration).max() <= 1e-6

    def test_counts_are_the_absolute_position_rounded(self):
        fb = checked(encoded(layout="counts", unit="mm", counts_per_si=1000.0))
        rows = play(fb, start(fb))
        counts = [row["nposition"] for row in rows]
        assert counts == np.rint(1000.0 * sample(MOVE, CYCLE).position[:, 0]).tolist()
        assert counts == [row["fposition"] for row in rows]

    def test_holds_the_target_while_execute_lasts(self):
        fb = checked(encoded())
        play(fb, start(fb))
        for _ in range(3):
            outputs = fb.call()
            assert (outputs["bdone"], outputs["fposition"], outputs["fvelocity"]) == (True, 0.4, 0.0)
        outputs = fb.call(bExecute=False)
        assert not (outputs["bbusy"] or outputs["bdone"] or outputs["baborted"] or outputs["berror"])
        assert outputs["fposition"] == 0.4

    def test_dropping_execute_does_not_stop_and_done_shows_for_one_cycle(self):
        fb = checked(encoded())
        start(fb)
        outputs = [fb.call(bExecute=False) for _ in range(52)]
        assert [row["bdone"] for row in outputs] == [False] * 49 + [True, False, False]

    def test_a_second_edge_during_the_motion_is_ignored(self):
        fb = checked(encoded(layout="samples"))
        start(fb)
        for _ in range(10):
            fb.call(bExecute=False)
        assert fb.call(bExecute=True)["fposition"] == sample(MOVE, CYCLE).position[11, 0]

    def test_it_starts_again_only_where_the_motion_begins(self):
        fb = checked(encoded())
        play(fb, start(fb))
        assert start(fb, fActPosition=0.4)["nerrorid"] == 2
        assert fb.call(bExecute=False)["nerrorid"] == 0
        assert len(play(fb, start(fb))) == 51

    def test_stands_still_without_execute(self):
        fb = FunctionBlock(encoded())
        for _ in range(30):
            outputs = fb.call(fCycleTime=CYCLE, fActPosition=0.1)
            assert not (outputs["bbusy"] or outputs["bdone"] or outputs["baborted"] or outputs["berror"])
            assert (outputs["fposition"], outputs["fvelocity"]) == (0.1, 0.0)

    @pytest.mark.parametrize("layout", LAYOUTS)
    def test_one_cycle_is_motion_enough(self, layout):
        fb = checked(encoded(quintic((0.0, 1e-3), duration=0.015), layout))
        assert [row["fposition"] for row in play(fb, start(fb))][-1] == fb["cTarget"]


class TestVariants:
    @pytest.mark.parametrize("layout", LAYOUTS)
    @pytest.mark.parametrize(
        ("scale", "mirror", "offset"), [(0.5, False, 0.0), (1.0, True, 0.0), (0.25, True, 2.0)]
    )
    def test_scale_mirror_and_offset_turn_the_same_motion(self, layout, scale, mirror, offset):
        fb = checked(encoded(layout=layout))
        planned = play(fb, start(fb))
        begin = fb["cStart"]
        unit = fb["cTarget"] - begin  # of 0.3 m
        shift = offset * unit
        rows = play(
            fb, start(fb, fScale=scale, bMirror=mirror, fStartOffset=shift, fActPosition=begin + shift)
        )
        gain = -scale if mirror else scale
        expected = begin + shift + gain * (column(planned, "position") - begin)
        np.testing.assert_allclose(column(rows, "position"), expected, rtol=1e-12, atol=1e-12)
        for quantity in ("velocity", "acceleration"):
            np.testing.assert_allclose(
                column(rows, quantity), gain * column(planned, quantity), rtol=1e-12, atol=1e-12
            )
        assert not rows[-1]["boffnominal"]

    def test_they_are_taken_over_at_the_start(self):
        fb = checked(encoded())
        planned = column(play(fb, start(fb)), "position")
        rows = [start(fb)]
        while rows[-1]["bbusy"]:
            rows.append(fb.call(fScale=0.3, bMirror=True, fStartOffset=7.0, fActPosition=-1.0))
        np.testing.assert_array_equal(column(rows, "position"), planned)


class TestRefusals:
    @pytest.mark.parametrize(
        ("error", "inputs"),
        [
            (1, {"fCycleTime": 0.0}),
            (1, {"fCycleTime": 0.01}),
            (1, {"fCycleTime": 0.02001}),
            (1, {"fCycleTime": float("nan")}),
            (2, {"fActPosition": 0.1011}),
            (2, {"fActPosition": 0.0}),
            (2, {"fActPosition": float("nan")}),
            (2, {"fActPosition": 0.1005, "fStartTolerance": 0.0004}),
            (2, {"fStartOffset": 0.2}),
            (3, {"fScale": -0.1}),
            (3, {"fScale": 1.1}),
            (3, {"fScale": float("nan")}),
            (4, {"bAbort": True}),
        ],
    )
    def test_nothing_moves_and_the_reason_shows(self, error, inputs):
        fb = checked(encoded())
        outputs = start(fb, **inputs)
        for _ in range(2):
            assert (outputs["berror"], outputs["nerrorid"], outputs["bbusy"]) == (True, error, False)
            assert (outputs["fposition"], outputs["fvelocity"]) == (0.1, 0.0)
            outputs = fb.call()
        assert not fb.call(bExecute=False)["berror"]

    @pytest.mark.parametrize(
        "inputs", [{"fCycleTime": 0.02000000001}, {"fActPosition": 0.1009}, {"fScale": 0.0}]
    )
    def test_what_is_near_enough_starts(self, inputs):
        assert start(checked(encoded()), **inputs)["bbusy"]

    def test_every_axis_is_checked(self):
        fb = checked(encoded(TWO_MOVES))
        assert start(fb, fActPosition=[0.1, 0.0])["nerrorid"] == 2
        assert start(fb, fActPosition=[0.0, 1.2])["nerrorid"] == 2
        assert start(fb, fActPosition=[0.1, 1.2])["nerrorid"] == 0

    @pytest.mark.parametrize("layout", LAYOUTS)
    def test_any_altered_value_of_the_table_is_found(self, layout):
        text = encoded(bang_bang(), layout, cycle_time=0.1)
        names = ["cPosition", "cVelocity", "cAcceleration"]
        if layout == "segments":
            names = ["cFirst", *(f"cPower{power}" for power in range(6))]
        assert start(checked(text))["bbusy"]
        for name in names:
            for index, value in enumerate(FunctionBlock(text)[name]):
                fb = FunctionBlock(text)
                fb.alter(
                    name, index, value + 1 if isinstance(value, int) else np.nextafter(value, 1.0).item()
                )
                outputs = play(fb, start(fb))[-1]
                assert (outputs["berror"], outputs["nerrorid"], outputs["fposition"]) == (
                    True,
                    5,
                    fb["cStart"],
                )

    def test_a_start_waits_for_the_checksum(self):
        text = encoded(layout="samples")
        cycles = int(re.search(r"found right \((\d+) cycles", text)[1])
        fb = FunctionBlock(text)
        rows = play(fb, fb.call(bExecute=True, fCycleTime=CYCLE, fActPosition=0.1))
        assert all(row["bbusy"] for row in rows[:-1])
        assert len(rows) == cycles + 50
        assert (column(rows[:cycles], "velocity") == 0.0).all()
        assert rows[-1]["bdone"]

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("layout", "cycle"), [("samples", 0.004), ("counts", 0.002), ("segments", 0.001)]
    )
    def test_the_checksum_of_a_long_table_is_there_within_a_second(self, layout, cycle):
        text = encoded(quintic((0.1, 9.4), duration=6.0), layout, cycle_time=cycle)
        fb = FunctionBlock(text)
        fb.call()
        values = len(list(fb.constants())) - 1
        assert (fb["cChecks"] - 1) * 1.0 / cycle <= max(values, 8.0 / cycle)
        calls = 1
        while not fb["bChecked"]:
            fb.call()
            calls += 1
        assert calls * cycle <= 1.0 + cycle
        assert fb["bIntact"]
        assert f"found right ({calls} cycles" in text

    def test_memory_that_fails_later_is_found_before_the_next_start(self):
        fb = checked(encoded(layout="samples"))
        play(fb, start(fb))
        fb.alter("cPosition", 7, fb["cPosition"][7] + 1e-9)
        for _ in range(50):
            fb.call(bExecute=False)
        assert start(fb)["nerrorid"] == 5
