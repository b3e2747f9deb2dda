"""Units against their definitions, and axes through a spec."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import SpecError
from gen_profile.support.units import AXIS_UNITS, COUNTS, UNITS, axis_factor


@pytest.mark.parametrize(
    ("unit", "written", "si"),
    [("m", 2.5, 2.5), ("mm", 2500.0, 2.5), ("um", 2.5e6, 2.5), ("rad", 0.5, 0.5), ("deg", 90.0, math.pi / 2)],
)
def test_units_by_their_definition(unit, written, si):
    assert si * axis_factor(unit, 1.0) == pytest.approx(written, rel=1e-15)


def test_every_unit_is_tested_above_or_counts():
    assert set(AXIS_UNITS) == {"m", "mm", "um", "rad", "deg", COUNTS}
    assert {si for si, _ in UNITS.values()} == {"m", "rad"}


@given(st.floats(1.0, 1e9))
def test_counts_are_the_drives_own(counts):
    assert axis_factor(COUNTS, counts) == counts


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("mm", 1e3), ("um", 1e6), ("counts", 2e5)])
@pytest.mark.parametrize("sign", [1, -1])
def test_an_axis_of_a_spec_is_scaled_with_its_sign(unit, factor, sign):
    overrides = [f"axis.unit={unit}", f"axis.sign={sign}", "axis.counts_per_metre=2e5"]
    (scale,) = preset_spec("paper", overrides).axis_scales()
    assert (scale.name, scale.unit) == ("cart", unit)
    assert scale.factor == sign * factor
    assert scale.counts_per_si == sign * 2e5


def test_a_feed_constant_may_be_counts_and_metres():
    (axis,) = preset_spec("paper", ["axis.counts_per_metre=[65536, 0.04]", "axis.sign=-1"]).axis_scales()
    assert axis.counts_per_si == -65536 / 0.04
    (axis,) = preset_spec("paper", ["axis.counts_per_metre=[1000000, 3]"]).axis_scales()
    assert axis.counts_per_si == 1000000 / 3


@pytest.mark.parametrize(
    "pair", ["[1]", "[1, 2, 3]", "[0, 1]", "[1, -1]", "[1, nan]", "[true, 1]", "[[1], 1]"]
)
def test_other_feed_constants_are_refused(pair):
    with pytest.raises(SpecError, match=r"^axis.cart.counts_per_metre: must be a number, or two: counts and"):
        preset_spec("paper", [f"axis.counts_per_metre={pair}"])
