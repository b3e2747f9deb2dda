"""The model descriptions, judged by other people's readers and against the equations."""

import importlib.metadata
import io
import math
import re
import subprocess
import sys
import zipfile
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import attrs
import casadi
import fmpy
import numpy as np
import pytest
import ziglang
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from fmu.hoisting_pendulum import PLANT as WINCH
from fmu.kinds import ALL_KINDS, INPUTS, KINDS, PAIRS, model_of

from gen_profile.plants.plant import Coordinate, Parameter
from gen_profile.plants.registry import BUILT_IN, find_plant
from gen_profile.support.errors import CosimulationError
from gen_profile_exporters.planner.c_source import c_name
from gen_profile_fmu.building.plant_fmu import cached_fmu, plant_fmu
from gen_profile_fmu.description.base_units import BASE_UNITS
from gen_profile_fmu.description.fmu_files import Version, archive, fmu_files, sources
from gen_profile_fmu.model.variables import variable_name

PLANTS = [*(find_plant(name) for name in BUILT_IN), WINCH]
CRANE = find_plant("double-pendulum-crane")


@cache
def read(model, version):
    """The model description as FMPy reads it, from an FMU without binaries."""
    packed = archive(fmu_files(sources(model, version), {}, with_extras=False))
    return read_model_description(io.BytesIO(packed), validate=True)


@pytest.fixture(params=PLANTS, ids=lambda plant: plant.type)
def plant(request):
    return request.param


@pytest.fixture(params=Version)
def version(request):
    return request.param


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


@pytest.fixture
def in_turn(plant, kind):
    """One version, either in turn: both are written from the same model."""
    return [*Version][(PLANTS.index(plant) + KINDS.index(kind)) % 2]


@pytest.mark.slow
def test_fmpy_finds_no_fault(plant, kind, in_turn, tmp_path):
    path = tmp_path / "model.fmu"
    path.write_bytes(archive(fmu_files(sources(model_of(kind, plant), in_turn), {}, with_extras=False)))
    assert validate_fmu(str(path)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "version"), PAIRS)
def test_fmutool_finds_no_fault(kind, version):
    tool = Path(sys.executable).with_name("fmutool")
    built = cached_fmu(model_of(kind, CRANE), version).archive
    done = subprocess.run(
        [str(tool), "-input", str(built), "-check"], capture_output=True, text=True, check=False
    )
    words = done.stdout + done.stderr
    assert done.returncode == 0, words
    assert f"seems to be compliant with FMI-{version.value}.0" in words
    assert "No semantic error" in words


@pytest.mark.parametrize("kind", INPUTS)
def test_says_what_the_plant_says(plant, kind, in_turn):
    description = read(model_of(kind, plant), in_turn)
    variables = {variable.name: variable for variable in description.modelVariables}
    assert description.modelName == plant.type
    for parameter in plant.parameters:
        variable = variables[parameter.name]
        assert (variable.unit, variable.description) == (parameter.unit, parameter.description)
        assert (variable.causality, variable.variability) == ("parameter", "tunable")
        found = [float(value) for value in (variable.start, variable.min, variable.max)]
        assert found == [parameter.nominal, parameter.lower, parameter.upper]
    suffix, order = {
        "plant-acceleration": ("setpoint_acceleration", "/s^2"),
        "plant-velocity": ("setpoint_velocity", "/s"),
        "plant-setpoint": ("setpoint", ""),
    }[kind]
    for axis in plant.actuated:
        names = [f"{axis.name}.{name}" for name in ("start", suffix, "position", "velocity")]
        kinds = [(variables[name].causality, variables[name].unit) for name in names]
        unit = axis.unit
        assert kinds == [
            ("parameter", unit),
            ("input", unit + order),
            ("output", unit),
            ("output", unit + "/s"),
        ]
    for load in map(variable_name, plant.loads):
        units = [variables[f"{quantity}.{load}"].unit for quantity in ("sway", "height", "angle")]
        assert units == ["m", "m", "rad"]
    for body in plant.bodies:
        assert [variables[f"position.{body}.{direction}"].unit for direction in "xyz"] == ["m"] * 3
        assert variables["energy"].unit == "J"


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_claims_the_capabilities_importers_look_for(kind, version):
    root = ElementTree.fromstring(sources(model_of(kind, CRANE), version).description)
    assert root.get("fmiVersion") == f"{version.value}.0"
    names = {
        Version.FMI2: ("canGetAndSetFMUstate", "canSerializeFMUstate", "providesDirectionalDerivative"),
        Version.FMI3: (
            "canGetAndSetFMUState",
            "canSerializeFMUState",
            "providesDirectionalDerivatives",
            "providesAdjointDerivatives",
        ),
    }[version]
    for title in ("ModelExchange", "CoSimulation"):
        interface = root.find(title)
        assert interface.get("needsExecutionTool", "false") == "false"
        assert interface.get("canBeInstantiatedOnlyOncePerProcess", "false") == "false"
        assert [interface.get(name) for name in names] == ["true"] * len(names)
    assert interface.get("canHandleVariableCommunicationStepSize") == "true"
    takes_slopes = kind in {"plant-acceleration", "plant-velocity"}
    if version is Version.FMI2:
        assert interface.get("canInterpolateInputs") == str(takes_slopes).lower()
    else:
        on_the_way = {v.get("causality") for v in root.find("ModelVariables") if v.get("intermediateUpdate")}
        assert on_the_way == ({"input", "output"} if takes_slopes else set())
        assert interface.get("providesIntermediateUpdate") == str(takes_slopes).lower()
    assert float(root.find("DefaultExperiment").get("tolerance")) > 0.0


