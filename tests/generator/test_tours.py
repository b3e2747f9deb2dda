"""Rare inputs come in every state in every proof, as the commands before them tell."""

from bisect import bisect_right
from collections import Counter

import numpy as np
import pytest

from gen_profile.assurance.proof.exercised import LOST, MILLIONTH, NO_NUMBER, RISES, STANDING
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.assurance.proof.prove import _required
from gen_profile.spec.reading import preset_spec

SENSOR = [
    "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}",
    'planner.sensor={quantity="angle", of="theta1", noise=0.002, offset=0.005, delay=[0.05, 0.15]}',
    "planner.disturbance={swing={payload=0.5}, gust={acceleration=0.1, longest=5.0}, settle=12.0}",
]
MACHINES = {
    "bay": [],
    "sensor": SENSOR,
    "zones": ["planner.zones=true"],
    "hoisted": ["planner.live_rate={L1=0.1}"],
}
GUIDED = (STANDING, "position", "velocity", "stop")


def named(change, cycle):
    for name, value in change.inputs.items():
        if name == "fCycleTime" and abs(value / cycle - 1.0) < 1e-5:
            yield name + MILLIONTH
        else:
            yield name if np.isfinite(value) and (name, value) != ("rOverride", 1.5) else name + NO_NUMBER


def given(histories, drawn):
    """How often inputs come after commands of a kind."""
    found, cycle = Counter(), histories.spec.export.cycle_time
    for choices in drawn:
        history = histories.history(choices)
        times = [command.time for command in history.commands]
        for change in history.changes:
            last = bisect_right(times, change.time) - 1
            state = STANDING if last < 0 else history.commands[last].command
            found.update((name, state) for name in named(change, cycle))
    return found


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("seed", [1, 2])
def test_rare_inputs_come_in_every_state(machine, seed):
    histories = Histories.of(preset_spec("bay-crane", MACHINES[machine]))
    found = given(histories, histories.drawn(150, seed))
    rare = ["bReset", "fCycleTime", "fCycleTime" + MILLIONTH, "rOverride" + NO_NUMBER, "bQuickStop"]
    rare += [] if machine == "hoisted" else ["fL1", "fm2", "fL1" + NO_NUMBER, "fm2" + NO_NUMBER]
    rare += [] if machine == "sensor" else LOST
    missing = [(name, state) for name in rare for state in GUIDED if not found[name, state]]
    assert not missing
    assert found["bReset", "quick-stop"]
    powered_up = ("bExecute", "bVelocity", "bStop", "bReset", "bQuickStop")
    assert all(found[name, STANDING] for name in powered_up)


@pytest.mark.parametrize("machine", MACHINES)
def test_what_a_proof_requires_in_any_state_is_given(machine):
    """Whatever the seed, as a proof fails else: one with a sensor was refused for want of fActVelocity."""
    spec = preset_spec("bay-crane", MACHINES[machine])
    due = {name for name, state in _required(spec) if not state and not name.startswith("a sensor")}
    histories = Histories.of(spec)
    found = {name for name, _ in given(histories, histories.drawn(150, 4))}
    assert due - {*RISES} <= found


@pytest.mark.parametrize("machine", MACHINES)
def test_errors_are_acknowledged_and_cycles_wrong_without_enable_too(machine):
    histories, found = Histories.of(preset_spec("bay-crane", MACHINES[machine])), Counter()
    for choices in histories.drawn(150, 1):
        changes = histories.history(choices).changes
        off = [(one.time, one.time + one.lasts) for one in changes if one.inputs.get("bEnable") == 0.0]
        for one in changes:
            within = any(begin < one.time < end for begin, end in off)
            found.update(name for name in one.inputs if within)
    assert found["bReset"]
    assert found["fCycleTime"]


def test_commands_come_in_every_cycle():
    histories = Histories.of(preset_spec("bay-crane"))
    cycle = histories.spec.export.cycle_time
    in_a_row = Counter()
    for choices in histories.drawn(150, 1):
        for name in ("bExecute", "bVelocity"):
            times = [one.time for one in histories.history(choices).changes if name in one.inputs]
            in_a_row[name] += np.isclose(np.diff(sorted(times)), cycle).sum() > 30
    assert min(in_a_row.values()) > 5


def test_the_search_keeps_the_tour_of_what_it_climbs_from():
    numbering = Numbering.of(Histories.of(preset_spec("bay-crane")), 80, 1).after_round([7, 8])
    first = numbering.rounds[0].start
    tours = [numbering.choices(number)[-1] for number in (7, 8, first, first + 1)]
    assert tours[:2] == tours[2:]
    assert len({*np.round(numbering.drawn[:, -1], 9)}) > 20
