"""How far every machine of a box is from its approximate motion, and how much it sways.

With X, its defect and y as in disturbance.py, the error e, by which true motions differ from X in y, obeys
d|S e|/dt ≤ μ |S e| + |S ∂y/∂x defect|, μ the logarithmic norm of S (∂ẏ/∂y) S⁻¹ (docs/certificate.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

from flint import arb, arb_mat

from gen_profile_recheck.boxes import MachineState, MotionPiece, Values, wide
from gen_profile_recheck.disturbance import Disturbance
from gen_profile_recheck.halving import keeps
from gen_profile_recheck.jets import derivatives
from gen_profile_recheck.machines import carried
from gen_profile_recheck.reading import NotProvedError, require
from gen_profile_recheck.scales import Matrix, ScaleMatrix, norm

ATTEMPTS, WIDER = 12, 2


# what all that series leave out may be worth of a bound, and in the exponent by which errors grow
ROUGH, FINE = (2.0**-8, 2.0), (2.0**-11, 0.25)


@dataclass(frozen=True)
class SwayClaim:
    """A sway that is to be bounded: of which loads together, from which piece on, and by how much."""

    loads: slice
    first: int
    bound: float


@dataclass(frozen=True)
class Effort:
    """What series may leave out of sways, of the growth of errors and of their rate (as sway per second).

    `taken` tells how many terms of each variable a function took in the piece before.
    """

    sway: float
    growth: arb
    rate: arb
    taken: Mapping[str, list[int]]


def prove(
    pieces: Sequence[MotionPiece], scales: Sequence[Any], start: Sequence[float], claims: Sequence[SwayClaim]
) -> None:
    """Prove the bounds of all sways of the machines of a box, roughly where that will do.

    Raises
    ------
    NotProvedError
    """
    least, span = min(claim.bound for claim in claims), sum((2 * one.half for one in pieces), start=arb(0))
    for share, growth in (ROUGH, FINE):
        taken = {name: pieces[0].few_terms() for name in ("defect", "growth", "sway")}
        effort = Effort(share * least, growth / span, share * least / span, taken)
        try:
            error, scale = arb(0), ScaleMatrix(pieces[0], scales[0])
            for number, piece in enumerate(pieces):
                if 0 < number < len(scales):
                    before, scale = scale, ScaleMatrix(piece, scales[number])
                    error *= scale.change(before)
                due = [claim for claim in claims if number >= claim.first]
                proof = PieceProof(piece, scale, due, effort)
                leap = proof.beside.leap(_leap(pieces, number, start), at_start=number == 0)
                error = proof.error_after(error + scale.length(leap))
            return
        except (NotProvedError, ValueError, ArithmeticError) as error_met:
            cause = error_met
    raise NotProvedError(str(cause)) from cause


def _leap(pieces: Sequence[MotionPiece], number: int, start: Sequence[float]) -> list[arb]:
    """Bound by how much the approximate motion leaps where a piece begins."""
    jumps = []
    for row, series in enumerate(pieces[number].series):
        begin = arb_mat(1, series.nrows(), [(-1) ** k for k in range(series.nrows())]) * series
        end = arb_mat(1, series.ncols(), [start[row]] + [0] * (series.ncols() - 1))
        if number:
            last = pieces[number - 1].series[row]
            end = arb_mat(1, last.nrows(), [1] * last.nrows()) * last
        jumps.append(sum(map(abs, (begin - end).entries()), start=arb(0)))
    return jumps


class PieceProof:
    """The proof for a piece."""

    def __init__(
        self, piece: MotionPiece, scale: ScaleMatrix, claims: Sequence[SwayClaim], effort: Effort
    ) -> None:
        self.piece, self.scale, self.claims, self.effort = piece, scale, claims, effort
        self.beside, self.machine, self.n = Disturbance(piece), piece.box.machine, len(piece.series) // 2
        lever = reduce(arb.max, self._away([arb(0)] * 2 * self.n, arb(1)))
        self.room = effort.rate / lever

    def error_after(self, error: arb) -> arb:
        """Bound the error at the end by that at the beginning, and all sways.

        Raises
        ------
        NotProvedError
        """
        fits, taken = (
            lambda residual: bool(self.scale.length(residual) < self.room),
            self.effort.taken["defect"],
        )
        found = self.piece.bounded(self._defect, fits, taken)
        defect = self.beside.in_rates(list(map(wide, found)), -1)
        lengths = (self.scale.length(self.beside.in_rates(one)) for one in [defect, *self.beside.terms])
        error, greatest, off = self._step(error, sum(lengths, start=arb(0)) * 2 * self.piece.half)
        away = self._away(off, greatest)
        for claim in self.claims:
            kept = self._keeps(claim, claim.bound - norm(away[claim.loads]))
            require(kept, f"a sway is not bounded by {1e3 * claim.bound:.6g} mm")
        return error

    def _defect(self, s: MachineState) -> Values:
        dq = s.y[self.n :]
        _, v, dv = s.axes
        rates = dq + carried(s.posture.drift(dq, v), s.posture.inputs, dv)
        return [one - two for one, two in zip(s.slope, rates, strict=True)]

    def _keeps(self, claim: SwayClaim, room: arb) -> bool:
        """Tell whether the approximate motion's sway is proved to be at most so much."""

        def square(s: MachineState) -> Values:
            return [sum(one * one for one in s.posture.sways()[claim.loads])]

        if not room > 0 or square(self.beside.state)[0] <= room * room:
            return bool(room > 0)
        most, taken = self.effort.sway * claim.bound, self.effort.taken["sway"]
        (sway,) = self.piece.enclosed(square, lambda residual: bool(residual[0] < most), taken)
        return keeps(sway, (room * room).lower())

    def _step(self, error: arb, source: arb) -> tuple[arb, arb, list[arb]]:
        """Assume that errors keep below something, and prove it: the last, the greatest, of all entries."""
        time = 2 * self.piece.half
        reach = ((error + source) * 5 / 4 + arb(10) ** -14).abs_upper()
        for _ in range(ATTEMPTS):
            off = [wide(reach * row) for row in self.scale.rows]
            shaken = sum((self.scale.size(one) * mean for one, mean in self.beside.shaken(off)), start=arb(0))
            growth = self._growth(off)
            factor, most = (((one + shaken) * time).exp() for one in (growth, growth.max(arb(0))))
            greatest = ((error + source) * most).abs_upper()
            if greatest < reach:
                return (error * factor + source * most).abs_upper(), greatest, off
            if not greatest.is_finite():
                break
            reach = (greatest * WIDER).abs_upper()
        raise NotProvedError("errors of the approximate motion cannot be bounded")

    def _growth(self, off: Sequence[arb]) -> arb:
        """Bound the logarithmic norm on smooth axes by Gershgorin's circles of the symmetric part."""
        n, indices, half = self.n, range(2 * self.n), arb(0.5)
        tube = [one + two for one, two in zip(off, self.beside.in_rates(self.beside.shift), strict=True)]

        def lower(s: MachineState) -> Matrix:
            y = [one + two for one, two in zip(s.y, tube, strict=True)]
            return derivatives(lambda q, dq: self.machine.bend(q, dq, s.axes, s.k), y[:n], y[n:])

        def symmetric(s: MachineState) -> Values:
            changed = self.scale.changed(lower(s), s.places)
            return [(changed[i][j] + changed[j][i]) * half for i in indices for j in indices if j <= i]

        most, taken = self.effort.growth / (2 * n), self.effort.taken["growth"]
        found = iter(
            self.piece.enclosed(symmetric, lambda residual: all(one < most for one in residual), taken)
        )
        entry = {(i, j): next(found) for i in indices for j in indices if j <= i}
        sides = ([entry[max(i, j), min(i, j)].size for j in indices if j != i] for i in indices)
        greatest = reduce(arb.max, (sum(row, start=entry[i, i].upper) for i, row in enumerate(sides)))
        whole: list[Values] = [[int(i + n == j) for j in indices] for i in range(n)]
        whole += map(list, lower(self.beside.state))
        return greatest + self.scale.gap * self.scale.size(whole)

    def _away(self, off: Sequence[arb], error: arb) -> list[arb]:
        """Bound by how much sways of all loads differ from those of the approximate motion."""
        beside, k, q = self.beside, self.beside.state.k, self.beside.near(off)[: self.n]
        gains = derivatives(lambda q, a: self.machine.at(q, a, k).sways(), q, beside.axes[0])
        known = [*beside.shift[: self.n], *(wide(axis.gap.most) for axis in self.piece.axes)]
        changed = self.scale.per_length([row[: self.n] for row in gains])
        still = ([abs(arb(one)) * abs(two) for one, two in zip(row, known, strict=True)] for row in gains)
        return [
            (norm([arb(one) for one in row]) * error + sum(sizes, start=arb(0))).abs_upper()
            for row, sizes in zip(changed, still, strict=True)
        ]
