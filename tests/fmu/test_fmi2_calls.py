"""The binary at the level of FMI 2.0: call order, values, steps and what it exports."""

import re
import sys
from ctypes import byref, c_char_p, c_double, c_int, c_uint
from pathlib import Path

import fmpy
import numpy as np
import pytest
from elftools.elf.elffile import ELFFile
from fmpy import fmi2, read_model_description
from fmu.slave import MOVE, status_of

# in which of the fixtures' modes the standard (2.0.4, sections 3.2.3 and 4.2.4) allows a call
COSIMULATION = {
    "fmi2SetupExperiment": "1100000",
    "fmi2EnterInitializationMode": "0100000",
    "fmi2ExitInitializationMode": "0010000",
    "fmi2DoStep": "0001000",
    "fmi2Terminate": "0001100",
    "fmi2SetReal": "1111000",
    "fmi2GetReal": "0011111",
    "fmi2GetRealStatus": "0001110",
    "fmi2GetBooleanStatus": "0001110",
    "fmi2Reset": "1111111",
    "fmi2CancelStep": "0000000",
}
EXCHANGE = {
    "fmi2SetupExperiment": "1100000",
    "fmi2EnterInitializationMode": "0100000",
    "fmi2ExitInitializationMode": "0010000",
    "fmi2NewDiscreteStates": "0001000",
    "fmi2EnterContinuousTimeMode": "0001000",
    "fmi2EnterEventMode": "0001100",
    "fmi2CompletedIntegratorStep": "0000100",
    "fmi2SetContinuousStates": "0000100",
    "fmi2SetTime": "0001100",
    "fmi2SetReal": "1111000",  # of a tunable parameter
    "fmi2GetReal": "0011111",
    "fmi2GetDerivatives": "0011111",
    "fmi2Terminate": "0001100",
    "fmi2Reset": "1111111",
}


def arguments_of(function):
    six, reference = (c_double * 6)(), (c_uint * 1)(0)
    return {
        "fmi2SetupExperiment": (0, 0.0, 0.0, 0, 0.0),
        "fmi2DoStep": (0.0, 1e-3, 1),
        "fmi2SetReal": (reference, 1, (c_double * 1)(0.5)),
        "fmi2GetReal": (reference, 1, (c_double * 1)()),
        "fmi2GetRealStatus": (fmi2.fmi2LastSuccessfulTime, byref(c_double())),
        "fmi2GetBooleanStatus": (fmi2.fmi2Terminated, byref(c_int())),
        "fmi2NewDiscreteStates": (byref(fmi2.fmi2EventInfo()),),
        "fmi2CompletedIntegratorStep": (1, byref(c_int()), byref(c_int())),
        "fmi2SetContinuousStates": (six, 6),
        "fmi2GetDerivatives": (six, 6),
        "fmi2SetTime": (0.0,),
    }.get(function, ())


def allowed(instance, modes, function):
    """In which modes a call is taken, as a row of ones and zeros; refusals must be about the order."""
    found = ""
    for enter in modes:
        enter()
        status = status_of(getattr(instance, function), instance.component, *arguments_of(function))
        found += "1" if status == fmi2.fmi2OK else "0"
        if status != fmi2.fmi2OK:
            assert re.search(
                "must not be called in|must be set up before|cannot be set in", instance.last_message
            )
    return found


