"""Other people's importers: CasADi's DaeBuilder, Ecos, and a plain C compiler for the sources."""

import html
import io
import re
import subprocess
import zipfile
from pathlib import Path

import casadi
import fmpy
import fmu_manipulation_toolbox
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmu.drivers import Instance, cosimulate
from fmu.kinds import INPUTS, PAIRS, model_of, motion
from numpy.polynomial import Polynomial
from system_parts import program

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import dynamics
from gen_profile.motion.profile import Profile
from gen_profile.plants.registry import find_plant
from gen_profile_fmu.building.build import build_fmu
from gen_profile_fmu.building.plant_fmu import cached_fmu
from gen_profile_fmu.description.fmu_files import Version, archive, fmu_files, sources
from gen_profile_fmu.model.contents import system_model
from gen_profile_fmu.model.nominals import smooth_move, state_nominals
from gen_profile_fmu.model.plant_variables import PlantInstance

CRANE = find_plant("double-pendulum-crane")
HEADERS = Path(fmu_manipulation_toolbox.__file__).parent / "resources" / "fmi"  # the standard's, unaltered
LINKED = Path(__file__).with_name("two_fmus.c")


@pytest.fixture(params=Version)
def version(request):
    return request.param


def _own_jacobian(kind, x, u):
    """Of the states' derivatives by states and inputs, from the equations the profiles are planned with."""
    e = dynamics(CRANE)
    tau = {"plant-velocity": 0.1}.get(kind)
    reference = sym.symbols("u", 1)
    push = {
        "plant-acceleration": reference,
        "plant-setpoint": casadi.SX(0),  # nothing moves the axis before it has taken a setpoint
        "plant-velocity": (reference - e.dq_a) / (tau or 1.0),
        "system": motion(1).derivative(np.array([0.5]), 2)[0, 0],
    }[kind]
    ddq_u = casadi.substitute(e.ddq_u, e.ddq_a, push)
    rates = casadi.vertcat(e.dq_u, ddq_u, e.dq_a, push)
    known = casadi.vertcat(e.q_u, e.dq_u, e.q_a, e.dq_a, *([reference] if len(u) else []))
    function = casadi.Function("J", [known, e.p], [casadi.jacobian(rates, known)])
    return np.array(function(np.concatenate([x, u]), list(CRANE.nominal().values())))


if tuple(map(int, casadi.__version__.split(".")[:2])) >= (3, 8):  # older ones read neither FMI 3 nor states

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", [*INPUTS, "system"])
    def test_casadi_imports_model_exchange_with_our_jacobian(kind, version):
        fmu = cached_fmu(model_of(kind, CRANE), version)
        builder = casadi.DaeBuilder("crane", str(fmu.folder))
        states = ["theta1", "theta2", "theta1.rate", "theta2.rate", "cart.position", "cart.velocity"]
        assert builder.x() == states
        inputs = builder.u()
        right_side = builder.create("f", ["t", "x", "u", "p"], ["ode"])
        x, u = np.array([0.3, -0.2, 0.5, 0.4, 0.1, -0.3]), np.full(len(inputs), 0.7)
        p = builder.get(builder.p())
        x_symbol, u_symbol = casadi.MX.sym("x", 6), casadi.MX.sym("u", len(inputs))
        ode = right_side(t=0.5, x=x_symbol, u=u_symbol, p=p)["ode"]
        jacobian = casadi.Function(
            "J", [x_symbol, u_symbol], [casadi.jacobian(ode, casadi.vertcat(x_symbol, u_symbol))]
        )
        np.testing.assert_allclose(
            np.array(jacobian(x, u)), _own_jacobian(kind, x, u), rtol=1e-10, atol=1e-12
        )

    @pytest.mark.slow
    @pytest.mark.parametrize(("kind", "version"), PAIRS)
    def test_casadi_reads_every_kind(kind, version):
        fmu = cached_fmu(model_of(kind, CRANE), version)
        builder = casadi.DaeBuilder("fmu", str(fmu.folder))
        assert len(builder.x()) == len(fmu.variables.states)
        assert len(builder.y()) >= 4


