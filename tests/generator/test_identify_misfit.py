"""Logs that are not of the machine: told by what is left of them, and never answered with a narrow range."""

import numpy as np
import pytest
from generator.free_swings import inside, swing
from scipy.integrate import solve_ivp

from gen_profile.plants.registry import find_plant
from gen_profile.presentation.charts.identification import identification_figure
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.identification import misfit
from gen_profile.studies.identification.estimation import estimate
from gen_profile.studies.identification.fit import Fit, fit_of
from gen_profile.studies.identification.identify import identify
from gen_profile.studies.identification.measurements import Period, SwingLog, cut_swing, parse_reading
from gen_profile.studies.identification.misfit import Explanation, elsewhere, likeliest, spectrum
from gen_profile.studies.identification.swing_model import (
    SwingingMachine,
    SwingModel,
    require_likely,
    swing_model,
)
from gen_profile.studies.identification.uncertainty import uncertainty
from gen_profile.support.errors import InfeasibleProblem, SpecError

CRANE, HOIST = find_plant("double-pendulum-crane"), find_plant("single-pendulum-crane")
TIMES = np.arange(0.0, 15.0, 0.1)
NOISE = np.random.default_rng(4).normal(0.0, 1e-3, len(TIMES))


def log_of(values, quantity="angle", load="payload"):
    return SwingLog(times=TIMES, values=values, quantity=quantity, load=load)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "read"), [(0, ()), (1, ("L1=6.0±0.1",))])
def test_noise_alone_tells_no_rope(seed, read):
    """The least of its noise at some frequency gave a rope of 4.5 ± 1.4 m where it was 6.05 m."""
    times = np.arange(0.0, 60.0, 0.1)
    noise = np.random.default_rng(seed).normal(0.0, 1e-3, len(times))
    log = SwingLog(times=times, values=noise, quantity="rate", load="hook")
    with pytest.raises(InfeasibleProblem, match=r"shows no swing of this machine|does not come to rest"):
        identify(preset_spec("bay-crane"), [log, *map(parse_reading, read)], ["L1"])


@pytest.mark.slow
@pytest.mark.parametrize(("quantity", "first"), [("angle", -4.0), ("rate", 0.0)])
def test_a_log_that_begins_while_the_axis_moves_is_refused_with_the_cure(quantity, first):
    """It was said to be of another machine, or noise."""
    spec = preset_spec("single-pendulum-crane", ["plant.L0=2.6", "plant.c=0"])  # its rope has 6.2 m
    stops = 10.0  # s

    def rates(t, x):
        push = 0.3 * ((t < 4.0) - float(6.0 < t < stops))
        return [x[1], -(9.81 * np.sin(x[0]) + push * np.cos(x[0])) / 6.2]

    times = np.arange(0.0, 45.0, 0.05)
    angle, rate = solve_ivp(rates, (0.0, 45.0), [0.0, 0.0], "DOP853", times, max_step=0.05, rtol=1e-9).y
    values = (angle if quantity == "angle" else rate) + np.random.default_rng(3).normal(0.0, 5e-4, len(times))
    options = {"quantity": quantity, "load": "payload"}
    log = cut_swing(times + first, values, "log", after=None, **options)
    with pytest.raises(InfeasibleProblem, match=r"is one from (\S+) s on: .* \(after \1\)") as refused:
        identify(spec, [log], ["L0"], (0.0, 1.0))
    after = float(str(refused.value).split("(after ")[1].rstrip(")."))
    assert stops <= after - first <= stops + 6.0
    later = cut_swing(times + first, values, "log", after=after, **options)
    found = identify(spec, [later], ["L0"], (0.0, 1.0)).estimate
    assert abs(found.values["L0"] - 5.2) <= found.half_range["L0"] < 0.1


@pytest.mark.slow
def test_a_swing_of_the_size_of_its_noise_tells_the_rope():
    spec, times = preset_spec("bay-crane"), np.arange(0.0, 60.0, 0.1)
    true = {**spec.plant.parameters, "L1": 6.05}
    exact = swing(true, times, [0.0015, 0.0015, 0.0, 0.0], (8.0,), "double-pendulum-crane")
    noisy = exact + np.random.default_rng(0).normal(0.0, 1e-3, len(times))
    log = SwingLog(times=times, values=noisy, quantity="angle", load="hook")
    found = identify(spec, [log], ["L1"]).estimate
    assert inside(found, true) and found.half_range["L1"] < 0.1


