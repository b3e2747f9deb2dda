"""How far a steady force holds a machine's loads from their places at rest.

The loads stand where the potential energy less the work of the force is stationary, ∂(V − F s)/∂q_u = 0,
with s the sway that the force acts along. It is found by Newton's method, the force raised in steps.
"""

from collections.abc import Mapping, Sequence
from functools import cache

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.scenarios import Scenario
from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics, parameter_rows
from gen_profile.dynamics.problem.symbolic import Function
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec
from gen_profile.support.errors import SpecError

STEPS, ITERATIONS = 10, 6  # of the force, and of Newton's method at each
ACCURACY = 1e-9  # of the last change of coordinates


@attrs.frozen(kw_only=True)
class StaticDeflection:
    """How far the loads are held from their places at rest, on the machine where the end load is farthest.

    Attributes
    ----------
    force : float
        N.
    machine : str
        Its name.
    loads : mapping of str to float
        m, each load in the direction of the force.
    """

    force: float
    machine: str
    loads: Mapping[str, float]

    def to_dict(self) -> dict[str, object]:
        """Nest plain values for JSON."""
        return {"force_n": self.force, "machine": self.machine, "deflections_m": dict(self.loads)}


def in_wind(spec: Spec, machines: Sequence[Scenario]) -> StaticDeflection | None:
    """Push the end load of machines by a spec's wind where the move ends; None without wind.

    Raises
    ------
    SpecError
        The wind is too strong.
    """
    if spec.check.wind.force == 0.0:
        return None
    by_name = {machine.name: machine.parameters for machine in machines}
    return static_deflection(spec.machine(), spec.check.wind.force, by_name, spec.move.target)


def static_deflection(
    plant: Plant, force: float, machines: Mapping[str, Mapping[str, float]], q_a: Sequence[float]
) -> StaticDeflection:
    """Push the end load of machines along each direction in which it swings, and find the farthest.

    Parameters
    ----------
    plant : Plant
        With bodies.
    force : float
        N.
    machines : mapping of str to mapping of str to float
        Parameters by the machines' names.
    q_a : (m,) sequence of float
        Where the axes stand.

    Raises
    ------
    SpecError
        The force is so great that the loads come to rest nowhere.
    """
    rows, loads = parameter_rows(plant, list(machines.values())), len(plant.loads)
    held = np.zeros((len(rows), loads))
    for direction in range(loads)[plant.end_load]:
        pushed = _deflected(plant, rows, q_a, force * np.eye(loads)[direction])
        # what the force does not act along, of a load in another direction, is not its deflection
        alike = slice(direction % plant.directions, None, plant.directions)
        held[:, alike] = pushed[:, alike]
    if not np.isfinite(held).all():
        raise SpecError(
            f"check.wind.force: {force:g} N hold the {plant.end_load_name} nowhere; state the force in N."
        )
    worst = int(np.argmax(held[:, plant.end_load].max(axis=1)))
    by_load = dict(zip(plant.loads, map(float, held[worst]), strict=True))
    return StaticDeflection(force=force, machine=list(machines)[worst], loads=by_load)


def _deflected(plant: Plant, rows: Array, q_a: Sequence[float], force: Array) -> Array:
    """Find the loads' distances in m from their places at rest, (machines, loads); nan where none is."""
    statics, n_u = _statics(plant), len(plant.unactuated)
    q: Array = np.zeros((len(rows), n_u))
    axes = np.tile(np.asarray(q_a, dtype=np.float64), (len(rows), 1))
    change = q
    for step in np.linspace(0.0, 1.0, STEPS + 1)[1:]:
        pushing = np.tile(step * force, (len(rows), 1))
        for _ in range(ITERATIONS):
            terms = statics(q, axes, rows, pushing)
            change = np.asarray(
                np.linalg.solve(terms[:, :n_u, 1:], terms[:, :n_u, :1])[:, :, 0], dtype=np.float64
            )
            q = q - change
    sway = np.abs(statics(q, axes, rows, 0.0 * pushing)[:, n_u:, 0])
    return np.where(np.abs(change).max(axis=1, keepdims=True) < ACCURACY, sway, np.nan)


@cache
def _statics(plant: Plant) -> Function:
    """[gradient, Hessian] of V − F s by q_u; below them the loads' sway."""
    d = dynamics(plant)
    force = sym.symbols("force", len(plant.loads))
    energy = sym.at_zero(d.energy, sym.column([d.dq_u, d.dq_a]))
    slope = sym.gradient(energy - sym.dot(force, d.sway), d.q_u)
    curved = sym.beside(slope, sym.jacobian(slope, d.q_u))
    seen = sym.beside(d.sway, sym.zeros(len(plant.loads), len(plant.unactuated)))
    whole = sym.matrix([*sym.rows(curved), *sym.rows(seen)])
    return Function("statics", {"q_u": d.q_u, "q_a": d.q_a, "p": d.p, "force": force}, whole)
