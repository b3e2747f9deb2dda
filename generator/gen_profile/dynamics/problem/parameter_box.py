"""Where in the ranges of parameters to look for the worst machine, and the search for it from there.

A motion leaves of a mode what its acceleration's spectrum has at the mode's frequency ω. The spectrum of a
motion that lasts T changes over ω no faster than e^{iωT} does; so among machines whose modes' phases ω T are
a fraction of a radian apart, the best starts for a local search are found.

A place is a row of shares from 0 to 1, one per range: from its least value to its greatest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from itertools import product

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.dynamics.problem.linearization import eigenvalues_at
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant

Ranges = Mapping[str, tuple[float, float]]  # least and greatest values of parameters
Phases = Callable[[Array], Array]  # of every mode in rad at the end of the motion, (places, modes)
Shares = Callable[[Array], Array]  # of their limits that several figures take up, (places, figures)

MOST_TRACED = 3  # ranges whose machines are all followed in full, which takes much longer than peaks alone
TURN = 0.6  # rad by which phases may differ between neighbours on a line
FEWEST = 9  # places on a line
FINE = 513  # places at which a line's phases are found
CORNERS = 6  # ranges up to which all corners are places
FEWEST_SPREAD = 32  # places per range that are spread over a box
MOST = 512  # places that are spread at most, and twice as many on all lines together
FEW = 64  # likewise, where machines cost more
STARTS = 8  # of local searches for each figure
APART = 2.5  # steps between two starts
ROUNDS = 8  # of a local search along one range, and two more for each further one
NEAR_END = 0.1  # of a range: as near to an end a search looks at the end, too
POLLS = 4096  # places that all local searches may look at, however many ranges there are


@attrs.frozen(kw_only=True, eq=False)
class Start:
    """Places to begin a search at.

    Attributes
    ----------
    places : (places, ranges) array
    steps : (ranges,) array
        How far apart places are along each range, about.
    """

    places: Array
    steps: Array


@attrs.frozen(kw_only=True, eq=False)
class Box:
    """Ranges of a machine's parameters under a motion.

    Attributes
    ----------
    plant : Plant
    nominal : mapping of str to float
        Value of every parameter.
    ranges : mapping of str to (float, float)
        Least and greatest values; at least one. What is no parameter of the plant changes no machine.
    ends : sequence of (m,) sequences of float
        Where the axes start and stop.
    duration : float
        Of the motion in s.
    """

    plant: Plant
    nominal: Mapping[str, float]
    ranges: Ranges
    ends: Sequence[Sequence[float]]
    duration: float

    def machines(self, places: Array) -> Array:
        """Parameters at some places, shape (places, parameters), in the plant's order."""
        names = self._names()
        machines = np.tile([float(self.nominal[name]) for name in names], (len(places), 1))
        for (name, (low, high)), fraction in zip(self.ranges.items(), places.T, strict=True):
            if name in names:
                machines[:, names.index(name)] = low + fraction * (high - low)
        return machines

    def parameters(self, places: Array) -> list[dict[str, float]]:
        """Parameters at some places by name."""
        return [dict(zip(self._names(), row, strict=True)) for row in self.machines(places).tolist()]

    def phases(self, places: Array) -> Array:
        """Find how far in rad the modes turn during the motion, shape (places, modes).

        Frequencies are the mean of those at both ends.
        """
        ends = tuple(tuple(map(float, q_a)) for q_a in self.ends)
        return self.duration * _frequencies(self.plant, self.machines(places).tobytes(), ends)

    def _names(self) -> list[str]:
        return [parameter.name for parameter in self.plant.parameters]


@lru_cache(maxsize=4)  # the plan and the check look at the same box
def _frequencies(plant: Plant, machines: bytes, ends: tuple[tuple[float, ...], ...]) -> Array:
    """Find the frequencies of many machines in rad/s, the mean of those at some places of the axes."""
    rows, modes = np.frombuffer(machines).reshape(-1, len(plant.parameters)), len(plant.unactuated)
    frequencies = [np.sort(rates.imag, axis=1)[:, modes:] for rates in eigenvalues_at(plant, rows, ends)]
    return np.asarray(np.mean(frequencies, axis=0))


def box_of(problem: Problem, ranges: Ranges) -> Box | None:
    """State the box of some ranges, least and greatest values, for a problem's move; none where none is wide.

    Parameters
    ----------
    problem : Problem
    ranges : mapping of str to (float, float)
    """
    wide = {name: ends for name, ends in ranges.items() if ends[1] > ends[0]}
    if not wide:
        return None
    return Box(
        plant=problem.plant,
        nominal=problem.parameters,
        ranges=wide,
        ends=(problem.start, problem.target),
        duration=problem.duration,
    )


def ends(ranges: Ranges) -> list[dict[str, float]]:
    """List the corners of some ranges, of many the two extreme ones, and the ends of each range by itself."""
    meeting = corners(ranges)
    if len(ranges) > MOST_TRACED:
        meeting = [meeting[0], meeting[-1]]
    alone = [{name: end} for name, (low, high) in ranges.items() for end in (high, low)]
    return [*meeting, *alone] if len(ranges) > 1 else meeting


