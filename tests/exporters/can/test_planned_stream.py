"""A planner block that drives its axis: the bus carries what the block issues, and every stop works."""

import csv
import os
import pty
import re
import struct
import termios
from contextlib import suppress

import attrs
import numpy as np
import pytest
from exporters.can.bench import MS, QUICK_STOP, Bench, RigidLoad
from fmu.kinds import PLANNED, planner_text

from gen_profile.delivery.streaming.keyboard import Keyboard, Keys
from gen_profile.delivery.streaming.outcome import Source, StreamOutcome
from gen_profile.delivery.streaming.planned_motion import CommandList, PlannedMotion
from gen_profile.planner.commands import play, read_commands
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.interface import BlockAxis
from gen_profile.spec.can import CanSpec
from gen_profile.support.errors import SpecError
from gen_profile_exporters.can.cia402 import State
from gen_profile_exporters.can.streaming.record import Book, Phase

COUNTS = 1_000_000
CYCLE = PLANNED.export.cycle_time
COMMANDS = "time_s,command,value,L1\n0.1,position,0.2,0.48\n0.7,velocity,-0.3,\n1.2,stop,,\n"
AXES = (BlockAxis(name=""),)
LONG = "time_s,command,value\n0.1,velocity,0.4\n"


def spec_of(**can):
    return attrs.evolve(PLANNED, can=CanSpec(**{"sync_period": CYCLE, "timeout": 0.5} | can))


def source_of(spec, commands=COMMANDS, **live):
    operator = commands
    if isinstance(commands, str):
        operator = CommandList(read_commands(commands, AXES, ("L1",)), CYCLE)
    return PlannedMotion(spec, BlockInstance(planner_text()), operator, live)


def bench_of(source, stand=0, **options):
    load = RigidLoad([stand / COUNTS])
    return Bench(source=source, step=MS, stand=[stand], load=load, **options)


def played(commands=COMMANDS, calls=1):
    """What `planner play` writes, at every SYNC."""
    rows = list(csv.DictReader(play(planner_text(), commands).table.splitlines()))
    return {name: np.array([float(row[name]) for row in rows])[::calls] for name in rows[0]}


@pytest.mark.slow
def test_targets_of_cycles_one_after_the_other_are_all_taken():
    commands = f"time_s,command,value\n0.1,position,0.1\n{0.1 + CYCLE},position,0.2\n"
    with bench_of(source_of(spec_of(), commands)) as bench:
        record = bench.run()
    last = struct.unpack_from("<i", bench.of(0x301)[-1].data)[0]
    assert (record.phase, last) == (Phase.DONE, round(0.2 * COUNTS))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("calls", "can"),
    [
        (1, {}),
        (2, {"feed_forward": "velocity"}),
        (1, {"mode": "csv", "following_error": 0.01}),
    ],
)
def test_the_bus_carries_what_the_block_issues(calls, can):
    period = calls * CYCLE
    source = source_of(spec_of(sync_period=period, **can))
    with bench_of(source) as bench:
        record = bench.run()
    assert (record.phase, record.reason) == (Phase.DONE, "")
    assert "approach" not in bench.phases
    due = played(calls=calls)
    many = min(len(due["position_m"]), record.sent)  # standing at the end is counted by SYNC
    assert abs(len(due["position_m"]) - record.sent) <= 1
    counts = np.rint(due["position_m"][:many] * COUNTS).astype(int)
    sent = np.array([struct.unpack_from("<i", frame.data)[0] for frame in bench.of(0x301)])
    moves = np.flatnonzero(counts)[0]
    if can.get("mode") == "csv":
        moves = np.flatnonzero(np.rint(due["position_m"] * COUNTS / period))[0]
        led = np.cumsum(sent[np.flatnonzero(sent)[0] :]) * period
        np.testing.assert_allclose(led[: many - moves], counts[moves:], atol=1.0)
    else:
        begin = np.flatnonzero(sent)[0] - moves
        np.testing.assert_array_equal(sent[begin : begin + many], counts)
    assert record.final == (counts[-1],)
    np.testing.assert_array_equal(source.at_sync[1:many, 0], counts[: many - 1])
    np.testing.assert_array_equal(source.columns["promise"][:many], due["promise"][:many])
    assert not source.columns["error_id"].any()


