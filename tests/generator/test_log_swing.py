"""Swings that are logged from a phone and from a controller, both on the loopback interface."""

import asyncio
import json
import signal
import subprocess
import threading
import time
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qsl, urlsplit

import can
import numpy as np
import pytest
from asyncua import Server, ua
from command_line import PROGRAM, error_of, run_here
from end_to_end.simulated_controllers import free_port, in_thread

from gen_profile.spec.reading import preset_spec
from gen_profile.studies.identification.identify import read_swing

AXIS = np.array([0.36, -0.48, 0.8])  # about which the phone swings, of its own
FREQUENCY = 1.9


def rate(times):
    return 0.2 * np.cos(FREQUENCY * times)


class Phyphox:
    """What the app answers of an experiment; its clock runs while it measures."""

    def __init__(self, *, measuring=False, source="gyroscope", speed=20.0):
        self.measuring, self.source, self.speed = measuring, source, speed
        self.session, self.fails, self.asked = "a1b2c3", 0, []
        self.started, self.before = time.monotonic(), 3.0 if measuring else 0.0

    def buffers(self):
        now = self.before + (time.monotonic() - self.started) * self.speed if self.measuring else self.before
        times = np.arange(0.0, now, 0.01)
        rates = rate(times)[:, None] * AXIS + [0.01, -0.02, 0.005]
        return dict(zip(("tt", "rx", "ry", "rz"), [times, *rates.T], strict=True))

    def answer(self, path, query):
        self.asked.append(path + ("?" + "&".join("=".join(one) for one in query) if query else ""))
        if path == "/config":
            outputs = [{"x": "rx"}, {"y": "ry"}, {"z": "rz"}, {"t": "tt"}]
            return {"title": "Some", "inputs": [{"source": self.source, "outputs": outputs}], "buffers": []}
        if path == "/control":
            self.measuring, self.started = query[0][1] == "start", time.monotonic()
            return {"result": True}
        kept, held = {}, self.buffers()
        for name, asked in query:
            threshold, _, reference = asked.partition("|")
            values = held[name][-1:] if not asked else held[name][held[reference or name] > float(threshold)]
            kept[name] = {
                "size": 0,
                "updateMode": "partial",
                "buffer": [float(f"{one:.7e}") for one in values],
            }
        return {"buffer": kept, "status": {"session": self.session, "measuring": self.measuring}}


class Lossy(Phyphox):
    """Lost for two requests, once the first readings were taken."""

    def answer(self, path, query):
        answer = super().answer(path, query)
        if sum("|" in asked for asked in self.asked) == 1:
            self.fails = 2
        return answer


class OtherServer(Phyphox):
    def answer(self, path, query):
        return b"<html>"


class Stubborn(Phyphox):
    def answer(self, path, query):
        return {"result": False} if path == "/control" else super().answer(path, query)


class Dripping(Phyphox):
    drips = True

    def answer(self, path, query):
        return b" " * 1000 + json.dumps(super().answer(path, query)).encode()


class Elsewhere(Phyphox):
    """It leads to another server."""

    def __init__(self, place):
        super().__init__()
        self.place = place


class Absurd(Phyphox):
    def buffers(self):
        return {name: values * 1e300 for name, values in super().buffers().items()}


@contextmanager
def served(app):
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            if app.fails:
                app.fails -= 1
                self.connection.close()
                return
            parts = urlsplit(self.path)
            answer = app.answer(parts.path, parse_qsl(parts.query, keep_blank_values=True))
            content = answer if isinstance(answer, bytes) else json.dumps(answer).encode()
            place = getattr(app, "place", None)
            self.send_response(200 if place is None else 302)
            if place is not None:
                self.send_header("Location", place + self.path)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            pieces = (
                [content[at : at + 1] for at in range(len(content))] if hasattr(app, "drips") else [content]
            )
            with suppress(OSError):  # the client has gone
                for piece in pieces:
                    self.wfile.write(piece)
                    time.sleep(0.02 * (len(pieces) > 1))

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@pytest.mark.parametrize("measuring", [False, True])
def test_a_phone_is_logged_about_the_axis_it_swings_about(tmp_path, measuring):
    app = Phyphox(measuring=measuring)
    with served(app) as url:
        outcome = run_here("log-swing", url, "--out", tmp_path / "swing.csv", "--for", "5", "--json")
    assert outcome.code == 0, outcome.err
    assert app.measuring == measuring  # as it was before
    assert outcome.document["lasts_s"] >= 5.0
    log = read_swing(tmp_path / "swing.csv", preset_spec("bay-crane"), columns=("1", "2"), signal="rate:hook")
    np.testing.assert_allclose(np.diff(log.times), 0.01, atol=1e-6)
    waves = [np.cos(FREQUENCY * log.times), np.sin(FREQUENCY * log.times), np.ones_like(log.times)]
    (cosine, sine, _), (left,), *_ = np.linalg.lstsq(np.stack(waves, axis=1), log.values)
    assert np.hypot(cosine, sine) == pytest.approx(0.2, rel=1e-3)
    assert left < 1e-9 * len(log.times)


