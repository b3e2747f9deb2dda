"""What docs/command-line.md tells of JSON documents, held against those that the commands print."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[1] / "docs" / "command-line.md"
REFUSAL = "Exit codes"  # the section that shows a refusal's document


def require_documented(command: str, document: Any) -> None:
    """Fail where a command's document and the page differ in their keys."""
    refused = isinstance(document, dict) and document.keys() == {"error"}
    shapes = documented()[REFUSAL if refused else command]
    faults = [list(_differences(shape, document, command)) for shape in shapes]
    assert not all(faults), f"{PAGE.name}: {'; '.join(min(faults, key=len))}"


@cache
def documented() -> dict[str, list[Any]]:
    """Read the page's JSON blocks, by the command, or else the heading, that they stand under."""
    found: dict[str, list[Any]] = {}
    for section in re.split(r"^##+ ", PAGE.read_text("utf-8"), flags=re.MULTILINE):
        heading = section.partition("\n")[0]
        command = re.match(r"`gen-profile ([a-z -]+?) (?:\[|[A-Z])", heading)
        blocks = re.findall(r"^```json\n(.*?)^```$", section, flags=re.MULTILINE | re.DOTALL)
        found[command[1] if command else heading] = [json.loads(block) for block in blocks]
    return found


def _differences(stated: Any, found: Any, place: str) -> Iterator[str]:
    """Tell which keys are on one side only; texts on the page stand for any value without keys."""
    match stated:
        case str():
            part = re.match(r"(\w+), above", stated)
            if part and found is not None:
                yield from _differences(documented()[f"`{part[1]}`"][0], found, place)
            elif isinstance(found, dict):
                yield f"{place} has keys that are not told"
        case dict() if isinstance(found, dict):
            yield from _different_keys(stated, found, place)
        case list() if isinstance(found, list):
            for element in found:
                yield from _differences(stated[0], element, f"{place}[]")
        case _ if found not in (None, stated):
            yield f"{place} is {found!r}, not {stated!r}"


def _different_keys(stated: dict[str, Any], found: dict[str, Any], place: str) -> Iterator[str]:
    any_name = next((shape for key, shape in stated.items() if key.startswith("<")), None)
    for key, value in found.items():
        shape = stated.get(key, any_name)
        if shape is None:
            yield f"{place}.{key} is not told"
        else:
            yield from _differences(shape, value, f"{place}.{key}")
    for key, shape in stated.items():
        seldom = re.match(r"(\{'<\w+>': ')?only", str(shape))
        if key not in found and not key.startswith("<") and not seldom:
            yield f"{place}.{key} is described, but not there"
