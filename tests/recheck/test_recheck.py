"""The re-checker agrees with the re-check of the program, of which it has nothing, and refuses forgeries."""

import hashlib
import json
import shutil
import subprocess
import sys
from functools import cache

import forgeries
import numpy as np
import pytest
from certificates import certified, contents
from flint import arb, arb_poly

import gen_profile as gp
from gen_profile.assurance.certificate.arithmetic.balls import ball
from gen_profile.assurance.certificate.equations import enclosed_equations
from gen_profile.plants.registry import find_plant, is_built_in, plant_types
from gen_profile.spec.reading import spec_from_dict
from gen_profile.support.errors import CertificateError
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.registry import find_exporter
from gen_profile_recheck.__main__ import main
from gen_profile_recheck.axes import quintic
from gen_profile_recheck.boxes import Expansion
from gen_profile_recheck.check import check
from gen_profile_recheck.halving import keeps
from gen_profile_recheck.jets import along, inverse, moved, sine_cosine
from gen_profile_recheck.machines import MACHINES
from gen_profile_recheck.reading import NotProvedError, read_setpoints

KINDS = [kind for kind in plant_types() if is_built_in(kind)]
SPEC = (
    "single-pendulum-crane",
    "export.cycle_time=0.01",
    "limits.sway=0.25",
    "limits.acceleration=0.9",
    "limits.jerk=3",
    "robustness.uncertain={L0=0.02}",
)
QUICK = (
    "flexible-joint",
    "limits.sway=0.04",
    "limits.acceleration=22",
    "limits.jerk=1500",
    "robustness.uncertain={J=0.02}",
)
COARSE = "export.cycle_time=0.02"  # fewer pieces of a motion to enclose
CERTIFIED = [  # beside SPEC and QUICK
    ("flexible-joint", "robustness.uncertain={k=0.01, c=0.05}"),
    ("paper", "check.uncertain={}", "axis.unit=counts", "axis.counts_per_metre=30000"),
    ("flexible-joint", "axis.unit=rad", "axis.modulo=1.0", "check.uncertain={}"),
    ("slosh-tank", "check.uncertain={}", COARSE),
    ("slosh-tank", "plant.mu=0", "limits.sway=0.1"),
    ("mass-spring-chain", "plant.c1=2", "robustness.uncertain={k2=0.05}"),
    ("single-pendulum-crane", "move.initial={phi=0.001}", COARSE),
    ("gantry-crane", "robustness.uncertain={L=0.002, c=0.02}", "limits.sway=0.4", COARSE),
    ("tower-crane", "robustness.uncertain={L=0.02}", COARSE),
    ("paper-beta0", "robustness.uncertain={L2=0.05}", "export.cycle_time=0.004"),
]


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_equations_are_those_of_the_program(kind):
    plant, machine, random = find_plant(kind), MACHINES[kind], np.random.default_rng(1)
    theirs, n = enclosed_equations(plant), len(plant.unactuated)
    assert machine.axes == tuple(axis.name for axis in plant.actuated)
    assert machine.coordinates == tuple(one.name for one in plant.unactuated)
    assert (machine.loads, machine.end_load) == (plant.loads, (plant.end_load_name, plant.end_load))
    for _ in range(20):
        p = {one.name: (one.nominal or 0.01) * random.uniform(0.7, 1.3) for one in plant.parameters}
        x, v = 0.4 * random.normal(size=2 * n), random.normal(size=len(plant.actuated))
        a = random.uniform(0.5, 3.0, len(v))
        k = machine.constants({name: arb(value) for name, value in p.items()})
        balls = [[arb(one) for one in values.tolist()] for values in (x, a, v)]
        ours = [*machine.rate(*balls, k), *machine.at(balls[0][:n], balls[1], k).sways()]
        columns = [[ball(one) for one in values] for values in (x, a, v, p.values())]
        seen = theirs.sway(columns[0][:n], columns[1], columns[3])
        found = [row[0] for row in [*theirs.rate(*columns), *seen]]
        assert [float(one) for one in ours] == pytest.approx([float(one.mid) for one in found], 1e-9, 1e-9)


