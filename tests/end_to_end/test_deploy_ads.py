"""Deployment by ADS: by pyads to a server of our own with the exported block behind it, and under faults."""

import random
import socket
import struct
from contextlib import closing
from functools import partial

import numpy as np
import pytest
from command_line import error_of, run_here
from end_to_end.simulated_controllers import (
    MOVES,
    assert_deployed_and_watched,
    assert_whole,
    attempted,
    deployed_otherwise,
    exported_moves,
    free_port,
    serving,
    table_in_use,
    unchecked_deployments,
)

from gen_profile.delivery.deployment.ads import AdsLink
from gen_profile.delivery.deployment.ads_sim import SimulatedAdsController
from gen_profile.delivery.deployment.block_state import MotionState, read_state
from gen_profile.delivery.deployment.deploy import deploy
from gen_profile.delivery.deployment.mailbox import RIGHT, LinkLostError, Mailbox
from gen_profile.delivery.deployment.table import read_table
from gen_profile.support.errors import DeploymentError

FAULTS = 25


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return exported_moves(tmp_path_factory.mktemp("ads"), "twincat")


@pytest.fixture(scope="module")
def tables(files):
    return {name: read_table(files / name / "FB_paper.TcPOU") for name in MOVES}


@pytest.fixture
def plc(tables):
    controller = SimulatedAdsController(tables["old"], free_port())
    with serving(controller) as url:
        yield controller, ("--to", url, "--security", "none")


