"""Slosh tank: a rectangular, open tank moved along its length, the liquid as its pendulum equivalent.

Of the liquid's antisymmetric modes n = 1, 2 (the symmetric ones are not excited by a horizontal motion), with
tank length a, width b, fill height h and wave number κ = (2n − 1) π / a:

    ω² = g κ tanh(κ h),   L = g / ω² = 1 / (κ tanh(κ h))
    ζ  = √(ν / (2 ω)) [1/a + 1/b + κ (1 − 2h/a) / sinh(2 κ h)] + 2 ν κ² / ω,   ν = μ/ρ
    L θ̈ + 2 ζ ω L θ̇ + g sin θ = ÿ cos θ

ω and L are those of R. A. Ibrahim, Liquid Sloshing Dynamics, 2005, and F. T. Dodge, The New Dynamic Behavior
of Liquids in Moving Containers, 2000, after H. N. Abramson, NASA SP-106, 1966. ζ is the boundary layers' of
G. H. Keulegan, 1959 (Landau & Lifshitz, Fluid Mechanics, § 25), plus the bulk's. Real liquids lose more, by
films and wetting: measure where it matters.

The sway is the rise of the liquid at the trailing wall. A steady acceleration ÿ tilts the surface by ÿ/g, of
whose Fourier series along the tank mode n holds 4 a / ((2n − 1) π)² at the wall; so mode n raises the liquid
there by 4 a / ((2n − 1) π)² sin θ. The same rise has the pendulum's potential energy if its mass is
m = 8 ρ a³ b / (((2n − 1) π)⁴ L), which is Dodge's, too; the rest of the liquid moves with the tank.
"""

from types import SimpleNamespace

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.drawing import Drawing, Pose, Shape, drawn, stacked, travel
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

ODD = (1, 3)  # 2n − 1 of the modes
SMALL = 0.1  # of the tank's length and of the fill height, for waves of the linear theory
SURFACE = 17  # points of the liquid's drawn surface


def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
    """Terms of the pendulums' equations of motion (module docstring)."""
    # the liquid feels the tank's acceleration only
    lengths, dampings = zip(*(_pendulum(odd, p) for odd in ODD), strict=True)
    return Equations(
        M_uu=[[lengths[0], 0.0], [0.0, lengths[1]]],
        M_au=[[-np.cos(theta) for theta in q_u]],
        K_u=[-p.g * np.sin(theta) for theta in q_u],
        G_u=[-damping * rate for damping, rate in zip(dampings, dq_u, strict=True)],
    )


def _pendulum(odd: int, p: SimpleNamespace) -> tuple[Scalar, Scalar]:
    """Length L and damping 2 ζ ω L of a mode."""
    wave_number = odd * np.pi / p.a
    length = 1.0 / (wave_number * np.tanh(wave_number * p.h))
    omega, viscosity = np.sqrt(p.g / length), p.mu / p.rho
    at_walls = 1.0 / p.a + 1.0 / p.b
    at_walls += wave_number * (1.0 - 2.0 * p.h / p.a) / np.sinh(2.0 * wave_number * p.h)
    # a root for each: slopes by h and ρ would be 0/0 where nothing is viscous
    boundary = np.sqrt(p.mu) / (np.sqrt(p.rho) * np.sqrt(2.0 * omega))
    ratio = boundary * at_walls + 2.0 * viscosity * wave_number**2 / omega
    return length, 2.0 * ratio * omega * length


def outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
    """Rise of the liquid at the trailing wall, and the first mode's angle."""
    rise = sum(_rises(q_u, p))
    return Outputs(sway=[rise], height=[rise], angle=[q_u[0]])


def _rises(q_u: Vector, p: SimpleNamespace) -> list[Scalar]:
    """How far each mode raises the liquid at the trailing wall."""
    return [4.0 * p.a / (odd * np.pi) ** 2 * np.sin(theta) for odd, theta in zip(ODD, q_u, strict=True)]


def mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    """Place the modes' pendulums below their pivots: the part of the liquid that sloshes."""
    (tank,) = q_a
    mass, place = [], []
    for odd, theta in zip(ODD, q_u, strict=True):
        length, _ = _pendulum(odd, p)
        mass.append(8.0 * p.rho * p.a**3 * p.b / ((odd * np.pi) ** 4 * length))
        place.append((tank - length * np.sin(theta), 0.0, -length * np.cos(theta)))
    return Mechanics(mass=mass, place=place, gravity=p.g)


def picture(pose: Pose) -> tuple[Drawing, ...]:
    """Draw the tank with the liquid: each mode is a cosine along it, and as high at the wall as it says."""
    a, h = pose.p.a, pose.p.h
    height = 1.35 * h
    along = np.linspace(0.0, 1.0, SURFACE)

    def points(pose: Pose) -> Array:
        place, rises = pose.q_a[:, 0], _rises(list(pose.q_u.T), pose.p)

        def above(fraction: float) -> Array:
            waves = (rise * np.cos(odd * np.pi * fraction) for odd, rise in zip(ODD, rises, strict=True))
            return np.asarray(h + sum(waves))

        surface = [(place + (fraction - 0.5) * a, above(fraction)) for fraction in along]
        left, right = place - 0.5 * a, place + 0.5 * a
        corners = [(left, height), (left, 0.0), (right, 0.0), (right, height)]
        low, high = travel(place, 0.6 * a)
        return stacked((low, 0.0), (high, 0.0), *corners, *surface, frames=len(place))

    surface = range(6, 6 + SURFACE)
    return (
        drawn(
            "from the side",
            pose,
            points,
            Shape(kind="rail", points=[0, 1]),
            Shape(kind="plumb", points=[surface[0], surface[-1]]),
            Shape(kind="liquid", points=[3, *surface, 4]),
            Shape(kind="frame", points=[2, 3, 4, 5]),
        ),
    )


def small_wave(p: SimpleNamespace) -> float:
    """Tell the rise in m up to which the linear theory holds: a tenth of the length, and of the fill height.

    A standing wave that rises by A at the wall has crests higher by κ A / 2, and a frequency lower by
    (κ A)² / 8, in a deep liquid: 16 % and 1.2 % where A is a tenth of the length (W. G. Penney and
    A. T. Price, Phil. Trans. R. Soc. A 244, 1952). In a shallow one A over the fill height is neglected.
    """
    return SMALL * float(min(p.a, p.h))


PLANT = Plant(
    type="slosh-tank",
    summary="liquid in a rectangular tank that is moved along its length",
    parameters=(
        Parameter(
            "a", "m", "tank length along the move", nominal=0.5, lower=1e-2, upper=100.0, essential=True
        ),
        Parameter("b", "m", "tank width across", nominal=0.3, lower=1e-2, upper=100.0),
        Parameter("h", "m", "fill height", nominal=0.25, lower=1e-3, upper=100.0, essential=True),
        Parameter("rho", "kg/m^3", "density", nominal=998.0, lower=100.0, upper=2e4),
        Parameter("mu", "Pa s", "dynamic viscosity", nominal=1.0e-3, lower=0.0, upper=1e3),
        Parameter("g", "m/s^2", "gravity", nominal=9.81, lower=0.1, upper=30.0),
    ),
    actuated=(Coordinate(name="tank", unit="m"),),
    unactuated=(Coordinate(name="theta1", unit="rad"), Coordinate(name="theta2", unit="rad")),
    loads=("surface",),
    equations=equations,
    outputs=outputs,
    bodies=("mode1", "mode2"),
    mechanics=mechanics,
    small_sway=small_wave,
    picture=picture,
)
