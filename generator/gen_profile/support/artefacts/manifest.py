"""``manifest.json``, the record beside the artefacts: spec, versions, hashes and check of every export."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from typing import Any

import attrs
from attrs.validators import instance_of

from gen_profile.support.errors import OutputError
from gen_profile.support.strict_json import parse_document

FILENAME = "manifest.json"
HEAD = {"format": "gen-profile manifest", "format_version": 1}
UNVERIFIED = "unverified"
PLANNER = "planner"  # format of every file that is a planner block
LIBRARIES = ("gen-profile", "casadi", "fmpy", "numpy", "scipy")  # that shape the numbers
SEAL = "manifest_sha256"  # of everything else in it, so that no limit or verdict is changed by hand


@cache
def versions() -> tuple[tuple[str, str], ...]:
    """List the libraries that shape the numbers, with their versions installed here."""
    return tuple((library, version(library)) for library in LIBRARIES)


@attrs.frozen(kw_only=True)
class Artefact:
    """One exported file.

    Attributes
    ----------
    format : str
    path : str
        Relative to the manifest's folder.
    sha256 : str
        Of the file's bytes.
    bytes : int
    payload_sha256 : str
        Of the setpoints that the file carries, whatever its form; empty for a file that carries none.
    """

    format: str
    path: str = attrs.field(validator=instance_of(str))
    sha256: str = attrs.field(validator=instance_of(str))
    bytes: int
    payload_sha256: str = ""


def artefact_of(format_: str, path: str, content: bytes, payload_sha256: str = "") -> Artefact:
    """Describe a file that was written."""
    digest = sha256(content)
    return Artefact(
        format=format_, path=path, sha256=digest, bytes=len(content), payload_sha256=payload_sha256
    )


@attrs.frozen(kw_only=True)
class Manifest:
    """What was designed, from what, by what, and how it was judged.

    Attributes
    ----------
    name : str
    spec : mapping
        The whole spec, as `gen_profile.spec.model.Spec.to_dict` gives it.
    spec_sha256 : str
    profile_sha256 : str
        Of the continuous profile.
    versions : mapping of str to str
        Of this program and the libraries that shape the numbers.
    artefacts : tuple of Artefact
    check : mapping or None
        `gen_profile.assurance.verification.verdict.Check.to_dict` of the artefact that came off worst;
        None when none was checked.
    earlier : tuple of Manifest
        Of exports into the same folder before, with those of their artefacts that were not replaced since.
    """

    name: str
    spec: Mapping[str, Any] = attrs.field(validator=instance_of(dict))
    spec_sha256: str
    profile_sha256: str
    versions: Mapping[str, str]
    artefacts: tuple[Artefact, ...]
    check: Mapping[str, Any] | None
    earlier: tuple[Manifest, ...] = ()

    def after(self, previous: Manifest) -> Manifest:
        """Keep what a previous manifest says of artefacts that this export does not replace."""
        replaced = {artefact.path for artefact in self.artefacts}
        remaining = (
            attrs.evolve(one, artefacts=tuple(a for a in one.artefacts if a.path not in replaced), earlier=())
            for one in (previous, *previous.earlier)
        )
        return attrs.evolve(self, earlier=tuple(one for one in remaining if one.artefacts))

    def covering(self, name: str, digest: str, *, planner: bool = False) -> Manifest | None:
        """Find the export that a file comes from: by its name or, where no export has that, by its SHA-256.

        A motion's file that was altered and renamed is taken for one of the latest motion.
        """
        listed = [(one, known) for one in (self, *self.earlier) for known in one.artefacts]
        alike = [(one, known) for one, known in listed if (known.format == PLANNER) == planner]
        if any(known.path == name for _, known in listed):  # or files of two motions could change places
            return next((one for one, known in alike if known.path == name), None)
        by_content = [one for one, known in listed if known.sha256 == digest]
        latest = [] if planner else [one for one, _ in alike]
        return next(iter(by_content or latest), None)

    def companions(self, name: str, digest: str) -> dict[str, str]:
        """List what was exported with a file in its format, SHA-256 by name; it is found as by `covering`."""
        own = self._own(name, digest)
        of_format = [known for known in self.artefacts if own is not None and known.format == own.format]
        return {known.path: known.sha256 for known in of_format if known is not own}

    def left_over(self, name: str, digest: str) -> list[str]:
        """List what earlier exports of the same name and format as a file's wrote, and its own did not."""
        own, alike = self._own(name, digest), [one for one in self.earlier if one.name == self.name]
        known = [known for one in alike for known in one.artefacts]
        return [one.path for one in known if own is not None and one.format == own.format]

    def _own(self, name: str, digest: str) -> Artefact | None:
        found = [known for known in self.artefacts if known.sha256 == digest or known.path == name]
        return min(found, key=lambda known: (known.path != name, known.sha256 != digest), default=None)

    def words(self) -> str:
        """Tell what it is of: the kind and the names of the latest export's files."""
        kind = "planner block" if any(known.format == PLANNER for known in self.artefacts) else "motion"
        return f"the {kind} {', '.join(known.path for known in self.artefacts) or self.name}"

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        return {
            **attrs.asdict(self, recurse=False),
            "artefacts": [attrs.asdict(artefact) for artefact in self.artefacts],
            "check": self.check or UNVERIFIED,
            "earlier": [one.to_dict() for one in self.earlier],
        }

    def to_json(self) -> bytes:
        """Render, UTF-8."""
        document = {**HEAD, **self.to_dict()}
        document[SEAL] = seal_of(document)
        return (json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8")


def parse_manifest(content: bytes, source: str) -> Manifest:
    """Read a manifest.

    Parameters
    ----------
    content : bytes
    source : str
        Where it comes from, for the error.

    Raises
    ------
    OutputError
        It is none, of another version, or was altered.
    """
    try:
        document = parse_document(content.decode("utf-8"), HEAD)
        seal, computed = document.pop(SEAL, None), seal_of(document)
        manifest = _from_dict({key: value for key, value in document.items() if key not in HEAD})
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise OutputError(
            f"{source}: not a manifest of this version of gen-profile; export again."
        ) from error
    if seal != computed:
        raise OutputError(
            f"{source} was altered after it was written, or comes from an earlier version ({SEAL} does not "
            "fit), so it proves nothing; export again."
        )
    return manifest


def seal_of(document: Mapping[str, Any]) -> str:
    """Hash a document, whatever its order and layout."""
    return sha256(json.dumps(document, sort_keys=True, separators=(",", ":")).encode("ascii"))


def _from_dict(document: dict[str, Any]) -> Manifest:
    artefacts = tuple(Artefact(**artefact) for artefact in document.pop("artefacts"))
    earlier = tuple(map(_from_dict, document.pop("earlier", ())))
    check = document.pop("check")
    return Manifest(
        artefacts=artefacts, earlier=earlier, check=None if check == UNVERIFIED else check, **document
    )


def sha256(content: bytes) -> str:
    """Hash bytes, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()
