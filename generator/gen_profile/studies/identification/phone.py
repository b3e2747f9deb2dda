"""A phone that lies on the hook: phyphox's gyroscope, read by its remote access while it measures.

phyphox.org/wiki, Remote-interface communication: ``/config`` names the buffers of each sensor, ``/get`` gives
their values, those after a time alone where it is asked to, and ``/control`` begins and ends a measurement.
"""

import time
from collections.abc import Iterator
from contextlib import suppress
from http.client import HTTPException
from typing import Any
from urllib.parse import urlsplit
from urllib.request import ProxyHandler, build_opener

import numpy as np

from gen_profile.motion.profile import Array
from gen_profile.support.errors import OutputError, SpecError
from gen_profile.support.strict_json import parse_json

TIMEOUT, LOST_FOR, PAUSE = 3.0, 15.0, 0.3  # s of an answer, of a lost network, and between two questions
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
        self._url, self._open = url.rstrip("/"), build_opener(ProxyHandler({})).open
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
            It does not answer for `LOST_FOR`, or shows another experiment.
        """
        clock, *rates = self._buffers
        status, table = self._get("&".join(self._buffers))
        session, last = status.get("session"), float(np.nanmax(table[:, 0], initial=-1.0))
        began = not status.get("measuring")
        if began and self._ask("control?cmd=start").get("result") is not True:
            raise OutputError("The phone does not begin to measure; press play in phyphox.")
        try:
            while True:
                since = "&".join(f"{one}={last!r}|{clock}" for one in rates)
                status, table = self._get(f"{clock}={last!r}&{since}")
                if status.get("session") != session:
                    raise OutputError("Another experiment was opened on the phone meanwhile.")
                table = table[np.isfinite(table).all(axis=1) & (table[:, 0] > last)]
                last = float(table[:, 0].max(initial=last))
                yield table
                time.sleep(PAUSE)
        finally:
            if began:
                with suppress(OutputError):
                    self._ask("control?cmd=stop")

    def _get(self, query: str) -> tuple[dict[str, Any], Array]:
        answer = self._ask(f"get?{query}", LOST_FOR)
        try:
            columns = [answer["buffer"][name]["buffer"] for name in self._buffers]
            rows = list(zip(*columns, strict=False))
            return dict(answer["status"]), np.array(rows, dtype=np.float64).reshape(-1, 4)
        except (KeyError, TypeError, ValueError) as error:
            raise self._strange() from error

    def _ask(self, path: str, patience: float = 0.0) -> dict[str, Any]:
        """Ask for a document, again and again for some s where the network is lost."""
        until = time.monotonic() + patience
        while True:
            try:
                with self._open(f"{self._url}/{path}", timeout=TIMEOUT) as reply:
                    return dict(parse_json(reply.read(MOST_BYTES)))
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
