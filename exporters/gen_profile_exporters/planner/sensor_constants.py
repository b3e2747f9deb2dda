"""What a planner block knows of a sensor of the load: constants, and words of its header."""

from collections.abc import Mapping, Sequence

import attrs
import numpy as np

from gen_profile_exporters.playback.structured_text import literal

GROWN = 1.5  # of the stated swing, which a load that is damped does not reach: the sensor shows another one
NOISE_WATCHED = 0.5  # s, over which the sensor's noise is averaged
CORRELATED = 0.15  # of what else may differ: a misreading where nothing differs otherwise for a period
MEMORY = 1.0  # slow periods, over which what it shows of the axis's own motions is
INPUTS = ("fSensor", "bSensorValid", "fSensorAge")
OUTPUTS = ("fSwayEstimated", "fSwayUncertainty", "bSensorUsed", "nSensorFault", "fSensorScale")


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
    swing, hides, floor, again, roused, end : float
        m, of the slowest mode: what is unknown at first, where the value stays the same, and later; where
        damping begins, where once it hung still, and where it ends.
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
    again: float
    roused: float
    end: float
    misread: float
    room: float
    estimation_error: float


def model_rows(modes: int) -> int:
    """Rows of the model for the sensor of an axis."""
    return 5 * modes + 2


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
    return {
        "measured": " and ".join(f"fSensor{of} is {words}" for of, words in sensed.values()),
        "sensor_inputs": "\n".join(inputs),
        "sensor_outputs": "\n".join(outputs),
        "drop_out": f"{sensor.drop_out:g}",
        "room": f"{sensor.room:.3g}",
    }


def observer_constants(sensor: SensorConstants, modes: int, cycle: float) -> dict[str, float | int]:
    """Give the observer's constants."""
    return {
        "cRate": int(sensor.rate),
        "cOldest": sensor.oldest,
        "cMost": sensor.most,
        "cStep": sensor.step,
        "cGate": sensor.gate,
        "cFrozen": sensor.frozen,
        "cHides": sensor.hides,
        "cMostNoise": sensor.noisy,
        "cSmoothing": min(1.0, cycle / NOISE_WATCHED),
        "cMisread": sensor.misread,
        "cCorrelated": CORRELATED,
        "cForgets": 1.0 / (2.0 * np.pi * MEMORY),
        "cFloor": sensor.floor,
        "cSwing": sensor.swing,
        "cGrown": GROWN * sensor.swing + sensor.estimation_error,
        "cStill": sensor.roused,
        "cSensorRows": model_rows(modes),
        "cLength": expected(sensor, cycle),
        "cDropOut": max(1, round(sensor.drop_out / cycle)),
    }


def expected(sensor: SensorConstants, cycle: float) -> int:
    """Cycles in which a value may be as old as the oldest."""
    return int(sensor.oldest / cycle) + 3


def cycle_work(sensor: SensorConstants | None, modes: int) -> int:
    """Floating-point operations of every cycle for each axis."""
    return 0 if sensor is None else 120 + 40 * modes
