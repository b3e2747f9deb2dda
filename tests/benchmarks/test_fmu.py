"""Cost of co-simulation: one step against the bare integration, and many runs against FMPy's own loop."""

from time import perf_counter, process_time

import numpy as np
from fmpy import read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmu.kinds import model_of

from gen_profile.plants.registry import find_plant
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.description.fmu_files import Version
from gen_profile_fmu.running.many_runs import ManyRuns

CRANE = find_plant("double-pendulum-crane")
TIMES = np.linspace(0.0, 7.0, 701)


def test_many_runs(capsys):
    """7 s at 10 ms, with one integration step of 10 ms, and with ten; processor time of one thread."""
    fmu = cached_fmu(model_of("plant-acceleration", CRANE), Version.FMI2)
    inputs = {"cart.setpoint_acceleration": np.sin(3.0 * TIMES[:-1])}
    for max_step, runs in ((0.01, 2000), (0.001, 500)):
        lengths, steps = np.linspace(0.4, 0.6, runs), np.full(runs, max_step)
        with ManyRuns(fmu) as many:
            parameters = {"L1": lengths, "max_step": steps}
            many.peaks(TIMES, inputs, {"L1": lengths[:1], "max_step": steps[:1]}, ["sway.payload"])
            began = process_time()
            found = many.peaks(TIMES, inputs, parameters, ["sway.payload"])
            ours = (process_time() - began) / runs
        with ManyRuns(fmu, workers=2) as many:
            began = perf_counter()
            np.testing.assert_array_equal(many.peaks(TIMES, inputs, parameters, ["sway.payload"]), found)
            shared = (perf_counter() - began) / runs
        fmpys, theirs = _fmpy(fmu, inputs, lengths[:20], max_step)
        with capsys.disabled():
            print(
                f"\nmax_step {max_step * 1e3:g} ms: {ours * 1e3:.3g} ms a run, {ours / 700 * 1e6:.3g} µs a "
                f"step, of which {_bare(fmu, max_step) * 1e6:.3g} µs are integration; FMPy "
                f"{theirs * 1e3:.3g} ms a run, {theirs / ours:.3g} times as long; "
                f"10 000 runs in {1e4 * ours:.3g} s, on two threads in {1e4 * shared:.3g} s by the clock"
            )
        np.testing.assert_allclose(found[:20, 0], fmpys, rtol=1e-9)


def _bare(fmu, max_step):
    """Seconds that 10 ms of integration take by themselves: in one communication step of 70 s."""
    with ManyRuns(fmu) as many:
        began = process_time()
        many.peaks(
            np.array([0.0, 70.0]),
            {"cart.setpoint_acceleration": np.zeros(1)},
            {"theta1": np.full(10, 0.1), "max_step": np.full(10, max_step)},
            ["sway.payload"],
        )
        return (process_time() - began) / 70_000


def _fmpy(fmu, inputs, lengths, max_step):
    """Peaks and seconds a run with instance and description reused, as FMPy advises for many runs."""
    description = read_model_description(str(fmu.folder))
    slave = FMU2Slave(
        guid=fmu.guid,
        modelIdentifier=fmu.model_identifier,
        unzipDirectory=str(fmu.folder),
        instanceName="many",
    )
    slave.instantiate()
    (name,) = inputs
    signal = np.array(
        list(zip(TIMES, np.append(inputs[name], 0.0), strict=True)), dtype=[("time", float), (name, float)]
    )
    peaks, began = [], process_time()
    for length in lengths:
        slave.reset()
        result = simulate_fmu(
            str(fmu.folder),
            start_time=0.0,
            stop_time=7.0,
            output_interval=0.01,
            start_values={"L1": length, "max_step": max_step},
            input=signal,
            output=["sway.payload"],
            model_description=description,
            fmu_instance=slave,
            fmi_type="CoSimulation",
            use_event_mode=False,
        )
        peaks.append(np.abs(result["sway.payload"]).max())
    seconds = (process_time() - began) / len(lengths)
    slave.freeInstance()
    return np.array(peaks), seconds
