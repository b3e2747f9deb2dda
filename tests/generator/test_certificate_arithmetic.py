"""Balls and Chebyshev series, held against Arb's complex balls (python-flint)."""

from itertools import product

import attrs
import flint
import numpy as np
import pytest
from numpy.polynomial import chebyshev as series

from gen_profile.assurance.certificate.arithmetic import balls, chebyshev
from gen_profile.assurance.certificate.arithmetic.affine import Affine, constant
from gen_profile.assurance.certificate.arithmetic.balls import Ball, ball, matmul, shared
from gen_profile.assurance.certificate.boxes import Ranges, covers, halves
from gen_profile.assurance.certificate.equations import OPERATIONS, Enclosed, over_sinh
from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.symbolic import Function

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
    "divide by sinh": (over_sinh, lambda a, b: a / b.sinh()),
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


SIZES = [
    5e-324,
    1.5e-323,
    3e-310,
    2.2250738585072014e-308,
    1e-300,
    1e-160,
    1e-17,
    0.7,
    1.0,
    1e17,
    1e160,
    1e300,
]
ANGLES = [30.0, 400.0, 755.0, 800.0]  # and as far as functions go
SHARES = [0.0, 5e-324, 1e-310, 2.0**-53, 1e-3, 0.9, 1.0 - 2.0**-53, 1.0]  # of a midpoint


def adversarial_balls(random, count):
    """Balls that underflow, nearly overflow or nearly hold zero, and a point on each rim."""
    mid = random.choice([*SIZES, *ANGLES], count) * random.choice([-1.0, 1.0], count)
    mid = mid * random.choice([1.0, 1.0 + 2.0**-52, 1.7], count)
    rad = np.abs(mid) * random.choice(SHARES, count)
    rad = np.where(random.random(count) < 0.2, random.choice(SIZES, count), rad)
    turn = random.choice([-1.0, 1.0], count)
    rim = [
        flint.acb(m) + flint.acb(r) * flint.acb(t)
        for m, r, t in zip(mid.tolist(), rad.tolist(), turn.tolist(), strict=True)
    ]
    return Ball(mid, rad), rim


def require_inside(found, exact, share=0.5):
    mid, rad = (np.broadcast_to(part, len(exact)) for part in (found.mid, found.rad))
    known = np.isfinite(mid) & np.isfinite(rad)
    assert known.mean() > share
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


@pytest.mark.slow
@pytest.mark.parametrize(("enclosed", "exact"), UNARY.values(), ids=UNARY.keys())
def test_functions_enclose_what_underflows_or_nearly_overflows(enclosed, exact):
    with np.errstate(all="ignore"), flint.ctx.workprec(2300):
        x, rim = adversarial_balls(np.random.default_rng(11), 9000)
        require_inside(enclosed(x), [exact(z) for z in rim], 0.15)


@pytest.mark.parametrize(("enclosed", "exact"), BINARY.values(), ids=BINARY.keys())
@pytest.mark.parametrize("affine", [False, True], ids=["balls", "affine"])
def test_operations_enclose_what_underflows_or_nearly_overflows(enclosed, exact, affine):
    random = np.random.default_rng(12)
    with np.errstate(all="ignore"), flint.ctx.workprec(2300):
        (x, rim), (y, other) = (adversarial_balls(random, 4000) for _ in range(2))
        first, second = (constant(one, REACH) for one in (x, y)) if affine else (x, y)
        found = enclosed(first, second)
        exact_ones = [exact(a, b) for a, b in zip(rim, other, strict=True)]
        require_inside(found.ball if affine else found, exact_ones, 0.1)


def test_the_upper_end_of_a_ball_is_no_lower_than_it_is():
    x, _ = adversarial_balls(np.random.default_rng(13), 4000)
    with np.errstate(all="ignore"), flint.ctx.workprec(2300):
        ends = zip(x.mid.tolist(), x.rad.tolist(), x.upper.tolist(), x.most.tolist(), strict=True)
        for mid, rad, upper, most in ends:
            assert flint.arb(mid) + flint.arb(rad) <= flint.arb(upper)
            assert abs(flint.arb(mid)) + flint.arb(rad) <= flint.arb(most)


@pytest.mark.parametrize("numerator", [lambda x: 1.0, lambda x: 3.0 * x])
def test_what_a_hyperbolic_sine_divides_stays_small_where_that_is_large(numerator):
    """As in the damping of a tank's higher modes, where sinh x varies by a factor of fifty."""
    x, wide = sym.symbols("x", 1), Ball(9.5, 2.0)
    ((found,),) = Enclosed(Function("damping", {"x": x}, numerator(x) / np.sinh(x)), "a test")([wide])
    ends = np.array([7.5, 11.5])
    assert (np.abs(numerator(ends) / np.sinh(ends) - found.mid) <= found.rad).all() and found.most < 0.1
    assert np.isinf((1.0 / balls.sinh(wide)).rad)


