"""Setpoints that are no designed motion, or not the one that was asked for; no format's own are in doubt."""

import re
from functools import cache
from itertools import cycle

import attrs
import numpy as np
import pytest
from command_line import run_here
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from gen_profile.assurance.verification.plausibility import implausibilities
from gen_profile.methods.solvers.plan import plan
from gen_profile.motion.metrics import greatest
from gen_profile.motion.profile import Profile, SampledProfile, sample
from gen_profile.spec.model import LimitsSpec
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import ExportError
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.registry import find_exporter

MILLIMETRE = 1e-3
FORMS = {
    "csv": {},
    "csv of positions": {"export": {"csv_columns": ("position",)}},
    "csv of counts": {"axis": {"unit": "counts"}},
    "plc": {},
    "plc samples": {"export": {"plc_layout": "samples"}},
    "plc counts": {"export": {"plc_layout": "counts"}},
    "can": {},
    "can of velocities": {"can": {"mode": "csv", "following_error": 0.05}},
    "siemens-scl": {},
    "rockwell-l5x": {},
    "plcopen-xml": {},
}
MOVES = {
    "optimal": ("paper",),
    "two axes": ("gantry-crane",),
    "radians": ("flexible-joint",),
    "slow": ("double-pendulum-crane",),
    "two shots, far apart": ("paper", "solver.method=zv", "move.duration=2.0"),
    "jerk leaps": (
        "paper",
        "solver={method='zvdd', base='jerk-limited'}",
        "move.duration=4.6",
        "limits={velocity=0.26, acceleration=1.5, jerk=21.5}",
    ),
    "up and down": ("paper", "solver.method=umzvd"),
    "leading a lag": ("paper", "actuator={type='first-order', tau=0.2}"),
    "begins with a swing": ("paper", "move.initial={theta1=0.05}"),
    "ends at speed": ("paper", "move.final_velocity=0.1"),
}


@cache
def planned(preset, *overrides):
    spec = preset_spec(preset, overrides)
    return spec, plan(spec).evaluation.command


@pytest.fixture(scope="module")
def paper():
    return planned("paper")


def held_to_its_peaks(spec, command):
    """State limits that the command just keeps."""
    names = ("velocity", "acceleration")
    peaks = [
        {name: greatest(command, order, column) or None for order, name in enumerate(names, start=1)}
        for column in range(command.axes)
    ]
    reached = sample(command, 1e-4).position
    travels = zip(reached.min(axis=0).tolist(), reached.max(axis=0).tolist(), strict=True)
    limits = {
        axis: attrs.evolve(spec.limits.of(0), **peak, travel=travel)
        for axis, peak, travel in zip(spec.axis, peaks, travels, strict=True)
    }
    return attrs.evolve(spec, limits=LimitsSpec(axis=limits))


def for_controller(spec, form, cycle_time, counts):
    """Give a spec what a form of artefact needs."""
    wanted = FORMS[form]
    axis = {
        name: attrs.evolve(one, counts_per_metre=counts, **wanted.get("axis", {}))
        for name, one in spec.axis.items()
    }
    return attrs.evolve(
        spec,
        axis=axis,
        export=attrs.evolve(spec.export, cycle_time=cycle_time, **wanted.get("export", {})),
        can=attrs.evolve(spec.can, sync_period=cycle_time, bitrate=1_000_000, **wanted.get("can", {})),
    )


def played(spec, command, form):
    exporter, target = find_exporter(form.split()[0]), target_of(spec)
    return exporter.replay(exporter.encode(command, target)[0].content, target)


@pytest.mark.slow
@pytest.mark.parametrize("move", MOVES.values(), ids=MOVES)
@settings(max_examples=5)
@given(
    form=st.sampled_from(list(FORMS)),
    cycle_time=st.sampled_from([0.002, 0.004, 0.0075, 0.01, 0.02, 0.05]),
    counts=st.sampled_from([1e3, 1e4, 1e5, 1e6]),
)
def test_no_format_of_ours_is_ever_in_doubt(move, form, cycle_time, counts):
    spec, command = planned(*move)
    spec = for_controller(held_to_its_peaks(spec, command), form, cycle_time, counts)
    try:
        setpoints = played(spec, command, form)
    except ExportError:  # too many points for its cams
        reject()
    assert implausibilities(spec, setpoints) == ()


