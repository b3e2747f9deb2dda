"""Who may talk to the studio, and what a stranger's spec can make it do: asked over HTTP and a WebSocket."""

import asyncio
import gc
import hashlib
import json
import os
import signal
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path
from urllib.error import URLError
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import pytest
from end_to_end.studios import HANG, closed, conversation, status, studio, workers_of
from tornado.httpclient import HTTPClientError

SPY = Path(__file__).with_name("touched_paths.py")
OWN = Path(__file__).parents[2] / "examples" / "inclined_crane.py"
# Tornado's client says so of connections that the server refuses or ends
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.fixture(autouse=True)
def _collected():
    """Let it say so here, and not in the midst of another test."""
    yield
    gc.collect()


@pytest.fixture(scope="module")
def running():
    with studio() as found:
        yield found


def test_strangers_are_refused(running):
    address, own = running.address, {"Cookie": running.cookie}
    assert status(address, **own) == 200 and status(f"{address}words.json", **own) == 200
    for name in ("words.json", "studio.js", "live", "made/unknown", "help/spec", "help/studio.png", "guess"):
        assert status(f"{address}{name}") == 404
    assert status(address) == 403 and status(address, Cookie=running.cookie[:-2] + "xx") == 403
    assert status(address, Host="evil.example", **own) == 404  # whose name was made to mean this machine
    assert status(address, Host=f"localhost.evil.example:{urlsplit(address).port}", **own) == 404
    assert status(address, Origin="http://evil.example", **own) == 404
    for site in ("cross-site", "same-site"):  # the latter is another port of this machine
        assert status(f"{address}words.json", **{"Sec-Fetch-Site": site}, **own) == 404
    assert status(f"{address}../pyproject.toml", **own) == status(f"{address}studio.py", **own) == 404
    assert status(f"{address}made/unknown", **own) == 404
    assert status(f"{address}help/spec", **own) == status(f"{address}help/studio.png", **own) == 200
    for name in ("help/guess", "help/../pyproject.toml", "help/..%2Fpyproject", "help/conf.py", "help/"):
        assert status(f"{address}{name}", **own) == 404


@pytest.mark.slow
def test_a_code_works_once_and_in_any_writing(tmp_path):
    with (tmp_path / "told").open("w+") as stderr, studio(stderr=stderr) as running:
        assert running.enter("") == running.enter("aaaaaaaa") == running.enter("ä") == ""
        assert running.enter(running.code, Origin="http://evil.example") == ""
        given = running.enter(f" {running.code[:4].upper()}-{running.code[4:]}")
        assert given.startswith(f"gen-profile-studio-{urlsplit(running.address).port}=")
        assert given.split("; ")[1:] == ["HttpOnly", "Path=/", "SameSite=Strict"]
        assert running.enter(running.code) == ""
        stderr.seek(0)
        assert running.enter(stderr.read().split()[-1]) == given


@pytest.mark.parametrize("place", ["", "help/spec"])
def test_the_page_can_load_and_tell_nothing_elsewhere(running, place):
    with urlopen(Request(f"{running.address}{place}", headers={"Cookie": running.cookie})) as answer:
        policy = dict(
            part.strip().split(" ", 1) for part in answer.headers["Content-Security-Policy"].split(";")
        )
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert answer.headers["Cache-Control"] == "no-store"
        page = answer.read().decode()
    assert policy["default-src"] == policy["frame-ancestors"] == "'none'"
    assert policy["script-src"] == "'self'" and "unsafe" not in "".join(policy.values())
    assert "http" not in page  # no file of another place


def test_it_listens_on_this_machine_alone(running):
    others = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    for other in others - {"127.0.0.1"}:
        with pytest.raises((URLError, OSError)):
            urlopen(running.address.replace("127.0.0.1", other), timeout=5.0)


def test_a_page_elsewhere_cannot_listen(running):
    for origin in ("http://evil.example", "null"):
        with pytest.raises(HTTPClientError):
            asyncio.run(running.connect(Origin=origin))
    with pytest.raises(HTTPClientError):
        asyncio.run(running.connect(Cookie=running.cookie[:-1]))


@pytest.mark.slow
def test_pages_do_not_disturb_each_other_and_nonsense_is_a_sentence(running):
    def show(duration):
        return {"say": "show", "serial": 1, "state": {"preset": "", "edits": {"move.duration": duration}}}

    async def both():
        found = []
        sockets = [await running.connect() for _ in range(2)]
        for one, duration in zip(sockets, (3.2, 3.4), strict=True):
            for nonsense in ("[", "null", '{"say": "fly"}', '{"say": "show", "serial": 1, "state": 3}'):
                await one.write_message(nonsense)
            await one.write_message(json.dumps(show(duration)))
        for one in sockets:
            parts = []
            while not parts or (parts[-1]["part"], parts[-1]["serial"]) != ("curves", 1):
                parts.append(json.loads(await asyncio.wait_for(one.read_message(), HANG)))
            found.append(parts[-1]["duration"])
            assert [part["part"] for part in parts].count("failure") == 4
            await closed(one)
        return found

    assert asyncio.run(both()) == pytest.approx([3.2, 3.4])


def test_what_is_too_long_ends_the_conversation(running):
    with pytest.raises(AssertionError, match="closed"):
        conversation(running, "x" * 100_000, until="an answer")


def dropped(name, content):
    return b"\n".join((json.dumps({"say": "drop", "name": name}).encode(), content))


def showing(content):
    """Show a spec that was dropped as bay.toml."""
    preset = f"bay.toml ({hashlib.sha256(content).hexdigest()[:6]})"
    return {"say": "show", "serial": 1, "state": {"preset": preset, "edits": {}}}


