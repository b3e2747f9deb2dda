"""Watching a block in a history: what it is told, and what it would have done without each command."""

from __future__ import annotations

import re
from collections.abc import Sequence
from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_long, c_void_p
from typing import Any

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.planner.design import quick_limits, target_range
from gen_profile.planner.execution import BlockInstance
from gen_profile.proof.followed import LEAST_REACTION, REACTION, Followed
from gen_profile.proof.histories import Histories
from gen_profile.proof.obedience import faults
from gen_profile.proof.orders import QUICK_STOP, Ends, Inputs, TimedOrder, orders
from gen_profile.spec.model import Spec
from gen_profile_exporters.planner.block import RESERVE
from gen_profile_fmu.running.block_run import BlockRun, CalledBlock, Script

AT_ONCE = 64  # cycles between looks at whether a setpoint differs
WANDER = 2.0  # of the allowed sway, by which calming may lead away from a target

_STATED = re.compile(r"\bcReaction\s*:\s*LREAL\s*:=\s*([0-9.Ee+-]+)\s*;")
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
    told : Inputs
    reaction : float
        s, within which a new command must be obeyed.
    """

    histories: Histories
    inputs: Sequence[str]
    outputs: Sequence[str]
    cycle: float
    told: Inputs
    reaction: float

    @classmethod
    def of(cls, text: str, block: BlockInstance, histories: Histories) -> BlockWatch:
        """Look at a block's text."""
        stated, held = _STATED.search(text), _HELD.search(text)
        usual = LEAST_REACTION + REACTION * histories.period
        return cls(
            histories=histories,
            inputs=list(block.inputs),
            outputs=block.outputs,
            cycle=block.inputs["fCycleTime"],
            told=Inputs(
                names=list(block.inputs),
                axes=[*histories.axes.values()],
                limits=tuple(_ends(histories.spec, number) for number in histories.axes),
                live=histories.spec.planner.live,
                held=int(held[1]) if held else 0,
                cycle=block.inputs["fCycleTime"],
            ),
            reaction=float(stated[1]) if stated else usual,
        )

    @property
    def spec(self) -> Spec:
        """Of the machine."""
        return self.histories.spec

    def orders(self, script: Script) -> tuple[TimedOrder, ...]:
        """Read what a script tells the block."""
        begins, rows = self._changes(script)
        last = script.begins[-1] + script.longest + script.settle + script.watch
        return orders(begins, rows, self.told, last)

    def _changes(self, script: Script) -> tuple[list[int], Array]:
        """Leave out rows in which but live parameters change, within their ranges."""
        begins, rows = np.asarray(script.begins), script.inputs[:, : len(self.inputs)]
        kept = rows.copy()
        for name, (low, high) in self.told.live.items():
            live = kept[:, self.inputs.index(f"f{name}")]
            live[(live >= low) & (live <= high)] = low
        changed = np.flatnonzero(np.concatenate([[True], (kept[1:] != kept[:-1]).any(axis=1)]))
        return begins[changed].tolist(), kept[changed]

    def marks(self, told: Sequence[TimedOrder]) -> list[int]:
        """Tell before which cycles the block is to be copied: those of orders that hold long enough."""
        least = self.reaction / self.cycle
        return [
            one.begin
            for one in told
            if 0 < one.begin == one.edge and one.end - one.begin > least and one.kind != QUICK_STOP
        ]

    def faults(
        self, period: float, script: Script, told: Sequence[TimedOrder], block: CalledBlock, run: BlockRun
    ) -> tuple[str, ...]:
        """Say what is wrong, each in words that end a sentence.

        Parameters
        ----------
        period : float
            s, of the slowest swing that the block is told of.
        script : Script
            Of a history.
        told : sequence of TimedOrder
            Of that script.
        block : CalledBlock
        run : BlockRun
            With its trace, and copies of the block before `marks`.
        """
        return tuple(faults(*self.followed(period, script, told, block, run)))

    def followed(
        self, period: float, script: Script, told: Sequence[TimedOrder], block: CalledBlock, run: BlockRun
    ) -> tuple[Followed, dict[int, int | None]]:
        """Give what is to be judged."""
        assert run.trace is not None
        reserve = RESERVE if self.spec.planner.live_rate else 0.0
        followed = Followed(
            cycle=self.cycle,
            period=period,
            reaction=self.reaction,
            axes=[*self.histories.axes.values()],
            limits=self.told.limits,
            orders=[
                order if order.end <= run.cycles else attrs.evolve(order, end=run.cycles)
                for order in told
                if order.begin < run.cycles
            ],
            issued=dict(zip(self.outputs, run.trace.T, strict=False)),
            reserve=reserve,
            wander=WANDER * max(self.spec.check.residual_sway.values()) if reserve else 0.0,
            seen=self._seen(script, run.cycles),
        )
        if run.copies is None:
            return followed, {}
        ends = {order.begin: order.end for order in followed.orders}
        places = [self.outputs.index(name) for axis in block.axes for name in axis]
        reactions = {
            mark: self._first_difference(script, (mark, ends[mark]), block, memory, run.trace[:, places])
            for mark, memory in zip(self.marks(told), run.copies, strict=True)
            if mark in ends
        }
        return followed, reactions

    def _seen(self, script: Script, cycles: int) -> list[int]:
        """Tell when bLoadAtRest rises; blocks of earlier versions have none."""
        if "bLoadAtRest" not in self.inputs:
            return []
        given = script.inputs[:, self.inputs.index("bLoadAtRest")]
        rows = np.flatnonzero(np.diff(given, prepend=0.0) > 0.0).tolist()
        return [begin for row in rows if (begin := script.begins[row]) < cycles]

    def _first_difference(
        self, script: Script, cycles: tuple[int, int], block: CalledBlock, memory: Any, issued: Array
    ) -> int | None:
        """Call a copy of a block as if an order had not come, until it issues other setpoints than it did."""
        begin, end = cycles
        play, places = _PLAY(block.play), [self.outputs.index(name) for axis in block.axes for name in axis]
        live = [self.inputs.index(f"f{name}") for name in self.spec.planner.live]
        row, inputs = int(np.searchsorted(script.begins, begin - 1, side="right")) - 1, len(self.inputs)
        first, many = begin, AT_ONCE
        while first < end:
            part = np.arange(first, min(first + many, end))
            given = np.tile(script.inputs[row, :inputs], (len(part), 1))
            now = np.searchsorted(script.begins, part, side="right") - 1
            given[:, live] = script.inputs[now[:, None], live]
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
    assert own.velocity and own.acceleration and own.jerk
    return Ends(
        velocity=own.velocity,
        acceleration=own.acceleration,
        jerk=own.jerk,
        targets=target_range(spec, axis),
        quick=quick_limits(spec, axis),
    )


def _doubles(array: Array) -> Any:
    return array.ctypes.data_as(POINTER(c_double))
