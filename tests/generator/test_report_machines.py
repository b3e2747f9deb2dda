"""Drawings of machines: points against the places of the masses that Lagrange's equations were made of."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from generator.lagrangian_machines import double_pendulum, flexible_joint, gantry, single_pendulum, tower
from scipy.integrate import trapezoid

from gen_profile.plants.looks import body_size, drawings, pose_of
from gen_profile.plants.machine_file import plant_of_file, read_machine_file
from gen_profile.plants.plant import Coordinate
from gen_profile.plants.registry import find_plant, plant_types
from gen_profile.presentation.report.animation import Actor, Animation
from gen_profile.presentation.report.page import ASSETS

FRAMES = 50
LINES = {"rail", "rope", "spring", "plumb", "frame", "liquid"}
EXAMPLE = "examples/inclined_crane.py"


def swinging(plant, seed=1):
    """A machine that moves its axes and swings at random, by less than a radian."""
    random = np.random.default_rng(seed)
    times = np.linspace(0.0, 1.0, FRAMES)[:, None]
    q_a = 2.0 + 3.0 * times * random.uniform(0.5, 1.0, len(plant.actuated))
    q_u = 0.3 * np.sin(7.0 * times + random.uniform(0.0, 6.0, len(plant.unactuated)))
    parameters = plant.nominal()
    return plant, pose_of(plant, parameters, q_a, q_u, body_size(plant, parameters, q_a))


def shown(drawing, kind, which=0):
    """Where the last point of a drawing's shape is, (frames, 2)."""
    shape = [shape for shape in drawing.shapes if shape.kind == kind][which]
    return drawing.points[:, shape.points[-1]]


def places(lagrangian, pose):
    """Cartesian places of all masses, (frames, masses, 3)."""
    q = [*pose.q_u.T, *pose.q_a.T]
    masses, _ = lagrangian(q, SimpleNamespace(**pose.parameters))
    return np.array([[np.broadcast_to(x, FRAMES) for x in place] for _, place in masses]).transpose(2, 0, 1)


def test_hook_and_payload_are_drawn_where_their_masses_are():
    plant, pose = swinging(find_plant("double-pendulum-crane"))
    (side,) = drawings(plant, pose)
    hook, payload = places(double_pendulum, pose)[:, :, [0, 2]].transpose(1, 0, 2)
    np.testing.assert_allclose(shown(side, "hook"), hook, atol=1e-12)
    np.testing.assert_allclose(shown(side, "load"), payload, atol=1e-12)


def test_a_hoisted_load_is_drawn_where_its_mass_is():
    plant, pose = swinging(find_plant("single-pendulum-crane"))
    (side,) = drawings(plant, pose)
    np.testing.assert_allclose(shown(side, "load"), places(single_pendulum, pose)[:, 0, [0, 2]], atol=1e-12)


@pytest.mark.parametrize("number, axes", [(0, [0, 2]), (1, [0, 1])])
def test_a_gantry_s_load_is_drawn_where_its_mass_is_from_both_sides(number, axes):
    plant, pose = swinging(find_plant("gantry-crane"))
    np.testing.assert_allclose(
        shown(drawings(plant, pose)[number], "load"), places(gantry, pose)[:, 0, axes], atol=1e-12
    )


def test_a_tower_crane_s_load_is_drawn_where_its_mass_is_from_above():
    plant, pose = swinging(find_plant("tower-crane"))
    above, along = drawings(plant, pose)
    mass = places(tower, pose)[:, 0]
    np.testing.assert_allclose(shown(above, "load"), mass[:, :2], atol=1e-12)
    slew = pose.q_a[:, 0]
    radial = mass[:, 0] * np.cos(slew) + mass[:, 1] * np.sin(slew)
    np.testing.assert_allclose(shown(along, "load"), np.stack([radial, mass[:, 2]], 1), atol=1e-12)


def test_an_arm_is_drawn_at_its_angle():
    plant, pose = swinging(find_plant("flexible-joint"))
    (above,) = drawings(plant, pose)
    along = places(flexible_joint, pose)[:, 0, :2]  # of length 1
    np.testing.assert_allclose(shown(above, "load"), pose.p.R * along, atol=1e-12)


