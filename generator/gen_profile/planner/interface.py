"""The inputs and outputs of a planner block: which are an axis's, which are live parameters."""

import re
from collections.abc import Container, Iterable
from functools import lru_cache

import attrs

from gen_profile.support.errors import ExportError, SpecError

COMMON = ("bEnable", "bExecute", "bVelocity", "bStop", "bQuickStop", "rOverride", "fCycleTime")
OWN = ("fTarget", "fVelocityCommand", "fVelocityLimit", "fActPosition")  # of each axis
ISSUED = ("fPosition", "fVelocity", "fAcceleration")  # likewise
STATES = ("bBusy", "bPromise", "nErrorId", "bEnabled")
LATER = (
    "bReset",
    "bLoadAtRest",
    "fActVelocity",
    "fFollowingLimit",
    "bSensorCheck",
    "bPromptStop",
)  # inputs that the first blocks had not
SENSOR = ("fSensor", "bSensorValid", "fSensorAge")  # of axes with one
UNPROVEN = 8  # nSensorFault of a sensor that is used, and has not shown a motion of its axis yet
SENSED = {  # what the block tells of such an axis, by the columns of a table
    "sway_estimated_m": "fSwayEstimated",
    "sway_uncertainty_m": "fSwayUncertainty",
    "sensor_used": "bSensorUsed",
    "sensor_fault": "nSensorFault",
}
LOST = {  # promises, by nPromise
    1: "a live parameter changed on the way",
    2: "there was a quick stop, the axis was moved while the block was disabled, or too much had added up",
    5: "what the stated errors leave, or prompt stops, adds up to more than is allowed",
    6: "the sensor shows more sway than is allowed, or that is being damped",
}
UNITS = ("m", "rad")

_TARGET = re.compile(r"^\s*fTarget(\w*)\s*:\s*LREAL\s*;(?:\s*\(\*\s*(\w+))?", re.MULTILINE)


@attrs.frozen(kw_only=True)
class BlockAxis:
    """An axis that a block plans.

    Attributes
    ----------
    name : str
        Empty where it is the only one.
    unit : str
        One of `UNITS`.
    """

    name: str
    unit: str = "m"

    @property
    def suffix(self) -> str:
        """End the names of the block's inputs and outputs that are this axis's."""
        return f"_{self.name}" if self.name else ""

    @property
    def prefix(self) -> str:
        """Begin the names of columns that are this axis's, as in every exported table."""
        return f"{self.name}_" if self.name else ""

    def of(self, name: str) -> str:
        """Name the input or output of the block that is this axis's."""
        return name + self.suffix


@lru_cache(maxsize=4)
def block_axes(text: str) -> tuple[BlockAxis, ...]:
    """Find the axes that a block plans in its declarations.

    Raises
    ------
    ExportError
        It is no planner block's text.
    """
    axes = tuple(
        BlockAxis(name=suffix.removeprefix("_"), unit=unit if unit in UNITS else "m")
        for suffix, unit in _TARGET.findall(text)
    )
    if not axes:
        raise ExportError("The function block has no input fTarget, so it is no planner block.")
    return axes


def sensed_axes(inputs: Container[str], axes: Iterable[BlockAxis]) -> list[BlockAxis]:
    """Tell along which axes a block has a sensor."""
    return [axis for axis in axes if axis.of(SENSOR[0]) in inputs]


def live_inputs(inputs: Iterable[str], axes: Iterable[BlockAxis]) -> dict[str, str]:
    """Tell which inputs of a planner block are live parameters, by the parameters' names.

    Raises
    ------
    SpecError
        It is no planner block.
    """
    standard = [*COMMON, *(axis.of(name) for axis in axes for name in OWN)]
    known = list(inputs)
    if missing := [name for name in standard if name not in known]:
        raise SpecError(f"The function block has no input {missing[0]}, so it is no planner block.")
    standard += [name for later in (*SENSOR, *LATER) for name in (later, *(axis.of(later) for axis in axes))]
    return {name[1:]: name for name in known if name not in standard and "[" not in name}
