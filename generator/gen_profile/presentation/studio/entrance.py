"""Who may talk to the studio: browsers that hold its cookie.

A browser gets the cookie for a word that works once: the key in a file that only the user can read, through
which his browser is started, or the code that the terminal shows, typed by hand. No address holds either, for
command lines, histories and messages show addresses to others.
"""

import asyncio
import base64
import hashlib
import json
import os
import re
import secrets
import time
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from importlib import resources
from pathlib import Path
from tempfile import gettempdir
from threading import Thread
from typing import Any, cast

import attrs
from tornado.http1connection import HTTP1Connection
from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream
from tornado.web import HTTPError, RequestHandler

from gen_profile.support.private_folder import temporary_folder

KEY_LASTS = 120.0  # s in which the user's browser must have started
LETTERS = "abcdefghjkmnpqrstuvwxyz23456789"  # none that look alike
CODE_LENGTH = 8  # letters: 40 bits
PAUSE = 1.0  # s before a code is looked at: with MOST_STRANGERS at once, guessing takes centuries
MOST_STRANGERS = 64  # connections that have not shown the cookie
PATIENCE = 10.0  # s for a request to be sent
NOTHING = "default-src 'none'; frame-ancestors 'none'; base-uri 'none'"  # of a page's policy
# for what a file asks for: redirected, it would still be the file that asks, and no cookie would be sent
GO_ON = (
    '<!doctype html><title>gen-profile studio</title><link rel="icon" href="data:,">'
    '<meta http-equiv="refresh" content="0;url=/">'
)


def _code() -> str:
    return "".join(secrets.choice(LETTERS) for _ in range(CODE_LENGTH))


@attrs.define
class Entrance:
    """The cookie, and the words that it is given for.

    Attributes
    ----------
    host : str
        The server's address and port.
    renew : str → None
        Takes another code when one was used.
    code : str
        For a browser that the studio did not start.
    key : str
        For the one that it starts.
    until : float
        Time of `time.monotonic` at which the key ends.
    """

    host: str
    renew: Callable[[str], None]
    cookie: str = attrs.field(factory=lambda: secrets.token_urlsafe(32), repr=False)
    code: str = attrs.field(factory=_code, repr=False)
    key: str = attrs.field(factory=lambda: secrets.token_urlsafe(32), repr=False)
    until: float = attrs.field(factory=lambda: time.monotonic() + KEY_LASTS)

    @property
    def name(self) -> str:
        """Name of the cookie; browsers send cookies to all ports of a host."""
        return f"gen-profile-studio-{self.host.rpartition(':')[2]}"

    def knows(self, cookie: str | None) -> bool:
        """Whether this is the cookie."""
        return secrets.compare_digest((cookie or "").encode(), self.cookie.encode())

    def takes_key(self, word: str) -> bool:
        """Whether this is the key; it is taken once."""
        taken = time.monotonic() < self.until and secrets.compare_digest(word.encode(), self.key.encode())
        self.until = 0.0 if taken else self.until
        return taken

    def takes_code(self, word: str) -> bool:
        """Whether this is the code, however it is written; it is taken once."""
        typed = re.sub(r"[\s-]", "", word).lower()
        taken = secrets.compare_digest(typed.encode(), self.code.encode())
        if taken:
            self.code = _code()
            self.renew(self.code)
        return taken


