"""Numbers and names as people read them."""

import pytest

from gen_profile.dynamics.evaluation.phrases import bound, machine, mm, number


@pytest.mark.parametrize(
    "value, text",
    [
        (0.0, "0"),
        (-0.0, "0"),
        (1e-9, "0"),
        (-1e-9, "0"),
        (0.00004, "0.00004"),
        (-0.00004, "−0.00004"),
        (0.00012345, "0.00012"),
        (1.23456, "1.235"),
        (-12.5, "−12.5"),
        (12345.0, "12345"),
        (259564.70775, "259565"),
    ],
)
def test_numbers_have_four_digits_and_none_below_a_hundred_thousandth(value, text):
    assert number(value) == text


def test_lengths_are_in_millimetres_and_errors_in_micrometres():
    assert (mm(2.1934e-3), bound(4.2e-8)) == ("2.193 mm", "0.042 µm")


@pytest.mark.parametrize(
    "name, text",
    [
        ("nominal", "nominal"),
        ("L1 -20 %, m2 +10 %", "L1 −20\xa0%, m2 +10\xa0%"),
        ("mass-spring -2.5 %", "mass-spring −2.5\xa0%"),
    ],
)
def test_a_machine_s_name_keeps_sign_number_and_unit_together(name, text):
    assert machine(name) == text
