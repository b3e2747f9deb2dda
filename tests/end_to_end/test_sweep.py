"""Sweeps: what is in the table, whatever becomes of the processes."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from command_line import PROGRAM, run_here, run_process
from distributed import Client
from sweeps import archived, scheduler

from gen_profile.assurance.verification.check import check_artefact
from gen_profile.delivery.designs.design import design
from gen_profile.spec.reading import preset_spec, preset_text
from gen_profile.studies.sweep import run as workflow
from gen_profile.studies.sweep.grid import parse_grid
from gen_profile.studies.sweep.run import prepare
from gen_profile.studies.sweep.store import grid_of, swept_table, take_out

pytestmark = pytest.mark.slow

AXES = ("--vary", "move.distance=1e6,0.3", "--vary", "plant.L1=0.4:0.5:4")
QUICK = ("--preset", "paper", "--set", "export.cycle_time=0.01")


def prepared(folder, *axes, overrides=(), formats=("csv",)):
    text = (preset_text("paper"), "paper", folder)
    return prepare(text, ("export.cycle_time=0.01", *overrides), parse_grid(axes), formats, folder)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A sweep of two processes, of which some cases fail; its folder and its outcome."""
    folder = tmp_path_factory.mktemp("swept")
    outcome = run_here("sweep", *QUICK, *AXES, "--out", folder, "--workers", "2", "--json")
    assert outcome.code == 0, outcome.err
    return folder, outcome


@pytest.fixture
def table(swept):
    return pq.read_table(swept[0] / "sweep.parquet").to_pylist()


def test_has_a_row_for_every_combination(table):
    assert [(row["case"], row["move.distance"], row["plant.L1"]) for row in table] == [
        (n, d, length)
        for n, (d, length) in enumerate(
            (d, length) for d in (1e6, 0.3) for length in (0.4, 0.433333333333, 0.466666666667, 0.5)
        )
    ]


def test_a_row_is_what_a_design_of_its_own_finds(table, tmp_path):
    row = table[6]
    overrides = ("export.cycle_time=0.01", "move.distance=0.3", f"plant.L1={row['plant.L1']}")
    own = design(preset_spec("paper", overrides), ["csv"], tmp_path)
    assert own.passed and row["status"] == "passed"
    assert row["spec_sha256"] == own.spec.sha256()
    for name, value in own.plan.figures.items():
        assert row[name] == pytest.approx(value, rel=1e-6, abs=1e-9)
    load, finding = own.check.worst
    assert row["check_worst_load"] == load
    assert row["check_worst_sway_m"] == pytest.approx(finding.residual[load], rel=1e-6)


def test_the_artefacts_of_passed_cases_lie_beside_it_and_pass_again(swept, table):
    for row in table:
        if row["status"] != "passed":
            assert row["artefacts"] == []
            continue
        (artefact,) = row["artefacts"]
        judged = check_artefact(swept[0] / row["folder"] / artefact["path"])
        assert judged.check.passed and judged.manifest == "matches"
        assert judged.spec.move.distance == (row["move.distance"],)
        assert (swept[0] / row["folder"] / artefact["path"]).stat().st_size == artefact["bytes"]


def test_cases_that_fail_are_rows_with_their_reason(swept, table):
    assert [row["status"] for row in table] == 4 * ["faulty spec"] + 4 * ["passed"]
    assert all(row["reason"].startswith("move.target") for row in table[:4])
    document = swept[1].document
    assert document["statuses"] == {"faulty spec": 4, "passed": 4}
    assert document["reasons"]["faulty spec"].startswith("case 0: move.target")
    assert document["cases"] == 8 and document["finished_before"] == 0


def test_tells_how_far_it_is(swept):
    lines = swept[1].err.splitlines()
    assert lines[0] == "designing cases, 0 of 8 …"
    assert lines[-1].startswith("designing cases, 8 of 8, 4 failed")


def test_goes_on_in_its_folder_and_repeats_nothing(swept):
    folder, _ = swept
    before = stamps(folder)
    again = run_here("sweep", *QUICK, *AXES, "--out", folder)
    assert again.code == 0
    lines = [line.strip() for line in again.out.splitlines()]
    assert "kept         8 that had been finished before" in lines
    assert any(line.startswith("faulty spec  4 of 8; case 0: move.target") for line in lines)
    assert stamps(folder) == before


def test_one_file_takes_up_and_holds_the_same(swept, tmp_path):
    folder, outcome = swept
    path = archived(folder, tmp_path / "swept.sqlite", leave_out=(1, 6))
    with scheduler() as address:
        done = run_here("sweep", *QUICK, *AXES, "--out", path, "--scheduler", address, "--json")
    assert done.code == 0, done.err
    assert done.document["finished_before"] == 6
    assert done.document["statuses"] == outcome.document["statuses"]
    assert done.document["reasons"] == outcome.document["reasons"]
    due = pq.read_table(folder / "sweep.parquet")
    found = swept_table(path, grid_of(folder), due.column_names)
    assert found.to_pylist() == due.to_pylist()
    (row,) = swept_table(path, grid_of(folder), cases=[6]).to_pylist()
    take_out(path, row, tmp_path / "out")
    for file in (tmp_path / "out").iterdir():
        assert file.read_bytes() == (folder / row["folder"] / file.name).read_bytes()


def test_any_number_of_processes_finds_the_same_table_on_any_system(swept, tmp_path):
    """Here without what only some systems have; numbers on other processors may differ in last bits."""
    hidden = str(Path(__file__).parents[1] / "other_systems")
    alone = run_process("sweep", *QUICK, *AXES, "--out", tmp_path, "--workers", "1", PYTHONPATH=hidden)
    assert alone.code == 0, alone.err
    assert (tmp_path / "sweep.parquet").read_bytes() == (swept[0] / "sweep.parquet").read_bytes()