@pytest.mark.parametrize(("per_rad", "refused"), [(1.0, False), (180.0 / np.pi, True)])
def test_degrees_under_the_name_of_rad_are_named_before_anything_is_searched(monkeypatch, per_rad, refused):
    """The slow mode swings by 2 rad then; the fast one, for which it was taken, by less than 45°."""
    spec, times = preset_spec("bay-crane"), np.arange(0.0, 60.0, 0.1)
    exact = swing(spec.plant.parameters, times, [0.03, 0.03, 0.0, 0.0], (8.0,), "double-pendulum-crane")
    log = SwingLog(times=times, values=per_rad * np.gradient(exact, times), quantity="rate", load="hook")
    machine = SwingingMachine(plant=CRANE, parameters=spec.plant.parameters, q_a=(8.0,))
    if not refused:
        require_likely(swing_model(machine, log))
        return
    monkeypatch.setattr(Fit, "solve", lambda *_: pytest.fail("it was searched"))
    with pytest.raises(InfeasibleProblem, match=r"rad/s to either side, a swing of \d+°: look at its unit"):
        identify(spec, [log], ["L1"])


def hoist(**changed):
    return SwingingMachine(plant=HOIST, parameters=HOIST.nominal() | changed, q_a=(0.0, 4.0))


@pytest.mark.slow
def test_another_rope_that_is_wrong_is_named():
    true = CRANE.nominal() | {"L1": 0.52, "L2": 0.40}
    times = 0.5 * TIMES
    exact = swing(true, times, [0.1, -0.05, 0.2, 0.3], (0.0,), "double-pendulum-crane")
    log = SwingLog(times=times, values=exact + NOISE, quantity="angle", load="hook")
    machine = SwingingMachine(plant=CRANE, parameters=true | {"L1": 0.47, "L2": 0.36}, q_a=(0.0,))
    with pytest.raises(
        InfeasibleProblem, match=r"rad RMS, .* is left of it, strongest at .*another .*L2"
    ) as refusal:
        estimate(machine, ["L1"], [], [log])
    assert "free " in str(refusal.value)
    assert inside(estimate(machine, ["L1", "L2"], [], [log]), true)


@pytest.mark.slow
@pytest.mark.parametrize("lasts", [12.6, 20.0])
def test_a_rope_far_from_the_spec_s_is_found(lasts):
    """The search from 1.5 m ended beside a log of 4 m, or did not come to rest."""
    spec, times = preset_spec("bay-crane"), np.arange(0.0, lasts, 0.04)
    true = {**spec.plant.parameters, "L2": 4.0}
    exact = swing(true, times, [0.012, -0.01, 0.0, 0.004], (8.0,), "double-pendulum-crane")
    rates = np.gradient(exact, times) + np.random.default_rng(0).normal(0.0, 1e-3, len(times))
    log = SwingLog(times=times, values=rates, quantity="rate", load="hook")
    found = identify(spec, [log, parse_reading("L1=6.0±0.01")], ["L2"]).estimate
    assert inside(found, true) and found.half_range["L2"] < 0.1


@pytest.mark.slow
def test_swings_that_are_not_small_are_fitted_as_such_where_small_ones_mislead():
    """The fit of small swings led to ropes of 5.5 and 2 m, and the log was said not to be of the machine."""
    spec, times = preset_spec("bay-crane"), np.arange(0.0, 14.0, 0.2)
    exact = swing(spec.plant.parameters, times, [0.2, 0.2, 0.0, 0.0], (8.0,), "double-pendulum-crane")
    noise = np.random.default_rng(0).normal(0.0, 1e-3, len(times))
    log = SwingLog(times=times, values=exact + noise, quantity="angle", load="hook")
    found = identify(spec, [log], ["L1", "L2"]).estimate
    assert inside(found, spec.plant.parameters) and found.half_range["L2"] < 0.1


@pytest.mark.slow
def test_a_damping_that_is_wrong_is_named():
    exact = swing(HOIST.nominal() | {"c": 1500.0}, TIMES, [0.15, 0.0])
    with pytest.raises(InfeasibleProblem, match=r"with another c than the spec's .*; free c, too"):
        estimate(hoist(c=0.0), ["L0"], [], [log_of(exact + NOISE)])