def test_masses_of_a_chain_trail_their_places_by_their_coordinates():
    plant, pose = swinging(find_plant("mass-spring-chain-3"))
    (side,) = drawings(plant, pose)
    blocks = [shape.points[0] for shape in side.shapes if shape.kind == "load"]
    trailing = side.rest[:, blocks, 0] - side.points[:, blocks, 0]
    np.testing.assert_allclose(trailing, pose.q_u, atol=1e-12)
    np.testing.assert_allclose(np.diff(side.rest[:, [2, *blocks], 0], axis=1).std(axis=0), 0.0, atol=1e-12)


def test_a_liquid_rises_at_the_trailing_wall_as_the_plant_says_and_keeps_its_volume():
    plant, pose = swinging(find_plant("slosh-tank"))
    (side,) = drawings(plant, pose)
    (liquid,) = (shape for shape in side.shapes if shape.kind == "liquid")
    surface = side.points[:, liquid.points[1:-1]]
    (rise,), _ = pose.loads()
    np.testing.assert_allclose(surface[:, 0, 1] - pose.p.h, rise, atol=1e-12)
    np.testing.assert_allclose(trapezoid(surface[..., 1], surface[..., 0]), pose.p.a * pose.p.h, rtol=1e-12)


def test_a_machine_of_one_s_own_is_drawn_from_its_outputs(request):
    plant = plant_of_file(read_machine_file(request.config.rootpath / EXAMPLE))
    plant, pose = swinging(plant)
    (side,) = drawings(plant, pose)
    slope = np.array([np.cos(pose.p.s), np.sin(pose.p.s)])
    np.testing.assert_allclose(shown(side, "body"), pose.q_a * slope, atol=1e-12)
    rope = shown(side, "load") - shown(side, "body")
    np.testing.assert_allclose(np.linalg.norm(rope, axis=1), pose.p.L, rtol=1e-12)


def test_one_s_own_turning_machine_without_places_hangs_from_where_it_turns(request):
    plant = plant_of_file(read_machine_file(request.config.rootpath / EXAMPLE))
    turning = Coordinate(name="turntable", unit="rad")
    plant, pose = swinging(attrs.evolve(plant, actuated=(turning,), bodies=()))
    (side,) = drawings(plant, pose)
    np.testing.assert_allclose(shown(side, "body"), 0.0, atol=1e-12)
    (sway,), (height,) = pose.loads()
    np.testing.assert_allclose(shown(side, "load"), np.stack([-sway, height], 1), atol=1e-12)


@pytest.mark.parametrize("type_", plant_types())
def test_every_machine_s_animation_keeps_its_points_in_the_picture_and_to_a_thousandth_of_it(type_):
    plant, pose = swinging(find_plant(type_))
    actor = Actor(name="nominal", colour="#000", sway=pose.q_u[:, 0], drawings=drawings(plant, pose))
    animation = Animation(
        times=np.linspace(0.0, 1.0, FRAMES), arrival=0.5, limit=0.1, load="load", actors=[actor]
    )
    document = animation.to_json()
    for view, moving, drawing in zip(
        document["views"], document["actors"][0]["views"], actor.drawings, strict=True
    ):
        left, bottom, width, height = view["bounds"]
        found = np.array(moving["rest"]) * view["units"][0] + np.array(moving["swing"]) * view["units"][1]
        found = found.reshape(FRAMES, -1, 2)
        np.testing.assert_allclose(found, drawing.points, atol=1e-3 * max(width, height))
        assert (found >= [left, bottom]).all() and (found <= [left + width, bottom + height]).all()
        assert all(max(shape["points"]) < found.shape[1] for shape in moving["shapes"])


def test_the_page_s_script_knows_every_kind_of_shape():
    script = (ASSETS / "animation.js").read_text("utf-8")
    for type_ in plant_types():
        for drawing in drawings(*swinging(find_plant(type_))):
            for shape in drawing.shapes:
                assert shape.kind == "load" or f"    {shape.kind}: {{" in script
                assert (shape.size != (0.0, 0.0)) == (shape.kind not in LINES)
