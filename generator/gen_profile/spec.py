"""A motion task as frozen values: machine, move, robustness, cost, limits, check and target.

Every number is in SI units. What a TOML file may say is exactly the attributes here;
`gen_profile.spec_reading` turns text into them and gathers its faults.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal

import attrs

from gen_profile.plants.plant import Plant
from gen_profile.plants.registry import find_plant
from gen_profile.units import AxisScale, axis_factor


@attrs.frozen
class Bounds:
    """Allowed values of a number; `above` and `below` are themselves excluded."""

    above: float = -float("inf")
    least: float = -float("inf")
    most: float = float("inf")


@attrs.frozen
class Pattern:
    """Allowed texts: a regular expression and what it means in words."""

    expression: str
    meaning: str


Name = Annotated[
    str,
    Pattern(
        r"[A-Za-z0-9](?:[A-Za-z0-9._ -]{0,62}[A-Za-z0-9_-])?",
        "1 to 64 letters, digits, dots, underscores, hyphens and spaces, "
        "beginning with a letter or digit and not ending with a dot or space",
    ),
]
Positive = Annotated[float, Bounds(above=0.0)]
NotNegative = Annotated[float, Bounds(least=0.0)]
RelativeRange = Annotated[float, Bounds(above=0.0, most=0.9)]
CycleTime = Annotated[float, Bounds(least=1e-5, most=10.0)]
Duration = Annotated[float, Bounds(least=1e-3, most=1e5)]
Distance = Annotated[float, Bounds(least=-1e5, most=1e5)]

DEFAULT_COUNTS_PER_SI = 1e6
RESIDUAL_SHARE = 0.01  # default limit of residual sway: this share of the longest axis move


def _frozen_mapping(values: Mapping[str, Any]) -> Mapping[str, Any]:
    return MappingProxyType(dict(values))


@attrs.frozen(kw_only=True)
class PlantSpec:
    """Which machine, with the value of every parameter."""

    type: str
    parameters: Mapping[str, float] = attrs.field(factory=dict, converter=_frozen_mapping)
    defaults: tuple[str, ...] = attrs.field(default=(), eq=False)  # parameters the spec left to the type


@attrs.frozen(kw_only=True)
class MoveSpec:
    """From standstill to standstill: start and target of every axis in m (or rad), duration in s."""

    start: tuple[Distance, ...]
    target: tuple[Distance, ...]
    duration: Duration

    @property
    def distance(self) -> tuple[float, ...]:
        """Signed distance of every axis."""
        return tuple(b - a for a, b in zip(self.start, self.target, strict=True))


@attrs.frozen(kw_only=True)
class ActuatorSpec:
    """How the drive follows: perfectly, or with a first-order lag of time constant tau in s (eq. 6)."""

    type: Literal["ideal", "first-order"] = "ideal"
    tau: Positive | None = None


@attrs.frozen(kw_only=True)
class RobustnessSpec:
    """Uncertain parameters with their relative half-ranges, and what the design does about them."""

    method: Literal["none", "sensitivity"] = "none"
    order: Literal[1] = 1
    uncertain: Mapping[str, RelativeRange] = attrs.field(factory=dict, converter=_frozen_mapping)


@attrs.frozen(kw_only=True)
class CostSpec:
    """The cost (26): which effort, the sway's weight β and its scale γ in 1/m (None: automatic)."""

    effort: Literal["jerk", "snap", "reference"] = "jerk"
    sway_weight: NotNegative = 0.0
    sway_scale: Positive | None = None


@attrs.frozen(kw_only=True)
class LimitsSpec:
    """Greatest magnitudes of the command in SI units, and of the end load's transient sway in m."""

    velocity: Positive | None = None
    acceleration: Positive | None = None
    jerk: Positive | None = None
    sway: Positive | None = None


@attrs.frozen(kw_only=True)
class CheckSpec:
    """Greatest residual sway in m of each load by name, over all scenarios."""

    residual_sway: Mapping[str, Positive] = attrs.field(converter=_frozen_mapping)
    default: bool = attrs.field(default=False, eq=False)  # the limit was not stated


@attrs.frozen(kw_only=True)
class AxisSpec:
    """What the target's axis counts in."""

    unit: Literal["m", "mm", "um", "deg", "rad", "counts"]
    sign: Literal[1, -1] = 1
    counts_per_metre: Positive = DEFAULT_COUNTS_PER_SI


@attrs.frozen(kw_only=True)
class ExportSpec:
    """The controller's cycle in s."""

    cycle_time: CycleTime = 0.001


@attrs.frozen(kw_only=True)
class CanSpec:
    """The drive on the CAN bus; the second axis takes the next node, and so on."""

    node: Annotated[int, Bounds(least=1, most=127)] = 1
    bitrate: Annotated[int, Bounds(least=10_000, most=1_000_000)] = 500_000
    mode: Literal["csp"] = "csp"
    sync_period: CycleTime = 0.004


@attrs.frozen(kw_only=True)
class Spec:
    """One motion task, complete: nothing downstream looks anything else up."""

    name: Name
    plant: PlantSpec
    move: MoveSpec
    actuator: ActuatorSpec
    robustness: RobustnessSpec
    cost: CostSpec
    limits: LimitsSpec
    check: CheckSpec
    axis: Mapping[str, AxisSpec] = attrs.field(converter=_frozen_mapping)
    export: ExportSpec
    can: CanSpec

    def machine(self) -> Plant:
        """Load the plant."""
        return find_plant(self.plant.type)

    def axis_scales(self) -> tuple[AxisScale, ...]:
        """How the target counts each axis, in the plant's order."""
        return tuple(
            AxisScale(
                name=name,
                unit=axis.unit,
                factor=axis.sign * axis_factor(axis.unit, axis.counts_per_metre),
                counts_per_si=axis.sign * axis.counts_per_metre,
            )
            for name, axis in self.axis.items()
        )

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values that `gen_profile.spec_reading.spec_from_dict` reads back to an equal spec."""
        document: dict[str, Any] = _plain(self)
        document["plant"] = {"type": self.plant.type, **self.plant.parameters}
        if self.cost.sway_scale is None:
            document["cost"]["sway_scale"] = "auto"
        del document["check"]["default"]
        return document

    def sha256(self) -> str:
        """Hash of the whole spec, defaults included, in hexadecimal."""
        text = json.dumps(self.to_dict(), sort_keys=True, separators=(",", ":"), ensure_ascii=True)
        return hashlib.sha256(text.encode("ascii")).hexdigest()


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
