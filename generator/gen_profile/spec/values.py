"""Kinds of values in a spec: numbers with bounds, texts with patterns, choices.

A field's annotation says what it may hold; `gen_profile.spec.structure` holds every value to it.
"""

import math
import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Annotated, Any, Literal

import attrs

from gen_profile.support.errors import SpecError
from gen_profile.support.phrase import Phrase
from gen_profile.support.suggestion import found

NONE: Mapping[str, Any] = MappingProxyType({})  # a default


@attrs.frozen
class Bounds:
    """Allowed values of a number, `above` itself excluded, and what they are: a unit, or words."""

    above: float = -math.inf
    least: float = -math.inf
    most: float = math.inf
    meaning: str = ""

    def problem(self, value: float, _: object) -> str:
        """Say what a number must be; nothing where it is."""
        if value > self.above and self.least <= value <= self.most:
            return ""
        bounds = between({"greater than": self.above, "at least": self.least, "at most": self.most})
        form = Phrase("{bounds} {meaning}", bounds=bounds, meaning=self.meaning) if self.meaning else bounds
        return Phrase("must be {form}, found {found}", form=form, found=found(value))


@attrs.frozen
class Pattern:
    """Allowed texts: a regular expression and what it means in words."""

    expression: str
    meaning: str

    def problem(self, value: str, _: object) -> str:
        """Say what a text must be; nothing where it is."""
        fits = re.fullmatch(self.expression, value)
        return "" if fits else Phrase("must be {form}, found {found}", form=self.meaning, found=found(value))


@attrs.frozen
class Rising:
    """Two numbers, the second no less than the first; or greater, where that is `strict`."""

    meaning: str = ""
    strict: bool = False

    def problem(self, value: tuple[float, float], written: Sequence[float]) -> str:
        """Say what two numbers must be; nothing where they are."""
        low, high = value
        if low < high or (low == high and not self.strict):
            return ""
        meaning = self.meaning or Phrase("numbers, such as {example}", example=[high, low])
        return Phrase("must be two rising {meaning}, found {found}", meaning=meaning, found=list(written))


class Words:
    """What to say of whatever does not fit: a template with its values, besides ``{found}``."""

    def __init__(self, template: str, **values: Any) -> None:
        self._template, self._values = template, values

    def of(self, value: object) -> Phrase:
        """Put it into words for a value."""
        return Phrase(self._template, **{"found": found(value), **self._values})


def example(toml: str) -> Words:
    """Show what a table may hold, in TOML, to who states something else."""
    return Words("must be a table such as {{ {toml} }}, found {found}", toml=toml)


@attrs.frozen
class Named:
    """Keys that are names of the machine's, such as its axes, or of something that is stated by them."""

    word: str  # such as "axis"
    of: str = ""  # what is stated by these names, where the machine says what that may be
    reorder: bool = True  # into the machine's order, so that the one they are written in means nothing


def between(limits: Mapping[str, float], unit: str = "") -> str:
    """Say what a number must be, such as ``at least 1 m and at most 2 m``, by limits that are finite."""
    template = "{word} {bound:g} {unit}" if unit else "{word} {bound:g}"
    finite = {word: bound for word, bound in limits.items() if math.isfinite(bound)}
    stated = [Phrase(template, word=word, bound=bound, unit=unit) for word, bound in finite.items()]
    return stated[0] if len(stated) == 1 else Phrase("{low} and {high}", low=stated[0], high=stated[1])


def require_whole(value: object, least: int, place: str) -> None:
    """Refuse, by a `SpecError`, what is no whole number, or less."""
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise SpecError(f"{place}: must be a whole number of at least {least}, found {found(value)}.")


GERMAN = str.maketrans({"Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ä": "ae", "ö": "oe", "ü": "ue"})


def ascii_name(name: str) -> str:
    """Write a name as files and blocks of controllers have it, such as Bruecke for Brücke."""
    if name.isascii():
        return name
    from anyascii import anyascii  # noqa: PLC0415  (whose tables few names need)

    return anyascii(name.translate(GERMAN))


@attrs.frozen
class NamePattern(Pattern):
    """Names of letters of any script, as long as what they are in ASCII fits the expression."""

    def problem(self, value: str, written: object) -> str:
        """Say what a name must be; nothing where it is."""
        of_letters = re.fullmatch(r"[\w. -]*", value)
        fits = of_letters and not super().problem(ascii_name(value), written)
        return "" if fits else Phrase("must be {form}, found {found}", form=self.meaning, found=found(value))


Name = Annotated[
    str,
    NamePattern(
        r"(?!(?i:con|prn|aux|nul|com[0-9]|lpt[0-9])(?:\.|$))"
        r"[A-Za-z0-9](?:[A-Za-z0-9._ -]{0,62}[A-Za-z0-9_-])?",
        "1 to 64 letters, digits, dots, underscores, hyphens and spaces, beginning with a letter or digit, "
        "not ending with a dot or space, and no device's name in Windows, as CON",
    ),
]
AxisName = Annotated[str, Named("axis", reorder=False)]
LoadName = Annotated[str, Named("load")]
ParameterName = Annotated[str, Named("parameter")]
Positive = Annotated[float, Bounds(above=0.0)]
NotNegative = Annotated[float, Bounds(least=0.0)]
RelativeRange = Annotated[float, Bounds(above=0.0, most=0.9, meaning="(0.1 is 10 %)")]
CycleTime = Annotated[float, Bounds(least=1e-5, most=1.0, meaning="s (4 ms are 0.004)")]
LONGEST_MOVE = 1e5  # s
Duration = Annotated[float, Bounds(least=1e-3, most=LONGEST_MOVE, meaning="s")]
Column = Literal["position", "velocity", "acceleration", "jerk"]
Distance = Annotated[float, Bounds(least=-1e5, most=1e5, meaning="m (or rad)")]
Travel = Annotated[tuple[Distance, Distance], Rising()]
SolverName = Literal["auto", "indirect", "direct"]
ShaperName = Literal["nzv", "zv", "zvd", "zvdd", "umzvd", "ei", "2hump-ei", "3hump-ei", "mzv"]
