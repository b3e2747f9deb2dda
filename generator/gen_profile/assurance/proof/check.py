"""Proving a planner block that lies on disk, whatever wrote or altered it, and replaying its histories."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import attrs

from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.assurance.proof.prove import prove, replay
from gen_profile.assurance.proof.verdict import HISTORIES, Proof
from gen_profile.assurance.verification.origin import JudgedFile, origin_of
from gen_profile.planner.directions import planned_axes, sensed_directions
from gen_profile.planner.forms import block_in, refuse_program, refuse_wrapper
from gen_profile.planner.interface import SENSOR, block_axes, live_inputs, sensed_axes
from gen_profile.planner.stated import unstated_limits
from gen_profile.spec.model import Spec
from gen_profile.support.artefacts.manifest import PLANNER, Manifest
from gen_profile.support.artefacts.reading import read_artefact
from gen_profile.support.errors import ExportError, OutputError, SpecError
from gen_profile.support.progress import Progress, no_progress
from gen_profile_exporters.block_source import is_planner, parse_function_block
from gen_profile_exporters.registry import container_of


@attrs.frozen(kw_only=True, eq=False)
class BlockJudgement(JudgedFile):
    """A proof of one file, and what its manifest says about it.

    Attributes
    ----------
    text : str
    check : Proof
        Of all histories, or of the one that was asked for.
    history : int or None
        Number of the only one.
    """

    text: str = attrs.field(repr=False)
    check: Proof
    history: int | None = None

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        named = self.identity(PLANNER)
        if self.history is None:
            return {**named, "proof": self.check.to_dict()}
        history = self.check.described(self.check.worst)
        return {**named, "history": history, "reasons": list(self.check.reasons())}


def is_planner_block(path: Path) -> bool:
    """Tell by a file's text whether it holds a planner block.

    Raises
    ------
    OutputError
        It cannot be read.
    ExportError
        It is a program, which is not read back, or the wrapper of one.
    CheckFailed
        Such a one is not the one that was exported.
    """
    content = read_artefact(path)
    refuse_program(path, content)
    try:
        container_of(path)
        text = block_in(path, content)
    except (SpecError, ExportError, OutputError):  # none that carries blocks, or that holds none
        return False
    refuse_wrapper(path, content, text)
    return is_planner(text)


def check_block(
    path: Path,
    spec: Spec | None = None,
    *,
    histories: int | None = None,
    history: int | None = None,
    scheduler: str | None = None,
    progress: Progress = no_progress,
) -> BlockJudgement:
    """Prove a file again, or replay one history of its proof, and compare it with its manifest.

    Parameters
    ----------
    path : Path
        A planner block.
    spec : Spec, optional
        Taken from ``manifest.json`` beside the file when not given.
    histories : int, optional
        How many, in place of those that the manifest tells of.
    history : int, optional
        Number of the only one to run.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers run the histories.
    progress : callable
        Told what is being done.

    Raises
    ------
    OutputError
        The file cannot be read, or there is no spec.
    SpecError
        There is no history of that number, or the spec has no planner block.
    ExportError
        It is no planner block that can be executed.
    CosimulationError
    """
    content = read_artefact(path)
    origin = origin_of(path, content, spec, planner=True)
    spec, manifest = origin.spec, origin.manifest
    text = block_in(path, content)
    _require_inputs(path, text, spec)
    known = _record(manifest) if origin.agreement != "none" else {}
    count = histories or histories_of(manifest if known else None)
    if history is not None and not 0 <= history < count:
        raise SpecError(f"history {history}: the histories are numbered from 0 to {count - 1}.")
    proof = partial(prove, spec, text, histories=count, scheduler=scheduler, progress=progress)
    if history is None:
        replayed = proof()
    else:
        if not _is_whole(known, count):  # the search's histories depend on what it has found
            known = proof().to_dict()
        seed, parents = known["seed"], known["search_parents"]
        numbering = Numbering.of(Histories.of(spec), count, seed, parents)
        replayed = replay(spec, text, numbering, history, progress)
    return BlockJudgement(
        path=path,
        text=text,
        spec=spec,
        check=attrs.evolve(replayed, faults=origin.faults),
        manifest=origin.agreement,
        companions=origin.companions,
        history=history,
    )


def _require_inputs(path: Path, text: str, spec: Spec) -> None:
    """Refuse a block of other axes, live parameters, sensors or zones than a spec's."""
    if faults := unstated_limits(spec):
        raise SpecError(*faults)
    inputs = [v.name for v in parse_function_block(text).variables if v.section == "VAR_INPUT"]
    zones = {name for name in inputs if name.startswith(("aBlocked", "aSlow"))}
    axes, planned = block_axes(text), planned_axes(spec)
    sensed = [planned[number] for number in sensed_directions(spec)] if spec.planner.sensor else []
    known = {axis.of("fTarget") for axis in axes} | {axis.of(SENSOR[0]) for axis in sensed_axes(inputs, axes)}
    known |= {*live_inputs([name for name in inputs if name not in zones], axes).values()}
    due = {axis.of("fTarget") for axis in planned.values()} | {axis.of(SENSOR[0]) for axis in sensed}
    due |= {f"f{name}" for name in spec.planner.live}
    if bool(zones) != spec.planner.zones:
        known ^= {*zones} or {"aBlockedLow"}
    if differing := sorted(due ^ known):
        raise SpecError(
            f"{path} is no block of this spec: only one of them has an input {differing[0]}; name the spec "
            "that it was written of."
        )


def histories_of(manifest: Manifest | None) -> int:
    """Tell on how many histories a block was proved; the usual number of one that was not.

    Raises
    ------
    OutputError
        The manifest has another value there.
    """
    count = _record(manifest).get("histories", HISTORIES)
    if type(count) is not int or count < 1:
        raise OutputError(
            f"The manifest's check.histories must be a whole number from 1 on, found {count!r}: it was "
            "altered; export the block again."
        )
    return count


def _is_whole(record: Mapping[str, Any], count: int) -> bool:
    """Tell whether a record has all that replaying one of so many histories takes."""
    seed, parents = record.get("seed"), record.get("search_parents")
    if record.get("histories") != count or type(seed) is not int or not isinstance(parents, list):
        return False
    numbers = [number for one in parents for number in (one if isinstance(one, list) else [None])]
    return all(type(number) is int and 0 <= number < count for number in numbers)


def _record(manifest: Manifest | None) -> Mapping[str, Any]:
    """Read what the manifest tells of the proof; nothing of a block that was not proved."""
    return (manifest.check if manifest else None) or {}
