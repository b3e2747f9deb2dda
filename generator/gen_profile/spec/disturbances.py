"""What comes between a file and the load: the way of its setpoints to the axes, and wind."""

from typing import Annotated, Literal

import attrs

from gen_profile.spec.structure import Checked
from gen_profile.spec.values import Bounds, NotNegative, Rising


@attrs.frozen(kw_only=True)
class PathSpec(Checked, table="check.path"):
    """The way of a setpoint from the artefact to the axis.

    Attributes
    ----------
    quantum : float
        Spacing in m (or rad) of the positions that the drive can be asked for; 0 where it takes any.
    between : str
        What the drive does until the next setpoint: interpolate linearly (60C2h), or hold the last one.
    lag : (float, float) or None
        Range of the drives' time constant in s, which need not be the one that the setpoints lead.
    latency : float
        s by which all setpoints come late.
    jitter : float
        s by which each of them comes earlier or later at most.
    lost : float
        Share of them that never comes; the axis stays where it is until the next one.
    """

    quantum: NotNegative = 0.0
    between: Literal["linear", "hold"] = "linear"
    lag: Annotated[tuple[NotNegative, NotNegative], Rising("times in s")] | None = None
    latency: Annotated[float, Bounds(least=0.0, most=10.0)] = 0.0
    jitter: Annotated[float, Bounds(least=0.0, most=1.0)] = 0.0
    lost: Annotated[float, Bounds(least=0.0, most=0.5)] = 0.0

    @property
    def faulty(self) -> bool:
        """Whether setpoints come at other times than they should, or not at all."""
        return self.latency > 0.0 or self.jitter > 0.0 or self.lost > 0.0

    @property
    def alters_setpoints(self) -> bool:
        """Whether the drive makes something else of setpoints that come in time than straight lines."""
        return self.quantum > 0.0 or self.between != "linear" or self.lag is not None


@attrs.frozen(kw_only=True)
class WindSpec(Checked, table="check.wind"):
    """A steady wind: its force in N on the end load, along each direction in which it swings."""

    force: NotNegative = 0.0
