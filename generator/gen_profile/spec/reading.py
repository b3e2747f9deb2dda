"""From TOML files, presets and ``KEY=VALUE`` overrides to a `Spec`, with every fault in one error."""

import copy
import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib.resources import files
from pathlib import Path, PureWindowsPath
from typing import Any, TypeVar

from gen_profile.spec.arguments import as_names, as_path, as_text
from gen_profile.spec.model import Spec
from gen_profile.spec.plausibility import refuse_implausible
from gen_profile.spec.stacks import SOURCES
from gen_profile.spec.tables import Table, structure
from gen_profile.support.bounded_file import DOCUMENT, is_folder, read_bounded
from gen_profile.support.errors import OutputError, SpecError, UnknownProgram
from gen_profile.support.private_folder import is_agreed
from gen_profile.support.suggestion import DASHES, listed, meant, number_meant, suggestion

Document = TypeVar("Document", bound=dict[str, Any])
HERE = Path()
PROGRAMS = (("plant", "file"), ("check", "fmu"))  # keys that name code, which runs
MOST_PARTS = 32  # of a key: its parser takes time and memory by their square
LONG_KEY = re.compile(
    r"(?<![\w-])(?:(?:[\w-]++|\"(?:[^\"\\\n]|\\.)*+\"|'[^'\n]*+')[ \t]*+\.[ \t]*+)"
    rf"{{{MOST_PARTS}}}"
)
HEADER = re.compile(r"\s*\[+([^\[\]=]+)\]")
KEY = re.compile(r"\s*([\w.\"'-]+)\s*=")
SLIPS = {
    rf"[=\[,]\s*{DASHES.pattern}\s*\.?\d": "; write the minus of the keyboard, -",
    r"//|/\*|;|^\s*(%|!|--)": "; a comment begins with #",
    r"^\s*[\w.-]+\s*:": "; write = between a key and its value",
    r"=\s*[A-Za-z_]": "; a text stands in quotes",
    "[=\\[,]\\s*[\u2018-\u201f\u00ab\u00bb]": '; write the straight quotes of the keyboard, "',
    "^[^#]*[\u00a0\u2000-\u200b\u202f\u3000]": "; a space there is none of the keyboard's, type it again",
}  # the last two are what word processors write

# a move is stated one way, and so is what stands under it: the new way replaces the old one
REPLACED: dict[tuple[str, str], Sequence[str]] = {
    ("move", "distance"): ("start", "target"),
    ("move", "start"): ("distance",),
    ("move", "target"): ("distance",),
    **{("path", one): [other for other in SOURCES if other != one] for one in SOURCES},
}


def read_spec(path: Path | str, overrides: Sequence[str] = (), **tables: Any) -> Spec:
    r"""Read a TOML file.

    Parameters
    ----------
    path : Path or str
    overrides : sequence of str
        Such as ``"plant.L1=0.5"``.
    tables : mappings
        Further values by table, such as ``move={"duration": 3.2}``; None takes a key away, or a table.

    Raises
    ------
    OutputError
        The file cannot be read.
    SpecError
        No path, or the text is no TOML, or its content has faults: all of them are listed.

    Examples
    --------
    >>> with open("tank.toml", "w") as file:
    ...     _ = file.write("plant.type = 'slosh-tank'\nmove = { distance = 0.5, duration = 2.0 }")
    >>> gp.read_spec("tank.toml", move={"duration": 2.2}).move.duration
    2.2
    """
    path = as_path(path, "A spec, or the path of one,")
    return parse_spec(read_text(path), overrides, str(path), path.parent, **tables)


def as_spec(spec: Spec | Path | str) -> Spec:
    """Take a spec as it is, or read the file that is named; raises as `read_spec`."""
    return spec if isinstance(spec, Spec) else read_spec(spec)


