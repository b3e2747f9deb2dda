"""What a planner has to know of its machine: the modes as functions of the live parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from types import SimpleNamespace

import attrs
import numpy as np

from gen_profile.errors import SpecError
from gen_profile.planner.chebyshev import Array, Interpolant, interpolate
from gen_profile.problem.linearization import Linearization, linearize
from gen_profile.spec.model import Spec

MOST_MODES = 2
MOST_RATIO = 9.0  # of the fastest mode to the slowest, whose period makes the slots
MOST_LIVE = 2
DEGREES = (3, 6, 9, 12)
ACCURACY = 1e-5  # relative, of the frequencies over the live ranges
MOST_TERMS = 60
NEGLIGIBLE = 1e-7  # coefficient, relative to the largest of its function


@attrs.frozen(kw_only=True, eq=False)
class LiveModes:
    """Frequencies in rad/s and decays in 1/s of the modes over the ranges of the live parameters.

    Attributes
    ----------
    modes : int
    live : mapping of str to (float, float)
    interpolant : Interpolant
        Of the live parameters, each mapped to −1 … 1: the elementary symmetric polynomials of the squared
        frequencies (which have no branch point where two modes come near each other), then the decays; and
        where live parameters change on the way, the matrix of the loads' sway in 1/s², row by row.
    error : float
        Greatest relative error of a frequency found between the points of interpolation.
    """

    modes: int
    live: Mapping[str, tuple[float, float]]
    interpolant: Interpolant
    error: float


def live_modes(spec: Spec) -> LiveModes:
    """Find a machine's modes over the ranges of its live parameters.

    Raises
    ------
    SpecError
        The planner block does not take this machine, or not over these ranges.
    """
    live = spec.planner.live
    _refuse_others(spec)
    _refuse_rates(spec)

    def invariants(point: Sequence[float]) -> Array:
        found = _linearized(spec, point)
        squares = found.frequencies**2
        return np.array(
            [
                squares.sum(),
                *[squares.prod()][: len(squares) - 1],
                *(found.damping_ratios * found.frequencies),
                *(_sway_matrix(found).ravel() if spec.planner.live_rate else ()),
            ]
        )

    modes = len(_linearized(spec, [0.0] * len(live)).frequencies)
    between = list(product(np.linspace(-1.0, 1.0, 6), repeat=len(live)))
    exact = [_linearized(spec, point).frequencies for point in between]
    for degree in DEGREES if live else (0,):
        interpolant = interpolate(invariants, len(live), degree).without(NEGLIGIBLE)
        found = [frequencies(interpolant(point)[:modes]) for point in between]
        error = float(np.abs(np.array(found) / exact - 1.0).max())
        if error <= ACCURACY or interpolant.exponents.shape[1] > MOST_TERMS:
            break
    if error > ACCURACY or interpolant.exponents.shape[1] > MOST_TERMS:
        raise SpecError(
            f"planner.live: over these ranges the frequencies would be known to {error:.1g} only; "
            "narrow the ranges, or write a block for each part of them."
        )
    slowest, fastest = np.array(exact)[:, 0], np.array(exact)[:, -1]
    if (fastest / slowest).max() > MOST_RATIO:
        raise SpecError(
            f"plant: the fastest mode has more than {MOST_RATIO:g} times the frequency of the slowest, "
            "and the planner block does not take that; leave the fast mode out of the machine."
        )
    return LiveModes(modes=modes, live=live, interpolant=interpolant, error=error)


def frequencies(invariants: Array) -> Array:
    """Find one or two frequencies from their squares' sum (and product), as the block does."""
    if len(invariants) == 1:
        return np.asarray(np.sqrt(invariants))
    total, product_ = invariants
    larger = 0.5 * (total + np.sqrt(total * total - 4.0 * product_))
    return np.asarray(np.sqrt([product_ / larger, larger]))


