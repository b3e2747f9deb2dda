"""What setpoints, whose axes are at a = ã + ε, do to machines beside what the smooth axes ã do.

Let ẋ = f(x, a, v), and along an approximate motion x̃ and the smooth axes J = ∂f/∂x, G = ∂f/∂v and
P = J G + ∂f/∂a − dG/dt. With ε = ε̄ + ψ', the motion X = x̃ + G ε + P ψ has the defect

    Ẋ − f(X, a, v) = x̃' − f(x̃, ã, ṽ) − P ε̄ + (dP/dt − J P) ψ − ½ D²f

with second derivatives along (G ε + P ψ, ε, ε'), at places between. How far true motions are from X is
measured in y = (q, w + D(q, ã) ṽ), the coordinates and their rates if axes were smooth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement
from typing import Any

from flint import arb, arb_series

from gen_profile_recheck.axes import AxisPiece, Size
from gen_profile_recheck.boxes import MotionPiece, Values, first, wide
from gen_profile_recheck.jets import SINGLE, along, moved


class Disturbance:
    """What setpoints do on a piece, for all machines of its box.

    `shift` encloses X − x̃, and `terms` all of the defect but what x̃ has on smooth axes: each is a vector that
    is bounded over the piece, times the root mean square of a function of time. So the mean of the defect's
    length is at most the sum of theirs. `off` lists axes that leave smooth ones, and their
    directions, `state` encloses x̃ and smooth axes, `axes` those of the setpoints.
    """

    def __init__(self, piece: MotionPiece) -> None:
        self.piece, self.machine, self.state, axes = piece, piece.box.machine, piece.around(), piece.axes
        n, m = len(piece.series), len(axes)
        units = [[int(row == chosen) for row in range(m)] for chosen in range(m)]
        pairs = zip(axes, units, strict=True)
        self.off = [(axis, unit) for axis, unit in pairs if not axis.gap.most.is_zero()]
        position, velocity, _ = self.state.axes
        self.axes = (
            [one + wide(axis.gap.most) for one, axis in zip(position, axes, strict=True)],
            [one + wide(axis.rate.most) for one, axis in zip(velocity, axes, strict=True)],
        )
        self.lifts, self.terms, ways = list[Values](), list[Values](), list[tuple[Values, Size]]()
        for axis, unit in self.off:
            lift, pull = self._along(axis, unit)
            self.lifts.append(lift)
            ways += [(lift + unit + [0] * m, axis.gap), (pull + [0] * 2 * m, axis.swing)]
            ways.append(([0] * (n + m) + unit, axis.rate))
        sizes = [(way, wide(size.most)) for way, size in ways]
        self.shift = [sum((way[row] * size for way, size in sizes), start=arb(0)) for row in range(n)]
        places = self.near() + self.axes[0] + self.axes[1]
        for (one, size), (other, its_size) in combinations_with_replacement(ways, 2):
            z = moved(moved(places, one, 1), other, 2)
            bent = self.machine.rate(z[:n], z[n : n + m], z[n + m :], self.state.k)
            weight = size.mean * its_size.mean / (2 if one is other else 1)
            self.terms.append([along(along(entry, 1), 2) * weight for entry in bent])

    def _along(self, axis: AxisPiece, unit: Sequence[int]) -> tuple[Values, Values]:
        """Give the columns of G and P that belong to an axis, and note the terms with ε̄ and ψ."""
        s = self.piece.around(0, 3)
        (a, v, _), rate = s.axes, self.machine.rate
        lift = [along(one, 1) for one in rate(s.x, a, moved(v, unit, 1), s.k)]
        passed = rate(moved(s.x, lift, 1), moved(a, unit, 1), v, s.k)
        pull = [along(one, 1) - self._later(two) for one, two in zip(passed, lift, strict=True)]
        passed = rate(moved(s.x, pull, 1), a, v, s.k)
        rest = [self._later(one) - along(two, 1) for one, two in zip(pull, passed, strict=True)]
        self.terms.append([first(one) * axis.average for one in pull])
        self.terms.append([first(one) * axis.swing.mean for one in rest])
        return [first(one) for one in lift], [first(one) for one in pull]

    def _later(self, value: Any) -> Any:
        return value.derivative() / self.piece.half if isinstance(value, arb_series) else 0

    def near(self, off: Sequence[Any] | None = None) -> Values:
        """Enclose motions that are off X by so much."""
        beside = self.shift if off is None else [one + two for one, two in zip(self.shift, off, strict=True)]
        return [one + two for one, two in zip(self.state.x, beside, strict=True)]

    def in_rates(self, change: Sequence[Any], way: int = 1, off: Sequence[Any] | None = None) -> Values:
        """Give ∂y/∂x times a vector, or with −1 its inverse times one."""
        a, v, _ = self.state.axes
        q = self.near(off)[: len(change) // 2]
        return self.machine.in_rates(q, change, a, [way * one for one in v], self.state.k)

    def leap(self, leap: Sequence[arb], at_start: bool) -> Values:
        """Enclose by how much y leaps where x̃ does, and at the beginning how far it is from the machine's."""
        (a, v, _), wides = self.state.axes, [wide(one) for one in leap]
        total = wides
        for (axis, unit), lift in zip(self.off, self.lifts, strict=True):
            lifts = self.machine.rate(moved(self.near(wides), wides, 2), a, moved(v, unit, 1), self.state.k)
            own = [along(along(one, 1), 2) * wide(axis.gap.most) for one in lifts]
            if at_start:
                own = [one + two * wide(axis.first) for one, two in zip(own, lift, strict=True)]
            total = [one + two for one, two in zip(total, own, strict=True)]
        return self.in_rates(total, off=total)

    def shaken(self, off: Sequence[arb]) -> Iterator[tuple[list[Values], arb]]:
        """List derivatives of ∂ẏ/∂y along axes and speeds where y is off by so much, and means of these."""
        size, (a, v, _) = range(len(off)), self.state.axes
        columns = [self.in_rates([int(row == one) for row in size], -1, off) for one in size]
        x = self.near(self.in_rates(off, -1, off))
        for one, column in zip(size, columns, strict=True):
            x = moved(x, column, SINGLE << one)
        for axis, unit in self.off:
            for order, mean in enumerate([axis.gap.mean, axis.rate.mean]):
                near, fast = (moved(one, unit, 1) if n == order else one for n, one in enumerate(self.axes))
                rate = self.machine.rate(x, near, fast, self.state.k)
                changed = self.machine.in_rates(x[: len(x) // 2], rate, a, v, self.state.k)
                yield [[along(along(entry, 1), SINGLE << one) for one in size] for entry in changed], mean
