"""What histories have exercised of a block: which input changed, and which output came, in which state."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gen_profile.assurance.proof.followed import Followed
from gen_profile.assurance.proof.orders import DISABLED, POSITION, QUICK_STOP, STOP, VELOCITY, Flags
from gen_profile.motion.profile import Array

STANDING, POWERED_UP, ANYWHERE = "standing", "powered up", ""
STATES = {
    POWERED_UP: "at power-up",
    DISABLED: "without bEnable",
    STANDING: "standing",
    POSITION: "to a target",
    VELOCITY: "by a stick",
    STOP: "stopping",
    QUICK_STOP: "in a quick stop",
    ANYWHERE: "in any state",
}
GUIDED = (STANDING, POSITION, VELOCITY, STOP)  # in which any command may come
COMMANDS = ("bExecute", "bVelocity", "bStop", "fTarget", "fVelocityCommand", "rOverride", "fVelocityLimit")
NO_NUMBER, SPIKE, MILLIONTH = " that is no number", " for one cycle", " by a millionth"
EVENTS = (  # likewise, that no user need give, but some controller will
    *("bReset", "bQuickStop", "fCycleTime", "fCycleTime" + MILLIONTH),
    *("rOverride" + NO_NUMBER, "fVelocityLimit" + NO_NUMBER),
)
LOST = ("bEnable", "fFollowingLimit")  # after which nothing goes on as it was led to
LATER = (("bReset", DISABLED), ("bReset", QUICK_STOP), ("fCycleTime", DISABLED))
SELDOM = ("fActVelocity", "bLoadAtRest")  # in any state: one counts without bEnable alone, one as axes stand
RISES = ("bDone", "bBusy", "bInVelocity", "bCommandAborted", "bError", "bPromise")
CHANGES = ("nErrorId", "nPromise")
OFF = 2e-6  # of fCycleTime, that is a millionth

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
    states = _states(run)
    found = Counter((_plain(name), POWERED_UP) for name, value in zip(names, rows[0], strict=False) if value)
    lasts = np.diff([*starts, run.cycles])
    same = (rows[1:] == rows[:-1]) | (np.isnan(rows[1:]) & np.isnan(rows[:-1]))
    for row, column in np.argwhere(~same).tolist():
        if starts[row + 1] < run.cycles:
            state = states[starts[row + 1] - 1]
            for name in _kinds(_plain(names[column]), rows[row : row + 2, column], lasts[row + 1] == 1):
                found[name, state] += 1
    for name, flags in _came(run):
        for cycle in np.flatnonzero(flags).tolist():
            found[name, states[max(cycle - 1, 0)]] += 1
    return found


def _kinds(name: str, values: Array, is_spike: bool) -> Iterator[str]:
    """Name a change of an input, from a value to another, and what is rare in it."""
    before, now = values.tolist()
    millionth = name == "fCycleTime" and abs(now / before - 1.0) < OFF
    yield f"{name}{MILLIONTH}" if millionth else name
    if not isfinite(now):
        yield name + NO_NUMBER
    elif is_spike:
        yield name + SPIKE


def _states(run: Followed) -> NDArray[Any]:
    """Name the state of each cycle, (cycles,)."""
    kinds = run.by_order([order.kind for order in run.orders])
    return np.where(run.stands & (kinds != DISABLED), STANDING, kinds)


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


def required(
    live: Iterable[str], sensors: Sequence[str] = (), *, hoists: bool = False, prompts: bool = False
) -> list[tuple[str, str]]:
    """List the pairs of inputs, or outputs, and states that every proof must have tried.

    Parameters
    ----------
    live : iterable of str
        Names of the live parameters that change now and then.
    sensors : sequence of str
        What sensors must have met, by names of `sensor_met`. Histories with one have no events of `LOST`,
        and no axis that goes as it is taken over.
    hoists : bool
        Whether ropes change on the way: a block that calms by its model believes that the load hangs still.
    prompts : bool
        Whether stops may be prompt.
    """
    given, seldom = [f"f{name}" for name in live], SELDOM[bool(sensors) : len(SELDOM) - hoists]
    rare = (*EVENTS, *(name + how for name in given for how in (NO_NUMBER, SPIKE)))
    return [
        *((name, state) for name in (*COMMANDS, *rare) for state in GUIDED),
        *((name, state) for name in LOST for state in (() if sensors else GUIDED)),
        *((name, POWERED_UP) for name in ("bExecute", "bVelocity", "bStop", "bQuickStop", "bReset")),
        *LATER,
        *(("bPromptStop", state) for state in (POSITION, VELOCITY, STOP) if prompts),
        *((name, ANYWHERE) for name in (*seldom, *LOST, *given, *RISES, *sensors)),
    ]


def sensor_met(fault: str) -> str:
    """Name what a sensor meets in a history, which may be nothing."""
    return f"a sensor: {fault or 'sound'}"


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
