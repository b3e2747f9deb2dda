"""The machines' equations, written down by hand from the physics, in forms without differences of like terms.

Each machine gives, of its unactuated coordinates q, its axes a and constants k, a `Posture`: with rates dq of
q and v of a, q̈ = drift + D v̇. Everything that swings counts as positive where it trails an axis that sets off
in positive direction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add, mul
from types import SimpleNamespace
from typing import Any

import flint

from gen_profile_recheck.jets import Scalar, along, moved, sine_cosine

Values = Sequence[Scalar]
INNER, OUTER = 1 << 7, 1 << 8  # units for what changes along the motion itself, and along others


@dataclass(frozen=True)
class Posture:
    """What a machine does in a position: D, and functions that give `drift` of (dq, v), and sways."""

    inputs: Sequence[Values]
    drift: Callable[[Values, Values], list[Scalar]]
    sways: Callable[[], list[Scalar]]


@dataclass(frozen=True)
class Machine:
    """What is known of a kind of machine: names, and its equations (module docstring)."""

    axes: tuple[str, ...]
    coordinates: tuple[str, ...]
    loads: tuple[str, ...]
    end_load: tuple[str, slice]
    at: Callable[[Values, Values, SimpleNamespace], Posture]
    constants: Callable[[Mapping[str, Scalar]], SimpleNamespace] = lambda p: SimpleNamespace(**p)

    @property
    def states(self) -> list[str]:
        """Name all coordinates, and then their rates."""
        return [name + of for of in ("", ".rate") for name in self.coordinates]

    def speed(self, x: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
        """Give dq of x = (q, w), where w = dq − D v does not leap when v does."""
        q, w = x[: len(x) // 2], x[len(x) // 2 :]
        return carried(w, self.at(q, a, k).inputs, v)

    def rate(self, x: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
        """Give ẋ."""
        q, w = x[: len(x) // 2], x[len(x) // 2 :]
        here = self.at(q, a, k)
        dq = carried(w, here.inputs, v)
        later = self.at(moved(q, dq, INNER), moved(a, v, INNER), k).inputs
        changes = [[along(one, INNER) for one in row] for row in later]
        return dq + carried(here.drift(dq, v), changes, [-one for one in v])

    def bend(self, q: Values, dq: Values, axes: Sequence[Values], k: SimpleNamespace) -> list[Scalar]:
        """Give q̈, of axes with position, velocity and acceleration."""
        a, v, dv = axes
        here = self.at(q, a, k)
        return carried(here.drift(dq, v), here.inputs, dv)

    def in_rates(self, q: Values, change: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
        """Give the change of (q, dq) for one of x, and with −v the other way round."""
        n = len(q)
        rows = self.at(moved(q, change[:n], OUTER), a, k).inputs
        carried = (along(inner(row, v), OUTER) for row in rows)
        return [*change[:n], *(one + other for one, other in zip(change[n:], carried, strict=True))]


def carried(values: Values, matrix: Sequence[Values], v: Values) -> list[Scalar]:
    """Add a matrix times a vector to values."""
    return [one + inner(row, v) for one, row in zip(values, matrix, strict=True)]


def inner(row: Values, v: Values) -> Scalar:
    """Give the inner product of two vectors."""
    return reduce(add, map(mul, row, v))


# Two ropes: α and β are their angles from the vertical, δ = β − α. Lagrange's equations
#   (m1+m2) L1 α̈ + m2 L2 cos δ β̈ = m2 L2 sin δ β̇² − (m1+m2) g sin α + (m1+m2) ÿ cos α + (c2 δ̇ − c1 α̇)/L1
#   L1 cos δ α̈ + L2 β̈ = −L1 sin δ α̇² − g sin β + ÿ cos β − c2 δ̇/(m2 L2)
# solved with sin β and cos β expanded by δ; the determinant is L1 L2 (m1 + m2 sin² δ).


def _two_ropes(q: Values, a: Values, k: SimpleNamespace) -> Posture:
    (sa, ca), (sd, cd) = map(sine_cosine, q)
    mass, both, share = k.m1 + k.m2, cd * sd, 1 / (k.m1 + k.m2 * (sd * sd))
    upper, lower = share / k.L1, share / k.L2

    def drift(dq: Values, v: Values) -> list[Scalar]:
        da, dd = dq
        at_cart, at_hook = (k.c2 * dd - k.c1 * da) / k.L1, k.c2 / (k.m2 * k.L2) * dd
        above, below = k.L1 * (da * da), k.L2 * ((da + dd) * (da + dd))
        whirled = k.m2 * (sd * below + both * (above + k.g * ca) + cd * at_hook) + at_cart
        swung = mass * (sd * (above + k.g * ca) + at_hook) + k.m2 * (both * below) + cd * at_cart
        first = upper * whirled - k.g / k.L1 * sa
        return [first, -(lower * swung) - first]

    first = ca / k.L1 + k.m2 * (upper * (both * sa))
    hook = k.L1 * sa
    inputs = [[first], [-(mass * (lower * (sa * sd))) - first]]
    return Posture(inputs, drift, lambda: [hook, hook + k.L2 * (sa * cd + ca * sd)])


# One rope of length l = L0 + hoist: l φ̈ = −g sin φ − 2 l̇ φ̇ − c φ̇/(m l) + ÿ cos φ.


def _one_rope(q: Values, a: Values, k: SimpleNamespace) -> Posture:
    (sine, cosine), length = sine_cosine(q[0]), k.L0 + a[1]

    def drift(dq: Values, v: Values) -> list[Scalar]:
        return [-(k.g * sine + (2 * v[1] + k.c / (k.m * length)) * dq[0]) / length]

    return Posture([[cosine / length, 0]], drift, lambda: [length * sine])


# A rope on a universal joint: the load lies at (x − L sin θx cos θy, y − L sin θy, −L cos θx cos θy).


def _joint(q: Values, a: Values, k: SimpleNamespace) -> Posture:
    (sx, cx), (sy, cy) = map(sine_cosine, q)

    def drift(dq: Values, v: Values) -> list[Scalar]:
        damping = k.c / (k.m * k.L * k.L)
        first = -(k.g * sx) / (k.L * cy) + 2 * (sy / cy * dq[0] * dq[1]) - damping * dq[0]
        return [first, -(k.g * (cx * sy)) / k.L - sy * cy * dq[0] * dq[0] - damping * dq[1]]

    inputs = [[cx / (k.L * cy), 0], [-(sx * sy) / k.L, cy / k.L]]
    return Posture(inputs, drift, lambda: [k.L * (sx * cy), k.L * sy])


# A hook block on a rope of length l = L0 + hoist, and a payload L2 below it, by Newton's law and the ropes'
# pulls p, q of the hook's and the payload's mass: with the ropes' directions u and n, and s = m2/m1,
#   hook: P̈ = −g e_z − p u + s q n − c u̇/(m1 l),   payload: R̈ = −g e_z − q n,
# where u · (P̈ − T̈) = l̈ − l u̇² and n · (R̈ − P̈) = −L2 ṅ² give p = r + s κ q with κ = u · n, r = l u̇² − l̈ −
# u · (T̈ + g e_z), and q (1 + s (u × n)²) = κ r + L2 ṅ² + c n · u̇/(m1 l). The angles follow along ∂u/∂θ.


def _two_joints(q: Values, a: Values, k: SimpleNamespace) -> Posture:
    upper, lower, length, s = _direction(q[:2]), _direction(q[2:]), k.L0 + a[2], k.m2 / k.m1
    (u, ux, uy), (n, nx, ny) = upper.vectors, lower.vectors
    across = _cross(u, n)
    share = 1 / (1 + s * inner(across, across))

    def bent(whirled: Scalar, swung: Scalar, carry: Values, drag: Values) -> list[Scalar]:
        """Give angles' accelerations but for their own whirling: `carry` is T̈ + g e_z, `drag` c u̇/(m1 l)."""
        r = whirled - inner(u, carry)
        pull = share * (inner(u, n) * r + swung + inner(n, drag))
        hook = [s * pull * one - other - third for one, other, third in zip(n, carry, drag, strict=True)]
        below = [(r + s * inner(u, n) * pull) * one + other for one, other in zip(u, drag, strict=True)]
        ways = (
            (ux, hook, length, upper.cy),
            (uy, hook, length, 1),
            (nx, below, k.L2, lower.cy),
            (ny, below, k.L2, 1),
        )
        return [inner(way, force) / (size * cosine * cosine) for way, force, size, cosine in ways]

    def drift(dq: Values, v: Values) -> list[Scalar]:
        rate, rate_below = (
            [dq[i] * one + dq[i + 1] * other for one, other in zip(*of.vectors[1:], strict=True)]
            for i, of in ((0, upper), (2, lower))
        )
        drag = [k.c / (k.m1 * length) * one for one in rate]
        whirled, swung = length * inner(rate, rate), k.L2 * inner(rate_below, rate_below)
        rows = bent(whirled, swung, [0, 0, k.g], drag)
        own = [
            *(
                2 * v[2] / length * one - other
                for one, other in zip(dq[:2], upper.whirl(dq[:2]), strict=True)
            ),
            *(-one for one in lower.whirl(dq[2:])),
        ]
        return [one - other for one, other in zip(rows, own, strict=True)]

    pushes = [
        bent(0, 0, [1, 0, 0], [0, 0, 0]),
        bent(0, 0, [0, 1, 0], [0, 0, 0]),
        bent(-1, 0, [0, 0, 0], [0, 0, 0]),
    ]
    hook = [-(length * u[0]), -(length * u[1])]
    return Posture(
        [list(row) for row in zip(*pushes, strict=True)],
        drift,
        lambda: [*hook, hook[0] - k.L2 * n[0], hook[1] - k.L2 * n[1]],
    )


