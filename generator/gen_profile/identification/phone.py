"""A phone that lies on the hook: phyphox's gyroscope, read by its remote access while it measures.

phyphox.org/wiki, Remote-interface communication: ``/config`` names the buffers of each sensor, ``/get`` gives
their values, those after a time alone where it is asked to, and ``/control`` begins and ends a measurement.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from http.client import HTTPException
from typing import Any
from urllib.parse import urlsplit
from urllib.request import ProxyHandler, build_opener

import numpy as np

from gen_profile.errors import OutputError, SpecError
from gen_profile.motion.profile import Array
from gen_profile.strict_json import parse_json

TIMEOUT, LOST_FOR, RETRY = 3.0, 15.0, 0.5  # s of an answer, of a lost network, and between two trials then
MOST_BYTES = 1 << 25
AXES = "xyz"


class Phone:
    """The gyroscope of a phone.

    Parameters
    ----------
    url : str
        As phyphox shows it where remote access is allowed, ``http://192.168.0.42:8080``.
    pause : callable
        Lets s pass.

    Raises
    ------
    SpecError
        This is no such address.
    OutputError
        It does not answer as phyphox does, or measures no rates.
    """

    columns = ("Rate (rad/s)", *(f"Gyroscope {axis} (rad/s)" for axis in AXES))

    def __init__(self, url: str, pause: Callable[[float], None] = time.sleep) -> None:
        parts = urlsplit(url)
        if parts.scheme != "http" or not parts.hostname or parts.query:
            raise SpecError(f"{url}: is no address such as http://192.168.0.42:8080.")
        self._url, self._pause = url.rstrip("/"), pause
        self._open = build_opener(ProxyHandler({})).open
        config = self._ask("config", 0.0)
        gyroscopes = [
            {name: buffer for output in one.get("outputs", ()) for name, buffer in output.items()}
            for one in config.get("inputs", ())
            if one.get("source") == "gyroscope"
        ]
        if not gyroscopes or not gyroscopes[0].keys() >= {*AXES, "t"}:
            raise OutputError(
                f"The experiment {config.get('title', '')!r} on the phone measures no rates about three "
                "axes: open phyphox's experiment Gyroscope there."
            )
        self._buffers = [gyroscopes[0][name] for name in ("t", *AXES)]
        self._session, self._began, self._last = "", False, -1.0

    def begin(self) -> None:
        """Have the phone measure, if it does not yet; what it measured before does not count."""
        status = self._status("&".join(self._buffers))
        self._session = str(status[1].get("session"))
        earlier = status[0][self._buffers[0]]
        self._last = max((value for value in earlier if value is not None), default=-1.0)
        if not status[1].get("measuring"):
            self._began = self._ask("control?cmd=start", 0.0).get("result") is True
            if not self._began:
                raise OutputError("The phone does not begin to measure; press play in phyphox.")

    def rows(self) -> Array:
        """Give what it measured since the last time: times in s and rates in rad/s about x, y and z."""
        clock, *rates = self._buffers
        since = f"{self._last!r}"
        values, status = self._status(
            "&".join([f"{clock}={since}", *(f"{one}={since}|{clock}" for one in rates)])
        )
        if str(status.get("session")) != self._session:
            raise OutputError("Another experiment was opened on the phone meanwhile; log again.")
        columns = [values[name] for name in self._buffers]
        count = min(map(len, columns))
        table = np.array([column[:count] for column in columns], dtype=np.float64).T.reshape(-1, 4)
        table = table[np.isfinite(table).all(axis=1) & (table[:, 0] > self._last)]
        if len(table):
            self._last = float(table[-1, 0])
        return table

    def end(self) -> None:
        """Have it measure no longer, if it did not before."""
        if self._began:
            self._ask("control?cmd=stop", 0.0)

    def shown(self, table: Array) -> Array:
        """Put the rate about the axis about which the phone swings before those about its own, in rad/s."""
        swing = table[:, 1:] - table[:, 1:].mean(axis=0)
        axis = np.linalg.eigh(swing.T @ swing)[1][:, -1]
        axis = axis * np.sign(axis[np.argmax(np.abs(axis))])
        return np.column_stack([table[:, 0] - table[0, 0], table[:, 1:] @ axis, table[:, 1:]])

    def _status(self, query: str) -> tuple[dict[str, list[float | None]], dict[str, Any]]:
        answer = self._ask(f"get?{query}", LOST_FOR)
        try:
            buffers = {name: list(answer["buffer"][name]["buffer"]) for name in self._buffers}
            return buffers, dict(answer["status"])
        except (KeyError, TypeError, ValueError) as error:
            raise self._strange() from error

    def _ask(self, path: str, patience: float) -> dict[str, Any]:
        """Ask for a document, again and again for some s where the network is lost."""
        began = time.monotonic()
        while True:
            try:
                with self._open(f"{self._url}/{path}", timeout=TIMEOUT) as reply:
                    answer = parse_json(reply.read(MOST_BYTES))
            except ValueError as error:
                raise self._strange() from error
            except (OSError, HTTPException) as error:
                if time.monotonic() - began >= patience:
                    reason = getattr(error, "reason", error)
                    raise OutputError(
                        f"{self._url} does not answer ({reason}): allow remote access in phyphox, compare "
                        "the address that it shows, keep the phone's screen on, and both in one network."
                    ) from error
                self._pause(RETRY)
                continue
            if not isinstance(answer, dict):
                raise self._strange()
            return answer

    def _strange(self) -> OutputError:
        return OutputError(f"{self._url} answers, but not as phyphox does; look at the address and the port.")
