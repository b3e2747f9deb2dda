"""Watching a block in a history: what it is told, and what it would have done without each command."""

from __future__ import annotations

import re
from collections.abc import Sequence
from ctypes import CFUNCTYPE, POINTER, c_double, c_int, c_long, c_void_p

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.planner.design import target_range
from gen_profile.planner.execution import BlockInstance
from gen_profile.proof.histories import Histories, History
from gen_profile.proof.obedience import LEAST_REACTION, REACTION, Followed, faults
from gen_profile.proof.orders import QUICK_STOP, Ends, Order, orders, told_rows
from gen_profile.spec.model import Spec
from gen_profile_exporters.planner.block import RESERVE
from gen_profile_fmu.running.block_run import BlockRun, CalledBlock, Script

AT_ONCE = 64  # cycles between looks at whether a setpoint differs
WANDER = 2.0  # of the allowed sway, by which calming may lead away from a target

_STATED = re.compile(r"\bcReaction\s*:\s*LREAL\s*:=\s*([0-9.Ee+-]+)\s*;")
_PLAY = CFUNCTYPE(c_int, c_void_p, POINTER(c_double), c_long, POINTER(c_double))


@attrs.frozen(kw_only=True)
class Watch:
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
    stated : float or None
        s, in which the block says that it obeys.
    """

    histories: Histories
    inputs: Sequence[str]
    outputs: Sequence[str]
    cycle: float
    stated: float | None

    @classmethod
    def of(cls, text: str, block: BlockInstance, histories: Histories) -> Watch:
        """Look at a block's text."""
        stated = _STATED.search(text)
        return cls(
            histories=histories,
            inputs=list(block.inputs),
            outputs=block.outputs,
            cycle=block.inputs["fCycleTime"],
            stated=float(stated[1]) if stated else None,
        )

    @property
    def spec(self) -> Spec:
        """Of the machine."""
        return self.histories.spec

    @property
    def limits(self) -> tuple[Ends, ...]:
        """Of the block's axes."""
        found = []
        for number in self.histories.axes:
            own = self.spec.limits.of(number)
            assert own.velocity and own.acceleration and own.jerk
            found.append(
                Ends(
                    velocity=own.velocity,
                    acceleration=own.acceleration,
                    jerk=own.jerk,
                    targets=target_range(self.spec, number),
                )
            )
        return tuple(found)

    def orders(self, script: Script, last: int) -> tuple[Order, ...]:
        """Read what a script tells the block, up to a cycle."""
        live = [self.inputs.index(f"f{name}") for name in self.spec.planner.live]
        begins, rows = told_rows(script.begins, script.inputs, live)
        return orders(begins, rows, self.inputs, [*self.histories.axes.values()], self.limits, last)

    def marks(self, script: Script) -> list[int]:
        """Tell before which cycles the block is to be copied: those of orders that hold long enough."""
        period = self.histories.period
        least = self.reaction(period) / self.cycle
        found = self.orders(script, script.begins[-1] + script.longest)
        return [
            one.begin
            for one in found
            if 0 < one.begin == one.edge and one.end - one.begin > least and one.kind != QUICK_STOP
        ]

    def reaction(self, period: float) -> float:
        """Time in s within which a new command must be obeyed."""
        usual = LEAST_REACTION + REACTION * period
        return usual if self.stated is None else self.stated

    def faults(self, history: History, script: Script, marks: Sequence[int], block: CalledBlock, run: BlockRun) -> tuple[str, ...]:
        """Say what is wrong, each in words that end a sentence."""
        return tuple(faults(*self.followed(history, script, marks, block, run)))

    def followed(
        self, history: History, script: Script, marks: Sequence[int], block: CalledBlock, run: BlockRun
    ) -> tuple[Followed, dict[int, int | None]]:
        """Give what is to be judged."""
        assert run.trace is not None
        period = self.histories.slowest(history)
        reaction = self.reaction(self.histories.period)
        reserve = RESERVE if self.spec.planner.live_rate else 0.0
        followed = Followed(
            cycle=self.cycle,
            period=period,
            reaction=reaction,
            axes=[*self.histories.axes.values()],
            limits=self.limits,
            orders=self.orders(script, run.cycles),
            issued=dict(zip(self.outputs, run.trace.T, strict=False)),
            reserve=reserve,
            wander=WANDER * max(self.spec.check.residual_sway.values()) if reserve else 0.0,
        )
        if run.copies is None:
            return followed, {}
        ends = {order.begin: order.end for order in followed.orders}
        places = [self.outputs.index(name) for axis in block.axes for name in axis]
        reactions = {
            mark: _first_difference(block, memory, self._without(script, mark, ends[mark]), run.trace[mark:], places)
            for mark, memory in zip(marks, run.copies, strict=True)
            if mark in ends
        }
        return followed, reactions

    def _without(self, script: Script, begin: int, end: int) -> Array:
        """Inputs as if nothing but live parameters changed any more, (cycles, inputs)."""
        cycle = np.arange(begin - 1, end)
        rows = script.inputs[np.searchsorted(script.begins, cycle, side="right") - 1]
        given = rows[1:].copy()
        others = [k for k, name in enumerate(self.inputs) if name[1:] not in self.spec.planner.live]
        given[:, others] = rows[0, others]
        return given


def _first_difference(block: CalledBlock, memory: Array, rows: Array, issued: Array, places: Sequence[int]) -> int | None:
    """Call a copy of a block, and find the first cycle in which it issues other setpoints than it did."""
    play, outputs = _PLAY(block.play), np.empty((AT_ONCE, len(block.outputs)))
    for first in range(0, len(rows), AT_ONCE):
        part = rows[first : first + AT_ONCE]
        fault = play(memory.ctypes.data, part.ctypes.data_as(POINTER(c_double)), len(part), outputs.ctypes.data_as(POINTER(c_double)))
        if fault:
            return None
        differs = (outputs[: len(part), places] != issued[first : first + len(part), places]).any(axis=1)
        if differs.any():
            return first + int(np.argmax(differs))
    return None
