"""A motion task as frozen values: machine, move, robustness, cost, limits, check and target.

Every number is in SI units. What a TOML file may say is exactly the attributes here. Their annotations say
what each may hold, however it is made; `gen_profile.spec.rules` holds them to one another.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Literal

import attrs

from gen_profile.plants.machine_file import MachineFile, plant_of_file
from gen_profile.plants.plant import Plant
from gen_profile.plants.registry import find_plant
from gen_profile.spec.can import CanSpec
from gen_profile.spec.disturbances import PathSpec, WindSpec
from gen_profile.spec.external_fmu import ExternalFmu
from gen_profile.spec.planner import PlannerSpec
from gen_profile.spec.stacks import StacksSpec
from gen_profile.spec.structure import Checked, kinds_of
from gen_profile.spec.values import (
    NONE,
    AxisName,
    Bounds,
    Column,
    CycleTime,
    Distance,
    Duration,
    LoadName,
    Name,
    Named,
    NotNegative,
    ParameterName,
    Positive,
    RelativeRange,
    Rising,
    ShaperName,
    SolverName,
    Travel,
    Words,
    ascii_name,
    example,
)
from gen_profile.support.summary import Drawable
from gen_profile.support.units import AxisScale, axis_factor

DEFAULT_COUNTS_PER_SI = 1e6
RESIDUAL_SHARE = 0.01  # default limit of residual sway: this share of the longest axis move

ParameterSpan = Annotated[str, Named("parameter", of="span")]
Span = Annotated[tuple[float, float], Rising()]
SwingState = Annotated[str, Named("coordinate")]
Shares = Annotated[Mapping[ParameterName, RelativeRange], example("NAME = 0.2")]
Sway = Annotated[float, Bounds(above=0.0), Words("must be a finite number greater than 0, found {found}")]


@attrs.frozen(kw_only=True)
class PlantSpec(Checked, table="plant"):
    """Which machine, with the value of every parameter, and the file that a user wrote it in."""

    type: str
    file: MachineFile | None = None
    parameters: Mapping[ParameterName, float] = NONE
    defaults: tuple[str, ...] = attrs.field(default=(), eq=False)  # parameters the spec left to the type


@attrs.frozen(kw_only=True)
class DurationBounds(Checked, table="move.duration"):
    """What a duration that is to be found may be at least and at most, in s."""

    least: Duration | None = None
    most: Duration | None = None


@attrs.frozen(kw_only=True)
class MoveSpec(Checked, table="move"):
    """Start and target of every axis in m (or rad), duration in s; from standstill, to standstill or a speed.

    Attributes
    ----------
    free : tuple of str
        Axes that may move on the way although they end where they began; all others are held.
    shortest : bool
        The duration is to be found, and the one given here means nothing.
    bounds : DurationBounds
        Of a duration that is to be found.
    initial : mapping of str to float
        What swings at the start: unactuated coordinates by name in m (or rad), their rates as ``NAME.rate``.
    final_velocity : tuple of float
        Of every axis at the target, in m/s (or rad/s).
    """

    start: tuple[Distance, ...]
    target: tuple[Distance, ...]
    duration: Duration
    shortest: bool = False
    bounds: DurationBounds = DurationBounds()
    free: tuple[AxisName, ...] = ()
    initial: Annotated[Mapping[SwingState, float], example("theta1 = 0.05")] = NONE
    final_velocity: tuple[Distance, ...] = attrs.field()

    @final_velocity.default
    def _standstill(self) -> tuple[float, ...]:
        return (0.0,) * len(self.target)

    @property
    def distance(self) -> tuple[float, ...]:
        """Signed distance of every axis."""
        return tuple(b - a for a, b in zip(self.start, self.target, strict=True))

    @property
    def asked(self) -> tuple[bool, ...]:
        """Whether each axis is asked to move: to another place, or at a speed in the end."""
        return tuple(
            bool(way or speed) for way, speed in zip(self.distance, self.final_velocity, strict=True)
        )

    def longest(self, plant: Plant) -> float:
        """Longest distance of the axes that move in m; 0 where none does."""
        axes = zip(plant.actuated, self.distance, strict=True)
        return max((abs(way) for axis, way in axes if axis.unit == "m"), default=0.0)

    @property
    def stops(self) -> bool:
        """Whether the axes stand still at the end."""
        return not any(self.final_velocity)


@attrs.frozen(kw_only=True)
class ActuatorSpec(Checked, table="actuator"):
    """How the drive follows: perfectly, or with a first-order lag of time constant tau in s (eq. 6)."""

    type: Literal["ideal", "first-order"] = "ideal"
    tau: Positive | None = None


@attrs.frozen(kw_only=True)
class RobustnessSpec(Checked, table="robustness"):
    """Uncertain parameters with their relative half-ranges, and what the design does about them."""

    method: Literal["none", "sensitivity", "range"] = "none"
    order: Literal[1, 2] = 1
    nominal_zero: bool = False  # with method "range": the nominal machine comes to rest exactly all the same
    uncertain: Shares = NONE
    OF_METHOD: ClassVar = {"order": "sensitivity", "nominal_zero": "range"}  # keys for one robust method only


@attrs.frozen(kw_only=True)
class CostSpec(Checked, table="cost"):
    """The cost (26): which effort, the sway's weight β and its scale γ in 1/m (None: automatic)."""

    effort: Literal["jerk", "snap", "reference"] = "jerk"
    sway_weight: NotNegative = 0.0
    sway_scale: Positive | None = None


