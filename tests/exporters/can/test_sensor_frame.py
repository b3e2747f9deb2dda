"""Values of a load's sensor in CAN frames, against bytes that were written by hand."""

import can
import pytest

from gen_profile.spec.can import CanSensorSpec
from gen_profile_exporters.can.sensor_frame import frame_of, values_in

FRAMES = {  # little endian, two's complement, IEEE 754
    "int16": ({"byte": (2,), "reverse": True}, "00 00 0c fe", 0.1),  # −500 counts
    "int32": ({"byte": (0,)}, "60 79 fe ff", -20.0),  # −100 000 counts
    "float32": ({"byte": (0,)}, "00 00 80 3f", 0.0002),  # 1.0
}


@pytest.mark.parametrize("kind", FRAMES)
def test_values_are_read_and_written_as_the_bytes_say(kind):
    changes, data, value = FRAMES[kind]
    sensor = CanSensorSpec(cob_id=0x1A0, type=kind, counts=5000.0, **changes)
    content = bytes.fromhex(data)
    message = can.Message(arbitration_id=0x1A0, data=content, is_extended_id=False)
    assert values_in(message, sensor) == pytest.approx([value])
    assert frame_of([value], sensor) == (0x1A0, content)
    others = {"arbitration_id": 0x1A1}, {"data": content[:-1]}, {"is_extended_id": True}
    for other in others:
        fields = {"arbitration_id": 0x1A0, "data": content, "is_extended_id": False, **other}
        assert values_in(can.Message(**fields), sensor) is None


def test_what_does_not_fit_is_sent_as_the_greatest():
    assert frame_of([100.0], CanSensorSpec(cob_id=0x1A0, counts=5000.0))[1] == bytes.fromhex("ff 7f")
