"""What stands under a crane, and how near its loads may come to it: the table ``[path]``.

A load is a box that hangs upright, its middle at the place of the machine's body. It may not come nearer to a
stack than the clearance: either it is beside it by the one for the sides, or above it by the one for heights;
below what is overhead likewise, past which the ropes run. A machine of two horizontal axes goes straight from
start to target in plan view.
A stack that the load stands on, or hangs over, at the start or the target is left upwards: until the load is
clear of it, it stays within the clearance for the sides of where it stood.
"""

import math
import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant
from gen_profile.spec.plan_view import Area, StraightWay
from gen_profile.spec.structure import Checked, Faults, Structurer, kinds_of
from gen_profile.spec.values import Distance, NotNegative, Words
from gen_profile.support.bounded_file import DOCUMENT, read_bounded
from gen_profile.support.phrase import Phrase

MOST_STACKS = 200
ROOM_TOLERANCE = 5e-4  # m, by which a load may be nearer to a stack than the clearance
TOUCHING = 1e-3  # m, by which a load may be lower than what it stands on
NUDGE = 1e-6  # m, by which a machine is moved to see which way an axis carries the load


@attrs.frozen
class Lengths:
    """Allowed counts of numbers in a row."""

    counts: tuple[int, ...]

    def problem(self, row: Sequence[float], _: object) -> str:
        """Say that there are too few or too many; nothing where it fits."""
        return "" if len(row) in self.counts else "must hold another count of numbers"


Stack = Annotated[
    tuple[Distance, ...],
    Lengths((3, 5)),
    Words(
        "must be three numbers in m, such as [8.0, 10.5, 6.0]: from, to and height; or five in plan view: "
        "from and to in x, from and to in y, and height, found {found}"
    ),
]
Point = Annotated[
    tuple[Distance, Distance],
    Words("must be two numbers in m, such as [8.0, 6.0]: place and height, found {found}"),
]
Size = Annotated[
    tuple[NotNegative, ...],
    Lengths((2, 3)),
    Words(
        "must be two numbers in m, such as [2.5, 2.6]: width and height; or three in plan view: widths in x "
        "and y, and height, found {found}"
    ),
]
Place = tuple[float, float, float]
OTHER_UNIT = re.compile(r"(?<![^\W_])(?:[mcdkuµ]m|ft|feet|foot|inch(?:es)?)(?![^\W_])")  # in a heading
SOURCES = ("stacks", "profile", "file")


@attrs.frozen(kw_only=True)
class StacksSpec(Checked, table="path"):
    """What stands in the way of a load, in m; heights are counted from any level.

    Attributes
    ----------
    stacks : tuple of (from, to, height) or (x from, x to, y from, y to, height)
        Along the first horizontal axis, in its own coordinate, and endless across it; or in plan view, of a
        machine of two horizontal axes.
    overhead : tuple of the same
        What hangs from above, such as a portal's beams: the height is that of its underside.
    rail : float
        Height of where the load is suspended, from the same level as the stacks' heights.
    load, hook : (width, height) or (width in x, width in y, height)
        Of the end load, and of what hangs above it; the middle of each is where the machine has its body.
    clearance : float or (float, float)
        To the sides and upwards; one number is both.
    """

    stacks: tuple[Stack, ...]
    rail: Distance
    load: Size
    hook: Size | None = None
    overhead: tuple[Stack, ...] = ()
    clearance: NotNegative | tuple[NotNegative, NotNegative] = 0.5

    @property
    def clearances(self) -> tuple[float, float]:
        """To the sides and upwards, in m."""
        return self.clearance if isinstance(self.clearance, tuple) else (self.clearance, self.clearance)

    def size(self, body: int, bodies: int) -> tuple[float, float, float]:
        """Widths in x and y, and height, of a body in m; the last of them is the load."""
        size = self.load if body == bodies - 1 else self.hook or (0.0, 0.0)
        return size[0], size[-2], size[-1]

    @property
    def obstacles(self) -> tuple[tuple[float, ...], ...]:
        """Stacks, and behind them what is overhead."""
        return (*self.stacks, *self.overhead)

    def area(self, obstacle: int) -> Area:
        """Tell where one of the obstacles is in plan view."""
        low, high, *rest = self.obstacles[obstacle]
        return Area((low, high)) if len(rest) == 1 else Area((low, high), (rest[0], rest[1]))

    def named(self, obstacle: int) -> Phrase:
        """Name a stack by its place, or what is overhead, whose numbers follow."""
        low, high, *rest, height = self.obstacles[obstacle]
        overhead = obstacle >= len(self.stacks)
        if rest:
            template = (
                "the stack from {low:g} to {high:g} m in x and {near:g} to {far:g} m in y, {height:g} m high"
            )
            if overhead:
                template = (
                    "what is overhead from {low:g} to {high:g} m in x and {near:g} to {far:g} m in y, "
                    "{height:g} m high"
                )
            return Phrase(template, low=low, high=high, near=rest[0], far=rest[1], height=height)
        template = "the stack from {low:g} to {high:g} m, {height:g} m high"
        if overhead:
            template = "what is overhead from {low:g} to {high:g} m, {height:g} m high"
        return Phrase(template, low=low, high=high, height=height)


