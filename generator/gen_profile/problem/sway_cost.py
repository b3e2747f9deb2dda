"""What sway costs on the way: β exp((γ d)²) of eq. (26), and its derivatives by the sway."""

from __future__ import annotations

import attrs
import numpy as np

from gen_profile.motion.profile import Array

STEEPEST = 50.0  # exponent beyond which the cost is steep enough


@attrs.frozen(kw_only=True)
class SwayCost:
    """β and γ, resolved; sways are arrays (points, directions) in m."""

    beta: float
    gamma: float

    def exponents(self, sway: Array) -> Array:
        """(γ d)², shape (points,)."""
        with np.errstate(over="ignore"):  # of an iterate that diverges
            return np.asarray(self.gamma**2 * (sway**2).sum(axis=1))

    def values(self, sway: Array) -> Array:
        """Evaluate the cost, shape (points,)."""
        return np.asarray(self.beta * np.exp(np.minimum(self.exponents(sway), STEEPEST)))

    def derivatives(self, sway: Array) -> tuple[Array, Array]:
        """Differentiate it once and twice: (points, directions) and (points, directions, directions)."""
        steepness = 2.0 * self.gamma**2 * self.values(sway)[:, None]
        with np.errstate(over="ignore"):
            square = np.eye(sway.shape[1]) + 2.0 * self.gamma**2 * sway[:, :, None] * sway[:, None]
            return steepness * sway, steepness[..., None] * square
