"""Machines under a trolley and a hoist: their motion and its derivatives, many at once."""

from functools import cache

import attrs
import numpy as np

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.dynamics.problem.sensitivities import swing_equations
from gen_profile.dynamics.problem.symbolic import Function, Symbol
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant

TROLLEY = 3  # states of the trolley, which come first: place, velocity and acceleration


@attrs.frozen(kw_only=True, eq=False)
class Swing:
    """A machine's state (trolley, q_u, q̇_u, sensitivities) and what is seen of it, with their derivatives.

    Attributes
    ----------
    states : int
    rate : Function
        Of (state, hoist's place, velocity and acceleration, parameters): [ż, ∂ż/∂z] without the jerk's part.
    seen : Function
        Of the same: [y, ∂y/∂z], y being the bodies' horizontal places and the end load's sway.
    """

    states: int
    rate: Function
    seen: Function


@cache
def swing_of(plant: Plant, trolley: int, names: tuple[str, ...]) -> Swing:
    """Compile a machine, with sensitivities to some parameters."""
    d = dynamics(plant)
    swing, rate, sensitive = swing_equations(plant, d, names, 1)
    carried, hoist = sym.symbols("trolley", TROLLEY), sym.symbols("hoist", 3)
    state = sym.column([carried, swing, *(one.states for one in sensitive)])
    moved = sym.column([sym.split(carried)[1], sym.split(carried)[2], sym.zeros(1, 1)])

    def driven(expression: Symbol) -> Symbol:
        for order, symbol in enumerate((d.q_a, d.dq_a, d.ddq_a)):
            both = [sym.split(hoist)[order], sym.split(carried)[order]]
            axes = sym.column(both if trolley else both[::-1])
            expression = sym.substitute(expression, symbol, axes)
        return expression

    rates = sym.column([moved, driven(rate), *(driven(one.rates) for one in sensitive)])
    places = sym.split(d.place)[::3]
    seen = driven(sym.column([*places, sym.split(d.sway)[-1]]))
    inputs = {"state": state, "hoist": hoist, "p": d.p}
    return Swing(
        states=state.shape[0],
        rate=Function("rate", inputs, sym.beside(rates, sym.jacobian(rates, state))),
        seen=Function("seen", inputs, sym.beside(seen, sym.jacobian(seen, state))),
    )


@attrs.frozen(kw_only=True, eq=False)
class FollowedMachines:
    """What machines do in every interval, at its steps.

    Attributes
    ----------
    states : (machines, intervals, steps + 1, n) array
    along : (machines, intervals, steps + 1, n, n + 1) array
        Derivatives by the state at the interval's begin, and by its jerk.
    seen : (machines, intervals, steps + 1, y) array
    seen_along : (machines, intervals, steps + 1, y, n + 1) array
    """

    states: Array
    along: Array
    seen: Array
    seen_along: Array


def followed(
    swing: Swing, nodes: Array, p: Array, *, jerks: Array, hoist: Array, step: float
) -> FollowedMachines:
    """Integrate by the classical method of Runge and Kutta, with the derivatives.

    Parameters
    ----------
    swing : Swing
    nodes : (machines, intervals, n) array
        States at which intervals begin.
    p : (machines, parameters) array
    jerks : (intervals,) array
        Of the trolley, m/s³.
    hoist : (intervals, 2 steps + 1, 3) array
        Its place, velocity and acceleration, at the steps and half between them.
    step : float
        s.
    """
    machines, intervals, n = nodes.shape
    pushed = np.zeros((n, 1))
    pushed[TROLLEY - 1] = 1.0
    z, along = nodes, np.broadcast_to(np.eye(n, n + 1), (machines, intervals, n, n + 1))
    states, alongs = [z], [along]
    parameters = p[:, None]

    def slope(z: Array, along: Array, half: int) -> tuple[Array, Array]:
        both = swing.rate(z, hoist[:, half], parameters)
        rates = both[..., 0] + jerks[:, None] * pushed[:, 0]
        change = both[..., 1:] @ along
        change[..., n:] += pushed
        return rates, change

    for number in range((hoist.shape[1] - 1) // 2):
        k1 = slope(z, along, 2 * number)
        k2 = slope(z + step / 2.0 * k1[0], along + step / 2.0 * k1[1], 2 * number + 1)
        k3 = slope(z + step / 2.0 * k2[0], along + step / 2.0 * k2[1], 2 * number + 1)
        k4 = slope(z + step * k3[0], along + step * k3[1], 2 * number + 2)
        z = z + step / 6.0 * (k1[0] + 2.0 * k2[0] + 2.0 * k3[0] + k4[0])
        along = along + step / 6.0 * (k1[1] + 2.0 * k2[1] + 2.0 * k3[1] + k4[1])
        states.append(z)
        alongs.append(along)
    whole, whole_along = np.stack(states, axis=2), np.stack(alongs, axis=2)
    both = swing.seen(whole, hoist[:, ::2], p[:, None, None])
    return FollowedMachines(
        states=whole, along=whole_along, seen=both[..., 0], seen_along=both[..., 1:] @ whole_along
    )
