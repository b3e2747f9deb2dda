"""What was found before is found again: at once, to the last bit, and counted as the same work."""

import pytest

from gen_profile.methods.solvers.indirect import solver as indirect
from gen_profile.methods.solvers.plan import plan
from gen_profile.spec.reading import preset_spec
from gen_profile.support.remembered import KEPT, forget, remembered
from gen_profile.support.work import OutOfWork, budget, left, spend


def test_what_is_found_again_counts_as_much_work_as_before():
    calls = []

    @remembered(lambda number, *, aside: number)
    def square(number, *, aside):
        spend(0.25)
        calls.append((number, aside))
        return number**2

    for aside in ("one", "two"):
        with budget(1.0):
            assert square(3, aside=aside) == 9
            assert left() == pytest.approx(0.75, abs=1e-9)
    assert calls == [(3, "one")]
    with budget(0.2), pytest.raises(OutOfWork):
        square(3, aside="three")
    for number in range(4, 4 + KEPT):
        square(number, aside="")
    square(3, aside="again")
    assert calls[-1] == (3, "again")


@pytest.mark.parametrize(
    ("preset", "begun", "change"),
    [
        ("paper", [], "check.residual_sway=0.004"),
        ("paper", [], "export.cycle_time=0.002"),
        ("flexible-joint", [], "robustness.method='sensitivity'"),
        ("paper", ["limits.acceleration=0.3"], "planner.sway_share=0.4"),
        ("gantry-crane", ["limits.velocity=9"], "limits.velocity=8"),
    ],
)
def test_a_knob_that_does_not_change_the_problem_costs_no_solve(monkeypatch, preset, begun, change):
    plan(preset_spec(preset, begun))
    monkeypatch.setattr(indirect, "_refined", lambda *_: pytest.fail("solved again"))
    plan(preset_spec(preset, [*begun, change]))


def test_answers_are_the_same_to_the_last_bit_whatever_was_asked_before():
    asked = [
        ["cost.sway_scale=auto"],
        ["cost.sway_scale=auto", "cost.sway_weight=40"],
        ["limits.acceleration=0.35", "cost.sway_scale=auto"],
        ["limits.acceleration=0.4", "cost.sway_scale=auto"],
        ["plant.L1=0.5"],
    ]

    def given(settings):
        return plan(preset_spec("paper", settings)).command.payload_hash()

    alone = []
    for settings in asked:
        forget()
        alone.append(given(settings))
    forget()
    assert [given(settings) for settings in asked] == alone
    assert [given(settings) for settings in reversed(asked)] == alone[::-1]


def test_what_is_remembered_cannot_be_changed_by_whom_it_was_given_to():
    optimum = plan(preset_spec("paper")).solution.optimum
    for name in ("knots", "states", "costates", "hamiltonian", "top_derivative", "sway"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(optimum, name)[:] = 0.0
