"""How wrong a sensor may be until damping no longer calms a load, by playing a written block.

What a block does with what a sensor shows is found anew as the load goes on, so it has no frequency response.
So it is played while the load swings, on the machine's FMU, where that swings most quickly and most slowly
within the live ranges. Its watch over the sensor is switched off, as that would end the trial.
"""

import re
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from itertools import product
from typing import Any, Self

import attrs
import numpy as np

from gen_profile.planner.directions import driven_modes, linearized, planned_axes, sensed_directions
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.sensor import sensed_modes
from gen_profile.spec.model import Spec
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.model.plant_variables import MAX_STEP, TAU
from gen_profile_fmu.running.block_run import BlockFollower, Measurement, Script

PERIODS = 12.0  # of the slowest swing, that are played
SHARE = 0.4  # of the stated swing, at the beginning
DELAYS = 0.08  # of that period: steps of a delay until one no longer calms
GAINS = 1.5  # likewise, the ratio of gains
MOST_DELAY, MOST_GAIN = 1.0, 12.0  # of the period; and what is tried at most
HALVINGS = 3  # of the last step
STEP = 0.05  # rad of the fastest swing, an integration step at most
WATCHES = re.compile(r"\b((?:cMisread|cFrozen|cGate|cMost|cMostNoise|cGrown)\s*:\s*LREAL\s*:=)[^;]*")


@attrs.frozen(kw_only=True)
class Margins:
    """How wrong a sensor may be, at the worse of these, before damping no longer calms.

    Attributes
    ----------
    delay : float
        s, by which it may be later than `planner.sensor.delay` says in the middle.
    gain : float
        How many times too much it may show; infinity where all that were tried calm.
    """

    delay: float
    gain: float

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {"delay_s": self.delay, "gain": self.gain}


def sensor_margins(spec: Spec, text: str) -> Margins | None:
    """Find the margins of a written block.

    Parameters
    ----------
    spec : Spec
    text : str
        Of the block of this spec.

    Returns
    -------
    Margins or None
        None where it has no sensor.

    Raises
    ------
    ExportError, CosimulationError
        The text, or the machine's FMU, cannot be executed.
    """
    if spec.planner.sensor is None:
        return None
    delay, gain = np.inf, np.inf
    with SwungMachine(spec, WATCHES.sub(r"\1 1.0E+9", text)) as machine:
        corners = sorted(product((-1.0, 1.0), repeat=len(spec.planner.live)), key=machine.period)
        for point in dict.fromkeys((corners[0], corners[-1])):
            delays = np.arange(0.0, MOST_DELAY, DELAYS) * machine.period(point)
            delay = _most(partial(machine.calms, point, gain=1.0), delays.tolist(), delay)
            gains = GAINS ** np.arange(0.0, np.log(MOST_GAIN) / np.log(GAINS))
            gain = _most(partial(machine.calms, point, 0.0), gains.tolist(), gain)
    return Margins(delay=float(delay), gain=float(gain))


def _most(calms: Callable[[float], bool], steps: Sequence[float], known: float) -> float:
    """Find up to where all calm, by these steps and then halves of the last; no more than is known."""
    if known < np.inf and calms(known):
        return known
    low, high = 0.0, np.inf
    for step in steps:
        if step >= known or not calms(step):
            high = step
            break
        low = step
    if high == np.inf:
        return known
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if calms(middle) else (low, middle)
    return low


class SwungMachine:
    """The machine of a spec, which swings and follows a block that is shown it; a context manager."""

    def __init__(self, spec: Spec, text: str) -> None:
        self._spec, self._block, self._open = spec, BlockInstance(text), ExitStack()
        self._follower = self._open.enter_context(BlockFollower(plant_fmu(spec.machine())))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def period(self, point: Sequence[float]) -> float:
        """Give the slowest swing's in s, at a point of the live ranges, each from −1 to 1."""
        return float(2.0 * np.pi / linearized(self._spec, point).distinct_frequencies[0])

    def calms(self, point: Sequence[float], late: float, gain: float) -> bool:
        """Tell whether the block calms a swing by sensors so many s late that show so many times too much."""
        spec, cycle, axes = self._spec, self._spec.export.cycle_time, planned_axes(self._spec)
        sensor, period, given = spec.planner.sensor, self.period(point), self._live(point)
        assert sensor is not None
        inputs = self._block.inputs | {f"f{name}": value for name, value in given.items()} | {"bEnable": 1.0}
        names, sensed = [*inputs], [axes[number] for number in sensed_directions(spec)]
        quantity = {"angle": "{}", "rate": "{}.rate", "sway": "sway.{}"}[sensor.quantity]
        cycles, watch = (round(periods * period / cycle) for periods in (PERIODS, 1.0))
        outputs = np.tile(
            [gain, 0.0, round((sensor.usual_age + late) / cycle), 1.0], (cycles + 1, len(sensed), 1)
        )
        script = Script(
            cycle=cycle,
            start_cycles=[0, cycles],
            inputs=np.array(2 * [[*inputs.values()]]),
            actual=[names.index(axis.of("fActPosition")) for axis in axes.values()],
            longest=0,
            settle=0,
            watch=0,
            measured=Measurement(
                quantities=[quantity.format(of) for of in sensor.names],
                shows=[names.index(axis.of("fSensor")) for axis in sensed],
                valid=[names.index(axis.of("bSensorValid")) for axis in sensed],
                cycles=outputs,
                pushed=np.zeros((cycles + 1, len(axes))),
                again=cycles,
            ),
        )
        values = self._starts(point, given)
        run = self._follower.run(self._block.called(), script, values, [*axes], rows=cycles)
        assert run.trace is not None
        left = np.abs(run.trace[-watch:, len(self._block.outputs) :]).max(axis=0)
        return bool((left <= [*spec.check.residual_sway.values()]).all())

    def _live(self, point: Sequence[float]) -> dict[str, float]:
        ranges = zip(self._spec.planner.live.items(), point, strict=True)
        return {name: 0.5 * (low + high + x * (high - low)) for (name, (low, high)), x in ranges}

    def _starts(self, point: Sequence[float], live: dict[str, float]) -> dict[str, float]:
        """Give the FMU's start values: a share of the stated swing along each axis with a sensor."""
        spec, machine, at = self._spec, self._spec.machine(), linearized(self._spec, point)
        step = STEP / float(at.distinct_frequencies[-1])
        values = dict(spec.plant.parameters) | live | {TAU: spec.actuator.tau or 0.0, MAX_STEP: step}
        for number, axis in enumerate(machine.actuated):
            place = float(np.mean(spec.limits.of(number).travel or 0.0))
            values |= {f"{axis.name}.start": place, f"{axis.name}.setpoint": place}
        swings = np.zeros(len(machine.unactuated))
        for number, direction in sensed_directions(spec).items():
            modes = sensed_modes(spec, point, direction)
            swings += SHARE * modes.swing / modes.push[0] * driven_modes(at, number)[:, 0]
        names = (coordinate.name for coordinate in machine.unactuated)
        return values | dict(zip(names, swings.tolist(), strict=True))
