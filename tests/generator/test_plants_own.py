"""A user's own machine: a Python file that a spec names."""

import json
import pickle
import shutil
from pathlib import Path
from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from command_line import error_of, run_here
from fmu.hoisting_pendulum import PLANT as WINCH

from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.plants.machine_file import plant_of_file, read_machine_file
from gen_profile.plants.plant import Coordinate, Equations, Mechanics
from gen_profile.plants.registry import BUILT_IN, find_plant
from gen_profile.plants.soundness import faults_of
from gen_profile.spec.reading import parse_spec, read_spec, spec_from_dict
from gen_profile.support.errors import SpecError

PENDULUM = '''"""A load on a rope, and nothing else."""

import numpy as np

from gen_profile.plants.plant import Coordinate, Equations, Outputs, Parameter, Plant


def equations(q_u, dq_u, q_a, dq_a, p):
    (phi,), (rate,) = q_u, dq_u
    return Equations(
        M_uu=[[p.L]], M_au=[[-np.cos(phi)]], K_u=[-9.81 * np.sin(phi)], G_u=[-p.damping * rate]
    )


def outputs(q_u, q_a, p):
    (phi,) = q_u
    return Outputs(sway=[p.L * np.sin(phi)], height=[-p.L * np.cos(phi)], angle=[phi])


PLANT = Plant(
    type="plain-pendulum",
    summary="a load on a rope",
    parameters=(
        Parameter(name="L", unit="m", description="rope", nominal=1.0, lower=0.1, upper=50.0),
        Parameter(name="damping", unit="m/s", description="loss", nominal=0.0, lower=0.0, upper=10.0),
    ),
    actuated=(Coordinate(name="cart", unit="m"),),
    unactuated=(Coordinate(name="phi", unit="rad"),),
    loads=("load",),
    equations=equations,
    outputs=outputs,
)
'''
SPEC = """
name = "own"
[plant]
file = "machines/pendulum.py"
L = 2.0
[move]
distance = 1.0
duration = 5.0
[robustness]
uncertain = { L = 0.1 }
[check]
residual_sway = 0.01
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "machines").mkdir()
    (tmp_path / "machines" / "pendulum.py").write_text(PENDULUM, "utf-8")
    (tmp_path / "own.toml").write_text(SPEC, "utf-8")
    return tmp_path


def test_a_spec_finds_the_machine_beside_itself(folder):
    spec = read_spec(folder / "own.toml")
    assert spec.plant.type == "plain-pendulum"
    assert spec.plant.parameters == {"L": 2.0, "damping": 0.0}
    assert spec.machine() is read_spec(folder / "own.toml").machine()
    assert spec.to_dict()["plant"]["file"] == "pendulum.py"  # no folder of this computer


def test_what_a_machine_s_file_prints_is_no_part_of_the_outcome(folder, capsys):
    with (folder / "machines" / "pendulum.py").open("a", encoding="utf-8") as file:
        file.write('print("read")\n')
    read_spec(folder / "own.toml")
    assert capsys.readouterr() == ("", "read\n")


def test_a_spec_carries_its_machine_wherever_it_goes(folder):
    spec = read_spec(folder / "own.toml")
    shutil.rmtree(folder / "machines")
    again = pickle.loads(pickle.dumps(spec.plant.file))
    assert plant_of_file(again) is spec.machine()


@pytest.mark.slow
def test_the_written_machine_is_designed_for_checked_and_found_again(folder, monkeypatch):
    monkeypatch.chdir(folder)
    designed = run_here("own.toml", "--out", "deploy", "--json")
    assert (designed.code, designed.errors) == (0, [])
    assert designed.document["check"]["passed"]
    manifest = json.loads(Path("deploy/manifest.json").read_text("utf-8"))
    assert str(folder) not in json.dumps(manifest)

    shutil.move("deploy", "elsewhere")
    shutil.rmtree("machines")
    judged = run_here("check", "elsewhere/own.csv", "--json")
    assert (judged.code, judged.errors) == (0, [])
    assert judged.document["artefact"]["manifest"] == "matches"

    with Path("elsewhere/pendulum.py").open("a", encoding="utf-8") as file:
        file.write("raise SystemExit('never run')\n")
    err = error_of("check", "elsewhere/own.csv")
    assert "not the file that is meant" in err
    assert "it was not run" in err


def test_a_spec_may_pin_its_machine(folder):
    file = read_machine_file(folder / "machines" / "pendulum.py")
    pinned = SPEC.replace("L = 2.0", f'file_sha256 = "{file.sha256}"')
    assert parse_spec(pinned, folder=folder).plant.file == file
    with pytest.raises(SpecError, match="not the file that is meant"):
        parse_spec(pinned.replace(file.sha256, "0" * 64), folder=folder)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("PLANT = 1 +", "pendulum.py, line 1: SyntaxError"),
        ("import numpy\n1 / 0", "pendulum.py, line 2: ZeroDivisionError: division by zero"),
        ("raise SystemExit(3)", "pendulum.py, line 1: SystemExit: 3"),
        ("PLANT = 3", "must define PLANT, a gen_profile.plants.plant.Plant, found 3"),
        ("", "must define PLANT, a gen_profile.plants.plant.Plant, found nothing"),
        ("\0", "pendulum.py"),
        (
            PENDULUM.replace("M_uu=[[p.L]]", "M_uu=[p.L]"),
            "M_uu must be 1 × 1 finite numbers, found the shape 1",
        ),
        (
            PENDULUM.replace("p.damping", "p.c"),
            "its equations fail with its nominal parameters: AttributeError",
        ),
    ],
)
def test_a_broken_machine_is_one_sentence(folder, text, why):
    (folder / "machines" / "pendulum.py").write_text(text, "utf-8")
    with pytest.raises(SpecError) as caught:
        read_spec(folder / "own.toml")
    (sentence,) = caught.value.faults
    assert sentence.startswith("plant.file: ")
    assert why in sentence


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("file = 3", "plant.file: must name a Python file, found 3."),
        ('file = "machines/none.py"', "plant.file: cannot read"),
        (
            'file = "machines"',
            "plant.file: 'machines' must be a Python file such as my_machine.py, named by ASCII letters, "
            "digits, dots, underscores and hyphens.",
        ),
        ('file = "machines/pendulum.py"\nfile_sha256 = 3', "plant.file_sha256: must be text, found 3."),
        ('file_sha256 = "00"', "plant.file: must name a Python file, found nothing."),
        (
            'file = "machines/pendulum.py"\ntype = "crane"',
            "plant.type: pendulum.py holds a machine of type 'plain-pendulum', found text 'crane'.",
        ),
        ('file = "machines/pendulum.py"\nm = 1.0', "plant.m: unknown key"),
    ],
)
def test_a_machine_file_that_cannot_be_meant(folder, line, why):
    with pytest.raises(SpecError) as caught:
        parse_spec(
            SPEC.replace('file = "machines/pendulum.py"', line).replace("L = 2.0\n", ""), folder=folder
        )
    assert caught.value.faults[0].startswith(why)


@pytest.mark.parametrize("type_", [*BUILT_IN, "mass-spring-chain-5"])
def test_the_projects_own_machines_are_sound(type_):
    assert faults_of(find_plant(type_)) == ()


UNSOUND = {
    "its type 'w/inch'": {"type": "w/inch"},
    "'type' cannot name a parameter": {"parameters": [attrs.evolve(WINCH.parameters[0], name="type")]},
    "'a b' cannot name a load": {"loads": ("a b",)},
    "2 loads are named 'load'": {"loads": ("load", "load")},
    "the nominal value of m": {"parameters": [attrs.evolve(WINCH.parameters[0], lower=3.0)]},
    "the unit of phi": {"unactuated": [Coordinate(name="phi", unit="deg")]},
    "at least one actuated": {"actuated": ()},
    "directions must be from 1": {"directions": 2},
    "its loads must be several: write ('load',)": {"loads": "load"},
}


@pytest.mark.parametrize(("why", "change"), UNSOUND.items(), ids=UNSOUND)
def test_what_makes_a_machine_unsound(why, change):
    assert faults_of(WINCH) == ()
    assert any(why in fault for fault in faults_of(attrs.evolve(WINCH, **change)))


def changed(**terms):
    def equations(*arguments):
        return attrs.evolve(WINCH.equations(*arguments), **terms)

    return attrs.evolve(WINCH, equations=equations)


def test_equations_that_make_no_machine():
    (singular,) = faults_of(changed(M_uu=[[0.0]]))
    assert "M_uu is singular" in singular
    (pushed,) = faults_of(changed(K_u=[1.0]))
    assert "does not rest at q_u = 0" in pushed
    (infinite,) = faults_of(changed(G_u=[np.inf]))
    assert "G_u must be 1 finite numbers" in infinite

    def leaning(q_u, q_a, p):
        return attrs.evolve(WINCH.outputs(q_u, q_a, p), sway=[0.5])

    (crooked,) = faults_of(attrs.evolve(WINCH, outputs=leaning))
    assert "its sway at rest is not zero" in crooked


def place(q_u, q_a, p):
    (phi,), (trolley, length) = q_u, q_a
    return [(trolley - length * np.sin(phi), 0.0, -length * np.cos(phi))]


def with_bodies(plant, **changes):
    def mechanics(q_u, q_a, p):
        terms = {"mass": [p.m], "place": place(q_u, q_a, p), "gravity": p.g} | changes
        return Mechanics(**{name: term(q_u, p) if callable(term) else term for name, term in terms.items()})

    return attrs.evolve(plant, bodies=("load",), mechanics=mechanics)


def test_equations_must_agree_with_the_bodies_they_are_of():
    assert faults_of(with_bodies(WINCH)) == ()
    gravity_twice = with_bodies(WINCH, springs=lambda q_u, p: -p.m * p.g * np.cos(q_u[0]))
    for wrong in (
        gravity_twice,
        with_bodies(WINCH, place=[(0.0, 0.0, 0.0)]),
        with_bodies(changed(M_au=[[1.0], [0.0]])),
        with_bodies(changed(M_uu=[[1.01]])),
        with_bodies(attrs.evolve(WINCH, equations=without_the_hoists_push)),
    ):
        (fault,) = faults_of(wrong)
        assert fault.startswith("its equations contradict its mechanics")


def without_the_hoists_push(q_u, dq_u, q_a, dq_a, p):
    return WINCH.equations(q_u, dq_u, q_a, [0.0, 0.0], p)


def test_equations_must_not_gain_energy():
    def pushed(q_u, dq_u, q_a, dq_a, p):
        return WINCH.equations(q_u, dq_u, q_a, dq_a, SimpleNamespace(**{**vars(p), "c": -p.c}))

    (fault,) = faults_of(with_bodies(attrs.evolve(WINCH, equations=pushed)))
    assert fault == "its equations gain energy from nothing: the sign of a damping term is wrong"


def test_bodies_must_be_whole():
    (fault,) = faults_of(with_bodies(WINCH, place=[(0.0, 0.0)]))
    assert fault == "place must be 1 × 3 finite numbers, found the shape 1 × 2"
    nameless = attrs.evolve(with_bodies(WINCH), bodies=())
    assert len(faults_of(nameless)) == 2
    with pytest.raises(SpecError, match="do not take symbols"):
        dynamics(nameless)
    twins = attrs.evolve(WINCH, bodies=("a", "a"))
    assert any("2 moving parts are named" in fault for fault in faults_of(twins))

    def breaking(q_u, dq_u, q_a, dq_a, p):
        if q_u[0] != 0.0:
            raise ZeroDivisionError("no such angle")
        return WINCH.equations(q_u, dq_u, q_a, dq_a, p)

    (fault,) = faults_of(with_bodies(attrs.evolve(WINCH, equations=breaking)))
    assert fault == "its equations fail where it swings: ZeroDivisionError: no such angle"


def test_equations_that_do_not_take_symbols():
    def branching(q_u, dq_u, q_a, dq_a, p):
        push = 0.0 if q_u[0] < 1.0 else 1.0
        return Equations(M_uu=[[1.0]], M_au=[[1.0], [0.0]], K_u=[-q_u[0]], G_u=[push])

    branchy = attrs.evolve(WINCH, equations=branching)
    assert faults_of(branchy) == ()
    with pytest.raises(SpecError, match=r"winch' do not take symbols .*without branches on values"):
        dynamics(branchy)


@pytest.mark.parametrize("function", ["math.sin(phi)", "float(phi)"])
@pytest.mark.parametrize("line", ["K_u=[-9.81 * np.sin(phi)]", "height=[-p.L * np.cos(phi)]"])
def test_equations_that_lose_their_symbols(tmp_path, function, line):
    """CasADi's symbols pass for floats, NaN, which would go into the design and the FMU without a word."""
    text = "import math\n" + PENDULUM.replace(line, f"{line[:-1]} + {function}]")
    (tmp_path / "machine.py").write_text(text, "utf-8")
    machine = plant_of_file(read_machine_file(tmp_path / "machine.py"))
    with pytest.raises(SpecError, match="lose their symbols; write them with functions of NumPy"):
        dynamics(machine)


def test_an_identified_spec_takes_its_machine_along(folder, tmp_path):
    (tmp_path / "new").mkdir()
    found = run_here(
        "identify", folder / "own.toml", "--measured", "L=2.1±0.01", "--out", tmp_path / "new" / "spec.toml"
    )
    assert (found.code, found.errors) == (0, [])
    spec = read_spec(tmp_path / "new" / "spec.toml")
    assert spec.plant.parameters["L"] == 2.1
    assert spec.machine() is read_spec(folder / "own.toml").machine()


def test_a_machine_of_its_own_survives_the_manifest(folder):
    spec = read_spec(folder / "own.toml")
    assert spec_from_dict(spec.to_dict(), folder / "machines") == spec
