"""Pontryagin's conditions of a problem: state and costate equations, ready for a boundary value solver.

Names and the paper's symbols:

===================  =========================================================================
``x``                x: q_u, q̇_u, then y, ẏ, ÿ (and y⃛ for snap) of every axis, then S
``u``                u: y⃛ (jerk), its derivative (snap), or ÿ_ref (reference, eq. 6)
``costate``          λ
``hamiltonian``      H = g + λᵀ f
``running_cost``     g, eq. (26): effort + β (exp((γ d)²) − 1), d the end load's sway; efforts of
                     several axes are summed, each weighed by `gen_profile.dynamics.problem.cost`
===================  =========================================================================

The constant −β T leaves the optimum where it is, and keeps H from drowning in it.

Everything is dimensionless: ``x = offset + scale ∘ x̂``, ``t = T s``, ``g = cost_scale ĝ``. The scales, the
plant's parameters and the weights are run-time data, so one derivation serves every move of a plant.
"""

from functools import cached_property, lru_cache

import attrs
import numpy as np

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import Dynamics, dynamics
from gen_profile.dynamics.problem.problem import Effort
from gen_profile.dynamics.problem.sensitivities import swing_equations
from gen_profile.dynamics.problem.symbolic import Function, Symbol
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant

SNAP_TIME = 0.02  # s; weighs snap against jerk: ½ (j² + (0.02 s · snap)²)


@attrs.frozen(kw_only=True)
class StateLayout:
    """Where things stand in the state.

    Attributes
    ----------
    n_u, m : int
        Unactuated and actuated coordinates.
    orders : int
        States per axis: position, velocity, acceleration, and for snap the jerk.
    sensitivity_rows : tuple of (parameters, plant row)
        One entry per sensitivity state; rows count q_u, then q̇_u.
    """

    n_u: int
    m: int
    orders: int
    sensitivity_rows: tuple[tuple[tuple[str, ...], int], ...]

    @property
    def size(self) -> int:
        """Number of states."""
        return 2 * self.n_u + self.orders * self.m + len(self.sensitivity_rows)

    def axis(self, order: int) -> slice:
        """States that hold the given derivative of the axes' positions."""
        first = 2 * self.n_u + order * self.m
        return slice(first, first + self.m)

    @cached_property
    def kinds(self) -> list[tuple[list[int], list[int]]]:
        """States of the unactuated side by kind: coordinates, rates, and each one's sensitivities.

        Each kind as its states and the coordinates that they belong to.
        """
        first = self.sensitivities.start
        rows: list[tuple[int, tuple[str, ...], int]] = [(row, (), row) for row in range(2 * self.n_u)]
        rows += [(first + i, names, row) for i, (names, row) in enumerate(self.sensitivity_rows)]
        kinds: dict[tuple[tuple[str, ...], bool], tuple[list[int], list[int]]] = {}
        for state, names, row in rows:
            states, coordinates = kinds.setdefault((names, row < self.n_u), ([], []))
            states.append(state)
            coordinates.append(row % self.n_u)
        return list(kinds.values())

    @property
    def sensitivities(self) -> slice:
        """States that hold sensitivities."""
        return slice(2 * self.n_u + self.orders * self.m, self.size)


@attrs.frozen(kw_only=True, eq=False)
class OptimalitySystem:
    """The dimensionless canonical equations ``ẑ' = F(ẑ)``, z = (x, λ), the control eliminated by ∂H/∂u = 0.

    Attributes
    ----------
    plant : Plant
    layout : StateLayout
    slopes : Function
        Points ẑ (points, 2 n) and data (1, …) → (points, 2 n + sways, 1): F, and the end load's sway in m.
    linear : Function
        The same → (points, n + sways + …, 2 n): derivatives by ẑ of x̂', of the end load's sway in m, and of
        what else of the state is costed by half its square.
    quantities : Function
        The same → (points, 2 + m + 2 loads, 1) in SI units: H, g, the highest derivative of every axis that
        the state's chain of integrators ends in (jerk, or snap), sway and angle of every load.
    """

    plant: Plant
    layout: StateLayout
    slopes: Function
    linear: Function
    quantities: Function
    _hamiltonian: Symbol
    _inputs: dict[str, Symbol]

    @cached_property
    def flow(self) -> Function:
        """The same → (points, 2 n, 1 + 2 n): F, and beside it ∂F/∂ẑ. Takes longest to derive."""
        return Function("flow", self._inputs, _canonical_flow(self._hamiltonian, self._inputs["z"]))


@attrs.frozen(kw_only=True, eq=False)
class RuntimeParameters:
    """Run-time data of an `OptimalitySystem`; see the module docstring for the scales.

    Attributes
    ----------
    parameters : (parameters,) array
    beta, gamma : float
    tau : float
        Any positive number where the drive is ideal.
    duration, cost_scale : float
    effort_weights : (m,) array
        Of the square of every axis' effort.
    offset, scale : (n,) arrays
    """

    parameters: Array
    beta: float
    gamma: float
    tau: float
    duration: float
    cost_scale: float
    effort_weights: Array
    offset: Array
    scale: Array

    def row(self) -> Array:
        """Order the data as the functions take them, shape (1, …)."""
        weights = [self.beta, self.gamma, self.tau, self.duration, self.cost_scale]
        return np.concatenate([self.parameters, weights, self.effort_weights, self.offset, self.scale])[None]


