"""Watching a block that runs: what is as proved passes to the last bit, whatever is not is named."""

import random
import signal
import types

import numpy as np
import pytest
from simulated_blocks import DirectLink, Machine, box_of, exported, poked, seen, setting

from gen_profile.delivery.deployment.block_state import MOVING, MotionState, read_state
from gen_profile.delivery.deployment.deploy import deploy
from gen_profile.delivery.deployment.simulated_block import SimulatedBlock
from gen_profile.delivery.deployment.table import read_table
from gen_profile.delivery.deployment.watching import watch as watching
from gen_profile.delivery.deployment.watching.motion import MotionJudge
from gen_profile.support.errors import CheckFailed, DeploymentError

GANTRY = ("export.cycle_time=0.02", "move.duration=8.0")


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    return read_table(exported(tmp_path_factory.mktemp("watched")))


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    return read_table(exported(tmp_path_factory.mktemp("other"), "move.distance=0.2"))


START = (0.5, setting(bExecute=1.0))


@pytest.mark.slow
def test_a_motion_is_the_tables_in_every_cycle(table):
    found, events = seen(table, Machine(table, [START]))
    assert found.fault is None and found.moving == found.exact > 250
    assert (found.runs, found.completed, found.off_nominal) == (1, 1, 0)
    assert found.states in {found.cycles, found.cycles + 1}
    assert events == ["motion 1 begins", "arrived"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("preset", "layout", "changes", "start"),
    [
        ("paper", "samples", (), {}),
        ("paper", "counts", (), {}),
        ("gantry-crane", "segments", GANTRY, {"fScale": [0.7, 1.0], "bMirror": [1.0, 0.0]}),
    ],
)
def test_hold_override_and_abort_are_followed_bit_for_bit(preset, layout, changes, start, tmp_path):
    """Against the compiled block itself, between the table's cycles too, on one axis and two."""
    path = exported(tmp_path, f"export.plc_layout={layout}", *changes, preset=preset)
    table = read_table(path)
    script = [
        (0.5, setting(bExecute=1.0, **start)),
        (1.0, setting(rOverride=0.37)),
        (2.0, setting(bHold=1.0)),
        (3.5, setting(bHold=0.0, rOverride=0.9)),
        (4.5, setting(bAbort=1.0)),
        (6.0, setting(bAbort=0.0)),
        (6.1, setting(bContinue=1.0)),
    ]
    found, events = seen(table, Machine(table, script), 25.0)
    assert found.fault is None and found.moving == found.exact > 600
    assert (found.runs, found.completed) == (2, 1)
    assert [one.split(",")[0] for one in events] == [
        "motion 1 begins",
        "its timing is changed",
        "stopped on the way",
        "motion 2 begins",
        "arrived",
    ]


@pytest.mark.slow
def test_a_watch_may_begin_on_the_way_and_miss_cycles(table, monkeypatch):
    machine = Machine(table, [START])
    machine.advance(1.0)
    machine.advance(0.5)
    monkeypatch.setattr(watching, "LEAST_INTERVAL", 0.13)
    found, events = seen(table, machine)
    assert found.fault is None and events == ["under way", "arrived"]
    assert found.states < found.cycles / 5


def altered(place, change, phase=MOVING):
    def alter(values):
        if values[1] == phase and values[8] > 40.0:
            values[place] = change(values[place])
        return values

    return alter


@pytest.mark.parametrize(
    ("place", "change", "words"),
    [
        (14, lambda x: x + 1e-9, "The position of cart is .* in cycle 4., and|of the motion"),
        (15, lambda x: x * (1 + 1e-9), "The velocity of cart"),
        (16, lambda x: -x, "The acceleration of cart"),
        (8, lambda x: x + 1.0, "The position of cart"),
        (10, lambda _: 0.25, "The position of cart"),
        (17, lambda _: 0.999, "The position of cart"),
        (18, lambda _: 1e-6, "The position of cart"),
        (11, lambda _: 1.5, "The velocity of cart"),
        (9, lambda _: 1.0, "has selected motion 1, which paper.st does not hold"),
        (6, lambda x: x + 1.0, "no longer uses paper.st"),
        (4, lambda _: 1.0, "no longer uses paper.st"),
        (5, lambda _: 2.0, "the checksum of its table wrong"),
    ],
)
def test_whatever_differs_is_named(place, change, words, table):
    found, events = seen(table, Machine(table, [START], altered(place, change)))
    assert isinstance(found.fault, CheckFailed)
    with pytest.raises(CheckFailed, match=words):
        raise found.fault
    assert events[-1] == str(found.fault)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 7.5])
@pytest.mark.parametrize("place", [1, 8, 14])
def test_what_is_no_state_of_a_block_is_refused(place, value, table):
    found, _ = seen(table, Machine(table, [START], altered(place, lambda _: value)))
    assert found.fault is not None
    assert ("holds no state of a block" in str(found.fault)) == (place < 14 or not np.isfinite(value))


def test_last_digits_may_differ_and_are_counted(table):
    """As a controller's compiler makes them that fuses multiplication and addition."""
    found, _ = seen(table, Machine(table, [START], altered(15, lambda x: np.nextafter(x, 9.0))))
    assert found.fault is None and 0 < found.exact < found.moving


