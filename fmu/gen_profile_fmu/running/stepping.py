"""A plant FMU that is led on step by step, by a caller that does not know the next setpoint yet."""

from collections.abc import Mapping, Sequence

import numpy as np

from gen_profile.dynamics.evaluation.simulation import Response
from gen_profile.motion.profile import SampledProfile
from gen_profile.plants.plant import Plant
from gen_profile.support.progress import Progress, no_progress
from gen_profile_fmu.model.plant_variables import MAX_STEP, TAU
from gen_profile_fmu.running.cosimulation import PlantCosimulation, Steps


class SteppedPlant(PlantCosimulation):
    """A plant FMU in memory, run in steps; a context manager.

    Parameters
    ----------
    plant : Plant
    position : sequence of float
        Where the axes stand at first, in m (or rad); the loads hang at rest.
    parameters : mapping of str to float
        Value of every parameter of the plant.
    tau : float
        Lag of the drives in s; 0 for ideal ones.
    max_step : float
        Longest integration step in s.
    progress : callable
        Told of a compilation, which takes seconds.

    Raises
    ------
    CosimulationError
        When the FMU cannot be built, loaded or started.
    """

    def __init__(
        self,
        plant: Plant,
        position: Sequence[float],
        parameters: Mapping[str, float],
        *,
        tau: float,
        max_step: float,
        progress: Progress = no_progress,
    ) -> None:
        super().__init__(plant, progress)
        rest = SampledProfile(cycle_time=1.0, position=[position, position])
        self._begin(rest, parameters, {TAU: tau, MAX_STEP: max_step})
        self._time = 0.0

    def advance(self, position: Sequence[float], duration: float) -> Response:
        """Lead the axes evenly to a position, which ideal drives reach after `duration` s.

        Returns
        -------
        Response
            Before and after.

        Raises
        ------
        CosimulationError
            The FMU refuses the step.
        """
        end = self._time + duration
        step = Steps(
            times=np.array([self._time, end]),
            sizes=np.array([duration]),
            setpoints=np.array([position], dtype=np.float64),
        )
        response = Response(times=step.times, **self._observe(step))
        self._time = end
        return response
