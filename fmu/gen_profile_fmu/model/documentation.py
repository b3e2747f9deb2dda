"""The page that importers show beside an FMU: equations, variables and a picture of the motion."""

import inspect
import math
from collections.abc import Callable, Iterable, Sequence
from html import escape

import numpy as np

from gen_profile.evaluation.simulation import PlantSimulation
from gen_profile.motion.profile import Array, Profile
from gen_profile.plants.plant import Coordinate, Plant
from gen_profile_fmu.model.nominals import rounded_up, smooth_move
from gen_profile_fmu.model.plant_variables import InputKind, PlantInstance
from gen_profile_fmu.model.variables import VariableTable

_WIDTH, _HEIGHT, _SAMPLES = 640.0, 220.0, 321
_FLAT = 1e-12  # what moves by less is drawn as a line
_COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b")
_INPUTS = {
    InputKind.ACCELERATION: "The axes have the accelerations of the inputs at once. In co-simulation, "
    "inputs may have time derivatives up to the third order (FMI 2).",
    InputKind.VELOCITY: "Drives follow the inputs with a first-order lag, τ dv/dt = v_ref − v, or at once "
    "where τ = 0. In co-simulation, inputs may have time derivatives up to the third order (FMI 2); a step "
    "of the velocity strikes the loads as its impulse; in model exchange drives without lag hold a velocity "
    "for interpolation_period.",
    InputKind.SETPOINT: "Drives interpolate their setpoints linearly (CiA 402, object 60C2h), so that "
    "velocity is constant between two setpoints, behind a first-order lag where τ &gt; 0. In co-simulation a "
    "setpoint is reached at the end of the step; in model exchange drives take one every "
    "interpolation_period.",
}
_ERROR = (
    "<p>In co-simulation the loads are integrated by the classical Runge-Kutta method of fourth order, in "
    "steps of at most max_step; a hundredth of the shortest period of oscillation leaves less than a "
    "millionth of the swing a period. The axes' motion is exact.</p>"
)
_CALLS = (  # of a block
    "In co-simulation the cycles that begin within a step are called with the inputs of the step's beginning."
)
_BEGINNING = (
    "It begins at start_time or, with wait_for_trigger, as soon as trigger is true from then on. Before, it "
    "rests; after its end it holds the target, or goes on at the final velocity."
)


def plant_page(name: str, machine: PlantInstance, table: VariableTable, kind: InputKind) -> str:
    """Describe a plant with inputs, in HTML; its picture is the swing after a quick push."""
    parts = (
        f"<p>{_capital(machine.plant.summary)}.</p>",
        _equations(machine.plant),
        f"<h2>Drives</h2><p>{_INPUTS[kind]}</p>",
        _ERROR,
        "<h2>Sway after a move of one second</h2>",
        _sway_plot(machine, _push(machine), 6.0),
        _variables(table),
    )
    return _page(name, parts)


def motion_page(name: str, axes: Sequence[Coordinate], profile: Profile, table: VariableTable) -> str:
    """Describe a motion, in HTML."""
    parts = (
        f"<p>The motion of the axes, as polynomials between knots: exact at any time. {_BEGINNING}</p>",
        "<h2>Motion</h2>",
        _motion_plots(axes, profile),
        _variables(table),
    )
    return _page(name, parts)


def system_page(name: str, machine: PlantInstance, command: Profile, table: VariableTable) -> str:
    """Describe a plant that follows a motion, in HTML."""
    parts = (
        f"<p>{_capital(machine.plant.summary)}, whose drives follow a motion, behind a first-order lag where "
        f"τ &gt; 0. {_BEGINNING}</p>",
        _equations(machine.plant),
        _ERROR,
        "<h2>Motion</h2>",
        _motion_plots(machine.plant.actuated, command),
        "<h2>Sway on ideal drives</h2>",
        _sway_plot(machine, command, command.duration + 4.0),
        _variables(table),
    )
    return _page(name, parts)


def block_page(name: str, words: str, table: VariableTable) -> str:
    """Describe a planner block, in HTML, by its own words."""
    text = f"<p>A planner block as a sampled controller: it is called once in every cycle. {_CALLS}</p>"
    return _page(name, (text, f"<h2>The block</h2><pre>{escape(words)}</pre>", _variables(table)))


def planned_system_page(name: str, machine: PlantInstance, words: str, table: VariableTable) -> str:
    """Describe a plant that a planner drives, in HTML."""
    parts = (
        f"<p>{_capital(machine.plant.summary)}, whose drives go from setpoint to setpoint of a planner "
        f"block, which is called once in every cycle, behind a first-order lag where τ &gt; 0. {_CALLS}</p>",
        _equations(machine.plant),
        _ERROR,
        f"<h2>The block</h2><pre>{escape(words)}</pre>",
        _variables(table),
    )
    return _page(name, parts)


def _page(title: str, parts: Iterable[str]) -> str:
    style = (
        "body{font-family:sans-serif;max-width:60em;margin:2em auto} svg{display:block;margin:1em 0} "
        "td,th{padding:0 1em 0 0;text-align:left;vertical-align:top}"
    )
    body = "\n".join(parts)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{style}</style></head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n</body>\n</html>\n"
    )


def _capital(words: str) -> str:
    return escape(words[:1].upper() + words[1:])


def _equations(plant: Plant) -> str:
    """Quote what the plant's file says of its equations."""
    module = inspect.getmodule(plant.equations)
    words = inspect.getdoc(module) or inspect.getdoc(plant.equations) or ""
    general = "M_uu(q) q̈_u = K_u(q) + G_u(q, q̇) − M_au(q)ᵀ q̈_a"
    return f"<h2>Equations</h2>\n<pre>{general}</pre>\n<pre>{escape(words)}</pre>"


def _variables(table: VariableTable) -> str:
    def cell(number: float | None) -> str:
        return "" if number is None else f"{number:g}"

    rows = "\n".join(
        f"<tr><td>{escape(v.name)}</td><td>{v.kind.causality}, {v.kind.variability}</td>"
        f"<td>{escape(v.unit)}</td><td>{cell(v.start) if v.kind.has_start else ''}</td>"
        f"<td>{cell(v.lower)}</td><td>{cell(v.upper)}</td><td>{escape(v.description)}</td></tr>"
        for v in table.variables
    )
    head = "".join(f"<th>{word}</th>" for word in ("name", "kind", "unit", "start", "min", "max", "what"))
    return f"<h2>Variables</h2>\n<table>\n<tr>{head}</tr>\n{rows}\n</table>"


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
