"""A profile and a plant as an SSP: by the standard's schemas, and in other people's co-simulation masters."""

import importlib
import io
import re
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
from command_line import run_here
from fmpy import read_model_description, simulate_fmu
from fmpy.ssp.simulation import simulate_ssp
from lxml import etree
from system_parts import missing

SCHEMAS = Path(fmpy.__file__).parent / "ssp" / "schema"
SPACES = {
    name: f"http://ssp-standard.org/SSP1/SystemStructure{words}"
    for name, words in (("ssc", "Common"), ("ssd", "Description"), ("ssv", "ParameterValues"))
}
STEP, STOP = 0.004, 5.0
SWAY = 1e-6  # m, left on ideal drives


@pytest.fixture(scope="module", params=["2", "3"])
def version(request):
    return request.param


@pytest.fixture(scope="module")
def package(version, tmp_path_factory):
    path = tmp_path_factory.mktemp("ssp") / "paper.ssp"
    step = ("--set", f"export.cycle_time={STEP}")
    done = run_here("fmu", "ssp", "--fmi", version, *step, "--out", path, "--json")
    assert done.code == 0, done.err
    assert done.document["model_identifier"] == "paper"
    return path


@pytest.fixture(scope="module")
def folder(package):
    with zipfile.ZipFile(package) as opened:
        opened.extractall(package.parent)
    return package.parent


@pytest.fixture(scope="module")
def files(package):
    with zipfile.ZipFile(package) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def test_is_what_the_standard_says(files):
    assert sorted(files) == [
        "SystemStructure.ssd",
        *(f"resources/paper_{part}" for part in ("plant.fmu", "plant.ssv", "profile.fmu", "profile.ssv")),
    ]
    for name, content in files.items():
        if not name.endswith(".fmu"):
            words = "Description" if name.endswith(".ssd") else "ParameterValues"
            schema = etree.XMLSchema(etree.parse(str(SCHEMAS / f"SystemStructure{words}.xsd")))
            schema.assertValid(etree.fromstring(content))


def test_tells_what_its_fmus_tell(files):
    """Connectors, parameters with their values, units, and that every input has a source."""
    root = etree.fromstring(files["SystemStructure.ssd"])
    kinds, units = {}, {}
    for component in root.iterfind(".//ssd:Component", SPACES):
        description = read_model_description(io.BytesIO(files[component.get("source")]))
        variables = {variable.name: variable for variable in description.modelVariables}
        name = component.get("name")
        for connector in component.iterfind(".//ssd:Connector", SPACES):
            variable = variables[connector.get("name")]
            kinds[name, variable.name] = variable.causality
            units[name, variable.name] = variable.unit
            assert connector.get("kind") == variable.causality
            assert connector[0].get("unit") == variable.unit
        binding = component.find(".//ssd:ParameterBinding", SPACES)
        values = etree.fromstring(files[binding.get("source")]).iterfind(".//ssv:Parameter", SPACES)
        stated = {value.get("name"): value[0] for value in values}
        assert set(stated) == {v.name for v in variables.values() if v.causality == "parameter"}
        for parameter, value in stated.items():
            assert value.get("value") == variables[parameter].start
            assert value.get("unit") == variables[parameter].unit
    connections = [dict(found.attrib) for found in root.iterfind(".//ssd:Connection", SPACES)]
    for connection in connections:
        start = connection["startElement"], connection["startConnector"]
        end = connection["endElement"], connection["endConnector"]
        assert (kinds[start], kinds[end], units[start]) == ("output", "input", units[end])
    assert [connection["endConnector"] for connection in connections] == ["cart.setpoint"]


def judge(rows, folder):
    """Whether the plant followed its profile one step later, as parallel masters deliver, and calmly."""
    position, sway = np.array([[0.0, 0.0], *rows]).T
    profile = str(folder / "resources" / "paper_profile.fmu")
    alone = simulate_fmu(profile, stop_time=STOP, output_interval=STEP, fmi_type="CoSimulation")
    setpoint, count = alone["cart.setpoint"], len(position)
    np.testing.assert_allclose(position[1:], setpoint[: count - 1], rtol=0.0, atol=1e-12)
    after = np.arange(count) * STEP > 3.0 + 2.0 * STEP
    assert np.abs(sway).max() > 1e-2
    assert np.abs(sway[after]).max() < SWAY


@pytest.mark.parametrize("version", ["2"], indirect=True)  # which is all that FMPy's master knows
def test_fmpy_runs_it(package):
    found = simulate_ssp(str(package), stop_time=STOP, step_size=STEP)
    sway = found["plant.sway.payload"]
    assert found["plant.cart.position"][-1] == pytest.approx(0.3, abs=1e-12)
    assert np.abs(sway).max() > 1e-2
    assert np.abs(sway[found["time"] > 3.0 + 2.0 * STEP]).max() < SWAY


