"""Judging one history: which limits the block kept, and what sways on."""

from collections.abc import Callable, Iterator, Sequence

import attrs

from gen_profile.assurance.proof.exercised import Pairs
from gen_profile.assurance.proof.histories import History
from gen_profile.assurance.proof.numbering import LONG, RHYTHMS, Numbering
from gen_profile.assurance.proof.promptness import Obeyed
from gen_profile.assurance.proof.verdict import TAKEN_BACK, JudgedHistory
from gen_profile.planner.interface import BlockAxis
from gen_profile.planner.stated import quick_limits
from gen_profile.spec.model import Spec
from gen_profile_exporters.st_to_c import FAULTS
from gen_profile_fmu.running.block_run import NO_NUMBER, AxisExtremes, BlockRun

ROUNDING = 1e-9  # by which setpoints may miss a limit, in m and s
STEADY = 1e-9  # m, by which setpoints may move while the axis stands

Judge = Callable[[Numbering, Sequence[int]], list[JudgedHistory]]


@attrs.frozen(kw_only=True, eq=False)
class WatchedRun:
    """What became of a history.

    Attributes
    ----------
    run : BlockRun
    faults : tuple of str
        What the block did other than commanded, in words that end a sentence.
    left : float
        m, that stated errors leave at most on the linear machine, as long as the block promises.
    overstated : float
        `fSwayLeft` by what stated errors leave if each axis and mode has a worst machine of its own, at most.
    obeyed : sequence of Obeyed
        How soon its commands were carried out.
    exercised : mapping
        How often inputs changed, and outputs came, in which state.
    unproven : bool
        Whether a sensor had at the end not yet shown a motion of its axis, so that nothing may be promised.
    braked : bool
        Whether axes were braked as an interval came nearer than it was stated that they stop.
    hurried : bool
        Whether one stopped in less time, or on a shorter way, than a stop takes that leaves nothing.
    """

    run: BlockRun
    faults: tuple[str, ...] = ()
    left: float = 0.0
    overstated: float = 0.0
    obeyed: Sequence[Obeyed] = ()
    exercised: Pairs = attrs.field(factory=dict)
    unproven: bool = False
    braked: bool = False
    hurried: bool = False


def judge_run(
    spec: Spec, watched: WatchedRun, history: History, *, cycle: float, number: int, group: str
) -> JudgedHistory:
    """Judge what became of a history.

    Parameters
    ----------
    spec : Spec
    watched : WatchedRun
    history : History
        Of that run.
    cycle : float
        s.
    number : int
    group : str
    """
    loads = spec.machine().loads
    last = max(command.time for command in history.commands)
    run = watched.run
    limits = _shares(spec, history, run)
    return JudgedHistory(
        number=number,
        group=group,
        history=history,
        cycles=run.cycles,
        rests_after=max(0.0, run.stands * cycle - last) if run.stands >= 0 else None,
        promise=run.promise and not (history.misinformed or watched.braked),
        residual=dict(zip(loads, run.residual.tolist(), strict=True)),
        on_the_way=dict(zip(loads, run.on_the_way.tolist(), strict=True)),
        limits=limits,
        left=watched.left,
        overstated=watched.overstated,
        obeyed=tuple(watched.obeyed),
        exercised=watched.exercised,
        faults=(
            *_faults(spec, history, watched, limits, cycle=cycle, lasts=group in (RHYTHMS, LONG)),
            *watched.faults,
        ),
    )


def _shares(spec: Spec, history: History, run: BlockRun) -> dict[str, float]:
    """Shares of the limits that are taken, by quantity, and by axis where there are several."""
    shares: dict[str, float] = {}
    for (number, named), axis in zip(history.axes.items(), run.axes, strict=True):
        own = spec.limits.of(number)
        assert own.velocity and own.acceleration and own.jerk and own.travel
        acceleration, jerk = quick_limits(spec, number) if history.brakes else (own.acceleration, own.jerk)
        start, (low, high) = history.places[number], own.travel
        shares |= {
            f"{named.prefix}velocity": axis.velocity / own.velocity,
            f"{named.prefix}acceleration": axis.acceleration / acceleration,
            f"{named.prefix}jerk": axis.jerk / jerk,
            f"{named.prefix}beyond_travel_{named.unit}": max(
                min(low, start) - axis.lowest, axis.highest - max(high, start), 0.0
            ),
        }
    return shares


def _faults(
    spec: Spec, history: History, watched: WatchedRun, limits: dict[str, float], *, cycle: float, lasts: bool
) -> Iterator[str]:
    """Say what is wrong, each in words that end a sentence; in one that lasts long errors may add up."""
    run = watched.run
    if run.fault:
        yield "a setpoint is no number" if run.fault == NO_NUMBER else f"the block {FAULTS[run.fault]}"
        return
    for (number, named), axis in zip(history.axes.items(), run.axes, strict=True):
        braked = (
            (spec.limits.of(number).jerk or 0.0) * cycle**3 * watched.braked
        )  # braking ends within a cycle
        yield from _axis_faults(history, named, axis, limits, ROUNDING + braked)
    if run.stands < 0:
        yield "the axis does not come to rest" if len(run.axes) == 1 else "the axes do not come to rest"
    unknown = history.brakes or history.disturbed or watched.hurried or watched.unproven or watched.braked
    if not run.promise and not (unknown or lasts):
        yield TAKEN_BACK


def _axis_faults(
    history: History, named: BlockAxis, axis: AxisExtremes, limits: dict[str, float], gap: float
) -> Iterator[str]:
    of, which = (f" of {named.name}", f"axis {named.name}") if named.name else ("", "axis")
    for name in ("velocity", "acceleration", "jerk"):
        ratio = limits[f"{named.prefix}{name}"]
        if not ratio <= 1.0 + ROUNDING:
            yield f"the {name}{of} is above its limit by {100.0 * (ratio - 1.0):.3g} %"
    beyond = limits[f"{named.prefix}beyond_travel_{named.unit}"]
    if not beyond <= ROUNDING and not history.moved:
        yield f"the {which} leaves its travel by {beyond:.3g} {named.unit}"
    if not axis.gap <= gap and not (history.brakes or history.moved):  # a quick stop ends within a cycle
        yield f"a setpoint{of} jumps by {axis.gap:.3g} {named.unit}"
    if not axis.creep <= STEADY:
        yield f"the {which} moves on at rest by {axis.creep:.3g} {named.unit}"
