"""Where a delivered file comes from: its spec, and what the manifest beside it says of it."""

from collections.abc import Mapping
from pathlib import Path
from shlex import quote
from typing import Any

import attrs

from gen_profile.spec.model import Spec
from gen_profile.spec.reading import received_spec
from gen_profile.support.artefacts.manifest import FILENAME, Manifest, seal_of, sha256
from gen_profile.support.artefacts.reading import companions_of, manifest_beside, strays
from gen_profile.support.errors import CheckFailed, OutputError, SpecError


@attrs.frozen(kw_only=True)
class Origin:
    """What is known of a file before it is judged.

    Attributes
    ----------
    spec : Spec
    manifest : Manifest or None
        None where there is none of this file.
    agreement, companions
        See `JudgedFile`.
    faults : tuple of str
        Says that the file, or one that belongs to it, is not the one that was exported.
    """

    spec: Spec
    manifest: Manifest | None
    agreement: str
    companions: Mapping[str, str]
    faults: tuple[str, ...]

    def require_unaltered(self) -> None:
        """Refuse a file where it, or one that belongs to it, is not the one that was exported.

        Raises
        ------
        CheckFailed
        """
        for sentence in self.faults:
            raise CheckFailed(sentence)


def origin_of(path: Path, content: bytes, spec: Spec | None = None, *, planner: bool = False) -> Origin:
    """Find a file's spec and manifest, and compare it and its companions with what was exported.

    Parameters and errors are those of `spec_and_manifest`.
    """
    spec, manifest, digest = spec_and_manifest(path, content, spec, planner=planner)
    agreement, companions = _agreement(manifest, content, digest), companions_of(manifest, path, content)
    return Origin(
        spec=spec,
        manifest=manifest,
        agreement=agreement,
        companions=companions,
        faults=(*_alterations(path, agreement, manifest), *strays(path, companions)),
    )


@attrs.frozen(kw_only=True, eq=False)
class JudgedFile:
    """A file that was judged by a spec, and what the manifest beside it says about it.

    Attributes
    ----------
    path : Path
    spec : Spec
    manifest : str
        ``"matches"``, ``"differs"`` (the file is not the one that was exported), or ``"none"`` for this spec.
    companions : mapping of str to str
        Of each file that was exported with it, as its wrapper: ``"matches"``, ``"differs"`` or ``"missing"``;
        and ``"earlier"`` of one that only an earlier export of it had.
    """

    path: Path
    spec: Spec
    manifest: str
    companions: Mapping[str, str] = attrs.field(factory=dict)

    def identity(self, format_: str) -> dict[str, Any]:
        """Nest plain values for JSON that tell which file was judged, and by which spec."""
        artefact = {"format": format_, "path": str(self.path), "manifest": self.manifest}
        return {
            "name": self.spec.name,
            "spec_sha256": self.spec.sha256(),
            "artefact": {**artefact, "companions": self.companions},
        }


def spec_and_manifest(
    path: Path, content: bytes, spec: Spec | None, *, planner: bool = False
) -> tuple[Spec, Manifest | None, str]:
    """Take a spec that was named, or else the one in the manifest beside a file.

    Parameters
    ----------
    path : Path
    content : bytes
    spec : Spec or None
    planner : bool
        Whether the file is a planner block.

    Returns
    -------
    spec : Spec
    manifest : Manifest or None
        None where there is none of this file.
    spec_sha256 : str
        Of the spec as the manifest holds it, if it holds this one: a version of the program that knows other
        keys writes the same spec otherwise.

    Raises
    ------
    OutputError
        No spec was named, and no manifest is of this file.
    """
    try:
        manifest = manifest_beside(path, content, planner=planner)
    except OutputError as error:
        if spec is not None:
            return spec, None, spec.sha256()
        words = f"{str(error).removesuffix('.')}, or name its spec"
        raise OutputError(f"{words}: gen-profile check {quote(str(path))} SPEC.toml") from error
    try:
        own = received_spec(manifest.spec, path.parent)
    except (SpecError, OutputError) as error:
        if spec is not None:
            return spec, manifest, spec.sha256()
        if isinstance(error, OutputError):
            raise
        version = manifest.versions.get("gen-profile", "of some version")
        raise OutputError(
            f"The spec in {path.parent / FILENAME}, which gen-profile {version} wrote, is faulty: {error}"
        ) from error
    spec = own if spec is None else spec
    return spec, manifest, seal_of(manifest.spec) if spec == own else spec.sha256()


def _agreement(manifest: Manifest | None, content: bytes, spec_sha256: str) -> str:
    """Tell whether a file is the one of a manifest: it matches, differs, or there is none of this spec."""
    if manifest is None or seal_of(manifest.spec) != spec_sha256:
        return "none"
    if sha256(content) in {artefact.sha256 for artefact in manifest.artefacts}:
        return "matches"
    return "differs"


def _alterations(path: Path, agreement: str, manifest: Manifest | None) -> tuple[str, ...]:
    """Say that a file is none of those that were exported."""
    if agreement != "differs" or manifest is None:
        return ()
    if path.name in (artefact.path for artefact in manifest.artefacts):
        found = f"not what {FILENAME} beside it lists by this name"
    else:
        found = f"none of the files that {FILENAME} beside it lists, which is of {manifest.words()}"
    return (
        f"{path.name} is {found}: it was altered after its export, or comes from another; export it again.",
    )
