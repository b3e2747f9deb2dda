"""The formats by name and suffix: our own, and those of entry-point group ``gen_profile.exporters``.

An entry point of that group names a `Format` in a module that is quick to import; the exporter itself loads
only when its format is asked for.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import PurePath
from typing import TYPE_CHECKING, Literal, NamedTuple, cast

from gen_profile.errors import SpecError
from gen_profile.suggestion import suggestion

if TYPE_CHECKING:
    from gen_profile_exporters import csv_table, structured_text
    from gen_profile_exporters.can import exporter as can
    from gen_profile_exporters.exporter import Exporter

    # Holds the project's own formats to the protocol wherever types are checked.
    _CONFORMING: tuple[Exporter, ...] = (csv_table, structured_text, can)

Proof = Literal["executed", "read back", "parsed", "untested"]


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
        ``"read back"`` by other people's readers, ``"parsed"`` by other people's grammar, or ``"untested"``.
    suffix : str
        Of the artefact's name, such as ``".csv"``.
    """

    module: str
    summary: str
    proof: Proof
    suffix: str


BUILT_IN: dict[str, Format] = {
    "can": Format(
        module="gen_profile_exporters.can.exporter",
        summary="CiA 402 setpoints and SYNCs as candump log, ASC and BLF, with DBC and start-up list",
        proof="read back",
        suffix=".log",
    ),
    "csv": Format(
        module="gen_profile_exporters.csv_table",
        summary="table of time, position, velocity, acceleration and jerk (RFC 4180)",
        proof="read back",
        suffix=".csv",
    ),
    "plc": Format(
        module="gen_profile_exporters.structured_text",
        summary="playback function block in portable IEC 61131-3 Structured Text",
        proof="executed",
        suffix=".st",
    ),
}
GROUP = "gen_profile.exporters"


def formats() -> dict[str, Format]:
    """Every known format by name, sorted; the project's own win over others of the same name."""
    known = {entry.name: _format_of_plugin(entry) for entry in entry_points(group=GROUP)}
    return dict(sorted((known | BUILT_IN).items()))


def find_exporter(name: str) -> Exporter:
    """Load the exporter of a format.

    Raises
    ------
    SpecError
        When no format has that name.
    """
    known = BUILT_IN if name in BUILT_IN else formats()
    if name not in known:
        raise SpecError(f"--export: unknown format {name!r}{suggestion(name, known)}.")
    return cast("Exporter", import_module(known[name].module))


def format_of(path: PurePath | str) -> str:
    """Tell the format of an artefact by its suffix.

    Raises
    ------
    SpecError
        When no format has that suffix.
    """
    suffix = PurePath(path).suffix.lower()
    suffixes = {form.suffix: name for name, form in BUILT_IN.items()}
    if suffix not in suffixes:
        suffixes = {form.suffix: name for name, form in formats().items()} | suffixes
    if suffix not in suffixes:
        raise SpecError(
            f"{path}: no format has the suffix {suffix!r} (known: {', '.join(sorted(suffixes))}); "
            "give the file the suffix that it was exported with."
        )
    return suffixes[suffix]


def _format_of_plugin(entry: EntryPoint) -> Format:
    try:
        form = entry.load()
    except Exception as error:
        raise SpecError(
            f"--export: format {entry.name!r} cannot be loaded from {entry.value} ({error}); "
            "update or uninstall the package that provides it."
        ) from error
    if not isinstance(form, Format):
        raise SpecError(
            f"--export: format {entry.name!r}: {entry.value} is no gen_profile_exporters.registry.Format; "
            "update or uninstall the package that provides it."
        )
    return form
