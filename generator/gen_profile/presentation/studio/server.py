"""The studio's page and what it says, on this machine alone, to browsers that were let in."""

from __future__ import annotations

import asyncio
import json
import math
import secrets
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import tornado.netutil
import tornado.web
import tornado.websocket

from gen_profile.presentation.studio import manual
from gen_profile.presentation.studio.entrance import (
    PATIENCE,
    BoundedServer,
    Entering,
    Entrance,
    Guarded,
    started_browser,
)
from gen_profile.presentation.studio.orders import DriveQuestion, LogQuestion, Order, Question
from gen_profile.presentation.studio.session import Session
from gen_profile.presentation.studio.state import StudioState, WrittenSpec, opened_start, preset_start
from gen_profile.presentation.studio.workers import Message, Part, Workers, failure
from gen_profile.spec.reading import presets
from gen_profile.support.artefacts.manifest import sha256
from gen_profile.support.artefacts.reading import read_artefact
from gen_profile.support.errors import GenProfileError, OutputError, SpecError
from gen_profile.support.phrase import plain
from gen_profile.support.strict_json import parse_json
from gen_profile_exporters.registry import find_exporter, formats

if TYPE_CHECKING:
    from gen_profile.presentation.studio.watching import Watching

LOOPBACK = "127.0.0.1"
MOST_MESSAGE = 65_536  # bytes of what a page may say at once
MOST_UPLOAD = 16_777_216  # bytes of a file that is dropped on a page, its name included
MOST_FILES = 4  # of a page, that can be downloaded
MOST_NAME = 100  # characters of such a file's name
MOST_OPENED = 32  # specs that were dropped
CONTENT_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
}
OWN = resources.files("gen_profile.presentation.studio") / "assets"
ASSETS = {
    **{file.name: file for file in OWN.iterdir() if Path(file.name).suffix in CONTENT_TYPES},
    "uPlot.js": OWN / "uPlot" / "uPlot.iife.min.js",
    "uPlot.css": OWN / "uPlot" / "uPlot.min.css",
    "animation.js": resources.files("gen_profile.presentation.report") / "assets" / "animation.js",
}


@attrs.define
class Studio:
    """What all pages share.

    Attributes
    ----------
    start : WrittenSpec
        What the command named.
    workers : Workers
    agreed : dict of Path to str
        Programs that the user lets run, with their SHA-256 when he said so.
    opened : dict of str to WrittenSpec
        Specs that were dropped on a page, by the name that its state holds.
    first : Session or None
        Where the first page's question is answered before that page is there.
    watching : Watching or None
        A controller that is watched meanwhile.
    """

    start: WrittenSpec
    workers: Workers
    agreed: dict[Path, str] = attrs.field(factory=dict)
    opened: dict[str, WrittenSpec] = attrs.field(factory=dict)
    first: Session | None = None
    watching: Watching | None = None

    def question(self, state: StudioState) -> Question:
        """Say what a page asks for.

        Raises
        ------
        SpecError
            There is no such preset, and no spec of that name was opened.
        """
        known = self.opened.get(state.preset, self.start if not state.preset else None)
        return Question(start=known or preset_start(state.preset), state=state)

    def open(self, name: str, content: bytes) -> str:
        """Take a spec that was dropped on a page, and say how a page's state calls it.

        Raises
        ------
        SpecError
            It is no spec that can be read.
        """
        opened = opened_start(name, content, self.start.folder)
        key = f"{name} ({sha256(content)[:6]})"
        self.opened[key] = opened
        while len(self.opened) > MOST_OPENED:
            del self.opened[next(iter(self.opened))]
        return key

    def permitted(self, question: Question) -> Question | None:
        """Take a question whose programs the user lets run, as they are; None if he is to be asked.

        No file is touched that he was not asked of: its name alone may lead to another computer.

        Raises
        ------
        OutputError
            A program cannot be read.
        """
        programs = question.start.programs
        if not all(path in self.agreed for path in programs.values()):
            return None
        digests = {key: _digest(path) for key, path in programs.items()}
        known = all(self.agreed[path] == digests[key] for key, path in programs.items())
        return attrs.evolve(question, agreed=digests) if known else None

    def agree(self, programs: Iterable[Path]) -> None:
        """Let programs run as they are now.

        Raises
        ------
        OutputError
            One cannot be read.
        """
        self.agreed |= {path: _digest(path) for path in programs}


