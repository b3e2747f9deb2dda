"""The sentences of a proof that fails."""

from types import SimpleNamespace

import numpy as np

from gen_profile.proof.numbering import DRAWS, SEARCH
from gen_profile.proof.verdict import Proof, late_on_average

ONE_LOAD = {"payload": 0.05}


def test_of_what_comes_late_the_key_that_helps_is_named():
    faults = ("a stop ends later than allowed by 0.02 s, at 8.6 s", "a target is left again by 0.1 m, at 9 s")
    one = SimpleNamespace(
        number=3, group=SEARCH, faults=faults, fraction=lambda *_: 0.0, residual={"payload": 0.0}
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


def test_what_comes_late_on_average_is_a_fault():
    def late(group, count, mean):
        one = SimpleNamespace(group=group, later={"stop": mean + np.array([-0.3, 0.3])})
        return [*late_on_average([one] * (count // 2))]

    assert late(DRAWS, 40, 1.2) == ["Stops end later than allowed on average, by 0.11 slow periods or more."]
    assert not late(DRAWS, 40, 1.05)  # which may be chance
    assert not late(DRAWS, 10, 1.9)
    assert not late(SEARCH, 40, 1.9)
