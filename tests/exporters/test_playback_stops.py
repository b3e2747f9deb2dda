"""How the playback block holds, slows down and stops: on the path, within its limits, never later."""

import random

import numpy as np
import pytest
from motions import bang_bang, quintic, target
from playing import QUANTITIES, checked, column, play, start

from gen_profile_exporters.playback import structured_text
from gen_profile_exporters.playback.table import tabulate

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


class Laws:
    """What holds for every cycle of every motion, whatever the inputs."""

    def __init__(self, profile, layout, cycle=CYCLE):
        self.text, self.cycle = encoded(profile, layout, cycle_time=cycle), cycle
        table = tabulate(profile, goal_of(profile, layout, cycle_time=cycle))
        self.velocity, self.acceleration, self.jerk = *table.peaks[:2], table.limits.jerk
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
    @pytest.mark.slow
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
            assert len(rows) <= 51
            played_on = rows[-1]["fposition"] == fb["cTarget"]
            assert rows[-1]["boffnominal"] != played_on
            assert fb["bLeft"] != played_on
            laws.hold_for_stop(rows)
            stopped = fb.call(bAbort=False)
            assert (stopped["baborted"], stopped["fposition"]) == (True, rows[-1]["fposition"])
            assert not fb.call(bExecute=False)["baborted"]

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

    @pytest.mark.slow
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


class TestStopDeceleration:
    """MC_Stop's Deceleration and Jerk (PLCopen, motion control, part 1)."""

    @pytest.mark.parametrize("harder", [1.5, 4.0])
    @pytest.mark.parametrize("profile", THERE_AND_BACK.values(), ids=THERE_AND_BACK.keys())
    def test_it_stops_sooner_within_what_is_given_and_never_later_than_the_motion(self, profile, harder):
        laws = Laws(profile, "segments")
        gentle, hard = checked(laws.text), checked(laws.text)
        deceleration, jerk = harder * laws.acceleration, harder * laws.jerk
        given = {"fStopDeceleration": deceleration.tolist(), "fStopJerk": jerk.tolist()}
        if profile.axes == 1:
            given = {name: value[0] for name, value in given.items()}
        laws.acceleration, laws.jerk = deceleration, jerk
        saved = 0
        for cycle in range(1, 50, 3):
            lengths = []
            for fb, own in ((gentle, {}), (hard, given)):
                rows = [start(fb)]
                rows += [fb.call() for _ in range(cycle - 1)]
                rows += play(fb, fb.call(bAbort=True, **own))
                laws.hold_for_stop(rows)
                lengths.append(len(rows))
            assert lengths[1] <= lengths[0] <= 51
            saved += lengths[0] - lengths[1]
        assert saved > 10

    def test_without_a_jerk_it_is_as_the_deceleration_asks_for(self):
        fb = checked(encoded())
        start(fb)
        rows = [fb.call() for _ in range(24)]
        rows += play(fb, fb.call(bAbort=True, fStopDeceleration=20.0))
        assert np.abs(column(rows, "acceleration")).max() <= 20.0
        assert len(rows) - 24 <= 6  # 0.56 m/s: two cycles at 20 m/s2, and as many to build it up

    @pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), 0.5])
    def test_less_than_the_motion_s_own_peak_means_that_peak(self, value):
        fb = checked(encoded())
        lengths = []
        for given in (0.0, value):
            start(fb)
            for _ in range(12):
                fb.call()
            lengths.append(len(play(fb, fb.call(bAbort=True, fStopDeceleration=given, fStopJerk=given))))
        assert lengths[0] == lengths[1]


