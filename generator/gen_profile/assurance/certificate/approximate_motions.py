"""Motions of many machines as series, of which nothing needs to be believed."""

import attrs

from gen_profile.assurance.certificate.arithmetic.balls import Array, Ball
from gen_profile.assurance.certificate.scaling import Scaling


@attrs.frozen(kw_only=True, eq=False)
class Approximation:
    """Motions of machines as Chebyshev series of time and parameters.

    Attributes
    ----------
    lower, upper : (boxes, ranges) Balls
        Of the parameters that vary.
    varied : (ranges,) tuple of int
        Which of the machine's parameters these are.
    nominal : (parameters,) array
        Values of all others.
    series : (boxes, pieces, 2 n_u, time terms, terms of each parameter …) array
        Of x = (q_u, w).
    scaling : Scaling
        S, of the norm |S e| in which errors are measured.
    start : (2 n_u,) array
        x at time 0.
    """

    lower: Ball
    upper: Ball
    varied: tuple[int, ...]
    nominal: Array
    series: Array
    scaling: Scaling
    start: Array
