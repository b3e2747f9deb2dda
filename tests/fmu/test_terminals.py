"""Terminals of FMI 3, by the standard's schemas and by what they are to connect."""

import io
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmu.hoisting_pendulum import PLANT as WINCH
from fmu.kinds import ALL_KINDS, model_of
from lxml import etree

from gen_profile.plants.registry import BUILT_IN, find_plant
from gen_profile_fmu.description.fmu_files import Version, archive, fmu_files, sources
from gen_profile_fmu.model.contents import plant_model
from gen_profile_fmu.model.plant_variables import InputKind, PlantInstance

SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"


@pytest.fixture(scope="module")
def schema():
    return {
        name: etree.XMLSchema(etree.parse(SCHEMAS / f"fmi3{name}.xsd"))
        for name in ("TerminalsAndIcons", "BuildDescription")
    }


def files_of(model):
    packed = archive(fmu_files(sources(model, Version.FMI3), {}))
    with zipfile.ZipFile(io.BytesIO(packed)) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def terminals(files):
    """Variables' names by terminal and member."""
    root = etree.fromstring(files["terminalsAndIcons/terminalsAndIcons.xml"])
    return {
        terminal.get("name"): {member.get("memberName"): member.get("variableName") for member in terminal}
        for terminal in root.iter("Terminal")
    }


def variables(files):
    root = etree.fromstring(files["modelDescription.xml"])
    return {variable.get("name"): variable for variable in root.find("ModelVariables")}


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_are_what_the_standard_says(schema, kind):
    files = files_of(model_of(kind, find_plant("double-pendulum-crane")))
    schema["TerminalsAndIcons"].assertValid(
        etree.fromstring(files["terminalsAndIcons/terminalsAndIcons.xml"])
    )
    schema["BuildDescription"].assertValid(etree.fromstring(files["sources/buildDescription.xml"]))
    assert files["terminalsAndIcons/icon.png"].startswith(b"\x89PNG")


@pytest.mark.parametrize("plant", [*map(find_plant, BUILT_IN), WINCH], ids=lambda plant: plant.type)
@pytest.mark.parametrize("kind", InputKind)
def test_connect_a_profile_with_a_plant(kind, plant):
    """Every input of the plant has an output of the profile to be connected with, and of its unit."""
    # a winch whose rope had no length could not be pictured
    machine = PlantInstance(plant=plant, parameters=plant.nominal(), position=[1.0] * len(plant.actuated))
    profile, driven = files_of(model_of("profile", plant)), files_of(plant_model(machine, kind))
    given, taken = variables(profile), variables(driven)
    connected = set()
    for name, members in terminals(driven).items():
        for member, variable in members.items():
            other = terminals(profile).get(name, {}).get(member)
            if taken[variable].get("causality") == "input":
                assert given[other].get("causality") == "output"
                assert given[other].get("unit") == taken[variable].get("unit")
                connected.add(variable)
    assert connected == {name for name, variable in taken.items() if variable.get("causality") == "input"}
    bodies = {f"position.{body}": {*"xyz"} for body in plant.bodies}
    axes = {axis.name for axis in plant.actuated}
    assert {name: set(found) for name, found in terminals(driven).items() if name not in axes} == bodies
