"""The studio as a user starts it: a process of its own, and a browser or a program that is let in."""

import asyncio
import json
import os
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import IO, Any
from urllib.error import HTTPError
from urllib.parse import urlencode
from urllib.request import HTTPRedirectHandler, Request, build_opener, urlopen

import attrs
from command_line import PROGRAM
from headless import Browser
from tornado.httpclient import HTTPRequest
from tornado.websocket import WebSocketClientConnection, websocket_connect

SETTLED = "return document.querySelector('#pill').classList.contains('{}')"
HANG = 300.0  # s without any answer


class _Staying(HTTPRedirectHandler):
    def redirect_request(self, *_: object) -> None:
        """Follow nothing."""


@attrs.define(slots=False)
class Studio:
    """A studio that runs: its address, the code that it showed at first, and its process."""

    address: str
    code: str
    pid: int

    @property
    def origin(self) -> str:
        """The page's own."""
        return self.address.rstrip("/")

    def enter(self, word: str, **headers: str) -> str:
        """Hand in a code or key, and give the cookie with what is said of it, or nothing."""
        request = Request(self.address, urlencode({"word": word}).encode(), headers)
        try:
            given = build_opener(_Staying).open(request).headers
        except HTTPError as error:
            given = error.headers
        return str(given.get("Set-Cookie", ""))

    @cached_property
    def cookie(self) -> str:
        """For a program that was let in by the code."""
        return self.enter(self.code).partition(";")[0]

    async def connect(self, **headers: str) -> WebSocketClientConnection:
        """Open a conversation as the page does."""
        url = f"{self.address.replace('http:', 'ws:')}live"
        sent = {"Origin": self.origin, "Cookie": self.cookie} | headers
        return await websocket_connect(HTTPRequest(url, headers=sent))

    def open(self, window: Browser) -> None:
        """Type the code into a browser's window."""
        window.visit(self.address)
        window.find("input[name=word]").send_keys(f"{self.code}\n")
        window.wait("return document.querySelector('#pill') !== null")
        window.complaints()  # of the code's page, which is a refusal


@contextmanager
def studio(
    *words: str | Path,
    folder: Path | None = None,
    stderr: IO[str] | None = None,
    program: Sequence[str | Path] = (PROGRAM,),
    browser: Path | None = None,
) -> Iterator[Studio]:
    """Start the studio, and end it as Ctrl-C does; `stderr` takes its stderr."""
    command = [*program, "studio", "--json", *([] if browser else ["--no-browser"]), *words]
    told_of = {**os.environ, "BROWSER": f"{browser} %s"}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=stderr, text=True, cwd=folder, env=told_of
    ) as process:
        try:
            assert process.stdout is not None
            document = "".join(iter(process.stdout.readline, "}\n")) + "}"
            yield Studio(**json.loads(document), pid=process.pid)
        finally:
            process.terminate()
    assert process.returncode == 0


def status(url: str, **headers: str) -> int:
    """Ask for a page, and give the status of the answer."""
    try:
        with urlopen(Request(url, headers=headers)) as answer:
            return int(answer.status)
    except HTTPError as error:
        return error.code


def conversation(running: Studio, *sayings: Any, until: str) -> dict[str, Any]:
    """Say things to the studio, and give its parts until one of a name comes."""

    async def talk() -> dict[str, Any]:
        socket_ = await running.connect()
        for saying in sayings:
            binary = isinstance(saying, bytes)
            text = saying if isinstance(saying, str | bytes) else json.dumps(saying)
            await socket_.write_message(text, binary=binary)
        heard: dict[str, Any] = {}
        while until not in heard:
            text = await asyncio.wait_for(socket_.read_message(), HANG)
            assert text is not None, f"closed after {list(heard)}"
            part = json.loads(text)
            heard[part["part"]] = part
        await closed(socket_)
        return heard

    return asyncio.run(talk())


async def closed(socket_: WebSocketClientConnection) -> None:
    """Wait until the other end has closed, too."""
    socket_.close()
    while await socket_.read_message() is not None:
        pass


def workers_of(server: int) -> list[int]:
    """List the processes that a studio started, those that have ended left out."""
    found: list[int] = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
            command = (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if int(parent) == server and state != "Z" and b"spawn_main" in command:
            found.append(int(entry.name))
    return found


def look_at(page: Browser, view: str) -> None:
    """Go to a view by its link, as a reader does."""
    page.find(f"#places a[data-view={view}]").click()
    page.wait(f"return document.body.dataset.show === '{view}'")


def state(page: Browser) -> list[str]:
    """Give the command line that the page shows, and its address."""
    shown: list[str] = page.run("return [document.querySelector('#command').textContent, location.hash]")
    return shown
