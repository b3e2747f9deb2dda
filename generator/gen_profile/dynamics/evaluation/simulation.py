"""A plant's answer to a motion of its axes."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import MappingProxyType

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.integration import NODES, Accelerations, integrate
from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics, parameter_rows
from gen_profile.dynamics.problem.initial_state import initial_state
from gen_profile.dynamics.problem.linearization import eigenvalues, eigenvalues_at, linear_terms, linearize
from gen_profile.dynamics.problem.overshoot import beyond
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.dynamics.problem.symbolic import Function
from gen_profile.motion.metrics import length, peak
from gen_profile.motion.profile import Array, Profile
from gen_profile.plants.plant import Plant
from gen_profile.support.errors import CosimulationError, InfeasibleProblem
from gen_profile.support.summary import Sampled
from gen_profile.support.work import spend

RELATIVE_TOLERANCE = 1e-10
ABSOLUTE_TOLERANCE = 1e-13
FREE_ACCURACY = 1e-8  # of swings from given states, which are compared with measured ones
TRANSIENT_SAMPLES = 4001
SHORTEST_STRETCH = 1e-9  # of a motion's duration: closer times are one
GROWTH = 1e-6  # of the fastest rate, beyond which a machine does not return to rest
GREATEST_RATE_TIME = 1e6  # of a machine, rate times time: some hundred thousand steps, and minutes
RATE, POINT = 2e-5, 2e-7  # s of work to evaluate the equations in a step, and more for each point
AT_REST: Mapping[str, float] = MappingProxyType({})


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Sway(Sampled):
    """How the loads of a machine sway.

    Attributes
    ----------
    times : (samples,) array
        s, rising.
    sway : (samples, loads) array
        Of every load as `gen_profile.plants.plant.Outputs` defines it, in m.
    """

    times: Array
    sway: Array


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Response(Sway):
    """What the machine does.

    Attributes
    ----------
    position, velocity : (samples, axes) arrays
        Of the driven axes, in m and m/s (or rad and rad/s).
    q_u, dq_u : (samples, n_u) arrays
        Unactuated coordinates and rates.
    angle : (samples, loads) array
        Of every load as `gen_profile.plants.plant.Outputs` defines it, in rad.
    """

    position: Array
    velocity: Array
    q_u: Array
    dq_u: Array
    angle: Array


class PlantSimulation:
    """Machines whose axes follow one profile exactly, integrated all at once.

    Parameters
    ----------
    plant : Plant
    profile : Profile
    machines : sequence of mapping of str to float
        The parameters of each machine.
    until : float
        Last time that can be asked for, in s.
    initial : mapping of str to float, optional
        What swings at time 0, on all machines; see `gen_profile.dynamics.problem.initial_state`.
        All hang at rest by default.
    accuracy : float, optional
        Of a step, relative; to nearly rounding accuracy by default.

    Raises
    ------
    CosimulationError
        The integration fails, as when a load is thrown over.
    InfeasibleProblem
        It would take too many steps.
    """

    def __init__(
        self,
        plant: Plant,
        profile: Profile,
        machines: Sequence[Mapping[str, float]],
        until: float,
        initial: Mapping[str, float] = AT_REST,
        *,
        accuracy: float = RELATIVE_TOLERANCE,
    ) -> None:
        self.plant, self.initial, self._profile = plant, initial, profile
        motion = motion_of(profile)
        self._p = p = parameter_rows(plant, machines)
        start, ends = initial_state(plant, initial).reshape(2, -1), [profile.start, profile.target]
        rates = np.array(eigenvalues_at(plant, p, ends))
        fastest = float(np.abs(rates).max())
        for growing in np.flatnonzero((rates.real > GROWTH * fastest).any(axis=(0, 2))).tolist():
            linearize(plant, machines[growing], profile.target.tolist())  # which says what is wrong
        first, last = (linear_terms(plant, p, q_a) for q_a in ends)
        constant = all(map(np.array_equal, first, last))

        def linear(time: float) -> tuple[Array, Array]:
            return first if constant else linear_terms(plant, p, motion(np.array([time]))[0, : profile.axes])

        _require_pace(plant, fastest, until)
        self._solution = integrate(
            _accelerations(plant, p, motion),
            linear,
            np.tile(start, len(p)),
            _stretches(profile, until),
            fastest=fastest,
            accuracy=accuracy,
            least=ABSOLUTE_TOLERANCE / RELATIVE_TOLERANCE * accuracy,
            what=f"{plant.type}'s motion",
        )

    def states(self, times: Array) -> Array:
        """Coordinates and rates at rising times in s, shape (2, machines, times, n_u)."""
        values = self._solution(times).reshape(2, len(times), len(self._p), -1)
        return np.ascontiguousarray(values.swapaxes(1, 2))

    def at(self, times: Array) -> tuple[Response, ...]:
        """Evaluate every machine at rising times in s."""
        states, loads = self.states(times), len(self.plant.loads)
        position, velocity = (self._profile.derivative(times, order) for order in (0, 1))
        outputs = equations_of(self.plant)[1](states[0], position, self._p[:, None])[..., 0]
        return tuple(
            Response(
                times=times,
                position=position,
                velocity=velocity,
                q_u=q_u,
                dq_u=dq_u,
                sway=observed[:, :loads],
                angle=observed[:, loads:],
            )
            for q_u, dq_u, observed in zip(*states, outputs, strict=True)
        )

    def sway(self, times: Array) -> Array:
        """Sway of every load in m at rising times in s, shape (machines, times, loads)."""
        q_u = self._solution.positions(times).reshape(len(times), len(self._p), -1).swapaxes(0, 1)
        sway, by_place = _sway(self.plant)
        q_a = self._profile.derivative(times, 0) if by_place else self._profile.start[None]
        return sway(q_u, q_a, self._p[:, None])[..., 0]

    def bodies(self, times: Array) -> Array:
        """Places of the bodies in m at rising times in s, shape (machines, times, bodies, 3)."""
        return body_places(
            self.plant, self.states(times)[0], self._profile.derivative(times, 0), self._p[:, None]
        )


def greatest_sway(
    plant: Plant,
    motion: Profile,
    machines: Sequence[Mapping[str, float]],
    initial: Mapping[str, float] = AT_REST,
    *,
    accuracy: float = RELATIVE_TOLERANCE,
    samples: int = TRANSIENT_SAMPLES,
) -> Array:
    """Find the greatest sway of every machine's end load during a motion, in m, shape (machines,).

    Infinite where the loads swing so far that they cannot be followed.
    """
    try:
        swing = PlantSimulation(plant, motion, machines, motion.duration, initial, accuracy=accuracy)
        sway = swing.sway(np.linspace(0.0, motion.duration, samples))
    except CosimulationError:
        return np.full(len(machines), np.inf)
    return peak(length(sway[:, :, plant.end_load]))[:, 0]


def greatest_overshoot(
    problem: Problem,
    motion: Profile,
    machines: Sequence[Mapping[str, float]],
    *,
    accuracy: float = RELATIVE_TOLERANCE,
    samples: int = TRANSIENT_SAMPLES,
) -> Array:
    """Find how far every machine's end load passes its targets during a motion, in m, shape (machines,).

    Infinite where the loads swing so far that they cannot be followed.
    """
    plant, times = problem.plant, np.linspace(0.0, motion.duration, samples)
    try:
        swing = PlantSimulation(plant, motion, machines, motion.duration, problem.initial, accuracy=accuracy)
        sway = swing.sway(times)[:, :, plant.end_load]
    except CosimulationError:
        return np.full(len(machines), np.inf)
    return np.asarray(beyond(problem.targets, motion.derivative(times, 0), sway).max(axis=(0, 2)))


def free_swing(
    plant: Plant, machines: Array, *, q_a: Sequence[float], starts: Array, times: Array
) -> tuple[Array, Array]:
    """Let machines swing from given states while their axes stand still.

    Parameters
    ----------
    plant : Plant
    machines : (machines, parameters) array
        In the order of `Plant.parameters`.
    q_a : (m,) sequence of float
        Where the axes stand.
    starts : (machines, 2 n_u) array
        q_u, then q̇_u, of every machine at the first of the times.
    times : (samples,) array
        s, rising.

    Returns
    -------
    sway, angle : (machines, samples, loads) arrays

    Raises
    ------
    CosimulationError
        The integration fails.
    """
    position = np.array([q_a], dtype=np.float64)
    still = np.concatenate([position, np.zeros((1, 2 * position.size))], axis=1)
    return driven_swing(
        plant, machines, motion=lambda nodes: np.repeat(still, len(nodes), axis=0), starts=starts, times=times
    )


def driven_swing(
    plant: Plant, machines: Array, *, motion: Callable[[Array], Array], starts: Array, times: Array
) -> tuple[Array, Array]:
    """Let machines swing from given states while their axes move; see `free_swing` and `swing_from`.

    Returns
    -------
    sway, angle : (machines, samples, loads) arrays

    Raises
    ------
    CosimulationError
        The integration fails.
    """
    start = starts.reshape(len(machines), 2, -1).swapaxes(0, 1)
    followed = swing_from(plant, machines, motion=motion, start=start, times=times)
    q_u, places = np.ascontiguousarray(followed[0].swapaxes(0, 1)), motion(times)[:, : len(plant.actuated)]
    outputs, loads = equations_of(plant)[1], len(plant.loads)
    values = outputs(q_u, places, machines[:, None])[..., 0]
    return values[:, :, :loads], values[:, :, loads:]


def swing_from(
    plant: Plant, machines: Array, *, motion: Callable[[Array], Array], start: Array, times: Array
) -> Array:
    """Let machines swing from given states while their axes move.

    Parameters
    ----------
    plant : Plant
    machines : (machines, parameters) array
        In the order of `Plant.parameters`.
    motion : (nodes,) array → (nodes, 3 axes) array
        Position, velocity and acceleration of all axes at times in s.
    start : (2, machines, n_u) array
        q_u and q̇_u at the first of the times.
    times : (samples,) array
        s, rising.

    Returns
    -------
    (2, samples, machines, n_u) array
        q_u and q̇_u.

    Raises
    ------
    CosimulationError
        The integration fails.
    """
    q_a = motion(times[:1])[0, : len(plant.actuated)].tolist()
    swing = integrate(
        _accelerations(plant, machines, motion),
        lambda _: linear_terms(plant, machines, q_a),
        start.reshape(2, -1),
        times[[0, -1]],
        fastest=float(np.abs(eigenvalues(plant, machines, q_a)).max()),
        accuracy=FREE_ACCURACY,
        least=ABSOLUTE_TOLERANCE / RELATIVE_TOLERANCE * FREE_ACCURACY,
        what=f"{plant.type}'s swing",
    )
    return swing(times).reshape(2, len(times), *start.shape[1:])


def _stretches(profile: Profile, until: float) -> Array:
    """List the times between which a motion is smooth, so that no step of integration meets a kink."""
    times = profile.knots
    apart = np.diff(times, prepend=-np.inf) > SHORTEST_STRETCH * profile.duration
    return np.append(times[apart & (times < until * (1.0 - SHORTEST_STRETCH))], until)


def _accelerations(plant: Plant, p: Array, motion: Callable[[Array], Array]) -> Accelerations:
    """Evaluate q̈_u of all machines at the nodes of steps."""
    acceleration = equations_of(plant)[0]

    def at(times: Array) -> Callable[[Array, Array], Array]:
        axes, each = motion(times), (len(times), len(p), len(plant.unactuated))
        work = RATE * len(times) / NODES + POINT * len(times) * len(p)

        def evaluate(q_u: Array, dq_u: Array) -> Array:
            spend(work)
            states = (values.reshape(each).swapaxes(0, 1) for values in (q_u, dq_u))
            values = acceleration(*states, axes, p[:, None])[..., 0]
            return values.swapaxes(0, 1).reshape(q_u.shape)

        return evaluate

    return at


def _require_pace(plant: Plant, fastest: float, until: float) -> None:
    if fastest * until > GREATEST_RATE_TIME:
        raise InfeasibleProblem(
            f"plant: a motion of the {plant.type} changes within {1.0 / fastest:.1g} s, too fast to be "
            f"followed for {until:.3g} s; look at its stiffness, damping and masses."
        )


@cache
def equations_of(plant: Plant) -> tuple[Function, Function]:
    """Compile q̈_u of (q_u, q̇_u, axes' motion, p), and sway and angle of (q_u, q_a, p)."""
    d = dynamics(plant)
    axes = sym.column([d.q_a, d.dq_a, d.ddq_a])
    acceleration = Function("acceleration", {"q_u": d.q_u, "dq_u": d.dq_u, "axes": axes, "p": d.p}, d.ddq_u)
    outputs = sym.column([d.sway, d.angle])
    return acceleration, Function("outputs", {"q_u": d.q_u, "q_a": d.q_a, "p": d.p}, outputs)


@cache
def _sway(plant: Plant) -> tuple[Function, bool]:
    """Compile the sway of (q_u, q_a, p), where nothing else is looked at; and whether q_a changes it."""
    d = dynamics(plant)
    return Function("sway", {"q_u": d.q_u, "q_a": d.q_a, "p": d.p}, d.sway), sym.depends(d.sway, d.q_a)


def body_places(plant: Plant, q_u: Array, q_a: Array, p: Array) -> Array:
    """Find x, y and z of the bodies of machines in m, shape (…, bodies, 3), of coordinates and parameters."""
    found = _places(plant)(q_u, q_a, p)[..., 0]
    return found.reshape(*found.shape[:-1], len(plant.bodies), 3)


@cache
def _places(plant: Plant) -> Function:
    d = dynamics(plant)
    return Function("places", {"q_u": d.q_u, "q_a": d.q_a, "p": d.p}, d.place)


def motion_of(profile: Profile) -> Callable[[Array], Array]:
    """Evaluate position, velocity and acceleration of all axes, as rows, without overhead."""
    order = profile.coefficients.shape[1]
    stacked = np.zeros((len(profile.knots), order, 3, profile.axes))  # one segment more: what follows
    stacked[-1, 0, 0], stacked[-1, 0, 1] = profile.target, profile.final_velocity
    stacked[-1, 1, 0] = profile.final_velocity
    falling = np.ones(order)
    for derivative in range(3):
        kept = order - derivative
        stacked[:-1, :kept, derivative] = profile.coefficients[:, derivative:] * falling[:, None]
        falling = falling[1:] * np.arange(1, kept)
    rows = stacked.reshape(len(profile.knots), order, -1)
    knots, powers = profile.knots, np.arange(order)

    def motion(times: Array) -> Array:
        segment = np.maximum(np.searchsorted(knots, times, side="right") - 1, 0)
        values = np.einsum("tk,tkr->tr", (times - knots[segment])[:, None] ** powers, rows[segment])
        return np.asarray(values)

    return motion
