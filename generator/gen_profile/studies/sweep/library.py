"""From a sweep to one PLC block that plays any of its profiles, made of the very files that passed."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs

from gen_profile.delivery.designs.names import names_of_library, require_own_names
from gen_profile.dynamics.evaluation.phrases import named
from gen_profile.studies.sweep.case import PASSED
from gen_profile.studies.sweep.store import case_files, case_folder, case_spec, grid_of, swept_table
from gen_profile.support.artefacts.manifest import FILENAME, SEAL, parse_manifest, seal_of, sha256
from gen_profile.support.artefacts.writing import staged
from gen_profile.support.errors import ExportError, SpecError
from gen_profile.support.progress import Progress, no_progress
from gen_profile_exporters.block_source import BlockSource
from gen_profile_exporters.exporter import File, Target, target_of
from gen_profile_exporters.playback.library import LibraryEntry, library_source, read_library
from gen_profile_exporters.registry import container_of, find_container, formats


@attrs.frozen(kw_only=True)
class Library:
    """What was written.

    Attributes
    ----------
    path, index : Path
        Of the block, and of a JSON file that tells which profile is which.
    format : str
        Of the block's file.
    files : tuple of Path
        What was written of that format: the block's file, and what else the format needs.
    block : str
        Name of the function block.
    bytes : int
        Of the block's file.
    profiles : tuple of dict
        By number: case, values, hash, duration and worst sway.
    """

    path: Path
    index: Path
    format: str
    files: tuple[Path, ...]
    block: str
    bytes: int
    profiles: tuple[dict[str, Any], ...]

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return attrs.asdict(
            self, value_serializer=lambda _, __, one: str(one) if isinstance(one, Path) else one
        )


def write_library(folder: Path, path: Path, progress: Progress = no_progress) -> Library:
    """Put the PLC blocks of all cases that passed into one, and make sure that it issues the same.

    Raises
    ------
    SpecError
        The sweep exported no playback blocks, no case passed, or no format with the block has that suffix.
    OutputError
        The sweep's files were altered, or the library cannot be written, as where a motion has its names.
    ExportError
        The profiles do not fit into one block.
    """
    format_ = container_of(path)
    container, stem = find_container(format_), path.name[: -len(formats()[format_].suffix)]
    profiles, specs, entries, target = _gathered(folder, stem.removeprefix("FB_"), progress)
    progress("writing the library and reading it back")
    library = library_source(entries, target)
    first, *others = container.wrap(library, target)
    index = path.with_name(f"{stem}.json")
    names = names_of_library(library.name, path.name, index.name, *(file.filename for file in others))
    with staged(path.parent) as staging:
        require_own_names(None, names, staging.earlier)
        written = staging.write(path.name, first.content)
        _require_same(container.unwrap(written, target), target, profiles)
        for file in others:
            staging.write(file.filename, file.content)
        staging.write(index.name, index_of(library.name, written, others, profiles, specs))
        staging.deliver()
    return Library(
        path=path,
        index=index,
        format=format_,
        files=(path, *(path.with_name(file.filename) for file in others)),
        block=library.name,
        bytes=len(written),
        profiles=tuple(profiles),
    )


def _gathered(
    folder: Path, name: str, progress: Progress
) -> tuple[list[dict[str, Any]], list[Mapping[str, Any]], list[LibraryEntry], Target]:
    """Read the blocks of all cases that passed; tell what each is, its spec, and the library's target."""
    grid = grid_of(folder)
    passed = [row for row in swept_table(folder, grid).to_pylist() if row["status"] == PASSED]
    if not passed:
        raise SpecError(
            f"No case of the sweep in {folder} passed, so there is nothing to put into a library."
        )
    with case_folder(folder, passed[0]) as case:
        target = attrs.evolve(target_of(case_spec(folder, passed[0], case)), name=name)
    profiles, specs, entries = [], list[Mapping[str, Any]](), []
    for number, row in enumerate(passed):
        progress("reading profiles", number, len(passed))
        artefact = _block_of(row)
        files = case_files(folder, row)
        specs.append(parse_manifest(files[FILENAME], f"{row['folder']}/{FILENAME}").spec)
        values = {axis.key: row[axis.key] for axis in grid.axes}
        source = find_container(artefact["format"]).unwrap(files[artefact["path"]], target)
        entries.append(LibraryEntry(source=source, label="  ".join(named(values))))
        profiles.append(
            {
                "number": number,
                "case": row["case"],
                "values": values,
                "payload_sha256": artefact["payload_sha256"],
                "duration_s": row["duration_s"],
                "sway_residual_worst_m": row["check_worst_sway_m"],
            }
        )
    return profiles, specs, entries, target


def _block_of(row: dict[str, Any]) -> dict[str, Any]:
    """Find the first file that holds a playback block; what else belongs to it follows it."""
    known, artefacts = formats(), row["artefacts"]
    blocks: list[dict[str, Any]] = [item for item in artefacts if known[item["format"]].holds_block]
    if not blocks:
        raise SpecError("A library needs the cases' PLC blocks: sweep again with the format plc.")
    return blocks[0]


def _require_same(library: BlockSource, target: Target, profiles: list[dict[str, Any]]) -> None:
    """Hold what the library's file issues to what was checked."""
    for profile, motion in zip(profiles, read_library(library, target), strict=True):
        if motion.payload_hash() != profile["payload_sha256"]:
            raise ExportError(
                f"Profile {profile['number']} would not issue what case {profile['case']} does."
            )


def index_of(
    block: str,
    written: bytes,
    others: Sequence[File],
    profiles: list[dict[str, Any]],
    specs: list[Mapping[str, Any]],
) -> bytes:
    """Write the index beside a library and its other files: what each profile is, and a hash of all that."""
    document: dict[str, Any] = {
        "block": block,
        "sha256": sha256(written),
        "profiles": profiles,
        "specs": specs,
    }
    document["companions"] = {file.filename: sha256(file.content) for file in others}
    document[SEAL] = seal_of(document)
    return (json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8")
