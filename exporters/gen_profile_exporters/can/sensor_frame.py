"""Frames in which a node on the bus tells what the planner's sensors show, as ``can.sensor`` states them."""

import struct
from collections.abc import Sequence

import can

from gen_profile.spec.can import SENSOR_BYTES, CanSensorSpec

FORMATS = {"int16": "<h", "int32": "<i", "float32": "<f"}  # little endian, as of every CANopen object


def values_in(message: can.Message, sensor: CanSensorSpec) -> list[float] | None:
    """Read the sensors' values in their units; None of another frame, or of one that is too short."""
    plain = not (message.is_extended_id or message.is_remote_frame or message.is_error_frame)
    size = max(sensor.byte) + SENSOR_BYTES[sensor.type]
    if not plain or message.arbitration_id != sensor.cob_id or len(message.data) < size:
        return None
    found = [struct.unpack_from(FORMATS[sensor.type], message.data, begin)[0] for begin in sensor.byte]
    return [value / _counts(sensor) for value in found]


def frame_of(values: Sequence[float], sensor: CanSensorSpec) -> tuple[int, bytes]:
    """Write COB-ID and data of such a frame, values beyond its numbers at their ends."""
    size = SENSOR_BYTES[sensor.type]
    data = bytearray(max(sensor.byte) + size)
    most = 2 ** (8 * size - 1) - 1
    for begin, value in zip(sensor.byte, values, strict=True):
        counted = value * _counts(sensor)
        if sensor.type != "float32":
            counted = max(-most, min(most, round(counted)))
        struct.pack_into(FORMATS[sensor.type], data, begin, counted)
    return sensor.cob_id, bytes(data)


def _counts(sensor: CanSensorSpec) -> float:
    return -sensor.counts if sensor.reverse else sensor.counts
