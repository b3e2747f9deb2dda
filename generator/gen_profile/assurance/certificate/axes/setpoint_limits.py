"""What a file's setpoints ask of the axes, where the spec limits it.

Setpoints are joined by straight lines, which have a velocity at every instant. How much it changes from one
cycle to the next, per cycle, is the acceleration that a drive finds, and of that likewise the jerk. Every
motion through the setpoints has at least as much somewhere.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import ball, concatenate
from gen_profile.assurance.verification.plausibility import OVERSHOOT
from gen_profile.motion.profile import SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.support.errors import CertificateError

PER_TIME = {"velocity": "s", "acceleration": "s²", "jerk": "s³"}

Asked = Mapping[str, Mapping[str, Mapping[str, Any]]]


def asked_of_axes(spec: Spec, setpoints: SampledProfile) -> Asked:
    """Bound velocity, acceleration and jerk where they are limited.

    Returns
    -------
    mapping
        By axis and kind: ``bound``, ``limit``, ``rounding`` of positions that a bound contains, ``unit``.

    Raises
    ------
    CertificateError
        It is more than the check lets cams and rounding make of the limit. Of jerks that is not asked.
    """
    asked: dict[str, dict[str, Mapping[str, Any]]] = {}
    for order, (kind, per) in enumerate(PER_TIME.items(), start=1):
        roundings = (2 ** (order - 1) * setpoints.resolution / setpoints.cycle_time**order).tolist()
        rows = zip(_quotients(spec, setpoints, order), roundings, spec.machine().actuated, strict=True)
        for column, (bound, rounding, axis) in enumerate(rows):
            limit, unit = getattr(spec.limits.of(column), kind), f"{axis.unit}/{per}"
            if limit is None:
                continue
            if kind in OVERSHOOT and not bound <= (1.0 + OVERSHOOT[kind]) * limit + rounding:
                raise CertificateError(
                    f"The setpoints ask {axis.name} for {bound:.4g} {unit}, and "
                    f"{spec.limits.place(column, kind)} allows {limit:.4g} {unit}."
                )
            claim = {"bound": bound, "limit": limit, "rounding": rounding, "unit": unit}
            asked.setdefault(axis.name, {})[kind] = claim
    return asked


def _quotients(spec: Spec, setpoints: SampledProfile, order: int) -> list[float]:
    """Bound every axis' difference quotients of an order, what is before and after included."""
    position, cycle = ball(setpoints.position), ball(setpoints.cycle_time)
    after = cycle * np.arange(1.0, order)[:, None] * np.array(spec.move.final_velocity)
    quotients = concatenate([position[:1]] * (order - 1) + [position, after + setpoints.position[-1]])
    for _ in range(order):
        quotients = (quotients[1:] - quotients[:-1]) / cycle
    greatest: list[float] = quotients.most.max(axis=0).tolist()
    return greatest
