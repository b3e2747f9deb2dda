"""What may stand under a crane, as a spec states it, and how near a load comes to it."""

import tomllib

import numpy as np
import pytest
from generator.quay import STACKS, quay
from scipy.interpolate import CubicSpline

import gen_profile as gp
from gen_profile.dynamics.evaluation.clearance import Nearest, nearest
from gen_profile.methods.solvers.draft import Passage
from gen_profile.methods.solvers.over_stacks.hoist import Rates, highest, least_time, rest_to_rest
from gen_profile.spec.reading import overridden, spec_from_dict
from gen_profile.spec.stacks import PathAxes, path_axes

PROFILE = [[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [10.5, 6.0], [10.5, 2.0], [12.0, 3.0]]
AS_STACKS = ((0.0, 8.0, 0.0), (8.0, 10.5, 6.0), (10.5, 12.0, 3.0))


def stated(tmp_path, **path):
    spec = quay(path={"stacks": None, "profile": None, **path}, move={"start": [20.0, 10.0]})
    return spec_from_dict(spec.to_dict(), tmp_path)


def test_a_spec_reads_back_equal():
    spec = quay()
    assert spec_from_dict(spec.to_dict()) == spec
    assert spec.held() == {}
    assert "path" not in gp.preset_spec("paper").to_dict()


@pytest.mark.parametrize(
    ("text", "stacks"),
    [
        ("from,to,height\n8,10.5,6\n13;15".replace(";", ",") + ",9\n", ((8.0, 10.5, 6.0), (13.0, 15.0, 9.0))),
        ("# by a scanner\nplace;height\n" + "\n".join(f"{x};{z}" for x, z in PROFILE), AS_STACKS),
        ("\ufeff" + "\n".join(f"{x},{z}" for x, z in PROFILE), AS_STACKS),
        ("\n".join(f"{x}\t{z}" for x, z in PROFILE), AS_STACKS),
    ],
    ids=["stacks", "semicolons", "no header", "tabs"],
)
def test_files_of_stacks_and_of_profiles(tmp_path, text, stacks):
    (tmp_path / "bay.csv").write_text(text, "utf-8")
    document = quay(move={"start": [20.0, 10.0]}).to_dict()
    del document["path"]["stacks"]
    document["path"]["file"] = "bay.csv"
    assert spec_from_dict(document, tmp_path).path.stacks == stacks


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "path.file: bay.csv holds no rows of numbers"),
        ("from,to,height\n", "path.file: bay.csv holds no rows of numbers"),
        ("20.0,22.5,1O.4\n8,10.5,6\n", "path.file: bay.csv: line 1 must be two, three or five numbers"),
        ("1,8,10.5,6\n8,10.5,6\n", "path.file: bay.csv: line 1 must be two, three or five numbers"),
        (
            "from,to,height\n\n# lee\n8,10.5\n8,10.5,x\n",
            "path.file: bay.csv: line 5 must be two, three or five",
        ),
        (
            "from,to,height\n8,10.5\n10.5,13,9\n",
            "path.file: bay.csv: line 3 must be two, three or five numbers",
        ),
        (
            "from_mm,to_mm,height_mm\n8000,10500,6000\n",
            "path.file: bay.csv: line 1 names another unit than m",
        ),
        ("Place [cm];Height [cm]\n8;6\n", "path.file: bay.csv: line 1 names another unit than m"),
        ("from,to,height\n8,10.5,nan\n", "path.file: bay.csv: line 2 must be two, three or five numbers"),
        ("height,from,to\n6,8,10.5\n", "path.file: bay.csv: line 1 names a column behind the height"),
        (
            "place,height\n0,0\n20000,10400\n30000,0\n",
            "path.stacks: reach 10400 m, far above path.rail of 36 m",
        ),
        ("from,to,height\n8000,10500,6\n", "path.stacks: are all 7964 m or more from start and target"),
    ],
)
def test_no_row_of_a_file_is_left_out_or_misread(tmp_path, text, sentence):
    (tmp_path / "bay.csv").write_text(text, "utf-8")
    document = quay(move={"start": [20.0, 10.0]}).to_dict()
    del document["path"]["stacks"]
    document["path"]["file"] = "bay.csv"
    with pytest.raises(gp.SpecError) as refusal:
        spec_from_dict(document, tmp_path)
    assert [fault.startswith(sentence) for fault in refusal.value.faults] == [True], refusal.value.faults


def test_a_rail_in_mm_is_told():
    """Nothing would be in the way of loads that hang far above."""
    with pytest.raises(
        gp.SpecError, match=r"path\.rail: is 35981\.8 m above the highest stack; state it in m"
    ):
        quay(path={"rail": 36000.0})


