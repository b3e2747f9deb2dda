"""Residual sway of many machines at once, by the compiled loop over the plant's FMU."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.clearance import zones_of
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec
from gen_profile.spec.passed_target import BoundedTarget, targets
from gen_profile.spec.plan_view import EVERYWHERE, Area
from gen_profile.support.progress import Progress, no_progress
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.model.plant_variables import MAX_STEP, TAU
from gen_profile_fmu.running.many_runs import ZONE, ManyRuns

NOWHERE = Area(
    (np.inf, -np.inf), (np.inf, -np.inf)
)  # in place of where a body stands at the start or the target
_most: ContextVar[int] = ContextVar("_most", default=sys.maxsize)


@attrs.frozen(kw_only=True, eq=False)
class Feed:
    """What the drives do, for all machines or for each: between the points they interpolate linearly.

    Attributes
    ----------
    times : (points,) or (runs, points) array
        s, rising.
    position : (points, axes) or (runs, points, axes) array
        Where the axes are asked to be at these times, in m (or rad).
    """

    times: Array
    position: Array

    def thinned(self, every: int) -> Feed:
        """Leave out all points but every so many-th, and the last."""
        kept = np.unique([*range(0, len(self.times), every), len(self.times) - 1])
        return Feed(times=self.times[kept], position=self.position[kept])


@contextmanager
def on_processors(count: int) -> Iterator[None]:
    """Take no more processors than this, such as one beside other processes of the same sweep."""
    earlier = _most.set(count)
    try:
        yield
    finally:
        _most.reset(earlier)


@contextmanager
def many_machines(plant: Plant, progress: Progress = no_progress) -> Iterator[ManyRuns]:
    """Load the plant's FMU once for every processor that this process may use."""
    with ManyRuns(plant_fmu(plant, progress), workers=processors()) as runs:
        yield runs


def residual_peaks(
    runs: ManyRuns,
    spec: Spec,
    feed: Feed,
    machines: Array,
    *,
    tau: Array,
    max_step: Array | float,
    since: float,
    on_the_way: bool = False,
) -> Array:
    """Feed every machine, and find the greatest sway of every load once the axes stand.

    Parameters
    ----------
    runs : ManyRuns
        Of the spec's plant.
    spec : Spec
        Of which the plant and what swings at the start are taken.
    feed : Feed
    machines : (runs, parameters) array
        In the order of `Plant.parameters`.
    tau : (runs,) array
        Lag of the drives in s.
    max_step : (runs,) array or float
        Longest integration step in s.
    since : float
        When the axes stand, in s.
    on_the_way : bool
        Whether the end load's greatest sway at any time is one more column.

    Returns
    -------
    (runs, loads) array, or with more columns
        m. Where the spec has stacks, the last three are the least room to one in m, when that is in s, and
        which of `zones_of` it is; where it limits how far the load passes its target, the room behind that,
        negative by as much as it is passed, when, and which of `targets` it is.

    Raises
    ------
    CosimulationError
    """
    plant = spec.machine()
    names = [parameter.name for parameter in plant.parameters]
    values = {**dict(zip(names, machines.T, strict=True)), **spec.move.initial, TAU: tau, MAX_STEP: max_step}
    for column, axis in enumerate(plant.actuated):
        first = feed.position[..., 0, column]
        values |= {f"{axis.name}.{suffix}": first for suffix in ("start", "setpoint")}
    inputs = {
        f"{axis.name}.setpoint": feed.position[..., 1:, column] for column, axis in enumerate(plant.actuated)
    }
    ahead = targets(spec)  # no path over stacks has any
    rows = [_behind(one) for one in ahead] or [
        _zone(zone.body, zone.top, -1.0 if zone.overhead else 1.0, zone.area, *zone.own)
        for zone in zones_of(spec)
    ]
    zones = np.array(rows).reshape(-1, ZONE)
    places = [f"position.{body}.{along}" for body in plant.bodies for along in "xyz"] if rows else []
    outputs = [*places, *(f"sway.{load}" for load in plant.loads)]
    components = plant.directions if on_the_way else 0
    found = runs.peaks(feed.times, inputs, values, outputs, since=since, components=components, zones=zones)
    return found[:, len(places) :]


def _zone(body: int, top: float, up: float, *areas: Area) -> list[float]:
    """Write where a body may not be, and then where it may be all the same, as `ManyRuns` takes it."""
    edges = (edge for area in (*areas, NOWHERE, NOWHERE)[:3] for edge in (*area.x, *area.y))
    return [*(3.0 * body + along for along in range(3)), top, up, *edges]


def _behind(target: BoundedTarget) -> list[float]:
    """Write what is behind a target as a zone of all heights."""
    beyond = (target.at, np.inf) if target.way > 0.0 else (-np.inf, target.at)
    area = Area(beyond) if target.direction.coordinate == 0 else Area(EVERYWHERE, beyond)
    return _zone(target.direction.body, np.inf, 1.0, area)


def processors() -> int:
    """Count the processors that this process may use."""
    present = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(present, _most.get())
