"""Drawings of machines with the names of their variables: what is named, and on which side it is drawn."""

from xml.etree import ElementTree

import numpy as np
import pytest
from command_line import error_of, run_here

import gen_profile as gp
from gen_profile.plants.registry import find_plant, plant_types
from gen_profile.presentation.charts.machine import views

LENGTHS = {
    "double-pendulum-crane": {"L1", "L2"},
    "flexible-joint": {"R"},
    "gantry-crane": {"L"},
    "hall-crane": {"L0 + hoist", "L2"},
    "mass-spring-chain-2": set(),
    "single-pendulum-crane": {"L0 + hoist"},
    "slosh-tank": {"a"},
    "tower-crane": {"L"},
}
SMALL = {"theta2"}  # of the tank: a wave too low to be seen beside the first one


def drawn_sides(type_):
    plant = find_plant(type_)
    return plant, views(plant, plant.nominal())


@pytest.mark.parametrize("type_", plant_types())
def test_every_variable_is_named(type_):
    plant, sides = drawn_sides(type_)
    assert {name for view in sides for name, _, _ in view.moved()} == {axis.name for axis in plant.actuated}
    swinging = {name for view in sides for name, _, _ in view.swung()}
    missing = {free.name for free in plant.unactuated} - swinging
    assert missing == (SMALL if type_ == "slosh-tank" else set())
    assert {name for view in sides for name, _ in view.lengths()} == LENGTHS[type_]


def test_a_short_rope_is_named_below_a_long_one():
    plant = find_plant("double-pendulum-crane")
    (side,) = views(plant, {**plant.nominal(), "L1": 9.0, "L2": 0.9})
    assert {name for name, _, _ in side.swung()} == {"theta1", "theta2"}


@pytest.mark.parametrize(("type_", "axis"), [("double-pendulum-crane", "cart"), ("gantry-crane", "x")])
def test_what_swings_positively_is_drawn_where_it_trails(type_, axis):
    _, (side, *_) = drawn_sides(type_)
    directions = {name: direction for name, _, direction in side.moved()}
    assert directions[axis] == pytest.approx([1.0, 0.0])
    for _, point, without in side.swung():
        assert (side.drawing.points[0][point] - without) @ directions[axis] < 0.0


def test_a_hoist_pays_out_along_the_rope():
    _, (side,) = drawn_sides("single-pendulum-crane")
    directions = {name: direction for name, _, direction in side.moved()}
    assert directions["hoist"][1] < -0.9
    (pair,) = (pair for name, pair in side.lengths() if name == "L0 + hoist")
    rope = side.drawing.points[0][pair[1]] - side.drawing.points[0][pair[0]]
    assert directions["hoist"] == pytest.approx(rope / np.linalg.norm(rope), abs=1e-6)


@pytest.mark.slow
def test_the_command_draws_a_machine(tmp_path):
    outcome = run_here("plants", "single-pendulum-crane", "--plot", tmp_path / "crane.svg", "--json")
    assert outcome.code == 0, outcome.err
    assert list(outcome.document["plants"]) == ["single-pendulum-crane"]
    texts = {node.text for node in ElementTree.parse(tmp_path / "crane.svg").iter() if node.text}
    assert texts  # well-formed
    gp.plot(gp.preset_spec("bay-crane"), tmp_path / "bay.png")
    assert (tmp_path / "bay.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("plants", "--plot", "any.png"), "--plot: name the machine to draw"),
        (("plants", "gantry"), "plants gantry: unknown machine; did you mean 'gantry-crane'?"),
    ],
)
def test_what_cannot_be_drawn_is_refused(words, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sentence in error_of(*words)