class TestCallOrder:
    @pytest.fixture
    def modes(self, fmu, slave):
        """How to bring a fresh instance into every mode of the standard's state machine."""

        def instantiated():
            slave.reset()

        def set_up():
            slave.reset()
            slave.setupExperiment()

        def initialization():
            set_up()
            slave.enterInitializationMode()

        def step_complete():
            slave.reset()
            slave.initialise()

        def step_failed():
            step_complete()
            slave.write(cart__setpoint=1e200)
            assert status_of(slave.doStep, 0.0, 1e-3) == fmi2.fmi2Discard

        def terminated():
            step_complete()
            slave.terminate()

        def erroneous():
            step_complete()
            assert status_of(slave.doStep, 0.0, -1.0) == fmi2.fmi2Error

        return [instantiated, set_up, initialization, step_complete, step_failed, terminated, erroneous]

    @pytest.mark.parametrize("function", COSIMULATION)
    def test_is_enforced(self, slave, modes, function):
        assert allowed(slave, modes, function) == COSIMULATION[function]

    @pytest.mark.parametrize("function", EXCHANGE)
    def test_is_enforced_in_model_exchange(self, exchange, function):
        def instantiated():
            exchange.reset()

        def set_up():
            exchange.reset()
            exchange.setupExperiment()

        def initialization():
            set_up()
            exchange.enterInitializationMode()

        def event():
            initialization()
            exchange.exitInitializationMode()

        def continuous():
            event()
            exchange.enterContinuousTimeMode()
            exchange.completedIntegratorStep()

        def terminated():
            event()
            exchange.terminate()

        def erroneous():
            event()
            assert status_of(exchange.setTime, float("nan")) == fmi2.fmi2Error

        modes = [instantiated, set_up, initialization, event, continuous, terminated, erroneous]
        assert allowed(exchange, modes, function) == EXCHANGE[function]

    @pytest.mark.parametrize("name", ["theta1", "cart.velocity", "L1"])
    def test_states_and_parameters_are_set_by_name_until_somebody_integrates(self, exchange, name):
        """What CasADi's DaeBuilder does, which evaluates only."""
        exchange.enterContinuousTimeMode()
        exchange.setReal([exchange.references[name]], [0.25])
        assert exchange.read(name) == [0.25]
        exchange.completedIntegratorStep()
        assert status_of(exchange.setReal, [exchange.references[name]], [0.5]) == fmi2.fmi2Error
        words = (
            "is an output, it cannot be set"
            if name == "cart.velocity"
            else "cannot be set in continuous-time mode"
        )
        assert exchange.last_message == f"{name} {words}."

    @pytest.mark.parametrize("name", ["tau", "cart.start", "sway.hook"])
    def test_nothing_else_is_set_by_name_while_time_runs(self, exchange, name):
        exchange.enterContinuousTimeMode()
        assert status_of(exchange.setReal, [exchange.references[name]], [0.5]) == fmi2.fmi2Error

    def test_after_an_error_nothing_goes_on_but_a_reset_helps(self, slave):
        assert status_of(slave.doStep, 0.0, 0.0) == fmi2.fmi2Error
        assert status_of(slave.doStep, 0.0, 1e-3) == fmi2.fmi2Error
        slave.reset()
        slave.initialise()
        slave.doStep(0.0, 1e-3)

    def test_no_instance_is_an_error(self, slave):
        assert status_of(slave.fmi2DoStep, None, 0.0, 1e-3, 1) == fmi2.fmi2Error
        slave.fmi2FreeInstance(None)


