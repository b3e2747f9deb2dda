"""Deployment by S7, to python-snap7's own server with the exported block behind it, and under faults."""

import random
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
from snap7.error import S7ConnectionError, S7TimeoutError

from gen_profile.delivery.deployment.block_state import MotionState, read_state
from gen_profile.delivery.deployment.deploy import deploy
from gen_profile.delivery.deployment.mailbox import RIGHT, Mailbox
from gen_profile.delivery.deployment.s7 import S7Link
from gen_profile.delivery.deployment.s7_sim import SimulatedS7Controller
from gen_profile.delivery.deployment.table import read_table
from gen_profile.support.errors import DeploymentError

NUMBER, FAULTS = 7, 20


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return exported_moves(tmp_path_factory.mktemp("s7"), "plc", "siemens-scl")


@pytest.fixture(scope="module")
def tables(files):
    return {name: read_table(files / name / "paper.st") for name in MOVES}


@pytest.fixture
def plc(tables):
    simulated = SimulatedS7Controller(tables["old"], NUMBER, free_port())
    with serving(simulated) as url:
        yield simulated, ("--to", url, "--db", f"{NUMBER}", "--security", "none")


@pytest.mark.slow
def test_a_table_gets_into_a_controller_and_back_and_is_watched(files, plc):
    old, new = files / "old" / "paper.scl", files / "new" / "paper.scl"
    simulated, where = plc
    at = assert_deployed_and_watched(old, new, where, lambda: simulated.memory.__setitem__(0, 1))
    assert (at["instance"], at["security"], at["policy"]) == ("DB7", "none", "None")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "code", "error"),
    [
        ({"--to": "s7://127.0.0.1/8/1"}, 2, "is no address such as s7://"),
        ({"--to": "s7://127.0.0.1:70000/0/1"}, 2, "is no address such as s7://"),
        ({"--to": "opc.tcp://127.0.0.1:4840"}, 2, "--db: is for S7"),
        ({"--db": None}, 2, "S7 cannot be browsed; name the number"),
        ({"--security": None}, 2, "S7 has none, and any client may write"),
        ({"--user": "me"}, 2, "mean nothing with S7"),
        ({"--to": "s7://127.0.0.1:9/0/1"}, 6, "cannot be reached"),
        ({"--db": "8"}, 6, "The controller refuses DB8"),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)
def test_what_is_not_as_it_should_be_is_told_in_a_sentence(words, code, error, files, plc):
    found = deployed_otherwise(files / "old" / "paper.st", plc[1], words)
    assert found.code == code and error in found.err, found.err


def test_a_simulated_controller_needs_to_be_asked_for_no_security(files):
    assert "--db: S7 has no security" in error_of("plc-sim", files / "old" / "paper.st", "--db", "7")


class Bench:
    """A server whose block is called whenever its reply or state is read."""

    def __init__(self, tables):
        self.tables = tables
        self.controller = SimulatedS7Controller(tables["old"], NUMBER, free_port())
        self.controller.server.start_to("127.0.0.1", self.controller.port)
        self.reset()

    def reset(self):
        self.controller.data[:] = bytes(len(self.controller.data))
        self.controller.memory[0] = 0
        self.controller.block = type(self.controller.block)(self.tables["old"])
        self.turn(60)

    def turn(self, cycles=1):
        self.controller.turn(cycles)

    def link(self, pdu=480):
        processor = ("127.0.0.1", 0, 1, self.controller.port)
        link = BenchLink(("s7://127.0.0.1/0/1", processor, NUMBER, self.tables["new"]), self)
        link._client.pdu_length = pdu
        return link

    def box(self, link):
        return Mailbox(link, pause=lambda _: None)

    def used(self):
        """Tell which table is used in the end, by a connection without faults."""
        self.controller.memory[0] = 0
        self.turn(400)
        with closing(self.link()) as link:
            return table_in_use(self.tables, self.box(link))


class BenchLink(S7Link):
    def __init__(self, what, bench):
        self.bench = bench
        super().__init__(*what)

    def read(self):
        self.bench.turn()
        return super().read()


@pytest.fixture(scope="module")
def bench(tables):
    bench = Bench(tables)
    yield bench
    bench.controller.server.stop()


@pytest.fixture
def unchecked(tables, monkeypatch):
    return unchecked_deployments(monkeypatch, tables)


class Faults:
    """What happens to a connection from one PDU on, for so many of them."""

    def __init__(self, link, at, times, lose="", alter=None, happen=None):
        self.link, self.span, self.count = link, range(at, at + times), 0
        self.lose, self.alter, self.happen = lose, alter, happen
        self.send = link._client._send_receive
        link._client._send_receive = self

    def __call__(self, request, *rest):
        self.count += 1
        due = self.count in self.span
        if due and self.lose == "before":
            self.cut()
        if due and self.happen is not None:
            happen, self.happen = self.happen, None
            happen()
        response = self.send(self.alter(bytearray(request)) if due and self.alter else request, *rest)
        if due and self.lose == "after":
            self.cut()
        return response

    def cut(self):
        self.link._client.disconnect()
        raise (S7ConnectionError if self.lose == "before" else S7TimeoutError)("cut")


