"""Watching a block in a history: what it is commanded, and what it would have done without each command."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_long, c_void_p
from itertools import product
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.assurance.proof.exercised import exercised
from gen_profile.assurance.proof.followed import (
    CALMING,
    LEAST_REACTION,
    REACTION,
    UNKNOWN,
    Followed,
    GivenMachine,
    Zone,
    runs_of,
    standing,
)
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.judging import WatchedRun
from gen_profile.assurance.proof.obedience import faults, measured
from gen_profile.assurance.proof.orders import (
    DISABLED,
    QUICK_STOP,
    ZONES,
    Ends,
    Facts,
    Flags,
    Inputs,
    TimedOrder,
    read_orders,
)
from gen_profile.assurance.proof.promptness import obeyed
from gen_profile.assurance.proof.statements import ADDED_UP, LEFT, OVERSTATED
from gen_profile.motion.profile import Array
from gen_profile.planner.execution import BlockInstance
from gen_profile.planner.stated import LEAST_RATE, quick_limits, target_range
from gen_profile.spec.model import Spec
from gen_profile_fmu.running.block_run import BlockRun, CalledBlock, Script

LARGE_SWINGS = 0.1  # of the allowed sway, which the linear machine of a block does not know
MOST_COPIES = 32  # of the block in a history
AT_ONCE = 64  # cycles between looks at whether a setpoint differs
SURELY = 3  # times that the block needs to see a live parameter change
CLEARLY = 1.01  # of the change from which on it must be seen
RETOLD = 0.5  # of the change of a live parameter that counts, from which on plans are for another machine
MEDIAN = 3  # cycles, of which the median of a live parameter counts
WANDER = 2.0  # of the allowed sway, by which calming may lead away from a target

_STATED = re.compile(r"\bcReaction\s*:\s*LREAL\s*:=\s*([0-9.Ee+-]+)\s*;")
_GIVES_UP = re.compile(r"\bcGivesUp\s*:\s*LREAL\s*:=\s*([0-9.Ee+-]+)\s*;")
_HELD = re.compile(r"\bcHoldCycles\s*:\s*DINT\s*:=\s*(\d+)\s*;")
_PLAY = CFUNCTYPE(c_int, c_void_p, POINTER(c_double), c_long, POINTER(c_double))


@attrs.frozen(kw_only=True)
class BlockWatch:
    """What is known of a block and its machine.

    Attributes
    ----------
    histories : Histories
    inputs : sequence of str
        Names of the block's.
    outputs : sequence of str
        Likewise.
    cycle : float
        s.
    known : Inputs
    reaction : float
        s, within which a new command must be obeyed.
    """

    histories: Histories
    inputs: Sequence[str]
    outputs: Sequence[str]
    cycle: float
    known: Inputs
    reaction: float

    @classmethod
    def of(cls, text: str, block: BlockInstance, histories: Histories) -> BlockWatch:
        """Look at a block's text."""
        stated, held, gives_up = (known.search(text) for known in (_STATED, _HELD, _GIVES_UP))
        usual = LEAST_REACTION + REACTION * histories.period
        return cls(
            histories=histories,
            inputs=list(block.inputs),
            outputs=block.outputs,
            cycle=block.inputs["fCycleTime"],
            known=Inputs(
                names=list(block.inputs),
                axes=[*histories.axes.values()],
                limits=tuple(_ends(histories.spec, number) for number in histories.axes),
                live=histories.spec.planner.live,
                held=int(held[1]) if held else 0,
                cycle=block.inputs["fCycleTime"],
                **({"patience": int(float(gives_up[1]) / block.inputs["fCycleTime"])} if gives_up else {}),
            ),
            reaction=float(stated[1]) if stated else usual,
        )

    @property
    def spec(self) -> Spec:
        """Of the machine."""
        return self.histories.spec

    def orders(self, script: Script) -> tuple[TimedOrder, ...]:
        """Read what a script tells the block."""
        start_cycles, rows = self._changes(script)
        return read_orders(start_cycles, rows, self.known, script.last).orders

    def _changes(self, script: Script) -> tuple[list[int], Array]:
        """Leave out rows in which but live parameters change, within their ranges."""
        start_cycles, rows = np.asarray(script.start_cycles), script.inputs[:, : len(self.inputs)]
        kept = rows.copy()
        for name, (low, high) in self.known.live.items():
            live = kept[:, self.inputs.index(f"f{name}")]
            live[(live >= low) & (live <= high)] = low
        changed = np.flatnonzero(np.concatenate([[True], (kept[1:] != kept[:-1]).any(axis=1)]))
        return start_cycles[changed].tolist(), kept[changed]

    def marks(self, orders: Sequence[TimedOrder]) -> list[int]:
        """Tell before which cycles the block is to be copied: those of orders that hold long enough."""
        guided = [one for one in orders if one.kind not in (QUICK_STOP, DISABLED)]
        held = [one for one in guided if one.end - one.begin > self.reaction / self.cycle]
        return [one.begin for one in held if 0 < one.begin == one.edge][:MOST_COPIES]

    def judged(
        self,
        given: GivenMachine,
        script: Script,
        expected: Sequence[TimedOrder],
        block: CalledBlock,
        run: BlockRun,
    ) -> WatchedRun:
        """Hold what a block did in a run against what it was commanded.

        Parameters
        ----------
        given : GivenMachine
        script : Script
            Of a history.
        expected : sequence of TimedOrder
            Of that script, as its inputs alone tell.
        block : CalledBlock
        run : BlockRun
            With its trace, and copies of the block before `marks`.
        """
        followed, reactions = self.followed(given, script, expected, block, run)
        met = [*measured(followed, reactions)]
        left, overstated = (
            max((one.needed for one in met if one.what == what), default=0.0) for what in (LEFT, OVERSTATED)
        )
        wrong = (*faults(met, followed.cycle), *self._understated(run, followed))
        planner = self.spec.planner
        if planner.live_rate or planner.live_noise:  # live parameters change in every cycle
            tried = exercised(followed, *self._changes(script), self.inputs)
        else:
            rows = script.inputs[:, : len(self.inputs)]
            tried = exercised(followed, script.start_cycles, rows, self.inputs)
        return WatchedRun(
            run=run,
            faults=wrong,
            left=left,
            overstated=overstated,
            obeyed=obeyed(followed),
            exercised=tried,
            braked=bool(followed.brakings),
            hurried=followed.stopped_from < followed.cycles,
        )

    def _understated(self, run: BlockRun, followed: Followed) -> Iterator[str]:
        """Tell where more sways on than the block states that errors may leave."""
        states, left = followed.issued.get("fSwayLeft"), float(run.residual.max(initial=0.0))
        known = followed.issued["nPromise"][-1] in (0.0, ADDED_UP)
        known = known and not (followed.sensed("bSensorUsed").any() or followed.drifts.any())
        lost = followed.brakings or any(one.kind in (QUICK_STOP, DISABLED) for one in followed.orders)
        if states is None or not known or lost:
            return  # it is not known how the load swings
        stated = float(states[run.stands :].max(initial=0.0))  # a damped load's falls
        if left > stated + LARGE_SWINGS * followed.sway_limit:
            yield f"a load sways by {left:.3g} m, where fSwayLeft states {stated:.3g} m"

    def followed(
        self,
        given: GivenMachine,
        script: Script,
        expected: Sequence[TimedOrder],
        block: CalledBlock,
        run: BlockRun,
    ) -> tuple[Followed, dict[int, int | None]]:
        """Give what is to be judged."""
        assert run.trace is not None
        reserve = CALMING if self.spec.planner.live_rate else 0.0
        issued = dict(zip(self.outputs, run.trace.T, strict=False))
        start_cycles, rows = self._changes(script)
        now = np.searchsorted(script.start_cycles, np.arange(run.cycles), side="right") - 1
        inputs = dict(zip(self.inputs, script.inputs.T, strict=False))
        steps, speeds = (
            np.stack([inputs.get(axis.of(name), np.zeros(len(rows)))[now] for axis in self.known.axes])
            for name in ("fActPosition", "fActVelocity")
        )
        followed = Followed(
            cycle=self.cycle,
            **attrs.asdict(given, recurse=False),
            reaction=self.reaction,
            axes=self.known.axes,
            limits=self.known.limits,
            received=read_orders(start_cycles, rows, self.known, run.cycles, self._facts(issued)),
            issued=issued,
            prompt=inputs.get("bPromptStop", np.zeros(len(script.start_cycles)))[now] != 0.0,
            reserve=reserve,
            wander=WANDER * max(self.spec.check.residual_sway.values()) if reserve else 0.0,
            settle=self.spec.planner.disturbance.settle if self.spec.planner.disturbance else 0.0,
            sway_limit=min(self.spec.check.residual_sway.values()),
            share=self.spec.planner.sway_share * min(self.spec.check.residual_sway.values()),
            rest_reports=self._rest_reports(script, run.cycles),
            zones=list(self._zones(start_cycles, rows, run.cycles)),
            drifts=self._drifts(script, now, 1.0, self.known.held // 2),
            retold=self._drifts(script, now, RETOLD, 1),
            live_changes=list(self._live_changes(script, run.cycles)),
            last_known=self._last_known(script, expected),
            steps=steps,
            speeds=speeds,
        )
        return followed, self._reactions(followed, script, expected, block, run)

    def _reactions(
        self,
        followed: Followed,
        script: Script,
        expected: Sequence[TimedOrder],
        block: CalledBlock,
        run: BlockRun,
    ) -> dict[int, int | None]:
        """Tell how many cycles after orders a setpoint came that would not have come without them."""
        if run.copies is None or run.trace is None:
            return {}
        ends = {order.begin: order.end for order in followed.orders}
        places = [self.outputs.index(name) for axis in block.axes for name in axis]
        return {
            mark: self._first_difference(
                script, block, memory, run.trace[:, places], begin=mark, end=ends[mark]
            )
            for mark, memory in zip(self.marks(expected), run.copies, strict=True)
            if mark in ends
        }

    def _facts(self, issued: Mapping[str, Array]) -> Facts:
        position, velocity, acceleration, low, high = (
            np.stack([issued[axis.of(name)] for axis in self.known.axes])
            for name in ("fPosition", "fVelocity", "fAcceleration", "fStopLow", "fStopHigh")
        )
        return Facts(
            done=issued["bDone"] != 0.0,
            stands=standing(velocity, acceleration),
            errors=issued["nErrorId"],
            position=position,
            low=low,
            high=high,
            withdrawn=issued["nPromise"] == UNKNOWN,
        )

    def _zones(self, start_cycles: Sequence[int], rows: Array, cycles: int) -> Iterator[Zone]:
        """Find intervals that are blocked or slow for some time."""
        kinds = (("aBlockedLow", "aBlockedHigh", None), ("aSlowLow", "aSlowHigh", "aSlowLimit"))
        if "nZone" not in self.outputs:
            return
        for (k, axis), number, names in product(enumerate(self.known.axes), range(ZONES), kinds):
            columns = [rows[:, self.inputs.index(f"{axis.of(name)}[{number}]")] for name in names if name]
            values = np.stack([*columns, np.zeros(len(rows))][:3], axis=1)
            changes = [0, *(np.flatnonzero((values[1:] != values[:-1]).any(axis=1)) + 1).tolist()]
            for row, end in zip(changes, [*changes[1:], None], strict=True):
                low, high, limit = values[row].tolist()
                until = cycles if end is None else min(start_cycles[end], cycles)
                if low < high and start_cycles[row] < until:
                    yield Zone(
                        axis=k,
                        low=low,
                        high=high,
                        limit=limit,
                        begin=start_cycles[row],
                        end=until,
                        number=number + 1,
                    )

    def _drifts(self, script: Script, now: NDArray[np.int64], share: float, cycles: int) -> Flags:
        """Tell where a live parameter is other than at first, by a share of what counts, for longer.

        In place of one out of its range, the last good one counts.
        """
        drifts = np.zeros(len(now), dtype=bool)
        for name, (low, high) in self.known.live.items():
            if name in self.spec.planner.live_rate:
                continue
            value = script.inputs[:, self.inputs.index(f"f{name}")][now]
            good = (value >= low) & (value <= high)
            held = value[np.maximum.accumulate(np.where(good, np.arange(len(now)), 0))]
            apart = (np.abs(held - held[0]) > share * LEAST_RATE * high) & (held >= low) & (held <= high)
            apart[1:-1] |= apart[:-2] & apart[2:]  # of three in a row, the one between counts
            for begin, end in runs_of(apart):
                drifts[begin + cycles : end] |= end - begin > cycles
        return drifts

    def _last_known(self, script: Script, orders: Sequence[TimedOrder]) -> int:
        """Tell the cycle from which the block must know the last live parameters: at once with an order."""
        live = script.inputs[:, [self.inputs.index(f"f{name}") for name in self.known.live]]
        row = np.flatnonzero((live[1:] != live[:-1]).any(axis=1))[-1:] + 1
        begin = int(np.asarray(script.start_cycles)[row].sum())
        return begin + (MEDIAN if any(one.begin == begin for one in orders) else SURELY * self.known.held)

    def _live_changes(self, script: Script, cycles: int) -> Iterator[tuple[int, int]]:
        """Give cycles in which a live parameter changes, and from which that is certain."""
        first, sure = np.asarray(script.start_cycles), SURELY * self.known.held
        for name, (low, high) in self.known.live.items():
            if name in self.spec.planner.live_rate or name in self.spec.planner.live_noise:
                continue
            value = script.inputs[:, self.inputs.index(f"f{name}")]
            rows = (np.flatnonzero(value[1:] != value[:-1]) + 1).tolist()  # which may be infinite
            ends = [*first[rows[1:]].tolist(), cycles]
            for row, begin, end in zip(rows, first[rows].tolist(), ends, strict=False):
                good = low <= value[row] <= high and abs(value[row] - value[0]) > CLEARLY * LEAST_RATE * high
                if good and value[row - 1] == value[0] and begin + sure < min(end, cycles):
                    yield begin, begin + sure

    def _rest_reports(self, script: Script, cycles: int) -> list[int]:
        """Tell when bLoadAtRest rises."""
        given = script.inputs[:, self.inputs.index("bLoadAtRest")]
        rows = np.flatnonzero(np.diff(given, prepend=0.0) > 0.0).tolist()
        return [begin for row in rows if (begin := script.start_cycles[row]) < cycles]

    def _first_difference(
        self, script: Script, block: CalledBlock, memory: Any, issued: Array, *, begin: int, end: int
    ) -> int | None:
        """Call a copy of a block as if an order had not come, until it issues other setpoints than it did."""
        play, places = _PLAY(block.play), [self.outputs.index(name) for axis in block.axes for name in axis]
        live = [self.inputs.index(f"f{name}") for name in self.spec.planner.live]
        actual = list(script.actual)
        row, inputs = int(np.searchsorted(script.start_cycles, begin - 1, side="right")) - 1, len(self.inputs)
        first, many = begin, AT_ONCE
        while first < end:
            part = np.arange(first, min(first + many, end))
            given = np.tile(script.inputs[row, :inputs], (len(part), 1))
            now = np.searchsorted(script.start_cycles, part, side="right") - 1
            given[:, live] = script.inputs[now[:, None], live]
            given[:, actual] += issued[part - 1, ::3]
            outputs = np.empty((len(part), len(self.outputs)))
            if play(memory.ctypes.data, _doubles(given), len(part), _doubles(outputs)):
                return None
            differs = (outputs[:, places] != issued[part]).any(axis=1)
            if differs.any():
                return first - begin + int(np.argmax(differs))
            first, many = first + many, 2 * many
        return None


def _ends(spec: Spec, axis: int) -> Ends:
    own = spec.limits.of(axis)
    assert own.velocity and own.acceleration and own.jerk and own.travel
    targets = target_range(spec, axis)
    return Ends(
        velocity=own.velocity,
        acceleration=own.acceleration,
        jerk=own.jerk,
        targets=targets,
        margin=targets[0] - own.travel[0],
        quick=quick_limits(spec, axis),
    )


def _doubles(array: Array) -> Any:
    return array.ctypes.data_as(POINTER(c_double))