def test_a_network_that_is_lost_for_a_moment_loses_nothing(tmp_path):
    app = Lossy(measuring=True)
    with served(app) as url:
        outcome = run_here("log-swing", url, "--out", tmp_path / "swing.csv", "--for", "12")
    assert outcome.code == 0 and app.fails == 0, outcome.err
    times = np.loadtxt(tmp_path / "swing.csv", delimiter=",", skiprows=1)[:, 0]
    np.testing.assert_allclose(np.diff(times), 0.01, atol=1e-6)


@pytest.mark.parametrize(
    ("app", "sentence"),
    [
        (
            lambda: Phyphox(source="accelerometer"),
            "measures no rates about three axes: open phyphox's experiment",
        ),
        (OtherServer, "but not as phyphox does"),
        (Stubborn, "press play in phyphox"),
        (Dripping, "but not as phyphox does"),
        (lambda: Absurd(measuring=True), "but not as phyphox does"),
        (lambda: Phyphox(measuring=True, speed=0.0), "no new rates"),
    ],
)
def test_what_is_no_gyroscope_is_refused(tmp_path, app, sentence, monkeypatch):
    monkeypatch.setattr("gen_profile.studies.identification.phone.WHOLE", 0.5)
    monkeypatch.setattr("gen_profile.studies.identification.phone.LOST_FOR", 0.5)
    with served(app()) as url:  # its clock runs from here on
        outcome = run_here("log-swing", url, "--out", tmp_path / "swing.csv", "--for", "2")
    assert outcome.code == 2 and sentence in outcome.err
    assert not list(tmp_path.iterdir())


def test_nothing_is_asked_of_another_server(tmp_path):
    other = Phyphox(measuring=True)
    with served(other) as place, served(Elsewhere(place)) as url:
        outcome = run_here("log-swing", url, "--out", tmp_path / "swing.csv", "--for", "2")
    assert outcome.code == 2 and "but not as phyphox does" in outcome.err
    assert other.asked == [] and not list(tmp_path.iterdir())


def test_addresses_that_are_none(tmp_path):
    for source, *more in (
        ("192.168.0.42:8080",),
        ("https://x:1",),
        ("opc.tcp://127.0.0.1:1", "--security", "none"),
    ):
        assert run_here("log-swing", source, *more, "--out", tmp_path / "swing.csv").code == 2
    err = error_of("log-swing", f"http://127.0.0.1:{free_port()}", "--out", tmp_path / "swing.csv")
    assert "does not answer" in err
    assert "allow remote access" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_ctrl_c_ends_a_log_and_keeps_it(tmp_path):
    app = Phyphox(measuring=True)
    with served(app) as url:
        program = subprocess.Popen(
            [PROGRAM, "log-swing", url], cwd=tmp_path, stderr=subprocess.PIPE, text=True
        )
        while sum("|" in asked for asked in app.asked) < 3:  # the readings of two requests are taken in
            time.sleep(0.05)
        program.send_signal(signal.SIGINT)
        _, err = program.communicate()
    assert program.returncode == 0, err
    assert len((tmp_path / "swing.csv").read_text().splitlines()) > 16