def test_what_may_be_zero_or_beyond_a_branch_proves_nothing():
    wide = Ball(np.array([0.1]), np.array([0.2]))
    with np.errstate(all="ignore"):
        for found in (1.0 / wide, balls.log(wide), balls.sqrt(wide), balls.absolute(wide), balls.sign(wide)):
            assert not np.isfinite(found.rad).any()
        for nothing in (0.0, np.zeros(1)):
            assert (balls.sqrt(ball(nothing)).most == 0.0).all()  # as of a viscosity that is none
            assert not np.isfinite((1.0 / ball(nothing)).rad).any()


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
    coefficients = chebyshev.interpolate(np.exp(nodes[:, None]) / (2.0 - nodes), 2)
    off = np.abs(series.chebgrid2d(fine, fine, coefficients) - np.exp(fine[:, None]) / (2.0 - fine)).max()
    rhos = (2.0, 3.0, 6.0)
    reach = 0.5 * (np.array(rhos) + 1.0 / np.array(rhos))
    with np.errstate(all="ignore"):
        most = np.stack([np.exp(reach), np.where(reach < 2.0, np.e / (2.0 - reach), np.inf)])
    said = float(chebyshev.interpolation_error(most, rhos, (9, 9)))
    assert off <= said <= 1e3 * off
    assert np.allclose(chebyshev.values_at_nodes(9, 9) @ chebyshev.coefficients_of(9), np.eye(9))
    assert np.array_equal(chebyshev.derivative(6)[:-1], series.chebder(np.eye(6)))


def test_series_and_their_values_enclose_those_of_arb():
    random = np.random.default_rng(6)
    exact = random.normal(size=(2, 5, 4))
    values = chebyshev.evaluated(exact, (7, 6))
    again, off = chebyshev.interpolated(values, 2)
    assert values.rad.shape == (2, 1, 1) and values.rad.max() < 1e-12 and off.max() < 1e-9
    places = [[(flint.arb.pi() * (2 * j + 1) / (2 * count)).cos() for j in range(count)] for count in (7, 6)]
    for box, i, j in product(range(2), range(7), range(6)):
        terms = (
            flint.arb(float(exact[box, k, m])) * places[0][i].chebyshev_t(k) * places[1][j].chebyshev_t(m)
            for k, m in product(range(5), range(4))
        )
        assert abs(sum(terms) - flint.arb(values.mid[box, i, j])) <= flint.arb(values.rad[box, 0, 0])
    whole = np.zeros((2, 7, 6))
    whole[:, :5, :4] = exact
    assert (np.abs(again - whole).sum(axis=(1, 2)) <= off).all()
    fine = np.linspace(-1.0, 1.0, 41)
    shaken = np.where(random.random((2, 7, 6)) < 0.5, -1.0, 1.0)  # at nodes, by all of a radius of 1
    series_, off = chebyshev.interpolated(Ball(0.0 * shaken, np.ones((2, 1, 1))), 2)
    least = [np.abs(series.chebgrid2d(fine, fine, chebyshev.interpolate(one, 2))).max() for one in shaken]
    assert (series_ == 0.0).all() and (least <= off).all() and off.max() < 5.0


def test_the_greatest_value_of_a_series_is_bounded_closely():
    random, fine = np.random.default_rng(7), np.linspace(-1.0, 1.0, 41)
    for _ in range(4):
        exact = random.normal(size=(2, 7, 6, 4)) / np.exp(np.add.outer(np.arange(7), np.arange(6)))[..., None]
        truth = max(np.abs(series.chebgrid3d(fine, fine, fine, one)).max() for one in exact)
        found = chebyshev.greatest(exact, np.array([0.0, 1e-3]), 0.0)
        assert truth <= found <= 1.02 * truth
        assert truth <= chebyshev.greatest(exact, np.zeros(2), 1.2 * truth) <= 1.2 * truth
    assert np.isnan(chebyshev.greatest(np.full((1, 3), np.nan), np.zeros(1), 1.0))
    for sign, matrix in zip((-1.0, 1.0), chebyshev.halves(9), strict=True):
        one = random.normal(size=9)
        assert np.allclose(series.chebval(fine, matrix @ one), series.chebval(0.5 * (fine + sign), one))