@lru_cache(maxsize=8)
def optimality_system(
    plant: Plant, desensitized: tuple[str, ...], effort: Effort, order: int = 1
) -> OptimalitySystem:
    """Derive the canonical equations by CasADi's differentiation.

    Parameters
    ----------
    plant : Plant
    desensitized : tuple of str
        Parameters whose sensitivities become states.
    effort : str
        ``"reference"`` brings the actuator's lag, eq. (6), into the state equations.
    order : int
        Of the sensitivities.
    """
    d = dynamics(plant)
    weights = sym.symbols("weights", 5)
    beta, gamma, tau, duration, cost_scale = sym.split(weights)
    effort_weights = sym.symbols("effort_weights", len(plant.actuated))
    axes = _axis_chain(d, effort, tau, effort_weights)
    layout, x, f = _state_equations(plant, d, axes, desensitized, order)
    end_sway = d.sway[plant.end_load]
    g = axes.effort + beta * (sym.exp(gamma**2 * sym.dot(end_sway, end_sway)) - 1)

    n = x.shape[0]
    state, costate = sym.symbols("state", n), sym.symbols("costate", n)
    offset, scale = sym.symbols("offset", n), sym.symbols("scale", n)
    # f is affine and g quadratic in u: ∂H/∂u = 0 is a linear equation, and its solution the minimum
    u_star = -cost_scale / axes.weight * sym.gradient(sym.dot(costate, duration * f / scale), axes.u)

    def optimal(expression: Symbol) -> Symbol:
        return sym.substitute(sym.substitute(expression, axes.u, u_star), x, offset + scale * state)

    hamiltonian = optimal(g / cost_scale + sym.dot(costate, duration * f / scale))
    costed = [end_sway, axes.costed / sym.sqrt(cost_scale)]
    quantities = [hamiltonian * cost_scale, optimal(sym.column([g, axes.top, d.sway, d.angle]))]
    z = sym.column([state, costate])
    inputs = {"z": z, "data": sym.column([d.p, weights, effort_weights, offset, scale])}
    forward, backward = _canonical_slopes(hamiltonian, state, costate)
    return OptimalitySystem(
        plant=plant,
        layout=layout,
        slopes=Function("slopes", inputs, sym.column([forward, backward, optimal(end_sway)])),
        linear=Function("linear", inputs, sym.jacobian(sym.column([forward, *map(optimal, costed)]), z)),
        quantities=Function("quantities", inputs, sym.column(quantities)),
        hamiltonian=hamiltonian,
        inputs=inputs,
    )


def _canonical_slopes(hamiltonian: Symbol, state: Symbol, costate: Symbol) -> tuple[Symbol, Symbol]:
    return sym.gradient(hamiltonian, costate), -sym.gradient(hamiltonian, state)


def _canonical_flow(hamiltonian: Symbol, z: Symbol) -> Symbol:
    """Slopes (∂H/∂λ, −∂H/∂x), and beside them their Jacobian, half of which follows by symmetry."""
    unknowns = sym.split(z)
    state, costate = sym.column(unknowns[: len(unknowns) // 2]), sym.column(unknowns[len(unknowns) // 2 :])
    forward, backward = _canonical_slopes(hamiltonian, state, costate)
    by_state, curvature = sym.jacobian(forward, state), sym.symmetric(sym.jacobian(backward, state))
    above = sym.beside(by_state, sym.jacobian(forward, costate))
    below = sym.beside(curvature, -by_state.T)
    return sym.beside(sym.column([forward, backward]), sym.column([above, below]))


@attrs.frozen(kw_only=True, eq=False)
class _AxisChain:
    """The driven axes' integrators: position upward in `chain`, then `top`, which the control moves."""

    u: Symbol
    chain: list[Symbol]
    top: Symbol
    effort: Symbol
    weight: Symbol  # ∂² effort / ∂u² of every axis; axes do not mix
    costed: Symbol  # what of the chain the effort holds half the square of


def _axis_chain(d: Dynamics, effort: Effort, tau: Symbol, weights: Symbol) -> _AxisChain:
    u, nothing = sym.symbols("u", d.q_a.shape[0]), sym.column([])
    chain, half_square = [d.q_a, d.dq_a, d.ddq_a], sym.dot(weights * u, u) / 2
    if effort == "jerk":
        return _AxisChain(u=u, chain=chain, top=u, effort=half_square, weight=weights, costed=nothing)
    if effort == "reference":
        lagged = (u - d.ddq_a) / tau
        return _AxisChain(u=u, chain=chain, top=lagged, effort=half_square, weight=weights, costed=nothing)
    jerk = sym.symbols("dddq_a", d.q_a.shape[0])
    return _AxisChain(
        u=u,
        chain=[*chain, jerk],
        top=u,
        effort=sym.dot(weights * jerk, jerk) / 2 + SNAP_TIME**2 * half_square,
        weight=SNAP_TIME**2 * weights,
        costed=sym.sqrt(weights) * jerk,
    )


def _state_equations(
    plant: Plant, d: Dynamics, axes: _AxisChain, desensitized: tuple[str, ...], order: int
) -> tuple[StateLayout, Symbol, Symbol]:
    """Put what swings, the axes and the sensitivities into one state x, with ẋ = f."""
    swing, rate, reached = swing_equations(plant, d, desensitized, order)
    layout = StateLayout(
        n_u=len(plant.unactuated),
        m=len(plant.actuated),
        orders=len(axes.chain),
        sensitivity_rows=tuple((s.parameters, row) for s in reached for row in s.rows),
    )
    x = sym.column([swing, *axes.chain, *(s.states for s in reached)])
    f = sym.column([rate, *axes.chain[1:], axes.top, *(s.rates for s in reached)])
    return layout, x, f