@dataclass(frozen=True)
class _Direction:
    """Direction of a rope and its derivatives by two angles, the cosine of the second, and whirling."""

    vectors: tuple[Values, Values, Values]
    cy: Scalar
    whirl: Callable[[Values], list[Scalar]]


def _direction(angles: Values) -> _Direction:
    (sx, cx), (sy, cy) = map(sine_cosine, angles)
    vectors = ([-(sx * cy), -sy, -(cx * cy)], [-(cx * cy), 0, sx * cy], [sx * sy, -cy, cx * sy])
    return _Direction(vectors, cy, lambda dq: [2 * (sy / cy * dq[0] * dq[1]), -(sy * cy * dq[0] * dq[0])])


def _cross(one: Values, other: Values) -> list[Scalar]:
    (a, b, c), (d, e, f) = one, other
    return [b * f - c * e, c * d - a * f, a * e - b * d]


# One rope on a joint below a trolley at radius r of a jib that turns by α. In the jib's frame the load lies
# at (X, Y, Z) and feels (r̈ − α̈ Y − 2 α̇ Ẏ − α̇² X, α̈ X + 2 α̇ Ẋ − α̇² Y) besides, here along both angles.


def _jib(q: Values, a: Values, k: SimpleNamespace) -> Posture:
    (sr, cr), (st, ct), joint = *map(sine_cosine, q), _joint(q, a, k)

    def drift(dq: Values, v: Values) -> list[Scalar]:
        x, y = a[1] - k.L * (sr * ct), -(k.L * st)
        dx, dy = v[1] + k.L * (sr * st * dq[1] - cr * ct * dq[0]), -(k.L * (ct * dq[1]))
        along_jib, across = -(2 * v[0] * dy) - v[0] * v[0] * x, 2 * v[0] * dx - v[0] * v[0] * y
        first, second = joint.drift(dq, v)
        return [first + cr * along_jib / (k.L * ct), second + (ct * across - sr * st * along_jib) / k.L]

    inputs = [[cr * st / ct, cr / (k.L * ct)], [ct * a[1] / k.L - sr, -(sr * st) / k.L]]
    return Posture(inputs, drift, joint.sways)


