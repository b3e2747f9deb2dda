"""Drives are left as they were found, whatever became of the stream."""

import attrs
import pytest
from exporters.can.bench import OTHER_MAKE, Bench
from exporters.motions import quintic

from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.record import Phase

OPTIONS = {
    "following_error": 0.01,
    "quick_stop": 2.0,
    "travel": {"cart": (0.0, 0.5)},
    "encoder": (65536, 1),
    "gear": (3, 1),
    "feed": (196608, 1),
    "feed_forward": "both",
    "torque_per_acceleration": 50.0,
}
OWN = {(0x6085, 0): 77, (0x6007, 0): 2, (0x6060, 0): 9, (0x1017, 0): 250, (0x607D, 1): -5, (0x607D, 2): 10**6}
OTHER_MASTER, OURS = 5 << 16 | 500, 127 << 16 | 20
FED = {0x6040, 0x6041, 0x6061, 0x6064, 0x607A, 0x60B1, 0x60B2}  # what is commanded and reported, not set


def held(drive):
    """Everything that a drive is set to."""
    dictionary = drive.local.object_dictionary
    entries = [entry.values() if hasattr(entry, "values") else [entry] for entry in dictionary.values()]
    places = [(one.index, one.subindex) for variables in entries for one in variables if one.writable]
    return {
        (index, sub): drive.value(index, sub)
        for index, sub in places
        if index not in FED and not (index & 0x0200 and index < 0x1C00 and sub > drive.value(index))
    }


def own_settings(bench, watched=OTHER_MASTER):
    for place, value in {**OWN, (0x1016, 1): watched}.items():
        bench.drive.store(*place, value)
        bench.drive._values.pop(place, None)
    return held(bench.drive)


@pytest.mark.slow
@pytest.mark.parametrize("make", [DriveVariant(), OTHER_MAKE, attrs.evolve(DriveVariant(), own_mapping=True)])
@pytest.mark.parametrize("stop", [False, True])
def test_a_drive_is_left_as_it_was_found(make, stop):
    with Bench(make=make, profile=quintic((0.1, 0.4)), **OPTIONS) as bench:
        before, during = own_settings(bench), []
        if stop:
            bench.at_cycle(100, lambda: bench.streamer.ask_to_stop("Interrupted."))
        else:
            bench.at_cycle(100, lambda: during.append(held(bench.drive)))
        record = bench.run()
        after = held(bench.drive)
    assert record.phase is (Phase.ABORTED if stop else Phase.DONE)
    assert record.aftermath == ""
    assert stop or len(during[0].items() - before.items()) > 12
    assert after == before


def test_one_that_was_refused_is_left_so_too():
    with Bench("bridge", "trolley", profile=quintic((0.1, 0.4), (1.2, -0.7))) as bench:
        before = [held(drive) for drive in bench.drives.drives]
        bench.drives.drives[1].store(0x6064, 0, 0)
        record = bench.run()
        assert "it stands at 0" in record.reason
        assert [held(drive) for drive in bench.drives.drives] == before


def test_a_heartbeat_is_watched_again_where_another_drive_was_unfit_from_the_beginning():
    with Bench("bridge", "trolley", profile=quintic((0.1, 0.4), (1.2, -0.7))) as bench:
        before = own_settings(bench)
        bench.drives.drives[1].store(0x1000, 0, 0x0002_0191)
        assert "no CiA 402 drive" in bench.run().reason
        assert held(bench.drive) == before


def test_a_heartbeat_that_a_killed_stream_left_watched_is_not():
    with Bench() as bench:
        own_settings(bench, watched=OURS)
        bench.run()
        assert bench.drive.value(0x1016, 1) == 0


def test_a_drive_that_did_not_stop_keeps_its_time_outs():
    with Bench(timeout=0.02) as bench:
        bench.at_cycle(100, lambda: setattr(bench.drive_end, "sending", lambda _: False))
        record = bench.run()
        assert "Not every axis is known to stand" in record.reason
        assert bench.drive.value(0x1016, 1) == OURS
        assert bench.drive.value(0x6007) == 3