def names(unknown):
    return {variable.name for variable in unknown.dependencies}


@pytest.mark.parametrize("kind", [*INPUTS, "system"])
def test_dependencies_are_those_of_the_equations(plant, kind, in_turn):
    """What an output and a derivative follows from, against a Jacobian of our own making."""
    description = read(model_of(kind, plant), in_turn)
    states = [derivative.variable.derivative.name for derivative in description.derivatives]
    n_u, n_a = len(plant.unactuated), len(plant.actuated)
    assert states == [
        *(q.name for q in plant.unactuated),
        *(f"{q.name}.rate" for q in plant.unactuated),
        *(f"{q.name}.position" for q in plant.actuated),
        *(f"{q.name}.velocity" for q in plant.actuated),
    ]
    x, ddq_a = casadi.SX.sym("x", len(states)), casadi.SX.sym("ddq_a", n_a)
    p = casadi.SX.sym("p", len(plant.parameters))
    q_u, dq_u, q_a, dq_a = casadi.vertsplit(x, np.cumsum([0, n_u, n_u, n_a, n_a]).tolist())
    named = _named([q.name for q in plant.parameters], casadi.vertsplit(p))
    each = [casadi.vertsplit(column) for column in (q_u, dq_u, q_a, dq_a)]
    terms = plant.equations(*each, named)
    push = casadi.vertcat(*(casadi.horzcat(*row) for row in terms.M_au)).T @ ddq_a
    ddq_u = casadi.solve(
        casadi.vertcat(*(casadi.horzcat(*row) for row in terms.M_uu)),
        casadi.vertcat(*terms.K_u) + casadi.vertcat(*terms.G_u) - push,
    )
    accelerations = {
        "plant-acceleration": lambda axis: {f"{axis}.setpoint_acceleration"},
        "plant-velocity": lambda axis: {f"{axis}.setpoint_velocity", f"{axis}.velocity"},
        "plant-setpoint": lambda axis: {f"{axis}.velocity"},
        "system": lambda axis: {f"{axis}.velocity", "time"},
    }[kind]
    drives = [accelerations(axis.name) for axis in plant.actuated]

    def sources_of(expression):
        """Names of the states and inputs that have an influence on an expression."""
        occurring = casadi.jacobian(casadi.SX(expression), casadi.vertcat(x, ddq_a))
        columns = casadi.sparsify(casadi.simplify(occurring)).sparsity().get_triplet()[1]
        each_column = [*({state} for state in states), *drives]
        return set().union(*(each_column[column] for column in columns))

    found = {unknown.variable.name: names(unknown) for unknown in description.derivatives}
    expected = {
        **{f"der({q.name})": {f"{q.name}.rate"} for q in plant.unactuated},
        **{f"der({q.name}.rate)": sources_of(ddq_u[i]) for i, q in enumerate(plant.unactuated)},
        **{f"der({q.name}.position)": {f"{q.name}.velocity"} for q in plant.actuated},
        **{f"der({q.name}.velocity)": drives[i] for i, q in enumerate(plant.actuated)},
    }
    assert found == expected
    seen = plant.outputs(each[0], each[2], named)
    found = {unknown.variable.name: names(unknown) for unknown in description.outputs}
    for quantity in ("sway", "height", "angle"):
        for load, value in zip(plant.loads, getattr(seen, quantity), strict=True):
            assert found[f"{quantity}.{variable_name(load)}"] == sources_of(value)
    mechanics = plant.mechanics(each[0], each[2], named)
    places = [casadi.vertcat(*place) for place in mechanics.place]
    for body, place in zip(plant.bodies, places, strict=True):
        for direction, value in zip("xyz", casadi.vertsplit(place), strict=True):
            assert found[f"position.{body}.{direction}"] == sources_of(value)
    if plant.bodies:
        q, dq = casadi.vertcat(q_u, q_a), casadi.vertcat(dq_u, dq_a)
        speeds = [casadi.jacobian(place, q) @ dq for place in places]
        kinetic = sum(m * casadi.sumsqr(speed) for m, speed in zip(mechanics.mass, speeds, strict=True))
        assert found["energy"] == sources_of(kinetic) | sources_of(mechanics.potential)
    for state in states:
        assert found[state] == {state}


