"""Judging one history: which limits the block kept, and what sways on."""

from __future__ import annotations

from collections.abc import Iterator

from gen_profile.planner.design import quick_limits
from gen_profile.proof.histories import History
from gen_profile.proof.verdict import JudgedHistory
from gen_profile.spec.model import Spec
from gen_profile_exporters.st_to_c import FAULTS
from gen_profile_fmu.running.block_run import BlockRun

ROUNDING = 1e-9  # by which setpoints may miss a limit, in m and s
STEADY = 1e-9  # m, by which setpoints may move while the axis stands


def judge_run(
    spec: Spec, run: BlockRun, history: History, *, cycle: float, number: int, group: str
) -> JudgedHistory:
    """Judge what became of a history.

    Parameters
    ----------
    spec : Spec
    run : BlockRun
    history : History
        Of that run.
    cycle : float
        s.
    number : int
    group : str
    """
    loads = spec.machine().loads
    last = max(command.time for command in history.commands)
    limits = _shares(spec, history, run)
    return JudgedHistory(
        number=number,
        group=group,
        history=history,
        cycles=run.cycles,
        rests_after=max(0.0, run.stands * cycle - last) if run.stands >= 0 else None,
        promise=run.promise,
        residual=dict(zip(loads, run.residual.tolist(), strict=True)),
        on_the_way=dict(zip(loads, run.on_the_way.tolist(), strict=True)),
        limits=limits,
        faults=tuple(_faults(history, run, limits)),
    )


def _shares(spec: Spec, history: History, run: BlockRun) -> dict[str, float]:
    own, (axis,) = spec.limits.of(0), run.axes
    assert own.velocity and own.acceleration and own.jerk and own.travel
    acceleration, jerk = quick_limits(spec) if history.brakes else (own.acceleration, own.jerk)
    low, high = own.travel
    return {
        "velocity": axis.velocity / own.velocity,
        "acceleration": axis.acceleration / acceleration,
        "jerk": axis.jerk / jerk,
        "beyond_travel_m": max(low - axis.lowest, axis.highest - high, 0.0),
    }


def _faults(history: History, run: BlockRun, limits: dict[str, float]) -> Iterator[str]:
    """Say what is wrong, each in words that end a sentence."""
    (axis,) = run.axes
    if run.fault:
        yield f"the block {FAULTS[run.fault]}"
        return
    for name in ("velocity", "acceleration", "jerk"):
        if not limits[name] <= 1.0 + ROUNDING:
            yield f"the {name} is above its limit by {100.0 * (limits[name] - 1.0):.3g} %"
    if not limits["beyond_travel_m"] <= ROUNDING:
        yield f"the axis leaves its travel by {limits['beyond_travel_m']:.3g} m"
    if not axis.gap <= ROUNDING and not history.brakes:  # a quick stop ends within a cycle
        yield f"a setpoint jumps by {axis.gap:.3g} m"
    if run.stands < 0:
        yield "the axis does not come to rest"
    elif not axis.creep <= STEADY:
        yield f"the axis moves on at rest by {axis.creep:.3g} m"
    if run.error:
        yield f"the block shows error {run.error}"
    if not run.promise and not history.brakes:
        yield "the block takes its promise back"
