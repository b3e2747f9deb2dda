"""Machines under a trolley and a hoist: their motion and its derivatives, many at once."""

from functools import cache

import attrs
import numpy as np

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.dynamics.problem.linearization import Linearization
from gen_profile.dynamics.problem.sensitivities import sensitivities
from gen_profile.dynamics.problem.symbolic import Function, Symbol
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant
from gen_profile.spec.plan_view import StraightWay
from gen_profile.spec.stacks import PathAxes
from gen_profile.support.work import spend

EQUAL = 1e-9  # relative difference of what is the same
EVALUATION = 1e-7  # s of work for each derivative of a rate
CARRIED = 3  # states of the trolley along every line, which come first: place, velocity and acceleration


@attrs.frozen(kw_only=True, eq=False)
class Swing:
    """A machine's state (trolley, q_u, q̇_u, sensitivities) and what is seen of it, with their derivatives.

    Attributes
    ----------
    states, lines : int
        The trolley has three states along every line.
    rate : Function
        Of (state, hoist's place, velocity and acceleration, parameters): ż without the jerks' part.
    slope : Function
        Of the same: [ż, ∂ż/∂z].
    seen : Function
        Of the same: [y, ∂y/∂z], y being every body's places along the lines and the end load's sways.
    """

    states: int
    lines: int
    rate: Function
    slope: Function
    seen: Function

    @property
    def carried(self) -> int:
        """Number of the trolley's states."""
        return CARRIED * self.lines


def swings_along(
    plant: Plant, axes: PathAxes, lines: tuple[StraightWay, ...], linear: Linearization
) -> tuple[tuple[StraightWay, ...], tuple[int, ...]]:
    """Choose lines on which the load swings as on these, and tell which coordinates move on them.

    A machine that swings alike along both axes does on any line what it does along the first; what is
    crosswise stays at rest.
    """
    if len(axes.along) == len(lines):
        return lines, tuple(range(len(plant.unactuated)))
    (line,) = lines
    first, second = axes.along
    pushes, shown = linear.input, linear.sway_gain[plant.end_load]
    powers = [np.linalg.matrix_power(linear.stiffness, k) for k in range(len(pushes))]
    seen = np.array([shown @ one @ pushes[:, [first, second]] for one in powers])
    alike = np.abs(seen - seen[:, :1, :1] * np.eye(2)).max(axis=(1, 2)) <= EQUAL * np.abs(seen).max(
        axis=(1, 2)
    )
    if alike.all():
        line = StraightWay()
    pushed = pushes[:, [first, second]] @ np.array(line.way)
    reached = np.max([np.abs(one @ pushed) / np.abs(one).max() for one in powers], axis=0)
    return (line,), tuple(np.flatnonzero(reached > EQUAL * reached.max()).tolist())


@cache
def swing_of(
    plant: Plant,
    axes: PathAxes,
    lines: tuple[StraightWay, ...],
    moving: tuple[int, ...],
    names: tuple[str, ...],
) -> Swing:
    """Compile a machine that goes along lines, with sensitivities to some parameters.

    Parameters
    ----------
    plant : Plant
    axes : PathAxes
    lines : tuple of StraightWay
        One, or two that are crosswise and cross where places along both are 0.
    moving : tuple of int
        Numbers of the coordinates that are states; others stay at 0.
    names : tuple of str
    """
    d = dynamics(plant)
    q, dq, ddq = (sym.split(one) for one in (d.q_u, d.dq_u, d.ddq_u))
    swing = sym.column([*(q[k] for k in moving), *(dq[k] for k in moving)])
    rate = sym.column([*(dq[k] for k in moving), *(ddq[k] for k in moving)])
    still = sym.column([one[k] for one in (q, dq) for k in range(len(q)) if k not in moving])
    by_name = dict(zip((q.name for q in plant.parameters), sym.split(d.p), strict=True))
    sensitive = sensitivities(rate, swing, by_name, names, 1)
    carried, hoist = sym.symbols("trolley", CARRIED * len(lines)), sym.symbols("hoist", 3)
    state = sym.column([carried, swing, *(one.states for one in sensitive)])
    places = [sym.split(carried)[CARRIED * k : CARRIED * (k + 1)] for k in range(len(lines))]
    onwards = sym.column([one for _, v, a in places for one in (v, a, sym.zeros(1, 1))])

    def driven(expression: Symbol) -> Symbol:
        expression = sym.at_zero(expression, still)
        for order, symbol in enumerate((d.q_a, d.dq_a, d.ddq_a)):
            moved: dict[int, Symbol] = {axes.hoist: sym.split(hoist)[order]}
            for k, axis in enumerate(axes.along):
                pairs = zip(places, lines, strict=True)
                parts = [line.way[k] * one[order] + (0.0 if order else line.origin[k]) for one, line in pairs]
                moved[axis] = sum(parts[1:], parts[0])
            expression = sym.substitute(
                expression, symbol, sym.column([moved[axis] for axis in sorted(moved)])
            )
        return expression

    rates = sym.column([onwards, driven(rate), *(driven(one.rates) for one in sensitive)])
    seen = driven(sym.column(_seen(sym.split(d.place), sym.split(d.sway)[plant.end_load], lines)))
    inputs = {"state": state, "hoist": hoist, "p": d.p}
    return Swing(
        states=state.shape[0],
        lines=len(lines),
        rate=Function("rate", inputs, rates),
        slope=Function("slope", inputs, sym.beside(rates, sym.jacobian(rates, state))),
        seen=Function("seen", inputs, sym.beside(seen, sym.jacobian(seen, state))),
    )