@pytest.mark.slow
def test_ecos_runs_a_profile_into_a_plant(ecos, version):
    """Connected by name: what a co-simulation master does with the two FMUs."""
    profile = cached_fmu(model_of("profile", CRANE), version)
    plant = cached_fmu(model_of("plant-acceleration", CRANE), version)
    with ecos.EcosSimulationStructure() as structure:
        structure.add_model("motion", str(profile.archive))
        structure.add_model("crane", str(plant.archive))
        structure.make_real_connection(
            "motion::cart.setpoint_acceleration", "crane::cart.setpoint_acceleration"
        )
        with ecos.EcosSimulation(structure=structure, step_size=1e-3) as simulation:
            simulation.init()
            simulation.step_until(2.5)
            found = [simulation.get_real(f"crane::{name}") for name in ("cart.position", "sway.payload")]
            target = simulation.get_real("motion::cart.setpoint")
    assert target == motion(1).target[0]
    system = Instance(cached_fmu(model_of("system", CRANE), version), version, exchange=False)
    system.begin({})
    rows = cosimulate(system, np.linspace(0.0, 2.5, 2501), lambda *_: None, ["cart.position", "sway.payload"])
    system.close()
    # the master hands over what was one step ago, and the plant holds it for a step
    assert found[0] + 0.1 == pytest.approx(rows[-1, 0], abs=1e-3)
    assert found[1] == pytest.approx(rows[-1, 1], abs=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plant-setpoint", "system"])
def test_ecos_runs_every_version(ecos, kind, version):
    fmu = cached_fmu(model_of(kind, CRANE), version)
    with ecos.EcosSimulationStructure() as structure:
        structure.add_model("crane", str(fmu.archive))
        with ecos.EcosSimulation(structure=structure, step_size=0.01) as simulation:
            simulation.init()
            if kind == "plant-setpoint":
                simulation.set_real("crane::cart.setpoint", 0.01)
            simulation.step()
            simulation.step()
            found = simulation.get_real("crane::cart.position")
    exact = 0.01 if kind == "plant-setpoint" else motion(1).derivative(np.array([0.02]), 0)[0, 0]
    assert found == pytest.approx(exact, abs=1e-12)


@pytest.mark.slow
def test_default_tolerances_of_model_exchange_do():
    """CVode weighs errors by the nominal values of the states, which are some hundredths of a radian."""
    plant = find_plant("tower-crane")
    move = smooth_move([0.0, 30.0], [2.0, 45.0], 30.0)
    nominal = state_nominals(plant, plant.nominal(), move)
    machine = PlantInstance(plant=plant, parameters=plant.nominal(), nominal=nominal)
    path = str(cached_fmu(system_model("tower", machine, move), Version.FMI2).archive)
    exact, integrated = (
        simulate_fmu(path, fmi_type=interface, stop_time=40.0, output_interval=0.05)
        for interface in ("CoSimulation", "ModelExchange")
    )
    for name in ("sway.payload_radial", "sway.payload_tangential"):
        same = np.interp(exact["time"], integrated["time"], integrated[name])
        np.testing.assert_allclose(same, exact[name], rtol=0.0, atol=5e-5)


def in_pieces():
    """0.3 m in 3 s, cut into pieces of 0.1 s whose ends are rounded as tenths are: 0.30000000000000004 …"""
    knots = np.arange(31) * 0.1
    whole = Polynomial(np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * 0.3 / 3.0 ** np.arange(6))
    pieces = np.array([whole(Polynomial([knot, 1.0])).coef for knot in knots[:-1]])
    return Profile(knots=knots, coefficients=pieces[:, :, None], target=[0.3], method="test")


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 0.3, 1.1])
@pytest.mark.parametrize("kind", ["plant-setpoint", "profile", "system"])
def test_events_may_lie_next_to_communication_points(kind, start, version):
    """FMPy takes times that agree to 1e-9 as one; CVode cannot integrate from one of them to the other."""
    fmu = cached_fmu(model_of(kind, CRANE, in_pieces()), version)
    position = "cart.setpoint" if kind == "profile" else "cart.position"
    own = {"interpolation_period": 0.1} if kind == "plant-setpoint" else {"start_time": start}
    found = simulate_fmu(
        str(fmu.archive),
        fmi_type="ModelExchange",
        stop_time=5.0,
        output_interval=0.01,
        start_values=own,
    )
    exact = 0.0 if kind == "plant-setpoint" else in_pieces().derivative(found["time"] - start, 0)[:, 0]
    np.testing.assert_allclose(found[position], exact, rtol=0.0, atol=1e-15 if kind == "profile" else 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "version"), PAIRS)
