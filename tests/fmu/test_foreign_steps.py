"""External FMUs that take communication steps of one length only."""

import numpy as np
import pytest
from fmu.foreign import run_of, spec_with, with_description, write_fmu

from gen_profile.assurance.verification.external_fmu import _in_steps
from gen_profile.delivery.designs.design import design
from gen_profile.support.errors import CosimulationError, SpecError
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.running.external_fmu import run_foreign

pytestmark = pytest.mark.slow

ADVANCE = "    double reference[N_A][N_ORDERS];\n    reference_velocity(model, step, reference);"
# the state is no longer finite after any other step, which the FMU refuses
ONE_STEP = {ADVANCE: f"    if (fabs(step - 0.005) > 1e-12) model->values[Q_U] = 0.0 / 0.0;\n{ADVANCE}"}


def fixed(path, kind="acceleration", version=Version.FMI2):
    write_fmu(path, kind, version, **ONE_STEP)
    declared = b'canHandleVariableCommunicationStepSize="true"'
    with_description(path, lambda text: text.replace(declared, declared.replace(b"true", b"false")))


@pytest.mark.parametrize("kind", ["acceleration", "setpoint", "velocity"])
def test_one_step_judges_as_any_do(tmp_path, kind):
    """The same machine, by steps of its own choice and by the only one that it takes."""
    any_step = {} if kind != "velocity" else {"residual_sway": 0.01}
    write_fmu(tmp_path / "customer.fmu", kind)
    free = design(spec_with(tmp_path, kind, **any_step), ["csv"], tmp_path / "free").check
    fixed(tmp_path / "customer.fmu", kind)
    found = design(spec_with(tmp_path, kind, step=0.005, **any_step), ["csv"], tmp_path / "fixed").check
    assert found.passed
    for one, other in zip(found.findings, free.findings, strict=True):
        for load in ("hook", "payload"):
            apart = abs(one.residual[load] - other.residual[load])
            assert apart < 1e-6 + found.error_bound + free.error_bound
    assert found.error_bound < 2e-4


def test_the_key_is_named_where_a_step_is_refused(tmp_path):
    fixed(tmp_path / "customer.fmu")
    with pytest.raises(
        CosimulationError, match=r"steps of one length only: state it, such as check.step = 0\.\d+"
    ):
        run_foreign(run_of(tmp_path / "customer.fmu"))
    times = np.arange(11) * 0.005
    assert run_foreign(run_of(tmp_path / "customer.fmu", times=times, step=0.005)).outputs.shape == (1, 11, 1)


@pytest.mark.parametrize("step", [0.0, -0.01, 2.0, "0.01"])
def test_a_step_is_a_time(tmp_path, step):
    (tmp_path / "customer.fmu").write_bytes(b"")
    with pytest.raises(SpecError, match=r"check\.step"):
        spec_with(tmp_path, step=step)


@pytest.mark.parametrize("delay", [0.0, 0.005])
def test_steps_lead_to_the_same_velocity_and_place(delay):
    times = np.array([0.0, 0.004, 0.013, 0.02, 0.05])
    inputs = np.array([[1.0], [-2.0], [0.5], [0.0]])
    grid, fed = _in_steps("acceleration", times, inputs, 0.01, delay)
    assert np.allclose(np.diff(grid), 0.01, rtol=1e-12)
    assert (fed * 0.01).sum() == pytest.approx((inputs[:, 0] * np.diff(times)).sum(), abs=1e-15)
    grid, places = _in_steps("setpoint", times, np.cumsum(inputs, axis=0), 0.01, delay)
    assert places[-1, 0] == pytest.approx(-0.5)
