"""The machine playing its move beside perturbed ones, as the numbers that a page's script plays."""

import math
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.motion_evaluation import MotionEvaluation
from gen_profile.motion.profile import Array
from gen_profile.plants.drawing import Drawing
from gen_profile.plants.looks import body_size, drawings, pose_of
from gen_profile.presentation.charts.curves import Shown, end_load_sway
from gen_profile.presentation.charts.plotly_json import rounded
from gen_profile.spec.model import Spec

TWINS = 2  # machines beside the nominal one
FRAME_RATE = 30.0  # 1/s; the page draws between frames
MOST_FRAMES = 600
PLACE_DIGITS, SWING_DIGITS = 4, 6  # of the picture's size; a swing can be drawn larger than it is
MARGIN = 0.06  # around a picture, of its size
FLATTEST, NARROWEST = 0.2, 1.2  # height of a picture over its width


@attrs.frozen(kw_only=True, eq=False)
class Actor:
    """One machine in the animation.

    Attributes
    ----------
    name : str
    colour : str
    sway : (frames,) array
        Of the end load, in m.
    drawings : sequence of Drawing
    """

    name: str
    colour: str
    sway: Array
    drawings: Sequence[Drawing]


@attrs.frozen(kw_only=True, eq=False)
class Animation:
    """Machines that play the same move.

    Attributes
    ----------
    times : (frames,) array
        Evenly spaced, in s, from 0.
    arrival : float
        When the axes stand still, in s.
    limit : float
        Of the end load's sway from then on, in m.
    load : str
        Name of the end load.
    actors : sequence of Actor
    obstacles : (n, 4) array
        What stands there, in the first view: left, bottom, width and height in m.
    """

    times: Array
    arrival: float
    limit: float
    load: str
    actors: Sequence[Actor]
    obstacles: Array = attrs.field(factory=lambda: np.zeros((0, 4)))
    kind = "animation"

    def to_json(self, bounds: Sequence[Sequence[float]] | None = None) -> dict[str, Any]:
        """Nest plain values for the page's script.

        Places at rest and swings away from them are whole numbers of a unit each, which are short to write.

        Parameters
        ----------
        bounds : sequence of (left, bottom, width, height), optional
            What every view shows, in m; all that the machines need by default.
        """
        views = len(self.actors[0].drawings)
        bounds = bounds or [self._bounds(view) for view in range(views)]
        return {
            "step": float(self.times[-1]) / (len(self.times) - 1),
            "frames": len(self.times),
            "arrival": self.arrival,
            "limit_mm": 1e3 * self.limit,
            "load": self.load,
            "obstacles": self.obstacles.tolist(),
            "views": [
                {"title": drawing.title, "bounds": box, "units": _units(box)}
                for drawing, box in zip(self.actors[0].drawings, bounds, strict=True)
            ],
            "actors": [
                {
                    "name": actor.name,
                    "colour": actor.colour,
                    "sway_mm": rounded(1e3 * actor.sway),
                    "views": [
                        _moving(drawing, box) for drawing, box in zip(actor.drawings, bounds, strict=True)
                    ],
                }
                for actor in self.actors
            ],
        }

    def _bounds(self, view: int) -> list[float]:
        """Find left, bottom, width and height in m of what all machines need, in a handsome shape."""
        drawings = [actor.drawings[view] for actor in self.actors]
        reach = max(max(shape.size) for drawing in drawings for shape in drawing.shapes)
        corners = [
            (places.min(axis=(0, 1)) - reach, places.max(axis=(0, 1)) + reach)
            for drawing in drawings
            for places in (drawing.points, drawing.rest)
        ]
        if view == 0:
            corners += [(box[:2], box[:2] + box[2:]) for box in self.obstacles]
        low, high = np.min([corner[0] for corner in corners], 0), np.max([corner[1] for corner in corners], 0)
        size = (1.0 + 2.0 * MARGIN) * (high - low)
        width = max(float(size[0]), float(size[1]) / NARROWEST)
        height = max(float(size[1]), FLATTEST * width)
        left, bottom = (low + high - (width, height)) / 2.0
        return [float(f"{value:.6g}") for value in (left, bottom, width, height)]


def _units(box: Sequence[float]) -> list[float]:
    """Choose what a whole number of a place, and of a swing, stands for in m."""
    size = math.floor(math.log10(max(box[2:])))
    return [10.0 ** (size - PLACE_DIGITS), 10.0 ** (size - SWING_DIGITS)]


def _moving(drawing: Drawing, box: Sequence[float]) -> dict[str, Any]:
    place, swing = _units(box)
    rest = np.rint(drawing.rest / place).astype(np.int64)
    away = np.rint((drawing.points - drawing.rest) / swing).astype(np.int64)
    return {
        "rest": rest.reshape(len(rest), -1).tolist(),
        "swing": away.reshape(len(away), -1).tolist(),
        "shapes": [
            {"kind": shape.kind, "points": list(shape.points), "size": list(shape.size)}
            for shape in drawing.shapes
        ],
    }


def animation(spec: Spec, evaluation: MotionEvaluation, shown: Sequence[Shown], arrival: float) -> Animation:
    """Let the nominal machine and those that sway the most play the move, and swing on.

    Parameters
    ----------
    spec : Spec
    evaluation : MotionEvaluation
    shown : sequence of Shown
        Of which the first ranks play.
    arrival : float
        When the axes stand still, in s.
    """
    until = evaluation.motion.duration + evaluation.watch
    times = np.linspace(0.0, until, min(MOST_FRAMES, int(np.ceil(FRAME_RATE * until)) + 1))
    responses = evaluation.swing.at(times)
    plant = spec.machine()
    size = body_size(plant, evaluation.machines[0].parameters, responses[0].position)
    actors = []
    for one in (one for one in shown if one.rank <= TWINS):
        response, parameters = responses[one.index], evaluation.machines[one.index].parameters
        pose = pose_of(plant, parameters, response.position, response.q_u, size)
        sway = end_load_sway(spec, response)
        drawn = drawings(plant, pose)
        actors.append(Actor(name=one.name, colour=one.style.colour, sway=sway, drawings=drawn))
    return Animation(
        times=times,
        arrival=arrival,
        limit=spec.check.residual_sway[plant.loads[-1]],
        load=plant.end_load_name,
        actors=actors,
        obstacles=_obstacles(spec),
    )


def _obstacles(spec: Spec) -> Array:
    """Tell where stacks are below the suspension."""
    path = spec.path
    if path is None:
        return np.zeros((0, 4))
    floor = min(0.0, *(row[-1] for row in path.stacks))
    standing = [(a, floor - path.rail, b - a, top - floor) for a, b, *_, top in path.stacks]
    hanging = [(a, height - path.rail, b - a, path.rail - height) for a, b, *_, height in path.overhead]
    return np.array([*standing, *(one for one in hanging if one[3] > 0.0)])
