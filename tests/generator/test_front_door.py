"""The names of `import gen_profile`: what they lead to, what they load, and what a script does with them."""

import ast
import inspect
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BPoly, CubicSpline, PPoly, make_interp_spline

import gen_profile as gp
from gen_profile.motion.profile import Profile
from gen_profile.presentation.charts.method_styles import method_styles
from gen_profile.spec.reading import preset_text


def typed_names():
    """What a type checker sees, as (name, module)."""
    stub = Path(inspect.getsourcefile(gp)).with_suffix(".pyi").read_text("utf-8")
    imports = (node for node in ast.parse(stub).body if isinstance(node, ast.ImportFrom))
    named = ((node.module, alias) for node in imports for alias in node.names)
    return {alias.asname: (f"gen_profile.{module}", alias.name) for module, alias in named}


def test_every_name_leads_to_what_a_type_checker_sees():
    names = typed_names()
    assert {*names, "__version__"} == set(dir(gp))
    for name, (module, attribute) in names.items():
        assert getattr(gp, name) is getattr(import_module(module), attribute)


def test_no_name_is_hidden_by_a_module_of_the_package():
    here = Path(inspect.getsourcefile(gp)).parent
    files, folders = here.glob("*.py"), here.glob("*/__init__.py")
    modules = {*(file.stem for file in files), *(file.parent.name for file in folders)}
    assert not modules & set(dir(gp))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="attribute desing"):
        _ = gp.desing


def test_a_spec_from_keyword_values_is_the_one_of_the_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        'name = "mine"\n[plant]\ntype = "single-pendulum-crane"\n[move]\ntarget = [2.0, 1.0]\nduration = 9\n'
    )
    tables = {"plant": {"type": "single-pendulum-crane"}, "move": {"target": np.array([2, 1]), "duration": 9}}
    assert gp.make_spec(name="mine", **tables) == gp.read_spec(str(file))
    longer = gp.read_spec(file, move={"duration": 10.0})
    assert longer == gp.read_spec(file, ["move.duration=10"]) == gp.evolve_spec(longer)
    assert longer.move.duration == 10.0


def test_one_override_needs_no_list():
    assert gp.preset_spec("paper", "move.duration=3.2") == gp.preset_spec("paper", move={"duration": 3.2})


def test_a_limit_of_all_axes_replaces_that_of_one():
    spec = gp.preset_spec("gantry-crane", ["limits.axis.y={velocity=0.3, jerk=2.0}", "limits.velocity=0.5"])
    changed = gp.evolve_spec(spec, limits={"velocity": 0.4})
    assert [changed.limits.of(axis).velocity for axis in (0, 1)] == [0.4, 0.4]
    assert changed.limits.of(1).jerk == 2.0


def test_evolving_keeps_what_is_not_named_and_takes_away_what_is_none():
    spec = gp.preset_spec("paper", limits={"velocity": 0.3, "jerk": 20.0})
    changed = gp.evolve_spec(spec, limits={"jerk": None}, move={"start": (0.1,), "target": (0.4,)})
    assert (changed.limits.velocity, changed.limits.jerk) == (0.3, None)
    assert changed.move.distance == pytest.approx((0.3,))
    assert gp.evolve_spec(changed, move={"distance": 0.2}).move.start == (0.0,)
    assert spec.limits.jerk == 20.0  # the given one is as it was


@pytest.mark.parametrize(
    ("tables", "sentence"),
    [
        ({"move": {"duration": -1}}, r"move\.duration: must be at least 0\.001 .*, found -1"),
        ({"plant": {"L9": 1.0}}, r"plant\.L9: unknown key"),
        ({"moves": {"duration": 1}}, r"moves: unknown key; did you mean 'move'"),
        ({"move": 3}, r"move: must be a table, found 3"),
        ({"plant": {"L1": np.nan}}, r"plant\.L1: must be a number"),
    ],
)
def test_faulty_values_are_told_with_their_place(tables, sentence):
    with pytest.raises(gp.SpecError, match=sentence):
        gp.preset_spec("paper", **tables)


