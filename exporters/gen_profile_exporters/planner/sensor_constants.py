"""What a planner block knows of a sensor of the load: constants, and words of its header."""

from collections.abc import Mapping, Sequence

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile_exporters.block_source import initialiser
from gen_profile_exporters.playback.structured_text import literal

LEAST_SLOTS = 9  # of a damping kernel: with fewer the velocity that can be stopped within it is low
GROWN = 1.5  # of the stated swing, which a load that is damped does not reach: the sensor shows another one
LARGEST_PULSE = 4.0  # by what the greatest acceleration makes in a slot: a larger one keeps the next ones out
KERNEL_PERIODS = 36.0  # its slots by the ratio of the slowest frequency to the next: nearly two fast periods
NOISE_WATCHED = 0.5  # s, over which the sensor's noise is averaged
CORRELATED = 0.15  # of what else may differ: a misreading where nothing differs otherwise for a period
STEADY = 0.03  # share by which a live parameter may be another than planned with, while motions are judged
MEMORY = 1.0  # slow periods, over which what it shows of the axis's own motions is
ROWS_BEFORE = 3  # of the model by mode: frequency, decay and error; then sway, axis by axis
INPUTS = {"aSensor": "fSensor", "bNews": "bSensorValid", "aSensorAge": "fSensorAge"}  # by the arrays
OUTPUTS = {
    "fSwayEstimated": "aSwayEstimated[{}]",
    "fSwayUncertainty": "aSwayUncertainty[{}]",
    "bSensorUsed": "bUsed[{}]",
    "nSensorFault": "aSensorTold[{}]",
    "fSensorScale": "1.0 + aOwnScale[{}]",
}


@attrs.frozen(kw_only=True, eq=False)
class SensorConstants:
    """A sensor, or one for each of some axes, and what is done by them.

    Attributes
    ----------
    words : mapping of int to str
        What is measured of the loads' sway along each axis, by its place among those that are planned.
    unit, load : str
        In which unit; and the load whose sway is an output.
    rate : bool
        Whether it measures a rate.
    age, oldest, drop_out : float
        s: usual age of a value, the greatest, and for how long there may be none.
    most, step, gate, frozen, noisy : float
        In its unit: what it may show; change from cycle to cycle; difference from what is expected, and
        the change of that while the value stays the same; mean square change.
    swing, hides, floor, begin, again, roused, end : float
        m, of the slowest mode: what is unknown at first, where the value stays the same, and later; where
        damping begins as the axis arrives, where later at rest, where once it hung still, and where it ends.
    gains : (3,) sequence of float
        Of sway, its rate and position, in pulses of a slot.
    misread : float
        By which share the axis's own motions may show otherwise than expected.
    room : float
        m, by which damping may lead away.
    estimation_error : float
        m, by which gusts and wrong frequencies may move the estimate away.
    """

    words: Mapping[int, str]
    unit: str
    load: str
    rate: bool
    age: float
    oldest: float
    drop_out: float
    most: float
    step: float
    gate: float
    frozen: float
    noisy: float
    swing: float
    hides: float
    floor: float
    begin: float
    again: float
    roused: float
    end: float
    gains: Sequence[float]
    misread: float
    room: float
    estimation_error: float


def damping_slots(frequencies: Array) -> int:
    """Slots of the damping kernel at some frequencies, rising."""
    if len(frequencies) == 1:
        return LEAST_SLOTS
    return max(LEAST_SLOTS, round(KERNEL_PERIODS * float(frequencies[0] / frequencies[1])))


def model_rows(modes: int) -> int:
    """Rows of the model for the sensor of an axis."""
    return 5 * modes + 2


def damping_rows(modes: int) -> int:
    """Conditions of the damping kernel."""
    return 2 * modes - 1


