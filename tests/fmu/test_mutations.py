"""Defects injected one at a time into a good FMU: each is caught by one check at least, as told here.

The checks are those of the rest of the suite: FMPy's validation, dependencies and start values against the
binary, and loading it.
"""

import re
import shutil
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model
from fmpy.validation import validate_fmu
from fmu.kinds import model_of

from gen_profile.plants.registry import find_plant
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.description.fmu_files import Version, archive

CRANE = find_plant("double-pendulum-crane")


def fmpy_objects(folder, version):
    path = folder / "whole.fmu"
    files = [p for p in folder.rglob("*") if p.is_file() and p.suffix not in {".fmu", ".json"}]
    path.write_bytes(archive({p.relative_to(folder).as_posix(): p.read_bytes() for p in files}))
    return bool(validate_fmu(str(path)))


def _open(folder, version):
    description = read_model_description(str(folder), validate=False)
    kind = FMU2Model if version is Version.FMI2 else FMU3Model
    fmu = kind(
        guid=description.guid if version is Version.FMI2 else description.instantiationToken,
        modelIdentifier=description.modelExchange.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="mutant",
    )
    fmu.instantiate()
    if version is Version.FMI2:
        fmu.setupExperiment()
    fmu.enterInitializationMode()
    return description, fmu


def does_not_load(folder, version):
    try:
        _, fmu = _open(folder, version)
    except Exception:
        return True
    fmu.freeInstance()
    return False


def starts_differ(folder, version):
    """Whether the binary has other start values than the XML says."""
    description, fmu = _open(folder, version)
    getter = fmu.getReal if version is Version.FMI2 else fmu.getFloat64
    stated = [v for v in description.modelVariables if v.start is not None and v.type in {"Real", "Float64"}]
    found = getter([v.valueReference for v in stated])
    fmu.freeInstance()
    return found != [float(v.start) for v in stated]


def dependencies_differ(folder, version):
    """Whether a derivative follows from other states and inputs than the XML says, by the binary's own."""
    description, fmu = _open(folder, version)
    writer = fmu.setReal if version is Version.FMI2 else fmu.setFloat64
    table = {v.name: v.valueReference for v in description.modelVariables}
    swinging = {"theta1": 0.3, "theta2": -0.2, "theta1.rate": 0.5, "theta2.rate": 0.4}
    writer([table[name] for name in swinging], list(swinging.values()))
    fmu.exitInitializationMode()
    states = [unknown.variable.derivative for unknown in description.derivatives]
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    differ = False
    for unknown in description.derivatives:
        of = [unknown.variable.valueReference]
        rows = {
            v.name: fmu.getDirectionalDerivative(of, [v.valueReference], [1.0])[0] for v in (*states, *inputs)
        }
        found = {name for name, value in rows.items() if value != 0.0}
        differ |= found != {v.name for v in unknown.dependencies}
    fmu.freeInstance()
    return differ


CHECKS = (fmpy_objects, does_not_load, starts_differ, dependencies_differ)
# defect: pattern and replacement in the XML of FMI 2 and of FMI 3, and who catches it
DEFECTS = {
    "initial unknown dropped": (
        (r"(<InitialUnknowns>\s*)<Unknown [^>]*/>", r"\1"),
        (r"<InitialUnknown [^>]*/>", ""),
        fmpy_objects,
    ),
    "unit unknown": ((r'unit="rad/s"', 'unit="rpm"'), (r'unit="rad/s"', 'unit="rpm"'), fmpy_objects),
    "start missing": ((r' start="0.192"', ""), (r' start="0.192"', ""), fmpy_objects),
    "identity of another": ((r'guid="\w{4}', 'guid="0000'), (r'Token="\w{4}', 'Token="0000'), does_not_load),
    "dependencies wrong": (
        (r'(<Derivatives>(\s*<Unknown [^>]*/>){2}\s*<Unknown index="\d+" dependencies=")\d+ ', r"\1"),
        (r'((<ContinuousStateDerivative [^>]*/>\s*){2}<\w+ valueReference="\d+" dependencies=")\d+ ', r"\1"),
        dependencies_differ,
    ),
    "start differs from the binary's": (
        (r'start="0.192"', 'start="0.193"'),
        (r'start="0.192"', 'start="0.193"'),
        starts_differ,
    ),
    "identifier of another": (
        (r'modelIdentifier="\w', 'modelIdentifier="x'),
        (r'modelIdentifier="\w', 'modelIdentifier="x'),
        does_not_load,
    ),
    "date without a time": (
        (r'generationTool="', 'generationDateAndTime="2020-01-01" generationTool="'),
        (r'generationTool="', 'generationDateAndTime="2020-01-01" generationTool="'),
        "generationDateAndTime",
    ),
    "two variables of one reference": (
        (r'valueReference="3"', 'valueReference="2"'),
        (r'valueReference="3"', 'valueReference="2"'),
        "valueReference",
    ),
}  # fmt: skip


@pytest.fixture(params=Version)
def version(request):
    return request.param


@pytest.fixture
def folder(version, tmp_path):
    """A good FMU, unpacked, to be spoilt."""
    good = cached_fmu(model_of("plant-acceleration", CRANE), version).folder
    return shutil.copytree(good, tmp_path / "fmu")


def test_a_good_fmu_passes_every_check(folder, version):
    assert [check.__name__ for check in CHECKS if check(folder, version)] == []
    assert [name for name in ("generationDateAndTime", "valueReference") if _is_faulty(folder, name)] == []


def _is_faulty(folder, attribute):
    """What no tool in use catches in both versions: dates as such, and references that are not unique."""
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    if attribute == "generationDateAndTime":
        return attribute in root.attrib  # there is no clock in an artefact
    references = [variable.get(attribute) for variable in root.find("ModelVariables")]
    return len(set(references)) != len(references)


@pytest.mark.parametrize("defect", DEFECTS)
def test_each_defect_is_caught(folder, version, defect):
    path = folder / "modelDescription.xml"
    text = path.read_text(encoding="utf-8")
    *rules, catcher = DEFECTS[defect]
    spoilt, count = re.subn(*rules[version is Version.FMI3], text, count=1)
    assert count == 1
    path.write_text(spoilt, encoding="utf-8")
    assert _is_faulty(folder, catcher) if isinstance(catcher, str) else catcher(folder, version)


def test_numbers_in_the_xml_are_exact(folder):
    root = ElementTree.parse(folder / "modelDescription.xml").getroot()
    texts = [element.get("start") for element in root.iter() if element.get("start") not in {None, "false"}]
    assert all(repr(float(text)) == text for text in texts)
    assert np.isfinite([float(text) for text in texts]).all()
