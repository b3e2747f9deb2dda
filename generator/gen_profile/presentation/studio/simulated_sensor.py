"""The sensor of a load that a planner block is shown on a page: late, and as wrong as a hand makes it."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gen_profile.dynamics.evaluation.simulation import equations_of
from gen_profile.motion.profile import Array
from gen_profile.planner.directions import sensed_directions, shown_by_sensors
from gen_profile.spec.model import Spec

NOISIER, FARTHER, LATER, GREATER = 10.0, 4.0, 3.0, 2.0  # than stated, at most; a scale
LATEST = 0.1  # s, where no delay is stated


class SimulatedSensor:
    """What the sensors of a spec show of a machine that they `follow`, from its first state on.

    Parameters
    ----------
    spec : Spec
        It states a sensor.
    cycle : float
        Of the block, in s.
    """

    def __init__(self, spec: Spec, cycle: float) -> None:
        sensor = spec.planner.sensor
        assert sensor is not None
        self._spec, self._plant, self._cycle = spec, spec.machine(), cycle
        self._in_order = np.argsort(list(sensed_directions(spec)))  # of the block's axes
        offset, delay = sensor.offset or sensor.noise, sensor.delay
        self._ranges = {
            "noise": (0.0, NOISIER * sensor.noise),
            "offset": (-FARTHER * offset, FARTHER * offset),
            "age": (0.0, LATER * (delay[1] or LATEST)),
            "scale": (-GREATER, GREATER),
        }
        self._set = {"noise": sensor.noise, "offset": 0.0, "age": sum(delay) / 2.0, "scale": 1.0}
        self._heard = True  # whether there is news of it
        self._kept = round(self._ranges["age"][1] / cycle) + 1
        self._true = np.zeros((0, len(self._in_order)))
        self._random = np.random.default_rng(0)

    @property
    def knobs(self) -> list[dict[str, Any]]:
        """Its errors as they are, and between what they may be."""
        return [
            {"name": name, "value": self._set[name], "least": least, "most": most}
            for name, (least, most) in self._ranges.items()
        ]

    def set(self, errors: Mapping[str, float]) -> None:
        """Give it a noise, an offset, an age in s and a scale; it is silent where ``lost`` is not 0."""
        self._set |= {
            name: min(max(errors.get(name, self._set[name]), least), most)
            for name, (least, most) in self._ranges.items()
        }
        self._heard = not errors.get("lost", 0.0)

    @property
    def known_cycles(self) -> int:
        """Of how many cycles to come it is known what it shows."""
        return max(1, self._age)

    @property
    def _age(self) -> int:
        return round(self._set["age"] / self._cycle)

    def shows(self, cycles: int) -> Array | None:
        """Show a value for each of so many known cycles, as `Planner.hold` takes them; None without news."""
        if not self._heard:
            return None
        latest = len(self._true) - 1 - self._age
        true = self._true[np.maximum(latest + np.arange(cycles), 0)]
        noise = self._set["noise"] * self._random.standard_normal(true.shape)
        shown = self._set["scale"] * true + self._set["offset"] + noise
        return shown if shown.shape[1] > 1 else shown[:, 0]

    def follow(self, states: Array, axes: Array, parameters: Array) -> None:
        """See how the machine goes on, or begins.

        Parameters
        ----------
        states : (2, cycles, n_u) array
            q_u and its rate at the end of each cycle.
        axes : (cycles, axes) array
        parameters : (1, parameters) array
        """
        sway = equations_of(self._plant)[1](states[0], axes, parameters)[:, : len(self._plant.loads), 0]
        seen = shown_by_sensors(self._spec, states[0], states[1], sway)[:, self._in_order]
        self._true = np.concatenate([self._true, seen])[-self._kept :]
