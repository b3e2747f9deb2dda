"""What to ask of a drive so that its axis moves as planned."""

import attrs
import numpy as np
from numpy.polynomial import polynomial

from gen_profile.motion.profile import Profile


def lag_compensated(profile: Profile, tau: float | None) -> Profile:
    """Lead a first-order drive: ``y_ref = y + τ ẏ``, eq. (6) integrated twice from rest.

    Parameters
    ----------
    profile : Profile
        Motion y of the axes.
    tau : float or None
        Time constant of the drive in s; None for an ideal one, which is asked for y itself.
    """
    if tau is None:
        return profile
    velocity = np.moveaxis(polynomial.polyder(np.moveaxis(profile.coefficients, 1, 0)), 0, 1)
    coefficients = profile.coefficients.copy()
    coefficients[:, :-1] += tau * velocity
    ahead = profile.target + tau * profile.final_velocity
    return attrs.evolve(profile, coefficients=coefficients, target=ahead)
