"""What a sweep varies, as the command line states it."""

import itertools
import re

import numpy as np
import pytest

from gen_profile.spec.reading import preset_spec
from gen_profile.studies.sweep import run
from gen_profile.studies.sweep.grid import GridAxis, grid_of_values, overrides, parse_grid
from gen_profile.support.errors import SpecError


def test_the_last_axis_changes_fastest():
    grid = parse_grid(["move.distance=0.1:0.3:3", "plant.L1=0.4,0.5", "robustness.method=none,sensitivity"])
    assert [grid[case] for case in range(len(grid))] == [
        {"move.distance": d, "plant.L1": length, "robustness.method": method}
        for d, length, method in itertools.product((0.1, 0.2, 0.3), (0.4, 0.5), ("none", "sensitivity"))
    ]


@pytest.mark.parametrize(("low", "high", "count"), [(0.1, 2.0, 20), (0.3, 0.6, 10), (-1e-7, 3e5, 7)])
def test_a_range_is_that_of_numpy_without_its_rounding(low, high, count):
    values = parse_grid([f"a={low}:{high}:{count}"]).axes[0].values
    np.testing.assert_allclose(values, np.linspace(low, high, count), rtol=1e-11)
    assert (values[0], values[-1]) == (low, high)


def test_values_are_the_grid_that_their_texts_are():
    values = {"plant.L1": [0.4, 0.5], "robustness.method": ["none", "sensitivity"]}
    assert grid_of_values(values) == parse_grid(["plant.L1=0.4,0.5", "robustness.method=none,sensitivity"])


@pytest.mark.parametrize(
    ("vary", "reason"),
    [
        ({}, "vary: name a key and its values"),
        ({"plant.L1": []}, "vary plant.L1: there is no value."),
        ({"plant.L1": [0.4, 0.4]}, "vary plant.L1: a value comes twice."),
        ({"plant.L1": [float("nan")]}, "vary plant.L1: values are finite numbers"),
        ({"plant.L1": list(range(10_000)), "plant.L2": list(range(10_000))}, "vary: more than 10000000"),
    ],
)
def test_values_of_which_no_grid_can_be_made(vary, reason):
    with pytest.raises(SpecError, match=re.escape(reason)):
        grid_of_values(vary)


def test_a_range_has_short_numbers():
    assert parse_grid(["a=0.1:2:20"]).axes[0].values[2] == 0.3


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("a=1,2", (1, 2)),
        ("a=0.5", (0.5,)),
        ('a="x, y",z', ('"x', 'y"', "z")),
        ('a="x, y","z"', ("x, y", "z")),
        ("a=[0,1],[2,3]", ([0, 1], [2, 3])),
        ("a=true,false", (True, False)),
        ("a=1]\nb=[2", ("1]\nb=[2",)),
    ],
)
def test_lists_are_toml_or_else_texts(text, values):
    axis = parse_grid([text]).axes[0]
    assert axis.values == values
    assert axis.numeric == all(type(value) in (int, float) for value in values)


def test_overrides_say_what_the_values_are():
    values = {"move.distance": 1e-07, "robustness.order": 2, "name": 'a"b', "move.target": [0.5], "x.y": True}
    read = preset_spec("paper", [text for text in overrides(values) if not text.startswith(("x", "name"))])
    assert read.move.target == (0.5,)
    assert read.robustness.order == 2
    assert overrides(values)[0] == "move.distance=1e-07"


@pytest.mark.parametrize(
    ("axes", "sentence"),
    [
        ([], "name what to vary"),
        (["move.distance"], "write KEY=LO:HI:N"),
        (["=1,2"], "write KEY=LO:HI:N"),
        (["a="], "write KEY=LO:HI:N"),
        (["a..b=1,2"], "write KEY=LO:HI:N"),
        (["a=0:x:3"], "LO:HI:N are two numbers"),
        (["a=0:1:2.5"], "LO:HI:N are two numbers"),
        (["a=0:1:2:3"], "LO:HI:N are two numbers"),
        (["a=3:9"], "say how many values to take, as LO:HI:N, such as a=3:9:5"),
        (["a=0,3:0,5:3"], "write a decimal point: 0.3"),
        (["a=0:1:1"], "two values or more"),
        (["a=0:inf:3"], "finite"),
        (["a=1,nan"], "finite"),
        (["a=1979-05-27"], "finite numbers, texts or arrays"),
        (["a=1:1:2"], "a value comes twice"),
        (["a=1,2", "a=3,4"], "a key is varied once"),
        (["a=0.5:1:1e3"], r"how many values to take\.$"),
        (["a=0.5:1:99999999"], "more than 10000000 combinations"),
        (["a=0.1,,0.2"], "between two commas of '0.1,,0.2' there is no value"),
        (["a=0:1:9999", "b=0:1:9999"], "more than 10000000 combinations"),
    ],
)
def test_tells_what_makes_no_sense(axes, sentence):
    with pytest.raises(SpecError, match=sentence):
        parse_grid(axes)


def test_steps_count_from_value_to_value_however_far_apart_they_are():
    axis = GridAxis(key="move.distance", values=(10, 1, 2.0))
    assert axis.steps(np.array([1.0, 2.0, 10.0, 1.5, 6.0, -7.0, 40.0])) == pytest.approx(
        [0, 1, 2, 0.5, 1.5, 0, 2]
    )
    assert GridAxis(key="plant.L1", values=(0.5,)).steps(0.5) == 0.0


@pytest.mark.parametrize(
    ("overrides", "cases", "processes"),
    [
        ([], 1, 1),
        ([], 20, 1),  # where a second process took longer to start than it saved
        ([], 40, 3),
        ([], 1000, 4),
        (["move.duration='minimum'", "limits.velocity=0.3"], 1, 1),
        (["move.duration='minimum'", "limits.velocity=0.3"], 4, 3),
        (["robustness.method='range'"], 20, 4),
    ],
)
def test_as_many_processes_start_as_pay(monkeypatch, overrides, cases, processes):
    monkeypatch.setattr(run, "CPU_COUNT", 4)
    assert run.worthwhile(preset_spec("paper", overrides), cases) == processes