@pytest.mark.slow
def test_who_interrupts_gets_a_stop_without_sway():
    """The same as a command to stop in that cycle, and the drives are switched off in order."""
    source = source_of(spec_of(), LONG)
    with bench_of(source) as bench:
        bench.at_cycle(80, lambda: bench.streamer.ask_to_stop("Stopped by SIGINT."))
        record = bench.run()
    words = "Stopped by SIGINT. The axes were stopped without sway."
    assert (record.phase, record.reason) == (Phase.ABORTED, words)
    assert QUICK_STOP not in [frame.data for frame in bench.of(0x201)]
    assert bench.phases[-3:] == ["hold", "disable", "aborted"]
    due = [np.rint(played(f"{LONG}{CYCLE * at:.3f},stop,\n")["position_m"] * COUNTS) for at in (80, 81, 82)]
    assert any(np.array_equal(source.at_sync[1:, 0], one[: record.sent - 1]) for one in due)


@pytest.mark.parametrize("what", ["asked twice", "fault", "silent"])
def test_what_is_wrong_or_urgent_stops_at_once(what):
    def act():
        if what == "asked twice":
            bench.streamer.ask_to_stop("Stopped by SIGINT.")
            bench.streamer.ask_to_stop("Stopped by SIGTERM.")
        elif what == "fault":
            bench.say(0x081, bytes([0x10, 0x23, 0, 0, 0, 0, 0, 0]))
        else:
            bench.drives_alive = False

    with bench_of(source_of(spec_of(timeout=0.04), LONG)) as bench:
        bench.at_cycle(80, act)
        record = bench.run()
    assert record.phase is Phase.ABORTED
    reasons = {"asked twice": "Stopped by SIGTERM", "fault": "emergency 2310h", "silent": "no feedback"}
    assert reasons[what] in record.reason
    stops = [frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP]
    allowed = 3 * 10 + (40 if what == "silent" else 0)
    assert stops[0] - bench.fault_at <= allowed
    assert max(frame.at for frame in bench.of(0x301)) <= stops[0]


def test_the_axis_begins_where_it_stands_and_only_within_the_travel():
    with bench_of(source_of(spec_of()), stand=150_000) as bench:
        record = bench.run()
    assert record.reason == ""
    assert record.actual[0, 0] == 150_000
    with bench_of(source_of(spec_of()), stand=1_000_100) as bench:
        record = bench.run()
    assert "stands at 1.0001, outside the planner's travel of -1 to 1" in record.reason
    assert not bench.of(0x301)


def test_the_screen_shows_beforehand_how_far_a_stop_leads():
    source = source_of(spec_of(), LONG)
    with bench_of(source) as bench:
        shown = []
        bench.at_cycle(150, lambda: bench.streamer.ask_to_stop("Stopped by SIGINT."))
        bench.streamer._tell = lambda words: shown.append(
            (words, 0 if source.goal is None else source.goal[0], bench.fault_at)
        )
        record = bench.run()
    lines = [
        (float(found[1]), at, asked)
        for words, at, asked in shown
        if (found := re.search(r"m/s, stops within ([\d.]+) m, no sway", words))
    ]
    (within, at, _) = [line for line in lines if line[2] is None][-1]
    assert record.final[0] > at
    later = 0.4 * 0.25 + 0.02  # m, of what the axis goes on between two lines
    assert (record.final[0] - at) / COUNTS <= within + later
    assert any("stopping without sway" in words for words, _, _ in shown)
    assert len(lines) <= record.sent * CYCLE / 0.25 + 1


def test_what_never_began_has_a_table():
    source = Source(spec=spec_of(), plan=source_of(spec_of()))
    record = Book.blank(0, 1).record("no answer", (0,), aftermath="", launched=False)
    outcome = StreamOutcome(source=source, record=record, notes=())
    assert outcome.table() == b"time_s,cart_planned_m,cart_actual_m,promise,error_id\n"


