"""A running stream as curves on a page in the browser: on this machine only, for who knows the address."""

from __future__ import annotations

import json
import secrets
import sys
import time
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from threading import Thread
from typing import Any

import numpy as np

from gen_profile.delivery.streaming.live import OVER, Glance, View

LOOPBACK = "127.0.0.1"
MOST_POINTS = 500  # of a curve
FAREWELL = 0.5  # s, for the page to see the end
POLL = 0.02  # s, within which the server notices that it is to end
FILES = {
    "": ("live.html", "text/html; charset=utf-8"),
    "live.js": ("live.js", "text/javascript; charset=utf-8"),
}
POLICY = "default-src 'self'; img-src data:; style-src 'unsafe-inline'; frame-ancestors 'none'"
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}


def show(view: View, look: Callable[[], Glance], over: Callable[[], bool]) -> None:
    """Serve the page until the stream is over, and say where it is."""
    with Server(view, look) as server:
        sys.stderr.write(f"Watch at {server.address}\n")
        sys.stderr.flush()
        while not over():
            pass
        time.sleep(FAREWELL)


class Server(ThreadingHTTPServer):
    """Answers on the loopback interface, under a path that cannot be guessed."""

    daemon_threads = True

    def __init__(self, view: View, look: Callable[[], Glance]) -> None:
        super().__init__((LOOPBACK, 0), _Request)
        self.host = f"{LOOPBACK}:{self.server_port}"
        self.path = f"/{secrets.token_urlsafe(16)}/"
        self.state: Callable[[], dict[str, Any]] = lambda: _state(view, look())

    @property
    def address(self) -> str:
        """Of the page."""
        return f"http://{self.host}{self.path}"

    def __enter__(self) -> Server:
        Thread(target=self.serve_forever, args=(POLL,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self.server_close()

    def handle_error(self, *_: object) -> None:
        """Keep silent of browsers that hang up."""


class _Request(BaseHTTPRequestHandler):
    server: Server

    def do_GET(self) -> None:
        # another name of this host would be that of a page elsewhere which wants to read this one
        known = self.headers.get("Host") == self.server.host and self.path.startswith(self.server.path)
        name = self.path.removeprefix(self.server.path)
        if known and name == "state":
            self._answer(json.dumps(self.server.state()).encode(), "application/json")
        elif known and name in FILES:
            file, kind = FILES[name]
            self._answer((resources.files(__package__) / "assets" / file).read_bytes(), kind)
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _answer(self, content: bytes, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        for name, value in {**HEADERS, "Content-Type": kind, "Content-Length": str(len(content))}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Say nothing of requests."""


def _state(view: View, glance: Glance) -> dict[str, Any]:
    step = -(-len(view.planned) // MOST_POINTS)
    return {
        "name": view.name,
        "phase": glance.phase.value,
        "over": glance.phase in OVER,
        "time": max(0, glance.cycle - 1) * view.period,
        "duration": (len(view.planned) - 1) * view.period,
        "late_us": glance.late,
        "axes": [
            {
                "name": axis,
                "unit": unit,
                "apart": float(glance.apart[column]),
                "planned": view.planned[::step, column].tolist(),
                "actual": [None if np.isnan(at) else at for at in glance.actual[::step, column].tolist()],
            }
            for column, (axis, unit) in enumerate(zip(view.axes, view.units, strict=True))
        ],
    }
