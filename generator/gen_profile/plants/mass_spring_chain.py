"""A family of machines: n masses behind a driven axis, each tied to the one before by a spring and a damper.

dᵢ is how far mass i trails the axis, so it stands at y − dᵢ; with d₀ = 0 and nothing behind the last mass,
Newton's second law reads

    mᵢ d̈ᵢ = −sᵢ + sᵢ₊₁ + mᵢ ÿ,   sᵢ = kᵢ (dᵢ − dᵢ₋₁) + cᵢ (ḋᵢ − ḋᵢ₋₁)

Drive belts, conveyors, long shafts and elastic structures are such chains. With equal masses and springs and
no damping the natural frequencies are 2 √(k/m) sin((2j − 1) π / (4 n + 2)), j = 1 … n (any text on lattice
vibrations with one end fixed and one free).
"""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from types import SimpleNamespace

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
from gen_profile.support.phrase import Phrase

LARGEST = 24


@cache
def member(masses: int) -> Plant:
    """Make the chain with the given number of masses, type ``mass-spring-chain-<masses>``.

    Raises
    ------
    KeyError
        The family has no such member.
    """
    if not 1 <= masses <= LARGEST:
        raise KeyError(masses)
    numbers = range(1, masses + 1)
    template = (
        "springs and masses behind a driven axis, {masses} of each (or another number: it ends the type)"
    )
    return Plant(
        type=f"mass-spring-chain-{masses}",
        summary=(Phrase(template, masses=masses)),
        parameters=tuple(_parameters(numbers)),
        actuated=(Coordinate(name="axis", unit="m"),),
        unactuated=tuple(Coordinate(name=f"d{number}", unit="m") for number in numbers),
        loads=tuple(f"mass{number}" for number in numbers),
        equations=_equations(masses),
        outputs=_outputs,
        bodies=tuple(f"mass{number}" for number in numbers),
        mechanics=_mechanics,
    )


def _parameters(numbers: range) -> Iterator[Parameter]:
    for letter, unit, template, nominal, lower, upper in (
        ("m", "kg", "mass {i}", 1.0, 1e-6, 1e6),
        ("k", "N/m", "spring before mass {i}", 100.0, 1e-6, 1e12),
        ("c", "N s/m", "damper beside spring {i}", 0.0, 0.0, 1e9),
    ):
        for i in numbers:
            words = Phrase(template, i=i)
            bounds = {"nominal": nominal, "lower": lower, "upper": upper}
            yield Parameter(f"{letter}{i}", unit, words, **bounds, essential=letter != "c")


def _equations(masses: int) -> Callable[..., Equations]:
    """Terms of the masses' equations of motion (module docstring)."""
    numbers = range(1, masses + 1)

    def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
        # the chain feels the axis' acceleration only
        mass, stiffness, damping = ([getattr(p, f"{name}{i}") for i in numbers] for name in "mkc")
        springs, dampers = _forces(stiffness, q_u), _forces(damping, dq_u)
        return Equations(
            M_uu=[[m if row == column else 0.0 for column in range(masses)] for row, m in enumerate(mass)],
            M_au=[[-m for m in mass]],
            K_u=[behind - before for before, behind in pairwise(springs)],
            G_u=[behind - before for before, behind in pairwise(dampers)],
        )

    return equations


def _forces(gains: Vector, values: Vector) -> list[Scalar]:
    """List the forces of all links, and of the missing one behind the last mass."""
    return [gain * step for gain, step in zip(gains, _steps(values), strict=True)] + [0.0]


def _steps(values: Vector) -> list[Scalar]:
    """Difference of each link's ends."""
    return [after - before for before, after in zip([0.0, *values[:-1]], values, strict=True)]


def _outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
    """Distance by which every mass trails its place behind the axis."""
    nothing = [0.0 for _ in q_u]
    return Outputs(sway=list(q_u), height=nothing, angle=nothing)


def _mechanics(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Mechanics:
    """Place the masses along the axis."""
    numbers, (axis,) = range(1, len(q_u) + 1), q_a
    links = zip(numbers, _steps(q_u), strict=True)
    return Mechanics(
        mass=[getattr(p, f"m{number}") for number in numbers],
        place=[(axis - distance, 0.0, 0.0) for distance in q_u],
        springs=sum(0.5 * getattr(p, f"k{number}") * step**2 for number, step in links),
    )