def values(sensor: SensorConstants | None, suffixes: Sequence[str]) -> dict[str, str]:
    """Words and numbers of the declarations, by the ends of all axes' names."""
    if sensor is None:
        return {}
    sensed = {axis: (suffixes[axis], words) for axis, words in sensor.words.items()}
    age = literal(sensor.age)
    inputs = [
        f"    fSensor{of} : LREAL; (* {sensor.unit}, {words} *)\n"
        f"    bSensorValid{of} : BOOL; (* fSensor{of} was measured *)\n"
        f"    fSensorAge{of} : LREAL := {age}; (* s, since then *)"
        for of, words in sensed.values()
    ]
    inputs.append(
        "    bSensorCheck : BOOL; (* while set nothing is damped: to try the sensor by small motions *)"
    )
    outputs = [
        f"    fSwayEstimated{of} : LREAL; (* m, of the {sensor.load}, by {words} *)\n"
        f"    fSwayUncertainty{of} : LREAL; (* m, that it may be off by; "
        f"current gusts and stated errors add up to {sensor.estimation_error:.3g} m *)\n"
        f"    bSensorUsed{of} : BOOL;\n"
        f"    nSensorFault{of} : DINT; (* why it is not used *)\n"
        f"    fSensorScale{of} : LREAL := 1.0; (* what it shows of the axis's motions, by what is due *)"
        for of, words in sensed.values()
    ]
    taken = [
        f"{array}[{k}] := {name}{of};" for k, (of, _) in sensed.items() for array, name in INPUTS.items()
    ]
    given = [
        f"{name}{of} := {value.format(k)};"
        for k, (of, _) in sensed.items()
        for name, value in OUTPUTS.items()
    ]
    return {
        "measured": " and ".join(f"fSensor{of} is {words}" for of, words in sensed.values()),
        "sensor_inputs": "\n".join(inputs),
        "sensor_outputs": "\n".join(outputs),
        "take_sensors": "\n".join(taken),
        "give_sensors": "\n".join(given),
        "drop_out": f"{sensor.drop_out:g}",
        "room": f"{sensor.room:.3g}",
    }


def lengths(sensor: SensorConstants | None, modes: int, axes: int, cycle: float) -> dict[str, int]:
    """Lengths of arrays."""
    if sensor is None:
        return {}
    rows = damping_rows(modes)
    expected = axes * _expected(sensor, cycle)
    return {"expected": expected, "own": 6 * axes, "damp_row": rows, "damp_gram": rows**2}


def whole_constants(sensor: SensorConstants | None, modes: int, axes: int, cycle: float) -> dict[str, int]:
    """Give the constants that are whole numbers."""
    if sensor is None:
        return {}
    return {
        "cSensorRow": (ROWS_BEFORE + axes) * modes,
        "cSensorRows": model_rows(modes),
        "cExpectedLength": _expected(sensor, cycle),
        "cDropOutCycles": max(1, round(sensor.drop_out / cycle)),
        "cDampRows": damping_rows(modes),
        "cDampLeastSlots": LEAST_SLOTS,
    }


def real_constants(sensor: SensorConstants | None, cycle: float) -> dict[str, float]:
    """Give the other constants."""
    if sensor is None:
        return {}
    return {
        "cSensorOldest": sensor.oldest,
        "cSensorMost": sensor.most,
        "cSensorStep": sensor.step,
        "cSensorGate": sensor.gate,
        "cSensorFrozen": sensor.frozen,
        "cSensorHides": sensor.hides,
        "cSensorNoisy": sensor.noisy,
        "cSensorSmoothing": min(1.0, cycle / NOISE_WATCHED),
        "cSensorScale": sensor.misread,
        "cSensorAlike": CORRELATED,
        "cSensorSteady": STEADY,
        "cSensorForgets": 1.0 / (2.0 * np.pi * MEMORY),
        "cSensorFloor": sensor.floor,
        "cSwing": sensor.swing,
        "cDampFrom": sensor.begin,
        "cDampAgain": sensor.again,
        "cDampRoused": sensor.roused,
        "cDampOnWay": 2.0 * sensor.roused,
        "cDampTo": sensor.end,
        "cDampRoom": sensor.room,
        "cDampMost": GROWN * sensor.swing + sensor.estimation_error,
        "cDampLength": KERNEL_PERIODS,
        "cDampPulse": LARGEST_PULSE,
    }


def _expected(sensor: SensorConstants, cycle: float) -> int:
    """Cycles in which a value may be as old as the oldest."""
    return int(sensor.oldest / cycle) + 3


def cycle_work(sensor: SensorConstants | None, modes: int) -> int:
    """Floating-point operations of every cycle for each axis."""
    return 0 if sensor is None else 120 + 40 * modes


def other_constants(sensor: SensorConstants | None) -> list[str]:
    """Declare the constants that are no single numbers."""
    if sensor is None:
        return []
    gains = initialiser([literal(gain) for gain in sensor.gains])
    return [
        f"    cSensorRate : BOOL := {str(sensor.rate).upper()}; (* it measures a rate *)",
        f"    cDampGain : ARRAY [0..{len(sensor.gains) - 1}] OF LREAL := {gains};",
    ]