@cache
def motion(preset):
    return gp.plan(gp.preset_spec(preset, ["export.cycle_time=0.02"])).command


@pytest.mark.slow
@pytest.mark.parametrize("tables", ["constants", "variables"])
@pytest.mark.parametrize("layout", ["segments", "samples", "counts"])
@pytest.mark.parametrize("preset", ["single-pendulum-crane", "tower-crane", "paper"])
def test_a_block_is_read_as_the_program_plays_it(preset, layout, tables):
    forms = [f"export.plc_layout={layout}", f"export.plc_tables={tables}"]
    spec = gp.preset_spec(preset, ["export.cycle_time=0.02", *forms])
    profile, target = motion(preset), target_of(spec)
    (file, *_) = find_exporter("plc").encode(profile, target)
    theirs = find_exporter("plc").replay(file.content, target)
    ours = read_setpoints(file.content, spec.to_dict(), list(spec.axis))
    assert ours.times == theirs.times.tolist() and ours.cycle == theirs.cycle_time
    assert np.array_equal(np.array(ours.positions).T, theirs.position)
    assert np.array_equal(ours.resolution, theirs.resolution)


@pytest.mark.parametrize(
    "axis",
    [
        {"unit": "deg", "modulo": 30.0},
        {"unit": "deg", "modulo": 29.3, "sign": -1},
        {"unit": "counts", "counts_per_metre": 2.0**32, "modulo": 2.0**32},
    ],
)
def test_a_table_that_begins_anew_is_read_as_the_program_reads_it(axis):
    document = gp.preset_spec(
        "flexible-joint", ["export.cycle_time=0.02", "move.start=0.4", "move.target=2.0"]
    ).to_dict()
    document["axis"]["hub"] |= axis
    spec = spec_from_dict(document)
    profile, target = gp.plan(spec).command, target_of(spec)
    (file,) = find_exporter("csv").encode(profile, target)
    theirs = find_exporter("csv").replay(file.content, target)
    ours = read_setpoints(file.content, document, ["hub"])
    assert np.array_equal(np.array(ours.positions).T, theirs.position)
    assert theirs.position[-1, 0] == pytest.approx(profile.target[0], 1e-6)
    first = file.content.splitlines()[1].split(b",")[1]
    outside = file.content.replace(b"," + first + b",", b",-3000000000.0,", 1)
    with pytest.raises(NotProvedError, match=r"outside the turn of axis\.modulo"):
        read_setpoints(outside, document, ["hub"])


@pytest.mark.slow
def test_a_function_block_is_proved_again(tmp_path):
    artefact, certificate = certified(tmp_path, *SPEC, form="plc")
    assert check(*contents(artefact, certificate)).startswith("Proved of all machines with L0 from 2.94")


@pytest.mark.slow
@pytest.mark.parametrize("spec", CERTIFIED)
def test_what_the_program_proves_is_proved_again(tmp_path, spec):
    artefact, certificate = certified(tmp_path, *spec)
    assert gp.check_certificate(artefact, certificate).proved
    assert check(*contents(artefact, certificate)).startswith("Proved of all machines with ")


@pytest.fixture(scope="module")
def genuine(tmp_path_factory):
    return certified(tmp_path_factory.mktemp("genuine"), *SPEC)


def copy_of(files, folder):
    shutil.copytree(files[0].parent, folder, dirs_exist_ok=True)
    return tuple(folder / one.name for one in files)


@pytest.fixture
def copied(genuine, tmp_path):
    return copy_of(genuine, tmp_path)


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    return certified(tmp_path_factory.mktemp("quick"), *QUICK)


@pytest.fixture
def _little_work(monkeypatch):
    """Try no harder to prove a forgery than what it was made of takes."""
    monkeypatch.setattr("gen_profile_recheck.halving.MOST_PARTS", 200)


