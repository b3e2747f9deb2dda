"""The planner block as Structured Text: constants of a machine put into the portable text.

The text stands in ``text/``. ``@name`` alone on a line is the part of that name, indented like it, or a value
as elsewhere; what stands between ``@where_followed`` and ``@end`` is left out where no live parameter changes
on the way, and likewise what is for zones and events where there are none.

- ``interface.st``: header and declarations.
- ``inputs.st``, ``slots.st``, ``setpoints.st``, ``outputs.st``: what runs in every cycle; between them the
  committed future, which is a velocity for every slot.
- ``pulses.st`` adds pulses to it where a slot begins. Of each as much is admitted as keeps every limit over
  the whole committed time. Where full speed is too much for one pulse, they grow and decline from slot to
  slot; ``shape.st`` tells what that adds to the decline that is committed already.
- ``next_job.st``, ``planning/``: some steps in each cycle, each a phase with a name, at the cost that
  ``costs.st`` tells. ``modes.st`` finds modes and kernel; others plan a motion to a target, or a stop. A plan
  is a linear programme: the coefficients of the velocity's spline that go farthest within the limits on
  value, difference and second difference, so that the modes and their derivatives by frequency are at rest.
  ``request.st`` begins one: which way, from which slot on, over how many. ``conditions.st`` writes
  unknowns and conditions, ``plan.st`` takes the share that is needed and holds it against the limits.
- ``programme.st`` solves it by a primal-dual interior-point method (Mehrotra 1992, with a fixed centring);
  the normal matrix has five diagonals, and the conditions enter by its Schur complement. Second derivatives
  by frequency, where stated errors make them count, are soft conditions: the square of what is left costs
  way, which adds its weight's inverse to the complement's diagonal. The last projection leaves them out.
- ``follow.st`` follows the linear machine of now, ``sway'' = acceleration - matrix * sway``, cycle by cycle,
  and its slope by the logarithm of the frequencies, ``slope'' = -matrix * (slope + 2 sway)``: what is unknown
  of them changes sway and slope alike along all that was driven, so it adds up where the slope is not known.
- ``calming.st`` calms what sways since live parameters changed. With the left eigenvectors l of the matrix a
  mode is l * sway; what the committed future leaves in it is a sum over its coefficients, as of a plan, and
  so is its slope. A pulse of the kernel's shape that ends where it begins takes both away.
- ``variations.st``, ``left.st``, ``between.st``: what the committed future leaves on machines of other
  frequencies is a state, what is long past a bound. ``slope_bounds.st`` bounds what past and plan leave.
- ``sensor.st`` estimates what sways, ``damping.st`` damps the slowest mode by pulses of another kernel, and
  ``events.st`` tells what is other than in the cycle before.
- ``formulas/``: modes at the live parameters, complex powers, columns that a row fills, slow zones near.
"""

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from textwrap import indent

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile_exporters.block_source import initialiser
from gen_profile_exporters.planner import error_constants as of_errors
from gen_profile_exporters.planner import search_constants as of_search
from gen_profile_exporters.planner import sensor_constants as of_sensor
from gen_profile_exporters.planner.axis_declarations import ZONES, axis_interface, axis_words
from gen_profile_exporters.planner.constants import PlannerConstants
from gen_profile_exporters.playback.structured_text import block_name, literal

