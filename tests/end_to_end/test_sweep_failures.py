"""Sweeps that cannot be, cases that fail, and what is said of them."""

import json
import multiprocessing
import os
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import attrs
import dask
import pyarrow.parquet as pq
import pytest
from command_line import error_of, run_here
from distributed import KilledWorker, LocalCluster
from sweeps import LOOPBACK, scheduler

from gen_profile.spec.reading import preset_text
from gen_profile.studies.sweep import case as sweep_case
from gen_profile.studies.sweep import run as workflow
from gen_profile.studies.sweep.case import failed, run_case
from gen_profile.studies.sweep.grid import parse_grid
from gen_profile.studies.sweep.run import prepare
from gen_profile.studies.sweep.store import opened
from gen_profile.studies.sweep.table import read_table, write_table
from gen_profile.support import cluster
from gen_profile.support.errors import OutputError, SpecError

QUICK = ("--preset", "paper-beta0", "--set", "export.cycle_time=0.01")


def prepared(folder, *axes, overrides=(), formats=("csv",)):
    text = (preset_text("paper-beta0"), "paper-beta0", folder)
    return prepare(text, ("export.cycle_time=0.01", *overrides), parse_grid(axes), formats, folder)


# Processes


@pytest.mark.slow
def test_a_process_that_is_given_up_is_started_anew(monkeypatch):
    """As is one that ends while it starts: no case may wait for it without end."""
    monkeypatch.setattr(cluster, "RENEWAL", 200)
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "1s"}),
        cluster.client_of(None, 1) as client,
    ):
        first = client.submit(os.getpid, pure=False).result()
        client.sync(client.cluster.workers[0].close)
        assert client.submit(os.getpid, pure=False).result() != first


@pytest.mark.slow
def test_links_that_another_user_laid_in_a_shared_folder_are_not_written_through(tmp_path, monkeypatch):
    """Dask keeps its locks in a folder of one name for all users, truncates them, and imports from there."""
    precious = tmp_path / "precious.txt"
    precious.write_text("mine", "utf-8")
    laid = tmp_path / "shared" / "dask-scratch-space"
    laid.mkdir(parents=True)
    for name in ("global.lock", "purge.lock"):
        (laid / name).symlink_to(precious)
    monkeypatch.setattr("tempfile.tempdir", str(laid.parent))
    monkeypatch.setenv("TMPDIR", str(laid.parent))
    with cluster.client_of(None, 1) as client:
        paths = client.submit(lambda: [*sys.path, str(Path.cwd())]).result()
        assert precious.read_text("utf-8") == "mine"
        assert str(laid) not in {*paths, *sys.path}
    assert list(laid.parent.iterdir()) == [laid] and len(list(laid.iterdir())) == 2


def test_a_link_in_place_of_the_lock_is_not_written_through(tmp_path):
    precious = tmp_path / "precious.txt"
    precious.write_text("mine", "utf-8")
    store = prepared(tmp_path / "out", "plant.L1=0.4:0.5:2")
    store.folder.mkdir()
    (store.folder / ".lock").symlink_to(precious)
    with pytest.raises(OutputError, match="choose another one"), opened(store):
        pass
    assert precious.read_text("utf-8") == "mine"


# Cases


