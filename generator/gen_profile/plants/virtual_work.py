"""A machine's equations against its bodies, by d'Alembert's principle.

For every unactuated coordinate the bodies' inertia and the gradient of the potential must be balanced by what
damping does,

    Σ m r̈ · ∂r/∂q_i + ∂V/∂q_i = D_i,

where r̈ follows from the accelerations that the equations give. Damping opposes the rates: D_i turns with
them, and takes energy. Both are examined by differences at some states; no algebra is needed.
"""

from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Mechanics, Plant

NEARBY = 1e-6  # for first differences, in m or rad
APART = 1e-4  # for second ones
ROUGH = 1e-4  # of the terms' size: what differences may err by
STATES = 8
SWING, RATE, PUSH = 0.2, 0.5, 1.0  # greatest coordinates, rates and accelerations of these states


def equation_inconsistencies(plant: Plant) -> Iterator[str]:
    """Say, a clause each, where a machine's equations contradict its bodies; it must have bodies."""
    probe, p = plant.probe()
    n_u, m = len(plant.unactuated), len(plant.actuated)
    random = np.random.default_rng(1)
    wrong, gaining = False, False
    for _ in range(STATES):
        q = np.concatenate([random.uniform(-SWING, SWING, n_u), probe])
        dq, ddq_a = random.uniform(-RATE, RATE, n_u + m), random.uniform(-PUSH, PUSH, m)
        forwards, size = _imbalance(plant, p, q, dq, ddq_a)
        backwards, _ = _imbalance(plant, p, q, -dq, ddq_a)
        # equality: a coordinate that moves no body at all is wrong, too
        wrong |= bool((np.abs(forwards + backwards) >= ROUGH * size).any())
        dq[n_u:] = 0.0  # so that no axis does work
        damping, size = _imbalance(plant, p, q, dq, np.zeros(m))
        gaining |= bool(damping @ dq[:n_u] > ROUGH * (size @ np.abs(dq[:n_u])))
    if wrong:
        yield "its equations contradict its mechanics: masses, places and springs move otherwise"
    elif gaining:
        yield "its equations gain energy from nothing: the sign of a damping term is wrong"


def end_load_is_a_body(plant: Plant) -> bool:
    """Tell whether a body moves as the sway of the end load says, so that a force in N on it means something.

    To first order about rest, each of its sways must be how far one of the bodies goes in some horizontal
    direction. A liquid's surface rises as no mass moves.
    """
    (q_a, p), n_u = plant.probe(), len(plant.unactuated)

    def differences(values: Callable[[list[float]], Array]) -> Array:
        ways = [(values(step.tolist()), values((-step).tolist())) for step in NEARBY * np.eye(n_u)]
        return np.array([np.subtract(ahead, behind) / (2.0 * NEARBY) for ahead, behind in ways])

    sways = differences(lambda q: np.array(plant.outputs(q, q_a, p).sway, dtype=np.float64))[
        :, plant.end_load
    ]
    places = differences(lambda q: np.array(plant.mechanics(q, q_a, p).place, dtype=np.float64))

    def is_of(body: int, sway: Array) -> bool:
        along = places[:, body, :2]
        direction = np.linalg.lstsq(along, sway, rcond=ROUGH)[0]
        off = np.linalg.norm(along @ direction - sway)
        return bool(off <= ROUGH * np.linalg.norm(sway) and abs(np.linalg.norm(direction) - 1.0) <= ROUGH)

    return all(any(is_of(body, sway) for body in range(len(plant.bodies))) for sway in sways.T)


def _imbalance(plant: Plant, p: SimpleNamespace, q: Array, dq: Array, ddq_a: Array) -> tuple[Array, Array]:
    """Give the left side of the principle, and the size of its terms, for each unactuated coordinate."""
    n_u, n = len(plant.unactuated), len(q)
    state = (q[:n_u].tolist(), dq[:n_u].tolist(), q[n_u:].tolist(), dq[n_u:].tolist())
    terms = plant.equations(*state, p)
    forces = np.add(terms.K_u, terms.G_u) - np.transpose(terms.M_au) @ ddq_a
    ddq = np.concatenate([np.linalg.solve(np.array(terms.M_uu, dtype=np.float64), forces), ddq_a])

    def mechanics(at: Array) -> Mechanics:
        return plant.mechanics(at[:n_u].tolist(), at[n_u:].tolist(), p)

    def place(at: Array) -> Array:
        return np.array(mechanics(at).place, dtype=np.float64)

    def potential(at: Array) -> float:
        return float(mechanics(at).potential)

    nearby = NEARBY * np.eye(n)
    along = np.array([(place(q + step) - place(q - step)) / (2.0 * NEARBY) for step in nearby])
    pulls = [(potential(q + step) - potential(q - step)) / (2.0 * NEARBY) for step in nearby[:n_u]]
    bend = (place(q + APART * dq) - 2.0 * place(q) + place(q - APART * dq)) / APART**2
    mass = np.array(mechanics(q).mass, dtype=np.float64)
    inertia = mass[:, None] * (np.tensordot(ddq, along, 1) + bend)
    works = along[:n_u] * inertia
    return works.sum(axis=(1, 2)) + pulls, np.abs(works).sum(axis=(1, 2)) + np.abs(pulls)
