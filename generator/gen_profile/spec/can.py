"""What a spec says of drives on a CAN bus."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import attrs

from gen_profile.spec.structure import Checked
from gen_profile.spec.values import NONE, AxisName, Bounds, CycleTime, Distance, Pattern, Positive, example
from gen_profile.support.bounded_file import DOCUMENT, read_bounded

Unsigned32 = Annotated[int, Bounds(least=1, most=0xFFFF_FFFF)]
NodeId = Annotated[int, Bounds(least=1, most=127)]
# what CiA 301 leaves to PDOs: EMCY lies below, SDOs above
PdoCobId = Annotated[int, Bounds(least=0x181, most=0x57F, meaning="(181h to 57Fh)")]
# candump separates its name from the rest by a space
Channel = Annotated[str, Pattern(r"[!-~]{1,60}", "the name of a channel, such as 'can0'")]


@attrs.frozen(kw_only=True)
class CobIdsSpec(Checked, table="can.cob_ids"):
    """COB-IDs of one drive's PDOs; None for those of the predefined connection set of CiA 301.

    Attributes
    ----------
    command : int or None
        Controlword, 200h + node id.
    setpoint : int or None
        300h + node id.
    feed_forward : int or None
        The torque beside a velocity, 400h + node id.
    feedback : int or None
        Statusword and actual position, 180h + node id.
    position : int or None
        The actual position, where a drive's fixed mapping has it apart from the statusword.
    """

    command: PdoCobId | None = None
    setpoint: PdoCobId | None = None
    feed_forward: PdoCobId | None = None
    feedback: PdoCobId | None = None
    position: PdoCobId | None = None


Mapped = tuple[Unsigned32, ...]


@attrs.frozen(kw_only=True)
class FixedPdosSpec(Checked, table="can.fixed_pdos"):
    """PDOs of drives that cannot be mapped anew, as their manual states them.

    Attributes
    ----------
    rpdo1, rpdo2, rpdo3, rpdo4 : tuple of int
        Entries of 1600h to 1603h, such as 0x60400010 and 0x607A0020; empty for what is not used.
    tpdo1, tpdo2, tpdo3, tpdo4 : tuple of int
        Entries of 1A00h to 1A03h.
    """

    rpdo1: Mapped = ()
    rpdo2: Mapped = ()
    rpdo3: Mapped = ()
    rpdo4: Mapped = ()
    tpdo1: Mapped = ()
    tpdo2: Mapped = ()
    tpdo3: Mapped = ()
    tpdo4: Mapped = ()

    @property
    def received(self) -> tuple[Mapped, ...]:
        """Entries of each RPDO."""
        return self.rpdo1, self.rpdo2, self.rpdo3, self.rpdo4

    @property
    def sent(self) -> tuple[Mapped, ...]:
        """Entries of each TPDO."""
        return self.tpdo1, self.tpdo2, self.tpdo3, self.tpdo4

    @property
    def stated(self) -> bool:
        """Whether there are any."""
        return any((*self.received, *self.sent))


_POWER = r"(?:(?:1|10+|0\.0*1) )?"
VelocityUnit = Annotated[
    str,
    Pattern(
        rf"{_POWER}(?:counts/s|rpm|rev/s|m/s|rad/s|deg/s)",
        "counts/s, rpm, rev/s, m/s, rad/s or deg/s, behind a power of ten if it is not 1: '0.001 rpm'",
    ),
]
AccelerationUnit = Annotated[
    str,
    Pattern(
        rf"{_POWER}(?:counts/s\^2|rpm/s|rev/s\^2|m/s\^2|rad/s\^2|deg/s\^2)",
        "counts/s^2, rpm/s, rev/s^2, m/s^2, rad/s^2 or deg/s^2, behind a power of ten if it is not 1: "
        "'0.001 m/s^2'",
    ),
]
SENSOR_BYTES = {"int16": 2, "int32": 4, "float32": 4}


@attrs.frozen(kw_only=True)
class CanSensorSpec(Checked, table="can.sensor"):
    """Frames of a node that tells what ``planner.sensor`` shows, for a planner block that is streamed.

    Attributes
    ----------
    cob_id : int
        Of its frames.
    type : str
        ``"int16"``, ``"int32"`` or ``"float32"``, little endian.
    byte : tuple of int
        At which byte of a frame the value of each sensor begins.
    counts : float
        What it counts for each rad (or m, rad/s, m/s).
    reverse : bool
        Whether it counts the other way.
    """

    cob_id: PdoCobId
    type: Literal["int16", "int32", "float32"] = "int16"
    byte: tuple[Annotated[int, Bounds(least=0, most=6)], ...] = (0,)
    counts: Positive
    reverse: bool = False


@attrs.frozen(kw_only=True)
class DataSheet:
    """A drive's EDS or DCF (CiA 306): its file's name, without folders, and what it holds."""

    name: str
    content: bytes = attrs.field(repr=False)

    @property
    def sha256(self) -> str:
        """Hash of the content, in hexadecimal."""
        return hashlib.sha256(self.content).hexdigest()


def read_data_sheet(path: Path) -> DataSheet:
    """Read a drive's file, without understanding it.

    Raises
    ------
    OSError
    """
    return DataSheet(name=path.name, content=read_bounded(path, DOCUMENT))


# what streams can do without where a spec says so; `gen_profile_exporters.can.startup` has the substitutes
Dispensable = Literal["1016h", "1017h", "6007h", "605Ah", "6065h", "607Bh", "6085h", "60C2h"]


@attrs.frozen(kw_only=True)
class CanSpec(Checked, table="can"):
    """The drives on the CAN bus, and how they are to be fed, watched and stopped.

    Attributes
    ----------
    node : int
        CANopen node of the first axis; the second axis takes the next one, and so on.
    nodes : mapping of str to int
        Nodes of all axes by name, where they do not count up from `node`; empty where they do.
    channels : mapping of str to str
        The CAN channel of each axis's drive, such as ``"can0"``, where they are on several buses.
    cob_ids : mapping of str to CobIdsSpec
        By axis, where they are not those of the predefined connection set.
    fixed_pdos : FixedPdosSpec
        What the drives' own PDOs carry, where they cannot be mapped anew; nothing where they can.
    bitrate : int
        bit/s.
    mode : str
        ``"csp"`` (cyclic synchronous position, 607Ah), ``"ip"`` (interpolated position, 60C1h) or ``"csv"``
        (cyclic synchronous velocity, 60FFh).
    sync_period : float
        s; also the drives' interpolation period 60C2h.
    feed_forward : str
        What goes along with each position in csp: nothing, the velocity 60B1h, the torque 60B2h, or both.
    torque_per_acceleration : float or None
        For the torque: ‰ of the rated torque per m/s² (or rad/s²) of the axis.
    timeout : float or None
        How long a drive waits for the next setpoint before it stops by itself, and the streamer for an
        answer, in s; None takes 20 ms or three cycles, whichever is longer.
    sdo_timeout : float
        How long an answer to an SDO is awaited, in s.
    state_timeout : float
        How long a drive may take to change its state or mode of operation, and an axis to settle, in s.
    start_tolerance : float
        How far the axis may stand from the first setpoint, in m (or rad).
    following_error : float or None
        How far an axis may be off the motion in m (or rad) before it is stopped, and the drive's window
        6065h; None derives it from the motion's lag, and leaves the drive's own. It must be stated in csv.
    quick_stop : float or None
        Deceleration 6085h in m/s² (or rad/s²); None takes twice the motion's greatest acceleration.
    travel : mapping of str to (float, float)
        Software position limits 607Dh by axis, in m (or rad).
    encoder, gear, feed : (int, int) or None
        Numerator and denominator of 608Fh (increments per motor revolutions), 6091h (motor per shaft
        revolutions) and 6092h (counts per shaft revolutions), for drives that scale positions themselves.
    velocity_unit, acceleration_unit : str or None
        In what the drive counts 60FFh and 60B1h, and 6085h, such as ``"0.001 rpm"``; None for counts of its
        positions per second, and per second squared.
    counts_per_revolution : float or None
        Counts of positions to one of the revolutions that these units count.
    vendor, product : int or None
        Identity 1018h:01 and :02 that a drive must have.
    serial : mapping of str to int
        Serial number 1018h:04 that the drive of an axis must have.
    homed : (int, int, int) or None
        Index, subindex and bits of the drive's object that are set once it knows where its axis is.
    eds : DataSheet or None
        The file of the drives, which all are of one kind; motion and settings must fit it.
    without : tuple of str
        Objects that the drives lack, and whose substitutes will do, such as ``"605Ah"``.
    sensor : CanSensorSpec or None
        From which node a streamed planner block learns what its sensors show.
    """

    node: NodeId = 1
    nodes: Annotated[Mapping[AxisName, NodeId], example("bridge = 5, trolley = 9")] = NONE
    channels: Annotated[Mapping[AxisName, Channel], example('bridge = "can0", trolley = "can1"')] = NONE
    cob_ids: Annotated[Mapping[AxisName, CobIdsSpec], example("cart = { setpoint = 0x321 }")] = NONE
    fixed_pdos: FixedPdosSpec = FixedPdosSpec()
    bitrate: Annotated[int, Bounds(least=10_000, most=1_000_000)] = 500_000
    mode: Literal["csp", "ip", "csv"] = "csp"
    sync_period: CycleTime = 0.004
    feed_forward: Literal["none", "velocity", "torque", "both"] = "none"
    torque_per_acceleration: Positive | None = None
    timeout: Annotated[float, Bounds(least=0.001, most=30.0)] | None = None
    sdo_timeout: Annotated[float, Bounds(least=0.01, most=60.0)] = 2.0
    state_timeout: Annotated[float, Bounds(least=0.01, most=600.0)] = 5.0
    start_tolerance: Positive = 0.001
    following_error: Positive | None = None
    quick_stop: Positive | None = None
    travel: Annotated[Mapping[AxisName, tuple[Distance, Distance]], example("cart = [0.0, 0.5]")] = NONE
    encoder: tuple[Unsigned32, Unsigned32] | None = None
    gear: tuple[Unsigned32, Unsigned32] | None = None
    feed: tuple[Unsigned32, Unsigned32] | None = None
    velocity_unit: VelocityUnit | None = None
    acceleration_unit: AccelerationUnit | None = None
    counts_per_revolution: Positive | None = None
    vendor: Unsigned32 | None = None
    product: Unsigned32 | None = None
    serial: Annotated[Mapping[AxisName, Unsigned32], example("cart = 0x12345678")] = NONE
    homed: tuple[Unsigned32, Annotated[int, Bounds(least=0, most=255)], Unsigned32] | None = None
    eds: DataSheet | None = None
    without: tuple[Dispensable, ...] = ()
    sensor: CanSensorSpec | None = None
