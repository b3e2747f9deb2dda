"""Whether a block tells a sensor's faults by the motions of its own axis, as soon as these tell."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Self

import attrs
import numpy as np

from gen_profile.assurance.proof.sensing import EXCHANGED, GREATER, SensedHistory, stated_sensor
from gen_profile.motion.profile import Array
from gen_profile.planner.interface import BlockAxis
from gen_profile.spec.model import Spec
from gen_profile.spec.planner import DisturbanceSpec

SHOWS = {"": 1.0, "sign": -1.0, "scale": GREATER, "dead": 0.0}  # of the axis's own motions
TO_NOTICE = 2.0  # longest periods of own motion stronger than what else swings, within which a fault shows
STRONG = 2.5  # own motions by what else swings, root mean square of a period, at which that is known
KNOWN_TO = 1.0 / STRONG  # as no more of what else swings can look like own motions (Cauchy and Schwarz)
LEAKY = 0.3  # damping ratio by which what is shown of them is forgotten


def told_by_motions(
    spec: Spec,
    one: SensedHistory,
    axis: BlockAxis,
    issued: Mapping[str, Array],
    sway: Array,
    *,
    fault: str,
    cycle: float,
    period: float,
    resets: Sequence[float],
) -> Iterator[str]:
    """Say what is wrong with what a block makes of its axis's motions; its sensor may have a fault."""
    if fault not in (*SHOWS, EXCHANGED):
        return
    (_, disturbance), since = stated_sensor(spec), one.fails if fault else 0.0
    moved = OwnMotion.of(axis, issued, sway, disturbance, since=since, cycle=cycle, period=period)
    if fault in SHOWS and disturbance.gust is not None:
        yield from _misread(axis, issued, moved, fault=fault, resets=resets)
    if fault:
        swing = min(spec.check.residual_sway.values())
        yield from _unnoticed(axis, issued, moved, fault=fault, swing=swing)


@attrs.frozen(kw_only=True, eq=False)
class OwnMotion:
    """How much of a swing the axis's own motions make, since a sensor failed.

    Attributes
    ----------
    own : (cycles, 2) Array
        Mean square in m²/s⁴ of what swings by the motions since then, and by all of them.
    others : float
        m/s², what the strongest gust, and what swung as it failed, show beside it.
    used_for : (cycles,) Array
        s, for how long the sensor has been used.
    since, cycle, period : float
        s.
    """

    own: Array
    others: float
    used_for: Array
    since: float
    cycle: float
    period: float

    @classmethod
    def of(
        cls,
        axis: BlockAxis,
        issued: Mapping[str, Array],
        sway: Array,
        disturbance: DisturbanceSpec,
        *,
        since: float,
        cycle: float,
        period: float,
    ) -> Self:
        """Measure them by what a block issued, and a load's sway."""
        from scipy.signal import cont2discrete, lfilter  # noqa: PLC0415  (half of what the command line takes to start)

        cycles, used = np.arange(len(sway)), issued[axis.of("bSensorUsed")] != 0.0
        rate, used_for = 2.0 * np.pi / period, cycles - np.maximum.accumulate(np.where(used, -1, cycles))
        swings, fades, _ = cont2discrete(([1.0], [1.0, 2.0 * LEAKY * rate, rate**2]), cycle)
        # before, what swung at first and the offset are not known yet
        counts = (cycles * cycle > since) & (used_for * cycle > period)
        moved = issued[axis.of("fAcceleration")][:, None] * np.transpose([counts, np.ones_like(counts)])
        swung = rate**2 * lfilter(swings.ravel(), fades, moved, axis=0)
        share = cycle / period
        before = sway[max(0, round((since - period) / cycle)) : round(since / cycle)]  # shown otherwise later
        gust = disturbance.gust.acceleration if disturbance.gust is not None else 0.0
        return cls(
            own=lfilter([share], [1.0, share - 1.0], swung**2, axis=0),
            others=gust + rate**2 * np.abs(before).max(initial=0.0),
            used_for=np.asarray(used_for * cycle, dtype=float),
            since=since,
            cycle=cycle,
            period=period,
        )


def _misread(
    axis: BlockAxis, issued: Mapping[str, Array], moved: OwnMotion, *, fault: str, resets: Sequence[float]
) -> Iterator[str]:
    """Say whether what a sensor is found to show of the axis's own motions is wrong since it has a fault."""
    cycle, period, cycles = moved.cycle, moved.period, np.arange(len(moved.own))
    strength = np.sqrt(moved.own[:, 0]) / moved.others
    strength *= (moved.used_for > 2.0 * period) & (cycles * cycle > moved.since + 2.0 * period)
    strength *= cycles < min((round(time / cycle) for time in resets), default=len(cycles))  # when it forgets
    at = int(np.argmax(strength))
    scale = axis.of("fSensorScale")
    # of what it showed before it failed
    remembered = max(0.0, 1.0 - moved.own[at, 0] / max(moved.own[at, 1], 1e-300))
    wrong = abs(issued[scale][at] - SHOWS[fault] - remembered * (1.0 - SHOWS[fault]))
    if strength[at] > STRONG and wrong > KNOWN_TO:
        yield f"{scale} is wrong by {wrong:.3g}, at {at * cycle:.2f} s"


def _unnoticed(
    axis: BlockAxis, issued: Mapping[str, Array], moved: OwnMotion, *, fault: str, swing: float
) -> Iterator[str]:
    """Say whether a faulty sensor confirms more of the axis's own motion than is stated.

    Swings below `swing` in m do no harm.
    """
    confirms = (issued[axis.of("bSensorUsed")] != 0.0) & (issued[axis.of("nSensorFault")] == 0.0)
    others = max(moved.others, (2.0 * np.pi / moved.period) ** 2 * swing)
    strong = confirms & (moved.own[:, 0] > others**2)
    seconds = moved.cycle * np.cumsum(strong)
    allowed = TO_NOTICE * moved.period
    if seconds[-1] > allowed:
        yield (
            f"a faulty sensor ({fault}) confirms strong motions of its axis for too long by "
            f"{seconds[-1] - allowed:.3g} s, at {np.argmax(seconds > allowed) * moved.cycle:.2f} s"
        )
