"""Histories by number: corners and draws, a search that climbs from the worst, rhythms likewise, a shift."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import Self

import attrs
import numpy as np

from gen_profile.assurance.proof.histories import SHIFT, Histories, History
from gen_profile.motion.profile import Array

CORNERS, DRAWS, SEARCH, RHYTHMS, LONG = "corners", "draws", "search", "rhythms", "shift"
SEARCHED = 0.25  # share of all histories that are no draws
ONE_RHYTHM = 25  # of so many histories, one is a rhythm
PER_RHYTHM = 4  # rhythms of a round; those of the first are drawn, the others climb
RHYTHM_LASTS = (32.0, 64.0, 128.0, 256.0)  # periods, by round: some 64 to 512 commands
MANY = 1000  # histories from which rhythms may last longer than the first of these
WITH_SHIFT = 2000  # histories from which one is a whole shift
MOST_CYCLES = 500_000  # of a rhythm, all of which are kept
PER_ROUND = 16  # histories of the search that begin at the same worst ones, at least
MOST_ROUNDS = 40
KEPT = 4  # of the worst, from which a round begins
CHANGED, RHYTHM_CHANGED = 0.2, 0.6  # share of the choices that a step changes
FIRST_STEP, LAST_STEP, RHYTHM_STEP = 0.3, 0.02, 0.1  # standard deviation of a step, in shares of the ranges


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
    def _edges(self) -> tuple[int, int, int, int]:
        """Numbers at which the search, the rhythms and the shift begin, and of all."""
        searched, planner = self.count - len(self.drawn), self.histories.spec.planner
        shift = int(self.count >= WITH_SHIFT and not (planner.live_rate or planner.live_noise))
        rhythms = min(searched, self.count // ONE_RHYTHM)
        return len(self.drawn), self.count - rhythms - shift, self.count - shift, self.count

    @property
    def rounds(self) -> list[range]:
        """Numbers that depend on what is found before, round by round."""
        first, rhythms, shift, end = self._edges
        number = min(MOST_ROUNDS, max(1, (end - first) // PER_ROUND))
        edges = np.linspace(first, end, number + 1, dtype=int).tolist()
        edges = [*(edge for edge in edges if edge < rhythms), *range(rhythms, shift, PER_RHYTHM), shift, end]
        return [range(begin, end) for begin, end in pairwise(edges) if begin < end]

    def group(self, number: int) -> str:
        """Tell what kind of history a number means."""
        if number >= len(self.drawn):
            return (SEARCH, RHYTHMS, LONG)[bisect_right(self._edges, number) - 1]
        return CORNERS if number < self.histories.corners(len(self.drawn)) else DRAWS

    def history(self, number: int) -> History:
        """Make the history of a number, which the search must have come to."""
        return self.histories.history(self.choices(number), self._lasts(number))

    def _lasts(self, number: int) -> float:
        """How long it goes on in a rhythm or for a shift, in s; 0 for any other."""
        _, rhythms, shift, _ = self._edges
        if not rhythms <= number < shift:
            return SHIFT * (number >= shift)
        among = RHYTHM_LASTS if self.count >= MANY else RHYTHM_LASTS[:1]
        most = MOST_CYCLES * self.histories.spec.export.cycle_time
        return min(most, self.histories.period * among[(number - rhythms) // PER_RHYTHM % len(among)])

    def choices(self, number: int) -> Array:
        """Choose as drawn, or a step away from one of the worst; at random where there are none."""
        if number < len(self.drawn):
            return np.asarray(self.drawn[number])
        round_ = next(k for k, numbers in enumerate(self.rounds) if number in numbers)
        parents, place = self.parents[round_], number - self.rounds[round_].start
        random = np.random.default_rng([self.seed, number])
        if not parents:
            return random.random(self.histories.choices)
        searches = sum(numbers.start < self._edges[1] for numbers in self.rounds)
        step = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** (round_ / max(1, searches - 1))
        step, share = (RHYTHM_STEP, RHYTHM_CHANGED) if self.group(number) == RHYTHMS else (step, CHANGED)
        *before, touring = self.choices(parents[place % len(parents)]).tolist()
        changed = random.random(len(before)) < share
        stepped = np.clip(before + changed * random.normal(scale=step, size=len(before)), 0.0, 1.0)
        return np.append(stepped, touring)
