"""What a planner has to know of its machine: the modes as functions of the live parameters."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from itertools import product
from math import ceil, floor, log10
from types import SimpleNamespace

import attrs
import numpy as np

from gen_profile.dynamics.problem.linearization import Linearization
from gen_profile.motion.profile import Array
from gen_profile.planner.chebyshev import Interpolant, bend, interpolate
from gen_profile.planner.directions import NO_ACCELERATION, linearized, planned_axes
from gen_profile.spec.model import Spec
from gen_profile.support.errors import SpecError

MOST_MODES = 3
NARROWED = 12  # halvings of a range, until no mode is too fast in what is left
SYMMETRIC = 2  # modes whose frequencies come from sum and product of their squares
MOST_RATIO = 25.0  # of the faster of two modes to the slower, whose period makes the slots
# of three modes, or where the machine is followed: none turns by more than half a turn in a slot then
MOST_FOLLOWED = 9.0
MOST_LIVE = 2
DEGREES = (3, 6, 9, 12)
FREQUENCY_ACCURACY = 1e-5  # relative, of the frequencies over the live ranges
OVERSTATED = 0.08  # of what stated errors leave: by so much more it may be stated
MOST_TERMS = 60
SAME = 1e-9  # relative difference
NEGLIGIBLE_COEFFICIENT = 1e-7  # coefficient, relative to the largest of its function


@attrs.frozen(kw_only=True, eq=False)
class LiveModes:
    """Frequencies in rad/s and decays in 1/s of the modes over the ranges of the live parameters.

    Attributes
    ----------
    modes : int
        Of different frequencies.
    live : mapping of str to (float, float)
    interpolant : Interpolant
        Of the live parameters, each mapped to −1 … 1: the squared frequencies (of two modes, their sum and
        product, which have no branch point where these come near each other), then the decays.
    others : Interpolant
        Where live parameters change on the way the matrix of the loads' sway in 1/s², row by row, and
        elsewhere `left_by_errors`, none below what is true.
    error : float
        Greatest relative error of a frequency found between the points of interpolation.
    """

    modes: int
    live: Mapping[str, tuple[float, float]]
    interpolant: Interpolant
    others: Interpolant
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
        linear = linearized(spec, point)
        squares = linear.distinct_frequencies**2
        known = [squares.sum(), squares.prod()] if len(squares) == SYMMETRIC else squares
        return np.array([*known, *decays(linear)])

    def others(point: Sequence[float]) -> Array:
        if spec.planner.live_rate:
            return _sway_matrix(linearized(spec, point)).ravel()
        return left_by_errors(spec, point)

    modes = len(linearized(spec, [0.0] * len(live)).distinct_frequencies)
    between = list(product(np.linspace(-1.0, 1.0, 6), repeat=len(live)))
    exact = [linearized(spec, point).distinct_frequencies for point in between]
    _refuse_fast_modes(spec, between, [rates[-1] / rates[0] for rates in exact])
    tried = (_curvatures(invariants, len(live)), [0.0] * len(live))
    least = np.inf
    for degree, curvatures in product(DEGREES if live else (0,), tried):
        interpolant = interpolate(invariants, curvatures, degree).without(NEGLIGIBLE_COEFFICIENT)
        interpolated = [frequencies(interpolant(point)[:modes]) for point in between]
        error = float(np.abs(np.array(interpolated) / exact - 1.0).max())
        if error > FREQUENCY_ACCURACY or interpolant.exponents.shape[1] > MOST_TERMS:
            continue
        if spec.planner.live_rate:
            second, over = interpolate(others, curvatures, degree).without(NEGLIGIBLE_COEFFICIENT), 0.0
        else:
            second = _raised(interpolate(others, _curvatures(others, len(live)), degree), others, between)
            over = _overstated(second, others, between, modes)
        if over <= OVERSTATED:
            break
        least = min(least, over)
    else:
        raise SpecError(
            _unknown(spec, error, least, between[int(np.argmin([one[1] / one[0] for one in exact]))])
        )
    return LiveModes(modes=modes, live=live, interpolant=interpolant, others=second, error=error)


def _refuse_fast_modes(spec: Spec, points: Sequence[Sequence[float]], ratios: Sequence[float]) -> None:
    """Refuse modes that are too fast for slots of the slowest one, before all that other cures would help."""
    modes = len(linearized(spec, points[0]).distinct_frequencies)
    follows = bool(spec.planner.live_rate or spec.planner.sensor)
    most = MOST_FOLLOWED if follows or modes != SYMMETRIC else MOST_RATIO
    if max(ratios) > most:
        live = bool(spec.planner.live)
        at = f"planner.live: at {_place(spec, points[int(np.argmax(ratios))])}" if live else "plant:"
        narrowed = list(_narrowed(spec, points, points[int(np.argmax(ratios))], most))
        narrow = f"narrow the ranges, such as to {' or '.join(narrowed)}, or " if narrowed else ""
        raise SpecError(
            f"{at} the fastest mode has {max(ratios):.3g} times the frequency of the slowest, and the "
            f"planner block takes {most:g} at most; {narrow}state a machine without the fast mode, "
            "such as a single pendulum as long as both ropes."
        )


def _narrowed(
    spec: Spec, points: Sequence[Sequence[float]], worst: Sequence[float], most: float
) -> Iterator[str]:
    """Give ranges of single live parameters in which no mode is too fast, in words."""

    def fits(number: int, end: float) -> bool:
        moved = {(*point[:number], end, *point[number + 1 :]) for point in points}
        rates = [linearized(spec, point).distinct_frequencies for point in moved]
        return max(float(one[-1] / one[0]) for one in rates) <= most

    for number, (name, (low, high)) in enumerate(spec.planner.live.items()):
        bad, good = worst[number], -worst[number]
        if abs(bad) < 1.0 or not fits(number, good):
            continue
        for _ in range(NARROWED):
            between = 0.5 * (bad + good)
            bad, good = (bad, between) if fits(number, between) else (between, good)
        digit, end = 10.0 ** floor(log10((high - low) / 20.0)), 0.5 * (low + high + good * (high - low))
        kept = (digit * ceil(end / digit), high) if bad < good else (low, digit * floor(end / digit))
        if kept[0] < kept[1]:
            yield f"{name} = [{kept[0]:g}, {kept[1]:g}]"


def decays(linear: Linearization) -> Array:
    """Give how fast the modes decay, in 1/s."""
    return np.asarray(linear.distinct_damping_ratios * linear.distinct_frequencies)


def _curvatures(functions: Callable[[Sequence[float]], Array], variables: int) -> list[float]:
    """Find how each variable bends the first of some functions."""
    return [bend([functions((t * axis).tolist())[0] for t in (-1.0, 0.0, 1.0)]) for axis in np.eye(variables)]


def _place(spec: Spec, point: Sequence[float]) -> str:
    """Name a point of the live ranges, given in −1 … 1."""
    units, ranges = spec.machine().units, zip(spec.planner.live.items(), point, strict=True)
    return " and ".join(
        f"{name} = {0.5 * (low + high + t * (high - low)):g} {units[name]}"
        for (name, (low, high)), t in ranges
    )


def _unknown(spec: Spec, error: float, over: float, point: Sequence[float]) -> str:
    """Say what would not be known well enough over the live ranges, and where modes come nearest."""
    if over == np.inf:
        words = f"planner.live: over these ranges the frequencies would be known to {error:.1g} only; "
        return f"{words}narrow the ranges, or write a block for each part of them."
    return (
        f"planner.live: near {_place(spec, point)} two modes have nearly the same frequency, so that what "
        f"stated errors leave would be overstated by {100.0 * over:.2g} %; keep the ranges away from there, "
        "such as by a least load above 0, or write a block for each part of them."
    )


def _overstated(
    interpolant: Interpolant,
    functions: Callable[[Sequence[float]], Array],
    points: Sequence[Sequence[float]],
    modes: int,
) -> float:
    """Tell by which share `left_by_errors` is overstated at most, summed over the modes."""

    def swings(known: Array) -> float:
        errors, *gains = known.reshape(-1, modes)
        return float(np.max(gains, axis=0) @ errors)

    over = [
        swings(interpolant(point)) / true - 1.0 if (true := swings(functions(point))) > 0.0 else 0.0
        for point in points
    ]
    return max(over)


def _raised(
    interpolant: Interpolant, functions: Callable[[Sequence[float]], Array], points: Sequence[Sequence[float]]
) -> Interpolant:
    """Raise functions until at some points none lies below what is true."""
    below = np.max([functions(point) - interpolant(point) for point in points], axis=0)
    raised = interpolant.coefficients.copy()
    raised[:, ~interpolant.exponents.any(axis=0)] += np.maximum(below, 0.0)[:, None]
    return attrs.evolve(interpolant, coefficients=raised)


def frequencies(invariants: Array) -> Array:
    """Find frequencies from their squares or, of two, from sum and product of these, as the block does."""
    if len(invariants) != SYMMETRIC:
        return np.asarray(np.sqrt(invariants))
    total, product_ = invariants
    larger = 0.5 * (total + np.sqrt(np.maximum(total * total - 4.0 * product_, 0.0)))  # but for rounding
    return np.asarray(np.sqrt([product_ / larger, larger]))


def frequency_errors(spec: Spec) -> Array:
    """By which share the stated errors change each mode's frequency at most, at the live ranges' corners."""
    errors = [_frequency_errors(spec, point) for point in corners(spec.planner.live)]
    return np.asarray(np.max(errors, axis=0))


def least_decay(spec: Spec) -> float:
    """How slowly a mode of the stated errors may decay, as a share of what the machine as given does."""
    least = 1.0
    for point in corners(spec.planner.live):
        as_given = decays(linearized(spec, point))
        lost = np.zeros_like(as_given)
        for wrong in _machines_of_errors(spec, point):
            found = np.min([decays(one) for one in wrong], axis=0)
            lost += 1.0 - np.minimum(1.0, found / np.maximum(as_given, np.finfo(float).tiny))
        least = min(least, float(1.0 - lost[as_given > 0.0].max(initial=0.0)))
    return max(least, 0.0)


def left_by_errors(spec: Spec, point: Sequence[float]) -> Array:
    """Give the relative errors of the modes' frequencies, then the loads' sway by each axis and mode.

    A mode that is left swinging, ``∫ velocity · exp(iωt) dt`` in m (or rad), makes the load that shows it
    most sway by so many m times its modulus, on the machine of stated errors whose own modes show it most.
    """
    at = linearized(spec, point)
    gains = _sway_by_modes(spec, at)
    worst = gains.copy()
    for wrong in _machines_of_errors(spec, point):
        most = np.max([_sway_by_modes(spec, one) for one in wrong], axis=0)
        worst *= np.maximum(1.0, most / np.maximum(gains, np.finfo(float).tiny))
    return np.concatenate([_frequency_errors(spec, point), worst])


def _sway_by_modes(spec: Spec, at: Linearization) -> Array:
    """Give by how many m each axis and mode makes the load sway that shows it most, (axes · modes,)."""
    modes = np.abs(at.frequencies[:, None] - at.distinct_frequencies).argmin(axis=1)
    shown, excited = at.sway_gain @ at.modes, np.linalg.solve(at.modes, at.input)
    return np.array(
        [
            np.abs(shown[:, modes == mode] @ excited[modes == mode, axis]).max()
            for axis in planned_axes(spec)
            for mode in range(len(at.distinct_frequencies))
        ]
    )


def corners(live: Collection[str]) -> list[Sequence[float]]:
    """Give the corners of the live ranges, each mapped to −1 … 1."""
    return list(product((-1.0, 1.0), repeat=len(live)))


def _frequency_errors(spec: Spec, point: Sequence[float]) -> Array:
    frequencies = linearized(spec, point).distinct_frequencies
    errors = np.zeros_like(frequencies)
    for wrong in _machines_of_errors(spec, point):
        errors += np.max([np.abs(one.distinct_frequencies / frequencies - 1.0) for one in wrong], axis=0)
    return errors


def _machines_of_errors(spec: Spec, point: Sequence[float]) -> Iterator[list[Linearization]]:
    """Linearise machines with each uncertain parameter at its ends."""
    nominal = spec.plant.parameters
    for name, ends in spec.checked_ranges().items():
        if nominal[name] == 0.0 or (name in spec.planner.live and name in spec.check.spans):
            continue  # of nothing there is no share, and a live one's span says where it may be
        yield [linearized(spec, point, {name: end / nominal[name]}) for end in ends]


def _sway_matrix(linear: Linearization) -> Array:
    """Find A of sway'' = acceleration − A sway, along every axis that makes loads sway.

    A rope's rate appears in it nowhere: a load's horizontal acceleration is the rope's force by its mass, and
    that depends on where the loads are.

    Raises
    ------
    ValueError
        There is no such matrix, or not the same one for all axes.
    """
    gain = linear.sway_gain
    if gain.shape[0] != gain.shape[1]:
        raise ValueError("fewer loads than coordinates")
    whole, pushed = gain @ linear.stiffness @ np.linalg.inv(gain), gain @ linear.input
    driven = pushed.T[np.abs(pushed).max(axis=0) > NO_ACCELERATION]
    along = [np.flatnonzero(np.abs(column - 1.0) <= SAME) for column in driven]
    if len({len(loads) for loads in along}) > 1:
        raise ValueError("axes that push other numbers of loads")
    first = whole[np.ix_(along[0], along[0])]
    apart = np.zeros_like(whole)
    for loads in along:
        apart[np.ix_(loads, loads)] = first
    if not np.allclose(apart, whole, rtol=SAME, atol=SAME):
        raise ValueError("loads that sway otherwise along another axis")
    return np.asarray(first)


def sway_model(spec: Spec, known: Interpolant) -> Interpolant | None:
    """Find squared frequencies (of two their sum and product), then the matrix of the loads' sway by rows.

    None where the loads do not hang on ropes alone, or sway otherwise along another axis. `known` are the
    same frequencies, whose degree and bends are taken.
    """

    def rows(point: Sequence[float]) -> Array:
        linear = linearized(spec, point)
        squares = linear.distinct_frequencies**2
        invariants = [squares.sum(), squares.prod()] if len(squares) == SYMMETRIC else squares
        return np.array([*invariants, *_sway_matrix(linear).ravel()])

    middle = linearized(spec, [0.0] * len(spec.planner.live))
    try:
        if len(_sway_matrix(middle)) != len(middle.distinct_frequencies):
            return None
    except ValueError:
        return None
    return interpolate(rows, known.curvatures, int(known.exponents.max(initial=0))).without(
        NEGLIGIBLE_COEFFICIENT
    )


def _refuse_rates(spec: Spec) -> None:
    """Refuse live parameters that change on the way, of machines that sway otherwise than loads on ropes."""
    plant, rates = spec.machine(), spec.planner.live_rate
    if not rates:
        return
    middle = linearized(spec, [0.0] * len(spec.planner.live))
    if np.abs(middle.damping).max() > 0.0:
        raise SpecError(
            "planner.live_rate: the planner block follows machines without damping only; set the damping "
            "to 0, which is the worse case."
        )
    try:
        if len(plant.bodies) != len(_sway_matrix(middle)):
            raise ValueError("other bodies than loads")
    except ValueError as error:
        raise SpecError(
            f"planner.live_rate: the loads of a {plant.type} do not hang on ropes alone, or sway otherwise "
            "along another axis."
        ) from error
    for name in rates:
        if not _is_length(spec, name):
            raise SpecError(f"planner.live_rate.{name}: no rope's length; only these may change on the way.")


def lowered(spec: Spec) -> dict[str, float]:
    """Of live parameters with a rate that lower all loads by as much as they grow: the inverse of gravity."""
    gravity = spec.plant.parameters.get("g")
    if not gravity:
        return {}
    lowering = {name: _lowering(spec, name) for name in spec.planner.live_rate}
    return {name: 1.0 / gravity for name, by in lowering.items() if np.allclose(by, 1.0, rtol=0.0, atol=SAME)}


def _is_length(spec: Spec, name: str) -> bool:
    """Whether a load comes down by as much as a parameter grows, all hanging still."""
    hangs = spec.planner.live[name][0] > 0.0 or name not in spec.plant.parameters
    return hangs and abs(_lowering(spec, name)[-1] - 1.0) <= SAME


def _lowering(spec: Spec, name: str) -> Array:
    """By how much each load comes down as a live parameter grows, relative to that, all hanging still."""
    plant, (low, high) = spec.machine(), spec.planner.live[name]
    still = [0.0] * len(plant.unactuated)
    heights = []
    for value in (low, high):
        places = [
            value if axis.name == name else start
            for axis, start in zip(plant.actuated, spec.move.start, strict=True)
        ]
        parameters = SimpleNamespace(**{**spec.plant.parameters, name: value})
        heights.append(np.array(plant.outputs(still, places, parameters).height, dtype=np.float64))
    return np.asarray((heights[0] - heights[1]) / (high - low))


def _refuse_others(spec: Spec) -> None:
    """Refuse machines that the planner block does not take yet."""
    plant = spec.machine()
    if len(spec.planner.live) > MOST_LIVE:
        raise SpecError(f"planner.live: at most {MOST_LIVE} parameters can be live; fix the others.")
    middle = linearized(spec, [0.0] * len(spec.planner.live))
    for number, axis in enumerate(plant.actuated):
        if axis.name in spec.planner.live and number in planned_axes(spec):
            raise SpecError(
                f"planner.live.{axis.name}: this axis makes the load sway, so the block plans it, and its "
                "place is no live parameter."
            )
    if len(middle.distinct_frequencies) > MOST_MODES:
        raise SpecError(
            f"plant: the machine has {len(middle.distinct_frequencies)} modes, and the planner block takes "
            f"{MOST_MODES} at most; export a profile instead."
        )
