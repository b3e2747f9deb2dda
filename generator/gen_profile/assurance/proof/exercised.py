"""What histories have exercised of a block: which input changed, and which output came, in which state."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from gen_profile.assurance.proof.followed import Followed
from gen_profile.assurance.proof.orders import DISABLED, POSITION, QUICK_STOP, STOP, VELOCITY, Flags
from gen_profile.motion.profile import Array

STANDING = "standing"
STATES = {
    DISABLED: "without bEnable",
    STANDING: "standing",
    POSITION: "to a target",
    VELOCITY: "by a stick",
    STOP: "stopping",
    QUICK_STOP: "in a quick stop",
}
GUIDED = (STANDING, POSITION, VELOCITY, STOP)  # in which any command may come
COMMANDS = ("bExecute", "bVelocity", "bStop", "fTarget", "fVelocityCommand", "rOverride", "fVelocityLimit")
SELDOM = ("bQuickStop", "bEnable", "bReset", "fFollowingLimit", "fCycleTime", "fActVelocity")  # in any state
RISES = ("bDone", "bBusy", "bInVelocity", "bCommandAborted", "bError", "bPromise")
CHANGES = ("nErrorId", "nPromise")

Pairs = Mapping[tuple[str, str], int]  # of an input or output and a state: how often


def exercised(
    run: Followed, starts: Sequence[int], rows: Array, names: Sequence[str]
) -> Counter[tuple[str, str]]:
    """Count in which states inputs changed, and outputs came.

    Parameters
    ----------
    run : Followed
    starts : (rows,) sequence of int
        Cycles from which on rows of inputs hold.
    rows : (rows, inputs) array
    names : sequence of str
        Of the inputs.
    """
    found, states = Counter[tuple[str, str]](), [*_states(run)]
    at = np.asarray(starts)
    same = (rows[1:] == rows[:-1]) | (np.isnan(rows[1:]) & np.isnan(rows[:-1]))
    for column, name in enumerate(names):
        for cycle in at[1:][~same[:, column]].tolist():
            if cycle < run.cycles:
                found[_plain(name), states[cycle - 1]] += 1
    for name, flags in _came(run):
        for cycle in np.flatnonzero(flags).tolist():
            found[name, states[max(cycle - 1, 0)]] += 1
    return found


def _states(run: Followed) -> Iterator[str]:
    """Name the state of each cycle, (cycles,)."""
    for order in run.orders:
        for stands in run.stands[order.begin : order.end].tolist():
            yield STANDING if stands and order.kind != DISABLED else order.kind


def _plain(name: str) -> str:
    """Name an input without its axis and place."""
    return re.sub(r"(_\w+|\[\d+\])+$", "", name)


def _came(run: Followed) -> Iterator[tuple[str, Flags]]:
    """Give outputs, and numbers of errors and reasons, with the cycles in which they came."""
    for name in RISES:
        yield name, np.diff(run.issued[name], prepend=0.0) > 0.0
    for name in CHANGES:
        values = run.issued[name]
        changed = np.diff(values, prepend=0.0) != 0.0
        for value in sorted({*values[changed].tolist()} - {0.0}):
            yield f"{name} {value:.0f}", changed & (values == value)


def required(live: Iterable[str]) -> list[tuple[str, str]]:
    """List the pairs of inputs, or outputs, and states that every proof must have tried; "" for any state.

    Parameters
    ----------
    live : iterable of str
        Names of the live parameters that change now and then.
    """
    anywhere = (*SELDOM, *(f"f{name}" for name in live), *RISES)
    return [*((name, state) for name in COMMANDS for state in GUIDED), *((name, "") for name in anywhere)]


def never(found: Pairs, pairs: Iterable[tuple[str, str]]) -> list[str]:
    """Name the pairs that never came."""
    inputs = {name for (name, _), times in found.items() if times}
    return [
        f"{name} {STATES[state]}" if state else name
        for name, state in pairs
        if not (found.get((name, state)) if state else name in inputs)
    ]


def table(found: Pairs) -> dict[str, dict[str, int]]:
    """Nest counts by input or output, then by state."""
    names = sorted({name for name, _ in found})
    return {name: {words: found.get((name, state), 0) for state, words in STATES.items()} for name in names}