def test_what_takes_longer_than_one_axis_after_the_other_is_not_said_to_take_less():
    near = Nearest(room=0.0, time=0.0, body="load", obstacle=0)
    passage = Passage(lift=1.0, one_by_one=40.0, nearest=near, programs=1)
    assert passage.gained(30.0) == "30 s, 25 % less than one axis after the other (40 s)"
    assert passage.gained(100.0) == "100 s, longer than one axis after the other (40 s)"


def test_a_profile_counts_the_higher_end_of_every_piece():
    assert (
        quay(path={"stacks": None, "profile": PROFILE}, move={"start": [20.0, 10.0]}).path.stacks == AS_STACKS
    )


@pytest.mark.parametrize(
    ("tables", "sentence"),
    [
        ({"path": {"stacks": [[10.0, 8.0, 3.0]]}}, "path.stacks.0: must begin left of where it ends"),
        ({"path": {"stacks": []}}, "path.stacks: must hold at least one stack"),
        ({"path": {"stacks": [[1.0, 2.0]]}}, "path.stacks.0: must be three numbers in m"),
        ({"path": {"stacks": None}}, "path: state one of stacks, profile and file"),
        ({"path": {"stacks": None, "file": "none.csv"}}, "path.file: none.csv cannot be read"),
        ({"path": {"rail": None}}, "path.rail: required, but missing"),
        ({"path": {"load": 3.0}}, "path.load: must be two numbers in m"),
        ({"path": {"hook": [1.0, 1.0]}}, "path.hook: the machine has no hook"),
        ({"path": {"clearance": -0.1}}, "path.clearance: must be at least 0"),
        ({"path": {"clearence": 0.1}}, "path.clearence: unknown key; did you mean 'clearance'?"),
        ({"path": {"profil": []}}, "path.profil: unknown key; did you mean 'profile'?"),
        (
            {"move": {"start": [24.0, 20.0]}},
            "move.start: the payload is too near to the stack from 22.5 to 25",
        ),
        ({"move": {"target": [34.0, 28.0]}}, "move.target: the payload is too near to the stack from 34.75"),
        (
            {"path": {"overhead": [[-2.0, 2.0, 5.0]]}},
            "move.start: the payload is too near to what is overhead from -2 to 2 m, 5 m high, by",
        ),
        ({"path": {"overhead": [[3.0, 2.0, 5.0]]}}, "path.overhead.0: must begin left of where it ends"),
        ({"solver": {"method": "zvd"}}, "solver.method: does not consider stacks"),
        ({"move": {"free": ["hoist"]}}, "move.free: both axes move"),
        (
            {"actuator": {"type": "first-order", "tau": 0.1}},
            "actuator.type: a path over stacks is planned for",
        ),
        ({"limits": {"axis": {"cart": {"jerk": 1.0}}}}, "limits.axis.hoist.velocity: required with [path]"),
        (
            {"plant": {"type": "double-pendulum-crane", "m": None, "L0": None}, "move": {"start": None}},
            "path: needs a machine of a hoist and one or two axes",
        ),
    ],
)
def test_refusals_name_the_place(tables, sentence):
    tables = {table: dict(values) for table, values in tables.items()}
    if "plant" in tables:
        tables |= {"move": {"start": None, "target": None, "distance": 1.0}}
        tables |= {"limits": None, "robustness": {"uncertain": None}}
        tables["move"]["duration"] = 9.0
    with pytest.raises(gp.SpecError) as refusal:
        quay(**tables)
    assert any(fault.startswith(sentence) for fault in refusal.value.faults), refusal.value.faults


def test_one_way_to_state_stacks_replaces_another():
    changed = quay(path={"profile": PROFILE}, move={"start": [20.0, 10.0]})
    assert changed.path.stacks == AS_STACKS
    assert gp.evolve_spec(changed, path={"stacks": STACKS}).path.stacks == quay().path.stacks


FILED = '[path]\nrail = 36.0\nload = [2.5, 2.6]\nfile = "bay.csv"\n'
LISTED = FILED.replace('file = "bay.csv"', "stacks = [[1, 2, 3], [4, 5, 6]]")


@pytest.mark.parametrize("text", [FILED, LISTED])
@pytest.mark.parametrize(
    ("change", "stacks"),
    [
        ("path.stacks.1.2=7.5", ((1.0, 2.0, 3.0), (4.0, 5.0, 7.5))),
        ("path.stacks.0=[0.0, 2, 4]", ((0.0, 2.0, 4.0), (4.0, 5.0, 6.0))),
    ],
)
def test_one_number_of_one_stack_can_be_changed(tmp_path, text, change, stacks):
    (tmp_path / "bay.csv").write_text("from,to,height\n1,2,3\n4,5,6\n", "utf-8")
    document = {**quay(move={"start": [0.0, 10.0]}).to_dict(), **tomllib.loads(text)}
    assert spec_from_dict(overridden(document, [change]), tmp_path).path.stacks == stacks


