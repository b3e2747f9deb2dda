"""The proof: an approximate motion of many machines, and a bound on how far every true one is from it.

docs/certificate.md states the theorem and its proof; names here are those of that page. Nothing in here needs
to be believed of the approximation: whatever it is, the bound holds.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, reduce

import attrs
import numpy as np

from gen_profile.certificate import chebyshev
from gen_profile.certificate.axis_motion import AxisMotion, Gap, powers, widened
from gen_profile.certificate.balls import Array, Ball, ball, matmul, stack
from gen_profile.certificate.equations import EnclosedEquations

TIME_NODES, FEW_TIME_NODES = 16, 8  # for the defect, and for what need not be as close
ELLIPSES = (
    (3.0, 3.0),
    (4.0, 5.0),
    (6.0, 4.0),
    (6.0, 7.0),
    (6.0, 12.0),
    (9.0, 10.0),
    (12.0, 20.0),
)  # ρ of both
TIGHT_DEGREE, TIGHT_NODES = 6, 96  # for the greatest sway over a piece
FIRST_GUESS, ATTEMPTS = 5e-3, 4  # how far a motion is off, as a share of its size; doubled and more
ROUND_UP = 1.0 + 1e-12


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
    terms : int
        Of the series in each parameter.
    coefficients : (boxes, pieces, 2 n_u, time terms, parameter terms) array
        Of x = (q_u, w); parameter terms are flattened as `chebyshev.tensor` does.
    scales : (boxes, pieces, 2 n_u, 2 n_u) array
        S, of the norm |S e| in which errors are measured.
    start : (2 n_u,) array
        x at time 0.
    """

    lower: Ball
    upper: Ball
    varied: tuple[int, ...]
    nominal: Array
    terms: int
    coefficients: Array
    scales: Array
    start: Array


@attrs.frozen(kw_only=True, eq=False)
class SwayBounds:
    """What is proved, or nan.

    Attributes
    ----------
    sway : (boxes, loads) array
        Greatest residual sway in m.
    seen : (boxes, loads) array
        Greatest residual sway in m that the approximation has at some nodes; nothing is proved of it.
    """

    sway: Array
    seen: Array


