"""A spec's text with some values changed, and all that its author wrote beside them kept."""

from pathlib import Path

import tomli_w
import tomlkit
from tomlkit.items import InlineTable, Item, Table

from gen_profile.spec.model import Spec
from gen_profile.spec.reading import overridden, parse_spec
from gen_profile.support.errors import GenProfileError

CHANGED = ("plant", "robustness", "check")


def changed_text(text: str, overrides: tuple[str, ...], given: Spec, spec: Spec, folder: Path) -> str:
    """Write a spec that differs from the one a text states, in parameters, robustness and check.

    Parameters
    ----------
    text : str
        TOML.
    overrides : tuple of str
        That were applied to it; they are written, too.
    given : Spec
        What both state.
    spec : Spec
        What the new text shall state.
    folder : Path
        What files that the text names are relative to.

    Returns
    -------
    str
        With every comment of the old text; the complete spec where that text cannot be changed so.
    """
    document = overridden(tomlkit.parse(text), overrides)
    before, after = given.to_dict(), spec.to_dict()
    for name in CHANGED:
        _change(document, name, before[name], after[name])
    try:
        if parse_spec(document.as_string(), source="spec", folder=folder) != spec:
            return tomli_w.dumps(after)
    except GenProfileError:
        return tomli_w.dumps(after)
    if spec.plant.file is not None:
        document["plant"]["file"] = spec.plant.file.name  # lies beside the new spec
    return document.as_string()


def _change(table: tomlkit.TOMLDocument | Table, key: str, before: object, after: object) -> None:
    if before == after:
        return
    width = _width(table.get(key))
    _set(table, key, before, after)
    changed = table[key]
    if width and (trivia := changed.trivia).comment:  # which stays in its column
        trivia.comment_ws = " " * max(1, len(trivia.comment_ws) + width - _width(changed))


def _width(item: object) -> int:
    """Count the characters of a value in its line; none of a table of several lines."""
    return len(item.as_string()) if isinstance(item, Item) and not isinstance(item, Table) else 0


def _set(table: tomlkit.TOMLDocument | Table, key: str, before: object, after: object) -> None:
    if isinstance(after, dict) and isinstance(before, dict):
        known = table.setdefault(key, tomlkit.table())
        if isinstance(known, InlineTable) and not after.keys() <= known.keys():
            # else the last one lacks its space
            held = (f"{name} = {tomlkit.item(value).as_string()}" for name, value in after.items())
            table[key] = tomlkit.value(f"{{ {', '.join(held)} }}")
            return
        for name, value in after.items():
            _change(table[key], name, before.get(name), value)
    else:
        table[key] = after
