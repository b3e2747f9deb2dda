"""Boxes of parameters: the whole of some ranges, halved as often as it takes."""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import prod

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import Array, Ball, ball

# of every range how often it was halved, and which of the parts it is
DyadicBox = tuple[tuple[int, int], ...]


@attrs.frozen(kw_only=True, eq=False)
class Ranges:
    """Parameters that vary.

    Attributes
    ----------
    names : tuple of str
    lower, upper : (ranges,) array
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array

    @property
    def ends(self) -> dict[str, tuple[float, float]]:
        """Least and greatest values by name."""
        return dict(zip(self.names, zip(self.lower.tolist(), self.upper.tolist(), strict=True), strict=True))

    def values(self, box: DyadicBox, places: Array) -> Array:
        """Values at places on [−1, 1] of a box, rounded, shape (places, ranges)."""
        low, high = (np.array(ends).reshape(-1) for ends in shares(box))
        fractions = 0.5 * (low + high) + 0.5 * (high - low) * places
        return np.asarray(self.lower + fractions * (self.upper - self.lower))

    def widths(self, box: DyadicBox) -> Array:
        """Give half of a box's width in every range, as a share of its middle, at most 1."""
        low, high = self.values(box, np.array(-1.0)), self.values(box, np.array(1.0))
        return np.asarray((high - low) / np.maximum(np.abs(low + high), high - low))

    def enclosed(self, boxes: Sequence[DyadicBox]) -> tuple[Ball, Ball]:
        """Enclose the ends of boxes, each of shape (boxes, ranges)."""
        low, high = (np.array(ends).reshape(len(boxes), -1) for ends in zip(*map(shares, boxes), strict=True))
        width = ball(self.upper) - self.lower
        return width * low + self.lower, width * high + self.lower


def shares(box: DyadicBox) -> tuple[list[float], list[float]]:
    """Where a box begins and ends in every range, in shares of it, exactly."""
    return [index / 2**level for level, index in box], [(index + 1) / 2**level for level, index in box]


def halves(box: DyadicBox, range_: int) -> tuple[DyadicBox, DyadicBox]:
    """Cut a box in two."""
    level, index = box[range_]
    first, second = ((*box[:range_], (level + 1, 2 * index + part), *box[range_ + 1 :]) for part in (0, 1))
    return first, second


def volume(boxes: Iterable[DyadicBox]) -> Fraction:
    """Sum up the fractions of the whole that boxes are."""
    return sum((Fraction(1, prod(2**level for level, _ in box)) for box in boxes), Fraction(0))


def covers(boxes: Sequence[DyadicBox]) -> bool:
    """Tell whether boxes are all there is: disjoint, and together of the whole's volume."""
    inside = all(0 <= index < 2**level for box in boxes for level, index in box)
    if not inside or volume(boxes) != 1:
        return False
    low, high = (np.array(ends).reshape(len(boxes), -1) for ends in zip(*map(shares, boxes), strict=True))
    return not any(
        bool(((low[number] < high[number + 1 :]) & (low[number + 1 :] < high[number])).all(axis=1).any())
        for number in range(len(boxes) - 1)
    )
