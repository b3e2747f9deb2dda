"""An external FMU as the judge: ours in disguise, and such as crash, hang, leave, or lie."""

import io
import json
import stat
import zipfile
from contextlib import suppress

import numpy as np
import pytest
from fmu.foreign import CRANE, run_of, spec_with, with_description, write_fmu
from fmu.kinds import machine_of
from hypothesis import given, settings
from hypothesis import strategies as st

from gen_profile.assurance.verification import external_fmu as foreign_check
from gen_profile.assurance.verification.batch import Feed
from gen_profile.assurance.verification.check import check_artefact
from gen_profile.assurance.verification.external_fmu import _axis_inputs
from gen_profile.delivery.designs.design import design
from gen_profile.delivery.streaming.stream import verified
from gen_profile.spec.reading import preset_spec, spec_from_dict
from gen_profile.support.artefacts.manifest import FILENAME
from gen_profile.support.errors import CosimulationError, SpecError
from gen_profile_fmu.description.fmu_files import Version, sources
from gen_profile_fmu.model.contents import plant_model
from gen_profile_fmu.model.plant_variables import InputKind
from gen_profile_fmu.running import external_child as foreign_child
from gen_profile_fmu.running import safe_archive
from gen_profile_fmu.running.external_fmu import run_foreign, write_job

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("kind", "version"), [("acceleration", Version.FMI2), ("setpoint", Version.FMI3)])
def test_judges_as_our_own_does(tmp_path, kind, version):
    write_fmu(tmp_path / "customer.fmu", kind, version)
    own = design(preset_spec("paper", ("export.cycle_time=0.01",)), ["csv"], tmp_path / "own").check
    outcome = design(spec_with(tmp_path, kind), ["csv"], tmp_path)
    found = outcome.check
    assert found.passed
    assert [f.scenario.name for f in found.findings] == [f.scenario.name for f in own.findings]
    for one, other in zip(found.findings, own.findings, strict=True):
        for load in ("hook", "payload"):
            apart = abs(one.residual[load] - other.residual[load])
            assert apart < 1e-6 + found.error_bound + own.error_bound
    again = check_artefact(tmp_path / outcome.artefacts[0].path).check  # the spec comes from the manifest
    assert again.findings == found.findings
    manifest = json.loads((tmp_path / FILENAME).read_text())
    assert manifest["spec"]["check"]["fmu"] == "customer.fmu"
    assert str(tmp_path) not in json.dumps(manifest)


def test_goes_along_with_what_it_judged(tmp_path):
    (tmp_path / "models").mkdir()
    write_fmu(tmp_path / "models" / "customer.fmu")
    outcome = design(spec_with(tmp_path, fmu="models/customer.fmu"), ["can"], tmp_path / "elsewhere")
    (tmp_path / "models" / "customer.fmu").unlink()
    path = tmp_path / "elsewhere" / outcome.artefacts[0].path
    assert check_artefact(path).check.findings == outcome.check.findings
    assert verified(path).spec == outcome.spec


def test_an_altered_fmu_is_noticed(tmp_path):
    path = write_fmu(tmp_path / "customer.fmu")
    document = spec_with(tmp_path).to_dict()
    path.write_bytes(path.read_bytes() + b" ")
    with pytest.raises(SpecError, match=r"check.fmu: .* is not the FMU that was checked with"):
        spec_from_dict(document, tmp_path)


def test_a_lagging_drive_is_ours(tmp_path):
    write_fmu(tmp_path / "customer.fmu")
    lag = {"type": "first-order", "tau": 0.1}
    document = {**preset_spec("paper", ("export.cycle_time=0.01",)).to_dict(), "actuator": lag}
    own = design(spec_from_dict(document), ["csv"], tmp_path / "own").check
    document["check"] = spec_with(tmp_path).to_dict()["check"]
    found = design(spec_from_dict(document, tmp_path), ["csv"], tmp_path).check
    for one, other in zip(found.findings, own.findings, strict=True):
        assert one.residual["payload"] == pytest.approx(other.residual["payload"], abs=2e-6)


