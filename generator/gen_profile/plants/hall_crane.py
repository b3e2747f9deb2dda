"""Hall crane: bridge in x, trolley in y, a hoist, and a payload on a sling below the hook block.

The hook block hangs at P = T + l u, l = L0 + hoist, and the payload at R = P + L2 n, where T = (x, y, 0), and

    u(θ) = (−sin θx cos θy, −sin θy, −cos θx cos θy)

is the direction of a rope by the angles of a universal joint, from the vertical; of the sling it is n. Angles
are positive where the load trails a positive acceleration, and singular only where a rope is horizontal. With
the ropes' pulls p and q of the hook block's and the payload's mass, s = m2/m1, and a viscous moment c on the
upper rope's angular velocity, Newton's law is

    P̈ = −g e_z − p u + s q n − F,   R̈ = −g e_z − q n,   F = c u̇ / (m1 l).

That the ropes are as long as they are, u · (P̈ − T̈) = l̈ − l u̇² and n · (R̈ − P̈) = −L2 ṅ², gives the pulls:

    q = [(u · n) r + L2 ṅ² + n · F] / [1 + s (u × n)²],   p = r + s (u · n) q,
    r = l u̇² − l̈ − u · (T̈ + g e_z).

Along e_i = ∂u/∂θ_i and f_i = ∂n/∂θ_i, e_i · (l ü + 2 l̇ u̇) = e_i · (P̈ − T̈) and f_i · L2 n̈ = f_i · (p u + F).
(In a plane and without hoist: W. Singhose, D. Kim, M. Kenison, Input shaping control of double-pendulum
bridge crane oscillations, 2008.)
"""

from functools import partial
from types import SimpleNamespace

import attrs
import numpy as np

from gen_profile.plants.gantry_crane import picture
from gen_profile.plants.plant import (
    Coordinate,
    Equations,
    Mechanics,
    Outputs,
    Parameter,
    Plant,
    Scalar,
    Vector,
)

NOTHING = (0.0, 0.0, 0.0)


@attrs.frozen
class _Rope:
    """Direction of a rope, its derivatives by both angles and by time, and e_i · ü but for θ̈'s share."""

    direction: Vector
    along: tuple[Vector, Vector]
    rate: Vector
    inertia: Vector
    whirl: Vector


def _rope(angles: Vector, rates: Vector = (0.0, 0.0)) -> _Rope:
    (x, y), (dx, dy) = angles, rates
    sx, cx, sy, cy = np.sin(x), np.cos(x), np.sin(y), np.cos(y)
    first, second = (-cx * cy, 0.0, sx * cy), (sx * sy, -cy, cx * sy)
    return _Rope(
        direction=(-sx * cy, -sy, -cx * cy),
        along=(first, second),
        rate=[dx * a + dy * b for a, b in zip(first, second, strict=True)],
        inertia=(cy**2, 1.0),
        whirl=(-2.0 * sy * cy * dx * dy, sy * cy * dx**2),
    )


def _dot(one: Vector, other: Vector) -> Scalar:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _cross(one: Vector, other: Vector) -> Vector:
    (a, b, c), (d, e, f) = one, other
    return (b * f - c * e, c * d - a * f, a * e - b * d)