@pytest.mark.slow
@pytest.mark.usefixtures("_little_work")
def test_little_work_proves_what_forgeries_are_made_of(quick):
    assert gp.check_certificate(*quick).proved
    assert check(*contents(*quick)).startswith("Proved of all machines with J")


@pytest.mark.slow
@pytest.mark.usefixtures("_little_work")
@pytest.mark.parametrize(("forge", "said"), forgeries.FORGERIES.items())
def test_forgeries_are_refused_by_both(quick, tmp_path, forge, said):
    artefact, certificate = copy_of(quick, tmp_path)
    document = json.loads(certificate.read_text())
    forge(document)
    certificate.write_text(json.dumps(document))
    with pytest.raises(CertificateError, match=said):
        gp.check_certificate(artefact, certificate)
    with pytest.raises(NotProvedError):
        check(*contents(artefact, certificate))


@pytest.mark.slow
def test_an_altered_setpoint_is_refused_though_the_hash_is_made_to_fit(copied):
    artefact, certificate = copied
    lines = artefact.read_text().splitlines()
    cells = lines[800].split(",")
    cells[1] = str(float(cells[1]) + 20.0)
    artefact.write_text("\n".join([*lines[:800], ",".join(cells), *lines[801:]]) + "\n")
    with pytest.raises(NotProvedError, match="another artefact"):
        check(*contents(artefact, certificate))
    document = json.loads(certificate.read_text())
    document["artefact_sha256"] = hashlib.sha256(artefact.read_bytes()).hexdigest()
    for axis in document["setpoints"].values():
        for kind in axis.values():
            kind["bound"] = min(kind["bound"] * 1e6, kind["limit"])
    certificate.write_text(json.dumps(document))
    with pytest.raises(NotProvedError):
        check(*contents(artefact, certificate))


@pytest.mark.slow
def test_a_spec_with_other_limits_is_refused_though_its_hash_is_written_into_the_certificate(copied):
    artefact, certificate = copied
    document = json.loads(certificate.read_text())
    for change in ("limits.velocity=0.5", "robustness.uncertain={L0=0.03}", "check.residual_sway=0.001"):
        other = gp.preset_spec(SPEC[0], [*SPEC[1:-1], change] if "L0" in change else [*SPEC[1:], change])
        forged = json.dumps({**document, "spec_sha256": other.sha256()}).encode()
        with pytest.raises(NotProvedError):
            check(artefact.read_bytes(), json.dumps(other.to_dict()).encode(), forged)
        with pytest.raises(NotProvedError, match="about another spec"):
            check(artefact.read_bytes(), json.dumps(other.to_dict()).encode(), json.dumps(document).encode())


@pytest.mark.slow
def test_what_is_not_the_move_of_the_spec_is_refused(genuine, tmp_path):
    """A file that stands still leaves no sway; one may leave the travel, or swing at the start."""
    artefact, manifest, certificate = contents(*genuine)
    spec, document = json.loads(manifest)["spec"], json.loads(certificate)

    def refused(artefact=artefact, message="the setpoints", **changed):
        other = json.dumps(
            {
                name: {**spec[name], **changed.get(name, {})} if isinstance(spec[name], dict) else spec[name]
                for name in spec
            }
        )
        digest = spec_sha(json.loads(other))
        forged = {**document, "artefact_sha256": hashlib.sha256(artefact).hexdigest(), "spec_sha256": digest}
        with pytest.raises(NotProvedError, match=message):
            check(artefact, other.encode(), json.dumps(forged).encode())

    header, first, *rows = artefact.decode().splitlines()
    values = first.split(",", 1)[1]
    still = "\n".join([header, first, *(f"{row.split(',')[0]},{values}" for row in rows)]) + "\n"
    refused(still.encode(), "do not move cart from where")
    refused(message="do not move cart", move={"target": [11.0, 1.0]})
    refused(message="arrive at another time", move={"duration": 15.0})
    refused(message="take hoist beyond its travel", limits={"axis": {"hoist": {"travel": [1.5, 7.0]}}})
    refused(message="not covered: phi_rate", move={"initial": {"phi_rate": 0.1}})
    refused(message="not covered: snap", limits={"snap": 1.0})
    for change in (
        lambda t: t[:-5],
        lambda t: t.replace("\n0.00,", "\n٠.00,"),
        lambda t: t.replace("\n", ",1\n"),
    ):
        refused(change(artefact.decode()).encode(), "not covered, or damaged")


