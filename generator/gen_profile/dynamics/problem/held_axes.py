"""A machine some of whose axes stand still: fewer axes are driven, and what nothing moves need not be solved.

With q_a = (moving, held) and the held ones constant, eq. (2) keeps its form for the moving ones. Coordinates
that nothing swings then, as a gantry's load across its way, rest: they are left out, too.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from types import SimpleNamespace

import attrs

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.dynamics.problem.initial_state import RATE
from gen_profile.plants.plant import Equations, Mechanics, Outputs, Plant, Vector
from gen_profile.spec.model import Spec
from gen_profile.support.phrase import Phrase

Places = tuple[tuple[int, float], ...]  # of held axes: their numbers, and where they stand in m (or rad)


def held_axes(spec: Spec) -> Iterator[str]:
    """Say which axes are held that could help, and how they may; nothing where none could."""
    names = [axis.name for axis in spec.machine().actuated]
    held = [names[column] for column in spec.held() if names[column] not in spec.move.free]
    if held:
        template = "The move does not ask {axes} to move, so it is held; move.free = {free} lets it help."
        yield Phrase(template, axes=" or ".join(held), free=str(held).replace("'", '"'))


@attrs.frozen(kw_only=True)
class Reduced:
    """A machine without its held axes and resting coordinates."""

    plant: Plant
    moving: tuple[int, ...]  # numbers of its axes in the whole machine


def reduced(plant: Plant, held: Mapping[int, float], initial: Mapping[str, float]) -> Reduced:
    """Let some axes of a machine stand still.

    Parameters
    ----------
    plant : Plant
    held : mapping of int to float
        Where axes stand, by their number, in m (or rad).
    initial : mapping of str to float
        What swings at the start, as `Problem.initial`: it does not rest.

    Returns
    -------
    Reduced
        The whole machine where nothing would swing without the held axes: solvers need something that does.
    """
    swung = frozenset(name.removesuffix(RATE) for name, value in initial.items() if value != 0.0)
    return _reduced(plant, tuple(sorted(held.items())), swung)


@cache
def _reduced(plant: Plant, held: Places, swung: frozenset[str]) -> Reduced:
    whole = Reduced(plant=plant, moving=tuple(range(len(plant.actuated))))
    if not held:
        return whole
    resting = _at_rest(fixed := _fixed(plant, held), swung)
    if len(resting) == len(plant.unactuated):
        return whole
    numbers = dict(held)
    moving = tuple(axis for axis in whole.moving if axis not in numbers)
    return Reduced(plant=_without(fixed, resting), moving=moving)


def _fixed(plant: Plant, held: Places) -> Plant:
    """Write a machine's equations for the axes that are not held."""
    numbers, axes = dict(held), range(len(plant.actuated))
    moving = [axis for axis in axes if axis not in numbers]

    def whole(q_a: Vector, places: Mapping[int, float]) -> Vector:
        given = iter(q_a)
        return [places[axis] if axis in places else next(given) for axis in axes]

    still = dict.fromkeys(numbers, 0.0)

    def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
        terms = plant.equations(q_u, dq_u, whole(q_a, numbers), whole(dq_a, still), p)
        return attrs.evolve(terms, M_au=[terms.M_au[axis] for axis in moving])

    def outputs(q_u: Vector, q_a: Vector, p: SimpleNamespace) -> Outputs:
        return plant.outputs(q_u, whole(q_a, numbers), p)

    return attrs.evolve(
        plant,
        actuated=tuple(plant.actuated[axis] for axis in moving),
        equations=equations,
        outputs=outputs,
        bodies=(),
        mechanics=lambda q_u, q_a, p: Mechanics(mass=[], place=[]),  # motions are planned without
    )


def _at_rest(plant: Plant, swung: frozenset[str]) -> tuple[int, ...]:
    """Find the coordinates that rest whatever the axes and the other coordinates do."""
    d = dynamics(plant)
    resting = [k for k, coordinate in enumerate(plant.unactuated) if coordinate.name not in swung]
    while resting:
        still = sym.column([column[k] for column in (d.q_u, d.dq_u) for k in resting])
        pulled = {row for row, _ in sym.entries(sym.at_zero(d.ddq_u, still))}
        kept = [k for k in resting if k not in pulled]
        if kept == resting:
            break
        resting = kept
    return tuple(resting)


def _without(plant: Plant, resting: tuple[int, ...]) -> Plant:
    """Leave coordinates out that are always 0."""
    if not resting:
        return plant
    everything = range(len(plant.unactuated))
    kept = [k for k in everything if k not in resting]

    def whole(q_u: Vector) -> Vector:
        given = iter(q_u)
        return [0.0 if k in resting else next(given) for k in everything]

    def equations(q_u: Vector, dq_u: Vector, q_a: Vector, dq_a: Vector, p: SimpleNamespace) -> Equations:
        terms = plant.equations(whole(q_u), whole(dq_u), q_a, dq_a, p)
        return Equations(
            M_uu=[[terms.M_uu[row][column] for column in kept] for row in kept],
            M_au=[[row[column] for column in kept] for row in terms.M_au],
            K_u=[terms.K_u[row] for row in kept],
            G_u=[terms.G_u[row] for row in kept],
        )

    return attrs.evolve(
        plant,
        unactuated=tuple(plant.unactuated[k] for k in kept),
        equations=equations,
        outputs=lambda q_u, q_a, p: plant.outputs(whole(q_u), q_a, p),
    )
