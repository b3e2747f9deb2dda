"""A plant's answer to a motion of its axes."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import pairwise
from types import MappingProxyType

import attrs
import numpy as np
from scipy.integrate import DOP853, OdeSolution, solve_ivp

from gen_profile.errors import CosimulationError, InfeasibleProblem
from gen_profile.motion.metrics import length, peak
from gen_profile.motion.profile import Array, Profile
from gen_profile.plants.plant import Plant
from gen_profile.problem import symbolic as sym
from gen_profile.problem.dynamics import dynamics, parameter_column
from gen_profile.problem.initial_state import initial_state
from gen_profile.problem.linearization import linearize
from gen_profile.problem.symbolic import Function
from gen_profile.work import spend

RELATIVE_TOLERANCE = 1e-10
ABSOLUTE_TOLERANCE = 1e-13
TRANSIENT_SAMPLES = 4001
LEAST_STRETCHES, MOST_STRETCHES = 20, 256  # that the integration of a motion is divided into
SHORTEST_STRETCH = 1e-9  # of a motion's duration: closer times are one
LONGEST = 1e6  # greatest rate of a machine times its time: some hundred thousand steps, and minutes
RATE, MACHINE = 4e-5, 2e-6  # s of work to evaluate the equations, and more for each machine
AT_REST: Mapping[str, float] = MappingProxyType({})


@attrs.frozen(kw_only=True, eq=False)
class Response:
    """What the machine does.

    Attributes
    ----------
    times : (samples,) array
        s, rising.
    position, velocity : (samples, axes) arrays
        Of the driven axes, in m and m/s (or rad and rad/s).
    q_u, dq_u : (samples, n_u) arrays
        Unactuated coordinates and rates.
    sway, angle : (samples, loads) arrays
        Of every load as `gen_profile.plants.plant.Outputs` defines them, in m and rad.
    """

    times: Array
    position: Array
    velocity: Array
    q_u: Array
    dq_u: Array
    sway: Array
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
        What swings at time 0, on all machines; see `gen_profile.problem.initial_state`. All hang at rest by
        default.
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
        acceleration, self._outputs = _functions(plant)
        self.plant, self.initial, self._profile = plant, initial, profile
        self._p = p = np.concatenate([parameter_column(plant, dict(values)) for values in machines])
        self._shape = shape = (2, len(machines), len(plant.unactuated))
        motion = _motion(profile)
        for values in machines:
            _require_pace(plant, values, profile, until)

        start = np.repeat(initial_state(plant, initial).reshape(2, 1, -1), len(machines), axis=1)
        work = RATE + MACHINE * len(machines)

        def rate(t: float, state: Array) -> Array:
            spend(work)
            q_u, dq_u = state.reshape(shape)
            ddq_u = acceleration(q_u, dq_u, motion(t), p)[:, :, 0]
            return np.concatenate([dq_u.ravel(), ddq_u.ravel()])

        self._solution = _integrated(rate, start.ravel(), _stretches(profile, until), accuracy, plant.type)

    def at(self, times: Array) -> tuple[Response, ...]:
        """Evaluate every machine at rising times in s."""
        states = self._solution(times).reshape(*self._shape, len(times)).transpose(0, 1, 3, 2)
        axes = self._profile(times)
        loads = len(self.plant.loads)
        responses = []
        for q_u, dq_u, machine in zip(*np.ascontiguousarray(states), self._p[:, None], strict=True):
            seen = self._outputs(q_u, axes.position, machine)[:, :, 0]
            responses.append(
                Response(
                    times=times,
                    position=axes.position,
                    velocity=axes.velocity,
                    q_u=q_u,
                    dq_u=dq_u,
                    sway=seen[:, :loads],
                    angle=seen[:, loads:],
                )
            )
        return tuple(responses)


def greatest_sway(
    plant: Plant,
    motion: Profile,
    machines: Sequence[Mapping[str, float]],
    initial: Mapping[str, float] = AT_REST,
    *,
    accuracy: float = RELATIVE_TOLERANCE,
    samples: int = TRANSIENT_SAMPLES,
) -> Array:
    """Find the greatest sway of every machine's end load during a motion, in m, shape (machines,)."""
    swing = PlantSimulation(plant, motion, machines, motion.duration, initial, accuracy=accuracy)
    responses = swing.at(np.linspace(0.0, motion.duration, samples))
    return np.array([float(peak(length(found.sway[:, plant.end_load]))[0]) for found in responses])


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
    acceleration, outputs = _functions(plant)
    shape = (2, len(machines), len(plant.unactuated))
    position = np.array([q_a], dtype=np.float64)
    axes = np.concatenate([position, np.zeros((1, 2 * position.size))], axis=1)

    def rate(_: float, state: Array) -> Array:
        q_u, dq_u = state.reshape(shape)
        return np.concatenate([dq_u.ravel(), acceleration(q_u, dq_u, axes, machines).ravel()])

    start = starts.reshape(len(machines), 2, -1).swapaxes(0, 1).ravel()
    with np.errstate(over="ignore", invalid="ignore"):  # a failure is told below
        integral = solve_ivp(
            rate, (times[0], times[-1]), start, method="DOP853", t_eval=times, rtol=1e-8, atol=1e-11
        )
    if not integral.success:
        raise CosimulationError(f"The {plant.type}'s swing cannot be integrated: {integral.message}")
    q_u = np.ascontiguousarray(integral.y.reshape(*shape, len(times))[0].transpose(0, 2, 1))
    seen = np.stack([outputs(q, position, p[None])[:, :, 0] for q, p in zip(q_u, machines, strict=True)])
    loads = len(plant.loads)
    return seen[:, :, :loads], seen[:, :, loads:]


