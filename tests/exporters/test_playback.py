"""The playback block, executed cycle by cycle: what it issues, when it refuses, and how it stops."""

import random
import re

import numpy as np
import pytest
from motions import bang_bang, quintic, target
from playing import QUANTITIES, checked, column, play, start
from st_interpreter import FunctionBlock

from gen_profile.profile import sample
from gen_profile_exporters import structured_text
from gen_profile_exporters.playback_table import tabulate

MOVE = quintic((0.1, 0.4))
TWO_MOVES = quintic((0.1, 0.4), (1.2, -0.7))
THERE_AND_BACK = {"there": quintic((0.1, 0.4)), "bang-bang": bang_bang(), "two axes": TWO_MOVES}
CYCLE = 0.02
LAYOUTS = ["segments", "samples", "counts"]
ROUNDING = 1e-9  # relative


def goal_of(profile, layout="segments", **options):
    names = ("bridge", "trolley")[: profile.axes]
    return target(*names, **{"cycle_time": CYCLE, "export": {"plc_layout": layout}, **options})


def encoded(profile=MOVE, layout="segments", **options):
    return structured_text.block_text(profile, goal_of(profile, layout, **options))


class TestNominal:
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

    def test_memory_that_fails_later_is_found_before_the_next_start(self):
        fb = checked(encoded(layout="samples"))
        play(fb, start(fb))
        fb.alter("cPosition", 7, fb["cPosition"][7] + 1e-9)
        for _ in range(50):
            fb.call(bExecute=False)
        assert start(fb)["nerrorid"] == 5


class Laws:
    """What holds for every cycle of every motion, whatever the inputs."""

    def __init__(self, profile, layout, cycle=CYCLE):
        self.text, self.cycle = encoded(profile, layout, cycle_time=cycle), cycle
        table = tabulate(profile, goal_of(profile, layout, cycle_time=cycle))
        self.velocity, self.acceleration, self.jerk = *table.peaks()[:2], table.limits().jerk
        count = 1.0 if layout == "counts" else 0.0  # positions are whole there, between cycles too nearly
        span = np.sort([table.start, table.target], axis=0)
        self.least, self.most = span[0] - count - 1e-12, span[1] + count + 1e-12
        self.smooth = layout == "segments"

    def hold_for(self, rows):
        position, velocity, acceleration = (column(rows, quantity) for quantity in QUANTITIES)
        slack = 1.0 + ROUNDING
        assert (np.abs(velocity) <= self.velocity * slack).all()
        assert (np.abs(acceleration) <= self.acceleration * slack).all()
        assert (np.abs(np.diff(acceleration, axis=0)) <= self.jerk * self.cycle * slack).all()
        assert (position >= self.least).all()
        assert (position <= self.most).all()
        # Velocity and acceleration are those of the positions: Taylor's remainder, with the rate's own jerk.
        if self.smooth:
            moved = np.diff(position, axis=0) - 0.5 * self.cycle * (velocity[1:] + velocity[:-1])
            assert (np.abs(moved) <= self.jerk * self.cycle**3 / 12.0 * (1.0 + ROUNDING) + 1e-15).all()

    def hold_for_stop(self, rows):
        """The last row stands still, with no step of velocity larger than acceleration and jerk allow."""
        self.hold_for(rows)
        assert (column(rows[-1:], "velocity") == 0.0).all()
        assert (np.abs(column(rows[-1:], "acceleration")) <= self.jerk * self.cycle).all()


