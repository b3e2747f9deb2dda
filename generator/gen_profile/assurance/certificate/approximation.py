"""Approximate motions of all machines of some boxes, by integration of a few. Nothing here is rigorous."""

from collections.abc import Sequence
from functools import cache
from itertools import product

import numpy as np

from gen_profile.assurance.certificate.arithmetic import chebyshev
from gen_profile.assurance.certificate.arithmetic.balls import Array
from gen_profile.assurance.certificate.boxes import DyadicBox
from gen_profile.assurance.certificate.theorem import Theorem
from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.dynamics.problem.linearization import linear_terms
from gen_profile.dynamics.problem.symbolic import Function
from gen_profile.plants.plant import Plant

TIME_TERMS = 10  # of a series over a piece of time, of `CertificateOptions.radians_per_piece`
ACCURACY = 1e-10  # of the integration, relative
FINE = 2.0**-36  # of the greatest value of each coordinate: what coefficients are rounded to
NOISE = 2.0**-34  # likewise, below which coefficients are left out
NEGLIGIBLE = 1e-12  # coefficient in m or rad, and relative eigenvalue, that stands in for 0


def approximate(theorem: Theorem, boxes: Sequence[DyadicBox]) -> Array:
    """Integrate machines at Chebyshev's nodes of some boxes; coefficients of `Approximation`."""
    spec, axes, ranges = theorem.spec, theorem.axes, theorem.ranges
    plant, profile = spec.machine(), axes.profile()
    grid = _grid(theorem.terms)
    places = np.concatenate([ranges.values(box, grid) for box in boxes])
    machines = [
        {**spec.plant.parameters, **dict(zip(ranges.names, row, strict=True))} for row in places.tolist()
    ]
    swing = PlantSimulation(
        plant, profile, machines, float(axes.knots[-1]), spec.move.initial, accuracy=ACCURACY
    )
    nodes = chebyshev.nodes(TIME_TERMS).mid[::-1]
    half = np.diff(axes.knots) / 2.0
    times = (axes.knots[:-1, None] + half[:, None] * (nodes + 1.0)).ravel()
    q_u, dq_u = swing.states(times)  # (machines, times, n_u)
    motion = profile(times)
    p = np.array([list(machine.values()) for machine in machines])
    lifted = np.stack(
        [
            rate
            - np.einsum("tij,tj->ti", theorem.equations.jump(q, motion.position, row[None]), motion.velocity)
            for q, rate, row in zip(q_u, dq_u, p, strict=True)
        ]
    )
    x = np.concatenate([q_u, lifted], axis=2)
    x = x.reshape(len(boxes), len(grid), len(half), TIME_TERMS, -1)[:, :, :, ::-1]
    values = x.transpose(0, 2, 4, 3, 1)
    values = values.reshape(*values.shape[:4], *theorem.terms)
    return rounded(chebyshev.interpolate(values, 1 + len(theorem.terms)).reshape(*values.shape[:4], -1))


def _grid(terms: Sequence[int]) -> Array:
    """List Chebyshev's nodes of all ranges, shape (places, ranges)."""
    return np.array(list(product(*(chebyshev.nodes(count).mid for count in terms))))


def rounded(coefficients: Array) -> Array:
    """Round to whole multiples of a power of two for each coordinate, so that their sums are exact.

    What is as small as the integration's errors is left out: it adds nothing but bytes.
    """
    greatest = np.abs(coefficients).max(axis=(0, 1, 3, 4))[:, None, None]
    quantum = 2.0 ** np.round(np.log2(np.maximum(greatest, NEGLIGIBLE) * FINE))
    kept = np.where(np.abs(coefficients) < NOISE * greatest, 0.0, coefficients)
    return np.asarray(np.round(kept / quantum) * quantum)


