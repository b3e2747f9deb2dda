"""Units that an external FMU declares, those that it leaves out, and its start values beside the spec's."""

import re

import numpy as np
import pytest
from fmu.foreign import run_of, spec_with, with_description, write_fmu

from gen_profile.delivery.designs.design import design
from gen_profile.spec.reading import spec_from_dict
from gen_profile.support.errors import CosimulationError
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.running.external_fmu import run_foreign

pytestmark = pytest.mark.slow

VERSIONS = pytest.mark.parametrize("version", Version)
FED, SWAY = "cart.setpoint_acceleration", "sway.payload"
UNITS = {
    "mm": {"m": 1, "factor": 1e-3},
    "dm": {"m": 1, "factor": 0.1},
    "mm/s2": {"m": 1, "s": -2, "factor": 1e-3},
    "deg": {"rad": 1, "factor": 0.017453292519943295},
    "Hz": {"s": -1},
    "odd": None,
    "none": {"m": 1, "factor": 0.0},
}


def declare(path, units, start=None):
    """Have an FMU declare other units for some variables, by name; None takes the unit away."""

    def change(content):
        text = content.decode()
        added = ""
        for name, base in UNITS.items():
            powers = " ".join(f'{key}="{value}"' for key, value in (base or {}).items())
            inner = "" if base is None else f"<BaseUnit {powers}/>"
            added += f'<Unit name="{name}">{inner}</Unit>'
        text = text.replace("<UnitDefinitions>", f"<UnitDefinitions>{added}", 1)
        for variable, unit in units.items():
            found = re.search(
                rf'name="{re.escape(variable)}"[^>]*?(>\s*<Real)?( unit="[^"]*")', text, re.DOTALL
            )
            said = "" if unit is None else f' unit="{unit}"'
            text = text[: found.start(2)] + said + text[found.end(2) :]
        for variable, value in (start or {}).items():
            found = re.search(rf'name="{variable}".*?start="([^"]*)"', text, re.DOTALL)
            text = text[: found.start(1)] + str(value) + text[found.end(1) :]
        return text.encode()

    with_description(path, change)


@VERSIONS
def test_declared_units_are_converted_both_ways(tmp_path, version):
    """The FMU's numbers are SI's, whatever its description says: 0.1 "mm/s2" is 0.0001 m/s²."""
    plain = write_fmu(tmp_path / "plain.fmu", version=version)
    path = write_fmu(tmp_path / "customer.fmu", version=version)
    declare(path, {FED: "mm/s2", SWAY: "mm", "L1": "mm"})
    expected = run_foreign(run_of(plain)).outputs
    inputs, machines = np.full((10, 1), 0.1e-3), [{"L1": 0.5e-3}]
    found = run_foreign(run_of(path, inputs=inputs, machines=machines))
    np.testing.assert_allclose(found.outputs, 1e-3 * expected, rtol=1e-12)
    assert found.remarks == ()


@VERSIONS
@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({SWAY: "rad"}, "'sway.payload' is in 'rad', which measures something else than 'm'"),
        ({SWAY: "deg"}, "'sway.payload' is in 'deg', which measures something else"),
        ({FED: "m"}, r"'cart.setpoint_acceleration' is in 'm', .* else than 'm/s\^2'"),
        ({"L1": "Hz"}, "'L1' is in 'Hz', which measures something else"),
        (
            {"L1": "odd"},
            r"'L1' is in 'odd', which the FMU does not define; .* check.units = \{ 'L1' = 'm' \}",
        ),
        ({"L1": "none"}, "the unit 'none' of 'L1' is not defined by finite numbers"),
    ],
)
def test_units_of_something_else_are_refused(tmp_path, version, units, message):
    path = write_fmu(tmp_path / "customer.fmu", version=version)
    declare(path, units)
    with pytest.raises(CosimulationError, match=message):
        run_foreign(run_of(path))


def test_hertz_is_no_rad_per_second(tmp_path):
    path = write_fmu(tmp_path / "customer.fmu")
    declare(path, {FED: "Hz"})
    units = {FED: "rad/s", SWAY: "m", "L1": "m"}
    with pytest.raises(CosimulationError, match="'Hz', which measures something else than 'rad/s'"):
        run_foreign(run_of(path, si_units=units))
    declare(path, {FED: "rad/s"})
    assert run_foreign(run_of(path, si_units=units)).outputs.shape == (1, 11, 1)