class TestStops:
    @pytest.mark.parametrize("layout", LAYOUTS)
    @pytest.mark.parametrize("profile", THERE_AND_BACK.values(), ids=THERE_AND_BACK.keys())
    def test_abort_at_every_cycle_stops_on_the_path(self, profile, layout):
        laws = Laws(profile, layout)
        fb = checked(laws.text)
        for cycle in range(1, 50):
            rows = [start(fb)]
            rows += [fb.call() for _ in range(cycle - 1)]
            rows += play(fb, fb.call(bAbort=True))
            assert rows[-1]["baborted"]
            assert rows[-1]["boffnominal"] or cycle > 45
            laws.hold_for_stop(rows)
            stopped = fb.call(bAbort=False)
            assert (stopped["baborted"], stopped["fposition"]) == (True, rows[-1]["fposition"])
            assert not fb.call(bExecute=False)["baborted"]

    def test_a_stop_takes_no_longer_than_full_braking_from_full_speed(self):
        for profile in THERE_AND_BACK.values():
            table = tabulate(profile, goal_of(profile))
            limits = table.limits()
            fb = checked(encoded(profile))
            for cycle in range(1, 50):
                start(fb)
                for _ in range(cycle - 1):
                    fb.call()
                rows = play(fb, fb.call(bAbort=True))
                # to full slope, along it and back to none; longer where the motion itself brakes already
                longest = 1.0 / limits.slope + limits.slope / limits.slope_rate
                assert len(rows) <= 1.5 * longest / CYCLE + 3

    def test_axes_stay_together_on_the_path(self):
        fb = checked(encoded(TWO_MOVES))
        for cycle in range(1, 50, 4):
            rows = [start(fb, rOverride=0.7)]
            rows += [fb.call() for _ in range(cycle)]
            rows += play(fb, fb.call(bAbort=True))
            share = (column(rows, "position") - fb["cStart"]) / (np.array(fb["cTarget"]) - fb["cStart"])
            np.testing.assert_allclose(share[:, 0], share[:, 1], atol=1e-9)

    def test_abort_goes_on_when_abort_or_execute_drop(self):
        fb = checked(encoded())
        start(fb)
        for _ in range(20):
            fb.call()
        rows = play(fb, fb.call(bAbort=True, bHold=True))
        start(fb)
        for _ in range(20):
            fb.call()
        again = [fb.call(bAbort=True)]
        while again[-1]["bbusy"]:
            again.append(fb.call(bAbort=False, bExecute=False, rOverride=1.0))
        assert again == rows

    def test_abort_after_the_end_changes_nothing(self):
        fb = checked(encoded())
        play(fb, start(fb))
        assert fb.call(bAbort=True)["bdone"]

    @pytest.mark.parametrize("layout", LAYOUTS)
    def test_hold_at_every_cycle_then_on_to_the_target(self, layout):
        laws = Laws(MOVE, layout)
        fb = checked(laws.text)
        for cycle in range(1, 50):
            rows = [start(fb)]
            rows += [fb.call() for _ in range(cycle - 1)]
            rows += [fb.call(bHold=True) for _ in range(60)]
            laws.hold_for_stop(rows[: cycle + 60])
            assert rows[-1]["bbusy"] or cycle > 25
            standing = rows[-1]["fposition"]
            assert fb.call()["fposition"] == standing
            rows.append(fb.call(bHold=False))
            rows += play(fb, rows[-1])[1:]
            laws.hold_for(rows)
            assert rows[-1]["bdone"]
            assert rows[-1]["fposition"] == fb["cTarget"]

    def test_hold_at_the_start_delays_it(self):
        fb = checked(encoded())
        rows = [start(fb, bHold=True)] + [fb.call() for _ in range(5)]
        assert {row["fposition"] for row in rows} == {0.1}
        assert rows[0]["boffnominal"]
        assert play(fb, fb.call(bHold=False))[-1]["bdone"]

    @pytest.mark.parametrize("override", [0.25, 0.5, 0.9])
    def test_a_constant_override_slows_the_whole_motion(self, override):
        fb = checked(encoded())
        rows = play(fb, start(fb, rOverride=override))
        assert len(rows) == np.ceil(50 / override - 1e-9) + 1
        times = np.arange(len(rows)) * CYCLE * override
        motion = MOVE(times)
        np.testing.assert_allclose(column(rows, "position"), motion.position, atol=1e-9)
        np.testing.assert_allclose(column(rows, "velocity"), override * motion.velocity, atol=1e-9)
        np.testing.assert_allclose(column(rows, "acceleration"), override**2 * motion.acceleration, atol=1e-9)
        assert rows[0]["boffnominal"]

    @pytest.mark.parametrize("override", [1.0, 1.5, float("inf")])
    def test_override_never_speeds_up(self, override):
        fb = checked(encoded())
        rows = play(fb, start(fb, rOverride=override))
        assert (len(rows), rows[-1]["boffnominal"]) == (51, False)

    @pytest.mark.parametrize("override", [0.0, -1.0, float("nan")])
    def test_no_override_is_a_hold(self, override):
        fb = checked(encoded())
        start(fb)
        rows = [fb.call(rOverride=override) for _ in range(60)]
        assert rows[-1]["bbusy"]
        assert rows[-1]["fvelocity"] == 0.0

    @pytest.mark.parametrize("layout", LAYOUTS)
    def test_an_axis_that_stays_takes_part_in_nothing(self, layout):
        profile = quintic((0.1, 0.4), (0.5, 0.5))
        fb = checked(encoded(profile, layout))
        start(fb)
        for _ in range(25):
            fb.call()
        rows = play(fb, fb.call(bAbort=True))
        assert {row["fposition"][1] for row in rows} == {fb["cStart"][1]}
        assert len(rows) < 30


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("profile", THERE_AND_BACK.values(), ids=THERE_AND_BACK.keys())
def test_the_laws_hold_for_random_inputs(profile, layout):
    """With the three profiles and layouts, 10 000 motions in all."""
    laws, choices = Laws(profile, layout, cycle=0.05), random.Random(3)
    fb = checked(laws.text)
    outcomes = set()
    for _ in range(1112):
        rows = [start(fb, rOverride=choices.choice([1.0, 1.0, 0.6]), bHold=choices.random() < 0.05)]
        rate = choices.choice([0.05, 0.2, 0.5])
        aborts = choices.randrange(60)
        while rows[-1]["bbusy"] and len(rows) < 70:
            inputs = {"bAbort": len(rows) >= aborts and choices.random() < 0.9}
            if choices.random() < rate:
                inputs["bHold"] = choices.random() < 0.3
            if choices.random() < rate:
                inputs["rOverride"] = choices.choice([0.0, 0.3, choices.random(), 1.0, 2.0])
            if choices.random() < 0.05:
                inputs["bExecute"] = choices.random() < 0.5
            rows.append(fb.call(**inputs))
        rows += play(fb, fb.call(bAbort=True))
        laws.hold_for(rows)
        outcomes.add((rows[-1]["bdone"], rows[-1]["baborted"], rows[-1]["boffnominal"]))
    assert {(True, False, True), (False, True, True)} <= outcomes