FUTURE = 140  # slots of a committed future
LONGEST = 132  # of a plan; farther targets are approached by pulses, as a stick would
COLUMNS = 56  # unknowns of a plan; in a longer one the slots in the middle have the same velocity
HALF = 24  # unknowns of a plan whose second half mirrors the first one, likewise
KERNEL_SLOTS = COLUMNS  # of a kernel, at most
LONG_KERNEL = 40  # slots, from which on no longer one is sought
WIDE = COLUMNS + 4  # with two committed shares before, and two zeros behind
REACH_SLOTS = (*range(20, 31), *range(32, 48, 2), *range(48, 88, 4), 96, LONGEST)  # measured
SHORT_SLOTS = (10, 12, 14, *range(16, 20))  # likewise, where plans may leave a slope
PULSE_WORK = 60  # operations of each slot of a pulse that is weighed
COUNTED = 40  # operations of a cycle that its cautious count leaves out
HOLD = 0.2  # s, in which an input that is out of range is held
STILL = 1e-3  # of full speed: a velocity that counts as standing, and a way as none
ROUNDING = 1e-3  # of a live parameter's greatest rate
SLOTS_PER_PERIOD = 20.0  # of the slowest mode
RESERVE = 0.1  # share of the limits that only calming takes up, where live parameters change on the way
INSIDE = 5e-4  # share of each limit that a plan leaves, for rounding
FOR, END_FOR = re.compile(r"( *)FOR (\w+) := (.+) TO (.+) DO(.*)"), re.compile(r"( *)END_FOR;(.*)")
AXIS_LOOP = re.compile(r"(?ms)^( *)FOR (\w+) := 0 TO cAxes - 1 DO[^\n]*\n(.*?)^\1END_FOR;[^\n]*\n")
# of the first axis: how many of something there are before
FIRST = re.compile(r"(?<![\w.])0(?: \* c\w+)+( \+ )?")
WHERE = re.compile(r"(?ms)^ *@where_(\w+)\n(.*?)^ *@end\n")
PART = re.compile(r"(?m)^( *)@(\w+)\n")
TEXT = Path(__file__).with_name("text")


def block_text(constants: PlannerConstants) -> str:
    """Write the function block."""
    text = _filled("block", constants)
    return narrow(with_while_loops(_without_loops(text) if len(constants.axes) == 1 else text))


def interface(constants: PlannerConstants) -> str:
    """Write its header and declare its inputs and outputs."""
    return _filled("interface", constants).partition("\nVAR\n")[0] + "\n"


def _filled(part: str, constants: PlannerConstants) -> str:
    parts = {
        "followed": bool(constants.rates),
        "zones": constants.zones,
        "events": constants.events,
        "ramped": not constants.rates,
        "varied": constants.stated_error > 0.0 and not constants.rates,
        "several_varied": len(constants.axes) > 1 and constants.stated_error > 0.0 and not constants.rates,
        "measured": constants.sensor is not None,
        "measured_varied": constants.sensor is not None and constants.stated_error > 0.0,
    }
    text = WHERE.sub(lambda some: some[2] if parts[some[1]] else "", _part(part))
    values = _values(constants)
    return re.sub(r"@([a-z_]+)", lambda hole: values[hole[1]], text)


@cache
def _part(name: str, margin: str = "") -> str:
    """Read a part of the text, with those that it names where it names them."""

    def named(hole: re.Match[str]) -> str:
        return _part(hole[2], hole[1]) if hole[2] in _parts() else hole[0]

    return indent(PART.sub(named, _parts()[name]), margin)


@cache
def _parts() -> dict[str, str]:
    return {path.stem: path.read_text("ascii") for path in TEXT.rglob("*.st")}


def _without_loops(text: str) -> str:
    """Take the loops over axes away where there is one axis, of number 0."""

    def once(loop: re.Match[str]) -> str:
        _, counter, body = loop.groups()
        body = re.sub("(?m)^ {4}", "", re.sub(rf"\b{counter}\b", "0", _without_loops(body)))
        return FIRST.sub(lambda found: "" if found[1] else "0", body.replace("(0 + 1) * ", ""))

    return AXIS_LOOP.sub(once, text)


def with_while_loops(text: str) -> str:
    """Write FOR loops as WHILE loops: since 2024 matiec leaves out those of a single pass."""
    lines, counters = list[str](), list[str]()
    for line in text.split("\n"):
        if loop := FOR.fullmatch(line):
            margin, counter, first, last, more = loop.groups()
            within = f"< {last[:-4]}" if last.endswith(" - 1") else f"<= {last}"
            lines += [f"{margin}{counter} := {first};", f"{margin}WHILE {counter} {within} DO{more}"]
            counters.append(counter)
        elif ends := END_FOR.fullmatch(line):
            margin, more, counter = *ends.groups(), counters.pop()
            lines += [f"{margin}    {counter} := {counter} + 1;", f"{margin}END_WHILE;{more}"]
        else:
            lines.append(line)
    return "\n".join(lines)


