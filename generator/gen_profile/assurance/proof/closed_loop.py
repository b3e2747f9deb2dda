"""Machines of a spec that follow a written planner block, many histories side by side, or one in full."""

import math
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from itertools import product
from queue import SimpleQueue
from typing import Self

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.assurance.proof.estimating import estimation_error
from gen_profile.assurance.proof.exercised import ANYWHERE, sensor_met
from gen_profile.assurance.proof.followed import GivenMachine
from gen_profile.assurance.proof.histories import SHIFT, SLOWEST, Histories, History
from gen_profile.assurance.proof.judging import WatchedRun, judge_run
from gen_profile.assurance.proof.left_swinging import GivenModes
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.assurance.proof.sensor_use import sensor_faults
from gen_profile.assurance.proof.verdict import JudgedHistory
from gen_profile.assurance.proof.watching import BlockWatch
from gen_profile.assurance.verification.time_scales import STEP_PHASE
from gen_profile.dynamics.evaluation.residual_sway import SHORTEST_WATCH, STANDSTILL
from gen_profile.dynamics.evaluation.simulation import AT_REST
from gen_profile.motion.metrics import length
from gen_profile.motion.profile import Array, SampledProfile
from gen_profile.planner.commands import input_rows
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.interface import UNPROVEN
from gen_profile.spec.model import Spec
from gen_profile.support.progress import Progress, no_progress
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.model.plant_variables import MAX_STEP, TAU
from gen_profile_fmu.running.block_run import BlockFollower, BlockRun, CalledBlock, Hoist, Script
from gen_profile_fmu.running.cosimulation import PlantCosimulation

