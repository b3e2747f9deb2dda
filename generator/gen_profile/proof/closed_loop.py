"""Machines of a spec that follow a written planner block, many histories side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from queue import SimpleQueue
from types import TracebackType
from typing import Self

import numpy as np

from gen_profile.evaluation.residual_sway import SHORTEST_WATCH, STANDSTILL
from gen_profile.motion.profile import SampledProfile
from gen_profile.planner.commands import input_rows
from gen_profile.planner.execution import BlockInstance
from gen_profile.proof.histories import Histories, History
from gen_profile.spec.model import Spec
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.model.plant_variables import MAX_STEP, TAU
from gen_profile_fmu.running.block_run import BlockFollower, BlockRun, Script
from gen_profile_fmu.running.cosimulation import PlantCosimulation

STEP_PHASE = 0.05  # rad of the fastest mode that an integration step may cover
WATCHED = 2.2  # of the slowest periods in which the residual sway shows
PATIENCE = 30.0  # of these periods that the axes have to come to rest, and the travel's time beside


class ClosedLoop:
    """A written block and the FMU of its machine, to be run as often as wanted; a context manager.

    Parameters
    ----------
    spec : Spec
        Whose limits of velocity and travel are stated.
    text : str
        The block.
    histories : Histories
        Of the spec.
    workers : int
        Instances of the FMU that share the runs: compiled code, they run side by side.
    on_build : callable, optional
        Called before the FMU is compiled, when it is not in the cache.

    Raises
    ------
    ExportError
        It is no planner block's text.
    CosimulationError
        Something cannot be compiled or loaded.
    """

    def __init__(
        self,
        spec: Spec,
        text: str,
        histories: Histories,
        *,
        workers: int = 1,
        on_build: Callable[[], None] | None = None,
    ) -> None:
        self._spec, self._histories = spec, histories
        self._block = BlockInstance(text)
        self.cycle = self._block.inputs["fCycleTime"]
        self.max_step = STEP_PHASE / histories.fastest
        self._workers = workers
        self._open = ExitStack()
        self._followers: SimpleQueue[BlockFollower] = SimpleQueue()
        fmu = plant_fmu(spec.machine(), on_build)
        for _ in range(workers):
            self._followers.put(self._open.enter_context(BlockFollower(fmu)))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()

    @property
    def outputs(self) -> list[str]:
        """Names of the block's outputs, which a trace begins with; the loads' sway follows."""
        return self._block.outputs

    @contextmanager
    def runs(self, histories: Iterable[History]) -> Iterator[Iterator[BlockRun]]:
        """Run histories on all workers, in their order; those not begun when it closes are left out."""
        pool = ThreadPoolExecutor(self._workers)
        try:
            yield pool.map(self.run, histories)
        finally:
            pool.shutdown(cancel_futures=True)

    def run(self, history: History, *, rows: int = 0, max_step: float | None = None) -> BlockRun:
        """Let the machine of a history follow the block.

        Parameters
        ----------
        history : History
        rows : int
            Cycles of which a trace is to be kept.
        max_step : float, optional
            Longest integration step in s, in place of the usual.

        Raises
        ------
        ExportError, CosimulationError
        """
        follower = self._followers.get()
        try:
            return follower.run(
                self._block.called(),
                self._script(history),
                self._values(history, max_step or self.max_step),
                led=(0,),
                rows=rows,
            )
        finally:
            self._followers.put(follower)

    def distance_from_fmpy(self, history: History, cycles: int) -> float:
        """Let FMPy's own importer co-simulate what the block issued in so many cycles.

        Returns
        -------
        float
            The greatest difference of a load's sway at any time in m.
        """
        traced = self.run(history, rows=cycles).trace
        assert traced is not None
        led = traced[:, self.outputs.index("fPosition")]
        position = np.tile(history.places, (len(traced) + 1, 1))
        position[1:, 0] = led
        with PlantCosimulation(self._spec.machine()) as fmu:
            response = fmu.run(
                SampledProfile(cycle_time=self.cycle, position=position),
                history.parameters,
                tau=self._spec.actuator.tau or 0.0,
                max_step=self.max_step,
                settle=0.0,
                by_fmpy=True,
            )
        return float(np.abs(response.sway[1:] - traced[:, len(self.outputs) :]).max())

    def _script(self, history: History) -> Script:
        values = self._block.inputs | {"bEnable": 1.0, "fActPosition": history.places[0]}
        values |= {f"f{name}": value for name, value in history.live.items()}
        begins, inputs = input_rows(history.commands, values, self.cycle)
        limits, period = self._spec.limits.of(0), self._histories.period
        assert limits.velocity and limits.travel
        patience = PATIENCE * period + (limits.travel[1] - limits.travel[0]) / limits.velocity
        watch = max(SHORTEST_WATCH, WATCHED * period)
        settle = STANDSTILL * (self._spec.actuator.tau or 0.0)
        longest, settled, watched = (math.ceil(time / self.cycle) for time in (patience, settle, watch))
        return Script(
            cycle=self.cycle,
            begins=begins,
            inputs=inputs,
            longest=longest,
            settle=settled,
            watch=watched,
        )

    def _values(self, history: History, max_step: float) -> dict[str, float]:
        values = {**history.parameters, TAU: self._spec.actuator.tau or 0.0, MAX_STEP: max_step}
        for axis, place in zip(self._spec.machine().actuated, history.places, strict=True):
            values |= {f"{axis.name}.start": place, f"{axis.name}.setpoint": place}
        return values