def stacks_of(table: Mapping[str, Any], folder: Path, structurer: Structurer) -> dict[str, Any]:
    """Take a profile of heights, or a file, for stacks: the higher end of every piece counts.

    Parameters
    ----------
    table : mapping
        What ``[path]`` states.
    folder : Path
        What the file's name is relative to.
    structurer : Structurer
    """
    faults = structurer.faults
    table = structurer.known(table, (*SOURCES, *kinds_of(StacksSpec)), "path")
    stacks = table.get("stacks")
    changes = stacks if isinstance(stacks, Mapping) else {}
    given = [key for key in SOURCES if key in table and not (key == "stacks" and changes)]
    others = {key: value for key, value in table.items() if key not in SOURCES}
    if len(given) != 1:
        faults.add("path", "state one of stacks, profile and file: what stands under the crane")
        return {**others, "stacks": []}
    (source,) = given
    rows = table[source]
    if source == "file":
        if not isinstance(rows, str):
            faults.add("path.file", "must name a CSV file of the columns from, to, height, or place, height")
        rows = _rows(folder / rows, faults) if isinstance(rows, str) else []
    if source == "profile" or (source == "file" and rows and len(rows[0]) == 2):
        rows = _pieces(rows, f"path.{source}", structurer)
    return {**others, "stacks": _changed(rows, changes, faults)}


def _changed(rows: Any, changes: Mapping[str, Any], faults: Faults) -> Any:
    """Put other numbers into stacks of a file or profile: whole rows, or some numbers of a row, by number."""
    if not changes:
        return rows
    changed: list[Any] = [list(row) for row in rows]
    for number, change in changes.items():
        if not number.isdecimal() or int(number) >= len(changed):
            faults.add(
                f"path.stacks.{number}", "there are {count} stacks, numbered from 0", count=len(changed)
            )
        elif not isinstance(change, Mapping):
            changed[int(number)] = change
        elif change.keys() <= set(map(str, range(len(changed[int(number)])))):
            for column, value in change.items():
                changed[int(number)][int(column)] = value
        else:
            template = "holds {count} numbers: 0 is from, 1 is to, {last} is the height"
            count = len(changed[int(number)])
            faults.add(f"path.stacks.{number}", template, count=count, last=count - 1)
    return changed


def _rows(path: Path, faults: Faults) -> list[list[float]]:
    """Read the rows of a CSV file: two, three or five numbers each, behind a header or none."""
    try:
        text = read_bounded(path, DOCUMENT).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        problem = getattr(error, "strerror", "it is no UTF-8 text")
        faults.add("path.file", "{path} cannot be read ({problem})", path=path, problem=problem)
        return []
    mark = next((mark for mark in ";\t" if mark in text), ",")
    rows: list[list[float]] = []
    heading = True
    for number, line in enumerate(text.splitlines(), start=1):
        cells = [cell.strip(' "') for cell in line.split(mark)]
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        row = [value for value in map(_number, cells) if value is not None]
        if heading and not row:
            problem = _misleading([cell.lower() for cell in cells])
        else:
            fits = len(row) == len(cells) == len(rows[0] if rows else cells) and len(row) in (2, 3, 5)
            template = "{path}: line {line} must be two, three or five numbers in m, as all others"
            problem = None if fits else template
            rows.append(row)
        heading = False
        if problem is not None:
            faults.add("path.file", problem, path=path.name, line=number)
            return []
    if not rows:
        faults.add("path.file", "{path} holds no rows of numbers", path=path.name)
    return rows


def _number(cell: str) -> float | None:
    try:
        number = float(cell)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _misleading(heading: Sequence[str]) -> str | None:
    """Tell what a heading says that is not so: another unit, or another order."""
    if any(OTHER_UNIT.search(cell) for cell in heading):
        return "{path}: line {line} names another unit than m; give places and heights in m"
    if any(cell.startswith("height") for cell in heading[:-1]):
        return "{path}: line {line} names a column behind the height; give from, to, height, or place, height"
    return None


def _pieces(points: Any, where: str, structurer: Structurer) -> list[tuple[float, float, float]]:
    """Make a stack of every piece of a polyline, as high as its higher end; equal neighbours become one."""
    fitted = structurer.fit(points, tuple[Point, ...], where, ())
    if any(left > right for (left, _), (right, _) in pairwise(fitted)):
        structurer.faults.add(where, "must go from left to right")
    pieces: list[tuple[float, float, float]] = []
    for (left, low), (right, high) in pairwise(fitted):
        height = max(low, high)
        if pieces and pieces[-1][1:] == (left, height):
            pieces[-1] = (pieces[-1][0], right, height)
        elif right > left:
            pieces.append((left, right, height))
    return pieces


