"""`gen-profile stream` and `drive-sim` as a user calls them, with the virtual bus of python-can."""

import csv
import errno
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import attrs
import can
import canopen
import numpy as np
import pytest
from command_line import PROGRAM, error_of, run_here, run_process
from exporters.can.bench import MS, FakeClock, HastyClock, RigidLoad

from gen_profile.delivery.streaming import stream as workflow
from gen_profile.support.artefacts import writing as delivery
from gen_profile.support.artefacts.manifest import parse_manifest
from gen_profile_exporters.can.simulation.drive_bank import FAREWELL, DriveBank
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.simulation.simulated_drive import SimulatedDrive
from gen_profile_exporters.can.streaming.pacer import Pacer
from gen_profile_exporters.can.streaming.streamer import Streamer

BUSY = ("late at cycle", "cannot hold a cycle")  # a busy machine says so, and is no fault of the program


@pytest.fixture(scope="module")
def deployed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("deploy")
    own = ("--set", "can.timeout=0.5", "--set", "can.sync_period=0.02")
    assert run_here("--preset", "paper", *own, "--export", "can", "--out", folder).code == 0
    return folder


@pytest.fixture
def hasty(monkeypatch):
    """Have a simulation, or a self-test, take no longer than its computations do."""
    monkeypatch.setattr(workflow, "SharedClock", HastyClock)
    monkeypatch.setattr(workflow, "SystemClock", lambda *_: HastyClock(longest=MS))


def patiently(*arguments):
    """Stream, again where this machine was too busy."""
    for _ in range(5):
        outcome = run_here("stream", *arguments)
        if not any(words in outcome.out + outcome.err for words in BUSY):
            break
    return outcome


def streamed(*arguments):
    return patiently(*arguments, "--json")


@pytest.mark.slow
def test_simulated_drives_end_without_sway(deployed, tmp_path):
    table = tmp_path / "driven.csv"
    outcome = streamed(deployed / "paper.log", "--simulate-drive", "--self-test", "--log", table)
    document = outcome.document
    assert (outcome.code, document["state"], document["reason"]) == (0, "done", "")
    assert document["cycles_sent"] == document["cycles_planned"] == 151
    assert document["drive"]["position_error_m"] == 0.0
    assert 0.0 < document["drive"]["sway_residual_peak_m"] < 3e-4
    assert {"p50", "p99", "max"} <= document["lateness_us"].keys()
    assert sum(document["lateness_us"]["histogram"].values()) == 151
    head, *rows = csv.reader(table.read_text().splitlines())
    assert head == ["time_s", "cart_planned_m", "cart_actual_m"]
    assert len(rows) == 151
    assert rows[-1][0] == "3"
    assert float(rows[-1][1]) == pytest.approx(0.3, abs=1e-4)


@pytest.mark.slow
def test_drives_that_take_only_speed(tmp_path, hasty):
    """Velocities (60FFh) from the design over the check to the simulated load."""
    spec = ("can.mode=csv", "can.following_error=0.01", "can.timeout=0.5", "can.sync_period=0.02")
    options = [word for override in spec for word in ("--set", override)]
    designed = run_here("--preset", "paper", *options, "--export", "can", "--out", tmp_path, "--json")
    assert designed.document["check"]["passed"]
    document = streamed(tmp_path / "paper.log", "--simulate-drive").document
    assert (document["state"], document["reason"]) == ("done", "")
    assert document["drive"]["position_error_m"] == 0.0
    assert document["drive"]["following_error_max_m"] < 1.1e-6  # a count
    assert 0.0 < document["drive"]["sway_residual_peak_m"] < 3e-4


