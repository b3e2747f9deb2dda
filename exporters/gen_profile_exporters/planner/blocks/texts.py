"""The texts of the blocks, with a machine's constants and the sizes of arrays put in."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile_exporters.block_source import initialiser
from gen_profile_exporters.planner.block import SLOTS_PER_PERIOD, PlannerConstants
from gen_profile_exporters.playback.structured_text import literal

FOLDER = Path(__file__).parent
SIDES = 12  # of a polygon
LONGEST, FEWEST = (
    64,
    40,
)  # slots of the longest programme, where there are operations for it, and where there are few
SLOT_WORK = 8_000  # operations of a slot of the longest programme: eight iterations
QUICK = 2.0  # s; machines whose slowest mode is quicker need more operations in a cycle,
QUICK_WORK = 600_000  # for so many in a slot


@attrs.frozen(kw_only=True)
class Sizes:
    """What the blocks of a planner are made for.

    Attributes
    ----------
    watched : tuple of float
        Machines that are watched: shares of the stated errors.
    shown : tuple of float
        Those of them that every programme has rows of.
    """

    watched: tuple[float, ...] = (-1.0, 1.0)
    shown: tuple[float, ...] = (-1.0, 1.0)

    def rows(self, modes: int) -> int:
        """Rows of a programme: those of the swings, and a target's way."""
        return 2 * modes * (1 + len(self.shown)) + 1


def linear_programme(name: str, *, slots: int, rows: int) -> str:
    """Write the block of linear programmes.

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
    last = {f"last_{array}": length - 1 for array, length in lengths.items()}
    return filled("linear_programme", linear_programme=name, slots=slots, wide=slots + 2, rows=rows, **last)


def operations(constants: PlannerConstants) -> int:
    """Give what a cycle may spend: what is stated, but more for quick machines."""
    period = min(constants.periods)
    cycles = int(period / (SLOTS_PER_PERIOD * constants.cycle))
    return max(constants.operations, QUICK_WORK // cycles) if period < QUICK else constants.operations


def longest(constants: PlannerConstants) -> int:
    """Give the slots of the longest programme."""
    cycles = int(min(constants.periods) / (SLOTS_PER_PERIOD * constants.cycle))
    return max(FEWEST, min(LONGEST, operations(constants) * cycles // SLOT_WORK))


def planner(constants: PlannerConstants, sizes: Sizes) -> str:
    """Write a planner of one axis, behind the blocks that it has within it."""
    modes, swings = constants.modes, constants.modes * (1 + len(sizes.watched))
    name = constants.name.replace("-", "_")
    names = {part: f"{name}_{part}" for part in ("linear_programme", "account", "modes", "planner")}
    shown = [
        *range(modes),
        *(modes * (1 + sizes.watched.index(e)) + m for e in sizes.shown for m in range(modes)),
    ]
    rows, slots = sizes.rows(modes), longest(constants)
    bounds = [constants.sway_share * share for share in _shares(constants)]
    lengths = {
        "live": max(1, len(constants.live)), "swing": swings, "shown": len(shown), "slot": slots,
        "entry": rows * slots, "row": rows, "pair": max(1, rows // 2), "mode": modes,
        "power": max(1, len(constants.live)) * constants.degrees, "model": len(constants.model),
        "future": slots + 4,
    }  # fmt: skip
    values = {
        **names,
        **{f"last_{array}": length - 1 for array, length in lengths.items()},
        "swings": swings,
        "shown": len(shown),
        "slots": slots,
        "bounds": initialiser([literal(float(v)) for v in np.tile(bounds, 1 + len(sizes.watched))]),
        "shown_swings": initialiser([str(v) for v in shown]),
        "model_work": 80 + constants.model.shape[1] * (2 * len(constants.model) + 4) + 4 * lengths["power"],
        "modes_constants": constant_lines(_of_modes(constants, sizes)),
        "planner_constants": constant_lines(_of_motion(constants, len(shown), slots)),
    }
    return "\n".join(
        [
            linear_programme(names["linear_programme"], slots=slots, rows=rows),
            *(filled(part, **values) for part in ("modes", "account", "planner")),
        ]
    )


def _shares(c: PlannerConstants) -> Array:
    """Divide what errors may leave among the modes: by the root of what they change, amid the live ranges.

    By what they change itself, a mode that counts little would be bound as much as if it were to be at rest.
    """
    modes, lives = c.modes, len(c.live)
    middles = np.array(c.curvatures[lives:]) if lives else np.zeros(1)  # where the middle is bent to
    powers = np.array([[np.cos(k * np.arccos(bend)) for k in range(c.degrees)] for bend in middles])
    exponents = c.exponents if lives else np.zeros((1, c.model.shape[1]), dtype=np.int64)
    terms = np.prod([row[taken] for row, taken in zip(powers, exponents, strict=True)], axis=0)
    errors, sways = (c.model @ terms)[2 * modes : 4 * modes].reshape(2, modes)
    roots = np.sqrt(np.maximum(errors * sways, 0.0))
    return np.asarray(roots / roots.sum()) if roots.any() else np.full(modes, 1.0 / modes)


def _of_modes(c: PlannerConstants, sizes: Sizes) -> dict[str, object]:
    lives = c.live or {"": (0.0, 1.0)}
    exponents = c.exponents if c.live else np.zeros((1, c.model.shape[1]), dtype=np.int64)
    return {
        "cModes": c.modes,
        "cSwings": c.modes * (1 + len(sizes.watched)),
        "cLives": len(c.live),
        "cDegrees": c.degrees,
        "cTerms": c.model.shape[1],
        "cModelRows": len(c.model),
        "cSlotsPerPeriod": SLOTS_PER_PERIOD,
        "cCycle": c.cycle,
        "cLeastDecay": c.least_decay,
        "cWatched": [float(e) for e in sizes.watched],
        "cLiveLow": [low for low, _ in lives.values()],
        "cLiveHigh": [high for _, high in lives.values()],
        "cLiveBend": [float(v) for v in c.curvatures or (0.0, 0.0)],
        "cExponent": [int(v) for v in exponents.ravel()],
        "cModel": [float(v) for v in c.model.ravel()],
    }


def _of_motion(c: PlannerConstants, shown: int, slots: int) -> dict[str, object]:
    (axis,) = c.axes
    return {
        "cModes": c.modes,
        "cShown": shown,
        "cSlots": slots,
        "cFuture": slots + 4,
        "cReserve": 100 + 8 * slots,  # operations where a plan was found
        "cVelocity": axis.velocity,
        "cChange": axis.acceleration / axis.velocity,
        "cCurve": axis.jerk / axis.velocity,
        "cTravelLow": axis.travel[0],
        "cTravelHigh": axis.travel[1],
        "cPolygon": float(np.cos(np.pi / SIDES)),
    }


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
    """Read a block's text and put in what it leaves open, as ``@name``."""
    text = (FOLDER / f"{part}.st").read_text("ascii")
    return re.sub(r"@([a-z_]+)", lambda hole: str(values[hole[1]]), text)
