"""The block of linear programmes, translated to C, beside SciPy's HiGHS and beside the tests' interpreter."""

import os

import attrs
import numpy as np
import pytest
from counted_block import CountedBlock, compile_counting
from solved_programmes import FOUND, NONE, ROWS, UNFINISHED, Programmes, crane_problem, text
from st_interpreter import block_of

from gen_profile.planner.execution import BlockInstance
from gen_profile_exporters.planner.blocks.texts import linear_programme

COUNT = int(os.environ.get("LINEAR_PROGRAMMES", "1000"))
MET = 1e-6  # of full speed: bounds and sums of what is found
LEAST = 2e-3  # full speeds: beyond the least cost
MOST = 30  # iterations


@pytest.fixture(scope="module")
def programmes():
    return Programmes()


def problem_of(*seed, **changes):
    return attrs.evolve(crane_problem(np.random.default_rng(seed)), **changes)


def differences(programmes, seed, numbers):
    """What the block says of random programmes otherwise than HiGHS, and how often it found some."""
    words, found, not_least = [], 0, 0
    for number in numbers:
        problem = problem_of(seed, number)
        result, speeds, iterations = programmes.solve(problem, iterations=MOST)
        due = problem.by_highs(problem.costs)
        found += result == FOUND
        if result != (NONE if due is None else FOUND):
            words.append(f"{number}: {result} after {iterations}, HiGHS {due is not None}")
        elif due is not None and problem.shortfall(speeds) > MET:
            words.append(f"{number}: missed by {problem.shortfall(speeds)}")
        elif due is not None and problem.costs is not None and problem.costs @ (speeds - due) > LEAST:
            if iterations < MOST:
                words.append(f"{number}: costs {problem.costs @ speeds}, HiGHS {problem.costs @ due}")
            not_least += 1  # all iterations were used up, and what was found by then is given
    if not_least > len(numbers) / 300:
        words.append(f"{not_least} do not reach the least costs")
    return words, found


def test_random_programmes_are_found_or_refused_as_by_highs(programmes):
    words, found = differences(programmes, 1, range(60))
    assert not words
    assert 20 < found < 40


@pytest.mark.slow
def test_many_random_programmes_are_found_or_refused_as_by_highs(programmes):
    words, found = differences(programmes, 2, range(COUNT))
    assert not words
    assert 0.35 < found / COUNT < 0.65


def one_with(result, programmes, **changes):
    for number in range(100):
        problem = problem_of(3, number, **changes)
        if programmes.solve(problem)[0] == result and programmes.solve(problem)[2] > 4:
            return problem
    raise AssertionError("no such programme")


def test_polygons_that_are_next_to_nothing_are_met_or_not_found_and_nothing_divides_by_zero(programmes):
    """One side of a polygon then weighs 1e16 times what the others do."""
    for number in (113, 138, 165, 667, 973, 1398, 1732, 2455, 2571, 2612):
        problem = problem_of(77, number)
        for share in (1e-4, 1e-6):
            tight = attrs.evolve(problem, radii=share * problem.radii)
            result, speeds, _ = programmes.solve(tight, iterations=21)
            assert result != FOUND or tight.shortfall(speeds) <= MET


@pytest.mark.parametrize("result", [FOUND, NONE])
def test_it_does_the_same_however_few_operations_a_call_has(programmes, result):
    problem = one_with(result, programmes)
    due, speeds, iterations = programmes.solve(problem, operations=60_000)
    again, slowly, as_many = programmes.solve(problem, operations=700)
    assert (again, as_many) == (due, iterations) and np.array_equal(slowly, speeds)
    assert programmes.calls > 60
    assert max(programmes.spent) <= 700


def test_it_never_spends_more_than_it_counts():
    for number in range(6):
        problem = problem_of(4, number)
        block = CountedBlock(compile_counting(text()))
        row = Programmes().row(problem, operations=5000, iterations=30)
        block.inputs = dict(zip(block.inputs, row, strict=False))
        for _ in range(2000):
            issued = block.step()
            assert issued["operations"] <= issued["nSpent"] <= 5000
            block.inputs["bStart"] = 0.0
            if issued["nResult"]:
                break
        assert issued["nResult"]


def test_one_that_is_not_finished_is_neither_found_nor_refused(programmes):
    for wanted in (FOUND, NONE):
        problem = one_with(wanted, programmes)
        assert programmes.solve(problem, iterations=3)[0] == UNFINISHED


def test_bounds_that_exclude_each_other_are_refused_at_once(programmes):
    problem = one_with(FOUND, programmes)
    slow, fast = problem.speeds
    for changes in (
        {"speeds": (slow, np.where(np.arange(problem.slots) == 3, -2.0, fast))},
        {"places": (np.full(problem.slots, 1.0), np.full(problem.slots, 0.5))},
        {"most": (0.0, problem.most[1])},
        {"most": (problem.most[0], -1.0)},
    ):
        refused = attrs.evolve(problem, **changes)
        assert programmes.solve(refused)[::2] == (NONE, 0)


