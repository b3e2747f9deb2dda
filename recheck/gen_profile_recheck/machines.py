"""The machines' equations, written down by hand from the physics, in forms without differences of like terms.

Each machine gives, of its unactuated coordinates q with rates dq, its axes a with velocities v and constants
k: `input_matrix`, the matrix D by which accelerations of the axes act, q̈ = drift + D v̇; `drift`; and `sway`
of its loads. Everything that swings counts as positive where it trails an axis that sets off in positive
direction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import flint

from gen_profile_recheck.jets import Scalar, along, moved, sine_cosine

Values = Sequence[Scalar]
INNER, OUTER = 1 << 7, 1 << 8  # units for what changes along the motion itself, and along others


@dataclass(frozen=True)
class Machine:
    """What is known of a kind of machine: names, and its equations (module docstring)."""

    axes: tuple[str, ...]
    coordinates: tuple[str, ...]
    loads: tuple[str, ...]
    end_load: tuple[str, slice]
    input_matrix: Callable[[Values, Values, SimpleNamespace], list[list[Scalar]]]
    drift: Callable[[Values, Values, Values, Values, SimpleNamespace], list[Scalar]]
    sway: Callable[[Values, Values, SimpleNamespace], list[Scalar]]
    constants: Callable[[Mapping[str, Scalar]], SimpleNamespace] = lambda p: SimpleNamespace(**p)

    @property
    def states(self) -> list[str]:
        """Name all coordinates, and then their rates."""
        return [name + of for of in ("", ".rate") for name in self.coordinates]

    def speed(self, x: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
        """Give dq of x = (q, w), where w = dq − D v does not leap when v does."""
        q, w = x[: len(x) // 2], x[len(x) // 2 :]
        return carried(w, self.input_matrix(q, a, k), v)

    def rate(self, x: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
        """Give ẋ."""
        q, dq = x[: len(x) // 2], self.speed(x, a, v, k)
        later = self.input_matrix(moved(q, dq, INNER), moved(a, v, INNER), k)
        changes = [[along(one, INNER) for one in row] for row in later]
        return dq + carried(self.drift(q, dq, a, v, k), changes, [-one for one in v])

    def bend(self, q: Values, dq: Values, axes: Sequence[Values], k: SimpleNamespace) -> list[Scalar]:
        """Give q̈, of axes with position, velocity and acceleration."""
        a, v, dv = axes
        return carried(self.drift(q, dq, a, v, k), self.input_matrix(q, a, k), dv)

    def in_rates(self, q: Values, change: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
        """Give the change of (q, dq) for one of x, and with −v the other way round."""
        n = len(q)
        rows = self.input_matrix(moved(q, change[:n], OUTER), a, k)
        carried = (along(inner(row, v), OUTER) for row in rows)
        return [*change[:n], *(one + other for one, other in zip(change[n:], carried, strict=True))]


def carried(values: Values, matrix: Sequence[Values], v: Values) -> list[Scalar]:
    """Add a matrix times a vector to values."""
    return [one + inner(row, v) for one, row in zip(values, matrix, strict=True)]


def inner(row: Values, v: Values) -> Scalar:
    """Give the inner product of two vectors."""
    return sum((one * other for one, other in zip(row, v, strict=True)), start=0)


# Two ropes: α and β are their angles from the vertical, δ = β − α. Lagrange's equations
#   (m1+m2) L1 α̈ + m2 L2 cos δ β̈ = m2 L2 sin δ β̇² − (m1+m2) g sin α + (m1+m2) ÿ cos α + (c2 δ̇ − c1 α̇)/L1
#   L1 cos δ α̈ + L2 β̈ = −L1 sin δ α̇² − g sin β + ÿ cos β − c2 δ̇/(m2 L2)
# solved with sin β and cos β expanded by δ; the determinant is L1 L2 (m1 + m2 sin² δ).


def _two_ropes_inputs(q: Values, a: Values, k: SimpleNamespace) -> list[list[Scalar]]:
    (sa, ca), (sd, cd) = map(sine_cosine, q)
    inertia = k.m1 + k.m2 * (sd * sd)
    upper = ca / k.L1 + k.m2 * (cd * sd * sa) / (k.L1 * inertia)
    lower = -((k.m1 + k.m2) * (sa * sd)) / (k.L2 * inertia)
    return [[upper], [lower - upper]]


def _two_ropes_drift(q: Values, dq: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
    (sa, ca), (sd, cd) = map(sine_cosine, q)
    da, dd = dq
    db, mass, inertia = da + dd, k.m1 + k.m2, k.m1 + k.m2 * (sd * sd)
    at_cart, at_hook = (k.c2 * dd - k.c1 * da) / k.L1, k.c2 * dd / (k.m2 * k.L2)
    whirled = k.m2 * k.L2 * (sd * db * db) + k.m2 * k.L1 * (cd * sd * da * da)
    pulled = k.m2 * k.g * (cd * sd * ca)
    upper = (whirled + pulled + at_cart + k.m2 * (cd * at_hook)) / (k.L1 * inertia) - k.g * sa / k.L1
    swung = mass * k.L1 * (sd * da * da) + k.m2 * k.L2 * (cd * sd * db * db) + mass * k.g * (ca * sd)
    lower = -(swung + mass * at_hook + cd * at_cart) / (k.L2 * inertia)
    return [upper, lower - upper]


def _two_ropes_sway(q: Values, a: Values, k: SimpleNamespace) -> list[Scalar]:
    hook = k.L1 * sine_cosine(q[0])[0]
    return [hook, hook + k.L2 * sine_cosine(q[0] + q[1])[0]]


# One rope of length l = L0 + hoist: l φ̈ = −g sin φ − 2 l̇ φ̇ − c φ̇/(m l) + ÿ cos φ.


def _one_rope_inputs(q: Values, a: Values, k: SimpleNamespace) -> list[list[Scalar]]:
    return [[sine_cosine(q[0])[1] / (k.L0 + a[1]), 0]]


def _one_rope_drift(q: Values, dq: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
    length = k.L0 + a[1]
    return [-(k.g * sine_cosine(q[0])[0] + (2 * v[1] + k.c / (k.m * length)) * dq[0]) / length]


def _one_rope_sway(q: Values, a: Values, k: SimpleNamespace) -> list[Scalar]:
    return [(k.L0 + a[1]) * sine_cosine(q[0])[0]]


# A rope on a universal joint: the load lies at (x − L sin θx cos θy, y − L sin θy, −L cos θx cos θy).


def _joint_inputs(q: Values, a: Values, k: SimpleNamespace) -> list[list[Scalar]]:
    (sx, cx), (sy, cy) = map(sine_cosine, q)
    return [[cx / (k.L * cy), 0], [-(sx * sy) / k.L, cy / k.L]]


def _joint_drift(q: Values, dq: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
    (sx, cx), (sy, cy) = map(sine_cosine, q)
    damping = k.c / (k.m * k.L * k.L)
    first = -(k.g * sx) / (k.L * cy) + 2 * (sy / cy * dq[0] * dq[1]) - damping * dq[0]
    return [first, -(k.g * (cx * sy)) / k.L - sy * cy * dq[0] * dq[0] - damping * dq[1]]


def _joint_sway(q: Values, a: Values, k: SimpleNamespace) -> list[Scalar]:
    (sx, _), (sy, cy) = map(sine_cosine, q)
    return [k.L * (sx * cy), k.L * sy]


# The same below a trolley at radius r of a jib that turns by α. In the jib's frame the load lies at (X, Y, Z)
# and feels (r̈ − α̈ Y − 2 α̇ Ẏ − α̇² X, α̈ X + 2 α̇ Ẋ − α̇² Y) besides, here along both angles.


def _jib_inputs(q: Values, a: Values, k: SimpleNamespace) -> list[list[Scalar]]:
    (sr, cr), (st, ct) = map(sine_cosine, q)
    return [[cr * st / ct, cr / (k.L * ct)], [ct * a[1] / k.L - sr, -(sr * st) / k.L]]


def _jib_drift(q: Values, dq: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
    (sr, cr), (st, ct) = map(sine_cosine, q)
    x, y = a[1] - k.L * (sr * ct), -(k.L * st)
    dx, dy = v[1] + k.L * (sr * st * dq[1] - cr * ct * dq[0]), -(k.L * (ct * dq[1]))
    along_jib, across = -(2 * v[0] * dy) - v[0] * v[0] * x, 2 * v[0] * dx - v[0] * v[0] * y
    first, second = _joint_drift(q, dq, a, v, k)
    return [first + cr * along_jib / (k.L * ct), second + (ct * across - sr * st * along_jib) / k.L]


# Masses behind an axis, each tied to the one before: m_i d̈_i = m_i ÿ − s_i + s_{i+1}, with
# s_i = k_i Δd_i + c_i Δḋ_i.


def _chain_drift(q: Values, dq: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
    def pull(i: int) -> Scalar:
        if i == len(q):
            return 0
        stretch, rate = (q[i], dq[i]) if i == 0 else (q[i] - q[i - 1], dq[i] - dq[i - 1])
        return getattr(k, f"k{i + 1}") * stretch + getattr(k, f"c{i + 1}") * rate

    return [(pull(i + 1) - pull(i)) / getattr(k, f"m{i + 1}") for i in range(len(q))]


def _pushed(q: Values, a: Values, k: SimpleNamespace) -> list[list[Scalar]]:
    return [[1]] * len(q)


def _chain(masses: int) -> Machine:
    loads, coordinates = (" ".join(f"{one}{i + 1}" for i in range(masses)) for one in ("mass", "d"))
    names = f"axis, {coordinates}, {loads}, mass{masses}"
    return _machine(names, 1, _pushed, _chain_drift, lambda q, a, k: list(q))


# An arm behind a hub, of inertia J, on a spring: J (α̈ − ÿ) = −k α − c α̇, with α positive behind the hub.


def _arm_drift(q: Values, dq: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
    return [-(k.k * q[0] + k.c * dq[0]) / k.J]


def _arm_sway(q: Values, a: Values, k: SimpleNamespace) -> list[Scalar]:
    return [k.R * q[0]]


# Liquid in a tank: modes n = 1, 2 as pendulums of length 1/(κ tanh κh), κ = (2n − 1) π/a, damped by ζ of
# boundary layers and bulk (Keulegan): √(ν/2ω) [1/a + 1/b + κ (1 − 2h/a)/sinh 2κh] + 2 ν κ²/ω, ν = μ/ρ.


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


def _tank_drift(q: Values, dq: Values, a: Values, v: Values, k: SimpleNamespace) -> list[Scalar]:
    modes = zip(q, dq, k.L, k.loss, strict=True)
    return [-(k.g * sine_cosine(one)[0]) / length - loss * rate for one, rate, length, loss in modes]


def _tank_inputs(q: Values, a: Values, k: SimpleNamespace) -> list[list[Scalar]]:
    return [[sine_cosine(one)[1] / length] for one, length in zip(q, k.L, strict=True)]


def _tank_sway(q: Values, a: Values, k: SimpleNamespace) -> list[Scalar]:
    return [inner(k.rise, [sine_cosine(one)[0] for one in q])]


def _machine(names: str, directions: int, *equations: Callable[..., Any]) -> Machine:
    """Take names of axes, coordinates, loads and the end load: the last loads, so many directions."""
    axes, coordinates, loads, (end_load,) = (tuple(each.split()) for each in names.split(","))
    end = end_load, slice(len(loads) - directions, len(loads))
    return Machine(axes, coordinates, loads, end, *equations)


_JOINT = "theta_x theta_y, payload-x payload-y, load"
_JIB = "theta_r theta_t, payload-radial payload-tangential, load"
_TANK = "tank, theta1 theta2, surface, surface"
MACHINES: Mapping[str, Machine] = {
    "double-pendulum-crane": _machine(
        "cart, theta1 theta2, hook payload, payload", 1, _two_ropes_inputs, _two_ropes_drift, _two_ropes_sway
    ),
    "single-pendulum-crane": _machine(
        "cart hoist, phi, payload, payload", 1, _one_rope_inputs, _one_rope_drift, _one_rope_sway
    ),
    "gantry-crane": _machine(f"x y, {_JOINT}", 2, _joint_inputs, _joint_drift, _joint_sway),
    "tower-crane": _machine(f"slew trolley, {_JIB}", 2, _jib_inputs, _jib_drift, _joint_sway),
    "flexible-joint": _machine("hub, alpha, tip, tip", 1, _pushed, _arm_drift, _arm_sway),
    "slosh-tank": _machine(_TANK, 1, _tank_inputs, _tank_drift, _tank_sway, _tank),
    **{f"mass-spring-chain-{masses}": _chain(masses) for masses in range(1, 25)},
}