def test_a_setpoint_that_comes_too_late_is_left_out():
    """The block goes on meanwhile, so that the axis is where it would be."""
    source = source_of(spec_of(), LONG.replace("0.4", "0.2") + "0.8,stop,\n")
    with bench_of(source) as bench:
        bench.at_cycle(40, lambda: bench.clock.stall(17 * MS))
        record = bench.run()
    assert record.reason == ""
    assert record.sent == len(source.at_sync) - 1


def test_errors_and_lost_promises_are_told():
    commands = "time_s,command,value,L1\n0.1,velocity,0.3,0.48\n1.0,position,7.0,0.42\n"
    source = source_of(spec_of(), commands, L1=0.44)
    with bench_of(source) as bench:
        bench.run()
    assert source.remarks == (
        "The block showed error 3: the target or the stick's velocity was no number, or the target out of "
        "its range.",
        "The load may sway, because a live parameter changed on the way.",
    )


@pytest.mark.slow
@pytest.mark.parametrize("calls", [1, 2])
@pytest.mark.parametrize(
    ("commands", "at", "error"),
    [
        ("time_s,command,value\n0.1,position,7.0\n", 0.1, 3),  # outside the travel
        ("time_s,command,value\n0.1,position,7.0\n0.11,position,0.2\n5.0,position,0.0\n", 0.1, 3),
        ("time_s,command,value,L1\n0.1,velocity,0.2,\n0.5,velocity,0.2,70.0\n", 0.7, 2),  # held for 0.2 s
    ],
)
def test_what_the_block_refuses_is_not_done(commands, at, error, calls):
    """Nothing of a file is carried out after that; the axis stands, without sway."""
    source = source_of(spec_of(sync_period=calls * CYCLE), commands)
    with bench_of(source) as bench:
        record = bench.run()
        assert bench.drive.state is State.SWITCH_ON_DISABLED
    assert record.phase is Phase.ABORTED
    words = (
        r"At ([\d.]+) s the block refused its commands: error (\d): .* The axes were stopped without sway\."
    )
    found = re.fullmatch(words, record.reason)
    assert float(found[1]) == pytest.approx(at, abs=2 * CYCLE)
    assert int(found[2]) == error
    assert QUICK_STOP not in [frame.data for frame in bench.of(0x201)]
    assert record.sent * calls * CYCLE < at + 4.0


def test_a_block_that_does_not_fit_the_bus_is_refused():
    with pytest.raises(SpecError, match=r"can\.sync_period: 0\.015 s are no whole number"):
        source_of(spec_of(sync_period=0.015))
    with pytest.raises(SpecError, match=r"can\.travel\.cart: it must hold"):
        source_of(spec_of(travel={"cart": (-0.5, 1.0)}))
    with pytest.raises(SpecError, match=r"no live parameter 'L2'"):
        source_of(spec_of(), L2=0.3)


def test_keys_are_a_stick_and_buttons():
    keys = Keys(AXES, [2.0])
    sent = (b"\x1b[C\x1b", b"[C", b"\x1bOD", b" 1.5", b"\x7f25\r", b"\x1b[D", b"q", b"..\r", b"x")
    taken = [one for some in sent for one in keys.take(some)]
    commands = [(one.command, *(round(value, 9) for value in one.values)) for one in taken]
    stick = [("velocity", 0.2), ("velocity", 0.4), ("velocity", 0.2)]
    then = [("stop",), ("position", 1.25), ("velocity", -0.2), ("quick-stop",), ("stop",)]
    assert commands == [*stick, *then]
    assert keys.over


def test_no_digit_of_a_typed_place_is_taken_without_what_stands_between():
    keys = Keys(AXES, [2.0])
    assert list(keys.take(b"3,5\r")) == []  # 35 m, if the comma were passed over
    assert keys.shown == "3,5 is no number; write a decimal point: 3.5"
    assert list(keys.take("−5\r".encode())) == [] and keys.shown.endswith("is no number")  # a printer's minus
    assert [one.values for one in keys.take(b"1e-1\r")] == [(0.1,)]


def test_keys_of_longer_sequences_are_none_of_a_place():
    """Delete, and the cursor's keys with Ctrl."""
    keys = Keys(AXES, [2.0])
    assert [one.values for one in keys.take(b"0.5\x1b[3~\x1b[1;5C\x1b[2\r"[:-2])] == []
    assert [one.values for one in keys.take(b"~\r")] == [(0.5,)]