@attrs.frozen(kw_only=True)
class StackZone:
    """Where a body of the machine may not be: within an area and below a height, in the machine's frame.

    Attributes
    ----------
    obstacle, body : int
        Numbers of both, as `StacksSpec.named` counts them.
    area : Area
        Of the body's middle, clearances included.
    top : float
        m, likewise.
    overhead : bool
        Whether it may not be above that height.
    own : tuple of Area
        Where the body may be all the same: it stands there at the start or the target.
    """

    obstacle: int
    body: int
    area: Area
    top: float
    overhead: bool = False
    own: tuple[Area, ...] = ()

    @property
    def low(self) -> float:
        """Where it begins in x, or along a line."""
        return self.area.x[0]

    @property
    def high(self) -> float:
        """Where it ends in x, or along a line."""
        return self.area.x[1]

    def beside(self, x: Array, y: Array | float = 0.0) -> Array:
        """Tell by how much more than it must a body is beside the stack, in m; negative where it is not."""
        return np.asarray(
            np.maximum.reduce([self.area.outside(x, y), *(-one.outside(x, y) for one in self.own)])
        )

    def clear(self, z: Array) -> Array:
        """Tell by how much more than it must a body is above the stack, or below what is overhead, in m."""
        return self.top - z if self.overhead else z - self.top

    def on(self, line: StraightWay) -> "StackZone | None":
        """Take what of it is along a line, as if that were the only axis; none where the line goes past."""
        spans = [line.span(one) for one in (self.area, *self.own)]
        if spans[0] is None:
            return None
        own = tuple(Area(span) for span in spans[1:] if span is not None)
        return attrs.evolve(self, area=Area(spans[0]), own=own)


def zones(path: StacksSpec, ends: Sequence[Sequence[Place]]) -> tuple[StackZone, ...]:
    """List where each body may not be.

    Parameters
    ----------
    path : StacksSpec
    ends : two sequences of (x, y, z)
        Where the bodies hang at the start and the target, in m, in the machine's frame.
    """
    sideways, above = path.clearances
    found = []
    for body in range(len(ends[0])):
        width, depth, height = path.size(body, len(ends[0]))
        places = [end[body] for end in ends]
        for number, (*_, stated) in enumerate(path.obstacles):
            area = path.area(number).widened(width / 2.0 + sideways, depth / 2.0 + sideways)
            level = stated - path.rail
            if number >= len(path.stacks):
                top = level - height / 2.0 - above
                found.append(StackZone(obstacle=number, body=body, area=area, top=top, overhead=True))
                continue
            level += height / 2.0
            over = [(x, y) for x, y, z in places if area.holds((x, y)) and level - TOUCHING <= z]
            own = (Area((x, x), (y, y)).widened(sideways, sideways) for x, y in dict.fromkeys(over))
            found.append(StackZone(obstacle=number, body=body, area=area, top=level + above, own=tuple(own)))
    return tuple(found)


def hanging(plant: Plant, parameters: Mapping[str, float], q_a: Sequence[float]) -> list[Place]:
    """Tell where the bodies of a machine at rest are, horizontally and above the suspension, in m."""
    still, named = [0.0] * len(plant.unactuated), SimpleNamespace(**parameters)
    places = plant.mechanics(still, list(q_a), named).place
    return [(float(x), float(y), float(z)) for x, y, z in places]


@attrs.frozen(kw_only=True)
class PathAxes:
    """Which of a machine's axes carry the load along, in x and perhaps in y, and which lifts it."""

    along: tuple[int, ...]
    hoist: int

    def line(self, start: Sequence[float], target: Sequence[float]) -> StraightWay:
        """Lay the way in plan view from where all axes start to their targets."""
        return StraightWay.between(*([end[axis] for axis in self.along] for end in (start, target)))


def path_axes(plant: Plant, parameters: Mapping[str, float]) -> PathAxes | None:
    """Find which axes of a machine carry the load along, and which lifts it; none of another machine."""
    if len(plant.actuated) not in (2, 3) or not plant.bodies:
        return None
    q_a, _ = plant.probe()
    here = np.array(hanging(plant, parameters, q_a)[-1])

    def moved(axis: int) -> tuple[int, ...]:
        there = [at + NUDGE * (number == axis) for number, at in enumerate(q_a)]
        ways = (np.array(hanging(plant, parameters, there)[-1]) - here) / NUDGE
        return tuple(round(way) if abs(way - round(way)) < NUDGE**0.5 else 2 for way in ways.tolist())

    ways = {moved(axis): axis for axis in range(len(q_a))}
    asked = [(1, 0, 0), (0, 1, 0)][: len(q_a) - 1]
    if set(ways) != {*asked, (0, 0, -1)}:
        return None
    return PathAxes(along=tuple(ways[way] for way in asked), hoist=ways[0, 0, -1])
