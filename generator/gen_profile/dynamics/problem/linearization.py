"""A plant's small oscillations about rest: q̈_u = −stiffness q_u − damping q̇_u + input q̈_a."""

from collections.abc import Mapping, Sequence
from functools import cache, lru_cache

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics, parameter_rows
from gen_profile.dynamics.problem.symbolic import Function
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant
from gen_profile.support.errors import InfeasibleProblem

SAME_FREQUENCY = 1e-6  # relative difference of natural frequencies that count as one


@attrs.frozen(kw_only=True, eq=False)
class Linearization:
    """The linear model at rest, in coordinates and in modes.

    Mode k is q_u = modes[:, k] z_k(t). Its equation is ``z̈ + 2 ζ ω ż + ω² z = (modes⁻¹ input q̈_a)_k``, and
    it shows in the sway of load l as ``(sway_gain modes)[l, k] z_k``.

    Attributes
    ----------
    stiffness, damping : (n_u, n_u) array
        Per unit of generalised mass, in 1/s² and 1/s; not symmetric in general.
    input : (n_u, m) array
        Unactuated acceleration per axis acceleration.
    sway_gain : (loads, n_u) array
        ∂sway/∂q_u.
    frequencies : (n_u,) array
        Undamped natural frequencies ω in rad/s, rising.
    damping_ratios : (n_u,) array
        ζ, from the diagonal of the damping matrix in modal coordinates: exact where damping does not couple
        the modes, and off by the square of the ratios otherwise.
    modes : (n_u, n_u) array
        One column per frequency, of unit length, its largest entry positive.
    """

    stiffness: Array
    damping: Array
    input: Array
    sway_gain: Array
    frequencies: Array
    damping_ratios: Array
    modes: Array

    @property
    def distinct_frequencies(self) -> Array:
        """Frequencies without repetition: a spherical pendulum has one, in two directions."""
        return np.asarray(self.frequencies[self._distinct()])

    @property
    def distinct_damping_ratios(self) -> Array:
        """Damping ratios that go with the distinct frequencies."""
        return np.asarray(self.damping_ratios[self._distinct()])

    def _distinct(self) -> NDArray[np.bool_]:
        apart = np.diff(self.frequencies) > SAME_FREQUENCY * self.frequencies[1:]
        return np.concatenate([[True], apart])


def linearize(
    plant: Plant, parameters: Mapping[str, float], q_a: Sequence[float] | None = None
) -> Linearization:
    """Linearise a plant of these parameters at rest, where q_u = 0 and the axes stand at q_a, 0 by default.

    Raises
    ------
    InfeasibleProblem
        A mode has no restoring force, so the machine has no natural frequency to speak of.
    """
    axes = [0.0] * len(plant.actuated) if q_a is None else q_a
    return _linearized(plant, tuple(parameters.items()), resting_place(plant, axes))


def eigenvalues(plant: Plant, machines: Array, q_a: Sequence[float] | Array) -> NDArray[np.complex128]:
    """Find the eigenvalues of many machines at rest in 1/s, shape (machines, 2 n_u).

    Parameters
    ----------
    plant : Plant
    machines : (machines, parameters) array
        In the order of `Plant.parameters`.
    q_a : (m,) sequence of float
        Where the axes stand.
    """
    return eigenvalues_at(plant, machines, [q_a])[0]


def eigenvalues_at(
    plant: Plant, machines: Array, places: Sequence[Sequence[float] | Array]
) -> list[NDArray[np.complex128]]:
    """Find the eigenvalues of many machines at rest at some places of the axes, each as `eigenvalues`."""
    resting = [resting_place(plant, q_a) for q_a in places]
    by_place = {place: _eigenvalues(*linear_terms(plant, machines, place)) for place in set(resting)}
    return [by_place[place] for place in resting]


def resting_place(plant: Plant, q_a: Sequence[float] | Array) -> tuple[float, ...]:
    """Tell where axes stand as far as it changes a plant at rest; other axes are always at the same place."""
    places = _terms(plant)[2]
    return tuple(float(at) if place is None else place for at, place in zip(q_a, places, strict=True))