def agreeing(*files):
    return {"say": "agree", "files": [*map(str, files)]}


def own_spec(machine):
    return f"plant.file = {json.dumps(str(machine))}\nmove = {{distance = 1.0, duration = 6.0}}\n".encode()


@pytest.mark.slow
def test_nothing_of_a_file_is_touched_before_the_user_agrees(tmp_path):
    """Where it lies on another computer, a look is enough to tell that one who looked."""
    marker, touched = tmp_path / "ran", tmp_path / "touched"
    machine = tmp_path / "elsewhere" / "machine.py"
    machine.parent.mkdir()
    machine.write_text(f"open({str(marker)!r}, 'w').close()\n{OWN.read_text('utf-8')}", "utf-8")
    own = own_spec(machine)
    foreign = own.replace(b"plant.file", b"check.fmu").replace(b".py", b".fmu")
    spying = (sys.executable, SPY, touched, machine.parent)
    with studio(program=spying) as running:
        logged = {"use": "", "columns": None, "after": 0.0, "at": [], "free": []}
        driven = {"drive": 1, "command": "", "values": [], "live": {}, "sensor": {}, "wind": []}
        for content in (own, foreign):
            state = showing(content)["state"]
            asking = [
                showing(content),
                {"say": "make", "number": 1, "state": state, "formats": [], "report": False},
                {"say": "drive", "number": 1, "state": state, **driven},
                dropped("bay.csv", b""),
                {"say": "read", "number": 1, "state": state, **logged},
                agreeing(machine.parent / "another.py"),
                "nonsense",
            ]
            heard = conversation(running, dropped("bay.toml", content), *asking, until="failure")
            assert heard["opened"]["preset"] == state["preset"]
            assert heard["consent"]["files"][0].startswith(str(machine.parent))
        time.sleep(1.0)
        assert not touched.exists() and not marker.exists()
        agreed = (showing(own), agreeing(machine))
        conversation(running, dropped("bay.toml", own), *agreed, until="setting")
        assert marker.exists() and touched.exists()


def test_what_is_no_file_is_not_read_for_ever(running):
    endless = own_spec("/dev/zero")
    sayings = (dropped("bay.toml", endless), showing(endless), agreeing("/dev/zero"))
    heard = conversation(running, *sayings, until="failure")
    assert heard["failure"]["sentences"] == ["Cannot read /dev/zero: it is no file."]


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"a = = 1", "not valid TOML"), (b"\xff\xfe", "UTF-8"), (b"# \n" * 99_999, "no spec"), (b"", "empty")],
)
def test_what_is_no_spec_leaves_the_page_as_it_is(running, content, words):
    heard = conversation(running, dropped("bay.toml", content), until="notice")
    assert words in heard["notice"]["sentence"] and "opened" not in heard


@pytest.mark.slow
def test_a_log_is_read_and_forgotten(running):
    reading = {"say": "read", "number": 3, "use": "", "columns": None, "after": 0.0, "at": [], "free": []}
    reading["state"] = {"preset": "", "edits": {}}
    heard = conversation(running, dropped("bay.csv", b"time_s,hook_angle\n"), reading, until="unread")
    assert heard["unread"]["serial"] == 3 and heard["log"]["source"] == "bay.csv"
    faulty = {**reading, "after": "inf"}
    heard = conversation(running, dropped("bay.csv", b""), faulty, {"say": "forget"}, until="failure")
    assert "not understood" in heard["failure"]["sentences"][0]


@pytest.mark.slow
def test_a_machine_of_one_s_own_runs_only_when_the_user_agrees(tmp_path):
    marker = tmp_path / "ran"
    machine = tmp_path / "machine.py"
    machine.write_text(f"open({str(marker)!r}, 'w').close()\n{OWN.read_text('utf-8')}", "utf-8")
    (tmp_path / "own.toml").write_text('plant.file = "machine.py"\nmove = {distance = 1.0, duration = 6.0}\n')
    with studio("own.toml", folder=tmp_path) as running:
        begin = {"say": "open", "address": ""}
        asked = conversation(running, begin, until="consent")
        assert asked["consent"]["files"] == [str(machine)]
        assert "curves" not in asked and not marker.exists()
        agreed = conversation(running, begin, agreeing(machine), until="setting")
        assert marker.exists() and agreed["consent"]["changed"] is False
        assert "consent" not in conversation(running, begin, until="setting")
        marker.unlink()
        machine.write_text(machine.read_text("utf-8") + "# a change\n", "utf-8")
        again = conversation(running, begin, until="consent")
        assert again["consent"]["changed"] is True and not marker.exists()


@pytest.mark.slow
def test_a_worker_that_is_killed_is_replaced():
    with studio() as running:
        conversation(running, {"say": "open", "address": ""}, until="verdict")
        killed = waiting_workers(running.pid)
        for worker in killed:
            with suppress(ProcessLookupError):  # that of the page that closed may have ended
                os.kill(worker, signal.SIGKILL)
        state = {"preset": "", "edits": {"move.duration": 3.3}}
        found = conversation(running, {"say": "show", "serial": 1, "state": state}, until="curves")
        assert found["curves"]["duration"] == pytest.approx(3.3)
        left = waiting_workers(running.pid)
        assert not set(left) & set(killed)
    assert not any(Path(f"/proc/{worker}").exists() for worker in left)


def waiting_workers(server):
    """List a studio's processes as soon as one is ready for the next page."""
    while not (found := workers_of(server)):
        time.sleep(0.01)
    return found
