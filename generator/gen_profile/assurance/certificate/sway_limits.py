"""Limits of sway, where each is watched, and what is proved of it."""

import attrs

from gen_profile.assurance.certificate.arithmetic.balls import Array
from gen_profile.dynamics.problem.limits import SWAY_TOLERANCE
from gen_profile.spec.model import Spec
from gen_profile.spec.stacks import ROOM_TOLERANCE


@attrs.frozen(kw_only=True)
class SwayLimit:
    """How much a load may sway.

    Attributes
    ----------
    load : str
    allowed : float
        m.
    on_the_way : bool
        Whether it holds at any time, or after the move only. It is of the end load as a whole, then.
    """

    load: str
    allowed: float
    on_the_way: bool = False


@attrs.frozen(kw_only=True)
class ProvedSway:
    """What is proved of a limit.

    Attributes
    ----------
    limit : SwayLimit
    bound : float or None
        Proved one in m, of all machines that there are any of.
    largest_met : float
        Greatest sway that was met, in m; of it nothing is proved.
    """

    limit: SwayLimit
    bound: float | None
    largest_met: float

    @property
    def reason(self) -> str | None:
        """Say that the limit is not proved to be kept; nothing where it is, or where there is no bound."""
        limit, bound = self.limit, self.bound
        if bound is None or bound <= limit.allowed:
            return None
        when, place = "after the move", "check.residual_sway"
        if limit.on_the_way:
            when, place = "on the way", f"{SWAY_TOLERANCE:g} of limits.sway"
        return (
            f"The {limit.load} is proved to sway by at most {1e3 * bound:.4g} mm {when}, and "
            f"{1e3 * limit.allowed:.4g} mm are allowed ({place}); the greatest sway met is "
            f"{1e3 * self.largest_met:.4g} mm."
        )


def limits_of(spec: Spec) -> tuple[SwayLimit, ...]:
    """List what the check allows: every load after the move, and the end load on the way where limited."""
    after = tuple(SwayLimit(load=load, allowed=limit) for load, limit in spec.check.residual_sway.items())
    if spec.limits.sway is None:
        return after
    allowed = SWAY_TOLERANCE * spec.limits.sway
    return (*after, SwayLimit(load=spec.machine().end_load_name, allowed=allowed, on_the_way=True))


@attrs.frozen(kw_only=True)
class ProvedClearance:
    """What is proved of how near bodies come to what stands in their way.

    Attributes
    ----------
    nearer : float or None
        Proved bound in m of by how much nearer than the clearance any body comes, on any machine.
    largest_met : float
        By how much nearer one was met, in m; of it nothing is proved.
    """

    nearer: float | None
    largest_met: float
    allowed: float = ROOM_TOLERANCE

    def to_dict(self) -> dict[str, float | None]:
        """Give plain values for JSON."""
        return {"nearer_m": self.nearer, "allowed_m": self.allowed, "largest_met_m": self.largest_met}

    @property
    def reason(self) -> str | None:
        """Say that it is not proved to be kept; nothing where it is, or where there is no bound."""
        if self.nearer is None or self.nearer <= self.allowed:
            return None
        return (
            f"Loads are proved to come nearer than path.clearance by at most {1e3 * self.nearer:.4g} mm, and "
            f"{1e3 * self.allowed:.4g} mm are allowed; they were met {1e3 * self.largest_met:.4g} mm nearer."
        )


def unproved(spec: Spec) -> tuple[str, ...]:
    """List the limits that no bound is proved of: bounds are of sways, and not of where loads are."""
    return () if spec.limits.overshoot is None else ("limits.overshoot",)


@attrs.frozen(kw_only=True)
class WatchedSway:
    """A sway whose greatest value is wanted.

    Attributes
    ----------
    loads : slice
        Of the machine's; of several directions the vector's length counts.
    first : int
        Piece from which on.
    """

    loads: slice
    first: int


@attrs.frozen(kw_only=True, eq=False)
class SwayBounds:
    """What is proved, or nan.

    Attributes
    ----------
    sway : (boxes, watches) array
        Greatest sway in m; where clearances are watched, one more column of by how much less they are.
    largest_met : (boxes, watches) array
        Likewise what the approximation has at some nodes; nothing is proved of it.
    """

    sway: Array
    largest_met: Array