@pytest.mark.slow
def test_a_node_of_a_controller_is_logged(tmp_path):
    port = free_port()

    async def main(ready, end):
        server = Server()
        await server.init()
        server.set_endpoint(f"opc.tcp://127.0.0.1:{port}")
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        node = await server.nodes.objects.add_variable("ns=2;s=angle", "2:angle", 0.0)
        word = await server.nodes.objects.add_variable("ns=2;s=word", "2:word", "none")
        assert word
        async with server:
            ready()
            began = time.monotonic()
            while not end.is_set():
                await node.write_value(float(np.degrees(rate(time.monotonic() - began))))
                await asyncio.sleep(0.02)

    with in_thread(main):
        url = f"opc.tcp://127.0.0.1:{port}"
        how = ("--security", "none", "--out", tmp_path / "swing.csv", "--for", "2", "--unit", "deg", "--json")
        outcome = run_here("log-swing", url, *how, "--node", "ns=2;s=angle")
        for node, sentence in {
            "ns=2;s=word": "holds no number",
            "ns=2;s=x": "has no node",
            "angle": "has no node",
        }.items():
            assert sentence in error_of("log-swing", url, *how, "--node", node, code=6)
    assert outcome.code == 0, outcome.err
    log = read_swing(tmp_path / "swing.csv", preset_spec("bay-crane"), columns=("1", "2"))
    assert log.times[-1] >= 2.0 and len(log.times) > 10
    apart = [np.std(log.values - rate(log.times + late)) for late in np.linspace(0.0, 4.0, 200)]
    assert min(apart) < 0.01


COUNTS = 4096  # of a turn


@contextmanager
def encoder(channel, *, answers=True, size=4):
    """Node 5 swings about where its position turns over, in the midst of other frames."""
    ended = threading.Event()

    def message(cob_id, data, **more):
        return can.Message(arbitration_id=cob_id, data=data, **{"is_extended_id": False} | more)

    with can.Bus(channel, interface="virtual") as bus:  # there before it is asked

        def swing():
            while not ended.is_set():
                asked = bus.recv(0.01)
                if asked is not None and asked.arbitration_id == 0x605 and answers:
                    bus.send(message(0x585, b"\x43\x01\x60\x00" + COUNTS.to_bytes(4, "little")))
                angle = rate(time.time())
                counted = round(angle * COUNTS / (2.0 * np.pi)) % COUNTS
                bus.send(message(0x185, counted.to_bytes(size, "little")))
                bus.send(message(0x186, bytes(4)))
                bus.send(message(0x185, bytes(4), is_extended_id=True))
                bus.send(message(0x185, b"", is_remote_frame=True))

        thread = threading.Thread(target=swing)
        thread.start()
        try:
            yield f"can:virtual:{channel}"
        finally:
            ended.set()
            thread.join()


@pytest.mark.parametrize(
    ("size", "more"), [(4, ()), (2, ("--counts", "4096"))], ids=["asked for its counts", "of two bytes"]
)
def test_an_encoder_on_a_can_bus_is_logged(tmp_path, size, more):
    with encoder(f"swing {size}", answers=not more, size=size) as source:
        how = ("--node", "5", "--out", tmp_path / "swing.csv", "--for", "1.2", "--json")
        outcome = run_here("log-swing", source, *how, *more)
    assert outcome.code == 0, outcome.err
    log = read_swing(tmp_path / "swing.csv", preset_spec("bay-crane"), columns=("1", "2"))
    assert log.times[-1] >= 1.2 and len(log.times) > 10
    waves = [np.cos(FREQUENCY * log.times), np.sin(FREQUENCY * log.times), np.ones_like(log.times)]
    (cosine, sine, _), *_ = np.linalg.lstsq(np.stack(waves, axis=1), log.values)
    assert np.hypot(cosine, sine) == pytest.approx(0.2, rel=0.01)


@pytest.mark.parametrize(
    ("source", "more", "code", "sentence"),
    [
        ("http://127.0.0.1:1", ("--counts", "9"), 2, "--counts: is for an encoder on a CAN bus"),
        ("can:can0", ("--node", "5"), 2, "name interface and channel, as can:socketcan:can0"),
        ("can:virtual:x", (), 2, "--node: name the encoder's number on the bus, from 1 to 127"),
        ("can:virtual:x", ("--node", "128"), 2, "--node: name the encoder's number"),
        ("can:virtual:x", ("--node", "5", "--unit", "deg"), 2, "mean nothing with CAN"),
        ("can:vitual:x", ("--node", "5"), 2, "interface vitual, channel x: cannot be opened"),
        ("can:virtual:x", ("--node", "5"), 2, "does not tell the counts of a turn (6001h)"),
        ("can:virtual:x", ("--node", "5", "--counts", "9"), 2, "Node 5 sends no position (185h) on x"),
    ],
)
def test_an_encoder_that_is_not_there(tmp_path, monkeypatch, source, more, code, sentence):
    monkeypatch.setattr("gen_profile.studies.identification.encoder.SILENT", 0.5)
    assert sentence in error_of("log-swing", source, *more, "--out", tmp_path / "swing.csv", code=code)
    assert not list(tmp_path.iterdir())