@pytest.mark.slow
def test_an_interruption_waits_for_no_process_at_work(tmp_path, monkeypatch):
    """Dask let each work on for four seconds, while it closed."""
    begun, closing, ended = (tmp_path / name for name in ("begun", "closing", "ended"))
    close = cluster.Client.close
    monkeypatch.setattr(cluster.Client, "close", lambda *words: (closing.touch(), close(*words)))

    def long_work():
        begun.touch()
        while not closing.exists():
            time.sleep(0.01)
        ended.touch()

    with pytest.raises(KeyboardInterrupt), cluster.client_of(None, 1) as client:
        future = client.submit(long_work)
        while not begun.exists():
            time.sleep(0.01)
        raise KeyboardInterrupt
    assert future.status != "finished" and not ended.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("values", "status", "reason"),
    [
        ({}, "passed", ""),
        ({"solver.method": "zvd"}, "passed", ""),
        ({"check.residual_sway": 1e-6}, "check failed", "The payload sways by"),
        ({"limits.velocity": 0.05}, "infeasible", "No motion meets the end conditions"),
        ({"solver.method": "indirect", "limits.jerk": 0.1}, "limit broken", "limits.jerk"),
        ({"plant.L1": -1.0}, "faulty spec", "plant.L1: must be"),
        ({"axis.cart.unit": "counts", "axis.cart.counts_per_metre": 1e12}, "not exportable", "32 bits"),
    ],
)
def test_a_case_ends_in_a_record(tmp_path, values, status, reason):
    store = prepared(tmp_path, "move.duration=3,4")
    outcome = run_case(store.recipe, 5, values)
    assert (outcome.record["case"], outcome.record["values"]) == (5, values)
    assert (outcome.record["status"], outcome.passed) == (status, status == "passed")
    assert reason in outcome.record["reason"]
    assert outcome.record["reason"] or outcome.passed
    assert set(outcome.files) == ({"paper-beta0.csv", "manifest.json"} if outcome.passed else set())
    assert json.loads(json.dumps(outcome.record, allow_nan=False)) == outcome.record