def read_text(path: Path) -> str:
    """Read a TOML file's text, unparsed.

    Raises
    ------
    OutputError
        The file cannot be read.
    SpecError
        It is no UTF-8 text.
    """
    try:
        return read_bounded(path, DOCUMENT).decode("utf-8-sig")
    except OSError as error:
        near = meant(path.name, [other.name for other in path.parent.glob("*.toml")])
        cure = f"; did you mean {listed(near)}?" if near and isinstance(error, FileNotFoundError) else "."
        if is_folder(error, path):
            cure = "; name a file in it."
        if str(path) in presets():
            cure = f"; a preset is called so: --preset {path}, or gp.preset_spec({str(path)!r})."
        raise OutputError(f"Cannot read the spec {path}: {error.strerror}{cure}") from error
    except UnicodeDecodeError as error:
        _refuse_other(str(path))
        raise SpecError(f"{path}: not UTF-8 text (byte {error.start}); save the spec as UTF-8.") from error


def parse_spec(
    text: str, overrides: Sequence[str] = (), source: str = "spec", folder: Path = HERE, **tables: Any
) -> Spec:
    r"""Read TOML text, apply overrides such as ``plant.L1=0.5`` and validate the whole.

    Parameters
    ----------
    text : str
    overrides : sequence of str
    source : str
        Where the text comes from, for errors.
    folder : Path
        What files that the spec names are relative to.
    tables : mappings
        Further values by table, as `read_spec` takes them.

    Raises
    ------
    SpecError
        The text is no TOML (with line and column), or its content has faults: all of them are listed.

    Examples
    --------
    >>> gp.parse_spec("plant.type = 'slosh-tank'\nmove = { distance = 0.5, duration = 2.0 }").plant.type
    'slosh-tank'
    """
    text = as_text(text, f"{source}: a text")
    document = _document(text, source)
    if not document and not overrides and not tables:
        raise SpecError(f"{source}: the spec is empty; it must state at least [plant] type and [move].")
    document = overridden(document, overrides)
    _fill(document, tables)
    return spec_from_dict(document, folder)


def make_spec(**tables: Any) -> Spec:
    """Make a spec of its tables, such as ``plant={"type": "flexible-joint"}, move={…}``.

    Raises
    ------
    SpecError
        With one sentence for every fault found.

    Examples
    --------
    >>> gp.make_spec(plant={"type": "double-pendulum-crane"}, move={"distance": 1.0, "duration": 5.0})
    <Spec name: profile, machine: double-pendulum-crane, move: [0.0] to [1.0], duration: 5 s, ...>
    """
    return evolve_spec({}, **tables)


def evolve_spec(spec: Spec | Mapping[str, Any] | Path | str, **tables: Any) -> Spec:
    """Change values of a spec, which is validated as a whole again.

    Parameters
    ----------
    spec : Spec, the path of one, or nested plain values
    tables : mappings
        New values by table, as `read_spec` takes them.

    Raises
    ------
    SpecError
        With one sentence for every fault found.

    Examples
    --------
    >>> longer = gp.evolve_spec(gp.preset_spec("paper"), move={"duration": 3.2}, limits={"velocity": 0.3})
    >>> longer.move.duration
    3.2
    """
    document = copy.deepcopy(dict(spec) if isinstance(spec, Mapping) else as_spec(spec).to_dict())
    _fill(document, tables)
    return spec_from_dict(document)


def overridden(document: Document, overrides: Sequence[str]) -> Document:
    """Copy nested plain values and set keys such as ``plant.L1=0.5`` in them.

    Raises
    ------
    SpecError
        An override makes no sense.
    """
    changed = copy.deepcopy(document)
    for override in as_names(overrides):
        _override(changed, override)
    return changed


def presets() -> dict[str, str]:
    """List every preset's name with its summary (the first comment line of its TOML file), sorted.

    Examples
    --------
    >>> sorted(gp.presets())[:2]
    ['bay-crane', 'double-pendulum-crane']
    """
    folder = files("gen_profile") / "presets"
    texts = {item.name.removesuffix(".toml"): item.read_text("utf-8") for item in folder.iterdir()}
    return {name: text.partition("\n")[0].lstrip("# ") for name, text in sorted(texts.items())}


