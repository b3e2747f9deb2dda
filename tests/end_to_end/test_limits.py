"""Limits of the spec, and the cures that are named where they are broken."""

import re

import pytest
from command_line import run_here

BROKEN = {"velocity": 0.15, "acceleration": 0.4, "jerk": 8.0, "sway": 0.015}


def settings(limits):
    return [word for name, value in limits.items() for word in ("--set", f"limits.{name}={value}")]


@pytest.mark.parametrize("limits", [{name: value} for name, value in BROKEN.items()] + [BROKEN])
@pytest.mark.parametrize("lag", [(), ("--set", "actuator={type='first-order', tau=0.1}")])
def test_a_broken_limit_is_named_with_a_cure_that_works(tmp_path, limits, lag):
    refused = run_here(*lag, *settings(limits), "--out", tmp_path / "new")
    assert (refused.code, refused.out) == (3, "")
    assert not (tmp_path / "new").exists()
    *named, cure = refused.errors
    assert [re.match(r"Error: limits\.(\w+): ", line)[1] for line in named] == list(limits)
    for line in named:
        assert re.fullmatch(r"Error: limits\.\w+: [\d.]+ is allowed, the motion needs [\d.]+\.", line)
    needed = re.findall(r"the motion needs ([\d.]+)\.", refused.err)
    raised = {name: 1.01 * float(value) for name, value in zip(limits, needed, strict=True)}
    assert run_here(*lag, *settings(raised), "--out", tmp_path / "new").code == 0
    for _ in range(3):  # it says "about", from how a motion of the same shape would scale
        enough = re.fullmatch(r"Error: Allow about ([\d.]+) s \(move\.duration\), or .* limits\.", cure)[1]
        words = (*lag, *settings(limits), "--set", f"move.duration={enough}")
        longer = run_here(*words, "--out", tmp_path / "new")
        if longer.code == 0:
            break
        cure = longer.errors[-1]
    assert longer.code == 0


def test_kept_limits_change_nothing(tmp_path):
    loose = settings({"velocity": 1.0, "acceleration": 1.0, "jerk": 100.0, "sway": 0.1})
    assert run_here("--out", tmp_path / "a").code == 0
    assert run_here(*loose, "--out", tmp_path / "b").code == 0
    assert (tmp_path / "a" / "paper.csv").read_bytes() == (tmp_path / "b" / "paper.csv").read_bytes()


def test_limits_bind_the_command_of_a_lagging_drive(tmp_path):
    """y + τ ẏ is steeper than y."""
    words = ("--set", "actuator={type='first-order', tau=0.1}", "--out", tmp_path, "--json")
    figures = run_here(*words).document["figures"]
    motion, command = figures["jerk_max_m_per_s3"], figures["command_jerk_max_m_per_s3"]
    assert command > 1.5 * motion
    between = f"limits.jerk={0.5 * (motion + command)}"
    assert run_here("--set", between, *words).code == 3
    assert run_here("--set", between, "--out", tmp_path).code == 0