class TestValues:
    def test_start_values_are_those_of_the_model_description(self, fmu, slave):
        slave.reset()
        slave.setupExperiment()
        slave.enterInitializationMode()
        found = dict(zip(slave.references, slave.read(), strict=True))
        described = read_model_description(str(fmu.archive), validate=True).modelVariables
        assert [variable.valueReference for variable in described] == list(slave.references.values())
        for variable in described:
            assert (variable.start is None) == (variable.initial == "calculated" or variable.name == "time")
            if variable.start is not None:
                assert found[variable.name] == float(variable.start), variable.name

    @pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
    def test_must_be_finite(self, slave, value):
        before = slave.read("cart.setpoint")
        assert status_of(lambda: slave.write(cart__setpoint=value)) == fmi2.fmi2Error
        assert slave.last_message.startswith("cart.setpoint must be finite")
        assert slave.read("cart.setpoint") == before

    @pytest.mark.parametrize(
        ("name", "value"), [("m1", -1.0), ("L1", 201.0), ("tau", -1e-9), ("max_step", 0.0)]
    )
    def test_must_keep_their_bounds(self, slave, name, value):
        slave.reset()
        assert status_of(lambda: slave.write(**{name: value})) == fmi2.fmi2Error
        assert slave.last_message.startswith(f"{name} must lie between")

    def test_bounds_themselves_are_allowed(self, slave):
        slave.write(L1=200.0, m1=1e-4)
        assert slave.read("L1", "m1") == [200.0, 1e-4]

    @pytest.mark.parametrize("name", ["der(theta1)", "sway.payload", "cart.position"])
    def test_outputs_cannot_be_set(self, slave, name):
        assert status_of(slave.setReal, [slave.references[name]], [0.0]) == fmi2.fmi2Error
        assert slave.last_message == f"{name} is an output, it cannot be set."

    @pytest.mark.parametrize("name", ["tau", "cart.start"])
    def test_fixed_parameters_are_set_before_the_first_step_only(self, slave, name):
        assert status_of(slave.setReal, [slave.references[name]], [0.0]) == fmi2.fmi2Error
        slave.reset()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.setReal([slave.references[name]], [0.5])
        slave.exitInitializationMode()
        assert slave.read(name) == [0.5]

    def test_parameters_are_tunable_between_steps(self, slave):
        slave.follow(MOVE, 0.0, 0.01)
        (theta,) = slave.read("theta1")
        slave.write(L1=0.8)
        sway, height = slave.read("sway.hook", "height.hook")
        np.testing.assert_allclose([sway, height], [0.8 * np.sin(theta), -0.8 * np.cos(theta)])

    def test_the_start_position_shows_in_initialization_mode(self, slave):
        slave.reset()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.write(cart__start=0.25)
        assert slave.read("cart.position") == [0.25]

    @pytest.mark.parametrize("access", ["getReal", "setReal"])
    def test_unknown_references_are_refused(self, slave, access):
        arguments = ([999],) if access == "getReal" else ([999], [0.0])
        assert status_of(getattr(slave, access), *arguments) == fmi2.fmi2Error
        assert slave.last_message == "There is no variable of reference 999."

    @pytest.mark.parametrize("kind", ["Integer", "String"])
    def test_there_are_no_variables_of_other_types(self, slave, kind):
        value = c_char_p if kind == "String" else c_int
        for function in (getattr(slave, f"fmi2Get{kind}"), getattr(slave, f"fmi2Set{kind}")):
            slave.reset()
            slave.setupExperiment()
            slave.enterInitializationMode()
            assert status_of(function, slave.component, (c_uint * 1)(0), 0, (value * 1)()) == fmi2.fmi2OK
            assert status_of(function, slave.component, (c_uint * 1)(0), 1, (value * 1)()) == fmi2.fmi2Error
            assert re.search(r"is no integer variable|there is no such variable", slave.last_message)

    @pytest.mark.parametrize("access", ["fmi2GetReal", "fmi2SetReal"])
    def test_null_pointers_are_refused(self, slave, access):
        for arguments in [(None, 1, (c_double * 1)()), ((c_uint * 1)(0), 1, None)]:
            slave.reset()
            slave.initialise()
            assert status_of(getattr(slave, access), slave.component, *arguments) == fmi2.fmi2Error
            assert slave.last_message == f"{access} was given a null pointer."


