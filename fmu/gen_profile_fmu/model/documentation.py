"""The page that importers show beside an FMU: equations, variables and a picture of the motion."""

import inspect
import math
from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path

import numpy as np

from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.motion.profile import Array, Profile
from gen_profile.plants.plant import Coordinate, Plant
from gen_profile_exporters.templates import filled
from gen_profile_fmu.model.nominals import rounded_up, smooth_move
from gen_profile_fmu.model.plant_variables import InputKind, PlantInstance
from gen_profile_fmu.model.variables import FmuVariable, VariableTable

_WIDTH, _HEIGHT, _SAMPLES = 640.0, 220.0, 321
_FLAT = 1e-12  # what moves by less is drawn as a line
_COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b")
_PAGE = Path(__file__).with_name("page.html")
_PARTS = ("summary", "equations", "drives", "motion", "words", "sway")  # which some pages have, as HTML


def plant_page(name: str, machine: PlantInstance, table: VariableTable, kind: InputKind) -> str:
    """Describe a plant with inputs, in HTML; its picture is the swing after a quick push."""
    sway = _sway_plot(machine, _push(machine), 6.0)
    return _page("plant", name, table, machine.plant, drives=kind.value, sway=sway)


def motion_page(name: str, axes: Sequence[Coordinate], profile: Profile, table: VariableTable) -> str:
    """Describe a motion, in HTML."""
    return _page("motion", name, table, motion=_motion_plots(axes, profile))


def system_page(name: str, machine: PlantInstance, command: Profile, table: VariableTable) -> str:
    """Describe a plant that follows a motion, in HTML."""
    motion = _motion_plots(machine.plant.actuated, command)
    sway = _sway_plot(machine, command, command.duration + 4.0)
    return _page("system", name, table, machine.plant, motion=motion, sway=sway)


def block_page(name: str, words: str, table: VariableTable) -> str:
    """Describe a planner block, in HTML, by its own words."""
    return _page("block", name, table, words=escape(words))


def planned_system_page(name: str, machine: PlantInstance, words: str, table: VariableTable) -> str:
    """Describe a plant that a planner drives, in HTML."""
    return _page("planned_system", name, table, machine.plant, words=escape(words))


def _page(kind: str, title: str, table: VariableTable, plant: Plant | None = None, **more: str) -> str:
    if plant is not None:
        summary = escape(plant.summary[:1].upper() + plant.summary[1:])
        more |= {"summary": summary, "equations": _equations(plant)}
    parts = dict.fromkeys(_PARTS, "") | more
    return filled(_PAGE, kind=kind, title=title, variables=map(_row, table.variables), **parts)


def _equations(plant: Plant) -> str:
    """Quote what the plant's file says of its equations."""
    module = inspect.getmodule(plant.equations)
    words = inspect.getdoc(module) or inspect.getdoc(plant.equations) or ""
    return escape(words)


def _row(v: FmuVariable) -> tuple[str, ...]:
    """Give the cells of a variable, as HTML."""
    numbers = (v.start if v.kind.has_start else None, v.lower, v.upper)
    start, low, high = ("" if number is None else f"{number:g}" for number in numbers)
    kind = f"{v.kind.causality}, {v.kind.variability}"
    return escape(v.name), kind, escape(v.unit), start, low, high, escape(v.description)


def _push(machine: PlantInstance) -> Profile:
    """Move each axis by a tenth of its unit in 1 s, from rest to rest, from where it starts."""
    start = np.array(machine.position)
    return smooth_move(start.tolist(), (start + 0.1).tolist(), 1.0)


def _sway_plot(machine: PlantInstance, profile: Profile, until: float) -> str:
    times = np.linspace(0.0, until, _SAMPLES)
    (response,) = PlantSimulation(machine.plant, profile, [machine.parameters], until, machine.initial).at(
        times
    )
    return _plot(times, response.sway, machine.plant.loads, "sway in m")


def _motion_plots(axes: Sequence[Coordinate], profile: Profile) -> str:
    """Draw position, velocity and acceleration; axes that are measured alike share a picture."""
    times = np.linspace(0.0, profile.duration, _SAMPLES)
    plots = []
    for unit in dict.fromkeys(axis.unit for axis in axes):
        same_unit = [index for index, axis in enumerate(axes) if axis.unit == unit]
        for order, title in enumerate(
            (f"position in {unit}", f"velocity in {unit}/s", f"acceleration in {unit}/s²")
        ):
            columns = profile.derivative(times, order)[:, same_unit]
            plots.append(_plot(times, columns, [axes[index].name for index in same_unit], title))
    return "\n".join(plots)


def _plot(times: Array, columns: Array, names: Sequence[str], title: str) -> str:
    """Draw curves over time as SVG; coordinates are rounded, so that computers agree on the bytes."""
    low, high = float(columns.min()), float(columns.max())
    if high - low < _FLAT:
        low, high = low - 1.0, high + 1.0
    left, right, top, bottom = 60.0, _WIDTH - 25.0, 25.0, _HEIGHT - 25.0

    def x(time: Array) -> Array:
        return left + (right - left) * time / float(times[-1])

    def y(value: Array) -> Array:
        return bottom - (bottom - top) * (value - low) / (high - low)

    parts = [f'<text x="{left:g}" y="15">{escape(title)}</text>']
    for value, at in _ticks(low, high, y):
        parts.append(f'<path stroke="#ddd" d="M{left:g} {at}H{right:g}"/>')
        parts.append(f'<text x="{left - 6:g}" y="{at}" dy="4" text-anchor="end">{value}</text>')
    for value, at in _ticks(0.0, float(times[-1]), x):
        parts.append(f'<path stroke="#ddd" d="M{at} {top:g}V{bottom:g}"/>')
        parts.append(f'<text x="{at}" y="{bottom + 16:g}" text-anchor="middle">{value} s</text>')
    for index, (name, column) in enumerate(zip(names, columns.T, strict=True)):
        colour = _COLOURS[index % len(_COLOURS)]
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x(times), y(column), strict=True))
        parts.append(f'<polyline fill="none" stroke="{colour}" stroke-width="1.5" points="{points}"/>')
        parts.append(f'<text x="{left + 190 + 110 * index:g}" y="15" fill="{colour}">{escape(name)}</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH:g}" height="{_HEIGHT:g}" font-size="12">'
        f"{''.join(parts)}</svg>"
    )


def _ticks(low: float, high: float, place: Callable[[Array], Array]) -> list[tuple[str, str]]:
    """List round values between two ends, at most seven, and where they are."""
    step = rounded_up((high - low) / 6.0)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    values = np.array([step * number for number in range(first, last + 1)])
    return [(f"{value:.6g}", f"{at:.1f}") for value, at in zip(values, place(values), strict=True)]
