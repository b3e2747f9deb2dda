"""How ropes, and other live parameters, change on the way: leg by leg, each of one speed."""

from collections.abc import Mapping, Sequence
from itertools import accumulate, pairwise

from gen_profile.assurance.proof.habits import between, widened
from gen_profile.motion.profile import Array
from gen_profile.spec.planner import PlannerSpec

LEGS = 8  # of one speed each
PER_LEG = 2  # choices: speed, how long


def hoisted_ropes(
    planner: PlannerSpec, choices: Array, live_values: Mapping[str, float], until: float
) -> dict[str, tuple[tuple[float, float], ...]]:
    """Let live parameters change, leg by leg, at their greatest rates or below, as `History.hoisting`."""
    rates, hoisting = planner.live_rate, {}
    for (name, rate), legs in zip(rates.items(), choices.reshape(len(rates), LEGS, PER_LEG), strict=True):
        speeds = [rate * between((-1.0, 1.0), widened(fraction, 0.25)) for fraction in legs[:, 0].tolist()]
        shares = 0.1 + legs[:, 1]
        times = list(accumulate((until * shares / shares.sum()).tolist(), initial=0.0))
        hoisting[name] = _bouncing(live_values[name], speeds, times, planner.live[name])
    return hoisting


def _bouncing(
    value: float, speeds: Sequence[float], times: Sequence[float], ends: tuple[float, float]
) -> tuple[tuple[float, float], ...]:
    """Corners of a line of these speeds between rising times, which turns round at the ends of its range."""
    corners, sign, (low, high) = [(times[0], value)], 1.0, ends
    for speed, (begin, end) in zip(speeds, pairwise(times), strict=True):
        time = begin
        while speed:
            bound = high if sign * speed > 0.0 else low
            arrives = time + abs((bound - value) / speed)
            if arrives >= end:
                break
            if arrives > time:
                corners.append((arrives, bound))
            time, value, sign = arrives, bound, -sign
        value = min(max(value + sign * speed * (end - time), low), high)
        corners.append((end, value))
    return tuple(corners)
