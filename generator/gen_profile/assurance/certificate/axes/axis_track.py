"""Where the axes are when a file's setpoints are played: on straight lines, or behind those by a drive's lag.

A drive of first order is at y, with τ ẏ = r − y, where r goes from setpoint to setpoint along straight lines.
Where those have the slope v, it trails by y − r = −τ v + (y₀ − r₀ + τ v) exp(−t/τ), and since y = r − τ ẏ,
integrals of y need nothing else. So the axes' motion is known, however the machine swings.
"""

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import Array, Ball, ball, concatenate, exp
from gen_profile.dynamics.evaluation.residual_sway import STANDSTILL
from gen_profile.motion.profile import SampledProfile

FINER = 4  # points per setpoint
FEWEST = 10  # setpoints held, as it were, until a lag has faded


@attrs.frozen(kw_only=True, eq=False)
class Track:
    """Motion of the axes, at points until they stand still, or go straight on.

    Attributes
    ----------
    times : (points,) array
        s; every `FINER`-th is a setpoint's.
    parts : tuple of int
        Which of every `FINER`-th points the first setpoint, the last one and the end are: only there may the
        acceleration leap.
    position : (points, m) Ball
    areas : (points − 1, m) Ball
        Integrals of the position from point to point.
    bend : (points − 1, m) array
        Bounds of the acceleration between points; 0 along straight lines.
    velocity : (m,) array
        After the last point.
    creep, late_bend : (m,) array
        Bounds of what position and acceleration still differ by then.
    """

    times: Array
    parts: tuple[int, ...]
    position: Ball
    areas: Ball
    bend: Array
    velocity: Array
    creep: Array
    late_bend: Array


def track_of(setpoints: SampledProfile, velocity: Array, tau: float) -> Track:
    """Let the axes follow setpoints as drives interpolate them.

    Parameters
    ----------
    setpoints : SampledProfile
    velocity : (m,) array
        After the last one.
    tau : float
        Time constant of the drives in s; 0 of those that do not lag.
    """
    times, asked = setpoints.times, ball(setpoints.position)
    parts: tuple[int, ...] = (0, len(times) - 1)
    if tau:
        cycles = max(FEWEST, int(np.ceil(STANDSTILL * tau / setpoints.cycle_time)))
        more = np.linspace(times[-1], times[-1] + STANDSTILL * tau, cycles + 1)[1:]
        onward = (ball(more) - times[-1])[:, None] * velocity + setpoints.position[-1]
        times, asked = np.concatenate([times, more]), concatenate([asked, onward])
        parts = (*parts, len(times) - 1)
    lines = _on_lines(times, asked, velocity, parts)
    return _behind(lines, tau) if tau else lines


def _on_lines(times: Array, asked: Ball, velocity: Array, parts: tuple[int, ...]) -> Track:
    """Go along straight lines from setpoint to setpoint."""
    shares = np.arange(FINER) / FINER
    fine = (times[:-1, None] + np.diff(times)[:, None] * shares).ravel()
    before = np.arange(len(fine)) // FINER
    fraction = (ball(fine) - times[before]) / (ball(times[1:]) - times[:-1])[before]
    between = asked[before] + (asked[1:] - asked[:-1])[before] * fraction[:, None]
    fine, position = np.append(fine, times[-1]), concatenate([between, asked[-1:]])
    step, nothing = (ball(fine[1:]) - fine[:-1])[:, None], np.zeros(len(velocity))
    return Track(
        times=fine,
        parts=parts,
        position=position,
        areas=0.5 * step * (position[1:] + position[:-1]),
        bend=np.zeros((len(fine) - 1, len(velocity))),
        velocity=velocity,
        creep=nothing,
        late_bend=nothing,
    )


def _behind(lines: Track, tau: float) -> Track:
    """Follow straight lines with a lag."""
    step = (ball(lines.times[1:]) - lines.times[:-1])[:, None]
    kept = exp(-step / tau)
    led = tau * (lines.position[1:] - lines.position[:-1]) / step  # τ v
    trail = _trail(kept, led)
    position = lines.position + trail
    creep = (trail[-1] + tau * lines.velocity).most
    return attrs.evolve(
        lines,
        position=position,
        areas=lines.areas - tau * (position[1:] - position[:-1]),
        bend=(trail[:-1] + led).most / tau**2,
        creep=creep,
        late_bend=creep / tau**2,
    )


def _trail(kept: Ball, led: Ball) -> Ball:
    """Enclose y − r at points, which follows e' = E e − (1 − E) τ v from 0 on.

    Plain numbers that nearly do are off by no more than the greatest error of a step over 1 − E.
    """
    decay, lost = kept.mid, ((1.0 - kept) * led).mid
    near = np.zeros((len(decay) + 1, lost.shape[1]))
    for point, (factor, less) in enumerate(zip(decay, lost, strict=True)):
        near[point + 1] = factor * near[point] - less
    defect = (kept * near[:-1] - (1.0 - kept) * led - near[1:]).most.max(axis=0)
    off = defect / (1.0 - kept.upper.max()) * (1.0 + 1e-12)
    return Ball(near, np.broadcast_to(off, near.shape))