@pytest.mark.parametrize(
    "spline",
    [
        CubicSpline([0.0, 0.5, 2.0], [0.0, 0.1, 0.3], bc_type="clamped"),
        CubicSpline([1.0, 1.5, 3.0], [[0.0, 1.0], [0.1, 0.5], [0.3, 0.2]], bc_type="clamped"),
        PPoly.from_bernstein_basis(BPoly.from_derivatives([0.0, 2.0], [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])),
    ],
)
def test_a_spline_is_a_motion(spline):
    motion = Profile.from_ppoly(spline)
    times = np.linspace(0.0, motion.duration, 101)
    for order in range(4):
        theirs = spline(times + spline.x[0], order).reshape(len(times), -1)
        np.testing.assert_allclose(motion.derivative(times, order)[:-1], theirs[:-1], atol=1e-12)
    np.testing.assert_allclose(motion.target, np.atleast_1d(spline(spline.x[-1])), atol=1e-12)


def test_a_verdict_that_failed_raises():
    spec = gp.preset_spec("paper", check={"residual_sway": 1e-6}, export={"cycle_time": 0.02})
    design = gp.design(spec, ["csv"], "unused", keep_failed=False)
    assert not Path("unused").exists()
    with pytest.raises(gp.CheckFailed, match="sways by"):
        design.check.raise_for_failure()


def test_chosen_machines_follow_setpoints_as_in_the_check(tmp_path):
    spec = gp.preset_spec("paper", export={"cycle_time": 0.01})
    check = gp.design(spec, ["csv"], tmp_path).check
    setpoints = gp.sample(gp.plan(spec).command, cycle_time=0.01)
    machines = [finding.scenario.parameters for finding in check.judged[:3]]
    together = gp.residual_sways(spec, setpoints, {name: [m[name] for m in machines] for name in machines[0]})
    for finding, machine, sway in zip(check.judged, machines, together, strict=False):
        response = gp.cosimulate(spec, setpoints, machine)
        alone = abs(response.sway[response.times >= spec.move.duration]).max(axis=0)
        np.testing.assert_allclose(alone, list(finding.residual.values()), rtol=1e-3, atol=1e-6)
        np.testing.assert_allclose(sway, alone, rtol=1e-3, atol=1e-6)


def straight(axes, method):
    """A motion that stands still for 3 s."""
    return Profile(
        knots=[0.0, 3.0], coefficients=np.zeros((1, 1, axes)), target=np.zeros(axes), method=method
    )


