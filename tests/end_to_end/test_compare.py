"""`gen-profile compare` against the paper's tables, printed and independently found."""

import re
from pathlib import Path

import pytest
from command_line import run_here

from gen_profile.cli import words
from gen_profile.dynamics.problem.problem import problem_of
from gen_profile.methods.shapers.impulses import SHAPERS
from gen_profile.methods.solvers.transient_sway import sways
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.comparison.candidates import candidates
from gen_profile.studies.comparison.compare import compare

FEW = ("--set", "robustness={}")
FIGURES = (
    "acceleration_max_m_per_s2",
    "acceleration_rms_m_per_s2",
    "jerk_max_m_per_s3",
    "jerk_rms_m_per_s3",
    "sway_transient_peak_m",
    "sway_transient_rms_m",
    "sway_residual_peak_perturbed_m",
)
# m/s², m/s³ and mm; found independently of this project, rounded as given, and as printed in the paper
FOUND = {
    "nzv": ("0.214", "0.130", "1.708", "0.742", "27.22", "16.98", "8.74"),
    "zvd": ("0.706", "0.373", "20.79", "6.066", "28.78", "14.92", "1.627"),
    "optimal-beta0": ("0.3336", "0.1840", "3.749", "1.0655", "29.406", "15.818", "1.774"),
    "optimal-beta20": ("0.5569", "0.2281", "19.436", "3.1667", "21.992", "12.946", "1.469"),
    "optimal-beta50": ("0.7026", "0.2833", "25.867", "4.2040", "19.362", "12.376", "1.463"),
}
PRINTED = {
    "nzv": ("0.2141", "0.1299", "1.6982", "0.7381", "27.347", "17.037", "8.850"),
    "zvd": ("0.7067", "0.3727", "20.5333", "6.0468", "28.807", "14.917", "1.622"),
    "optimal-beta0": ("0.3337", "0.1840", "3.7308", None, "29.404", "15.817", "1.774"),
    "optimal-beta20": ("0.5571", "0.2283", "19.2325", None, "21.984", "12.943", "1.470"),
    "optimal-beta50": ("0.7030", "0.2835", "25.5660", "4.2066", "19.646", "12.374", "1.465"),
}  # None: misprints, which disagree with the peak beside them
SHORTER_ROPE = {"zvd": 1.882, "optimal-beta0": 2.155, "optimal-beta20": 1.889, "optimal-beta50": 1.954}


@pytest.fixture(scope="module")
def comparison():
    outcome = run_here("compare", "--json")
    assert outcome.code == 0
    return outcome.document


@pytest.fixture(scope="module")
def figures(comparison):
    return {row["method"]: row["figures"] for row in comparison["rows"]}


def cells(table):
    return [
        (method, figure, text)
        for method, row in table.items()
        for figure, text in zip(FIGURES, row, strict=True)
        if text is not None
    ]


def in_table_units(figure, value):
    return 1e3 * value if "sway" in figure else value


@pytest.mark.slow
@pytest.mark.parametrize(("method", "figure", "text"), cells(FOUND))
def test_reproduces_what_was_found_independently(figures, method, figure, text):
    share = 0.01 if "jerk" in figure and not method.startswith("optimal") else 0.005
    half_a_digit = 0.5 * 10.0 ** -len(text.partition(".")[2])
    assert in_table_units(figure, figures[method][figure]) == pytest.approx(
        float(text), rel=0.0, abs=share * float(text) + half_a_digit
    )


@pytest.mark.parametrize(("method", "figure", "text"), cells(PRINTED))
def test_reproduces_the_printed_tables(figures, method, figure, text):
    assert in_table_units(figure, figures[method][figure]) == pytest.approx(float(text), rel=0.02)


def test_the_page_on_the_paper_shows_what_the_command_finds(figures):
    """Every digit of its table."""
    page = (Path(__file__).parents[2] / "docs" / "paper.md").read_text("utf-8")
    shown = re.findall(r"^\| (NZV|ZVD|β = \d+) \|(.+)\|$", page, re.MULTILINE)
    assert len(shown) == len(FOUND)
    for name, cells_ in shown:
        row = figures[name.lower().replace("β = ", "optimal-beta")]
        for figure, text in zip((*FIGURES, "sway_residual_worst_m"), cells_.split("|"), strict=True):
            half_a_digit = 0.5 * 10.0 ** -len(text.strip().partition(".")[2])
            assert in_table_units(figure, row[figure]) == pytest.approx(float(text), abs=1.1 * half_a_digit)


