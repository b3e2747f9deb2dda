"""Tables of a written playback block, as the values of a buffer, and the blocks that such values make."""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar

import attrs
import numpy as np

from gen_profile.assurance.proof.check import BlockJudgement, histories_of, is_planner_block
from gen_profile.assurance.proof.prove import prove
from gen_profile.assurance.proof.verdict import HISTORIES
from gen_profile.assurance.verification.check import (
    Judgement,
    check_artefact,
)
from gen_profile.assurance.verification.origin import origin_of
from gen_profile.delivery.deployment.block_state import BlockState, MotionState, PlannerState
from gen_profile.motion.profile import Array
from gen_profile.planner.directions import planned_axes
from gen_profile.planner.forms import block_in
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import received_spec
from gen_profile.support.artefacts.manifest import SEAL, artefact_of, seal_of, sha256
from gen_profile.support.artefacts.reading import (
    compared,
    manifest_beside,
    read_artefact,
    strays,
)
from gen_profile.support.bounded_file import DOCUMENT
from gen_profile.support.errors import CheckFailed, ExportError, OutputError
from gen_profile.support.progress import Progress
from gen_profile.support.strict_json import parse_json
from gen_profile_exporters.block_source import BlockSource, parse_function_block
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.planner.parameters import buffered_planner, constant_planner
from gen_profile_exporters.playback.buffers import (
    CHECKSUM,
    buffer_texts,
    buffered,
    constant_sources,
    is_buffered,
    is_library,
    with_buffer,
)
from gen_profile_exporters.playback.library import singles_of
from gen_profile_exporters.playback.structured_text import literal
from gen_profile_exporters.playback.structured_text import read_table as read_playback
from gen_profile_exporters.playback.table import PlaybackTable
from gen_profile_exporters.registry import container_of, find_container, formats