def spec_sha(spec):
    return hashlib.sha256(json.dumps(spec, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@pytest.mark.slow
def test_a_manifests_other_spec_is_none_of_the_artefacts(genuine):
    artefact, manifest, certificate = contents(*genuine)
    document = json.loads(manifest)
    strict = {**document["spec"], "name": "other"}
    later = {**document, "spec": strict, "earlier": [{**document, "artefacts": []}]}
    with pytest.raises(NotProvedError, match="about another spec"):
        check(artefact, json.dumps(later).encode(), certificate)


@pytest.mark.parametrize("decoy", ["// {}", "{{ {} }}", "(* (* *) {} *)"])
def test_a_blocks_table_is_not_read_from_comments(decoy):
    spec = gp.preset_spec("paper", ["export.cycle_time=0.02"])
    (file, *_) = find_exporter("plc").encode(motion("paper"), target_of(spec))
    text = file.content.decode()
    (line,) = (one for one in text.splitlines() if "cTarget : " in one)
    declared = line.split("(*")[0].strip()
    forged = text.replace(
        line, decoy.format(declared) + "\n" + line.replace("cTarget", "CTARGET").replace(":= ", ":= 1")
    )
    try:
        found = read_setpoints(forged.encode(), spec.to_dict(), list(spec.axis))
    except NotProvedError:
        return
    assert found.positions[0][-1] != pytest.approx(spec.move.target[0])


@pytest.mark.slow
@pytest.mark.parametrize("twice", ['"bounds_m": {}, ', '"format": 1, '])
def test_a_key_that_stands_twice_is_refused_by_both(copied, twice):
    artefact, certificate = copied
    certificate.write_text("{" + twice + certificate.read_text()[1:])
    with pytest.raises(CertificateError, match="appears twice"):
        gp.check_certificate(artefact, certificate)
    with pytest.raises(NotProvedError, match="a key stands twice"):
        check(*contents(artefact, certificate))


@pytest.mark.slow
@pytest.mark.parametrize("text", ["[" * 200_000, '{"a": Infinity}', '{"a": 1e999}', "", "{}", "[]"])
def test_what_is_no_certificate_is_said_to_be_none(genuine, text):
    artefact, manifest, _ = contents(*genuine)
    with pytest.raises(NotProvedError):
        check(artefact, manifest, text.encode())


@pytest.mark.slow
def test_what_is_not_covered_is_said(tmp_path):
    lag = "actuator={type='first-order', tau=0.2}"
    artefact, certificate = certified(tmp_path, *SPEC[:2], lag)
    with pytest.raises(NotProvedError, match="not covered: drives that lag"):
        check(*contents(artefact, certificate))
    (warning,) = gp.check_certificate(artefact, certificate).warnings()
    assert "does not cover drives that lag behind their setpoints: it will refuse this" in warning


@pytest.mark.slow
def test_on_the_command_line_it_says_what_it_trusts(genuine, capsys, copied):
    artefact, certificate = genuine
    manifest = artefact.with_name("manifest.json")
    assert main([str(artefact), str(certificate), str(manifest)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("Proved of all machines with L0 from 2.94 to 3.06") and "Trusted: " in said
    copied[0].write_text("nothing")
    assert main([str(copied[0]), str(certificate), str(manifest)]) == 4
    assert capsys.readouterr().out == "Not proved: the certificate is about another artefact.\n"
    assert main([str(artefact)]) == 2 and main(["none", "none", "none"]) == 2
    assert main(["--help"]) == 0
    assert "Cannot read none" in capsys.readouterr().err


def test_it_loads_nothing_of_the_program():
    script = "import sys, gen_profile_recheck.check; print(*sys.modules)"
    environment = {"PYTHONPATH": str(sys.modules["gen_profile_recheck"].__path__[0] + "/..")}
    loaded = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    ).stdout.split()
    assert "flint" in loaded and not {"numpy", "casadi", "scipy", "gen_profile"} & {*loaded}


def test_jets_are_derivatives():
    x, y = moved(moved([arb(0.3), arb(0.7)], [1, 2], 1), [0, 1], 2)
    angle, (sine, cosine) = arb(0.3) * arb(0.7), sine_cosine(x * y)
    # along (1, 2) and (0, 1): of sin xy, (y + 2 x) cos xy, and of that by y
    assert along(sine, 1).parts[0].overlaps((arb(0.7) + 2 * arb(0.3)) * angle.cos())
    slope = angle.cos() - arb(0.3) * (arb(0.7) + 2 * arb(0.3)) * angle.sin()
    assert along(along(sine, 1), 2).overlaps(slope)
    (single,) = moved([arb(0.7)], [1], 2)
    assert along(inverse(single), 2).overlaps(-1 / arb(0.7) ** 2)
    assert along(along(cosine * cosine + sine * sine, 1), 2).contains(0)


def test_quintics_have_the_values_at_their_ends():
    found, half = quintic(arb(0.5), (1.0, 3.0), (-2.0, 0.5), (4.0, -1.0)), arb(0.5)
    slope, bend = found.derivative(), found.derivative().derivative()
    ends = [[poly(x) / half**order for x in (-1, 1)] for order, poly in enumerate([found, slope, bend])]
    assert [[float(one) for one in row] for row in ends] == pytest.approx(
        np.array([[1, 3], [-2, 0.5], [4, -1]])
    )


@pytest.mark.slow
def test_what_values_are_off_by_counts_once_and_bounds_at_nodes_hold_between_them(quick, monkeypatch):
    """Where it was in every coefficient, growth was bounded too roughly, and no error could be large."""
    pieces = []
    monkeypatch.setattr("gen_profile_recheck.check.prove", lambda given, *_: pieces.extend(given))
    check(*contents(*quick))
    (piece, *_), off = pieces, 1e-3

    def terms():
        return [6, 6]

    def exact(s):
        return [s.x[0]]

    def rough(s):
        return [s.x[0] + arb(0, off)]

    (one,), (other,) = (piece.enclosed(each, lambda _: True, terms()) for each in (exact, rough))
    amplified = 1 + 2 / np.pi * np.log(6)
    assert float(other.size) <= float(one.size) + 1.001 * off * amplified
    (bound,) = piece.bounded(exact, lambda _: True, terms())
    motions = [arb_poly(list(s.x[0])) for s in piece.at_nodes((9,), 12)]
    greatest = max(float(abs(one(arb(t)))) for t in (-1, 0.3, 1) for one in motions)
    assert 0 < greatest <= float(bound) < 10 * float(one.size)


def test_a_greatest_value_is_found_by_halves():
    # T2(t) + T1(u)/2 reaches 1.5 and no more, T2(t) T2(u) 1
    sum_ = Expansion([arb(one) for one in (0, 0, 1, 0.5, 0, 0, 0, 0, 0)], (3, 3), arb(0))
    product = Expansion([arb(one) for one in (0.2, 0, -0.4, 0, 0, 0, 0, 0, 0.7)], (3, 3), arb(0.01))
    assert keeps(sum_, arb(1.500001)) and not keeps(sum_, arb(1.499))
    assert keeps(product, arb(1.311)) and not keeps(product, arb(1.29))