@attrs.frozen(kw_only=True)
class SolverSpec(Checked, table="solver"):
    """Which solver, or which shaper and the move that it is fed with.

    "auto" takes the indirect solver where no limit binds.
    """

    method: Literal[SolverName, ShaperName] = "auto"
    base: Literal["quintic", "septic", "jerk-limited"] = "quintic"

    @property
    def solver(self) -> SolverName:
        """What finds optimal motions, also where a shaper is to make the motion."""
        return self.method if self.method in ("auto", "indirect", "direct") else "auto"

    @property
    def shaper(self) -> str | None:
        """What makes the motion, where it is no optimal one."""
        return None if self.method in ("auto", "indirect", "direct") else self.method


@attrs.frozen(kw_only=True)
class AxisLimitsSpec(Checked, table="limits.axis"):
    """Greatest magnitudes of one axis' command in SI units, and its travel."""

    velocity: Positive | None = None
    acceleration: Positive | None = None
    jerk: Positive | None = None
    travel: Travel | None = None


@attrs.frozen(kw_only=True)
class LimitsSpec(Checked, table="limits"):
    """Limits of all axes' commands, the end load's transient sway in m, and how far it passes its target.

    `axis` holds what is different for single axes: all axes by name in the plant's order, or none.
    """

    velocity: Positive | None = None
    acceleration: Positive | None = None
    jerk: Positive | None = None
    sway: Positive | None = None
    overshoot: NotNegative | None = None
    travel: Travel | None = None
    axis: Annotated[Mapping[AxisName, AxisLimitsSpec], Words("must be a table by axis, found {found}")] = NONE

    def own(self, column: int) -> tuple[str, AxisLimitsSpec]:
        """Name of an axis that has limits of its own, and those."""
        return list(self.axis.items())[column] if self.axis else ("", AxisLimitsSpec())

    def of(self, column: int) -> AxisLimitsSpec:
        """Limits of one axis: its own, and where it has none, those of all."""
        _, own = self.own(column)
        names = kinds_of(AxisLimitsSpec)
        stated = {name: getattr(own, name) for name in names if getattr(own, name) is not None}
        return AxisLimitsSpec(**{name: getattr(self, name) for name in names} | stated)

    def only(self, columns: Sequence[int]) -> LimitsSpec:
        """Limits of some of the axes, numbered anew."""
        return attrs.evolve(self, axis=dict(own for k, own in enumerate(self.axis.items()) if k in columns))

    def place(self, column: int, name: str) -> str:
        """Where one kind of limit of one axis stands in the spec."""
        axis, own = self.own(column)
        return f"limits.{name}" if getattr(own, name) is None else f"limits.axis.{axis}.{name}"

    def stated(self) -> dict[str, Any]:
        """Every limit that is stated, by its place in the spec, such as ``limits.axis.x.jerk``."""
        tables: dict[str, LimitsSpec | AxisLimitsSpec] = {"limits": self}
        tables |= {f"limits.axis.{axis}": own for axis, own in self.axis.items()}
        return {
            f"{table}.{name}": value
            for table, own in tables.items()
            for name in kinds_of(LimitsSpec)
            if name != "axis" and (value := getattr(own, name, None)) is not None
        }


