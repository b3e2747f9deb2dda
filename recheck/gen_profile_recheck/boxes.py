"""A box of machines and their approximate motions, and bounds of what depends on these over a piece of time.

A function of time τ and of parameters u, each on [−1, 1], is expanded as a power series of τ at Chebyshev's
nodes of u, in balls. What N terms miss is at most M R⁻ᴺ/(1 − 1/R), with M its bound for |τ| ≤ R (Cauchy);
what N nodes of one parameter miss, 4 M ρ⁻ᴺ/(1 − 1/ρ), with M its bound on the ellipse with foci ±1 and sum of
half-axes ρ (Bernstein; Trefethen, theorem 8.2), times 1 + 2/π ln N for each parameter before it (Rivlin).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from itertools import product
from math import isfinite, log, pi, prod
from types import SimpleNamespace
from typing import Any

from flint import acb, arb, arb_mat, arb_poly, arb_series, ctx

from gen_profile_recheck.axes import AxisPiece
from gen_profile_recheck.machines import Machine

DISCS = (1.3, 1.6, 2.0, 2.5, 3.1, 3.8, 4.8)  # R
ELLIPSES = (1.5, 2.0, 2.8, 3.8, 4.8, 5.8, 6.8, 8.0, 9.5, 12.0, 16.0, 24.0)  # ρ
Values = list[Any]


@dataclass
class MachineState:
    """All that equations depend on: state and slope, axes with derivatives, constants, parameters' places."""

    x: Values
    slope: Values
    axes: Sequence[Values]  # position, velocity, acceleration, jerk
    k: SimpleNamespace
    places: Values
    key: Any  # of these places


Function = Callable[[MachineState], Values]


@dataclass(frozen=True)
class Expansion:
    """A function of time and parameters: coefficients of Chebyshev's polynomials, how many, and the rest."""

    coefficients: arb_mat
    counts: tuple[int, ...]
    rest: arb

    @property
    def size(self) -> arb:
        """Bound its absolute value."""
        return sum(map(abs, self.coefficients.entries()), start=self.rest).abs_upper()

    @property
    def ball(self) -> arb:
        """Enclose it."""
        first = self.coefficients[0, 0]
        return first + arb(0, 1) * (self.size - abs(first)).abs_upper()


def wide(size: Any) -> arb:
    """Give all real numbers up to a size."""
    return arb(0, 1) * arb(size).abs_upper()


def _disc(center: Any, radius: Any) -> acb:
    return acb(arb(center) + wide(radius), wide(radius))


@cache
def chebyshev(count: int) -> arb_mat:
    """Matrix from Chebyshev coefficients to powers: column k has those of T_k."""
    rows = (
        [arb_poly.chebyshev_t(k) for k in range(count)] if hasattr(arb_poly, "chebyshev_t") else _polys(count)
    )
    return arb_mat(count, count, [poly[row] for row in range(count) for poly in rows])


def _polys(count: int) -> list[arb_poly]:
    polynomials, x = [arb_poly([1]), arb_poly([0, 1])], arb_poly([0, 1])
    while len(polynomials) < count:
        polynomials.append(2 * x * polynomials[-1] - polynomials[-2])
    return polynomials[:count]


@cache
def powers(count: int) -> arb_mat:
    """Matrix from powers to Chebyshev coefficients."""
    return chebyshev(count).inv()


def _t(degree: int, x: Any) -> Any:
    before, now = 1, x
    if degree == 0:
        return arb(1)
    for _ in range(degree - 1):
        before, now = now, 2 * x * now - before
    return now


@cache
def nodes(count: int) -> list[arb]:
    """Chebyshev's nodes."""
    return [(arb.pi() * (2 * j + 1) / (2 * count)).cos() for j in range(count)]


