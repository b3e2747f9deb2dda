"""A stream watched while it runs: what is drawn, and that drawing disturbs nothing."""

import json
import multiprocessing
import os
import pty
import re
import signal
import subprocess
import time
from contextlib import suppress
from io import StringIO
from types import SimpleNamespace
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import attrs
import numpy as np
import pytest
from command_line import PROGRAM, error_of, run_here
from exporters.can.bench import HastyClock
from headless import browser
from rich.console import Console

from gen_profile.delivery.streaming import live, live_page, live_terminal
from gen_profile.delivery.streaming import stream as workflow
from gen_profile_exporters.can.host.port import Port
from gen_profile_exporters.can.streaming.record import Book, Phase

VIEW = live.View(
    name="bay-3",
    axes=("bridge",),
    units=("m",),
    period=0.5,
    planned=np.array([[0.0], [1.0], [2.0], [3.0]]),
    scale=np.array([1000.0]),
)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    folder = tmp_path_factory.mktemp("live")
    spec = ("--set", "can.timeout=0.5", "--set", "can.sync_period=0.02")
    assert run_here("--preset", "paper", *spec, "--export", "can", "--out", folder).code == 0
    return folder / "paper.log"


def begun():
    """Take down half a motion: the second answer is missing, the third cycle was late."""
    book = Book.blank(4, 1)
    book.begin(Phase.STREAM)
    for cycle, late in enumerate((1000, 2000, 9000)):
        book.take_sent(cycle, late)
    book.take_answer(0, [0])
    book.take_answer(2, [1990])
    return book


def test_a_glance_at_a_stream_that_runs():
    glance = live.Glance.at(begun(), VIEW)
    assert (glance.phase, glance.cycle, glance.late) == (Phase.STREAM, 3, 9.0)
    np.testing.assert_array_equal(glance.actual[:, 0], [0.0, np.nan, 1.99, np.nan])
    assert glance.apart == pytest.approx([0.01])


def test_what_is_drawn():
    console = Console(width=24, record=True, file=StringIO())
    console.print(live_terminal.picture(VIEW, live.Glance.at(begun(), VIEW), 24))
    words = " ".join(console.export_text().split())
    assert "bay-3: stream, 1.0 of 1.5 s, late by 9 µs at most" in words
    assert "bridge: 1.99 m, at most 10 mm off the motion" in words


def test_curves_go_where_they_belong():
    rising, nothing = np.linspace(-1.0, 1.0, 8), np.full(8, np.nan)
    lines = [line.plain[live_terminal.SCALE :] for line in live_terminal.curves(rising, nothing, 4, 2)]
    assert lines == ["\u2800\u2800⡠⠊", "⡠⠊\u2800\u2800"]
    assert [line.plain.split()[0] for line in live_terminal.curves(rising, nothing, 4, 2)] == ["1", "-1"]
    above = live_terminal.curves(rising, np.where(rising < 0, rising, np.nan), 4, 2)
    assert [span.style for line in above for span in line.spans].count(live_terminal.ACTUAL) == 2


def hang(view, look, over):
    """Neither look nor end."""
    time.sleep(60.0)


def fail(view, look, over):
    raise OSError("the terminal is gone")


def die(view, look, over):
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.parametrize("show", [hang, fail, die])
def test_nobody_waits_for_a_viewer(log, show, monkeypatch):
    monkeypatch.setattr(live, "LAST_LOOK", 0.1)
    monkeypatch.setattr(workflow, "SharedClock", HastyClock)
    source = workflow.verified(log)
    with live.watched(source, show) as book:
        port = Port(interface="virtual", channel="live")
        outcome = workflow.stream(source, port, simulate_drive=True, book=book)
        assert book.state is Phase.DONE
    assert (outcome.record.reason, outcome.record.sent) == ("", 151)
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_on_a_terminal(log):
    master, slave = pty.openpty()
    command = [PROGRAM, "stream", log, "--simulate-drive", "--live", "terminal"]
    environment = {**os.environ, "COLUMNS": "80", "TERM": "xterm"}
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=slave, env=environment)
    os.close(slave)
    drawn = b""
    with suppress(OSError):  # which is how its end shows
        while part := os.read(master, 65536):
            drawn += part
    os.close(master)
    assert process.wait() == 0
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", drawn.decode("utf-8"))
    assert re.search(r"paper: (stream|hold), ", text)  # on a busy machine it is seen near its end only
    assert re.search(r"paper: done, 3\.0 of 3\.0 s", text)
    assert re.search(r"cart: 0\.3 m, at most [\d.e-]+ mm off the motion", text)
    assert max(text) > "\u2800"


