"""A planner block that is driven by hand on a page, and the machines that follow it: a moment per question.

The page is the clock. It asks for the next moment while it shows the last one, so a slow computer makes time
pass slowly, and nothing is left to run when a page is gone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from gen_profile.assurance.proof.sensing import stated_swing
from gen_profile.dynamics.evaluation.phrases import machine, place_unit
from gen_profile.dynamics.evaluation.simulation import equations_of, swing_from
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.motion.profile import Array
from gen_profile.planner.directions import planned_axes, sensed_directions
from gen_profile.planner.interface import UNPROVEN
from gen_profile.planner.planner import Planner
from gen_profile.plants.drawing import Drawing
from gen_profile.plants.looks import body_size, drawings, pose_of
from gen_profile.presentation.charts.figure import PALETTE
from gen_profile.presentation.report.animation import Actor, Animation
from gen_profile.presentation.studio.orders import DriveQuestion
from gen_profile.presentation.studio.simulated_sensor import SimulatedSensor
from gen_profile.presentation.studio.views import fault
from gen_profile.presentation.studio.workers import Part
from gen_profile.spec.model import Spec
from gen_profile.support.errors import GenProfileError, SpecError

MOMENT = 0.1  # s
FRAMES = 4  # of a moment
COLOURS = PALETTE[:3]
SWAYS = 0.35  # rad, of the ropes, that a picture has room for
COMMANDS = ("velocity", "target", "point", "stop", "quick_stop")


def drive(asked: DriveQuestion) -> Iterator[Part]:
    """Go on with a drive, or begin one."""
    try:
        if asked.drive not in _drives:
            _drives.clear()
            _drives[asked.drive] = Drive(asked.question.spec())
        yield _drives[asked.drive].moment(asked)
    except GenProfileError as error:
        yield {"part": "undriven", "faults": [fault(sentence) for sentence in error.sentences]}


_drives: dict[int, Drive] = {}  # the one that this process is at, by its number


class Drive:
    """A planner block and the machines that follow it, from rest.

    Parameters
    ----------
    spec : Spec

    Raises
    ------
    SpecError
        A limit is not stated, or no block takes this machine.
    CosimulationError
        There is no C compiler.
    """

    def __init__(self, spec: Spec) -> None:
        self._spec, self._plant = spec, spec.machine()
        self._columns = list(planned_axes(spec))
        self._followers = _followers(spec)  # by their names, how many times its own every parameter is
        self._places = np.array(spec.move.start, dtype=np.float64)
        start = self._places[self._columns]
        self._planner = Planner(spec, start if len(start) > 1 else float(start[0]))
        self._live = self._planner.live
        n_u = len(self._plant.unactuated)
        self._state = np.zeros((2, len(self._followers), n_u))  # coordinates and rates of every machine
        self._axes = self._at(np.array([start]))[0]
        self._target: Array | None = None  # of the planned axes
        cycle = self._planner.cycle_time
        self._sensor: SimulatedSensor | None = None
        if spec.planner.sensor is not None:
            self._sensor = SimulatedSensor(spec, cycle)
            self._state[:, 0] = self._swinging()
            self._sensor.follow(self._state, self._axes[:1], self._rows()[:1])
        self._bounds = self._room()

    def moment(self, asked: DriveQuestion) -> Part:
        """Follow a hand for a moment, and tell what is then to be seen."""
        started = self._axes[None], self._state[:, None]
        outputs, axes, states = self._go_on(asked)
        names = ("fPosition", "fVelocity", "fStopLow", "fStopHigh")
        position, velocity, low, high = (self._of(outputs, name) for name in names)
        shown = np.linspace(0, len(axes), FRAMES + 1).round().astype(int)
        places, swung = np.concatenate([started[0], axes]), np.concatenate([started[1], states], axis=1)
        frames = self._animation(places[shown, 0], swung[0, shown])
        return {
            "part": "driven",
            "animation": frames.to_json(self._bounds),
            "seconds": self._planner.cycle_time * len(axes),
            "axes": self._facts(position[-1], velocity[-1], [low[-1], high[-1]]),
            "live": [self._ranges(name, value) for name, value in self._live.items()],
            "target": None if self._target is None else self._target.tolist(),
            "marks": [] if self._target is None else self._marks(self._target).tolist(),
            "stops": [self._marks(end[-1]).tolist() for end in (low, high)],
            "trace": {
                "times": (self._planner.cycle_time * shown[1:]).tolist(),
                "position": position[shown[1:] - 1].T.tolist(),
                "velocity": velocity[shown[1:] - 1].T.tolist(),
                "low": low[shown[1:] - 1].T.tolist(),
                "high": high[shown[1:] - 1].T.tolist(),
                "estimated": self._estimated(outputs)[shown[1:] - 1].tolist() if self._sensor else [],
            },
            "busy": bool(outputs["bBusy"][-1]),
            "promise": bool(outputs["bPromise"][-1]),
            "error": int(outputs["nErrorId"][-1]),
            "sensor": self._sensed(outputs),
        }

    def _go_on(self, asked: DriveQuestion) -> tuple[Mapping[str, Array], Array, Array]:
        """Let block and machines go on for a moment, no farther at once than it is known what sensors show.

        Returns
        -------
        outputs : mapping of str to (cycles,) array
            Of the block.
        axes : (cycles, 3, axes) array
        states : (2, cycles, machines, n_u) array
        """
        orders, cycle = self._orders(asked), self._planner.cycle_time
        left, found = max(1, round(MOMENT / cycle)), list[tuple[Mapping[str, Array], Array, Array]]()
        if self._sensor is not None:
            self._sensor.set(asked.sensor)
        while left:
            cycles = left
            if self._sensor is not None:
                cycles = min(left, self._sensor.known_cycles)
                orders["sensor"] = self._sensor.shows(cycles)
            outputs = self._planner.hold(cycles * cycle, **orders).outputs
            self._tell_live(asked.live)
            names = ("fPosition", "fVelocity", "fAcceleration")
            axes = self._at(*(self._of(outputs, name) for name in names))
            states = self._swing(axes, asked.wind)[:, 1:]
            self._axes, self._state = axes[-1], states[:, -1]
            if self._sensor is not None:
                self._sensor.follow(states[:, :, 0], axes[:, 0], self._rows()[:1])
            found.append((outputs, axes, states))
            orders, left = {}, left - cycles
        parts = list(zip(*found, strict=True))
        together = {name: np.concatenate([part[name] for part in parts[0]]) for name in parts[0][0]}
        return together, np.concatenate(parts[1]), np.concatenate(parts[2], axis=1)

    def _swinging(self) -> Array:
        """Let the nominal machine swing by as much as is stated, shape (2, n_u)."""
        along = len(sensed_directions(self._spec))
        begun, nominal = [(along**-0.5, 0.0)] * along, self._parameters()[0]
        swing = stated_swing(self._spec, begun, nominal, self._places.tolist())
        names = [coordinate.name for coordinate in self._plant.unactuated]
        return np.array([[swing[f"{name}{order}"] for name in names] for order in ("", ".rate")])

    def _sensed(self, outputs: Mapping[str, Array]) -> Part | None:
        """Tell what becomes of the sensor: its knobs, and what the block makes of it."""
        if self._sensor is None:
            return None
        used, fault = (self._of(outputs, name)[-1] for name in ("bSensorUsed", "nSensorFault"))
        disturbance = self._spec.planner.disturbance
        gust = disturbance.gust if disturbance else None
        return {
            "knobs": self._sensor.knobs,
            "wind": gust.acceleration if gust else 0.0,
            "used": bool(used.all()),
            "damping": bool(outputs["bDamping"][-1]),
            "fault": int((fault * (fault != UNPROVEN)).max()),
        }

    def _estimated(self, outputs: Mapping[str, Array]) -> Array:
        """Give the end load's sway in mm by the block, shape (cycles,); along two axes its size."""
        along = 1e3 * self._of(outputs, "fSwayEstimated")
        return along[:, 0] if along.shape[1] == 1 else np.linalg.norm(along, axis=1)

    def _of(self, outputs: Mapping[str, Array], output: str) -> Array:
        """Give an output of every axis that has it, shape (cycles, axes)."""
        names = [name for name in outputs if name == output or name.startswith(f"{output}_")]
        return np.stack([outputs[name] for name in names], axis=1)

    def _orders(self, asked: DriveQuestion) -> dict[str, Any]:
        """Write a command as the planner takes it."""
        numbers = [*asked.values, *asked.wind, *asked.sensor.values()]
        if asked.command not in ("", *COMMANDS) or not np.isfinite(numbers).all():
            raise SpecError(f"There is no command {asked.command[:20]!r} with such values.")
        if asked.wind and len(asked.wind) != len(self._columns):
            raise SpecError(f"Wind takes {len(self._columns)} values, one for each axis.")
        orders: dict[str, Any] = {"live": asked.live}
        if not asked.command:
            return orders
        self._target = None
        if asked.command in ("stop", "quick_stop"):
            return {**orders, asked.command: True}
        command, values = asked.command, asked.values
        if command == "point":
            command, values = "target", self._pointed(values)
        if len(values) != len(self._columns):
            raise SpecError(f"The planner takes {len(self._columns)} values, one for each axis.")
        if command == "target":
            self._target = np.array(values)
        return {**orders, command: values if len(values) > 1 else values[0]}

    def _pointed(self, values: Sequence[float]) -> tuple[float, ...]:
        """Find the target at which the load hangs where a picture is pointed at, or as near as it gets.

        Parameters
        ----------
        values : (view, x, y)
            The picture's number, and a place in it in m.
        """
        if len(values) != 3 or values[0] not in range(len(self._bounds)):
            raise SpecError(f"There is no command 'point' with {len(values)} such values.")
        low, high = self._ends()[:, self._columns]
        view, *place = values
        start = np.clip(self._axes[0, self._columns], low, high)
        way = least_squares(  # from zero, since its first step is as long as what it begins with
            lambda way: self._marks(start + way)[int(view)] - place,
            np.zeros(len(start)),
            bounds=(low - start, high - start),
            method="dogbox",  # the other one stays where it begins at a bound
        ).x
        return tuple(np.clip(start + way, low, high).tolist())

    def _marks(self, target: Array) -> Array:
        """Tell where in every picture the nominal machine's end load hangs at a target, shape (views, 2)."""
        q_a = np.concatenate([self._ends(), self._places[None]])
        q_a[-1, self._columns] = target
        drawings = self._drawn(self._parameters()[0], q_a, np.zeros((len(q_a), len(self._plant.unactuated))))
        return np.array([drawing.rest[-1, _load(drawing)] for drawing in drawings])

    def _tell_live(self, live: Mapping[str, float]) -> None:
        """Give the machines the ropes that the planner was given."""
        self._live = {**self._live, **live}
        for column, axis in enumerate(self._plant.actuated):
            self._places[column] = self._live.get(axis.name, self._places[column])

    def _parameters(self) -> list[dict[str, float]]:
        nominal = dict(self._spec.plant.parameters)
        nominal |= {name: value for name, value in self._live.items() if name in nominal}
        return [
            {name: value * off.get(name, 1.0) for name, value in nominal.items()}
            for off in self._followers.values()
        ]

    def _rows(self) -> Array:
        """Give the parameters of every machine, shape (machines, parameters)."""
        return parameter_rows(self._plant, self._parameters())

    def _at(self, *motion: Array) -> Array:
        """Put the planned axes' motion beside those that stand still: shape (cycles, 3, axes)."""
        axes = np.zeros((len(motion[0]), 3, len(self._places)))
        axes[:, 0] = self._places
        for order, values in enumerate(motion):
            axes[:, order, self._columns] = values
        return axes

    def _swing(self, axes: Array, wind: Sequence[float]) -> Array:
        """Let all machines follow the axes, shape (2, cycles + 1, machines, n_u).

        Loads that wind pushes in proportion to their masses swing as where the axes accelerate against it.
        """
        moved = np.stack([self._axes, *axes])
        moved[:, 2, self._columns] -= wind or 0.0
        rows = moved.reshape(len(moved), -1)
        times: Array = self._planner.cycle_time * np.arange(len(rows), dtype=np.float64)
        return swing_from(
            self._plant,
            self._rows(),
            motion=lambda nodes: np.stack([np.interp(nodes, times, row) for row in rows.T], axis=1),
            start=self._state,
            times=times,
        )

    def _animation(self, places: Array, swung: Array) -> Animation:
        """Draw the machines; two frames at the ends of the travel come first: rails go as far."""
        ends = self._ends()
        q_a = np.concatenate([ends, places])
        still = np.zeros((len(ends), len(self._plant.unactuated)))
        outputs, actors = equations_of(self._plant)[1], []
        for index, (name, parameters) in enumerate(zip(self._followers, self._parameters(), strict=True)):
            q_u = np.concatenate([still, swung[:, index]])
            row = parameter_rows(self._plant, [parameters])
            sway = outputs(q_u, q_a, row)[:, : len(self._plant.loads), 0][:, self._plant.end_load]
            drawn = self._drawn(parameters, q_a, q_u)
            sign = sway[:, -1] if sway.shape[1] == 1 else np.linalg.norm(sway, axis=1)
            actors.append(Actor(name=name, colour=COLOURS[index], sway=sign, drawings=drawn))
        return Animation(
            times=np.linspace(0.0, MOMENT, len(q_a)),
            arrival=0.0,
            limit=min(self._spec.check.residual_sway.values()),
            load=self._plant.end_load_name,
            actors=actors,
        )

    def _drawn(self, parameters: Mapping[str, float], q_a: Array, q_u: Array) -> Sequence[Drawing]:
        """Draw a machine from every side."""
        size = body_size(self._plant, parameters, q_a)
        return drawings(self._plant, pose_of(self._plant, parameters, q_a, q_u, size))

    def _ends(self) -> Array:
        """Give the places of all axes at both ends of the travel, shape (2, axes)."""
        ends = np.tile(self._places, (2, 1))
        for column in self._columns:
            ends[:, column] = self._spec.limits.of(column).travel or self._places[column]
        return ends

    def _room(self) -> list[list[float]]:
        """Choose what a picture shows: the whole travel, and loads that swing."""
        angles = [one.unit == "rad" for one in self._plant.unactuated]
        swung = np.tile(np.where(angles, SWAYS, 0.0), (len(self._followers), 1))
        frames = self._animation(self._ends(), np.stack([-swung, swung])).to_json()
        views: list[list[float]] = [view["bounds"] for view in frames["views"]]
        return views

    def _facts(self, position: Array, velocity: Array, stops: Sequence[Array]) -> list[Part]:
        """Tell of every planned axis where it is, where a stop would lead, and what it may do."""
        facts = []
        for index, column in enumerate(self._columns):
            axis, limits = self._plant.actuated[column], self._spec.limits.of(column)
            unit, factor = place_unit(self._spec, column)
            facts.append(
                {
                    "name": axis.name,
                    "unit": unit,
                    "factor": factor,
                    "si": axis.unit,
                    "position": float(position[index]),
                    "velocity": float(velocity[index]),
                    "stop_low": float(stops[0][index]),
                    "stop_high": float(stops[1][index]),
                    "fastest": limits.velocity,
                    "travel": limits.travel,
                }
            )
        return facts

    def _ranges(self, name: str, value: float) -> Part:
        low, high = self._spec.planner.live[name]
        return {"name": name, "value": value, "least": low, "most": high, "unit": self._plant.units[name]}


def _load(drawing: Drawing) -> int:
    """Find the point of a drawing at which its end load is."""
    loads = [shape for shape in drawing.shapes if shape.kind == "load"]
    return [*drawing.shapes, *loads][-1].points[0]


def _followers(spec: Spec) -> dict[str, Mapping[str, float]]:
    """Choose the machines: nominal, and both ends of every range beside; a sensor measures but the first."""
    ranges, nominal = spec.checked_ranges(), spec.plant.parameters
    ends = {
        name: (low / nominal[name], high / nominal[name])
        for name, (low, high) in ranges.items()
        if nominal[name] != 0.0 and name not in spec.check.spans
    }
    followers: dict[str, Mapping[str, float]] = {"nominal": {}}
    for side in (0, 1) if ends and spec.planner.sensor is None else ():
        off = {name: both[side] for name, both in ends.items()}
        words = ", ".join(f"{name} {100.0 * (factor - 1.0):+.3g} %" for name, factor in off.items())
        followers[machine(words)] = off
    return followers
