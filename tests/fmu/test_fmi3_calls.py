"""The binary at the level of FMI 3.0: call order, refusals, states, and what it exports."""

import re
from ctypes import byref, c_bool, c_double, c_size_t, c_uint32, c_void_p
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import (
    FMU3Model,
    FMU3ScheduledExecution,
    FMU3Slave,
    fmi3IntermediateUpdateCallback,
    fmi3LogMessageCallback,
)
from fmu.kinds import model_of
from fmu.test_fmi2_calls import exported_and_needed

from gen_profile.plants.registry import find_plant
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.description.fmu_files import Version

CRANE = find_plant("double-pendulum-crane")
DISCARD, ERROR = 2, 3


@pytest.fixture
def fmu():
    return cached_fmu(model_of("plant-acceleration", CRANE), Version.FMI3)


def load(fmu, kind):
    instance = kind(
        guid=fmu.guid,
        modelIdentifier=fmu.model_identifier,
        unzipDirectory=str(fmu.folder),
        instanceName="crane",
    )
    instance.messages = []
    instance.log = lambda _, status, category, message: instance.messages.append(
        (status, category.decode(), message.decode())
    )
    return instance


@pytest.fixture
def slave(fmu):
    instance = load(fmu, FMU3Slave)
    instance.instantiate(logMessage=instance.log)
    yield instance
    instance.freeInstance()


@pytest.fixture
def model(fmu):
    instance = load(fmu, FMU3Model)
    instance.instantiate(logMessage=instance.log)
    instance.enterInitializationMode()
    yield instance
    instance.freeInstance()


def status_of(call, *arguments):
    try:
        return call(*arguments) or 0
    except FMICallException as error:
        return error.status


