"""Whether a motion keeps the limits of its spec."""

import math
from collections.abc import Iterator

import attrs

from gen_profile.motion.metrics import extremes, greatest
from gen_profile.motion.profile import Profile
from gen_profile.spec.model import LimitsSpec
from gen_profile.support.errors import Code, Reason
from gen_profile.support.phrase import Phrase
from gen_profile.support.units import RATES

SWAY_TOLERANCE = 1.01  # times limits.sway that machines off nominal may sway: searches find the worst so well
LIMIT_TOLERANCE = 1e-6  # share of a limit, or of travel's width: programs are no more exact


@attrs.frozen(kw_only=True)
class Breach:
    """A limit that a motion breaks.

    Attributes
    ----------
    place : str
        In the spec, such as ``limits.velocity``.
    found, allowed : float
        What the motion needs, and what it may have.
    """

    place: str
    found: float
    allowed: float

    @property
    def excess(self) -> float:
        """Share of what is allowed by which that is broken; infinite where nothing is."""
        return abs((self.found - self.allowed) / self.allowed) if self.allowed else math.inf

    def sentence(self) -> str:
        """Put it into words, with so many digits that the numbers contradict each other."""
        digits = next((n for n in range(4, 17) if float(f"{self.found:.{n}g}") > self.allowed), 17)
        found = float(f"{self.found:.{digits}g}")
        template = "{place}: {allowed:.12g} is allowed, the motion needs {found:.12g}."
        return Phrase(template, place=self.place, allowed=self.allowed, found=found)

    def reason(self) -> Reason:
        """Tell it to programs."""
        return Reason(code=Code.LIMIT_BROKEN, **attrs.asdict(self))


def breaches(
    limits: LimitsSpec, command: Profile, transient_sway: float, overshoot: float = -math.inf
) -> tuple[Breach, ...]:
    """Find the limits that a motion breaks.

    Parameters
    ----------
    limits : LimitsSpec
    command : Profile
        Setpoints of the drives, lag compensation included.
    transient_sway : float
        Greatest sway of the end load during the move in m, nominal machine.
    overshoot : float
        How far the end load passes its target, in m.
    """
    demands = _demands(limits, command, transient_sway, overshoot)
    return tuple(breach for breach in demands if breach.found > breach.allowed)


def _demands(limits: LimitsSpec, command: Profile, sway: float, overshoot: float) -> Iterator[Breach]:
    """List what the motion needs of every limit there is."""
    for column in range(command.axes):
        allowed_here = limits.of(column)
        for order, name in enumerate(RATES, start=1):
            allowed = getattr(allowed_here, name)
            if allowed is not None:
                demand = (1.0 - LIMIT_TOLERANCE) * greatest(command, order, column)
                yield Breach(place=limits.place(column, name), found=demand, allowed=allowed)
        if allowed_here.travel is not None:
            (low, high), travel = allowed_here.travel, limits.place(column, "travel")
            rounding = LIMIT_TOLERANCE * (high - low)
            bottom, top = extremes(command, 0, column)
            yield Breach(place=travel, found=top - rounding, allowed=high)
            yield Breach(place=travel, found=-bottom - rounding, allowed=-low)
    if limits.sway is not None:
        yield Breach(place="limits.sway", found=sway, allowed=limits.sway)
    if limits.overshoot is not None:
        yield Breach(place="limits.overshoot", found=overshoot, allowed=limits.overshoot)