@VERSIONS
def test_variables_without_a_unit_are_named(tmp_path, version):
    path = write_fmu(tmp_path / "customer.fmu", version=version)
    expected = run_foreign(run_of(path)).outputs
    declare(path, {FED: None, SWAY: None})
    found = run_foreign(run_of(path))
    np.testing.assert_array_equal(found.outputs, expected)
    assert found.remarks == (
        "customer.fmu declares no unit of some variables, which are taken as in SI: "
        f"{FED} in m/s^2, {SWAY} in m.",
    )
    stated = run_foreign(run_of(path, stated_units={SWAY: 1e-3, FED: 1.0}))
    np.testing.assert_allclose(stated.outputs, 1e-3 * expected, rtol=1e-12)
    assert stated.remarks == ()


def test_a_start_value_of_another_unit_is_refused(tmp_path):
    path = write_fmu(tmp_path / "customer.fmu")
    declare(path, {"L1": None}, start={"L1": 470})
    meant = {"L1": (0.47, "m", "L1")}
    with pytest.raises(
        CosimulationError,
        match=r"'L1' starts as 470 and declares no unit, where the spec has L1 = 0.47 m; state its unit",
    ):
        run_foreign(run_of(path, parameters=meant))
    expected = run_foreign(run_of(path)).outputs
    found = run_foreign(run_of(path, parameters=meant, stated_units={"L1": 1e-3}, machines=[{"L1": 0.5e-3}]))
    np.testing.assert_array_equal(found.outputs, expected)


# value reference 2 is L1: the customer's own rope is in dm, accelerations and sways are in mm
OWN_UNITS = {
    "static void model_outputs(Model *model) { plant_outputs(model); }": """
static void to_metres(const Model *constant, double rope, double fed) {
    Model *model = (Model *)constant;
    model->values[2] *= rope;
    model->values[INPUTS] *= fed;
}
static void model_outputs(Model *model) {
    to_metres(model, 0.1, 1.0);
    plant_outputs(model);
    to_metres(model, 10.0, 1.0);
    model->values[SWAY] *= 1e3;
    model->values[SWAY + 1] *= 1e3;
}""",
    "static double model_substeps(const Model *model, double step) { "
    "return plant_substeps(model, lag(model), step); }": """
static double model_substeps(const Model *model, double step) {
    to_metres(model, 0.1, 1.0);
    const double substeps = plant_substeps(model, lag(model), step);
    to_metres(model, 10.0, 1.0);
    return substeps;
}""",
    "    reference_velocity(model, step, reference);\n": """
    to_metres(model, 0.1, 1e-3);
    reference_velocity(model, step, reference);
""",
    "    model->time += step;\n": "    to_metres(model, 10.0, 1e3);\n    model->time += step;\n",
}


@pytest.mark.parametrize(("start", "unit", "said"), [(0.2, "kg", "0.2"), (0.1, "kg", None)])
def test_start_values_of_what_is_not_set_are_compared(tmp_path, start, unit, said):
    path = write_fmu(tmp_path / "customer.fmu")
    declare(path, {"m2": unit}, start={"m2": start})
    (*remarks,) = run_foreign(run_of(path, parameters={"m2": (0.1, "kg", None)})).remarks
    sentence = f"customer.fmu judges with m2 = {said} kg, where the spec has m2 = 0.1; name the variable"
    assert [sentence in remark for remark in remarks] == ([] if said is None else [True])


def test_a_plant_in_millimetres_is_judged_as_one_in_metres(tmp_path):
    """Its numbers, not its description alone: 7.4 mm of sway are 7.4, and a limit of 3 mm is no 3 m."""
    write_fmu(tmp_path / "customer.fmu")
    expected = design(spec_with(tmp_path), ["csv"], tmp_path / "si").check
    write_fmu(tmp_path / "customer.fmu", **OWN_UNITS)
    declare(tmp_path / "customer.fmu", {FED: "mm/s2", SWAY: "mm", "sway.hook": "mm", "L1": "dm"})
    found = design(spec_with(tmp_path), ["csv"], tmp_path / "mm")
    for one, other in zip(found.check.findings, expected.findings, strict=True):
        assert one.residual["payload"] == pytest.approx(other.residual["payload"], rel=1e-9)
    assert found.check.warnings() == ()


def test_stated_units_are_kept_in_the_manifest(tmp_path):
    write_fmu(tmp_path / "customer.fmu")
    spec = spec_with(tmp_path, units={"L1": "mm", "sway.payload": "m"})
    assert dict(spec.check.foreign.units) == {"L1": "mm", "sway.payload": "m"}
    assert spec_from_dict(spec.to_dict(), tmp_path) == spec
