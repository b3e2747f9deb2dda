"""The knobs of a spec: what may be changed, between which bounds, as the spec's own annotations say.

A knob's words are looked up by its key in ``assets/words.json``; only a machine's parameters bring their own.
"""

import math
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import attrs

from gen_profile.dynamics.evaluation.phrases import place_unit
from gen_profile.plants.plant import Parameter
from gen_profile.spec.model import MoveSpec, Spec
from gen_profile.spec.stacks import StacksSpec
from gen_profile.spec.structure import kinds_of
from gen_profile.spec.values import Bounds
from gen_profile.support.units import RATES

REACH = 4.0  # times the value to begin with, up to which a slider goes, and down to which share of it
OF_THE_LOAD = ("limits.sway", "limits.overshoot")  # limits in m whatever the axes' units are
_TABLES = tomllib.loads((Path(__file__).parents[2] / "lists" / "knobs.toml").read_text("utf-8"))
UNITS: Mapping[str, str] = _TABLES["units"]
USUAL: Mapping[str, float] = _TABLES["usual"]


@attrs.frozen(kw_only=True)
class Knob:
    """One value of a spec, as a page shows it.

    Attributes
    ----------
    path : str
        Its key.
    index : int or None
        Its place where the key holds an array.
    group : str
        Table of the spec.
    kind : str
        ``"number"``, ``"interval"`` (a parameter's range, stated as a share of it), ``"pair"``, ``"choice"``,
        ``"switch"``, ``"several"`` (any of the choices) or ``"text"``.
    words : str
        Key of its name in the table of words.
    name : str
        What it belongs to, such as an axis, a load or a parameter.
    about : str
        What a machine says of its parameter.
    value
        In SI units; None where the spec states none.
    unit : str
    factor : float
        How many of the unit make one SI unit.
    least, most : float or None
        Bounds.
    span : (float, float) or None
        Ends of a slider.
    logarithmic : bool
        Whether the slider is.
    whole : bool
        Whether it takes whole numbers only.
    optional : bool
        Whether the spec may leave it out.
    usual : float or None
        What to begin with where it is left out.
    choices : tuple
    """

    path: str
    index: int | None = None
    group: str = attrs.field(init=False)
    kind: str
    words: str = attrs.field()
    name: str = ""
    about: str = ""
    value: Any
    unit: str = ""
    factor: float = 1.0
    least: float | None = None
    most: float | None = None
    span: tuple[float, float] | None = None
    logarithmic: bool = False
    whole: bool = False
    optional: bool = False
    usual: float | None = None
    choices: tuple[Any, ...] = ()

    @group.default
    def _table(self) -> str:
        return "export" if self.path == "name" else self.path.partition(".")[0]

    @words.default
    def _key(self) -> str:
        return self.path


def knobs(spec: Spec, document: Mapping[str, Any], start: Spec) -> list[Knob]:
    """List the knobs of a spec.

    Parameters
    ----------
    spec : Spec
    document : mapping
        As it is written: a move is changed in the way that it is stated.
    start : Spec
        Around whose values sliders go.
    """
    listed = [*_listed(spec, document)]
    before = {(knob.path, knob.index): knob.value for knob in _listed(start, document)}
    return [_with_slider(knob, before.get((knob.path, knob.index))) for knob in listed]


def _listed(spec: Spec, document: Mapping[str, Any]) -> Iterator[Knob]:
    parameters = spec.machine().parameters
    yield from _move(spec, document.get("move", {}))
    yield from (_of_parameter(one, "number", "plant", spec.plant.parameters[one.name]) for one in parameters)
    yield from _fields(spec.robustness, "robustness")
    yield from _intervals(spec)
    yield from _fields(spec.cost, "cost")
    yield from _fields(spec.solver, "solver")
    yield from _limits(spec)
    yield from _path(spec.path)
    yield from _fields(spec.actuator, "actuator")
    yield from _residual_sway(spec, document.get("check", {}))
    yield from _fields(spec.check, "check")
    yield from _fields(spec.check.path, "check.path")
    yield from _fields(spec.check.wind, "check.wind")
    spans = spec.check.spans
    yield from (_of_parameter(one, "pair", "check.spans", spans.get(one.name)) for one in parameters)
    yield from _planner(spec)
    yield from _axes(spec, document.get("axis", {}))
    yield from _fields(spec.export, "export")
    yield from _of_axes(spec, _fields(spec.can, "can"))
    yield Knob(path="name", kind="text", value=spec.name)