def scales(theorem: Theorem, boxes: Sequence[DyadicBox]) -> Array:
    """Scale errors by the energy of oscillations of every machine: coefficients of S of `Approximation`.

    |S e|² is twice the energy, e'K e + ė'M ė, so that errors of a machine that swings freely do not grow. For
    the middle of a box, coordinates are those of the modes. One piece stands for all where they are alike.
    """
    spec, axes, ranges = theorem.spec, theorem.axes, theorem.ranges
    plant, names = spec.machine(), list(spec.plant.parameters)
    grid = np.concatenate([np.zeros((1, len(ranges.names))), _grid(theorem.scale_terms)])
    machines = np.tile(list(spec.plant.parameters.values()), (len(boxes) * len(grid), 1))
    machines[:, [names.index(name) for name in ranges.names]] = np.concatenate(
        [ranges.values(box, grid) for box in boxes]
    )
    middles = 0.5 * (axes.position[:-1] + axes.position[1:])
    few = [_energies(plant, machines, q_a) for q_a in middles[:: max(1, len(middles) // 8)]]
    equal = all(np.allclose(one, few[0], rtol=1e-12, atol=0.0) for one in few)
    matrices = few[:1] if equal else [_energies(plant, machines, q_a) for q_a in middles]
    energies = np.stack(matrices, axis=1)  # (2, pieces, machines, n_u, n_u)
    energies = energies.reshape(2, len(matrices), len(boxes), len(grid), *energies.shape[3:]).swapaxes(1, 2)
    mass, stiffness = 0.5 * (energies + np.swapaxes(energies, -1, -2))
    root = _root(mass[:, -1:, :1], -0.5)  # at the end; S shall change little from piece to piece
    modes = root @ np.linalg.eigh(root @ stiffness[:, -1:, :1] @ root)[1]
    modal = (np.swapaxes(modes, -1, -2) @ one @ modes for one in (stiffness, mass))
    blocks = [_root(one, 0.5) @ np.linalg.inv(modes) for one in modal]
    whole = np.zeros((*mass.shape[:3], 2 * mass.shape[3], 2 * mass.shape[3]))
    n_u = mass.shape[3]
    whole[..., :n_u, :n_u], whole[..., n_u:, n_u:] = blocks
    values = np.moveaxis(whole[:, :, 1:], 2, -1)
    series = chebyshev.interpolate(values.reshape(*values.shape[:4], *theorem.scale_terms), len(ranges.names))
    quantum = 2.0 ** np.round(np.log2(np.abs(series).max() * FINE))  # digits beyond need not be stored
    return np.asarray(np.round(series / quantum) * quantum).reshape(*values.shape[:4], -1)


def _energies(plant: Plant, machines: Array, q_a: Array) -> Array:
    """Find matrices of inertia and stiffness at rest, (2, machines, n_u, n_u), that are symmetric."""
    stiffness, inertia = linear_terms(plant, machines, q_a)[0], _inertia(plant)
    if inertia is None:  # any energy will do that the machine keeps: that of its modes
        back = np.linalg.inv(np.linalg.eig(stiffness)[1]).real
        mass = np.swapaxes(back, -1, -2) @ back
    else:
        mass = inertia(np.array([q_a]), machines)
    return np.stack([mass, mass @ stiffness])


@cache
def _inertia(plant: Plant) -> Function | None:
    """Second derivative of the energy by the rates at rest, where the plant tells of its bodies."""
    d = dynamics(plant)
    if not plant.bodies:
        return None
    inertia = sym.jacobian(sym.jacobian(d.energy, d.dq_u).T, d.dq_u)
    still = sym.at_zero(inertia, sym.column([d.q_u, d.dq_u, d.dq_a]))
    return Function("inertia", {"q_a": d.q_a, "p": d.p}, still)


def _root(matrices: Array, power: float) -> Array:
    """Take a power of symmetric matrices."""
    values, vectors = np.linalg.eigh(matrices)
    values = np.maximum(values, NEGLIGIBLE * np.abs(values).max(axis=-1, keepdims=True))
    return np.asarray((vectors * values[..., None, :] ** power) @ np.swapaxes(vectors, -1, -2))
