"""Random draws, other drives and faults of timing, against a Monte Carlo written separately.

The equations are Lagrange's of both angles from the vertical, solved by Cramer's rule for all machines at
once, and integrated by SciPy; the drive's lag is integrated along. Parameters, draws and setpoints are the
project's.
"""

import json

import attrs
import numpy as np
import pytest
from command_line import error_of, run_here
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from gen_profile.assurance.verification.check import _verdict, check_artefact
from gen_profile.assurance.verification.setpoint_path import transmitted
from gen_profile.assurance.verification.time_scales import standstill
from gen_profile.assurance.verification.verdict import MOST_LISTED
from gen_profile.dynamics.evaluation.residual_sway import observation_time
from gen_profile.dynamics.evaluation.scenarios import further_scenarios, scenarios
from gen_profile.dynamics.evaluation.simulation import PlantSimulation
from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.metrics import peak
from gen_profile.motion.profile import SampledProfile, sample
from gen_profile.spec.reading import preset_spec
from gen_profile.support.progress import no_progress

RANGES = "check.uncertain={L1=0.2, m2=0.15, L2=0.1}"
DAMPING = "check.spans={c1=[0.0, 0.004], c2=[0.0, 0.002]}"
LOOSE = "check.residual_sway=0.05"


def design(folder, *overrides, cycle="0.001"):
    words = [word for override in (*overrides, LOOSE) for word in ("--set", override)]
    outcome = run_here(*words, "--cycle-time", cycle, "--out", folder, "--json")
    assert outcome.code == 0, outcome.err
    return folder / "paper.csv"


def pushes(angles, rates, push, p):
    """Accelerations of both angles from the vertical, for all machines."""
    (a, b), (u, v) = angles, rates
    m1, m2, L1, L2, g, c1, c2 = (p[name] for name in ("m1", "m2", "L1", "L2", "g", "c1", "c2"))
    m11, m12, m22 = (m1 + m2) * L1**2, m2 * L1 * L2 * np.cos(a - b), m2 * L2**2
    whirl, joint = m2 * L1 * L2 * np.sin(a - b), c2 * (v - u)
    f1 = (m1 + m2) * L1 * (push * np.cos(a) - g * np.sin(a)) - whirl * v**2 - c1 * u + joint
    f2 = m2 * L2 * (push * np.cos(b) - g * np.sin(b)) + whirl * u**2 - joint
    return np.array([f1 * m22 - f2 * m12, f2 * m11 - f1 * m12]) / (m11 * m22 - m12**2)


def parameters(findings):
    names = findings[0].scenario.parameters
    return {name: np.array([found.scenario.parameters[name] for found in findings]) for name in names}


def peaks(states, p):
    """Greatest sway of hook and payload of every machine, from angles (2, machines, times)."""
    hook = p["L1"][:, None] * np.sin(states[0])
    payload = hook + p["L2"][:, None] * np.sin(states[1])
    return np.stack([np.abs(hook).max(axis=1), np.abs(payload).max(axis=1)], axis=1)


def integrate(push, p, state, span, points=None):
    machines = len(p["L1"])

    def rates(t, x):
        angles, speeds = x.reshape(2, 2, machines)
        return np.concatenate([speeds.ravel(), pushes(angles, speeds, push(t), p).ravel()])

    found = solve_ivp(
        rates, span, state, method="DOP853", rtol=1e-9, atol=1e-12, max_step=0.02, t_eval=points
    )
    return found.y


def table(path):
    rows = [line.split(",") for line in path.read_text("utf-8").splitlines() if line[:1].isdigit()]
    return np.array(rows, dtype=float)


@pytest.mark.slow
def test_draws_agree_with_a_separate_monte_carlo_within_the_bound(tmp_path):
    artefact = design(tmp_path, RANGES, DAMPING, "check.samples=40", "check.seed=3")
    check = check_artefact(artefact).check
    drawn = check.groups["samples"]
    assert len(drawn) == 40
    p = parameters(drawn)
    columns = table(artefact)
    velocity = make_interp_spline(columns[:, 0], columns[:, 2], k=5)
    acceleration = velocity.derivative()
    still = standstill(preset_spec("paper", [RANGES]), setpoints_of(columns))
    moved = integrate(lambda t: acceleration(t) if t < 3.0 else 0.0, p, np.zeros(160), (0.0, still))[:, -1]
    watched = np.linspace(still, still + 4.0, 4001)
    free = integrate(lambda _: 0.0, p, moved, (still, watched[-1]), watched)
    expected = peaks(free.reshape(2, 2, 40, -1)[0], p)
    found = np.array([list(finding.residual.values()) for finding in drawn])
    assert check.error_bound < 1.5e-6
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=check.error_bound)
    assert found.max() > 1e-3
    assert len(check.groups["machines"]) + len(check.groups["corners"]) == 1 + 2**5 + 2 * 5


def setpoints_of(columns):
    return SampledProfile(cycle_time=round(columns[1, 0], 9), position=columns[:, 1:2])