def _named(names, values):
    class Parameters:
        pass

    named = Parameters()
    for name, value in zip(names, values, strict=True):
        setattr(named, name, value)
    return named


@pytest.mark.parametrize("kind", INPUTS)
def test_start_values_follow_from_parameters_and_start_states(plant, kind, in_turn):
    description = read(model_of(kind, plant), in_turn)
    starting = {unknown.variable.name: names(unknown) for unknown in description.initialUnknowns}
    calculated = {v.name for v in description.modelVariables if v.initial == "calculated"}
    assert set(starting) == calculated
    parameters = {parameter.name for parameter in plant.parameters}
    coordinates = {q.name for q in plant.unactuated}
    for axis in plant.actuated:
        assert starting[f"{axis.name}.position"] == {f"{axis.name}.start"}
        assert starting[f"{axis.name}.velocity"] == set()
    starts = {f"{axis.name}.start" for axis in plant.actuated}
    for load in map(variable_name, plant.loads):
        assert starting[f"angle.{load}"] <= parameters | coordinates | starts
    for unknown in description.derivatives:
        name = unknown.variable.name
        assert names(unknown) & coordinates == starting[name] & coordinates, name
    used = set().union(*starting.values())
    assert parameters <= used | {
        "g"
    }  # every parameter matters to something, but gravity not on every machine


def test_units_have_the_right_exponents(plant, version):
    description = read(model_of("system", plant), version)
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    used = {variable.unit for variable in description.modelVariables} - {None}
    assert used == set(units)
    assert all(units[unit] is not None for unit in used - {"N m s"})
    for unit, order in (("m/s", 1), ("m/s^2", 2), ("rad/s", 1)):
        if unit in units:
            assert (units[unit].s, units[unit].kg) == (-order, 0)


@pytest.mark.parametrize("unit", BASE_UNITS)
def test_base_units_follow_from_the_units_name(unit):
    """Read "N m s/rad" as arithmetic with the base units as powers of primes."""
    primes = {"kg": 2, "m": 3, "s": 5, "rad": 7}
    values = {**primes, "N": 2 * 3 / 5**2, "J": 2 * 3**2 / 5**2, "Pa": 2 / 3 / 5**2, "1": 1}
    above, *below = unit.split("/")
    expected = 1.0
    for part, sign in [(factor, 1) for factor in above.split()] + [(divisor, -1) for divisor in below]:
        name, _, power = part.partition("^")
        expected *= values[name] ** (sign * int(power or 1))
    exponents = BASE_UNITS[unit].items()
    assert np.prod([float(primes[base]) ** power for base, power in exponents]) == pytest.approx(expected)


def test_an_unknown_unit_stays_without_base_units(version):
    parameter = attrs.evolve(WINCH.parameters[0], unit="stone")
    odd = attrs.evolve(WINCH, parameters=(parameter, *WINCH.parameters[1:]))
    units = {unit.name: unit.baseUnit for unit in read(model_of("system", odd), version).unitDefinitions}
    assert units["stone"] is None


@pytest.mark.slow
def test_a_plant_may_have_unbounded_parameters_and_constant_outputs(version):
    parameter = attrs.evolve(WINCH.parameters[0], lower=-math.inf, upper=math.inf)
    flat = attrs.evolve(
        WINCH,
        parameters=(parameter, *WINCH.parameters[1:]),
        outputs=lambda *arguments: attrs.evolve(WINCH.outputs(*arguments), height=[-1.0]),
    )
    built = cached_fmu(model_of("plant-setpoint", flat), version).archive
    assert validate_fmu(str(built)) == []
    described = read_model_description(str(built)).modelVariables[0]
    assert (described.name, described.min, described.max) == ("m", None, None)


