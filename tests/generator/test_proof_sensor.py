"""The proof of a block with a sensor, and what gives it the sensor's values."""

import re
from itertools import pairwise

import attrs
import numpy as np
import pytest
from generator.test_proof_obedience import CYCLES, MOVE, REST, STICKS, STOPS, kinds, with_orders

from gen_profile.assurance.proof.closed_loop import ClosedLoop, trace
from gen_profile.assurance.proof.histories import Histories
from gen_profile.assurance.proof.numbering import Numbering
from gen_profile.assurance.proof.obedience import WORDS
from gen_profile.assurance.proof.orders import POSITION
from gen_profile.assurance.proof.prove import prove, replay
from gen_profile.assurance.proof.sensing import FAULTS, JUMP, Gust
from gen_profile.assurance.proof.sensor_use import sensor_faults
from gen_profile.assurance.proof.verdict import kind_of
from gen_profile.planner.commands import play
from gen_profile.planner.design import planner_block
from gen_profile.planner.interface import BlockAxis
from gen_profile.planner.planner import Planner
from gen_profile.planner.sensor import FADES, estimation_error
from gen_profile.planner.sensor_log import read_sensor_log
from gen_profile.presentation.charts.proof import damping_figures, worst_damped
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import SpecError
from gen_profile_fmu.running.block_run import BlockRun

MEASURED = [
    "planner.live={L1=[3.0, 9.0], m2=[500.0, 2000.0]}",
    'planner.sensor={quantity="angle", of="theta1", noise=0.002, offset=0.005, delay=[0.05, 0.15]}',
    "planner.disturbance={swing={payload=0.5}, gust={acceleration=0.1, longest=5.0}, settle=12.0}",
]
HISTORIES = 16
CYCLE = 0.004


@pytest.fixture(scope="module")
def spec():
    return preset_spec("bay-crane", MEASURED)


@pytest.fixture(scope="module")
def text(spec):
    return planner_block(spec).text


@pytest.mark.slow
def test_histories_have_sensors_of_every_kind_and_old_ones_stay(spec):
    histories = Histories.of(spec)
    drawn = Numbering.of(histories, 400, 0).drawn
    sensed = [histories.history(choices).sensed for choices in drawn]
    kinds = [one.fault for one in sensed if one is not None]
    assert 0.3 < sensed.count(None) / len(sensed) < 0.4
    assert {*kinds} == {"", *FAULTS}
    failing = [one for one in sensed if one is not None and one.fault]
    assert any(one.gusts for one in failing)
    assert all(gust.time + gust.lasts <= one.fails for one in failing for gust in one.gusts)
    pairs = [pair for one in sensed if one is not None for pair in pairwise(one.gusts)]
    assert pairs
    assert all(before.time + before.lasts <= after.time for before, after in pairs)  # no more than stated
    plain = Histories.of(preset_spec("bay-crane", MEASURED[:1]))
    assert histories.choices > plain.choices


def test_a_gust_pushes_as_its_acceleration_says(spec):
    histories = Histories.of(spec)
    drawn = (histories.history(choices) for choices in Numbering.of(histories, 60, 0).drawn)
    one = next(h.sensed for h in drawn if h.sensed is not None and h.sensed.gusts)
    times = np.arange(0.0, one.ends + 2.0, 1e-3)
    pushed = np.diff(one.pushed(times)[:, 0], 2) / 1e-6
    due = sum(
        gust.acceleration * np.sin(np.pi * np.clip((times[1:-1] - gust.time) / gust.lasts, 0.0, 1.0))
        for gust in one.gusts
    )
    assert np.abs(pushed - due).max() < 2e-3


