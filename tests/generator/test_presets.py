"""Presets as files to begin one's own spec with: nothing lost, units told, and the limits that they offer."""

import re
import tomllib

import attrs
import pytest
from command_line import run_here

from gen_profile.methods.solvers.plan import plan
from gen_profile.spec.reading import parse_spec, preset_spec, preset_text, presets, read_spec


@pytest.mark.parametrize("name", presets())
def test_a_preset_that_is_written_reads_back_as_the_same_spec(tmp_path, name):
    path = tmp_path / "bay.toml"
    assert run_here("presets", name, "--out", path).code == 0
    spec = read_spec(path)
    assert spec == preset_spec(name)
    assert spec.sha256() == preset_spec(name).sha256()
    assert spec.plant.defaults == ()
    printed = run_here("presets", name)
    assert (printed.code, printed.out) == (0, path.read_text("utf-8"))
    assert run_here("presets", name, "--json").document == {"preset": name, "toml": printed.out}


@pytest.mark.parametrize("name", presets())
def test_every_quantity_has_its_unit_beside_it(name):
    text, spec = preset_text(name), preset_spec(name)
    plant = spec.machine()
    beside = dict(re.findall(r"^#? ?([\w.]+) = .*?  ?# (.*)$", text, flags=re.MULTILINE))
    for parameter in plant.parameters:
        assert beside[parameter.name].startswith(f"{parameter.unit}, ")
    for key in {"distance", "start", "target"} & beside.keys():
        assert set(re.findall(r"\w+", beside[key].partition(":")[0])) == {
            axis.unit for axis in plant.actuated
        }
    for axis in plant.actuated:
        own = "" if len(plant.actuated) == 1 else f"axis.{axis.name}."
        for order, limit in enumerate(("velocity", "acceleration", "jerk"), start=1):
            assert beside[f"{own}{limit}"] == f"{axis.unit}/s{' ²³'[order - 1].strip()}"
    stated = tomllib.loads(text)
    numbers = [key for table in ("move", "cost", "check", "export") for key in stated.get(table, ())]
    assert set(numbers) <= beside.keys()


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(presets()) - {"bay-crane"}))
def test_the_limits_that_a_preset_offers_leave_it_its_motion(name):
    before, heading, after = preset_text(name).partition("# [limits]")
    block, check, rest = after.partition("[check]")
    offered = before + heading[2:] + re.sub("^# ", "", block, flags=re.MULTILINE) + check + rest
    limited = parse_spec(offered)
    assert attrs.evolve(limited, limits=preset_spec(name).limits) == preset_spec(name)
    assert len(limited.limits.stated()) == 1 + 3 * len(limited.machine().actuated)
    assert plan(limited).solution.method == "indirect"  # which knows no limits, so none binds


def test_nothing_is_overwritten(tmp_path):
    path = tmp_path / "bay.toml"
    path.write_text("mine", "utf-8")
    outcome = run_here("presets", "paper", "--out", path)
    assert (outcome.code, path.read_text("utf-8")) == (2, "mine")
    assert outcome.errors == [f"Error: Cannot write {path}: it exists already; choose another name."]


def test_a_file_needs_a_preset(tmp_path):
    outcome = run_here("presets", "--out", tmp_path / "bay.toml")
    assert outcome.code == 2
    assert outcome.errors == ["Error: --out: name the preset to write, as gen-profile presets paper does."]


def test_a_mistyped_preset_is_told_its_neighbour():
    outcome = run_here("presets", "papre")
    assert outcome.code == 2
    assert "did you mean 'paper'?" in outcome.errors[0]