@cache
def node_values(terms: tuple[int, ...], counts: tuple[int, ...]) -> arb_mat:
    """Matrix with the products of Chebyshev's polynomials of all parameters at all nodes, (terms, nodes)."""
    each = [
        [[_t(i, x) for x in nodes(count)] for i in range(number)]
        for number, count in zip(terms, counts, strict=True)
    ]
    return _products(each, terms, counts)


@cache
def interpolation(counts: tuple[int, ...]) -> arb_mat:
    """Matrix from values at nodes (in rows) to coefficients."""
    each = [
        [[_t(i, nodes(n)[j]) * (1 if i == 0 else 2) / n for i in range(n)] for j in range(n)] for n in counts
    ]
    return _products(each, counts, counts)


def _products(each: Sequence[Any], rows: Sequence[int], columns: Sequence[int]) -> arb_mat:
    entries = []
    for row in product(*map(range, rows)):
        for column in product(*map(range, columns)):
            entry = arb(1)
            for matrix, i, j in zip(each, row, column, strict=True):
                entry *= matrix[i][j]
            entries.append(entry)
    return arb_mat(prod(rows), prod(columns), entries)


@dataclass
class MachineBox:
    """Machines whose parameters lie in a part of their ranges.

    `parts`: of every range how often it was halved, and which part it is; `terms`: of series in each.
    """

    machine: Machine
    nominal: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]
    parts: Sequence[tuple[int, int]]
    terms: tuple[int, ...]
    _constants: dict[Any, SimpleNamespace] = field(default_factory=dict)
    _best: dict[Any, int] = field(default_factory=dict)

    def constants(self, places: Sequence[Any], key: Any) -> SimpleNamespace:
        """Give the machine's constants at places of its parameters."""
        if key not in self._constants:
            p: dict[str, Any] = {name: arb(value) for name, value in self.nominal.items()}
            for (name, (low, high)), (level, index), u in zip(
                self.ranges.items(), self.parts, places, strict=True
            ):
                p[name] = low + (arb(high) - low) * (index + (u + 1) / 2) / 2**level
            self._constants[key] = self.machine.constants(p)
        return self._constants[key]

    def grid(self, counts: tuple[int, ...]) -> Iterator[tuple[arb, ...]]:
        """List the nodes of all parameters."""
        return product(*map(nodes, counts))

    def ellipse(self, chosen: int, rho: float) -> Values:
        """Let one parameter be on an ellipse, and all others real."""
        return [
            _disc(0, (arb(rho) + 1 / arb(rho)) / 2) if number == chosen else acb(wide(1))
            for number in range(len(self.terms))
        ]

    def interpolation_error(
        self, counts: tuple[int, ...], first: Sequence[arb], key: Any, at: Callable[[int, float], Values]
    ) -> list[arb]:
        """Bound what interpolation misses of functions that are off by `first` at nodes, and `at` around."""
        error, amplified = [arb(0)] * len(first), arb(1)
        for number, count in enumerate(counts):
            bounds = self.least((key, number), ELLIPSES, partial(_beyond, at, number, count))
            error = [one + amplified * bound for one, bound in zip(error, bounds, strict=True)]
            amplified *= 1 + 2 / pi * log(count) + 1e-9
        return [one + amplified * late for one, late in zip(error, first, strict=True)]

    def least(self, key: Any, choices: Sequence[float], bounds: Callable[[float], list[arb]]) -> list[arb]:
        """Bound functions by the best of some choices: those beside what was best the last time."""
        tried: dict[int, list[arb]] = {}
        sums: dict[int, float] = {}
        place = self._best.get(key, len(choices) // 3)
        while True:
            for n in range(max(0, place - 1), min(place + 2, len(choices))):
                if n not in tried:
                    tried[n] = bounds(choices[n])
                    sums[n] = sum(map(float, tried[n]))
            known = [n for n, total in sums.items() if isfinite(total)]
            best = min(known, key=sums.__getitem__) if known else max(0, place - 2)
            if best == place or (not known and 0 in tried):
                self._best[key] = best
                return [_least(row) for row in zip(*tried.values(), strict=True)]
            place = best

    def polynomials(
        self, function: Callable[[Values, Any], Values], counts: tuple[int, ...]
    ) -> list[arb_mat]:
        """Expand polynomials of the parameters, of degrees below these, a row of coefficients each."""
        at_nodes = [function(list(u), (counts, number)) for number, u in enumerate(self.grid(counts))]
        rows = zip(*at_nodes, strict=True)
        return [arb_mat(1, len(row), [arb(one) for one in row]) * interpolation(counts) for row in rows]


def _beyond(at: Callable[[int, float], Values], number: int, count: int, rho: float) -> list[arb]:
    return [4 * one / arb(rho) ** count / (1 - 1 / arb(rho)) for one in at(number, rho)]


def _least(bounds: Sequence[arb]) -> arb:
    known = [one.abs_upper() for one in bounds if one.is_finite()]
    return min(known, key=float) if known else arb("inf")


def spread_of(value: Any) -> arb:
    """Bound how far a value is from a constant, of which an expansion misses nothing."""
    known = acb(value)
    return abs(known - known.mid()).abs_upper()


@dataclass
class MotionPiece:
    """A box's approximate motions on a piece of time: of every coordinate (time × parameter) terms."""

    box: MachineBox
    half: arb
    axes: Sequence[AxisPiece]
    series: Sequence[arb_mat]

    @cached_property
    def _in_powers(self) -> list[arb_mat]:
        return [chebyshev(one.nrows()) * one for one in self.series]

    @cached_property
    def _sizes(self) -> list[list[list[arb]]]:
        return [[[abs(one) for one in row] for row in series.tolist()] for series in self.series]

    def _axes_at(self, kind: Callable[[arb_poly], Any]) -> list[Values]:
        values, polynomials, scale = [], [one.smooth for one in self.axes], arb(1)
        for _ in range(4):
            values.append([kind(one) * scale for one in polynomials])
            polynomials, scale = [one.derivative() for one in polynomials], scale / self.half
        return values

    def _balls(
        self, tube: Sequence[Any], time: Sequence[arb], change: Sequence[arb], weights: Sequence[arb]
    ) -> Any:
        """Bound the motions and their slopes where terms have at most these weights."""
        x, slope = [], []
        for sizes, series, off in zip(self._sizes, self.series, tube, strict=True):
            summed = [sum((a * b for a, b in zip(row, weights, strict=True)), start=arb(0)) for row in sizes]
            total = sum((a * b for a, b in zip(summed, time, strict=True)), start=arb(0))
            x.append((series[0, 0], total - abs(series[0, 0]) + off))
            slope.append(sum((a * b for a, b in zip(summed, change, strict=True)), start=arb(0)) / self.half)
        return x, slope

    def on_disc(self, radius: float, tube: Sequence[Any]) -> MachineState:
        """Take complex times up to a radius, and all real parameters."""
        r, count = arb(radius), self.series[0].nrows()
        rows = [[abs(one) for one in row] for row in chebyshev(count).transpose().tolist()]
        time = [sum((c * r**j for j, c in enumerate(row)), start=arb(0)) for row in rows]
        change = [sum((j * c * r ** (j - 1) for j, c in enumerate(row) if j), start=arb(0)) for row in rows]
        x, slope = self._balls(tube, time, change, [arb(1)] * self.series[0].ncols())
        places = [acb(wide(1)) for _ in self.box.terms]

        def kind(poly: arb_poly) -> acb:
            rest = sum((abs(c) * r**j for j, c in enumerate(poly.coeffs()) if j), start=arb(0))
            return _disc(poly[0], rest)

        k = self.box.constants(places, "all, complex")
        states, slopes = [_disc(*one) for one in x], [_disc(0, one) for one in slope]
        return MachineState(states, slopes, self._axes_at(kind), k, places, "all, complex")

    def on_ellipse(self, chosen: int, rho: float, tube: Sequence[Any]) -> MachineState:
        """Take one parameter on an ellipse, all others and time real."""
        count = self.series[0].nrows()
        weights = [arb(rho) ** degrees[chosen] for degrees in product(*map(range, self.box.terms))]
        x, slope = self._balls(tube, [arb(1)] * count, [arb(j * j) for j in range(count)], weights)
        places, real = self.box.ellipse(chosen, rho), self._axes_at(_range)
        k = self.box.constants(places, (chosen, rho))
        axes = [[acb(one) for one in row] for row in real]
        states, slopes = [_disc(*one) for one in x], [_disc(0, one) for one in slope]
        return MachineState(states, slopes, axes, k, places, (chosen, rho))

    def everywhere(self, tube: Sequence[Any]) -> MachineState:
        """Take all times and parameters at once, in real balls."""
        count = self.series[0].nrows()
        ones = [arb(1)] * self.series[0].ncols()
        x, slope = self._balls(tube, [arb(1)] * count, [arb(j * j) for j in range(count)], ones)
        places = [wide(1) for _ in self.box.terms]
        k = self.box.constants(places, "all")
        states = [center + wide(rest) for center, rest in x]
        return MachineState(states, [wide(one) for one in slope], self._axes_at(_range), k, places, "all")

    def enclosed(
        self,
        function: Function,
        terms: int,
        counts: tuple[int, ...],
        tube: Sequence[Any],
        bent: Function | None = None,
    ) -> list[Expansion]:
        """Enclose functions of the motions, and of all within a tube around them.

        `bent` bounds what is left of them on discs and ellipses after something linear in the motions is
        taken off, which expansions of enough terms have exactly.
        """
        exact = self.series[0].nrows() <= terms and all(
            a <= b for a, b in zip(self.box.terms, counts, strict=True)
        )
        beyond = bent if bent and exact else lambda s: [spread_of(one) for one in function(s)]
        ctx.cap = terms
        at = [one * node_values(self.box.terms, counts) for one in self._in_powers]
        columns = [one.transpose().tolist() for one in at]
        axes = self._axes_at(lambda poly: arb_series(poly.coeffs(), terms))
        rows: list[list[list[arb]]] = []
        for number, places in enumerate(self.box.grid(counts)):
            x, slope = [], []
            for column, off in zip(columns, tube, strict=True):
                values = column[number]
                slopes = [j * one / self.half for j, one in enumerate(values) if j]
                x.append(arb_series([values[0] + wide(off), *values[1:]], terms))
                slope.append(arb_series(slopes, terms))
            k = self.box.constants(places, (counts, number))
            outputs = function(MachineState(x, slope, axes, k, list(places), (counts, number)))
            rows.append([_padded(one, terms) for one in outputs])
        late = self.box.least(
            (terms, len(rows[0])),
            DISCS,
            lambda r: [one / arb(r) ** terms / (1 - 1 / arb(r)) for one in beyond(self.on_disc(r, tube))],
        )
        rests = self.box.interpolation_error(
            counts,
            late,
            (terms, len(rows[0])),
            lambda number, rho: beyond(self.on_ellipse(number, rho, tube)),
        )
        result = []
        for output, rest in enumerate(rests):
            matrix = arb_mat([row[output] for row in rows]).transpose()
            result.append(Expansion(powers(terms) * matrix * interpolation(counts), (terms, *counts), rest))
        return result


def _padded(value: Any, terms: int) -> list[arb]:
    if not isinstance(value, arb_series):  # what does not depend on time
        return [arb(value)] + [arb(0)] * (terms - 1)
    return [value[row] for row in range(terms)]


def _range(poly: arb_poly) -> arb:
    """Enclose a polynomial on −1 … 1."""
    return poly[0] + wide(sum((abs(one) for one in poly.coeffs()[1:]), start=arb(0)))