def corners(ranges: Ranges) -> list[dict[str, float]]:
    """List the corners of some ranges, from all upper ends to all lower ones; none of no ranges."""
    meeting = product(*((high, low) for low, high in ranges.values()))
    return [dict(zip(ranges, corner, strict=True)) for corner in meeting if corner]


def machines_of(problem: Problem) -> list[dict[str, float]]:
    """List the parameters of machines at the ends of a problem's ranges and within, the nominal one first."""
    nominal = dict(problem.parameters)
    return [nominal, *({**nominal, **shifted} for shifted in ends(problem.ranges)), *machines_inside(problem)]


def machines_inside(problem: Problem) -> list[dict[str, float]]:
    """List the parameters of machines all over a problem's ranges, for its move; none of no ranges."""
    box = box_of(problem, problem.ranges)
    return [] if box is None else box.parameters(start(box.phases, len(box.ranges), FEW).places)


def start(phase_of: Phases, ranges: int, most: int = MOST) -> Start:
    """Choose places all over a box: on the lines through its middle, at its corners, within and on its faces.

    Parameters
    ----------
    phase_of : callable
        Such as `Box.phases`.
    ranges : int
        At least 1.
    most : int
        Number of places to spread within at most, on faces and on edges; on all lines twice as many.
    """
    lines = [_line(phase_of, ranges, axis, max(2 * most // ranges, FEWEST)) for axis in range(ranges)]
    steps = np.array([1.0 / (len(line) - 1) for line in lines])
    if ranges == 1:
        return Start(places=lines[0], steps=steps)
    from scipy.stats import qmc  # noqa: PLC0415  # half a second

    corners = list(product((0.0, 1.0), repeat=ranges)) if ranges <= CORNERS else []
    points = qmc.Halton(ranges, scramble=False)
    coarse = points.random(min(FEWEST_SPREAD * ranges, most))
    span = np.ptp(phase_of(np.concatenate([coarse, *lines])), axis=0)
    count = int(min(np.prod(1.0 + span), most))
    spread = [coarse, points.random(max(count - len(coarse), 0)), *_on_faces(coarse)]
    return Start(places=np.concatenate([np.array(corners).reshape(-1, ranges), *lines, *spread]), steps=steps)


def _on_faces(places: Array) -> list[Array]:
    """Move places onto the faces of a box, one after another, and onto the edges between two of them."""
    ranges, numbers = places.shape[1], np.arange(len(places))
    found, moved = [], places
    for beyond in range(min(ranges - 1, 2)):
        moved = moved.copy()
        column = (numbers + beyond * (1 + numbers // ranges % (ranges - 1))) % ranges
        moved[numbers, column] = np.round(moved[numbers, column])
        found.append(moved)
    return found


def _line(phase_of: Phases, ranges: int, axis: int, most: int) -> Array:
    """Choose places on the line along one range through the middle, evenly by the fastest turning mode."""
    fine = np.linspace(0.0, 1.0, FINE)
    places = np.full((FINE, ranges), 0.5)
    places[:, axis] = fine
    turns = np.abs(np.diff(phase_of(places), axis=0)).max(axis=1)
    measure = np.concatenate([[0.0], np.cumsum(turns / TURN)]) + (FEWEST - 1) * fine
    count = min(int(np.ceil(measure[-1])) + 1, most)
    line = np.full((count, ranges), 0.5)
    line[:, axis] = np.interp(np.linspace(0.0, measure[-1], count), measure, fine)
    return line


def worst_places(shares: Shares, begun: Start, keep: int = 1) -> tuple[Array, int]:
    """Search a box for the places where figures are greatest: pattern searches from the best starts.

    The directions are turned at random between rounds (C. Audet and J. E. Dennis, Mesh adaptive direct search
    algorithms, SIAM J. Optim. 17, 2006), which gets along the ridges of equal frequency.

    Parameters
    ----------
    shares : callable
    begun : Start
    keep : int
        How many local maxima of each figure are wanted at most.

    Returns
    -------
    places : (places, ranges) array
        Local maxima of each figure, those of the first figure first, each figure's greatest first.
    tried : int
        Number of places looked at, those that were come back to included.
    """
    shares = _remembering(shares)
    values, ranges = shares(begun.places), begun.places.shape[1]
    rounds = ROUNDS + 2 * (ranges - 1)
    starts = min(
        STARTS, max(POLLS // (rounds * (2 * ranges + 1) * values.shape[1]) - (3 + ranges) * keep, keep)
    )
    chosen = [
        (place, figure)
        for figure, column in enumerate(values.T)
        for place in _separate(begun.places, column, begun.steps)[:starts]
    ]
    index, figure = (np.array(column) for column in zip(*chosen, strict=True))
    climbers = _Climbers(
        places=begun.places[index],
        best=values[index, figure],
        figure=figure,
        reach=np.ones(len(index)),
        way=np.zeros((len(index), ranges)),
    )
    bases = np.linalg.qr(np.random.default_rng(0).standard_normal((2 * rounds, ranges, ranges)))[0]
    bases[rounds::2] = np.eye(ranges)  # along faces and edges, too
    tried = len(values)
    for number, basis in enumerate(bases[: rounds if ranges == 1 else None]):
        if number == rounds:  # the greatest of the maxima more exactly
            climbers = climbers.greatest(begun.steps, keep)
        climbers = climbers.polled(shares, np.concatenate([basis, -basis]) * begun.steps)
        tried += (2 * ranges + 1) * len(climbers.best)
    climbers = climbers.greatest(begun.steps, keep)
    if ranges > 1:
        edges, along = climbers.at_ends(shares), np.concatenate([np.eye(ranges), -np.eye(ranges)])
        between = (edges.places % 1.0 > 0.0)[:, None]
        polls = len(edges.best) * (2 * ranges + 1)
        rounds = min(rounds, POLLS // polls)
        for _ in range(rounds):
            edges = edges.polled(shares, along * begun.steps * between)
        tried += len(edges.best) + rounds * polls
        climbers = climbers.joined(edges).greatest(begun.steps, keep)
    return climbers.places, tried


@attrs.frozen(kw_only=True, eq=False)
class _Climbers:
    """Local searches: where each is, its figure there, which one that is, how far it looks, and its way."""

    places: Array
    best: Array
    figure: NDArray[np.intp]
    reach: Array
    way: Array  # of the last two rounds

    def polled(self, shares: Shares, ways: Array) -> _Climbers:
        """Look in some ways, and on as in the last rounds; go to the greatest figure, or look less far."""
        around = self.places[:, None] + self.reach[:, None, None] * ways
        polls = np.clip(np.concatenate([around, (self.places + self.way)[:, None]], axis=1), 0.0, 1.0)
        found = shares(polls.reshape(-1, ways.shape[-1])).reshape(*polls.shape[:2], -1)
        own = np.take_along_axis(found, self.figure[:, None, None], axis=2)[:, :, 0]
        top, rows = own.argmax(axis=1), np.arange(len(own))
        better = own[rows, top] > self.best
        places = np.where(better[:, None], polls[rows, top], self.places)
        return _Climbers(
            places=places,
            best=np.where(better, own[rows, top], self.best),
            figure=self.figure,
            reach=np.where(better, np.minimum(2.0 * self.reach, 1.0), 0.5 * self.reach),
            way=places - self.places + 0.5 * self.way,
        )

    def at_ends(self, shares: Shares) -> _Climbers:
        """Begin anew with parameters at the ends of their ranges: those that are nearly there, and one more.

        On a ridge the others have to change with it, so that none gets there by itself.
        """
        ends, one_more = np.round(self.places), [*np.eye(self.places.shape[1], dtype=bool), False]
        near = np.abs(self.places - ends) < NEAR_END
        places = np.concatenate([np.where(near | more, ends, self.places) for more in one_more])
        figure = np.tile(self.figure, len(one_more))
        best = shares(places)[np.arange(len(places)), figure]
        return _Climbers(
            places=places, best=best, figure=figure, reach=np.ones(len(places)), way=np.zeros_like(places)
        )

    def joined(self, others: _Climbers) -> _Climbers:
        """Take others, too."""
        return _Climbers(
            **{name: np.concatenate([one, getattr(others, name)]) for name, one in attrs.asdict(self).items()}
        )

    def greatest(self, steps: Array, keep: int) -> _Climbers:
        """Keep some of each figure that are not close to one another, greatest first."""
        kept = [
            rows[_separate(self.places[rows], self.best[rows], steps)[:keep]]
            for rows in (np.flatnonzero(self.figure == number) for number in range(self.figure.max() + 1))
        ]
        return _Climbers(
            **{name: values[np.concatenate(kept)] for name, values in attrs.asdict(self).items()}
        )


def _remembering(shares: Shares) -> Shares:
    """Find shares once for every place: searches at an edge, or that meet, come back to some."""
    known: dict[bytes, Array] = {}

    def found(places: Array) -> Array:
        keys = [place.tobytes() for place in places]
        new = {key: place for key, place in zip(keys, places, strict=True) if key not in known}
        if new:
            known.update(zip(new, shares(np.array(list(new.values()))), strict=True))
        return np.array([known[key] for key in keys])

    return found


def _separate(places: Array, values: Array, steps: Array) -> NDArray[np.intp]:
    """Choose the greatest values' places that are not close to one another, greatest first."""
    left = np.argsort(-values, kind="stable")
    chosen: list[int] = []
    while len(left) and len(chosen) < STARTS:
        chosen.append(int(left[0]))
        left = left[np.linalg.norm((places[left] - places[left[0]]) / steps, axis=1) >= APART]
    return np.array(chosen, dtype=np.intp)
