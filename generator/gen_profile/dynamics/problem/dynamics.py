"""A plant's equations solved for the unactuated accelerations, eq. (3), as symbols."""

from collections.abc import Mapping, Sequence
from types import SimpleNamespace

import attrs
import numpy as np

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.symbolic import Function, Symbol
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Mechanics, Plant
from gen_profile.support.errors import SpecError


@attrs.frozen(kw_only=True, eq=False)
class Dynamics:
    """Symbols of a plant and its motion: q̈_u = free + driven · q̈_a.

    Attributes
    ----------
    q_u, dq_u : (n_u,) columns
        Unactuated coordinates and rates.
    q_a, dq_a, ddq_a : (m,) columns
        Actuated coordinates, rates and accelerations (the input).
    p : (parameters,) column
        In the order of `Plant.parameters`.
    drift : (n_u,) column
        M_uu⁻¹ (K_u + G_u).
    input_matrix : (n_u, m) matrix
        −M_uu⁻¹ M_auᵀ; also the jump of q̇_u per unit step of axis velocity.
    ddq_u : (n_u,) column
    sway, height, angle : (loads,) columns
    place : (3 bodies,) column
        x, y and z of every body, where the plant tells of bodies.
    energy : (1,) column, or (0,)
        Of all bodies, kinetic and potential, likewise.
    """

    q_u: Symbol
    dq_u: Symbol
    q_a: Symbol
    dq_a: Symbol
    ddq_a: Symbol
    p: Symbol
    drift: Symbol
    input_matrix: Symbol
    ddq_u: Symbol
    sway: Symbol
    height: Symbol
    angle: Symbol
    place: Symbol
    energy: Symbol

    @property
    def outputs(self) -> Symbol:
        """All outputs as one column: of the loads first, then of the bodies."""
        return sym.column([self.sway, self.height, self.angle, self.place, self.energy])


def dynamics(plant: Plant) -> Dynamics:
    """Write a plant's equations in symbols.

    Raises
    ------
    SpecError
        They are not written for symbols.
    """
    n_u, m = len(plant.unactuated), len(plant.actuated)
    q_u, dq_u = sym.symbols("q_u", n_u), sym.symbols("dq_u", n_u)
    q_a, dq_a, ddq_a = sym.symbols("q_a", m), sym.symbols("dq_a", m), sym.symbols("ddq_a", m)
    p = sym.symbols("p", len(plant.parameters))
    q, dq = sym.column([q_u, q_a]), sym.column([dq_u, dq_a])
    named = SimpleNamespace(**dict(zip((q.name for q in plant.parameters), sym.split(p), strict=True)))
    try:
        terms = plant.equations(sym.split(q_u), sym.split(dq_u), sym.split(q_a), sym.split(dq_a), named)
        outputs = plant.outputs(sym.split(q_u), sym.split(q_a), named)
        bodies = plant.mechanics(sym.split(q_u), sym.split(q_a), named)
        place = [x for _, place in zip(plant.bodies, bodies.place, strict=True) for x in place]
        energy = [_energy(bodies, q, dq)] if plant.bodies else []
    except Exception as error:  # of the machine's author
        raise SpecError(
            f"plant.type: the equations of {plant.type!r} do not take symbols "
            f"({type(error).__name__}: {str(error).partition(chr(10))[0]}); write them with NumPy functions "
            "on scalars, without branches on values."
        ) from error
    mass = sym.matrix(terms.M_uu)
    drift = sym.solve(mass, sym.column(terms.K_u) + sym.column(terms.G_u))
    input_matrix = -sym.solve(mass, sym.matrix(terms.M_au).T)
    made = Dynamics(
        q_u=q_u,
        dq_u=dq_u,
        q_a=q_a,
        dq_a=dq_a,
        ddq_a=ddq_a,
        p=p,
        drift=drift,
        input_matrix=input_matrix,
        ddq_u=drift + input_matrix @ ddq_a,
        sway=sym.column(outputs.sway),
        height=sym.column(outputs.height),
        angle=sym.column(outputs.angle),
        place=sym.column(place),
        energy=sym.column(energy),
    )
    _require_symbols(plant, made)
    return made


def _require_symbols(plant: Plant, made: Dynamics) -> None:
    """Find what Python's own ``math`` made of a symbol: it takes one for a float, NaN, silently.

    Raises
    ------
    SpecError
    """
    inputs = {name: getattr(made, name) for name in ("q_u", "dq_u", "q_a", "dq_a", "ddq_a", "p")}
    rest = {name: np.zeros((1, symbols.shape[0])) for name, symbols in inputs.items()}
    places, parameters = plant.probe()
    rest |= {"q_a": np.array([places]), "p": parameter_rows(plant, [vars(parameters)])}
    at_rest = Function("at_rest", inputs, sym.column([made.ddq_u, made.outputs]))(*rest.values())
    if np.isnan(at_rest).any():
        raise SpecError(
            f"plant.type: the equations of {plant.type!r} lose their symbols; write them with functions of "
            "NumPy, not of math (np.sin, not math.sin), and without float()."
        )


def _energy(bodies: Mechanics, q: Symbol, dq: Symbol) -> Symbol:
    """½ Σ m ṙ² and what gravity and springs have stored."""
    velocities = (sym.directional(sym.column(place), q, dq) for place in bodies.place)
    kinetic = (0.5 * m * sym.dot(v, v) for m, v in zip(bodies.mass, velocities, strict=True))
    return sum(kinetic, bodies.potential)


def parameter_rows(plant: Plant, machines: Sequence[Mapping[str, float]]) -> Array:
    """Order the parameters of machines as `Plant.parameters`, shape (machines, parameters)."""
    names = [parameter.name for parameter in plant.parameters]
    return np.array([[values[name] for name in names] for values in machines]).reshape(-1, len(names))
