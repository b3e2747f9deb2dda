"""The account that follows a machine whose rope changes on the way, with a machine's constants put in."""

from itertools import product
from math import factorial

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.support.errors import ExportError
from gen_profile_exporters.block_source import initialiser
from gen_profile_exporters.planner.block import SLOTS_PER_PERIOD
from gen_profile_exporters.planner.blocks.texts import (
    SIDES,
    Sizes,
    constant_lines,
    filled,
    longest,
    operations,
    planner,
)
from gen_profile_exporters.planner.constants import PlannerConstants, SwayConstants
from gen_profile_exporters.playback.structured_text import literal

SHARE = 0.5  # of the allowed sway, that motions may leave by stated errors
FAST = 0.25  # of what a mode may leave, the next faster one may
ENDS = (-1.0, 1.0)  # shares of the errors, of the machines that programmes have rows of
BETWEEN = 14  # more that are weighed, where there are operations for them:
OF_CYCLE, OF_MODEL, OF_SLOT = 10, 4, 12  # parts of operations: to follow them, for a model, to foresee them
NO_LIVE = {"": (0.0, 1.0)}  # in the place of live parameters, where there are none
LEFT_OUT = 1e-7  # of a mode, by the series of a slot or a cycle


def motion(c: PlannerConstants) -> str:
    """Write a planner of one axis whose rope changes on the way, behind the blocks that it has within it."""
    return planner(_of_modes(c), Sizes(watched=ENDS), account_texts(c))


def _of_modes(c: PlannerConstants) -> PlannerConstants:
    """Give the constants that a planner of a rope that stays would have: all frequencies are wrong alike.

    Of sways by modes it asks the shares only, of what may be left.
    """
    constant = 1.0 * ~c.exponents.any(axis=0)
    errors = c.modes * [c.stated_error * constant]
    sways = [FAST ** (2 * mode) * constant for mode in range(c.modes)]
    model = np.vstack([c.model[: 2 * c.modes], *errors, *(len(c.axes) * sways)])
    return attrs.evolve(c, model=model, sway_share=SHARE * c.sway_limit)


def account_texts(c: PlannerConstants) -> str:
    """Write the block of the account, behind that of the machine that it has within it."""
    modes, machines, slots = c.modes, len(_stretches(c)), longest(c)
    rowed, swings, rows, plan = modes * (1 + len(ENDS)), modes * machines, 6 * modes + 1, 2 * slots + 4
    name = c.name.replace("-", "_")
    lengths = {
        "live": max(1, len(c.live)), "swing": swings, "mode": modes, "entry": rows * slots, "row": rows,
        "pair": rows // 2, "plan": plan, "power": max(1, len(c.live)) * _degrees(c), "matrix": modes**2,
        "turn": machines * modes**2, "push": 4 * swings, "state": 2 * swings, "sweep": 2 * modes * rowed,
        "sum": 2 * rowed, "model_row": len(_sway(c).coefficients), "step": max(3, 2 * modes),
        "machine": machines, "part": 6 * terms(c, _longest_slot(c)),
    }  # fmt: skip
    of_account = _of_account(c)
    shares = np.repeat([1.0] * (1 + len(ENDS)) + [1.0 / SHARE] * (machines - 1 - len(ENDS)), modes)
    values: dict[str, str | int] = {
        "account": f"{name}_account",
        "rope_model": f"{name}_rope_model",
        "is_modal": int(len(_sway(c).coefficients) > modes + modes**2),
        **{f"last_{array}": length - 1 for array, length in lengths.items()},
        "swings": swings,
        "rowed": rowed,
        "mode_count": modes,
        "slots": slots,
        "plan": plan,
        "polygon": literal(float(np.cos(np.pi / SIDES))),
        "bounds": initialiser([literal(float(v)) for v in np.tile(_bounds(c), machines) * shares]),
        "rope_constants": constant_lines(_of_rope(c)),
        "live_constants": constant_lines(of_account),
    }
    return "\n".join(filled(part, **values) for part in ("rope_model", "live_account"))


def _bounds(c: PlannerConstants) -> Array:
    """Divide what motions may leave, in m, among the modes, the slowest first."""
    parts = FAST ** np.arange(c.modes)
    return np.asarray(SHARE * c.sway_limit / len(c.axes) * parts / parts.sum())


def between(c: PlannerConstants) -> tuple[float, ...]:
    """Give machines between the ends of the errors, evenly beside that as given: shares of the errors."""
    if not c.stated_error:
        return ()
    room, cycles = operations(c) // len(c.axes), min(c.periods) / (SLOTS_PER_PERIOD * c.cycle)
    slot, cycle, run, follow = _machine_work(c)
    in_cycle, in_slot = follow, slot + longest(c) * run  # of each machine
    if c.rates:
        in_cycle, in_slot = follow + cycle, longest(c) * (slot + run)
    each = room / OF_CYCLE / in_cycle, room / OF_MODEL / slot, room * cycles / OF_SLOT / in_slot
    pairs = int(min(BETWEEN, *each)) // 2
    return tuple(np.delete(np.linspace(-1.0, 1.0, 2 * pairs + 3), [0, pairs + 1, -1]).tolist())


