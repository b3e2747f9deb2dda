"""Whether a motion keeps the limits of its spec."""

from __future__ import annotations

import math
from collections.abc import Iterator

import attrs

from gen_profile.errors import LimitViolation
from gen_profile.metrics import extremes, greatest
from gen_profile.profile import Profile
from gen_profile.spec import LimitsSpec


@attrs.frozen(kw_only=True)
class Breach:
    """A limit that a motion breaks.

    Attributes
    ----------
    limit : str
        Its place in the spec, such as ``limits.velocity``.
    found, allowed : float
        What the motion needs, and what it may have.
    power : int
        The need goes by 1 / durationᵖ; 0 where more time does not help.
    """

    limit: str
    found: float
    allowed: float
    power: int

    def sentence(self) -> str:
        """Say it."""
        return f"{self.limit}: {self.allowed:g} is allowed, the motion needs {self.found:.4g}."


def breaches(limits: LimitsSpec, command: Profile, transient_sway: float) -> tuple[Breach, ...]:
    """Find the limits that a motion breaks.

    Parameters
    ----------
    limits : LimitsSpec
    command : Profile
        Setpoints of the drives, lag compensation included.
    transient_sway : float
        Greatest sway of the end load during the move in m, nominal machine.
    """
    return tuple(
        breach for breach in _demands(limits, command, transient_sway) if breach.found > breach.allowed
    )


def require_limits(limits: LimitsSpec, command: Profile, transient_sway: float) -> None:
    """Hold a motion to its limits.

    Raises
    ------
    LimitViolation
        Naming every limit that is broken, and a duration that would keep them all.
    """
    broken = breaches(limits, command, transient_sway)
    if not broken:
        return
    factors = [(breach.found / breach.allowed) ** (1.0 / breach.power) for breach in broken if breach.power]
    cure = "Widen the limits."
    if factors:
        enough = rounded_up(command.duration * max(factors))
        cure = f"Allow about {enough} s (move.duration), or raise the limits."
    raise LimitViolation("\n".join([*(breach.sentence() for breach in broken), cure]))


def rounded_up(value: float) -> str:
    """Write three digits, rounded up: what is called enough must be enough."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return f"{math.ceil(value / unit) * unit:.3g}"


def _demands(limits: LimitsSpec, command: Profile, sway: float) -> Iterator[Breach]:
    """List what the motion needs of every limit there is."""
    for column in range(command.axes):
        allowed_here = limits.of(column)
        for order, name in enumerate(("velocity", "acceleration", "jerk"), start=1):
            allowed = getattr(allowed_here, name)
            if allowed is not None:
                found = greatest(command, order, column)
                yield Breach(limit=limits.place(column, name), found=found, allowed=allowed, power=order)
        if allowed_here.travel is not None:
            (low, high), travel = allowed_here.travel, limits.place(column, "travel")
            rounding = 1e-12 * max(abs(low), abs(high))
            bottom, top = extremes(command, 0, column)
            yield Breach(limit=travel, found=top - rounding, allowed=high, power=0)
            yield Breach(limit=travel, found=-bottom - rounding, allowed=-low, power=0)
    if limits.sway is not None:
        yield Breach(limit="limits.sway", found=sway, allowed=limits.sway, power=2)
