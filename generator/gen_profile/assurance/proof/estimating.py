"""By how much an estimate of sway may be off, and what a sensor may show, known of machine and spec alone.

A slow period of values tells how the slowest mode swings, and apart from it an offset. So whatever observer a
block has, its estimate need not be off by more than what is unknown makes of the sway in one such period if
nothing of it is corrected: gusts; the errors of the machine, which act on its own motions and on what swings;
values as much older or newer as they may be; and the offset. Noise is left to `fSwayUncertainty`.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import product

import attrs
import numpy as np

from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.methods.quickest.modes import SwayModes
from gen_profile.motion.profile import Array
from gen_profile.planner.directions import SensedDirection, driven_modes, sensed_directions, shown_of_modes
from gen_profile.spec.model import Spec

Machine = tuple[Mapping[str, float], Sequence[float]]  # parameters, and places of the axes

SAMPLES = 2000  # of a slow period, over which responses are integrated
NOISES = 8.0  # standard deviations of the noise that no value is off by

_STATED = re.compile(r"\bfSwayUncertainty\w*\s*:\s*LREAL\s*;\s*\(\*[^*]*\badd up to ([0-9.Ee+-]+) m\b")


@attrs.frozen(kw_only=True)
class Unknown:
    """What is unknown along an axis with a sensor, at most, in m of the end load's sway in a slow period.

    Attributes
    ----------
    gusts, errors, delay, offset : float
    shown : float
        What the sensor shows of the stated swing, of gusts, offset and noise, in its unit.
    """

    gusts: float
    errors: float
    delay: float
    offset: float
    shown: float

    @property
    def sway(self) -> float:
        """All together."""
        return self.gusts + self.errors + self.delay + self.offset


def estimation_error(
    spec: Spec, text: str, machines_of_errors: Callable[[Mapping[str, float]], Sequence[Sequence[Machine]]]
) -> float:
    """Find by how much in m an estimate may be off beside `fSwayUncertainty`.

    No more than the block's text states beside that output, and than what is unknown at the ends of all live
    ranges.

    Parameters
    ----------
    spec : Spec
    text : str
        The block.
    machines_of_errors : callable
        Of the machine of some live parameters and those of its stated errors, from it to each corner.
    """
    found = []
    for ends in product(*spec.planner.live.values()):
        lines = machines_of_errors(dict(zip(spec.planner.live, ends, strict=True)))
        machines = [lines[0][0], *(line[-1] for line in lines)]
        found += [unknown(spec, machines, one).sway for one in sensed_directions(spec).values()]
    return min([max(found), *map(float, _STATED.findall(text))])


def unknown(spec: Spec, machines: Sequence[Machine], direction: SensedDirection) -> Unknown:
    """Find what is unknown of the first of some machines, which may be any of the others in truth."""
    sensor, disturbance = spec.planner.sensor, spec.planner.disturbance
    acceleration = spec.limits.of(direction.axis).acceleration
    assert sensor and disturbance and acceleration
    modes = SwayModes.of(spec.machine(), machines, [direction.axis])
    rates, slowest = modes.poles.imag, float(modes.poles[0].imag.min())
    times = np.linspace(0.0, 2.0 * np.pi / rates.min(), SAMPLES)
    sways, speeds = _responses(modes, direction.end_load, times)
    swing, shows = _slowest_mode(spec, machines[0], direction)
    out_of_phase = 2.0 * np.sin(
        np.minimum(0.5 * np.abs(rates[:, 0] - slowest).max() * times[-1], 0.5 * np.pi)
    )
    gusts = (disturbance.gust.acceleration if disturbance.gust else 0.0) * _integral(sways, times)
    fastest = acceleration * _integral(speeds, times) + swing * float(rates[:, 0].max())
    shown = shows * slowest ** int(sensor.quantity == "rate")
    return Unknown(
        gusts=gusts,
        errors=acceleration * _integral(sways - sways[0], times) + swing * float(out_of_phase),
        delay=sensor.unknown_delay * fastest,
        offset=sensor.offset / shown,
        shown=shown * (swing + gusts) + sensor.offset + NOISES * sensor.noise,
    )


def _slowest_mode(spec: Spec, machine: Machine, direction: SensedDirection) -> tuple[float, float]:
    """Tell what the end load may swing by at first, in m, and what the sensor shows of each metre."""
    at, disturbance = linearize(spec.machine(), *machine), spec.planner.disturbance
    assert disturbance
    sways = np.abs(at.sway_gain @ driven_modes(at, direction.axis)[:, 0])
    loads = list(spec.machine().loads)
    most = [
        swing * sways[direction.end_load] / sway
        for load, swing in disturbance.swing.items()
        if (sway := sways[loads.index(load)]) > 0.0
    ]
    shown = np.abs(shown_of_modes(spec, at, direction)[0]) / sways[direction.end_load]
    return float(min(most)), float(shown)


def _responses(modes: SwayModes, load: int, times: Array) -> tuple[Array, Array]:
    """Give each machine's sway of a load, and its rate, after an impulse of an axis: (machines, times)."""
    waves = modes.gains[:, load, 0, :, None] * np.exp(modes.poles[:, :, None] * times)
    return waves.imag.sum(axis=1), (modes.poles[:, :, None] * waves).imag.sum(axis=1)


def _integral(values: Array, times: Array) -> float:
    """Integrate the sizes of each machine's values, and give the greatest."""
    return float(np.abs(values).mean(axis=-1).max() * times[-1])