@attrs.frozen(kw_only=True)
class CheckSpec(Checked, table="check"):
    """What may remain of the sway, on which machines, and who is to judge.

    Attributes
    ----------
    residual_sway : mapping of str to float
        Greatest in m of each load by name, in all scenarios.
    uncertain : mapping of str to float, or None
        Relative half-ranges of parameters; those of the design where it is None.
    spans : mapping of str to (float, float)
        Least and greatest value of parameters for which a share says nothing, such as a damping of 0.
    samples : int
        Machines drawn at random from all ranges, beside the ends and corners.
    seed : int
        Of what is random.
    path : PathSpec
    wind : WindSpec
        Whose deflection is reported and not judged.
    foreign : ExternalFmu or None
        An external FMU that judges in place of ours.
    """

    residual_sway: Mapping[LoadName, Sway]
    uncertain: Shares | None = None
    spans: Annotated[Mapping[ParameterSpan, Span], example("c2 = [0.0, 0.02]")] = NONE
    samples: Annotated[int, Bounds(least=0, most=1_000_000)] = 0
    seed: Annotated[int, Bounds(least=0, most=0xFFFF_FFFF)] = 0
    path: PathSpec = attrs.field(factory=PathSpec)
    wind: WindSpec = attrs.field(factory=WindSpec)
    foreign: ExternalFmu | None = None
    default: bool = attrs.field(default=False, eq=False)  # the limit was not stated


@attrs.frozen(kw_only=True)
class AxisSpec(Checked, table="axis"):
    """What the target's axis counts in, and after how many of these a modulo axis wraps."""

    unit: Literal["m", "mm", "um", "deg", "rad", "counts"]
    sign: Literal[1, -1] = 1
    counts_per_metre: Positive = DEFAULT_COUNTS_PER_SI
    modulo: Positive | None = None


@attrs.frozen(kw_only=True)
class ExportSpec(Checked, table="export"):
    """The controller's cycle in s, and what the formats leave to choose."""

    cycle_time: CycleTime = 0.001
    plc_layout: Literal["segments", "samples", "counts"] = "segments"
    plc_tables: Literal["constants", "variables"] = "constants"
    csv_dialect: Literal["rfc4180", "excel-de", "sew", "kollmorgen", "lenze"] = "rfc4180"
    csv_columns: Annotated[
        tuple[Column, ...], Words('must be a list such as ["position", "velocity"], found {found}')
    ] = ("position", "velocity", "acceleration", "jerk")