def _fields(table: Any, place: str, *, words: str = "", name: str = "") -> Iterator[Knob]:
    """List the plain fields of a table: numbers, choices and switches."""
    kinds: Any = type(table)
    for key, kind in kinds_of(kinds).items():
        knob = _field(kind)
        if knob is None or f"{place}.{key}" in _TABLES["left_out"]:
            continue
        label = f"{words or place}.{key}"
        usual = {"unit": UNITS.get(label, ""), "usual": USUAL.get(label)}
        values = {**usual, **knob, "value": getattr(table, key)}
        yield Knob(path=f"{place}.{key}", words=label, name=name, **values)


def _field(kind: Any) -> dict[str, Any] | None:
    """Say what a field's annotation makes of its knob; None for what is no plain value."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        inside = _field(inner[0])
        return inside and {**inside, "optional": True}
    if origin is Literal:
        return {"kind": "choice", "choices": inner}
    if origin is Annotated:
        inside = _field(inner[0])
        bounds = next((one for one in inner[1:] if isinstance(one, Bounds)), Bounds())
        return inside and {**inside, **_bounds(bounds)}
    if kind is bool:
        return {"kind": "switch"}
    if kind is int:
        return {"kind": "number", "whole": True}
    return {"kind": "number"} if kind is float else None


def _bounds(bounds: Bounds) -> dict[str, Any]:
    least = max(bounds.above, bounds.least)
    return {
        "least": least if math.isfinite(least) else None,
        "most": bounds.most if math.isfinite(bounds.most) else None,
        "logarithmic": bounds.above == 0.0 or bounds.least > 0.0,
    }


def _move(spec: Spec, stated: Mapping[str, Any]) -> Iterator[Knob]:
    """Tell ways in the unit of each axis, and the duration."""
    ways = ("distance",) if "target" not in stated else ("start", "target")
    for key in (*ways, *(["final_velocity"] if spec.path is None else [])):
        for column, axis in enumerate(spec.machine().actuated):
            unit, factor = place_unit(spec, column)
            speed = key == "final_velocity"
            yield Knob(
                path=f"move.{key}",
                index=column,
                kind="number",
                name=axis.name if len(spec.axis) > 1 else "",
                value=getattr(spec.move, key)[column],
                unit=f"{axis.unit}/s" if speed else unit,
                factor=1.0 if speed else factor,
                least=None if speed or not math.isfinite(axis.lower) else axis.lower,
                most=None if speed or not math.isfinite(axis.upper) else axis.upper,
            )
        if key == ways[-1]:
            duration = _field(kinds_of(MoveSpec)["duration"])
            yield Knob(
                path="move.duration",
                value="minimum" if spec.move.shortest else spec.move.duration,
                unit=UNITS["move.duration"],
                choices=("minimum",),
                **(duration or {}),
            )
    axes = tuple(axis.name for axis in spec.machine().actuated)
    if len(axes) > 1 and spec.path is None:
        yield Knob(path="move.free", kind="several", value=list(spec.move.free), choices=axes)


def _of_parameter(one: Parameter, kind: str, place: str, value: Any) -> Knob:
    """Tell a machine's parameter, or its range, which stand by its name in some table of the spec."""
    return Knob(
        path=f"{place}.{one.name}",
        kind=kind,
        words=place,
        name=one.name,
        about=one.description,
        value=value,
        unit=one.unit.replace("^2", "²").replace("^3", "³"),
        least=one.lower,
        most=one.upper,
        logarithmic=one.lower > 0.0,
        optional=kind != "number",
    )


def _intervals(spec: Spec) -> Iterator[Knob]:
    """Tell the range of every parameter in its own unit: metres of rope, not a share of them."""
    for one in spec.machine().parameters:
        nominal, fraction = spec.plant.parameters[one.name], spec.robustness.uncertain.get(one.name)
        if nominal > 0.0:
            ends = None if fraction is None else [nominal * (1.0 - fraction), nominal * (1.0 + fraction)]
            yield _of_parameter(one, "interval", "robustness.uncertain", ends)


def _planner(spec: Spec) -> Iterator[Knob]:
    """Give the block's inputs at run time, and how fast they may change."""
    live, rates = spec.planner.live, spec.planner.live_rate
    for one in spec.machine().parameters:
        yield _of_parameter(one, "pair", "planner.live", live.get(one.name))
        if one.name in live:
            low, high = live[one.name]
            rate = _of_parameter(one, "number", "planner.live_rate", rates.get(one.name))
            rate = attrs.evolve(rate, unit=f"{rate.unit}/s", least=0.0, most=None, optional=True)
            yield attrs.evolve(rate, usual=0.1 * (high - low))
    for axis in spec.machine().actuated:
        if axis.name in live:  # a hoist
            yield _pair("planner.live", f"planner.live.{axis.name}", axis.name, live[axis.name], axis.unit)
    yield from _of_axes(spec, _fields(spec.planner, "planner"))


