"""The account that follows a machine whose rope changes on the way, with a machine's constants put in."""

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile_exporters.block_source import initialiser
from gen_profile_exporters.planner.blocks.sizes import (
    ENDS,
    Sizes,
    account_work,
    between,
    degrees,
    longest,
    longest_slot,
    sway_of,
    terms,
)
from gen_profile_exporters.planner.blocks.texts import SIDES, constant_lines, filled, planner
from gen_profile_exporters.planner.constants import PlannerConstants
from gen_profile_exporters.planner.interface import SLOTS_PER_PERIOD
from gen_profile_exporters.playback.structured_text import literal

SHARE = 0.5  # of the allowed sway, that motions may leave by stated errors
FAST = 0.25  # of what a mode may leave, the next faster one may
NO_LIVE = {"": (0.0, 1.0)}  # in the place of live parameters, where there are none


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
        "pair": rows // 2, "plan": plan, "power": max(1, len(c.live)) * degrees(c), "matrix": modes**2,
        "turn": machines * modes**2, "push": 4 * swings, "state": 2 * swings, "sweep": 2 * modes * rowed,
        "sum": 2 * rowed, "model_row": len(sway_of(c).coefficients), "step": max(3, 2 * modes),
        "machine": machines, "part": 6 * terms(c, longest_slot(c)),
    }  # fmt: skip
    of_account = _of_account(c)
    shares = np.repeat([1.0] * (1 + len(ENDS)) + [1.0 / SHARE] * (machines - 1 - len(ENDS)), modes)
    values: dict[str, str | int] = {
        "account": f"{name}_account",
        "rope_model": f"{name}_rope_model",
        "is_modal": int(len(sway_of(c).coefficients) > modes + modes**2),
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


def _stretches(c: PlannerConstants) -> list[float]:
    """Give the frequencies of all machines, by those as given; ends of the errors stand before the others."""
    return [1.0, *(1.0 + c.stated_error * share for share in (*ENDS, *between(c)))]


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
    sway = sway_of(c)
    return {
        "cModes": c.modes,
        "cMachines": len(_stretches(c)),
        "cLongest": terms(c, longest_slot(c)),
        **_of_live(c),
        "cDegrees": degrees(c),
        "cTerms": sway.coefficients.shape[1],
        "cLiveBend": [float(v) for v in sway.curvatures] or [0.0],
        "cExponent": [int(v) for v in sway.exponents.ravel()] or len(sway.coefficients[0]) * [0],
        "cModel": [float(v) for v in sway.coefficients.ravel()],
    }


def _of_account(c: PlannerConstants) -> dict[str, object]:
    """Give rates and ranges, and the operations of a slot and a cycle, counted cautiously."""
    return {
        **_of_live(c),
        "cCycle": c.cycle,
        "cSlotsPerPeriod": SLOTS_PER_PERIOD,
        "cRate": [float(c.rates.get(name, 0.0)) for name in c.live or NO_LIVE],
        "cLowers": [float(c.rope_length_gain.get(name, 0.0)) for name in c.live or NO_LIVE],
        "cTerms": terms(c, longest_slot(c)),
        "cCycleTerms": terms(c, c.cycle),
        **account_work(c, len(_stretches(c))),
    }