@attrs.frozen(kw_only=True, eq=False)
class Enclosure:
    """One batch of boxes.

    Attributes
    ----------
    equations : EnclosedEquations
    axes : AxisMotion
    gap : Gap
        How far the axes are from `axes`.
    watched : int
        First piece in which the sway counts.
    approximation : Approximation
    """

    equations: EnclosedEquations
    axes: AxisMotion
    gap: Gap
    watched: int
    approximation: Approximation

    @property
    def fine(self) -> tuple[int, int]:
        """Nodes in time and in each parameter."""
        return TIME_NODES, self.approximation.terms + 3

    @property
    def coarse(self) -> tuple[int, int]:
        """Nodes where a per cent will do."""
        return FEW_TIME_NODES, self.approximation.terms

    def bounds(self) -> SwayBounds:
        """Carry the proof out."""
        with np.errstate(all="ignore"):  # what is not finite proves nothing
            return self._bounds()

    def _bounds(self) -> SwayBounds:
        defect = self.defect()
        scale = self.approximation.scales
        source = _norm(matmul_most(scale, defect))
        inverse, slip = self._inverse()
        size = _norm(matmul_most(scale, self._range(1.0, 1.0)[0].most))
        reach = FIRST_GUESS * size.max(axis=1)
        for _ in range(ATTEMPTS):
            tube = (
                reach[:, None, None]
                * np.sqrt((inverse**2).sum(axis=-1))
                * (1.0 + 2.0 * slip)[..., None]
                * ROUND_UP
            )
            growth, disturbance, slopes, shift = self._tubes(tube, inverse, slip)
            largest, at_watch = self._accumulated(growth, source + disturbance, inverse, slip)
            closed = largest <= reach
            if (closed | ~np.isfinite(largest)).all():
                break
            reach = np.where(closed, reach, 2.0 * largest)
        sway, seen = self._sway()
        sway = sway + slopes * np.where(closed, at_watch, np.nan)[:, None] + shift
        return SwayBounds(sway=sway * ROUND_UP, seen=seen)

    # the approximation

    def _range(self, rho: float, rho_p: float) -> tuple[Ball, Ball]:
        """Enclose x̃ and its slope on ellipses, each (boxes, pieces, 2 n_u)."""
        c = self.approximation.coefficients
        terms = c.shape[3]
        over_p = rho_p ** chebyshev.degrees(self.approximation.terms, len(self.approximation.varied))
        weights = rho ** np.arange(terms)[:, None] * over_p
        sizes = np.abs(c)
        total = np.einsum("bpxtk,tk->bpx", sizes, weights) * ROUND_UP
        middle = c[..., 0, 0]
        slope = np.abs(chebyshev.derivative(terms).T @ rho ** np.arange(terms))
        rate = np.einsum("bpxtk,t,k->bpx", sizes, slope, over_p) * ROUND_UP
        return Ball(middle, (total - np.abs(middle)) * ROUND_UP + 1e-15 * total), Ball(
            np.zeros_like(rate), rate
        ) / self.axes.halves[:, None]

    def _parameters(self, places: Ball | None, reach: float = 1.0) -> list[Ball]:
        """All parameters: at places on [−1, 1] per range, shape (boxes, 1, 1, places), or all of them."""
        a = self.approximation
        found: list[Ball] = [ball(value) for value in a.nominal.tolist()]
        for column, number in enumerate(a.varied):
            low, high = a.lower[:, column], a.upper[:, column]
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            if places is None:
                found[number] = Ball(middle.mid, (middle.rad + half.most * reach) * ROUND_UP)[:, None]
            else:
                found[number] = middle[:, None, None, None] + half[:, None, None, None] * places[column]
        return found

    def _places(self, count: int) -> Ball:
        """Nodes in each range, shape (ranges, nodes ** ranges)."""
        ranges = len(self.approximation.varied)
        one = chebyshev.nodes(count)
        if not ranges:
            return Ball(np.zeros((0, 1)), np.zeros((0, 1)))
        grids = [
            np.stack([g.ravel() for g in np.meshgrid(*[part] * ranges, indexing="ij")])
            for part in (one.mid, one.rad)
        ]
        return Ball(*grids)

    def _at_nodes(self, coefficients: Array, counts: tuple[int, int]) -> Ball:
        """Evaluate series, (…, time terms, parameter terms) → (…, time nodes, places)."""
        a = self.approximation
        ranges = len(a.varied)
        over_p = chebyshev.tensor(chebyshev.values_at_nodes(counts[1], a.terms), ranges)
        over_t = chebyshev.values_at_nodes(counts[0], coefficients.shape[-2])
        return matmul(over_t, matmul(ball(coefficients), Ball(over_p.mid.T, over_p.rad.T)))

    def defect(self) -> Array:
        """Bound x̃' − f(x̃), (boxes, pieces, 2 n_u)."""
        a, c = self.approximation, self.axes.coefficients()
        n, ranges = a.coefficients.shape[2], len(a.varied)
        half = self.axes.halves
        x = self._at_nodes(a.coefficients, self.fine)
        dx = self._at_nodes(chebyshev.derivative(a.coefficients.shape[3]) @ a.coefficients, self.fine)
        nodes = chebyshev.nodes(self.fine[0])
        q_a = powers(c, nodes, 0)[..., None]
        v = powers(c, nodes, 1)[..., None] / half[:, None, None, None]
        p = self._parameters(self._places(self.fine[1]))
        f = self.equations.rate(_columns(x, 2), _columns(q_a, 2), _columns(v, 2), p)
        found = [
            _series(dx[:, :, i] / half[None, :, None, None] - f[i][0], ranges, self.fine).most.sum(
                axis=(-1, -2)
            )
            * ROUND_UP
            for i in range(n)
        ]
        return np.stack(found, axis=2) + self._missed(self._defect_on, self.fine)

    def _defect_on(self, rho: float, rho_p: float) -> Array:
        """Bound the defect on ellipses."""
        x, dx = self._range(rho, rho_p)
        q_a, v, p = (
            self._axes_on(rho),
            self._axes_on(rho, 1),
            self._parameters(None, 0.5 * (rho_p + 1.0 / rho_p)),
        )
        f = self.equations.rate(_columns(x, 2), _columns(q_a, 1), _columns(v, 1), p)
        return stack([dx[..., i] - row[0] for i, row in enumerate(f)], axis=2).most

    def _missed(self, on: Callable[[float, float], Array], counts: tuple[int, int]) -> Array:
        """Bound what interpolation misses, by the best ellipse."""
        ranges = len(self.approximation.varied)
        return reduce(
            np.fmin,
            (
                chebyshev.missed(on(rho, rho_p), (rho, counts[0]), (rho_p, counts[1]), ranges)
                for rho, rho_p in ELLIPSES
            ),
        )

    def _axes_on(self, rho: float, order: int = 0, off: Array | None = None) -> Ball:
        """Enclose a derivative of the axes' smooth motion on ellipses, and what is as near, (pieces, m)."""
        reach = 0.5 * (rho + 1.0 / rho)
        found = widened(self.axes.coefficients(), reach, order)
        for _ in range(order):
            found = found / self.axes.halves[:, None]
        return found if off is None else Ball(found.mid, (found.rad + off) * ROUND_UP)

    # the error

    def _inverse(self) -> tuple[Array, Array]:
        """Approximate S⁻¹, and bound |S S⁻¹ − I|."""
        scale = self.approximation.scales
        try:
            inverse = np.asarray(np.linalg.inv(scale), dtype=np.float64)
        except np.linalg.LinAlgError:
            inverse = np.full(scale.shape, np.nan)
        identity = matmul(ball(scale), ball(inverse)) - np.eye(scale.shape[-1])
        return inverse, np.where((slip := identity.most.sum(axis=(-1, -2)) * ROUND_UP) < 0.5, slip, np.nan)

    def _tubes(self, tube: Array, inverse: Array, slip: Array) -> tuple[Array, Array, Array, Array]:
        """Bound what depends on where the true motions are: within a tube around the approximate ones.

        Returns
        -------
        growth, disturbance : (boxes, pieces) arrays
            Logarithmic norm in 1/s, and what setpoints add.
        slopes, shift : (boxes, loads) arrays
            Sway per error, and what setpoints add.
        """
        eq, around = self.equations, self._range(1.0, 1.0)[0]
        shape, p = around.shape[:2], self._parameters(None)
        near, shifted = self._near(around, tube)
        n_u = around.shape[-1] // 2
        seen = _columns(near[..., :n_u], 2), _columns(self._axes_on(1.0, 0, self.gap.position), 1), p
        gain = _array(eq.sway_slopes(*seen), shape)
        slopes = (
            _norm(matmul(gain, ball(inverse[..., :n_u, :])).most) * (1.0 + 2.0 * slip)[..., None] * ROUND_UP
        )
        shift = np.einsum("bplx,bpx->bpl", gain.most, shifted[..., :n_u])
        shift += np.einsum("bpla,pa->bpl", _array(eq.sway_by_position(*seen), shape).most, self.gap.position)
        disturbance = _norm(matmul_most(self.approximation.scales, self._disturbance(near, shifted)))
        growth = self._growth(self._jacobian_change(near, Ball(0.0 * tube, tube)), inverse, slip)
        watched = slice(self.watched, None)
        return growth, disturbance, slopes[:, watched].max(axis=1), shift[:, watched].max(axis=1) * ROUND_UP

    def _state(self, near: Ball) -> tuple[list[Ball], ...]:
        """List everything that equations depend on where the true motions may be."""
        q_a, v = self._axes_on(1.0, 0, self.gap.position), self._axes_on(1.0, 1, self.gap.velocity)
        return _columns(near, 2), _columns(q_a, 1), _columns(v, 1), self._parameters(None)

    def _near(self, around: Ball, tube: Array) -> tuple[Ball, Array]:
        """Enclose x, and bound x − z; nan where a first guess of it was too small."""
        guess, shifted = np.zeros(around.shape), np.zeros(around.shape)
        for _ in range(2):
            near = Ball(around.mid, (around.rad + tube + guess) * ROUND_UP)
            state, ddq_a = self._state(near), _columns(self._axes_on(1.0, 2), 1)
            lift = _array(self.equations.lift(*state), near.shape[:2]).most
            pull = _array(self.equations.pull(*state, ddq_a), near.shape[:2]).most
            shifted = _times(lift, self.gap.position) + _times(pull, self.gap.integral)
            previous, guess = guess, 2.0 * shifted + 1e-14 * near.most
        near = Ball(np.where(shifted < previous, near.mid, np.nan), near.rad)
        return near, shifted * ROUND_UP

    def _jacobian_change(self, near: Ball, change: Ball) -> Ball:
        """Enclose how much J changes with x, and with the axes as far as they are off."""
        state, still = self._state(near), np.zeros(len(self.axes.halves.mid))
        nothing = [[Ball(still, still)] * len(column) for column in state[1:3]]
        parameters = [ball(0.0)] * len(state[3])
        rows = self.equations.jacobian_change(*state, _columns(change, 2), *nothing, parameters)
        return _array(rows, near.shape[:2])

    def _disturbance(self, near: Ball, shifted: Array) -> Array:
        """Bound r, what the setpoints make of the motion beside the smooth one, (boxes, pieces, 2 n_u)."""
        eq, gap, shape, state = self.equations, self.gap, near.shape[:2], self._state(near)
        ddq_a, jerk = (_columns(self._axes_on(1.0, order), 1) for order in (2, 3))
        lift = _array(eq.lift(*state), shape).most
        pull = _array(eq.pull(*state, ddq_a), shape).most
        jacobian = _array(eq.jacobian(*state), shape).most
        rate = [row[0] for row in eq.rate(*state)]
        both = np.concatenate([gap.position, gap.velocity], axis=1)
        squares = (both[:, :, None] * both[:, None, :]).reshape(len(both), -1)
        second = 0.5 * _times(_array(eq.curvature(*state), shape).most, squares)
        faster = _times(lift, gap.velocity) + _times(_array(eq.by_position(*state), shape).most, gap.position)
        faster = (faster + second) * ROUND_UP
        bent = self._jacobian_change(near, Ball(0.0 * shifted, shifted)).most
        turned = _array(eq.lift_change(*state, _columns(Ball(0.0 * faster, faster), 2)), shape).most
        changed = _array(eq.pull_change(*state, ddq_a, rate, jerk), shape).most
        found = _times(pull, gap.mean) + _times(changed, gap.integral) + _times(turned, gap.position) + second
        found += np.einsum("bpxy,bpy->bpx", jacobian, _times(pull, gap.integral))
        found += np.einsum("bpxy,bpy->bpx", bent, _times(lift, gap.position))
        return found * ROUND_UP

    def _turned(self) -> Ball:
        """Enclose S J S⁻¹ on the approximate motion itself, (boxes, pieces, 2 n_u, 2 n_u)."""
        a, c, ranges = self.approximation, self.axes.coefficients(), len(self.approximation.varied)
        x = self._at_nodes(a.coefficients, self.coarse)
        nodes = chebyshev.nodes(self.coarse[0])
        q_a = powers(c, nodes, 0)[..., None]
        v = powers(c, nodes, 1)[..., None] / self.axes.halves[:, None, None, None]
        p = self._parameters(self._places(self.coarse[1]))
        rows = self.equations.jacobian(_columns(x, 2), _columns(q_a, 2), _columns(v, 2), p)
        shape = (*x.shape[:2], *x.shape[3:])
        series = [[_series(_full(one, shape), ranges, self.coarse) for one in row] for row in rows]
        inside = stack(
            [stack([Ball(one.mid[..., 0, 0], _rest(one)) for one in row], -1) for row in series], -2
        )
        missed = self._missed(self._jacobian_on, self.coarse)
        return Ball(inside.mid, (inside.rad + missed) * ROUND_UP)

    def _jacobian_on(self, rho: float, rho_p: float) -> Array:
        x, p = self._range(rho, rho_p)[0], self._parameters(None, 0.5 * (rho_p + 1.0 / rho_p))
        q_a, v = self._axes_on(rho), self._axes_on(rho, 1)
        return _array(
            self.equations.jacobian(_columns(x, 2), _columns(q_a, 1), _columns(v, 1), p), x.shape[:2]
        ).most

    def _growth(self, turn: Ball, inverse: Array, slip: Array) -> Array:
        """Bound the logarithmic norm of S J S⁻¹, by Gershgorin's circles of its symmetric part."""
        scale = ball(self.approximation.scales)
        turned = matmul(matmul(scale, self._still + turn), ball(inverse))
        flipped = Ball(np.swapaxes(turned.mid, -1, -2), np.swapaxes(turned.rad, -1, -2))
        symmetric = 0.5 * (turned + flipped)
        sides = (symmetric.most * (1.0 - np.eye(scale.mid.shape[-1]))).sum(axis=-1)
        own = np.einsum("...ii->...i", symmetric.upper)
        whole = np.sqrt((turned.most**2).sum(axis=(-1, -2)))
        return np.asarray((own + sides).max(axis=-1) + whole * (2.0 * slip + 1e-12))

    @cached_property
    def _still(self) -> Ball:
        return self._turned()

    def _accumulated(self, growth: Array, source: Array, inverse: Array, slip: Array) -> tuple[Array, Array]:
        """Add errors up from piece to piece: the greatest, and the greatest while the sway counts."""
        a, lengths = self.approximation, 2.0 * self.axes.halves.most
        ends = a.coefficients.sum(axis=3)
        begins = (a.coefficients * (-1.0) ** np.arange(a.coefficients.shape[3])[:, None]).sum(axis=3)
        begin = begins[:, 0].copy()
        begin[..., 0] -= a.start
        leaps = np.concatenate([begin[:, None], begins[:, 1:] - ends[:, :-1]], axis=1)
        between = np.abs(leaps).sum(axis=-1) * ROUND_UP
        leap = _norm(matmul_most(a.scales, between))
        changed = np.ones(source.shape)
        product = matmul(ball(a.scales[:, 1:]), ball(inverse[:, :-1])).most
        sums = product.sum(axis=-1).max(axis=-1), product.sum(axis=-2).max(axis=-1)
        changed[:, 1:] = np.sqrt(sums[0] * sums[1]) * (1.0 + 2.0 * slip[:, :-1]) * ROUND_UP
        error, largest, counted = np.zeros((3, len(source)))
        for piece in range(source.shape[1]):
            error = (error * changed[:, piece] + leap[:, piece]) * ROUND_UP
            factor = np.exp(growth[:, piece] * lengths[piece])
            fed = source[:, piece] * lengths[piece] * np.maximum(factor, 1.0)
            highest = (error * np.maximum(factor, 1.0) + fed) * ROUND_UP
            error = (error * factor + fed) * ROUND_UP
            largest = np.maximum(largest, highest)
            if piece >= self.watched:
                counted = np.maximum(counted, highest)
        return largest, counted

    # the sway

    def _sway(self) -> tuple[Array, Array]:
        """Bound the approximate motions' sway, and give its greatest value at nodes, each (boxes, loads)."""
        watched, ranges = slice(self.watched, None), len(self.approximation.varied)
        n_u = self.approximation.coefficients.shape[2] // 2
        c = self.axes.coefficients()[:, watched]
        x = self._at_nodes(self.approximation.coefficients[:, watched, :n_u], self.fine)
        q_a = powers(c, chebyshev.nodes(self.fine[0]), 0)[..., None]
        p = self._parameters(self._places(self.fine[1]))
        found = self.equations.sway(_columns(x, 2), _columns(q_a, 2), p)
        shape = x[:, :, 0].shape
        seen = np.stack([np.abs(_full(row[0], shape).mid).max(axis=(1, 2, 3)) for row in found], axis=1)
        greatest = [_greatest(_full(row[0], shape), ranges, self.fine) for row in found]
        missed = self._missed(self._sway_on, self.fine)[:, watched]
        return (np.stack(greatest, axis=2) + missed).max(axis=1), seen

    def _sway_on(self, rho: float, rho_p: float) -> Array:
        n_u = self.approximation.coefficients.shape[2] // 2
        x = self._range(rho, rho_p)[0][..., :n_u]
        q_a, p = self._axes_on(rho), self._parameters(None, 0.5 * (rho_p + 1.0 / rho_p))
        return stack(
            [_full(row[0], x.shape[:2]) for row in self.equations.sway(_columns(x, 2), _columns(q_a, 1), p)],
            axis=2,
        ).most