@pytest.mark.parametrize(
    ("type_", "identifier"),
    [("double-pendulum-crane", "double_pendulum_crane"), ("2-axis winch", "_2_axis_winch"), ("ü", "_")],
)
def test_the_model_identifier_is_a_c_identifier(type_, identifier):
    assert c_name(type_) == identifier


# FMI 2.0.4, section 2.2.9, and FMI 3.0, section 2.4.7.5.1, but for arrays and quotes
STRUCTURED = re.compile(r"[a-zA-Z_]\w*(\.[a-zA-Z_]\w*)*|der\([a-zA-Z_]\w*(\.[a-zA-Z_]\w*)*\)", re.ASCII)


def test_every_name_is_structured(plant, kind, in_turn):
    root = ElementTree.fromstring(sources(model_of(kind, plant), in_turn).description)
    assert root.get("variableNamingConvention") == "structured"
    named = [variable.get("name") for variable in root.find("ModelVariables")]
    assert [name for name in named if not STRUCTURED.fullmatch(name)] == []


def test_a_plants_hyphens_become_underscores(version):
    plant = attrs.evolve(WINCH, unactuated=(Coordinate(name="front-sling", unit="rad"),))
    description = read(model_of("plant-setpoint", plant), version)
    assert "front_sling.rate" in {variable.name for variable in description.modelVariables}


def test_tells_who_made_it_with_what(version):
    root = ElementTree.fromstring(sources(model_of("system", CRANE), version).description)
    release = importlib.metadata.version("gen-profile")
    assert root.get("version") == release
    assert root.get("generationTool") == f"gen-profile {release}"
    assert root.get("author") == "gen-profile"


def test_shows_angles_in_degrees_and_sway_in_millimetres(version):
    description = read(model_of("system", CRANE), version)
    variables = {variable.name: variable for variable in description.modelVariables}
    units = {unit.name: {shown.name: shown.factor for shown in unit.displayUnits}
             for unit in description.unitDefinitions}  # fmt: skip
    for name, unit, shown, factor in (
        ("theta1", "rad", "deg", 180.0 / math.pi),
        ("theta1.rate", "rad/s", "deg/s", 180.0 / math.pi),
        ("sway.payload", "m", "mm", 1000.0),
    ):
        found = variables[name]
        found = found.declaredType or found
        assert (found.unit, found.displayUnit) == (unit, shown)
        assert float(units[unit][shown]) == pytest.approx(factor, rel=1e-15)
    assert variables["cart.position"].displayUnit is None


@pytest.mark.parametrize("name", ["tau", "max_step", "phi", "time"])
def test_two_variables_of_one_name_are_refused(name):
    taken = Parameter(name=name, unit="m", description="", nominal=1.0, lower=0.0, upper=2.0)
    plant = attrs.evolve(WINCH, parameters=(*WINCH.parameters, taken))
    with pytest.raises(CosimulationError, match=f"2 variables named '{name}'"):
        model_of("plant-setpoint", plant)


@pytest.mark.parametrize("load", ["the load", "100%", 'say "so"', "Ä", ""])
@pytest.mark.parametrize("kind", ["plant-setpoint", "system"])
def test_names_that_importers_do_not_take_are_refused(load, kind):
    with pytest.raises(CosimulationError, match="cannot name a variable"):
        model_of(kind, attrs.evolve(WINCH, loads=(load,)))


def test_the_archive_holds_the_unpacked_files(plant):
    fmu = plant_fmu(plant)
    with zipfile.ZipFile(fmu.archive) as packed:
        assert packed.testzip() is None
        contents = packed.namelist()
        assert "modelDescription.xml" in contents
        assert len(contents) == 2
        for name in contents:
            assert packed.read(name) == (fmu.folder / name).read_bytes()
            assert packed.getinfo(name).date_time == (1980, 1, 1, 0, 0, 0)


def test_no_path_of_this_computer_gets_out(plant):
    fmu = plant_fmu(plant)
    folders = [fmu.folder.parent, Path(ziglang.__file__).parent, Path(fmpy.__file__).parent]
    for path in fmu.folder.rglob("*.*"):
        content = path.read_bytes()
        assert not [folder for folder in folders if str(folder).encode() in content]
