"""A box of machines and their approximate motions, and enclosures of what depends on these on a piece.

A function of time and of parameters, each on [−1, 1], is expanded as a power series of time at Chebyshev's
nodes of the parameters, in balls. What N terms miss is at most the coefficient N of its series about any time
(Taylor). What N nodes of a parameter miss is at most 2¹⁻ᴺ times that of its series about any place, times
1 + 2/π ln N for each parameter before it (Rivlin). Series about any place at once need only that no
derivative of T_k is greater on [−1, 1] than at 1. One such series tells how many terms or nodes it takes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, reduce
from itertools import chain, product
from math import log, pi
from types import SimpleNamespace
from typing import Any

from flint import arb, arb_mat, arb_poly, arb_series, ctx

from gen_profile_recheck.axes import AxisPiece
from gen_profile_recheck.jets import along, moved, parts_of
from gen_profile_recheck.machines import INNER, Machine, Posture, carried

Values = list[Any]
Function = Callable[["MachineState"], Values]
Fits = Callable[[list[arb]], bool]  # tells whether what series miss, one of each function, is little
FEW_TERMS, MOST_TERMS = 3, 20  # of a variable


class Places(tuple[Any, ...]):
    """Places of all parameters, told apart as objects: balls are not hashed."""

    __slots__ = ()
    __hash__ = object.__hash__
    __eq__ = object.__eq__


@dataclass
class MachineState:
    """All that equations depend on: states, axes with derivatives, constants, parameters' places.

    States are x = (q, w), and y = (q, dq) with its slope in time.
    """

    x: Values
    y: Values
    slope: Values
    posture: Posture
    axes: Sequence[Values]  # position, velocity, acceleration
    k: SimpleNamespace
    places: Places


@dataclass(frozen=True)
class Expansion:
    """A function of parameters and time: coefficients of Chebyshev's polynomials, how many, and the rest.

    The last variable's degree, time's, changes first.
    """

    coefficients: Sequence[arb]
    counts: tuple[int, ...]
    rest: arb

    @property
    def size(self) -> arb:
        """Bound its absolute value."""
        return sum(map(abs, self.coefficients), start=self.rest).abs_upper()

    @property
    def upper(self) -> arb:
        """Bound it."""
        first = self.coefficients[0]
        return (first + (self.size - abs(first))).upper()


def wide(size: Any) -> arb:
    """Give all real numbers up to a size."""
    return arb(0, 1) * arb(size).abs_upper()


def first(value: Any) -> arb:
    """Take the first coefficient of a series, or a number."""
    return value[0] if isinstance(value, arb_series) else arb(value)


def chebyshev_value(degree: int, x: Any) -> Any:
    """Evaluate T_k."""
    before, now = 1, x
    for _ in range(degree - 1):
        before, now = now, 2 * x * now - before
    return now if degree else 1


@cache
def in_powers(count: int, center: int = 0, terms: int = 0) -> arb_mat:
    """Matrix from Chebyshev coefficients to those of powers beyond a center: of T_k in column k."""
    columns = [arb_poly([1]) * chebyshev_value(k, arb_poly([center, 1])) for k in range(count)]
    return arb_mat([[poly[row] for poly in columns] for row in range(terms or count)])


@cache
def from_powers(count: int) -> arb_mat:
    """Matrix from powers to Chebyshev coefficients."""
    return in_powers(count).inv()


@cache
def nodes(count: int) -> list[arb]:
    """Chebyshev's nodes."""
    return [(arb.pi() * (2 * j + 1) / (2 * count)).cos() for j in range(count)]


@cache
def grid(counts: tuple[int, ...]) -> list[Places]:
    """List all nodes of the parameters."""
    return [Places(one) for one in product(*map(nodes, counts))]


@cache
def _anywhere(count: int, variable: int | None, terms: int) -> Places:
    """Enclose all places of so many parameters; of one of them give a series about any place."""
    near = arb_series([wide(1), 1], terms)
    return Places(near if number == variable else wide(1) for number in range(1, count + 1))


@cache
def node_values(terms: tuple[int, ...], counts: tuple[int, ...]) -> arb_mat:
    """Matrix with the products of Chebyshev's polynomials of all parameters at all nodes, (nodes, terms)."""
    return kronecker(
        arb_mat([[chebyshev_value(k, x) for k in range(size)] for x in nodes(count)])
        for size, count in zip(terms, counts, strict=True)
    )


@cache
def _greatest(counts: tuple[int, ...], variable: int | None, terms: int) -> arb_mat:
    """Matrix with what products of Chebyshev's polynomials, or terms of their series, are at most."""
    greatest = [arb_mat([[1]] * count) for count in counts]
    if variable:
        greatest[variable - 1] = in_powers(counts[variable - 1], 1, terms).transpose()
    return kronecker(greatest)


