"""The model description, judged by other people's readers and against the equations."""

import math
import subprocess
import sys
import zipfile
from pathlib import Path

import attrs
import casadi
import fmpy
import numpy as np
import pytest
import ziglang
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from fmu.hoisting_pendulum import PLANT as WINCH

from gen_profile.errors import CosimulationError
from gen_profile.plants.plant import Coordinate, Parameter
from gen_profile.plants.registry import find_plant
from gen_profile_fmu.model_description import BASE_UNITS, model_identifier
from gen_profile_fmu.plant_fmu import plant_fmu
from gen_profile_fmu.variables import plant_variables

PLANTS = [find_plant("double-pendulum-crane"), WINCH]


@pytest.fixture(params=PLANTS, ids=lambda plant: plant.type)
def plant(request):
    return request.param


@pytest.fixture
def description(plant):
    return read_model_description(str(plant_fmu(plant).archive), validate=True)


def test_fmpy_finds_no_fault(plant):
    assert validate_fmu(str(plant_fmu(plant).archive)) == []


def test_fmutool_finds_no_fault(plant):
    tool = Path(sys.executable).with_name("fmutool")
    command = [str(tool), "-input", str(plant_fmu(plant).archive), "-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    words = done.stdout + done.stderr
    assert done.returncode == 0, words
    assert "seems to be compliant with FMI-2.0" in words
    assert "No semantic error" in words


def test_says_what_the_plant_says(plant, description):
    variables = {variable.name: variable for variable in description.modelVariables}
    assert description.modelName == plant.type
    for parameter in plant.parameters:
        variable = variables[parameter.name]
        assert (variable.unit, variable.description) == (parameter.unit, parameter.description)
        assert (variable.causality, variable.variability) == ("parameter", "tunable")
        found = [float(value) for value in (variable.start, variable.min, variable.max)]
        assert found == [parameter.nominal, parameter.lower, parameter.upper]
    for axis in plant.actuated:
        names = [f"{axis.name}.{suffix}" for suffix in ("start", "setpoint", "position", "velocity")]
        kinds = [(variables[name].causality, variables[name].unit) for name in names]
        assert kinds == [("parameter", "m"), ("input", "m"), ("output", "m"), ("output", "m/s")]
    for load in plant.loads:
        units = [variables[f"{quantity}.{load}"].unit for quantity in ("sway", "height", "angle")]
        assert units == ["m", "m", "rad"]


def test_claims_the_capabilities_importers_look_for(description):
    assert description.fmiVersion == "2.0"
    cosimulation = description.coSimulation
    assert cosimulation.canHandleVariableCommunicationStepSize
    assert cosimulation.canGetAndSetFMUstate
    assert cosimulation.canSerializeFMUstate
    assert not cosimulation.needsExecutionTool
    assert not cosimulation.canBeInstantiatedOnlyOncePerProcess
    assert float(description.defaultExperiment.tolerance) > 0.0


def test_every_output_is_listed_with_its_dependencies(plant, description):
    """Start values depend on what the Jacobian of a swinging load's outputs says, and on nothing else."""
    outputs = [variable for variable in description.modelVariables if variable.causality == "output"]
    assert [unknown.variable for unknown in description.outputs] == outputs
    assert [unknown.variable for unknown in description.initialUnknowns] == outputs
    assert all(unknown.dependencies == [] for unknown in description.outputs)

    names = [parameter.name for parameter in plant.parameters]
    starts = [f"{axis.name}.start" for axis in plant.actuated]
    p, q_a = casadi.MX.sym("p", len(names)), casadi.MX.sym("q_a", len(starts))
    q_u = np.linspace(0.3, 0.4, len(plant.unactuated))
    seen = plant.outputs(list(q_u), casadi.vertsplit(q_a), _named(names, casadi.vertsplit(p)))
    expected = {f"{axis.name}.position": {f"{axis.name}.start"} for axis in plant.actuated}
    for quantity in ("sway", "height", "angle"):
        for load, value in zip(plant.loads, getattr(seen, quantity), strict=True):
            jacobian = casadi.jacobian(casadi.MX(value), casadi.vertcat(p, q_a)).sparsity()
            _, columns = jacobian.get_triplet()
            expected[f"{quantity}.{load}"] = {[*names, *starts][column] for column in columns}
    for unknown in description.initialUnknowns:
        found = {variable.name for variable in unknown.dependencies}
        assert found == expected.get(unknown.variable.name, set()), unknown.variable.name


def _named(names, values):
    class Parameters:
        pass

    named = Parameters()
    for name, value in zip(names, values, strict=True):
        setattr(named, name, value)
    return named


def test_units_have_the_right_exponents(description):
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    damping = units.get("N m s/rad")
    if damping is not None:
        assert (damping.kg, damping.m, damping.s, damping.rad) == (1, 2, -1, -1)
    assert (units["m/s^2"].m, units["m/s^2"].s, units["m/s^2"].kg) == (1, -2, 0)


@pytest.mark.parametrize("unit", BASE_UNITS)
def test_base_units_follow_from_the_units_name(unit):
    """Read "N m s/rad" as arithmetic with the base units as powers of primes."""
    primes = {"kg": 2, "m": 3, "s": 5, "rad": 7}
    values = {**primes, "N": 2 * 3 / 5**2, "1": 1}
    above, *below = unit.split("/")
    expected = 1.0
    for part, sign in [(factor, 1) for factor in above.split()] + [(divisor, -1) for divisor in below]:
        name, _, power = part.partition("^")
        expected *= values[name] ** (sign * int(power or 1))
    exponents = BASE_UNITS[unit].items()
    assert np.prod([float(primes[base]) ** power for base, power in exponents]) == pytest.approx(expected)


def test_an_unknown_unit_stays_without_base_units(tmp_path):
    parameter = attrs.evolve(WINCH.parameters[0], unit="stone")
    odd = attrs.evolve(WINCH, parameters=(parameter, *WINCH.parameters[1:]))
    archive = plant_fmu(odd).archive
    assert validate_fmu(str(archive)) == []
    units = {unit.name: unit.baseUnit for unit in read_model_description(str(archive)).unitDefinitions}
    assert units["stone"] is None


def test_a_plant_may_have_unbounded_parameters_and_constant_outputs():
    parameter = attrs.evolve(WINCH.parameters[0], lower=-math.inf, upper=math.inf)
    flat = attrs.evolve(
        WINCH,
        parameters=(parameter, *WINCH.parameters[1:]),
        outputs=lambda *arguments: attrs.evolve(WINCH.outputs(*arguments), height=[-1.0]),
    )
    archive = plant_fmu(flat).archive
    assert validate_fmu(str(archive)) == []
    described = read_model_description(str(archive)).modelVariables[0]
    assert (described.name, described.min, described.max) == ("m", None, None)


@pytest.mark.parametrize(
    ("type_", "identifier"),
    [("double-pendulum-crane", "double_pendulum_crane"), ("2-axis winch", "_2_axis_winch"), ("ü", "_")],
)
def test_the_model_identifier_is_a_c_identifier(type_, identifier):
    assert model_identifier(attrs.evolve(WINCH, type=type_)) == identifier


@pytest.mark.parametrize("name", ["sling", "front-sling"])
def test_names_are_structured_where_they_can_be(name):
    plant = attrs.evolve(WINCH, unactuated=(Coordinate(name=name, unit="rad"),))
    description = read_model_description(str(plant_fmu(plant).archive))
    assert description.variableNamingConvention == ("flat" if "-" in name else "structured")


@pytest.mark.parametrize("name", ["tau", "max_step", "phi"])
def test_two_variables_of_one_name_are_refused(name):
    taken = Parameter(name=name, unit="m", description="", nominal=1.0, lower=0.0, upper=2.0)
    with pytest.raises(CosimulationError, match=f"2 variables named '{name}'"):
        plant_variables(attrs.evolve(WINCH, parameters=(*WINCH.parameters, taken)))


@pytest.mark.parametrize("load", ["the load", "100%", 'say "so"', "Ä", ""])
def test_names_that_importers_do_not_take_are_refused(load):
    with pytest.raises(CosimulationError, match="cannot name a variable"):
        plant_variables(attrs.evolve(WINCH, loads=(load,)))


def test_the_archive_holds_the_unpacked_files(plant):
    fmu = plant_fmu(plant)
    with zipfile.ZipFile(fmu.archive) as archive:
        assert archive.testzip() is None
        names = archive.namelist()
        assert "modelDescription.xml" in names
        assert len(names) == 2
        for name in names:
            assert archive.read(name) == (fmu.folder / name).read_bytes()
            assert archive.getinfo(name).date_time == (1980, 1, 1, 0, 0, 0)


def test_no_path_of_this_computer_gets_out(plant):
    fmu = plant_fmu(plant)
    folders = [fmu.folder.parent, Path(ziglang.__file__).parent, Path(fmpy.__file__).parent]
    for path in fmu.folder.rglob("*.*"):
        content = path.read_bytes()
        assert not [folder for folder in folders if str(folder).encode() in content]
