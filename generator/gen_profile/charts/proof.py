"""The proof of a planner block as a picture: one history in full, and the worst over the live parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gen_profile.charts.figure import FRAME, INK, LIMIT, PALETTE
from gen_profile.charts.picture import picture
from gen_profile.progress import Progress, untold
from gen_profile.proof.histories import Histories
from gen_profile.proof.trace import Trace, trace
from gen_profile.proof.verdict import JudgedHistory, Proof
from gen_profile.spec.model import Spec

CELLS = 8  # of the map along each live parameter


def draw(spec: Spec, text: str, proof: Proof, path: Path, progress: Progress = untold) -> None:
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
    followed = trace(spec, text, Histories.of(spec), proof.worst.history, progress)
    progress("drawing")
    mapped = len(proof.judged) > 1
    with picture(path, spec.name, (12.0 if mapped else 8.0, 9.0)) as figure:
        left, right = figure.subfigures(1, 2, width_ratios=(2, 1)) if mapped else (figure, None)
        _history(left.subplots(4, 1, sharex=True), spec, proof, followed)
        if right is not None:
            _map(right, spec, proof)
        figure.suptitle(f"{spec.name}: history {proof.worst.number} of {proof.count}")


def _history(axes: Any, spec: Spec, proof: Proof, found: Trace) -> None:
    """Draw place, velocity, acceleration and sway over time, and shade what is not promised."""
    own, times, issued = spec.limits.of(0), found.times, found.issued
    assert own.velocity and own.acceleration and own.travel
    place, velocity, acceleration, sway = axes
    place.plot(times, issued["fPosition"], color=PALETTE[0])
    velocity.plot(times, issued["fVelocity"], color=PALETTE[0])
    acceleration.plot(times, issued["fAcceleration"], color=PALETTE[0])
    _commands(place, velocity, found)
    limits = (own.travel, (-own.velocity, own.velocity), (-own.acceleration, own.acceleration))
    for axis, levels in zip(axes, limits, strict=False):
        for level in levels:
            axis.axhline(level, color=LIMIT, linewidth=0.8)
    for number, (name, values) in enumerate(found.sway.items()):
        colour = INK if number == 0 else PALETTE[(number - 1) % len(PALETTE)]
        sway.plot(times, 1e3 * values, color=colour, linewidth=1.4 if number == 0 else 0.9, label=name)
    for sign in (-1.0, 1.0):
        sway.axhline(sign * 1e3 * list(proof.limit.values())[-1], color=LIMIT, linewidth=0.8)
    unkept = (issued["bPromise"] == 0.0) & (issued["bBusy"] != 0.0)
    for axis in axes:
        axis.fill_between(
            times, 0, 1, where=unkept, transform=axis.get_xaxis_transform(), color=FRAME, alpha=0.25
        )
        axis.grid(alpha=0.3)
    sway.legend(fontsize="small", ncols=6, loc="upper center", bbox_to_anchor=(0.5, -0.3))
    sway.set_xlabel("time (s); grey: not promised")
    labels = ("position (m)", "velocity (m/s)", "acceleration (m/s²)", "sway (mm)")
    for axis, label in zip(axes, labels, strict=True):
        axis.set_ylabel(label)


def _commands(place: Any, velocity: Any, found: Trace) -> None:
    """Mark targets in the place, the stick in the velocity, and stops in both."""
    commands = found.history.commands
    ends = [*[command.time for command in commands[1:]], float(found.times[-1])]
    for command, end in zip(commands, ends, strict=True):
        span = [command.time, end]
        if command.command == "position":
            place.plot(span, [command.value] * 2, color=PALETTE[1], linestyle="--")
        elif command.command == "velocity":
            velocity.plot(span, [command.value] * 2, color=PALETTE[1], linestyle="--")
        else:
            for axis in (place, velocity):
                axis.axvline(command.time, color=PALETTE[1], linestyle=":")


def _map(figure: Any, spec: Spec, proof: Proof) -> None:
    """Draw the worst share of the limit in cells of two live parameters, or over one."""
    axis = figure.subplots()
    live = spec.planner.live
    shares = np.array([proof.share(one) for one in proof.judged])
    title = "worst residual sway (share of its limit)"
    if len(live) == 2:
        worst = _cells(proof.judged, shares, live)
        (x, across), (y, upwards) = live.items()
        drawn = axis.imshow(
            worst.T,
            origin="lower",
            aspect="auto",
            extent=(*across, *upwards),
            cmap="viridis_r",
            vmin=0.0,
            vmax=max(1.0, float(np.nanmax(worst))),
        )
        figure.colorbar(drawn, ax=axis, location="bottom", label=title)
        axis.set(xlabel=x, ylabel=y)
        return
    name = next(iter(live), "number")
    values = [one.history.live.get(name, one.number) for one in proof.judged]
    axis.plot(values, shares, ".", color=PALETTE[0], markersize=3)
    axis.axhline(1.0, color=LIMIT, linewidth=0.8)
    axis.set(xlabel=name if live else "history", ylabel=title)


def _cells(judged: tuple[JudgedHistory, ...], shares: Any, live: Any) -> Any:
    """Find the greatest share in each cell; where no history was, not a number."""
    worst = np.full((CELLS, CELLS), np.nan)
    for one, share in zip(judged, shares, strict=True):
        cell = tuple(
            min(CELLS - 1, int(CELLS * (one.history.live[name] - low) / (high - low)))
            for name, (low, high) in live.items()
        )
        worst[cell] = np.fmax(worst[cell], share)
    return worst
