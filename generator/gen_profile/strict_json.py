"""JSON from outside: finite numbers only, and nested no deeper than Python takes."""

import json
from math import isfinite
from typing import Any


def parse_json(text: str | bytes) -> Any:
    """Read JSON as RFC 8259 has it: without NaN and Infinity, which Python takes.

    Raises
    ------
    ValueError
        It is none, nested too deeply, or holds a number that is not finite.
    """
    try:
        return json.loads(text, parse_constant=_finite, parse_float=_finite)
    except RecursionError as error:
        raise ValueError("arrays or objects nested too deeply") from error


def _finite(text: str) -> float:
    if not isfinite(number := float(text)):
        raise ValueError(f"{text[:20]} is no finite number")
    return number
