"""Parts that pip cannot install. `.ci/run` installs all of them, so in CI a missing one is a failure."""

from __future__ import annotations

import os
import shutil
import sysconfig
from typing import NoReturn

import pytest


def missing(what: str) -> NoReturn:
    """Skip the test that asks; in CI, fail it.

    Parameters
    ----------
    what : str
        Names the part and the way to get it.
    """
    message = f"missing on this machine: {what}"
    if "CI" in os.environ:
        pytest.fail(message)
    pytest.skip(message)


def program(name: str, package: str) -> str:
    """Find a program of a Debian package, not the script of that name that a Python package brings."""
    own = sysconfig.get_path("scripts")
    path = os.pathsep.join(one for one in os.environ["PATH"].split(os.pathsep) if one != own)
    return shutil.which(name, path=path) or missing(f"{name} (Debian package {package})")
