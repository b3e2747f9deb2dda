"""How far every machine of a box is from its approximate motion, and how much it sways.

With X, its defect and y as in disturbance.py, the error e, by which true motions differ from X in y, obeys
d|S e|/dt ≤ μ |S e| + |S ∂y/∂x defect|, μ the logarithmic norm of S (∂ẏ/∂y) S⁻¹ (docs/certificate.md).
"""

from __future__ import annotations

from collections.abc import Sequence
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

MISSED = 2.0**-11  # of a bound, that all that series leave out may be worth
GROWTH = 2.0**-2  # by whose exponential errors may grow for what series of the growth leave out
ATTEMPTS, WIDER = 12, 2


@dataclass(frozen=True)
class SwayClaim:
    """A sway that is to be bounded: of which loads together, from which piece on, and by how much."""

    loads: slice
    first: int
    bound: float


def prove(
    pieces: Sequence[MotionPiece], scales: Sequence[Any], start: Sequence[float], claims: Sequence[SwayClaim]
) -> None:
    """Prove the bounds of all sways of the machines of a box, piece after piece.

    Raises
    ------
    NotProvedError
    """
    error, scale = arb(0), ScaleMatrix(pieces[0], scales[0])
    least, span = min(claim.bound for claim in claims), sum((2 * one.half for one in pieces), start=arb(0))
    for number, piece in enumerate(pieces):
        if 0 < number < len(scales):
            before, scale = scale, ScaleMatrix(piece, scales[number])
            error *= scale.change(before)
        proof = PieceProof(piece, scale, [claim for claim in claims if number >= claim.first], least, span)
        error += scale.length(proof.beside.leap(_leap(pieces, number, start), at_start=number == 0))
        error = proof.error_after(error)


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
    """The proof for a piece, where series may miss little of the least bound and over the span of time."""

    def __init__(
        self, piece: MotionPiece, scale: ScaleMatrix, claims: Sequence[SwayClaim], least: float, span: arb
    ) -> None:
        self.piece, self.scale, self.claims, self.beside = piece, scale, claims, Disturbance(piece)
        self.machine, self.n = piece.box.machine, len(piece.series) // 2
        lever = reduce(arb.max, self._away([arb(0)] * 2 * self.n, arb(1)))
        self.room, self.least, self.span = least / lever / span, least, span

    def error_after(self, error: arb) -> arb:
        """Bound the error at the end by that at the beginning, and all sways.

        Raises
        ------
        NotProvedError
        """
        outputs = self.piece.enclosed(self._defect_and_sways, self._misses_little)
        defect = self.beside.in_rates([wide(one.size) for one in outputs[: 2 * self.n]], -1)
        lengths = (self.scale.length(self.beside.in_rates(one)) for one in [defect, *self.beside.terms])
        error, greatest, off = self._step(error, sum(lengths, start=arb(0)) * 2 * self.piece.half)
        away = self._away(off, greatest)
        for claim, sway in zip(self.claims, outputs[2 * self.n :], strict=True):
            room = claim.bound - norm(away[claim.loads])
            single = len(away[claim.loads]) == 1
            kept = room > 0 and keeps(sway, (room if single else room * room).lower())
            require(kept, f"a sway is not bounded by {1e3 * claim.bound:.6g} mm")
        return error

    def _defect_and_sways(self, s: MachineState) -> Values:
        dq = s.y[self.n :]
        _, v, dv = s.axes
        rates = dq + carried(s.posture.drift(dq, v), s.posture.inputs, dv)
        entries = [one - two for one, two in zip(s.slope, rates, strict=True)]
        sways = s.posture.sways()
        for claim in self.claims:
            own = sways[claim.loads]
            entries.append(own[0] if len(own) == 1 else sum(one * one for one in own))
        return entries

    def _misses_little(self, residual: Sequence[arb]) -> bool:
        """Tell whether what series of the defect and sways miss is little beside bounds."""
        length = self.scale.length(residual[: 2 * self.n])
        return length < MISSED * self.room and all(
            one < MISSED * self.least**2 for one in residual[2 * self.n :]
        )

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

        def matrix(s: MachineState) -> Matrix:
            y = [one + two for one, two in zip(s.y, tube, strict=True)]
            lower = derivatives(lambda q, dq: self.machine.bend(q, dq, s.axes, s.k), y[:n], y[n:])
            return [[int(i + n == j) for j in indices] for i in range(n)] + lower

        def symmetric(s: MachineState) -> Values:
            changed = self.scale.times(matrix(s), s)
            return [(changed[i][j] + changed[j][i]) * half for i in indices for j in indices if j <= i]

        most = GROWTH / (2 * n * self.span)
        found = iter(self.piece.enclosed(symmetric, lambda rest: all(one < most for one in rest), 12))
        entry = {(i, j): next(found) for i in indices for j in indices if j <= i}
        sides = ([entry[max(i, j), min(i, j)].size for j in indices if j != i] for i in indices)
        greatest = reduce(arb.max, (sum(row, start=entry[i, i].upper) for i, row in enumerate(sides)))
        return greatest + self.scale.gap * self.scale.size(matrix(self.beside.state))

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
