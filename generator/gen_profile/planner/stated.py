"""What a spec states of a planner block's motions, whichever block it is."""

from gen_profile.planner.sensor import damping_room
from gen_profile.spec.model import Spec

STEADY = 1e-3  # change of a live parameter on the way, relative to the end of its range, that counts as none
MARGIN = 2.0  # between targets and the travel's ends, relative to the allowed sway, for calming
QUICK = 2.0  # default deceleration of a quick stop, relative to the limit of the acceleration
QUICK_JERK = 4.0


def quick_limits(spec: Spec, axis: int) -> tuple[float, float]:
    """Deceleration and jerk of an axis's quick stop, where its limits are stated, in m (or rad) and s."""
    own = spec.limits.of(axis)
    assert own.acceleration and own.jerk
    return (
        spec.planner.quick_stop or QUICK * own.acceleration,
        spec.planner.quick_stop_jerk or QUICK_JERK * own.jerk,
    )


def target_range(spec: Spec, axis: int) -> tuple[float, float]:
    """Least and greatest target of an axis, where its travel is stated: with room for calming and damping."""
    travel = spec.limits.of(axis).travel
    assert travel is not None
    margin = MARGIN * min(spec.check.residual_sway.values()) if spec.planner.live_rate else damping_room(spec)
    return travel[0] + margin, travel[1] - margin