def _eigenvalues(stiffness: Array, damping: Array) -> NDArray[np.complex128]:
    """Find the eigenvalues of machines from their linear terms; ±√−k of the stiffness without damping."""
    machines, n_u, _ = stiffness.shape
    if not damping.any():
        roots = np.sqrt(np.asarray(np.linalg.eigvals(-stiffness), dtype=np.complex128))
        return np.concatenate([roots, -roots], axis=1)
    state = np.zeros((machines, 2 * n_u, 2 * n_u))
    state[:, :n_u, n_u:] = np.eye(n_u)
    state[:, n_u:, :n_u], state[:, n_u:, n_u:] = -stiffness, -damping
    return np.asarray(np.linalg.eigvals(state), dtype=np.complex128)


def linear_terms(plant: Plant, machines: Array, q_a: Sequence[float] | Array) -> tuple[Array, Array]:
    """Find stiffness and damping of many machines at rest, each of shape (machines, n_u, n_u).

    Parameters
    ----------
    plant : Plant
    machines : (machines, parameters) array
        In the order of `Plant.parameters`.
    q_a : (m,) sequence of float
        Where the axes stand.
    """
    n_u = len(plant.unactuated)
    terms = -_terms(plant)[0](*_at_rest(plant, machines, q_a))
    return terms[:, :, :n_u], terms[:, :, n_u : 2 * n_u]


def _at_rest(plant: Plant, machines: Array, q_a: Sequence[float] | Array) -> tuple[Array, ...]:
    """List what `_terms` are functions of, for machines that hang still."""
    still_u, still_a = np.zeros((1, len(plant.unactuated))), np.zeros((1, len(plant.actuated)))
    return still_u, still_u, np.array([q_a], dtype=np.float64), still_a, machines


@lru_cache(maxsize=64)
def _linearized(
    plant: Plant, parameters: tuple[tuple[str, float], ...], q_a: tuple[float, ...]
) -> Linearization:
    n_u, rest = len(plant.unactuated), _at_rest(plant, parameter_rows(plant, [dict(parameters)]), q_a)
    motion_terms, sway_terms, _ = _terms(plant)
    free_q, free_dq, input_matrix = np.split(motion_terms(*rest)[0], [n_u, 2 * n_u], axis=1)
    frequencies, modes = _modes(plant, -free_q)
    modal_damping = np.linalg.solve(modes, -free_dq @ modes)
    return Linearization(
        stiffness=-free_q,
        damping=-free_dq,
        input=input_matrix,
        sway_gain=sway_terms(*rest)[0],
        frequencies=frequencies,
        damping_ratios=np.diag(modal_damping) / (2.0 * frequencies),
        modes=modes,
    )


@cache
def _terms(plant: Plant) -> tuple[Function, Function, list[float | None]]:
    """[∂free/∂q_u, ∂free/∂q̇_u, driven] and ∂sway/∂q_u as functions of state and parameters.

    Third, for every axis on whose place neither depends while the plant is at rest, one to let it stand at.
    """
    d = dynamics(plant)
    inputs = {"q_u": d.q_u, "dq_u": d.dq_u, "q_a": d.q_a, "dq_a": d.dq_a, "p": d.p}
    motion = sym.matrix([[sym.jacobian(d.drift, d.q_u), sym.jacobian(d.drift, d.dq_u), d.input_matrix]])
    sway = sym.jacobian(d.sway, d.q_u)
    moving = sym.column([d.q_u, d.dq_u, d.dq_a])
    at_rest = [sym.at_zero(terms, moving) for terms in (motion, sway)]
    depends = [any(sym.depends(terms, q) for terms in at_rest) for q in sym.split(d.q_a)]
    places = [None if matters else place for matters, place in zip(depends, plant.probe()[0], strict=True)]
    return Function("motion_terms", inputs, motion), Function("sway_terms", inputs, sway), places


def _modes(plant: Plant, stiffness: Array) -> tuple[Array, Array]:
    """Solve stiffness · mode = ω² · mode."""
    squares, vectors = np.linalg.eig(stiffness)
    # M⁻¹K of a conservative machine has real eigenvalues; a nearly double one may round to a complex pair
    order = np.argsort(squares.real)
    squares, vectors = squares.real[order], vectors.real[:, order]
    if not (squares > 0.0).all():
        raise InfeasibleProblem(
            f"The machine {plant.type!r} does not return to rest with these parameters, "
            "so it has no natural frequencies; check the signs of its parameters."
        )
    largest = vectors[np.abs(vectors).argmax(axis=0), range(len(squares))]
    return np.sqrt(squares), vectors * np.sign(largest) / np.linalg.norm(vectors, axis=0)