@cache
def interpolation(count: int) -> arb_mat:
    """Matrix from values at nodes to coefficients."""
    return node_values((count,), (count,)).inv()


def kronecker(matrices: Any) -> arb_mat:
    """Multiply matrices of each parameter to one of all, the last one's index changing first."""
    result = [[arb(1)]]
    for one in matrices:
        result = [[x * y for x in row for y in other] for row in result for other in one.tolist()]
    return arb_mat(result)


def transformed(matrices: Sequence[arb_mat], entries: Sequence[arb]) -> list[arb]:
    """Multiply entries, whose last variable's index changes first, by a matrix for each variable."""
    for matrix in reversed(matrices):
        columns = arb_mat(len(entries) // matrix.ncols(), matrix.ncols(), entries).transpose()
        entries = (matrix * columns).entries()  # now the last variable's index comes first
    return list(entries)


@dataclass(frozen=True)
class MachineBox:
    """Machines whose parameters lie in a part of their ranges.

    `parts`: of every range how often it was halved, and which part it is; `terms`: of series in each.
    """

    machine: Machine
    nominal: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]
    parts: Sequence[tuple[int, int]]
    terms: tuple[int, ...]

    @cached_property
    def constants(self) -> Callable[[Places], SimpleNamespace]:
        """Give the machine's constants at places of its parameters."""
        return cache(self._constants)

    def _constants(self, places: Places) -> SimpleNamespace:
        p: dict[str, Any] = {name: arb(value) for name, value in self.nominal.items()}
        for (name, (low, high)), (level, index), u in zip(
            self.ranges.items(), self.parts, places, strict=True
        ):
            p[name] = low + (arb(high) - low) * (index + (u + 1) / 2) / 2**level
        return self.machine.constants(p)