def _digest(path: Path) -> str:
    if path.exists() and not path.is_file():
        raise OutputError(f"Cannot read {path}: it is no file.")
    return sha256(read_artefact(path))


class Asset(Guarded):
    """A file of the page."""

    def get(self, name: str = "studio.html") -> None:
        """Send it."""
        if name not in ASSETS:
            raise tornado.web.HTTPError(404)
        self.set_header("Content-Type", CONTENT_TYPES[Path(name).suffix])
        self.finish(ASSETS[name].read_bytes())


class ManualPage(Guarded):
    """A page of the manual, or a picture on one."""

    def get(self, name: str, picture: str | None) -> None:
        """Send it."""
        content = manual.picture(name) if picture else manual.page(name)
        if content is None:
            raise tornado.web.HTTPError(404)
        self.set_header("Content-Type", "image/png" if picture else CONTENT_TYPES[".html"])
        self.finish(content)


class FrontPage(Entering, Asset):
    """The page itself."""


class Download(Guarded):
    """A file that a page had made."""

    def get(self, name: str) -> None:
        """Send it under its name."""
        made = self.settings["made"]
        if name not in made:
            raise tornado.web.HTTPError(404)
        filename, content = made[name]
        self.set_header("Content-Type", "application/octet-stream")
        self.set_header("Content-Disposition", f'attachment; filename="{filename}"')
        self.finish(content)


