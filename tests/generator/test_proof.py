"""The proof of a planner block: against other equations and another importer, and that it can fail."""

import json
import pickle
import re
from html import unescape
from time import sleep

import attrs
import numpy as np
import pytest
from command_line import error_of, run_here
from distributed import LocalCluster
from generator.planned_machines import BAY, CYCLE, GANTRY, HOIST, PAPER, swing
from sweeps import LOOPBACK

from gen_profile.assurance.proof.closed_loop import ClosedLoop, trace
from gen_profile.assurance.proof.histories import Histories, History
from gen_profile.assurance.proof.judging import WatchedRun, judge_run
from gen_profile.assurance.proof.numbering import CORNERS, DRAWS, RHYTHMS, SEARCH, Numbering
from gen_profile.assurance.proof.on_cluster import ProofRecipe, judge_part
from gen_profile.assurance.proof.prove import prove, replay
from gen_profile.planner.commands import Command, play
from gen_profile.planner.design import planner_block
from gen_profile.planner.interface import BlockAxis
from gen_profile.presentation.charts.proof import history_figure
from gen_profile.spec.reading import parse_spec
from gen_profile.support.errors import SpecError
from gen_profile_fmu.running.block_run import AxisExtremes, BlockRun

COUNT = 25  # histories, the fewest that have one of each group
FEW = 8  # with corners, draws and a search


@pytest.fixture(scope="module")
def spec():
    return parse_spec(BAY)


@pytest.fixture(scope="module")
def block(spec):
    return planner_block(spec)


@pytest.fixture(scope="module")
def text(block):
    return block.text


