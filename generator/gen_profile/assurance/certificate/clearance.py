"""How near bodies come to what stands in their way at most: by halving of times and parameters.

A body is clear of a zone where one of several forms, linear in its place, is not negative: beside it along an
axis, above it, or near enough to where it stands at an end. The greatest of forms a and b is at least
λ a + (1 − λ) b for every λ of [0, 1]. As a load passes an edge, one of two rises while the other falls: with
the λ for which the sum stands still, few halvings are needed.
"""

from collections.abc import Sequence
from functools import cached_property

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import UNIT, Array
from gen_profile.assurance.certificate.arithmetic.chebyshev import ROUND_UP, ends, halves
from gen_profile.spec.plan_view import Area
from gen_profile.spec.stacks import StackZone

CLOSE, OFF = 5e-5, 2.0  # m below what was met, and times what places are off: a bound is close enough
MOST_WORK = 2**27  # coefficients that are looked at, after which a bound is as low as it is
FLAT = 1e-3  # of what is straight, beside what is bent, in the choice of what is halved


@attrs.frozen(kw_only=True)
class ZoneForms:
    """What is not negative where a body is clear of a zone: the last form, or all of one of the groups.

    Attributes
    ----------
    zone : StackZone
    """

    zone: StackZone

    @cached_property
    def _each(self) -> list[list[tuple[int, float, float]]]:
        """List groups of forms: coordinate, its factor, and what is added."""
        zone = self.zone
        outside = [[one] for one in _sides(zone.area, 1.0)]
        return [*outside, *(_sides(area, -1.0) for area in zone.own)]

    @cached_property
    def groups(self) -> list[list[int]]:
        """Numbers of the forms of each group, of all sides that there are."""
        numbers, count = [], 0
        for group in self._each:
            numbers.append(list(range(count, count + len(group))))
            count += len(group)
        return numbers

    @cached_property
    def factors(self) -> Array:
        """Of places in forms, (forms, 3), the height's last."""
        rows = [np.eye(3)[k] * factor for group in self._each for k, factor, _ in group]
        return np.array([*rows, np.eye(3)[2] * (-1.0 if self.zone.overhead else 1.0)])

    @cached_property
    def constants(self) -> Array:
        """What is added to forms, (forms,)."""
        added = [constant for group in self._each for *_, constant in group]
        return np.array([*added, self.zone.top if self.zone.overhead else -self.zone.top])


def _sides(area: Area, sign: float) -> list[tuple[int, float, float]]:
    """List forms of an area's edges, positive outside, or with the other sign within; of edges there are."""
    edges = [
        (k, way, edge)
        for k, pair in enumerate((area.x, area.y))
        for way, edge in zip((-1.0, 1.0), pair, strict=True)
    ]
    return [(k, sign * way, -sign * way * edge) for k, way, edge in edges if np.isfinite(edge)]


def least_room(series: Array, off: Array, zone: StackZone) -> tuple[float, float]:
    """Bound from below how much more than it must a body is away from a zone: by 0, or closely where less.

    Parameters
    ----------
    series : (items, 3, terms, …) array
        Chebyshev series of its place, of time first.
    off : (items, 3) array
        How far places are from those of the series.
    zone : StackZone

    Returns
    -------
    (float, float)
        The bound, and the least room that the series have at some places, in m; not a number without one.
    """
    forms, bound, met, work = ZoneForms(zone=zone), np.inf, np.inf, 0
    waiting = [(series, off)]
    while waiting:
        items, missing = waiting.pop()
        if not (np.isfinite(items).all() and np.isfinite(missing).all()):
            return np.nan, np.nan
        lower, seen = _rooms(forms, items, missing)
        met = min(met, float(seen.min()))
        near = lower < np.minimum(0.0, met - CLOSE - OFF * missing.max(axis=1))
        work += items.size
        if work > MOST_WORK:
            near &= False
        bound = min(bound, float(lower[~near].min(initial=np.inf)))
        if near.any():
            waiting += _halved(items[near], missing[near])
    return bound, met


