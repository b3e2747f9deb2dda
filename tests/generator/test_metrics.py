"""Figures of motions, against polynomials' roots."""

import numpy as np
import pytest
from generator.crane_problems import crane_problem

from gen_profile.methods.solvers.indirect.solver import solve
from gen_profile.methods.solvers.motion import optimal_profile
from gen_profile.motion.metrics import extremes, greatest, overshoot
from gen_profile.motion.profile import Profile


@pytest.fixture(scope="module")
def motion():
    return optimal_profile(solve(crane_problem()))


def by_roots(profile, order):
    """Values at the knots, from both sides, and wherever the next derivative vanishes."""
    values = []
    for k, length in enumerate(np.diff(profile.knots)):
        piece = np.polynomial.Polynomial(profile.coefficients[k, :, 0]).deriv(order)
        roots = piece.deriv().roots()
        inside = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0) & (roots.real < length)]
        values.extend(piece(np.concatenate([inside, [0.0, length]])))
    return min(values), max(values)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_extremes_are_found_between_points(motion, order):
    expected = by_roots(motion, order)
    found = extremes(motion, order)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-12)
    assert greatest(motion, order) == max(abs(found[0]), abs(found[1]))


def test_a_jump_s_both_sides_count():
    step = Profile(
        knots=[0.0, 1.0, 2.0],
        coefficients=np.array([[[0.0], [3.0]], [[3.0], [-1.0]]]),
        target=[2.0],
        method="step",
    )
    assert extremes(step, 1) == (-1.0, 3.0)
    assert overshoot(step) == 1.0
