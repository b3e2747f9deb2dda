"""Pareto fronts and recommendations, on figures made up for the purpose."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen_profile.studies.comparison.compare import OBJECTIVES, efficient, recommend


def row(duration, acceleration, sway, worst):
    return dict(zip(OBJECTIVES, (duration, acceleration, sway, worst), strict=True))


ROWS = st.lists(st.tuples(*[st.integers(1, 4)] * 4), min_size=1, max_size=8)


@given(ROWS)
def test_the_front_is_what_nothing_dominates(values):
    rows = {str(k): row(*map(float, value)) for k, value in enumerate(values)}
    expected = {
        str(k)
        for k, one in enumerate(values)
        if not any(all(b <= a for a, b in zip(one, other, strict=True)) and other != one for other in values)
    }
    assert efficient(rows) == expected


def test_differences_that_say_nothing_do_not_decide():
    assert efficient({"a": row(1.0, 1.0, 1.0, 1.0), "b": row(1.0, 1.0, 1.0, 1.0005)}) == {"a", "b"}


def advice(rows, optimal=("optimal",)):
    return recommend(rows, limit="3 mm", unit="rad", optimal=optimal)


def test_a_shaper_is_recommended_where_it_wins_and_the_best_optimal_motion_named():
    rows = {"zvd": row(3.0, 0.5, 0.02, 0.001), "optimal": row(3.0, 0.7, 0.01, 0.001)}
    found = advice(rows)
    assert (found["fastest"].method, found["gentlest"].method) == ("zvd", "optimal")
    assert (
        "least acceleration (0.5 rad/s²; the best optimal motion, optimal: 0.7 rad/s²)"
        in found["fastest"].reason
    )
    assert "least on the way (10 mm; the best shaper, zvd: 20 mm)" in found["gentlest"].reason


def test_large_figures_are_told_without_powers_of_ten():
    rows = {"zvd": row(3.0, 0.5, 1.394, 0.001), "optimal": row(3.0, 0.7, 1.2, 0.001)}
    assert "(1200 mm; the best shaper, zvd: 1394 mm)" in advice(rows)["gentlest"].reason


def test_time_decides_where_it_differs():
    rows = {"zvd": row(3.1, 0.5, 0.02, 0.001), "zv": row(3.0, 0.9, 0.03, 0.002)}
    found = advice(rows)["fastest"]
    assert found.method == "zv"
    assert "takes the least time (3 s)." in found.reason


def test_among_equals_the_one_that_leaves_least_is_taken():
    rows = {"a": row(3.0, 0.5, 0.02, 0.002), "b": row(3.0, 0.5001, 0.02, 0.001)}
    assert {kind.method for kind in advice(rows).values()} == {"b"}


@pytest.mark.parametrize("kind", ["fastest", "gentlest"])
def test_nothing_is_recommended_where_nothing_will_do(kind):
    found = advice({})[kind]
    assert found.method is None
    assert found.reason == "No method keeps the residual sway below 3 mm on all machines."