def test_the_page_on_the_paper_shows_what_the_paper_prints():
    """Below the row of each method; misprints as they are."""
    page = (Path(__file__).parents[2] / "docs" / "paper.md").read_text("utf-8")
    shown = re.findall(r"^\| (NZV|ZVD|β = \d+) \|.+\n\| printed \|(.+)\| \|$", page, re.MULTILINE)
    assert [name.lower().replace("β = ", "optimal-beta") for name, _ in shown] == list(PRINTED)
    for row, (_, cells_) in zip(PRINTED.values(), shown, strict=True):
        for text, cell in zip(row, cells_.split("|"), strict=True):
            assert text in (None, cell.strip())


@pytest.mark.parametrize(("method", "millimetres"), SHORTER_ROPE.items())
def test_the_worst_case_is_the_shorter_rope(figures, method, millimetres):
    assert 1e3 * figures[method]["sway_residual_worst_m"] == pytest.approx(millimetres, rel=0.005)


def test_optimal_motions_leave_nothing_on_the_nominal_crane(figures):
    for method, row in figures.items():
        if method.startswith("optimal-beta"):
            assert row["sway_residual_peak_m"] < 1e-8


def test_the_document_holds_the_contract_s_keys(comparison):
    assert {"name", "rows", "recommended", "reasons"} <= comparison.keys()
    named = {row["method"] for row in comparison["rows"] + comparison["left_out"]}
    assert {*SHAPERS, *FOUND, "optimal-range", "optimal-order2"} == named
    assert FOUND.keys() <= {row["method"] for row in comparison["rows"]}
    assert comparison["recommended"].keys() == comparison["reasons"].keys() == {"fastest", "gentlest"}
    for row in comparison["rows"]:
        assert row["figures"]["duration_s"] == pytest.approx(3.0)


def test_recommends_among_those_that_keep_the_limit(comparison, figures):
    safe = {method for method, row in figures.items() if row["sway_residual_worst_m"] <= 0.003}
    assert "nzv" not in safe
    fastest = min(safe, key=lambda method: figures[method]["acceleration_max_m_per_s2"])
    gentlest = min(safe, key=lambda method: figures[method]["sway_transient_peak_m"])
    assert comparison["recommended"] == {"fastest": fastest, "gentlest": gentlest}
    assert "3 mm" in comparison["reasons"]["fastest"]


@pytest.mark.slow
def test_recommends_nothing_where_nothing_keeps_the_limit():
    document = run_here("compare", "--json", "--set", "check.residual_sway=1e-6").document
    assert document["recommended"] == {"fastest": None, "gentlest": None}
    assert "No method keeps" in document["reasons"]["gentlest"]


def test_says_which_method_has_no_motion_and_why():
    """ZVD's own delay is 2.4 s on this crane: a move in 2 s leaves it no time."""
    found = compare(preset_spec("paper", ["move.duration=2", "robustness={}"]))
    document, table = found.to_dict(), words.comparison(found)
    (left_out,) = (row for row in document["left_out"] if row["method"] == "zvd")
    assert left_out["reason"].endswith(".")
    assert "zvd" not in {row["method"] for row in document["rows"]}
    assert any(
        line.startswith("Need more than 2 s: ") and "zvd, ei (at least 2.516 s)" in line
        for line in table.splitlines()
    )
    assert left_out["reason"] not in table and "move.duration:" not in table


def test_a_reason_that_more_time_does_not_mend_is_one_line():
    table = words.comparison(compare(preset_spec("paper", ["move.final_velocity=0.1", "robustness={}"])))
    assert any(line.startswith("zvd: move.final_velocity: a shaper moves") for line in table.splitlines())