@pytest.fixture(scope="module")
def designed(block):
    """Spare the command line the design of the block, which depends on neither errors nor limits of sway."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("gen_profile.delivery.designs.planner.planner_block", lambda _: block)
        yield


@pytest.fixture(scope="module")
def proof(spec, text):
    return prove(spec, text, histories=COUNT)


@pytest.fixture(scope="module")
def few(spec, text):
    return prove(spec, text, histories=FEW, workers=1)


@pytest.mark.slow
def test_a_history_against_other_equations(spec, text):
    """The setpoints are those of `planner play`; the machine's rope is 4 % longer than the block is given."""
    machine = dict(spec.plant.parameters) | {"L1": 1.04 * 6.0}
    commands = (
        Command(time=0.4, command="position", values=(9.0,), live={}),
        Command(time=5.0, command="velocity", values=(-0.7,), live={}),
        Command(time=9.0, command="stop", live={}),
    )
    table = play(text, "time_s,command,value\n0.4,position,9\n5,velocity,-0.7\n9,stop,0\n").table
    columns = np.array([line.split(",")[:4] for line in table.splitlines()[1:]], dtype=float).T
    history = History(live={"L1": 6.0, "m2": 2000.0}, parameters=machine, places=(0.0,), commands=commands)
    with ClosedLoop(spec, text, Histories.of(spec)) as loop:
        run = loop.run(history)
    time = CYCLE * np.arange(run.cycles)
    acceleration = np.zeros(run.cycles)
    acceleration[: len(columns[3])] = columns[3][: run.cycles]
    sway = swing(time, acceleration, **machine)
    assert run.on_the_way == pytest.approx(sway.max(axis=1), abs=1e-5)
    assert run.residual == pytest.approx(sway[:, run.stands // 2 :].max(axis=1), abs=1e-5)
    assert run.residual.max() > 1e-4


@pytest.mark.slow
def test_a_move_on_the_machine_as_told_leaves_a_thousandth_of_its_sway(spec, text):
    move = (Command(time=0.5, command="position", values=(4.0,), live={}),)
    history = History(
        live={"L1": 6.0, "m2": 2000.0}, parameters=spec.plant.parameters, places=(0.0,), commands=move
    )
    with ClosedLoop(spec, text, Histories.of(spec)) as loop:
        run = loop.run(history)
    assert (run.residual < 1e-3 * run.on_the_way).all()


@pytest.mark.slow
def test_a_sound_block_is_proved(spec, proof):
    assert proof.passed
    assert {one.group for one in proof.judged} == {CORNERS, DRAWS, SEARCH, RHYTHMS}
    assert [one.number for one in proof.judged] == list(range(COUNT))
    assert 0.0 < proof.fraction(proof.worst) < 1.0
    assert proof.apart < 1e-12
    slowed = [
        (one.override, *one.velocity_limits) for judged in proof.judged for one in judged.history.commands
    ]
    assert min(override for override, *_ in slowed) < 0.5
    assert 0.3 <= min(limit for _, *limits in slowed for limit in limits) < 0.5
    assert len(proof.by_fmpy) >= 2
    live, ropes = spec.planner.live, [one.history.parameters["L1"] for one in proof.judged]
    assert min(ropes) == pytest.approx(0.95 * live["L1"][0])
    assert max(ropes) == pytest.approx(1.05 * live["L1"][1])
    document = proof.to_dict()
    for name in ("velocity", "acceleration", "jerk"):
        assert 0.9 < document["limits"][name] <= 1.0 + 1e-9


@pytest.mark.slow
def test_sway_on_the_way_is_told_where_it_is_limited(proof):
    assert proof.warnings() == ()
    assert attrs.evolve(proof, sway_limit=10.0).warnings() == ()
    (sentence,) = attrs.evolve(proof, sway_limit=0.1).warnings()
    assert "mm on the way" in sentence
    assert "100 mm are stated (limits.sway)" in sentence


@pytest.mark.slow
def test_who_interrupts_a_proof_need_not_wait_for_the_rest(spec, text, monkeypatch):
    begun = []

    def watched(self, history, *_):
        begun.append(history)
        sleep(0.01)
        return GOOD, ()

    monkeypatch.setattr(ClosedLoop, "watched", watched)
    histories = Histories.of(spec)
    many = [histories.history(choices) for choices in histories.drawn(4, seed=0)] * 100
    with ClosedLoop(spec, text, histories) as loop, pytest.raises(KeyboardInterrupt), loop.runs(many) as runs:
        next(runs)
        raise KeyboardInterrupt
    assert 0 < len(begun) < len(many)


@pytest.mark.slow
def test_a_block_that_fails_in_every_history_is_told_once(spec, text, monkeypatch):
    broken = attrs.evolve(GOOD, fault=1, cycles=0, stands=-1)
    monkeypatch.setattr(ClosedLoop, "watched", lambda *_: WatchedRun(run=broken))
    (reason,) = prove(spec, text, histories=4).reasons()
    assert reason == (
        "In history 0 of 4 the block goes beyond the end of an array, and likewise in 3 others."
    )


@pytest.mark.slow
def test_every_history_can_be_had_again_by_its_number(spec, text, proof):
    numbering = Numbering.of(Histories.of(spec), proof.count, proof.seed, proof.parents)
    for number in (0, COUNT // 2, COUNT - 1):
        (again,) = replay(spec, text, numbering, number).judged
        assert again.to_dict() == proof.judged[number].to_dict()


@pytest.mark.slow
def test_what_is_found_does_not_depend_on_the_number_of_workers(spec, text, few):
    assert prove(spec, text, histories=FEW, workers=3).to_dict() == few.to_dict()


@pytest.mark.slow
def test_workers_of_a_scheduler_find_the_same(spec, text, few):
    with LocalCluster(n_workers=1, threads_per_worker=2, processes=False, **LOOPBACK) as cluster:
        other = prove(spec, text, histories=FEW, scheduler=cluster.scheduler_address)
    assert other.to_dict() == few.to_dict()


def test_a_worker_gets_the_machine_s_file(tmp_path):
    machine = (
        "from gen_profile.plants.registry import find_plant\nPLANT = find_plant('double-pendulum-crane')\n"
    )
    (tmp_path / "own.py").write_text(machine, "utf-8")
    own = parse_spec(BAY.replace('type = "double-pendulum-crane"', 'file = "own.py"'), (), "bay", tmp_path)
    recipe = ProofRecipe.of(own, "")
    (tmp_path / "own.py").unlink()
    assert pickle.loads(pickle.dumps(recipe)).read_spec().sha256() == own.sha256()


def test_a_worker_with_other_libraries_judges_nothing(spec):
    recipe = attrs.evolve(ProofRecipe.of(spec, ""), versions=(("numpy", "0.9"),))
    with pytest.raises(SpecError, match=r"a worker has gen-profile .*, and this proof needs numpy 0\.9"):
        judge_part(recipe, (1, 0, (), [0]))


def test_a_scheduler_that_nobody_runs_is_named(spec, text, monkeypatch):
    monkeypatch.setattr("gen_profile.support.cluster.ANSWER_TIME", "200ms")
    with pytest.raises(SpecError, match=r"scheduler tcp://127\.0\.0\.1:9: no worker answers"):
        prove(spec, text, histories=1, scheduler="tcp://127.0.0.1:9")


@pytest.mark.slow
def test_a_worker_that_fails_is_told(spec, text, monkeypatch):
    def unable(*_):
        raise ModuleNotFoundError("No module 'x'")

    monkeypatch.setattr("gen_profile.assurance.proof.on_cluster.judge_part", unable)
    with (
        LocalCluster(n_workers=1, processes=False, **LOOPBACK) as cluster,
        pytest.raises(SpecError, match=r"the workers cannot go on .*No module 'x'"),
    ):
        prove(spec, text, histories=2, scheduler=cluster.scheduler_address)


def test_the_ends_of_every_choice_make_a_history(spec):
    histories = Histories.of(spec)
    for end, rope, load, place in ((0.0, 0.95 * 3.0, 1e-6, -1.2), (1.0, 1.05 * 9.0, 2000.0, 41.2)):
        history = histories.history(np.full(histories.choices, end))
        assert history.parameters["L1"] == pytest.approx(rope)
        assert history.parameters["m2"] == pytest.approx(load, abs=1.0)
        assert history.places == pytest.approx((place,))  # beyond the travel, from 0 to 40 m
        assert history.commands
        assert [one.time for one in history.commands] == sorted(one.time for one in history.commands)


def scaled(text, name, factor, part=slice(None)):
    """The text with some numbers of a constant array multiplied."""
    found = re.search(rf"{name} : (?:ARRAY \[[^]]*\] OF )?LREAL := (?:\[([^]]*)\]|([^;]*));", text)
    group = 1 if found[1] else 2
    numbers = [float(number) for number in found[group].split(",")]
    numbers[part] = [factor * number for number in numbers[part]]
    return text[: found.start(group)] + ", ".join(map(repr, numbers)) + text[found.end(group) :]


@pytest.mark.slow
def test_a_block_with_altered_constants_fails(spec, text):
    """Frequencies 10 % too high (their squares' sum and product are stored), and 1 % above the velocity."""
    row = (text.split("cModel :")[1].split(";")[0].count(",") + 1) // 4  # of two sums for each mode
    altered = scaled(text, "cModel", 1.1**2, slice(0, row))
    altered = scaled(altered, "cModel", 1.1**4, slice(row, 2 * row))
    proof = prove(spec, re.sub(r"(cVelocity : [^;]*:= \[?\s*)1\.0\b", r"\g<1>1.01", altered), histories=COUNT)
    sway, *others = proof.reasons()
    assert "sways by" in sway
    assert "are allowed (check.residual_sway)" in sway
    assert any("the velocity is above its limit by" in one for one in others)


@pytest.mark.slow
def test_a_block_that_gives_commands_up_fails_and_one_that_stands_for_ever_too():
    spec = parse_spec(BAY, ["limits.travel=[0.0, 90.0]"])
    text, found = planner_block(spec).text, "bFails := programme.nResult > 1;"
    assert text.count(found) == 1
    text = text.replace(found, f"{found} IF bStands THEN bFails := TRUE; END_IF;")
    (given_up,) = [one for one in prove(spec, text, histories=8).reasons() if "error 9" in one]
    assert given_up.endswith("narrow check.uncertain, allow more (check.residual_sway), or accelerate less.")
    patient, early = (re.sub(r"(cGivesUp : LREAL := )[^;]*", rf"\g<1>{time}", text) for time in (1e9, 5.0))
    stands = prove(spec, patient, histories=8).reasons()
    assert any("does not come to rest" in one for one in stands)
    assert not any("error 9" in one for one in stands)
    unstated = early.replace("cGivesUp", "cGaveUp")
    assert any("nErrorId" in one for one in prove(spec, unstated, histories=8).reasons())


@pytest.mark.slow
@pytest.mark.parametrize(("written", "live"), [(PAPER, "L1"), (HOIST, "hoist")])
def test_other_machines_are_proved(written, live):
    """Also one whose rope the hoist tells, and whose errors are none."""
    spec = parse_spec(written)
    proof = prove(spec, planner_block(spec).text, histories=FEW)
    assert proof.reasons() == ()
    live_values = {one.history.live[live] for one in proof.judged}
    assert (min(live_values), max(live_values)) == spec.planner.live[live]
    hoisted = {one.history.places[1:] for one in proof.judged}
    assert (len(hoisted) > 1) == (live == "hoist")


@pytest.mark.slow
def test_several_axes_are_proved_while_they_move_at_once():
    spec = parse_spec(GANTRY)
    text = planner_block(spec).text
    proof = prove(spec, text, histories=FEW)
    assert proof.reasons() == ()
    document = proof.to_dict()
    names = [f"{axis}_{name}" for axis in "xy" for name in ("velocity", "acceleration", "jerk")]
    assert all(0.9 < document["limits"][name] <= 1.0 + 1e-9 for name in names)
    assert {"x_start_m", "y_start_m"} < document["worst"].keys()
    sticks = [one for judged in proof.judged for one in judged.history.commands if one.command == "velocity"]
    assert any(0.0 in one.values and any(one.values) for one in sticks)
    assert any(all(one.values) for one in sticks)
    followed = trace(spec, text, Histories.of(spec), proof.worst.history)
    velocities = [values for name, values in followed.issued.items() if name.startswith("fVelocity")]
    *_, sway = (panels := history_figure(spec, proof, followed).panels)
    moving = np.flatnonzero(np.any(velocities, axis=0))
    assert {level.between for level in sway.levels} == {
        (followed.times[moving[-1]], sway.lines[0].x[-1])
    }  # on the way a swing means nothing
    titles = [panel.title for panel in panels]
    assert titles[0] == "Position of x"
    assert titles[4] == "Velocity of y"


GOOD = BlockRun(
    axes=(
        AxisExtremes(
            velocity=1.0, acceleration=0.3, jerk=1.0, lowest=0.0, highest=40.0, gap=1e-14, creep=0.0
        ),
    ),
    on_the_way=np.array([0.1, 0.1]),
    residual=np.array([0.01, 0.01]),
    cycles=100,
    stands=50,
    promise=True,
    error=0,
    fault=0,
)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({}, None),
        ({"velocity": 1.0 + 2e-9}, "the velocity is above its limit"),
        ({"acceleration": 0.31}, "the acceleration is above its limit by 3.33 %"),
        ({"jerk": np.inf}, "the jerk is above its limit"),
        ({"lowest": -2e-9}, "the axis leaves its travel by 2e-09 m"),
        ({"highest": np.inf}, "the axis leaves its travel"),
        ({"gap": 1e-6}, "a setpoint jumps by 1e-06 m"),
        ({"creep": 1e-6}, "the axis moves on at rest"),
        ({"stands": -1}, "the axis does not come to rest"),
        ({"promise": False}, "the block takes its promise back"),
        ({"fault": 2}, "the block repeats a loop without end"),
    ],
)
def test_every_fault_of_a_run_is_told(spec, changed, words):
    axis = {name: value for name, value in changed.items() if hasattr(GOOD.axes[0], name)}
    others = {name: value for name, value in changed.items() if name not in axis}
    run = attrs.evolve(GOOD, axes=(attrs.evolve(GOOD.axes[0], **axis),), **others)
    stop = Command(time=0.1, command="stop", live={})
    history = History(live={}, parameters={}, places=(0.0,), commands=(stop,))
    faults = judge_run(spec, WatchedRun(run=run), history, cycle=CYCLE, number=0, group=DRAWS).faults
    assert faults == () if words is None else words in faults[0]


def test_errors_may_add_up_in_a_history_that_lasts_long(spec):
    run, stop = attrs.evolve(GOOD, promise=False), Command(time=0.1, command="stop", live={})
    history = History(live={}, parameters={}, places=(0.0,), commands=(stop,))
    judged = judge_run(spec, WatchedRun(run=run), history, cycle=CYCLE, number=0, group=RHYTHMS)
    assert judged.faults == ()
    assert not judged.promise


def test_of_several_axes_the_one_at_fault_is_named():
    spec = parse_spec(GANTRY)
    axes = dict(enumerate([BlockAxis(name="x"), BlockAxis(name="y")]))
    fast = attrs.evolve(GOOD.axes[0], velocity=0.6)
    run = attrs.evolve(GOOD, axes=(fast, attrs.evolve(fast, highest=12.5)))
    stop = Command(time=0.1, command="stop")
    history = History(live={}, parameters={}, places=(0.0, 0.0), commands=(stop,), axes=axes)
    faults = judge_run(spec, WatchedRun(run=run), history, cycle=CYCLE, number=0, group=DRAWS).faults
    assert faults == ("the velocity of y is above its limit by 20 %", "the axis y leaves its travel by 0.5 m")


def test_after_a_quick_stop_nothing_is_promised(spec):
    stop = Command(time=0.1, command="quick-stop", live={})
    history = History(live={}, parameters={}, places=(0.0,), commands=(stop,))
    swaying = attrs.evolve(GOOD, promise=False, residual=np.array([1.0, 1.0]))
    judged = judge_run(spec, WatchedRun(run=swaying), history, cycle=CYCLE, number=0, group=DRAWS)
    assert judged.faults == ()
    assert judged.fraction(spec.check.residual_sway, 0.0) == 0.0


@pytest.fixture(scope="module")
def deployed(tmp_path_factory, designed):
    """The bay crane's block as the command line writes it."""
    folder = tmp_path_factory.mktemp("deployed")
    (folder / "bay.toml").write_text(BAY)
    options = ("--out", folder, "--histories", 16, "--plot", folder / "proof.svg", "--json")
    written = run_here("planner", "write", folder / "bay.toml", *options)
    assert written.code == 0, written.err
    return folder, written.document


@pytest.mark.slow
def test_the_command_line_delivers_what_is_proved(deployed, text):
    folder, document = deployed
    assert (folder / "bay 3.st").read_text() == text
    assert document["proof"]["passed"]
    assert (folder / "proof.svg").read_text().count("<path") > 20
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["check"] == document["proof"]
    assert [artefact["format"] for artefact in manifest["artefacts"]] == ["planner", "planner"]
    assert manifest["artefacts"][1]["path"] == "bay 3_velocity.st"


@pytest.mark.slow
def test_check_repeats_the_proof_from_the_file(deployed):
    folder, document = deployed
    again = run_here("check", folder / "bay 3.st", "--json").document
    assert again["artefact"]["manifest"] == "matches"
    assert again["proof"] == document["proof"]


@pytest.mark.slow
def test_check_replays_one_history(deployed):
    folder, document = deployed
    worst = dict(document["proof"]["worst"])
    one = run_here("check", folder / "bay 3.st", "--history", worst["number"], "--json").document
    share, own = one["history"].pop("share"), worst.pop("share")
    assert one["history"] == worst
    assert share == pytest.approx(own, rel=1e-3)  # the error bound is that of the history alone
    assert "passed" in run_here("check", folder / "bay 3.st", "--history", 0).out


@pytest.mark.slow
def test_a_page_tells_of_the_proof(deployed, tmp_path):
    """Its charts, its data and its words hold what the proof found."""
    folder = deployed[0]
    proof = json.loads((folder / "manifest.json").read_text())["check"]
    page = tmp_path / "bay.html"
    written = run_here("report", folder / "bay 3.st", "--out", page, "--field", "Customer=ACME", "--json")
    assert written.code == 0, written.err
    document = written.document
    assert document["proof"] == proof
    text = unescape(page.read_text("utf-8"))
    worst = proof["worst"]
    assert f"gen-profile check 'bay 3.st' --history {worst['number']} runs" in text
    assert "L1 (m)" in text
    ranked = [float(swayed) for swayed in re.findall(r"<td[^>]*>(?:hook|payload) ([0-9.]+) mm</td>", text)]
    shares = [proof["share"], *(one["share"] for one in proof["next_worst"])]
    limit = 1e3 * proof["limits_m"]["payload"]
    assert ranked == pytest.approx([limit * share for share in shares], rel=1e-2)
    assert f"history {worst['number']} of {proof['histories']}, drawn with the seed {proof['seed']}" in text
    assert "ACME" in text
    assert document["report"]["bytes"] == page.stat().st_size
    data = json.loads(re.search(r'<script id="data"[^>]*>(.*?)</script>', text, re.DOTALL)[1])
    history, mapped, prompt = data["figures"]
    assert [entry["name"] for entry in history["legend"]][:3] == ["setpoint", "command", "this history"]
    position = history["panels"][0]["data"][0]["y"]
    assert position[0] == pytest.approx(worst["start_m"], abs=1e-4)
    (cells,) = mapped["panels"][0]["data"]
    found = [share for row in cells["z"] for share in row if share is not None]
    assert max(found) == pytest.approx(100.0 * proof["share"], rel=1e-4)
    *kinds, _, _ = prompt["panels"][0]["data"]  # the quickest, and what is late
    assert sum(len(kind["y"]) for kind in kinds) == sum(
        one["compared"] for one in proof["prompt"]["commands"]
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--history", 16), "numbered from 0 to 15"),
        (("--samples", 5), "--samples: is for a motion"),
        (("--scale", "x=0.5"), "--scale: is for a motion"),
    ],
)
def test_what_means_nothing_for_a_block_is_refused(deployed, options, words):
    assert words in error_of("check", deployed[0] / "bay 3.st", *options)