# Masses behind an axis, each tied to the one before: m_i d̈_i = m_i ÿ − s_i + s_{i+1}, with
# s_i = k_i Δd_i + c_i Δḋ_i.


def _masses(q: Values, a: Values, k: SimpleNamespace) -> Posture:
    names = [str(i + 1) for i in range(len(q))]

    def drift(dq: Values, v: Values) -> list[Scalar]:
        ties = zip(names, q, [0, *q], dq, [0, *dq], strict=False)
        pulls = [
            getattr(k, f"k{i}") * (one - two) + getattr(k, f"c{i}") * (fast - slow)
            for i, one, two, fast, slow in ties
        ]
        following = zip(names, pulls, [*pulls[1:], 0], strict=True)
        return [(after - before) / getattr(k, f"m{i}") for i, before, after in following]

    return Posture([[1]] * len(q), drift, lambda: list(q))


def _chain(masses: int) -> Machine:
    loads, coordinates = (" ".join(f"{one}{i + 1}" for i in range(masses)) for one in ("mass", "d"))
    return _machine(f"axis, {coordinates}, {loads}, mass{masses}", 1, _masses)


# An arm behind a hub, of inertia J, on a spring: J (α̈ − ÿ) = −k α − c α̇, with α positive behind the hub.


def _arm(q: Values, a: Values, k: SimpleNamespace) -> Posture:
    return Posture([[1]], lambda dq, v: [-(k.k * q[0] + k.c * dq[0]) / k.J], lambda: [k.R * q[0]])


