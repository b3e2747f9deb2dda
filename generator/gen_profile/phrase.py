"""A text that knows how it was made: a template and values, so that a translation need not parse it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from string import Formatter
from types import MappingProxyType
from typing import Any, Self


class Phrase(str):
    """A template such as ``"{place}: {allowed:g} is allowed"`` with its values filled in.

    Parameters
    ----------
    template : str
        As `str.format` takes it; a translation is another template with the same names.
    values
        By name: numbers, texts, or further phrases.
    """

    __slots__ = ("template", "values")
    template: str
    values: Mapping[str, Any]

    def __new__(cls, template: str, /, **values: Any) -> Self:
        """Fill in the values."""
        made = super().__new__(cls, template.format(**values))
        made.template, made.values = template, MappingProxyType(values)
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        """Make it again elsewhere."""
        return _phrase, (self.template, dict(self.values))


def _phrase(template: str, values: Mapping[str, Any]) -> Phrase:
    return Phrase(template, **values)


def alternatives(texts: Sequence[str]) -> str:
    """Write ``a, or with b, or with c``."""
    first, *others = texts
    return Phrase("{first}, or with {others}", first=first, others=alternatives(others)) if others else first


def plain(text: str) -> str | dict[str, Any]:
    """Nest plain values for JSON: a text as it is, or a phrase's template and its values, each as a text."""
    if not isinstance(text, Phrase):
        return text
    values = text.values
    shown = {name: spec or "" for _, name, spec, _ in Formatter().parse(text.template) if name}
    return {
        "template": text.template,
        "values": {
            name: plain(values[name]) if isinstance(values[name], str) else format(values[name], spec)
            for name, spec in shown.items()
        },
    }
