"""What an installation without extras does, and what it says where a command needs one."""

import json
import subprocess
import sys

import pytest

HIDDEN = {"asyncua", "canopen", "cryptography", "dask", "distributed", "flint", "matplotlib", "pandas"}
HIDDEN |= {"pyads", "pyarrow", "ruckig", "snap7", "tornado"}  # Plotly comes with fmpy
WORKS = [
    "--export plc --export can --out out",
    "check out/paper.st",
    "compare",
    "robustness --parameter L1",
    "can list",
    "planner --preset bay-crane --no-check --out block",
]
NEEDS = {
    "sweep --preset paper --vary plant.L1=1,2": "sweep",
    "lookup swept --plant.L1 1": "sweep",
    "library swept": "sweep",
    "planner --preset bay-crane --scheduler tcp://127.0.0.1:1 --out proved": "sweep",
    "compare --plot picture.png": "plot",
    "robustness --parameter L1 --plot picture.png": "plot",
    "plants single-pendulum-crane --plot picture.png": "plot",
    "planner --preset bay-crane --plot picture.png --out drawn": "plot",
    "studio --preset paper --no-browser": "studio",
    "stream out/paper.log --dry-run": "can",
    "drive-sim": "can",
    "deploy out/paper.st --to opc.tcp://127.0.0.1:1 --security none": "opcua",
    "deploy out/paper.st --to ads://127.0.0.1.1.1:851 --security none": "ads",
    "deploy out/paper.st --to s7://127.0.0.1/0/1 --db 1 --security none": "s7",
    "plc-sim out/paper.st": "opcua",
    "log-swing opc.tcp://127.0.0.1:1 --node ns=2;i=1 --security none": "opcua",
    "check out/paper.st --signed-by key.pub": "sign",
    "--sign key --out signed": "sign",
}
SCRIPT = """
import contextlib, io, json, sys
from importlib.machinery import PathFinder

find = PathFinder.find_spec
hidden, commands = json.load(sys.stdin)
PathFinder.find_spec = lambda name, *more: None if name in hidden else find(name, *more)

from gen_profile.cli import main

outcomes = []
for command in commands:
    sys.argv = ["gen-profile", *command.split()]
    streams = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)]
    code = 0
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        try:
            main()
        except SystemExit as leave:
            code = leave.code or 0
    outcomes.append((code, streams[1].buffer.getvalue().decode()))
print(json.dumps(outcomes))
"""


@pytest.mark.slow
def test_without_extras_the_main_job_runs_and_every_other_command_tells_what_to_install(tmp_path):
    (tmp_path / "key.pub").write_text("")
    (tmp_path / "swept").mkdir()
    commands = [*WORKS, *NEEDS]
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input=json.dumps([sorted(HIDDEN), commands]),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    outcomes = dict(zip(commands, json.loads(done.stdout), strict=True))
    failed = {command: outcomes[command] for command in WORKS if outcomes[command][0] != 0}
    assert failed == {}
    wrong = {
        command: outcomes[command]
        for command, extra in NEEDS.items()
        if outcomes[command][0] != 2 or f"pip install 'gen-profile[{extra}]'" not in outcomes[command][1]
    }
    assert wrong == {}, json.dumps(wrong, indent=1)
