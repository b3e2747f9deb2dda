"""What every solver returns: the optimal motion, or the reason why there is none."""

import math
from collections.abc import Iterable
from enum import Enum

import attrs

from gen_profile.dynamics.problem.problem import Problem
from gen_profile.motion.profile import Array, read_only
from gen_profile.support.errors import Code, InfeasibleProblem, NoMotion, Reason, SolverDiverged, Suggestion
from gen_profile.support.summary import Summarised

LONGER = "Allow more time (move.duration), or shorten the move."
WIDER = "Allow more time (move.duration), or wider limits."
LATER = "Allow more time (move.duration)."
SIMPLER = "See whether all numbers of the spec are in its units; else change the duration or limits."
HORIZONTAL = math.pi / 2.0  # rad; beyond, a rope would go slack


class Status(Enum):
    """How a solve ended, each with its sentence."""

    CONVERGED = "The optimality conditions are met."
    SWINGS_TOO_FAR = "The load would have to swing too far."
    INFEASIBLE = "No motion meets the end conditions within the limits."
    NOT_CONTROLLABLE = "Some part of the machine swings on, whatever the axes do."
    DIVERGED = "The solver found no motion that meets the optimality conditions; there may be one."
    GIVEN_UP = "The search for a motion was given up, for it took too long."


UNKNOWN = {Status.DIVERGED, Status.GIVEN_UP}  # whether there is a motion


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Optimum(Summarised):
    """States, costates and what follows from them, in SI units on a mesh.

    Attributes
    ----------
    knots : (intervals + 1,) array
        Times of the mesh's nodes in s.
    states, costates : (intervals + 1, n) arrays
        In the order of `gen_profile.dynamics.problem.pontryagin.StateLayout`, at the nodes.
    hamiltonian : (intervals + 1,) array or None
        H at the nodes, without the constant β of the running cost; None where the method has none.
    top_derivative : (intervals, points, m) array
        The highest derivative of every axis' position that is a polynomial of degree points − 1 on each
        interval, as coefficients in the interval's own time in s, lowest power first: the jerk, or the snap.
    top_order : int
        Which derivative that is: 3 or 4.
    sway : (points, loads) array
        Sway at the collocation points in m.
    angle : float
        Greatest rope angle at the collocation points in rad.
    cost : float
        Eq. (26), in the units of the effort squared times s.
    sway_weight, sway_scale : float
        β and γ as they entered the cost, automatic ones resolved.
    defect : float or None
        Greatest relative amount by which the solution misses the canonical equations between collocation
        points.
    hamiltonian_variation : float or None
        Greatest relative change of H along the nodes; zero for the exact solution.
    """

    knots: Array = attrs.field(converter=read_only)
    states: Array = attrs.field(converter=read_only)
    costates: Array = attrs.field(converter=read_only)
    hamiltonian: Array | None = attrs.field(converter=attrs.converters.optional(read_only))
    top_derivative: Array = attrs.field(converter=read_only)
    top_order: int
    sway: Array = attrs.field(converter=read_only)
    angle: float
    cost: float
    sway_weight: float
    sway_scale: float
    defect: float | None
    hamiltonian_variation: float | None

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {"nodes": len(self.knots), "states": self.states.shape[1], "cost": f"{self.cost:.6g}"}


@attrs.frozen(kw_only=True, eq=False, repr=False)
class Solution(Summarised):
    """Outcome of a solve.

    Attributes
    ----------
    status : Status
    method : str
        Name of the solver.
    problem : Problem
    optimum : Optimum or None
        None exactly when the status is no success.
    iterations : int
        Newton iterations, all stages together.
    residual : float
        Relative size of the last Newton step.
    redundant : tuple of str
        Uncertain parameters whose sensitivities those of the others decide, so that they were left out.
    worst_case_bound : float or None
        Residual sway of the end load in m below which no motion could bring the worst machine, as far as
        angles are small; None where the worst machine was not what counted.
    other_costs : tuple of float or None
        Of the motion to which another start led, where one was tried because loads swing far; empty where it
        led to none, or limits keep it from being tried; None where loads do not swing far.
    advice : str
        What to change, a sentence; empty on success.
    suggestions : tuple of Suggestion
        Changes that were tried and give a motion.
    """

    status: Status
    method: str
    problem: Problem
    optimum: Optimum | None = None
    iterations: int = 0
    residual: float = float("inf")
    redundant: tuple[str, ...] = ()
    worst_case_bound: float | None = None
    other_costs: tuple[float, ...] | None = None
    advice: str = ""
    suggestions: tuple[Suggestion, ...] = ()

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        return {
            "status": self.status.name.lower(),
            "method": self.method,
            "iterations": self.iterations,
            "residual": f"{self.residual:.2g}",
        }

    @property
    def redundancy(self) -> str:
        """Say what leaving out the sensitivities to the redundant parameters means."""
        if any(self.problem.initial.values()):
            return "cannot be zero as well where the load swings at the start"
        return "zero whenever the others are, for small angles"

    def raise_for_status(self) -> Optimum:
        """Return the optimum.

        Raises
        ------
        InfeasibleProblem, SolverDiverged
            With the status's sentence and what to change.
        """
        if self.optimum is None:
            raise no_motion(self.status, self.advice, self.suggestions)
        return self.optimum


def no_motion(status: Status, advice: str, suggestions: Iterable[Suggestion] = ()) -> NoMotion:
    """Say how a solve ended that found no motion, and what to change."""
    error: type[NoMotion] = SolverDiverged if status in UNKNOWN else InfeasibleProblem
    sentences = filter(None, [status.value, advice])
    return error(*sentences, reasons=[Reason(code=Code[status.name])], suggestions=suggestions)
