"""Setpoints that a drive leaves out, found in what it tells; what lags, starts or ends is no such thing."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from exporters.can.bench import Bench, RigidLoad
from motions import quintic

from gen_profile.delivery.streaming.outcome import Source, StreamOutcome
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.following import standstills

PERIOD = 0.004


def found(bench, record):
    return standstills(bench.plan.motion.at_sync, record.actual, record.answered, PERIOD)


@pytest.mark.slow
@pytest.mark.parametrize("many", [1, 2, 3])
@pytest.mark.parametrize("goal", [0.4, -0.2])
def test_setpoints_that_a_drive_leaves_out(many, goal):
    """A drive that holds instead of going on moves less, and follows again afterwards."""

    def drop(message):
        if message is not None and message.arbitration_id == 0x301 and bench.fault_at and left:
            left.pop()
            return None
        return message

    left = [None] * many
    with Bench(make=DriveVariant(miss="hold"), profile=quintic((0.1, goal)), following_error=0.01) as bench:
        bench.at_cycle(120, lambda: None)
        bench.drive_end.receiving = drop
        record = bench.run()
    assert record.reason == ""
    (stood,) = found(bench, record)
    assert (stood.column, len(stood.cycles)) == (0, many)
    assert stood.cycles == tuple(range(stood.cycles[0], stood.cycles[0] + many))
    assert abs(stood.cycles[0] - 121) <= 1
    step = np.abs(np.diff(bench.plan.motion.position[:, 0])).max()
    assert stood.apart == pytest.approx(many * step, rel=0.02)
    machine = SimpleNamespace(actuated=[SimpleNamespace(name="cart", unit="m")])
    source = Source(plan=bench.plan, spec=SimpleNamespace(machine=lambda: machine))
    document = StreamOutcome(source=source, record=record, notes=("first",)).to_dict()
    assert (document["drive"]["cycles_standing"], document["drive"]["cycles_unanswered"]) == (many, 0)
    cycles = "1 cycle" if many == 1 else f"{many} cycles"
    pattern = (
        rf"axis cart: it stood still in {cycles} of the motion, from cycle 12\d on, and came [\d.]+ mm off"
    )
    assert re.match(pattern, document["notes"][1])


@pytest.mark.slow
@pytest.mark.parametrize("lag", [0.0, 0.8])
def test_an_axis_that_follows_or_lags_stands_still_nowhere(lag):
    with Bench(load=RigidLoad([0.1], lag=lag)) as bench:
        record = bench.run()
    assert record.reason == ""
    assert found(bench, record) == ()


def test_a_delay_is_no_standstill_and_neither_are_lost_answers():
    led = np.rint(1e6 * quintic((0.0, 0.3))(np.arange(251) * PERIOD).position).astype(np.int64)
    late = np.concatenate([np.repeat(led[:1], 10, axis=0), led[:-10]])
    answered = np.ones(251, dtype=bool)
    assert standstills(led, late, answered, PERIOD) == ()
    frozen = late.copy()
    frozen[100:103] = frozen[99]
    answered[100:103] = False
    assert standstills(led, frozen, answered, PERIOD) == ()
    assert standstills(led[:5], led[:5], answered[:5], PERIOD) == ()
