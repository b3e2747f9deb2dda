"""From plain values to typed ones, as annotations say; a misfit becomes a sentence with its place.

What fits is kept where other values do not, so that rules across fields find their faults beside them.
"""

import math
import re
from collections.abc import Iterable, Mapping
from functools import cache
from itertools import accumulate
from types import MappingProxyType, UnionType
from typing import Annotated, Any, ClassVar, Union, get_args, get_origin, get_type_hints

import attrs

from gen_profile.spec.values import NONE, Named, Words
from gen_profile.support.errors import SpecError
from gen_profile.support.phrase import Phrase, placed
from gen_profile.support.suggestion import found, suggestion

Kind = Any  # an annotation
MOST_HINTS = 100  # what unknown keys of a table may be meant to be; more is no slip of the hand
MISFIT: Any = object()  # in place of a value that does not fit
FORMS = {
    float: "a finite number",
    int: "a whole number",
    bool: "true or false",
    str: "text",
    Mapping: "a table",
}


class Faults:
    """What is wrong with a spec, by place.

    The first fault of a place stands; those of the places around and inside it are left out, as they follow.
    """

    def __init__(self) -> None:
        self._sentences: dict[str, str] = {}
        self._around: set[str] = set()  # places that hold one of a fault, and those themselves

    def add(self, place: str, problem: str, /, *causes: str, **values: Any) -> None:
        """Note a problem, such as ``must be positive``, of a place such as ``plant.m1``.

        With values, the problem is a template, as `gen_profile.support.phrase.Phrase` takes them. It is no
        fault of its own where something is wrong at its causes, which are places, too.
        """
        if not any(self._told(one) for one in (place, *causes)):
            self._sentences[place] = placed(place, Phrase(problem, **values) if values else problem)
            self._around.update(_outwards(place))

    def _told(self, place: str) -> bool:
        """Whether something is wrong at a place, around it or inside it."""
        return place in self._around or any(outer in self._sentences for outer in _outwards(place))

    def raise_any(self) -> None:
        """Raise all faults as one error.

        Raises
        ------
        SpecError
            There are some.
        """
        if self._sentences:
            raise SpecError(*self._sentences.values())


def _outwards(place: str) -> Iterable[str]:
    """List a place and those around it: ``plant.m1`` and ``plant``."""
    return accumulate(place.split("."), "{}.{}".format)


