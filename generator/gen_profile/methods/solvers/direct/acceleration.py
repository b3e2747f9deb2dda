"""Anderson's acceleration of a fixed-point iteration ``x ← g(x)``.

The next point is that combination of the last ones whose steps ``g(x) − x`` cancel best, moved on by what
remains of the step (Walker and Ni, Anderson acceleration for fixed-point iterations, 2011). It settles
iterations that overshoot, back and forth, and would never end.
"""

from collections.abc import Sequence

import numpy as np

from gen_profile.motion.profile import Array

MEMORY = 6  # steps combined at most
SINGULAR = 1e-8  # relative singular value below which differences of steps are taken for dependent


def accelerate(points: Sequence[Array], images: Sequence[Array], weights: Array) -> Array:
    """Predict the fixed point.

    Parameters
    ----------
    points, images : sequence of (n,) arrays
        x and g(x), oldest first; only the last ones count.
    weights : (n,) array
        How much each entry counts.
    """
    x, step = np.array(points[-MEMORY:]), np.array(images[-MEMORY:]) - np.array(points[-MEMORY:])
    changes = np.diff(step, axis=0)
    mixture = np.linalg.lstsq((weights * changes).T, weights * step[-1], rcond=SINGULAR)[0]
    return np.asarray(x[-1] + step[-1] - mixture @ (np.diff(x, axis=0) + changes))