def test_a_plant_that_takes_velocities(tmp_path):
    """Of drives without much lag of their own; what they have is the customer's."""
    write_fmu(tmp_path / "customer.fmu", "velocity")
    spec = spec_with(tmp_path, "velocity", residual_sway=0.01)
    assert design(spec, ["csv"], tmp_path).check.findings[0].residual["payload"] < 0.01


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fmu": 3}, "check.fmu: must name an FMU"),
        ({"fmu": "paper.csv"}, "check.fmu: must name an FMU, such as customer.fmu, found text 'paper.csv'"),
        ({"fmu": "none.fmu"}, r"check.fmu: .*none.fmu cannot be read \(No such file"),
        ({"input": {"force": "u"}}, "check.input: must name the inputs by one of acceleration, velocity"),
        ({"input": {"setpoint": ["a", "b"]}}, r"check.input.setpoint: must name one .* per axis \(1\)"),
        ({"output": {"angle": "a"}}, "check.output: must name the sway"),
        ({"output": {"sway": {"boom": "a"}}}, "check.output.sway.boom: unknown load"),
        ({"parameters": {"L3": "a", "L1": "b"}}, "check.parameters.L3: unknown parameter"),
        ({"parameters": 1}, "check.parameters: must be a table"),
        ({"parameters": {}}, "check.parameters.L1: required, as it is uncertain"),
        ({"units": {"rope": "mm"}}, r"check.units.rope: unknown variable"),
        ({"units": {"L1": "mm/s"}}, r"check.units.L1: unknown value, found text 'mm/s'"),
        ({"units": {"L1": 3}}, r"check.units.L1: unknown value"),
        ({"time_limit": -1}, "check.time_limit: must be a positive time"),
        ({"fnu": 1}, r"check.fnu: unknown key"),
    ],
)
def test_faults_of_the_map_are_sentences(tmp_path, change, message):
    (tmp_path / "customer.fmu").write_bytes(b"")
    with pytest.raises(SpecError, match=message):
        spec_with(tmp_path, **change)


def test_one_output_is_the_end_loads(tmp_path):
    (tmp_path / "customer.fmu").write_bytes(b"")
    foreign = spec_with(tmp_path, output={"sway": "load.dx"}).check.foreign
    assert dict(foreign.sway) == {"payload": "load.dx"}


ADVANCE = "    double reference[N_A][N_ORDERS];\n    reference_velocity(model, step, reference);"


@pytest.mark.parametrize(
    ("code", "changes", "message"),
    [
        ("*(volatile int *)16 = 1;", {}, r"customer.fmu: the FMU crashed \(SIGSEGV\)"),
        ("abort();", {}, r"the FMU crashed \(SIGABRT\)"),
        ("exit(0);", {}, "the FMU ended its process before"),
        ("for (;;) model->samples++;", {"time_limit": 1.0}, "not done after 1 s; .* raise check.time_limit"),
        ("model->values[THROWN] = 0.0 / 0.0;", {}, r"refused fmi2DoStep \(status 2\), saying: \w+"),
        (
            "model->values[SWAY] = 1.0;",
            {"output_names": ["sway.boom"]},
            "no real scalar variable 'sway.boom'",
        ),
        ("model->samples++;", {"machines": [{"L1": -1.0}]}, r"refused fmi2SetReal .*L1"),
    ],
)
def test_whatever_native_code_does_is_a_sentence(tmp_path, code, changes, message):
    code = code.replace("THROWN", "Q_U")
    path = write_fmu(tmp_path / "customer.fmu", **{ADVANCE: f"    {code}\n{ADVANCE}"})
    with pytest.raises(CosimulationError, match=message):
        run_foreign(run_of(path, **changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"input_names": ["sway.hook"]},
            "'sway.hook' cannot be set as input: it is continuous and of causal",
        ),
        ({"machines": [{"sway.hook": 0.1}]}, "'sway.hook' cannot be set as parameter: .* 'output'"),
    ],
)
def test_variables_must_be_of_use(tmp_path, changes, message):
    path = write_fmu(tmp_path / "customer.fmu")
    with pytest.raises(CosimulationError, match=message):
        run_foreign(run_of(path, **changes))
    assert "name another variable" in done_here(run_of(path, **changes), tmp_path / "work")