PATHS = {
    "lag": "check.path={lag=[0.015, 0.02]}",
    "quantum": "check.path={quantum=1e-3, lag=[0.01, 0.01]}",
    "hold": "check.path={between='hold', lag=[0.02, 0.02]}",
    "jitter": "check.path={jitter=0.004, lag=[0.01, 0.01]}",
    "lost": "check.path={lost=0.2, lag=[0.01, 0.01]}",
    "late": "check.path={latency=0.037}",
}


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS.keys())
def test_whatever_happens_to_setpoints_on_the_way_agrees_with_a_separate_simulation(tmp_path, path):
    artefact = design(tmp_path, path, cycle="0.01")
    check = check_artefact(artefact).check
    spec = preset_spec("paper", [path, "export.cycle_time=0.01"])
    setpoints = setpoints_of(table(artefact))
    chosen = check.groups.get("timing", check.groups.get("drives", ()))[-1]
    feed = transmitted(spec, setpoints, [chosen.scenario])
    times, position = (np.squeeze(feed.times), np.squeeze(feed.position))
    expected = followed(times, position, chosen.scenario, standstill(spec, setpoints))
    np.testing.assert_allclose(list(chosen.residual.values()), expected, rtol=0.0, atol=check.error_bound)


def followed(times, position, scenario, still):
    """Sway of hook and payload behind a drive that is led from point to point: tau dv/dt = r − v."""
    p = {name: np.array([value]) for name, value in scenario.parameters.items()}
    tau = scenario.lag or 0.0
    state, speed = np.zeros(4), 0.0
    ends = np.append(times, still)
    for asked, start, end in zip([*np.diff(position) / np.diff(times), 0.0], ends, ends[1:], strict=False):
        if tau == 0.0:
            impulse = pushes(state[:2, None], np.zeros((2, 1)), asked - speed, {**p, "g": np.zeros(1)})
            state[2:] += impulse[:, 0]
            speed = asked
            state = integrate(lambda _: 0.0, p, state, (start, end))[:, -1]
            continue
        begun = speed

        def push(t, start=start, asked=asked, begun=begun):
            return (asked - begun) / tau * np.exp(-(t - start) / tau)

        state = integrate(push, p, state, (start, end))[:, -1]
        speed = asked + (begun - asked) * np.exp(-(end - start) / tau)
    free = integrate(lambda _: 0.0, p, state, (still, still + 4.0), np.linspace(still, still + 4.0, 8001))
    return peaks(free.reshape(2, 2, 1, -1)[0], p)[0]


def test_the_draws_fill_their_ranges_evenly_and_are_the_same_again(tmp_path):
    spec = preset_spec("paper", [RANGES, DAMPING, "check.samples=50", "check.path={lag=[0.0, 0.01]}"])
    rows = [row for row in further_scenarios(spec, scenarios(spec)) if row.group == "samples"]
    assert rows == [row for row in further_scenarios(spec, scenarios(spec)) if row.group == "samples"]
    for name, (low, high) in spec.checked_ranges().items():
        values = np.sort([row.parameters[name] for row in rows])
        strata = np.floor((values - low) / (high - low) * 50)
        np.testing.assert_array_equal(strata, np.arange(50))
    assert len({round(row.lag * 5000) for row in rows}) > 25
    other = attrs.evolve(spec, check=attrs.evolve(spec.check, seed=1))
    assert rows != [row for row in further_scenarios(other, scenarios(other)) if row.group == "samples"]


def test_groups_are_judged_apart_and_timing_only_when_strict(tmp_path):
    """One setpoint in three is lost; of the rest, the limit allows what the machines leave and no more."""
    shaky = "check.path={lost=0.33}"
    artefact = design(tmp_path, shaky, cycle="0.01")
    words = ("--preset", "paper", "--set", shaky, "--set", "export.cycle_time=0.01")
    tight = (*words, "--set", "check.residual_sway=0.0022")
    loose = run_here("check", artefact, *tight, "--json")
    groups = {group["group"]: group for group in loose.document["check"]["groups"]}
    assert [group["passed"] for group in groups.values()] == [True, False]
    assert (loose.code, groups["timing"]["counts"]) == (0, False)
    assert "It counts where the check is strict." in loose.err
    strict = run_here("check", artefact, *tight, "--strict", "--json")
    assert (strict.code, strict.document["check"]["groups"][1]["counts"]) == (4, True)
    assert "timing" in strict.err


@pytest.mark.slow
def test_many_rows_leave_a_small_manifest_and_stay_replayable(tmp_path):
    artefact = design(tmp_path, RANGES, "check.samples=100", cycle="0.01")
    check = json.loads((tmp_path / "manifest.json").read_text("utf-8"))["check"]
    drawn = [row for row in check["scenarios"] if row["group"] == "samples"]
    (group,) = [group for group in check["groups"] if group["group"] == "samples"]
    assert group["rows"] == 100 and len(drawn) == MOST_LISTED
    assert group["worst"]["row"] in [row["row"] for row in drawn]
    assert (
        group["quantiles_m"]["0.5"] < group["quantiles_m"]["0.99"] <= group["worst"]["residual_peak_m"] + 1e-3
    )
    row = group["worst"]["row"]
    (alone,) = run_here("check", artefact, "--scenario", row, "--json").document["check"]["scenarios"]
    (listed,) = [one for one in drawn if one["row"] == row]
    assert alone["residual_peaks_m"] == pytest.approx(listed["residual_peaks_m"], rel=1e-9)
    assert {**alone, "residual_peak_m": 0, "residual_peaks_m": 0, "residual_modal_m": 0} == {
        **listed,
        "residual_peak_m": 0,
        "residual_peaks_m": 0,
        "residual_modal_m": 0,
    }
    outcome = run_here("check", artefact, "--scenario", "9999")
    assert (outcome.code, len(outcome.errors)) == (2, 1)
    more = run_here("check", artefact, "--samples", "10")
    assert more.code == 0 and "samples, 10" in more.out


