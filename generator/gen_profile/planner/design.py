"""From a spec to its planner block."""

import re
from collections import Counter
from collections.abc import Sequence

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.planner.chebyshev import same_terms
from gen_profile.planner.directions import planned_axes
from gen_profile.planner.machine import (
    LiveModes,
    corners,
    frequencies,
    frequency_errors,
    least_decay,
    live_modes,
    lowered,
    sway_model,
)
from gen_profile.planner.sensor import between, modal_model, sensor_constants
from gen_profile.planner.stated import LEAST_RATE, quick_limits, target_range, unstated_limits
from gen_profile.spec.model import Spec
from gen_profile.spec.stack_rules import refuse_stacks
from gen_profile.support.errors import SpecError
from gen_profile.support.one_thread import one_thread
from gen_profile.support.phrase import Phrase, placed
from gen_profile_exporters.planner.axis_declarations import AxisConstants
from gen_profile_exporters.planner.blocks.whole import whole_block
from gen_profile_exporters.planner.constants import PlannerConstants, SwayConstants
from gen_profile_exporters.planner.interface import SLOTS_PER_PERIOD

DECLARED = re.compile(r"(?m)^\s+(\w+) : ")  # in Structured Text
FEWEST_CYCLES = 4  # in a slot
SPRINGS = 1e-9  # s²/m: they bend as little as if gravity were so great
# A cycle may spend so many at least, and so many for each ms, if the spec states none; the more where the
# slowest mode swings faster than once in LEISURELY s, as it waits for plans.
OPERATIONS, ZONED_OPERATIONS = 3000, 5000
LEISURELY = 2.0


@attrs.frozen(kw_only=True)
class PlannerBlock:
    """A planner block and what is known of it.

    Attributes
    ----------
    filename, text : str
    modes : int
    frequency_error : float
        Relative, over the live ranges.
    period : float
        Of the slowest mode in s, the shortest over the live ranges.
    """

    filename: str
    text: str = attrs.field(repr=False)
    modes: int
    frequency_error: float
    period: float


@one_thread
def planner_block(spec: Spec) -> PlannerBlock:
    """Write the planner block of a spec.

    Raises
    ------
    SpecError
        A limit is not stated, or the block does not take this machine.
    """
    refuse_stacks(spec, "a planner block")
    modes_of_live, constants = planner_constants(spec)
    text = whole_block(constants)
    declared = Counter(name.lower() for name in DECLARED.findall(text))  # the language has one case only
    if taken := [name for name in modes_of_live.live if declared[f"f{name}".lower()] > 1]:
        problems = {name: Phrase("the block has an {own} of its own", own=f"f{name}") for name in taken}
        raise SpecError(*(placed(f"planner.live.{name}", problem) for name, problem in problems.items()))
    return PlannerBlock(
        filename=f"{spec.ascii_name}.st",
        text=text,
        modes=modes_of_live.modes,
        frequency_error=modes_of_live.error,
        period=_shortest_period(modes_of_live),
    )