STANDING = gp.SampledProfile(cycle_time=0.01, position=np.zeros((10, 1)))


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (
            lambda spec: gp.evaluate(spec, straight(2, "mine")),
            r"moves 2 axes, .* machine has 1 \(cart\)",
        ),
        (lambda _: gp.plan(3), "A spec, or the path of one, is expected, found 3"),
        (lambda spec: gp.design(spec, "csv", 3), "A path is expected, found 3"),
        (lambda spec: gp.design(spec, None, "unused"), "or a list of names, is expected, found None"),
        (lambda spec: gp.cosimulate(spec, STANDING, 3), "parameters: give values by name, .* found 3"),
        (lambda _: gp.cosimulate(gp.preset_spec("gantry-crane"), STANDING), "for 1 axes, .* machine has 2"),
        (lambda spec: gp.identify(spec, 3), "give is expected, found 3"),
        (
            lambda spec: gp.identify(spec, gp.parse_period("1.7±0.1"), "L1", q_a=2.0),
            "at: .* numbers, found 2",
        ),
        (lambda _: gp.parse_period(1.7), "period: a text is expected, found 1.7"),
        (lambda spec: gp.read_swing("a.csv", spec, columns=(1, 2), unit=1), "unit: .* expected, found 1"),
        (lambda spec: gp.linearize(spec.machine(), [6.0]), r"parameters: give values by name, .*\[6.0\]"),
        (
            lambda spec: gp.linearize(spec.machine(), {**spec.plant.parameters, "L1": "5"}),
            "parameters: L1: must be a number, found text '5'",
        ),
        (lambda _: gp.plot(None, "a.png"), "There is no picture of nothing; give one of Spec, Plan,"),
        (lambda _: gp.parse_spec(b""), "a text is expected, found a bytes"),
        (
            lambda spec: gp.compare(spec, own="mine.csv"),
            r"gp\.plan\(spec\)\.motion, found text 'mine.csv'",
        ),
        (lambda spec: gp.evaluate(spec, STANDING), "A Profile .* found a SampledProfile"),
        (lambda spec: gp.cosimulate(spec, straight(1, "mine")), r"such as gp\.sample.* found a Profile"),
        (lambda spec: gp.robustness(spec, "L1", points=1), "points: must be .* at least 3, found 1"),
        (lambda spec: gp.robustness(spec, "L1", half_range=np.nan), "range: must be .* 0.9 .* found nan"),
        (
            lambda spec: gp.linearize(spec.machine(), spec.plant.parameters, [0.0, 1.0]),
            "one position per axis",
        ),
        (lambda spec: gp.export_fmu(spec, "plant", version="4"), r"version: .* '4' \(known: 2, 3\)"),
        (lambda spec: gp.export_fmu(spec, input_kind="speed"), "input_kind: .*; did you mean 'velocity'"),
        (lambda spec: gp.export_fmu(spec, platforms="linux"), "platforms: .*; did you mean 'linux-x86_64'"),
        (
            lambda _: gp.deploy_planner(gp.preset_spec("bay-crane"), "plc", "unused", histories=0),
            "at least 1",
        ),
        (lambda _: gp.preset_spec("paper", move={"duration": 3j}), "found a complex"),
        (lambda _: gp.preset_spec(None), "A preset's name is expected, found nothing"),
        (lambda spec: gp.compare(spec, own=straight(1, "zvd")), "Two motions are called 'zvd'"),
        (lambda spec: gp.export_fmu(spec, "plnt"), "no FMU of the kind 'plnt'; did you mean 'plant'"),
        (lambda spec: gp.cosimulate(spec, STANDING, {"L3": 1.0}), "machine has no 'L3'"),
        (
            lambda spec: gp.residual_sways(spec, STANDING, {"L1": [0.4, 0.5], "L2": [1, 2, 3]}),
            "as many of all",
        ),
        (
            lambda spec: gp.residual_sways(spec, STANDING, {"L1": [0.4, np.nan]}),
            "L1 must be from 0.01 to 200 m",
        ),
        (lambda spec: gp.cosimulate(spec, STANDING, {"L1": -1.0}), "must be from 0.01 to 200 m, found -1"),
        (lambda spec: gp.cosimulate(spec, STANDING, {"L1": [0.4, 0.5]}), "residual_sways takes many"),
        (lambda spec: gp.linearize(spec.machine(), {"m1": 0.1}), "m2 must be a finite number"),
        (
            lambda spec: gp.linearize(spec.machine(), spec.plant.parameters, [np.nan]),
            r"at: must hold finite numbers, found \[nan\]",
        ),
        (lambda spec: gp.export_fmu(spec, "plant", author=3), "author: a name is expected, found 3"),
        (lambda spec: gp.linearize(spec, {}), r"such as spec\.machine\(\) gives, found a Spec"),
        (
            lambda spec: gp.read_swing("a.csv", spec, columns="time,angle"),
            "columns: name two, .* 'time,angle'",
        ),
        (lambda spec: gp.read_swing("a.csv", spec, columns=(1, 2), time_unit="min"), "unknown unit 'min'"),
        (lambda spec: gp.run_sweep(spec, ["plant.L1=1:2:3"], "plc", "unused"), "vary: give values by key"),
        (
            lambda spec: gp.run_sweep(spec, {"plant.L1": 0.5}, "plc", "unused"),
            "vary plant.L1: give a list of values, found 0.5",
        ),
        (
            lambda spec: gp.run_sweep(spec, {"move.duration": [1e6, "minimum"]}, "plc", "unused"),
            "move.duration: .*found 1000000.0",
        ),
        (
            lambda spec: gp.run_sweep(spec, {"plant.L1": [1, 2]}, "plc", "unused", workers=True),
            "workers: must be a whole number of at least 1, found true",
        ),
        (
            lambda spec: gp.run_sweep(spec, {"plant.L1": [1, 2]}, "plc", "unused", scheduler=3),
            "scheduler: an address is expected, found 3",
        ),
        (lambda spec: gp.design(spec, [], "unused"), "name at least one format"),
        (lambda spec: gp.design(spec, "plcc", "unused"), "unknown format 'plcc'; did you mean 'plc'"),
    ],
)
def test_slips_are_told_in_a_sentence(call, sentence):
    with pytest.raises(gp.SpecError, match=sentence):
        call(gp.preset_spec("paper"))
    assert not Path("unused").exists()