@pytest.mark.parametrize("version", Version)
@pytest.mark.parametrize(("folders", "has"), [(["win99", "vax"], "vax, win99"), ([], "sources only")])
def test_a_binary_for_this_computer_is_required(tmp_path, version, folders, has):
    path = write_fmu(tmp_path / "customer.fmu", version=version)
    packed = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(packed, "w") as new:
        new.writestr("modelDescription.xml", old.read("modelDescription.xml"))
        for folder in folders:
            new.writestr(f"binaries/{folder}/customer.bin", b"")
    path.write_bytes(packed.getvalue())
    message = done_here(run_of(path), tmp_path / "work")
    assert message.startswith("customer.fmu: the FMU has no binary for this computer")
    assert f"(it has {has})" in message


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace(b'fmiVersion="2.0"', b'fmiVersion="1.0"'), "FMI 1.0 is not taken"),
        (lambda text: text[: len(text) // 2], "the model description cannot be read"),
        (lambda _: b"", "the model description cannot be read"),
        (lambda text: text.replace(b'guid="', b'guid="x'), "the FMU cannot be run"),
        (lambda text: b"".join([text.partition(b"<CoSimulation")[0], text.partition(b"</CoSimulation>")[2]]),
         "for model exchange only"),
    ],
)  # fmt: skip
def test_wrong_descriptions_are_refused(tmp_path, change, message):
    path = write_fmu(tmp_path / "customer.fmu")
    with_description(path, change)
    with pytest.raises(CosimulationError, match=message):
        run_foreign(run_of(path))
    assert message in done_here(run_of(path), tmp_path / "work")


def zipped(*members):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, content, mode in members:
            info = zipfile.ZipInfo(name)
            info.external_attr = mode << 16
            archive.writestr(info, content)
    return packed.getvalue()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not an FMU, or damaged"),
        (b"PK\x03\x04 nonsense", "not an FMU, or damaged"),
        (zipped(("../evil", b"", 0o644)), "would write outside"),
        (zipped(("a/../../evil", b"", 0o644)), "would write outside"),
        (zipped(("/etc/evil", b"", 0o644)), "would write outside"),
        (zipped(("c:\\evil", b"", 0o644)), "would write outside"),
        (zipped(("..\\evil", b"", 0o644)), "would write outside"),
        (zipped(("link", b"/etc/passwd", stat.S_IFLNK | 0o777)), "would write outside"),
        (zipped(("empty", b"", 0o644)), "the model description cannot be read"),
    ],
)
def test_archives_that_do_harm_are_refused(tmp_path, content, message):
    path = tmp_path / "customer.fmu"
    path.write_bytes(content)
    work = tmp_path / "work"
    assert message in done_here(run_of(path), work)
    assert [p.name for p in tmp_path.rglob("*") if work not in {p, *p.parents}] == ["customer.fmu"]
    assert not [p for p in work.rglob("*") if "evil" in p.name or p.name == "link"]


def test_a_missing_archive_is_a_sentence(tmp_path):
    with pytest.raises(CosimulationError, match=r"none.fmu: the FMU cannot be read \(No such file"):
        run_foreign(run_of(tmp_path / "none.fmu"))
    assert "cannot be read (No such file" in done_here(run_of(tmp_path / "none.fmu"), tmp_path / "work")


def test_too_large_archives_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "large.fmu"
    path.write_bytes(zipped(("a", b"x" * 1000, 0o644), ("b", b"x" * 1000, 0o644)))
    monkeypatch.setattr(safe_archive, "LARGEST", 1999)
    with pytest.raises(CosimulationError, match="too large"):
        safe_archive.unpack(path, tmp_path / "out")
    monkeypatch.setattr(safe_archive, "LARGEST", 2000)
    safe_archive.unpack(path, tmp_path / "out")
    monkeypatch.setattr(safe_archive, "MOST_FILES", 1)
    with pytest.raises(CosimulationError, match="too large"):
        safe_archive.unpack(path, tmp_path / "out")


