"""A machine that was logged, simulated here by other equations, beside the plan."""

import json

import attrs
import numpy as np
import pytest
from command_line import run_here
from scipy.integrate import solve_ivp

from gen_profile.dynamics.evaluation.motion_evaluation import evaluate
from gen_profile.methods.solvers.plan import plan
from gen_profile.presentation.report.log import MeasuredLog, read_log
from gen_profile.presentation.report.measured import compare_measured
from gen_profile.presentation.report.measured_section import measured_verdict
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import OutputError

STEP = 0.01
OFFSET, SENSOR = 1.234, 0.004  # s by which the log begins earlier; m by which a sensor's zero is off


@pytest.fixture(scope="module")
def spec():
    return preset_spec("paper")


@pytest.fixture(scope="module")
def motion(spec):
    return plan(spec).evaluation.motion


def swing(motion, p, until):
    """Absolute angles of both ropes at multiples of STEP: Lagrange's equations in those coordinates."""

    def rate(t, state):
        a, b, da, db = state
        y = motion.derivative(np.array([t]), 2)[0, 0]
        mass = p["m1"] + p["m2"]
        coupling = p["m2"] * p["L1"] * p["L2"] * np.cos(a - b)
        M = [[mass * p["L1"] ** 2, coupling], [coupling, p["m2"] * p["L2"] ** 2]]
        twist = p["m2"] * p["L1"] * p["L2"] * np.sin(a - b)
        force = [
            mass * p["L1"] * (y * np.cos(a) - p["g"] * np.sin(a)) - twist * db**2,
            p["m2"] * p["L2"] * (y * np.cos(b) - p["g"] * np.sin(b)) + twist * da**2,
        ]
        return [da, db, *np.linalg.solve(M, force)]

    times = np.arange(0.0, until, STEP)
    solved = solve_ivp(rate, (0.0, until), [0.0] * 4, "DOP853", times, rtol=1e-9, atol=1e-12, max_step=0.2)
    return times, solved.y[0], solved.y[1]


def log(path, motion, p, *, until=8.0, columns=("position", "payload", "angles")):
    """Write what a machine with parameters p does, its clock and one sensor off."""
    moving, first, second = swing(motion, p, until)
    times = np.arange(0.0, until + OFFSET, STEP)
    later = times - OFFSET
    first, second = (np.interp(later, moving, angle) for angle in (first, second))
    signals = {
        "time_s": times,
        "position": {"cart_position_mm": 1e3 * motion(later).position[:, 0]},
        "payload": {"payload_sway_mm": 1e3 * (p["L1"] * np.sin(first) + p["L2"] * np.sin(second) + SENSOR)},
        "angles": {"hook_angle_deg": np.degrees(first), "payload_angle_deg": np.degrees(second)},
    }
    table = {"time_s": signals["time_s"]} | {k: v for name in columns for k, v in signals[name].items()}
    rows = np.array(list(table.values())).T
    lines = [";".join(f"{value:.6f}".replace(".", ",") for value in row) for row in rows]
    path.write_text("\n".join([";".join(table), *lines, ""]), "utf-8")
    after = later >= motion.duration
    return {
        load: 1e3 * np.abs(sway[after]).max()
        for load, sway in {
            "hook": p["L1"] * np.sin(first),
            "payload": p["L1"] * np.sin(first) + p["L2"] * np.sin(second),
        }.items()
    }


def report(tmp_path, *words):
    out = tmp_path / "report.html"
    outcome = run_here(
        "report", "--no-compare", "--measured", tmp_path / "log.csv", "--out", out, "--json", *words
    )
    measured = json.loads(outcome.out)["measured"] if outcome.code in {0, 4} else None
    return outcome, measured, out.read_text("utf-8") if out.exists() else ""