class Conversation(Guarded, tornado.websocket.WebSocketHandler):
    """What one page asks and gets; every page has its own, so they do not disturb each other."""

    def check_origin(self, origin: str) -> bool:
        """Let only the page itself talk."""
        return origin == f"http://{self.host}"

    def open(self, *_: str, **__: str) -> None:
        """Greet a page."""
        self.set_nodelay(True)
        self._studio: Studio = self.settings["studio"]
        self._serial, self._made = 0, list[str]()
        self._pending: tuple[StudioState, list[Path]] | None = None
        self._dropped: tuple[str, bytes] | None = None
        session, self._studio.first = self._studio.first, None
        self._session = session or Session(self._studio.workers, asyncio.get_running_loop())
        self._tell(
            {
                "part": "hello",
                "presets": presets(),
                "opened": list(self._studio.opened),
                "most_upload": MOST_UPLOAD - MOST_MESSAGE,
                "start": " ".join(self._studio.start.words),
                "watching": self._studio.watching is not None,
                "formats": {name: form.summary for name, form in formats().items()},
            }
        )
        self._session.attach(self._pass_on)

    def on_message(self, message: str | bytes) -> None:
        """Take what the page asks for; whatever it says wrong is answered in a sentence."""
        head, _, content = message.partition(b"\n") if isinstance(message, bytes) else (message, b"", b"")
        if len(head) > MOST_MESSAGE:
            self.close(code=1009)
            return
        try:
            said = parse_json(head)
            act: dict[str, Callable[[dict[str, Any]], None]] = {
                "open": self._begin,
                "show": self._show,
                "agree": self._agree,
                "make": self._make,
                "stop": lambda _: self._session.stop("files"),
                "drop": lambda said: self._drop(said, content),
                "read": self._read,
                "forget": lambda _: self._forget(),
                "drive": self._drive,
                "park": lambda _: self._session.stop("drive"),
                "watch": lambda _: self._watch(),
            }
            act[said["say"]](said)
        except GenProfileError as error:
            answer = "faulty" if isinstance(error, SpecError) else "unanswered"
            self._tell(failure(answer, str(error).splitlines()))
        except (ValueError, KeyError, TypeError, AttributeError):
            self._tell(failure("unanswered", ["The page sent a message that is not understood."]))

    def on_close(self) -> None:
        """Let go of the page's workers and files."""
        self._session.close()
        for name in self._made:
            self.settings["made"].pop(name, None)

    def _begin(self, said: dict[str, Any]) -> None:
        """Show the state that an address holds."""
        try:
            state = StudioState.from_address(said["address"]) if said["address"] else StudioState()
            self._studio.question(state)
        except SpecError as error:
            state = StudioState()
            self._tell({"part": "notice", "sentence": str(error)})
        self._tell({"part": "state", "preset": state.preset, "edits": dict(state.edits)})
        self._ask(state)

    def _show(self, said: dict[str, Any]) -> None:
        self._serial = int(said["serial"])
        self._ask(StudioState.from_json(said["state"]))

    def _ask(self, state: StudioState) -> None:
        """Ask for a picture, once the user lets run what the spec wants to run."""
        question = self._permitted(state)
        if question is not None:
            self._session.show(self._serial, question)

    def _permitted(self, state: StudioState) -> Question | None:
        """Say what is asked for, or ask the user first whether he lets its programs run."""
        question = self._studio.question(state)
        permitted = self._studio.permitted(question)
        if permitted is None:
            programs = [*question.start.programs.values()]
            self._pending = (state, programs)
            changed = all(path in self._studio.agreed for path in programs)
            self._tell({"part": "consent", "files": [*map(str, programs)], "changed": changed})
        return permitted

    def _agree(self, said: dict[str, Any]) -> None:
        """Let run what the page showed, and nothing that took its place meanwhile."""
        if self._pending is not None and said["files"] == [*map(str, self._pending[1])]:
            state, programs = self._pending
            self._pending = None
            self._studio.agree(programs)
            self._ask(state)

    def _make(self, said: dict[str, Any]) -> None:
        question = self._permitted(StudioState.from_json(said["state"]))
        names = tuple(str(name) for name in said["formats"][: len(formats())])
        for name in names:
            find_exporter(name)
        if question is not None:
            order = Order(question=question, formats=names or ("csv",), report=bool(said["report"]))
            self._session.ask("files", int(said["number"]), order)

    def _drop(self, said: dict[str, Any], content: bytes) -> None:
        """Take a file that was dropped on the page: a spec to start with, or a log."""
        name = str(said["name"])[:MOST_NAME]
        if not name.isprintable():
            raise ValueError(name)
        if not name.lower().endswith(".toml"):
            self._dropped = (name, content)
            return
        try:
            self._tell({"part": "opened", "preset": self._studio.open(name, content)})
        except SpecError as error:
            self._tell({"part": "notice", "sentence": str(error)})

    def _read(self, said: dict[str, Any]) -> None:
        """Ask what the log tells, once its spec may run what it wants to run."""
        question = self._permitted(StudioState.from_json(said["state"]))
        if self._dropped is None or question is None:
            return
        name, content = self._dropped
        columns, after, at = said["columns"], float(said["after"]), tuple(map(float, said["at"]))
        if not all(map(math.isfinite, (after, *at))):
            raise ValueError(after, at)
        asked = LogQuestion(
            question=question,
            name=name,
            content=content,
            use=str(said["use"]),
            columns=None if columns is None else str(columns),
            after=after,
            at=at,
            free=tuple(map(str, said["free"])),
        )
        self._session.ask("log", int(said["number"]), asked)

    def _drive(self, said: dict[str, Any]) -> None:
        """Let a planner block go on for a moment, once its spec may run what it wants to run."""
        question = self._permitted(StudioState.from_json(said["state"]))
        if question is None:
            return
        asked = DriveQuestion(
            question=question,
            drive=int(said["drive"]),
            command=str(said["command"]),
            values=tuple(map(float, said["values"])),
            live={str(name): float(value) for name, value in said["live"].items()},
            sensor={str(name): float(value) for name, value in said["sensor"].items()},
            wind=tuple(map(float, said["wind"])),
        )
        self._session.ask("drive", int(said["number"]), asked)

    def _watch(self) -> None:
        """Tell how the controller stands that is watched."""
        if self._studio.watching is not None:
            self._tell(plain(self._studio.watching.part()))

    def _forget(self) -> None:
        """Read no log any more."""
        self._dropped = None
        self._session.stop("log")

    def _tell(self, part: Part) -> None:
        self._write(json.dumps({**part, "serial": self._serial}))

    def _pass_on(self, message: Message) -> None:
        """Hand on what a worker tells; a file stays here until it is fetched."""
        if message.file is None:
            self._write(message.text)
        else:
            self._write(json.dumps({**json.loads(message.text), "file": self._keep(*message.file)}))

    def _write(self, text: str) -> None:
        if self.ws_connection is not None:
            self.write_message(text)

    def _keep(self, name: str, content: bytes) -> Part:
        key, made = secrets.token_urlsafe(8), self.settings["made"]
        made[key] = (name, content)
        self._made.append(key)
        for old in self._made[:-MOST_FILES]:
            made.pop(old, None)
        return {"name": name, "bytes": len(content), "link": f"made/{key}"}


