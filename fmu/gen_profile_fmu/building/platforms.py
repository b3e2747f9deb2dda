"""The platforms that FMUs are built for: compiler targets, and where FMI wants their binaries."""

import sys
from platform import machine

import attrs

from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.description.fmu_files import Version

_PROCESSORS = {"amd64": "x86_64", "x86_64": "x86_64", "arm64": "arm64", "aarch64": "arm64"}
_SYSTEMS = {"linux": "linux", "darwin": "macos", "win32": "windows"}


@attrs.frozen
class Platform:
    """A platform.

    Attributes
    ----------
    target : str
        As Zig calls it; no newer C library or system than named there is needed.
    fmi2, fmi3 : str
        Folder of binaries (2.0.4 section 2.3.1, 3.0 section 2.5.1.3). FMI 2.0 has no name for Linux on ARM:
        there FMI 3.0's stands in. On macOS it has one, for a universal binary of both processors.
    extension : str
    """

    target: str
    fmi2: str
    fmi3: str
    extension: str

    def library(self, version: Version, identifier: str) -> str:
        """Path of a binary in an archive."""
        folder = self.fmi2 if version is Version.FMI2 else self.fmi3
        return f"binaries/{folder}/{identifier}{self.extension}"


PLATFORMS = {
    "linux-x86_64": Platform("x86_64-linux-gnu.2.17", "linux64", "x86_64-linux", ".so"),
    "linux-arm64": Platform("aarch64-linux-gnu.2.17", "aarch64-linux", "aarch64-linux", ".so"),
    "windows-x86_64": Platform("x86_64-windows-gnu", "win64", "x86_64-windows", ".dll"),
    "macos-x86_64": Platform("x86_64-macos.11.0", "darwin64", "x86_64-darwin", ".dylib"),
    "macos-arm64": Platform("aarch64-macos.11.0", "darwin64", "aarch64-darwin", ".dylib"),
}


def host_platform() -> str:
    """Name this computer's platform.

    Raises
    ------
    CosimulationError
        When it is none of `PLATFORMS`.
    """
    processor = machine().lower()
    name = f"{_SYSTEMS.get(sys.platform, sys.platform)}-{_PROCESSORS.get(processor, processor)}"
    if name not in PLATFORMS:
        raise CosimulationError(
            f"There is no compiler for the plant's FMU on {sys.platform} {processor}. "
            f"FMUs are built on and for {', '.join(PLATFORMS)}."
        )
    return name
