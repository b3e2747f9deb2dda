"""Balls and Chebyshev series, held against Arb's complex balls (python-flint)."""

from itertools import product

import attrs
import flint
import numpy as np
import pytest
from numpy.polynomial import chebyshev as series

from gen_profile.certificate import balls, chebyshev
from gen_profile.certificate.balls import Ball, ball, matmul
from gen_profile.certificate.boxes import Ranges, covers, halves, whole

POINTS = 200


@pytest.fixture(autouse=True)
def exactly():
    """Let Arb's own rounding not matter."""
    with flint.ctx.workprec(200):
        yield


UNARY = {
    "sin": (balls.sin, lambda z: z.sin()),
    "cos": (balls.cos, lambda z: z.cos()),
    "tan": (balls.tan, lambda z: z.tan()),
    "sinh": (balls.sinh, lambda z: z.sinh()),
    "cosh": (balls.cosh, lambda z: z.cosh()),
    "tanh": (balls.tanh, lambda z: z.tanh()),
    "exp": (balls.exp, lambda z: z.exp()),
    "log": (balls.log, lambda z: z.log()),
    "sqrt": (balls.sqrt, lambda z: z.sqrt()),
    "cube": (lambda x: balls.power(x, 3.0), lambda z: z**3),
    "inverse square": (lambda x: balls.power(x, -2.0), lambda z: 1 / (z * z)),
    "power": (lambda x: balls.power(x, 1.7), lambda z: z ** flint.acb(1.7)),
}
BINARY = {
    "add": (lambda x, y: x + y, lambda a, b: a + b),
    "subtract": (lambda x, y: x - y, lambda a, b: a - b),
    "multiply": (lambda x, y: x * y, lambda a, b: a * b),
    "divide": (lambda x, y: x / y, lambda a, b: a / b),
}


def random_balls(random):
    """Balls of all sizes from a unit in the last place to half of their midpoint, and a point on each rim."""
    mid = random.uniform(0.05, 4.0, POINTS)
    rad = mid * 10.0 ** random.uniform(-17.0, -0.35, POINTS)
    turn = np.exp(1j * random.choice([0.0, np.pi, *random.uniform(0.0, 2.0 * np.pi, 4)], POINTS))
    rim = [
        flint.acb(m) + flint.acb(r * 0.999999) * flint.acb(complex(t))
        for m, r, t in zip(mid, rad, turn, strict=True)
    ]
    return Ball(mid, rad), rim


def require_inside(found, exact):
    mid, rad = np.broadcast_to(found.mid, POINTS), np.broadcast_to(found.rad, POINTS)
    known = np.isfinite(mid) & np.isfinite(rad)
    assert known.mean() > 0.5
    for m, r, value in zip(mid[known].tolist(), rad[known].tolist(), np.array(exact)[known], strict=True):
        assert abs(value - flint.acb(m)) <= flint.arb(r)


@pytest.mark.parametrize(("enclosed", "exact"), UNARY.values(), ids=UNARY.keys())
def test_functions_enclose_all_complex_values_around(enclosed, exact):
    x, rim = random_balls(np.random.default_rng(1))
    with np.errstate(all="ignore"):
        require_inside(enclosed(x), [exact(z) for z in rim])


@pytest.mark.parametrize(("enclosed", "exact"), BINARY.values(), ids=BINARY.keys())
def test_operations_enclose_all_complex_values_around(enclosed, exact):
    (x, rim), (y, other) = (random_balls(np.random.default_rng(seed)) for seed in (2, 3))
    with np.errstate(all="ignore"):
        require_inside(enclosed(x, y), [exact(a, b) for a, b in zip(rim, other, strict=True)])


def test_what_may_be_zero_or_beyond_a_branch_proves_nothing():
    wide = Ball(np.array([0.1]), np.array([0.2]))
    with np.errstate(all="ignore"):
        for found in (1.0 / wide, balls.log(wide), balls.sqrt(wide), balls.absolute(wide), balls.sign(wide)):
            assert not np.isfinite(found.rad).any()
        assert (balls.sqrt(ball(np.zeros(1))).most == 0.0).all()  # as of a viscosity that is none


def test_products_of_matrices_enclose_those_of_arb():
    random = np.random.default_rng(4)
    a, b = (Ball(random.normal(size=(5, 5)), 1e-9 * random.random((5, 5))) for _ in range(2))
    found = matmul(a, b)
    for sign in (-1.0, 1.0):
        first, second = (edge(x, sign) for x in (a, b))
        exact = first * second
        for i, j in product(range(5), repeat=2):
            assert abs(exact[i, j] - flint.arb(found.mid[i, j])) <= flint.arb(found.rad[i, j])


def edge(matrix, sign):
    """The least or greatest matrix of a ball."""
    pairs = zip(matrix.mid.ravel().tolist(), matrix.rad.ravel().tolist(), strict=True)
    return flint.arb_mat(*matrix.shape, [flint.arb(mid) + sign * flint.arb(rad) for mid, rad in pairs])


def test_interpolation_misses_less_than_is_said():
    nodes, fine = chebyshev.nodes(9).mid, np.linspace(-1.0, 1.0, 801)
    values = np.exp(nodes[:, None]) / (2.0 - nodes)
    coefficients = chebyshev.coefficients_of(9).mid @ values @ chebyshev.coefficients_of(9).mid.T
    off = np.abs(series.chebgrid2d(fine, fine, coefficients) - np.exp(fine[:, None]) / (2.0 - fine)).max()
    rho = 3.0
    reach = 0.5 * (rho + 1.0 / rho)
    said = float(chebyshev.missed(np.array(np.exp(reach) / (2.0 - reach)), (rho, 9), (rho, 9), 1))
    assert off <= said <= 1e3 * off
    assert np.allclose(chebyshev.values_at_nodes(9, 9).mid @ chebyshev.coefficients_of(9).mid, np.eye(9))
    assert np.array_equal(chebyshev.derivative(6)[:-1], series.chebder(np.eye(6)))
    wave = np.zeros(7)
    wave[6] = 1.0
    turned = series.chebval(np.cos(np.arange(0.5, 20.0) * np.pi / 20.0), wave)
    assert np.abs(turned).max() * chebyshev.between_nodes(20, 6) >= 1.0


def test_boxes_that_do_not_cover_everything_once_are_told():
    boxes = whole([1, 2])
    assert len(boxes) == 8 and covers(boxes)
    parts = [*boxes[1:], *halves(boxes[0], 1)]
    assert covers(parts)
    assert not covers(parts[1:])
    assert not covers([*parts[1:], parts[1]])
    assert not covers([((0, 0), (0, 1))])
    assert covers(whole([])) and not covers([])
    ranges = Ranges(names=("a", "b"), lower=np.array([0.1, 2.0]), upper=np.array([0.3, 5.0]))
    low, high = ranges.enclosed(boxes)
    assert np.allclose(low.mid.min(axis=0), ranges.lower) and np.allclose(high.mid.max(axis=0), ranges.upper)
    assert np.allclose(ranges.values(boxes[0], np.array([[-1.0, 1.0]])), [[0.1, 2.75]])


def test_a_ball_is_frozen():
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        ball(1.0).mid = 2.0
