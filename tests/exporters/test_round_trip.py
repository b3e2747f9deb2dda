"""What every format owes: replaying what it wrote gives the sampled motion back."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motions import quintic, target

from gen_profile.motion.profile import SampledProfile, sample
from gen_profile.support.errors import ExportError
from gen_profile_exporters.registry import BUILT_IN, find_exporter

AXES = {1: ("cart",), 2: ("bridge", "trolley")}
MOVES = {1: quintic((0.1, 0.4)), 2: quintic((0.1, 0.4), (1.2, -0.7))}
UNITS = ["m", "mm", "um", "deg", "counts"]
ANY_TWO = [  # choices go together
    (axes, unit, (-1) ** (axes + number)) for number, unit in enumerate(UNITS) for axes in AXES
]

bounded = settings(max_examples=30, deadline=None, derandomize=True)
fewer = settings(bounded, max_examples=12)


class Contract(NamedTuple):
    """How exactly positions come back."""

    format: str
    exact: bool = False  # bit for bit, from axes in m
    error: float = 0.0  # m, beside rounding
    counts: bool = False  # in every unit, not only in counts
    single: bool = False  # precision
    stem: str = "bay 3.b"  # of the file of a motion of that name
    export: Mapping[str, str] = MappingProxyType({})

    def goal(self, *names, **options):
        return target(*names, export=self.export, **options)

    def cycle_time(self, goal):
        return goal.can.sync_period if self.format == "can" else goal.cycle_time

    def half_count(self, unit):
        whole = self.counts or (unit == "counts" and self.error == 0.0)
        return 0.5e-6 if whole else 0.0


CONTRACTS = {
    "csv": Contract("csv", exact=True),
    "plc": Contract("plc", error=1e-9),
    "plc samples": Contract("plc", exact=True, export={"plc_layout": "samples"}),
    "plc counts": Contract("plc", counts=True, export={"plc_layout": "counts"}),
    "can": Contract("can", counts=True),
    "plcopen-xml": Contract("plcopen-xml", exact=True, export={"plc_layout": "samples"}),
    "codesys": Contract("codesys", error=1e-9),
    "twincat": Contract("twincat", error=1e-9, stem="FB_bay_3_b"),
    "siemens-scl": Contract("siemens-scl", counts=True, export={"plc_layout": "counts"}),
    "rockwell-l5x": Contract("rockwell-l5x", error=1e-5, single=True),
}
pytestmark = pytest.mark.parametrize("contract", CONTRACTS.values(), ids=CONTRACTS.keys())


def test_every_format_is_here(contract):
    assert {other.format for other in CONTRACTS.values()} == BUILT_IN.keys()


def round_trip(contract, profile, goal):
    exporter = find_exporter(contract.format)
    return exporter.replay(exporter.encode(profile, goal)[0].content, goal)


def mutated(content, draw):
    """Delete, double, alter or insert: bytes, or whole lines."""
    kind = draw(
        st.sampled_from(["cut", "delete", "double", "alter", "digit", "insert", "drop line", "double line"])
    )
    at = draw(st.integers(0, len(content)))
    if kind == "cut":
        return content[:at]
    if kind == "delete":
        return content[:at] + content[at + draw(st.integers(1, 20)) :]
    if kind == "double":
        end = at + draw(st.integers(1, 20))
        return content[:end] + content[at:]
    if kind == "alter":
        return content[:at] + draw(st.binary(min_size=1, max_size=1)) + content[at + 1 :]
    if kind == "digit":
        return (
            content[:at]
            + draw(st.sampled_from([b"0", b"9", b".", b"-", b"E", b"e99", b",", b"n"]))
            + content[at + 1 :]
        )
    if kind == "insert":
        return content[:at] + draw(st.binary(min_size=1, max_size=4)) + content[at:]
    lines = content.splitlines(keepends=True)
    row = draw(st.integers(0, max(0, len(lines) - 1)))
    return b"".join(
        lines[:row] + (2 * lines[row : row + 1] if kind == "double line" else []) + lines[row + 1 :]
    )


@pytest.mark.slow
@pytest.mark.parametrize(("axes", "unit", "sign"), ANY_TWO)
def test_positions_come_back(contract, axes, unit, sign):
    goal = contract.goal(*AXES[axes], unit=unit, sign=sign)
    found = round_trip(contract, MOVES[axes], goal)
    expected = sample(MOVES[axes], contract.cycle_time(goal))
    assert found.cycle_time == contract.cycle_time(goal)
    assert found.position.shape == expected.position.shape
    if contract.exact and unit == "m":
        np.testing.assert_array_equal(found.position, expected.position)
        assert found.payload_hash() == expected.payload_hash()
    else:
        error = np.abs(found.position - expected.position).max()
        assert error <= contract.half_count(unit) + contract.error + 1e-15
    if contract.single:
        assert (found.resolution > 0.0).all()
    else:
        np.testing.assert_array_equal(found.resolution, 2 * contract.half_count(unit) * np.ones(axes))


def test_derivatives_come_back_where_carried(contract):
    goal = contract.goal(unit="um", sign=-1)
    found = round_trip(contract, MOVES[1], goal)
    expected = sample(MOVES[1], contract.cycle_time(goal))
    for quantity in ("velocity", "acceleration", "jerk"):
        values = getattr(found, quantity)
        if values is not None:
            tolerance = 2e-6 if contract.error or contract.counts else 1e-15  # m/s², segments and counts
            np.testing.assert_allclose(values, getattr(expected, quantity), rtol=1e-14, atol=tolerance)


def test_bytes_are_the_same_every_time(contract):
    exporter = find_exporter(contract.format)
    goal = contract.goal(*AXES[2])
    assert exporter.encode(MOVES[2], goal) == exporter.encode(MOVES[2], goal)


def test_file_name_has_the_formats_suffix(contract):
    file, *_ = find_exporter(contract.format).encode(MOVES[1], contract.goal(name="bay 3.b"))
    assert file.filename == f"{contract.stem}{BUILT_IN[contract.format].suffix}"


@pytest.mark.slow
@fewer
@given(
    start=st.floats(-30, 30),
    end=st.floats(-30, 30),
    duration=st.floats(0.5, 2.0),
    cycle=st.sampled_from(["0.001", "0.002", "0.004", "0.0125", "0.1"]),
    sign=st.sampled_from([1, -1]),
)
def test_any_move_comes_back(contract, start, end, duration, cycle, sign):
    goal = contract.goal(sign=sign, cycle_time=float(cycle), sync_period=float(cycle))
    profile = quintic((start, end), duration=duration)
    found = round_trip(contract, profile, goal)
    expected = sample(profile, float(cycle))
    assert found.cycle_time == float(cycle)
    error = contract.half_count("m") * (1 + 1e-6) + contract.error + 1e-37
    assert np.abs(found.position - expected.position).max() <= error
    np.testing.assert_array_equal(found.times, expected.times)


@pytest.mark.slow
@bounded
@given(content=st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_any_bytes_are_refused_or_read_never_a_crash(contract, content):
    try:
        found = find_exporter(contract.format).replay(content, contract.goal())
    except ExportError as error:
        assert str(error).endswith(".")
        assert "\n" not in str(error)
    else:
        assert np.isfinite(found.position).all()


@pytest.mark.slow
@fewer
@given(data=st.data())
def test_a_mutated_file_is_refused_or_read_never_a_crash(contract, data):
    exporter = find_exporter(contract.format)
    goal = contract.goal(*AXES[2], cycle_time=0.05, sync_period=0.05)
    content = exporter.encode(MOVES[2], goal)[0].content
    for _ in range(data.draw(st.integers(1, 3))):
        content = mutated(content, data.draw)
    try:
        found = exporter.replay(content, goal)
    except ExportError as error:
        assert str(error).endswith(".")
        assert "\n" not in str(error)
    else:
        assert isinstance(found, SampledProfile)
        assert np.isfinite(found.position).all()