@pytest.fixture
def full_disk(monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(delivery.StagingFolder, "write", refuse)


FULL = r"Cannot write to the folder .*: No space left on device; choose another one\."


@pytest.mark.slow
def test_in_words_even_where_the_log_cannot_be_written(deployed, tmp_path, full_disk, hasty):
    table = ("--log", tmp_path / "driven.csv")
    outcome = patiently(deployed / "paper.log", "--simulate-drive", "--self-test", *table)
    assert outcome.code == 2
    assert re.fullmatch(f"Error: {FULL} The motion is done all the same[.]", outcome.errors[0])
    assert re.search("^done: 151 of 151 setpoints sent$", outcome.out, re.MULTILINE)
    lateness = r"half below \d+ µs, 99 % below \d+ µs, all below \d+ µs"
    assert re.search(rf"^lateness: {lateness}; drift −?[\d.]+ µs$", outcome.out, re.MULTILINE)
    assert re.search(rf"^Self-test: {lateness}\.$", outcome.out, re.MULTILINE)


@pytest.mark.slow
def test_a_busy_machine_delays_a_simulation_as_a_whole(deployed, monkeypatch):
    send, sent = Pacer.send, []

    def kept_from_it(self, messages):
        sent.append(messages)
        if len(sent) in {60, 100, 101}:
            time.sleep(0.1)  # five cycles
        send(self, messages)

    monkeypatch.setattr(Pacer, "send", kept_from_it)
    document = run_here("stream", deployed / "paper.log", "--simulate-drive", "--json").document
    assert (document["state"], document["cycles_sent"]) == ("done", 151)
    assert document["drive"]["sway_residual_peak_m"] < 3e-4
    assert document["lateness_us"]["max"] < 10_000
    stall = re.fullmatch(
        r"This machine stalled for (\d+) ms in all, and the .* with it\.", document["notes"][-1]
    )
    assert int(stall[1]) >= 3 * (100 - 5)


@pytest.mark.slow
def test_turning_axes_are_told_in_radians(tmp_path, hasty):
    spec = ("--preset", "flexible-joint", "--set", "can.sync_period=0.02")
    words = run_here("stream", *spec, "--dry-run").out
    assert "hub: node 1, from 0 to 1.5708 rad" in words
    outcome = patiently(*spec, "--simulate-drive", "--log", tmp_path / "hub.csv")
    assert re.search(r"^axis: [\d.]+ mrad off the target", outcome.out, re.MULTILINE)
    assert (tmp_path / "hub.csv").read_text().startswith("time_s,hub_planned_rad,hub_actual_rad\n")


def test_a_log_that_cannot_be_written_is_refused_before_anything_moves(deployed, tmp_path):
    outcome = run_here("stream", deployed / "paper.log", "--simulate-drive", "--log", tmp_path)
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.errors == [f"Error: Cannot write {tmp_path}: it is no regular file; choose another one."]
    assert "configure" not in outcome.err


@pytest.mark.slow
def test_a_silent_bus_is_told_once(deployed):
    bus = ("--interface", "virtual", "--channel", "empty")
    done = run_process("stream", deployed / "paper.log", *bus, cwd=deployed)
    assert done.code == 6
    assert "node 1 does not answer properly" in done.err
    assert "Transfer aborted" not in done.err
    assert "lateness" not in done.out


def test_dry_run_touches_no_bus(deployed):
    document = run_here("stream", deployed / "paper.log", "--dry-run", "--json").document
    assert (document["state"], document["cycles_sent"], document["cycles_planned"]) == ("planned", 0, 151)
    assert document["axes"] == [{"name": "cart", "node": 1, "start_m": 0.0, "target_m": 0.3}]
    assert 0.02 < document["bus_load"] < 0.04
    assert {
        "node": 1,
        "object": "60C2h:01",
        "value": 20,
        "meaning": "interpolation period: digits",
    } in document["startup"]
    words = run_here("stream", deployed / "paper.log", "--dry-run").out
    assert "cart: node 1, from 0 to 0.3 m" in words
    assert "1400h:01 = 80000201h  controlword: off while it changes" in words
    assert "6085h:00 = 1" in words


def test_a_spec_is_designed_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    document = run_here(
        "stream", "--preset", "paper", "--node", "5", "--mode", "ip", "--dry-run", "--json"
    ).document
    assert document["axes"][0]["node"] == 5
    assert {entry["value"] for entry in document["startup"] if entry["object"] == "6060h:00"} == {7}
    assert not list(tmp_path.iterdir())


def test_a_spec_that_fails_its_check_is_not_streamed():
    assert "sways by" in error_of(
        "stream", "--preset", "paper", "--set", "check.residual_sway=1e-6", "--dry-run", code=4
    )


class TestArtefact:
    def refused(self, path, *options):
        outcome = run_here("stream", path, "--dry-run", *options)
        assert outcome.code == 2
        return outcome.err

    def copy(self, deployed, tmp_path):
        shutil.copytree(deployed, tmp_path / "copy")
        return tmp_path / "copy" / "paper.log"

    def test_altered(self, deployed, tmp_path):
        path = self.copy(deployed, tmp_path)
        path.write_bytes(path.read_bytes().replace(b"301#E0930400", b"301#E1930400"))
        assert "is not the file that" in self.refused(path)

    def test_of_another_format(self, tmp_path):
        (tmp_path / "paper.csv").write_text("")
        assert "only the log of the format can" in self.refused(tmp_path / "paper.csv")

    def test_unverified(self, tmp_path):
        run_here("--preset", "paper", "--no-check", "--export", "can", "--out", tmp_path)
        assert "or accept it as it is (accept_unverified)." in self.refused(tmp_path / "paper.log")
        assert run_here("stream", tmp_path / "paper.log", "--dry-run", "--accept-unverified").code == 0

    def test_failed(self, deployed, tmp_path):
        path = self.copy(deployed, tmp_path)
        beside = path.with_name("manifest.json")
        manifest = parse_manifest(beside.read_bytes(), "manifest.json")
        beside.write_bytes(attrs.evolve(manifest, check={**manifest.check, "passed": False}).to_json())
        assert "failed its check" in self.refused(path, "--accept-unverified")

    @pytest.mark.parametrize("change", ['"start_tolerance": 9.001', '"quick_stop": 0.01'])
    def test_with_an_altered_manifest(self, deployed, tmp_path, change):
        path = self.copy(deployed, tmp_path)
        manifest = path.with_name("manifest.json")
        text = manifest.read_text()
        altered = text.replace('"start_tolerance": 0.001', change)
        assert altered != text
        manifest.write_text(altered)
        assert "manifest.json was altered after it was written" in self.refused(path)

    def test_that_begins_with_a_swing(self, tmp_path):
        swung = ("--preset=paper", "--set", "move.initial={theta1=0.05}")
        assert run_here(*swung, "--no-check", "--export", "can", "--out", tmp_path).code == 0
        for source in [(tmp_path / "paper.log", "--accept-unverified"), swung]:
            assert "move.initial: drives need a while" in self.refused(*source, "--simulate-drive")
        assert "move.initial: the simulated crane" in error_of(
            "drive-sim", *swung, "--interface", "virtual", "--channel", "swung", code=4
        )

    def test_missing(self, tmp_path):
        assert "Cannot read" in self.refused(tmp_path / "nothing.log")

    def test_with_options_for_specs(self, deployed):
        assert "streamed as it is" in self.refused(deployed / "paper.log", "--node", "3")

    def test_without_a_bus(self, deployed):
        assert "name the bus" in error_of("stream", deployed / "paper.log")

    def test_with_a_bus_that_cannot_be_opened(self, deployed):
        bus = ("--interface", "socketcan", "--channel", "nowhere0")
        assert "cannot be opened" in error_of("stream", deployed / "paper.log", *bus)

    @pytest.mark.parametrize(
        ("interface", "cure"),
        [
            ("socketcan", "ip link set nowhere0 up type can"),
            ("pcan", "install PEAK's PCAN-Basic library"),
            ("kvaser", "install Kvaser's CANlib"),
            ("sockedcan", "did you mean 'socketcan'?"),
        ],
    )
    def test_a_spec_without_its_bus_before_anything_is_solved(self, interface, cure):
        outcome = run_here("stream", "--preset", "paper", "--interface", interface, "--channel", "nowhere0")
        assert outcome.code == 2
        assert outcome.err.splitlines()[-1].startswith("Error: --interface")
        assert cure in outcome.err
        assert "?." not in outcome.err
        assert "solving" not in outcome.err


@pytest.mark.slow
def test_nobody_on_the_bus(deployed, tmp_path, full_disk):
    bus = ("--interface", "virtual", "--channel", "empty")
    outcome = run_here("stream", deployed / "paper.log", *bus, "--log", tmp_path / "driven.csv", "--json")
    assert (outcome.code, outcome.document["state"], outcome.document["drive"]) == (6, "aborted", None)
    assert "does not answer" in outcome.document["reason"]
    assert re.fullmatch(FULL, outcome.document["notes"][-1])


@pytest.mark.slow
def test_a_log_that_could_not_be_written_is_told_in_the_document(deployed, tmp_path, full_disk, hasty):
    outcome = streamed(deployed / "paper.log", "--simulate-drive", "--log", tmp_path / "driven.csv")
    error = outcome.document["error"]
    assert (outcome.code, outcome.document["state"]) == (error["exit_code"], "done") == (2, "done")
    assert re.fullmatch(f"{FULL} The motion is done all the same[.]", error["message"])


def test_a_full_disk_is_seen_before_anything_moves(deployed, tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=2000))
    outcome = run_here("stream", deployed / "paper.log", "--simulate-drive", "--log", tmp_path / "driven.csv")
    assert (outcome.code, outcome.out) == (2, "")
    assert "its disk has no room for it (2000 bytes)" in outcome.err
    assert "configure" not in outcome.err


