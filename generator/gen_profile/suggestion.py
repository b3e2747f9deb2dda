"""What a person may have meant by a word that is not known."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable


def suggestion(word: str, known: Iterable[str]) -> str:
    """End a sentence: ``; did you mean 'x'?`` where something similar is known, else the list of what is."""
    known = list(known)
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"; did you mean {near[0]!r}?" if near else f" (known: {', '.join(known)})."


def decimal_point(text: str) -> str:
    """Continue a sentence about a number with a decimal comma: ``; write a decimal point: 6.0``."""
    comma = re.fullmatch(r"\s*([+-]?[0-9]+),([0-9]+)\s*", text)
    return f"; write a decimal point: {comma[1]}.{comma[2]}" if comma else ""