def _rooms(forms: ZoneForms, items: Array, off: Array) -> tuple[Array, Array]:
    """Bound the room of every item from below, and tell the least at its corners and middles."""
    terms = items.shape[2:]
    values = np.tensordot(items, forms.factors, axes=(1, 1))  # (items, terms …, forms)
    values = np.moveaxis(values, -1, 1).reshape(len(items), len(forms.factors), -1)
    values[..., 0] += forms.constants
    sizes = np.abs(values).sum(axis=-1) + np.abs(forms.constants)
    missing = (off @ np.abs(forms.factors).T + 1e-14 * sizes) * ROUND_UP

    def lowest(series: Array, missing: Array) -> Array:
        middle = series[..., 0]
        spread = (np.abs(series).sum(axis=-1) - np.abs(middle)) * ROUND_UP
        return np.asarray(middle - spread - missing)

    own = lowest(values, missing)
    first = int(np.prod(terms[1:]))  # degree 1 in time, and 0 in all others
    slopes = values[..., first] if terms[0] > 1 else np.zeros(own.shape)
    up = slopes[:, -1:]
    share = np.where(slopes[:, :-1] * up < 0.0, slopes[:, :-1] / (slopes[:, :-1] - up + 1e-300), 0.0)
    share = np.clip(share, 0.0, 1.0)
    both = share[..., None] * values[:, -1:] + (1.0 - share[..., None]) * values[:, :-1]
    sums = share * missing[:, -1:] + (1.0 - share) * missing[:, :-1] + 1e-14 * sizes.max(axis=1)[:, None]
    beside = np.maximum(own[:, :-1], lowest(both, sums * ROUND_UP))
    lower = np.maximum.reduce([own[:, -1], *(beside[:, group].min(axis=1) for group in forms.groups)])
    corners = values.reshape(*values.shape[:2], *terms)
    for axis, count in enumerate(terms, start=2):
        corners = np.moveaxis(np.tensordot(corners, ends(count), axes=(axis, 1)), -1, axis)
    corners = corners.reshape(*values.shape[:2], -1)
    seen = np.maximum.reduce([corners[:, -1], *(corners[:, group].min(axis=1) for group in forms.groups)])
    return lower, seen.min(axis=1)


def _halved(items: Array, off: Array) -> list[tuple[Array, Array]]:
    """Halve each item's variable in which places are bent most, or change most where they are straight."""
    shape = items.shape[2:]
    degree = sum(np.ix_(*map(np.arange, shape)))
    weighed = (np.abs(items) * np.where(degree > 1, 1.0, FLAT)).sum(axis=1)
    axes = range(1, len(shape) + 1)
    rest = [weighed.take([0], axis=axis).reshape(len(items), -1).sum(axis=1) for axis in axes]
    chosen = np.argmin(np.array(rest), axis=0)
    parts = []
    for axis in np.unique(chosen).tolist():
        own, terms = items[chosen == axis], shape[axis]
        sizes = np.abs(own).reshape(*own.shape[:2], -1).sum(axis=-1)
        missing = (off[chosen == axis] + 2.0 * terms * (terms + 4) * UNIT * sizes) * ROUND_UP
        for matrix in halves(terms):
            part = np.moveaxis(np.tensordot(own, matrix, axes=(axis + 2, 1)), -1, axis + 2)
            parts.append((part, missing))
    return parts


def rooms(coordinates: Sequence[tuple[Array, Array]], zones: Sequence[StackZone]) -> tuple[Array, Array]:
    """Bound the room of all bodies to all zones from below, for each box, as `least_room` does.

    Parameters
    ----------
    coordinates : sequence of (series, off)
        x, y and z of each body: (boxes, pieces, terms, …) and (boxes, pieces).
    zones : sequence of StackZone

    Returns
    -------
    (boxes,) arrays
        The bounds, and the least room that was met.
    """
    series, off = (np.stack(parts, axis=2) for parts in zip(*coordinates, strict=True))
    found = np.array(
        [
            [
                least_room(places[:, k : k + 3], away[:, k : k + 3], zone)
                for zone in zones
                for k in [3 * zone.body]
            ]
            for places, away in zip(series, off, strict=True)
        ]
    )
    bounds, met = found.min(axis=1).T  # which keeps what is not a number
    return bounds, met
