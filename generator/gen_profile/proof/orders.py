"""What a planner block is told, from its inputs alone: which command holds from which cycle to which."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.planner.interface import BlockAxis

POSITION, VELOCITY, STOP, QUICK_STOP = "position", "velocity", "stop", "quick-stop"


@attrs.frozen(kw_only=True)
class Order:
    """A command that holds, and how fast it may be followed.

    Attributes
    ----------
    begin, end : int
        Cycles; the end is that of the next one's begin.
    kind : str
        One of those above.
    values : tuple of float
        Of each axis the target or the velocity; none of a stop.
    tops : tuple of float
        Of each axis the greatest velocity, by limit, override and velocity limit; 0 holds.
    refused : int
        Error for which it is a stop.
    edge : int
        Cycle in which the command came; before `begin` where but the velocity limits have changed since.
    """

    begin: int
    end: int
    kind: str
    values: tuple[float, ...]
    tops: tuple[float, ...]
    edge: int
    refused: int = 0


@attrs.frozen(kw_only=True)
class Ends:
    """Between which a block may move an axis, in its unit and s."""

    velocity: float
    acceleration: float
    jerk: float
    targets: tuple[float, float]


def orders(
    begins: Sequence[int], rows: Array, names: Sequence[str], axes: Sequence[BlockAxis], limits: Sequence[Ends], last: int
) -> tuple[Order, ...]:
    """Read rows of inputs as the block's header tells.

    Parameters
    ----------
    begins : (rows,) sequence of int
        From which cycle each row holds.
    rows : (rows, inputs) array
    names : sequence of str
        Of the inputs.
    axes : sequence of BlockAxis
    limits : sequence of Ends
        Of the same axes.
    last : int
        Cycle after the last one.
    """
    found = list[Order]()
    for order in _changes(begins, rows, names, axes, limits):
        before = found[-1] if found else None
        if before and _same(order, before):
            continue
        if before and order.begin == before.begin:
            found.pop()
        found.append(order)
    ends = [*(order.begin for order in found[1:]), last]
    return tuple(attrs.evolve(order, end=min(end, last)) for order, end in zip(found, ends, strict=True) if order.begin < last)


def _same(order: Order, before: Order) -> bool:
    """Whether nothing new is told; stops know no velocity limit."""
    again = (order.kind, order.values) == (before.kind, before.values) and not order.refused
    return again and (order.kind in (STOP, QUICK_STOP) or order.tops == before.tops)


def _changes(
    begins: Sequence[int], rows: Array, names: Sequence[str], axes: Sequence[BlockAxis], limits: Sequence[Ends]
) -> Iterator[Order]:
    """Give an order for every row."""
    place = {name: number for number, name in enumerate(names)}

    def of(name: str) -> list[int]:
        return [place[axis.of(name)] for axis in axes]

    targets, sticks, slow = of("fTarget"), of("fVelocityCommand"), of("fVelocityLimit")
    kind, values, execute, edge = STOP, tuple[float, ...](), False, 0
    full = tops = tuple(own.velocity for own in limits)
    for begin, row in zip(begins, rows.tolist(), strict=True):
        override, given = row[place["rOverride"]], [row[number] for number in slow]
        if 0.0 <= override <= 1.0 and min(given) >= 0.0:  # others are the block's to refuse
            tops = tuple(min(override * most, limit or most) for most, limit in zip(full, given, strict=True))
        refused = 0
        was, rises = (kind, values), bool(row[place["bExecute"]]) and not execute
        execute = bool(row[place["bExecute"]])
        if row[place["bQuickStop"]]:
            kind, values = QUICK_STOP, ()
        elif row[place["bStop"]] or not row[place["bEnable"]]:
            kind, values = STOP, ()
        elif row[place["bVelocity"]]:
            kind, values = VELOCITY, tuple(row[number] for number in sticks)
        elif rises:
            kind, values = POSITION, tuple(row[number] for number in targets)
            if not all(low <= value <= high for value, (low, high) in zip(values, (own.targets for own in limits), strict=True)):
                kind, values, refused = STOP, (), 3
        elif kind in (VELOCITY, QUICK_STOP):
            kind, values = STOP, ()
        if rises or was != (kind, values):
            edge = begin
        yield Order(begin=begin, end=begin, kind=kind, values=values, tops=tops, edge=edge, refused=refused)


def told_rows(begins: Sequence[int], rows: Array, ignored: Sequence[int]) -> tuple[list[int], Array]:
    """Leave out rows in which but some inputs (those of live parameters) change."""
    if len(rows) < 2:
        return list(begins), rows
    kept = np.delete(rows, ignored, axis=1)
    changed = np.flatnonzero(np.concatenate([[True], (kept[1:] != kept[:-1]).any(axis=1)]))
    return [begins[number] for number in changed], rows[changed]
