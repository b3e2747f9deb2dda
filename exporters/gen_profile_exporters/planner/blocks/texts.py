"""The texts of the blocks, with a machine's constants and the sizes of arrays put in."""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile_exporters.block_source import initialiser
from gen_profile_exporters.planner.blocks.sizes import Sizes, longest, model_work, operations
from gen_profile_exporters.planner.constants import PlannerConstants
from gen_profile_exporters.planner.interface import SLOTS_PER_PERIOD, WHERE
from gen_profile_exporters.playback.structured_text import literal

FOLDER = Path(__file__).parent
# beyond a target, that is damped on the way, or that others take longer to
ROOM = "fAim := table.fAim, fRoom := {}, fSpanLow := fSpanLow, fSpanHigh := fSpanHigh,"
# of several axes
SEVERAL = {
    "held": "AND NOT (bHeld AND (nTick < account.nSlot))",
    "others": "nOthers := nOthers,",
    "kept": "AND (nLength > nOthers)",
}
SIDES = 12  # of a polygon, whose normals have the cosines
QUARTER = [1.0, 0.8660254037844387, 0.5]
COSINES = [
    *QUARTER,
    0.0,
    *(-c for c in reversed(QUARTER)),
    *(-c for c in QUARTER[1:]),
    0.0,
    *reversed(QUARTER[1:]),
]
STOP_SHARE = 0.8  # of the sway that is allowed, that a stop may leave
BETWEEN = 1.15  # times that, on any machine that is watched
LITTLE = 30  # slots in which little is left of what was measured, until it is no more damped
APART = 1.5  # rad
FADED = 1.386  # exponent by which a swing decays to a quarter
FOREVER = 1e9  # s
LEAST_SHARE = 0.02  # of the allowed sway, that rounding may leave where no errors are stated


