"""What a proof counts of inputs, states and outputs, and what so many histories bound."""

from types import SimpleNamespace

import attrs
import numpy as np
from generator.test_proof_obedience import CYCLES, STICK, STOPPED, TOLD, obedient

from gen_profile.assurance.proof.exercised import (
    ANYWHERE,
    POWERED_UP,
    STANDING,
    exercised,
    never,
    required,
    sensor_met,
    table,
)
from gen_profile.assurance.proof.numbering import DRAWS, SEARCH
from gen_profile.assurance.proof.orders import POSITION, STOP, VELOCITY
from gen_profile.assurance.proof.prove import _required, seed_of
from gen_profile.assurance.proof.verdict import Proof
from gen_profile.spec.reading import preset_spec

NAMES = ("bExecute", "fTarget_x", "aSlowLow_x[3]", "bStop", "fL1")
NONE = np.nan
ROWS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 3.0],
        [1.0, 5.0, 0.0, 0.0, 3.0],  # from a standstill
        [1.0, 5.0, 2.0, 0.0, NONE],  # on the way to the target
        [1.0, 5.0, 2.0, 0.0, NONE],
        [0.0, 5.0, 2.0, 1.0, NONE],  # under the stick
    ]
)


def counted():
    return exercised(obedient(), [0, TOLD, 300, STICK - 100, STOPPED], ROWS, NAMES)


def test_inputs_are_counted_by_the_state_in_which_they_change():
    found = counted()
    inputs = {
        key: times
        for key, times in found.items()
        if key[0] in {"bExecute", "fTarget", "aSlowLow", "bStop", "fL1"}
    }
    assert inputs == {
        ("bExecute", STANDING): 1,
        ("fTarget", STANDING): 1,
        ("aSlowLow", POSITION): 1,
        ("fL1", POSITION): 1,
        ("fL1", POWERED_UP): 1,
        ("bExecute", VELOCITY): 1,
        ("bStop", VELOCITY): 1,
    }


def test_outputs_are_counted_where_they_come():
    followed = obedient()
    followed.issued["nErrorId"][STOPPED + 50 : STOPPED + 60] = 3.0
    found = exercised(followed, [0], ROWS[:1], NAMES)
    assert found["bDone", POSITION] == 1
    assert found["bInVelocity", VELOCITY] == 1
    assert found["nErrorId 3", STOP] == 1
    assert table(found)["nErrorId 3"]["stopping"] == 1


def test_pairs_that_never_came_are_named():
    found = counted()
    missing = never(found, required(["L1", "m2"]))
    assert {"bExecute stopping", "bVelocity standing", "bQuickStop to a target", "fm2"} <= {*missing}
    assert {"fL1 for one cycle by a stick", "bStop at power-up", "bReset in a quick stop"} <= {*missing}
    assert not {"bExecute standing", "bStop by a stick", "fL1", "bDone"} & {*missing}
    met = required(["L1"], [sensor_met(""), sensor_met("dead")])
    assert {"a sensor: dead"} == {*never({(sensor_met(""), ANYWHERE): 1}, met)} & {
        "a sensor: dead",
        "a sensor: sound",
        "bEnable standing",
    }


def test_what_is_rare_in_a_change_is_counted_beside_it():
    names = ("fCycleTime", "fL1", "bStop")
    rows = np.array(
        [
            [0.01, 3.0, 1.0],
            [0.01 * (1.0 + 1e-6), 3.0, 0.0],
            [0.01, NONE, 0.0],
            [0.02, 4.0, 0.0],
            [0.01, 3.0, 0.0],
        ]
    )
    found = exercised(obedient(), [0, 200, 300, 301, 302], rows, names)
    inputs = {
        name: times for (name, state), times in found.items() if state == POSITION and name[1:] != "Done"
    }
    assert {name: times for name, times in inputs.items() if name.startswith(("fC", "fL", "bS"))} == {
        "fCycleTime by a millionth": 2,
        "fCycleTime": 2,
        "fCycleTime for one cycle": 2,
        "fL1": 3,
        "fL1 that is no number": 1,
        "fL1 for one cycle": 1,
        "bStop": 1,
    }
    assert found["bStop", POWERED_UP] == 1


def proof(count, fails=0, **known):
    judged = [
        SimpleNamespace(
            number=k,
            group=DRAWS if k % 4 else SEARCH,
            faults=("a fault, at 1 s",) * (k < fails),
            fraction=lambda *_: 0.5,
            promise=True,
            obeyed=(),
            exercised={("bStop", STANDING): 1},
            residual={"payload": 0.0},
        )
        for k in range(count)
    ]
    few = {
        "limit": {"payload": 0.05},
        "error_bound": 0.0,
        "seed": 7,
        "parents": (),
        "by_fmpy": (),
        "apart": 0.0,
    }
    return Proof(**few, count=count, judged=tuple(judged), **known)


def test_a_proof_fails_where_a_pair_never_came():
    assert proof(200).passed
    (reason,) = proof(200, required=[("bStop", STANDING), ("bStop", POSITION)]).reasons()
    assert reason.startswith("No history tried bStop to a target: ")


def test_no_failure_in_so_many_bounds_the_share_that_would_fail():
    assert proof(200).bound == (150, 0.02)
    assert (
        proof(200).sureness() == "none of 150 drawn by chance fails: fewer than 2 % of such would (at 95 %)"
    )
    assert proof(200, fails=2).sureness() == "1 of 150 drawn by chance fail, with the seed 7"


def test_live_parameters_that_change_in_every_cycle_need_no_events_of_their_own():
    """No tour gives them any, so every proof of 200 histories would fail."""
    changes = ([], ["planner.live_rate={L1=0.1}"], ["planner.live_noise={m2=20.0}"])
    pairs = [_required(preset_spec("bay-crane", change)) for change in changes]
    assert [any(name.startswith("fm2") for name, _ in one) for one in pairs] == [True, False, False]


def test_specs_that_differ_meet_other_histories():
    spec = preset_spec("bay-crane")
    seeds = {
        seed_of(one) for one in (spec, attrs.evolve(spec, name="other"), spec.changed({"check.seed": 1}))
    }
    assert len(seeds) == 3
    assert seed_of(preset_spec("bay-crane")) == seed_of(spec)
    assert CYCLES > STOPPED
