"""What Python users hand over, taken as values: paths, names, texts and numbers."""

from collections.abc import Iterable, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import TypeVar

from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import found

Given = TypeVar("Given")


def as_path(path: Path | str, what: str = "A path") -> Path:
    """Take a path; raises SpecError where it is none."""
    if not isinstance(path, Path | str):
        raise SpecError(f"{what} is expected, found {path!r}.")
    return Path(path)


def as_names(names: Sequence[str] | str) -> Sequence[str]:
    """Take names as they are, or a single one, whose letters are no names; raises SpecError likewise."""
    if not isinstance(names, Iterable):
        raise SpecError(f"A name, or a list of names, is expected, found {names!r}.")
    return (names,) if isinstance(names, str) else [as_text(name, "A name") for name in names]


def as_text(text: str, what: str) -> str:
    """Take a text; raises SpecError where it is none."""
    if not isinstance(text, str):
        raise SpecError(f"{what} is expected, found {found(text)}.")
    return text


def as_number(number: float, what: str) -> float:
    """Take a number of any kind; raises SpecError where it is none, or a truth value."""
    if not isinstance(number, Real) or isinstance(number, bool):
        raise SpecError(f"{what}: must be a number, found {found(number)}.")
    return float(number)


def as_values(values: Mapping[str, Given], what: str) -> Mapping[str, Given]:
    """Take values by name; raises SpecError likewise."""
    if not isinstance(values, Mapping):
        raise SpecError(f"{what}: give values by name, such as {{'L1': 6.0}}, found {values!r}.")
    return values


def as_numbers(numbers: Sequence[float], what: str) -> list[float]:
    """Take numbers, one by one; raises SpecError likewise."""
    if isinstance(numbers, str) or not isinstance(numbers, Iterable):
        raise SpecError(f"{what}: must be a list of numbers, found {found(numbers)}.")
    return [as_number(number, what) for number in numbers]