def test_source_fmus_compile_with_a_plain_compiler_and_run(kind, version, tmp_path):
    """By C99 alone and with the standard's headers, as an importer does, who finds nothing to warn of."""
    model = model_of(kind, CRANE)
    content = archive(fmu_files(sources(model, version), {}))
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        assert not [name for name in packed.namelist() if name.startswith("binaries/")]
        packed.extractall(tmp_path)
    folder = {Version.FMI2: fmpy.platform, Version.FMI3: fmpy.platform_tuple}[version]
    library = tmp_path / "binaries" / folder / f"{model.identifier}.so"
    library.parent.mkdir(parents=True)
    system = program("cc", "gcc")
    override = f"-DFMI{version.value}_OVERRIDE_FUNCTION_PREFIX"
    warnings = (
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Wconversion",
        "-Wshadow",
        "-Werror",
        "-isystem",
        str(HEADERS),
    )
    level = "-O0" if "plann" in kind else "-O1"  # which takes a planner four seconds
    command = [
        *(system, "-std=c99", level, *warnings),
        *("-shared", "-fPIC", override, "-o", str(library), "fmu.c", "-lm"),
    ]
    done = subprocess.run(command, cwd=tmp_path / "sources", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for interface in ("CoSimulation", "ModelExchange"):
        result = simulate_fmu(
            str(tmp_path), fmi_type=interface, stop_time=0.1, output_interval=0.01, solver="Euler"
        )
        assert len(result) >= 11


@pytest.mark.slow
def test_two_source_fmus_link_into_one_program(version, tmp_path):
    """Statically, as real-time targets do: both run in it, and no name of one clashes with the other's."""
    system, objects, facts = program("cc", "gcc"), [], [f"-DFMI={version.value}"]
    for name, kind in (("plant", "plant-acceleration"), ("system", "system")):
        made = sources(model_of(kind, CRANE), version)
        table = made.model.variables
        facts += [f'-D{name.upper()}_IDENTITY="{made.identity}"']
        facts += [f"-D{name.upper()}_{block}={table.offset(block)}" for block in table.blocks]
        assert not {file for file in made.code if file in version.headers}  # these are the importer's
        folder = tmp_path / name
        folder.mkdir()
        for file, text in made.code.items():
            (folder / file).write_text(text)
        objects.append(str(folder / "fmu.o"))
        command = [system, "-std=c99", "-O1", "-I", str(HEADERS), "-c", "fmu.c", "-o", objects[-1]]
        subprocess.run(command, cwd=folder, check=True)
    command = [system, "-std=c99", "-I", str(HEADERS), *facts]
    subprocess.run([*command, str(LINKED), *objects, "-lm", "-o", "both"], cwd=tmp_path, check=True)
    done = subprocess.run([tmp_path / "both"], capture_output=True, text=True, check=True)
    position, setpoint = map(float, done.stdout.split())
    assert position == pytest.approx(0.5 * 0.2**2, abs=1e-12)  # pushed with 1 m/s² for 0.2 s
    assert setpoint == pytest.approx(motion(1).derivative(np.array([0.2]), 0)[0, 0], abs=1e-12)


def test_pictures_have_one_unit_each_and_round_ticks():
    model = model_of("system", find_plant("tower-crane"))
    pictures = re.findall("<svg.*?</svg>", model.page())
    assert [re.findall(">([a-z]+ in [^<]+)<", picture) for picture in pictures] == [
        [f"{quantity} in {unit}{per}"]
        for unit in ("rad", "m")
        for quantity, per in (("position", ""), ("velocity", "/s"), ("acceleration", "/s²"))
    ] + [["sway in m"]]
    for picture in pictures:
        axis = [float(tick) for tick in re.findall(r'anchor="end">([^<]+)<', picture)]
        assert 2 <= len(axis) <= 7
        step = np.diff(axis)
        np.testing.assert_allclose(step, step[0], rtol=1e-6)
        assert f"{step[0]:.0e}"[0] in "125"


@pytest.mark.slow
def test_fmus_are_complete_and_reproducible(version):
    model = model_of("system", CRANE)
    first, again = (build_fmu(model_of("system", CRANE), version, ("linux-x86_64",)) for _ in range(2))
    assert first == again
    with zipfile.ZipFile(io.BytesIO(first)) as packed:
        names = set(packed.namelist())
        page = packed.read("documentation/index.html").decode()
        picture = "model.png" if version is Version.FMI2 else "terminalsAndIcons/icon.png"
        assert packed.read(picture).startswith(b"\x89PNG")
    assert {"modelDescription.xml", "sources/fmu.c", "documentation/licenses/license.txt"} <= names
    assert ("sources/buildDescription.xml" in names) == (version is Version.FMI3)
    for word in ("M_uu = [", "<svg", "cart.setpoint_jerk", "der(theta1.rate)"):
        assert word in page
    for variable in model.variables.variables:
        assert html.escape(variable.description) in page
    assert Path(fmpy.__file__).parent.as_posix() not in page