def preset_spec(name: str, overrides: Sequence[str] = (), **tables: Any) -> Spec:
    """Read a preset by name, with changes as `read_spec` takes them.

    Raises
    ------
    SpecError
        There is no such preset, or the overrides have faults.

    Examples
    --------
    >>> gp.preset_spec("paper", ["plant.L1=0.5"]).plant.parameters["L1"]
    0.5
    """
    return parse_spec(preset_text(name), overrides, name, **tables)


def preset_text(name: str) -> str:
    """Read a preset's TOML text.

    Raises
    ------
    SpecError
        There is no such preset.
    """
    if as_text(name, "A preset's name") not in presets():
        raise SpecError(f"preset: unknown preset {name!r}{suggestion(name, presets())}")
    return (files("gen_profile") / "presets" / f"{name}.toml").read_text("utf-8")


def spec_from_dict(document: Mapping[str, Any], folder: Path = HERE) -> Spec:
    """Validate nested plain values, as TOML or a manifest holds them.

    Parameters
    ----------
    document : mapping
    folder : Path
        What files that the spec names are relative to.

    Raises
    ------
    SpecError
        With one sentence for every fault found.
    """
    spec = structure(document, folder)
    refuse_implausible(spec)
    return spec


def received_spec(document: Mapping[str, Any], folder: Path) -> Spec:
    """Read the spec in a manifest, which may be another's: programs that it names are not run unasked.

    Raises
    ------
    SpecError
        It has faults.
    OutputError
        It names a program elsewhere than beside it, or without its SHA-256.
    UnknownProgram
        The user has not let it run.
    """
    unknown = {}
    for table, key in PROGRAMS:
        stated = document.get(table)
        if not isinstance(stated, Mapping) or key not in stated:
            continue
        name, sha256 = stated[key], stated.get(f"{key}_sha256")
        beside = isinstance(name, str) and PureWindowsPath(name).name == name
        if not beside or not isinstance(sha256, str):
            raise OutputError(
                f"The spec in {folder} names the program {name!r} by {table}.{key}; it was not run, as "
                f"received files name programs beside them only, with {table}.{key}_sha256."
            )
        if not is_agreed(sha256):
            unknown[folder / name] = sha256
    if unknown:
        raise UnknownProgram(
            f"{' and '.join(map(str, unknown))} would run with your rights, and never did. Read it, then "
            "let it run by an answer in a terminal, or by naming a spec of yours that names it.",
            programs=unknown,
        )
    return spec_from_dict(document, folder)


@lru_cache(maxsize=1)  # all cases of a sweep begin at the same
def _document(text: str, source: str) -> Table:
    """Parse TOML, for others to copy; its parser tells where it stumbled, except at the end of the text."""
    try:
        return parse_toml(text)
    except tomllib.TOMLDecodeError as error:
        last = text.split("\n")
        end = f"(at the end: line {len(last)}, column {len(last[-1]) + 1})"
        problem = _doubled(text, re.sub(r"[(]at end of document[)]", end, str(error)))
        _refuse_other(source)
        raise SpecError(f"{source}: not valid TOML: {problem}{_slip(text, problem)}.") from error


def _refuse_other(source: str) -> None:
    """Refuse a file that cannot be read as TOML, and is not even named so."""
    if (kind := Path(source).suffix) not in {".toml", ""}:
        raise SpecError(
            f"{source}: a {kind} file is no spec, which ends in .toml; "
            "gen-profile check and report take what was exported."
        )


def parse_toml(text: str) -> Table:
    """Parse TOML that may mean harm.

    Raises
    ------
    tomllib.TOMLDecodeError
        It is none, or what no spec holds.
    """
    if long := LONG_KEY.search(text):
        line = text.count("\n", 0, long.start()) + 1
        raise tomllib.TOMLDecodeError(f"a key of more than {MOST_PARTS} parts (at line {line})")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError as error:
        raise tomllib.TOMLDecodeError("arrays or tables nested too deeply") from error
    except ValueError as error:
        raise tomllib.TOMLDecodeError("a whole number of thousands of digits") from error


