"""Where the re-checker will refuse a certificate, a warning says so when it is written."""

import json

import attrs
import pytest

import gen_profile as gp
from gen_profile.assurance.certificate.rechecking import not_covered
from gen_profile.plants.registry import is_built_in, plant_types
from gen_profile.spec.reading import evolve_spec
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.registry import BUILT_IN, find_exporter
from gen_profile_recheck.machines import MACHINES
from gen_profile_recheck.reading import NotProvedError, read_setpoints


def test_every_machine_of_the_project_has_equations_there():
    assert {one for one in plant_types() if is_built_in(one)} <= MACHINES.keys()


EXPORTS = [
    *((format_, {}) for format_ in BUILT_IN),
    *(("csv", {"csv_dialect": dialect}) for dialect in ("excel-de", "sew", "kollmorgen", "lenze")),
    ("csv", {"csv_columns": ["velocity"]}),
    ("plc", {"plc_layout": "segments"}),
]


@pytest.fixture(scope="module")
def motion():
    return gp.plan(gp.preset_spec("paper", ["export.cycle_time=0.02"])).command


@pytest.mark.parametrize(("format_", "export"), EXPORTS)
def test_the_files_that_it_reads_are_those_that_are_said_to_be_covered(format_, export, motion):
    if export.get("csv_dialect") in ("sew", "kollmorgen", "lenze"):
        export = {**export, "csv_columns": ["position"]}
    spec = evolve_spec(gp.preset_spec("paper", ["export.cycle_time=0.02"]), export=export)
    first, *_ = find_exporter(format_).encode(motion, target_of(spec))
    try:
        read_setpoints(first.content, json.loads(json.dumps(spec.to_dict())), ["cart"])
    except NotProvedError:
        assert not_covered(first.filename, spec) == (f"such {format_} files",)
    else:
        assert not_covered(first.filename, spec) == ()


def test_a_lag_and_a_machine_of_one_s_own_are_named(tmp_path):
    spec = gp.preset_spec("paper", ["actuator={type='first-order', tau=0.2}"])
    assert not_covered("paper.csv", spec) == ("drives that lag behind their setpoints",)
    own = attrs.evolve(spec, plant=attrs.evolve(spec.plant, type="luffing-crane"))
    assert not_covered("own.twincat.TcPOU", own)[0] == "machines of type luffing-crane"
