"""Checks take all processors that they are let onto, and those of a sweep one each."""

import os

import dask
import pytest

from gen_profile.assurance.verification import batch as many_machines
from gen_profile.assurance.verification.batch import on_processors
from gen_profile.plants.registry import find_plant
from gen_profile.studies.sweep.case import Recipe, run_case
from gen_profile.support import cluster
from gen_profile.support.artefacts.manifest import versions
from gen_profile_fmu.running.many_runs import ManyRuns

CRANE = find_plant("double-pendulum-crane")


@pytest.fixture
def workers(monkeypatch):
    """How many instances each check has had."""
    seen = []

    class Counted(ManyRuns):
        def __init__(self, *arguments, workers):
            seen.append(workers)
            super().__init__(*arguments, workers=workers)

    monkeypatch.setattr(many_machines, "ManyRuns", Counted)
    return seen


@pytest.fixture
def _on_one():
    every = os.sched_getaffinity(0)
    os.sched_setaffinity(0, [min(every)])
    yield
    os.sched_setaffinity(0, every)


def opened(times=1):
    for _ in range(times):
        with many_machines.many_machines(CRANE):
            pass


def test_a_check_takes_every_processor(workers):
    opened()
    assert workers == [len(os.sched_getaffinity(0))]


@pytest.mark.usefixtures("_on_one")
def test_a_process_that_is_let_onto_one_takes_one(workers):
    opened()
    assert workers == [1]


def test_where_the_system_does_not_tell_all_there_are(workers, monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    opened()
    assert workers == [3]


def test_the_number_is_bounded_within_and_not_afterwards(workers, monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    with on_processors(2):
        opened()
        with on_processors(9):
            opened()
    opened()
    assert workers == [2, 4, 4]


def test_a_case_of_a_sweep_takes_one(workers, monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    overrides = ("check.samples=3", "export.cycle_time=0.01")
    recipe = Recipe(
        text=(
            '[plant]\ntype = "double-pendulum-crane"\n[move]\ndistance = 0.3\nduration = 3.0\n'
            "[robustness]\nuncertain = { L1 = 0.05 }\n"
        ),
        overrides=overrides,
        source="test",
        folder=".",
        formats=("csv",),
        versions=versions(),
    )
    assert run_case(recipe, 0, {}).record["status"] in {"passed", "check failed"}
    assert set(workers) == {1}


def test_workers_of_a_sweep_keep_no_record_of_their_own_stack(monkeypatch):
    seen = []

    def begun(**_):
        seen.append(dask.config.get("distributed.worker.profile.enabled"))

    monkeypatch.setattr(cluster, "LocalCluster", begun)
    cluster._local_cluster(1)
    assert seen == [False]
