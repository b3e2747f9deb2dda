"""Motions that are fed to shapers: from 0 to 1 within unit time, from rest to rest, as exact polynomials."""

import math
from collections.abc import Callable, Sequence

import attrs
import numpy as np
from numpy.polynomial import polynomial

from gen_profile.motion.profile import Array, read_only
from gen_profile.spec.model import LimitsSpec
from gen_profile.support.errors import SpecError
from gen_profile.support.plugins import require_installed
from gen_profile.support.units import RATES

PLACES = 65  # of a segment, at which peaks are looked for


@attrs.frozen(kw_only=True, eq=False)
class BaseMove:
    """A motion of unit distance in unit time.

    Attributes
    ----------
    knots : (segments + 1,) array
        Rising from 0 to 1.
    coefficients : (segments, order) array
        Of the position, lowest power first, every segment in time of its own.
    """

    knots: Array = attrs.field(converter=read_only)
    coefficients: Array = attrs.field(converter=read_only)

    def peak(self, order: int) -> float:
        """Find the greatest absolute value of a derivative, in units of the distance and of time."""
        powers = [polynomial.polyder(own, order) for own in self.coefficients]
        lengths, places = np.diff(self.knots), np.linspace(0.0, 1.0, PLACES)
        return max(
            float(np.abs(polynomial.polyval(places * length, own)).max())
            for own, length in zip(powers, lengths, strict=True)
        )


# the lowest polynomials with continuous acceleration, and with continuous jerk
QUINTIC = BaseMove(knots=[0.0, 1.0], coefficients=[[0.0, 0.0, 0.0, 10.0, -15.0, 6.0]])
SEPTIC = BaseMove(knots=[0.0, 1.0], coefficients=[[0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0]])


def jerk_limited(limits: LimitsSpec, distance: Sequence[float]) -> BaseMove:
    """Move as fast as limits of velocity, acceleration and jerk permit, in up to seven cubic segments.

    Parameters
    ----------
    limits : LimitsSpec
        Of which the jerk must be stated.
    distance : (axes,) sequence of float
        Of every axis in m (or rad): all make the same move, each over its own distance.

    Raises
    ------
    SpecError
        There is no limit of jerk, or Ruckig is not installed.
    """
    velocity, acceleration, jerk = (_share(limits, name, distance) for name in RATES)
    if math.isinf(jerk):
        raise SpecError(
            "limits.jerk: a jerk-limited base move needs it; state it, or take another base move."
        )
    require_installed("A jerk-limited base move needs Ruckig", "ruckig", "ruckig")
    from ruckig import InputParameter, Ruckig, Trajectory  # noqa: PLC0415  # an extra

    demand, trajectory = InputParameter(1), Trajectory(1)
    demand.target_position = [1.0]
    demand.max_velocity, demand.max_acceleration, demand.max_jerk = [velocity], [acceleration], [jerk]
    Ruckig(1).calculate(demand, trajectory)
    pieces = trajectory.profiles[0][0]
    kept = np.array(pieces.t) > 0.0
    taylor = np.stack([pieces.p[:-1], pieces.v[:-1], np.array(pieces.a[:-1]) / 2.0, np.array(pieces.j) / 6.0])
    duration = trajectory.duration
    ends = np.cumsum(np.array(pieces.t)[kept]) / duration
    return BaseMove(knots=[0.0, *ends[:-1], 1.0], coefficients=taylor[:, kept].T * duration ** np.arange(4.0))


def _share(limits: LimitsSpec, name: str, distance: Sequence[float]) -> float:
    """Limit of a derivative of a unit move; infinite where no axis that moves has one."""
    allowed = [getattr(limits.of(axis), name) for axis in range(len(distance))]
    pairs = zip(allowed, distance, strict=True)
    return min((limit / abs(far) for limit, far in pairs if limit is not None and far), default=math.inf)


BASES: dict[str, Callable[[LimitsSpec, Sequence[float]], BaseMove]] = {
    "quintic": lambda _limits, _distance: QUINTIC,
    "septic": lambda _limits, _distance: SEPTIC,
    "jerk-limited": jerk_limited,
}
