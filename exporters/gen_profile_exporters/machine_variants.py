"""Which variants of a motion a machine allows, axis by axis, decided from its equations.

With q̈_u = f(q_u, q̇_u, q_a, q̇_a, q̈_a), an axis may be

shifted    if neither f nor the sway depends on where it stands
mirrored   if besides signs σ exist for which the machine mirrored in that axis does the same:
           f(σ q_u, σ q̇_u, …, −q̇_a, −q̈_a) = σ f, and every sway changes at most its sign
scaled     if besides the load's small swing is linear in the axis's motion, whatever the other axes do: the
           force on a load at rest is linear in (q̇_a, q̈_a), f's derivatives by q_u and q̇_u do not depend on
           them, and no other axis pushes what this one moves, so that nothing is cancelled between axes

A hoist changes the rope and so allows nothing; nor does the radius of a tower crane. A load that swings at
the start allows shifts only. Equations are compared at a few fixed states, numerically, so any machine
will do.
"""

from collections.abc import Callable, Sequence
from itertools import product
from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec

STATES = 4
SWING = 0.1  # rad (or m), of the loads in these states
TOLERANCE = 1e-6  # relative
DIFFERENCE_STEP = 1e-5  # of differences
MOST_SIGNS = 8  # coordinates whose signs are tried one by one; of more, all together


@attrs.frozen(kw_only=True)
class AxisVariants:
    """Which variants of a motion the machine allows along an axis.

    Attributes
    ----------
    least_scale : float
        The distance may be multiplied by this, up to 1.
    mirror : bool
        It may be travelled the other way.
    shift : bool
        It may begin elsewhere.
    """

    least_scale: float = 1.0
    mirror: bool = False
    shift: bool = False


# Accelerations, then sways, of q_u, q̇_u, q_a, q̇_a, q̈_a; each has a row for every state.
States = list[Array]
Law = Callable[[Array, Array, Array, Array, Array], tuple[Array, Array]]


def machine_variants(spec: Spec) -> tuple[AxisVariants, ...]:
    """Decide for every axis of a spec's machine."""
    plant = spec.machine()
    law, states = _law(plant, spec), _states(plant, spec)
    variants = []
    for axis in range(len(plant.actuated)):
        shift = _shifts(law, states, axis)
        mirror = shift and not spec.move.initial and _mirrors(law, states, axis)
        scaled = mirror and _is_linear(law, states, axis)
        variants.append(AxisVariants(least_scale=0.0 if scaled else 1.0, mirror=mirror, shift=shift))
    return tuple(variants)


def _law(plant: Plant, spec: Spec) -> Law:
    p = SimpleNamespace(**spec.plant.parameters)

    def law(q_u: Array, dq_u: Array, q_a: Array, dq_a: Array, ddq_a: Array) -> tuple[Array, Array]:
        count, swing, at = len(q_u), list(q_u.T), list(q_a.T)
        terms = plant.equations(swing, list(dq_u.T), at, list(dq_a.T), p)
        input_force = _matrices(terms.M_au, count).swapaxes(1, 2) @ ddq_a[..., None]
        push = _matrices([terms.K_u, terms.G_u], count).sum(axis=1)[..., None] - input_force
        sway = _matrices([plant.outputs(swing, at, p).sway], count)[:, 0]
        return np.linalg.solve(_matrices(terms.M_uu, count), push)[..., 0], sway

    return law


