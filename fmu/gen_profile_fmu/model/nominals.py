"""The size of a plant's states, by which integrators weigh their errors (FMI's `nominal`)."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from gen_profile.dynamics.evaluation.simulation import AT_REST, PlantSimulation
from gen_profile.motion.profile import Array, Profile
from gen_profile.plants.plant import Plant
from gen_profile_fmu.model.variables import variable_name

_SAMPLES = 401
_RESIDUAL_SHARE = 0.1  # of a peak on the way, as which what remains at the target counts
_LEAST_NOMINAL = 0.1  # share of the largest of its kind that a state has which the motion leaves alone
_ROUND = (1.0, 2.0, 5.0, 10.0)


def smooth_move(start: Sequence[float], target: Sequence[float], duration: float) -> Profile:
    """Move from rest to rest by the polynomial of fifth order, which needs no solver.

    Parameters
    ----------
    start, target : (axes,) sequences of float
        m (or rad).
    duration : float
        s.
    """
    shape = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) / duration ** np.arange(6)
    coefficients = shape[None, :, None] * (np.array(target) - np.array(start))
    coefficients[0, 0] = start
    return Profile(knots=[0.0, duration], coefficients=coefficients, target=target, method="smooth")


def state_nominals(
    plant: Plant, parameters: Mapping[str, float], motion: Profile, initial: Mapping[str, float] = AT_REST
) -> dict[str, float]:
    """Tell how large errors of every state are large, by its variable's name.

    Parameters
    ----------
    plant : Plant
    parameters : mapping of str to float
        Value of every parameter.
    motion : Profile
        Of the axes.
    initial : mapping of str to float, optional
        What swings at the start.

    Returns
    -------
    dict of str to float
        A tenth of the greatest magnitude while the axes move, in SI units, rounded up to 1, 2 or 5 times a
        power of ten.

    Raises
    ------
    CosimulationError
        The motion throws a load over.
    InfeasibleProblem
        Its integration would take too many steps.
    """
    times = np.linspace(0.0, motion.duration, _SAMPLES)
    (response,) = PlantSimulation(plant, motion, [parameters], motion.duration, initial).at(times)
    swinging, axes = [q.name for q in plant.unactuated], [axis.name for axis in plant.actuated]
    sizes = {
        **_sizes(swinging, response.q_u),
        **_sizes([f"{name}.rate" for name in swinging], response.dq_u),
        **_sizes([f"{name}.position" for name in axes], response.position),
        **_sizes([f"{name}.velocity" for name in axes], response.velocity),
    }
    return {variable_name(name): size for name, size in sizes.items()}


def _sizes(names: Sequence[str], columns: Array) -> dict[str, float]:
    peaks = _RESIDUAL_SHARE * np.abs(columns).max(axis=0)
    least = _LEAST_NOMINAL * float(peaks.max())
    return {name: rounded_up(max(float(peak), least)) for name, peak in zip(names, peaks, strict=True)}


def rounded_up(size: float) -> float:
    """Round to 1, 2 or 5 times a power of ten, so that all computers agree; 1 for nothing."""
    if size == 0.0:
        return 1.0
    power = math.floor(math.log10(size))
    factor = next(factor for factor in _ROUND if factor >= size / 10.0**power * (1.0 - 1e-6))
    return float(f"{factor:g}e{power}")