def test_exports_the_standards_functions_and_no_others(fmu):
    header = (Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h").read_text()
    declared = set(re.findall(r"FMI3_Export \w+TYPE\s+(fmi3\w+);", header))
    (library,) = (fmu.folder / "binaries").rglob("*.so")
    assert exported_and_needed(library)[0] == declared


# in which modes the standard (3.0, sections 2.3, 3.2 and 4.2) allows a call: after instantiation,
# initialization, event or (co-simulation) step, continuous time or (co-simulation) a discarded step,
# termination, error
ORDER = {
    "fmi3EnterInitializationMode": ("100000", "100000"),
    "fmi3ExitInitializationMode": ("010000", "010000"),
    "fmi3Terminate": ("001100", "001100"),
    "fmi3Reset": ("111111", "111111"),
    "fmi3SetFloat64": ("111000", "111000"),  # of a tunable parameter
    "fmi3GetFloat64": ("011111", "011111"),
    "fmi3GetDirectionalDerivative": ("011111", "011111"),
    "fmi3DoStep": (None, "001000"),
    "fmi3UpdateDiscreteStates": ("001000", None),
    "fmi3EnterEventMode": ("001100", None),
    "fmi3EnterContinuousTimeMode": ("001000", None),
    "fmi3CompletedIntegratorStep": ("000100", None),
    "fmi3SetTime": ("001100", None),
    "fmi3SetContinuousStates": ("000100", None),
    "fmi3GetContinuousStateDerivatives": ("011111", None),
}


def arguments_of(function):
    one, six, first = (c_double * 1)(0.5), (c_double * 6)(), (c_uint32 * 1)(0)
    flags, time = [byref(c_bool()) for _ in range(5)], byref(c_double())
    return {
        "fmi3EnterInitializationMode": (c_bool(False), 0.0, 0.0, c_bool(False), 0.0),
        "fmi3SetFloat64": (first, 1, one, 1),
        "fmi3GetFloat64": (first, 1, one, 1),
        "fmi3GetDirectionalDerivative": (first, 1, first, 1, one, 1, one, 1),
        "fmi3DoStep": (0.0, 0.01, c_bool(True), *flags[:3], time),
        "fmi3UpdateDiscreteStates": (*flags, time),
        "fmi3CompletedIntegratorStep": (c_bool(True), *flags[:2]),
        "fmi3SetTime": (0.0,),
        "fmi3SetContinuousStates": (six, 6),
        "fmi3GetContinuousStateDerivatives": (six, 6),
    }.get(function, ())


def bring(instance, mode):
    """Lead an instance into one of the modes, by number, as `ORDER` lists them."""
    instance.reset()
    if mode > 0:
        instance.enterInitializationMode()
    if mode > 1:
        instance.exitInitializationMode()
    if mode == 3 and isinstance(instance, FMU3Model):
        instance.enterContinuousTimeMode()
        instance.completedIntegratorStep()
    elif mode == 3:
        instance.setFloat64([slave_reference("cart.setpoint_acceleration")], [1e250])
        assert status_of(instance.doStep, 0.0, 0.01) == DISCARD
    elif mode == 4:
        instance.terminate()
    elif mode == 5:
        assert status_of(instance.getFloat64, [999]) == ERROR


@pytest.mark.parametrize(
    ("kind", "function", "allowed"),
    [
        (kind, function, allowed)
        for function, each in ORDER.items()
        for kind, allowed in zip((FMU3Model, FMU3Slave), each, strict=True)
        if allowed is not None  # FMPy has no such function for that interface
    ],
)
def test_the_order_of_calls_is_enforced(fmu, kind, function, allowed):
    instance = load(fmu, kind)
    instance.instantiate(logMessage=instance.log)
    found = ""
    for mode in range(6):
        bring(instance, mode)
        instance.messages.clear()
        status = status_of(getattr(instance, function), instance.component, *arguments_of(function))
        found += "1" if status == 0 else "0"
        if status != 0:
            assert re.search("must not be called in|cannot be set in", instance.messages[0][2])
    instance.freeInstance()
    assert found == allowed


def test_steps_only_after_initialization(slave):
    assert status_of(lambda: slave.doStep(0.0, 0.01)) == ERROR
    assert slave.messages[-1] == (
        ERROR,
        "logStatusError",
        "fmi3DoStep must not be called in the mode after instantiation.",
    )
    slave.reset()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    slave.doStep(0.0, 0.01)
    assert status_of(lambda: slave.doStep(0.0, 0.01)) == ERROR
    assert slave.messages[-1][2] == "The step begins at 0 s, but the FMU has reached 0.01 s."


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_values_must_be_finite(slave, value):
    assert status_of(slave.setFloat64, [0], [value]) == ERROR
    assert slave.messages[-1][2].startswith("m1 must be finite, found ")


def test_unknown_references_and_wrong_types_are_refused(slave):
    slave.enterInitializationMode()
    for call, message in (
        (lambda: slave.getFloat64([999]), "There is no variable of reference 999."),
        (lambda: slave.getBoolean([0]), "m1 is no boolean variable."),
        (lambda: slave.getInt32([0]), "m1 is no integer variable."),
        (lambda: slave.getInt64([0]), "fmi3GetInt64: there is no such variable."),
        (lambda: slave.getFloat64([0], nValues=2), "fmi3GetFloat64: every variable has one value."),
    ):
        slave.reset()
        slave.enterInitializationMode()
        assert status_of(call) == ERROR
        assert slave.messages[-1][2] == message


def test_states_are_saved_and_restored(slave):
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    references = list(range(20))
    slave.setFloat64([slave_reference("cart.setpoint_acceleration")], [1.0])
    slave.doStep(0.0, 0.1)
    state = slave.getFMUState()
    text = slave.serializeFMUState(state)
    slave.doStep(0.1, 0.1)
    once = slave.getFloat64(references)
    slave.setFMUState(state)
    slave.doStep(0.1, 0.1)
    assert slave.getFloat64(references) == once
    copy = slave.deserializeFMUState(text)
    slave.setFMUState(copy)
    slave.doStep(0.1, 0.1)
    assert slave.getFloat64(references) == once
    slave.freeFMUState(state)
    slave.freeFMUState(copy)
    with pytest.raises(FMICallException):
        slave.deserializeFMUState(text[:-1])


def slave_reference(name):
    table = cached_fmu(model_of("plant-acceleration", CRANE), Version.FMI3).variables
    return [variable.name for variable in table.variables].index(name)


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (FMU3Slave, {"eventModeUsed": True}, "Event mode in co-simulation is not provided."),
        (FMU3ScheduledExecution, {}, "Scheduled execution is not provided."),
    ],
)
def test_what_is_not_provided_is_not_instantiated(fmu, kind, arguments, message):
    instance = load(fmu, kind)
    with pytest.raises(Exception, match="nstantiate"):
        instance.instantiate(logMessage=instance.log, **arguments)
    assert instance.messages[0][2].startswith(message)
    instance.freeLibrary()