WATCHED = 2.2  # of the slowest periods in which the residual sway shows
PATIENCE = 30.0  # of these periods that the axes have to come to rest, and the travel's time beside
NOISY_ON = 6.0  # of these periods after the last command, in which live parameters go on being noisy
TOLD = 50  # histories between two signs of life
LONGEST = 10**9  # cycles: longer than any history
MOST_MACHINES = 4  # at corners of the uncertain ranges
FAILED = 4.0  # of these periods, in which the axis may move as a sensor that failed shows
HOIST_STARTS = 0.1  # of these periods, in which a hoist takes up its speed


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

    Raises
    ------
    ExportError
        It is no planner block's text.
    CosimulationError
        Something cannot be compiled or loaded.
    """

    def __init__(self, spec: Spec, text: str, histories: Histories, *, workers: int = 1) -> None:
        self._spec, self._histories = spec, histories
        self._block = BlockInstance(text)
        self.cycle = self._block.inputs["fCycleTime"]
        self.max_step = STEP_PHASE / histories.fastest
        self._watch = BlockWatch.of(text, self._block, histories)
        self._workers = workers
        self._open = ExitStack()
        self._followers: SimpleQueue[BlockFollower] = SimpleQueue()
        self._machine = histories.machine
        self._estimation_error = (
            estimation_error(spec, text, histories.machines_of_errors) if spec.planner.sensor else 0.0
        )
        fmu = plant_fmu(self._machine)
        for _ in range(workers):
            self._followers.put(self._open.enter_context(BlockFollower(fmu)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    @property
    def outputs(self) -> list[str]:
        """Names of the block's outputs, which a trace begins with; the loads' sway follows."""
        return self._block.outputs

    @contextmanager
    def runs(self, histories: Iterable[History]) -> Iterator[Iterator[WatchedRun]]:
        """Run histories on all workers, in their order; those not begun when it closes are left out."""
        pool, listed = ThreadPoolExecutor(self._workers), list(histories)
        try:
            # linearised here, as that is not for several threads
            yield pool.map(self.watched, listed, [self.known(one) for one in listed])
        finally:
            pool.shutdown(cancel_futures=True)

    def judged(
        self, numbering: Numbering, numbers: Sequence[int], progress: Progress = no_progress
    ) -> list[JudgedHistory]:
        """Run and judge the histories of some numbers."""
        histories, judged = [numbering.history(number) for number in numbers], []
        with self.runs(histories) as runs:
            for number, history, watched in zip(numbers, histories, runs, strict=True):
                group = numbering.group(number)
                judged.append(
                    judge_run(self._spec, watched, history, cycle=self.cycle, number=number, group=group)
                )
                if number % TOLD == 0:
                    progress("proving", number, numbering.count)
        return judged

    def known(self, history: History) -> GivenMachine:
        """Tell what is known of the machine that the block is given."""
        spec = self._spec
        steady = not (history.hoisting or history.sensed or spec.planner.live_noise or spec.planner.live_rate)
        lasting = [one.inputs for one in history.changes if math.isinf(one.lasts)]
        live = {name: given[f"f{name}"] for given in lasting for name in history.live if f"f{name}" in given}
        return GivenMachine(
            tuple(self._histories.periods(history).tolist()),
            self._modes(history, history.live, history.commands[-1].time) if steady else None,
            self._modes(history, {**history.live, **live}) if steady and live else None,
        )

    def _modes(self, history: History, live: Mapping[str, float], seconds: float = 0.0) -> GivenModes:
        """Linearise the machine of some live parameters, those of stated errors, and the one that follows."""
        histories = self._histories
        following = [(self._parameters(history), history.places)] if live is history.live else []
        return GivenModes.of(
            self._spec.machine(),
            list(histories.axes),
            histories.machines_of_errors(live),
            following,
            seconds,
        )

    def watched(self, history: History, given: GivenMachine) -> WatchedRun:
        """Let the machine of a history follow the block, and see whether the block obeys.

        Parameters
        ----------
        history : History
        given : GivenMachine
            As `known` tells it.

        Raises
        ------
        ExportError, CosimulationError
        """
        script, block = self._script(history), self._block.called()
        if history.commands[-1].time >= SHIFT:  # too long to be kept whole
            return WatchedRun(run=self._followed(history, block, script, rows=0))
        orders = self._watch.orders(script)
        marks = self._watch.marks(orders) if history.sensed is None else ()
        run = self._followed(history, block, script, rows=orders[-1].end, marks=marks)
        if run.fault:
            return WatchedRun(run=run)
        judged = self._watch.judged(given, script, orders, block, run)
        faults = (*judged.faults, *self._sensor_faults(history, max(given.periods), run))
        tried = dict(judged.exercised)
        if history.sensed is not None:
            tried[sensor_met(history.sensed.fault), ANYWHERE] = 1
        bare, unproven = attrs.evolve(run, trace=None, copies=None), self._unproven(run)
        return attrs.evolve(judged, run=bare, faults=faults, unproven=unproven, exercised=tried)

    def _unproven(self, run: BlockRun) -> bool:
        """Tell whether a sensor has not shown a motion of its axis until the end."""
        names = [name for name in self.outputs if name.startswith("nSensorFault")]
        last = dict(zip(self.outputs, run.trace[-1], strict=False)) if run.trace is not None else {}
        return any(last.get(name) == UNPROVEN for name in names)

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
        script = self._script(history)
        return self._followed(history, self._block.called(), script, rows=rows, max_step=max_step)

    def _followed(
        self,
        history: History,
        block: CalledBlock,
        script: Script,
        *,
        rows: int,
        max_step: float | None = None,
        marks: Sequence[int] = (),
    ) -> BlockRun:
        follower = self._followers.get()
        try:
            return follower.run(
                block,
                script,
                self._values(history, max_step or self.max_step),
                led=tuple(self._histories.axes),
                hoists=self._hoists(history),
                rows=rows,
                marks=marks,
            )
        finally:
            self._followers.put(follower)

    def measured(self, history: History, run: BlockRun) -> Array:
        """Give what sensors told the block in each cycle of a run, (cycles, sensors), NaN for nothing."""
        found = self._script(history).measured
        if found is None:
            return np.full((run.cycles, 0), np.nan)
        gain, added, age, valid = np.moveaxis(found.cycles[: run.cycles], 2, 0)
        then = np.maximum(np.arange(run.cycles)[:, None] - age.astype(np.int64), 0)
        return np.where(valid != 0.0, gain * np.take_along_axis(run.shown, then, axis=0) + added, np.nan)

    def distance_from_fmpy(self, history: History, cycles: int) -> float:
        """Let FMPy's own importer co-simulate what the block issued in so many cycles.

        Returns
        -------
        float
            The greatest difference of a load's sway at any time in m.
        """
        traced = self.run(history, rows=cycles).trace
        assert traced is not None
        position = np.tile(self._places(history), (len(traced) + 1, 1))
        for number, axis in self._histories.axes.items():
            position[1:, number] = traced[:, self.outputs.index(axis.of("fPosition"))]
        if history.sensed:
            pushed = history.sensed.pushed(np.arange(1.0, len(position)) * self.cycle)
            position[1:, list(self._histories.axes)] += pushed
        script = self._script(history)
        given = _rows_at(script.start_cycles, script.inputs, np.arange(len(traced)))
        for hoist in self._hoists(history):
            position[1:, hoist.axis] = hoist.ratio * given[:, hoist.column]
        with PlantCosimulation(self._machine) as fmu:
            response = fmu.run(
                SampledProfile(cycle_time=self.cycle, position=position),
                self._parameters(history),
                tau=self._spec.actuator.tau or 0.0,
                max_step=self.max_step,
                settle=0.0,
                initial=history.sensed.starts if history.sensed else AT_REST,
                by_fmpy=True,
            )
        return float(np.abs(response.sway[1:] - traced[:, len(self.outputs) :]).max())

    def _script(self, history: History) -> Script:
        axes = self._histories.axes
        actual = [axis.of("fActPosition") for axis in axes.values()]
        values = self._block.inputs | {"bEnable": 1.0, **dict.fromkeys(actual, 0.0)}
        values |= {f"f{name}": value for name, value in history.live.items()}
        start_cycles, inputs = self._hoisted(
            history, *input_rows(history.commands, [*axes.values()], values, self.cycle)
        )
        start_cycles, inputs = self._changed(history, *self._noisy(start_cycles, inputs))
        start_cycles, inputs = self._until_calm(history, start_cycles, inputs)
        period = self._histories.period
        patience = PATIENCE * period + max(map(self._crossing, axes))
        watch = max(SHORTEST_WATCH, WATCHED * period)
        settle = STANDSTILL * (self._spec.actuator.tau or 0.0)
        longest, settled, watched = (math.ceil(time / self.cycle) for time in (patience, settle, watch))
        script = Script(
            cycle=self.cycle,
            start_cycles=start_cycles,
            inputs=inputs,
            actual=[list(values).index(name) for name in actual],
            longest=longest,
            settle=settled,
            watch=watched,
        )
        if history.sensed is None:
            return script
        found = history.sensed.measurement(self._spec, list(values), self.cycle, script.last + 1)
        return attrs.evolve(script, measured=found)

    def _until_calm(
        self, history: History, start_cycles: Sequence[int], inputs: Array
    ) -> tuple[Sequence[int], Array]:
        """Let the last row begin once what swings at first, or after a gust or a fault, was measured."""
        ends = 0
        if history.sensed:
            periods = FAILED if history.sensed.fault else 1.0
            ends = math.ceil((history.sensed.ends + periods * self._histories.period) / self.cycle)
        if ends <= start_cycles[-1]:
            return start_cycles, inputs
        return [*start_cycles, ends], np.vstack([inputs, inputs[-1]])

    def _sensor_faults(self, history: History, period: float, run: BlockRun) -> Iterator[str]:
        """Judge how the block used its sensor; after a quick stop more may swing than is stated."""
        if history.sensed is not None and not history.brakes:
            changed = [one.time + one.lasts for one in history.changes if math.isfinite(one.lasts)]
            last = max(history.commands[-1].time, *changed, 0.0)
            yield from sensor_faults(
                self._spec,
                history.sensed,
                run,
                self.outputs,
                cycle=self.cycle,
                period=period,
                last=last,
                estimation_error=self._estimation_error,
                resets=[one.time for one in history.changes if "bReset" in one.inputs],
            )

    def _crossing(self, axis: int) -> float:
        """Find the time in s that an axis needs from end to end by a history's slowest command, at most.

        The sum of what it would need within each of its limits alone.
        """
        limits = self._spec.limits.of(axis)
        assert limits.velocity and limits.acceleration and limits.jerk and limits.travel
        travel = limits.travel[1] - limits.travel[0]
        alone = (
            travel / (SLOWEST * limits.velocity),
            2.0 * math.sqrt(travel / limits.acceleration),
            math.cbrt(32.0 * travel / limits.jerk),
        )
        return sum(alone)

    def _hoisted(
        self, history: History, start_cycles: list[int], inputs: Array
    ) -> tuple[Sequence[int], Array]:
        """Give a row to every cycle in which live parameters change, and what they truly are at its end."""
        if not history.hoisting:
            return start_cycles, inputs
        starting = math.ceil(HOIST_STARTS * self._histories.period / self.cycle)
        end = max(corners[-1][0] for corners in history.hoisting.values())
        cycles = np.arange(max(start_cycles[-1], math.ceil(end / self.cycle) + starting) + 1)
        inputs = _rows_at(start_cycles, inputs, cycles)
        for name, corners in history.hoisting.items():
            low, high = self._spec.planner.live[name]
            line = np.interp(np.arange(1 - starting, len(cycles)) * self.cycle, *np.transpose(corners))
            rounded = np.convolve(line, np.full(starting, 1.0 / starting), mode="valid")
            inputs[:, list(self._block.inputs).index(f"f{name}")] = np.clip(rounded, low, high)
        true = [inputs[:, list(self._block.inputs).index(f"f{name}")] for name in history.hoisting]
        return range(len(cycles)), np.column_stack([inputs, *true])

    def _noisy(self, start_cycles: Sequence[int], inputs: Array) -> tuple[Sequence[int], Array]:
        """Let the given live parameters be off by their noise, another one in every cycle."""
        noise, random = self._spec.planner.live_noise, np.random.default_rng(0)
        if not noise:
            return start_cycles, inputs
        cycles = np.arange(start_cycles[-1] + math.ceil(NOISY_ON * self._histories.period / self.cycle))
        inputs = _rows_at(start_cycles, inputs, cycles)
        for name, most in noise.items():
            reported = inputs[:, list(self._block.inputs).index(f"f{name}")]
            reported[:] = np.clip(
                reported + random.uniform(-most, most, len(cycles)), *self._spec.planner.live[name]
            )
        return range(len(cycles)), inputs

    def _changed(
        self, history: History, start_cycles: Sequence[int], inputs: Array
    ) -> tuple[Sequence[int], Array]:
        """Let inputs differ for some time."""
        if not history.changes:
            return start_cycles, inputs
        spans = [
            (first, first + max(1, round(min(change.lasts / self.cycle, LONGEST))), change)
            for change in history.changes
            # only what is there from the start is there in the first cycle
            for first in [max(round(change.time / self.cycle), int(change.time > 0.0))]
        ]
        edges = {edge for begin, end, _ in spans for edge in (begin, end) if edge < LONGEST}
        edges.update(*(range(begin, end) for begin, end, change in spans if change.noise))
        cycles = sorted({*start_cycles, *edges})
        inputs = _rows_at(start_cycles, inputs, cycles)
        for begin, end, change in spans:
            within = slice(bisect_left(cycles, begin), bisect_left(cycles, end))
            for name, value in change.inputs.items():
                inputs[within, list(self._block.inputs).index(name)] = value
            for name, value in change.noise.items():
                random = np.random.default_rng([begin, *name.encode("ascii")])
                off = random.uniform(-value, value, end - begin)
                if name.startswith("fActPosition"):  # which is given relative to that of the cycle before
                    off = np.diff(off, prepend=0.0)
                inputs[within, list(self._block.inputs).index(name)] += off
        return cycles, inputs

    def _hoists(self, history: History) -> list[Hoist]:
        """Describe how axes follow the block's inputs."""
        axes, inputs = [axis.name for axis in self._machine.actuated], len(self._block.inputs)
        return [
            Hoist(
                axis=axes.index(name),
                column=inputs + place,
                ratio=history.parameters[name] / history.live[name] if name in history.parameters else 1.0,
            )
            for place, name in enumerate(history.hoisting)
        ]

    def _places(self, history: History) -> list[float]:
        return [*history.places, *(history.parameters[name] for name in self._histories.hoisted_names)]

    def _parameters(self, history: History) -> dict[str, float]:
        return {known.name: history.parameters[known.name] for known in self._machine.parameters}

    def _values(self, history: History, max_step: float) -> dict[str, float]:
        values = {**self._parameters(history), TAU: self._spec.actuator.tau or 0.0, MAX_STEP: max_step}
        for axis, place in zip(self._machine.actuated, self._places(history), strict=True):
            values |= {f"{axis.name}.start": place, f"{axis.name}.setpoint": place}
        return values | dict(history.sensed.starts if history.sensed else {})


