"""For all tests: Hypothesis without deadlines, as machines differ, and derandomised; one cache of FMUs."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("gen-profile", deadline=None, derandomize=True)
settings.load_profile("gen-profile")


@pytest.fixture(scope="session")
def shared_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One cache for all tests, in all of pytest-xdist's processes: each FMU is compiled once."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "cache"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(autouse=True)
def cache(shared_cache: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep the tests out of the user's cache."""
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(shared_cache))
    monkeypatch.delenv("GEN_PROFILE_CC", raising=False)
    return shared_cache
