"""Texts for controllers, compilers and browsers in files of their own, which are Jinja2 templates.

``{{ name }}`` is what a text leaves open; a line that is nothing but a statement ``{% … %}`` leaves no trace.
"""

import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

FOLDER = Path(__file__).parent
_PART = re.compile(r"(?m)^@part (\w+)\n")


def filled(path: str | Path, **values: object) -> str:
    """Fill a template of this package, or of another one by its whole path, with values by their names.

    Raises
    ------
    jinja2.UndefinedError
        One is missing.
    """
    return _environment().get_template(str(path)).render(values)


def macros(path: str) -> Any:
    """Give what a template of this package defines: its macros, and its values, as attributes."""
    return _environment().get_template(path).module


@cache
def _environment() -> "Environment":
    from jinja2 import Environment, FunctionLoader, StrictUndefined  # noqa: PLC0415  # slow to import

    return Environment(
        autoescape=lambda path: str(path).endswith(".html"),
        loader=FunctionLoader(lambda path: (FOLDER / path).read_text("utf-8")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


@cache
def text_parts(path: str) -> dict[str, Any]:
    """Read the parts of a file of this package, each below a line ``@part NAME``.

    The last line of a part has no end.
    """
    _, *pieces = _PART.split((FOLDER / path).read_text("utf-8"))
    return {name: text.removesuffix("\n") for name, text in zip(pieces[::2], pieces[1::2], strict=True)}


def names_by_type(part: str) -> dict[str, tuple[str, ...]]:
    """Read lines of a type and names of variables that have it."""
    return {type_: tuple(names) for type_, *names in map(str.split, part.splitlines())}


def put_in(text: str, **values: str) -> str:
    """Put in what stands in Structured Text as ``@name``; alone on its line, it is whole lines, or none."""
    lines = {name: f"{value}\n" if value else "" for name, value in values.items()}
    text = re.sub(r"(?m)^@(\w+)\n", lambda hole: lines.get(hole[1], hole[0]), text)
    return re.sub(r"@(\w+)", lambda hole: values.get(hole[1], hole[0]), text)


def indented(lines: Iterable[str]) -> str:
    """Put lines of C between braces."""
    return indent("\n".join(lines), "    ")