def _columns(values: Ball, axis: int) -> list[Ball]:
    """Split along an axis."""
    mids, rads = (np.moveaxis(part, axis, 0) for part in (values.mid, values.rad))
    return [Ball(mid, rad) for mid, rad in zip(mids, rads, strict=True)]


def _array(rows: list[list[Ball]], shape: tuple[int, ...]) -> Ball:
    """Join nested rows to one array, the matrix' axes last."""
    return stack([stack([_full(one, shape) for one in row], axis=-1) for row in rows], axis=-2)


def _full(one: Ball, shape: tuple[int, ...]) -> Ball:
    return Ball(np.broadcast_to(one.mid, shape), np.broadcast_to(one.rad, shape))


def matmul_most(matrix: Array, sizes: Array) -> Array:
    """Bound a matrix times a vector whose entries have at most some sizes."""
    return np.asarray(np.einsum("...ij,...j->...i", np.abs(matrix), sizes) * ROUND_UP)


def _times(matrix: Array, sizes: Array) -> Array:
    """Bound matrices (boxes, pieces, rows, columns) times vectors (pieces, columns)."""
    return np.asarray(np.einsum("bpxa,pa->bpx", matrix, sizes))


def _norm(sizes: Array) -> Array:
    """Euclidean length."""
    return np.asarray(np.sqrt((sizes**2).sum(axis=-1)) * ROUND_UP)