@pytest.mark.slow
def test_what_only_a_design_has_is_refused_in_a_report(deployed):
    assert "--no-compare: is for a design" in error_of("report", deployed[0] / "bay 3.st", "--no-compare")


@pytest.mark.slow
@pytest.mark.usefixtures("designed")
def test_a_block_that_sways_too_much_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr("gen_profile.delivery.designs.planner.planner_suggestions", lambda *_: ())
    (tmp_path / "bay.toml").write_text(BAY.replace("residual_sway = 0.05", "residual_sway = 0.00001"))
    options = ("--out", tmp_path / "out", "--histories", 4, "--json")
    failed = run_here("planner", "write", tmp_path / "bay.toml", *options)
    assert failed.code == 4
    assert "sways by" in failed.err
    assert "Nothing was written" in failed.err
    assert failed.document["path"] is None
    assert not (tmp_path / "out").exists()
    kept = run_here("planner", "write", tmp_path / "bay.toml", *options, "--keep-failed", "--export", "c")
    assert kept.code == 4
    assert len(kept.document["files"]) > 1
    assert not json.loads((tmp_path / "out" / "manifest.json").read_text())["check"]["passed"]


@pytest.mark.slow
def test_an_altered_file_is_told(deployed, tmp_path):
    for name in ("bay 3.st", "manifest.json"):
        (tmp_path / name).write_bytes((deployed[0] / name).read_bytes())
    path, end = tmp_path / "bay 3.st", "END_FUNCTION_BLOCK"
    path.write_text(path.read_text().replace(end, f"(* altered *)\n{end}"))
    options = ("--histories", 1, "--json")
    altered = run_here("check", path, *options)
    assert altered.code == 4
    assert altered.document["artefact"]["manifest"] == "differs"
    assert "altered after its export" in altered.err
