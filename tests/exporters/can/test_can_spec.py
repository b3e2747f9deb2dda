"""The [can] table: what it takes, and the sentences for what it does not."""

import pytest

from gen_profile.spec.can import CobIdsSpec
from gen_profile.spec.reading import preset_spec, spec_from_dict
from gen_profile.support.errors import SpecError

TRAVEL = "can.travel={cart=[-0.1, 0.5]}"


def test_everything_stated_comes_back():
    spec = preset_spec(
        "paper",
        [
            "can.mode=csp", "can.feed_forward=torque", "can.torque_per_acceleration=40", "can.timeout=0.05",
            "can.start_tolerance=0.002", "can.following_error=0.01", "can.quick_stop=1.5", TRAVEL,
            "can.encoder=[65536, 1]", "can.gear=[3, 1]", "can.feed=[40000, 1]", "can.vendor=0x2E5",
            "can.product=1", "can.homed=[0x2003, 0, 1]", "can.serial=7", "can.nodes={cart=9}",
            "can.cob_ids={cart={setpoint=0x321, feedback=0x195}}",
            "can.channels={cart='can1'}",
            "can.fixed_pdos={rpdo3=[0x60400010, 0x607A0020], tpdo3=[0x60410010, 0x60640020]}",
        ],
    )  # fmt: skip
    assert spec.can.travel == {"cart": (-0.1, 0.5)}
    assert spec.can.gear == (3, 1)
    assert spec.can.vendor == 0x2E5
    assert spec.can.homed == (0x2003, 0, 1)
    assert (spec.can.serial, spec.can.nodes) == ({"cart": 7}, {"cart": 9})
    assert spec.can.cob_ids == {"cart": CobIdsSpec(setpoint=0x321, feedback=0x195)}
    assert spec.can.fixed_pdos.received == ((), (), (0x60400010, 0x607A0020), ())
    assert spec_from_dict(spec.to_dict()) == spec


@pytest.mark.parametrize(
    ("override", "sentence"),
    [
        ("can.travel=3", "can.travel: must be a table such as { cart = [0.0, 0.5] }, found 3."),
        ("can.travel={kart=[0, 1]}", "can.travel.kart: unknown axis; did you mean 'cart'?"),
        ("can.travel={cart=[1]}", "can.travel.cart: must be an array of 2 numbers, found [1]."),
        ("can.travel={cart=[0, 'a']}", "can.travel.cart: must be a finite number, found text 'a'."),
        ("can.homed=[1, 2]", "can.homed: must be an array of 3 numbers, found [1, 2]."),
        ("can.gear=3", "can.gear: must be an array of 2 numbers, found 3."),
        ("can.feed_forward=torque", "can.torque_per_acceleration: required with feed_forward"),
        ("can.feed_forward=both", 'can.torque_per_acceleration: required with feed_forward = "both"'),
        ("can.timeout=0", "can.timeout: must be at least 0.001"),
        ("can.mode=csv", 'can.following_error: required with mode = "csv"'),
        ("can.nodes={kart=3}", "can.nodes.kart: unknown axis; did you mean 'cart'?"),
        ("can.nodes={cart=0}", "can.nodes.cart: must be at least 1 and at most 127, found 0."),
        ("can.serial={cart=0}", "can.serial.cart: must be at least 1"),
        (
            "can.cob_ids={cart={setpoint=0x581}}",
            "can.cob_ids.cart.setpoint: must be at least 385 and at most 1407",
        ),
        ("can.cob_ids={cart={setpoints=0x301}}", "can.cob_ids.cart.setpoints: unknown key"),
        ("can.cob_ids=3", "can.cob_ids: must be a table such as { cart = { setpoint = 0x321 } }, found 3."),
        ("can.fixed_pdos={rpdo3=[-1]}", "can.fixed_pdos.rpdo3.0: must be at least 1"),
        ("can.fixed_pdos={pdo3=[1]}", "can.fixed_pdos.pdo3: unknown key"),
        ("can.channels={cart='can 0'}", "can.channels.cart: must be the name of a channel, such as 'can0'"),
        ("can.channels={cart=0}", "can.channels.cart: "),
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


@pytest.mark.parametrize(
    ("nodes", "fault"),
    [
        ("{x=5, y=5}", "can.nodes.y: 5 is the node of the axis x already"),
        ("{x=5}", "can.nodes.y: required beside the other axes' nodes"),
    ],
)
def test_every_axis_has_a_node_of_its_own(nodes, fault):
    with pytest.raises(SpecError) as refusal:
        preset_spec("gantry-crane", [f"can.nodes={nodes}"])
    assert [found.rstrip(".") for found in refusal.value.faults] == [fault]