class TestContinue:
    """MC_GroupContinue (PLCopen, motion control, part 4) after an abort."""

    def aborted(self, cycle=12):
        laws = Laws(TWO_MOVES, "segments")
        fb = checked(laws.text)
        rows = [start(fb)]
        rows += [fb.call() for _ in range(cycle)]
        rows += play(fb, fb.call(bAbort=True))
        assert rows[-1]["baborted"]
        return fb, laws, rows

    @pytest.mark.parametrize("kept", [True, False])
    def test_it_plays_the_way_that_is_left(self, kept):
        fb, laws, rows = self.aborted()
        standing = rows[-1]["fposition"]
        fb.call(bAbort=False, bExecute=kept)
        rows.append(fb.call(bContinue=True, fActPosition=standing))
        assert rows[-1]["fposition"] == standing
        rows += play(fb, rows[-1])[1:]
        laws.hold_for(rows)
        assert rows[-1]["bdone"] and rows[-1]["boffnominal"]
        assert rows[-1]["fposition"] == fb["cTarget"]

    def test_time_and_distance_to_go_shrink_to_nothing(self):
        fb, _, rows = self.aborted()
        left = [row["ftimetogo"] for row in rows]
        assert left[0] == 1.0 and (np.diff(left) < 0.0).all() and left[-1] > 0.3
        ends = np.array([row["fposition"] for row in rows]) + [row["fdistancetogo"] for row in rows]
        np.testing.assert_allclose(ends, [fb["cTarget"]] * len(rows), atol=1e-12)
        fb.call(bAbort=False)
        rows = play(fb, fb.call(bContinue=True, fActPosition=rows[-1]["fposition"]))
        assert rows[-1]["ftimetogo"] == 0.0 and rows[-1]["fdistancetogo"] == [0.0, 0.0]

    def test_it_is_refused_where_the_axis_was_moved_and_taken_up_where_it_is_near(self):
        fb, laws, rows = self.aborted()
        fb.call(bAbort=False)
        standing = np.array(rows[-1]["fposition"])
        moved = fb.call(bContinue=True, fActPosition=(standing + np.array([0.0, 0.01])).tolist())
        assert (moved["berror"], moved["nerrorid"]) == (True, 2)
        fb.call(bContinue=False)
        near = (standing + np.array([0.0009, -0.0009])).tolist()
        rows = [fb.call(bContinue=True, fActPosition=near)]
        np.testing.assert_allclose(rows[0]["fposition"], near, atol=1e-12)
        rows += play(fb, rows[0])[1:]
        laws.least, laws.most = laws.least - 0.001, laws.most + 0.001
        laws.hold_for(rows)
        np.testing.assert_allclose(rows[-1]["fposition"], fb["cTarget"], atol=1e-12)

    def test_it_is_refused_where_nothing_is_left(self):
        fb = checked(encoded())
        assert fb.call(bContinue=True, fCycleTime=CYCLE, fActPosition=0.1)["nerrorid"] == 8
        assert fb.call(bContinue=False)["nerrorid"] == 0
        play(fb, start(fb))
        assert fb.call(bContinue=True)["nerrorid"] == 8


class TestStartWithinTheTolerance:
    @pytest.mark.parametrize("layout", LAYOUTS)
    @pytest.mark.parametrize("away", [0.0009, -0.0009])
    @pytest.mark.parametrize("profile", THERE_AND_BACK.values(), ids=THERE_AND_BACK.keys())
    def test_it_begins_where_the_axis_stands_and_ends_at_the_target(self, profile, away, layout):
        laws = Laws(profile, layout)
        fb = checked(laws.text)
        begin = (np.array(fb["cStart"]) + away).tolist()
        rows = play(fb, start(fb, fActPosition=begin))
        np.testing.assert_allclose(rows[0]["fposition"], begin, atol=1e-12)
        assert not rows[-1]["boffnominal"]
        assert 51 <= len(rows) <= 52
        np.testing.assert_allclose(rows[-1]["fposition"], fb["cTarget"], atol=1e-12)
        laws.least, laws.most = laws.least - 0.001, laws.most + 0.001
        laws.hold_for(rows)

    def test_a_way_that_grows_much_longer_is_flagged(self):
        fb = checked(encoded(quintic((0.1, 0.12))))
        rows = play(fb, start(fb, fActPosition=0.0991))
        assert rows[-1]["boffnominal"] and rows[-1]["bdone"]
        assert len(rows) == 51 + np.ceil(50 * 0.9 / 20.0)

    def test_an_axis_that_does_not_move_stays_where_it_is(self):
        fb = checked(encoded(quintic((0.1, 0.4), (0.5, 0.5))))
        rows = play(fb, start(fb, fActPosition=[0.1, 0.5004]))
        assert {row["fposition"][1] for row in rows} == {0.5004}


@pytest.mark.slow
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("profile", THERE_AND_BACK.values(), ids=THERE_AND_BACK.keys())
def test_the_laws_hold_for_random_inputs(profile, layout):
    """With the three profiles and layouts, 3600 motions in all."""
    laws, choices = Laws(profile, layout, cycle=0.05), random.Random(3)
    fb = checked(laws.text)
    outcomes = set()
    for _ in range(400):
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
