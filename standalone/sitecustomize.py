"""Import a standalone folder's Python code from `code.zip`; extension modules and data lie beside it."""

import os
import sys
import zipfile
from importlib.machinery import ModuleSpec, SourcelessFileLoader
from importlib.util import spec_from_file_location
from pathlib import Path

HERE = Path(__file__).parent
ARCHIVE = zipfile.ZipFile(HERE / "code.zip")
NAMES = frozenset(ARCHIVE.namelist())

# a list of this folder's few fonts would spoil other Matplotlibs of the user, which share their cache
os.environ.setdefault("MPLCONFIGDIR", os.path.expanduser("~/.cache/gen-profile-matplotlib"))  # noqa: PTH111


class Loader(SourcelessFileLoader):
    """Loads a module as if its file lay unpacked."""

    def get_data(self, path: str) -> bytes:
        """Read a file, of code or data."""
        name = Path(path).relative_to(HERE).as_posix()
        return ARCHIVE.read(name) if name in NAMES else super().get_data(path)


class Finder:
    """Finds modules in the archive."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Find one, by its full name."""
        module = name.replace(".", "/")
        for file in (f"{module}/__init__.pyc", f"{module}.pyc"):
            if file in NAMES:
                return spec_from_file_location(name, HERE / file, loader=Loader(name, str(HERE / file)))
        return None


sys.meta_path.insert(0, Finder)
