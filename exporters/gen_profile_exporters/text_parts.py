"""Texts for controllers in files of their own, where they can be read as what they are.

What a text leaves open stands in it as ``$name`` (C, XML, HTML, the playback block), as ``@name`` (buffers
and planner blocks) or as ``{name}`` (libraries and what wraps a block).
"""

import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from string import Template
from textwrap import indent
from typing import Any

FOLDER = Path(__file__).parent
_PART = re.compile(r"(?m)^@part (\w+)\n")


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


def filled(path: str, **values: object) -> str:
    """Read a program of this package, and put in what stands there as ``$name``."""
    return Template((FOLDER / path).read_text("ascii")).substitute(values)


def put_in(text: str, **values: str) -> str:
    """Put in what stands in Structured Text as ``@name``; alone on its line, it is whole lines, or none."""
    lines = {name: f"{value}\n" if value else "" for name, value in values.items()}
    text = re.sub(r"(?m)^@(\w+)\n", lambda hole: lines.get(hole[1], hole[0]), text)
    return re.sub(r"@(\w+)", lambda hole: values.get(hole[1], hole[0]), text)


def indented(lines: Iterable[str]) -> str:
    """Put lines of C between braces."""
    return indent("\n".join(lines), "    ")
