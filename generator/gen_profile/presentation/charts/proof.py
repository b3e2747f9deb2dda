"""The proof of a planner block: one history in full, and the worst over the live parameters."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import attrs
import numpy as np

from gen_profile.assurance.proof.closed_loop import Trace, trace
from gen_profile.assurance.proof.followed import PLANNING, runs_of
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.promptness import KINDS
from gen_profile.assurance.proof.verdict import JudgedHistory, Proof
from gen_profile.motion.metrics import length
from gen_profile.motion.profile import Array
from gen_profile.presentation.charts.figure import INK, PALETTE, Band, Figure, Level, Line, Map, Panel, Style
from gen_profile.presentation.charts.picture import save
from gen_profile.spec.model import Spec
from gen_profile.support.progress import Progress, no_progress

CELLS = 8  # of the map along each live parameter
SAMPLES = 4000  # of a curve, at most
COMMAND = Style(colour=PALETTE[1], dash="dash")
SETPOINT = Style(colour=PALETTE[0])


def draw(spec: Spec, text: str, proof: Proof, path: Path, progress: Progress = no_progress) -> None:
    """Draw the worst history, and the worst residual sway by live parameters where more were judged.

    Parameters
    ----------
    spec : Spec
    text : str
        The block.
    proof : Proof
        Of that block.
    path : Path
        Of the picture.
    progress : callable
        Told what is being done.

    Raises
    ------
    OutputError
        The file cannot be written.
    ExportError, CosimulationError
    """
    histories = Histories.of(spec)
    followed = trace(spec, text, histories, proof.worst.history, progress)
    progress("drawing")
    figures = [history_figure(spec, proof, followed)]
    if (one := worst_damped(proof)) is not None:
        figures += damping_figures(spec, proof, trace(spec, text, histories, one.history, progress))
    if len(proof.judged) > 1:
        figures.append(map_figure(spec, proof))
    if proof.lateness.latest is not None:
        figures.append(lateness_figure(proof))
    save(figures, path, spec.name, f"{spec.name}: history {proof.worst.number} of {proof.count}")


def history_figure(spec: Spec, proof: Proof, trace: Trace) -> Figure:
    """Draw each axis, ropes that change, and the sway over time; shade what is not promised."""
    few = slice(None, None, -(-len(trace.times) // SAMPLES))
    times, limit = trace.times[few], 1e3 * list(proof.limit.values())[-1]
    arrival = _arrival(trace)
    bands = _unpromised(trace)
    panels = [panel for place in range(len(trace.history.axes)) for panel in _axis_panels(spec, trace, place)]
    for name, corners in trace.history.hoisting.items():
        line = Line("command", times, np.interp(times, *np.transpose(corners)), COMMAND)
        ends, label = [Level(value) for value in spec.planner.live[name]], _labelled(spec, name)
        title = f"{name} as given to the block"
        panels.append(Panel(title, label, [line], levels=ends, bands=bands))
    styles = [Style(colour=INK, width=2.0), *(Style(colour=colour, width=1.2) for colour in PALETTE[2:])]
    sways = [
        Line(name, times, 1e3 * sway[few], style)
        for (name, sway), style in zip(trace.sway.items(), styles, strict=False)
    ]
    levels = [Level(sign * limit, (arrival, times[-1])) for sign in _signs(spec)]
    title = f"Sway of the {spec.machine().end_load_name}"
    panels.append(Panel(title, "sway (mm)", sways, levels=levels, bands=bands))
    caption = "Dotted: stops. Shaded: not promised. Dashed in red: limits; of the sway, of what remains."
    return Figure(caption, panels, columns=1)


def _signs(spec: Spec) -> tuple[float, ...]:
    """Tell which signs the end load's sway may have: none where it is the length of two directions'."""
    return (1.0, -1.0) if spec.machine().directions == 1 else (1.0,)


def _arrival(trace: Trace) -> float:
    """Say from when on no axis moves any more, so that what the load still does is what remains."""
    axes = [np.abs(trace.issued[axis.of("fVelocity")]) for axis in trace.history.axes.values()]
    return float(trace.times[np.flatnonzero(np.max(axes, axis=0) > 0.0)[-1:]].sum())


def _axis_panels(spec: Spec, trace: Trace, place: int) -> Iterator[Panel]:
    """Draw the commands and setpoints of an axis, within its limits."""
    number, axis = list(trace.history.axes.items())[place]
    own, few = spec.limits.of(number), slice(None, None, -(-len(trace.times) // SAMPLES))
    assert own.velocity and own.acceleration and own.travel
    of = f" of {axis.name}" if axis.name else ""
    stops = [one.time for one in trace.history.commands if one.command not in {"position", "velocity"}]
    bands = [*_unpromised(trace), *(Band(time, time) for time in stops)]
    for title, unit, output, levels, command in (
        ("Position", axis.unit, "fPosition", own.travel, "position"),
        ("Velocity", f"{axis.unit}/s", "fVelocity", (-own.velocity, own.velocity), "velocity"),
        ("Acceleration", f"{axis.unit}/s²", "fAcceleration", (-own.acceleration, own.acceleration), ""),
    ):
        setpoints = trace.issued[axis.of(output)][few]
        issued = Line("setpoint", trace.times[few], setpoints, SETPOINT)
        lines, limits = [issued, *_commanded(trace, command, place)], [Level(level) for level in levels]
        label = f"{title.lower()} ({unit})"
        yield Panel(title + of, label, lines, levels=limits, bands=bands)


def worst_damped(proof: Proof) -> JudgedHistory | None:
    """Find where most remained of histories with a sound sensor and gusts."""
    damped = [one for one in _sound(proof) if one.promise]
    return max(damped, key=proof.fraction, default=None)


def _sound(proof: Proof) -> list[JudgedHistory]:
    sensed = [(one, one.history.sensed) for one in proof.judged]
    return [one for one, sensor in sensed if sensor is not None and sensor.gusts and not sensor.fault]


def damping_figures(spec: Spec, proof: Proof, trace: Trace) -> list[Figure]:
    """Draw gusts, what the sensor showed, sway and position; then what remained of all histories."""
    sensor, sensed, axes = spec.planner.sensor, trace.history.sensed, [*trace.history.axes.values()]
    assert sensor is not None and sensed is not None
    few, end_load = slice(None, None, -(-len(trace.times) // SAMPLES)), spec.machine().end_load_name
    times, cycle = trace.times[few], float(trace.times[1])
    edges = cycle * np.arange(-1.0, len(trace.times) + 1.0, dtype=np.float64)
    bands, limit = _unpromised(trace), 1e3 * list(proof.limit.values())[-1]
    unit = next((one.unit for one in spec.machine().unactuated if one.name in sensor.names), "m")
    outputs = [axis.of("fSwayEstimated") for axis in axes]
    estimates = [trace.issued[output] for output in outputs if output in trace.issued]

    def panel(title: str, y_label: str, names: Sequence[str], columns: Array) -> Panel:
        drawn = zip(names, columns.T, (SETPOINT, COMMAND), strict=False)
        lines = [Line(name, times, column, style) for name, column, style in drawn]
        return Panel(title, y_label, lines, bands=bands)

    along = [axis.name or "gusts" for axis in axes]
    shown = f"{sensor.quantity} ({unit}/s)" if sensor.quantity == "rate" else f"{sensor.quantity} ({unit})"
    true = trace.sway["this history"][few]
    sways = np.stack([true, length(np.stack(estimates, axis=1))[few, 0]], axis=1)
    sway = panel(f"Sway of the {end_load}", "sway (mm)", ["true", "estimated"], 1e3 * sways)
    pushes = np.diff(sensed.pushed(edges), 2, axis=0)[few] / cycle**2
    title = f"What the sensor shows: {sensor.quantity} of {' and '.join(sensor.names)}"
    panels = [
        panel("Gusts", "push (m/s²)", along, pushes),
        panel(title, shown, sensor.names if len(axes) > 1 else ["shown"], trace.measured[few]),
        attrs.evolve(sway, levels=[Level(sign * limit) for sign in _signs(spec)]),
    ]
    for axis in axes:
        title = f"Position of {axis.name}" if axis.name else "Position"
        places = trace.issued[axis.of("fPosition")][few, None]
        panels.append(panel(title, f"position ({axis.unit})", ["setpoint"], places))
    caption = "Shaded: not promised. Dashed in red: what may remain."
    return [Figure(caption, panels, columns=1), _remains_figure(spec, proof)]


def _remains_figure(spec: Spec, proof: Proof) -> Figure:
    """Draw what remains by the strongest gust, and by the first live parameter where there is one."""
    judged, stated, live = _sound(proof), spec.planner.disturbance, spec.planner.live
    assert stated is not None and stated.gust is not None
    sensors = [one.history.sensed for one in judged]
    gusts = [max(abs(gust.acceleration) for gust in sensor.gusts) for sensor in sensors if sensor]
    names = [*live][:1]
    panel = _shares_panel(
        "What remains after gusts",
        [*(_labelled(spec, name) for name in names), "strongest gust (m/s²)"],
        np.array([*([one.history.live[name] for one in judged] for name in names), gusts]),
        [*(live[name] for name in names), (0.0, stated.gust.acceleration)],
        [proof.fraction(one) for one in judged],
    )
    caption = "Every history with a sound sensor and gusts; white: none there."
    return Figure(caption, [panel], columns=1)


def lateness_figure(proof: Proof) -> Figure:
    """Draw how long commands take over what is possible, with what counts as late."""
    found = proof.lateness
    lines = []
    for (kind, words), colour in zip(KINDS.items(), PALETTE, strict=False):
        own = [one for _, one in found.commands if one.kind == kind and one.possible is not None]
        possible, takes = np.array([[one.quickest, one.takes] for one in own]).reshape(-1, 2).T
        lines.append(Line(words, possible, takes, Style(colour=colour, dash="points", width=3.5)))
    longest = max(one.quickest for _, one in found.commands)
    ends = np.array([0.0, longest])
    lines.append(Line("as quick as possible", ends, ends, SETPOINT))
    lines.append(Line("late above", ends, found.factor * ends + PLANNING, COMMAND))
    title = "Commands beside the quickest motions"
    panel = Panel(title, "takes (s)", [one for one in lines if len(one.x)], x_label="possible (s)")
    return Figure("By linear programmes, of some commands of each kind.", [panel], columns=1)


def map_figure(spec: Spec, proof: Proof) -> Figure:
    """Draw the worst share of the limit in cells of two live parameters, or of every history over one."""
    live, judged = spec.planner.live, [one for one in proof.judged if one.promise] or proof.judged
    names = [*live] if len(live) == 2 else [*live][:1]
    places = [[one.history.live[name] for one in judged] for name in names]
    panel = _shares_panel(
        "Worst residual sway",
        [_labelled(spec, name) for name in names] or ["history"],
        np.array(places or [[one.number for one in judged]]),
        [live[name] for name in names],
        [proof.fraction(one) for one in judged],
    )
    captions = (
        "Every history with a promise.",
        "Every history with a promise, over what the block is given.",
        "Over what the block is given; white: no history with a promise there.",
    )
    return Figure(captions[len(names)], [panel], columns=1)


def _labelled(spec: Spec, name: str) -> str:
    """Name a live parameter, which may be another axis's position, with its unit."""
    return f"{name} ({spec.machine().units[name]})"