@pytest.mark.parametrize("width", [60, 80, 200])
def test_the_table_is_as_wide_as_the_terminal(monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    compared = compare(preset_spec("paper", ["move.duration=2", "robustness={}"]))
    lines = words.comparison(compared).splitlines()
    rows = [line.split() for line in lines if line.split()[:1] == [compared.rows[0].method]]
    heads = " ".join(" ".join(lines).split())
    assert all(head in heads for head in words.COLUMNS)
    figures = [word for row in rows for word in row[1:] if word != "●"]
    assert len(figures) == len(words.COLUMNS)  # each once, whatever the number of tables
    assert (len(rows) > 1) == (width < 100)
    tables = [line for line in lines if line.startswith(" ")]
    assert max(map(len, tables)) <= width


@pytest.mark.slow
def test_the_spec_s_own_weight_is_compared_too():
    methods = [
        row["method"] for row in run_here("compare", "--json", "--set", "cost.sway_weight=7").document["rows"]
    ]
    assert "optimal-beta7" in methods


@pytest.mark.slow
def test_people_get_a_table_with_the_recommendation():
    outcome = run_here("compare")
    assert outcome.code == 0
    lines = outcome.out.splitlines()
    assert lines[0].startswith("paper: double-pendulum-crane, cart 0.3 m in 3 s, L1 ±20 %")
    row, *further = (line.split() for line in lines if line.strip().startswith("optimal-beta50"))
    row += [cell for more in further for cell in more[1:]]  # in tables as wide as a terminal
    assert row[1] == "3"
    assert row[6:] == ["19.36", "12.38", "0", "1.463", "1.955", "●", "●"]
    assert lines[2:5] == [
        "Recommended, of those that keep the residual sway below 3 mm on all machines:",
        "Least acceleration: optimal-beta0 (0.3337 m/s²; the best shaper, zvd: 0.706 m/s²)",
        "Least sway on the way: optimal-beta50 (19.36 mm; the best shaper, umzvd: 25.46 mm)",
    ]
    assert "Need more than 3 s: zvdd, 2hump-ei (at least 3.728 s); 3hump-ei (at least 4.939 s)" in lines
    assert max(map(len, lines)) < 140 and not any("move.duration" in line for line in lines)
    assert outcome.errors == []


def test_shapers_can_be_fed_with_another_move(figures):
    document = run_here("compare", "--json", "--base", "septic", *FEW).document
    rows = {row["method"]: row["figures"] for row in document["rows"]}
    assert document["base"] == "septic"
    for name in SHAPERS.keys() & figures.keys():
        assert rows[name]["velocity_max_m_per_s"] != pytest.approx(figures[name]["velocity_max_m_per_s"])


def test_the_range_of_ropes_is_kept_best_by_the_motion_made_for_it(figures):
    """At no more acceleration than β = 50; the convex bound for these is 0.70 mm."""
    row = figures["optimal-range"]
    assert row["acceleration_max_m_per_s2"] <= figures["optimal-beta50"]["acceleration_max_m_per_s2"] * 1.0001
    assert row["sway_residual_worst_m"] < 0.75e-3


def test_marks_the_pareto_front(comparison):
    rows = {row["method"]: row for row in comparison["rows"]}
    assert not rows["zv"]["pareto"]  # nzv leaves less, swings less and asks for less
    assert all(rows[method]["pareto"] for method in comparison["recommended"].values())
    assert {method for method, row in rows.items() if row["keeps_residual_sway"]} == {
        method for method, row in rows.items() if row["figures"]["sway_residual_worst_m"] <= 0.003
    }


@pytest.mark.slow
def test_other_machines_compare_the_spec_s_own_motion_as_optimal():
    document = run_here("compare", "--json", "--preset", "slosh-tank", *FEW).document
    methods = [row["method"] for row in document["rows"]]
    assert {"optimal", "optimal-beta0"} <= set(methods)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
def test_variants_keep_the_limit_of_the_sway_on_every_machine():
    spec = preset_spec("paper-beta0", ["limits.sway=0.024"])
    (variant,) = [one for one in candidates(spec) if one.method == "optimal-range"]
    _, worst = sways(problem_of(spec), variant.design())
    assert 0.99 * 0.024 < worst <= 1.01 * 0.024