def test_a_value_of_the_table_that_is_altered_in_the_controller_is_seen_in_the_motion(table):
    """Where the block has read its numbers already, its checksum is silent until it stands again."""

    def poke(machine):
        memory = machine.block._instance._memory
        at = memory.raw.find(table.values.tobytes())
        assert at >= 0
        for row in range(int(table.values[3])):  # the first power: position at each segment's beginning
            place = at + 8 * (3 + table.constant("cOwn") + row)
            value = np.frombuffer(memory.raw[place : place + 8]) + 1e-6
            memory[place : place + 8] = value.tobytes()

    found, _ = seen(table, Machine(table, [START, (1.5, poke)]))
    assert isinstance(found.fault, CheckFailed) and "The position of cart is" in str(found.fault)
    assert found.seconds < 1.6


def test_memory_that_fails_while_nothing_moves_is_told_by_the_checksum(table):
    machine = Machine(table, [(1.0, lambda machine: poked(machine.block, table.values, random.Random(3)))])
    found, _ = seen(table, machine)
    assert "the checksum of its table wrong" in str(found.fault)


def test_another_deployment_is_noticed(table, other, monkeypatch):
    monkeypatch.setattr(type(other), "check", lambda self, *_: table_judgement(self))
    machine = Machine(table, [(1.0, lambda machine: deploy(other, box_of(DirectLink(machine.block))))])
    found, _ = seen(table, machine)
    assert isinstance(found.fault, CheckFailed)
    assert f"with the checksum {int(other.checksum)} and not {int(table.checksum)}" in str(found.fault)


def table_judgement(_table):
    return types.SimpleNamespace(check=types.SimpleNamespace(passed=True))


def test_a_lost_connection_is_taken_up_again(table):
    machine = Machine(table, [START])
    machine.lost = [(1.0, 3.3), (4.0, 4.1)]
    found, events = seen(table, machine)
    assert found.fault is None and found.lost == 2 and found.completed == 1
    assert events == ["motion 1 begins", "connection lost for 2.5 s, arrived", "connection lost for 0.5 s"]


def test_a_connection_that_stays_lost_ends_it(table):
    machine = Machine(table)
    machine.lost = [(1.0, 1e9)]
    found, _ = seen(table, machine, 100.0)
    assert isinstance(found.fault, DeploymentError)
    assert "The connection broke (the cable was pulled), and could not be taken up" in str(found.fault)


def test_a_controller_that_stops_is_told(table):
    machine = Machine(table, [START, (1.5, lambda machine: setattr(machine, "runs", False))])
    found, _ = seen(table, machine)
    assert isinstance(found.fault, DeploymentError) and "is no longer called" in str(found.fault)


@pytest.mark.slow
def test_a_controller_that_was_started_anew_is_told(table, other):
    for after in (table, other):
        script = [(1.5, lambda machine, after=after: setattr(machine, "block", SimulatedBlock(after)))]
        found, _ = seen(table, Machine(table, script))
        assert isinstance(found.fault, DeploymentError) and "was started anew" in str(found.fault)
        assert found.cycles > 0


@pytest.mark.parametrize("pace", [0.5, 2.0])
def test_a_task_of_another_cycle_is_told_though_every_setpoint_is_the_tables(pace, table):
    found, _ = seen(table, Machine(table, [START], pace=pace))
    assert isinstance(found.fault, CheckFailed)
    assert f"is called every {20.0 / pace:.2g}" in str(found.fault).replace("39.9", "40").replace(
        "9.98", "10"
    )


@pytest.mark.parametrize(
    ("calls", "gain", "words"),
    [(0.0, 1.0, "went on by 1 cycles in 0 calls"), (3.0, 1.0, "by 1 cycles in 3"), (1.0, 0.5, "on the way")],
)
def test_a_motion_that_jumps_waits_or_bends_is_told(calls, gain, words, table):
    """Consistent as each single cycle is."""
    machine = Machine(table, [START])
    machine.advance(1.0)
    machine.advance(1.0)
    judge, before = MotionJudge(table), machine.block.outputs["aState"].copy()
    machine.block.run(1)
    after = machine.block.outputs["aState"].copy()
    judge.take(read_state(before, 1, MotionState), 0.0)
    after[[0, -1]] = before[0] + calls
    after[14:18] *= gain
    with pytest.raises(CheckFailed, match=words):
        judge.take(read_state(after, 1, MotionState), 0.02)


def test_states_of_two_cycles_are_read_again(table):
    torn = iter([True, True, False] * 10_000)

    def tear(values):
        if next(torn):
            values[-1] -= 1.0
        return values

    found, _ = seen(table, Machine(table, [START], tear))
    assert found.fault is None and found.completed == 1
    broken, _ = seen(table, Machine(table, [START], lambda values: np.append(values[:-1], 0.5)))
    assert "is of several cycles whenever it is read" in str(broken.fault)


def test_a_state_of_another_length_is_refused(table):
    found, _ = seen(table, Machine(table, alter=lambda values: values[:-1]))
    assert "aState has 19 values there in place of 20" in str(found.fault)


def test_a_refused_start_is_told_and_no_fault(table):
    found, events = seen(table, Machine(table, [(0.4, setting(fActPosition=0.1)), START]))
    assert found.fault is None and found.refused == 1
    assert events == ["start refused, error 2: the axis does not stand where the motion begins"]


def test_an_interrupt_ends_it_with_what_was_seen(table):
    machine = Machine(table, [START, (2.0, lambda _: signal.raise_signal(signal.SIGINT))])
    found, _ = seen(table, machine, None)
    assert found.fault is None and 1.9 < found.seconds < 2.1 and found.moving > 50