def quintic(distance, duration):
    rising = [factor * distance / duration**power for power, factor in ((3, 10), (4, -15), (5, 6))]
    return Profile(
        knots=[0.0, duration],
        coefficients=[[[0.0], [0.0], [0.0], *([one] for one in rising)]],
        target=[distance],
        method="quintic",
    )


@pytest.mark.slow
@settings(max_examples=100)
@given(
    distance=st.floats(1e-3, 50.0),
    cycles=st.floats(1.0, 500.0),
    cycle_time=st.floats(5e-4, 0.1),
    resolution=st.sampled_from([0.0, 1e-6, 1e-4]),
)
def test_a_smooth_move_is_in_no_doubt_however_few_its_setpoints_are(distance, cycles, cycle_time, resolution):
    duration = max(cycles * cycle_time, distance / 50.0, 1e-3)  # no faster than any machine
    spec = preset_spec("paper", [f"move.distance={distance!r}", f"move.duration={duration!r}"])
    motion = sample(quintic(distance, duration), cycle_time)
    position = motion.position
    if resolution:
        position = resolution * np.round(position / resolution)
    setpoints = SampledProfile(cycle_time=cycle_time, position=position, resolution=[resolution])
    assert implausibilities(spec, setpoints) == ()
    assert implausibilities(spec, attrs.evolve(setpoints, velocity=motion.velocity)) == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "cycle_time"), [*zip(FORMS, cycle((0.002, 0.004, 0.01, 0.02)), strict=False)]
)
def test_one_setpoint_moved_by_a_millimetre_lies_off_the_others(paper, form, cycle_time):
    spec = for_controller(paper[0], form, cycle_time, 1e6)
    setpoints = played(spec, paper[1], form)
    for row in np.linspace(2, len(setpoints.position) - 3, 9).astype(int).tolist():
        position = setpoints.position.copy()
        position[row] += MILLIMETRE
        (fault,) = implausibilities(spec, bare(setpoints, position))
        assert fault.startswith(f"The setpoint of cart at {setpoints.times[row]:.6g} s lies off the others")


def bare(setpoints, position, cycle_time=None):
    return SampledProfile(
        cycle_time=cycle_time or setpoints.cycle_time, position=position, resolution=setpoints.resolution
    )


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("factor", "overrides"), [(0.98, ()), (1.02, ("move.final_velocity=0.1",))])
def test_a_motion_scaled_in_time_arrives_at_another_time(form, factor, overrides):
    spec, command = planned("paper", *overrides)
    spec = for_controller(spec, form, 0.01, 1e6)
    longer = attrs.evolve(
        command,
        knots=factor * command.knots,
        coefficients=command.coefficients * factor ** -np.arange(command.coefficients.shape[1])[:, None],
    )
    faults = implausibilities(spec, bare(setpoints := played(spec, longer, form), setpoints.position))
    assert f"The motion arrives at {3.0 * factor:.6g} s, and the spec asks for 3 s (move.duration)." in faults
    if not overrides:
        assert len(faults) == 1


def test_setpoints_played_at_another_cycle_arrive_at_another_time(paper):
    setpoints = sample(paper[1], 0.004)
    (fault,) = implausibilities(paper[0], bare(setpoints, setpoints.position, 0.00408))
    assert fault == "The motion arrives at 3.06 s, and the spec asks for 3 s (move.duration)."


def test_no_duration_is_asked_for_where_it_is_the_shortest(paper):
    spec = preset_spec(
        "paper", ["move.duration='minimum'", "limits={velocity=0.5, acceleration=0.8, jerk=40}"]
    )
    setpoints = sample(paper[1], 0.004)
    assert implausibilities(spec, bare(setpoints, setpoints.position, 0.006)) == ()


def test_a_shortest_move_that_ends_at_speed_may_go_on_for_a_cycle():
    spec, command = planned("paper", "move.final_velocity=0.1")
    setpoints = sample(command, 0.007)  # which is no part of 3 s
    shortest = attrs.evolve(spec, move=attrs.evolve(spec.move, shortest=True, duration=1.0))
    assert implausibilities(shortest, setpoints) == ()
    farther = bare(setpoints, 1.01 * setpoints.position)
    (fault,) = implausibilities(shortest, farther)
    assert fault.startswith("Axis cart ends at 0.30")


