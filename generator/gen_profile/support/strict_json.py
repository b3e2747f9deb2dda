"""JSON from outside: finite numbers only, every key once, and nested no deeper than Python takes."""

import json
from collections.abc import Mapping
from math import isfinite
from typing import Any


def parse_json(text: str | bytes) -> Any:
    """Read JSON that every reader takes alike: no NaN and Infinity, and no key twice, which Python allows.

    Raises
    ------
    ValueError
        It is none, nested too deeply, or holds a number that is not finite or a key that stands twice.
    """
    try:
        return json.loads(text, parse_constant=_finite, parse_float=_finite, object_pairs_hook=_once)
    except RecursionError as error:
        raise ValueError("arrays or objects nested too deeply") from error


def parse_document(text: str | bytes, head: Mapping[str, object]) -> dict[str, Any]:
    """Read a JSON document of a format: an object that has the values of a head.

    Raises
    ------
    ValueError
        As `parse_json`; or it is of another format.
    """
    document = parse_json(text)
    if not isinstance(document, dict) or {key: document.get(key) for key in head} != head:
        raise ValueError("another format")
    return document


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    document = dict(pairs)
    if len(document) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"{next(key for key in keys if keys.count(key) > 1)[:40]!r} appears twice")
    return document


def _finite(text: str) -> float:
    if not isfinite(number := float(text)):
        raise ValueError(f"{text[:20]} is no finite number")
    return number
