"""A problem transcribed for the direct method: mesh, machines, forms of the effort."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.dynamics.problem.cost import SwayCost, axis_reach
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.dynamics.problem.initial_state import initial_state
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.dynamics.problem.motion_equations import motion_equations
from gen_profile.dynamics.problem.pontryagin import SNAP_TIME, optimality_system
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.direct import goals
from gen_profile.methods.solvers.direct.bezier import Piece
from gen_profile.methods.solvers.direct.condensing import axes_map
from gen_profile.methods.solvers.direct.conic import Entries
from gen_profile.methods.solvers.direct.transcription import Iterate, TranscribedMachine, Transcription
from gen_profile.methods.solvers.indirect.boundary_value_problem import (
    BoundaryValueProblem,
    canonical_problem,
    independence,
    without,
)
from gen_profile.motion.profile import Array

MAX_GRADED = 30  # intervals that grow from the ends on, at most


@attrs.frozen(kw_only=True)
class DirectOptions:
    """How exactly the direct method solves, and how far it goes; see docs/solvers.md for the evidence.

    Attributes
    ----------
    intervals, max_intervals : int
        Of the mesh before it is bisected, at least and at most.
    radians_per_interval : float
        rad of the fastest mode, which Gauss collocation then follows to 1e-7 of the cost.
    step_tolerance : float
        How far the motion may still change, relative, as the last two programs let it be foreseen; the cost
        is off by its square, or as much where sway's scale is automatic.
    max_iterations : int
        Programs on one mesh; most take ten.
    max_bisections : int
        Of a mesh where limits begin or cease to bind.
    worth_bisecting : float
        Relative change of the cost from one mesh to the next, below which it is bisected no more.
    reached : float
        Fraction of a limit that may lack of all of it where it counts as binding.
    growth : float
        Times the one before, an interval is long from the ends on, where snap lets the motion change quickly.
    steeper : float
        By which the exponent of the sway's cost may grow from one expansion to the next.
    """

    intervals: int = 40
    max_intervals: int = 480
    radians_per_interval: float = 1.5
    step_tolerance: float = 1e-8
    max_iterations: int = 50
    max_bisections: int = 6
    worth_bisecting: float = 1e-4
    reached: float = 1e-4
    growth: float = 1.4
    steeper: float = 2.0


USUAL = DirectOptions()


@attrs.frozen(kw_only=True, eq=False)
class Setup:
    """A problem, transcribed.

    Attributes
    ----------
    problem : Problem
    transcription : Transcription
    effort_weights : (m,) array
        Of the axes, in units of `cost_scale`.
    forms : tuple of (intervals, size, size) arrays
        Twice the effort of every axis, in units of `cost_scale`.
    cost_scale : float
        Of the running cost.
    options : DirectOptions
    tried : tuple of Amplitudes
        Of every machine whose residual sway is to be bounded; empty where end states are zero instead.
    """

    problem: Problem
    transcription: Transcription
    effort_weights: Array
    forms: tuple[Array, ...]
    cost_scale: float
    options: DirectOptions
    tried: tuple[goals.Amplitudes, ...] = ()

    @property
    def extra(self) -> int:
        """Number of variables that bounding the worst machine takes."""
        return goals.worst_case_variables(self.tried) if self.tried else 0

    @property
    def sees_all(self) -> bool:
        """Whether the effort depends on the highest derivative of the motion's polynomials."""
        return self.problem.effort != "reference" or self.transcription.piece.order == 3

    @cached_property
    def effort_form(self) -> Entries:
        """Twice the effort of a motion as a quadratic form of a program's variables but the goal's."""
        return self.transcription.effort(self.forms)

    def effort(self, local: Array) -> float:
        """Evaluate the effort of a motion, in units of `cost_scale`."""
        axes = local.reshape(self.transcription.intervals, len(self.forms), -1).swapaxes(0, 1)
        return sum(
            0.5 * float(np.einsum("ka,kab,kb->", own, form, own))
            for own, form in zip(axes, self.forms, strict=True)
        )

    def cost(self, iterate: Iterate, sway_cost: SwayCost) -> float:
        """Evaluate eq. (26) in SI units."""
        swayed = sway_cost.values(self.transcription.end_sway_found(iterate))
        running = self.cost_scale * self.effort(iterate.local) + self.transcription.quadrature() @ swayed
        return self.problem.duration * float(running)