def _series(values: Ball, ranges: int, counts: tuple[int, int]) -> Ball:
    """Interpolate values (…, time nodes, places); coefficients (…, time terms, parameter terms)."""
    over_p = chebyshev.tensor(chebyshev.coefficients_of(counts[1]), ranges)
    return matmul(chebyshev.coefficients_of(counts[0]), matmul(values, Ball(over_p.mid.T, over_p.rad.T)))


def _rest(series: Ball) -> Array:
    """Bound how far a series is from its first coefficient's midpoint."""
    return np.asarray(
        (series.most.sum(axis=(-1, -2)) - np.abs(series.mid[..., 0, 0])) * ROUND_UP
        + 1e-14 * series.most[..., 0, 0]
    )


def _greatest(values: Ball, ranges: int, counts: tuple[int, int]) -> Array:
    """Bound an interpolant closely: by sums over parameters, and by values over time."""
    c = _series(values, ranges, counts)
    terms = TIGHT_DEGREE + 1
    low = matmul(chebyshev.values_at_nodes(TIGHT_NODES, terms), c[..., :terms, :])
    rest = c[..., terms:, :].most.sum(axis=(-1, -2))
    peak = low.most.sum(axis=-1).max(axis=-1)
    return np.asarray((peak * chebyshev.between_nodes(TIGHT_NODES, TIGHT_DEGREE) + rest) * ROUND_UP)
