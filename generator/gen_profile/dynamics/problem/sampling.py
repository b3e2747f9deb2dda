"""Halton's points, those of SciPy's `qmc`: each plan spreads some, and `qmc` takes half a second to load."""

from itertools import count, islice

import numpy as np
from numpy.typing import NDArray


def halton(points: int, dimensions: int, begin: int = 0) -> NDArray[np.float64]:
    """Spread points evenly (J. H. Halton, Numerische Mathematik, 1960).

    Parameters
    ----------
    points, dimensions : int
    begin : int
        Number of the first one in the sequence, of which number 0 is the origin.

    Returns
    -------
    (points, dimensions) array
        From 0 to 1.
    """
    primes = (number for number in count(2) if all(number % divisor for divisor in range(2, number)))
    columns = [_van_der_corput(begin + np.arange(points), base) for base in islice(primes, dimensions)]
    return np.stack(columns, axis=1)


def _van_der_corput(numbers: NDArray[np.int64], base: int) -> NDArray[np.float64]:
    """Mirror the digits of whole numbers at the point."""
    mirrored, place = np.zeros(len(numbers)), 1.0 / base
    while numbers.any():
        numbers, digits = np.divmod(numbers, base)
        mirrored += digits * place
        place /= base
    return mirrored
