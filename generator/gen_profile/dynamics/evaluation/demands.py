"""What a motion asks of the drives beside what is allowed, once for terminal, report and studio."""

from collections.abc import Iterator

import attrs

from gen_profile.motion.metrics import greatest
from gen_profile.motion.profile import Profile
from gen_profile.plants.plant import Coordinate
from gen_profile.spec.model import Spec
from gen_profile.support.units import RATES


@attrs.frozen(kw_only=True)
class AxisDemand:
    """The greatest magnitude of a derivative of one axis's command.

    Attributes
    ----------
    axis : Coordinate
    quantity : str
        ``"velocity"``, ``"acceleration"`` or ``"jerk"``.
    unit : str
        Of both values, such as ``"m/s²"``.
    asked : float
    allowed : float or None
        The spec's limit, if it states one.
    """

    axis: Coordinate
    quantity: str
    unit: str
    asked: float
    allowed: float | None


def demands(spec: Spec, command: Profile) -> Iterator[AxisDemand]:
    """List what a command asks of every axis, in the order of axes and of derivatives."""
    for column in range(len(spec.machine().actuated)):
        yield from axis_demands(spec, command, column)


def axis_demands(spec: Spec, command: Profile, column: int) -> Iterator[AxisDemand]:
    """List what a command asks of one axis, in the order of derivatives."""
    axis, limits = spec.machine().actuated[column], spec.limits.of(column)
    for order, (quantity, per) in enumerate(RATES.items(), start=1):
        yield AxisDemand(
            axis=axis,
            quantity=quantity,
            unit=f"{axis.unit}{per}",
            asked=greatest(command, order, column),
            allowed=getattr(limits, quantity),
        )
