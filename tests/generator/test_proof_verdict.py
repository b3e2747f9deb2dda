"""The sentences of a proof that fails."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from generator.test_proof_obedience import (
    CYCLES,
    MOVE,
    REST,
    STICKS,
    STOPPED,
    kinds,
    obedient,
    order,
    with_orders,
)

from gen_profile.assurance.proof.numbering import DRAWS, RHYTHMS, SEARCH
from gen_profile.assurance.proof.obedience import WORDS
from gen_profile.assurance.proof.orders import STOP, VELOCITY
from gen_profile.assurance.proof.verdict import Proof, kind_of

ONE_LOAD = {"payload": 0.05}


def test_of_what_comes_late_the_key_that_helps_is_named():
    faults = (f"{kind_of(WORDS[STOP])} by 0.02 s, at 8.6 s", "a target is left again by 0.1 m, at 9 s")
    one = SimpleNamespace(
        number=3,
        group=SEARCH,
        faults=faults,
        fraction=lambda *_: 0.0,
        residual={"payload": 0.0},
        obeyed=(),
        exercised={},
    )
    few = {
        "limit": {"payload": 0.05},
        "error_bound": 0.0,
        "seed": 0,
        "count": 1,
        "parents": (),
        "by_fmpy": (),
    }
    late, left = Proof(**few, judged=(one, one), apart=0.0).reasons()
    assert "at 8.6 s, and likewise in 1 others; " in late
    assert "planner.operations" in late
    assert "planner.operations" not in left


@pytest.mark.parametrize(
    ("cycle", "short", "fails"),
    [
        (STOPPED - 1, 0.15, False),  # two slots of 0.1 s at 0.8 m/s may be led on
        (STOPPED - 1, 0.17, True),
        (STOPPED + 10, 0.15, False),
        (STOPPED + 30, 0.01, True),  # they are over
    ],
)
def test_a_stick_that_is_let_go_of_is_held_to_the_stated_ends(cycle, short, fails):
    let_go = with_orders(REST, MOVE, STICKS, order(STOPPED, CYCLES, VELOCITY, 0.0))
    let_go = attrs.evolve(let_go, sway_limit=0.05)  # of which a hundredth may be left
    let_go.issued["bInVelocity"][4220:] = 1.0
    for name in ("fStopHigh", "fStopDistance"):
        let_go.issued[name][cycle] -= short
    assert kinds(let_go) == ({kind_of(WORDS["ends"])} if fails else set())


def test_nothing_is_promised_while_what_was_measured_is_damped():
    damps = obedient()
    damps.issued["bDamping"] = np.where(np.arange(CYCLES) < 200, 1.0, 0.0)
    assert kind_of(WORDS["kept"]) in kinds(damps)
    damps.issued["bPromise"][:200], damps.issued["nPromise"][:200] = 0.0, 6.0
    assert kind_of(WORDS["kept"]) not in kinds(damps)


def proof_of(count, promised):
    """A proof of so many histories without a fault, of which some end with a promise."""
    one = SimpleNamespace(
        number=0, group=DRAWS, faults=(), obeyed=(), exercised={}, residual=ONE_LOAD, overstated=0.0
    )
    judged = [
        SimpleNamespace(**vars(one), promise=k < promised, fraction=lambda *_: 0.5) for k in range(count)
    ]
    return Proof(
        limit=ONE_LOAD,
        error_bound=0.0,
        seed=0,
        count=count,
        parents=(),
        judged=tuple(judged),
        by_fmpy=(),
        apart=0.0,
    )


def test_few_histories_are_a_trial_and_all_verdicts_tell_how_many():
    assert proof_of(199, 150).summary() == {
        "trial": "passed",
        "prompt": "no command held long enough to be timed",
        "histories": "199 histories of the 200 that make a proof, 150 of them promised",
        "worst": "history 0, 50 % of the limit",
    }
    assert proof_of(200, 150).summary()["histories"] == "200 histories, 150 of them promised"
    assert (proof_of(199, 1).kind, proof_of(200, 1).kind) == ("trial", "proof")


def test_how_tight_statements_are_is_told_of_short_histories_and_refuses_nothing():
    assert proof_of(200, 150).tightness() == "fSwayLeft was compared in no history"
    proof = proof_of(200, 150)
    for k, (group, times) in enumerate([(DRAWS, 1.2), (DRAWS, 1.9), (RHYTHMS, 7.0)]):
        proof.judged[k].number, proof.judged[k].group, proof.judged[k].overstated = k, group, times
    assert proof.tightness().startswith(
        "fSwayLeft states at most 1.9 times what errors may leave, in history 1:"
    )
    assert proof.reasons() == ()


@pytest.mark.parametrize("count", [1, 250])
def test_where_nothing_was_promised_nothing_is_proved(count):
    (reason,) = proof_of(count, 0).reasons()
    assert reason.startswith(f"None of the {count} histories ends with a promise, so no sway was judged")
    assert proof_of(count, 1).passed
    again = attrs.evolve(
        proof_of(count, 0), judged=proof_of(1, 0).judged
    )  # one that is run again by its number
    assert again.passed == (count > 1)
