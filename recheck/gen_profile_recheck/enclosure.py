"""How far every machine of a box is from its approximate motion, and how much it sways.

With G = ∂f/∂v and P = ∂f/∂x G + ∂f/∂a − dG/dt along the smooth motion of the axes, z = x − G ε − P ψ follows
ż = f(z, smooth axes) + r, where every term of r has ε̄, ψ or two factors of ε and its rate; the error
e = z − x̃ obeys d|S e|/dt ≤ μ |S e| + |S| (|x̃' − f(x̃)| + |r|), μ the logarithmic norm of S (∂f/∂x) S⁻¹
(docs/certificate.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import product
from typing import Any

from flint import arb, arb_mat

from gen_profile_recheck.axes import magnitude, mean_products
from gen_profile_recheck.boxes import (
    Expansion,
    Function,
    MachineBox,
    MachineState,
    MotionPiece,
    Values,
    _t,
    spread_of,
    wide,
)
from gen_profile_recheck.halving import keeps
from gen_profile_recheck.jets import SINGLE, Jet, along, moved

TERMS, FEW_TERMS = 16, 8  # of power series in time: for the defect and sway, and for μ
MORE, SOME_MORE = 2, 0  # nodes than terms in each parameter, likewise
MANY_MORE = 4  # nodes and terms beyond these, where that is not enough
ATTEMPTS, WIDER = 12, 2
INVERSE = 7  # terms of V in each parameter


@dataclass(frozen=True)
class SwayClaim:
    """A sway that is to be bounded: of which loads together, from which piece on, and by how much."""

    loads: slice
    first: int
    bound: float


@dataclass(frozen=True)
class PieceErrors:
    """A piece's greatest error, what setpoints fed into it, and how far states are off z, and z off x̃."""

    greatest: arb
    fed: arb
    shift: Sequence[arb]
    tube: Sequence[arb]


class NotProvedError(Exception):
    """A sentence that says why nothing is proved."""