@pytest.mark.slow
def test_nobody_who_takes_the_outcome(deployed):
    """As with `2>&1 | head -n 4`, on a full disk besides."""
    reader, writer = os.pipe()
    os.close(reader)
    bus = ("--interface", "virtual", "--channel", "empty")
    with Path("/dev/full").open("w") as full:
        command = [PROGRAM, "stream", deployed / "paper.log", *bus]
        done = subprocess.run(command, check=False, stdout=full, stderr=writer)
    os.close(writer)
    assert done.returncode == 6


@pytest.mark.slow
def test_sigterm_stops_the_axis(deployed, monkeypatch, hasty):
    send, sent = Pacer.send, []

    def interrupted(self, messages):
        sent.append(messages)
        if len(sent) == 80:
            os.kill(os.getpid(), signal.SIGTERM)
        send(self, messages)

    monkeypatch.setattr(Pacer, "send", interrupted)
    outcome = streamed(deployed / "paper.log", "--simulate-drive")
    assert outcome.code == 6
    assert outcome.document["reason"] == "Stopped by SIGTERM. The axes were stopped."
    assert outcome.document["drive"]["sway_residual_peak_m"] > 0.003


@pytest.mark.slow
def test_a_machine_that_cannot_hold_the_cycle(deployed, monkeypatch):
    class Slow(HastyClock):
        def now(self):
            return super().now() + 15 * MS * (super().now() // (50 * MS) % 2)

    monkeypatch.setattr(workflow, "SystemClock", lambda *_: Slow(longest=MS))
    assert "cannot hold a cycle of 20 ms" in error_of(
        "stream", deployed / "paper.log", "--simulate-drive", "--self-test", code=6
    )


def test_eds_of_the_simulated_drive(tmp_path):
    assert run_here("drive-sim", "--eds", tmp_path / "drive.eds").code == 0
    assert canopen.import_od(str(tmp_path / "drive.eds"), 1)[0x1000].default == 0x0002_0192
    assert "Cannot write" in error_of("drive-sim", "--eds", tmp_path / "drive.eds" / "below.eds")


@pytest.mark.slow
@pytest.mark.parametrize("interrupted", [False, True])
def test_drives_of_their_own(deployed, monkeypatch, interrupted):
    """drive-sim, and a streamer beside it, on a clock that waits for both, however busy this machine is."""
    source, records = workflow.verified(deployed / "paper.log"), []
    clock = FakeClock(MS)
    serve = workflow.serve

    def stream_beside(bank, stop):
        clock.actors.append(bank.poll)
        with can.Bus(channel="apart", interface="virtual") as bus:
            records.append(Streamer(bus, clock, source.plan).run())
        if interrupted:
            raise KeyboardInterrupt
        clock.sleep_until(clock.now() + 2 * FAREWELL)
        serve(bank, stop)

    monkeypatch.setattr(workflow, "serve", stream_beside)
    monkeypatch.setattr(workflow, "SystemClock", lambda: clock)
    spec = ("--set", "can.timeout=0.5", "--set", "can.sync_period=0.02")
    options = ("--interface", "virtual", "--channel", "apart", "--own-mapping", "--miss", "hold")
    document = run_here("drive-sim", "--preset", "paper", *spec, *options, "--json").document
    assert document["states"] == ["switch on disabled"]
    assert records[0].reason == ""
    assert document["position_m"] == pytest.approx([0.3])
    assert document["sway_residual_peak_m"] < 3e-4


@pytest.fixture
def drive_away(monkeypatch):
    """A drive whose axis stands away from the start, on a clock of its own."""
    clock = FakeClock(MS)
    with can.Bus(channel="away", interface="virtual") as bus:
        bank = DriveBank(bus, clock, [SimulatedDrive(1, DriveVariant(), 70_000)], [1e6], RigidLoad([0.07]))
        clock.actors.append(bank.poll)
        monkeypatch.setattr(workflow, "SystemClock", lambda *_: clock)
        yield bank.drives[0]


AWAY = ("--interface", "virtual", "--channel", "away")


class TestSlowMotions:
    def streamed(self, deployed, *options):
        return run_here("stream", deployed / "paper.log", *AWAY, *options, "--json")

    @pytest.mark.slow
    def test_to_the_start_and_then_the_motion(self, deployed, drive_away):
        refused = self.streamed(deployed)
        assert (refused.code, "stands at 0.07" in refused.document["reason"]) == (6, True)
        ways = []
        arrive = drive_away.arrive
        drive_away.arrive = lambda actual: (ways.append(actual), arrive(actual))
        slow = self.streamed(deployed, "--to-start")
        assert (slow.code, slow.document["state"], drive_away.actual) == (0, "done", 0.0)
        steps = np.abs(np.diff(ways)) / 1e6 / 0.02
        peak = steps.max()
        ways.clear()
        again = self.streamed(deployed, "--to-start").document
        assert (again, ways) == ({"state": "at start", "reason": ""}, [])
        assert self.streamed(deployed).document["state"] == "done"
        assert 0.01 < peak / (np.abs(np.diff(ways)).max() / 1e6 / 0.02) <= 0.1 * (1 + 1e-3)

    def test_a_jog_in_millimetres_is_told_the_travel(self):
        travel = ("--preset", "paper", "--set", "limits.travel=[-0.1, 0.5]")
        outcome = run_here("stream", *travel, "--simulate-drive", "--jog", "cart=50")
        assert outcome.code == 2
        assert "jog cart=50: leads to 50, beyond limits.travel (-0.1 to 0.5)" in outcome.errors[-1]

    @pytest.mark.slow
    def test_jogging(self, deployed, drive_away):
        document = self.streamed(deployed, "--jog", "cart=-0.01").document
        assert document["state"] == "done"
        assert drive_away.actual == pytest.approx(60_000)

    @pytest.mark.slow
    def test_they_stop_as_every_stream_does(self, deployed, drive_away, monkeypatch):
        send, sent = Pacer.send, []

        def interrupted(self, messages):
            sent.append(messages)
            if len(sent) == 200:
                os.kill(os.getpid(), signal.SIGTERM)
            send(self, messages)

        monkeypatch.setattr(Pacer, "send", interrupted)
        outcome = self.streamed(deployed, "--to-start")
        assert outcome.code == 6
        assert outcome.document["reason"] == "Stopped by SIGTERM. The axes were stopped."
        assert 0.0 < drive_away.actual < 70_000

    def test_nothing_is_asked_where_somebody_is_in_command(self, deployed, drive_away):
        with can.Bus(channel="away", interface="virtual") as other:
            other.send(can.Message(arbitration_id=0x080, is_extended_id=False))
            clock = workflow.SystemClock()
            clock.actors.append(lambda: other.send(can.Message(arbitration_id=0x080, is_extended_id=False)))
            outcome = self.streamed(deployed, "--to-start")
        assert (outcome.code, "a controller is at work" in outcome.err) == (6, True)

    def test_a_drive_that_counts_in_other_units(self, tmp_path, drive_away):
        own = ("--set", "can.gear=[3, 1]", "--set", "can.sync_period=0.02")
        run_here("--preset", "paper", *own, "--export", "can", "--out", tmp_path)
        assert "the drive holds another 6091h:01 than the spec" in error_of(
            "stream", tmp_path / "paper.log", *AWAY, "--to-start", code=6
        )

    @pytest.mark.parametrize(
        ("options", "words"),
        [
            (("--jog", "kart=0.1"), "--jog kart=0.1: unknown axis; did you mean 'cart'?"),
            (("--jog", "cart=1e3m"), "state the distance as a number of metres"),
            (("--jog", "cart=0,1"), "as cart=0.05; write a decimal point: 0.1."),
            (("--jog", "cart=inf"), "state the distance as a number of metres"),
            (("--jog", "cart=0.1", "--to-start"), "choose one of them"),
            (("--to-start", "--dry-run"), "--dry-run touches no bus"),
        ],
    )
    def test_what_cannot_be_meant(self, deployed, options, words):
        assert words in error_of("stream", deployed / "paper.log", *AWAY, *options)


class TestSeveralBuses:
    SPEC = (
        *("--preset", "gantry-crane", "--set", "can.channels={x='left', y='right'}"),
        *("--set", "can.sync_period=0.05", "--set", "can.timeout=0.5"),
    )

    @pytest.mark.slow
    def test_a_simulation(self, hasty):
        outcome = run_here("stream", *self.SPEC, "--simulate-drive", "--json")
        assert (outcome.code, outcome.document["state"], outcome.document["reason"]) == (0, "done", "")
        assert outcome.document["drive"]["position_error_m"] < 1e-6

    def test_the_spec_names_the_channels(self):
        bus = ("--interface", "virtual", "--channel", "left")
        assert "--channel: the spec states every axis's" in error_of("stream", *self.SPEC, *bus)

    @pytest.mark.slow
    def test_a_channel_that_is_not_there(self):
        assert "interface socketcan, channel left: cannot be opened" in error_of(
            "drive-sim", *self.SPEC, "--interface", "socketcan"
        )
