"""Logs that are dropped on the studio's page: how they are read, and what is reported of them."""

import json
import shlex

import numpy as np
import pytest
from command_line import run_here
from generator.free_swings import states

from gen_profile.methods.solvers.plan import draft
from gen_profile.presentation.charts.figure import Figure, Line, Panel
from gen_profile.presentation.report.log import parse_log
from gen_profile.presentation.studio.curves_json import MOST, curves_json
from gen_profile.presentation.studio.logs import log
from gen_profile.presentation.studio.orders import LogQuestion, Question
from gen_profile.presentation.studio.state import StudioState, document_of, preset_start
from gen_profile.spec.reading import preset_spec, spec_from_dict

PAPER = Question(start=preset_start("paper"), state=StudioState(preset="paper"))
TRUE = 0.52  # m, L1 of the crane that was logged


def answer_to(content, name="log.csv", **how):
    reading = {"use": "", "columns": None, "after": 0.0, "at": (), "free": (), **how}
    asked = LogQuestion(question=PAPER, name=name, content=content, **reading)
    parts = json.loads(json.dumps(list(log(asked)), allow_nan=False))
    assert "Internal error" not in str(parts)
    return {part["part"]: part for part in parts}


@pytest.fixture(scope="module")
def swing():
    """A hook's angle in degrees over milliseconds, under names that mean nothing."""
    times = np.arange(0.0, 8.0, 0.02)
    parameters = {**preset_spec("paper").plant.parameters, "L1": TRUE}
    angle = states(parameters, times, [0.1, 0.1, 0.0, 0.0], (0.3,), "double-pendulum-crane")[0]
    noisy = np.degrees(angle) + np.random.default_rng(0).normal(0.0, 0.05, len(times))
    rows = [
        f"{1e3 * time:.0f};{value:.3f}\n".replace(".", ",") for time, value in zip(times, noisy, strict=True)
    ]
    return "".join(["Uhr;Geber 4\n", *rows]).encode()


@pytest.mark.slow
@pytest.mark.parametrize("count", [1.0, 0.09])
def test_a_swing_tells_parameters_that_can_be_taken(swing, count, tmp_path, monkeypatch):
    if count != 1.0:  # as an encoder tells it
        rows = [row.replace(",", ".").split(";") for row in swing.decode().splitlines()[1:]]
        swing = "".join(f"{time};{round(float(value) / count)}\n" for time, value in rows).encode()
    found = answer_to(swing, name="stop.csv", use="swing", columns=f"time_ms=1,hook_angle_{count:g}deg=2")
    (row,) = found["identified"]["parameters"]
    assert row["name"] == "L1" and abs(row["value"] - TRUE) <= row["half_range"]
    taken = spec_from_dict(document_of(PAPER.start, found["identified"]["edits"]))
    assert taken.plant.parameters["L1"] == pytest.approx(row["value"], abs=0.1 * row["half_range"])
    assert taken.robustness.uncertain == {"L1": 0.2}  # a rope that was measured still changes in service
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stop.csv").write_bytes(swing)
    program, *words = shlex.split(found["identified"]["command"])
    again = run_here(*words, "--json").document["parameters"]["L1"]
    assert program == "gen-profile" and again["value"] == pytest.approx(row["value"], rel=1e-6)


def test_columns_that_no_name_tells_are_asked_for(swing):
    found = answer_to(swing)
    assert found["log"]["columns"] == [{"name": "Uhr", "meaning": ""}, {"name": "Geber 4", "meaning": ""}]
    assert {"time", "cart_position", "hook_angle"} <= set(found["log"]["meanings"])
    assert "column" in found["unread"]["sentences"][0] and found["log"]["free"] == ["L1"]
    drawn = {panel["title"]: panel["curves"][0]["y"] for panel in found["unread"]["panels"]}
    assert [*drawn] == ["Uhr", "Geber 4"] and max(drawn["Geber 4"][1:]) > 3.0  # degrees


def test_a_move_is_told_from_a_swing_and_held_against_the_plan():
    motion = draft(PAPER.spec()).motion
    times = np.arange(0.0, motion.duration + 6.0, 0.02)
    place = motion(times - 0.5).position[:, 0]
    rows = [f"{time:.2f},{1e3 * x:.4f},0.0\n" for time, x in zip(times, place, strict=True)]
    found = answer_to("".join(["time_s,cart_position_mm,payload_sway_mm\n", *rows]).encode())
    assert found["log"]["use"] == "move" and found["measured"]["passed"] is True
    assert "begins at 0.5 s" in found["measured"]["sentences"][-1]
    panel = next(panel for panel in found["measured"]["panels"] if panel["title"] == "Position of cart")
    planned, measured = (np.array(curve["y"]) for curve in panel["curves"])
    assert measured == pytest.approx(planned, abs=1e-4)
    assert found["measured"]["command"] == "gen-profile report --preset paper --measured log.csv"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"PK\x03\x04 a workbook", "workbook is damaged"),
        (b"\x1f\x8b", "unpack"),
        (bytes(range(256)) * 40, "column"),
        (b"time_s,hook_angle\n" + b"0.1,nan\n" * 40, "no number"),
        (b"time_s,hook_angle\n" + b"".join(b"0.1,0.%d\n" % k for k in range(40)), "rise"),
        (b"time_s,hook_angle\n0,1e300\n", "number"),
        (b'"' * 5000, ""),
    ],
)
def test_what_is_no_log_is_a_sentence(content, words):
    assert words in " ".join(answer_to(content)["unread"]["sentences"])


def test_columns_by_number_are_no_cells_of_the_same_text():
    """A cell that holds the number of a column made its row the names, and hid the rows above."""
    text = "t;a\n" + "".join(f"{row};{0.01 * row}\n" for row in range(40))
    read = parse_log(text, "log.csv", preset_spec("paper"), "time_s=1,hook_angle=2")
    assert len(read.times) == 40


def test_long_curves_keep_their_peaks():
    x = np.linspace(0.0, 1.0, 100_000)
    y = np.sin(300.0 * x)
    y[31_415] = 7.0
    line = Line(name="y", x=x, y=y)
    panel = Panel(title="", x_label="", y_label="", lines=[line, Line(name="z", x=x, y=-y)])
    (drawn,) = curves_json(Figure(caption="", panels=[panel]))
    assert len(drawn["x"]) <= MOST + 2 and drawn["x"][-1] == 1.0
    assert max(drawn["curves"][0]["y"]) == 7.0 and min(drawn["curves"][1]["y"]) == -7.0