@pytest.mark.parametrize(
    ("asked", "call", "arguments", "words"),
    [
        (True, "setFloat64", (["L1"], [0.5]), "L1 cannot be set in an intermediate update."),
        (
            True,
            "getFloat64",
            (["sway.hook"],),
            "fmi3GetFloat64 must not be called in an intermediate update.",
        ),
        (
            False,
            "setFloat64",
            (["cart.setpoint_acceleration"], [0.5]),
            "fmi3SetFloat64 must not be called in",
        ),
        (False, "doStep", (0.0, 0.1), "fmi3DoStep must not be called in an intermediate update."),
        (True, "reset", (), "fmi3Reset must not be called in an intermediate update."),
    ],
)
def test_on_the_way_inputs_are_set_and_outputs_read_and_nothing_else(fmu, asked, call, arguments, words):
    instance = load(fmu, FMU3Slave)

    def update(_, time, asks, *__):
        if asks is asked:
            names, *values = arguments if "Float64" in call else ((), *arguments)
            references = [[slave_reference(name) for name in names]] if names else []
            status_of(getattr(instance, call), *references, *values)

    instance.instantiate(logMessage=instance.log, intermediateUpdate=update)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    assert status_of(instance.doStep, 0.0, 0.01) == ERROR
    assert instance.messages[0][2].startswith(words)
    assert len(instance.messages) == 1
    instance.freeInstance()


@pytest.mark.slow
def test_who_follows_setpoints_takes_no_updates():
    """A setpoint is for the whole of a step."""
    instance = load(cached_fmu(model_of("plant-setpoint", CRANE), Version.FMI3), FMU3Slave)
    token, log = instance.guid.encode(), fmi3LogMessageCallback(instance.log)
    flags, wanted = [c_bool(False)] * 4, (c_uint32 * 1)(0)
    callbacks = (None, log, fmi3IntermediateUpdateCallback())
    made = instance.fmi3InstantiateCoSimulation(b"crane", token, b"", *flags, wanted, 1, *callbacks)
    assert not made
    assert instance.messages[0][2] == "Intermediate updates are not provided."
    instance.freeLibrary()


@pytest.mark.parametrize(
    "name", ["fmi3EnterConfigurationMode", "fmi3ExitConfigurationMode", "fmi3EnterStepMode"]
)
def test_functions_without_a_capability_fail_in_a_sentence(slave, name):
    assert status_of(getattr(slave, name), slave.component) == ERROR
    assert slave.messages[-1][2] == f"{name} is not provided by this FMU."


def test_model_exchange_counts_its_states_and_events(model):
    model.exitInitializationMode()
    number = c_size_t()
    model.fmi3GetNumberOfContinuousStates(model.component, byref(number))
    assert number.value == 6
    model.fmi3GetNumberOfEventIndicators(model.component, byref(number))
    assert number.value == 0
    nominals = (c_double * 6)()
    model.fmi3GetNominalsOfContinuousStates(model.component, nominals, 6)
    assert list(nominals) == [1.0] * 6
    assert status_of(model.fmi3GetContinuousStates, model.component, nominals, 5) == ERROR
    assert model.messages[-1][2] == "There are 6 continuous states."


def test_time_and_states_are_set_in_continuous_time_mode_only(model):
    states = (c_double * 6)()
    assert status_of(model.fmi3SetContinuousStates, model.component, states, 6) == ERROR
    assert model.messages[-1][2].endswith("must not be called in initialization mode.")
    model.reset()
    model.enterInitializationMode()
    model.exitInitializationMode()
    model.enterContinuousTimeMode()
    states[2] = float("nan")
    assert status_of(model.fmi3SetContinuousStates, model.component, states, 6) == ERROR
    assert model.messages[-1][2] == "theta1.rate must be finite."


def test_null_pointers_and_no_instance_are_errors(slave):
    slave.enterInitializationMode()
    assert status_of(slave.fmi3GetFloat64, slave.component, None, 1, None, 1) == ERROR
    assert slave.messages[-1][2] == "fmi3GetFloat64 was given a null pointer."
    assert status_of(slave.fmi3GetFloat64, None, (c_uint32 * 1)(0), 1, (c_double * 1)(), 1) == ERROR
    assert status_of(slave.fmi3GetFMUState, slave.component, None) == ERROR
    slave.fmi3FreeInstance(None)


def test_log_categories_are_switched(slave):
    slave.fmi3SetDebugLogging(slave.component, c_bool(True), 0, None)
    slave.reset()
    assert slave.messages == [(0, "logEvents", "Reset.")]
    assert isinstance(slave.component, c_void_p | int)
