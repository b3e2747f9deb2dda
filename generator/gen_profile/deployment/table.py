"""The table of a written playback block, as the values of a buffer, and the block that such values make."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import attrs
import numpy as np

from gen_profile.artefacts.manifest import artefact_of, sha256
from gen_profile.artefacts.reading import read_artefact
from gen_profile.errors import CheckFailed, ExportError
from gen_profile.motion.profile import Array
from gen_profile.progress import Progress
from gen_profile.spec.model import Spec
from gen_profile.verification.check import (
    Judgement,
    alterations,
    check_artefact,
    provenance,
    spec_and_manifest,
)
from gen_profile_exporters.block_source import BlockSource
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.playback.buffers import (
    CHECKSUM,
    PER_AXIS,
    SCALARS,
    buffer_texts,
    buffered,
    is_buffered,
    with_buffer,
)
from gen_profile_exporters.playback.structured_text import literal
from gen_profile_exporters.playback.structured_text import read_table as read_playback
from gen_profile_exporters.playback.table import PlaybackTable
from gen_profile_exporters.registry import container_of, find_container


@attrs.frozen(kw_only=True, eq=False)
class BlockTable:
    """What a controller is to hold.

    Attributes
    ----------
    path : Path
    spec : Spec
        Of its manifest.
    source : BlockSource
        The block, its numbers being variables.
    values : (values,) array
        Of a buffer.
    hashes : mapping of str to str
        SHA-256 of the file, its setpoints, its spec and the values.
    """

    path: Path
    spec: Spec
    source: BlockSource
    values: Array
    hashes: dict[str, str]

    @property
    def checksum(self) -> float:
        """What the block works out for the table."""
        return float(self.values[CHECKSUM])

    @property
    def start(self) -> Array:
        """Where the axes begin, in their units, shape (axes,)."""
        scalars, axes = len(SCALARS), self.constant("cAxes")
        return self.values[scalars : scalars + axes * len(PER_AXIS)].reshape(axes, -1)[
            :, PER_AXIS.index("Start")
        ]

    def playback(self) -> PlaybackTable:
        """Give the table as the block plays it."""
        return read_playback(self.source.text(), target_of(self.spec))

    def constant(self, name: str) -> int:
        """Value of one of the block's whole constants."""
        return next(int(one.initial) for one in self.source.variables if one.name == name)

    def check(self, values: Array, progress: Progress) -> Judgement:
        """Co-simulate the block with other values in its buffer, as they were read from a controller.

        Raises
        ------
        ExportError
            They are no table.
        CosimulationError
        """
        text = with_buffer(self.source, list(map(literal, values.tolist()))).text()
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{self.spec.name}.st"
            path.write_text(text, encoding="ascii", newline="\n")
            return attrs.evolve(check_artefact(path, self.spec, progress=progress), path=self.path)


def read_table(path: Path) -> BlockTable:
    """Read a written block, whether its numbers are constants or variables.

    Raises
    ------
    SpecError, OutputError, ExportError
        It is no playback block of one motion, or there is no manifest of it.
    CheckFailed
        It is not the file that was exported.
    """
    container = find_container(container_of(path))
    content = read_artefact(path)
    spec, manifest = spec_and_manifest(path, content, None)
    for fault in alterations(path, provenance(manifest, content, spec)):
        raise CheckFailed(fault)
    target = target_of(spec)
    source = container.unwrap(content, target)
    if any(one.name == "nProfile" or one.section == "VAR_IN_OUT" for one in source.variables):
        raise ExportError(
            f"{path}: is a library or a wrapper; name the file of the playback block of a single motion."
        )
    motion = container.replay(content, target)
    if not is_buffered(source):
        source = buffered(source, target)
    values = np.array(list(map(float, buffer_texts(source))))
    hashes = {
        "artefact_sha256": artefact_of("", path.name, content).sha256,
        "payload_sha256": motion.payload_hash(),
        "spec_sha256": spec.sha256(),
        "table_sha256": table_hash(values),
    }
    return BlockTable(path=path, spec=spec, source=source, values=values, hashes=hashes)


def table_hash(values: Array) -> str:
    """Hash a buffer's values, bit for bit, as little-endian doubles."""
    return sha256(values.astype("<f8").tobytes())
