"""How limits change with the motion: gradients of the programs against finite differences by Lagrange."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from generator.lagrangian_machines import Lagrange
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp

from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.collocation import GAUSS
from gen_profile.methods.solvers.direct.bezier import bernstein
from gen_profile.methods.solvers.direct.set_up import set_up
from gen_profile.methods.solvers.direct.transcription import Iterate
from gen_profile.plants.registry import find_plant

STEP = 1e-2
STENCIL = {-2: 1.0 / 12.0, -1: -2.0 / 3.0, 1: 2.0 / 3.0, 2: -1.0 / 12.0}
REST_TO_REST = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
BUMPS = Polynomial([0.0, 0.0, 0.0, 1.0, -3.0, 3.0, -1.0]), Polynomial([0.0, 0.0, 0.0, -0.5, 1.0, -0.5])


def task(type_):
    """Every axis from 1 to 1.4 in a period and a half, with nominal parameters and some damping."""
    plant = find_plant(type_)
    parameters = {q.name: q.nominal or 0.1 * plant.nominal().get("m", 1.0) for q in plant.parameters}
    if type_ == "slosh-tank":
        parameters["mu"] = 0.0  # its boundary layers are no part of Lagrange's equations
    axes = len(plant.actuated)
    period = 2.0 * np.pi / linearize(plant, parameters, [1.0] * axes).frequencies[0]
    return Problem(
        plant=plant,
        parameters=parameters,
        start=(1.0,) * axes,
        target=(1.4,) * axes,
        duration=float(1.5 * period),
        tau=None,
        desensitized=(),
        effort="jerk",
        sway_weight=0.0,
        sway_scale=1.0,
    )


def local_coordinates(transcription, paths):
    """Coordinates of paths, polynomials of dimensionless time, one per axis: (intervals, axes * size)."""
    piece, knots = transcription.piece, np.arange(transcription.intervals) / transcription.intervals
    inside = np.linspace(0.0, 1.0, piece.size - piece.order)
    control = np.linalg.inv(bernstein(len(inside) - 1, inside))
    blocks = []
    for path in paths:
        blocks += [path.deriv(order)(knots)[:, None] for order in range(piece.order)]
        blocks.append(path.deriv(piece.order)(knots[:, None] + piece.length[:, None] * inside) @ control.T)
    return np.concatenate(blocks, axis=1)


def through(maps, start, local):
    """States at the nodes."""
    nodes = [start]
    for transition, drive, offset, moved in zip(maps.transition, maps.drive, maps.offset, local, strict=True):
        nodes.append(transition @ nodes[-1] + drive @ moved + offset)
    return np.array(nodes)


def gradients(transcription, local, change):
    """Slopes of the sway at the collocation points and of the last states along a change of the motion."""
    machine = transcription.machines[0]
    iterate = attrs.evolve(transcription.rest(), local=local)
    for _ in range(8):  # Newton's method: the collocation equations of this motion
        (maps,) = transcription.maps(iterate)
        nodes = through(maps, machine.start, local)
        iterate = Iterate(local=local, stages=(maps.stages(nodes[:-1], local),))
    (maps,) = transcription.maps(iterate)
    moved = [np.zeros_like(machine.start)]
    for transition, drive, along in zip(maps.transition, maps.drive, change, strict=True):
        moved.append(transition @ moved[-1] + drive @ along)
    found, blocks, _ = transcription.end_sway(iterate, maps)
    along = np.concatenate([change.ravel(), np.ravel(moved)])[transcription.coupled]
    return np.einsum("kax,kx->ka", blocks, along).reshape(found.shape), moved[-1] * machine.scale


def lagranges(problem, type_, paths, times):
    """End load's sway at some times, and the states at the end, where the axes take these paths in metres."""
    lagrange, n, p = Lagrange(type_), len(problem.plant.unactuated), SimpleNamespace(**problem.parameters)
    T = problem.duration

    def axes(t, order):
        return np.array([path.deriv(order)(t / T) / T**order for path in paths])

    def rates(t, x):
        q, dq = np.r_[x[:n], axes(t, 0)], np.r_[x[n:], axes(t, 1)]
        return np.r_[x[n:], lagrange.accelerations(q, dq, axes(t, 2), problem.parameters)]

    swing = solve_ivp(
        rates, (0.0, T), np.zeros(2 * n), "DOP853", np.r_[times, T], rtol=1e-12, atol=1e-14, max_step=T / 20
    )
    loads = problem.plant.end_load
    sway = [
        np.ravel(problem.plant.outputs(x[:n], axes(t, 0), p).sway)[loads]
        for t, x in zip(times, swing.y.T[:-1], strict=True)
    ]
    return np.reshape(sway, (len(times), -1)), swing.y[:, -1]


@pytest.mark.slow
@pytest.mark.parametrize(
    "type_", ["double-pendulum-crane", "tower-crane", "mass-spring-chain-1", "slosh-tank"]
)  # several loads, several axes, one coordinate, and a machine that is no pendulum
def test_slopes_of_sway_and_residual(type_):
    problem = task(type_)
    setup, _ = set_up(problem)
    transcription, m = setup.transcription, len(problem.start)
    reach = np.array(problem.distance)
    bumps = [BUMPS[axis % 2] for axis in range(m)]
    local = local_coordinates(transcription, [REST_TO_REST] * m)
    sway, end = gradients(transcription, local, local_coordinates(transcription, bumps))

    grid = (
        (np.arange(transcription.intervals)[:, None] + GAUSS.c) * problem.duration / transcription.intervals
    )
    times = grid.ravel()
    expected_sway, expected_end = 0.0, 0.0
    for steps, weight in STENCIL.items():
        paths = [
            start + r * (REST_TO_REST + steps * STEP * bump)
            for start, r, bump in zip(problem.start, reach, bumps, strict=True)
        ]
        seen, states = lagranges(problem, type_, paths, times)
        expected_sway = expected_sway + weight * seen / STEP
        expected_end = expected_end + weight * states / STEP
    np.testing.assert_allclose(sway, expected_sway, atol=1e-6 * np.abs(expected_sway).max(), rtol=0.0)
    size = np.abs(expected_end).max()
    np.testing.assert_allclose(end, expected_end, atol=1e-6 * size, rtol=0.0)
