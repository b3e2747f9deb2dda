"""What a sweep varies: axes of values, and all their combinations."""

import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import attrs
import numpy as np
import numpy.typing as npt

from gen_profile.spec.reading import parse_toml
from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import number_meant

MOST_CASES = 10_000_000
TOO_MANY = f"vary: more than {MOST_CASES} combinations; vary less, or in several sweeps."
DIGITS = 12  # of a value between the ends of an axis: 0.3, not 0.30000000000000004


@attrs.frozen(kw_only=True)
class GridAxis:
    """A key of the spec and the values that it takes.

    Attributes
    ----------
    key : str
        Such as ``"plant.L1"``.
    values : tuple
        Numbers, texts or arrays, as TOML has them; all different.
    """

    key: str
    values: tuple[Any, ...]

    @property
    def numeric(self) -> bool:
        """Whether all values are numbers, so that one may be nearer than another."""
        return all(isinstance(value, int | float) and not isinstance(value, bool) for value in self.values)

    def steps(self, values: npt.NDArray[np.float64] | float) -> npt.NDArray[np.float64]:
        """Count from the least value of a numeric axis to others, of the same shape: its second one is at 1.

        Between its values one interpolates; what lies beyond its ends counts as these.
        """
        known = np.sort(np.asarray(self.values, dtype=np.float64))
        return np.asarray(np.interp(np.asarray(values), known, np.arange(len(known))))


@attrs.frozen(kw_only=True)
class Grid:
    """All combinations of the axes' values, numbered; the last axis changes fastest."""

    axes: tuple[GridAxis, ...]

    def __len__(self) -> int:
        return math.prod(self._shape)

    def __getitem__(self, case: int) -> dict[str, Any]:
        """Value of every key in a case."""
        places = np.unravel_index(case, self._shape)
        return {axis.key: axis.values[int(at)] for axis, at in zip(self.axes, places, strict=True)}

    @cached_property
    def _shape(self) -> tuple[int, ...]:
        return tuple(len(axis.values) for axis in self.axes)


def parse_grid(texts: Sequence[str]) -> Grid:
    """Read axes such as ``move.distance=0.1:2:20`` and ``robustness.method=none,sensitivity``.

    Raises
    ------
    SpecError
        An axis makes no sense, there is none, a key comes twice, or there are too many cases.
    """
    axes = tuple(_parse_axis(text) for text in texts)
    if not axes:
        raise SpecError("vary: name what to vary, such as move.distance=0.1:2:20.")
    keys = [axis.key for axis in axes]
    for key in keys:
        if keys.count(key) > 1:
            raise SpecError(f"vary {key}: a key is varied once.")
    return _grid(axes)


def grid_of_values(vary: Mapping[str, Sequence[Any]]) -> Grid:
    """Combine values by key.

    Raises
    ------
    SpecError
        There is no key, a key has no values or one twice, or there are too many cases.
    """
    for key, values in vary.items():
        if not values:
            raise SpecError(f"vary {key}: there is no value.")
    if not vary:
        raise SpecError("vary: name a key and its values, such as {'move.distance': [0.1, 0.2]}.")
    return _grid(tuple(_axis(f"vary {key}", key, values) for key, values in vary.items()))


def _grid(axes: tuple[GridAxis, ...]) -> Grid:
    if math.prod(len(axis.values) for axis in axes) > MOST_CASES:
        raise SpecError(TOO_MANY)
    return Grid(axes=axes)


def overrides(values: Mapping[str, Any]) -> tuple[str, ...]:
    """Write a case as overrides of its spec, ``KEY=VALUE`` with a TOML value."""
    return tuple(f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in values.items())


def _parse_axis(text: str) -> GridAxis:
    key, equals, stated = (part.strip() for part in text.partition("="))
    if not equals or not stated or not all(step.strip() for step in key.split(".")):
        raise SpecError(f"vary {text!r}: write KEY=LO:HI:N or KEY=VALUE,VALUE,…")
    parts = stated.split(":")
    numbers = len(parts) > 1 and all(_is_number(part.replace(",", ".")) for part in parts)
    values = _range(text, parts) if numbers or len(parts) == 3 else _listed(stated)
    return _axis(f"vary {text!r}", key, values)


def _axis(where: str, key: str, values: Sequence[Any]) -> GridAxis:
    try:
        different = {json.dumps(value, allow_nan=False) for value in values}
    except (TypeError, ValueError) as error:
        raise SpecError(f"{where}: values are finite numbers, texts or arrays of these.") from error
    if len(different) < len(values):
        raise SpecError(f"{where}: a value comes twice.")
    return GridAxis(key=key, values=tuple(values))


def _range(text: str, parts: Sequence[str]) -> list[float]:
    if len(parts) < 3:
        raise SpecError(f"vary {text!r}: say how many values to take, as LO:HI:N, such as {text}:5.")
    try:
        first, last, number = parts
        low, high, count = float(first), float(last), int(number)
    except ValueError as error:
        point = next(filter(None, (number_meant(part) for part in parts if not _is_number(part))), "")
        raise SpecError(
            f"vary {text!r}: LO:HI:N are two numbers and how many values to take{point}."
        ) from error
    if count > MOST_CASES:
        raise SpecError(TOO_MANY)
    if count < 2 or not (math.isfinite(low) and math.isfinite(high)):
        raise SpecError(f"vary {text!r}: take two values or more, from one finite number to another.")
    inner = [float(f"{value:.{DIGITS}g}") for value in np.linspace(low, high, count)[1:-1]]
    return [low, *inner, high]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _listed(stated: str) -> list[Any]:
    """Read the values as TOML, and where they are none, as texts."""
    try:
        values = parse_toml(f"values = [{stated}]")
    except tomllib.TOMLDecodeError:
        texts = [part.strip() for part in stated.split(",")]
        if not all(texts):
            raise SpecError(f"vary: between two commas of {stated!r} there is no value.") from None
        return texts
    return values["values"] if values.keys() == {"values"} else [stated]
