"""What a block shows of itself in every cycle: ``aState``, that ``state.st`` and ``requests.st`` write."""

from typing import ClassVar, TypeVar

import attrs
import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.support.errors import DeploymentError
from gen_profile_exporters.playback.buffers import AXIS_STATE, STATE_HEAD, state_length

IDLE, WAITING, MOVING, DONE, ABORTED, FAILED = range(6)  # phases of a playback block
DISABLED, STANDING, GUIDED, BRAKING = range(4)  # and of a planner block: nState
NO_COMMAND, TO_POSITION, AT_VELOCITY = range(3)  # nCommand
WHOLE = 10  # values that are whole numbers, ahead of the others
GREATEST_COUNT = 2.0**52  # of whatever is counted


@attrs.frozen(kw_only=True, eq=False)
class BlockState:
    """One cycle of a block, whichever it is.

    Attributes
    ----------
    calls : int
        Cycles since the block was loaded.
    phase : int
        Of `PHASES`.
    error : int
        ``nErrorId``.
    off_nominal : bool
        Whether the load may sway: the timing no longer cancels it, or a planner block does not promise it.
    buffer : int
        The one in use.
    checked : int
        Whether the checksum of the buffer in use was found right (1), wrong (2), or not yet worked out (0).
    checksum : int
    kind : float
        What blocks that take each other's tables have in common, as a number.
    position, velocity, acceleration : (axes,) array
        Setpoints, in axis units and s.
    """

    PHASES: ClassVar[tuple[str, ...]]
    HEAD: ClassVar[tuple[str, ...]]  # names of the values ahead of the axes', but the last; empty: unused
    OF_AXIS: ClassVar[tuple[str, ...]]

    calls: int
    phase: int
    error: int
    off_nominal: bool = attrs.field(converter=bool)
    buffer: int
    checked: int
    checksum: int
    kind: float
    position: Array
    velocity: Array
    acceleration: Array

    @property
    def phase_name(self) -> str:
        """Name the phase."""
        return self.PHASES[self.phase]

    @property
    def setpoints(self) -> Array:
        """Position, velocity and acceleration, shape (3, axes)."""
        return np.array((self.position, self.velocity, self.acceleration))


@attrs.frozen(kw_only=True, eq=False)
class MotionState(BlockState):
    """One cycle of a playback block.

    Attributes
    ----------
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
    gain, shift : (axes,) array
        Of the path's positions, to which the setpoints lead: 1, and 0 in axis units, as planned.
    """

    PHASES = ("idle", "waiting", "moving", "done", "aborted", "failed")
    HEAD = ("runs", "cycle", "motion", "fraction", "rate", "slope")
    OF_AXIS = ("gain", "shift")

    runs: int
    cycle: int
    motion: int
    fraction: float
    rate: float
    slope: float
    gain: Array
    shift: Array

    @property
    def place(self) -> float:
        """How far the motion is, in cycles as planned."""
        return self.cycle + self.fraction


@attrs.frozen(kw_only=True, eq=False)
class PlannerState(BlockState):
    """One cycle of a planner block.

    Attributes
    ----------
    disabled_at : int
        The last of the calls in which it was disabled.
    command : int
        ``nCommand``.
    promise : int
        ``nPromise``.
    time_to_go : float
        s, of what is committed.
    target, speed : (axes,) array
        Of the command to a position, and of the one to a velocity, in axis units and s.
    """

    PHASES = ("disabled", "standing", "moving", "braking")
    HEAD = ("disabled_at", "command", "promise", "time_to_go", "", "")
    OF_AXIS = ("target", "speed")

    disabled_at: int
    command: int
    promise: int
    time_to_go: float
    target: Array
    speed: Array


_FIRST = ("calls", "phase", "error", "off_nominal", "buffer", "checked", "checksum")
State = TypeVar("State", bound=BlockState)


def read_state(values: Array, axes: int, kind: type[State]) -> State | None:
    """Take a block's state apart.

    Parameters
    ----------
    values : (values,) array
        Of ``aState``.
    axes : int
    kind : type
        `MotionState` or `PlannerState`.

    Returns
    -------
    BlockState or None
        None where the values are of two cycles, or no cycle was yet.

    Raises
    ------
    DeploymentError
        They are no state of such a block for so many axes.
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
    in_range = (whole >= 0.0).all() and (whole <= GREATEST_COUNT).all() and whole[1] < len(kind.PHASES)
    if not np.isfinite(values).all() or (whole != np.floor(whole)).any() or not in_range:
        raise DeploymentError(
            "aState holds no state of a block; let the controller show it as an array of LREAL, "
            "written by nothing but the block."
        )
    head = [int(value) for value in whole.tolist()] + values[WHOLE:STATE_HEAD].tolist()
    of_axes = values[STATE_HEAD:-1].reshape(axes, len(AXIS_STATE)).T
    names = (*_FIRST, *kind.HEAD, "kind", "position", "velocity", "acceleration", *kind.OF_AXIS)
    fields = dict(zip(names, (*head, *of_axes), strict=True))
    fields.pop("", None)
    return kind(**fields)