def _stretches(c: PlannerConstants) -> list[float]:
    """Give the frequencies of all machines, by those as given; ends of the errors stand before the others."""
    return [1.0, *(1.0 + c.stated_error * share for share in (*ENDS, *between(c)))]


def terms(c: PlannerConstants, time: float) -> int:
    """Find the terms of a time's series: what they leave out of a mode is less than `LEFT_OUT`."""
    sway, corners = _sway(c), product((-1.0, 1.0), repeat=len(c.live))
    signs = [np.prod(np.where(sway.exponents % 2, np.array(at)[:, None], 1.0), axis=0) for at in corners]
    squares = (sway.coefficients[: c.modes] @ np.array(signs).T).max(axis=1)
    angle = time * float(np.sqrt(squares[0 if c.modes == 2 else -1]))  # of two by their sum, which is more
    return next(k for k in range(2, 20) if angle ** (2 * k) / factorial(2 * k) < LEFT_OUT)


def _longest_slot(c: PlannerConstants) -> float:
    return max(c.periods) / SLOTS_PER_PERIOD


def _sway(c: PlannerConstants) -> SwayConstants:
    if c.sway is None:
        raise ExportError("The loads do not hang on ropes alone, so the block does not follow them.")
    return c.sway


def _degrees(c: PlannerConstants) -> int:
    return int(_sway(c).exponents.max(initial=0)) + 1


def _of_live(c: PlannerConstants) -> dict[str, object]:
    lives = c.live or NO_LIVE
    return {
        "cLives": len(c.live),
        "cLiveLow": [low for low, _ in lives.values()],
        "cLiveHigh": [high for _, high in lives.values()],
        "cStretch": _stretches(c),
    }


def _of_rope(c: PlannerConstants) -> dict[str, object]:
    """Give squared frequencies, then the matrix of the loads' sway, and what they are evaluated by."""
    sway = _sway(c)
    return {
        "cModes": c.modes,
        "cMachines": len(_stretches(c)),
        "cLongest": terms(c, _longest_slot(c)),
        **_of_live(c),
        "cDegrees": _degrees(c),
        "cTerms": sway.coefficients.shape[1],
        "cLiveBend": [float(v) for v in sway.curvatures] or [0.0],
        "cExponent": [int(v) for v in sway.exponents.ravel()] or len(sway.coefficients[0]) * [0],
        "cModel": [float(v) for v in sway.coefficients.ravel()],
    }


def _of_account(c: PlannerConstants) -> dict[str, object]:
    """Give rates and ranges, and the operations of a slot and a cycle, counted cautiously."""
    n, rows, machines = c.modes, c.modes + c.modes**2, len(_stretches(c))
    found, series = _sway(c).coefficients.shape[1], 2 * n**3 + n**2
    evaluated = found * (len(c.live) + 2 * rows) + len(c.live) * (20 + 4 * _degrees(c))
    modes = n * (n * n * n * (2 * n + 4) + 4 * n * n) + 20 * machines * n
    longest_series, short_series = terms(c, _longest_slot(c)), terms(c, c.cycle)
    slot, cycle, run, follow = _machine_work(c)
    model = evaluated + modes + longest_series * (series + 14) + machines * slot
    return {
        **_of_live(c),
        "cCycle": c.cycle,
        "cSlotsPerPeriod": SLOTS_PER_PERIOD,
        "cRate": [float(c.rates.get(name, 0.0)) for name in c.live or NO_LIVE],
        "cLowers": [float(c.rope_length_gain.get(name, 0.0)) for name in c.live or NO_LIVE],
        "cTerms": longest_series,
        "cCycleTerms": short_series,
        "cModesWork": evaluated + modes,
        "cModelWork": model,
        "cNowWork": evaluated + short_series * series + 14 * longest_series + machines * cycle,
        "cAheadWork": model if c.rates else 0,  # more for each slot ahead
        "cRunWork": 20 + machines * run,
        "cSweepWork": 20 + (1 + len(ENDS)) * 2 * n * (n * (8 * n + 8) + 8),
        "cFollowWork": machines * follow + 15 * len(c.live),
    }


def _machine_work(c: PlannerConstants) -> tuple[int, int, int, int]:
    """Count operations for a machine: models of a slot and of a cycle, foreseeing it and following it."""
    n, series = c.modes, (terms(c, _longest_slot(c)), terms(c, c.cycle))
    slot, cycle = (k * (5 * n**2 + 8 * n + 2) + 3 * n**3 for k in series)
    return slot, cycle, n * (8 + 8 * n), n * (16 + 10 * n)