@contextmanager
def started_browser(entrance: Entrance) -> Iterator[None]:
    """Start the user's browser with the key in a file that only he can read.

    Raises
    ------
    OSError
        There can be no such file.
    """
    with temporary_folder(Path(gettempdir()), "gen-profile-studio-") as folder:
        page = folder / "open.html"
        with os.fdopen(
            os.open(page, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8"
        ) as file:
            file.write(_asset("open.html").replace("HOST", entrance.host).replace("KEY", entrance.key))
        # in a thread, for browsers in a terminal keep their caller waiting
        Thread(target=webbrowser.open, args=[page.as_uri()], daemon=True).start()
        yield


class BoundedServer(HTTPServer):
    """Keeps few connections that have not shown the cookie: another one takes the place of the oldest."""

    def initialize(self, *arguments: Any, **options: Any) -> None:
        """Begin with none."""
        super().initialize(*arguments, **options)
        self._strangers = dict[IOStream, None]()

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        """Take a connection."""
        self._strangers = {one: None for one in self._strangers if not one.closed()}
        if len(self._strangers) >= MOST_STRANGERS:
            oldest = next(iter(self._strangers))
            del self._strangers[oldest]
            oldest.close()
        self._strangers[stream] = None
        super().handle_stream(stream, address)

    def trust(self, stream: IOStream) -> None:
        """Keep a connection that has shown the cookie."""
        self._strangers.pop(stream, None)


class Guarded(RequestHandler):
    """Answers only who holds the cookie, and calls this machine by its number."""

    origins: tuple[str, ...] = ()  # of requests that are taken beside the page's own

    @property
    def entrance(self) -> Entrance:
        """Who may come in."""
        return cast("Entrance", self.settings["entrance"])

    @property
    def host(self) -> str:
        """Under which this server is known."""
        return self.entrance.host

    def prepare(self) -> None:
        """Refuse strangers."""
        own = f"http://{self.host}"
        if self.request.host != self.host:  # a page elsewhere could have its name mean this machine: CWE-350
            raise HTTPError(404)
        if self.request.headers.get("Origin", own) not in (own, *self.origins):
            raise HTTPError(404)
        near = self.request.headers.get("Sec-Fetch-Site", "none") in ("none", "same-origin")
        if not near or not self.entrance.knows(self.get_cookie(self.entrance.name)):
            self.meet_stranger()
        else:
            self.settings["trust"](_stream(self))

    def meet_stranger(self) -> None:
        """Answer who does not hold the cookie, or follows a link from elsewhere."""
        raise HTTPError(404)

    def set_default_headers(self) -> None:
        """Let nothing but the page's own scripts run, and nothing be kept, framed or sent to others."""
        self.set_header(
            "Content-Security-Policy",
            f"{NOTHING}; script-src 'self'; style-src 'self'; img-src 'self' data:; "
            f"connect-src 'self' ws://{self.host}; form-action 'none'",
        )
        self.set_header("Cache-Control", "no-store")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.clear_header("Server")

    def write_error(self, status_code: int, **_: Any) -> None:
        """Say nothing to strangers."""
        self.finish(f"{status_code}")

    def ask_for_code(self, *, wrong: bool = False) -> None:
        """Show the page on which a code is typed; it loads nothing, for strangers get nothing else."""
        style, texts = _asset("studio.css"), json.loads(_asset("words.json"))["texts"]
        digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
        policy = f"{NOTHING}; style-src 'sha256-{digest}'; img-src data:; form-action 'self'"
        self.set_header("Content-Security-Policy", policy)
        self.set_header("Referrer-Policy", "same-origin")  # without it, the answer's origin would be null
        german = self.request.headers.get("Accept-Language", "").lower().startswith("de")
        fields = {key: escape(both[german]) for key, both in texts.items() if key.startswith("code.")}
        fields |= {"lang": "de" if german else "en", "hidden": "" if wrong else "hidden"}
        page = re.sub(r"{([\w.]+)}", lambda match: fields[match[1]], _asset("code.html"))
        self.set_status(403)
        self.finish(page.replace("STYLE", style))


class Entering(Guarded):
    """A page whose visitors show the cookie, or are asked for a word."""

    origins = ("null",)  # the file through which the browser is started

    def meet_stranger(self) -> None:
        """Ask for the code, unless a word is given."""
        if self.request.method != "POST":
            self.ask_for_code()

    async def post(self) -> None:
        """Let a browser in once for a word."""
        word, stream = self.get_body_argument("word", ""), _stream(self)
        taken = self.entrance.takes_key(word)
        if not taken:
            await asyncio.sleep(PAUSE)
            if stream.closed():
                return
            taken = self.entrance.takes_code(word)
        if taken:
            self.set_cookie(self.entrance.name, self.entrance.cookie, httponly=True, samesite="Strict")
        else:
            self.set_status(403)
        if self.request.headers.get("Origin") == "null":
            self.finish(GO_ON)
        elif taken:
            self.redirect("/", status=303)
        else:
            self.ask_for_code(wrong=True)


def _stream(handler: RequestHandler) -> IOStream:
    return cast("HTTP1Connection", handler.request.connection).stream


def _asset(name: str) -> str:
    return (resources.files("gen_profile.presentation.studio") / "assets" / name).read_text("utf-8")