@pytest.mark.slow
def test_of_parameters_that_explain_a_log_alike_none_is_advised():
    """A swing tells c/m and nothing else of both, so m must not be blamed where c is another one."""
    exact = swing(HOIST.nominal() | {"c": 1500.0}, TIMES, [0.15, 0.0])
    with pytest.raises(InfeasibleProblem, match="measure one of them directly") as refusal:
        estimate(hoist(c=200.0), ["L0"], [], [log_of(exact + NOISE)])
    assert "another m than" in str(refusal.value) and "another c than" in str(refusal.value)
    assert "free m" not in str(refusal.value) and "such as" not in str(refusal.value)


def test_what_explains_a_log_worse_beyond_chance_is_not_named():
    """The same rope, once by a search that was stopped many standard deviations beside its end."""
    log = log_of(swing(HOIST.nominal(), TIMES, [0.15, 0.0]) + NOISE)
    fit = fit_of(hoist(), ["L0"], [], [swing_model(hoist(), log)])
    unknowns, noise = fit.solve()
    wide = uncertainty(fit, unknowns, noise).standard[0]
    off = [unknowns + beside * wide * np.eye(len(unknowns))[0] for beside in (0.0, 1.0, 40.0)]
    best, near, far = (Explanation(freed=("L0",), fit=fit, unknowns=place, noise=noise) for place in off)
    assert likeliest([far, near, best]) == (near, best)


@pytest.mark.slow
def test_what_no_parameter_explains_widens_the_range():
    """As a wind that comes and goes, or a trolley that rocks."""
    exact = swing(HOIST.nominal() | {"c": 300.0}, TIMES, [0.15, 0.0])
    clean = estimate(hoist(c=300.0), ["L0"], [], [log_of(exact + NOISE)])
    torn = estimate(hoist(c=300.0), ["L0"], [], [log_of(exact + NOISE + 0.005 * np.sin(3.1 * TIMES))])
    assert clean.misfits == (None,) and clean.widened == (1.0,)
    (left,) = torn.misfits
    assert left.rms == pytest.approx(0.005 / np.sqrt(2.0), rel=0.1)
    assert left.frequency == pytest.approx(3.1, abs=0.2)
    assert torn.noise[0] == pytest.approx(np.hypot(left.rms, 1e-3), rel=0.1)
    assert torn.half_range["L0"] > 20.0 * clean.half_range["L0"]


@pytest.mark.slow
def test_where_no_machine_explains_half_of_a_log_large_swings_are_not_tried(monkeypatch):
    """They took more than ten minutes for 6,000 rows of a gyroscope that drifts."""
    monkeypatch.setattr(misfit, "nothing_left", lambda *_: pytest.fail("large swings were tried"))
    values = np.cumsum(np.random.default_rng(0).normal(0.0, 2e-3, len(TIMES)))
    machine = SwingingMachine(plant=HOIST, parameters=HOIST.nominal(), q_a=(0.0, 4.0))
    known = parse_reading(f"L0={HOIST.nominal()['L0']}±0.01")
    found = estimate(machine, ["L0"], [known], [log_of(values, load=HOIST.loads[0])])
    assert found.misfits[0] is not None


@pytest.mark.slow
def test_logs_of_two_machines_are_refused():
    own, other = (swing(HOIST.nominal() | {"L0": rope}, TIMES, [0.15, 0.0]) + NOISE for rope in (2.0, 2.1))
    assert estimate(hoist(), ["L0"], [], [log_of(own), log_of(0.7 * own)]).half_range["L0"] < 0.02
    with pytest.raises(InfeasibleProblem, match=r"not of one machine: number 1, of payload, is .* times"):
        estimate(hoist(), ["L0"], [], [log_of(own), log_of(other)])


def test_noise_is_no_misfit():
    """White, or alike from sample to sample: 100 spectra of each without a line."""
    random = np.random.default_rng(8)
    for width in (1, 4):
        for _ in range(100):
            noise = np.convolve(random.normal(size=len(TIMES) + width - 1), np.ones(width), "valid")
            found = spectrum(TIMES, noise, 2.0)
            assert (found.power < found.threshold).all()