def test_rows_that_say_the_same_count_once_and_those_that_say_otherwise_exclude_each_other(programmes):
    problem = next(p for p in (problem_of(5, k) for k in range(99)) if p.equal < 5 and len(p.rows) < ROWS
                   and programmes.solve(p)[0] == FOUND)  # fmt: skip
    again = attrs.evolve(
        problem,
        rows=np.vstack([problem.rows[:1], problem.rows]),
        values=np.r_[problem.values[:1], problem.values],
    )
    assert programmes.solve(again)[0] == FOUND
    other = attrs.evolve(again, values=np.r_[problem.values[0] + 0.01, problem.values])
    assert other.by_highs() is None
    assert programmes.solve(other)[0] != FOUND


@pytest.mark.slow
def test_c_and_the_interpreter_find_the_same_bits(programmes):
    oracle = block_of(text())
    for number in range(4):
        problem = problem_of(6, number)
        row = programmes.row(problem, operations=60_000, iterations=12)
        due = programmes.solve(problem, iterations=12)
        given = {}
        for name, value in zip(programmes.names, row, strict=True):
            base, _, indexed = name.partition("[")
            kind = {"b": bool, "n": int}.get(name[0], float)
            if indexed:
                given.setdefault(base, []).append(float(value))
            else:
                given[base] = kind(value)
        found = oracle.call(**given)
        while not found["nresult"]:
            found = oracle.call(**given | {"bStart": False})
        places = np.array(found["aplace"][: problem.slots])
        assert (found["nresult"], found["niterations"]) == due[::2]
        assert np.array_equal(np.diff(places, prepend=0.0), due[1])


PART = "solver(nPart := {part}, nAt := i, nSlots := nSlots, nRows := nRows, bFactored := bAgain, {arrays});"
MATRICES = {"aBand": 200, "aRow": 13 * 48, "aWeight": 13, "aAcross": 13, "aRight": 50, "aPull": 13}


def equations_text():
    """The block of equations within one that does all parts in one call; with bAgain for another g."""
    inputs = "".join(f"g{name} : ARRAY [0..{size - 1}] OF LREAL; " for name, size in MATRICES.items())
    own = "".join(f"{name} : ARRAY [0..{size - 1}] OF LREAL; " for name, size in MATRICES.items())
    arrays = ", ".join(f"{name} := {name}" for name in (*MATRICES, "aDx", "aRowNew"))

    def over(count, part):
        return f"FOR i := 0 TO {count} - 1 DO {PART.format(part=part, arrays=arrays)} END_FOR;"

    copies = "".join(
        f"FOR i := 0 TO {size - 1} DO {name}[i] := g{name}[i]; END_FOR;\n"
        for name, size in MATRICES.items()
        if name != "aBand"
    )
    return f"""{linear_programme("Programme", slots=48, rows=13)}
FUNCTION_BLOCK Called
VAR_INPUT nSlots : DINT; nRows : DINT; bAgain : BOOL; {inputs} END_VAR
VAR_OUTPUT aDx : ARRAY [0..49] OF LREAL; aRowNew : ARRAY [0..12] OF LREAL; END_VAR
VAR solver : Programme_equations; i : DINT; {own} END_VAR
{copies}
IF bAgain THEN {over("nSlots", 10)} ELSE
FOR i := 0 TO 199 DO aBand[i] := gaBand[i]; END_FOR;
{over("nSlots", 4)} END_IF;
{over("nRows", 6)} {over("nSlots", 7)}
END_FUNCTION_BLOCK
"""


def test_equations_of_a_step_are_solved_as_by_numpy():
    """Rows of equal sums weigh nothing, those of a pair weigh each other; then for another right side."""
    block = BlockInstance(equations_text())
    for number in range(20):
        draw = np.random.default_rng([7, number])
        slots, equal, pairs = int(draw.integers(16, 49)), int(draw.integers(1, 6)), int(draw.integers(0, 5))
        rows = equal + 2 * pairs
        half = sum(np.diag(draw.uniform(-1, 1, slots - k) + (k == 0) * 3, -k) for k in range(4))
        banded, border, weighs = half @ half.T, draw.normal(size=(rows, slots)), np.zeros((rows, rows))
        for at in range(equal, rows, 2):
            factor = draw.normal(size=(2, 2))
            weighs[at : at + 2, at : at + 2] = factor @ factor.T
        given = {name: np.zeros(size) for name, size in MATRICES.items()}
        for k in range(4):
            given["aBand"][4 * k + k : 4 * slots : 4] = np.diag(banded, -k)
        given["aRow"].reshape(13, 48)[:rows, :slots] = border
        given["aWeight"][:rows] = np.diag(weighs)
        given["aAcross"][1:rows] = np.diag(weighs, -1)
        for again in (0, 1):
            given["aRight"][:slots] = right = draw.normal(size=slots)
            given["aPull"][:rows] = pull = draw.normal(size=rows)
            issued = block.call(np.concatenate([[slots, rows, again], *given.values()])[None])[0]
            due = np.linalg.solve(np.block([[banded, border.T], [border, -weighs]]), np.r_[right, pull])
            assert np.allclose(np.r_[issued[:slots], issued[50 : 50 + rows]], due, rtol=1e-6, atol=1e-8)
