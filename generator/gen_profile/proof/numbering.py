"""Histories by number: corners and draws first, then those of a search that climbs from the worst."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Self

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.proof.histories import Histories, History

CORNERS, DRAWS, SEARCH = "corners", "draws", "search"
SEARCHED = 0.25  # share of all histories that the search takes
PER_ROUND = 16  # histories of the search that begin at the same worst ones, at least
MOST_ROUNDS = 40
KEPT = 4  # of the worst, from which a round begins
CHANGED = 0.2  # share of the choices that a step changes
FIRST_STEP, LAST_STEP = 0.3, 0.02  # standard deviation of a step, in shares of the ranges


@attrs.frozen(kw_only=True, eq=False)
class Numbering:
    """Which history a number means.

    Attributes
    ----------
    histories : Histories
    count : int
    seed : int
    drawn : (count without the search, choices) array
    parents : tuple of tuples of int
        Numbers of the histories from which each round of the search began, as far as it has come.
    """

    histories: Histories
    count: int
    seed: int
    drawn: Array
    parents: tuple[tuple[int, ...], ...] = ()

    @classmethod
    def of(cls, histories: Histories, count: int, seed: int, parents: Sequence[Sequence[int]] = ()) -> Self:
        """Draw so many histories."""
        drawn = histories.drawn(count - int(SEARCHED * count), seed)
        rounds = tuple(tuple(numbers) for numbers in parents)
        return cls(histories=histories, count=count, seed=seed, drawn=drawn, parents=rounds)

    def after_round(self, worst: Sequence[int]) -> Numbering:
        """Begin one more round of the search at some of the histories before."""
        return attrs.evolve(self, parents=(*self.parents, tuple(worst)))

    @property
    def rounds(self) -> list[range]:
        """Numbers of the search's histories, round by round."""
        searched = self.count - len(self.drawn)
        if not searched:
            return []
        number = min(MOST_ROUNDS, max(1, searched // PER_ROUND))
        edges = np.linspace(len(self.drawn), self.count, number + 1, dtype=int).tolist()
        return [range(begin, end) for begin, end in pairwise(edges)]

    def group(self, number: int) -> str:
        """Tell what kind of history a number means."""
        if number >= len(self.drawn):
            return SEARCH
        return CORNERS if number < self.histories.corners(len(self.drawn)) else DRAWS

    def history(self, number: int) -> History:
        """Make the history of a number, which the search must have come to."""
        return self.histories.history(self.choices(number))

    def choices(self, number: int) -> Array:
        """Choose as drawn, or a step away from one of the worst."""
        if number < len(self.drawn):
            return np.asarray(self.drawn[number])
        round_ = next(k for k, numbers in enumerate(self.rounds) if number in numbers)
        parents, place = self.parents[round_], number - self.rounds[round_].start
        step = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** (round_ / max(1, len(self.rounds) - 1))
        random = np.random.default_rng([self.seed, number])
        before = self.choices(parents[place % len(parents)])
        changed = random.random(before.shape) < CHANGED
        return np.clip(before + changed * random.normal(scale=step, size=before.shape), 0.0, 1.0)
