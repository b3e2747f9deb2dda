"""Which end conditions of a linear system are independent of one another.

State i at time 1 of ``x' = A x + B u`` from rest is ∫ rᵢ(1 − s) u(s) ds with rᵢ(t) = (e^{At} B)ᵢ. A
condition whose rᵢ is a combination of other conditions' holds by itself once those hold; asking for it again
would make the boundary value problem singular. So do first-order sensitivities: zero sensitivity of two
undamped modes to one rope length already is zero sensitivity to the other. Modes much faster than the move
behave alike: they follow statically.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from gen_profile.motion.profile import Array
from gen_profile.support.one_thread import one_thread

SAMPLES = 256


def independent_states(A: Array, B: Array, order: NDArray[np.intp], shares: Array) -> NDArray[np.bool_]:
    """Choose states that inputs can bring to given values independently, those first in `order` first.

    Parameters
    ----------
    A : (n, n) array
        In units in which the horizon is 1.
    B : (n, m) array
    order : (k,) array of int
        States to choose from.
    shares : (k,) array
        Share of rᵢ outside the span of the others below which condition i is implied.

    Returns
    -------
    (k,) array of bool
    """
    with one_thread:
        responses, step = B[None], expm(A / SAMPLES)
    while len(responses) <= SAMPLES:
        responses, step = np.concatenate([responses, step @ responses]), step @ step
    outside = responses.transpose(1, 0, 2).reshape(len(A), -1)[order]
    least = shares * np.linalg.norm(outside, axis=1)
    chosen = np.zeros(len(order), dtype=bool)
    # modified Gram-Schmidt: those behind lose what they share with the chosen
    for i, row in enumerate(outside):
        size = np.linalg.norm(row)
        chosen[i] = size > least[i]
        if chosen[i]:
            outside[i + 1 :] -= np.outer(outside[i + 1 :] @ row / size**2, row)
    return chosen
