"""The proof: an approximate motion of many machines, and a bound on how far every true one is from it.

docs/certificate.md states the theorem and its proof; names here are those of that page. Nothing in here needs
to be believed of the approximation x̃: whatever it is, the bound holds. Piece by piece of time, the error e
of x̃ is bounded in the norm |S e| by::

    d|S e|/dt ≤ μ |S e| + |S| (|defect| + |r|)

1. `defect`: x̃' − f(x̃), at Chebyshev's nodes, and between them by what interpolation misses.
2. `_tubes`, wherever |S e| ≤ R: r (`_disturbance`) and μ (`_still`, `_growth`), logarithmic norm of S J S⁻¹
   (Söderlind, BIT 46, 2006).
3. `_accumulated`: the error from piece to piece. Where it is within the R that was assumed, it is proved;
   `_bounds` guesses R and makes it wider until it is.
4. `_sway`: the greatest sway of x̃, and by how much |S e| can change it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property, reduce
from operator import add
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.assurance.certificate.approximate_motions import Approximation
from gen_profile.assurance.certificate.arithmetic import balls, chebyshev
from gen_profile.assurance.certificate.arithmetic.affine import Affine
from gen_profile.assurance.certificate.arithmetic.balls import Array, Ball, ball, matmul, shared
from gen_profile.assurance.certificate.arithmetic.chebyshev import ROUND_UP
from gen_profile.assurance.certificate.arithmetic.matrices import (
    array,
    entries,
    gershgorin,
    matmul_most,
    norm,
    product,
    split,
    symmetric,
    times,
)
from gen_profile.assurance.certificate.axes.axis_motion import AxisMotion, Gap, powers, widened
from gen_profile.assurance.certificate.clearance import rooms
from gen_profile.assurance.certificate.equations import EnclosedEquations
from gen_profile.assurance.certificate.scaling import Scaling, affine_entries
from gen_profile.assurance.certificate.sway_limits import SwayBounds, WatchedSway
from gen_profile.spec.stacks import StackZone

TIME_NODES, FEW_TIME_NODES = 12, 8  # for the defect, and for what need not be as close
# more nodes than terms in each parameter, as what interpolation misses is bounded roughly; fewer of few terms
MORE_NODES, FEW_MORE_NODES, FEW_TERMS = 4, 2, 5
ELLIPSES = (1.7, 2.5, 3.5, 5.0, 7.0, 10.0, 14.0, 20.0, 30.0)  # ρ
PORTION = 2**16  # numbers in an array over nodes, which a processor's cache holds
HOPELESS = 0.02  # error of a motion as a share of its size, without its growth: no proof is tried
SMALLEST_STATE = 1e-6  # m or rad and their rates: the size of a motion that is smaller, or none
FIRST_GUESS, WIDER, ATTEMPTS = 1e-4, 1.5, 8  # how far a motion is off, as a share of its size, and then


def nodes_for(terms: int) -> int:
    """Tell how many nodes of a parameter it takes for so many terms."""
    return terms + (FEW_MORE_NODES if terms <= FEW_TERMS else MORE_NODES)


@attrs.frozen(kw_only=True, eq=False)
class Enclosure:
    """One batch of boxes.

    Attributes
    ----------
    equations : EnclosedEquations
    axes : AxisMotion
    gap : Gap
        How far the axes are from `axes`.
    watches : tuple of WatchedSway
    approximation : Approximation
    zones : tuple of StackZone
        Where bodies may not be, at any time.
    """

    equations: EnclosedEquations
    axes: AxisMotion
    gap: Gap
    watches: tuple[WatchedSway, ...]
    approximation: Approximation
    zones: tuple[StackZone, ...] = ()

    @property
    def variables(self) -> int:
        """Time and parameters."""
        return 1 + len(self.approximation.varied)

    @property
    def fine(self) -> tuple[int, ...]:
        """Nodes in time and in each parameter."""
        return TIME_NODES, *map(nodes_for, self.approximation.series.shape[4:])

    @property
    def coarse(self) -> tuple[int, ...]:
        """Nodes where fewer in time will do."""
        return FEW_TIME_NODES, *map(nodes_for, self.approximation.series.shape[4:])

    def bounds(self, targets: Array) -> SwayBounds:
        """Carry the proof out.

        Parameters
        ----------
        targets : (watches,) array
            Bounds in m below which lower ones are not sought; a clearance takes none.
        """
        with np.errstate(all="ignore"):  # what is not finite proves nothing
            return self._bounds(targets)

    def _bounds(self, targets: Array) -> SwayBounds:
        defect = self.defect()
        scaling = self.approximation.scaling
        source = norm(matmul_most(scaling.most, defect))
        size = norm(matmul_most(scaling.most, self._around.most))
        least = norm(matmul_most(scaling.most, np.full((1, 1, self._around.shape[-1]), SMALLEST_STATE)))
        most = np.maximum(size, least).max(axis=1, keepdims=True)
        off, still = (
            np.full((*size.shape, n), np.nan) for n in (self.equations.sway.rows, self._around.shape[-1])
        )
        promising = (self._accumulated(0.0 * source, source) <= HOPELESS * most).all(axis=1)
        if promising.any():
            still[promising] = self._of(np.flatnonzero(promising))._still
        reach = WIDER * self._accumulated(still.max(axis=-1), source) + FIRST_GUESS * most
        waiting = np.flatnonzero((reach <= most).all(axis=1))
        for _ in range(ATTEMPTS):
            if not waiting.size:
                break
            some = self._of(waiting)
            s = some.approximation.scaling
            tube = reach[waiting, :, None] * norm(s.inverse_most) * s.slack[..., None]
            growth, disturbance, slopes, shift = some._tubes(tube * ROUND_UP, still[waiting])
            error = some._accumulated(growth, source[waiting] + disturbance)
            closed = (error <= reach[waiting]).all(axis=1)
            off[waiting[closed]] = ((slopes * error[..., None] + shift) * ROUND_UP)[closed]
            reach[waiting] = WIDER * error
            waiting = waiting[~closed & (reach[waiting] <= most[waiting]).all(axis=1)]
        return self._sway(off, targets)

    def _of(self, rows: NDArray[np.intp]) -> Enclosure:
        """Take some of the boxes."""
        a = self.approximation
        if len(rows) == len(a.series):
            return self
        approximation = attrs.evolve(
            a,
            lower=a.lower[rows],
            upper=a.upper[rows],
            series=a.series[rows],
            scaling=Scaling(series=a.scaling.series[rows]),
        )
        return attrs.evolve(self, approximation=approximation)

    # the approximation

    @cached_property
    def _around(self) -> Ball:
        """Enclose x̃, (boxes, pieces, 2 n_u)."""
        return chebyshev.spread(self.approximation.series, self.variables)

    def _ellipses(self) -> tuple[Array, Array]:
        """List ρ and half-axes of each variable's ellipses, all others real, each (ellipses, variables)."""
        each = np.ones((self.variables, len(ELLIPSES), self.variables))
        for variable in range(self.variables):
            each[variable, :, variable] = ELLIPSES
        rho = each.reshape(-1, self.variables)
        return rho, 0.5 * (rho + 1.0 / rho)

    @cached_property
    def _range(self) -> Ball:
        """Enclose x̃ on ellipses, (ellipses, boxes, pieces, 2 n_u)."""
        series, rho = self.approximation.series, self._ellipses()[0]
        total = chebyshev.weighted(series, chebyshev.weights(rho, series.shape[3:]))
        middle = self._around.mid
        return Ball(middle, (total - np.abs(middle)) * ROUND_UP + 1e-15 * total)

    def _portions(self, counts: tuple[int, ...]) -> Iterator[slice]:
        """Split pieces, so that arrays over their nodes are small."""
        boxes, pieces = self.approximation.series.shape[:2]
        step = max(1, PORTION // (boxes * int(np.prod(counts))))
        for first in range(0, pieces, step):
            yield slice(first, min(first + step, pieces))

    def _state_at(self, counts: tuple[int, ...], rows: slice) -> tuple[list[Any], ...]:
        """List all that equations depend on, at nodes of some pieces: each (boxes, pieces, nodes …)."""
        x = chebyshev.evaluated(self.approximation.series[:, rows], counts)
        return split(x, 2), *self._axes_at(counts[0], rows), self._parameters_at(counts[1:])

    def _axes_at(self, count: int, rows: slice) -> tuple[list[Ball], list[Ball]]:
        """Position and velocity of the smooth motion at nodes of time."""
        c, nodes = self.axes.coefficients()[:, rows], chebyshev.nodes(count)
        last = (1,) * (self.variables - 1)

        def columns(values: Ball) -> list[Ball]:
            each = (one.reshape(1, *one.shape, *last) for one in split(values, -1))
            return [shared(one, tuple(range(2, 2 + self.variables))) for one in each]

        rate = powers(c, nodes, 1) / self.axes.halves[rows, None, None]
        return columns(powers(c, nodes, 0)), columns(rate)

    def _parameters_at(self, counts: tuple[int, ...]) -> list[Ball]:
        """All parameters at nodes of those that vary."""
        a, size = self.approximation, self.variables
        parameters: list[Ball] = [ball(value) for value in a.nominal.tolist()]
        for column, (number, count) in enumerate(zip(a.varied, counts, strict=True)):
            middle, half = (part.reshape(-1, *[1] * (1 + size)) for part in self._middle(column))
            nodes = chebyshev.nodes(count).reshape(*[1] * (3 + column), -1, *[1] * (size - 2 - column))
            parameters[number] = shared(middle + half * nodes, tuple(range(2, 2 + size)))
        return parameters

    def _middle(self, column: int) -> tuple[Ball, Ball]:
        """Give the middle and the half-width of a range of every box."""
        low, high = self.approximation.lower[:, column], self.approximation.upper[:, column]
        return 0.5 * (low + high), 0.5 * (high - low)

    def _parameters(self, far: Mapping[int, Array] | None = None) -> list[Ball | Affine]:
        """All parameters: of whole boxes, (boxes, 1), or as far out as ellipses, (ellipses, boxes, 1)."""
        parameters: list[Ball | Affine] = [ball(value) for value in self.approximation.nominal.tolist()]
        far = dict.fromkeys(self._symbols, np.ones(())) if far is None else far
        for k, number in enumerate(self.approximation.varied):
            middle, half = (part[:, None] for part in self._middle(k))
            rad = (middle.rad + half.rad * far[k]) * ROUND_UP
            parameters[number] = Affine(middle.mid, {k: half.mid}, rad, far)
        return parameters

    @property
    def _symbols(self) -> range:
        """Number what parameters depend on."""
        return range(len(self.approximation.varied))

    @cached_property
    def _state_on_ellipses(self) -> tuple[list[Any], ...]:
        """List all that equations depend on, on ellipses: each (ellipses, boxes, pieces).

        All of it is linear in polynomials of fewer degrees than there are nodes (of the parameters, and where
        nodes are `fine` of time, too). These are interpolated exactly, so that only what is nonlinear in them
        counts for what interpolation misses (`Affine.beyond`).
        """
        wide = self._ellipses()[1]
        far = {k: wide[:, 1 + k, None, None] for k in self._symbols}
        parameters, state = self._parameters(far), list[list[Affine]]()
        axes = (self._axes_on(wide[:, :1, None, None], order) for order in (0, 1))
        for column in (self._range, *axes):
            state.append([])
            for one in split(column, -1):
                far[len(far)] = one.rad
                state[-1].append(Affine(one.mid, {len(far) - 1: np.ones(())}, np.zeros(()), far))
        return *state, parameters

    def _interpolation_error(self, most: Array, counts: tuple[int, ...]) -> Array:
        """Bound what interpolation misses, by what there is at most on ellipses, (ellipses, boxes, …)."""
        most = most.reshape(self.variables, len(ELLIPSES), *most.shape[1:])
        return chebyshev.interpolation_error(most, ELLIPSES, counts)

    def _axes_on(self, reach: Array | float, order: int = 0, off: Array | None = None) -> Ball:
        """Enclose a derivative of the axes' smooth motion on ellipses, and what is as near, (pieces, m)."""
        values = widened(self.axes.coefficients(), reach, order)
        for _ in range(order):
            values = values / self.axes.halves[:, None]
        return values if off is None else Ball(values.mid, (values.rad + off) * ROUND_UP)

    def defect(self) -> Array:
        """Bound x̃' − f(x̃), (boxes, pieces, 2 n_u)."""
        series, half = self.approximation.series, self.axes.halves
        slopes = np.moveaxis(np.tensordot(series, chebyshev.derivative(series.shape[3]), axes=(3, 1)), -1, 3)
        defects = []
        for rows in self._portions(self.fine):
            dx = split(chebyshev.evaluated(slopes[:, rows], self.fine), 2)
            f = self.equations.rate(*self._state_at(self.fine, rows))
            step = half[rows].reshape(-1, *[1] * self.variables)
            each = (
                self._whole(rate / step - row[0], self.fine, rows) for rate, row in zip(dx, f, strict=True)
            )
            sums = [chebyshev.total(*chebyshev.interpolated(one, self.variables)) for one in each]
            defects.append(np.stack(sums, axis=2))
        f = self.equations.rate.evaluated(*self._state_on_ellipses)
        shape = self._range.shape[:3]
        remainder = np.stack([np.broadcast_to(row[0].rad, shape) for row in f], axis=-1)
        return np.concatenate(defects, axis=1) + self._interpolation_error(remainder, self.fine)

    def _whole(self, values: Ball, counts: tuple[int, ...], rows: slice) -> Ball:
        """Give values at nodes, of which some may be alike, their full shape."""
        shape = self.approximation.series[:, rows].shape[:2]
        mid = np.broadcast_to(values.mid, (*shape, *counts))
        return Ball(mid, np.broadcast_to(values.rad, (*shape, *[1] * self.variables)))

    # the error

    def _tubes(self, tube: Array, still: Array) -> tuple[Array, Array, Array, Array]:
        """Bound what depends on where the true motions are: within a tube around the approximate ones.

        `still` is `_still` of these boxes.

        Returns
        -------
        growth, disturbance : (boxes, pieces) arrays
            Logarithmic norm in 1/s, and what setpoints add.
        slopes, shift : (boxes, pieces, loads) arrays
            Sway per error, and what setpoints add.
        """
        eq, around, scaling = self.equations, self._around, self.approximation.scaling
        shape, p = around.shape[:2], self._parameters()
        near, shifted = self._near(around, tube)
        n_u = around.shape[-1] // 2
        arguments = split(near[..., :n_u], -1), split(self._axes_on(1.0, 0, self.gap.position), -1), p
        gain = array(eq.sway_slopes(*arguments), shape)
        back = chebyshev.spread(scaling.inverse, scaling.variables)[:, :, :n_u]
        slopes = norm(matmul(gain, back).most) * scaling.slack[..., None] * ROUND_UP
        shift = np.einsum("bplx,bpx->bpl", gain.most, shifted[..., :n_u])
        shift += np.einsum(
            "bpla,pa->bpl", array(eq.sway_by_position(*arguments), shape).most, self.gap.position
        )
        disturbance = self._disturbance(near, shifted)
        growth = self._growth(near, tube, still)
        return growth, disturbance, slopes, shift * ROUND_UP

    def _state(self, near: Ball) -> tuple[list[Any], ...]:
        """List everything that equations depend on where the true motions may be."""
        q_a, v = self._axes_on(1.0, 0, self.gap.position), self._axes_on(1.0, 1, self.gap.velocity)
        return split(near, -1), split(q_a, -1), split(v, -1), self._parameters()

    def _near(self, around: Ball, tube: Array) -> tuple[Ball, Array]:
        """Enclose x, and bound x − z; nan where a first guess of it was too small."""
        guess, shifted = np.zeros(around.shape), np.zeros(around.shape)
        for _ in range(2):
            near = Ball(around.mid, (around.rad + tube + guess) * ROUND_UP)
            state, ddq_a = self._state(near), split(self._axes_on(1.0, 2), -1)
            lift = array(self.equations.lift(*state), near.shape[:2]).most
            pull = array(self.equations.pull(*state, ddq_a), near.shape[:2]).most
            shifted = times(lift, self.gap.position) + times(pull, self.gap.integral)
            previous, guess = guess, 2.0 * shifted + 1e-14 * near.most
        near = Ball(np.where(shifted < previous, near.mid, np.nan), near.rad)
        return near, shifted * ROUND_UP

    def _jacobian_change(self, near: Ball, change: Ball) -> Ball:
        """Enclose how much J changes with x."""
        return array(self.equations.jacobian_change(*self._state(near), split(change, -1)), near.shape[:2])

    def _disturbance(self, near: Ball, shifted: Array) -> Array:
        """Bound the mean over each piece of |S r|, r being what the setpoints add, (boxes, pieces).

        Each term of r is a vector that is bounded over the piece, times a function of time of known mean;
        the mean of a sum's length is at most the sum of these.
        """
        eq, gap, shape, state = self.equations, self.gap, near.shape[:2], self._state(near)
        ddq_a, jerk = (split(self._axes_on(1.0, order), -1) for order in (2, 3))
        lift = array(eq.lift(*state), shape).most
        pull = array(eq.pull(*state, ddq_a), shape).most
        jacobian = array(eq.jacobian(*state), shape).most
        rate = [row[0] for row in eq.rate(*state)]
        both = np.concatenate([gap.position, gap.velocity], axis=1)
        curvature = 0.5 * array(eq.curvature(*state), shape).most
        faster = times(lift, gap.velocity) + times(array(eq.by_position(*state), shape).most, gap.position)
        faster += times(curvature, (both[:, :, None] * both[:, None, :]).reshape(len(both), -1))
        bent = self._jacobian_change(near, Ball(0.0 * shifted, shifted)).most
        faster = faster * ROUND_UP
        lifted = array(eq.lift_change(*state, split(Ball(0.0 * faster, faster), -1)), shape).most
        changed = array(eq.pull_change(*state, ddq_a, rate, jerk), shape).most
        vectors = [pull, changed + jacobian @ pull, lifted + bent @ lift, curvature]
        squares = gap.mean_squares.reshape(len(both), -1)
        means = np.concatenate([gap.mean, gap.mean_integral, gap.mean_position, squares], axis=1)
        lengths = norm(np.swapaxes(self.approximation.scaling.most @ np.concatenate(vectors, axis=3), 2, 3))
        return np.asarray(np.einsum("bpk,pk->bp", lengths, means) * ROUND_UP)

    @cached_property
    def _still(self) -> Array:
        """Bound the growth of errors on the approximate motions themselves, as `_gershgorin` does."""
        a, counts = self.approximation, self.coarse
        scaling, size = a.scaling, a.series.shape[2]
        to, back = (chebyshev.evaluated(s, counts[1:]) for s in (scaling.series, scaling.inverse))
        far = symmetric(self._turned_on_ellipses())
        mid, rad = np.empty((2, *self._around.shape[:2], size, size))
        for rows in self._portions(counts):
            jacobian = self.equations.jacobian(*self._state_at(counts, rows))
            transformed = symmetric(product(product(entries(to, rows), jacobian), entries(back, rows)))
            for i, j in zip(*np.tril_indices(size), strict=True):
                whole = self._whole(transformed[i][j], counts, rows)
                series, off = chebyshev.interpolated(whole, self.variables)
                first = chebyshev.first(series, self.variables)
                rest = chebyshev.total(series, off) - np.abs(first)
                mid[:, rows, i, j], rad[:, rows, i, j] = first, rest * ROUND_UP
        for i, j in zip(*np.tril_indices(size), strict=True):
            rad[..., i, j] += self._interpolation_error(self._missed_by_few(far[i][j]), counts)
            mid[..., j, i], rad[..., j, i] = mid[..., i, j], rad[..., i, j]
        return gershgorin(Ball(mid, (rad + 1e-14 * np.abs(mid)) * ROUND_UP))

    def _missed_by_few(self, value: Affine) -> Array:
        """Bound what is not interpolated exactly where nodes of time are few: all that changes in time."""
        shape, times = self._range.shape[:3], len(ELLIPSES)
        over_time, over_parameters = (
            np.broadcast_to(one, shape) for one in (value.beyond(self._symbols), value.rad)
        )
        return np.concatenate([over_time[:times], over_parameters[times:]])

    def _turned_on_ellipses(self) -> list[list[Affine]]:
        """Enclose S J S⁻¹ on ellipses, each entry (ellipses, boxes, pieces)."""
        scaling, state = self.approximation.scaling, self._state_on_ellipses
        rho, far = self._ellipses()[0][:, 1:], state[0][0].reach
        to, back = (affine_entries(series, rho, far) for series in (scaling.series, scaling.inverse))
        return product(product(to, self.equations.jacobian.evaluated(*state)), back)

    def _growth(self, near: Ball, tube: Array, still: Array) -> Array:
        """Bound the logarithmic norm of S J S⁻¹ within a tube, (boxes, pieces)."""
        scaling = self.approximation.scaling
        jacobian = array(self.equations.jacobian(*self._state(near)), near.shape[:2]).most
        change = self._jacobian_change(near, Ball(0.0 * tube, tube)).most
        transformed, beside = (scaling.most @ one @ scaling.inverse_most for one in (jacobian, change))
        symmetric = 0.5 * (beside + np.swapaxes(beside, -1, -2))
        rows = still + gershgorin(Ball(np.zeros_like(symmetric), symmetric))
        whole = np.sqrt(((transformed + beside) ** 2).sum(axis=(-1, -2)))
        return np.asarray((rows.max(axis=-1) + whole * (2.0 * scaling.slip + 1e-12)) * ROUND_UP)

    def _accumulated(self, growth: Array, source: Array) -> Array:
        """Add errors up from piece to piece: the greatest on each, (boxes, pieces)."""
        a, lengths = self.approximation, 2.0 * self.axes.halves.most
        signs = (-1.0) ** np.arange(a.series.shape[3])
        ends = a.series.sum(axis=3)
        at_start = np.tensordot(a.series, signs, axes=(3, 0))
        start = np.zeros((len(at_start), 1, len(a.start), at_start[0, 0, 0].size))
        start[..., 0] = a.start
        before = np.concatenate([start.reshape(at_start[:, :1].shape), ends[:, :-1]], axis=1)
        between = np.abs(at_start - before).sum(axis=tuple(range(3, at_start.ndim))) * ROUND_UP
        leap = norm(matmul_most(a.scaling.most, between))
        changed = a.scaling.changes(len(lengths))
        error, greatest = np.zeros(len(source)), np.zeros(source.shape)
        for piece in range(source.shape[1]):
            error = (error * changed[:, piece] + leap[:, piece]) * ROUND_UP
            factor = np.exp(growth[:, piece] * lengths[piece])
            fed = source[:, piece] * lengths[piece] * np.maximum(factor, 1.0)
            greatest[:, piece] = (error * np.maximum(factor, 1.0) + fed) * ROUND_UP
            error = (error * factor + fed) * ROUND_UP
        return greatest

    # the sway

    def _sway(self, off: Array, targets: Array) -> SwayBounds:
        """Bound every sway that is watched; approximate ones are off by so much, (boxes, pieces, loads)."""
        n_u = self.approximation.series.shape[2] // 2
        begun = 0 if self.zones else min(watch.first for watch in self.watches)
        pieces = slice(begun, None)
        x, q_a, _, p = self._state_at(self.fine, pieces)
        at_nodes = [self._whole(row[0], self.fine, pieces) for row in self.equations.sway(x[:n_u], q_a, p)]
        x, q_a, _, p = self._state_on_ellipses
        far = [row[0] for row in self.equations.sway.evaluated(x[:n_u], q_a, p)]
        bounds, largest_met = np.zeros((2, len(off), len(self.watches)))
        for column, watch in enumerate(self.watches):
            loads, since = watch.loads, slice(watch.first - begun, None)
            away = norm(off[:, watch.first :, loads]).max(axis=1)
            bounds[:, column], largest_met[:, column] = self._greatest(
                [one[:, since] for one in at_nodes[loads]], far[loads], watch.first, targets[column] - away
            )
            bounds[:, column] = (bounds[:, column] + away) * ROUND_UP
        if self.zones:
            nearer, met = self._nearer(at_nodes, far, off)
            bounds, largest_met = np.column_stack([bounds, nearer]), np.column_stack([largest_met, met])
        return SwayBounds(sway=bounds, largest_met=largest_met)

    def _nearer(self, at_nodes: list[Ball], far: list[Affine], off: Array) -> tuple[Array, Array]:
        """Bound by how much less than they must bodies are away from zones, and tell what is met, in m."""
        shape, bodies = self._range.shape[:3], 1 + max(zone.body for zone in self.zones)
        sways = max(watch.loads.stop for watch in self.watches)
        each = []
        for row in range(sways, sways + 3 * bodies):
            series, rounding = chebyshev.interpolated(at_nodes[row], self.variables)
            interpolation = self._interpolation_error(np.broadcast_to(far[row].rad, shape), self.fine)
            each.append((series, (rounding + interpolation + off[:, :, row]) * ROUND_UP))
        bounds, met = rooms(each, self.zones)
        return np.maximum(-bounds, 0.0), np.maximum(-met, 0.0)

    def _greatest(
        self, at_nodes: list[Ball], far: list[Affine], first: int, targets: Array
    ) -> tuple[Array, Array]:
        """Bound a vector of the approximate motions, and give its greatest length at nodes, each (boxes,).

        Of several components the squared length is interpolated, which is as smooth as they are.
        """
        power = 1 if len(at_nodes) == 1 else 2
        whole, beyond = (reduce(add, (balls.power(one, power) for one in each)) for each in (at_nodes, far))
        remainder = np.broadcast_to(beyond.rad, self._range.shape[:3])[:, :, first:]
        series, rounding = chebyshev.interpolated(whole, self.variables)
        off = rounding + self._interpolation_error(remainder, self.fine)
        targets = np.maximum(targets, 0.0) ** power
        bounds = [chebyshev.greatest(*one) for one in zip(series, off, targets.tolist(), strict=True)]
        largest_met = np.abs(whole.mid).max(axis=tuple(range(1, whole.mid.ndim)))
        return np.array(bounds) ** (1.0 / power) * ROUND_UP, largest_met ** (1.0 / power)
