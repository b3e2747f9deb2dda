"""Whether a block uses its sensors well: a verdict on each history with one."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from gen_profile.assurance.proof.own_motion import told_by_motions
from gen_profile.assurance.proof.sensing import EXCHANGED, SensedHistory, stated_sensor
from gen_profile.motion.profile import Array
from gen_profile.planner.directions import planned_axes, sensed_directions
from gen_profile.planner.interface import UNPROVEN, BlockAxis
from gen_profile.planner.stated import damping_room
from gen_profile.spec.model import Spec
from gen_profile_fmu.running.block_run import BlockRun

NOTICED = ("silent", "away", "no number", "out of range")  # others are noticed where they do harm
SHOW_NOTHING = ("frozen",)  # from the first value on, and nothing is promised then
TAKEN_UP = 5  # cycles, in which the block shows that it has taken up a command


def sensor_faults(
    spec: Spec,
    one: SensedHistory,
    run: BlockRun,
    outputs: Sequence[str],
    *,
    cycle: float,
    period: float,
    last: float,
    estimation_error: float,
    resets: Sequence[float] = (),
) -> Iterator[str]:
    """Say what is wrong with how a block used its sensor, each in words that end a sentence.

    Parameters
    ----------
    spec : Spec
    one : SensedHistory
    run : BlockRun
        With its trace, which has these outputs, then the loads' sway.
    outputs : sequence of str
    cycle, period, last : float
        s: a cycle, the slowest swing, and when the last command came, or an input last changed.
    estimation_error : float
        m, by which an estimate may be off beside what it states, from `estimation_error`.
    resets : sequence of float
        s, when bReset was set.
    """
    assert run.trace is not None
    issued, axes = dict(zip(outputs, run.trace.T, strict=False)), planned_axes(spec)
    for place, (number, direction) in enumerate(sensed_directions(spec).items()):
        axis, fault = axes[number], one.fault if place == one.failing or one.fault == EXCHANGED else ""
        sway = run.trace[:, len(outputs) + direction.end_load]
        if not one.fault:
            yield from _misestimated(axis, issued, sway, estimation_error, cycle)
        yield from told_by_motions(
            spec, one, axis, issued, sway, fault=fault, cycle=cycle, period=period, resets=resets
        )
        shown = issued[axis.of("nSensorFault")]
        if fault:
            yield from _faults_of_a_faulty_one(spec, one, run, sway, shown, cycle=cycle)
        else:
            yield from _refused(axis, shown, cycle)
    if not one.fault and run.stands >= 0:
        yield from _swings_on(spec, one, run, issued, cycle=cycle, last=last)


def _refused(axis: BlockAxis, shown: Array, cycle: float) -> Iterator[str]:
    """Say whether a sound sensor is taken for a faulty one."""
    refused = np.flatnonzero((shown != 0.0) & (shown != UNPROVEN))
    if len(refused):
        at = int(refused[0])
        yield (
            f"a sound sensor is taken for a faulty one ({axis.of('nSensorFault')} {shown[at]:.0f}), "
            f"at {at * cycle:.2f} s"
        )


def _swings_on(
    spec: Spec, one: SensedHistory, run: BlockRun, issued: Mapping[str, Array], *, cycle: float, last: float
) -> Iterator[str]:
    """Say which loads swing for longer than is stated, with sound sensors, once the axes rest."""
    assert run.trace is not None
    _, disturbance = stated_sensor(spec)
    places = np.stack([issued[axis.of("fPosition")] for axis in planned_axes(spec).values()])
    near = (np.abs(places - places[:, -1:]) <= damping_room(spec)).all(axis=0)
    rests = (issued["bBusy"] == 0.0) | (near & (issued["bDamping"] != 0.0))  # not damped on the way
    first = min(round(last / cycle) + TAKEN_UP, len(rests) - 1)
    arrived = first + int(np.argmax(rests[first:]))
    settled = max(arrived, round(one.ends / cycle)) + round(disturbance.settle / cycle)
    sways = np.abs(run.trace[settled:, len(issued) :])
    for (load, most), column in zip(spec.check.residual_sway.items(), sways.T, strict=True):
        if len(column) and column.max() > most:
            late = np.flatnonzero(column > most)[-1] * cycle
            yield (
                f"the {load} is damped to check.residual_sway later than allowed by {late:.3g} s, at "
                f"{settled * cycle:.2f} s"
            )


def _misestimated(
    axis: BlockAxis, issued: Mapping[str, Array], sway: Array, estimation_error: float, cycle: float
) -> Iterator[str]:
    """Say whether the estimated sway is off by more than is stated."""
    uncertainty = axis.of("fSwayUncertainty")
    off = np.abs(issued[axis.of("fSwayEstimated")] - sway) - issued[uncertainty] - estimation_error
    off *= issued[axis.of("bSensorUsed")] != 0.0
    at = int(np.argmax(off))
    if off[at] > 0.0:
        yield f"{uncertainty} is too small by {off[at]:.3g} m, at {at * cycle:.2f} s"


def _faults_of_a_faulty_one(
    spec: Spec, one: SensedHistory, run: BlockRun, sway: Array, shown: Array, *, cycle: float
) -> Iterator[str]:
    """Say what is wrong where a sensor is: noticed too late, or the load made to sway."""
    sensor, disturbance = stated_sensor(spec)
    refused = (shown != 0.0) & (shown != UNPROVEN)
    known = bool(refused.any()) or shown[-1] == UNPROVEN
    noticed = (int(np.argmax(refused)) if refused.any() else len(shown)) * cycle if known else np.inf
    late = noticed - one.fails - sensor.drop_out
    if one.fault in NOTICED and late > sensor.drop_out:  # as much later, where news failed to come before
        yield f"the sensor's fault is not noticed ({one.fault}, at {one.fails:.2f} s)"
    if not known and not run.promise and one.fault not in SHOW_NOTHING:
        yield f"the sensor's fault is neither noticed nor harmless ({one.fault}, at {one.fails:.2f} s)"
    swings = float(np.abs(sway[round(one.fails / cycle) :]).max(initial=0.0))
    # what swung as it failed, and an axis once led from one end of its room for damping to the other
    if swings > min(disturbance.swing.values()) + 2.0 * damping_room(spec):
        yield f"a faulty sensor ({one.fault}) makes the load swing by {swings:.3g} m, at {one.fails:.2f} s"
    if one.fault == "away" and refused[-1]:
        yield f"a sensor that is back is not used again, from {one.fails:.2f} s"
