"""What a playback block shows of itself in every cycle (``state.st`` writes it)."""

from __future__ import annotations

import attrs
import numpy as np

from gen_profile.errors import DeploymentError
from gen_profile.motion.profile import Array
from gen_profile_exporters.playback.buffers import AXIS_STATE, STATE_HEAD, state_length

IDLE, WAITING, MOVING, DONE, ABORTED, FAILED = range(6)
PHASES = ("idle", "waiting", "moving", "done", "aborted", "failed")
WHOLE = 10  # values that are whole numbers, ahead of the others
MOST = 2.0**52  # of whatever is counted


@attrs.frozen(kw_only=True, eq=False)
class BlockState:
    """One cycle of a block.

    Attributes
    ----------
    calls : int
        Cycles since the block was loaded.
    phase : int
        Of `PHASES`.
    error : int
        ``nErrorId``.
    off_nominal : bool
        Whether the timing no longer cancels the sway.
    buffer : int
        The one in use.
    checked : int
        Whether the checksum of the buffer in use was found right (1), wrong (2), or not yet worked out (0).
    checksum : int
    runs : int
        Starts since the block was loaded, those of a way that was left included.
    cycle : int
        Along the path of
    motion : int
        the one that is selected, and
    fraction : float
        of the next cycle.
    rate, slope : float
        Along the path, 1 as planned; and its change, in 1/s.
    position, velocity, acceleration : (axes,) array
        Setpoints, in axis units and s.
    kind : float
        What blocks that take each other's tables have in common, as a number.
    gain, shift : (axes,) array
        Of the path's positions, to which the setpoints lead: 1, and 0 in axis units, as planned.
    """

    calls: int
    phase: int
    error: int
    off_nominal: bool
    buffer: int
    checked: int
    checksum: int
    runs: int
    cycle: int
    motion: int
    fraction: float
    rate: float
    slope: float
    kind: float
    position: Array
    velocity: Array
    acceleration: Array
    gain: Array
    shift: Array

    @property
    def place(self) -> float:
        """How far the motion is, in cycles as planned."""
        return self.cycle + self.fraction

    @property
    def setpoints(self) -> Array:
        """Position, velocity and acceleration, shape (3, axes)."""
        return np.array((self.position, self.velocity, self.acceleration))


def read_state(values: Array, axes: int) -> BlockState | None:
    """Take a block's state apart.

    Parameters
    ----------
    values : (values,) array
        Of ``aState``.
    axes : int

    Returns
    -------
    BlockState or None
        None where the values are of two cycles, or no cycle was yet.

    Raises
    ------
    DeploymentError
        They are no state of a block for so many axes.
    """
    if len(values) != state_length(axes):
        raise DeploymentError(
            "aState has {found} values there in place of {due}: the block is of another version, or for "
            "other axes. Export it again, and load it into the controller.",
            found=len(values),
            due=state_length(axes),
        )
    if values[0] != values[-1] or values[0] == 0.0:
        return None
    whole = values[:WHOLE]
    if not np.isfinite(values).all() or (whole != np.floor(whole)).any() or not _in_range(whole):
        raise DeploymentError(
            "aState holds no state of a block; let the controller show it as an array of LREAL, "
            "written by nothing but the block."
        )
    counts = [int(value) for value in whole.tolist()]
    of_axes = values[STATE_HEAD:-1].reshape(axes, len(AXIS_STATE)).T
    names = [field.name for field in attrs.fields(BlockState)]
    fields = dict(zip(names, (*counts, *values[WHOLE:STATE_HEAD].tolist(), *of_axes), strict=True))
    return BlockState(**fields | {"off_nominal": bool(fields["off_nominal"])})


def _in_range(whole: Array) -> bool:
    return bool((whole >= 0.0).all() and (whole <= MOST).all() and whole[1] < len(PHASES))
