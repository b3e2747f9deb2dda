"""The observer of what a sensor of the load shows, with a machine's constants put in."""

import numpy as np

from gen_profile_exporters.planner.blocks.followed import NO_LIVE
from gen_profile_exporters.planner.blocks.texts import constant_lines, filled
from gen_profile_exporters.planner.constants import PlannerConstants
from gen_profile_exporters.planner.sensor_constants import (
    SensorConstants,
    cycle_work,
    expected,
    model_rows,
    observer_constants,
)


def observer(c: PlannerConstants, sensor: SensorConstants) -> str:
    """Write the block of the observer along the axis that it is given."""
    modes, lives, axes = c.modes, c.live or NO_LIVE, len(c.axes)
    one = model_rows(modes)
    model = np.vstack([c.model[: 2 * modes], c.model[-axes * one :]])
    exponents = c.exponents if c.live else np.zeros((1, model.shape[1]), dtype=np.int64)
    constants = {
        **observer_constants(sensor, modes, c.cycle),
        "cMostPush": [axis.quick_deceleration for axis in c.axes],
        "cModes": modes,
        "cCycle": c.cycle,
        "cLives": len(c.live),
        "cDegrees": c.degrees,
        "cTerms": model.shape[1],
        "cWork": cycle_work(sensor, modes),
        "cModelWork": model.shape[1] * (2 * (2 * modes + one) + len(c.live)) + 4 * len(lives) * c.degrees,
        "cLiveLow": [low for low, _ in lives.values()],
        "cLiveHigh": [high for _, high in lives.values()],
        "cLiveBend": [float(v) for v in c.curvatures or (0.0, 0.0)],
        "cExponent": [int(v) for v in exponents.ravel()],
        "cModel": [float(v) for v in model.ravel()],
    }
    lengths = {
        "live": len(lives), "mode": modes, "observed": 2 * modes + one, "power": len(lives) * c.degrees,
        "expected": expected(sensor, c.cycle),
    }  # fmt: skip
    return filled(
        "observer",
        observer=f"{c.name.replace('-', '_')}_observer",
        observer_constants=constant_lines(constants),
        **{f"last_{array}": length - 1 for array, length in lengths.items()},
    )
