"""`gen-profile stream --planner` as a user calls it: which blocks are taken, and what is reported."""

import csv
import errno

import pytest
from command_line import error_of, run_here
from exporters.can.bench import HastyClock
from fmu.kinds import PLANNED, planner_text

from gen_profile.cli import planner
from gen_profile.delivery.streaming import stream as workflow
from gen_profile.planner.commands import play
from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import evolve_spec, preset_spec
from gen_profile.support.artefacts.manifest import FILENAME, Artefact, Manifest, sha256

KNOWING = "time_s,command,value,L1\n0,stop,,0.42\n0.1,velocity,0.3,\n2,stop,,\n"  # as --live-parameter does
SCRIPT = ("--planner", "paper.st", "--commands", "commands.csv")
COMMANDS = "time_s,command,value\n0.1,velocity,0.3\n2,stop,\n"


SENSOR = {"cob_id": 0x1A0, "type": "int16", "byte": [2], "counts": 5000.0, "reverse": True}
MEASURED = preset_spec(
    "bay-crane",
    [
        *(
            "export.cycle_time=0.02",
            "can.sync_period=0.02",
            "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}",
        ),
        'planner.sensor={quantity="angle", of="theta1", noise=0.002, delay=[0.0, 0.1]}',
        "planner.disturbance={swing={payload=0.5}, settle=15.0}",
        "move={start=10.0, target=18.0, duration=14.0}",
    ],
)
SWINGING = "time_s,command,value\n0.1,velocity,0.5\n3,quick-stop,\n18,stop,\n"


def deployed(folder, check, text=None, *, spec=PLANNED, commands=COMMANDS):
    """A block and its manifest, which says what came of the proof."""
    content = (planner_text() if spec is PLANNED else planner_block(spec).text).encode("ascii")
    (folder / "paper.st").write_bytes(content if text is None else text.encode("ascii"))
    known = Artefact(format="planner", path="paper.st", sha256=sha256(content), bytes=len(content))
    can = spec.to_dict()["can"] | {"sync_period": spec.export.cycle_time, "timeout": 0.5}
    manifest = Manifest(
        name="paper",
        spec=spec.to_dict() | {"can": can},
        spec_sha256=spec.sha256(),
        profile_sha256="",
        versions={},
        artefacts=(known,),
        check=check,
    )
    (folder / FILENAME).write_bytes(manifest.to_json())
    (folder / "commands.csv").write_text(commands)
    return ("--planner", folder / "paper.st", "--commands", folder / "commands.csv")


@pytest.mark.slow
def test_a_script_drives_simulated_drives(tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "SharedClock", HastyClock)
    table = tmp_path / "driven.csv"
    options = (*deployed(tmp_path, {"passed": True}), "--simulate-drive", "--log", table)
    outcome = run_here("stream", *options, "--live-parameter", "L1=0.42", "--json")
    document = outcome.document
    assert (outcome.code, document["state"], document["cycles_planned"]) == (0, "done", None)
    assert document["planner"] == {"promise": True, "error_ids": []}
    assert (
        0.0 < document["drive"]["sway_residual_peak_m"] < 0.01
    )  # the machine's rope is longer than the block's
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert list(rows[0]) == ["time_s", "cart_planned_m", "cart_actual_m", "promise", "error_id"]
    due = list(csv.DictReader(play(planner_text(), KNOWING).table.splitlines()))
    assert len(rows) == document["cycles_sent"] == len(due)
    for now, before in zip(rows[1:], due, strict=False):  # a drive is where it was led to by the cycle before
        assert float(now["cart_planned_m"]) == pytest.approx(float(before["position_m"]), abs=1e-6)


@pytest.mark.slow
def test_a_sensor_on_the_bus_lets_the_block_damp_what_a_quick_stop_left(tmp_path, monkeypatch):
    monkeypatch.setattr(workflow, "SharedClock", HastyClock)
    spec = evolve_spec(MEASURED, can={"sensor": SENSOR})
    options = deployed(tmp_path, {"passed": True}, spec=spec, commands=SWINGING)
    outcome = run_here("stream", *options, "--simulate-drive", "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.document["drive"]["sway_residual_peak_m"] < 0.05  # without, 0.41 m


@pytest.mark.slow
@pytest.mark.parametrize(
    ("check", "text", "words"),
    [
        (None, None, "is unverified"),
        ({"passed": False}, None, "failed its check"),
        ({"passed": True}, "altered", "is not the file that"),
    ],
)
def test_unproved_blocks_are_refused(tmp_path, check, text, words):
    altered = planner_text().replace("1.0", "1.5", 1) if text else None
    assert words in error_of("stream", *deployed(tmp_path, check, altered), "--simulate-drive")
    if check is None:
        options = (*deployed(tmp_path, None), "--accept-unverified", "--dry-run")
        assert "cart: node 1, from where it stands" in run_here("stream", *options).out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--commands", "commands.csv"), "name it by --planner"),
        (("--planner", "paper.st", "--jog", "cart=1"), "--jog: not with --planner"),
        (("--planner", "paper.st"), "standard error is no terminal"),
        (("--planner", "manifest.json", "--commands", "commands.csv"), "holds no planner block"),
        (
            ("--planner", "paper.st", "--commands", "commands.csv", "--live-parameter", "L1=x"),
            "state a number",
        ),
        (
            ("--planner", "paper.st", "--commands", "commands.csv", "--live-parameter", "L3=1"),
            "--live-parameter: the block has no live parameter 'L3'",
        ),
        (
            ("--planner", "paper.st", "--commands", "commands.csv", "--live-parameter", "L1=nan"),
            "--live-parameter: L1 must be from",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(tmp_path, monkeypatch, options, words):
    deployed(tmp_path, {"passed": True})
    monkeypatch.chdir(tmp_path)
    assert words in error_of("stream", *options, "--simulate-drive")


def test_a_terminal_that_is_gone_hides_nothing(monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.EIO, "gone")

    monkeypatch.setattr(planner.click, "echo", refuse)
    with planner.status_line():
        pass
