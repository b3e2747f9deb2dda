"""Mesh refinement: bisect the intervals within which a limit begins or ceases to bind.

There the control bends or jumps, which no polynomial does; elsewhere, those of a usual interval are as good
as exact.
"""

from collections.abc import Container

import numpy as np
from numpy.typing import NDArray

from gen_profile.methods.solvers.collocation import GAUSS, STAGES
from gen_profile.methods.solvers.direct import goals
from gen_profile.methods.solvers.direct.bezier import CONTROL_DEGREE, Piece, halving
from gen_profile.methods.solvers.direct.set_up import Setup, on_mesh
from gen_profile.methods.solvers.direct.transcription import Iterate
from gen_profile.motion.profile import Array


def switching(
    setup: Setup,
    iterate: Iterate,
    on_the_way: tuple[float | None, float | None],
    widened: Container[str] = (),
    wider: float = 1.0,
) -> NDArray[np.bool_]:
    """Tell within which intervals some limit begins or ceases to bind, shape (intervals,).

    Parameters
    ----------
    setup : Setup
    iterate : Iterate
    on_the_way : (float or None, float or None)
        Of the sway at the collocation points, and of how far the load passes its targets there, in m.
    widened : container of str
        Places of limits that are so many times as wide, as `goals.keep_limits` widens them.
    wider : float
    """
    transcription = setup.transcription
    local = iterate.local.reshape(transcription.intervals, len(transcription.target), -1)
    taken, (sway_limit, overshoot_limit) = [], on_the_way
    for limit in goals.axis_limits(setup.problem, transcription):
        values = np.einsum("krs,ks->kr", limit.rows, local[:, limit.axis])
        give = limit.give * (wider - 1.0) if limit.place in widened else 0.0
        middle, half = (limit.high + limit.low) / 2.0, (limit.high - limit.low) / 2.0 + give
        taken += [(values - middle) / half, (middle - values) / half]
    if sway_limit is not None:
        sway = np.linalg.norm(transcription.end_sway_found(iterate), axis=1)
        give = wider if "limits.sway" in widened else 1.0
        taken.append(sway.reshape(transcription.intervals, STAGES) / (give * sway_limit))
    if overshoot_limit is not None:
        ways = np.abs([target.way for target in setup.problem.targets])[:, None]
        most = overshoot_limit + ways * (wider - 1.0 if "limits.overshoot" in widened else 0.0)
        farther = goals.passed(transcription, iterate, setup.problem) - most
        taken += [*(1.0 + farther / ways).reshape(len(ways), transcription.intervals, STAGES)]
    binds = [fractions > 1.0 - setup.options.reached for fractions in taken]
    return np.asarray(np.any([some.any(axis=1) & ~some.all(axis=1) for some in binds], axis=0))


def bisected(setup: Setup, iterate: Iterate, where: NDArray[np.bool_]) -> tuple[Setup, Iterate]:
    """Bisect some intervals, and write the same motion on the mesh that results."""
    piece, parts = setup.transcription.piece, np.where(where, 2, 1)
    maps = np.broadcast_to(_halves(piece), (len(where), 2, piece.size, piece.size))
    axes = iterate.local.reshape(len(where), -1, piece.size).swapaxes(1, 2)
    local = _divided(axes, maps, where).swapaxes(1, 2).reshape(parts.sum(), -1)
    stage_maps = np.broadcast_to(_STAGES_OF_HALVES, (len(where), 2, STAGES, STAGES))
    stages = tuple(_divided(values, stage_maps, where) for values in iterate.stages)
    return on_mesh(setup, np.repeat(piece.length / parts, parts)), Iterate(local=local, stages=stages)


def _divided(values: Array, maps: Array, where: NDArray[np.bool_]) -> Array:
    """Map an interval's (intervals, rows, …) values to its two halves, or keep them."""
    halves = np.einsum("khrs,ks...->khr...", maps, values)
    halves[~where, 0] = values[~where]
    return np.asarray(halves[np.stack([np.ones_like(where), where], axis=1)])


def _halves(piece: Piece) -> Array:
    """Map an interval's local coordinates to those of its halves, shape (intervals, 2, size, size)."""
    maps = np.zeros((len(piece.length), 2, piece.size, piece.size))
    for half in (0, 1):
        for order in range(piece.order):
            maps[:, half, order] = piece.at(order, np.array([half / 2.0]))[:, 0]
    maps[:, :, piece.order :, piece.order :] = halving(CONTROL_DEGREE)
    return maps


def _stages_of_halves() -> Array:
    """Map a polynomial's values at an interval's collocation points to those of its halves."""
    powers = np.arange(STAGES)
    halves = (GAUSS.c[:, None] + np.array([0.0, 1.0])[:, None, None]) / 2.0
    return np.asarray(halves**powers @ np.linalg.inv(GAUSS.c[:, None] ** powers))


_STAGES_OF_HALVES = _stages_of_halves()
