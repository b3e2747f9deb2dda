"""The cost of sway and its derivatives, against differences."""

import numpy as np
import pytest

from gen_profile.dynamics.problem.cost import SwayCost

COST = SwayCost(beta=3.0, gamma=20.0)
SWAY = np.array([[0.01, -0.03], [0.0, 0.0], [0.05, 0.02]])
STEP = 1e-6


def changed(direction, by):
    return SWAY + by * np.eye(2)[direction]


def test_value_is_the_paper_s():
    np.testing.assert_allclose(COST.values(SWAY), 3.0 * np.exp((20.0 * np.hypot(*SWAY.T)) ** 2))


@pytest.mark.parametrize("direction", [0, 1])
def test_derivatives_are_quotients_of_differences(direction):
    up, down = changed(direction, STEP), changed(direction, -STEP)
    slope = (COST.values(up) - COST.values(down)) / (2 * STEP)
    np.testing.assert_allclose(COST.derivatives(SWAY)[0][:, direction], slope, rtol=1e-6, atol=1e-4)
    curvature = (COST.derivatives(up)[0] - COST.derivatives(down)[0]) / (2 * STEP)
    np.testing.assert_allclose(COST.derivatives(SWAY)[1][:, direction], curvature, rtol=1e-6, atol=1e-3)


def test_far_too_much_sway_costs_a_finite_amount():
    assert np.isfinite(COST.derivatives(np.array([[1e3, 0.0]]))[1]).all()


def test_a_sway_beyond_all_numbers_costs_the_most_without_a_warning():
    far = np.array([[1e200, 1e200]])
    assert COST.values(far) == COST.values(np.array([[1e3, 0.0]]))
    assert (COST.derivatives(far)[0] > 0.0).all()