@pytest.mark.slow
@pytest.mark.parametrize("until", [5.1, 6.1])
def test_swings_that_a_log_cuts_short_have_no_other_zero(tmp_path, spec, motion, until):
    p = {**spec.plant.parameters, "L1": 0.470 * 0.95, "m2": 0.203 * 0.9}
    truth = log(tmp_path / "log.csv", motion, p, until=until)
    _, measured, _ = report(tmp_path)
    assert 1e3 * measured["sways"]["payload"]["residual_m"] == pytest.approx(truth["payload"], rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(
    "columns", [("position", "payload"), ("payload",), ("angles",), ("position", "angles")]
)
def test_the_start_is_found_and_the_residual_is_that_of_the_machine(tmp_path, spec, motion, columns):
    p = {**spec.plant.parameters, "L1": 0.470 * 0.84}
    truth = log(tmp_path / "log.csv", motion, p, columns=columns)
    outcome, measured, page = report(tmp_path)
    assert outcome.code == 0
    known = "position" in columns  # otherwise it is where the sway fits best, which another rope's shifts
    assert measured["start_s"] == pytest.approx(OFFSET, abs=1e-4 if known else 0.05)
    assert measured["passed"] is True
    loads = {"hook", "payload"} if "angles" in columns else {"payload"}
    assert set(measured["sways"]) == loads
    for load in loads:
        found = 1e3 * measured["sways"][load]["residual_m"]
        # angles were turned into sways with the rope's nominal length
        assert found == pytest.approx(truth[load], rel=0.01 if columns[-1] == "payload" else 0.25)
    assert "L1 −20\xa0% swings most like it." in page
    assert "Measured: kept." in page


def test_deviations_are_those_between_log_and_plan(tmp_path, spec, motion):
    """A drive that lags by 20 ms is off by its velocity times that."""
    times = np.arange(0.0, 8.0, STEP)
    late = motion(times - 0.02).position[:, 0]
    rows = "".join(f"{t:.3f},{x:.7f}\n" for t, x in zip(times, late, strict=True))
    (tmp_path / "log.csv").write_text(f"time_s,position_m\n{rows}", "utf-8")
    outcome, measured, page = report(tmp_path, "--measured-start", "0")
    off = np.abs(late - motion(times).position[:, 0])
    assert outcome.code == 0 and measured["start_s"] == 0.0
    assert measured["positions"]["cart"]["deviation_peak_m"] == pytest.approx(off.max(), rel=1e-3)
    assert measured["positions"]["cart"]["deviation_rms_m"] == pytest.approx(
        np.sqrt(np.mean(off[times <= 7.0] ** 2)), rel=1e-2
    )
    assert measured["passed"] is None and "Measured, not judged." in page


def test_noise_is_told_where_it_is_much_of_the_sway(spec, motion):
    times = np.arange(0.0, 8.0, STEP)
    evaluation, words = evaluate(spec, motion), []
    swung = evaluation.swing.at(times)[0].sway[:, 1]
    for noise in (0.0, 5e-4):
        sways = {"payload": swung + np.random.default_rng(1).normal(0.0, noise, len(times))}
        log = MeasuredLog(source="log.csv", times=times, positions={}, sways=sways, angles={})
        measured = compare_measured(spec, evaluation, log, motion.duration, 0.0)
        assert measured.sways["payload"].noise == pytest.approx(noise, rel=0.1, abs=1e-5)
        words.append(" ".join(measured_verdict(measured).sentences))
    assert ["counts as sway" in one for one in words] == [False, True]


@pytest.mark.slow
def test_a_machine_that_swings_too_much_fails(tmp_path, spec, motion):
    p = {**spec.plant.parameters, "L1": 0.470 * 0.6}
    truth = log(tmp_path / "log.csv", motion, p)
    assert max(truth.values()) > 3.0
    outcome, measured, page = report(tmp_path)
    assert outcome.code == 4
    assert measured["passed"] is False and "Measured: exceeded." in page
    assert outcome.errors[0].startswith("Check failed: On the machine the ")


@pytest.mark.slow
def test_people_are_told_what_the_machine_did_without_opening_the_page(tmp_path, spec, motion):
    log(tmp_path / "log.csv", motion, dict(spec.plant.parameters))
    words = ("--no-compare", "--measured", tmp_path / "log.csv", "--out", tmp_path / "page.html")
    assert "  measured  On the machine the payload swings by " in run_here("report", *words).out


@pytest.mark.slow
def test_a_log_that_ends_at_the_arrival_is_drawn_and_not_judged(tmp_path, spec, motion):
    log(tmp_path / "log.csv", motion, dict(spec.plant.parameters), until=3.5, columns=("position", "payload"))
    outcome, measured, page = report(tmp_path)
    assert outcome.code == 0 and measured["passed"] is None
    assert measured["sways"]["payload"]["residual_m"] is None
    assert "for the length of one slow swing after the arrival" in page


def test_a_log_without_the_move_is_refused(tmp_path, spec, motion):
    log(tmp_path / "log.csv", motion, dict(spec.plant.parameters), until=8.0)
    outcome, _, page = report(tmp_path, "--measured-start", "7")
    assert (outcome.code, page) == (2, "")
    assert "log on until the load is at rest" in outcome.errors[-1]


@pytest.mark.parametrize("factor", [1e-3, -1.0, 3.0])
def test_a_log_of_another_way_is_refused(spec, motion, factor):
    times = np.linspace(0.0, 8.0, 400)
    positions = {"cart": factor * motion(times).position[:, 0]}
    log = MeasuredLog(source="log.csv", times=times, positions=positions, sways={}, angles={})
    with pytest.raises(
        OutputError, match=f"cart goes from 0 to {0.3 * factor:.4g} m in the log, and from 0 to 0.3"
    ):
        compare_measured(spec, evaluate(spec, motion), log, motion.duration)


def test_values_that_stick_out_of_a_log_are_told_with_their_time(spec, motion):
    times = np.linspace(0.0, 8.0, 401)
    position = motion(times).position[:, 0]
    position[50:60] += 65.535
    log = MeasuredLog(source="log.csv", times=times, positions={"cart": position}, sways={}, angles={})
    with pytest.raises(
        OutputError, match=r"cart is at 65\.\d+ m at 1(\.\d+)? s, and the move leads it to 0\.\d+ m then"
    ):
        compare_measured(spec, evaluate(spec, motion), log, motion.duration, start=None)


@pytest.mark.slow
@pytest.mark.parametrize("columns", [("position", "payload"), ("payload",), ("angles",)])
def test_a_sensor_that_counts_the_other_way_is_told(tmp_path, spec, motion, columns):
    log(tmp_path / "log.csv", motion, spec.plant.parameters, columns=columns)
    read = read_log(tmp_path / "log.csv", spec)
    reversed_swings = {name: {k: -v for k, v in getattr(read, name).items()} for name in ("sways", "angles")}
    with pytest.raises(OutputError, match=r"as planned, but the other way round: .* negate the column"):
        compare_measured(spec, evaluate(spec, motion), attrs.evolve(read, **reversed_swings), motion.duration)


@pytest.mark.slow
@pytest.mark.parametrize("kept", ["hook", "payload"])
def test_one_rope_s_angle_tells_of_what_hangs_on_it_alone(tmp_path, spec, motion, kept):
    """The upper one's gives the hook's sway; the lower one's, without the upper one's, none."""
    p = {**spec.plant.parameters, "L2": 0.9 * spec.plant.parameters["L2"]}
    truth = log(tmp_path / "log.csv", motion, p, columns=("position", "angles"))
    left_out = {"hook": "payload", "payload": "hook"}[kept]
    text = (tmp_path / "log.csv").read_text("utf-8").replace(f"{left_out}_angle_deg", "temperature")
    (tmp_path / "log.csv").write_text(text, "utf-8")
    _, measured, page = report(tmp_path)
    assert set(measured["angles"]) == {kept}
    assert "Columns that were not used: temperature." in page
    if kept == "payload":
        assert measured["sways"] == {} and "nor do the angles in it alone: log those of all ropes." in page
    else:
        assert list(measured["sways"]) == ["hook"]
        assert 1e3 * measured["sways"]["hook"]["residual_m"] == pytest.approx(truth["hook"], rel=0.05)
        assert "Not measured: the sway of the payload." in page
