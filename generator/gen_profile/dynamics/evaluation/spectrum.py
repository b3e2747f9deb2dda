"""The spectrum of a motion's acceleration, and the frequencies at which machines answer to it."""

from collections.abc import Sequence

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.scenarios import Scenario
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.profile import Array, Profile
from gen_profile.spec.model import Spec

FREQUENCY_RANGE = 1.6  # of the fastest mode's frequency, where a picture of a spectrum ends
DECADES = 4.0  # of a spectrum that are shown


@attrs.frozen(kw_only=True, eq=False)
class Natural:
    """Natural frequencies at the target, in rad/s.

    Attributes
    ----------
    nominal : (distinct modes,) array
        Of the nominal machine.
    lowest, highest : (modes,) array
        Of each mode, over all machines.
    varying : bool
        Whether they are others at the start, as those of a load that is hoisted.
    """

    nominal: Array
    lowest: Array
    highest: Array
    varying: bool

    def span(self, points: int) -> Array:
        """List frequencies at which to draw a spectrum, shape (points,)."""
        return np.linspace(0.0, FREQUENCY_RANGE * self.highest.max(), points)


def natural_frequencies(spec: Spec, machines: Sequence[Scenario]) -> Natural:
    """Find at which frequencies a spec's machines swing, the nominal one first."""
    plant, nominal = spec.machine(), machines[0].parameters
    linear = [linearize(plant, machine.parameters, spec.move.target) for machine in machines]
    everywhere = np.array([one.frequencies for one in linear])
    before = linearize(plant, nominal, spec.move.start).frequencies
    return Natural(
        nominal=np.asarray(linear[0].distinct_frequencies),
        lowest=everywhere.min(axis=0),
        highest=everywhere.max(axis=0),
        varying=not np.allclose(before, everywhere[0]),
    )


def spectrum(motion: Profile, frequencies: Array) -> Array:
    """Find |∫ ÿ exp(−jωt) dt| of the leading axis, by a quadrature that is exact to rounding within segments.

    Parameters
    ----------
    motion : Profile
    frequencies : (k,) array
        rad/s.

    Returns
    -------
    (k,) array
        m/s (or rad/s).
    """
    lengths = np.diff(motion.knots)
    # Gauss points resolve the segment's polynomial, and half an oscillation with three each
    points = motion.coefficients.shape[1] + 4 + int(3.0 * lengths.max() * frequencies.max() / np.pi)
    nodes, weights = np.polynomial.legendre.leggauss(points)
    times = (motion.knots[:-1, None] + lengths[:, None] * (nodes + 1.0) / 2.0).ravel()
    weighted = (
        motion.derivative(times, 2)[:, motion.leading] * np.multiply.outer(lengths / 2.0, weights).ravel()
    )
    return np.asarray(np.abs(np.exp(-1j * np.multiply.outer(frequencies, times)) @ weighted))
