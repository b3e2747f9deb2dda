"""The machine that simulated drives move: its FMU, behind the drives' port `Load`."""

from collections.abc import Sequence
from contextlib import AbstractContextManager

import numpy as np

from gen_profile.assurance.verification.time_scales import max_step
from gen_profile.dynamics.evaluation.residual_sway import RESIDUAL_SAMPLES, STANDSTILL, observation_time
from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.dynamics.evaluation.simulation import Response
from gen_profile.motion.metrics import length, peak
from gen_profile.planner.directions import shown_by_sensors
from gen_profile.spec.model import Spec
from gen_profile.support.errors import CosimulationError
from gen_profile.support.progress import Progress, no_progress
from gen_profile_exporters.can.sensor_frame import frame_of
from gen_profile_fmu.running.stepping import SteppedPlant


class CraneLoad(AbstractContextManager["CraneLoad"]):
    """The nominal machine of a spec, at rest at the start of its move; a context manager.

    Parameters
    ----------
    spec : Spec
    progress : callable
        Told of a compilation, which takes seconds.

    Raises
    ------
    CosimulationError
    """

    def __init__(self, spec: Spec, progress: Progress = no_progress) -> None:
        if spec.move.initial:
            raise CosimulationError(
                "move.initial: the simulated crane would swing on while its drives start up, and it is not "
                "known how it swings when the motion begins; leave move.initial out."
            )
        machines = scenarios(spec)
        tau = spec.actuator.tau or 0.0
        self._settle, self._watch = STANDSTILL * tau, observation_time(spec)
        self._end_load = spec.machine().end_load
        self._position: Sequence[float] = spec.move.start
        self._spec = spec
        self._latest: Response | None = None
        self._fmu = SteppedPlant(
            spec.machine(),
            spec.move.start,
            machines[0].parameters,
            tau=tau,
            max_step=max_step(spec, machines[0]),
            progress=progress,
        )

    def __exit__(self, *_: object) -> None:
        self._fmu.close()

    def advance(self, position: Sequence[float], duration: float) -> Sequence[float]:
        """Lead every axis evenly to a position in m (or rad), and return where the axes then are."""
        self._position, self._latest = position, self._fmu.advance(position, duration)
        return [float(at) for at in self._latest.position[-1]]

    def sensor_frames(self) -> Sequence[tuple[int, bytes]]:
        """Give COB-IDs and data of what sensors of the load send now, if the spec states some on the bus."""
        frames, latest = self._spec.can.sensor, self._latest
        if frames is None or latest is None:
            return ()
        values = shown_by_sensors(self._spec, latest.q_u[-1], latest.dq_u[-1], latest.sway[-1])
        return (frame_of(values.tolist(), frames),)

    def residual_sway(self) -> float:
        """Hold the axes, and return the greatest sway of the end load in m from their standstill on."""
        if self._settle:
            self._fmu.advance(self._position, self._settle)
        step = self._watch / (RESIDUAL_SAMPLES - 1)
        responses = [self._fmu.advance(self._position, step) for _ in range(RESIDUAL_SAMPLES)]
        sway = [response.sway[-1, self._end_load] for response in responses]
        return float(peak(length(np.array(sway)))[0])
