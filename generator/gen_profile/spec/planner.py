"""What a spec says of a planner block: what it is given, a sensor of the load, and what that is for."""

from collections.abc import Mapping
from typing import Annotated, Literal

import attrs

from gen_profile.spec.structure import Checked
from gen_profile.spec.values import NONE, Bounds, LoadName, Named, NotNegative, Positive, Rising, example

LiveParameter = Annotated[str, Named("parameter", of="live", reorder=False)]
LiveRate = Annotated[str, Named("parameter", of="rate", reorder=False)]
Span = Annotated[tuple[float, float], Rising()]


@attrs.frozen(kw_only=True)
class SensorSpec(Checked, table="planner.sensor"):
    """A sensor of a coordinate or load of the machine, or one alike for each of several, in m (or rad), s.

    Attributes
    ----------
    quantity : str
        Whether it measures a coordinate (``angle``, in m where that is a length) or its rate, or the
        ``sway`` of a load in m.
    of : str, or tuple of str
        Name of the coordinate or load, positive as in the machine's equations; or one along each axis.
    noise : float
        One standard deviation, independent from value to value.
    offset : float
        At most; slowly varying.
    delay : (float, float)
        Range of a value's age where the controller is not told of it.
    drop_out : float
        Time without a good value after which the sensor counts as lost.
    """

    quantity: Literal["angle", "rate", "sway"]
    of: str | tuple[str, ...]
    noise: Positive
    offset: NotNegative = 0.0
    delay: Annotated[tuple[NotNegative, NotNegative], Rising("times in s")] = (0.0, 0.0)
    drop_out: Positive = 0.5

    @property
    def names(self) -> tuple[str, ...]:
        """What is measured, one or several."""
        return (self.of,) if isinstance(self.of, str) else self.of

    @property
    def usual_age(self) -> float:
        """Of a value, in s: the middle of `delay`."""
        return 0.5 * sum(self.delay)

    @property
    def unknown_delay(self) -> float:
        """By how much a value may be older or newer than usual, in s."""
        return 0.5 * (self.delay[1] - self.delay[0])


@attrs.frozen(kw_only=True)
class GustSpec(Checked, table="planner.disturbance.gust"):
    """A force on all loads in proportion to their masses: m/s² at most, for s at most."""

    acceleration: Positive
    longest: Positive


@attrs.frozen(kw_only=True)
class DisturbanceSpec(Checked, table="planner.disturbance"):
    """What makes loads sway that the block did not, and how soon that is to be damped.

    Attributes
    ----------
    swing : mapping of str to float
        In m of each load by name: what the slowest mode may swing by before the last command.
    gust : GustSpec or None
    settle : float
        s, from the end of the last gust, or the arrival after the last command, to `check.residual_sway`.
    """

    swing: Annotated[Mapping[LoadName, Positive], example("payload = 0.5")]
    gust: GustSpec | None = None
    settle: Positive


@attrs.frozen(kw_only=True)
class PlannerSpec(Checked, table="planner"):
    """What a planner block is given at run time, and how it brakes at once.

    Attributes
    ----------
    live : mapping of str to (float, float)
        Ranges of the machine's parameters, or places of its hoist, that the controller knows.
    live_rate : mapping of str to float
        How fast some of them may change on the way, each in its unit per second.
    live_noise : mapping of str to float
        By how much what the controller is given of some may be off from cycle to cycle, each in its unit.
    events : bool
        Whether the last events are outputs of the block, for an operator's screen.
    zones : bool
        Whether blocked and slow intervals of the travel are inputs of the block.
    operations : int or None
        Floating-point operations that the block may spend in a cycle; None takes 3000 for each millisecond.
    sway_share : float
        Share of `check.residual_sway` that a motion may leave on the machines of the stated errors, for being
        quick; 0 plans motions that leave none to first order.
    lateness : float or None
        Times what is possible that a command may take, and a second beside; None demands nothing.
    stop : str
        How axes stop where `bPromptStop` is not given: "quiet", without sway, or "prompt", never faster.
    quick_stop : float or None
        Deceleration of a stop that lets the load swing, in m/s²; None takes twice the limit.
    quick_stop_jerk : float or None
        m/s³; None takes four times the limit.
    sensor : SensorSpec or None
        Of a load, by which the block damps what it did not make sway itself.
    disturbance : DisturbanceSpec or None
        What that is; a sensor needs it, and it a sensor.
    """

    live: Annotated[Mapping[LiveParameter, Span], example("L1 = [3.0, 9.0]")] = NONE
    live_rate: Annotated[Mapping[LiveRate, Positive], example("NAME = 0.1")] = NONE
    live_noise: Annotated[Mapping[LiveRate, Positive], example("L1 = 0.003")] = NONE
    events: bool = False
    zones: bool = False
    operations: Annotated[int, Bounds(least=3000, most=100_000)] | None = None
    sway_share: Annotated[float, Bounds(least=0.0, most=0.8)] = 0.5
    lateness: Annotated[float, Bounds(least=1.0, most=100.0)] | None = None
    stop: Literal["quiet", "prompt"] = "quiet"
    quick_stop: Positive | None = None
    quick_stop_jerk: Positive | None = None
    sensor: SensorSpec | None = None
    disturbance: DisturbanceSpec | None = None