def test_ecos_runs_it(ecos, package, folder):
    rows = []
    with ecos.EcosSimulation(ssp_path=str(package), step_size=STEP) as simulation:
        simulation.init()
        for _ in range(round(STOP / STEP)):
            simulation.step()
            rows.append([simulation.get_real(f"plant::{name}") for name in ("cart.position", "sway.payload")])
    judge(rows, folder)


def test_ecos_takes_the_parameters(ecos, files, tmp_path):
    values = files["resources/paper_plant.ssv"]
    changed = re.sub(rb'(name="L1">\s*<ssv:Real value=")[^"]*', rb"\g<1>0.5", values)
    other = tmp_path / "other.ssp"
    with zipfile.ZipFile(other, "w") as archive:
        for name, content in {**files, "resources/paper_plant.ssv": changed}.items():
            archive.writestr(name, content)
    with ecos.EcosSimulation(ssp_path=str(other), step_size=STEP) as simulation:
        simulation.init(parameter_set="initialValues")
        assert simulation.get_real("plant::L1") == 0.5
        assert simulation.get_real("profile::cart.distance") == 0.3


LIMITS = "limits={velocity=0.5, acceleration=1.0, jerk=20.0, travel=[-1.0, 1.0]}"


@pytest.fixture(scope="module")
def planned(version, tmp_path_factory):
    path = tmp_path_factory.mktemp("planned") / "planned.ssp"
    changes = (
        LIMITS,
        "planner.live={L1=[0.4, 0.5]}",
        "check.uncertain={L1=0.02}",
        f"export.cycle_time={STEP}",
    )
    done = run_here(
        "fmu", "planned-ssp", "--fmi", version, *(f"--set={one}" for one in changes), "--out", path, "--json"
    )
    assert done.code == 0, done.err
    assert done.document["model_identifier"] == "paper_planned"
    return path


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2"], indirect=True)
def test_a_planner_leads_the_plant(planned):
    with zipfile.ZipFile(planned) as opened:
        names, structure = opened.namelist(), etree.fromstring(opened.read("SystemStructure.ssd"))
    etree.XMLSchema(etree.parse(str(SCHEMAS / "SystemStructureDescription.xsd"))).assertValid(structure)
    assert "resources/paper_planner.ssv" not in names  # as it has no parameters
    (connection,) = structure.iterfind(".//ssd:Connection", SPACES)
    assert dict(connection.attrib) == {
        "startElement": "planner",
        "startConnector": "cart.setpoint",
        "endElement": "plant",
        "endConnector": "cart.setpoint",
    }
    connectors = structure.iterfind(".//ssd:Component[@name='planner']//ssd:Connector", SPACES)
    inputs = {one.get("name") for one in connectors if one.get("kind") == "input"}
    assert {"enable", "execute", "velocity", "stop", "target", "live.L1"} < inputs


@pytest.mark.slow
@pytest.mark.parametrize("version", ["2"], indirect=True)
def test_ecos_commands_a_planner(ecos, planned):
    rows = []
    with ecos.EcosSimulation(ssp_path=str(planned), step_size=STEP) as simulation:
        simulation.init()
        simulation.set_bool("planner::enable", True)
        simulation.set_real("planner::target", 0.3)
        simulation.set_real("planner::live.L1", 0.47)
        for step in range(round(STOP / STEP)):
            simulation.set_bool("planner::execute", step * STEP > 1.0)
            simulation.step()
            rows.append([simulation.get_real(f"plant::{name}") for name in ("cart.position", "sway.payload")])
    position, sway = np.abs(rows).T
    assert position[-1] == pytest.approx(0.3, abs=1e-12)
    assert sway.max() > 1e-2
    assert sway[-200:].max() < 1e-4


@pytest.fixture
def libcosim():
    """Give the parts of libcosim's package; its library prints much."""
    try:
        names = ("CosimExecution", "CosimLogging", "CosimObserver")
        execution, logging, observer = (importlib.import_module(f"libcosimpy.{name}") for name in names)
    except ModuleNotFoundError:
        missing("libcosimpy (pip install -e '.[dev]')")
    logging.log_output_level(logging.CosimLogLevel.FATAL)
    return execution.CosimExecution, observer.CosimObserver


@pytest.mark.parametrize("version", ["2"], indirect=True)  # which is all that libcosim knows
def test_libcosim_runs_it(libcosim, files, folder):
    """With the step that the SSD states."""
    executions, observers = libcosim
    execution, observer = executions.from_ssp_file(ssp_path=str(folder)), observers.create_last_value()
    execution.add_observer(observer)
    index = execution.slave_index_from_instance_name("plant")
    description = read_model_description(io.BytesIO(files["resources/paper_plant.fmu"]))
    references = {variable.name: variable.valueReference for variable in description.modelVariables}
    seen = [references[name] for name in ("cart.position", "sway.payload")]
    rows = []
    for _ in range(round(STOP / STEP)):
        execution.step()
        rows.append(observer.last_real_values(index, seen))
    assert execution.status().current_time == pytest.approx(STOP * 1e9)
    judge(rows, folder)