def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
    """Terms of the equations of motion of hook block and payload (module docstring)."""
    upper, lower = _rope(q_u[:2], dq_u[:2]), _rope(q_u[2:], dq_u[2:])
    length, paid_out, ratio = p.L0 + q_a[2], dq_a[2], p.m2 / p.m1
    u, n = upper.direction, lower.direction
    aslant, inline = _cross(u, n), _dot(u, n)
    share = 1.0 / (1.0 + ratio * _dot(aslant, aslant))

    def swung(
        carry: Vector, tight: Scalar = 0.0, tight_below: Scalar = 0.0, drag: Vector = NOTHING
    ) -> list[Scalar]:
        """Give e_i · (P̈ − T̈) and f_i · (R̈ − P̈) for T̈ + g e_z, u · (P̈ − T̈), n · (R̈ − P̈) and F."""
        above = tight - _dot(u, carry)
        pull = share * (inline * above + tight_below + _dot(n, drag))
        hook = [ratio * pull * a - b - c for a, b, c in zip(n, carry, drag, strict=True)]
        below = [(above + ratio * inline * pull) * a + b for a, b in zip(u, drag, strict=True)]
        return [*(_dot(e, hook) for e in upper.along), *(_dot(f, below) for f in lower.along)]

    drag = [p.c / (p.m1 * length) * one for one in upper.rate]
    forced = swung(NOTHING, length * _dot(upper.rate, upper.rate), p.L2 * _dot(lower.rate, lower.rate), drag)
    coriolis = [2.0 * paid_out * size * rate for size, rate in zip(upper.inertia, dq_u[:2], strict=True)]
    own = [
        *(length * one + two for one, two in zip(upper.whirl, coriolis, strict=True)),
        *(p.L2 * one for one in lower.whirl),
    ]
    sizes = [*(length * one for one in upper.inertia), *(p.L2 * one for one in lower.inertia)]
    pushes = (swung((1.0, 0.0, 0.0)), swung((0.0, 1.0, 0.0)), swung(NOTHING, -1.0))
    return Equations(
        M_uu=[[size if row == column else 0.0 for column in range(4)] for row, size in enumerate(sizes)],
        M_au=[[-one for one in push] for push in pushes],
        K_u=swung((0.0, 0.0, p.g)),
        G_u=[one - other for one, other in zip(forced, own, strict=True)],
    )


def outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
    """Sways of hook block and payload in both directions, their heights below the trolley, ropes' angles."""
    upper, lower = _rope(q_u[:2]).direction, _rope(q_u[2:]).direction
    x, y, low = [(p.L0 + q_a[2]) * one for one in upper]
    lowest = low + p.L2 * lower[2]
    return Outputs(
        sway=[-x, -y, -x - p.L2 * lower[0], -y - p.L2 * lower[1]],
        height=[low, low, lowest, lowest],
        angle=list(q_u),
    )


def mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    """Place hook block and payload below the trolley."""
    seen, (x, y, _) = outputs(q_u, q_a, p), q_a
    places = [(x - seen.sway[k], y - seen.sway[k + 1], seen.height[k]) for k in (0, 2)]
    return Mechanics(mass=[p.m1, p.m2], place=places, gravity=p.g)


PLANT = Plant(
    type="hall-crane",
    summary="bridge, trolley and hoist; hook block and payload swing in both directions",
    parameters=(
        Parameter("m1", "kg", "hook block mass", nominal=350.0, lower=1e-4, upper=1e6, essential=True),
        Parameter("m2", "kg", "payload mass", nominal=5000.0, lower=1e-4, upper=1e6, essential=True),
        Parameter(
            "L0",
            "m",
            "from trolley to hook block with the hoist at 0",
            nominal=2.0,
            lower=1e-2,
            upper=200.0,
            essential=True,
        ),
        Parameter(
            "L2", "m", "sling, hook block to payload", nominal=2.0, lower=1e-2, upper=100.0, essential=True
        ),
        Parameter("g", "m/s^2", "gravity", nominal=9.81, lower=0.1, upper=30.0),
        Parameter("c", "N m s/rad", "damping at the trolley", nominal=0.0, lower=0.0, upper=1e9),
    ),
    actuated=(
        Coordinate(name="x", unit="m"),
        Coordinate(name="y", unit="m"),
        Coordinate(name="hoist", unit="m", lower=0.0),
    ),
    unactuated=tuple(
        Coordinate(name=name, unit="rad") for name in ("theta1_x", "theta1_y", "theta2_x", "theta2_y")
    ),
    loads=("hook-x", "hook-y", "payload-x", "payload-y"),
    directions=2,
    equations=equations,
    outputs=outputs,
    bodies=("hook", "payload"),
    mechanics=mechanics,
    picture=partial(picture, side=slice(0, 3, 2)),
)
