"""Which variants machines allow, against independent simulations of the machines, and in the block."""

import attrs
import numpy as np
import pytest
from motions import quintic, target
from playing import checked, start

from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.machine_variants import AxisVariants, machine_variants
from gen_profile_exporters.playback import structured_text

ALL = AxisVariants(least_scale=0.0, mirror=True, shift=True)
TURNED = AxisVariants(mirror=True, shift=True)
NONE = AxisVariants()
MACHINES = {
    "double-pendulum-crane": (ALL,),
    "flexible-joint": (ALL,),
    "gantry-crane": (ALL, ALL),
    "mass-spring-chain": (ALL,),
    "single-pendulum-crane": (ALL, NONE),
    "slosh-tank": (ALL,),
    "tower-crane": (TURNED, NONE),
}


@pytest.mark.parametrize("preset", MACHINES)
def test_the_equations_decide(preset):
    assert machine_variants(preset_spec(preset)) == MACHINES[preset]


def test_a_load_that_swings_at_the_start_allows_shifts_only():
    spec = preset_spec("paper", ["move.initial={theta1=0.01}"])
    assert machine_variants(spec) == (AxisVariants(shift=True),)


def sway_after(spec, gain, offset):
    """Sway of the loads over a while after a quintic move that was varied, in m."""
    begin, way = np.array(spec.move.start) + offset, gain * np.array(spec.move.distance)
    motion = quintic(*zip(begin, begin + way, strict=True), duration=spec.move.duration)
    end = motion.duration + 5.0
    swing = PlantSimulation(spec.machine(), motion, [spec.plant.parameters], end)
    return np.abs(swing.at(np.linspace(motion.duration, end, 400))[0].sway)


@pytest.mark.parametrize("preset", ["gantry-crane", "single-pendulum-crane", "tower-crane"])
def test_what_is_allowed_sways_alike_and_what_is_not_does_not(preset):
    spec = preset_spec(preset)
    axes = len(spec.move.start)
    planned = sway_after(spec, np.ones(axes), np.zeros(axes))
    for axis, allowed in enumerate(MACHINES[preset]):
        one = np.eye(axes)[axis]
        shifted = sway_after(spec, np.ones(axes), 0.5 * one)
        mirrored = sway_after(spec, 1.0 - 2.0 * one, 0.5 * one if not allowed.mirror else 0.0 * one)
        smaller = sway_after(spec, 1.0 - 0.5 * one, np.zeros(axes))
        alike = [np.allclose(sway, planned, atol=1e-6) for sway in (shifted, mirrored)]
        assert alike == [allowed.shift, allowed.mirror]
        assert (smaller.max() <= planned.max() * 1.001) or allowed.least_scale == 1.0


@pytest.mark.parametrize(
    ("inputs", "error"),
    [
        ({"fScale": [0.5, 1.0], "bMirror": [True, False]}, 0),
        ({"fStartOffset": [3.0, 0.0], "fActPosition": [3.1, 1.2]}, 0),
        ({"fScale": [1.0, 0.5]}, 7),
        ({"bMirror": [False, True]}, 7),
        ({"fStartOffset": [0.0, 3.0], "fActPosition": [0.1, 4.2]}, 7),
        ({"fScale": [1.0, 1.5]}, 3),
    ],
)
def test_the_block_refuses_what_the_machine_does_not_allow(inputs, error):
    goal = target("cart", "hoist", cycle_time=0.02)
    variants = target_of(preset_spec("single-pendulum-crane")).variants
    text = structured_text.block_text(quintic((0.1, 0.4), (1.2, -0.7)), attrs.evolve(goal, variants=variants))
    outputs = start(checked(text), **inputs)
    assert (outputs["nerrorid"], outputs["berror"]) == (error, error != 0)
    assert "Axis 1, cart: " in text and "allows fScale from 0, bMirror, fStartOffset." in text
    assert "allows no variants." in text