def _matrices(rows: Sequence[Sequence[Any]], count: int) -> Array:
    """Stack matrices of so many states, whose entries are an array over the states or the same in all."""
    matrices = np.empty((count, len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            matrices[:, i, j] = entry
    return matrices


def _states(plant: Plant, spec: Spec) -> States:
    """List states on the way of the move, at which laws are compared; always the same ones."""
    random = np.random.default_rng(1)
    start, target = np.array(spec.move.start), np.array(spec.move.target)
    size = np.abs(target - start) + 0.1
    speed, push = size / spec.move.duration, size / spec.move.duration**2
    loads = len(plant.unactuated)
    states = [
        [
            *(SWING * random.uniform(-1.0, 1.0, (2, loads))),
            start + fraction * (target - start),
            speed * random.uniform(0.5, 1.0, len(size)),
            push * random.uniform(0.5, 1.0, len(size)),
        ]
        for fraction in np.linspace(0.1, 0.9, STATES)
    ]
    return [np.array(values) for values in zip(*states, strict=True)]


def _same(values: Sequence[Array], due: Sequence[Array]) -> bool:
    """Whether quantities are the same in every state, each in units of its greatest entry there."""
    return all(
        bool((_greatest(one - other) <= TOLERANCE * (_greatest(other) + TOLERANCE)).all())
        for one, other in zip(values, due, strict=True)
    )


def _greatest(values: Array) -> Array:
    """Greatest magnitude in every state."""
    return np.asarray(np.abs(values.reshape(len(values), -1)).max(axis=1))


def _changed(states: States, axis: int, *, by: float = 0.0, factor: float = 1.0) -> States:
    """Let an axis stand elsewhere, and move so many times as fast."""
    q_u, dq_u, q_a, dq_a, ddq_a = (values.copy() for values in states)
    q_a[:, axis] += by
    dq_a[:, axis] *= factor
    ddq_a[:, axis] *= factor
    return [q_u, dq_u, q_a, dq_a, ddq_a]


def _shifts(law: Law, states: States, axis: int) -> bool:
    due = law(*states)
    return all(_same(law(*_changed(states, axis, by=by)), due) for by in (0.05, 0.01))


def _mirrors(law: Law, states: States, axis: int) -> bool:
    loads = states[0].shape[1]
    signs = product((-1.0, 1.0), repeat=loads) if loads <= MOST_SIGNS else [(-1.0,) * loads]
    return any(_mirrored(law, states, axis, np.array(sign)) for sign in signs)


def _mirrored(law: Law, states: States, axis: int, sign: Array) -> bool:
    q_u, dq_u, *axes = _changed(states, axis, factor=-1.0)
    acceleration, sway = law(sign * q_u, sign * dq_u, *axes)
    due, sway_due = law(*states)
    return _same((sign * acceleration, np.abs(sway)), (due, np.abs(sway_due)))


def _is_linear(law: Law, states: States, axis: int) -> bool:
    rest = [np.zeros_like(states[0]), np.zeros_like(states[1]), *states[2:]]
    still = _changed(rest, axis, factor=0.0)
    others = law(*still)[0]
    whole = law(*rest)[0] - others
    coupling = _coupling(law, still)
    if not _same([_coupling(law, rest)], [coupling]):
        return False
    if not all(
        _same([law(*_changed(rest, axis, factor=k))[0] - others], [k * whole]) for k in (0.5, 0.25, -1.0)
    ):
        return False
    return not bool((_reached(whole, coupling) & _reached(others, coupling)).any())


def _coupling(law: Law, states: States) -> Array:
    """Differentiate the accelerations by q_u, then by q̇_u, one column each."""
    count, loads = states[0].shape
    ends = [np.tile(values, (4 * loads, 1)) for values in states]
    for column, (which, number, sign) in enumerate(product((0, 1), range(loads), (-1.0, 1.0))):
        ends[which][column * count : (column + 1) * count, number] += sign * DIFFERENCE_STEP
    below, above = law(*ends)[0].reshape(2 * loads, 2, count, loads).swapaxes(0, 1)
    return np.moveaxis((above - below) / (2.0 * DIFFERENCE_STEP), 0, -1)


def _reached(push: Array, coupling: Array) -> NDArray[np.bool_]:
    """Tell which coordinates a push moves, through their coupling too, in every state."""
    small = TOLERANCE * _greatest(coupling)[:, None, None]
    loads = push.shape[1]
    linked = (np.abs(coupling[:, :, :loads]) > small) | (np.abs(coupling[:, :, loads:]) > small)
    reached: NDArray[np.bool_] = np.abs(push) > TOLERANCE * (_greatest(push)[:, None] + TOLERANCE)
    for _ in range(loads):
        reached = reached | (linked @ reached[..., None])[..., 0]
    return reached
