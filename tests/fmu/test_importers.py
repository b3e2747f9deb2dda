"""Other people's importers: CasADi's DaeBuilder, Ecos, and a plain C compiler for the sources."""

import html
import importlib
import io
import re
import subprocess
import zipfile
from pathlib import Path

import casadi
import fmpy
import numpy as np
import pytest
from fmpy import simulate_fmu
from fmu.drivers import Instance, cosimulate
from fmu.kinds import INPUTS, KINDS, model_of, motion
from numpy.polynomial import Polynomial
from system_parts import missing, program

from gen_profile.plants.registry import find_plant
from gen_profile.problem import symbolic as sym
from gen_profile.problem.dynamics import dynamics
from gen_profile.profile import Profile
from gen_profile_fmu.building import build_fmu
from gen_profile_fmu.fmu_files import Version, archive, fmu_files, sources
from gen_profile_fmu.plant_fmu import cached_fmu

CRANE = find_plant("double-pendulum-crane")


@pytest.fixture(params=Version)
def version(request):
    return request.param


@pytest.fixture(scope="module")
def ecos():
    """Give Ecos, whose wheel takes Threading Building Blocks from the system."""
    try:
        return importlib.import_module("ecospy")
    except OSError as error:
        missing(f"Threading Building Blocks (Debian package libtbb12): {error}")


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

    @pytest.mark.parametrize("kind", KINDS)
    def test_casadi_reads_every_kind(kind, version):
        fmu = cached_fmu(model_of(kind, CRANE), version)
        builder = casadi.DaeBuilder("fmu", str(fmu.folder))
        assert len(builder.x()) == len(fmu.variables.states)
        assert len(builder.y()) >= 4


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


def in_pieces():
    """0.3 m in 3 s, cut into pieces of 0.1 s whose ends are rounded as tenths are: 0.30000000000000004 …"""
    knots = np.arange(31) * 0.1
    whole = Polynomial(np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]) * 0.3 / 3.0 ** np.arange(6))
    pieces = np.array([whole(Polynomial([knot, 1.0])).coef for knot in knots[:-1]])
    return Profile(knots=knots, coefficients=pieces[:, :, None], target=[0.3], method="test")


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


@pytest.mark.parametrize("kind", KINDS)
def test_source_fmus_compile_with_a_plain_compiler_and_run(kind, version, tmp_path):
    """By C99 alone, in the folder of sources, as an importer without our compiler would."""
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
    command = [system, "-std=c99", "-O1", "-shared", "-fPIC", override, "-o", str(library), "fmu.c", "-lm"]
    done = subprocess.run(command, cwd=tmp_path / "sources", capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for interface in ("CoSimulation", "ModelExchange"):
        result = simulate_fmu(
            str(tmp_path), fmi_type=interface, stop_time=0.1, output_interval=0.01, solver="Euler"
        )
        assert len(result) >= 11


def test_two_source_fmus_link_into_one_program(version, tmp_path):
    """Statically, as real-time targets do: no name of one FMU clashes with the other's."""
    objects = []
    for kind in ("plant-acceleration", "system"):
        model = model_of(kind, CRANE)
        folder = tmp_path / kind
        folder.mkdir()
        for name, text in sources(model, version).code.items():
            (folder / name).write_text(text)
        subprocess.run([program("cc", "gcc"), "-std=c99", "-c", "fmu.c"], cwd=folder, check=True)
        objects.append(folder / "fmu.o")
    names = [{line.split()[-1] for line in _symbols(path) if line.split()[-2] == "T"} for path in objects]
    assert names[0]
    if version is Version.FMI3:  # FMPy's header of FMI 2 has no prefixes; the standard's own has
        assert not names[0] & names[1]
        assert {name.split("_fmi3")[0] for name in names[1]} == {"paper_system"}
    assert all("_fmi" in name or name.startswith("fmi") for name in names[0] | names[1])


def _symbols(path):
    done = subprocess.run([program("nm", "binutils"), str(path)], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


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
