"""Instances of the FMU: their saved states, memory, independence and log."""

import subprocess
from ctypes import byref, c_char, c_size_t, c_void_p
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy import fmi2
from fmu.kinds import model_of
from fmu.slave import MOVE, FMU2LoggedSlave, open_slave, status_of
from system_parts import program

from gen_profile_fmu.description.fmu_files import Version, sources

DAMAGED = Path(__file__).with_name("damaged_states.c")


class TestStates:
    def test_a_run_goes_on_identically_from_a_saved_state(self, slave):
        slave.write(L1=0.55)
        slave.follow(MOVE[:10], 0.0, 0.01)
        state = slave.getFMUState()
        first = slave.follow(MOVE[10:], 0.1, 0.01)
        slave.write(L1=0.3)
        slave.setFMUState(state)
        assert slave.follow(MOVE[10:], 0.1, 0.01) == first
        slave.freeFMUState(state)

    def test_a_run_goes_on_identically_in_another_instance(self, fmu, slave):
        slave.follow(MOVE[:10], 0.0, 0.01)
        state = slave.getFMUState()
        size = c_size_t()
        slave.fmi2SerializedFMUstateSize(slave.component, state, byref(size))
        text = (c_char * size.value)()
        slave.fmi2SerializeFMUstate(slave.component, state, text, size)
        first = slave.follow(MOVE[10:], 0.1, 0.01)
        slave.freeFMUState(state)
        with open_slave(fmu) as other:
            copy = c_void_p()
            other.fmi2DeSerializeFMUstate(other.component, text, size, byref(copy))
            other.fmi2SetFMUstate(other.component, copy)
            assert other.follow(MOVE[10:], 0.1, 0.01) == first
            other.fmi2FreeFMUstate(other.component, byref(copy))
            assert copy.value is None

    def test_a_saved_state_is_overwritten_in_place(self, slave):
        state = slave.getFMUState()
        taken = set(slave.allocated)
        slave.follow(MOVE, 0.0, 0.01)
        slave.fmi2GetFMUstate(slave.component, byref(state))
        assert slave.allocated == taken
        row = slave.read()
        slave.reset()
        slave.setFMUState(state)
        assert slave.read() == row
        slave.freeFMUState(state)

    def test_a_state_saved_before_an_error_undoes_it(self, slave):
        state = slave.getFMUState()
        assert status_of(slave.doStep, 0.0, -1.0) == fmi2.fmi2Error
        slave.setFMUState(state)
        slave.doStep(0.0, 1e-3)
        slave.freeFMUState(state)

    def test_foreign_bytes_are_refused(self, slave):
        state = slave.getFMUState()
        size = c_size_t()
        slave.fmi2SerializedFMUstateSize(slave.component, state, byref(size))
        text = (c_char * size.value)()
        slave.fmi2SerializeFMUstate(slave.component, state, text, size)
        foreign = (c_char * size.value)()
        copy = c_void_p()
        for bytes_, length in [(text, size.value - 1), (foreign, size.value)]:
            arguments = (slave.component, bytes_, length, byref(copy))
            assert status_of(slave.fmi2DeSerializeFMUstate, *arguments) == fmi2.fmi2Error
            assert slave.last_message == "The bytes are not a state of this FMU."
        arguments = (slave.component, state, text, size.value - 1)
        assert status_of(slave.fmi2SerializeFMUstate, *arguments) == fmi2.fmi2Error
        slave.freeFMUState(state)

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", ["profile", "system"])
    def test_damaged_bytes_are_refused(self, crane, kind, tmp_path):
        """Under the sanitizers of addresses and of undefined behaviour."""
        for name, text in sources(model_of(kind, crane), Version.FMI2).compiled.items():
            (tmp_path / name).write_text(text)
        checks = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", f"-I{tmp_path}")
        command = [program("cc", "gcc"), "-std=c99", "-O1", *checks, str(DAMAGED), "-o", "damaged", "-lm"]
        subprocess.run(command, cwd=tmp_path, check=True)
        done = subprocess.run([tmp_path / "damaged"], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (0, ""), done.stderr

    def test_null_states_are_refused(self, slave):
        assert status_of(slave.fmi2SetFMUstate, slave.component, None) == fmi2.fmi2Error
        assert status_of(slave.fmi2GetFMUstate, slave.component, None) == fmi2.fmi2Error
        assert status_of(slave.fmi2FreeFMUstate, slave.component, None) == fmi2.fmi2OK

    def test_missing_memory_is_an_error(self, slave):
        slave.allocations_left = 0
        assert status_of(slave.getFMUState) == fmi2.fmi2Error
        assert slave.last_message == "There is no memory for an FMU state."


class TestInstances:
    def test_are_independent(self, fmu, slave):
        alone = slave.follow(MOVE, 0.0, 0.01)
        slave.reset()
        slave.initialise()
        with open_slave(fmu) as other:
            other.write(L1=1.2)
            together = []
            for k, position in enumerate(MOVE):
                together += slave.follow([position], k * 0.01, 0.01)
                other.follow([-position], k * 0.01, 0.01)
            assert other.read("sway.payload") != slave.read("sway.payload")
        assert together == alone

    def test_reset_brings_all_start_values_back(self, slave):
        slave.reset()
        slave.initialise()
        fresh = slave.read()
        slave.write(L1=1.0, max_step=1e-4)
        slave.follow(MOVE, 0.0, 0.01)
        slave.reset()
        slave.initialise()
        assert slave.read() == fresh

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"guid": b"another"}, "The identity in the model description is not the binary's"),
            ({"guid": None}, "The identity in the model description is not the binary's"),
            ({"name": b""}, "An instance needs a name."),
            ({"name": None}, "An instance needs a name."),
        ],
    )
    def test_are_refused_with_a_reason(self, fmu, changes, message):
        slave = FMU2LoggedSlave(fmu)
        given = {"name": b"crane", "kind": fmi2.fmi2CoSimulation, "guid": fmu.guid.encode(), **changes}
        component = slave.fmi2Instantiate(
            given["name"], given["kind"], given["guid"], None, byref(slave.own_callbacks), 0, 0
        )
        assert component is None
        assert slave.messages[0][:2] == (fmi2.fmi2Error, "logStatusError")
        assert slave.messages[0][2].startswith(message)
        slave.freeLibrary()

    @pytest.mark.parametrize("left", [0, 1])
    def test_free_what_they_took_when_memory_runs_out(self, fmu, left):
        slave = FMU2LoggedSlave(fmu)
        slave.allocations_left = left
        with pytest.raises(Exception, match="Failed to instantiate"):
            slave.instantiate(callbacks=slave.own_callbacks)
        assert not slave.allocated
        assert slave.last_message == "There is no memory for an instance."
        slave.freeLibrary()

    @pytest.mark.parametrize("missing", ["allocateMemory", "freeMemory"])
    def test_need_callbacks_for_memory(self, fmu, missing):
        slave = FMU2LoggedSlave(fmu)
        kind = dict(fmi2.fmi2CallbackFunctions._fields_)[missing]
        setattr(slave.own_callbacks, missing, kind())
        with pytest.raises(Exception, match="Failed to instantiate"):
            slave.instantiate(callbacks=slave.own_callbacks)
        assert slave.fmi2Instantiate(b"a", 1, fmu.guid.encode(), None, None, 0, 0) is None
        slave.freeLibrary()

    def test_can_do_without_a_logger(self, fmu):
        slave = FMU2LoggedSlave(fmu)
        slave.own_callbacks.logger = fmi2.fmi2CallbackLoggerTYPE()
        slave.start()
        assert status_of(slave.doStep, 0.0, -1.0) == fmi2.fmi2Error
        slave.freeInstance()