def test_jitter_beyond_the_cycle_is_a_sentence(tmp_path):
    outcome = run_here("--set", "check.path={jitter=0.002}", "--out", tmp_path)
    assert (outcome.code, outcome.errors[-1][:24]) == (2, "Error: check.path.jitter")
    assert not list(tmp_path.iterdir())


# on the nominal machine alone a right profile leaves nothing
ALONE = (
    "--set",
    "robustness={}",
    "--set",
    "check.residual_sway=5e-6",
    "--set",
    "export.csv_columns=['position']",
)


@pytest.fixture(scope="module")
def right(tmp_path_factory):
    folder = tmp_path_factory.mktemp("right")
    assert run_here(*ALONE, "--out", folder).code == 0
    return folder / "paper.csv"


def stretched(position):
    times = np.arange(len(position)) * 1e-3
    longer = np.arange(int(len(position) * 1.02)) * 1e-3
    return np.interp(longer / 1.02, times, position)


def moved(position):
    position[1500] += 1e-3
    return position


def cut(position):
    return np.append(position[:2900], np.full(100, position[-1]))


@pytest.mark.parametrize("change", [stretched, moved, cut])
def test_what_is_wrong_by_design_fails_on_its_sway(right, tmp_path, change):
    """The spec goes along instead of the manifest, so that the hash tells nothing."""
    head, *lines = right.read_text("utf-8").splitlines()
    position = change(np.array([float(line.split(",")[1]) for line in lines]))
    rows = [f"{index / 1000:.3f},{float(value)!r}" for index, value in enumerate(position)]
    (tmp_path / "paper.csv").write_text("\n".join([head, *rows]) + "\n", "utf-8", newline="")
    assert "sways by" in error_of("check", tmp_path / "paper.csv", "--preset", "paper", *ALONE, code=4)


def test_what_is_right_passes(right):
    assert run_here("check", right).code == 0


@pytest.mark.slow
def test_a_shaper_for_another_rope_fails_on_its_sway(tmp_path):
    limit = ("--set", "robustness={}", "--set", "check.residual_sway=5e-4")
    for rope, code in ((0.47, 0), (0.6, 4)):
        words = ("--method", "zvd", "--set", f"plant.L1={rope}", "--out", tmp_path / f"{rope}")
        assert run_here(*words, *limit).code == 0
        outcome = run_here("check", tmp_path / f"{rope}" / "paper.csv", "--preset", "paper", *limit)
        assert outcome.code == code
    assert "sways by" in outcome.err


def test_one_altered_count_fails_on_its_hash(right, tmp_path):
    for file in right.parent.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    text = (tmp_path / "paper.csv").read_text("utf-8").splitlines(keepends=True)
    time, _, value = text[1500].partition(",")
    text[1500] = f"{time},{float(value) + 1e-9:.12g}\n"
    (tmp_path / "paper.csv").write_text("".join(text), "utf-8", newline="")
    assert "altered after its export" in error_of("check", tmp_path / "paper.csv", code=4)


@pytest.mark.slow
@pytest.mark.parametrize(
    "overrides",
    [
        ("gantry-crane",),
        ("tower-crane",),
        ("single-pendulum-crane",),
        ("paper", "move.initial={theta1=0.02}"),
        ("paper", "move.final_velocity=0.1", "move.initial={'theta2.rate'=0.05}"),
    ],
    ids=lambda overrides: overrides[-1],
)
def test_draws_of_any_machine_agree_with_the_exact_motion(overrides):
    """Several axes, a hoist, a load that swings at the start, and axes that go on."""
    name, *rest = overrides
    spec = preset_spec(name, [*rest, "check.samples=6"])
    motion = plan(spec).evaluation.motion
    setpoints = sample(motion, spec.export.cycle_time)
    machines = scenarios(spec)
    rows = (*machines, *further_scenarios(spec, machines))
    check = _verdict(spec, setpoints, rows, no_progress)
    drawn, still = check.groups["samples"], standstill(spec, setpoints)
    watched = np.linspace(still, still + observation_time(spec), 8001)
    drawn_machines = [finding.scenario.parameters for finding in drawn]
    exact = PlantSimulation(spec.machine(), motion, drawn_machines, watched[-1], spec.move.initial).at(
        watched
    )
    expected = [peak(response.sway) for response in exact]
    found = [list(finding.residual.values()) for finding in drawn]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=check.error_bound)
    assert len(drawn) == 6 and np.max(found) > 1e-4
