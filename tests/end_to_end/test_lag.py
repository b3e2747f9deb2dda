"""Drives that lag: the command leads by exactly what they lose."""

import numpy as np
import pytest
from command_line import run_here

TAU = 0.1
LAGGING = ("--set", "actuator.type=first-order", "--set", f"actuator.tau={TAU}")


def table(path):
    return np.loadtxt(path, delimiter=",", skiprows=1).T


@pytest.fixture
def both(tmp_path):
    assert run_here("--out", tmp_path / "ideal").code == 0
    outcome = run_here(*LAGGING, "--export", "csv", "--export", "can", "--out", tmp_path / "lagging")
    assert outcome.code == 0
    assert "peak command" in outcome.out
    return tmp_path / "ideal" / "paper.csv", tmp_path / "lagging" / "paper.csv"


@pytest.mark.slow
def test_the_command_is_the_motion_and_tau_times_its_rate(both):
    ideal, lagging = map(table, both)
    for order in (1, 2, 3):  # position, velocity, acceleration
        np.testing.assert_allclose(
            lagging[order], ideal[order] + TAU * ideal[order + 1], rtol=0.0, atol=1e-9 * 10**order
        )
    assert lagging[1, -1] == ideal[1, -1] == 0.3
    assert np.abs(lagging[1] - ideal[1]).max() > 0.01


@pytest.mark.slow
def test_a_drive_with_that_lag_arrives_without_sway(both):
    lagging = both[1]
    for artefact in (lagging, lagging.with_suffix(".log")):
        outcome = run_here("check", artefact, "--json")
        assert outcome.code == 0
        check = outcome.document["check"]
        assert check["arrival_s"] == pytest.approx(3.0 + 10.0 * TAU)
        assert check["scenarios"][0]["residual_peak_m"] < 5e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("actuator", "arrival"), [("{type='ideal'}", 3.0), ("{type='first-order', tau=0.2}", 5.0)]
)
def test_another_lag_is_judged_as_that_drive_moves(both, actuator, arrival):
    """It stops at another time, as still: to first order, filtering what excites no mode excites none."""
    words = ("--preset", "paper", "--set", f"actuator={actuator}")
    check = run_here("check", both[1], *words, "--json").document["check"]
    assert check["arrival_s"] == pytest.approx(arrival)
    assert check["scenarios"][0]["residual_peak_m"] < 10e-6


@pytest.mark.slow
def test_an_ideal_command_does_not_arrive_in_time_with_a_lagging_drive(both):
    outcome = run_here("check", both[0], "--preset", "paper", *LAGGING, "--json")
    assert outcome.document["artefact"]["manifest"] == "none"
    assert outcome.document["check"]["arrival_s"] == pytest.approx(4.0)


def test_a_costly_lead_is_warned_of(tmp_path):
    """The paper's β = 50 and τ = 0.1 s: 2.59 m/s² for 0.70, and 3.15 mm beyond the target."""
    costly = run_here(*LAGGING, "--no-check", "--out", tmp_path)
    assert "3.7 times the motion's acceleration and overshoots by 3.15" in costly.out
    cheap = run_here(*LAGGING[:3], "actuator.tau=0.01", "--no-check", "--out", tmp_path)
    assert "peak command" in cheap.out
    assert "drive lag" not in cheap.out
