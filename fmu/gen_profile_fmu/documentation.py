"""The page that importers show beside an FMU: equations, variables and a picture of the motion."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from gen_profile.plants.plant import Coordinate, Plant
from gen_profile.profile import Array, Profile
from gen_profile.response import Swing
from gen_profile_fmu.plant_variables import InputKind, Machine
from gen_profile_fmu.variables import VariableTable

_WIDTH, _HEIGHT, _SAMPLES = 640.0, 220.0, 321
_COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b")
_INPUTS = {
    InputKind.ACCELERATION: "The axes have the accelerations of the inputs at once. In co-simulation, "
    "inputs may have time derivatives up to the third order (FMI 2).",
    InputKind.VELOCITY: "Drives follow the inputs with a first-order lag, τ dv/dt = v_ref − v. "
    "In co-simulation, inputs may have time derivatives up to the third order (FMI 2).",
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
_BEGINNING = (
    "It begins at start_time or, with wait_for_trigger, as soon as trigger is true from then on. Before, it "
    "rests; after its end it holds the target, or goes on at the final velocity."
)


def plant_page(name: str, machine: Machine, table: VariableTable, kind: InputKind) -> str:
    """Describe a plant with inputs, in HTML; its picture is the swing after a quick push."""
    parts = (
        f"<p>{escape(machine.plant.summary)}.</p>",
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


def system_page(name: str, machine: Machine, command: Profile, table: VariableTable) -> str:
    """Describe a plant that follows a motion, in HTML."""
    parts = (
        f"<p>{escape(machine.plant.summary)}, whose drives follow a motion, behind a first-order lag where "
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


def _page(title: str, parts: Iterable[str]) -> str:
    style = (
        "body{font-family:sans-serif;max-width:50em;margin:2em auto} td,th{padding:0 1em 0 0;text-align:left}"
    )
    body = "\n".join(parts)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{style}</style></head>\n<body>\n<h1>{escape(title)}</h1>\n{body}\n</body>\n</html>\n"
    )


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


def _push(machine: Machine) -> Profile:
    """Move each axis by a tenth of its unit in 1 s, from rest to rest, from where it starts."""
    start = np.array(machine.position)
    smooth = 0.1 * np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    coefficients = np.repeat(smooth[None, :, None], len(start), axis=2)
    coefficients[0, 0] = start
    return Profile(knots=[0.0, 1.0], coefficients=coefficients, target=start + 0.1, method="push")


def _sway_plot(machine: Machine, profile: Profile, until: float) -> str:
    times = np.linspace(0.0, until, _SAMPLES)
    (response,) = Swing(machine.plant, profile, [machine.parameters], until, machine.initial).at(times)
    return _plot(times, response.sway, machine.plant.loads, "sway in m")


def _motion_plots(axes: Sequence[Coordinate], profile: Profile) -> str:
    times = np.linspace(0.0, profile.duration, _SAMPLES)
    names = [axis.name for axis in axes]
    words = ("position", "velocity", "acceleration")
    return "\n".join(
        _plot(times, profile.derivative(times, order), names, word) for order, word in enumerate(words)
    )


def _plot(times: Array, columns: Array, names: Sequence[str], title: str) -> str:
    """Draw curves over time as SVG; coordinates are rounded, so that computers agree on the bytes."""
    low, high = float(columns.min()), float(columns.max())
    span = (high - low) or 1.0
    x = 10.0 + (_WIDTH - 20.0) * times / times[-1]
    curves = []
    for index, (name, column) in enumerate(zip(names, columns.T, strict=True)):
        y = _HEIGHT - 25.0 - (_HEIGHT - 50.0) * (column - low) / span
        colour = _COLOURS[index % len(_COLOURS)]
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        curves.append(f'<polyline fill="none" stroke="{colour}" points="{points}"/>')
        curves.append(f'<text x="{200 + 110 * index}" y="15" fill="{colour}">{escape(name)}</text>')
    caption = f"{title}: {low:.3g} to {high:.3g}; 0 to {times[-1]:g} s"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH:g}" height="{_HEIGHT:g}" font-size="12">'
        f'<text x="10" y="15">{escape(title)}</text>{"".join(curves)}'
        f'<text x="10" y="{_HEIGHT - 5:g}">{escape(caption)}</text></svg>'
    )
