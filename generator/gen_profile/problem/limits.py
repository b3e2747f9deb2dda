"""Whether a motion keeps the limits of its spec."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gen_profile.errors import LimitViolation
from gen_profile.metrics import POINTS_PER_SEGMENT
from gen_profile.profile import Profile
from gen_profile.spec import LimitsSpec


def require_limits(limits: LimitsSpec, command: Profile, transient_sway: float) -> None:
    """Hold the command, which the drive must follow, and the end load's sway to their limits.

    Parameters
    ----------
    limits : LimitsSpec
    command : Profile
        Setpoints of the drives, lag compensation included.
    transient_sway : float
        Greatest sway of the end load during the move in m, nominal machine.

    Raises
    ------
    LimitViolation
        Naming every limit that is broken, and a duration that would keep them all.
    """
    broken = [
        (name, found, allowed, power)
        for name, found, allowed, power in _demands(limits, command, transient_sway)
        if found > allowed
    ]
    if not broken:
        return
    sentences = [
        f"limits.{name}: {allowed:g} is allowed, the motion needs {found:.4g}."
        for name, found, allowed, _ in broken
    ]
    enough = command.duration * max((found / allowed) ** (1.0 / power) for _, found, allowed, power in broken)
    raise LimitViolation(
        "\n".join(sentences) + f"\nAllow about {enough:.2g} s (move.duration), or raise the limits."
    )


def _demands(limits: LimitsSpec, command: Profile, sway: float) -> Iterator[tuple[str, float, float, int]]:
    """Limit, what the motion needs, what is allowed, and the power of 1/duration that the need goes by."""
    for order, (name, allowed) in enumerate(
        [("velocity", limits.velocity), ("acceleration", limits.acceleration), ("jerk", limits.jerk)], start=1
    ):
        if allowed is not None:
            _, values = command.within_segments(POINTS_PER_SEGMENT, order)
            yield name, float(np.abs(values).max()), allowed, order
    if limits.sway is not None:
        yield "sway", sway, limits.sway, 2
