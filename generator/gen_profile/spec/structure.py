"""From plain values to the typed ones of the spec's model; a misfit becomes a sentence with its place."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal, get_args, get_origin

import attrs
from cattrs import Converter
from cattrs.errors import (
    ClassValidationError,
    ForbiddenExtraKeysError,
    IterableValidationError,
    IterableValidationNote,
)

from gen_profile.errors import SpecError
from gen_profile.plants.machine_file import MachineFile
from gen_profile.spec.model import ExternalFmu, Spec
from gen_profile.spec.values import Bounds, Pattern
from gen_profile.suggestion import number_meant, suggestion

Table = dict[str, Any]


class Faults:
    """What is wrong with a spec, by place.

    The first fault of a place stands, and those of the places inside it are left out: they follow from it.
    """

    def __init__(self) -> None:
        self._sentences: dict[str, str] = {}

    def add(self, place: str, problem: str) -> None:
        """Note a problem, such as ``must be positive``, of a place such as ``plant.m1``."""
        steps = place.split(".")
        if not any(".".join(steps[: depth + 1]) in self._sentences for depth in range(len(steps))):
            self._sentences[place] = f"{place}: {problem}{'' if problem.endswith(('?', '.')) else '.'}"

    def __iter__(self) -> Iterator[str]:
        """Give one sentence per place."""
        return iter(self._sentences.values())

    def __bool__(self) -> bool:
        return bool(self._sentences)


def structure(tables: Table, faults: Faults) -> Spec:
    """Build the spec.

    Parameters
    ----------
    tables : dict
        Plain values nested as the classes are.
    faults : Faults
        Those found so far.

    Raises
    ------
    SpecError
        With all faults, old and new.
    """
    try:
        spec = _CONVERTER.structure(tables, Spec)
    except ClassValidationError as error:
        _gather(error, "", faults)
        raise SpecError(*faults) from None  # whose sentences say more than the structuring does
    if faults:
        raise SpecError(*faults)
    return spec


def finite(value: object) -> float | None:
    """Return a finite number as a float, else None; booleans and texts are no numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def found(value: object) -> str:
    """Name a value in a sentence, never at length."""
    match value:
        case None:
            return "nothing"
        case bool():
            return str(value).lower()
        case int() if abs(value) >= 10**18:
            return "a whole number of more than 18 digits"
        case int() | float():
            return repr(value)
        case str():
            return f"text {value[:60]!r}{number_meant(value)}"
        case dict():
            return "a table"
        case list():
            return "an array"
        case _:
            return "a date or time"


def place(outer: str, step: object) -> str:
    """Join a place and a key of it; a key that is no bare TOML key is quoted, lest it pose as more."""
    key = str(step)
    bare = key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else repr(key[:60])
    return f"{outer}.{bare}" if outer else bare


def _gather(error: BaseException, where: str, faults: Faults) -> None:
    """Walk cattrs' tree of errors."""
    if isinstance(error, ClassValidationError | IterableValidationError):
        noted, others = error.group_exceptions()
        for leaf, note in noted:
            step = note.index if isinstance(note, IterableValidationNote) else note.name
            _gather(leaf, place(where, step), faults)
        for leaf in others:
            _gather(leaf, where, faults)
    elif isinstance(error, ForbiddenExtraKeysError):
        known = [field.name for field in attrs.fields(error.cl)]
        for key in sorted(error.extra_fields):
            faults.add(place(where, key), f"unknown key{suggestion(key, known)}")
    elif isinstance(error, KeyError):
        faults.add(where, "required, but missing")
    else:
        faults.add(where, str(error))


def _structure_float(value: Any, _: type) -> float:
    number = finite(value)
    if number is None:
        raise ValueError(f"must be a finite number, found {found(value)}")
    return number


def _structure_int(value: Any, _: type) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"must be a whole number, found {found(value)}")
    return value


def _structure_bool(value: Any, _: type) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"must be true or false, found {found(value)}")
    return value


def _structure_str(value: Any, _: type) -> str:
    if not isinstance(value, str):
        raise ValueError(f"must be text, found {found(value)}")
    return value


def _structure_choice(value: Any, annotation: Any) -> Any:
    allowed = get_args(annotation)
    for choice in allowed:
        if type(choice) is type(value) and choice == value:
            return choice
    words = [str(choice) for choice in allowed]
    raise ValueError(f"unknown value, found {found(value)}{suggestion(str(value), words)}")


def _constrained(annotation: Any) -> Callable[[Any, Any], Any]:
    base, *constraints = get_args(annotation)

    def structure_within(value: Any, _: Any) -> Any:
        typed = _CONVERTER.structure(value, base)
        for constraint in constraints:
            _enforce(typed, constraint)
        return typed

    return structure_within


def _enforce(value: Any, constraint: Bounds | Pattern) -> None:
    if isinstance(constraint, Pattern):
        if not re.fullmatch(constraint.expression, value):
            raise ValueError(f"must be {constraint.meaning}, found {found(value)}")
    elif not (value > constraint.above and constraint.least <= value <= constraint.most):
        words = {
            "greater than": constraint.above,
            "at least": constraint.least,
            "at most": constraint.most,
        }
        stated = [f"{word} {bound:g}" for word, bound in words.items() if math.isfinite(bound)]
        meaning = constraint.meaning and f" {constraint.meaning}"
        raise ValueError(f"must be {' and '.join(stated)}{meaning}, found {found(value)}")


def _is_fixed_tuple(annotation: Any) -> bool:
    return get_origin(annotation) is tuple and Ellipsis not in get_args(annotation)


def _fixed_tuple(annotation: Any) -> Callable[[Any, Any], Any]:
    items = get_args(annotation)

    def structure_items(value: Any, _: Any) -> Any:
        if not isinstance(value, list | tuple) or len(value) != len(items):
            raise ValueError(f"must be an array of {len(items)} numbers, found {found(value)}")
        return tuple(_CONVERTER.structure(one, item) for one, item in zip(value, items, strict=True))

    return structure_items


def _is(form: Any) -> Callable[[Any], bool]:
    return lambda annotation: get_origin(annotation) is form


def _converter() -> Converter:
    converter = Converter(forbid_extra_keys=True, detailed_validation=True)
    converter.register_structure_hook(float, _structure_float)
    converter.register_structure_hook(int, _structure_int)
    converter.register_structure_hook(str, _structure_str)
    converter.register_structure_hook(MachineFile, lambda value, _: value)
    converter.register_structure_hook(ExternalFmu, lambda value, _: value)
    converter.register_structure_hook(bool, _structure_bool)
    converter.register_structure_hook_func(_is(Literal), _structure_choice)
    converter.register_structure_hook_factory(_is(Annotated), _constrained)
    converter.register_structure_hook_factory(_is_fixed_tuple, _fixed_tuple)
    return converter


_CONVERTER = _converter()
