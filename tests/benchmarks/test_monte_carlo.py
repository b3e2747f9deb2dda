"""Cost of a check with 1000 draws, against the same scenarios through FMPy from the FMU's file."""

from time import perf_counter

import numpy as np
from fmpy import simulate_fmu

from gen_profile.assurance.verification.check import check_artefact
from gen_profile.delivery.designs.design import design
from gen_profile.spec.reading import preset_spec
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.registry import find_exporter
from gen_profile_fmu.building.plant_fmu import plant_fmu

DRAWS, TRIED = 1000, 8
STOP = 7.0  # s: the move, and 4 s of watching


def test_a_thousand_draws(tmp_path, capsys):
    spec = preset_spec("paper", ["check.samples=0"])
    design(spec, ["csv"], tmp_path, check=False)
    check_artefact(tmp_path / "paper.csv", samples=1)  # compiles what is to be compiled
    began = perf_counter()
    check = check_artefact(tmp_path / "paper.csv", samples=DRAWS).check
    ours = perf_counter() - began
    drawn = check.groups["samples"]
    setpoints = find_exporter("csv").replay((tmp_path / "paper.csv").read_bytes(), target_of(spec))
    began = perf_counter()
    peaks = np.array([_fmpy(spec, setpoints, row.scenario) for row in drawn[:TRIED]])
    theirs = (perf_counter() - began) * DRAWS / TRIED
    with capsys.disabled():
        print(
            f"\n{DRAWS} draws: {ours:.3g} s; through FMPy {theirs:.3g} s, {theirs / ours:.3g} times as long"
        )
    found = np.array([list(row.residual.values()) for row in drawn[:TRIED]])
    np.testing.assert_allclose(found, peaks, rtol=0.0, atol=check.error_bound)
    assert len(drawn) == DRAWS
    assert theirs > 20.0 * ours


def _fmpy(spec, setpoints, scenario):
    """Greatest sway of every load after the move, in steps of the cycle."""
    cycle, plant = setpoints.cycle_time, spec.machine()
    times = np.arange(round(STOP / cycle)) * cycle
    position = np.interp(times + cycle, setpoints.times, setpoints.position[:, 0])  # where each step leads
    signal = np.array(
        list(zip(times, position, strict=True)), dtype=[("time", float), ("cart.setpoint", float)]
    )
    found = simulate_fmu(
        str(plant_fmu(plant).archive),
        stop_time=STOP,
        output_interval=cycle,
        start_values=dict(scenario.parameters),
        input=signal,
        output=[f"sway.{load}" for load in plant.loads],
        fmi_type="CoSimulation",
        use_event_mode=False,
    )
    after = found["time"] >= setpoints.times[-1] + cycle
    return [np.abs(found[f"sway.{load}"][after]).max() for load in plant.loads]
