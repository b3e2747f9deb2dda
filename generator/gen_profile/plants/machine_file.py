"""A machine that a user wrote: a Python file with a `PLANT`, named in a spec as ``plant.file``."""

import hashlib
import re
import sys
import traceback
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path
from types import ModuleType

import attrs

from gen_profile.plants.plant import Plant
from gen_profile.plants.soundness import faults_of
from gen_profile.support.bounded_file import DOCUMENT, read_bounded
from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import found


@attrs.frozen(kw_only=True)
class MachineFile:
    """A file's name, without folders, and what it holds.

    A spec carries the content, not the place: wherever the spec goes, its machine goes with it.
    """

    name: str
    content: bytes = attrs.field(repr=False)

    @property
    def sha256(self) -> str:
        """Hash of the content, in hexadecimal."""
        return hashlib.sha256(self.content).hexdigest()


def read_machine_file(path: Path, sha256: str | None = None) -> MachineFile:
    """Read a machine's file, without running it.

    Parameters
    ----------
    path : Path
    sha256 : str, optional
        What the content must hash to.

    Raises
    ------
    SpecError
        It cannot be read, is no Python file, or not the one that is meant.
    """
    if not re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.-]*\.py", path.name):
        raise SpecError(
            f"plant.file: {path.name!r} must be a Python file such as my_machine.py, named by ASCII letters, "
            "digits, dots, underscores and hyphens."
        )
    try:
        file = MachineFile(name=path.name, content=read_bounded(path, DOCUMENT))
    except OSError as error:
        raise SpecError(f"plant.file: cannot read {path}: {error.strerror}.") from error
    if sha256 is not None and file.sha256 != sha256:
        raise SpecError(
            f"plant.file: {path} is not the file that is meant (its SHA-256 is not plant.file_sha256); "
            "it was not run."
        )
    return file


@cache
def plant_of_file(file: MachineFile) -> Plant:
    """Run a machine's file and take its `PLANT`.

    Raises
    ------
    SpecError
        The file fails, or its machine is unsound.
    """
    module = ModuleType(file.name.removesuffix(".py"))
    try:
        with redirect_stdout(sys.stderr):  # what it prints is no part of a JSON document
            exec(compile(file.content, file.name, "exec"), module.__dict__)  # what the user asked for
    except (Exception, SystemExit) as error:
        raise SpecError(f"plant.file: {_place(file, error)}: {type(error).__name__}: {error}.") from error
    plant = getattr(module, "PLANT", None)
    if not isinstance(plant, Plant):
        raise SpecError(
            f"plant.file: {file.name} must define PLANT, a gen_profile.plants.plant.Plant, found "
            f"{found(plant)}."
        )
    faults = faults_of(plant)
    if faults:
        raise SpecError(f"plant.file: {file.name}: {'; '.join(faults)}.")
    return plant


def _place(file: MachineFile, error: BaseException) -> str:
    """Name the file and the line of it that failed."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == file.name]
    line = error.lineno if isinstance(error, SyntaxError) else lines[-1] if lines else None
    return file.name if line is None else f"{file.name}, line {line}"