def test_what_is_not_taken_back_is_told():
    with Bench(quick_stop=2.0) as bench:
        entry = bench.drive.local.object_dictionary[0x6085]
        bench.at_cycle(100, lambda: setattr(entry, "access_type", "ro"))
        record = bench.run()
    assert record.phase is Phase.DONE
    assert record.aftermath == "Node 1 does not take back what it held in 6085h:00."


def test_a_drive_that_still_brakes_keeps_its_ramp():
    """It says that it is in fault, and brakes all the same."""
    with Bench(quick_stop=2.0) as bench:
        before, plain_feedback, ramps = held(bench.drive), bench.drive.feedback, []
        lie = b"\x08\x02"
        bench.at_cycle(
            120, lambda: setattr(bench.drive, "feedback", lambda: [(0x181, lie + plain_feedback()[0][1][2:])])
        )
        braking = (State.QUICK_STOP, State.FAULT_REACTION)
        look = lambda: bench.drive.state in braking and ramps.append(bench.drive.value(0x6085))  # noqa: E731
        bench.clock.actors.append(look)
        bench.run()
        assert held(bench.drive) == before
    assert set(ramps) == {2_000_000}


def tell_statusword(bench, word):
    """Have the drive tell one statusword always, by PDO and by SDO."""
    drive = bench.drive
    pack = drive._pack_feedback
    drive._pack_feedback = lambda: (pack(), drive.store(0x6041, 0, word))


RAMPS = {"profile": quintic((0.0, 0.3), duration=3.0), "quick_stop": 1.4}


@pytest.mark.parametrize("word", [0x0001, 0x0250], ids=["no state", "switch on disabled"])
class TestADriveThatBrakesWhateverItsStatuswordSays:
    def stopped(self, bench, word):
        bench.drive.store(0x6085, 0, 500_000)
        bench.drive._values.pop((0x6085, 0), None)
        ramps, said = [], []
        look = lambda: bench.drive.state is State.QUICK_STOP and ramps.append(bench.drive.value(0x6085))  # noqa: E731
        bench.clock.actors.append(look)
        bench.streamer._tell = lambda phase: said.append((phase, bench.drive.velocity))
        bench.at_cycle(
            375, lambda: (tell_statusword(bench, word), bench.streamer.ask_to_stop("Interrupted."))
        )
        return bench.run(), set(ramps), said

    @pytest.mark.slow
    def test_it_keeps_its_ramp_until_it_stands(self, word):
        with Bench(**RAMPS) as bench:
            record, ramps, said = self.stopped(bench, word)
            assert ramps == {1_400_000}
            assert said[-1] == ("aborted", 0.0)
            put_back = bench.drive.value(0x6085)
        known = word == 0x0250
        assert record.reason.endswith("The axes were stopped.") == known
        assert put_back == (500_000 if known else 1_400_000)
        assert known or "(cart: statusword 0001h, which is no state of CiA 402)" in record.reason

    @pytest.mark.slow
    def test_one_that_does_not_brake_is_not_said_to_stand(self, word):
        with Bench(**RAMPS) as bench:
            ways = ("_obey", "_lose_connection", "fault")
            bench.then_at_cycle(374, lambda: [setattr(bench.drive, way, lambda _: None) for way in ways])
            bench.then_at_cycle(375, lambda: setattr(bench.drive, "runaway", 100_000.0))
            record, _, _ = self.stopped(bench, word)
            assert bench.drive.value(0x6085) == 1_400_000
        assert "were stopped" not in record.reason
        known = "'switch on disabled', but not seen to stand" if word == 0x0250 else "statusword 0001h"
        assert f"Not every axis is known to stand (cart: {known}" in record.reason


def test_settings_are_not_put_back_under_an_axis_that_still_moves():
    """It coasts after the motion, without power."""
    with Bench(quick_stop=2.0) as bench:
        before = held(bench.drive)

        release = lambda: "disable" in bench.phases and bench.drive.state is State.SWITCH_ON_DISABLED  # noqa: E731
        bench.clock.actors.append(
            lambda: release() and bench.drive.store(0x6064, 0, int(400_000 + 100 * bench.now))
        )
        record = bench.run()
        assert held(bench.drive) != before
    assert record.aftermath == "Node 1 is not known to stand; its settings stay those of the motion."
