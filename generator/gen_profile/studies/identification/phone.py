"""A phone that lies on the hook: phyphox's gyroscope, read by its remote access while it measures.

phyphox.org/wiki, Remote-interface communication: ``/config`` names the buffers of each sensor, ``/get`` gives
their values, those after a time alone where it is asked to, and ``/control`` begins and ends a measurement.
"""

import time
from collections.abc import Iterator
from contextlib import closing, suppress
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from socket import SHUT_RDWR
from threading import Timer
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.support.errors import OutputError, SpecError
from gen_profile.support.strict_json import parse_json

TIMEOUT, WHOLE = 3.0, 30.0  # s without a byte of an answer, and of all of it
LOST_FOR, PAUSE = 15.0, 0.3  # s of a lost network, and between two questions
GREATEST = np.array([1e9, 1e3, 1e3, 1e3])  # s and rad/s that a phone may tell of; none turns so fast
MOST_BYTES = 1 << 25
COLUMNS = ("Rate (rad/s)", *(f"Gyroscope {axis} (rad/s)" for axis in "xyz"))


class Phone:
    """The gyroscope of a phone.

    Parameters
    ----------
    url : str
        As phyphox shows it where remote access is allowed, ``http://192.168.0.42:8080``.

    Raises
    ------
    SpecError
        This is no such address.
    OutputError
        It does not answer as phyphox does, or measures no rates.
    """

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        if parts.scheme != "http" or not parts.hostname or parts.query:
            raise SpecError(
                f"{url}: is no address such as http://192.168.0.42:8080 of a phone, opc.tcp://10.0.0.5:4840 "
                "or can:socketcan:can0."
            )
        self._url, self._at, self._path = url.rstrip("/"), parts.netloc, parts.path.rstrip("/")
        config = self._ask("config")
        try:
            sensors = {one["source"]: one.get("outputs", ()) for one in config["inputs"]}
            buffers = {name: str(one[name]) for one in sensors.get("gyroscope", ()) for name in one}
        except (KeyError, TypeError, AttributeError) as error:
            raise self._strange() from error
        if not buffers.keys() >= set("txyz"):
            raise OutputError(
                f"The experiment {config.get('title', '')!r} on the phone measures no rates about three "
                "axes: open phyphox's experiment Gyroscope there."
            )
        self._buffers = [buffers[name] for name in "txyz"]

    def tables(self) -> Iterator[Array]:
        """Give times in s and rates in rad/s about x, y and z, shape (samples, 4), over and over.

        A phone that does not measure yet begins to, and ends afterwards.

        Raises
        ------
        OutputError
            It does not answer, or has nothing new, for `LOST_FOR`, or shows another experiment.
        """
        clock, *rates = self._buffers
        status, table = self._get("&".join(self._buffers))
        session, last = status.get("session"), float(np.nanmax(table[:, 0], initial=-1.0))
        began = not status.get("measuring")
        if began and self._ask("control?cmd=start").get("result") is not True:
            raise OutputError("The phone does not begin to measure; press play in phyphox.")
        news = time.monotonic()
        try:
            while time.monotonic() - news < LOST_FOR:
                since = "&".join(f"{one}={last!r}|{clock}" for one in rates)
                status, table = self._get(f"{clock}={last!r}&{since}")
                if status.get("session") != session:
                    raise OutputError("Another experiment was opened on the phone meanwhile.")
                table = table[np.isfinite(table).all(axis=1) & (table[:, 0] > last)]
                last = float(table[:, 0].max(initial=last))
                yield table
                news = time.monotonic() if len(table) else news
                time.sleep(PAUSE)
            raise OutputError(f"The phone has sent no new rates for {LOST_FOR:g} s; press play in phyphox.")
        finally:
            if began:
                with suppress(OutputError):
                    self._ask("control?cmd=stop")

    def _get(self, query: str) -> tuple[dict[str, Any], Array]:
        answer = self._ask(f"get?{query}", LOST_FOR)
        try:
            columns = [answer["buffer"][name]["buffer"] for name in self._buffers]
            rows = list(zip(*columns, strict=False))
            table = np.array(rows, dtype=np.float64).reshape(-1, 4)
            if (np.abs(table) > GREATEST).any():
                raise ValueError("no time and rates of a phone")
            return dict(answer["status"]), table
        except (KeyError, TypeError, ValueError) as error:
            raise self._strange() from error

    def _ask(self, path: str, patience: float = 0.0) -> dict[str, Any]:
        """Ask for a document, again and again for some s where the network is lost."""
        until = time.monotonic() + patience
        while True:
            try:
                return dict(parse_json(self._answer(path)))
            except (ValueError, TypeError) as error:
                raise self._strange() from error
            except (OSError, HTTPException) as error:
                if time.monotonic() >= until:
                    raise OutputError(
                        f"{self._url} does not answer ({getattr(error, 'reason', error)}): allow remote "
                        "access in phyphox, compare the address that it shows, keep the phone's screen on, "
                        "and both in one network."
                    ) from error
                time.sleep(PAUSE)

    def _answer(self, path: str) -> bytes:
        """Ask once, of this very address: nothing is asked of another that it may name."""
        with closing(HTTPConnection(self._at, timeout=TIMEOUT)) as connection:
            connection.connect()
            late = Timer(WHOLE, connection.sock.shutdown, (SHUT_RDWR,))  # of one that sends a byte at a time
            late.start()
            try:
                connection.request("GET", f"{self._path}/{path}")
                reply = connection.getresponse()
                content = reply.read(MOST_BYTES)
            finally:
                late.cancel()
            if reply.status != HTTPStatus.OK:
                raise ValueError(f"status {reply.status}")
            return content

    def _strange(self) -> OutputError:
        return OutputError(f"{self._url} answers, but not as phyphox does; look at the address and the port.")


def about_its_axis(table: Array) -> Array:
    """Count times from 0; put the rate about the axis of a swing before rates about three axes, if any."""
    times, values = table[:, 0] - table[0, 0], table[:, 1:]
    if values.shape[1] == 1:
        return np.column_stack([times, values])
    swing = values - values.mean(axis=0)
    axis = np.linalg.eigh(swing.T @ swing)[1][:, -1]
    return np.column_stack([times, values @ axis * np.sign(axis[np.argmax(np.abs(axis))]), values])