def test_progress_is_reported_to_functions_alone():
    for function in filter(inspect.isfunction, (getattr(gp, name) for name in dir(gp))):
        given = inspect.signature(function).parameters
        if "progress" in given:
            values = {key: "unused" for key, one in given.items() if one.default is one.empty}
            with pytest.raises(gp.SpecError, match="progress: must be a function, found 3"):
                function(**values, progress=3)


@pytest.mark.parametrize("cycle_time", [0.0, -1.0, np.nan, np.inf, 1e-12, "0.01"])
def test_a_cycle_that_cannot_be_is_told_in_a_sentence(cycle_time):
    with pytest.raises(gp.GenProfileError, match="cycle"):
        gp.sample(straight(1, "mine"), cycle_time)


@pytest.mark.parametrize("order", [-1, 1.5])
def test_derivatives_have_orders(order):
    with pytest.raises(gp.GenProfileError, match="order of a derivative is 0, 1, 2"):
        straight(1, "mine").derivative(0.5, order)


def test_samples_without_axes_are_told_in_a_sentence():
    with pytest.raises(gp.GenProfileError, match=r"two samples of one axis, found \(10,\)"):
        gp.SampledProfile(cycle_time=0.01, position=np.zeros(10))


def test_what_is_no_spline_of_pieces_is_told_in_a_sentence():
    with pytest.raises(gp.GenProfileError, match=r"PPoly\.from_spline makes of others, found a BSpline"):
        gp.Profile.from_ppoly(make_interp_spline(np.linspace(0.0, 3.0, 9), np.linspace(0.0, 0.3, 9)))


def test_one_measurement_needs_no_list_and_no_log_is_drawn_of_it(tmp_path):
    found = gp.identify(gp.preset_spec("paper"), gp.parse_period("17.3±0.2/10"), "L1")
    with pytest.raises(gp.OutputError, match="no log was identified from"):
        gp.plot(found, tmp_path / "fit.svg")


def test_curves_of_motions_that_users_bring_differ():
    styles = method_styles(["zvd", "mine", "yours"])
    assert len({style.colour for style in styles.values()}) == 3
    styles = method_styles(["optimal", "mine", "yours", "theirs"])
    assert len({(style.colour, style.dash) for style in styles.values()}) == 4


def test_a_single_time_is_one_sample():
    motion = gp.plan(gp.preset_spec("paper")).motion
    for time in (-1.0, 1.5, 3.0, 9.0):
        one, many = motion(time), motion(np.array([time]))
        assert np.array_equal(one.position, many.position) and one.jerk.shape == (1, 1)


def test_a_spec_may_be_named_by_its_file(tmp_path):
    path = tmp_path / "bay-3.toml"
    path.write_text(preset_text("paper"), "utf-8")
    assert gp.plan(str(path)).spec == gp.plan(path).spec == gp.read_spec(path)
    (by_path,) = gp.robustness(path, "L1", methods="zvd", points=3).residual.values()
    (by_spec,) = gp.robustness(gp.read_spec(path), ["L1"], methods=["zvd"], points=3).residual.values()
    assert np.array_equal(by_path, by_spec)
    with pytest.raises(gp.OutputError, match=r"Cannot read the spec none\.toml"):
        gp.plan("none.toml")
    with pytest.raises(gp.OutputError, match=r"a preset is called so: .* gp\.preset_spec\('paper'\)"):
        gp.plan("paper")


@pytest.mark.slow
def test_a_plan_is_drawn(tmp_path):
    plan = gp.plan(gp.preset_spec("paper"))
    gp.plot(plan, tmp_path / "plan.svg")
    gp.plot(gp.design(plan.spec, "csv", tmp_path / "out", check=False), tmp_path / "design.svg")
    text = (tmp_path / "plan.svg").read_text("utf-8")
    assert "<!-- Velocity of cart -->" in text and "<!-- Sway of the payload -->" in text
    assert (tmp_path / "design.svg").read_text("utf-8") == text
