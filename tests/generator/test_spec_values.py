"""Values of a spec hold what their annotations allow, however they are made."""

import attrs
import numpy as np
import pytest

from gen_profile.spec.model import CheckSpec
from gen_profile.spec.reading import evolve_spec, make_spec, preset_spec
from gen_profile.support.errors import SpecError

PAPER = preset_spec("paper")


@pytest.mark.parametrize(
    ("table", "key", "value", "sentence"),
    [
        ("move", "duration", -1, "move.duration: must be at least 0.001 and at most 100000 s, found -1.0."),
        ("robustness", "uncertain", {"L1": 2.0}, "robustness.uncertain.L1: must be greater than 0 and"),
        ("limits", "travel", (2, 1), "limits.travel: must be two rising numbers, such as [1.0, 2.0], found"),
        ("limits", "axis", {"cart": {"jerk": 0}}, "limits.axis.cart.jerk: must be greater than 0, found 0.0"),
        ("check", "path", {"lost": "much"}, "check.path.lost: must be a finite number, found text 'much'."),
        ("can", "node", 128, "can.node: must be at least 1 and at most 127, found 128."),
        ("can", "channels", {"cart": "can 0"}, "can.channels.cart: must be the name of a channel"),
        ("export", "csv_columns", "position", "export.csv_columns: must be a list such as ["),
        ("solver", "method", "ZVD", "solver.method: unknown value, found text 'ZVD'; did you mean 'zvd'?"),
    ],
)  # fmt: skip
def test_a_changed_value_is_judged_as_a_stated_one(table, key, value, sentence):
    with pytest.raises(SpecError) as changed:
        attrs.evolve(getattr(PAPER, table), **{key: value})
    with pytest.raises(SpecError) as stated:
        evolve_spec(PAPER, **{table: {key: value}})
    assert str(changed.value) == str(stated.value)
    assert str(changed.value).startswith(sentence)


def test_all_misfits_of_a_class_are_told_at_once():
    with pytest.raises(SpecError) as caught:
        CheckSpec(residual_sway={"hook": 0.0}, samples=-1, seed=1.5)
    assert [fault.partition(":")[0] for fault in caught.value.faults] == [
        "check.residual_sway.hook", "check.samples", "check.seed",
    ]  # fmt: skip


def test_values_are_typed_however_they_are_made():
    move = attrs.evolve(PAPER.move, duration=np.float32(2), target=np.array([0.4]), initial={"theta1": 0})
    assert move == attrs.evolve(PAPER.move, duration=2.0, target=(0.4,), initial={"theta1": 0.0})
    assert type(move.duration) is float and type(move.target[0]) is float
    assert attrs.evolve(PAPER.can, node=np.int64(3)).node == 3
    with pytest.raises(TypeError):
        move.initial["theta1"] = 1.0


def test_what_is_no_table_is_told_so():
    with pytest.raises(SpecError) as caught:
        evolve_spec(PAPER, check={"path": 1}, can={"cob_ids": {"cart": 3}, "fixed_pdos": {"rpdo1": 7}})
    assert caught.value.faults == (
        "check.path: must be a table, found 1.",
        "can.cob_ids.cart: must be a table, found 3.",
        "can.fixed_pdos.rpdo1: must be an array, found 7.",
    )


def test_what_follows_from_a_fault_is_no_other():
    with pytest.raises(SpecError) as caught:
        make_spec(
            plant={"type": "double-pendulum-crane", "L1": 0},
            move={"distance": 0.3, "duration": "minimum"},
            robustness={"method": "range", "uncertain": {"L1": 2.0}},
            limits={"jerk": -1},
            check={"path": {"between": "hold", "lag": [0.2, 0.1]}},
        )
    assert {fault.partition(":")[0] for fault in caught.value.faults} == {
        "plant.L1", "robustness.uncertain.L1", "limits.jerk", "check.path.lag",
    }  # fmt: skip


def test_live_parameters_keep_the_order_in_which_a_block_shall_have_them():
    """They are its inputs; ranges of the design come in the machine's order, whatever a file says first."""
    spec = evolve_spec(
        PAPER,
        robustness={"uncertain": {"L1": 0.1, "m2": 0.1}},
        planner={"live": {"L1": [0.3, 0.6], "m2": [0.1, 0.3]}},
    )
    assert list(spec.robustness.uncertain) == ["m2", "L1"]
    assert list(spec.planner.live) == ["L1", "m2"]


def test_a_distance_out_of_bounds_is_a_target_out_of_bounds():
    with pytest.raises(SpecError, match=r"^move\.target\.0: must be at least -100000 and at most 100000 m"):
        evolve_spec(PAPER, move={"distance": 1e6})
