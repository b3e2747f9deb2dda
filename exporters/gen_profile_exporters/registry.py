"""The formats by name and suffix: our own, and those of entry-point group ``gen_profile.exporters``.

An entry point of that group names a `Format` in a module that is quick to import; the exporter itself loads
only when its format is asked for.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Set
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Literal, NamedTuple, cast

from gen_profile.support.errors import ExportError, SpecError
from gen_profile.support.plugins import load_plugin
from gen_profile.support.suggestion import suggestion

if TYPE_CHECKING:
    from gen_profile_exporters import csv_table
    from gen_profile_exporters.can.export import exporter as can
    from gen_profile_exporters.exporter import BlockContainer, Exporter, Target
    from gen_profile_exporters.playback import structured_text
    from gen_profile_exporters.vendors import codesys, plcopen_xml, rockwell_l5x, siemens_scl, twincat

    # Hold the project's own formats to the protocols wherever types are checked.
    _CONFORMING: tuple[Exporter, ...] = (can, csv_table, rockwell_l5x)
    _CONTAINERS: tuple[BlockContainer, ...] = (codesys, plcopen_xml, siemens_scl, structured_text, twincat)

NO_EXPORTS = {  # what else is in a folder of exports, and what to name in its place
    ".toml": "this is a spec; name the file that was exported of it first",
    ".json": "this is no exported file; name one that the manifest lists, or that the certificate is of",
}

Proof = Literal["executed", "read back", "schema-checked", "parsed", "untested"]


class Format(NamedTuple):
    """A format and where its exporter is found.

    Attributes
    ----------
    module : str
        Import path of a module with the functions of `gen_profile_exporters.exporter.Exporter`.
    summary : str
        One line for lists.
    proof : str
        How far others confirm the artefacts: ``"executed"`` by an implementation of the target's language,
        ``"read back"`` by other people's readers, ``"schema-checked"`` against the format's published schema,
        ``"parsed"`` by other people's grammar, or ``"untested"``.
    suffix : str
        Of the artefact's name, such as ``".csv"``.
    may_end_at_speed : bool
        What plays it does not hold the last setpoint: what comes next is not from here.
    modulo_axes : bool
        It takes modulo axes: positions wrap after ``axis.modulo``, and are unwrapped where they are read.
    holds_block : bool
        It carries the playback block: its module is a `gen_profile_exporters.exporter.BlockContainer`.
    """

    module: str
    summary: str
    proof: Proof
    suffix: str
    may_end_at_speed: bool = False
    modulo_axes: bool = False
    holds_block: bool = False


_ROWS = tomllib.loads(Path(__file__).with_name("formats.toml").read_text("utf-8"))
BUILT_IN = {name: Format(**row) for name, row in sorted(_ROWS.items())}
OTHER_NAMES = {"st": "plc"}
GROUP = "gen_profile.exporters"


def formats() -> dict[str, Format]:
    """Every known format by name, sorted; the project's own win over others of the same name."""
    known = {entry.name: load_plugin(entry, Format, "export: format") for entry in entry_points(group=GROUP)}
    return dict(sorted((known | BUILT_IN).items()))


def format_named(name: str) -> str:
    """Tell by which name a format is listed, whichever of its names this is."""
    return OTHER_NAMES.get(name, name)


def find_exporter(name: str) -> Exporter:
    """Load the exporter of a format.

    Raises
    ------
    SpecError
        When no format has that name.
    """
    listed = format_named(name)
    known = _known({listed})
    if listed not in known:
        raise SpecError(f"export: unknown format {name!r}{suggestion(name, known)}")
    return cast("Exporter", import_module(known[listed].module))


def _known(names: Set[str]) -> Mapping[str, Format]:
    """Look among others' formats only for what is not the project's own: a broken one blocks only itself."""
    return BUILT_IN if names <= BUILT_IN.keys() else formats()


def require_targets(exporters: Mapping[str, Exporter], target: Target) -> None:
    """Refuse a target for which formats could export no motion, before one is sought.

    Exporters that can tell have a function `require_target`, which takes the target.

    Raises
    ------
    ExportError
    """
    from gen_profile.support.units import require_one_way  # noqa: PLC0415  # loads attrs, which lists do without

    known = _known(exporters.keys())
    able = ", ".join(name for name, form in known.items() if form.modulo_axes)
    for name, exporter in exporters.items():
        for axis in () if known[name].modulo_axes else target.axes:
            require_one_way(axis, f"{name} takes no modulo axes", f"export {able}, or leave axis.modulo out")
        require: Callable[[Target], None] | None = getattr(exporter, "require_target", None)
        if require is not None:
            require(target)


def containers() -> tuple[str, ...]:
    """Names of the formats that carry function blocks, sorted."""
    return tuple(name for name, form in formats().items() if form.holds_block)


def find_container(name: str) -> BlockContainer:
    """Load the exporter of a format that carries the playback block.

    Raises
    ------
    SpecError
        It carries none, or no format has that name.
    """
    exporter = find_exporter(name)
    if not _known({format_named(name)})[format_named(name)].holds_block:
        raise SpecError(f"{name} carries no playback block; {_containers()}.")
    return cast("BlockContainer", exporter)


def container_of(path: PurePath | str) -> str:
    """Tell by a file's suffix which format it is, of those that carry the playback block.

    Raises
    ------
    SpecError
        None has that suffix.
    """
    name = _longest_suffix(path, formats())
    if name is None or not formats()[name].holds_block:
        fault = f"{name} carries no playback block" if name else "no format has that suffix"
        raise SpecError(f"{path}: {fault}; {_containers()}.")
    return name


def _containers() -> str:
    suffixes = (f"{form.suffix} ({name})" for name, form in formats().items() if form.holds_block)
    return f"the suffixes of those that do are {', '.join(suffixes)}"


def require_end(names: Set[str], *, stops: bool) -> None:
    """Refuse formats for a motion that ends at speed where their players would hold its last setpoint.

    Raises
    ------
    ExportError
    """
    if stops:
        return
    known = _known(names)
    holding = [name for name in names if not known[name].may_end_at_speed]
    if holding:
        able = ", ".join(name for name, form in known.items() if form.may_end_at_speed)
        raise ExportError(
            f"move.final_velocity: what plays {', '.join(holding)} holds the last setpoint, which would stop "
            f"the axis at once; export {able}, or end at rest."
        )


def format_of(path: PurePath | str) -> str:
    """Tell the format of an artefact by its suffix.

    Raises
    ------
    SpecError
        When no format has that suffix.
    """
    own = _longest_suffix(path, BUILT_IN)
    if own is not None:
        return own
    known = formats()
    name = _longest_suffix(path, known)
    if name is None and (cure := NO_EXPORTS.get(PurePath(path).suffix)):
        raise SpecError(f"{path}: {cure}.")
    if name is None:
        raise SpecError(
            f"{path}: no format has the suffix {PurePath(path).suffix!r} "
            f"(known: {', '.join(sorted(form.suffix for form in known.values()))}); "
            "give the file the suffix that it was exported with."
        )
    return name


def _longest_suffix(path: PurePath | str, known: Mapping[str, Format]) -> str | None:
    """Find the format whose suffix fits best: ``.codesys.xml`` rather than ``.xml``."""
    name = PurePath(path).name.lower()
    fitting = [key for key, form in known.items() if name.endswith(form.suffix.lower())]
    return max(fitting, key=lambda key: len(known[key].suffix), default=None)
