"""The files of an FMU, as FMI 2 or 3 lays them out, and the archive they make."""

import hashlib
import io
import zipfile
from collections.abc import Mapping
from enum import Enum
from importlib.resources import files
from pathlib import Path

import attrs
import fmpy

from gen_profile_exporters.templates import filled
from gen_profile_fmu.description.model_description import build_description, model_description
from gen_profile_fmu.description.terminals import terminals_and_icons
from gen_profile_fmu.model.c_sources import TEMPLATES, hand_written
from gen_profile_fmu.model.contents import Model

SOURCE_FILE = "fmu.c"  # includes all others
_COMMON = ("instance.h", "message.c", "instance.c", "common_functions.c")


class Version(Enum):
    """A version of FMI."""

    FMI2 = "2"
    FMI3 = "3"

    @property
    def own_files(self) -> tuple[str, ...]:
        """Names of the hand-written C files: the host first, then what is compiled after the instance."""
        number = self.value
        return (f"fmi{number}_host.h", f"fmi{number}.c", *(("fmi3_unclaimed.c",) if number == "3" else ()))

    @property
    def headers(self) -> tuple[str, ...]:
        """Names of the standard's own headers."""
        platform = "TypesPlatform" if self is Version.FMI2 else "PlatformTypes"
        return tuple(f"fmi{self.value}{name}.h" for name in ("Functions", "FunctionTypes", platform))


@attrs.frozen(kw_only=True)
class Sources:
    """All texts that go into an FMU but its documentation.

    Attributes
    ----------
    model : Model
    version : Version
    identity : str
        GUID or instantiation token: a digest of all that follows.
    description : bytes
        modelDescription.xml.
    code : mapping of str to str
        Every C file by name, but for FMI's own headers: these an importer supplies (2.0.4, section 2.3; 3.0,
        section 2.5.1).
    """

    model: Model
    version: Version
    identity: str
    description: bytes
    code: Mapping[str, str]

    @property
    def compiled(self) -> dict[str, str]:
        """All that a compiler reads to make a shared library."""
        return {**self.code, **standard_headers(self.version)}


def sources(model: Model, version: Version) -> Sources:
    """Write a model's C files and description for a version of FMI."""
    code = {**model.code, **hand_written("interface", *_COMMON, *version.own_files)}
    identity = digest(model_description(model, version.value, "", SOURCE_FILE), *flat(code))[:32]
    return Sources(
        model=model,
        version=version,
        identity=identity,
        description=model_description(model, version.value, identity, SOURCE_FILE),
        code={**code, SOURCE_FILE: _translation_unit(model, version, identity)},
    )


def standard_headers(version: Version) -> dict[str, str]:
    """Read FMI's own headers by name, as FMPy brings them along: for shared libraries, without prefixes."""
    folder = Path(fmpy.__file__).parent / "c-code"
    return {name: (folder / name).read_text(encoding="utf-8") for name in version.headers}


def _translation_unit(model: Model, version: Version, identity: str) -> str:
    host, *interface = version.own_files
    names = [host, "model.h", *model.order, *_COMMON, *interface]
    return filled(
        TEMPLATES / SOURCE_FILE,
        fmi=f"FMI{version.value}",
        model=model.identifier,
        identity=identity,
        includes="\n".join(f'#include "{name}"' for name in names if name != "instance.h"),
    )


def fmu_files(made: Sources, binaries: Mapping[str, bytes], *, with_extras: bool = True) -> dict[str, bytes]:
    """Lay out an FMU.

    Parameters
    ----------
    made : Sources
    binaries : mapping of str to bytes
        Shared libraries by their paths in the archive.
    with_extras : bool
        Whether sources, documentation, icon and licences go in.
    """
    laid = {"modelDescription.xml": made.description, **binaries}
    if not with_extras:
        return laid
    laid |= {f"sources/{name}": text.encode("utf-8") for name, text in made.code.items()}
    laid["documentation/index.html"] = made.model.page().encode("utf-8")
    package = files("gen_profile_fmu")
    licence = package.joinpath("licence.txt").read_bytes()
    icon = package.joinpath("icon.png").read_bytes()
    laid["documentation/licenses/license.txt"] = licence
    if made.version is Version.FMI2:
        return laid | {"model.png": icon}
    build = build_description(made.model, SOURCE_FILE)
    return laid | {
        "sources/buildDescription.xml": build,
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(made.model.variables),
        "terminalsAndIcons/icon.png": icon,
    }


def archive(contents: Mapping[str, bytes]) -> bytes:
    """Zip files so that the same content gives the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as zipped:
        for name, content in sorted(contents.items()):
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.create_system = 3  # Unix, wherever it is written
            entry.external_attr = 0o644 << 16
            zipped.writestr(entry, content, compress_type=zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def flat(texts: Mapping[str, str]) -> list[bytes]:
    """Names and texts, sorted, for a digest."""
    return [part.encode("utf-8") for name, text in sorted(texts.items()) for part in (name, text)]


def digest(*parts: bytes) -> str:
    """SHA-256 in hexadecimal, of parts that cannot run into each other."""
    result = hashlib.sha256()
    for part in parts:
        result.update(len(part).to_bytes(8, "little"))
        result.update(part)
    return result.hexdigest()