def planner_constants(spec: Spec) -> tuple[LiveModes, PlannerConstants]:
    """Find what a planner block has to know of a spec's machine; raises as `planner_block`."""
    modes_of_live = live_modes(spec)
    planned = planned_axes(spec)
    if faults := unstated_limits(spec):
        raise SpecError(*faults)
    axes = tuple(_axis(spec, number, axis.suffix) for number, axis in planned.items())
    period = _shortest_period(modes_of_live)
    if period / (SLOTS_PER_PERIOD * spec.export.cycle_time) < FEWEST_CYCLES:
        most = period / (SLOTS_PER_PERIOD * FEWEST_CYCLES)
        problem = Phrase("at most {most:.2g} s for a machine that swings this fast", most=most)
        raise SpecError(placed("export.cycle_time", problem))
    operations = _operations(spec, period)
    sensed = sensor_constants(spec, between(len(modes_of_live.live)), modes_of_live.others)
    parts = [modes_of_live.interpolant, modes_of_live.others, *([sensed[1]] if sensed else [])]
    exponents, coefficients = same_terms(*parts)
    return modes_of_live, PlannerConstants(
        name=spec.ascii_name,
        machine=spec.machine().type,
        axes=axes,
        cycle=spec.export.cycle_time,
        live=modes_of_live.live,
        units=tuple(spec.machine().units[name] for name in modes_of_live.live),
        nominal=tuple(_nominal(spec, name) for name in modes_of_live.live),
        drift=tuple(
            LEAST_RATE * high + 2.0 * spec.planner.live_noise.get(name, 0.0)
            for name, (_, high) in modes_of_live.live.items()
        ),
        rates=spec.planner.live_rate,
        rope_length_gain=lowered(spec),
        events=spec.planner.events,
        zones=spec.planner.zones,
        operations=operations,
        states_operations=spec.planner.operations is not None,
        periods=tuple(
            2.0 * np.pi / _rates(modes_of_live, point)[0][0] for point in corners(modes_of_live.live)
        ),
        tilt=1.0 / gravity if (gravity := spec.plant.parameters.get("g")) else SPRINGS,
        sway_limit=min(spec.check.residual_sway.values()),
        stated_error=float(frequency_errors(spec).max(initial=0.0)),
        prompt=spec.planner.stop == "prompt",
        sway_share=_sway_share(spec),
        degrees=int(exponents.max(initial=0)) + 1,
        curvatures=[*modes_of_live.interpolant.curvatures, *modes_of_live.others.curvatures],
        exponents=exponents,
        least_decay=least_decay(spec),
        modes=modes_of_live.modes,
        model=np.vstack(coefficients),
        sensor=sensed[0] if sensed else None,
        sway=_sway(spec, modes_of_live),
    )


def _operations(spec: Spec, period: float) -> int:
    """Give those that a cycle may take: more by default, the slower the cycle and the quicker the swing."""
    least = ZONED_OPERATIONS if spec.planner.zones else OPERATIONS
    stated = spec.planner.operations
    if stated and stated < least:
        template = "at least {least} with zones, found {found}"
        raise SpecError(placed("planner.operations", Phrase(template, least=least, found=stated)))
    return stated or max(least, round(least * spec.export.cycle_time / 1e-3 * max(1.0, LEISURELY / period)))


def _sway(spec: Spec, modes_of_live: LiveModes) -> SwayConstants | None:
    """Find how the loads sway on any ropes, where the block follows them."""
    if not spec.planner.live_rate and spec.planner.sensor is None:
        return None
    found = sway_model(spec, modes_of_live.interpolant) or modal_model(spec, modes_of_live.interpolant)
    return SwayConstants(
        curvatures=found.curvatures, exponents=found.exponents, coefficients=found.coefficients
    )


def _shortest_period(modes_of_live: LiveModes) -> float:
    """Give that of the slowest mode in s, over the live ranges."""
    rates = (_rates(modes_of_live, point)[0][0] for point in corners(modes_of_live.live))
    return 2.0 * float(np.pi) / float(max(rates))


def _sway_share(spec: Spec) -> float:
    """Find how much sway in m plans may leave by the stated errors."""
    if spec.planner.live_rate or not frequency_errors(spec).max(initial=0.0) > 0.0:
        return 0.0
    return spec.planner.sway_share * min(spec.check.residual_sway.values())


def _axis(spec: Spec, number: int, suffix: str) -> AxisConstants:
    axis, own = spec.machine().actuated[number], spec.limits.of(number)
    velocity, acceleration, jerk, travel = own.velocity, own.acceleration, own.jerk, own.travel
    assert velocity and acceleration and jerk and travel
    return AxisConstants(
        name=axis.name,
        unit=axis.unit,
        suffix=suffix,
        start=spec.move.start[number],
        velocity=velocity,
        acceleration=acceleration,
        jerk=jerk,
        quick_deceleration=quick_limits(spec, number)[0],
        quick_jerk=quick_limits(spec, number)[1],
        travel=travel,
        targets=target_range(spec, number),
    )


def _nominal(spec: Spec, name: str) -> float:
    axes = [axis.name for axis in spec.machine().actuated]
    value = (
        spec.plant.parameters[name] if name in spec.plant.parameters else spec.move.start[axes.index(name)]
    )
    low, high = spec.planner.live[name]
    return min(max(value, low), high)


def _rates(live_modes: LiveModes, point: Sequence[float]) -> tuple[Array, Array]:
    invariants, decays = np.split(live_modes.interpolant(point), [live_modes.modes])
    return frequencies(invariants), decays
