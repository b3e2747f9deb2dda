"""Points in the unit cube are those of SciPy, to the last bit."""

from importlib import import_module

import numpy as np
import pytest

from gen_profile.dynamics.problem.sampling import halton


@pytest.fixture
def qmc():
    """Load it for who uses it: it takes each process that collects these tests half a second."""
    return import_module("scipy.stats.qmc")


@pytest.mark.parametrize("dimensions", [1, 2, 9])
def test_halton_s_sequence_is_scipy_s(qmc, dimensions):
    due = qmc.Halton(dimensions, scramble=False).random(500)
    assert np.array_equal(halton(500, dimensions), due)
    assert np.array_equal(halton(100, dimensions, begin=400), due[400:])
    assert halton(0, dimensions).shape == (0, dimensions)
