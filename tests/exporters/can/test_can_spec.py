"""The [can] table: what it takes, and the sentences for what it does not."""

import pytest

from gen_profile.errors import SpecError
from gen_profile.spec.reading import preset_spec, spec_from_dict

TRAVEL = "can.travel={cart=[-0.1, 0.5]}"


def test_everything_stated_comes_back():
    spec = preset_spec(
        "paper",
        [
            "can.mode=csp", "can.feed_forward=torque", "can.torque_per_acceleration=40", "can.timeout=0.05",
            "can.start_tolerance=0.002", "can.following_error=0.01", "can.quick_stop=1.5", TRAVEL,
            "can.encoder=[65536, 1]", "can.gear=[3, 1]", "can.feed=[40000, 1]", "can.vendor=0x2E5",
            "can.product=1", "can.homed=[0x2003, 0, 1]",
        ],
    )  # fmt: skip
    assert spec.can.travel == {"cart": (-0.1, 0.5)}
    assert spec.can.gear == (3, 1)
    assert spec.can.vendor == 0x2E5
    assert spec.can.homed == (0x2003, 0, 1)
    assert spec_from_dict(spec.to_dict()) == spec


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("can.travel=3", "can.travel: must be a table such as { cart = [0.0, 0.5] }, found 3."),
        ("can.travel={kart=[0, 1]}", "can.travel.kart: unknown axis; did you mean 'cart'?"),
        ("can.travel={cart=[1]}", "can.travel.cart: must be an array of 2 numbers, found an array."),
        ("can.travel={cart=[0, 'a']}", "can.travel.cart: must be a finite number, found text 'a'."),
        ("can.homed=[1, 2]", "can.homed: must be an array of 3 numbers, found an array."),
        ("can.gear=3", "can.gear: must be an array of 2 numbers, found 3."),
        ("can.feed_forward=torque", "can.torque_per_acceleration: required with feed_forward"),
        ("can.feed_forward=both", 'can.torque_per_acceleration: required with feed_forward = "both"'),
        ("can.timeout=0", "can.timeout: must be at least 0.001"),
        ("can.mode=csv", 'can.following_error: required with mode = "csv"'),
        ("can.mode=pp", "can.mode: unknown value, found text 'pp'"),
    ],
)
def test_faults(override, sentence):
    with pytest.raises(SpecError) as refusal:
        preset_spec("paper", [override])
    assert len(refusal.value.faults) == 1
    assert refusal.value.faults[0].startswith(sentence)


def test_feed_forward_is_for_csp():
    with pytest.raises(SpecError, match=r'can\.feed_forward: only with mode = "csp"'):
        preset_spec("paper", ["can.mode=ip", "can.feed_forward=velocity"])
