"""Approximate motions of all machines of some boxes, by integration of a few. Nothing here is rigorous."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gen_profile.certificate import chebyshev
from gen_profile.certificate.balls import Array
from gen_profile.certificate.boxes import DyadicBox
from gen_profile.certificate.theorem import Theorem
from gen_profile.evaluation.simulation import PlantSimulation
from gen_profile.problem.linearization import linear_terms, linearize

TIME_TERMS = 12
ACCURACY = 1e-9  # of the integration, relative
FINE = 2.0**-29  # of the greatest value of each coordinate: what coefficients are rounded to
NEGLIGIBLE = 1e-12


def approximate(theorem: Theorem, boxes: Sequence[DyadicBox]) -> Array:
    """Integrate machines at Chebyshev's nodes of some boxes; coefficients of `Approximation`."""
    spec, axes, ranges = theorem.spec, theorem.axes, theorem.ranges
    plant, profile = spec.machine(), axes.profile()
    d, terms = len(ranges.names), theorem.terms
    one = chebyshev.nodes(terms).mid
    grid = (
        np.stack([g.ravel() for g in np.meshgrid(*[one] * d, indexing="ij")], axis=1)
        if d
        else np.zeros((1, 0))
    )
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
    to_series = chebyshev.coefficients_of(TIME_TERMS).mid
    over_p = chebyshev.tensor(chebyshev.coefficients_of(terms), d).mid
    c = np.einsum("kg,bgptx,jt->bpxjk", over_p, x, to_series, optimize=True)
    return rounded(c)


def rounded(coefficients: Array) -> Array:
    """Round to whole multiples of a power of two for each coordinate, so that their sums are exact."""
    greatest = np.abs(coefficients).max(axis=(0, 1, 3, 4))
    quantum = 2.0 ** np.round(np.log2(np.maximum(greatest, NEGLIGIBLE) * FINE))
    return np.asarray(np.round(coefficients / quantum[:, None, None]) * quantum[:, None, None])


def scales(theorem: Theorem, boxes: Sequence[DyadicBox]) -> Array:
    """Scale errors by the modes at the middle of every box and piece (or one): S of `Approximation`."""
    spec, axes, ranges = theorem.spec, theorem.axes, theorem.ranges
    plant = spec.machine()
    middles = 0.5 * (axes.position[:-1] + axes.position[1:])
    machine = np.array([list(spec.plant.parameters.values())])
    still = [linear_terms(plant, machine, q_a)[0] for q_a in middles[:: max(1, len(middles) // 8)]]
    if all(np.array_equal(one, still[0]) for one in still):
        middles = middles[:1]  # modes do not depend on where the axes are
    d = len(ranges.names)
    ends = np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
    found = []
    for box in boxes:
        values = ranges.values(box, ends)
        machines = np.tile(list(spec.plant.parameters.values()), (len(values), 1))
        machines[:, [list(spec.plant.parameters).index(name) for name in ranges.names]] = values
        nominal = dict(zip(spec.plant.parameters, machines[0].tolist(), strict=True))

        def scale(q_a: Array, machines: Array = machines, nominal: dict[str, float] = nominal) -> Array:
            one = linearize(plant, nominal, q_a.tolist())
            stiffness = linear_terms(plant, machines, q_a)[0]
            modal = np.linalg.inv(one.modes) @ (stiffness[1:] - stiffness[0]) @ one.modes
            inverse = _balance(np.abs(modal).sum(axis=0))[:, None] * np.linalg.inv(one.modes)
            nothing = np.zeros_like(inverse)
            return np.block([[one.frequencies[:, None] * inverse, nothing], [nothing, inverse]])

        found.append([scale(q_a) for q_a in middles])
    return np.array(found)


def _balance(coupling: Array) -> Array:
    """Find factors of modes that make a coupling of them as symmetric as can be (E. E. Osborne, 1960)."""
    factors = np.ones(len(coupling))
    off = coupling * (1.0 - np.eye(len(coupling))) + NEGLIGIBLE
    for _ in range(20):
        for mode in range(len(off)):
            row, column = (
                (off[mode] / factors).sum() * factors[mode],
                (off[:, mode] * factors).sum() / factors[mode],
            )
            factors[mode] *= np.sqrt(column / row)
    return factors