def narrow(text: str) -> str:
    """Indent by tabs, which keeps the text short."""
    return re.sub("(?m)^ +", lambda margin: "\t" * (len(margin[0]) // 4), text)


def _values(c: PlannerConstants) -> dict[str, str]:
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
    return {
        "name": c.name,
        "block": f"{block_name(c.name)}_planner",
        "machine": c.machine,
        "cycle_time": literal(c.cycle),
        "cycle": f"{c.cycle:g}",
        "live_rates": " faster than stated" if c.rates else "",
        "hold": f"{HOLD:g}",
        "reaction": f"{_reaction(c):.3g}",
        "gives_up": f"{_real_constants(c)['cGivesUp']:.3g}",
        "live_lines": "\n    ".join(ranges) or "No live parameters.",
        "live_inputs": "\n".join(inputs),
        "take_live": "\n".join(f"aLiveGiven[{k}] := f{name};" for k, name in enumerate(lives)),
        "constants": _constants(c),
        **axis_words(c.axes),
        **axis_interface(c.axes),
        **of_sensor.values(c.sensor, [axis.suffix for axis in c.axes]),
        **{f"last_{name}": str(length - 1) for name, length in _lengths(c).items()},
    }


def _lengths(c: PlannerConstants) -> dict[str, int]:
    """Lengths of the block's arrays."""
    modes, axes, conditions = c.modes, len(c.axes), _conditions(c)
    return {
        "axis": axes,
        "future": axes * FUTURE,
        "zone": axes * ZONES,
        "power": max(1, len(c.live)) * c.degrees,
        "live": max(1, len(c.live)),
        "mode": modes,
        "matrix": modes**2,
        "sway": 12 * axes * modes,
        "look": 4 * modes,
        "model": len(c.model),
        "column": WIDE,
        "wide": WIDE,
        "mean": 4 * axes,
        "conditions": conditions * COLUMNS,
        "row": conditions,
        "gram": conditions**2,
        "bounds": 4 * WIDE,
        "left": axes * modes * len(of_errors.VARIATIONS),
        "one": len(of_errors.VARIATIONS),
        "variation": modes * len(of_errors.VARIATIONS),
        "back": modes * (len(of_errors.VARIATIONS) + 1),
        "gain": axes * modes,
        "fine": axes * modes * _fine(c),
        "reach": axes * len(_reach_slots(c)),
        **of_sensor.lengths(c.sensor, modes, axes, c.cycle),
    }


def _constants(c: PlannerConstants) -> str:
    follows = str(bool(c.rates)).upper()
    lines = [f"    cFollows : BOOL := {follows}; (* how live parameters change on the way *)"]
    lines += [f"    {name} : DINT := {value};" for name, value in _whole_constants(c).items()]
    lines += [f"    {name} : LREAL := {literal(value)};" for name, value in _real_constants(c).items()]
    lines += [_array(name, "LREAL", [literal(v) for v in values]) for name, values in _arrays(c).items()]
    exponents = c.exponents if c.live else np.zeros((1, c.model.shape[1]), dtype=np.int64)
    lines.append(_array("cExponent", "DINT", [str(v) for v in exponents.ravel()]))
    lines += of_sensor.other_constants(c.sensor)
    before = np.cumsum(np.sign(c.second_order)) - 1.0
    lines.append(_array("cSecond", "DINT", [str(int(number)) for number in before]))
    lines.append(_array("cReachSlots", "DINT", [str(v) for v in _reach_slots(c)]))
    return "\n".join(lines)


def _whole_constants(c: PlannerConstants) -> dict[str, int]:
    modes, (rows, terms), left = c.modes, c.model.shape, _work(c) - _cycle_work(c)
    return {
        "cAxes": len(c.axes),
        "cModes": modes,
        "cRows": rows,
        # cycles, for which the machine that is followed counts as constant
        **({"cFresh": 8} if c.rates else {}),
        "cCycleWork": _cycle_work(c),
        "cMostLonger": 20,  # slots by which a plan may take longer than expected before pulses are quicker
        "cConditions": _conditions(c),
        **_watched(c),
        "cSlotBits": _longest_slot(c).bit_length(),
        "cRampLeastSlots": 9,
        "cAhead": 2 if c.rates else 1,
        "cSeconds": np.count_nonzero(c.second_order),
        "cLives": len(c.live),
        "cTerms": terms,
        "cDegrees": c.degrees,
        "cColumns": COLUMNS,
        "cHalf": HALF,
        "cLongest": LONGEST,
        "cLongestOnWay": 72 if c.rates else 80,  # where the axis moves already
        "cKernelFirst": 18,
        "cMostSteps": KERNEL_SLOTS + 1,  # of a kernel, and of the pulses that a stick's plan declines by
        "cLongestKernel": _longest_kernel(c),
        "cLongKernel": min(LONG_KERNEL, _longest_kernel(c)),
        "cPulseChunk": _pulse_chunk(c),
        "cPulseWork": PULSE_WORK + of_search.ZONED_WORK * c.zones,
        "cWide": WIDE,
        "cChunk": 45,  # slots that a phase takes at once
        "cFuture": FUTURE,
        "cWork": _work(c),
        **(of_search.zoned(left, FUTURE, len(c.axes), _shortest_slot(c)) if c.zones else {}),
        "cHoldCycles": round(HOLD / c.cycle),
        **of_search.whole_constants(),
        "cColumnWork": _column_work(c),
        "cReaches": len(_reach_slots(c)),
        **of_sensor.whole_constants(c.sensor, modes, len(c.axes), c.cycle),
    }


def _reach_slots(c: PlannerConstants) -> Sequence[int]:
    return REACH_SLOTS if c.rates or not c.sway_share else (*SHORT_SLOTS, *REACH_SLOTS)


def _conditions(c: PlannerConstants) -> int:
    """Conditions of a plan: its sum; four of each mode, and two of second order where these are needed."""
    return 1 + 4 * c.modes + 2 * int(np.count_nonzero(c.second_order))


def _work(c: PlannerConstants) -> int:
    return c.operations - COUNTED


def _column_work(c: PlannerConstants) -> int:
    """Operations of one iteration for each unknown of a plan."""
    conditions = _conditions(c)
    return 220 + 12 * conditions + conditions * conditions


def _reaction(c: PlannerConstants) -> float:
    """Bound the time in s until a new command changes the motion.

    It begins with a slot, and takes over two slots after it was planned; the plan in work may be finished
    before, or come too late.
    """

    def bound(period: float) -> float:
        cycles = max(1, round(period / (SLOTS_PER_PERIOD * c.cycle)))
        ahead = 2 + 2 * len(c.axes) * of_search.SEARCH_ITERATIONS * _column_work(c) * 2 * HALF // (
            _work(c) * cycles
        )
        return 2 * (ahead + 2) * cycles * c.cycle

    return max(bound(period) for period in c.periods)


def _fine(c: PlannerConstants) -> int:
    """Finer machines of a mode that what was executed is followed on."""
    return of_errors.finer(c.operations, _shortest_slot(c), c.modes * len(c.axes))


def _watched(c: PlannerConstants) -> dict[str, int]:
    """On how many machines what errors leave is watched, if it is."""
    sizes = _fine(c), _shortest_slot(c), c.modes * len(c.axes)
    return of_errors.whole_constants(*sizes) if c.stated_error and not c.rates else {"cVariations": 0}


def _shortest_slot(c: PlannerConstants) -> int:
    """Cycles in the shortest slot."""
    return int(min(c.periods) / (SLOTS_PER_PERIOD * c.cycle))


def _longest_slot(c: PlannerConstants) -> int:
    """Cycles in the longest slot."""
    return max(1, int(max(c.periods) / (SLOTS_PER_PERIOD * c.cycle)) + 1)


def _cycle_work(c: PlannerConstants) -> int:
    """Floating-point operations of every cycle, whatever is planned."""
    following = 110 + 4 * c.modes * (4 * c.modes + 17)
    sensed = of_sensor.cycle_work(c.sensor, c.modes)
    axes = (120 + sensed + (following if c.rates else 0) + (23 * ZONES if c.zones else 0)) * len(c.axes)
    return axes - 24 + 15 * len(c.live) + of_errors.cycle_work(_watched(c))


def _longest_kernel(c: PlannerConstants) -> int:
    """Slots of the longest kernel whose last step fits into one cycle at rest: the block's own count."""
    conditions = 1 + 4 * c.modes
    left = _work(c) - _cycle_work(c) - of_errors.rest_work(_watched(c), c.modes * len(c.axes)) - 140
    return min(KERNEL_SLOTS, left // (2 * conditions + 8))


def _pulse_chunk(c: PlannerConstants) -> int:
    """Slots of a long pulse that can be weighed in one cycle, in which pulses may be added, too."""
    spent = _cycle_work(c) + of_errors.FINE_BEGIN + 80 + 60 * len(c.axes) + (1 + 3 * len(c.axes)) * FUTURE
    return (_work(c) - spent) // (PULSE_WORK + of_search.ZONED_WORK * c.zones)


def _real_constants(c: PlannerConstants) -> dict[str, float]:
    return {
        "cCycle": c.cycle,
        "cReaction": _reaction(c),
        "cGivesUp": _reaction(c) + of_search.GIVES_UP * max(c.periods),
        "cSlotsPerPeriod": SLOTS_PER_PERIOD,
        "cRate": min(axis.acceleration / axis.velocity for axis in c.axes),
        "cCurve": min(axis.jerk / axis.velocity for axis in c.axes),
        "cInside": INSIDE + (RESERVE if c.rates else 0.0),
        "cReserve": RESERVE if c.rates else 0.0,
        "cMargin": c.axes[0].targets[0] - c.axes[0].travel[0],
        "cAtOnce": 2.0,  # of full speed, from a slot's pulse to the next: no bound
        "cAfterCut": 0.1,  # of full speed, by which pulses grow from slot to slot after one was cut
        **(
            {"cDoubt": c.stated_error, "cCalm": c.tolerated_sway}
            if c.rates
            else {
                "cSwayShare": c.sway_share / c.sway_limit / len(c.axes),
                "cSwayLimit": c.sway_limit,
                # m of an axis, that a plan from rest may leave by its slope, however much is left already
                "cLeastAdded": 0.02 * c.sway_limit / len(c.axes),
                **of_errors.real_constants(_fine(c), c.least_decay),
            }
        ),
        "cRampLeast": 0.05,  # of full speed: a change of the stick that is planned for
        "cMet": 1e-6,  # sum of shares by which a plan may miss a condition
        "cSpare": 0.3,  # slots more than expected, by slots between two measured motions
        # over a motion, up to which its halves mirror each other until the last projection
        "cMirrorDecay": 0.2,
        "cAgainst": 0.1,  # share of full speed, below which a tap of the stick ends by itself
        **of_search.real_constants(robust=not c.sway_share),
        **of_sensor.real_constants(c.sensor, c.cycle),
    }


def _arrays(c: PlannerConstants) -> dict[str, Sequence[float] | Array]:
    lives = c.live or {"": (0.0, 1.0)}
    return {
        "cVelocity": [axis.velocity for axis in c.axes],
        "cAcceleration": [axis.acceleration for axis in c.axes],
        "cJerk": [axis.jerk for axis in c.axes],
        "cQuickDeceleration": [axis.quick_deceleration for axis in c.axes],
        "cQuickJerk": [axis.quick_jerk for axis in c.axes],
        "cStill": [STILL * axis.velocity for axis in c.axes],
        "cTravelLow": [axis.travel[0] for axis in c.axes],
        "cTravelHigh": [axis.travel[1] for axis in c.axes],
        "cTargetLow": [axis.targets[0] for axis in c.axes],
        "cTargetHigh": [axis.targets[1] for axis in c.axes],
        "cSecondOrder": c.second_order,
        **({"cLowers": [c.rope_length_gain.get(name, 0.0) for name in lives]} if c.rates else {}),
        "cLiveLow": [low for low, _ in lives.values()],
        "cLiveHigh": [high for _, high in lives.values()],
        "cLiveBend": c.curvatures or (0.0, 0.0),
        **({} if c.rates else {"cVariation": of_errors.VARIATIONS}),
        "cLiveDrift": c.drift or (0.0,),
        "cLiveStep": [c.cycle * c.rates.get(name, 0.0) * (1.0 + ROUNDING) for name in lives],
        "cModel": c.model.ravel(),
    }


def _array(name: str, type_: str, values: Sequence[str]) -> str:
    return f"    {name} : ARRAY [0..{len(values) - 1}] OF {type_} := {initialiser(values)};"