def test_stated_sizes_are_not_believed(tmp_path, monkeypatch):
    content = zipped(("a", b"x" * 1000, 0o644))
    lie = content.replace((1000).to_bytes(4, "little"), (10).to_bytes(4, "little"))
    path = tmp_path / "lie.fmu"
    path.write_bytes(lie)
    monkeypatch.setattr(safe_archive, "LARGEST", 100)
    with pytest.raises(CosimulationError):
        safe_archive.unpack(path, tmp_path / "out")


@settings(max_examples=150)
@given(
    st.lists(st.tuples(st.integers(0, 1 << 20), st.integers(0, 255)), min_size=1, max_size=8),
    st.integers(0, 400),
)
def test_damaged_archives_are_read_or_refused(tmp_path_factory, changes, cut):
    """Bytes changed at random, and the end cut off: files come out, or a sentence."""
    content = bytearray(
        zipped(
            ("modelDescription.xml", b"<a/>" * 20, 0o644),
            ("binaries/x", b"\0" * 99, 0o644),
            ("d/", b"", 0o755),
        )
    )
    for position, value in changes:
        content[position % len(content)] = value
    folder = tmp_path_factory.mktemp("fuzz")
    path = folder / "a.fmu"
    path.write_bytes(bytes(content[: len(content) - cut]))
    with suppress(CosimulationError):
        safe_archive.unpack(path, folder / "out")
    outside = [p for p in folder.rglob("*") if p.is_file() and "out" not in p.relative_to(folder).parts]
    assert outside == [path]


DESCRIPTION = sources(plant_model(machine_of(CRANE), InputKind.ACCELERATION), Version.FMI3).description


@settings(max_examples=100)
@given(st.lists(st.tuples(st.integers(0, 1 << 20), st.binary(max_size=9)), min_size=1, max_size=4))
def test_damaged_descriptions_are_read_or_refused(tmp_path_factory, changes):
    text = bytearray(DESCRIPTION)
    for position, replacement in changes:
        place = position % len(text)
        text[place : place + len(replacement)] = replacement
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "modelDescription.xml").write_bytes(bytes(text))
    job = {
        "machines": [{"L1": 0.5}],
        "input_names": ["cart.setpoint_acceleration"],
        "output_names": ["sway.hook"],
        "si_units": {"cart.setpoint_acceleration": "m/s^2", "sway.hook": "m", "L1": "m"},
        "stated_units": {},
        "step": None,
        "parameters": {"L1": (0.5, "m", "L1"), "m2": (0.5, "kg", None)},
    }
    with suppress(CosimulationError):
        description = foreign_child._description("a.fmu", folder)
        reals = foreign_child._reals("a.fmu", description, job)
        foreign_child._conversions("a.fmu", description, job, reals)


