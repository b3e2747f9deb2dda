"""One history in full: what was commanded and issued, and how loads of several machines sway."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

import attrs
import numpy as np

from gen_profile.motion.metrics import length
from gen_profile.motion.profile import Array
from gen_profile.progress import Progress, no_progress
from gen_profile.proof.closed_loop import ClosedLoop
from gen_profile.proof.histories import Histories, History
from gen_profile.spec.model import Spec

MOST_MACHINES = 4  # at corners of the uncertain ranges


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
    """

    history: History
    times: Array
    issued: Mapping[str, Array]
    sway: Mapping[str, Array]


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
            kept = loop.run(attrs.evolve(history, parameters=parameters), rows=cycles).trace
            assert kept is not None
            outputs = len(loop.outputs)
            sways[name] = length(kept[:, outputs:][:, end_load])[:, 0]
            if name == "this history":
                issued = dict(zip(loop.outputs, kept.T, strict=False))
        times = np.arange(cycles, dtype=np.float64) * loop.cycle
    return Trace(history=history, times=times, issued=issued, sway=sways)


def _errors(histories: Histories) -> list[dict[str, float]]:
    """None, and then corners of the uncertain ranges: the extreme ones, and some more."""
    ranges = histories.uncertain
    corners = [dict(zip(ranges, ends, strict=True)) for ends in product(*ranges.values())] if ranges else []
    return [{}, *(corners if len(corners) <= MOST_MACHINES else [corners[0], corners[-1]])]