def test_a_spectrum_of_white_noise_is_its_variance():
    """In the mean of many: a windowed one has few ordinates of its own."""
    noises = np.random.default_rng(9).normal(0.0, 0.3, (50, len(TIMES)))
    powers = [spectrum(TIMES, noise, 100.0).power.mean() for noise in noises]
    assert np.mean(powers) == pytest.approx(0.3**2, rel=0.05)


def test_a_swing_too_wide_for_a_crane_is_in_another_unit():
    values = 180.0 / np.pi * swing(HOIST.nominal(), TIMES, [0.1, 0.0])
    with pytest.raises(InfeasibleProblem, match=r"to either side, a swing of .*°: look at its unit"):
        estimate(hoist(), ["L0"], [], [log_of(values, "sway")])
    with pytest.raises(SpecError, match="more than half a turn; is it in deg"):
        estimate(hoist(), ["L0"], [], [log_of(values, "angle")])


def test_nothing_is_drawn_where_a_log_has_a_gap():
    logged = (TIMES < 5.0) | (TIMES > 7.0)
    values = (swing(HOIST.nominal(), TIMES, [0.1, 0.0]) + NOISE)[logged]
    log = SwingLog(times=TIMES[logged], values=values, quantity="angle", load="payload")
    figure = identification_figure(identify(preset_spec("single-pendulum-crane"), [log], ["L0"], (0.0, 4.0)))
    for line in [line for panel in figure.panels[:2] for line in panel.lines]:
        assert [5.0 < at < 7.0 for at in line.x[np.isnan(line.y)]] == [True]


def test_what_a_stopwatch_rests_on_is_told():
    """T² of a simple pendulum goes with L0 + the hoist over g; its mass and drives do not matter."""
    found = estimate(hoist(), ["L0"], [Period(mode=1, seconds=4.914, uncertainty=0.01)])
    assert found.rests_on["L0"].get("m", 0.0) == pytest.approx(0.0, abs=1e-9)
    crane = SwingingMachine(plant=CRANE, parameters=CRANE.nominal(), q_a=(0.0,))
    watched = [Period(mode=1, seconds=1.73, uncertainty=0.01)]
    found = estimate(crane, ["L1"], watched).rests_on["L1"]["L2"]
    longer = SwingingMachine(
        plant=CRANE, parameters=CRANE.nominal() | {"L2": 1.01 * CRANE.nominal()["L2"]}, q_a=(0.0,)
    )
    moved = estimate(longer, ["L1"], watched).values["L1"] - estimate(crane, ["L1"], watched).values["L1"]
    assert found == pytest.approx(moved, rel=0.02)


def test_large_swings_that_differ_little_from_small_ones_are_not_tried(monkeypatch):
    """Fitting them took minutes for the log of another machine, before it was refused."""
    monkeypatch.setattr(misfit, "nothing_left", lambda *_, **__: pytest.fail("large swings were tried"))
    own = swing(HOIST.nominal(), TIMES, [0.02, 0.0])
    log = log_of(own + 0.005 * np.sin(3.1 * TIMES) + 0.1 * NOISE)
    assert elsewhere(fit_of(hoist(), ["L0"], [], [swing_model(hoist(), log)])) is None


def test_a_machine_whose_other_load_swings_too_far_explains_nothing(monkeypatch):
    """Its damping may be endless, so that each look at it took half a minute."""
    monkeypatch.setattr(SwingModel, "_outputs", lambda *_: pytest.fail("it was integrated"))
    machine = SwingingMachine(plant=CRANE, parameters=CRANE.nominal(), q_a=(0.0,))
    seen = log_of(NOISE, load="hook")
    fit = fit_of(machine, ["L1"], [], [swing_model(machine, seen)])
    assert not misfit._may_explain(fit, np.array([1.0, 0.0, 1.0, 0.0, 0.0, 0.0]))


@pytest.mark.slow
def test_a_log_that_nothing_explains_is_said_to_be_of_another_machine():
    """It was said to determine the rope to ± 3466 % only, and to be measured better."""
    foreign = log_of(0.05 * np.cos(3.1 * TIMES) + 0.012 * np.cos(5.3 * TIMES + 1.0) + 0.1 * NOISE)
    expected = r"^The log of payload is not of this machine: a swing of .* which no parameter explains; look"
    with pytest.raises(InfeasibleProblem, match=expected):
        identify(preset_spec("single-pendulum-crane"), [foreign], ["L0"], (0.0, 4.0))
