"""Bézier pieces against NumPy's polynomials."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from gen_profile.methods.solvers.direct.bezier import Piece, bernstein, elevation, gram, halving, power_basis

numbers = st.floats(-10.0, 10.0)
TIMES = np.linspace(0.0, 1.0, 41)


@pytest.mark.parametrize("degree", range(1, 8))
def test_powers_are_the_same_polynomial(degree):
    coefficients = np.arange(1.0, degree + 2.0) ** 2 - 3.0
    powers = Polynomial(power_basis(degree) @ coefficients)
    assert powers(TIMES) == pytest.approx(bernstein(degree, TIMES) @ coefficients, abs=1e-9)


@pytest.mark.parametrize("degree", range(1, 7))
def test_halves_are_the_same_polynomial(degree):
    coefficients = np.sin(np.arange(degree + 1.0))
    for half, map_ in enumerate(halving(degree)):
        whole = bernstein(degree, (TIMES + half) / 2.0) @ coefficients
        assert bernstein(degree, TIMES) @ map_ @ coefficients == pytest.approx(whole, abs=1e-12)


@pytest.mark.parametrize("degree", range(1, 7))
def test_elevation_changes_nothing_but_the_degree(degree):
    coefficients = np.sin(np.arange(degree + 1.0))
    raised = bernstein(degree + 1, TIMES) @ elevation(degree) @ coefficients
    assert raised == pytest.approx(bernstein(degree, TIMES) @ coefficients, abs=1e-12)


@pytest.mark.parametrize("degree", range(1, 7))
def test_gram_integrates_squares(degree):
    coefficients = np.cos(np.arange(degree + 1.0))
    square = Polynomial(power_basis(degree) @ coefficients) ** 2
    assert coefficients @ gram(degree) @ coefficients == pytest.approx(square.integ()(1.0), rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("order", [3, 4])
@given(local=st.lists(numbers, min_size=8, max_size=8))
def test_derivatives_of_a_piece_belong_together(order, local):
    piece = Piece(order=order, length=0.25)
    x = np.array(local[: piece.size])
    control = Polynomial(power_basis(3) @ x[order:])
    for k in range(order - 1, -1, -1):
        control = control.integ() * piece.length + x[k]
        assert piece.at(k, TIMES) @ x == pytest.approx(control(TIMES), abs=1e-9)


@given(local=st.lists(numbers, min_size=7, max_size=7))
def test_a_motion_stays_within_its_coefficients(local):
    piece = Piece(order=3, length=0.5)
    for order in range(4):
        hull = piece.derivative(order) @ np.array(local)
        values = piece.at(order, TIMES) @ np.array(local)
        assert values.max() <= hull.max() + 1e-9
        assert values.min() >= hull.min() - 1e-9


def test_leading_adds_the_next_derivative():
    piece, lag = Piece(order=3, length=0.5), 0.2
    local = np.linspace(-1.0, 2.0, piece.size)
    led = bernstein(5, TIMES) @ piece.leading(1, lag) @ local
    assert led == pytest.approx((piece.at(1, TIMES) + lag * piece.at(2, TIMES)) @ local, abs=1e-12)
    assert piece.leading(1, 0.0) is not None