def _rows_at(start_cycles: Sequence[int], inputs: Array, cycles: Sequence[int] | NDArray[np.int64]) -> Array:
    """Give the rows that hold in some cycles."""
    rows: Array = inputs[np.searchsorted(start_cycles, cycles, side="right") - 1]
    return rows


@attrs.frozen(kw_only=True, eq=False)
class Trace:
    """A history in full, one sample a cycle.

    Attributes
    ----------
    history : History
    times : (cycles,) array
        s.
    issued : mapping of str to (cycles,) array
        By names of the block's outputs.
    sway : mapping of str to (cycles,) array
        Of the end load in m (its magnitude where it has two directions), by machines: that of the history,
        the one that the block is given, and some at corners of the uncertain ranges.
    measured : (cycles, sensors) array
        What sensors told the block, not a number where nothing.
    """

    history: History
    times: Array
    issued: Mapping[str, Array]
    sway: Mapping[str, Array]
    measured: Array


def trace(
    spec: Spec, text: str, histories: Histories, history: History, progress: Progress = no_progress
) -> Trace:
    """Follow a history, and the same commands on other machines.

    Raises
    ------
    ExportError, CosimulationError
    """
    progress("following a history")
    end_load = spec.machine().end_load
    reported, *perturbed = [histories.perturbed(history, errors) for errors in _errors(histories)]
    machines = {"this history": history.parameters, "as given": reported}
    machines |= {f"perturbed {number}": machine for number, machine in enumerate(perturbed, start=1)}
    sways = {}
    with ClosedLoop(spec, text, histories) as loop:
        cycles = loop.run(history).cycles
        for name, parameters in machines.items():
            run = loop.run(attrs.evolve(history, parameters=parameters), rows=cycles)
            kept = run.trace
            assert kept is not None
            outputs = len(loop.outputs)
            sways[name] = length(kept[:, outputs:][:, end_load])[:, 0]
            if name == "this history":
                issued = dict(zip(loop.outputs, kept.T, strict=False))
                measured = loop.measured(history, run)
        times = np.arange(cycles, dtype=np.float64) * loop.cycle
    return Trace(history=history, times=times, issued=issued, sway=sways, measured=measured)


def _errors(histories: Histories) -> list[dict[str, float]]:
    """None, and then corners of the uncertain ranges: the extreme ones, and some more."""
    ranges = histories.uncertain
    corners = [dict(zip(ranges, ends, strict=True)) for ends in product(*ranges.values())] if ranges else []
    return [{}, *(corners if len(corners) <= MOST_MACHINES else [corners[0], corners[-1]])]