def test_of_two_axes_each_has_arrows_and_places():
    keys = Keys((BlockAxis(name="x"), BlockAxis(name="y")), [2.0, 1.0])
    commands = [(one.command, one.values) for one in keys.take(b"\x1b[C\x1b[B3,1.5\r7\r")]
    assert commands == [("velocity", (0.2, 0.0)), ("velocity", (0.2, -0.1)), ("position", (3.0, 1.5))]
    assert keys.shown == "7: enter a position for each of 2 axes"


@pytest.fixture
def terminal(monkeypatch):
    ours, theirs = pty.openpty()
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())
    yield ours, theirs
    for end in (ours, theirs):
        with suppress(OSError):  # closed already
            os.close(end)


@pytest.mark.slow
def test_the_keyboard_drives_and_the_terminal_comes_back(terminal):
    ours, theirs = terminal
    before = termios.tcgetattr(theirs)
    keyboard = Keyboard(theirs, AXES, [0.5])
    source = source_of(spec_of(), keyboard)
    with keyboard.operated(), bench_of(source) as bench:
        os.write(ours, b"\x1b[D")  # before the motion begins
        bench.at_cycle(10, lambda: os.write(ours, 3 * b"\x1b[C"))
        bench.then_at_cycle(300, lambda: os.write(ours, b"x"))
        record = bench.run()
        assert termios.tcgetattr(theirs) != before
    assert termios.tcgetattr(theirs) == before
    assert record.reason == ""
    steps = np.diff(source.at_sync[:300, 0])  # until it stops
    assert steps.max() == pytest.approx(0.15 * COUNTS * CYCLE, rel=0.01)
    way = source.at_sync[:, 0]
    assert (np.maximum.accumulate(way) - way).max() < 0.01 * COUNTS  # it may back up for the load, a little
    assert any("stick at 0.15 m/s" in words for words in bench.phases)


@pytest.mark.slow
def test_who_sees_the_error_may_go_on(terminal):
    ours, theirs = terminal
    for then in (b"0.05\r", b""):
        keyboard = Keyboard(theirs, AXES, [0.5])
        with keyboard.operated(), bench_of(source_of(spec_of(), keyboard)) as bench:
            bench.at_cycle(10, lambda: os.write(ours, b"7.0\r"))
            bench.then_at_cycle(60, lambda then=then: os.write(ours, then))
            bench.then_at_cycle(600, lambda: os.write(ours, b"x"))
            record = bench.run()
        assert (record.phase, record.reason) == (Phase.DONE, "")
        assert any("error 3" in words for words in bench.phases)


@pytest.mark.parametrize("mode", [{}, {"mode": "csv", "following_error": 0.02}], ids=["csp", "csv"])
def test_one_that_runs_off_is_stopped(mode):
    with bench_of(source_of(spec_of(**mode), LONG)) as bench:
        bench.drive._watch_following_error = lambda: None
        bench.at_cycle(80, lambda: setattr(bench.drive, "runaway", -300_000.0))
        record = bench.run()
    assert "off the motion, more than can.following_error" in record.reason
    assert record.reason.endswith("The axes were stopped.")
    stop = next(frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP)
    window = 0.02 if mode else 1.5 * 0.5 * (0.03 + 2 * CYCLE) + 0.001  # by the velocity limit
    assert stop - bench.fault_at <= 1e3 * (window / 0.3 + 2 * CYCLE)


def test_a_terminal_that_is_gone_stops_the_axis(terminal):
    ours, theirs = terminal
    keyboard = Keyboard(theirs, AXES, [0.5])
    source = source_of(spec_of(), keyboard)
    with keyboard.operated(), bench_of(source) as bench:
        bench.at_cycle(10, lambda: os.write(ours, b"\x1b[C"))
        bench.then_at_cycle(80, lambda: os.close(ours))
        record = bench.run()
    assert record.reason == ""
    assert 0 < record.final[0] < 100_000
    assert record.sent < 400


def test_what_is_no_terminal_is_refused():
    reading, writing = os.pipe()
    with pytest.raises(SpecError, match="standard input is no terminal"):
        Keyboard(reading, AXES, [0.5])
    os.close(reading)
    os.close(writing)