def _linearized(spec: Spec, point: Sequence[float]) -> Linearization:
    """Linearise the machine at a point of the live ranges, given in −1 … 1."""
    plant = spec.machine()
    values = {
        name: 0.5 * (low + high + x * (high - low))
        for (name, (low, high)), x in zip(spec.planner.live.items(), point, strict=True)
    }
    bounds = {p.name: p for p in plant.parameters}
    parameters = dict(spec.plant.parameters) | {
        name: max(value, bounds[name].lower) for name, value in values.items() if name in bounds
    }
    q_a = [values.get(axis.name, start) for axis, start in zip(plant.actuated, spec.move.start, strict=True)]
    return linearize(plant, parameters, q_a)


def _sway_matrix(found: Linearization) -> Array:
    """Find A of sway'' = acceleration − A sway.

    A rope's rate appears in it nowhere: a load's horizontal acceleration is the rope's force by its mass, and
    that depends on where the loads are.
    """
    gain = found.sway_gain
    return np.asarray(gain @ found.stiffness @ np.linalg.inv(gain))


def _refuse_rates(spec: Spec) -> None:
    """Refuse live parameters that change on the way, of machines that sway otherwise than loads on ropes."""
    plant, rates = spec.machine(), spec.planner.live_rate
    if not rates:
        return
    middle = _linearized(spec, [0.0] * len(spec.planner.live))
    if np.abs(middle.damping).max() > 0.0:
        raise SpecError(
            "planner.live_rate: the planner block follows machines without damping only; set the damping "
            "to 0, which is the worse case."
        )
    if plant.bodies != plant.loads or middle.sway_gain.shape[0] != middle.sway_gain.shape[1]:
        raise SpecError(f"planner.live_rate: the loads of a {plant.type} do not hang on ropes alone.")
    for name in rates:
        if not _is_length(spec, name):
            raise SpecError(f"planner.live_rate.{name}: no rope's length; only these may change on the way.")


def _is_length(spec: Spec, name: str) -> bool:
    """Whether a load comes down by as much as a parameter grows, all hanging still."""
    plant, (low, high) = spec.machine(), spec.planner.live[name]
    still = [0.0] * len(plant.unactuated)
    heights = []
    for value in (low, high):
        places = [
            value if axis.name == name else start
            for axis, start in zip(plant.actuated, spec.move.start, strict=True)
        ]
        parameters = SimpleNamespace(**{**spec.plant.parameters, name: value})
        heights.append(float(plant.outputs(still, places, parameters).height[-1]))
    hangs = low > 0.0 or name not in spec.plant.parameters
    return hangs and abs(heights[0] - heights[1] - (high - low)) <= 1e-9 * high


def _refuse_others(spec: Spec) -> None:
    """Refuse machines that the planner block does not take yet."""
    plant = spec.machine()
    if plant.actuated[0].unit != "m":
        raise SpecError(
            f"plant: the planner block moves an axis in metres, and {plant.actuated[0].name} turns; "
            "export a profile instead."
        )
    if len(spec.planner.live) > MOST_LIVE:
        raise SpecError(f"planner.live: at most {MOST_LIVE} parameters can be live; fix the others.")
    middle = _linearized(spec, [0.0] * len(spec.planner.live))
    for number, axis in enumerate(plant.actuated[1:], start=1):
        if np.abs(middle.input[:, number]).max() > 1e-9:
            raise SpecError(
                f"plant: the planner block plans one axis, and {axis.name} makes the load of a "
                f"{plant.type} sway, too; export a profile instead."
            )
    if len(middle.frequencies) > MOST_MODES:
        raise SpecError(
            f"plant: the machine has {len(middle.frequencies)} modes, and the planner block takes "
            f"{MOST_MODES} at most; export a profile instead."
        )
    if len(middle.distinct_frequencies) < len(middle.frequencies):
        raise SpecError(
            "plant: two modes have the same frequency, and the planner block does not take that; "
            "export a profile instead."
        )