@dataclass
class MotionPiece:
    """A box's approximate motions on a piece of time: of every coordinate (time × parameter) terms."""

    box: MachineBox
    half: arb
    axes: Sequence[AxisPiece]
    series: Sequence[arb_mat]
    sizes: Sequence[arb_mat]  # their absolute values
    _taken: dict[int, tuple[int, MachineState]] = field(default_factory=dict)

    @cached_property
    def _powers(self) -> list[arb_mat]:
        """Give series in powers of time, (parameter × time terms)."""
        return [(in_powers(one.nrows()) * one).transpose() for one in self.series]

    def _axes(self, at: Callable[[arb_poly], Any]) -> list[Values]:
        values, polynomials = [], [one.smooth for one in self.axes]
        for order in range(3):
            values.append([at(one) / self.half**order for one in polynomials])
            polynomials = [one.derivative() for one in polynomials]
        return values

    def at_nodes(self, counts: tuple[int, ...], terms: int) -> Iterator[MachineState]:
        """Take series of time at every node of the parameters."""
        ctx.cap, n = terms + 1, len(self.series) // 2  # a slope takes a term
        at = [(node_values(self.box.terms, counts) * one).tolist() for one in self._powers]
        axes = self._axes(lambda poly: arb_series(poly.coeffs(), terms + 1))
        for number, places in enumerate(grid(counts)):
            x = [arb_series(rows[number], terms + 1) for rows in at]
            k = self.box.constants(places)
            here = self.box.machine.at(x[:n], axes[0], k)
            y = x[:n] + carried(x[n:], here.inputs, axes[1])
            slope = [one.derivative() / self.half for one in y]
            yield MachineState(x, y, slope, here, axes, k, places)

    def around(self, variable: int | None = None, terms: int = 1) -> MachineState:
        """Take all times and parameters: balls, or series of one of them (0 is time) about any place."""
        ctx.cap, n = terms, len(self.series) // 2
        x, slope, times = Values(), Values(), self.series[0].nrows()
        places = _anywhere(len(self.box.terms), variable, terms)
        parameters = _greatest(self.box.terms, variable, terms)
        time = arb_mat([[1] * times, [k * k for k in range(times)]])
        if variable == 0:
            time = in_powers(times, 1, terms + 1)
        for sizes, series in zip(self.sizes, self.series, strict=True):
            found = (time * sizes * parameters).tolist()
            value, rate = [row[0] for row in found][:terms], [n * row[0] for n, row in enumerate(found)][1:]
            if variable != 0:
                value, rate = found
            first = series[0, 0]
            x.append([first + wide(value[0] - abs(first)), *map(wide, value[1:])])
            slope.append([wide(one / self.half) for one in rate])
        if variable is None:
            x, slope = [one for (one,) in x], [one for (one,) in slope]
        else:
            x, slope = ([arb_series(one, terms) for one in column] for column in (x, slope))
        whole = arb_poly([wide(1), 1])
        axes = self._axes(
            lambda poly: arb_series(poly(whole).coeffs(), terms) if variable == 0 else poly(wide(1))
        )
        a, v, dv = axes
        k = self.box.constants(places)
        speed = self.box.machine.speed(moved(x, slope, INNER), moved(a, v, INNER), moved(v, dv, INNER), k)
        y = x[:n] + [parts_of(one)[0] for one in speed]
        slope = slope[:n] + [along(one, INNER) for one in speed]
        return MachineState(x, y, slope, self.box.machine.at(x[:n], a, k), axes, k, places)

    def few_terms(self) -> list[int]:
        """Give as many terms of each variable as may be tried first; time is the last one."""
        return [FEW_TERMS] * (1 + len(self.box.terms))

    def _anywhere(self, variable: int, terms: int) -> MachineState:
        """Take series of a variable about any place, of so many terms at least, that may have been taken."""
        if self._taken.get(variable, (0,))[0] < terms:
            self._taken[variable] = terms, self.around(variable, terms)
        ctx.cap = terms
        return self._taken[variable][1]

    def enclosed(self, function: Function, fits: Fits, taken: list[int]) -> list[Expansion]:
        """Enclose functions of the motions, with as many terms of each variable as what they miss fits.

        So many were `taken` a piece before; it is changed to those that are taken now.
        """
        rests, amplified = self._take_terms(function, fits, taken)
        matrices, found = [*map(interpolation, taken[:-1]), from_powers(taken[-1])], list[Expansion]()
        for rows, rest in zip(self._tables(function, taken), rests, strict=True):
            # what values are off would be in every coefficient, but is amplified by interpolation only
            off = reduce(arb.max, (sum((one.rad() for one in row), start=arb(0)) for row in rows))
            table = transformed(matrices, [one.mid() for one in chain(*rows)])
            found.append(Expansion(table, tuple(taken), (rest + off * amplified).abs_upper()))
        return found

    def bounded(self, function: Function, fits: Fits, taken: list[int]) -> list[arb]:
        """Bound absolute values of functions likewise, by what they are at nodes at most."""
        rests, amplified = self._take_terms(function, fits, taken)
        inner = from_powers(taken[-1]).transpose()
        found = ((arb_mat(one) * inner).tolist() for one in self._tables(function, taken))
        greatest = (reduce(arb.max, (sum(map(abs, row), start=arb(0)) for row in rows)) for rows in found)
        return [one * amplified + rest for one, rest in zip(greatest, rests, strict=True)]

    def _tables(self, function: Function, counts: Sequence[int]) -> Iterator[Sequence[Values]]:
        """List coefficients of time of each function, a row for each node of the parameters."""
        *own, terms = counts
        every = ([_coefficients(one, terms) for one in function(s)] for s in self.at_nodes(tuple(own), terms))
        return zip(*every, strict=True)

    def _take_terms(self, function: Function, fits: Fits, taken: list[int]) -> tuple[list[arb], arb]:
        """Find how many terms fit; what they miss, and by how much parameters' nodes amplify values."""
        rests, amplified = [], arb(1)
        for place, near in enumerate(taken, start=1):
            variable = place if place < len(taken) else 0  # time is the last one
            taken[place - 1], residual = self._enough(function, fits, variable, amplified, near)
            rests.append(residual)
            if variable:
                amplified *= 1 + 2 / pi * log(taken[place - 1]) + 1e-9
        return [sum(one, start=arb(0)).abs_upper() for one in zip(*rests, strict=True)], amplified

    def _enough(
        self, function: Function, fits: Fits, variable: int, factor: arb, near: int
    ) -> tuple[int, list[arb]]:
        """Find how many terms of a variable miss what fits, from about so many on, and what these miss."""
        for most in (min(near + 2, MOST_TERMS), MOST_TERMS):
            late = [_coefficients(one, most + 1) for one in function(self._anywhere(variable, most + 1))]
            for count in range(max(1, near - 2), most + 1):
                less = factor * (arb(2) ** (1 - count) if variable else 1)
                if fits(residual := [abs(one[count]) * less for one in late]):
                    return count, residual
        return most, residual


def _coefficients(value: Any, terms: int) -> list[arb]:
    if not isinstance(value, arb_series):  # what depends on no variable
        return [arb(value)] + [arb(0)] * (terms - 1)
    return [value[row] for row in range(terms)]
