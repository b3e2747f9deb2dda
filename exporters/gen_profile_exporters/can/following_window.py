"""How far an axis may be off its motion before it is stopped: stated, or from the motion's own greatest lag.

An axis of velocity v that follows a first-order drive of time constant τ lags by v τ at most. A setpoint may
count one cycle late, and an answer may come one cycle late. So an axis that is fit lags by
``v (τ + 2 T)``, and one that runs away or is blocked is further off soon.
"""

from gen_profile.support.errors import ExportError
from gen_profile_exporters.can.scaling import Demand, magnitude_counts
from gen_profile_exporters.exporter import Target

NOISE = 0.001  # m (or rad), of what drives tell, and of how they keep a place
WINDOW_FACTOR = 1.5  # over the lag at the motion's greatest velocity
CYCLES_LATE = 2
USEFUL = 4.0  # windows as wide as this many derived ones
LEAST_USEFUL = 0.05  # m (or rad), however slow a motion is


def windows(demand: Demand, target: Target) -> tuple[int, ...]:
    """Tell how far each axis may be off its motion, in counts.

    Raises
    ------
    ExportError
        The spec states a window in which an axis could run away, or be blocked, for too long.
    """
    stated = target.can.following_error
    if stated is None:
        return _derived(demand, target)
    for axis, widest in zip(target.axes, useful(demand, target), strict=True):
        if magnitude_counts(stated, axis) > widest:
            most = widest / abs(axis.counts_per_si)
            raise ExportError(
                f"can.following_error: {stated:g} is wider than is useful on the axis {axis.name}, which "
                f"could run away for too long; state {most:.3g} at most, or leave it out."
            )
    return tuple(magnitude_counts(stated, axis) for axis in target.axes)


def useful(demand: Demand, target: Target) -> tuple[int, ...]:
    """Tell how wide each axis's window, ours or its drive's 6065h, may be at most, in counts."""
    derived = zip(_derived(demand, target), target.axes, strict=True)
    return tuple(max(round(USEFUL * own), magnitude_counts(LEAST_USEFUL, axis)) for own, axis in derived)


def _derived(demand: Demand, target: Target) -> tuple[int, ...]:
    lag = target.lag + CYCLES_LATE * target.can.sync_period
    return tuple(
        round(WINDOW_FACTOR * velocity * lag) + magnitude_counts(NOISE, axis)
        for velocity, axis in zip(demand.velocity, target.axes, strict=True)
    )