class BoxProof:
    """The proof for one box: pieces one after another."""

    def __init__(
        self,
        box: MachineBox,
        pieces: Sequence[MotionPiece],
        scales: Sequence[Any],
        start: Sequence[float],
        beyond: int = 0,
    ) -> None:
        self.box, self.pieces, self.start = box, pieces, start
        self.scales = [ScaleMatrix(box, one) for one in scales]
        self.terms, self.few_terms = TERMS + beyond, FEW_TERMS + beyond
        self.fine = tuple(count + MORE + beyond for count in box.terms)
        self.coarse = tuple(count + SOME_MORE + beyond // 2 for count in box.terms)

    def require(self, watches: Sequence[SwayClaim]) -> None:
        """Prove the bounds of all sways.

        Raises
        ------
        NotProvedError
        """
        error, fed, before = arb(0), arb(0), None
        for number, piece in enumerate(self.pieces):
            scale = self.scales[number if len(self.scales) > 1 else 0]
            error = error * (arb(1) if before is scale or before is None else scale.change(before))
            leap = self._leap(number)
            error += norm(scale.sizes_of(leap))
            if number == 0:
                error += norm(scale.sizes_of(_first_gap(piece, leap)))
            sides = [watch for watch in watches if number >= watch.first]
            wanted = partial(self._defect_and_sways, sides)
            none, bent = [0] * len(self.start), partial(self._bent, wanted)
            outputs = piece.enclosed(wanted, self.terms, self.fine, none, bent)
            defect, sways = outputs[: len(self.start)], outputs[len(self.start) :]
            source = norm(scale.sizes_of([one.size for one in defect]))
            error, step = self._step(piece, scale, error, source, fed)
            for watch, sway in zip(sides, sways, strict=True):
                self._require_sway(piece, scale, step, watch, sway)
            before, fed = scale, step.fed

    def _defect_and_sways(self, sides: Sequence[SwayClaim], s: MachineState) -> Values:
        machine, (a, v, *_) = self.box.machine, s.axes
        entries = [one - two for one, two in zip(s.slope, machine.rate(s.x, a, v, s.k), strict=True)]
        sways = machine.sway(s.x[: len(s.x) // 2], a, s.k) if sides else []
        for watch in sides:
            own_sway = sways[watch.loads]
            entries.append(own_sway[0] if len(own_sway) == 1 else sum(one * one for one in own_sway))
        return entries

    def _bent(self, function: Function, s: MachineState) -> Values:
        """Bound what is not linear in state, axes and slope: by how much derivatives by these change."""
        columns, units, reaches, still = [s.x, *s.axes[:2]], 0, list[arb](), list[Values]()
        for number, column in enumerate(columns):
            still.append([one.mid() for one in column])
            for chosen in range(len(column)):
                unit = [1 if row == chosen else 0 for row in range(len(column))]
                columns[number] = moved(columns[number], unit, SINGLE << units)
                units += 1
            reaches += [spread_of(one) for one in column]
        outputs, middles = (
            function(replace(s, x=x, axes=axes, slope=[0] * len(x))) for x, *axes in (columns, still)
        )
        changes = (
            sum((spread_of(along(one, SINGLE << k)) * reach for k, reach in enumerate(reaches)), start=arb(0))
            for one in outputs
        )
        return [spread_of(one) + change for one, change in zip(middles, changes, strict=True)]

    def _leap(self, number: int) -> list[arb]:
        """Bound by how much the approximate motion leaps where a piece begins."""
        jumps = []
        for row, series in enumerate(self.pieces[number].series):
            signs = arb_mat(1, series.nrows(), [(-1) ** k for k in range(series.nrows())])
            off = (signs * series).entries()
            if number:
                last = self.pieces[number - 1].series[row]
                ends = (arb_mat(1, last.nrows(), [1] * last.nrows()) * last).entries()
            else:
                ends = [arb(self.start[row])] + [arb(0)] * (len(off) - 1)
            jumps.append(sum((abs(a - b) for a, b in zip(off, ends, strict=True)), start=arb(0)))
        return jumps

    def _step(
        self, piece: MotionPiece, scale: ScaleMatrix, error: arb, source: arb, fed: arb
    ) -> tuple[arb, PieceErrors]:
        """Assume that errors keep below something, and prove it; the error at the end, and the greatest."""
        time = 2 * piece.half
        reach = ((error + source * time + fed) * 5 / 4 + arb(10) ** -14).abs_upper()
        for _ in range(ATTEMPTS):
            tube = [(reach * row).abs_upper() for row in scale.rows]
            try:
                growth, disturbance = self._growth(piece, scale, tube), Disturbance(piece, tube)
            except ValueError:  # so wide that a series cannot be divided by
                break
            added = sum((norm(scale.sizes_of(term)) for term in disturbance.terms), start=arb(0))
            factor = (growth * time).exp()
            most = factor.max(arb(1))
            step = (source + added) * time * most
            greatest = (error * most + step).abs_upper()
            if greatest <= reach:
                return (error * factor + step).abs_upper(), PieceErrors(
                    greatest, added * time, disturbance.shift, tube
                )
            if not greatest.is_finite():
                break
            reach = (greatest * WIDER).abs_upper()
        raise NotProvedError("errors of the approximate motion cannot be bounded")

    def _growth(self, piece: MotionPiece, scale: ScaleMatrix, tube: Sequence[arb]) -> arb:
        """Bound the logarithmic norm by Gershgorin's circles of the symmetric part."""
        n = len(tube)

        def symmetric(s: MachineState) -> Values:
            to, back = scale.at(s.places, s.key)
            transformed = matrix_product(matrix_product(to, self._jacobian(s)), back)
            return [(transformed[i][j] + transformed[j][i]) / arb(2) for i, j in pairs]

        pairs = [(i, j) for i in range(n) for j in range(i + 1)]
        bounds = piece.enclosed(symmetric, self.few_terms, self.coarse, tube)
        entry = dict(zip(pairs, bounds, strict=True))
        rows = []
        for i in range(n):
            sides = (entry[max(i, j), min(i, j)].size for j in range(n) if j != i)
            rows.append(sum(sides, start=entry[i, i].ball.upper()))
        columns = zip(*self._jacobian(piece.everywhere(tube)), strict=True)
        transformed = [norm(scale.sizes_of([abs(arb(one)) for one in column])) for column in columns]
        whole = sum((a * b for a, b in zip(transformed, scale.rows, strict=True)), start=arb(0))
        return reduce(arb.max, rows) + whole * (scale.slack - 1)

    def _jacobian(self, s: MachineState) -> list[Values]:
        a, v = s.axes[:2]
        x, n = s.x, len(s.x)
        for chosen in range(n):
            x = moved(x, [1 if row == chosen else 0 for row in range(n)], SINGLE << chosen)
        return [
            [along(one, SINGLE << column) for column in range(n)]
            for one in self.box.machine.rate(x, a, v, s.k)
        ]

    def _require_sway(
        self, piece: MotionPiece, scale: ScaleMatrix, step: PieceErrors, watch: SwayClaim, sway: Expansion
    ) -> None:
        machine, shift, n = self.box.machine, step.shift, len(step.tube) // 2
        s = piece.everywhere([a + b for a, b in zip(step.tube, shift, strict=True)])
        axes = [one + wide(gap.gap) for one, gap in zip(s.axes[0], piece.axes, strict=True)]
        aways = [arb(0)] * len(machine.loads[watch.loads])
        gains: list[list[arb]] = [[] for _ in aways]
        for chosen in range(n):
            unit = [1 if row == chosen else 0 for row in range(n)]
            sways = machine.sway(moved(s.x[:n], unit, 1), axes, s.k)[watch.loads]
            for row, one in enumerate(sways):
                gains[row].append(arb(along(one, 1)))
                aways[row] += abs(gains[row][-1]) * shift[chosen]
        for chosen, gap in enumerate(piece.axes):
            unit = [1 if row == chosen else 0 for row in range(len(axes))]
            for row, one in enumerate(machine.sway(s.x[:n], moved(axes, unit, 1), s.k)[watch.loads]):
                aways[row] += abs(arb(along(one, 1))) * gap.gap
        back = scale.at(s.places, s.key)[1]
        for row, gain in enumerate(gains):
            transformed = [
                sum((g * back[i][j] for i, g in enumerate(gain)), start=arb(0)) for j in range(2 * n)
            ]
            aways[row] += norm(transformed) * scale.slack * step.greatest
        room = watch.bound - norm(aways)
        allowed = room if len(aways) == 1 else room * room
        if not (room > 0 and keeps(sway, allowed.lower())):
            raise NotProvedError(f"a sway is not bounded by {1e3 * watch.bound:.6g} mm")


class ScaleMatrix:
    """S, by which errors are measured, and V, nearly its inverse: polynomials of the parameters.

    With |S V − I| ≤ σ < ½, the inverse of S is V (I + F) with |F| ≤ 2 σ; `slack` is 1 + 2 σ.
    """

    def __init__(self, box: MachineBox, entries: Sequence[Sequence[Sequence[float]]]) -> None:
        self.box, self.size, count = box, len(entries), len(entries[0][0])
        self.counts = tuple(1 if count == 1 else min(3, terms) for terms in box.terms)
        self.nodes = tuple(1 if terms == 1 else INVERSE for terms in self.counts)
        self.entries = [[[arb(one) for one in entry] for entry in row] for row in entries]
        self.known: dict[Any, Any] = {}
        inverses = box.polynomials(
            lambda u, _: _inverse(self._evaluated(self.entries, self.counts, u)), self.nodes
        )
        self.inverse = self._square([[one.mid() for one in row.entries()] for row in inverses])
        self.most, self.rows = _sizes(self.entries), [norm(row) for row in _sizes(self.inverse)]
        off = _norm_of(self._product_with(self, unit=1))
        if not off < 0.5:
            raise NotProvedError("the certificate's scales are singular")
        self.slack = 1 + 2 * off
        self.rows = [row * self.slack for row in self.rows]

    def _square(self, flat: Sequence[Any]) -> list[list[Any]]:
        return [list(flat[self.size * i : self.size * (i + 1)]) for i in range(self.size)]

    def _evaluated(self, entries: Any, counts: tuple[int, ...], places: Sequence[Any]) -> list[list[Any]]:
        degrees = product(*map(range, counts))
        basis = [_product(_t(d, u) for d, u in zip(each, places, strict=True)) for each in degrees]

        def value(entry: Sequence[arb]) -> Any:
            return sum((a * b for a, b in zip(entry, basis, strict=True) if not a.is_zero()), start=0)

        return [[value(entry) for entry in row] for row in entries]

    def at(self, places: Sequence[Any], key: Any) -> Any:
        """Give S and V at places of the parameters; entries that are nothing are 0."""
        if key not in self.known:
            self.known[key] = (
                self._evaluated(self.entries, self.counts, places),
                self._evaluated(self.inverse, self.nodes, places),
            )
        return self.known[key]

    def _product_with(self, other: ScaleMatrix, unit: int) -> list[list[arb]]:
        """Bound the entries of this S times another's V, less a multiple of the unit matrix."""
        counts = tuple(one + two for one, two in zip(self.counts, self.nodes, strict=True))

        def entries(u: Values, key: Any) -> Values:
            to, back = self.at(u, key)[0], other.at(u, key)[1]
            return [
                sum(a * b for a, b in zip(row, column, strict=True)) - unit * (i == j)
                for i, row in enumerate(to)
                for j, column in enumerate(zip(*back, strict=True))
            ]

        products = self.box.polynomials(entries, counts)
        return self._square([sum((abs(one) for one in row.entries()), start=arb(0)) for row in products])

    def sizes_of(self, sizes: Sequence[arb]) -> list[arb]:
        """Bound the entries of S times a vector whose entries have at most these sizes."""
        return [sum((a * b for a, b in zip(row, sizes, strict=True)), start=arb(0)) for row in self.most]

    def change(self, before: ScaleMatrix) -> arb:
        """Bound the norm of this S times the inverse of another."""
        return _norm_of(self._product_with(before, unit=0)) * before.slack


def _inverse(rows: Sequence[Values]) -> Values:
    try:
        return arb_mat([[arb(one) for one in row] for row in rows]).inv().entries()
    except ZeroDivisionError as error:
        raise NotProvedError("the certificate's scales are singular") from error


def _sizes(entries: Sequence[Sequence[Sequence[arb]]]) -> list[list[arb]]:
    return [[sum((abs(one) for one in entry), start=arb(0)) for entry in row] for row in entries]


def _norm_of(sizes: Sequence[Sequence[arb]]) -> arb:
    """Bound the norm of a matrix whose entries have at most these sizes."""
    rows, columns = ([sum(row, start=arb(0)) for row in kind] for kind in (sizes, zip(*sizes, strict=True)))
    return (magnitude(rows) * magnitude(columns)).sqrt().abs_upper()


class Disturbance:
    """What setpoints beside the smooth motion add: bounds of x − z in `shift`, and of r in `terms`.

    Each term is a vector times a function of time, whose mean over the piece is taken: errors grow with the
    integral of |S r|, and that is at most the sum of the terms' integrals.
    """

    def __init__(self, piece: MotionPiece, tube: Sequence[arb]) -> None:
        self.piece, self.machine = piece, piece.box.machine
        self.gaps = [one.gap for one in piece.axes]
        self._at(tube, [arb(0)] * len(tube))
        guess = [2 * one + arb(10) ** -30 for one in self.shift]
        self._at(tube, guess)
        if not all(one <= most for one, most in zip(self.shift, guess, strict=True)):
            raise NotProvedError("the setpoints are too far from the smooth motion")
        self.terms = self._terms()

    def _at(self, tube: Sequence[arb], guess: Sequence[arb]) -> None:
        s = self.piece.everywhere([a + b for a, b in zip(tube, guess, strict=True)])
        self.x, self.k, (self.a, self.v, self.bend, self.jerk) = s.x, s.k, s.axes
        self.lifts = self.lift(self.x, self.a, self.v)
        self.pulls = [self.pull(chosen, self.x, self.a, self.v, self.bend) for chosen in range(len(self.a))]
        lifted = _summed(zip(self.lifts, self.gaps, strict=True), len(self.x))
        pulled = _summed(zip(self.pulls, (one.swing for one in self.piece.axes), strict=True), len(self.x))
        self.shift = [a + b for a, b in zip(lifted, pulled, strict=True)]

    def rate(self, x: Values, a: Values, v: Values) -> Values:
        """Give f."""
        return self.machine.rate(x, a, v, self.k)

    def lift(self, x: Values, a: Values, v: Values) -> list[Values]:
        """List the columns of G."""
        lifts = []
        for chosen in range(len(v)):
            unit = [1 if row == chosen else 0 for row in range(len(v))]
            lifts.append([along(one, 1) for one in self.rate(x, a, moved(v, unit, 1))])
        return lifts

    def pull(self, chosen: int, x: Values, a: Values, v: Values, bend: Values) -> Values:
        """Give a column of P."""
        unit = [1 if row == chosen else 0 for row in range(len(v))]
        lift = [along(one, 1) for one in self.rate(x, a, moved(v, unit, 1))]
        beside = [along(one, 1) for one in self.rate(moved(x, lift, 1), moved(a, unit, 1), v)]
        flow = self.rate(x, a, v)
        later = moved(v, bend, 2)
        crossed = self.rate(moved(x, flow, 2), moved(a, v, 2), moved(later, unit, 1))
        return [one - along(along(two, 1), 2) for one, two in zip(beside, crossed, strict=True)]

    def _terms(self) -> list[list[arb]]:
        first, found = self._by_axes()
        faster = [wide(one) for one in first]
        true = [one + two for one, two in zip(self.rate(self.x, self.a, self.v), faster, strict=True)]
        moving = (
            moved(self.x, true, 4),
            moved(self.a, self.v, 4),
            moved(self.v, self.bend, 4),
            moved(self.bend, self.jerk, 4),
        )
        off = moved(self.x, [wide(one) for one in self.shift], 1)
        for chosen, axis in enumerate(self.piece.axes):
            pull, unit = self.pulls[chosen], [int(row == chosen) for row in range(len(self.v))]
            changed = [along(one, 4) for one in self.pull(chosen, *moving)]
            passed = [along(one, 1) for one in self.rate(moved(self.x, pull, 1), self.a, self.v)]
            lift_change = self.rate(moved(self.x, faster, 1), self.a, moved(self.v, unit, 2))
            bent = self.rate(moved(off, self.lifts[chosen], 2), self.a, self.v)
            found += [
                _weighted(axis.mean, pull),
                _weighted(axis.mean_swing, changed, passed),
                _weighted(
                    axis.mean_gap, *([along(along(one, 1), 2) for one in two] for two in (lift_change, bent))
                ),
            ]
        return found

    def _by_axes(self) -> tuple[list[arb], list[list[arb]]]:
        """Bound what the axes' being elsewhere changes in f, and by how much more than its slopes tell.

        Derivatives are taken along one axis at a time, so that what cancels in them does.
        """
        pieces, m = self.piece.axes, len(self.a)
        sizes, products = [*self.gaps, *(one.rate for one in pieces)], mean_products(tuple(pieces))
        near = [one + wide(size) for one, size in zip([*self.a, *self.v], sizes, strict=True)]
        first, second = [arb(0)] * len(self.x), []
        for i, j in product(range(2 * m), repeat=2):
            if j > i:
                continue
            once = moved(near, [int(row == i) for row in range(2 * m)], 1)
            both = moved(once, [int(row == j) for row in range(2 * m)], 2)
            slopes = [along(one, 1) for one in self.rate(self.x, both[:m], both[m:])]
            second.append(_weighted(products[i][j] / (2 if i == j else 1), [along(one, 2) for one in slopes]))
            if i == j:
                only = [one.parts.get(0, 0) if isinstance(one, Jet) else one for one in slopes]
                first = [one + abs(arb(two)) * sizes[i] for one, two in zip(first, only, strict=True)]
        return first, second


def _weighted(weight: arb, *columns: Sequence[Any]) -> list[arb]:
    """Bound a weight times the sum of columns, entry by entry."""
    return [sum((abs(arb(one)) for one in row), start=arb(0)) * weight for row in zip(*columns, strict=True)]


def _first_gap(piece: MotionPiece, leap: Sequence[arb]) -> list[arb]:
    """Bound what the smooth motion's first position is off, as the state sees it."""
    disturbance = Disturbance(piece, leap)
    return _summed(zip(disturbance.lifts, (one.first for one in piece.axes), strict=True), len(piece.series))


def _summed(columns: Any, size: int) -> list[arb]:
    total = [arb(0)] * size
    for column, weight in columns:
        total = [one + abs(arb(entry)) * weight for one, entry in zip(total, column, strict=True)]
    return [one.abs_upper() for one in total]


def norm(values: Sequence[Any]) -> arb:
    """Bound a vector's length."""
    return sum((one.abs_upper() ** 2 for one in values), start=arb(0)).sqrt().abs_upper()


def matrix_product(a: Sequence[Values], b: Sequence[Values]) -> list[Values]:
    """Multiply matrices many of whose entries are 0."""
    columns = list(zip(*b, strict=True))

    def entry(row: Sequence[Any], column: Sequence[Any]) -> Any:
        pairs = zip(row, column, strict=True)
        return sum((x * y for x, y in pairs if not (_nothing(x) or _nothing(y))), start=0)

    return [[entry(row, column) for column in columns] for row in a]


def _product(values: Any) -> Any:
    product: Any = arb(1)
    for one in values:
        product = product * one
    return product


def _nothing(value: Any) -> bool:
    return isinstance(value, int) and value == 0
