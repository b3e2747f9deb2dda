"""What a page of the studio shows: a spec to start with, and what was changed since."""

from __future__ import annotations

import base64
import json
import math
import re
import shlex
import zlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import attrs
import tomlkit

from gen_profile.spec.reading import PROGRAMS, Document, overridden, parse_toml, preset_text
from gen_profile.spec.values import NONE
from gen_profile.support.errors import SpecError
from gen_profile.support.strict_json import parse_json

MOST_EDITS = 200
MOST_TEXT = 200  # characters of a value
MOST_NUMBERS = 16  # of a value
MOST_SPEC = 262_144  # bytes of a spec that is dropped on a page
MOST_ADDRESS, MOST_STATE = 16_384, 262_144  # bytes, as it is written and unpacked
KEY = re.compile(r"[a-z]+(\.[A-Za-z0-9_-]+){0,4}")
# which program runs is for the studio's user to say, not for an address
FIXED = re.compile(
    r"(plant\.(type|file|file_sha256)|check\.(fmu|fmu_sha256|input|output|parameters|units|step))(\..*)?"
)


@lru_cache(maxsize=8)  # asked for at every turn of a knob; it is never changed
def _parsed(text: str) -> dict[str, Any]:
    return parse_toml(text)


@attrs.frozen(kw_only=True)
class WrittenSpec:
    """A spec as its author wrote it.

    Attributes
    ----------
    words : tuple of str
        What the command line calls it by.
    text : str
        TOML.
    folder : Path
        What files that the text names are relative to.
    """

    words: tuple[str, ...]
    text: str
    folder: Path

    @property
    def document(self) -> dict[str, Any]:
        """What it states.

        Raises
        ------
        SpecError
            It is no TOML.
        """
        try:
            return _parsed(self.text)
        except ValueError as error:
            raise SpecError(f"{' '.join(self.words)}: not valid TOML: {error}.") from error

    @property
    def programs(self) -> Mapping[str, Path]:
        """Files that the spec names and whose code would run, by key; nothing of them is looked at.

        They are a machine of one's own, and an external FMU.
        """
        programs = {}
        for name, key in PROGRAMS:
            table = self.document.get(name)
            if isinstance(table, dict) and isinstance(file := table.get(key), str):
                programs[f"{name}.{key}"] = (self.folder / file).absolute()
        return programs


def changed_start(words: tuple[str, ...], text: str, changes: tuple[str, ...], folder: Path) -> WrittenSpec:
    """Begin with a spec to which ``KEY=VALUE`` overrides were applied.

    Raises
    ------
    SpecError
        It is no TOML, or an override makes no sense.
    """
    start = WrittenSpec(words=words, text=text, folder=folder)
    if start.document and changes:
        sets = [word for change in changes for word in ("--set", change)]
        text = overridden(tomlkit.parse(text), changes).as_string()
        return WrittenSpec(words=(*words, *sets), text=text, folder=folder)
    return start


def preset_start(name: str) -> WrittenSpec:
    """Begin with a preset.

    Raises
    ------
    SpecError
        There is no such preset.
    """
    return WrittenSpec(words=("--preset", name), text=preset_text(name), folder=Path())


def opened_start(name: str, content: bytes, folder: Path) -> WrittenSpec:
    """Begin with a spec that was handed over as a file.

    Raises
    ------
    SpecError
        It is too large, no UTF-8 text, or no TOML.
    """
    if len(content) > MOST_SPEC:
        raise SpecError(f"{name}: more than {MOST_SPEC // 1024} kB, which is no spec.")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SpecError(f"{name}: not UTF-8 text (byte {error.start}); save the spec as UTF-8.") from error
    start = WrittenSpec(words=(name,), text=text, folder=folder)
    if not start.document:
        raise SpecError(f"{name}: the spec is empty; it must state at least [plant] type and [move].")
    return start


def _edits(stated: Mapping[str, Any]) -> dict[str, Any]:
    """Hold edits to what a knob can say."""
    if not isinstance(stated, Mapping) or len(stated) > MOST_EDITS:
        raise SpecError(f"The state of a page holds at most {MOST_EDITS} changes, by key.")
    for key, value in stated.items():
        if not isinstance(key, str) or not KEY.fullmatch(key) or FIXED.fullmatch(key):
            raise SpecError(f"{str(key)[:60]}: no knob changes this key.")
        if not _is_plain(value):
            raise SpecError(f"{key}: must be a number, a short text, a list of these, or nothing.")
    return dict(stated)


