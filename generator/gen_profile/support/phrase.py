"""A text that knows how it was made: a template and values, so that a translation need not parse it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from string import Formatter
from typing import Any

PLACED = "{place}: {problem}{end}"
AND, AND_THE = "{first} and {others}", "{first} and the {others}"  # to join texts by
OR_WITH = "{first}, or with {others}"


class Phrase(str):
    """A template such as ``"{place}: {allowed:g} is allowed"`` with its values filled in.

    Parameters
    ----------
    template : str
        As `str.format` takes it; a translation is another template with the same fields.
    values
        By name: numbers, texts, further phrases, or what has them as attributes.
    """

    template: str
    values: Mapping[str, str]

    def __new__(cls, template: str, /, **values: Any) -> Phrase:
        """Fill in the values; they are kept as texts."""
        texts: dict[str, str] = {}
        for _, field, spec, conversion in Formatter().parse(template):
            value = Formatter().get_field(field, (), values)[0] if field else ""
            if field:
                text = format(repr(value) if conversion else value, spec or "")
                texts[field] = value if isinstance(value, Phrase) else text
        return _phrase(template.format(**values), template, texts)

    def __reduce__(self) -> tuple[Any, ...]:
        """Make it again elsewhere."""
        return _phrase, (str(self), self.template, self.values)


def _phrase(text: str, template: str, values: Mapping[str, str]) -> Phrase:
    made = str.__new__(Phrase, text)
    made.template, made.values = template, values
    return made


def placed(place: str, problem: str) -> Phrase:
    """Tell where a problem is, as a sentence."""
    end = "" if problem.endswith(("?", ".")) else "."
    return Phrase(PLACED, place=place, problem=problem, end=end)


def joined(template: str, texts: Sequence[str]) -> str:
    """Join texts by a template of ``{first}`` and ``{others}``."""
    first, *others = texts
    return Phrase(template, first=first, others=joined(template, others)) if others else first


def plain(value: Any) -> Any:
    """Nest plain values for JSON: of phrases their templates, and their values as texts."""
    if isinstance(value, Mapping):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if not isinstance(value, Phrase):
        return value
    return {"template": value.template, "values": plain(value.values)}
