"""Machines of which no planner block is made, each refused in a sentence."""

import pytest
from driven_block import BAY

from gen_profile.planner.design import planner_block
from gen_profile.spec.reading import parse_spec, preset_spec
from gen_profile.support.errors import SpecError


@pytest.mark.parametrize(
    ("preset", "changes", "words"),
    [
        ("paper", [], r"limits.velocity: required(.*\n)+limits.travel: required"),
        (
            "gantry-crane",
            ["limits.axis.x.velocity=1.0"],
            r"limits.acceleration: required of x(.*\n)+limits.velocity: required of y",
        ),
        (
            "mass-spring-chain",
            ['plant={type="mass-spring-chain-4"}'],
            "has 4 modes",
        ),
        (
            "bay-crane",
            ['planner.stop="prompt"', "planner.live_rate={L1=0.1}"],
            'planner.stop: "prompt" is not together with planner.live_rate; leave one out',
        ),
        ("gantry-crane", ["planner.live={y=[0.0, 1.0]}"], "planner.live.y: this axis makes the load sway"),
        (
            "tower-crane",
            ["planner.live={L=[8.0, 20.0]}", "planner.live_rate={L=0.1}", "plant.c=0.0"],
            "planner.live_rate: the loads of a tower-crane .* sway otherwise along another axis",
        ),
    ],
)
def test_a_machine_that_it_does_not_take_is_refused(preset, changes, words):
    with pytest.raises(SpecError, match=words):
        planner_block(preset_spec(preset, changes))


def test_a_live_parameter_named_as_what_the_block_has_is_refused(tmp_path, request):
    machine = (request.config.rootpath / "examples/inclined_crane.py").read_text("utf-8")
    (tmp_path / "crane.py").write_text(machine.replace("p.L", "p.scale").replace('"L"', '"scale"'), "utf-8")
    changes = ['plant={file="crane.py"}', "planner.live={scale=[2.0, 5.0]}", "check.residual_sway=0.1"]
    with pytest.raises(SpecError, match=r"planner\.live\.scale: the block has an fscale of its own"):
        planner_block(parse_spec(BAY, changes, folder=tmp_path))
