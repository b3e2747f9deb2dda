"""How long, and how finely, the sway after a move is looked at."""

from collections.abc import Mapping

import numpy as np

from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.dynamics.evaluation.simulation import Response
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec

SHORTEST_WATCH = 4.0  # s; a residual is watched for this long, or for two of the slowest periods
STANDSTILL = 10.0  # time constants after which a lagging drive counts as standing: its speed is down to e⁻¹⁰
RESIDUAL_SAMPLES = 4001


def observation_time(spec: Spec) -> float:
    """Time in s in which every mode of every machine of a spec shows its greatest sway at the target."""
    plant, target = spec.machine(), spec.move.target
    slowest = min(linearize(plant, row.parameters, target).frequencies[0] for row in scenarios(spec))
    return max(SHORTEST_WATCH, 2.0 * 2.0 * np.pi / float(slowest))


def modal_amplitudes(plant: Plant, parameters: Mapping[str, float], at_rest: Response) -> Array:
    """Sum over the modes of what each adds to the sway of every load, in m, shape (loads,).

    Parameters
    ----------
    plant : Plant
    parameters : mapping of str to float
    at_rest : Response
        Of the machine from the standstill of its axes on.
    """
    linear = linearize(plant, parameters, at_rest.position[0])
    q_u, dq_u = at_rest.q_u[0], at_rest.dq_u[0]
    z, dz = np.linalg.solve(linear.modes, np.stack([q_u, dq_u], axis=1)).T
    amplitudes = np.hypot(z, dz / linear.frequencies)
    return np.asarray(np.abs(linear.sway_gain @ linear.modes) @ amplitudes)