def _unpromised(trace: Trace) -> list[Band]:
    """Find when the block is busy and does not promise."""
    unkept = (trace.issued["bPromise"] == 0.0) & (trace.issued["bBusy"] != 0.0)
    times = [*trace.times.tolist(), float(trace.times[-1])]
    return [Band(times[begin], times[end]) for begin, end in runs_of(unkept)]


def _commanded(trace: Trace, kind: str, place: int) -> list[Line]:
    """Draw targets or the stick while they hold, with gaps between."""
    commands = trace.history.commands
    ends = [*[command.time for command in commands[1:]], float(trace.times[-1])]
    held = [(one, end) for one, end in zip(commands, ends, strict=True) if one.command == kind]
    if not held:
        return []
    x = np.array([[one.time, end, end] for one, end in held]).ravel()
    y = np.array([[one.values[place], one.values[place], np.nan] for one, _ in held]).ravel()
    return [Line("command", x, y, COMMAND)]


def _shares_panel(
    title: str,
    labels: Sequence[str],
    places: Array,
    ranges: Sequence[tuple[float, float]],
    fractions: Sequence[float],
) -> Panel | Map:
    """Draw histories' shares of the limit over one quantity, or the greatest in each cell of two ranges.

    Places have the shape (quantities, histories). A cell in which no history was is not a number.
    """
    shares = 100.0 * np.array(fractions)
    if len(labels) == 1:
        order = np.argsort(places[0], kind="stable")
        return Panel(
            title,
            "share of its limit (%)",
            [Line("history", places[0][order], shares[order], Style(dash="points"))],
            x_label=labels[0],
            levels=[Level(100.0)],
        )
    low, high = np.transpose(ranges)
    cells = np.minimum(CELLS * (places.T - low) / (high - low), CELLS - 1).astype(int)
    worst = np.full((CELLS, CELLS), np.nan)
    np.fmax.at(worst, tuple(cells.T), shares)
    centres = [start + (end - start) * (np.arange(CELLS) + 0.5) / CELLS for start, end in ranges]
    return Map(
        title=title,
        x_label=labels[0],
        y_label=labels[1],
        unit="% of limit",
        x=centres[0],
        y=centres[1],
        values=worst.T,
        limit=100.0,
        cells=True,
        headroom=1.0,
    )