def affine_numbers(random):
    """Numbers of two parameters, balls of all that they may be, and some of these values in Arb."""
    mid, slope, other = random.uniform(0.5, 2.0, (3, POINTS)) * np.array([[1.0], [0.05], [0.02]])
    rad = mid * 10.0 ** random.uniform(-17.0, -2.0, POINTS)
    x = Affine(mid, {0: slope, 1: other}, rad, REACH)
    turn = random.choice([-1.0, 1.0], POINTS)

    def value(first, second):
        parts = zip(mid.tolist(), slope.tolist(), other.tolist(), (rad * turn).tolist(), strict=True)
        return [
            flint.acb(m) + flint.acb(a) * first + flint.acb(b) * second + flint.acb(r) for m, a, b, r in parts
        ]

    return x, value


REACH = {0: np.array(1.0), 1: np.array(2.5)}
AFFINE = {
    **BINARY,
    "sine": (lambda x, y: OPERATIONS["SIN"](x) * y, lambda a, b: a.sin() * b),
    "cosine": (lambda x, y: OPERATIONS["COS"](x) * y, lambda a, b: a.cos() * b),
    "exponential": (lambda x, y: OPERATIONS["EXP"](x) * y, lambda a, b: a.exp() * b),
    "hyperbolic": (
        lambda x, y: OPERATIONS["COSH"](x) - OPERATIONS["SINH"](y),
        lambda a, b: a.cosh() - b.sinh(),
    ),
    "root": (lambda x, y: OPERATIONS["SQRT"](x) / y, lambda a, b: a.sqrt() / b),
    "small difference": (
        lambda x, y: x * y / (x * y - 0.5 * y * x),
        lambda a, b: a * b / (a * b - b * a / 2),
    ),
}


@pytest.mark.parametrize(("enclosed", "exact"), AFFINE.values(), ids=AFFINE.keys())
def test_affine_numbers_enclose_all_values_around(enclosed, exact):
    (x, x_at), (y, y_at) = (affine_numbers(np.random.default_rng(seed)) for seed in (8, 9))
    for first, second in product(
        (flint.acb(1), flint.acb(-1), flint.acb(0, 1)), (flint.acb(2.5), flint.acb(-1, 2))
    ):
        with np.errstate(all="ignore"):
            found = enclosed(x, y)
            pairs = zip(x_at(first, second), y_at(first, second), strict=True)
            require_inside(found.ball, [exact(a, b) for a, b in pairs])


def test_what_depends_on_parameters_alike_does_not_blow_up():
    x, _ = affine_numbers(np.random.default_rng(8))
    with np.errstate(all="ignore"):
        close, wide = (x * x - 0.9 * (x * x)).ball, x.ball * x.ball - 0.9 * (x.ball * x.ball)
        assert (close.rad < 0.3 * wide.rad).all()


def test_numbers_that_share_a_radius_are_enclosed_like_others():
    (x, _), (y, _) = (random_balls(np.random.default_rng(seed)) for seed in (2, 3))
    for operation, _ in BINARY.values():
        with np.errstate(all="ignore"):
            alone = operation(x, y)
            joint = operation(*(shared(Ball(one.mid, 1e-9 * one.mid), (0,)) for one in (x, y)))
            exact = operation(*(Ball(one.mid, 1e-9 * one.mid) for one in (x, y)))
        assert joint.rad.shape == (1,) and alone.rad.shape == (POINTS,)
        assert np.array_equal(joint.mid, exact.mid) and (exact.rad <= joint.rad * (1.0 + 1e-12)).all()


def test_boxes_that_do_not_cover_everything_once_are_told():
    boxes = [((1, first), (2, second)) for first in range(2) for second in range(4)]
    assert len(boxes) == 8 and covers(boxes)
    parts = [*boxes[1:], *halves(boxes[0], 1)]
    assert covers(parts)
    assert not covers(parts[1:])
    assert not covers([*parts[1:], parts[1]])
    assert not covers([((0, 0), (0, 1))])
    assert covers([()]) and not covers([])
    ranges = Ranges(names=("a", "b"), lower=np.array([0.1, 2.0]), upper=np.array([0.3, 5.0]))
    low, high = ranges.enclosed(boxes)
    assert np.allclose(low.mid.min(axis=0), ranges.lower) and np.allclose(high.mid.max(axis=0), ranges.upper)
    assert np.allclose(ranges.values(boxes[0], np.array([[-1.0, 1.0]])), [[0.1, 2.75]])


def test_a_ball_is_frozen():
    with pytest.raises(attrs.exceptions.FrozenInstanceError):
        ball(1.0).mid = 2.0