def followed(sway, *, damping=0.0, fault=0.0, stands=0, **outputs):
    """A run of 20 s that arrives at once, and its outputs."""
    cycles = 5000
    columns = {"bDamping": damping, "bBusy": 0.0, "nSensorFault": fault, "bSensorUsed": 1.0}
    columns |= {"fSwayEstimated": sway, "fSwayUncertainty": 0.0, "fSensorScale": 1.0, "fAcceleration": 0.0}
    columns |= {"fPosition": 0.0} | outputs | {"hook": 0.0, "payload": sway}
    trace = np.column_stack([np.broadcast_to(value, cycles) for value in columns.values()])
    run = BlockRun(
        axes=(),
        on_the_way=np.zeros(2),
        residual=np.zeros(2),
        cycles=cycles,
        stands=stands,
        promise=True,
        error=0,
        fault=0,
        trace=trace,
    )
    return run, list(columns)[:-2]


def test_what_is_damped_too_late_and_false_alarms_are_faults(spec):
    histories = Histories.of(spec)
    drawn = [histories.history(choices).sensed for choices in Numbering.of(histories, 60, 0).drawn]
    sound = attrs.evolve(next(one for one in drawn if one is not None and not one.fault), gusts=())
    times = np.arange(5000) * CYCLE

    def faults(one, run, outputs):
        return [
            *sensor_faults(spec, one, run, outputs, cycle=CYCLE, period=3.0, last=1.0, estimation_error=0.15)
        ]

    assert not faults(sound, *followed(0.2 * (times < 12.9)))
    (late,) = faults(sound, *followed(0.2 * (times < 14.0)))
    assert "the payload is damped to check.residual_sway later than allowed by 0.976 s" in late
    (alarm,) = faults(sound, *followed(0.0, fault=5.0))
    assert "nSensorFault 5" in alarm
    gusty = attrs.evolve(sound, gusts=(Gust(time=2.0, lasts=1.0, acceleration=0.1, along=(1.0,)),))
    assert not faults(gusty, *followed(0.2 * (times < 14.0)))
    silent = attrs.evolve(sound, fault="silent", fails=3.0)
    assert "not noticed" in faults(silent, *followed(0.0))[0]
    late = faults(silent, *followed(0.2, fault=1.0 * (times > 4.1)))
    assert "not noticed" in late[0]
    assert not faults(silent, *followed(0.2, fault=1.0 * (times > 3.4)))
    scaled, (run, outputs) = attrs.evolve(sound, fault="scale", fails=3.0), followed(0.2)
    assert not faults(scaled, run, outputs)  # as long as the promise tells
    assert "neither noticed nor harmless" in faults(scaled, attrs.evolve(run, promise=False), outputs)[0]
    swings, _ = followed(2.0 * (times > 5.0), fault=7.0 * (times > 6.0))
    assert "makes the load swing by 2 m" in faults(scaled, swings, outputs)[0]


@pytest.mark.parametrize("settle", [0.0, 12.0])
def test_damping_on_the_way_may_put_off_an_arrival_for_so_long_and_no_longer(settle):
    orders = REST, attrs.evolve(MOVE, values=(5.1,)), STICKS, STOPS  # to where it never comes
    way = attrs.evolve(with_orders(*orders), periods=(0.1,), reaction=0.1, settle=settle)
    assert kind_of(WORDS[POSITION]) in kinds(way)
    way.issued["bDamping"] = np.ones(CYCLES)
    assert (kind_of(WORDS[POSITION]) in kinds(way)) == (settle == 0.0)