@pytest.mark.parametrize(
    ("text", "change", "sentence"),
    [
        (LISTED, "path.stacks.2.0=1", "'2' is none of the numbers 0 to 1"),
        (LISTED, "path.stacks.1.3=1", "'3' is none of the numbers 0 to 2"),
        (LISTED, "path.stacks.1.height=1", "'height' is none of the numbers 0 to 2"),
        (FILED, "path.stacks.2.0=1", "path.stacks.2: there are 2 stacks, numbered from 0"),
        (FILED, "path.stacks.1.3=1", "path.stacks.1: holds 3 numbers: 0 is from"),
        (FILED, "path.stacks.1=high", r"path.stacks.1: must be three numbers in m"),
    ],
)
def test_a_number_of_no_stack_is_refused(tmp_path, text, change, sentence):
    (tmp_path / "bay.csv").write_text("from,to,height\n1,2,3\n4,5,6\n", "utf-8")
    document = {**quay(move={"start": [0.0, 10.0]}).to_dict(), **tomllib.loads(text)}
    with pytest.raises(gp.SpecError, match=sentence):
        spec_from_dict(overridden(document, [change]), tmp_path)


def test_which_axis_is_the_hoist():
    spec = quay()
    assert path_axes(spec.machine(), spec.plant.parameters) == PathAxes(along=(0,), hoist=1)
    for name in ("gantry-crane", "tower-crane", "slosh-tank"):
        other = gp.preset_spec(name)
        assert path_axes(other.machine(), other.plant.parameters) is None


def test_planners_and_comparisons_refuse_stacks(tmp_path):
    for refused in (gp.compare, lambda spec: gp.deploy_planner(spec, "plc", tmp_path)):
        with pytest.raises(gp.SpecError, match=r"path: .* does not consider stacks"):
            refused(quay())


def test_the_nearest_instant_is_that_of_finely_divided_straight_ways():
    spec, random = quay(), np.random.default_rng(5)
    fine, places = np.linspace(0.0, 1.0, 40001), np.linspace(0.0, 1.0, 201)
    near = 0
    for _ in range(20):
        knots, x, z = np.linspace(0.0, 1.0, 8), random.uniform(15.0, 40.0, 8), random.uniform(-18.0, -10.0, 8)
        x, z = (CubicSpline(knots, values)(places) for values in (x, z))
        bodies = np.stack([x, np.zeros(201), z], axis=1)[:, None]
        found = nearest(spec, places, bodies)
        close, high = np.interp(fine, places, x), np.interp(fine, places, z)
        least = np.inf
        for left, right, top in STACKS:
            gap = np.maximum(left - close, close - right) - 1.25 - 0.5
            if left < 36.0 < right:
                gap = np.maximum(gap, 0.5 - np.abs(close - 36.0))
            least = min(least, float(np.maximum(gap, high + 36.0 - 1.3 - top - 1.0).min()))
        assert max(found.room, -1.0) == pytest.approx(max(least, -1.0), abs=2e-3)  # deeper is deep enough
        near += least > -1.0
    assert near >= 5


RATES = Rates(speed=1.5, acceleration=0.75, jerk=1.5)


@pytest.mark.parametrize("duration", [11.0, 14.0, 20.0, 26.0, 40.0])
@pytest.mark.parametrize("rise", [-9.0, 0.0, 7.0])
def test_the_hoist_keeps_its_limits_and_ends(duration, rise):
    up = highest(duration, rise, 16.0, RATES, start=3.0)
    position, velocity, acceleration, jerk = up.at(np.linspace(0.0, duration, 4001)).T
    assert up.duration == pytest.approx(duration, abs=1e-7)
    assert position[[0, -1]] == pytest.approx([3.0, 3.0 + rise], abs=2e-5)
    assert position.max() <= 19.0 + 1e-6
    for values, limit in ((velocity, 1.5), (acceleration, 0.75), (jerk, 1.5)):
        assert np.abs(values).max() <= limit * (1.0 + 1e-9)
    assert abs(velocity[-1]) < 1e-6
    assert abs(acceleration[-1]) < 1e-6


def test_too_little_time_for_the_hoist_alone():
    needed = least_time(12.0, RATES)
    assert needed == sum(time for time, _ in rest_to_rest(12.0, RATES))
    assert highest(0.999 * needed, 12.0, 20.0, RATES) is None
    assert highest(1.001 * needed, 12.0, 20.0, RATES) is not None