def test_a_bug_stops_one_case_only(tmp_path, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("0/0")

    monkeypatch.setattr(sweep_case, "design_in_memory", broken)
    record = run_case(prepared(tmp_path, "move.duration=3,4").recipe, 0, {}).record
    assert (record["status"], record["reason"]) == ("crashed", "Internal error (ZeroDivisionError: 0/0).")


def test_a_worker_with_other_libraries_refuses(tmp_path):
    recipe = attrs.evolve(prepared(tmp_path, "move.duration=3,4").recipe, versions=(("numpy", "0.9"),))
    with pytest.raises(SpecError, match=r"a worker has gen-profile .*, and this sweep needs numpy 0\.9"):
        run_case(recipe, 0, {})


# Sweeps


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--vary", "plant.L9=1,2"], "plant.L9: unknown key"),
        (["--vary", "plant.L1=-1:-2:3"], "plant.L1: must be a number from"),
        (["--vary", "plant.L1"], "write KEY=LO:HI:N or"),
        (["--vary", "plant.L1=1:2:3", "--export", "pdf"], "unknown format 'pdf'"),
        (["--vary", "plant.L1=1:2:3", "--set", "plant.m1=-3"], "plant.m1: must be"),
        (["--vary", "plant.L1=1:2:3", "--scheduler", "tcp://x:1", "--workers", "2"], "--workers is for"),
        (["--vary", "plant.L1=1:2:3", "--workers", "0"], "0 is not in the range"),
        ([], "Missing option '--vary'"),
    ],
)
def test_a_senseless_sweep_is_refused_before_any_work(tmp_path, arguments, sentence):
    assert sentence in error_of("sweep", *QUICK, *arguments, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_holds_one_sweep(tmp_path):
    store = prepared(tmp_path, "move.duration=3,4")
    with opened(store), pytest.raises(OutputError, match="Another sweep is at work"), opened(store):
        raise AssertionError
    with opened(store):
        pass
    other = prepared(tmp_path, "move.duration=3,5", overrides=["plant.m1=0.3"])
    difference = r"a sweep with other values and spec and overrides;"
    with pytest.raises(OutputError, match=difference), opened(other):
        raise AssertionError


VARIED = [b"[]", b"{}", b'{"plant.L1": null}', b'{"plant.L1": []}']
HEAD = b'{"format": "gen-profile sweep", "format_version": '


@pytest.mark.parametrize(
    "content",
    [b"", b"[]", b"[" * 5000, HEAD + b"99}", *(HEAD + b'1, "vary": ' + vary + b"}" for vary in VARIED)],
)
def test_a_damaged_description_is_named(tmp_path, content):
    store = prepared(tmp_path, "move.duration=3,4")
    (tmp_path / "sweep.json").write_bytes(content)
    with pytest.raises(OutputError, match=r"sweep.json: (not a sweep of this|damaged)"), opened(store):
        raise AssertionError


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    store = prepared(tmp_path / "file" / "out", "move.duration=3,4")
    with pytest.raises(OutputError, match=r"Cannot write to the folder .*choose another"), opened(store):
        raise AssertionError


def test_a_scheduler_that_nobody_runs_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("gen_profile.support.cluster.ANSWER_TIME", "200ms")
    with pytest.raises(SpecError, match=r"scheduler tcp://127.0.0.1:9: no worker answers"):
        workflow.sweep(prepared(tmp_path, "move.duration=3,4"), scheduler="tcp://127.0.0.1:9")


@pytest.mark.slow
def test_processes_of_this_computer_that_do_not_start_are_a_sentence(tmp_path, monkeypatch):
    """They have minutes, as on a busy computer; they had 30 s, and were called a scheduler, None."""
    monkeypatch.setattr(cluster, "START_TIME", "1us")
    with pytest.raises(SpecError, match=r"workers: no process of this computer started in 1us \("):
        workflow.sweep(prepared(tmp_path, "move.duration=3,4"), workers=1)


def test_a_scheduler_without_workers_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr("gen_profile.support.cluster.ANSWER_TIME", "1s")
    with (
        LocalCluster(n_workers=0, **LOOPBACK) as cluster,
        pytest.raises(SpecError, match="no worker"),
    ):
        workflow.sweep(prepared(tmp_path, "move.duration=3,4"), scheduler=cluster.scheduler_address)


DEADLY = """
import multiprocessing, os
from gen_profile.plants.registry import find_plant
PLANT = find_plant("double-pendulum-crane")
if multiprocessing.parent_process() is not None:
    os._exit(1)
"""


@pytest.mark.slow
def test_a_case_that_kills_its_process_is_a_row(tmp_path):
    (tmp_path / "deadly.py").write_text(DEADLY, "utf-8")
    text = preset_text("paper-beta0").replace('type = "double-pendulum-crane"', 'file = "deadly.py"')
    (tmp_path / "spec.toml").write_text(text, "utf-8")
    assert multiprocessing.parent_process() is None
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        outcome = run_here(
            "sweep",
            tmp_path / "spec.toml",
            "--vary",
            "move.duration=3",
            "--workers",
            "1",
            "--out",
            tmp_path / "out",
        )
    assert outcome.code == 0
    (row,) = pq.read_table(tmp_path / "out" / "sweep.parquet").to_pylist()
    assert row["status"] == "crashed"
    assert row["reason"] == "Every process that worked at it ended: it lacks memory, or a library crashes."


def test_a_case_that_kills_its_process_costs_none_of_those_worked_at_with_it(tmp_path, monkeypatch):
    def deadly(recipe, cases):
        if 4 in cases:
            raise KilledWorker("run_cases", SimpleNamespace(address="a"), 3)
        return [failed(case, values, "infeasible", "no") for case, values in cases.items()]

    monkeypatch.setattr(workflow, "run_cases", deadly)
    store = prepared(tmp_path, "move.duration=3:4:9")
    with scheduler() as address:
        swept = workflow.sweep(store, scheduler=address)
    assert swept.statuses == {"passed": 0, "infeasible": 8, "crashed": 1}
    assert swept.reasons["crashed"].startswith("case 4: Every process that worked at it ended")


@pytest.mark.parametrize(
    ("raised", "seen", "sentence"),
    [
        (ModuleNotFoundError("No module 'x'"), SpecError, "cannot go on .*No module 'x'.*finished is kept"),
        (OutputError("No space left."), OutputError, "^No space left.$"),
    ],
)
def test_workers_that_cannot_work_stop_the_sweep(tmp_path, monkeypatch, raised, seen, sentence):
    def unable(*_):
        raise raised

    monkeypatch.setattr(workflow, "run_cases", unable)
    with scheduler() as address, pytest.raises(seen, match=sentence):
        workflow.sweep(prepared(tmp_path, "move.duration=3,4"), scheduler=address)


# Its table


RECORD = {"case": 0, "values": {"a": 1, "b": [1, 2]}, "status": "passed", "reason": ""}


def test_cells_are_numbers_or_texts_and_may_be_missing(tmp_path):
    grid = parse_grid(["a=1,2", "b=[1, 2],x"])
    other = {
        **RECORD,
        "case": 1,
        "values": {"a": 1, "b": "x"},
        "figures": {"duration_s": 3.0},
        "solver": {"defect": None},
        "check": {"limit_m": 0.1},
    }
    write_table(tmp_path, grid, [RECORD, other])
    none, some = read_table(tmp_path, grid).to_pylist()
    assert (none["a"], none["b"], some["b"]) == (1.0, "[1, 2]", "x")
    assert (none["duration_s"], some["duration_s"], some["check_limit_m"]) == (None, 3.0, 0.1)
    assert none["artefacts"] == [] and none["spec_sha256"] is None and some["solver_defect"] is None


def test_batches_of_rows_make_one_table(tmp_path, monkeypatch):
    grid = parse_grid(["a=1,2", "b=3,4"])
    records = [{**RECORD, "case": n, "values": grid[n]} for n in range(4)]
    records[3]["figures"] = {"duration_s": 3.0}
    write_table(tmp_path, grid, records)
    whole = read_table(tmp_path, grid).to_pylist()
    monkeypatch.setattr("gen_profile.studies.sweep.table.BATCH", 1)
    write_table(tmp_path, grid, records)
    assert read_table(tmp_path, grid).to_pylist() == whole


def test_a_table_that_is_missing_or_damaged_is_named(tmp_path):
    grid = parse_grid(["a=1", "b=x,y"])
    with pytest.raises(OutputError, match="finish the sweep first"):
        read_table(tmp_path, grid)
    (tmp_path / "sweep.parquet").write_bytes(b"PAR1")
    with pytest.raises(OutputError, match="damaged"):
        read_table(tmp_path, grid)
    with pytest.raises(OutputError, match="Cannot write"):
        write_table(tmp_path / "nowhere", parse_grid(["a=1", "b=[1, 2],[3, 4]"]), [RECORD])
    write_table(tmp_path, grid, [{**RECORD, "values": {"a": 1, "b": "x"}}])
    for other in (["a=1", "c=x,y"], ["a=x", "b=x,y"]):
        with pytest.raises(OutputError, match="damaged"):
            read_table(tmp_path, parse_grid(other))
    path = tmp_path / "sweep.parquet"
    path.write_bytes(path.read_bytes().replace(b"passed", b"parsed", 1))
    with pytest.raises(OutputError, match="damaged"):
        read_table(tmp_path, grid)
    with pytest.raises(OutputError, match="a case's record was altered"):
        write_table(tmp_path, grid, [RECORD, {**RECORD, "figures": {"duration_s": {}}}])


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b'{"case": 0, "valu',
        b"[]",
        b"\xff",
        b'{"case": 0}',
        b'{"case": 1, "values": {"move.duration": 3}, "status": "passed", "reason": ""}',
        b'{"case": 0, "values": {"move.duration": 4}, "status": "passed", "reason": ""}',
        b'{"case": 0, "values": {"move.duration": 3}, "status": "passed", "reason": "", "check": []}',
    ],
)
def test_a_case_whose_record_is_damaged_is_not_finished(tmp_path, content):
    store = prepared(tmp_path, "move.duration=3,4")
    for case in range(2):
        store.keep(failed(case, store.grid[case], "infeasible", "no"))
    assert store.is_finished(0) and store.is_finished(1)
    (store.case_folder(0) / "case.json").write_bytes(content)
    assert not store.is_finished(0) and store.is_finished(1)
    with pytest.raises(OutputError, match=r"000.case.json: missing or damaged; sweep again\."):
        list(store.records())


@pytest.mark.slow
def test_damaged_cases_are_worked_out_again(tmp_path):
    words = ["sweep", *QUICK, "--vary", "move.duration=3,4", "--out", tmp_path, "--json"]
    folder = tmp_path / "cases" / "0000"
    lost, garbled = folder / "000" / "paper-beta0.csv", folder / "001" / "manifest.json"
    with scheduler() as address:
        first = run_here(*words, "--scheduler", address)
        before = [file.read_bytes() for file in (lost, garbled)]
        lost.unlink()
        garbled.write_bytes(b"garbage")
        again = run_here(*words, "--scheduler", address)
    assert (first.code, again.code) == (0, 0)
    assert [file.read_bytes() for file in (lost, garbled)] == before
    assert run_here("lookup", tmp_path, "--move.duration", "4").code == 0