def test_what_a_block_tells_of_its_sensor_is_judged(spec):
    drawn = (
        one.sensed for one in map(Histories.of(spec).history, Numbering.of(Histories.of(spec), 60, 0).drawn)
    )
    sound = attrs.evolve(next(one for one in drawn if one is not None and not one.fault), gusts=())
    dead = attrs.evolve(sound, fault="dead", fails=1.0)
    swings = 0.3 * np.sin(2.0 * np.pi / 3.0 * np.arange(5000) * CYCLE)

    def faults(one, resets=(), nSensorFault=0.0, **given):
        known = {"cycle": CYCLE, "period": 3.0, "last": 1.0, "estimation_error": 0.15, "resets": resets}
        return [*sensor_faults(spec, one, *followed(0.0, fault=nSensorFault, **given), **known)]

    assert not faults(sound, fSensorScale=1.3, fAcceleration=swings)
    assert "fSensorScale is wrong by 0.5" in faults(sound, fSensorScale=1.5, fAcceleration=swings)[0]
    assert not faults(sound, fSensorScale=1.5, fAcceleration=0.1 * swings)  # too little to tell
    assert not faults(sound, range(1, 20, 5), fSensorScale=1.5, fAcceleration=swings)  # forgotten by resets
    assert not faults(dead, nSensorFault=7.0, fSensorScale=0.3, fAcceleration=swings)
    assert "fSensorScale is wrong by 0.99" in faults(dead, nSensorFault=7.0, fAcceleration=swings)[0]
    wrong = attrs.evolve(sound, fault="exchanged", fails=0.0)
    (confirming,) = [one for one in faults(wrong, fAcceleration=swings) if "confirms" in one]
    assert float(re.search(r"too long by ([\d.]+) s", confirming)[1]) == pytest.approx(
        20.0 - (1 + 1 + 2) * 3.0,
        abs=0.5,  # first used, until the swing has built up, allowed
    )
    for shown in ({"nSensorFault": 8.0}, {"bSensorUsed": 0.0}):
        assert not any("confirms" in one for one in faults(wrong, fAcceleration=swings, **shown))
    assert not any("confirms" in one for one in faults(wrong, fAcceleration=0.1 * swings))
    stronger = np.where(np.arange(5000) * CYCLE < dead.fails, 30.0, 1.0) * swings  # which is still remembered
    assert not faults(dead, nSensorFault=7.0, fSensorScale=0.6, fAcceleration=stronger)
    assert faults(dead, nSensorFault=7.0, fSensorScale=0.6, fAcceleration=swings)
    swung = followed(np.where(np.arange(5000) * CYCLE < dead.fails, 0.5, 0.0), fAcceleration=swings)
    assert not [*sensor_faults(spec, dead, *swung, cycle=CYCLE, period=3.0, last=1.0, estimation_error=0.15)]
    assert not faults(sound, fSwayEstimated=0.2, fSwayUncertainty=0.06)
    (off,) = faults(sound, fSwayEstimated=0.2, fSwayUncertainty=0.04)
    assert off.startswith("fSwayUncertainty is too small by 0.01 m")
    assert not faults(sound, fSwayEstimated=0.2, bSensorUsed=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("jump", [0.05, 0.055, 0.06])
def test_a_jump_that_counts_as_an_offset_leaves_the_axis_at_rest(spec, text, jump):
    histories, half = Histories.of(spec), 2**31
    drawn = [histories.history(choices) for choices in Numbering.of(histories, 30, 0).drawn]
    with ClosedLoop(spec, text, histories) as loop:
        for one in drawn:
            if one.sensed is not None and not one.sensed.fault:
                failing = attrs.evolve(
                    one.sensed, fault="jump", fails=1.0, innovation=2.0 * jump / JUMP, seed=half, gusts=()
                )
                alone = attrs.evolve(one, commands=one.commands[-1:], changes=(), sensed=failing)
                watched = loop.watched(alone, loop.known(alone))
                assert not watched.faults
                assert watched.run.stands >= 0


@pytest.mark.slow
def test_gusts_in_time_with_the_swing_lead_the_estimate_away_by_less_than_the_block_states(spec, text):
    stated, histories = estimation_error(spec), Histories.of(spec)
    assert f"current gusts and stated errors add up to {stated:.3g} m" in text
    assert (
        f"* {FADES} * aFrequency[0] * cCycle;" in text
    )  # at which what is unknown at first is taken to fade
    drawn = (histories.history(choices) for choices in Numbering.of(histories, 60, 0).drawn)
    longest_rope = (one for one in drawn if one.sensed and not one.sensed.fault and one.live["L1"] == 9.0)
    one = next(longest_rope)
    gusts = tuple(
        Gust(time=6.0 + 3.0 * k, lasts=3.0, acceleration=0.1 * (-1.0) ** k, along=(1.0,)) for k in range(4)
    )
    pushed = attrs.evolve(
        one, commands=one.commands[-1:], changes=(), sensed=attrs.evolve(one.sensed, gusts=gusts)
    )
    with ClosedLoop(spec, text, histories) as loop:
        run = loop.run(pushed, rows=6000)
        issued = dict(zip(loop.outputs, run.trace.T, strict=False))
    assert issued["bSensorUsed"][1000:].all()
    off = np.abs(issued["fSwayEstimated"] - run.trace[:, -1]) - issued["fSwayUncertainty"]
    sensor = attrs.evolve(spec.planner.sensor, delay=(0.1, 0.1))
    known = attrs.evolve(spec, planner=attrs.evolve(spec.planner, sensor=sensor))
    assert 0.5 * estimation_error(known) < off.max() < stated


@pytest.mark.slow
def test_a_block_with_a_sensor_passes_its_proof(spec, text):
    proof = prove(spec, text, histories=HISTORIES, workers=2)
    assert proof.passed, proof.reasons()
    assert proof.apart <= 1e-9  # FMPy finds the same, with what swings at first and gusts
    assert any("sensor" in one.to_dict() for one in proof.judged)
    one = worst_damped(proof)
    damping, remains = damping_figures(spec, proof, trace(spec, text, Histories.of(spec), one.history))
    gusts, shown, sway, _ = (panel.lines for panel in damping.panels)
    strongest = max(abs(gust.acceleration) for gust in one.history.sensed.gusts)
    assert np.abs(gusts[0].y).max() == pytest.approx(strongest, rel=0.02)
    assert np.abs(sway[0].y - sway[1].y)[-300:].max() < 15.0  # mm, true and estimated
    assert np.nanmax(np.abs(shown[0].y)) > 0.01
    assert np.nanmax(remains.panels[0].values) >= 100.0 * proof.fraction(one) - 1e-9


@pytest.mark.slow
def test_python_and_play_give_it_what_the_sensor_shows(text, spec):
    planner = Planner(spec, position=20.0)
    shown = planner.hold(3.0, sensor=0.05 * np.cos(1.16 * CYCLE * np.arange(750))).outputs
    assert shown["bSensorUsed"][-1] and shown["bDamping"][-1]
    assert planner.hold(1.0).outputs["nSensorFault"][-1] == 1
    log = "time_s,value\n" + "".join(
        f"{0.02 * k:.2f},{0.05 * np.cos(1.16 * 0.02 * k):.4f}\n" for k in range(200)
    )
    with pytest.raises(SpecError, match=r"sensor: the block has none; state planner\.sensor"):
        read_sensor_log(log, [])
    issued = play(text, "time_s,command,value\n0.0,stop,\n", sensor_text=log)
    head, *rows = issued.table.splitlines()
    damping = head.split(",").index("damping")
    assert any(row.split(",")[damping] == "1" for row in rows)
    for wrong, words in (("time,value\n0,0\n", "no column time_s"), ("time_s,value\n0,x\n", "line 2")):
        with pytest.raises(SpecError, match=words):
            play(text, "time_s,command,value\n0.0,stop,\n", sensor_text=wrong)


@pytest.mark.parametrize("back", ["-0.1,0", "0.2,0\n0.1,0", "0.2,0\nnan,0", "0.2,0\ninf,0"])
def test_a_time_of_a_sensor_that_goes_back_is_named_by_its_line(back):
    line = 2 + back.count("\n")
    with pytest.raises(SpecError, match=f"sensor, line {line}: time_s must rise"):
        read_sensor_log(f"time_s,value\n{back}\n9.0,0\n", [BlockAxis(name="")])


GANTRY = [
    "limits={velocity=1.0, acceleration=0.4, jerk=2.0, travel=[0.0, 20.0]}",
    'planner.sensor={quantity="angle", of=["theta_x", "theta_y"], noise=0.002, offset=0.005}',
    "planner.sensor.delay=[0.05, 0.15]",
    "planner.disturbance={swing={payload-x=0.5, payload-y=0.5}, settle=15.0}",
    "planner.disturbance.gust={acceleration=0.1, longest=5.0}",
    *("planner.live={L=[3.0, 9.0]}", "export.cycle_time=0.01", "robustness.uncertain={L=0.05}"),
]


@pytest.fixture(scope="module")
def gantry():
    return preset_spec("gantry-crane", GANTRY)


@pytest.mark.slow
def test_sensors_of_a_gantry_are_given_by_axis(gantry):
    planner = Planner(gantry, position=[10.0, 10.0])
    shown = np.stack([0.05 * np.cos(1.4 * 0.01 * np.arange(600)), np.zeros(600)], axis=1)
    issued = planner.hold(6.0, sensor=shown).outputs
    assert issued["bSensorUsed_x"][-1] and issued["bSensorUsed_y"][-1] and issued["bDamping"].any()
    assert np.ptp(issued["fPosition_x"]) > 0.05 > 0.0 == np.ptp(issued["fPosition_y"])
    with pytest.raises(SpecError, match=r"sensor: must be a number for each axis \(x, y\)"):
        planner.step(sensor=0.0)
    axes = planner_block(gantry).text, "time_s,command,value_x,value_y\n0.0,stop,,\n"
    rows = "".join(f"{0.1 * k:.1f},{0.001 * k},{-0.002 * k}\n" for k in range(20))
    head, *issued = play(*axes, sensor_text="time_s,value_x,value_y\n" + rows).table.splitlines()
    x, y = (head.split(",").index(f"{axis}_sway_estimated_m") for axis in "xy")
    last = [float(cell) if "." in cell else 0.0 for cell in issued[180].split(",")]
    assert last[x] > 0.02 and last[y] < -0.04
    with pytest.raises(
        SpecError, match="no column value_y; the first line must name time_s, value_x, value_y"
    ):
        play(*axes, sensor_text="time_s,value_x\n0.0,0.0\n")


@pytest.mark.slow
def test_a_target_where_the_axes_stand_moves_none_while_nothing_is_to_be_damped(gantry):
    """Where a load swung by less than is damped, the same target again led an axis 4 cm away."""
    numbering = Numbering.of(Histories.of(gantry), 400, 0x4D15CD07)
    assert replay(gantry, planner_block(gantry).text, numbering, 88).judged[0].faults == ()


@pytest.mark.slow
def test_a_gantry_with_two_sensors_passes_its_proof(gantry):
    proof = prove(gantry, planner_block(gantry).text, histories=8, workers=2)
    # which the block still does in one of these histories
    assert not [one for one in proof.reasons() if "takes its promise back" not in one]
    assert proof.apart <= 1e-9  # FMPy pushes both axes alike
    drawn = map(Histories.of(gantry).history, Numbering.of(Histories.of(gantry), 60, 0).drawn)
    sensed = [one.sensed for one in drawn if one.sensed]
    assert {one.failing for one in sensed if one.fault} == {0, 1}
    assert any(min(map(abs, gust.along)) > 0.1 for one in sensed for gust in one.gusts)
    one = worst_damped(proof)
    figures = damping_figures(
        gantry, proof, trace(gantry, planner_block(gantry).text, Histories.of(gantry), one.history)
    )
    assert [len(panel.lines) for panel in figures[0].panels] == [2, 2, 2, 1, 1]