def linear_programme(name: str, *, slots: int, rows: int) -> str:
    """Write the block of linear programmes, behind the blocks that it has within it.

    Parameters
    ----------
    name : str
        Of the block.
    slots, rows : int
        That a programme has at most; two rows of each pair.
    """
    lengths = {
        "slot": slots,
        "entry": rows * slots,
        "row": rows,
        "pair": max(1, rows // 2),
        "bound": 4 * (slots + 2),
        "side": SIDES * max(1, rows // 2),
        "schur": rows * rows,
        "band": 4 * (slots + 2),
        "wide": slots + 2,
    }
    values: dict[str, str | int] = {
        "linear_programme": name,
        "equations": f"{name}_equations",
        "polygon_weight": f"{name}_polygon_weight",
        "sides_constants": constant_lines(
            {"cSides": SIDES, "cCosine": COSINES, "cSine": [*COSINES[-SIDES // 4 :], *COSINES[: -SIDES // 4]]}
        ),
        **{f"last_{array}": length - 1 for array, length in lengths.items()},
    }
    return "\n".join(
        filled(part, slots=slots, wide=slots + 2, rows=rows, **values)
        for part in ("equations", "polygon_weight", "linear_programme")
    )


def planner(constants: PlannerConstants, sizes: Sizes, account: str | None = None) -> str:
    """Write a planner of one axis, behind the blocks that it has within it.

    Its account may be another one: the text of that and all that it has within it.
    """
    watched = sizes.of(constants)
    modes, swings = constants.modes, constants.modes * (1 + len(watched))
    name = constants.name.replace("-", "_")
    damping = ("damping",) if constants.sensor else ()
    parts = (
        *("linear_programme", "account", "modes", "motion_bounds", "decisions", "setpoints"),
        *(*damping, "planner"),
    )
    names = {part: f"{name}_{part}" for part in parts}
    shown = [*range(2 * modes), *range(swings - modes, swings)]  # as given, and both ends of the errors
    rows, slots = 2 * len(shown) + 1, longest(constants)  # those of the swings, and a target's way
    plan = 2 * slots + 4  # a ramp, two slots of its speed, and a decline
    lengths = {
        "live": max(1, len(constants.live)), "swing": swings, "rowed": len(shown), "slot": slots,
        "entry": rows * slots, "row": rows, "pair": max(1, rows // 2), "mode": modes,
        "power": max(1, len(constants.live)) * constants.degrees, "model": len(constants.model),
        "future": plan + 4, "plan": plan,
    }  # fmt: skip
    values = {
        **names,
        **{f"last_{array}": length - 1 for array, length in lengths.items()},
        "swings": swings,
        "mode_count": modes,
        "rowed": len(shown),
        "shown": initialiser([str(v) for v in shown]),
        "slots": slots,
        "tilt": literal(constants.tilt),
        "polygon": literal(float(np.cos(np.pi / SIDES))),
        "bounds": initialiser([literal(float(v)) for v in _share(constants) * _shares(constants)]),
        "allowed": literal(constants.sway_limit / (len(constants.axes) * _share(constants))),
        "most": literal(BETWEEN * _stop_share(constants) * _share(constants)),
        "model_work": model_work(constants),
        "modes_constants": constant_lines(_of_modes(constants, watched)),
        "damping_constants": constant_lines(_damping(constants)),
        "planner_constants": constant_lines(_of_motion(constants, swings, len(shown), slots, plan)),
        **_following(constants, account),
    }
    return "\n".join(
        [
            linear_programme(names["linear_programme"], slots=slots, rows=rows),
            *([account] if account else (filled(part, **values) for part in ("modes", "account"))),
            *(
                filled(part, motion_constants=_common(part, slots), **values)
                for part in parts
                if part not in ("linear_programme", "account", "modes")
            ),
        ]
    )


def _following(constants: PlannerConstants, account: str | None) -> dict[str, str | int]:
    """Fill what depends on whether an account follows the machine, and on whether the load is measured."""
    several = len(constants.axes) > 1
    straight = several or constants.sensor is not None
    still = " AND NOT bUncalm" if constants.sensor else " AND (fSwayLeft <= cSwayLimit)"
    left = f"damping.nLittle < {LITTLE}" if constants.sensor else "table.bCalms AND (table.nPartly > 0)"
    return {
        "follows": int(account is not None),
        "is_measured": int(constants.sensor is not None),
        "left": f"bLeft := {left}," if account else "",
        "uncalm": "bUncalm := bUncalm AND bCalms AND NOT bPlanned," if account else "",
        "still": still if account else "",
        "wide": "0.15" if constants.rates else "0.09",  # a rope that changes needs more to be calmed
        "unmeasured": "bUncalm" if constants.rates else "FALSE",
        "calm_slots": LITTLE,
        "room": ROOM.format("cCalmRoom" if constants.sensor else "fPart") if straight else "",
        "is_straight": int(straight),
        "quiet": "" if account else "bQuiet := table.bQuiet,",
        **(SEVERAL if several else dict.fromkeys(SEVERAL, "")),
        "is_several": int(several),
    }


def _common(part: str, slots: int) -> str:
    """Declare those of the constants that blocks have in common that a block uses."""
    body = (FOLDER / f"{part}.st").read_text("ascii")
    lines = filled("motion_constants", slots=slots).splitlines()
    return "\n".join(line for line in lines if re.search(rf"\b{line.split()[0]}\b", body))


def _stop_share(c: PlannerConstants) -> float:
    if not c.sway_share or c.rates or c.sensor:
        return 1.0
    return max(1.0, STOP_SHARE * c.sway_limit / c.sway_share)


def _share(c: PlannerConstants) -> float:
    """Bound in m what a plan may leave at both ends of the errors."""
    return (c.sway_share or LEAST_SHARE * c.sway_limit) / len(c.axes)


def _shares(c: PlannerConstants) -> Array:
    """Divide what errors may leave among the modes: by the root of what they change, amid the live ranges.

    By what they change itself, a mode that counts little would be bound as much as if it were to be at rest.
    """
    modes, lives = c.modes, len(c.live)
    middles = np.array(c.curvatures[lives:]) if lives else np.zeros(1)  # where the middle is bent to
    errors, sways = _model_at(c, middles)[2 * modes : 4 * modes].reshape(2, modes)
    roots = np.sqrt(np.maximum(errors * sways, 0.0))
    return np.asarray(roots / roots.sum()) if roots.any() else np.full(modes, 1.0 / modes)


def _model_at(c: PlannerConstants, bent: Array) -> Array:
    """Evaluate the model's rows at live parameters, bent, from −1 to 1."""
    powers = np.array([[np.cos(k * np.arccos(bend)) for k in range(c.degrees)] for bend in bent])
    exponents = c.exponents if c.live else np.zeros((1, c.model.shape[1]), dtype=np.int64)
    return np.asarray(
        c.model @ np.prod([row[taken] for row, taken in zip(powers, exponents, strict=True)], axis=0)
    )


def known_for(c: PlannerConstants) -> float:
    """Give the time in s for which machines between those that are watched are known to swing as these.

    In it, neighbours come apart by `APART` in the slowest mode, where damping does not end it before. A
    sensor shows what swings for any time.
    """
    if not c.stated_error or c.sensor:
        return FOREVER
    times, steps = [FOREVER], len(Sizes().of(c)) - 1
    for period, end in zip(c.periods, product((-1.0, 1.0), repeat=len(c.live)), strict=True):
        time = APART * steps * period / (4.0 * np.pi * c.stated_error)
        decay = c.least_decay * _model_at(c, np.array(end or (0.0,)))[c.modes]
        times += [float(time)] if decay * time < FADED else []
    return min(times)


def _of_modes(c: PlannerConstants, watched: Sequence[float]) -> dict[str, object]:
    lives = c.live or {"": (0.0, 1.0)}
    exponents = c.exponents if c.live else np.zeros((1, c.model.shape[1]), dtype=np.int64)
    return {
        "cModes": c.modes,
        "cSwings": c.modes * (1 + len(watched)),
        "cLives": len(c.live),
        "cDegrees": c.degrees,
        "cTerms": c.model.shape[1],
        "cModelRows": len(c.model),
        "cSlotsPerPeriod": SLOTS_PER_PERIOD,
        "cCycle": c.cycle,
        "cLeastDecay": c.least_decay,
        "cWatched": [*watched, 0.0],
        "cLiveLow": [low for low, _ in lives.values()],
        "cLiveHigh": [high for _, high in lives.values()],
        "cLiveBend": [float(v) for v in c.curvatures or (0.0, 0.0)],
        "cExponent": [int(v) for v in exponents.ravel()],
        "cModel": [float(v) for v in c.model.ravel()],
    }


def _of_motion(c: PlannerConstants, swings: int, shown: int, slots: int, plan: int) -> dict[str, object]:
    rows = 2 * shown + 1
    return {
        "cModes": c.modes,
        "cShown": shown,
        "cPlan": plan,
        "cFuture": plan + 4,
        "cOwnWork": 95,  # operations of every cycle
        # operations that an axis has for programmes in a cycle in the mean, where all of them plan
        "cCycleWork": max(500, operations(c) // len(c.axes) - 340 - 5 * slots),
        # operations where a programme is found, and the next begins
        "cFoundWork": 250 + 8 * slots + 15 * swings,
        "cReserve": 150 + 30 * swings,  # operations behind a part of the search
        "cTakeWork": 11 * plan,  # and more, where a motion was found
        "cSlotWork": 650 + rows * (rows + 10),  # operations of an iteration, for each slot
        # and for each iteration
        "cStepWork": 2_200 * (shown - c.modes) + 2 * rows * (20 + rows * (rows + 14)),
        "cVelocity": [axis.velocity for axis in c.axes],
        "cAcceleration": [axis.acceleration for axis in c.axes],
        "cJerk": [axis.jerk for axis in c.axes],
        "cStopShare": _stop_share(c),
        "cSwayLimit": c.sway_limit / len(c.axes),
        "cCalmRoom": _calm_room(c),
    }


def _damping(c: PlannerConstants) -> dict[str, object]:
    """Give the sways of the slowest mode between which one that was measured is damped, in m."""
    if c.sensor is None:
        return {}
    return {"cDampsFrom": c.sensor.again, "cDampsTo": c.sensor.end}


def _calm_room(c: PlannerConstants) -> float:
    """Find in m how far from where a stop leads it may lead to calm a load."""
    if c.sensor is not None:
        return c.sensor.room
    return 2.0 * c.sway_limit if c.rates else 0.0


def constant_lines(constants: Mapping[str, object]) -> str:
    """Declare constants: whole and real ones, and lists of them."""
    return "\n".join(f"    {name} : {_constant(value)};" for name, value in constants.items())


def _constant(value: object) -> str:
    if isinstance(value, Sequence):
        whole = all(isinstance(one, int) for one in value)
        texts = [str(one) if whole else literal(one) for one in value]
        return f"ARRAY [0..{len(texts) - 1}] OF {'DINT' if whole else 'LREAL'} := {initialiser(texts)}"
    if isinstance(value, int):
        return f"DINT := {value}"
    assert isinstance(value, float)
    return f"LREAL := {literal(value)}"


def filled(part: str, **values: str | int) -> str:
    """Read a block's text and put in what it leaves open, as ``@name``.

    What stands between ``@where_follows`` and ``@end`` is for a rope that changes on the way, where
    ``follows`` is given and not 0; between ``@where_stays`` and ``@end`` for one that does not; and
    between ``@where_measured`` and ``@end`` for a load that is measured, where ``is_measured`` is not 0,
    and likewise ``@where_modal`` for loads that do not hang on ropes, ``@where_several`` for several axes,
    and ``@where_straight`` where targets are not to be left far behind.
    """
    follows = bool(values.get("follows"))
    stated = {"follows": follows, "stays": not follows}
    stated |= {part: bool(values.get(f"is_{part}")) for part in ("measured", "modal", "several", "straight")}
    text = WHERE.sub(
        lambda some: some[2] if stated.get(some[1], True) else "", (FOLDER / f"{part}.st").read_text("ascii")
    )
    return re.sub(r"@([a-z_]+)", lambda hole: str(values[hole[1]]), text)