def flipped(choices, request):
    """Flip a bit of what a PDU writes; PDUs that read carry no values."""
    if len(request) > 60:
        request[choices.randrange(40, len(request))] ^= 1 << choices.randrange(8)
    return request


def swapped(request):
    if len(request) > 100:
        request[-64:] = request[-60:] + request[-64:-60]
    return request


def drawn(bench, choices):
    """Draw a fault."""

    def started():
        bench.controller.memory[0] = 1
        bench.turn()

    def rival():
        with closing(bench.link(choices.choice([240, 480]))) as link:
            try:
                deploy(bench.tables["other"], bench.box(link))
            except DeploymentError as error:
                assert "Another deployment" in str(error) or "altered" in str(error)

    def half_a_rival():
        """A client that writes the first part of a request, or of values, and dies."""
        at = choices.choice([0, 0, 220, 445, 1024])
        size = choices.choice([8, 60, 205, 445])
        block = bench.controller.data
        block[at : at + size] = choices.randbytes(size)

    return choices.choice(
        [
            {"lose": "before"},
            {"lose": "after"},
            {"alter": partial(flipped, choices)},
            {"alter": swapped},
            {"happen": started},
            {"happen": rival},
            {"happen": half_a_rival},
            {"happen": half_a_rival},
        ]
    )


@pytest.mark.slow
def test_no_fault_leaves_a_controller_with_anything_but_a_whole_proved_table(bench, tables, unchecked):
    choices, ends = random.Random(7), []
    for number in range(FAULTS):
        bench.reset()
        unchecked.clear()
        fault, times = drawn(bench, choices), choices.choice([1, 1, 1, 2, 5, 40, 1000])
        with closing(bench.link(choices.choice([240, 480]))) as link:
            Faults(link, choices.randint(1, 150), times, **fault)
            done, error = attempted(partial(deploy, tables["new"], bench.box(link)))
        found = bench.used()
        ends.append((done, found))
        assert_whole(done, error, found, fault, tables, unchecked)
        assert found is not None, (number, fault, times)
    assert {(True, "new"), (False, "old")} <= set(ends)


@pytest.mark.slow
@pytest.mark.parametrize("lose", ["before", "after"])
def test_the_connection_may_break_at_every_pdu(lose, bench, tables, unchecked):
    with closing(bench.link()) as link:
        count = Faults(link, 0, 0)
        bench.reset()
        deploy(tables["new"], bench.box(link))
    assert count.count > 100
    for at in range(1, count.count + 1, 29):
        bench.reset()
        with closing(bench.link()) as link:
            Faults(link, at, 1, lose=lose)
            assert deploy(tables["new"], bench.box(link)).action == "deployed"
        assert bench.used() == "new"


def test_nothing_is_written_to_a_data_block_of_something_else(bench, tables):
    bench.reset()
    before = bytes(bench.controller.data)
    bench.controller.data[4096 + 13 * 8] ^= 1  # the kind of the block
    foreign = bytes(bench.controller.data)
    with pytest.raises(DeploymentError, match=r"DB7 of .* is not of a running block that takes paper\.st"):
        bench.link()
    assert bytes(bench.controller.data) == foreign != before
    bench.controller.data[:] = bytes(len(foreign))
    with pytest.raises(DeploymentError, match="not of a running block"):
        bench.link()
    assert not any(bench.controller.data)


def test_every_bit_of_a_number_arrives(bench, tables):
    bench.reset()
    odd = np.resize([-0.0, 5e-324, np.inf, np.nan, 1 / 3, -1e308], 256)
    odd[[0, 255]] = [-1.0, -2.0]  # no request
    with closing(bench.link(240)) as link:
        link.write(odd)
        found = link._doubles(0, 256)
        assert (found.view(np.uint64) == odd.view(np.uint64)).all()
        assert read_state(link.state(), 1, MotionState).checked == RIGHT


def test_the_exported_data_block_has_the_arrays_where_they_are_looked_for(files):
    text = (files / "old" / "paper.scl").read_text("ascii")
    block = text[text.index('DATA_BLOCK "DB_paper_Mailbox"') :]
    assert "S7_Optimized_Access := 'FALSE'" in block
    arrays = [line.strip() for line in block.splitlines() if "Array[" in line]
    assert arrays == [
        "aRequest : Array[0..255] OF LREAL;",
        "aReply : Array[0..255] OF LREAL;",
        "aState : Array[0..19] OF LREAL;",
    ]
    call = text[text.index("#fbMotion(") :].split(");")[0]
    for name, arrow in {"aRequest": ":=", "aReply": "=>", "aState": "=>"}.items():
        assert f'{name} {arrow} "DB_paper_Mailbox".{name},' in call
    assert run_here("check", files / "old" / "paper.scl").code == 0
