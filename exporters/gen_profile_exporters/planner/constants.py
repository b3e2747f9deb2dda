"""What a planner block needs to know of a machine."""

from collections.abc import Mapping, Sequence

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile_exporters.planner.axis_declarations import AxisConstants
from gen_profile_exporters.planner.sensor_constants import SensorConstants


@attrs.frozen(kw_only=True, eq=False)
class SwayConstants:
    """How loads on ropes sway: sums of products of Chebyshev polynomials of the live parameters.

    Attributes
    ----------
    curvatures : sequence of float
        Bends of the live parameters, as in `PlannerConstants`.
    exponents : (parameters, terms) array of int
    coefficients : (rows, terms) array
        For the squared frequencies (of two, for their sum and product), then for the matrix of the loads'
        sway, row by row, in 1/s².
    """

    curvatures: Sequence[float]
    exponents: NDArray[np.int64]
    coefficients: Array


@attrs.frozen(kw_only=True, eq=False)
class PlannerConstants:
    """What the block needs to know of a machine.

    Attributes
    ----------
    name, machine : str
    axes : tuple of AxisConstants
        That it plans.
    cycle : float
        s.
    live : mapping of str to (float, float)
        Ranges of the live parameters.
    units, nominal : tuple of str, tuple of float
        In which they are given, and their values where the controller gives none.
    drift : tuple of float
        By how much each may change before it is taken over anew.
    rates : mapping of str to float
        How fast some may change on the way, per s.
    rope_length_gain : mapping of str to float
        Of live parameters that lower all loads by as much as they grow: the inverse of gravity, in s²/m.
    tilt : float
        s²/m: the inverse of gravity, where it brings loads back; where springs do, next to nothing.
    sway_limit : float
        m, that the loads may sway after a motion.
    events : bool
        Whether the last events are outputs.
    zones : bool
        Whether blocked and slow intervals of the travel are inputs.
    operations : int
        That a cycle may spend.
    states_operations : bool
        Whether the spec states them: they are not to be more.
    periods : sequence of float
        s, of the slowest mode at the corners of the live ranges.
    prompt : bool
        Whether stops are prompt where the controller does not say.
    sway_share : float
        m, of the sway that errors may leave: what plans may spend; 0 for motions that leave none to first
        order.
    stated_error : float
        Relative error that the frequencies may have.
    degrees : int
        Chebyshev polynomials per live parameter.
    curvatures : sequence of float
        Of each live parameter t from -1 to 1: k of (t + k) / (1 + k t), of which they are; of the
        frequencies and decays, then of what follows.
    exponents : (parameters, terms) array of int
        Which of them are multiplied.
    least_decay : float
        How slowly modes of the stated errors may decay, relative to those of the machine as given.
    modes : int
    model : (rows, terms) array
        Coefficients for the squared frequencies (of two, for their sum and product), for the decays, then
        with rates for the matrix of the linear machine in the loads' sway, row by row, or else for the
        errors of the frequencies and the loads' sway by what is left in a mode, axis by axis; for a sensor.
    sensor : SensorConstants or None
    sway : SwayConstants or None
        Where the loads hang on ropes, and the rope changes on the way or the load is measured.
    """

    name: str
    machine: str
    axes: tuple[AxisConstants, ...]
    cycle: float
    live: Mapping[str, tuple[float, float]]
    units: tuple[str, ...]
    nominal: tuple[float, ...]
    drift: tuple[float, ...]
    rates: Mapping[str, float]
    rope_length_gain: Mapping[str, float]
    tilt: float
    sway_limit: float
    events: bool
    zones: bool
    operations: int
    states_operations: bool
    periods: Sequence[float]
    prompt: bool
    sway_share: float
    stated_error: float
    degrees: int
    curvatures: Sequence[float]
    exponents: NDArray[np.int64]
    least_decay: float
    modes: int
    model: Array
    sensor: SensorConstants | None = None
    sway: SwayConstants | None = None