def _pair(words: str, path: str, name: str, value: Any, unit: str) -> Knob:
    """Tell the least and greatest place of an axis."""
    return Knob(path=path, kind="pair", words=words, name=name, value=value, unit=unit, optional=True)


def _of_axes(spec: Spec, listed: Iterator[Knob]) -> Iterator[Knob]:
    """Write units of axes that turn, where all do."""
    turning = all(axis.unit == "rad" for axis in spec.machine().actuated)
    for knob in listed:
        rotary = turning and knob.unit.startswith("m")
        yield attrs.evolve(knob, unit=f"rad{knob.unit[1:]}") if rotary else knob


def _limits(spec: Spec) -> Iterator[Knob]:
    """List the limits of all axes, and of every axis where there are several."""
    axes = spec.machine().actuated
    units = {axis.unit for axis in axes}
    tables: dict[str, Any] = {"limits": spec.limits}
    if len(axes) > 1:
        for column, axis in enumerate(axes):
            tables[f"limits.axis.{axis.name}"] = spec.limits.own(column)[1]
    for place, table in tables.items():
        name = place.rpartition(".")[2] if place != "limits" else ""
        unit = next((axis.unit for axis in axes if axis.name == name), "m" if "m" in units else "rad")
        if not name and len(units) > 1:  # no limit means the same of axes of different units
            yield from (knob for knob in _fields(table, place) if knob.words in OF_THE_LOAD)
            continue
        for knob in _fields(table, place, words="limits", name=name):
            rate = RATES.get(knob.words.rpartition(".")[2])
            yield attrs.evolve(knob, unit=f"{unit}{rate}") if rate else knob
        yield _pair("limits.travel", f"{place}.travel", name, table.travel, unit)


def _path(path: StacksSpec | None) -> Iterator[Knob]:
    """List what is known of the load over stacks; the stacks themselves are moved in their picture."""
    if path is None:
        return
    yield Knob(path="path.rail", kind="number", value=path.rail, unit="m")
    sizes = {2: ("width", "height"), 3: ("width", "depth", "height")}
    pairs = [
        (key, sizes[len(size)], size) for key, size in (("load", path.load), ("hook", path.hook)) if size
    ]
    for key, names, pair in [*pairs, ("clearance", ("sideways", "upwards"), path.clearances)]:
        for index, value in enumerate(pair):
            yield Knob(
                path=f"path.{key}",
                index=index,
                kind="number",
                words=f"path.{key}.{names[index]}",
                value=value,
                unit="m",
                least=0.0,
            )


def _residual_sway(spec: Spec, stated: Mapping[str, Any]) -> Iterator[Knob]:
    """List what may remain of the sway: of all loads, or of each where that is stated."""
    of_each = isinstance(stated.get("residual_sway"), Mapping)
    for load, limit in spec.check.residual_sway.items():
        yield Knob(
            path=f"check.residual_sway.{load}" if of_each else "check.residual_sway",
            kind="number",
            words="check.residual_sway",
            name=load if of_each else "",
            value=limit,
            unit="mm",
            factor=1e3,
            least=0.0,
            logarithmic=True,
        )
        if not of_each:
            return


def _axes(spec: Spec, stated: Mapping[str, Any]) -> Iterator[Knob]:
    bare = len(spec.axis) == 1 and not any(isinstance(stated.get(name), Mapping) for name in spec.axis)
    for name, axis in spec.axis.items():
        place = "axis" if bare else f"axis.{name}"
        yield from _fields(axis, place, words="axis", name="" if len(spec.axis) == 1 else name)


def _with_slider(knob: Knob, before: Any) -> Knob:
    """Choose the ends of a knob's slider: around the value to begin with, so that they stand still."""
    known: list[float] = []
    if knob.kind == "interval":
        known = [end for value in (before, knob.value) if value for end in value]
    elif knob.kind == "number":
        known = [value for value in (before, knob.value, knob.usual) if isinstance(value, int | float)]
    return attrs.evolve(knob, span=_around(knob, min(known), max(known))) if known else knob


def _around(knob: Knob, low: float, high: float) -> tuple[float, float]:
    least = -math.inf if knob.least is None else knob.least
    most = math.inf if knob.most is None else knob.most
    if least >= 0.0 and most <= 1.0 and not knob.logarithmic:
        return (least, most)
    if knob.logarithmic:
        return (max(low / REACH, least), min(high * REACH, most))
    greatest = max(abs(low), abs(high)) or 1.0
    return (max(0.0 if low >= 0.0 else -REACH / 2.0 * greatest, least), min(REACH / 2.0 * greatest, most))
