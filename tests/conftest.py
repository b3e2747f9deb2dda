"""For all tests: Hypothesis without deadlines, as machines differ, and derandomised; one cache; options."""

import gc
import os
import signal
import sys
from collections import Counter
from collections.abc import Iterator, Set
from importlib import import_module
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is loaded: there is a process per processor

import pytest
from hypothesis import settings
from turns import TURNS, near, rooms_of, turns

from gen_profile.support.remembered import forget
from gen_profile.support.same_bits import choose_common_kernels

choose_common_kernels()  # before NumPy is loaded, too: bytes are compared with those of the program

settings.register_profile("gen-profile", deadline=None, derandomize=True)
settings.load_profile("gen-profile")

gc.disable()  # of what is loaded nothing becomes garbage: looking for it takes an eighth of the time

# in the background of a script this process ignores interruptions, and so would those that tests interrupt
signal.signal(signal.SIGINT, signal.default_int_handler)
if sys.platform != "win32":
    signal.signal(signal.SIGQUIT, signal.SIG_DFL)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup has it ignored


TURN = pytest.StashKey[str]()
NAMED = 8  # rooms, in the line that tells what ran


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """Give `-n auto` a process a processor, and two more where slow tests wait for other programs.

    Each process collects all tests, a tenth of the work of the quick ones. The tests of a module stay
    together, as far as they can, so that its fixtures are made once.
    """
    if config.option.dist == "no":
        config.option.dist = "worksteal"
    return (os.cpu_count() or 1) + 2 * (config.option.markexpr != "not slow")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--first-cases",
        action="store_true",
        help="run each parametrised test once only, which does to try other versions of libraries",
    )
    parser.addoption(
        "--turn",
        type=int,
        help=f"run the slow tests near to what changed, and those whose turn it is (modulo {TURNS})",
    )
    parser.addoption(
        "--changed", default="", metavar="PATHS", help="what changed, for --turn: a path each line"
    )


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: "recheck" not in item.path.parts)  # the longest first
    if config.getoption("--first-cases"):
        first = {item.nodeid.partition("[")[0]: item for item in reversed(items)}
        keep(config, items, set(first.values()))
    if config.getoption("--turn") is not None:
        take_turns(config, items)


def keep(config: pytest.Config, items: list[pytest.Item], kept: Set[pytest.Item]) -> None:
    config.hook.pytest_deselected(items=[item for item in items if item not in kept])
    items[:] = [item for item in items if item in kept]


def file_of(item: pytest.Item) -> str:
    """Name the page that a test runs, or else its own file."""
    page = item.get_closest_marker("page")
    return str(page.args[0] if page else item.nodeid.partition("::")[0])


def take_turns(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the slow tests whose turn it is not, and note how many for the last lines."""
    turn, changed = config.getoption("--turn") % TURNS, set(config.getoption("--changed").split())
    slow = {item: file_of(item) for item in items if item.get_closest_marker("slow")}
    tests = Counter(slow.values())
    why = near(
        tests, {file: rooms_of(file, (config.rootpath / file).read_text("utf-8")) for file in tests}, changed
    )
    turn_of = turns(set(tests))
    rooms = {item for item, file in slow.items() if file in why}
    due = {item for item, file in slow.items() if turn_of[file] == turn} - rooms
    keep(config, items, {*items} - slow.keys() | rooms | due)
    names = sorted({*why.values()}) or ["none"]
    more = [f"{len(names) - NAMED} more"] if len(names) > NAMED else []
    named = ", ".join(names[:NAMED] + more)
    left = len(slow) - len(rooms) - len(due)
    config.stash[TURN] = (
        f"Turn {turn + 1} of {TURNS}: of {len(slow)} slow tests {len(rooms)} of changed rooms ({named}), "
        f"{len(due)} in turn; {left} were left for the next turns."
    )
    if hasattr(config, "workeroutput"):  # of a process of pytest-xdist
        config.workeroutput["turn"] = config.stash[TURN]


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Take over what a process noted, if it did not die."""
    if line := getattr(node, "workeroutput", {}).get("turn"):
        node.config.stash[TURN] = line


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    if line := config.stash.get(TURN, ""):
        terminalreporter.write_line(line)


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)
    gc.enable()


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Halve the intervals of limited motions: what is refused, named and found to work is so on any mesh."""
    set_up = "gen_profile.methods.solvers.direct.set_up"
    monkeypatch.setattr(f"{set_up}.USUAL", import_module(set_up).DirectOptions(intervals=20))


@pytest.fixture(autouse=True)
def nothing_remembered() -> None:
    """Let no test find what another one has computed, perhaps by other methods."""
    forget()


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Keep out of the user's cache, and compile each FMU once, in all of pytest-xdist's processes.

    TESTS_CACHE is a folder that several runs share, one after the other.
    """
    base = tmp_path_factory.getbasetemp()
    own = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "cache"
    folder = Path(os.environ.get("TESTS_CACHE", own))
    folder.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("GEN_PROFILE_CACHE", str(folder))
        environment.setenv("ZIG_GLOBAL_CACHE_DIR", str(folder / "zig"))  # which takes HOME else
        environment.delenv("GEN_PROFILE_CC", raising=False)
        yield folder
