"""What a machine is to the rest of the project: parameters, equations and outputs.

The coordinates are split as in the paper's section 3: `q_a` have motors, `q_u` have none. The motors'
accelerations are the input, so neither motor forces nor friction on the driven side are needed:

    M_uu(q) q̈_u = K_u(q) + G_u(q, q̇) − M_au(q)ᵀ q̈_a          (eq. 2–3)

Equations are written with NumPy functions on scalars. The same text then takes floats, and the symbols of a
computer algebra system that implements NumPy's protocols.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np

from gen_profile.plants.drawing import Drawing, Pose

# A float, or a symbol that NumPy functions accept.
Scalar = Any
Vector = Sequence[Scalar]

PROBE = 0.1  # rad (or m) and rad/s (or m/s), with which a machine is tried


@attrs.frozen
class Parameter:
    """A physical constant of a machine.

    Attributes
    ----------
    name, unit, description : str
        `unit` is an SI unit.
    nominal : float
        Used where a spec says nothing.
    lower, upper : float
        Allowed values, both ends included.
    essential : bool
        Whether it makes the machine swing as it does, as masses and ropes do: a spec that states one such
        value has to state all that matter.
    """

    name: str
    unit: str
    description: str
    nominal: float = attrs.field(kw_only=True)
    lower: float = attrs.field(kw_only=True)
    upper: float = attrs.field(kw_only=True)
    essential: bool = attrs.field(default=False, kw_only=True)


@attrs.frozen(kw_only=True)
class Coordinate:
    """A generalised coordinate.

    Attributes
    ----------
    name : str
    unit : str
        ``"m"`` or ``"rad"``.
    lower, upper : float
        Of an actuated coordinate: where it may start and end, both ends included.
    """

    name: str
    unit: str
    lower: float = -math.inf
    upper: float = math.inf


@attrs.frozen(kw_only=True)
class Equations:
    """The terms of eq. (2) for the unactuated coordinates, as nested sequences of scalars.

    Attributes
    ----------
    M_uu : n_u × n_u
    M_au : m × n_u
    K_u, G_u : n_u
        Rows may be scaled by any positive factor, M_uu need not be symmetric.
    """

    M_uu: Sequence[Vector]
    M_au: Sequence[Vector]
    K_u: Vector
    G_u: Vector


@attrs.frozen(kw_only=True)
class Outputs:
    """What is seen of the loads, one entry per load, or one per load and horizontal direction.

    Attributes
    ----------
    sway : m
        Horizontal distance from the load's place at rest; positive when the load trails a machine that
        accelerates in the positive direction.
    height : m
        Above the suspension point, so negative for a hanging load.
    angle : rad
        Of the rope that carries the load, from the vertical; 0 where nothing hangs.
    """

    sway: Vector
    height: Vector
    angle: Vector


@attrs.frozen(kw_only=True)
class Mechanics:
    """What moves, as point masses, one entry per body.

    Attributes
    ----------
    mass : kg
    place : three each, m
        x, y and z in a frame that stands still, z upwards; z = 0 where a load is suspended.
    gravity : m/s²
    springs : J
        What all springs together have stored.
    """

    mass: Vector
    place: Sequence[tuple[Scalar, Scalar, Scalar]]
    gravity: Scalar = 0.0
    springs: Scalar = 0.0

    @property
    def potential(self) -> Scalar:
        """Potential energy in J."""
        weights = (mass * self.gravity * z for mass, (_, _, z) in zip(self.mass, self.place, strict=True))
        return sum(weights, self.springs)


def _no_bodies(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    return Mechanics(mass=[], place=[])


@attrs.frozen(kw_only=True, cache_hash=True)  # it is looked up by in all that is kept of a machine
class Plant:
    """A machine: names, parameters, equations of motion and outputs. Nothing else.

    Attributes
    ----------
    type : str
        What a spec calls it, such as ``"double-pendulum-crane"``.
    summary : str
        One line for lists.
    parameters : tuple of Parameter
    actuated, unactuated : tuple of Coordinate
    loads : tuple of str
        Names of the outputs: the loads, the end load last. The hook of a double pendulum is a load, too. One
        that swings in two horizontal directions has a name for each.
    directions : int
        In how many directions the end load swings: as many of the last `loads` are its components.
    equations : (q_u, dq_u, q_a, dq_a, p) → Equations
        Sequences of scalars, and the parameters as attributes of `p`.
    outputs : (q_u, q_a, p) → Outputs
    bodies : tuple of str
        Names of the bodies that `mechanics` tells of.
    mechanics : (q_u, q_a, p) → Mechanics
        For the loads' places and energy, and as a proof of the equations. A motion can be planned without.
    small_sway : (p) → m, optional
        Greatest sway of the end load up to which the equations hold, where they are linear ones.
    picture : (pose) → drawings, optional
        What an animation shows; a machine without is drawn from its outputs.
    """

    type: str
    summary: str
    parameters: tuple[Parameter, ...]
    actuated: tuple[Coordinate, ...]
    unactuated: tuple[Coordinate, ...]
    loads: tuple[str, ...]
    directions: int = 1
    equations: Callable[[Vector, Vector, Vector, Vector, SimpleNamespace], Equations]
    outputs: Callable[[Vector, Vector, SimpleNamespace], Outputs]
    bodies: tuple[str, ...] = ()
    mechanics: Callable[[Vector, Vector, SimpleNamespace], Mechanics] = _no_bodies
    small_sway: Callable[[SimpleNamespace], float] | None = None
    picture: Callable[[Pose], tuple[Drawing, ...]] | None = None

    @property
    def end_load(self) -> slice:
        """Which of the outputs are the end load's."""
        return slice(len(self.loads) - self.directions, len(self.loads))

    @property
    def end_load_name(self) -> str:
        """What to call the end load as a whole: its directions have a name each."""
        return self.loads[-1] if self.directions == 1 else "load"

    @property
    def units(self) -> dict[str, str]:
        """Unit of every axis and parameter, by name."""
        known: tuple[Parameter | Coordinate, ...] = (*self.actuated, *self.parameters)
        return {one.name: one.unit for one in known}

    def nominal(self) -> dict[str, float]:
        """Nominal value of every parameter, by name."""
        return {parameter.name: parameter.nominal for parameter in self.parameters}

    def probe(self) -> tuple[list[float], SimpleNamespace]:
        """Tell with which places of the axes and parameters the equations can be tried.

        Off zero, where a radius may vanish.
        """
        places = [min(max(1.0, axis.lower), axis.upper) for axis in self.actuated]
        return places, SimpleNamespace(**self.nominal())


def decides(plant: Plant, name: str, parameters: Mapping[str, float]) -> bool:
    """Tell whether a parameter changes how a machine of given parameters swings, or how that shows."""
    places, _ = plant.probe()
    angles, rates = (
        [PROBE / (k + 1.0) for k in range(len(plant.unactuated))],
        [PROBE for _ in plant.unactuated],
    )

    def swing(values: Mapping[str, float]) -> tuple[list[float], list[float]]:
        p, speeds = SimpleNamespace(**values), [PROBE for _ in places]
        terms = plant.equations(angles, rates, places, speeds, p)
        pushed = np.sum(np.array(terms.M_au, dtype=np.float64), axis=0)
        pull = np.array(terms.K_u, dtype=np.float64) + np.array(terms.G_u, dtype=np.float64) - pushed
        shown = plant.outputs(angles, places, p).sway
        return np.linalg.solve(np.array(terms.M_uu, dtype=np.float64), pull).tolist(), [
            float(x) for x in shown
        ]

    return not np.allclose(
        np.concatenate(swing(parameters)),
        np.concatenate(swing({**parameters, name: 1.5 * parameters[name]})),
        rtol=1e-12,
        atol=0.0,
    )