def _is_plain(value: object) -> bool:
    match value:
        case None | bool():
            return True
        case int() | float():
            return math.isfinite(value) and abs(value) < 10**18
        case str():
            return len(value) <= MOST_TEXT and value.isprintable()
        case list():
            inner = all(not isinstance(one, list) and one is not None and _is_plain(one) for one in value)
            return len(value) <= MOST_NUMBERS and inner
        case _:
            return False


@attrs.frozen(kw_only=True)
class StudioState:
    """What is shown.

    Attributes
    ----------
    preset : str
        With which it starts; empty for the spec that the studio was started with.
    edits : mapping of str to value
        New values by key, such as ``"plant.L1"``; None takes a key away.
    """

    preset: str = ""
    edits: Mapping[str, Any] = attrs.field(default=NONE, converter=_edits)

    @classmethod
    def from_json(cls, document: object) -> StudioState:
        """Take what a page says.

        Raises
        ------
        SpecError
            No page says that.
        """
        if not isinstance(document, dict) or not isinstance(document.get("preset", ""), str):
            raise SpecError("This is no state of a page.")
        return cls(preset=document.get("preset", ""), edits=document.get("edits", {}))

    @classmethod
    def from_address(cls, text: str) -> StudioState:
        """Read what `address` wrote.

        Raises
        ------
        SpecError
            The text is damaged.
        """
        try:
            packed = base64.urlsafe_b64decode(text[:MOST_ADDRESS] + "=" * (-len(text) % 4))
            unpacker = zlib.decompressobj(wbits=-15)
            document = parse_json(unpacker.decompress(packed, MOST_STATE))
        except (ValueError, zlib.error) as error:
            raise SpecError(
                "The state in the address is damaged; the page shows what it starts with."
            ) from error
        return cls.from_json(document)

    @property
    def address(self) -> str:
        """The state in letters, digits, hyphens and underscores; empty where nothing was changed."""
        if self == StudioState():
            return ""
        text = json.dumps(attrs.asdict(self), separators=(",", ":"), ensure_ascii=True)
        packer = zlib.compressobj(9, zlib.DEFLATED, -15)
        packed = packer.compress(text.encode()) + packer.flush()
        return base64.urlsafe_b64encode(packed).decode().rstrip("=")


def overrides(start: WrittenSpec, edits: Mapping[str, Any]) -> list[str]:
    """Write edits as ``--set`` takes them; a table that lost a key is stated as a whole."""
    lost = {key.partition(".")[0] for key, value in edits.items() if value is None}
    inside = {key: value for key, value in edits.items() if key.partition(".")[0] in lost}
    outside = [f"{key}={_written(value)}" for key, value in edits.items() if key not in inside]
    document = _edited(start.document, inside)
    return [*outside, *(f"{name}={_inline(document.get(name, {}))}" for name in sorted(lost))]


def document_of(start: WrittenSpec, edits: Mapping[str, Any]) -> dict[str, Any]:
    """Change a spec's nested plain values.

    Raises
    ------
    SpecError
        An edit makes no sense there.
    """
    return overridden(start.document, overrides(start, edits))


def text_of(start: WrittenSpec, edits: Mapping[str, Any]) -> str:
    """Write the changed spec as TOML, with all that its author wrote beside the values.

    Raises
    ------
    SpecError
    """
    return _edited(tomlkit.parse(start.text), edits).as_string()


def command_of(start: WrittenSpec, edits: Mapping[str, Any], *command: str) -> str:
    """Write the command line that designs what is shown, or does something else with it."""
    changes = [word for override in overrides(start, edits) for word in ("--set", override)]
    return shlex.join(["gen-profile", *command, *start.words, *changes])


def _edited(document: Document, edits: Mapping[str, Any]) -> Document:
    """Copy a document with other values, and without the keys that are taken away."""
    stated = [f"{key}={_written(value)}" for key, value in edits.items() if value is not None]
    changed = overridden(document, stated)
    for key, value in edits.items():
        if value is None:
            _drop(changed, key.split("."))
    return changed


def _drop(table: Any, path: list[str]) -> None:
    """Take a key away where it is stated."""
    *outer, last = path
    for part in outer:
        table = table.get(part)
        if not isinstance(table, dict):
            return
    table.pop(last, None)


def _written(value: Any) -> str:
    """Write a value as a person would behind ``KEY=``: a word without quotes where it stays one."""
    is_word = isinstance(value, str) and re.fullmatch(r"[a-z][a-z-]*", value)
    return value if is_word and value not in ("true", "false", "inf", "nan") else _inline(value)


def _inline(value: Any) -> str:
    """Write TOML on one line."""
    if not isinstance(value, Mapping):
        return str(tomlkit.item(value).as_string())
    table = tomlkit.inline_table()
    table.update(value)
    return table.as_string()
