"""The way of setpoints from the artefact to the axes: what the drives make of them, and what goes wrong."""

from collections.abc import Sequence

import attrs
import numpy as np

from gen_profile.assurance.verification.batch import Feed
from gen_profile.dynamics.evaluation.scenarios import SEARCH, TIMING, Scenario
from gen_profile.motion.profile import Array, SampledProfile
from gen_profile.spec.disturbances import PathSpec
from gen_profile.spec.model import Spec
from gen_profile.support.errors import SpecError

LEAP = 1e-3  # of a cycle, in which a drive that holds setpoints is given the next one
MOST_JITTER = 0.45  # of a cycle: setpoints must not overtake one another


def transmitted(spec: Spec, setpoints: SampledProfile, rows: Sequence[Scenario]) -> Feed:
    """Lead setpoints to the drives of some scenarios of one group.

    Parameters
    ----------
    spec : Spec
        Of which ``check.path`` is taken, but for machines at ends and corners: those get setpoints as the
        artefact has them.
    setpoints : SampledProfile
    rows : sequence of Scenario
        Of one group. Faults of timing are drawn for each by the spec's seed and its number.

    Returns
    -------
    Feed
        Of all rows together, or one for each where the timing differs.

    Raises
    ------
    SpecError
        The jitter is too large for the artefact's cycle.
    """
    path = path_taken(spec, rows[0])
    times, position = setpoints.times, setpoints.position
    if path.quantum > 0.0:
        position = path.quantum * np.round(position / path.quantum)
    if path.faulty:
        feeds = [_mistimed(spec, times, position, row) for row in rows]
        times, position = (np.stack(arrays) for arrays in zip(*feeds, strict=True))
    if path.between == "hold":
        times, position = _held(times, position, setpoints.cycle_time)
    return Feed(times=times, position=position)


def path_taken(spec: Spec, scenario: Scenario) -> PathSpec:
    """Tell on which path setpoints come to the axes of one scenario."""
    lag = lag_of(spec, scenario)
    if follows_exactly(scenario):
        return PathSpec(lag=(lag, lag))
    path = attrs.evolve(spec.check.path, lag=(lag, lag))
    return path if scenario.group == TIMING else attrs.evolve(path, latency=0.0, jitter=0.0, lost=0.0)


def lag_of(spec: Spec, scenario: Scenario) -> float:
    """Time constant in s of the drives in one scenario; 0 of those that follow at once."""
    return (spec.actuator.tau or 0.0) if scenario.lag is None else scenario.lag


def follows_exactly(scenario: Scenario) -> bool:
    """Whether the drives follow the setpoints as the artefact has them."""
    return scenario.group in ("machines", "corners", SEARCH)


def delay(path: PathSpec) -> float:
    """Longest time in s by which the last setpoint comes late."""
    return path.latency + path.jitter


def followed_up(feed: Feed, times: Array, velocity: Sequence[float]) -> Feed:
    """Go on after the last setpoint, at rest or at a velocity.

    Parameters
    ----------
    feed : Feed
    times : (points,) array
        s, rising, after all setpoints.
    velocity : (axes,) sequence of float
        m/s (or rad/s).
    """
    beyond = times - feed.times[..., -1:]
    onward = feed.position[..., -1:, :] + beyond[..., None] * np.array(velocity)
    return Feed(
        times=np.concatenate([feed.times, np.broadcast_to(times, beyond.shape)], axis=-1),
        position=np.concatenate([feed.position, onward], axis=-2),
    )


def _mistimed(spec: Spec, times: Array, position: Array, row: Scenario) -> tuple[Array, Array]:
    """Let setpoints come late, at uneven times, or not at all; the first is where the axes stand anyway.

    The last one comes: a controller sends it again and again.
    """
    path, cycle = spec.check.path, float(times[1] - times[0])
    if path.jitter > MOST_JITTER * cycle:
        raise SpecError(
            f"check.path.jitter: must be at most {MOST_JITTER:g} of the cycle, which is {1e3 * cycle:g} ms; "
            "setpoints that overtake one another are lost ones (check.path.lost)."
        )
    random = np.random.default_rng([spec.check.seed, row.row])
    uneven = random.uniform(-path.jitter, path.jitter, len(times) - 1)
    lost = np.flatnonzero(random.random(len(times) - 2) < path.lost) + 1
    due = times + path.latency
    due[1:] += uneven
    arrived = np.ones(len(times), dtype=np.bool_)
    arrived[lost] = False
    latest = np.maximum.accumulate(np.where(arrived, np.arange(len(times)), 0))
    start = 0.0 if path.latency > 0.0 else -cycle  # a point more, so that all rows are alike
    return np.concatenate([[start], due]), np.concatenate([position[:1], position[latest]])


def _held(times: Array, position: Array, cycle: float) -> tuple[Array, Array]:
    """Stand still until a setpoint comes, and be given it at once."""
    leap = LEAP * cycle
    points = np.stack([times[..., 1:], times[..., 1:] + leap], axis=-1)
    stood = np.stack([position[..., :-1, :], position[..., 1:, :]], axis=-2)
    points = points.reshape(*times.shape[:-1], -1)
    stood = stood.reshape(*position.shape[:-2], -1, position.shape[-1])
    held = np.concatenate([position[..., :1, :], stood], axis=-2)
    return np.concatenate([times[..., :1], points], axis=-1), held