@attrs.frozen
class Structurer:
    """Makes typed values of plain ones.

    Attributes
    ----------
    faults : Faults
        Where misfits are noted.
    names : mapping
        What the machine has, such as ``"axis"``, by name; with the annotation of what is stated of each,
        where that depends on it, or None.
    """

    faults: Faults
    names: Mapping[str, Mapping[str, Kind]] = NONE

    def fit(
        self, value: Any, kind: Kind, where: str, otherwise: Any = MISFIT, words: Words | None = None
    ) -> Any:
        """Hold a value to an annotation.

        Parameters
        ----------
        value
            As TOML or Python states it, or typed already.
        kind : annotation
        where : str
            The value's place in the spec.
        otherwise
            Stands in for a value that does not fit.
        words : Words, optional
            What to say of it.
        """
        origin: Any = get_origin(kind)
        if origin in (Union, UnionType):
            first, second = get_args(kind)
            several = get_origin(second) is tuple and isinstance(value, list | tuple)
            chosen = second if several else first
            fitted = None if value is None else self.fit(value, chosen, where, words=words)
        elif origin is not None:
            of_form = {Annotated: self._constrained, Mapping: self._mapping, tuple: self._tuple}
            fitted = of_form.get(origin, self._choice)(value, get_args(kind), where, words)
        elif kind not in FORMS and attrs.has(kind):
            fitted = self._table(value, kind, where)
        else:
            fitted = self._scalar(value, kind, where, words)
        return otherwise if fitted is MISFIT else fitted

    def known(self, table: Mapping[str, Any], names: Iterable[str], where: str, word: str = "key") -> Any:
        """Leave out what has other names than these, and tell."""
        names = list(names)
        for number, key in enumerate(sorted(set(table).difference(names))):
            hint = suggestion(key, names) if number < MOST_HINTS else "."
            self.faults.add(place(where, key), "unknown {word}{hint}", word=word, hint=hint)
        return {key: value for key, value in table.items() if key in names}

    def _misfit(self, where: str, words: Words | None, form: str, value: Any) -> Any:
        """Say that a value does not fit, by words of its own or by the form that it must have."""
        self.faults.add(where, (words or Words("must be {form}, found {found}", form=form)).of(value))
        return MISFIT

    def _constrained(self, value: Any, inner: tuple[Any, ...], where: str, words: Words | None) -> Any:
        kind, *constraints = inner
        words = next((one for one in constraints if isinstance(one, Words)), words)
        fitted = self.fit(value, kind, where, words=words)
        for one in constraints:
            if fitted is not MISFIT and hasattr(one, "problem") and (problem := one.problem(fitted, value)):
                self.faults.add(where, words.of(value) if words else problem)
                return MISFIT
        return fitted

    def _mapping(self, value: Any, kinds: tuple[Kind, ...], where: str, words: Words | None) -> Any:
        """Fit what is stated by names of the machine."""
        if not isinstance(value, Mapping):
            return self._misfit(where, words, FORMS[Mapping], value)
        key, kind = kinds
        (named,) = (one for one in key.__metadata__ if isinstance(one, Named))
        names = self.names.get(named.of or named.word, dict.fromkeys(value))
        stated = self.known(value, names, where, named.word)
        order = [name for name in names if name in stated] if named.reorder else stated
        fitted = {name: self.fit(stated[name], names[name] or kind, place(where, name)) for name in order}
        return MappingProxyType({name: one for name, one in fitted.items() if one is not MISFIT})

    def _tuple(self, value: Any, kinds: tuple[Kind, ...], where: str, words: Words | None) -> Any:
        value = value.tolist() if hasattr(value, "tolist") else value
        many = Ellipsis in kinds
        if not isinstance(value, list | tuple) or (not many and len(value) != len(kinds)):
            form = "an array" if many else Phrase("an array of {kinds} numbers", kinds=len(kinds))
            return self._misfit(where, words, form, value)
        if many:
            fitted = [self.fit(one, kinds[0], place(where, index)) for index, one in enumerate(value)]
        else:
            fitted = [self.fit(one, kind, where, words=words) for one, kind in zip(value, kinds, strict=True)]
        return MISFIT if MISFIT in fitted else tuple(fitted)

    def _choice(self, value: Any, choices: tuple[Any, ...], where: str, _: Words | None) -> Any:
        if any(type(choice) is type(value) and choice == value for choice in choices):
            return value
        hint = suggestion(str(value), map(str, choices))
        named = all(isinstance(choice, str) for choice in choices)
        words = Words("unknown value, found {found}{hint}", found=found(value, number=not named), hint=hint)
        return self._misfit(where, words, "", value)

    def _table(self, value: Any, kind: Kind, where: str) -> Any:
        """Make an instance of one of the spec's classes; fields that do not fit take their defaults."""
        if isinstance(value, kind):
            return value
        if not isinstance(value, Mapping):
            value = self._misfit(where, None, FORMS[Mapping], value) and {}
        kinds = kinds_of(kind)
        stated = self.known(value, kinds, where)
        for key in sorted(required(kind) - stated.keys()):
            self.faults.add(place(where, key), "required, but missing")
        fitted = {key: self.fit(one, kinds[key], place(where, key)) for key, one in stated.items()}
        sound = {key: one for key, one in fitted.items() if one is not MISFIT}
        return kind(**sound) if required(kind) <= sound.keys() else MISFIT

    def _scalar(self, value: Any, kind: type, where: str, words: Words | None) -> Any:
        value = value.tolist() if hasattr(value, "tolist") else value  # NumPy's
        is_one = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
        fitted = finite(value) if kind is float else value if is_one else None
        if fitted is None:
            form = FORMS.get(kind, f"a {kind.__name__}")
            return self._misfit(where, words, form, value)
        return fitted


@attrs.frozen(kw_only=True)
class Checked:
    """A table of a spec: its fields hold what their annotations allow, however it is made.

    Raises
    ------
    SpecError
        With all misfits.
    """

    _place: ClassVar[str] = ""

    def __init_subclass__(cls, table: str | None = None) -> None:
        """Name the table's place in a spec; attrs, which makes a class anew, calls this without."""
        if table is not None:
            cls._place = table

    def __attrs_post_init__(self) -> None:
        """Type every field that is not left at its default."""
        structurer = Structurer(Faults())
        table: Kind = type(self)
        kinds = kinds_of(table)
        for field in attrs.fields(table):
            value = getattr(self, field.name)
            if value is not field.default:
                typed = structurer.fit(value, kinds[field.name], place(self._place, field.name))
                object.__setattr__(self, field.name, typed)  # as converters of frozen classes do
        structurer.faults.raise_any()


@cache
def kinds_of(table: Kind) -> dict[str, Kind]:
    """Find the annotation of every field of one of the spec's classes."""
    kinds = get_type_hints(table, include_extras=True)
    return {field.name: kinds[field.name] for field in attrs.fields(table)}


@cache
def required(table: Kind) -> frozenset[str]:
    """Name the fields of one of the spec's classes that have no default."""
    return frozenset(field.name for field in attrs.fields(table) if field.default is attrs.NOTHING)


def finite(value: object) -> float | None:
    """Return a finite number as a float, else None; booleans and texts are no numbers."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def place(outer: str, step: object) -> str:
    """Join a place and a key of it; a key that is no bare TOML key is quoted, as it could pose as more."""
    key = str(step)
    bare = key if key.isidentifier() or re.fullmatch(r"[A-Za-z0-9_-]+", key) else repr(key[:60])
    return f"{outer}.{bare}" if outer else bare