# Liquid in a tank: modes n = 1, 2 as pendulums of length 1/(κ tanh κh), κ = (2n − 1) π/a, damped by ζ of
# boundary layers and bulk (Keulegan): √(ν/2ω) [1/a + 1/b + κ (1 − 2h/a)/sinh 2κh] + 2 ν κ²/ω, ν = μ/ρ.


def _liquid(q: Values, a: Values, k: SimpleNamespace) -> Posture:
    angles = list(map(sine_cosine, q))

    def drift(dq: Values, v: Values) -> list[Scalar]:
        modes = zip(angles, dq, k.L, k.loss, strict=True)
        return [-(k.g * sine) / length - loss * rate for (sine, _), rate, length, loss in modes]

    inputs = [[cosine / length] for (_, cosine), length in zip(angles, k.L, strict=True)]
    return Posture(inputs, drift, lambda: [inner(k.rise, [sine for sine, _ in angles])])


def _tank(p: Mapping[str, Scalar]) -> SimpleNamespace:
    k, viscosity = SimpleNamespace(g=p["g"], L=[], loss=[], rise=[]), p["mu"] / p["rho"]
    for odd in (1, 3):
        wave = odd * flint.arb.pi() / p["a"]
        small = (-2 * wave * p["h"]).exp()  # sinh 2x is (1/s − s)/2, and tanh x (1 − s)/(1 + s)
        length = (1 + small) / (wave * (1 - small))
        omega = (p["g"] / length).sqrt()
        walls = 1 / p["a"] + 1 / p["b"] + wave * (1 - 2 * p["h"] / p["a"]) * 2 * small / (1 - small * small)
        layers = 0 if p["mu"] == 0 else (viscosity / (2 * omega)).sqrt() * walls
        k.loss.append(2 * (layers + 2 * viscosity * wave * wave / omega) * omega)
        k.L.append(length)
        k.rise.append(4 * p["a"] / (odd * flint.arb.pi()) ** 2)
    return k


def _machine(names: str, directions: int, *equations: Callable[..., Any]) -> Machine:
    """Take names of axes, coordinates, loads and the end load: the last loads, so many directions."""
    axes, coordinates, loads, (end_load,) = (tuple(each.split()) for each in names.split(","))
    end = end_load, slice(len(loads) - directions, len(loads))
    return Machine(axes, coordinates, loads, end, *equations)


_JOINT = "theta_x theta_y, payload-x payload-y, load"
_JIB = "theta_r theta_t, payload-radial payload-tangential, load"
MACHINES: Mapping[str, Machine] = {
    "double-pendulum-crane": _machine("cart, theta1 theta2, hook payload, payload", 1, _two_ropes),
    "single-pendulum-crane": _machine("cart hoist, phi, payload, payload", 1, _one_rope),
    "gantry-crane": _machine(f"x y, {_JOINT}", 2, _joint),
    "hall-crane": _machine(
        "x y hoist, theta1_x theta1_y theta2_x theta2_y, hook-x hook-y payload-x payload-y, load",
        2,
        _two_joints,
    ),
    "tower-crane": _machine(f"slew trolley, {_JIB}", 2, _jib),
    "flexible-joint": _machine("hub, alpha, tip, tip", 1, _arm),
    "slosh-tank": _machine("tank, theta1 theta2, surface, surface", 1, _liquid, _tank),
    **{f"mass-spring-chain-{masses}": _chain(masses) for masses in range(1, 25)},
}
