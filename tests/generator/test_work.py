"""What a search may cost, and what interrupts compiled code."""

import math
import signal

import numpy as np
import pytest
from generator.crane_problems import crane_problem

from gen_profile.methods.solvers import method_selection as choice
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.direct.conic import ConicProgram, place
from gen_profile.methods.solvers.direct.set_up import DirectOptions
from gen_profile.methods.solvers.solution import Status
from gen_profile.spec.model import LimitsSpec
from gen_profile.support.interrupts import interrupts_collected
from gen_profile.support.work import OutOfWork, Overtaken, afford, budget, clock_left, left, spend


def test_a_budget_within_another_takes_from_both():
    with budget(3.0):
        with budget(2.0):
            spend(1.5)
        with budget(2.0), pytest.raises(OutOfWork):
            spend(1.6)


def test_work_without_a_budget_is_free():
    spend(1e9)


def test_the_clock_of_all_threads_ends_what_takes_longer_than_an_answer_may(monkeypatch):
    now = 0.0
    monkeypatch.setattr("gen_profile.support.work.time.process_time", lambda: now)
    with budget(2.0, clock=3.0), budget(1.5):
        now = 2.9  # a processor that is slower than usual
        spend(1.0)
        assert left() == 0.5
        now = 3.1
        with pytest.raises(OutOfWork):
            spend(0.3)
        with pytest.raises(OutOfWork):
            spend(0.0)


def test_a_part_may_have_its_own_share_of_the_clock(monkeypatch):
    now = 10.0
    monkeypatch.setattr("gen_profile.support.work.time.process_time", lambda: now)

    def slow():
        nonlocal now
        now += 0.6 * 3.0
        spend(1.0)

    assert clock_left() == math.inf
    with budget(9.0, clock=3.0):
        assert afford(slow, 5.0, 0.5 * clock_left()) is None
        assert clock_left() == pytest.approx(1.2)
        spend(0.1)  # what is around it goes on


def test_a_search_that_costs_too_much_is_given_up(monkeypatch):
    monkeypatch.setattr(choice, "SOLVING", 1e-4)
    monkeypatch.setattr(choice, "DIRECTLY", 1e-4)
    solution = choice.attempt(crane_problem())
    assert solution.status is Status.GIVEN_UP
    assert "units" in solution.advice


def test_a_motion_on_the_first_mesh_will_do_where_bisecting_costs_too_much():
    problem, options = crane_problem(limits=LimitsSpec(acceleration=0.3)), DirectOptions(intervals=20)
    fine = direct.solve(problem, options=options).raise_for_status()
    with budget(1e9):
        coarse = direct.solve(problem, coarse=True, options=options).raise_for_status()
        took = 1e9 - left()
    with budget(2.7 * took):
        found = direct.solve(problem, options=options)
    assert len(found.raise_for_status().knots) == len(coarse.knots) < len(fine.knots)
    assert choice.keeps_limits(found)


def test_an_interrupt_comes_when_compiled_code_has_ended():
    came = []
    before = signal.signal(signal.SIGTERM, lambda number, _: came.append(number))
    try:
        with interrupts_collected() as collected:
            signal.raise_signal(signal.SIGTERM)
            assert (collected, came) == ([signal.SIGTERM], [])
        assert came == [signal.SIGTERM]
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_program_ends_at_once_when_interrupted(monkeypatch):
    class Stopped:
        status, iterations, x, z = "CallbackTerminated", 1, np.zeros(1), np.zeros(1)

    class Solver:
        def __init__(self, *_):
            pass

        def set_termination_callback(self, ended):
            self.ended = ended

        def solve(self):
            assert not self.ended(None)
            signal.raise_signal(signal.SIGINT)
            assert self.ended(None)
            return Stopped()

    monkeypatch.setattr("gen_profile.methods.solvers.direct.conic.clarabel.DefaultSolver", Solver)
    program = ConicProgram(np.ones(1))
    one = place(np.ones((1, 1, 1)), np.zeros(1, dtype=int))
    program.equal(one, np.ones(1))
    with pytest.raises(KeyboardInterrupt):
        program.solve(one, np.zeros(1))


def test_what_is_no_longer_asked_for_is_left_and_not_taken_for_a_search_that_ended():
    asked = []
    with pytest.raises(Overtaken), budget(1e6, stop=lambda: bool(asked)):
        for number in range(100):
            try:
                with budget(50.0):
                    spend(0.1)
            except OutOfWork:
                pytest.fail("a search would go on with what it has")
            if number == 40:
                asked.append("something else")
            assert number <= 41
