"""Limits of the spec: kept where they can be, and where not, refused with a cure that works."""

import pytest
from command_line import run_here

LAG = ("--set", "actuator={type='first-order', tau=0.1}")
FIGURES = {
    "velocity": "velocity_max_m_per_s",
    "acceleration": "acceleration_max_m_per_s2",
    "jerk": "jerk_max_m_per_s3",
    "sway": "sway_transient_worst_m",
}
TIGHT = {"velocity": 0.15, "acceleration": 0.4, "jerk": 8.0, "sway": 0.018}  # all below what is best without
WITHIN = {"sway": 1.01}  # times a limit: of the worst machine, which a search finds; else rounding
IMPOSSIBLE = [
    ("velocity", 0.09, ()),
    ("acceleration", 0.1, LAG),
    ("jerk", 0.3, ()),
    ("sway", 0.01, ()),
]


@pytest.fixture(scope="module")
def free(tmp_path_factory):
    """Figures without limits."""
    return run_here("--no-check", "--out", tmp_path_factory.mktemp("free"), "--json").document["figures"]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit"), TIGHT.items())
def test_a_limit_that_can_be_kept_is_kept(tmp_path, free, name, limit):
    outcome = run_here("--set", f"limits.{name}={limit}", "--out", tmp_path, "--json")
    assert outcome.code == 0, outcome.err
    assert free[FIGURES[name]] > limit
    assert outcome.document["figures"][FIGURES[name]] <= limit * WITHIN.get(name, 1.0 + 1e-6)
    assert outcome.document["check"]["passed"]


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize(("name", "limit", "lag"), IMPOSSIBLE)
def test_an_impossible_limit_is_named_with_a_cure_that_works(tmp_path, name, limit, lag):
    words = (*lag, "--set", f"limits.{name}={limit}", "--out", tmp_path / "new", "--json")
    refused = run_here(*words)
    assert refused.code == refused.document["error"]["exit_code"] == 3
    assert not (tmp_path / "new").exists()
    (error,) = refused.errors
    assert f"limits.{name}" in error
    suggested = [one["values"] for one in refused.document["error"]["suggestions"]]
    (least,) = (values["move.duration"] for values in suggested if "move.duration" in values)
    (wider,) = (values[f"limits.{name}"] for values in suggested if f"limits.{name}" in values)
    figure = ("command_" if lag else "") + FIGURES[name]
    for cure, allowed in ((f"move.duration={least}", limit), (f"limits.{name}={wider}", wider)):
        cured = run_here(*words, "--no-check", "--set", cure)
        assert cured.code == 0, cured.err
        assert cured.document["figures"][figure] <= allowed * WITHIN.get(name, 1.0 + 1e-6)
    assert least > 3.0
    assert wider > limit


def test_loose_limits_change_nothing(tmp_path):
    loose = {"velocity": 1.0, "acceleration": 2.0, "jerk": 100.0, "sway": 0.1}
    words = [word for name, limit in loose.items() for word in ("--set", f"limits.{name}={limit}")]
    assert run_here("--out", tmp_path / "a").code == 0
    assert run_here(*words, "--out", tmp_path / "b").code == 0
    assert (tmp_path / "a" / "paper.csv").read_bytes() == (tmp_path / "b" / "paper.csv").read_bytes()


def test_limits_bind_the_command_of_a_lagging_drive(tmp_path):
    """y + τ ẏ is faster than y."""
    words = (*LAG, "--out", tmp_path, "--json")
    figures = run_here(*words).document["figures"]
    motion, command = figures["velocity_max_m_per_s"], figures["command_velocity_max_m_per_s"]
    assert command > 1.05 * motion
    limit = 0.5 * (motion + command)
    limited = run_here("--set", f"limits.velocity={limit}", *words)
    assert limited.code == 0, limited.err
    assert limited.document["figures"]["command_velocity_max_m_per_s"] <= limit * (1.0 + 1e-6)


@pytest.mark.slow
def test_a_shortest_motion_without_a_limit_of_the_jerk_tells_its_own(tmp_path):
    shortest = ("--set", "move.duration=minimum", "--set", "limits.acceleration=0.7", "--no-check")
    outcome = run_here(*shortest, "--out", tmp_path, "--json")
    (warning,) = outcome.errors
    asked = outcome.document["axes"]["cart"]["jerk_max_m_per_s3"]
    assert f"asks cart for {asked:.4g} m/s³, as no limit of its jerk is stated" in warning
    assert run_here(*shortest, "--set", "limits.jerk=60", "--out", tmp_path, "--json").errors == []