def set_up(
    problem: Problem, others: Sequence[Mapping[str, float]] = (), options: DirectOptions | None = None
) -> tuple[Setup, tuple[str, ...]]:
    """Transcribe a problem; also name the parameters whose sensitivities are left out, as others imply them.

    Parameters
    ----------
    problem : Problem
    others : sequence of mapping of str to float
        Parameters of further machines whose residual sway shall be bounded, with the nominal one's.
    options : DirectOptions, optional
    """
    options = options or USUAL
    system = optimality_system(problem.plant, problem.desensitized, problem.effort, problem.order)
    canonical = canonical_problem(problem, system)
    asked, redundant = independence(canonical)
    if redundant:
        return set_up(without(problem, redundant), others, options)[0], redundant
    machines = (
        _nominal(problem, canonical, asked),
        *(_other(problem, canonical, parameters) for parameters in others),
    )
    jerks = [problem.limits.of(axis).jerk for axis in range(system.layout.m)]
    commands_jerk = problem.tau is not None and any(jerk is not None for jerk in jerks)
    order = 4 if problem.effort == "snap" or commands_jerk else 3
    piece, reach = Piece(order=order, length=_mesh(problem, options)), axis_reach(problem)
    transcription = Transcription(
        piece=piece,
        axes=axes_map(piece, np.array(problem.start), reach, problem.duration),
        duration=problem.duration,
        target=np.array(problem.distance) / reach,
        final_velocity=np.array(problem.final_velocity) * problem.duration / reach,
        machines=machines,
    )
    cost_scale = canonical.data.cost_scale * goals.usual_effort(problem)
    weights = canonical.data.effort_weights * reach**2 / problem.duration**6 / cost_scale
    setup = Setup(
        problem=problem,
        transcription=transcription,
        effort_weights=weights,
        forms=_forms(problem, piece, weights),
        cost_scale=cost_scale,
        options=options,
        tried=_amplitudes(problem, machines, others),
    )
    return setup, redundant


def on_mesh(setup: Setup, lengths: Array) -> Setup:
    """Transcribe the same problem on another mesh, of such relative lengths of intervals."""
    problem, transcription = setup.problem, setup.transcription
    piece = attrs.evolve(transcription.piece, length=lengths)
    axes = axes_map(piece, np.array(problem.start), axis_reach(problem), problem.duration)
    return attrs.evolve(
        setup,
        transcription=attrs.evolve(transcription, piece=piece, axes=axes),
        forms=_forms(problem, piece, setup.effort_weights),
    )


def _forms(problem: Problem, piece: Piece, weights: Array) -> tuple[Array, ...]:
    form = goals.effort_form(problem, piece)
    return tuple(weight * form for weight in weights)


def _nominal(
    problem: Problem, canonical: BoundaryValueProblem, asked: NDArray[np.bool_]
) -> TranscribedMachine:
    """State the machine that is to rest at the end, and what it is to be insensitive to."""
    layout, scale = canonical.system.layout, canonical.data.scale
    states = np.r_[0 : 2 * layout.n_u, layout.sensitivities]
    exact = problem.worst_case is None or problem.worst_case.nominal_zero
    modal = np.asarray(np.linalg.inv(canonical.basis), dtype=np.float64)
    swung = initial_state(problem.plant, problem.initial)
    return TranscribedMachine(
        equations=motion_equations(problem.plant, problem.desensitized, problem.order),
        parameters=parameter_rows(problem.plant, [problem.parameters]),
        scale=scale[states],
        start=np.pad(swung, (0, len(states) - len(swung))) / scale[states],
        end=modal[np.ix_(states[asked[states] & exact], states)],
    )


def _other(
    problem: Problem, canonical: BoundaryValueProblem, parameters: Mapping[str, float]
) -> TranscribedMachine:
    """State a machine of other parameters that follows the same motion."""
    scale = canonical.data.scale[: 2 * canonical.system.layout.n_u]
    return TranscribedMachine(
        equations=motion_equations(problem.plant, (), problem.order),
        parameters=parameter_rows(problem.plant, [parameters]),
        scale=scale,
        start=initial_state(problem.plant, problem.initial) / scale,
        end=np.zeros((0, len(scale))),
    )


def _amplitudes(
    problem: Problem, machines: Sequence[TranscribedMachine], others: Sequence[Mapping[str, float]]
) -> tuple[goals.Amplitudes, ...]:
    """Say how what every machine swings with at the end shows, where the worst of them counts."""
    if problem.worst_case is None:
        return ()
    limits = problem.worst_case.load_limits
    return tuple(
        goals.amplitudes(problem, values, limits, machine.scale)
        for values, machine in zip([problem.parameters, *others], machines, strict=True)
    )


def _mesh(problem: Problem, options: DirectOptions) -> Array:
    """Choose relative lengths of intervals: resolve the fastest mode and, for snap, layers at the ends."""
    fastest = linearize(problem.plant, problem.parameters, problem.target).frequencies[-1]
    needed = fastest * problem.duration / options.radians_per_interval
    longest = 1.0 / float(np.clip(np.ceil(needed), options.intervals, options.max_intervals))
    shortest = SNAP_TIME / problem.duration if problem.effort == "snap" else longest
    graded = longest * options.growth ** -np.arange(1.0, MAX_GRADED)
    graded = graded[graded > shortest / options.growth][::-1]
    rest = 1.0 - 2.0 * graded.sum()
    middle = np.ceil(rest / longest * (1.0 - 1e-9))
    return np.concatenate([graded, np.full(int(middle), rest / middle), graded[::-1]])