def test_holding_the_target_longer_is_no_part_of_the_motion(paper):
    setpoints = sample(paper[1], 0.004)
    position = np.concatenate([setpoints.position, np.repeat(setpoints.position[-1:], 100, axis=0)])
    assert implausibilities(paper[0], bare(setpoints, position)) == ()


@pytest.mark.parametrize(
    ("limits", "pattern"),
    [
        ("limits={velocity=0.1}", r"for 0\.1\d+ m/s at 1\.\d+ s, and limits\.velocity allows 0\.1 m/s\."),
        (
            "limits={acceleration=0.1}",
            r"for 0\.\d+ m/s² at [0-2]\.\d+ s, and limits\.acceleration allows 0\.1 m/s²\.",
        ),
        ("limits={axis={cart={velocity=0.1}}}", r"for .* and limits\.axis\.cart\.velocity allows 0\.1 m/s\."),
    ],
)
def test_setpoints_that_ask_for_more_than_the_limits_say_so(paper, limits, pattern):
    (fault,) = implausibilities(preset_spec("paper", [limits]), sample(paper[1], 0.004))
    assert re.fullmatch(f"The setpoints ask cart {pattern}", fault)


def test_columns_that_belong_together_contradict_nothing(paper):
    setpoints = sample(paper[1], 0.01)
    assert implausibilities(paper[0], setpoints) == ()
    assert implausibilities(paper[0], attrs.evolve(setpoints, acceleration=None)) == ()


def test_an_altered_stretch_of_positions_contradicts_the_velocities(paper):
    setpoints = sample(paper[1], 0.01)
    position = setpoints.position.copy()
    position[150:160] += MILLIMETRE
    (fault,) = implausibilities(paper[0], attrs.evolve(setpoints, position=position))
    assert re.match(r"The velocity at 1\.[456]9? s contradicts the positions around it by 0\.0", fault)


def test_an_altered_velocity_contradicts_the_positions(paper):
    setpoints = sample(paper[1], 0.01)
    velocity = setpoints.velocity.copy()
    velocity[150] *= 1.05
    (fault,) = implausibilities(paper[0], attrs.evolve(setpoints, velocity=velocity))
    assert fault.startswith("The velocity at 1.5 s contradicts the positions around it by 0.00")


def test_two_setpoints_cannot_contradict_one_another():
    spec = preset_spec("paper", ["move.duration=1"])
    two = SampledProfile(cycle_time=1.0, position=[[0.0], [0.3]], velocity=[[0.0], [9.0]])
    assert implausibilities(spec, two) == ()


def stretched(text):
    """A CSV table that takes 2 % longer."""
    head, *lines = text.splitlines()
    rows = [line.split(",", 1) for line in lines]
    return "\n".join([head, *(f"{1.02 * float(time):.9g},{rest}" for time, rest in rows), ""])


def bumped(text):
    """A CSV table with a millimetre on one position."""
    lines = text.splitlines()
    time, position = lines[301].split(",")
    lines[301] = f"{time},{float(position) + MILLIMETRE!r}"
    return "\n".join([*lines, ""])


@pytest.mark.parametrize(
    ("alter", "sentence"),
    [
        (stretched, "The motion arrives at 3.06 s, and the spec asks for 3 s (move.duration)."),
        (
            bumped,
            "The setpoint of cart at 1.2 s lies off the others: the velocity changes there by 0.499 m/s",
        ),
    ],
)
def test_a_lone_file_that_was_altered_fails_by_what_it_plays(tmp_path, alter, sentence):
    paper = ("--preset", "paper")
    assert run_here(*paper, "--csv-columns", "position", "--cycle-time", "0.004", "--out", tmp_path).code == 0
    lone = tmp_path / "lone" / "paper.csv"
    lone.parent.mkdir()
    lone.write_text(alter((tmp_path / "paper.csv").read_text("utf-8")), "utf-8")
    outcome = run_here("check", lone, *paper, "--set", 'export.csv_columns=["position"]', "--json")
    assert outcome.code == 4
    assert any(reason.startswith(sentence) for reason in outcome.document["check"]["reasons"])
