"""What swings when a move begins."""

from collections.abc import Mapping

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant

RATE = ".rate"


def state_names(plant: Plant) -> tuple[str, ...]:
    """Name q_u, then q̇_u, as specs and FMUs do: ``theta1`` and ``theta1.rate``."""
    names = tuple(coordinate.name for coordinate in plant.unactuated)
    return (*names, *(f"{name}{RATE}" for name in names))


def initial_state(plant: Plant, initial: Mapping[str, float]) -> Array:
    """Order initial values as q_u, then q̇_u, shape (2 n_u,); what is not named is at rest."""
    return np.array([initial.get(name, 0.0) for name in state_names(plant)])