def test_without_a_terminal(log):
    assert "--live terminal: standard error is no terminal" in error_of(
        "stream", log, "--simulate-drive", "--live", "terminal"
    )


@pytest.fixture
def page():
    with live_page.Server(VIEW, lambda: live.Glance.at(begun(), VIEW)) as server:
        yield server


def answer(address, **headers):
    """Ask for a page; returns its status and content."""
    try:
        with urlopen(Request(address, headers=headers)) as found:
            return found.status, found.read()
    except HTTPError as error:
        with error:
            return error.code, b""


class TestPage:
    def test_it_tells_the_state(self, page):
        status, content = answer(f"{page.address}state")
        (axis,) = (state := json.loads(content))["axes"]
        assert (status, state["phase"], state["over"]) == (200, "stream", False)
        assert (state["time"], state["duration"]) == (1.0, 1.5)
        assert axis["planned"] == [0.0, 1.0, 2.0, 3.0]
        assert axis["actual"] == [0.0, None, 1.99, None]

    @pytest.mark.parametrize(
        "path", ["/", "/state", "/live.js", "/{guess}/state", "{own}../state", "{own}live_page.py"]
    )
    def test_only_who_knows_the_address(self, page, path):
        path = path.format(guess="A" * 22, own=page.path)
        assert answer(f"http://{page.host}{path}")[0] == 404

    def test_not_under_another_name(self, page):
        """As a page elsewhere would ask, whose name was made to mean this machine."""
        assert answer(f"{page.address}state", Host=f"elsewhere.example:{page.server_port}")[0] == 404
        assert page.server_address[0] == "127.0.0.1"

    def test_long_motions_are_thinned_out(self):
        long = attrs.evolve(VIEW, planned=np.zeros((100_000, 1)))
        book = Book.blank(100_000, 1)
        (axis,) = live_page._state(long, live.Glance.at(book, long))["axes"]
        assert len(axis["planned"]) == len(axis["actual"]) <= 500

    @pytest.mark.slow
    def test_a_browser_draws_it(self, page):
        with browser() as window:
            window.visit(page.address)
            window.wait("return document.querySelectorAll('polyline.planned').length === 1")
            words = window.run("return ['h1', 'h2'].map((name) => document.querySelector(name).textContent)")
            assert words == [
                "bay-3: stream, 1.0 of 1.5 s, late by 9 µs at most",
                "bridge: at most 10.0 mm off the motion",
            ]
            assert window.complaints() == []


@pytest.mark.slow
def test_the_address_is_told(log):
    command = [PROGRAM, "stream", log, "--simulate-drive", "--live", "browser", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        address = next(
            line.split()[-1] for line in process.stderr if line.startswith("Watch at http://127.0.0.1:")
        )
        state = json.loads(answer(f"{address}state")[1])
        out, _ = process.communicate()
    assert (state["name"], process.returncode, json.loads(out)["state"]) == ("paper", 0, "done")


def write_on(memory, cycles, over):
    """Take down cycles as sent, and as not sent again, until it is over."""
    book = Book(memory, cycles, 1)
    while not over.is_set():
        book.late[:] = 0
        book.late[:] = 1


def test_a_stream_is_looked_at_while_it_is_written():
    cycles, context = 100_000, multiprocessing.get_context("fork")
    memory, over = context.RawArray("b", Book.size(cycles, 1)), context.Event()
    writer = context.Process(target=write_on, args=(memory, cycles, over), daemon=True)
    writer.start()
    try:
        book, view = (
            Book(memory, cycles, 1),
            SimpleNamespace(scale=1.0, planned=np.zeros((cycles, 1)), axes=["x"]),
        )
        while not book.late.any():
            time.sleep(0.01)
        for _ in range(300):
            assert 0 <= live.Glance.at(book, view).cycle <= cycles
    finally:
        over.set()
        writer.join()
