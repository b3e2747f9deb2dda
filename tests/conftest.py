"""For all tests: Hypothesis without deadlines, as machines differ, and derandomised; one cache of FMUs."""

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("gen-profile", deadline=None, derandomize=True)
settings.load_profile("gen-profile")

# in the background of a script this process ignores interruptions, and so would those that tests interrupt
signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.platform != "win32":
    signal.signal(signal.SIGQUIT, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup has it ignored


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keep out of the user's cache, and compile each FMU once, in all of pytest-xdist's processes."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "cache"
    folder.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("GEN_PROFILE_CACHE", str(folder))
        environment.setenv("ZIG_GLOBAL_CACHE_DIR", str(folder / "zig"))  # which takes HOME else
        environment.delenv("GEN_PROFILE_CC", raising=False)
        yield folder
