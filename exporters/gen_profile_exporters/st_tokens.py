"""Tokens of the subset of IEC 61131-3 Structured Text that is translated to C."""

import re
from collections.abc import Iterator
from typing import NamedTuple

from gen_profile.errors import ExportError

NO_BLOCK = "The text is no function block that can be executed here"
LITERALS = {"REAL": "LREAL", "INTEGER": "DINT", "TRUTH": "BOOL"}  # types by kinds of tokens
_PATTERN = re.compile(
    r"""(?P<skipped>\s+|\(\*.*?\*\))
    |(?P<REAL>[0-9]+\.[0-9]+(?:[eE][+-]?[0-9]+)?)
    |(?P<INTEGER>[0-9]+)
    |(?P<word>[A-Za-z](?:_?[A-Za-z0-9])*)
    |(?P<mark>:=|\.\.|<=|>=|<>|[-+*/=<>()\[\],;:])
    |(?P<unknown>.)""",
    re.DOTALL | re.VERBOSE,
)
_WORDS = (
    *(
        "FUNCTION_BLOCK",
        "END_FUNCTION_BLOCK",
        "VAR_INPUT",
        "VAR_OUTPUT",
        "VAR",
        "CONSTANT",
        "END_VAR",
        "ARRAY",
    ),
    *("OF", "IF", "THEN", "ELSIF", "ELSE", "END_IF", "CASE", "END_CASE", "FOR", "TO", "DO", "END_FOR"),
    *("WHILE", "END_WHILE", "OR", "AND", "NOT"),
)
_KINDS = {
    **{word: word for word in _WORDS},
    **dict.fromkeys(("BOOL", "INT", "DINT", "LREAL"), "TYPE"),
    **dict.fromkeys(("TRUE", "FALSE"), "TRUTH"),
    **dict.fromkeys(("ABS", "SQRT", "LREAL_TO_DINT", "DINT_TO_LREAL"), "FUNCTION"),
}


class StToken(NamedTuple):
    """A word, number or mark: its kind, its text, its line, and where in the whole text it begins.

    Words of the language and marks are kinds of their own. Others are ``NAME``, ``TYPE``, ``FUNCTION``,
    ``REAL``, ``INTEGER``, ``TRUTH``, ``unknown`` for what is no part of the language, and ``END``.
    """

    kind: str
    text: str
    line: int
    begin: int


def tokens(text: str) -> Iterator[StToken]:
    """Divide a text, without its comments; the last token is ``END``."""
    line = 1
    for found in _PATTERN.finditer(text):
        kind, word = found.lastgroup or "", found.group()
        if kind == "skipped":
            line += word.count("\n")
            continue
        if kind == "word":
            kind = _KINDS.get(word.upper(), "NAME")
        elif kind == "mark":
            kind = word
        yield StToken(kind, word, line, found.start())
    yield StToken("END", "", line, len(text))


def refused(place: StToken | int, words: str) -> ExportError:
    """Say what cannot be executed, and in which line."""
    line = place.line if isinstance(place, StToken) else place
    return ExportError(f"{NO_BLOCK}: line {line}: {words}.")
