"""Judging what a block promises, and what it states of the sway that is left."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from generator.test_proof_obedience import CYCLE, CYCLES, MODES, kinds, obedient, with_output

from gen_profile.assurance.proof.obedience import WORDS
from gen_profile.assurance.proof.verdict import kind_of
from gen_profile.assurance.proof.watching import BlockWatch


@pytest.mark.parametrize(
    ("stated", "reason", "wrong"), [(0.06, 0.0, "kept"), (0.04, 5.0, "lost"), (0.06, 5.0, "")]
)
def test_errors_end_the_promise_where_they_may_leave_more_than_allowed(stated, reason, wrong):
    followed = attrs.evolve(with_output("fSwayLeft", slice(None), stated), sway_limit=0.05)
    followed.issued["nPromise"][:], followed.issued["bPromise"][:] = reason, reason == 0.0
    assert kinds(followed) == ({kind_of(WORDS[wrong])} if wrong else set())


@pytest.mark.parametrize(("stated", "wrong"), [(0.06, False), (0.04, True)])
def test_what_has_added_up_may_be_forgotten_and_nothing_else(stated, wrong):
    """Behind ``nPromise`` 5, which is true where more is stated than is allowed, 2 needs no other reason."""
    followed = attrs.evolve(with_output("fSwayLeft", slice(4600), stated), sway_limit=0.05)
    followed.issued["fSwayLeft"][4600:] = 0.0
    followed.issued["nPromise"][:4600] = 5.0 if stated > 0.05 else 0.0
    followed.issued["nPromise"][4600:] = 2.0
    followed.issued["bPromise"][:] = followed.issued["nPromise"] == 0.0
    assert kinds(followed) == ({kind_of(WORDS["lost"])} if wrong else set())


def test_a_damped_load_is_held_to_what_is_stated_where_the_axis_comes_to_rest():
    followed = SimpleNamespace(
        issued={"fSwayLeft": np.array([0.0, 0.02, 0.01, 0.005]), "nPromise": np.zeros(4)},
        orders=(),
        sway_limit=0.05,
        sensed=lambda _: np.zeros(4, dtype=bool),
        drifts=np.zeros(4, dtype=bool),
        brakings=[],
    )
    for left, found in ((0.02, []), (0.03, ["a load sways by 0.03 m, where fSwayLeft states 0.02 m"])):
        run = SimpleNamespace(residual=np.array([left]), stands=1)
        assert list(BlockWatch._understated(None, run, followed)) == found
    followed.brakings.append(1)
    assert list(BlockWatch._understated(None, run, followed)) == []
    followed.brakings.clear()
    followed.issued["nPromise"][-1] = 1.0  # the rope changed on the way
    assert list(BlockWatch._understated(None, run, followed)) == []
    followed.issued["nPromise"][-1], followed.drifts[1] = 0.0, True  # another rope was given at rest
    assert list(BlockWatch._understated(None, run, followed)) == []


def test_a_live_parameter_that_changes_on_the_way_ends_the_promise():
    assert kind_of(WORDS["kept"]) in kinds(attrs.evolve(obedient(), live_changes=[(300, 350)]))
    assert kinds(attrs.evolve(obedient(), live_changes=[(1000, 1050)])) == set()  # it is taken over


def test_what_is_left_goes_with_the_root_of_the_period_where_a_rope_changes_at_rest():
    """After the stop, from 2 rad/s to 1: √2 times as much is left; stating less is refused, more is safe."""
    changed, limit = CYCLES - 900, 0.05
    slower = attrs.evolve(MODES, modes=attrs.evolve(MODES.modes, poles=0.5 * MODES.modes.poles))
    retold = np.arange(CYCLES) >= changed
    known = {"live_changes": [(changed, changed + 9)], "last_known": changed + 9, "last_modes": slower}
    moved = MODES.modes.moved(obedient().acceleration, [changed - 1], CYCLE)
    left = 2.0**0.5 * float(MODES.modes.sway(moved).max())
    assert left > 10.0 * limit
    for stated, refused in ((left, False), (2.0 * left, False), (left - 0.02 * limit, True)):
        followed = with_output("fSwayLeft", slice(None), 2.0 * left)
        followed.issued["fSwayLeft"][changed:] = stated
        found = kinds(attrs.evolve(followed, modes=MODES, retold=retold, sway_limit=limit, **known))
        assert (kind_of(WORDS["understated"]) in found) is refused


def test_a_live_parameter_that_is_back_for_one_cycle_has_changed_all_the_same():
    """Of three values the one between counts: the block tells of the change (``nPromise`` 1) in time."""
    watch = SimpleNamespace(
        known=SimpleNamespace(live={"L": (3.0, 9.0)}),
        spec=SimpleNamespace(planner=SimpleNamespace(live_rate={})),
    )
    watch.inputs = ["bEnable", "fL"]
    for gap, drifts in ((1, True), (2, False)):
        rope = np.full(100, 6.0)
        rope[30:80] = 5.0
        rope[50 : 50 + gap] = 6.0
        script = SimpleNamespace(inputs=np.column_stack([np.ones(100), rope]))
        assert BlockWatch._drifts(watch, script, np.arange(100), 1.0, 35).any() == drifts