@attrs.frozen(kw_only=True, repr=False)
class Spec(Drawable, Checked):
    """One motion task, complete: nothing downstream looks anything else up.

    Examples
    --------
    >>> spec = gp.preset_spec("paper")
    >>> spec.move.duration, spec.plant.parameters["L1"]  # s, m
    (3.0, 0.47)
    """

    name: Name = "profile"
    plant: PlantSpec
    move: MoveSpec
    actuator: ActuatorSpec = ActuatorSpec()
    robustness: RobustnessSpec = RobustnessSpec()
    cost: CostSpec = CostSpec()
    solver: SolverSpec = SolverSpec()
    limits: LimitsSpec = LimitsSpec()
    check: CheckSpec
    axis: Mapping[AxisName, AxisSpec]
    export: ExportSpec = ExportSpec()
    can: CanSpec = attrs.field(factory=CanSpec)
    planner: PlannerSpec = attrs.field(factory=PlannerSpec)
    path: StacksSpec | None = None

    def summary(self) -> dict[str, object]:
        """Tell what a reader looks for first."""
        ranges = [f"{name} ±{100.0 * share:g} %" for name, share in self.robustness.uncertain.items()]
        return {
            "name": self.name,
            "machine": self.plant.type,
            "move": f"{list(self.move.start)} to {list(self.move.target)}",
            "duration": "the shortest" if self.move.shortest else f"{self.move.duration:g} s",
            "uncertain": ", ".join(ranges) or "nothing",
        }

    def machine(self) -> Plant:
        """Load the plant."""
        return find_plant(self.plant.type) if self.plant.file is None else plant_of_file(self.plant.file)

    def held(self) -> dict[int, float]:
        """Where the axes stand that do not move, by their number, in m (or rad).

        Those that the move neither asks to move nor sets free, or whose travel leaves them no room. A
        machine's only axis is not held: it is what removes a swing in place. On a path over stacks none is.
        """
        move, axes = self.move, self.machine().actuated
        if len(axes) == 1 or self.path is not None:
            return {}

        def stays(column: int) -> bool:
            low, high = self.limits.of(column).travel or (0.0, 1.0)
            return not move.asked[column] and (axes[column].name not in move.free or low == high)

        return {column: place for column, place in enumerate(move.start) if stays(column)}

    def changed(self, values: Mapping[str, Any]) -> Spec:
        """Put other values in their places, such as ``limits.axis.x.jerk``; a duration stands."""
        spec = attrs.evolve(self)
        for place, value in values.items():
            spec = _put(spec, place.split("."), value)
            if place == "move.duration":
                move = attrs.evolve(spec.move, shortest=False, bounds=DurationBounds())
                spec = attrs.evolve(spec, move=move)
        return spec

    def checked_ranges(self) -> dict[str, tuple[float, float]]:
        """Least and greatest value of every parameter that the check changes, in the machine's order."""
        shares = self.robustness.uncertain if self.check.uncertain is None else self.check.uncertain
        ranges = dict(self.check.spans)
        for name, fraction in shares.items():
            low, high = (self.plant.parameters[name] * (1.0 + sign * fraction) for sign in (-1, +1))
            ranges.setdefault(name, (low, high))
        return {name: ranges[name] for name in self.plant.parameters if name in ranges}

    def axis_scales(self) -> tuple[AxisScale, ...]:
        """How the target counts each axis, in the plant's order."""
        return tuple(
            AxisScale(
                name=name,
                unit=axis.unit,
                factor=axis.sign * axis_factor(axis.unit, axis.counts_per_metre),
                counts_per_si=axis.sign * axis.counts_per_metre,
                modulo=axis.modulo,
            )
            for name, axis in self.axis.items()
        )

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values that `gen_profile.spec.reading.spec_from_dict` reads back to an equal spec."""
        document: dict[str, Any] = _plain(self)
        own = self.plant.file
        written = {} if own is None else {"file": own.name, "file_sha256": own.sha256}
        document["plant"] = {"type": self.plant.type, **written, **self.plant.parameters}
        if self.cost.sway_scale is None:
            document["cost"]["sway_scale"] = "auto"
        del document["check"]["default"]
        if self.check.wind == WindSpec():  # a spec without hashes as it did
            del document["check"]["wind"]
        if self.planner == PlannerSpec():
            del document["planner"]
        elif not self.planner.live_rate:
            del document["planner"]["live_rate"]
        if self.check.foreign is not None:
            del document["check"]["foreign"]
            document["check"] |= self.check.foreign.to_dict()
        own_sheet = self.can.eds
        if own_sheet is not None:
            document["can"] |= {"eds": own_sheet.name, "eds_sha256": own_sheet.sha256}
        if not self.can.without:
            del document["can"]["without"]
        if not self.move.free:  # as a spec without hashes
            del document["move"]["free"]
        bounds = document["move"].pop("bounds")
        if document["move"].pop("shortest"):
            document["move"]["duration"] = bounds or "minimum"
        return document

    def files(self) -> dict[str, bytes]:
        """Read the files that it names, by their names: an own machine, the drives', an external FMU."""
        own, judge = (self.plant.file, self.can.eds), self.check.foreign
        files = {file.name: file.content for file in own if file is not None}
        return files if judge is None else files | {judge.name: judge.path.read_bytes()}

    @property
    def ascii_name(self) -> str:
        """Name files and program blocks, whose names are ASCII."""
        return ascii_name(self.name)

    def sha256(self) -> str:
        """Hash of the whole spec, defaults included, in hexadecimal."""
        text = json.dumps(self.to_dict(), sort_keys=True, separators=(",", ":"), ensure_ascii=True)
        return hashlib.sha256(text.encode("ascii")).hexdigest()


def _put(outer: Any, place: list[str], value: Any) -> Any:
    """Copy a table or mapping with another value somewhere inside."""
    if not place:
        return value
    key, *inner = place
    if isinstance(outer, Mapping):
        return {**outer, key: _put(outer.get(key), inner, value)}
    return attrs.evolve(outer, **{key: _put(getattr(outer, key), inner, value)})


def _plain(value: Any) -> Any:
    """Plain dicts, lists and scalars; None left out."""
    if attrs.has(type(value)):
        pairs = {field.name: getattr(value, field.name) for field in attrs.fields(type(value))}
        return {key: _plain(item) for key, item in pairs.items() if item is not None}
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value