def _stretches(profile: Profile, until: float) -> Array:
    """Choose the times between which a motion is smooth, so that no step of integration meets a kink.

    A move begins so gently that a step-size control left alone would leap over it: there are some, anyway.
    """
    times = profile.knots if len(profile.knots) <= MOST_STRETCHES else profile.knots[[0, -1]]
    if len(times) <= LEAST_STRETCHES:
        times = np.union1d(times, np.linspace(times[0], times[-1], LEAST_STRETCHES + 1))
    apart = np.diff(times, prepend=-np.inf) > SHORTEST_STRETCH * profile.duration
    return np.append(times[apart & (times < until * (1.0 - SHORTEST_STRETCH))], until)


def _integrated(
    rate: Callable[[float, Array], Array], start: Array, stretches: Array, accuracy: float, machine: str
) -> OdeSolution:
    """Integrate from time to time, by Runge and Kutta's method of order 8 of Dormand and Prince."""
    times, pieces, state, step = [float(stretches[0])], [], start, None
    for begin, end in pairwise(stretches.tolist()):
        solver = DOP853(
            rate,
            begin,
            state,
            end,
            rtol=accuracy,
            atol=ABSOLUTE_TOLERANCE / RELATIVE_TOLERANCE * accuracy,
            first_step=None if step is None else min(step, end - begin),
        )
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise CosimulationError(f"The {machine}'s motion cannot be integrated: {message}")
            times.append(solver.t)
            pieces.append(solver.dense_output())
        state, step = solver.y, solver.h_abs
    return OdeSolution(times, pieces)


def _require_pace(plant: Plant, parameters: Mapping[str, float], profile: Profile, until: float) -> None:
    linear = linearize(plant, parameters, profile.target.tolist())
    fastest = max(linear.frequencies[-1], np.abs(np.linalg.eigvals(linear.damping)).max())
    if fastest * until > LONGEST:
        raise InfeasibleProblem(
            f"plant: a motion of the {plant.type} changes within {1.0 / fastest:.1g} s, too fast to be "
            f"followed for {until:.3g} s; look at its stiffness, damping and masses."
        )


@cache
def _functions(plant: Plant) -> tuple[Function, Function]:
    """q̈_u of (q_u, q̇_u, axes' motion, p), and sway and angle of (q_u, q_a, p)."""
    d = dynamics(plant)
    axes = sym.column([d.q_a, d.dq_a, d.ddq_a])
    acceleration = Function("acceleration", {"q_u": d.q_u, "dq_u": d.dq_u, "axes": axes, "p": d.p}, d.ddq_u)
    seen = sym.column([d.sway, d.angle])
    return acceleration, Function("seen", {"q_u": d.q_u, "q_a": d.q_a, "p": d.p}, seen)


def _motion(profile: Profile) -> Callable[[float], Array]:
    """Evaluate position, velocity and acceleration of all axes at one time, as one row, without overhead."""
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
    knots, powers = profile.knots.tolist(), np.arange(order)

    def motion(t: float) -> Array:
        segment = max(bisect_right(knots, t) - 1, 0)
        row: Array = ((t - knots[segment]) ** powers) @ rows[segment]
        return row[None]

    return motion