class TestLog:
    def test_tells_errors_only_unless_asked(self, slave):
        assert slave.messages == []
        status_of(slave.doStep, 0.0, -1.0)
        assert [message[:2] for message in slave.messages] == [(fmi2.fmi2Error, "logStatusError")]

    def test_tells_events_when_asked(self, fmu):
        slave = FMU2LoggedSlave(fmu)
        slave.instantiate(callbacks=slave.own_callbacks, loggingOn=True)
        slave.initialise()
        slave.terminate()
        slave.reset()
        assert slave.messages == [
            (fmi2.fmi2OK, "logEvents", "Instantiated."),
            (fmi2.fmi2OK, "logEvents", "Initialized at time 0 s."),
            (fmi2.fmi2OK, "logEvents", "Terminated at time 0 s."),
            (fmi2.fmi2OK, "logEvents", "Reset."),
        ]
        slave.freeInstance()

    def test_categories_are_switched_one_by_one_or_all_at_once(self, slave):
        slave.setDebugLogging(True, ["logEvents"])
        slave.reset()
        assert slave.messages.pop()[1] == "logEvents"
        slave.setDebugLogging(False, ["logEvents", "logStatusError"])
        slave.reset()
        status_of(slave.doStep, 0.0, 1.0)
        assert slave.messages == []
        slave.fmi2SetDebugLogging(slave.component, 1, 0, None)
        slave.reset()
        status_of(slave.doStep, 0.0, 1.0)
        assert [category for _, category, _ in slave.messages] == ["logEvents", "logStatusError"]

    def test_unknown_categories_are_refused(self, slave):
        with pytest.raises(Exception, match="fmi2SetDebugLogging"):
            slave.setDebugLogging(True, ["logWeather"])
        assert slave.last_message == "An unknown log category was to be switched."

    def test_categories_are_those_of_the_model_description(self, fmu, slave):
        categories = ElementTree.parse(fmu.folder / "modelDescription.xml").findall("LogCategories/Category")
        for category in categories:
            slave.setDebugLogging(True, [category.get("name")])
        assert len(categories) == 3
