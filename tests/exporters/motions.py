"""Motions and targets to export, built without any solver."""

import numpy as np

from gen_profile.motion.profile import Profile
from gen_profile.spec.can import CanSpec
from gen_profile.spec.model import ExportSpec
from gen_profile.support.units import AxisScale, axis_factor
from gen_profile_exporters.exporter import Target
from gen_profile_exporters.machine_variants import AxisVariants


def quintic(*moves, duration=1.0):
    """Rest-to-rest quintic from and to the given pairs of positions, one pair per axis."""
    start, end = np.array(moves, dtype=float).T
    distance = end - start
    zero = np.zeros_like(start)
    rising = [factor * distance / duration**power for power, factor in ((3, 10), (4, -15), (5, 6))]
    coefficients = [start, zero, zero, *rising]
    return Profile(knots=[0.0, duration], coefficients=[coefficients], target=end, method="quintic")


def bang_bang(acceleration=1.2):
    """Full acceleration for half a second, then full deceleration: nothing could stop it sooner."""
    a = acceleration
    return Profile(
        knots=[0.0, 0.5, 1.0],
        coefficients=[[[0.1], [0.0], [a / 2]], [[0.1 + a / 8], [a / 2], [-a / 2]]],
        target=[0.1 + a / 4],
        method="bang-bang",
    )


def target(
    *names,
    unit="m",
    sign=1,
    counts_per_si=1e6,
    modulo=None,
    start=0.0,
    cycle_time=0.01,
    name="bay-3",
    export=None,
    **can,
):
    scales = tuple(
        AxisScale(
            name=axis,
            unit=unit,
            factor=sign * axis_factor(unit, counts_per_si),
            counts_per_si=sign * counts_per_si,
            modulo=modulo,
        )
        for axis in names or ("cart",)
    )
    return Target(
        name=name,
        axes=scales,
        start=(start,) * len(scales),
        export=ExportSpec(cycle_time=cycle_time, **(export or {})),
        can=CanSpec(**can),
        variants=(AxisVariants(least_scale=0.0, mirror=True, shift=True),) * len(scales),
    )
