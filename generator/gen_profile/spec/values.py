"""Kinds of values in a spec: numbers with bounds, texts with patterns, choices."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Any, Literal

import attrs


@attrs.frozen
class Bounds:
    """Allowed values of a number, `above` itself excluded, and what they are: a unit, or words."""

    above: float = -float("inf")
    least: float = -float("inf")
    most: float = float("inf")
    meaning: str = ""


@attrs.frozen
class Pattern:
    """Allowed texts: a regular expression and what it means in words."""

    expression: str
    meaning: str


Name = Annotated[
    str,
    Pattern(
        r"(?!(?i:con|prn|aux|nul|com[0-9]|lpt[0-9])(?:\.|$))"
        r"[A-Za-z0-9](?:[A-Za-z0-9._ -]{0,62}[A-Za-z0-9_-])?",
        "1 to 64 letters, digits, dots, underscores, hyphens and spaces, beginning with a letter or digit, "
        "not ending with a dot or space, and no device's name in Windows, as CON",
    ),
]
Positive = Annotated[float, Bounds(above=0.0)]
NotNegative = Annotated[float, Bounds(least=0.0)]
RelativeRange = Annotated[float, Bounds(above=0.0, most=0.9, meaning="(0.1 is 10 %)")]
CycleTime = Annotated[float, Bounds(least=1e-5, most=1.0, meaning="s (4 ms are 0.004)")]
Duration = Annotated[float, Bounds(least=1e-3, most=1e5, meaning="s")]
Column = Literal["position", "velocity", "acceleration", "jerk"]
Distance = Annotated[float, Bounds(least=-1e5, most=1e5, meaning="m (or rad)")]
SolverName = Literal["auto", "indirect", "direct"]
ShaperName = Literal["nzv", "zv", "zvd", "zvdd", "umzvd", "ei", "2hump-ei", "3hump-ei", "mzv"]


def frozen_mapping(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Copy a mapping, so that nobody alters it."""
    return MappingProxyType(dict(values))
