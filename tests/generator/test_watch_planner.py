"""Watching a planner block that runs: whatever it is commanded passes, and what it never does is named."""

import io

import numpy as np
import pytest
from rich.console import Console
from simulated_blocks import Machine, exported_planner, seen, setting

from gen_profile.cli.deployment.watching import picture, reporting, words
from gen_profile.delivery.deployment.block_state import PlannerState, read_state
from gen_profile.delivery.deployment.simulated_block import SimulatedBlock
from gen_profile.delivery.deployment.table import read_table
from gen_profile.delivery.deployment.watching.watch import watch
from gen_profile.support.errors import CheckFailed, DeploymentError

pytestmark = pytest.mark.slow

READY = (0.5, setting(bEnable=1.0, bLoadAtRest=1.0))
TO_FIVE = (1.0, setting(fTarget=5.0, bExecute=1.0))


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    return read_table(exported_planner(tmp_path_factory.mktemp("planner")))


def test_a_clumsy_hand_is_followed(table):
    """New target on the way, stop, stick, quick stop, a drive that trips and moves on, no target at all."""
    script = [
        READY,
        TO_FIVE,
        (4.0, setting(bExecute=0.0)),
        (4.1, setting(fTarget=3.0, bExecute=1.0)),
        (6.0, setting(bStop=1.0)),
        (12.0, setting(bStop=0.0, bExecute=0.0, bVelocity=1.0)),
        (12.5, setting(fVelocityCommand=-0.6)),
        (15.0, setting(bQuickStop=1.0)),
        (17.0, setting(bQuickStop=0.0, bVelocity=0.0, fVelocityCommand=np.nan)),
        (18.0, setting(bEnable=0.0)),
        (18.5, setting(fActPosition=9.0, fActVelocity=0.5)),
        (18.6, setting(bEnable=1.0)),
        (22.0, setting(fTarget=np.nan, bExecute=1.0)),
        (23.0, setting(bExecute=0.0, bLoadAtRest=0.0)),
        (24.0, setting(fTarget=8.0, bExecute=1.0, bLoadAtRest=1.0)),
    ]
    found, events = seen(table, Machine(table, script), 40.0)
    assert found.fault is None, found.fault
    assert found.moving > 500 and found.exact == 0
    assert (found.completed, found.refused, found.off_nominal) == (1, 1, 2)
    reported = " | ".join(events)
    for event in (
        "commanded to move to 5",
        "commanded to move to 3",
        "a stick is followed",
        "the axis is braked at once",
        "disabled; the axis stands",
        "error 3: the target",
        "the load may sway: after a quick stop",
        "the target is reached, at 8",
    ):
        assert event in reported


def altered(change, begin=200.0, phase=2):
    def alter(values):
        if values[1] == phase and values[0] > begin:
            change(values)
        return values

    return alter


def scaled(place, factor):
    def change(values):
        values[place] *= factor

    return change


def shifted(place, way):
    def change(values):
        values[place] += way

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (scaled(15, 5.0), "The velocity of cart is .* is moving, where"),
        (shifted(16, 1.0), "The acceleration of cart is .* is moving, where"),
        (shifted(14, 0.01), "The position of cart went from .* which no motion within the limits"),
        (shifted(15, 0.05), "The velocity of cart went from"),
        (scaled(16, -1.0), "The acceleration of cart went from"),
        (shifted(14, 100.0), "The position of cart went from"),
        (shifted(6, 1.0), "no longer uses bay-crane.st"),
        (shifted(4, 1.0), "no longer uses bay-crane.st"),
        (shifted(5, 1.0), "the checksum of its table wrong"),
    ],
)
def test_what_no_command_makes_it_do_is_named(change, words, table):
    found, events = seen(table, Machine(table, [READY, TO_FIVE], altered(change, begin=700.0)), 8.0)
    assert isinstance(found.fault, CheckFailed)
    with pytest.raises(CheckFailed, match=words):
        raise found.fault
    assert events[-1] == str(found.fault)


def test_it_stands_still_where_it_stands(table):
    found, _ = seen(table, Machine(table, [READY], altered(shifted(15, 1e-6), phase=1)), 3.0)
    assert "The velocity of cart is 1e-06 while bay-crane.st is standing, where 0 is the most" in str(
        found.fault
    )


def test_the_travel_is_left_by_no_plan(table):
    """Though each setpoint leads to the next one: all of them are elsewhere than they should be."""
    high = table.spec.limits.travel[1]
    script = [
        (0.3, setting(fActPosition=high - 1.0)),
        READY,
        (1.0, setting(fTarget=high - 0.2, bExecute=1.0)),
    ]
    found, _ = seen(table, Machine(table, script), 12.0)
    assert found.fault is None and found.completed == 1
    outside, _ = seen(
        table, Machine(table, script, lambda values: values + np.eye(len(values))[14] * 0.5), 12.0
    )
    assert "lies beyond the travel" in str(outside.fault)


def test_another_state_than_a_block_has_is_refused(table):
    found, _ = seen(table, Machine(table, [READY], altered(shifted(1, 3.0), phase=1)), 3.0)
    assert isinstance(found.fault, DeploymentError) and "holds no state of a block" in str(found.fault)


def test_a_command_that_no_block_has_ends_nothing(table):
    found, events = seen(table, Machine(table, [READY], altered(shifted(8, 5.0), phase=1)), 2.0)
    assert found.fault is None and any("an event that is not known here" in event for event in events)


def test_a_controller_that_was_started_anew_is_noticed(table):
    def restart(machine):
        machine.block = SimulatedBlock(table)

    found, _ = seen(table, Machine(table, [READY, (1.5, restart)]))
    assert isinstance(found.fault, DeploymentError) and "was started anew" in str(found.fault)


def test_it_is_logged_and_drawn_beside_what_it_is_commanded(table, tmp_path):
    machine, log = Machine(table, [READY, TO_FIVE]), tmp_path / "log.csv"
    with reporting(table, log) as report:
        found = watch(table, machine, report, seconds=4.0, now=lambda: machine.time, pause=machine.advance)
    assert words(found, table).endswith("a motion, within all limits; motions begun: 1, targets reached: 0.")
    rows = [line.split(",") for line in log.read_text("utf-8").splitlines()]
    assert rows[0][3:8] == ["error", "promise", "command", "time_to_go_s", "cart_position_m"]
    assert rows[0][-3:] == ["cart_target_m", "cart_speed_m_per_s", "event"]
    moving = [dict(zip(rows[0], row, strict=False)) for row in rows if row[2] == "moving"]
    assert len(moving) > 100 and {row["cart_target_m"] for row in moving} == {"5.0"}
    places = np.array([float(row["cart_position_m"]) for row in moving])
    assert (np.diff(places) > 0.0).all()
    console = Console(width=80, record=True, file=io.StringIO())
    console.print(picture(table)(read_state(machine.state(), 1, PlannerState), 4.0, 80))
    drawn = console.export_text()
    assert "4.0 s  moving, to 5," in drawn and "s to go" in drawn
