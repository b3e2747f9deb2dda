"""Along which axes a planner block moves a machine, and what its sensors show of each."""

from collections.abc import Mapping, Sequence

import attrs
import numpy as np

from gen_profile.dynamics.problem.linearization import Linearization, linearize
from gen_profile.motion.profile import Array
from gen_profile.planner.interface import BlockAxis
from gen_profile.spec.model import Spec
from gen_profile.support.errors import SpecError

ALONE = 1e-6  # of what a sensor shows, by other axes
NO_ACCELERATION = 1e-9  # acceleration of a coordinate, relative to an axis's, that counts as none


def planned_axes(spec: Spec) -> dict[int, BlockAxis]:
    """Find the axes that make a load sway by their numbers: these the block plans, and no others."""
    middle, axes = linearized(spec, [0.0] * len(spec.planner.live)), spec.machine().actuated
    numbers = np.flatnonzero(np.abs(middle.input).max(axis=0) > NO_ACCELERATION).tolist()
    several = len(numbers) > 1
    return {k: BlockAxis(name=axes[k].name if several else "", unit=axes[k].unit) for k in numbers}


@attrs.frozen(kw_only=True)
class SensedDirection:
    """What a sensor measures along an axis.

    Attributes
    ----------
    axis : int
        That makes swing what it shows.
    of : str
        A coordinate's name, or a load's.
    largest : tuple of int
        The load that shows each mode most, by its number.
    end_load : int
        Number of the end load in this direction.
    """

    axis: int
    of: str
    largest: tuple[int, ...]
    end_load: int


def shown_by_sensors(spec: Spec, q_u: Array, dq_u: Array, sway: Array) -> Array:
    """Give what the sensors of ``planner.sensor.of`` show, one after the other.

    Parameters
    ----------
    spec : Spec
    q_u, dq_u : (..., n_u) array
    sway : (..., loads) array
        m.

    Returns
    -------
    (..., sensors) array
    """
    plant, sensor = spec.machine(), spec.planner.sensor
    assert sensor is not None
    coordinates = [coordinate.name for coordinate in plant.unactuated]
    values, known = {
        "angle": (q_u, coordinates),
        "rate": (dq_u, coordinates),
        "sway": (sway, list(plant.loads)),
    }[sensor.quantity]
    return values[..., [known.index(name) for name in sensor.names]]


def sensed_directions(spec: Spec) -> dict[int, SensedDirection]:
    """Find what sensors measure along which axes, by the axes' numbers.

    Raises
    ------
    SpecError
        One shows no axis, or several, or what another one shows.
    """
    sensor, found = spec.planner.sensor, dict[int, SensedDirection]()
    assert sensor is not None
    middle = linearized(spec, [0.0] * len(spec.planner.live))
    end = range(len(spec.machine().loads))[spec.machine().end_load]
    for of in sensor.names:
        shown = {
            axis: float(np.abs(_row(spec, middle, of) @ driven_modes(middle, axis)).max())
            for axis in planned_axes(spec)
        }
        axis = max(shown, key=lambda number: shown[number])
        if any(other > ALONE * shown[axis] for number, other in shown.items() if number != axis):
            raise SpecError(f"planner.sensor.of: {of} shows more than one axis; measure along one.")
        if axis in found:
            raise SpecError(
                f"planner.sensor.of: {found[axis].of} and {of} swing along the same axis; name one of them."
            )
        sways = np.abs(middle.sway_gain @ driven_modes(middle, axis))
        found[axis] = SensedDirection(
            axis=axis,
            of=of,
            largest=tuple(sways.argmax(axis=0).tolist()),
            end_load=end[int(sways[end, 0].argmax())],
        )
    return found


def shown_of_modes(spec: Spec, at: Linearization, direction: SensedDirection) -> Array:
    """Give what the sensor shows of `driven_modes` (or of their rates), shape (modes,)."""
    return np.asarray(_row(spec, at, direction.of) @ driven_modes(at, direction.axis))


def _row(spec: Spec, at: Linearization, of: str) -> Array:
    sensor, plant = spec.planner.sensor, spec.machine()
    assert sensor is not None
    if sensor.quantity == "sway":
        return np.asarray(at.sway_gain[list(plant.loads).index(of)])
    return np.asarray(np.eye(len(plant.unactuated))[[one.name for one in plant.unactuated].index(of)])


def driven_modes(at: Linearization, axis: int) -> Array:
    """Give the coordinates' amplitudes in modes of different frequencies that an axis makes, as columns.

    Each follows z″ + 2 ζ ω z′ + ω² z = the axis's acceleration, times its column.
    """
    driven = at.modes * np.linalg.solve(at.modes, at.input)[:, axis]
    modes = np.abs(at.frequencies[:, None] - at.distinct_frequencies).argmin(axis=1)
    return np.asarray(driven @ np.eye(len(at.distinct_frequencies))[modes])


def linearized(
    spec: Spec, point: Sequence[float], errors: Mapping[str, float] | None = None
) -> Linearization:
    """Linearise the machine at a point of the live ranges, given in −1 … 1, some parameters times errors."""
    plant = spec.machine()
    values = {
        name: 0.5 * (low + high + x * (high - low))
        for (name, (low, high)), x in zip(spec.planner.live.items(), point, strict=True)
    }
    bounds = {p.name: p for p in plant.parameters}
    parameters = dict(spec.plant.parameters) | {
        name: max(value, bounds[name].lower) for name, value in values.items() if name in bounds
    }
    for name, error in (errors or {}).items():
        parameters[name] *= error
    q_a = [values.get(axis.name, start) for axis, start in zip(plant.actuated, spec.move.start, strict=True)]
    return linearize(plant, parameters, q_a)