async def serve(
    start: WrittenSpec,
    port: int,
    *,
    browser: bool,
    ready: Callable[[str, str], None],
    renew: Callable[[str], None],
    watching: Watching | None = None,
) -> None:
    """Serve pages until interrupted.

    Parameters
    ----------
    start : WrittenSpec
    port : int
        0 for any that is free.
    browser : bool
        Whether the user's browser is started.
    ready : (str, str) → None
        Takes the address, and the code for another browser.
    renew : str → None
        Takes another code when one was used.
    watching : Watching, optional
        A controller that is watched meanwhile.

    Raises
    ------
    OutputError
        The port is taken.
    """
    with ExitStack() as stack:
        workers = Workers()
        stack.callback(workers.close)
        studio = Studio(start=start, workers=workers, watching=watching)
        if not start.programs:  # the first picture is on its way before the browser is
            studio.first = Session(workers, asyncio.get_running_loop())
            studio.first.show(0, studio.question(StudioState()))
        try:
            sockets = tornado.netutil.bind_sockets(port, LOOPBACK)
        except OSError as error:
            raise OutputError(
                f"port {port}: {error.strerror}; leave it out to take one that is free."
            ) from error
        entrance = Entrance(host=f"{LOOPBACK}:{sockets[0].getsockname()[1]}", renew=renew)
        _server(studio, entrance).add_sockets(sockets)
        ready(f"http://{entrance.host}/", entrance.code)
        if browser:
            with suppress(OSError):  # without a file there is still the code
                stack.enter_context(started_browser(entrance))
        await asyncio.Event().wait()


def _server(studio: Studio, entrance: Entrance) -> BoundedServer:
    application = tornado.web.Application(
        [
            ("/", FrontPage),
            ("/live", Conversation),
            (r"/made/(?P<name>[\w-]+)", Download),
            (r"/help/(?P<name>[\w-]+)(?P<picture>\.png)?", ManualPage),
            (r"/(?P<name>.*)", Asset),
        ],
        websocket_max_message_size=MOST_UPLOAD,
        log_function=lambda _: None,
        studio=studio,
        entrance=entrance,
        made={},
    )
    server = BoundedServer(
        application,
        max_body_size=MOST_MESSAGE,
        max_header_size=MOST_MESSAGE,
        idle_connection_timeout=PATIENCE,
        body_timeout=PATIENCE,
    )
    application.settings["trust"] = server.trust
    return server
