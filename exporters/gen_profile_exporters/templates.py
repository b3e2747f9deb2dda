"""Texts for controllers, compilers and browsers in files of their own, which are Jinja2 templates.

``{{ name }}`` is what a text leaves open; a line that is nothing but a statement ``{% … %}`` leaves no trace.
"""

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jinja2 import Environment

FOLDER = Path(__file__).parent


def filled(path: str | Path, **values: object) -> str:
    """Fill a template of this package, or of another one by its whole path, with values by their names.

    Raises
    ------
    jinja2.UndefinedError
        One is missing.
    """
    return _environment(is_open=False).get_template(str(path)).render(values)


def left_open(path: str, **values: object) -> str:
    """Fill a template where there are values; elsewhere ``@name`` stands for what is missing."""
    return _environment(is_open=True).get_template(path).render(values)


def macros(path: str) -> Any:
    """Give what a template of this package defines: its macros, and its values, as attributes."""
    return _environment(is_open=False).get_template(path).module


@cache
def _environment(*, is_open: bool) -> "Environment":
    from jinja2 import Environment, FunctionLoader, StrictUndefined, Undefined  # noqa: PLC0415  # slow to import

    class Hole(Undefined):
        def __str__(self) -> str:
            return f"@{self._undefined_name}"

    return Environment(
        autoescape=lambda path: str(path).endswith(".html"),
        loader=FunctionLoader(lambda path: (FOLDER / path).read_text("utf-8")),
        undefined=Hole if is_open else StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def indented(lines: Iterable[str]) -> str:
    """Put lines of C between braces."""
    return indent("\n".join(lines), "    ")
