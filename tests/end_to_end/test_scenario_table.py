"""All scenarios of a check as a table, against its JSON document."""

import csv
import json
import re

import pytest
from command_line import run_here

pytestmark = pytest.mark.slow

ASKED = (
    "check.uncertain={L1=0.2}",
    "check.samples=8",
    "check.path={lag=[0.01, 0.05], quantum=1e-5, jitter=0.0002, lost=0.001, latency=0.003}",
    "check.residual_sway=0.002",
)
PATH = ("quantum", "between", "lag", "latency", "jitter", "lost")


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("checked")
    sets = [word for override in ASKED for word in ("--set", override)]
    assert run_here(*sets, "--cycle-time", "0.004", "--out", folder, "--keep-failed").code in {0, 4}
    return folder


@pytest.fixture(scope="module")
def table(checked, tmp_path_factory):
    """What the check of the file says, in JSON and as a table."""
    path = tmp_path_factory.mktemp("table") / "rows.csv"
    return run_here("check", checked / "paper.csv", "--csv", path, "--json").document["check"], rows(path)


def rows(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_row_is_the_scenario_of_the_json_document(table):
    document, found = table
    assert len(found) == sum(group["rows"] for group in document["groups"]) == 3 + (2 * 3 + 2) + 8 + 20
    for row, scenario in zip(found, document["scenarios"], strict=True):
        assert (int(row["row"]), row["group"], row["name"]) == (
            scenario["row"],
            scenario["group"],
            scenario["name"],
        )
        assert {name: float(row[f"plant.{name}"]) for name in scenario["parameters"]} == scenario[
            "parameters"
        ]
        assert {load: float(row[f"{load}_m"]) for load in ("hook", "payload")} == scenario["residual_peaks_m"]
        assert float(row["error_bound_m"]) == document["error_bound_m"]
        assert row["verdict"] == ("passed" if scenario["passed"] else "failed")
        assert float(row["path.lag"]) == (scenario["lag_s"] or 0.0)
    assert {row["verdict"] for row in found} == {"passed", "failed"}


def test_it_tells_what_each_group_s_setpoints_went_through(table):
    stated = [row for row in table[1] if row["group"] != "drives" or row["name"].startswith("nominal")]
    taken = {row["group"]: tuple(row[f"path.{name}"] for name in PATH) for row in stated}
    assert taken["machines"] == ("0.0", "linear", "0.0", "0.0", "0.0", "0.0")
    assert taken["drives"] == ("1e-05", "linear", "0.05", "0.0", "0.0", "0.0")
    assert taken["samples"][:2] == ("1e-05", "linear") and 0.01 <= float(taken["samples"][2]) <= 0.05
    assert taken["timing"] == ("1e-05", "linear", "0.05", "0.003", "0.0002", "0.001")


def test_a_single_scenario_is_a_table_of_one_row(checked, tmp_path):
    path = tmp_path / "rows.csv"
    outcome = run_here("check", checked / "paper.csv", "--scenario", "12", "--csv", path, "--json")
    (row,), (scenario,) = rows(path), outcome.document["check"]["scenarios"]
    assert (row["row"], float(row["payload_m"])) == ("12", scenario["residual_peaks_m"]["payload"])


def test_of_a_large_group_all_rows_are_there_and_the_same_every_time(checked, tmp_path):
    words = ("check", checked / "paper.csv", "--samples", "60", "--csv")
    document = json.loads(run_here(*words, tmp_path / "one.csv", "--json").out)["check"]
    run_here(*words, tmp_path / "two.csv")
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()
    drawn = [row for row in rows(tmp_path / "one.csv") if row["group"] == "samples"]
    assert len(drawn) == 60 > sum(row["group"] == "samples" for row in document["scenarios"])
    (group,) = (group for group in document["groups"] if group["group"] == "samples")
    load = group["worst"]["load"]
    assert max(float(row[f"{load}_m"]) for row in drawn) == group["worst"]["residual_peak_m"]


def test_a_table_that_cannot_be_written_is_a_sentence(checked, tmp_path):
    (tmp_path / "file").write_bytes(b"in the way")
    outcome = run_here("check", checked / "paper.csv", "--csv", tmp_path / "file" / "rows.csv")
    assert (outcome.code, outcome.out) == (2, "")
    assert re.match(r"Error: Cannot write to the folder .*\.$", outcome.errors[-1])