class TestSteps:
    @pytest.mark.parametrize("step", [0.0, -1e-3, float("nan"), float("inf")])
    def test_must_be_positive(self, slave, step):
        assert status_of(slave.doStep, 0.0, step) == fmi2.fmi2Error
        assert slave.last_message.startswith("The step size must be positive")

    @pytest.mark.parametrize("time", [0.5, -1e-6, float("nan")])
    def test_must_begin_where_the_last_one_ended(self, slave, time):
        assert status_of(slave.doStep, time, 1e-3) == fmi2.fmi2Error
        assert slave.last_message.startswith("The step begins at")

    def test_may_be_added_up_in_floats(self, slave):
        time = 0.0
        for _ in range(3000):
            slave.doStep(time, 0.01)
            time += 0.01

    def test_must_not_lead_beyond_the_stop_time(self, slave):
        slave.reset()
        slave.setupExperiment(startTime=1.0, stopTime=1.3)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        for k in range(3):
            slave.doStep(1.0 + k * 0.1, 0.1)
        assert status_of(slave.doStep, 1.3, 0.1) == fmi2.fmi2Error
        assert "beyond the stop time" in slave.last_message

    @pytest.mark.parametrize("times", [(float("nan"), None), (0.0, float("inf")), (1.0, 0.5)])
    def test_need_a_sensible_experiment(self, slave, times):
        slave.reset()
        start, stop = times
        assert status_of(lambda: slave.setupExperiment(startTime=start, stopTime=stop)) == fmi2.fmi2Error

    def test_may_vary_in_length(self, slave, fmu):
        slave.write(max_step=1e-3)
        rows = slave.follow(MOVE, 0.0, 0.01)
        slave.reset()
        slave.initialise()
        time, position = 0.0, 0.0
        for setpoint in MOVE:  # each step in two of 4 and 6 ms, through the same straight line
            slave.follow([position + 0.4 * (setpoint - position)], time, 0.004)
            row = slave.follow([setpoint], time + 0.004, 0.006)[-1]
            time, position = time + 0.01, setpoint
        free = slice(slave.references["theta1"], None)
        np.testing.assert_allclose(row[free], rows[-1][free], rtol=1e-11, atol=1e-13)

    def test_bring_new_outputs_without_new_inputs(self, slave):
        slave.follow(MOVE, 0.0, 0.01)
        before = slave.read("sway.hook")
        slave.doStep(len(MOVE) * 0.01, 0.01)
        sway, theta = slave.read("sway.hook", "theta1")
        assert [sway] != before
        assert sway == pytest.approx(0.47 * np.sin(theta), rel=1e-14)

    def test_that_end_in_infinity_are_discarded_and_undone(self, slave):
        before = slave.follow(MOVE, 0.0, 0.01)[-1]
        time = len(MOVE) * 0.01
        slave.write(cart__setpoint=1e200)
        assert status_of(slave.doStep, time, 0.01) == fmi2.fmi2Discard
        assert "no longer finite" in slave.last_message
        assert slave.getRealStatus(fmi2.fmi2LastSuccessfulTime) == pytest.approx(time)
        changed = slave.references["cart.setpoint"]
        after = slave.read()
        assert after[changed] == 1e200
        assert after[:changed] + after[changed + 1 :] == before[:changed] + before[changed + 1 :]

    def test_too_fine_an_integration_is_refused(self, slave):
        slave.reset()
        slave.initialise(max_step=1e-6)
        assert status_of(slave.doStep, 0.0, 20.0) == fmi2.fmi2Error
        assert "raise max_step" in slave.last_message

    def test_status_of_steps_in_the_background_is_not_known(self, slave):
        for call in (slave.fmi2GetStatus, slave.fmi2GetIntegerStatus, slave.fmi2GetStringStatus):
            value = c_char_p() if call == slave.fmi2GetStringStatus else c_int()
            assert status_of(call, slave.component, fmi2.fmi2PendingStatus, byref(value)) == fmi2.fmi2Discard
        assert slave.getBooleanStatus(fmi2.fmi2Terminated) is False
        assert status_of(slave.getRealStatus, fmi2.fmi2Terminated) == fmi2.fmi2Discard
        assert status_of(slave.getBooleanStatus, fmi2.fmi2LastSuccessfulTime) == fmi2.fmi2Discard

    @pytest.mark.parametrize("name", ["fmi2SetRealInputDerivatives", "fmi2GetRealOutputDerivatives"])
    def test_there_are_no_time_derivatives_of_setpoints_and_outputs(self, slave, name):
        reference = (c_uint * 1)(slave.references["cart.setpoint"])
        arguments = (reference, 1, (c_int * 1)(1), (c_double * 1)())
        assert status_of(getattr(slave, name), slave.component, *arguments) == fmi2.fmi2Error
        assert "ime derivatives" in slave.last_message


def test_version_and_platform(slave):
    assert slave.getVersion() == "2.0"
    assert slave.getTypesPlatform() == "default"


def functions_of_the_standard():
    """Names that FMI's own header declares."""
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi2Functions.h").read_text()
    return set(re.findall(r"FMI2_Export \w+TYPE\s+(fmi2\w+);", header))


def exported_and_needed(library):
    """Names that a library of this computer exports, and libraries that it needs."""
    assert sys.platform == "linux", "This test reads ELF files."
    with library.open("rb") as file:
        elf = ELFFile(file)
        symbols = list(elf.get_section_by_name(".dynsym").iter_symbols())
        needed = {tag.needed for tag in elf.get_section_by_name(".dynamic").iter_tags("DT_NEEDED")}
    exported = {
        symbol.name
        for symbol in symbols
        if symbol["st_shndx"] != "SHN_UNDEF" and symbol["st_info"]["bind"] != "STB_LOCAL"
    }
    return exported, needed


def test_only_fmi_functions_are_exported(fmu):
    (library,) = (fmu.folder / "binaries").glob("*/*.so")
    exported, needed = exported_and_needed(library)
    assert exported == functions_of_the_standard()
    assert needed <= {"libc.so.6", "libm.so.6", "ld-linux-x86-64.so.2"}