def test_cases_are_those_that_are_designed_alone(table, tmp_path):
    cold = [
        design(
            preset_spec(
                "paper", ("export.cycle_time=0.01", "move.distance=0.3", f"plant.L1={row['plant.L1']}")
            ),
            ["csv"],
            tmp_path,
        ).plan.solution
        for row in table[4:8]
    ]
    assert table[4]["solver_iterations"] == cold[0].iterations
    for row, solution in zip(table[5:8], cold[1:], strict=True):
        assert row["solver_iterations"] == solution.iterations
        assert row["solver_cost"] == solution.optimum.cost


def test_leaves_nothing_behind_but_the_sweep(swept):
    assert {path.name for path in swept[0].iterdir()} == {"sweep.json", "sweep.parquet", "cases", ".lock"}


def test_nothing_tells_of_a_clock_or_a_folder(swept):
    folder, _ = swept
    for path in folder.rglob("*.json"):
        assert str(folder) not in path.read_text("utf-8") and "time_s" not in path.read_text("utf-8")


# Processes that end


def stamps(folder):
    """Which file on the disk each record is, and when it was written."""
    found = {}
    for path in folder.glob("cases/*/*/case.json"):
        status = path.stat()
        found[path.parent.name] = (status.st_ino, status.st_mtime_ns)
    return found


def wait_for(condition):
    while not condition():
        time.sleep(0.02)


def test_a_sweep_that_is_killed_goes_on_where_it_was(swept, tmp_path):
    finished = {}
    while not 2 <= len(finished) < 8:  # a late kill found nothing left to do
        shutil.rmtree(tmp_path)
        process = subprocess.Popen(
            [PROGRAM, "sweep", *QUICK, *AXES, "--out", tmp_path, "--workers", "2"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_for(lambda process=process: process.poll() is not None or len(stamps(tmp_path)) >= 2)
        process.kill()
        process.wait()
        finished = stamps(tmp_path)
    assert not (tmp_path / "sweep.parquet").exists()
    with scheduler() as address:
        resumed = run_here("sweep", *QUICK, *AXES, "--out", tmp_path, "--scheduler", address, "--json")
    assert resumed.document["finished_before"] == len(finished)
    assert finished.items() <= stamps(tmp_path).items()
    assert (tmp_path / "sweep.parquet").read_bytes() == (swept[0] / "sweep.parquet").read_bytes()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_quietly(tmp_path, number):
    """Ctrl-C while it works; SIGTERM while its processes start, which Dask cannot stop then."""
    process = subprocess.Popen(
        [PROGRAM, "sweep", *QUICK, "--vary", "plant.L1=0.4:0.5:1000", "--out", tmp_path, "--workers", "1"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr.readline() == "designing cases, 0 of 1000 …\n"
    if number == signal.SIGINT:
        wait_for(lambda: stamps(tmp_path))
    os.killpg(process.pid, number)  # as a terminal and a service manager do, to all of them
    out, err = process.communicate()
    assert process.returncode == 130
    assert out == ""
    assert [line for line in err.splitlines() if line and not line.endswith(" …")] == ["Error: Interrupted."]


STARTED = """
import signal
from multiprocessing import resource_tracker
from gen_profile.support import cluster

def start(**_):
    resource_tracker.ensure_running()  # as the first process of any cluster does
    return signal.pthread_sigmask(signal.SIG_BLOCK, ())

cluster.LocalCluster = start
print(signal.SIGINT in cluster._local_cluster(2))
"""


def test_no_process_hears_ctrl_c_while_it_starts():
    """The second one and all others did, and printed where they were."""
    run = subprocess.run([sys.executable, "-c", STARTED], capture_output=True, text=True, check=True)
    assert run.stdout == "True\n"


@contextmanager
def cluster(folder, workers):
    """A Dask scheduler and workers, each a process of its own; the scheduler's address."""
    address = folder / "scheduler.json"
    loopback = ["--host", "127.0.0.1", "--no-dashboard"]
    with ExitStack() as stack:

        def start(name, *arguments):
            process = subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{name}", *arguments],
                stderr=subprocess.DEVNULL,
                cwd=folder,
            )
            stack.callback(process.wait)
            stack.callback(process.terminate)

        start("scheduler", *loopback, "--port", "0", "--scheduler-file", str(address))
        wait_for(address.exists)
        for _ in range(workers):
            start("worker", *loopback, "--nthreads", "1", "--scheduler-file", str(address))
        yield json.loads(address.read_text("utf-8"))["address"]


def test_a_worker_of_a_cluster_that_is_killed_costs_nothing_that_is_finished(swept, tmp_path):
    with cluster(tmp_path, workers=2) as address:
        store = prepared(tmp_path / "out", *AXES[1::2])
        seen, victims = {}, []

        def progress(_stage, cases_done, _total, _remark=""):
            now = stamps(store.folder)
            assert seen.items() <= now.items()
            seen.update(now)
            if cases_done == 3:
                with Client(address, set_as_default=False) as client:
                    victims.append(next(iter(client.run(os.getpid).values())))
                os.kill(victims[0], signal.SIGKILL)

        done = workflow.sweep(store, scheduler=address, progress=progress)
    assert len(victims) == 1
    assert seen == stamps(store.folder) and len(seen) == 8
    assert done.statuses == {"faulty spec": 4, "passed": 4}
    assert done.table.read_bytes() == (swept[0] / "sweep.parquet").read_bytes()