def _doubled(text: str, problem: str) -> str:
    """Name the key or table that is stated twice, where that is the problem, which tells only its line."""
    twice = re.match(r"Cannot (?:overwrite a value|declare .* twice) (?=.*line (\d+))", problem)
    lines = text.split("\n")[: int(twice[1])] if twice else []
    backwards = [(KEY.match(line), HEADER.match(line)) for line in reversed(lines)]
    header = next((header[1].strip() for _, header in backwards if header), "")
    stated = next((one for one in backwards if any(one)), None)
    if twice is None or stated is None or (stated[1] and "overwrite" in twice[0]):
        return problem
    key = stated[0] and ".".join(filter(None, (header, stated[0][1])))
    return f"{key or f'[{header}]'} is stated twice {problem[twice.end() :]}"


def _slip(text: str, problem: str) -> str:
    """Continue a sentence about text that is no TOML by what its writer took for TOML, if that shows."""
    line = text.split("\n")[int(match[1]) - 1] if (match := re.search(r"line (\d+)", problem)) else ""
    values = re.findall(r"=\s*([^\s#,}\]=]+(?:,[0-9]+)?(?:\s*[A-Za-zµ°%][^\s#}]*)?)", line.partition("#")[0])
    hints = filter(None, (number_meant(value) for value in values if not value[0].isalpha()))
    if hint := next((hint for hint in hints if "quotes" not in hint), ""):
        return hint
    return next((hint for pattern, hint in SLIPS.items() if re.search(pattern, line)), "")


def _override(document: Table, override: str) -> None:
    """Set a dotted key; the value is TOML where it parses as TOML, else text."""
    key, equals, text = str(override).partition("=")
    path = [part.strip() for part in key.split(".")]
    if not equals or not all(path):
        raise SpecError(f"set {override!r}: write KEY=VALUE, such as plant.L1=0.5.")
    table: Any = document
    for depth, part in enumerate(path[:-1]):
        place = ".".join(path[: depth + 1])
        if isinstance(table, list):
            inner = table[_number_in(table, part, override)]
        else:
            inner = table.setdefault(part, {})
        if not isinstance(inner, dict | list):
            raise SpecError(f"set {override!r}: {place!r} is a value, not a table.")
        table = inner
    value = _override_value(text)
    if isinstance(table, list):
        table[_number_in(table, path[-1], override)] = value
    else:
        _set(table, path, value)


def _number_in(values: list[Any], part: str, override: str) -> int:
    """Read the number of a value in a list, from 0."""
    if part.isdecimal() and int(part) < len(values):
        return int(part)
    raise SpecError(f"set {override!r}: {part!r} is none of the numbers 0 to {len(values) - 1} in that list.")


def _set(table: Table, path: Sequence[str], value: object) -> None:
    """Set the value of a key in the table that holds it."""
    for other in REPLACED.get((path[0], path[-1]), ()):
        table.pop(other, None)
    table[path[-1]] = value


def _plain(value: Any) -> Any:
    """Make lists and numbers of tuples, NumPy's arrays and NumPy's numbers, at any depth."""
    if isinstance(value, Mapping):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return value.tolist() if hasattr(value, "tolist") else value


def _fill(document: Table, tables: Mapping[str, Any]) -> None:
    """Set values by table; None takes a key away, or a table."""
    for name, values in _plain(tables).items():
        if values is None:
            document.pop(name, None)
            continue
        if not isinstance(values, dict):
            document[name] = values
            continue
        table = document.setdefault(name, {})
        for key, value in values.items():
            if value is None:
                table.pop(key, None)
            else:
                _set(table, (name, key), value)
                axes = table if name == "axis" else table.get("axis", {})
                for axis in axes.values():  # said of all axes, it replaces what was said of one
                    if isinstance(axis, dict):
                        axis.pop(key, None)


def _override_value(text: str) -> Any:
    try:
        parsed = parse_toml(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text.strip()
    return parsed["value"] if parsed.keys() == {"value"} else text.strip()
