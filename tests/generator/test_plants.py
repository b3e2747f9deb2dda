"""Machines against analytic mechanics and separately derived equations."""

from importlib.metadata import EntryPoint, EntryPoints
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.plants import registry
from gen_profile.plants.registry import find_plant, plant_types
from gen_profile.support.errors import SpecError

CRANE = find_plant("double-pendulum-crane")
ANGLES = st.floats(-1.5, 1.5)
PAIR = st.tuples(ANGLES, ANGLES)
CRANES = st.fixed_dictionaries(
    {
        "m1": st.floats(0.1, 1000.0),
        "m2": st.floats(0.1, 1000.0),
        "L1": st.floats(0.2, 20.0),
        "L2": st.floats(0.2, 20.0),
        "g": st.floats(1.0, 20.0),
        "c1": st.floats(0.0, 10.0),
        "c2": st.floats(0.0, 10.0),
    }
)


def absolute(q):
    """Both angles from the vertical."""
    return np.cumsum(q)


@given(PAIR, CRANES)
def test_sway_height_and_angle_are_where_the_loads_hang(q, parameters):
    p = SimpleNamespace(**parameters)
    outputs = CRANE.outputs(q, [0.0], p)
    ropes = np.array([p.L1, p.L2]) * np.exp(
        1j * absolute(q)
    )  # along the vertical, trailing as the imaginary part
    hanging = np.cumsum(ropes)
    np.testing.assert_allclose(outputs.sway, hanging.imag, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(outputs.height, -hanging.real, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(outputs.angle, absolute(q), rtol=1e-15)


@pytest.mark.parametrize(("payload", "frequencies"), [(0.203, (3.640, 9.017)), (0.201, (3.642, 8.990))])
def test_the_papers_frequencies_belong_to_another_payload(payload, frequencies):
    found = linearize(CRANE, CRANE.nominal() | {"m2": payload}).frequencies
    np.testing.assert_allclose(found, frequencies, atol=5e-4)


def test_nominal_parameters_lie_within_their_bounds():
    for type_ in plant_types():
        for parameter in find_plant(type_).parameters:
            assert parameter.lower <= parameter.nominal <= parameter.upper


def test_every_type_of_the_list_is_found_by_its_name():
    assert [find_plant(type_).type for type_ in plant_types()] == plant_types()


def test_other_distributions_add_machines(monkeypatch):
    own = EntryPoint("winch", "fmu.hoisting_pendulum:PLANT", registry.GROUP)

    monkeypatch.setattr(registry, "entry_points", EntryPoints([own]).select)
    assert "winch" in plant_types()
    assert find_plant("winch").parameters
    with pytest.raises(KeyError):
        find_plant("crane")


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("no_such_module:PLANT", "No module named"),
        ("fmu.hoisting_pendulum:outputs", "is no gen_profile"),
        ("generator.unsound_plant:PLANT", "M_uu is singular at rest"),
    ],
)
def test_a_broken_machine_of_another_distribution(monkeypatch, value, why):
    broken = EntryPoints([EntryPoint("winch", value, registry.GROUP)])
    monkeypatch.setattr(registry, "entry_points", broken.select)
    assert "winch" in plant_types()
    with pytest.raises(SpecError, match=rf"plant\.type: 'winch'.*{why}.*update or uninstall"):
        find_plant("winch")