@attrs.frozen(kw_only=True, eq=False)
class BlockTable:
    """What a controller is to hold.

    Attributes
    ----------
    path : Path
    specs : tuple of Spec
        Of each motion.
    source : BlockSource
        The block, its numbers being variables.
    values : (values,) array
        Of a buffer.
    hashes : mapping of str to str
        SHA-256 of the file, its setpoints and its spec (of a library: of the hashes of those of its motions),
        and of the values.
    """

    state: ClassVar[type[BlockState]] = MotionState  # what the block shows of itself

    path: Path
    specs: tuple[Spec, ...]
    source: BlockSource
    values: Array
    hashes: dict[str, str]

    @property
    def spec(self) -> Spec:
        """Give the spec of the first motion: all are for the same axes and cycle."""
        return self.specs[0]

    @property
    def checksum(self) -> float:
        """What the block works out for all that it holds."""
        return float(self.values[CHECKSUM])

    @property
    def start(self) -> Array:
        """Where the axes begin, in their units, shape (axes,)."""
        return self.motions[0].start

    @property
    def axes(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of each axis whose setpoints the block issues."""
        return tuple((axis.name, axis.unit) for axis in self.spec.axis_scales())

    @cached_property
    def motions(self) -> tuple[PlaybackTable, ...]:
        """Tables as the block plays them, by their number."""
        target = target_of(self.spec)
        return tuple(read_playback(one.text(), target) for one in constant_sources(self.source, target))

    def require_proved(self) -> None:
        """Refuse what was but tried; a motion is checked whole in any case."""

    def constant(self, name: str) -> int:
        """Value of one of the block's whole constants."""
        return next(int(one.initial) for one in self.source.variables if one.name == name)

    def check(self, values: Array, progress: Progress) -> Judgement | BlockJudgement:
        """Co-simulate the block with other values in its buffer, as they were read from a controller.

        Returns
        -------
        Judgement
            Of the motion that takes up the greatest share of its limit, and passes only if all do.

        Raises
        ------
        ExportError
            They are no table.
        CosimulationError
        """
        held = with_buffer(self.source, list(map(literal, values.tolist())))
        judgements = []
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{self.spec.ascii_name}.st"
            for block, spec in zip(constant_sources(held, target_of(self.spec)), self.specs, strict=True):
                path.write_text(block.text(), encoding="ascii", newline="\n")
                judgements.append(check_artefact(path, spec, progress=progress))
        worst = max(judgements, key=lambda one: one.check.demand)
        return attrs.evolve(worst, path=self.path)


class PlannerTable(BlockTable):
    """What a controller is to hold of a planner block: the numbers that it plans by."""

    state = PlannerState

    @property
    def start(self) -> Array:
        """Where the axes begin that it plans, in m (or rad), shape (axes,)."""
        return np.array(self.spec.move.start)[list(planned_axes(self.spec))]

    @property
    def axes(self) -> tuple[tuple[str, str], ...]:
        """Name and unit of each axis that it plans."""
        machine = self.spec.machine()
        return tuple((machine.actuated[n].name, machine.actuated[n].unit) for n in planned_axes(self.spec))

    @property
    def histories(self) -> int:
        """On how many its manifest says that it was proved; the usual number where it was not."""
        return histories_of(manifest_beside(self.path, read_artefact(self.path), planner=True))

    def require_proved(self) -> None:
        """Refuse what was but tried.

        Raises
        ------
        CheckFailed
            It was judged on fewer histories than make a proof.
        """
        if self.histories < HISTORIES:
            raise CheckFailed(
                f"{self.path} is a trial, on {self.histories} histories, and {HISTORIES} make a proof: prove "
                "it on so many, or ask for a trial by name to use it all the same."
            )

    def check(self, values: Array, progress: Progress) -> BlockJudgement:
        """Prove the block with other numbers, on as many histories as its manifest tells of."""
        text = constant_planner(with_buffer(self.source, list(map(literal, values.tolist())))).text()
        proof = prove(self.spec, text, histories=self.histories, progress=progress)
        return BlockJudgement(path=self.path, text=text, spec=self.spec, check=proof, manifest="none")


def read_table(path: Path) -> BlockTable:
    """Read a written block: of a motion, a library or a planner; its numbers are constants or variables.

    Raises
    ------
    SpecError, OutputError, ExportError
        It is none, or there is no manifest or index of it.
    CheckFailed
        It is not the file that was exported, or one beside it not the one that was exported with it.
    """
    content, container = read_artefact(path), find_container(container_of(path))
    kind: type[BlockTable] = PlannerTable if is_planner_block(path) else BlockTable
    if kind is PlannerTable:
        specs: tuple[Spec, ...] = (_exported_spec(path, content, planner=True),)
        source, setpoints = buffered_planner(parse_function_block(block_in(path, content))), ""
    else:
        specs = _listed_specs(path, content) or (_exported_spec(path, content),)
        source, setpoints = _played(path, container.unwrap(content, target_of(specs[0])), specs)
    values = np.array(list(map(float, buffer_texts(source))))
    hashes = {
        "artefact_sha256": artefact_of("", path.name, content).sha256,
        "payload_sha256": setpoints,
        "spec_sha256": _joint([spec.sha256() for spec in specs]),
        "table_sha256": table_hash(values),
    }
    return kind(path=path, specs=specs, source=source, values=values, hashes=hashes)


def _played(path: Path, source: BlockSource, specs: Sequence[Spec]) -> tuple[BlockSource, str]:
    """Put variables in place of a playback block's constants, and hash its setpoints."""
    target = target_of(specs[0])
    if any(one.section == "VAR_IN_OUT" for one in source.variables):
        raise ExportError(f"{path}: is a wrapper; name the file of the playback block.")
    constants = singles_of(source, target)
    motions = [read_playback(one.text(), target).motion() for one in constants]
    if len(motions) != len(specs):
        raise ExportError(f"{path}: is a library, and nothing beside it tells its specs; make it again.")
    if not is_buffered(source):
        source = buffered(constants, target, library=is_library(source))
    return source, _joint([motion.payload_hash() for motion in motions])


def _exported_spec(path: Path, content: bytes, *, planner: bool = False) -> Spec:
    """Read the spec that a block was exported with; refuse one that was altered since."""
    origin = origin_of(path, content, planner=planner)
    origin.require_unaltered()
    return origin.spec


def _listed_specs(path: Path, content: bytes) -> tuple[Spec, ...]:
    """Read the specs that a library's index lists; none where there is no index."""
    index = path.with_name(f"{path.name[: -len(formats()[container_of(path)].suffix)]}.json")
    document = _document(index)
    if "profiles" not in document:
        return ()
    seal = document.pop(SEAL, None)
    if seal != seal_of(document):
        raise OutputError(
            f"{index}: was altered, or is of an earlier version, and tells no specs; make the library again."
        )
    if document["sha256"] != sha256(content):
        raise CheckFailed(f"{path.name} is not the library of {index.name}: it was altered; make it again.")
    for sentence in strays(path, compared(path.parent, document.get("companions", {}))):
        raise CheckFailed(sentence)
    return tuple(received_spec(one, path.parent) for one in document["specs"])


def _document(path: Path) -> dict[str, Any]:
    """Read a JSON document; an empty one where there is none."""
    try:
        document = parse_json(read_artefact(path, DOCUMENT)) if path.is_file() else {}
    except ValueError:
        return {}
    return document if isinstance(document, dict) else {}


def _joint(hashes: Sequence[str]) -> str:
    return hashes[0] if len(hashes) == 1 else sha256("\n".join(hashes).encode("ascii"))


def table_hash(values: Array) -> str:
    """Hash a buffer's values, bit for bit, as little-endian doubles."""
    return sha256(values.astype("<f8").tobytes())