@pytest.mark.slow
def test_a_table_gets_into_a_controller_and_back_and_is_watched(files, plc):
    old, new = files / "old" / "FB_paper.TcPOU", files / "new" / "FB_paper.TcPOU"
    controller, where = plc

    def start():
        with controller.lock:
            controller.block.set("bExecute", np.ones(1))

    at = assert_deployed_and_watched(old, new, where, start)
    assert (at["instance"], at["security"], at["policy"]) == ("MAIN.fbMotion", "none", "None")
    assert run_here("deploy", old, *where, "--instance", "MAIN", "--verify").code == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "code", "error"),
    [
        ({"--to": "ads://127.0.0.1.1:851"}, 2, "is no address such as ads://"),
        ({"--to": "ads://127.0.0.1.1.256:851"}, 2, "is no address such as ads://"),
        ({"--db": "7"}, 2, "ADS finds the block by its name"),
        ({"--security": None}, 2, "ADS has none, and any client may write"),
        ({"--user": "me"}, 2, "mean nothing with ADS"),
        ({"--to": "ads://127.0.0.1:9/127.0.0.1.1.1:851"}, 6, "whether the controller has a route"),
        ({"--instance": "MAIN.fbOther"}, 6, "shows no block with aRequest and aReply as MAIN.fbOther"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_what_is_not_as_it_should_be_is_told_in_a_sentence(words, code, error, files, plc):
    found = deployed_otherwise(files / "old" / "FB_paper.TcPOU", plc[1], words)
    assert found.code == code and error in found.err, found.err
    assert "Warning" not in found.err  # of the library


def test_a_simulated_controller_needs_to_be_asked_for_no_security_and_one_protocol(files):
    for words, error in {
        ("--ads",): "--ads: ADS has no security",
        ("--ads", "--db", "7", "--no-security"): "--ads, --db: are of two protocols",
    }.items():
        assert error in error_of("plc-sim", files / "old" / "FB_paper.TcPOU", *words)


class Bench(SimulatedAdsController):
    """A controller whose block is called whenever its reply or state is read."""

    def __init__(self, tables):
        super().__init__(tables["old"], free_port())
        self.tables, self.cycle_time = tables, 1e9  # it does not call it by itself
        self.reset()

    def reset(self):
        self.block = type(self.block)(self.tables["old"])
        self.handles.clear()
        self.turn(60)

    def link(self, net_id="127.0.0.1.1.1"):
        place = (net_id, 851, f"127.0.0.1:{self.port}")
        return FaultyLink(("ads://127.0.0.1.1.1:851", place, "", self.tables["new"]), self)

    def used(self):
        """Tell which table is used in the end, by a connection without faults."""
        with self.lock:
            self.block.set("bExecute", np.zeros(1))
        self.turn(400)
        with closing(self.link()) as link:
            return table_in_use(self.tables, Mailbox(link, pause=lambda _: None))


class FaultyLink(AdsLink):
    """One to which something happens from one telegram on, for so many of them."""

    def __init__(self, what, bench):
        self.bench, self.count, self.span, self.fault = bench, 0, range(0), {}
        super().__init__(*what)

    def write(self, request):
        self.send(lambda: super(FaultyLink, self).write(self.altered(request.copy())))

    def read(self):
        self.bench.turn(1)
        return self.send(super().read)

    def send(self, work):
        self.count += 1
        due = self.count in self.span
        if due and self.fault.get("lose") == "before":
            self.cut()
        if due and "happen" in self.fault:
            self.fault.pop("happen")()
        answer = work()
        if due and self.fault.get("lose") == "after":
            self.cut()
        return answer

    def altered(self, request):
        return self.fault["alter"](request) if self.count in self.span and "alter" in self.fault else request

    def cut(self):
        self.close()
        raise LinkLostError("cut")


@pytest.fixture(scope="module")
def bench(tables):
    bench = Bench(tables)
    with serving(bench):
        yield bench


@pytest.fixture
def checked(tables, monkeypatch):
    return unchecked_deployments(monkeypatch, tables)


def drawn(bench, choices):
    """Draw a fault."""

    def flipped(request):
        request.view(np.uint64)[choices.randrange(256)] ^= np.uint64(1 << choices.randrange(52))
        return request

    def started():
        with bench.lock:
            bench.block.set("bExecute", np.ones(1))
        bench.turn(1)

    def rival():
        with closing(bench.link("127.0.0.2.1.1")) as link:
            try:
                deploy(bench.tables["other"], Mailbox(link, pause=lambda _: None))
            except DeploymentError as error:
                assert "Another deployment" in str(error) or "altered" in str(error)

    changes = [{"happen": happen} for happen in (started, rival, bench.handles.clear, bench.reset)]
    return choices.choice([{"lose": "before"}, {"lose": "after"}, {"alter": flipped}, *changes])


@pytest.mark.slow
def test_no_fault_leaves_a_controller_with_anything_but_a_whole_proved_table(bench, tables, checked):
    choices, ends = random.Random(3), []
    for number in range(FAULTS):
        bench.reset()
        checked.clear()
        fault, times = drawn(bench, choices), choices.choice([1, 1, 2, 5, 40, 1000])
        with closing(bench.link()) as link:
            link.fault, link.span = dict(fault), range(at := choices.randint(1, 60), at + times)
            box = Mailbox(link, pause=lambda _: None)
            done, error = attempted(partial(deploy, tables["new"], box))
        found = bench.used()
        ends.append((done, found))
        assert_whole(done, error, found, fault, tables, checked)
        assert found is not None, (number, fault, times)
    assert {(True, "new"), (False, "old")} <= set(ends)


def test_an_online_change_and_a_lost_connection_are_taken_up(bench, tables, checked):
    for fault in ({"happen": bench.handles.clear}, {"lose": "before"}, {"lose": "after"}):
        bench.reset()
        with closing(bench.link()) as link:
            link.fault, link.span = dict(fault), range(9, 10)
            assert deploy(tables["new"], Mailbox(link, pause=lambda _: None)).action == "deployed"
        assert bench.used() == "new"


def test_every_bit_of_a_number_arrives(bench):
    bench.reset()
    odd = np.resize([-0.0, 5e-324, np.inf, np.nan, 1 / 3, -1e308], 256)
    odd[[0, 255]] = [-1.0, -2.0]  # no request
    with closing(bench.link()) as link:
        link.write(odd)
        with bench.lock:
            assert (bench.block.get("aRequest").view(np.uint64) == odd.view(np.uint64)).all()
        assert read_state(link.state(), 1, MotionState).checked == RIGHT


def test_an_array_of_another_length_is_refused(bench, monkeypatch):
    with closing(bench.link()) as link:
        monkeypatch.setitem(bench.block.outputs, "aState", np.zeros(5))
        with pytest.raises(DeploymentError, match=r"aState is no array of 20 LREAL there"):
            link.state()


def test_broken_telegrams_stop_nothing(bench):
    for telegram in (bytes(100), b"\0\0" + struct.pack("<I", 2**31) + bytes(60), b"\xff" * 38):
        with socket.create_connection(("127.0.0.1", bench.port)) as sent:
            sent.sendall(telegram)
    bench.reset()
    assert bench.used() == "old"
