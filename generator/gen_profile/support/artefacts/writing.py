"""Writing files, alone or as a folder of artefacts, so that half of it is never seen."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from gen_profile.support.artefacts.reading import read_artefact
from gen_profile.support.bounded_file import DOCUMENT
from gen_profile.support.errors import OutputError
from gen_profile.support.interrupts import interrupts_collected
from gen_profile.support.private_folder import temporary_folder


class Kept:
    """A staging place in memory."""

    def __init__(self) -> None:
        self._written: dict[str, bytes] = {}
        self.delivered: dict[str, bytes] = {}

    def write(self, name: str, content: bytes) -> bytes:
        """Keep a file."""
        self._written[name] = content
        return content

    def earlier(self, name: str) -> bytes | None:
        """Find nothing, as nothing was delivered before."""
        return self.delivered.get(name)

    def deliver(self) -> None:
        """Let all files be taken."""
        self.delivered |= self._written


class StagingFolder:
    """A hidden folder beside the files to come; made by `staged`."""

    def __init__(self, folder: Path, destination: Path) -> None:
        self._folder, self._destination = folder, destination
        self._names: list[str] = []

    def write(self, name: str, content: bytes) -> bytes:
        """Write a file and return what the disk holds of it."""
        path = self._folder / name
        path.write_bytes(content)
        self._names.append(name)
        return path.read_bytes()

    def earlier(self, name: str) -> bytes | None:
        """Read a file of this name at the destination, if there is one."""
        path = self._destination / name
        return read_artefact(path, DOCUMENT) if path.is_file() else None

    def deliver(self) -> None:
        """Move the files to their destination, in the order in which they were written.

        An interruption comes before all of them are moved, or after.
        """
        with interrupts_collected():
            for name in self._names:
                (self._folder / name).replace(self._destination / name)


Staging = StagingFolder | Kept  # where files wait until they are judged


@contextmanager
def staged(destination: Path) -> Iterator[StagingFolder]:
    """Open a staging folder in an output folder; what is not delivered when it closes is gone.

    So is what a run that was killed left there.

    An output folder that was made for this and holds nothing at the end is gone, too.

    Raises
    ------
    OutputError
        The folder or a file in it cannot be written.
    """
    try:
        made = [folder for folder in (destination, *destination.parents) if not folder.exists()]
        try:
            destination.mkdir(parents=True, exist_ok=True)
            with temporary_folder(destination, ".gen-profile-") as folder:
                yield StagingFolder(folder, destination)
        finally:
            _remove_empty(made)
    except OSError as error:
        raise unwritable(destination, error) from error


def unwritable(folder: Path, error: Exception) -> OutputError:
    """Say why nothing can be written to a folder."""
    reason = getattr(error, "strerror", None) or error
    if isinstance(error, FileExistsError | NotADirectoryError):
        reason = f"{next(place for place in (folder, *folder.parents) if place.exists())} is a file"
    return OutputError(f"Cannot write to the folder {folder}: {reason}; choose another one.")


def deliver(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all.

    Raises
    ------
    OutputError
        It cannot be written, or a device or pipe stands in its place.
    """
    _require_regular(path)
    deliver_all(path.parent, {path.name: content})


def deliver_all(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files to a folder, by name and in this order, each whole or not at all.

    Raises
    ------
    OutputError
        The folder or a file in it cannot be written.
    """
    with staged(folder) as staging:
        for name, content in files.items():
            staging.write(name, content)
        staging.deliver()


def require_place(path: Path) -> None:
    """Refuse a file that `deliver` could not write, before there is anything to write.

    Raises
    ------
    OutputError
    """
    _require_regular(path)
    with staged(path.parent):
        pass


def _require_regular(path: Path) -> None:
    if path.exists() and not path.is_file():  # root's rename would replace even /dev/null
        raise OutputError(f"Cannot write {path}: it is no regular file; choose another one.")


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with suppress(OSError):  # something was delivered there, or it could not even be made
            folder.rmdir()