TEXTS = st.text(max_size=5)
KEYS = TEXTS | st.sampled_from(["sway", "L1"])
VALUES = st.recursive(
    TEXTS | st.integers() | st.floats() | st.booleans(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=5,
)


@pytest.fixture(scope="module")
def folder_with_fmu(tmp_path_factory):
    folder = tmp_path_factory.mktemp("spec")
    (folder / "customer.fmu").write_bytes(b"")
    return folder


@settings(max_examples=30)
@given(
    changes=st.dictionaries(st.sampled_from(["fmu", "input", "output", "parameters", "time_limit"]), VALUES)
)
def test_any_variable_map_is_read_or_refused(folder_with_fmu, changes):
    with suppress(SpecError):
        spec_with(folder_with_fmu, **changes)


def done_here(run, folder):
    """The child's work in this process, where coverage looks; its refusal, if any."""
    folder.mkdir()
    write_job(run, folder)
    with pytest.MonkeyPatch.context() as patch:
        # FMPy's proxy keeps the last logger it was given, for a whole process, beyond that logger's life
        patch.setattr("fmpy.logging.addLoggerProxy", lambda callbacks: None)
        foreign_child.main(folder)
    refusal = folder / "refusal.txt"
    return refusal.read_text() if refusal.exists() else None


@pytest.mark.parametrize("version", Version)
def test_the_childs_work_in_this_process(tmp_path, version):
    path = write_fmu(tmp_path / "customer.fmu", version=version)
    assert done_here(run_of(path), tmp_path / "work") is None
    np.testing.assert_array_equal(
        np.load(tmp_path / "work" / "result.npy"), run_foreign(run_of(path)).outputs
    )
    unknown, negative = run_of(path, output_names=["sway.boom"]), run_of(path, machines=[{"L1": -1.0}])
    assert "no real scalar variable 'sway.boom'" in done_here(unknown, tmp_path / "unknown")
    assert f"refused fmi{version.value}Set" in done_here(negative, tmp_path / "negative")


def test_positions_alone_become_accelerations():
    """Velocity passes through each cycle's mean at its middle, and stands at both ends."""
    times = np.arange(101) * 0.02
    position = (0.3 * np.sin(0.25 * np.pi * times) ** 2)[:, None]
    grid, inputs = _axis_inputs("acceleration", Feed(times=times, position=position), None, 0.0)
    velocity = np.cumsum(inputs[:, 0] * np.diff(grid))
    np.testing.assert_allclose(velocity[:-1], np.diff(position[:, 0]) / 0.02, atol=1e-12)
    assert velocity[-1] == pytest.approx(0.0, abs=1e-12)
    middles = 0.5 * (np.append(0.0, velocity[:-1]) + velocity) * np.diff(grid)
    assert middles.sum() == pytest.approx(0.3, abs=1e-4)


ROUGH = {"lag": [0.01, 0.03], "quantum": 1e-4, "latency": 0.01, "jitter": 0.001, "lost": 0.05}


TRIED = {"samples": 4, "path": ROUGH}


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A motion with scenarios of every kind, and how our own FMU judges it."""
    folder = tmp_path_factory.mktemp("own")
    document = preset_spec("paper", ("export.cycle_time=0.01",)).to_dict()
    document["check"] |= TRIED
    outcome = design(spec_from_dict(document), ["csv"], folder)
    artefact = folder / outcome.artefacts[0].path
    return artefact, check_artefact(artefact).check


@pytest.mark.parametrize("group", ["drives", "samples", "timing"])
def test_any_scenario_can_be_replayed_on_a_foreign_fmu(own, tmp_path, group):
    write_fmu(tmp_path / "customer.fmu")
    artefact, ours = own
    chosen = ours.groups[group][-1]
    theirs = check_artefact(artefact, spec_with(tmp_path, **TRIED), row=chosen.scenario.row).check
    (replayed,) = theirs.findings
    assert replayed.scenario == chosen.scenario
    for load, sway in chosen.residual.items():
        apart = abs(replayed.residual[load] - sway)
        assert apart < 1e-6 + ours.error_bound + theirs.error_bound
    alone = check_artefact(artefact, row=chosen.scenario.row).check
    assert alone.findings[0].residual == pytest.approx(chosen.residual, rel=1e-9)


def test_scenarios_that_share_setpoints_share_a_process(tmp_path, monkeypatch):
    write_fmu(tmp_path / "customer.fmu")
    monkeypatch.setattr("gen_profile.dynamics.evaluation.scenarios.FEWEST_TIMINGS", 1)
    started = []
    run = foreign_check.run_foreign
    monkeypatch.setattr(
        foreign_check, "run_foreign", lambda job: started.append(len(job.machines)) or run(job)
    )
    check = design(spec_with(tmp_path, samples=5, path={"lost": 0.1}), ["csv"], tmp_path).check
    assert [len(findings) for findings in check.groups.values()] == [3, 5, 3]
    assert started == [3, 3, 5, 5, *[1] * 6]  # each with its steps, and with steps of half the length
    assert [finding.scenario.row for finding in check.findings] == list(range(11))