def _seen(places: list[Symbol], sways: list[Symbol], lines: tuple[StraightWay, ...]) -> list[Symbol]:
    """Take places of all bodies along the lines, and then the end load's sways along them."""
    seen = []
    for k in range(0, len(places), 3):
        for (x, y), origin in ((line.way, line.origin) for line in lines):
            seen.append(x * places[k] + y * places[k + 1] - (x * origin[0] + y * origin[1]))
    for line in lines:
        parts = (way * one for way, one in zip(line.way[1:], sways[1:], strict=False))
        seen.append(sum(parts, line.way[0] * sways[0]))
    return seen


@attrs.frozen(kw_only=True, eq=False)
class FollowedMachines:
    """What machines do in every interval, at its steps.

    Attributes
    ----------
    states : (machines, intervals, steps + 1, n) array
    along : (machines, intervals, steps + 1, n, n + lines) array
        Derivatives by the state at the interval's begin, and by its jerks.
    seen : (machines, intervals, steps + 1, y) array
    seen_along : (machines, intervals, steps + 1, y, n + lines) array
    """

    states: Array
    along: Array
    seen: Array
    seen_along: Array


def followed(
    swing: Swing, nodes: Array, p: Array, *, jerks: Array, hoist: Array, step: float
) -> FollowedMachines:
    """Integrate by the classical method of Runge and Kutta, with the derivatives.

    Derivatives of rates cost most: those in the middle of a step are taken once, and those at its end again
    at the next one's begin.

    Parameters
    ----------
    swing : Swing
    nodes : (machines, intervals, n) array
        States at which intervals begin.
    p : (machines, parameters) array
    jerks : (intervals, lines) array
        Of the trolley, m/s³.
    hoist : (intervals, 2 steps + 1, 3) array
        Its place, velocity and acceleration, at the steps and half between them.
    step : float
        s.
    """
    machines, intervals, n = nodes.shape
    spend(EVALUATION * machines * intervals * hoist.shape[1] * n * (n + 1))
    lines = swing.lines
    pushed = np.zeros((n, lines))
    pushed[CARRIED * np.arange(lines) + CARRIED - 1, np.arange(lines)] = 1.0
    z, along = nodes, np.broadcast_to(np.eye(n, n + lines), (machines, intervals, n, n + lines))
    states, alongs = [z], [along]
    parameters = p[:, None]

    pushes = jerks @ pushed.T

    def rate(z: Array, half: int) -> Array:
        return swing.rate(z, hoist[:, half], parameters)[..., 0] + pushes

    def slope(z: Array, half: int) -> tuple[Array, Array]:
        both = swing.slope(z, hoist[:, half], parameters)
        return both[..., 0] + pushes, both[..., 1:]

    def change(by_state: Array, along: Array) -> Array:
        changed = by_state @ along
        changed[..., n:] += pushed
        return changed

    k1, begin = slope(z, 0)
    for half in range(0, hoist.shape[1] - 1, 2):
        k2 = rate(z + step / 2.0 * k1, half + 1)
        k3, middle = slope(z + step / 2.0 * k2, half + 1)
        k4 = rate(z + step * k3, half + 2)
        z = z + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        k1, end = slope(z, half + 2)
        d1 = change(begin, along)
        d2 = change(middle, along + step / 2.0 * d1)
        d3 = change(middle, along + step / 2.0 * d2)
        d4 = change(end, along + step * d3)
        along, begin = along + step / 6.0 * (d1 + 2.0 * d2 + 2.0 * d3 + d4), end
        states.append(z)
        alongs.append(along)
    whole, whole_along = np.stack(states, axis=2), np.stack(alongs, axis=2)
    both = swing.seen(whole, hoist[:, ::2], p[:, None, None])
    return FollowedMachines(
        states=whole, along=whole_along, seen=both[..., 0], seen_along=both[..., 1:] @ whole_along
    )
