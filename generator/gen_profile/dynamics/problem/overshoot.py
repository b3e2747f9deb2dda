"""How far the end load passes its target."""

from collections.abc import Sequence

import numpy as np

from gen_profile.dynamics.problem.limits import SWAY_TOLERANCE
from gen_profile.motion.profile import Array
from gen_profile.spec.passed_target import BoundedTarget


def beyond(targets: Sequence[BoundedTarget], q_a: Array, end_sway: Array) -> Array:
    """Tell how far the end load is past its targets in m, shape (targets, …); negative before them.

    Parameters
    ----------
    targets : sequence of BoundedTarget
    q_a : (…, axes) array
    end_sway : (…, directions) array
        Of the end load in m.
    """
    return np.array(
        [
            one.sign * (q_a[..., one.direction.axis] - end_sway[..., one.direction.component] - one.at)
            for one in targets
        ]
    )


def counted(targets: Sequence[BoundedTarget], nominal: float, worst: float = -np.inf) -> float:
    """Tell what of an overshoot counts against the limit: the nominal machine's, or the worst's if too great.

    Parameters
    ----------
    nominal, worst : float
        How far the load passes a target on the nominal machine, and on any, in m.
    """
    return (
        worst
        if excess(targets, worst) > 0.0
        else nominal - max((one.tolerance for one in targets), default=0.0)
    )


def excess(targets: Sequence[BoundedTarget], worst: float, accepted: float = SWAY_TOLERANCE) -> float:
    """Tell by how much in m the worst machine's load passes its targets farther than it may."""
    return worst - min((accepted * one.most for one in targets), default=np.inf)
