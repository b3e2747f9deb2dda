"""The planner block as Structured Text: constants of a machine put into the portable text."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from textwrap import indent

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile_exporters.planner.calming_text import CALMING
from gen_profile_exporters.planner.interface_text import HEADER, INTERFACE
from gen_profile_exporters.planner.motion_text import INPUTS, OUTPUTS, SLOTS
from gen_profile_exporters.planner.planning_text import PLANNING, POWERS
from gen_profile_exporters.planner.programme_text import EXTENT, PROGRAMME
from gen_profile_exporters.playback.structured_text import block_name, initialiser, literal

Array = NDArray[np.float64]

FUTURE = 256  # slots of a committed future
LONGEST = 248  # of a plan
MOST = 48  # unknowns of a plan; in a longer one the slots in the middle have the same velocity
KERNEL_SLOTS = 56
WIDE = KERNEL_SLOTS + 4  # with two committed shares before, and two zeros behind
REACH_SLOTS = (*range(20, 31), *range(32, MOST, 2), *range(MOST, 88, 4), 96, 120, LONGEST)  # measured
CHUNK = 45  # slots that a phase takes at once
WORK = 2960  # floating-point operations that a cycle may spend, by a cautious count
ITERATIONS = 6
ROUNDING = 1e-3  # of a live parameter's greatest rate
SPARE = 0.3  # slots more than expected, by slots between two measured motions
MORE_ITERATIONS = 5  # where these do not lead to a plan
WAY_ITERATIONS = 13  # where the axis moves already
SLOTS_PER_PERIOD = 20.0  # of the slowest mode
MIRROR_DECAY = 0.2  # over a motion, up to which its halves mirror each other until the last projection
CENTRE = 0.15  # of an interior-point iteration: the complementarity it aims at, relative to that of now
STEP = 0.93  # share of the way to the nearest bound that it goes
FRESH = 8  # cycles, for which the machine that is followed counts as constant
RESERVE = 0.1  # share of the limits that only calming takes up, where live parameters change on the way
INSIDE = 5e-4  # share of each limit that a plan leaves, for rounding


@attrs.frozen(kw_only=True, eq=False)
class PlannerConstants:
    """What the block needs to know of a machine, in m and s.

    Attributes
    ----------
    name, machine, axis : str
    start : float
        m, where the axis stands in the block's example.
    cycle : float
    velocity, acceleration, jerk : float
    quick_deceleration, quick_jerk : float
    travel : (float, float)
    live : mapping of str to (float, float)
        Ranges of the live parameters.
    units : tuple of str
        In which they are given.
    nominal : tuple of float
        Their values where the controller gives none.
    drift : tuple of float
        By how much each may change before it is taken over anew.
    rates : mapping of str to float
        How fast some may change on the way, per s.
    calm : float
        m, sway up to which nothing is done about it.
    targets : (float, float)
        m, within the travel.
    degrees : int
        Chebyshev polynomials per live parameter.
    exponents : (parameters, terms) array of int
        Which of them are multiplied.
    frequencies, decays : (modes, terms) arrays
        Coefficients for the sum of the squared frequencies (and, of two, the product), and for the decays.
    matrix : (modes², terms) array
        Likewise for the matrix of the linear machine in the loads' sway, row by row; no rows without rates.
    """

    name: str
    machine: str
    axis: str
    start: float
    cycle: float
    velocity: float
    acceleration: float
    jerk: float
    quick_deceleration: float
    quick_jerk: float
    travel: tuple[float, float]
    live: Mapping[str, tuple[float, float]]
    units: tuple[str, ...]
    nominal: tuple[float, ...]
    drift: tuple[float, ...]
    rates: Mapping[str, float]
    calm: float
    targets: tuple[float, float]
    degrees: int
    exponents: NDArray[np.int64]
    frequencies: Array
    decays: Array
    matrix: Array


def block_text(constants: PlannerConstants) -> str:
    """Write the function block."""
    body = PLANNING.replace("@programme\n", PROGRAMME).replace("@calming\n", CALMING)
    body = body.replace("@extent\n", indent(EXTENT, 16 * " "))
    body = body.replace("@powers\n", indent(POWERS, 20 * " "))
    slots = SLOTS.replace("@powers\n", indent(POWERS, 8 * " "))
    text = HEADER + INTERFACE + INPUTS + slots + body + OUTPUTS
    values = _values(constants)
    return re.sub(r"@([a-z_]+)", lambda hole: values[hole[1]], text)


def _values(c: PlannerConstants) -> dict[str, str]:
    modes, terms = c.frequencies.shape
    conditions = 1 + 4 * modes
    lives = list(c.live)
    known = list(zip(c.live.items(), c.units, c.nominal, strict=True))
    ranges = [
        f"f{name}: live parameter {name}, {low:g} to {high:g} {unit}".rstrip()
        + (f", on the way at most {c.rates[name]:g} {unit}/s" if name in c.rates else "")
        for (name, (low, high)), unit, _ in known
    ]
    inputs = [
        f"    f{name} : LREAL := {literal(value)}; (* {unit or 1}, {low:g} to {high:g} *)"
        for (name, (low, high)), unit, value in known
    ]
    lasts = {
        "future": FUTURE,
        "power": max(1, len(lives)) * c.degrees,
        "live": max(1, len(lives)),
        "mode": modes,
        "matrix": modes**2,
        "column": WIDE,
        "wide": WIDE,
        "conditions": conditions * KERNEL_SLOTS,
        "row": conditions,
        "gram": conditions**2,
        "bounds": 3 * WIDE,
        "reach": len(REACH_SLOTS),
    }
    return {
        "name": c.name,
        "block": f"{block_name(c.name)}_planner",
        "machine": c.machine,
        "axis": c.axis,
        "start": literal(c.start),
        "cycle_time": literal(c.cycle),
        "cycle": f"{c.cycle:g}",
        "velocity": f"{c.velocity:g}",
        "acceleration": f"{c.acceleration:g}",
        "jerk": f"{c.jerk:g}",
        "travel": f"{c.travel[0]:g} to {c.travel[1]:g}",
        "quick_deceleration": f"{c.quick_deceleration:g}",
        "quick_jerk": f"{c.quick_jerk:g}",
        "targets": f"{c.targets[0]:g} to {c.targets[1]:g}",
        "live_rates": " faster than stated" if c.rates else "",
        "live_lines": "\n    ".join(ranges) or "No live parameters.",
        "live_inputs": "\n".join(inputs),
        "take_live": "\n".join(f"aLiveNow[{k}] := f{name};" for k, name in enumerate(lives)),
        "constants": _constants(c, terms, conditions),
        **{f"last_{name}": str(length - 1) for name, length in lasts.items()},
    }


def _constants(c: PlannerConstants, terms: int, conditions: int) -> str:
    whole = {
        "cModes": len(c.frequencies),
        "cMatrices": len(c.frequencies) if c.rates else 0,
        "cFresh": FRESH,
        "cCycleWork": 85 + (40 + 30 * len(c.frequencies) ** 2 if c.rates else 0),
        "cConditions": conditions,
        "cLives": len(c.live),
        "cTerms": terms,
        "cDegrees": c.degrees,
        "cColumns": KERNEL_SLOTS,
        "cMost": MOST,
        "cHalf": MOST // 2,
        "cLongest": LONGEST,
        "cKernelFirst": 18,
        "cLongKernel": 40,
        "cWide": WIDE,
        "cChunk": CHUNK,
        "cFuture": FUTURE,
        "cWork": WORK,
        "cIterations": ITERATIONS,
        "cMoreIterations": MORE_ITERATIONS,
        "cWayIterations": WAY_ITERATIONS,
        "cColumnWork": 220 + 12 * conditions + conditions * conditions,
        "cReaches": len(REACH_SLOTS),
    }
    real = {
        "cCycle": c.cycle,
        "cVelocity": c.velocity,
        "cAcceleration": c.acceleration,
        "cJerk": c.jerk,
        "cQuickDeceleration": c.quick_deceleration,
        "cQuickJerk": c.quick_jerk,
        "cTravelLow": c.travel[0],
        "cTravelHigh": c.travel[1],
        "cSlotsPerPeriod": SLOTS_PER_PERIOD,
        "cInside": RESERVE if c.rates else INSIDE,
        "cReserve": RESERVE if c.rates else 0.0,
        "cCalm": c.calm,
        "cTargetLow": c.targets[0],
        "cTargetHigh": c.targets[1],
        "cSpare": SPARE,
        "cMirrorDecay": MIRROR_DECAY,
        "cCentre": CENTRE,
        "cStep": STEP,
    }
    lives = c.live or {"": (0.0, 1.0)}
    exponents = c.exponents if c.live else np.zeros((1, terms), dtype=np.int64)
    arrays = {
        "cLiveLow": [low for low, _ in lives.values()],
        "cLiveHigh": [high for _, high in lives.values()],
        "cLiveDrift": c.drift or (0.0,),
        "cLiveStep": [c.cycle * c.rates.get(name, 0.0) * (1.0 + ROUNDING) for name in lives],
        "cFrequency": c.frequencies.ravel(),
        "cDecay": c.decays.ravel(),
        "cMatrix": c.matrix.ravel() if c.rates else (0.0,),
    }
    follows = "TRUE" if c.rates else "FALSE"
    lines = [f"    cFollows : BOOL := {follows}; (* how live parameters change on the way *)"]
    lines += [f"    {name} : DINT := {value};" for name, value in whole.items()]
    lines += [f"    {name} : LREAL := {literal(value)};" for name, value in real.items()]
    lines += [_array(name, "LREAL", [literal(v) for v in values]) for name, values in arrays.items()]
    lines.append(_array("cExponent", "DINT", [str(v) for v in exponents.ravel()]))
    lines.append(_array("cReachSlots", "DINT", [str(v) for v in REACH_SLOTS]))
    return "\n".join(lines)


def _array(name: str, type_: str, values: Sequence[str]) -> str:
    return f"    {name} : ARRAY [0..{len(values) - 1}] OF {type_} := {initialiser(values)};"
