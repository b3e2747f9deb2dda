"""Deployment under faults: whatever goes wrong, a controller uses the former table or the proved one."""

import random
import struct
from functools import partial

import attrs
import numpy as np
import pytest
from end_to_end.simulated_controllers import assert_whole, attempted, table_in_use, unchecked_deployments
from simulated_blocks import (
    VARIABLES,
    DirectLink,
    box_of,
    exported,
    exported_library,
    exported_planner,
    poked,
)

from gen_profile.delivery.deployment.deploy import deploy, require_fit, verify
from gen_profile.delivery.deployment.mailbox import IN_USE, RIGHT, LinkLostError
from gen_profile.delivery.deployment.simulated_block import SimulatedBlock
from gen_profile.delivery.deployment.table import BlockTable, PlannerTable, read_table
from gen_profile.spec.reading import preset_spec
from gen_profile.support.errors import CheckFailed, DeploymentError, ExportError, OutputError

FAULTS = 40


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    """What is in use at first, what is deployed, and what another host deploys."""
    moves = {"old": 0.3, "new": 0.25, "other": 0.2}
    return {
        name: read_table(exported(tmp_path_factory.mktemp(name), f"move.distance={distance}"))
        for name, distance in moves.items()
    }


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    """The same, of several motions."""
    moves = {"old": [0.3, 0.25, 0.2], "new": [0.25, 0.2, 0.15], "other": [0.2, 0.3]}
    return {
        name: read_table(exported_library(tmp_path_factory.mktemp(name), distances))
        for name, distances in moves.items()
    }


@pytest.fixture(scope="module")
def planners(tmp_path_factory):
    """Numbers of three planner blocks."""
    changes = {"old": "limits.velocity=1.1", "new": "limits.velocity=0.9", "other": "plant.m1=2500"}
    return {
        name: read_table(exported_planner(tmp_path_factory.mktemp(name), change))
        for name, change in changes.items()
    }


@pytest.fixture
def block(tables):
    return fresh(tables)


class FaultyLink(DirectLink):
    """One where something happens at an operation, and perhaps for a few more."""

    def __init__(self, block, at, times, request=None, reply=None, happen=None, lose=False):
        super().__init__(block)
        self.span, self.lose = range(at, at + times), lose
        self.alter_request, self.alter_reply, self.happen = request, reply, happen
        self.happened = False

    def _due(self):
        due = self.operations + 1 in self.span
        if due and self.happen is not None and not self.happened:
            self.happen()
        self.happened |= due
        return due

    def write(self, request):
        due = self._due()
        if due and self.lose and self.operations % 2:
            self.operations += 1
            raise LinkLostError("before it was sent")
        super().write(self.alter_request(request.copy()) if due and self.alter_request else request)
        if due and self.lose:
            self.block.run(1)
            raise LinkLostError("after it was sent")

    def read(self):
        due = self._due()
        reply = super().read()
        if due and self.lose:
            raise LinkLostError("reading")
        return self.alter_reply(reply) if due and self.alter_reply else reply

    def reopen(self):
        due = self._due()
        super().reopen()
        if due and self.lose:
            raise LinkLostError("connecting")


def fresh(tables):
    block = SimulatedBlock(tables["old"])
    block.run(60)  # until its checksum is known
    return block


@pytest.fixture
def unchecked(tables, monkeypatch):
    return unchecked_deployments(monkeypatch, tables, BlockTable, PlannerTable)


def flip(values, choices):
    """Turn one bit of one value."""
    place, bit = choices.randrange(len(values)), choices.randrange(64)
    (whole,) = struct.unpack("<Q", struct.pack("<d", values[place]))
    values[place] = struct.unpack("<d", struct.pack("<Q", whole ^ 1 << bit))[0]
    return values


def rounded(request):
    request[16:] = request[16:].astype(np.float32)
    request[-1] = request[0]
    return request


def swapped(request):
    data = request[16:-1].copy().view(np.uint32).reshape(-1, 2)[:, ::-1].ravel().view(np.float64)
    request[16:-1] = data
    return request


def started(block):
    for name in {"bExecute", "bEnable"} & block.inputs.keys():
        block.set(name, np.array([1.0]))
    block.run(1)


def faults(tables, block, choices):
    """List all kinds of faults; where one strikes is drawn."""
    new, other = tables["new"], tables["other"]

    def rival():
        try:
            deploy(other, box_of(DirectLink(block)))
        except DeploymentError as error:
            assert "Another deployment" in str(error)

    return [
        {"lose": True},
        {"lose": True},
        {"request": rounded},
        {"request": swapped},
        {"request": lambda row: flip(row, choices)},
        {"reply": lambda row: flip(row, choices)},
        {"reply": lambda row: row[: choices.randrange(256)]},
        {"request": lambda row: np.append(row[:100], np.zeros(156))},
        {"happen": lambda: poked(block, new.values, choices)},
        {"happen": lambda: started(block)},
        {"happen": rival},
    ]


def used(block, tables):
    """Tell which table a block uses, once it has settled; by a link without faults."""
    for name in {"bExecute", "bEnable"} & block.inputs.keys():
        block.set(name, np.array([0.0]))
    block.run(400)
    return table_in_use(tables, box_of(DirectLink(block)))


@pytest.mark.slow
def test_no_fault_leaves_a_controller_with_anything_but_a_whole_proved_table(
    tables, libraries, planners, unchecked
):
    choices, ends = random.Random(31), []
    kinds = [(kind, DirectLink(fresh(kind))) for kind in (tables, libraries, planners)]
    for kind, count in kinds:
        deploy(kind["new"], box_of(count), trial=True)
    for number in range(FAULTS):
        tables, count = kinds[(0, 1, 0, 1, 2)[number % 5]]
        block, times = fresh(tables), choices.choice([1, 1, 1, 2, 3, 20, 1000])
        drawn = faults(tables, block, choices)
        fault = drawn[number % len(drawn)]
        link = FaultyLink(block, choices.randint(1, count.operations), times, **fault)
        unchecked.clear()
        done, error = attempted(partial(deploy, tables["new"], box_of(link), trial=True))
        found = used(block, tables)
        if found is None:  # memory that failed once all was confirmed: nothing starts
            assert "happen" in fault and box_of(DirectLink(block)).status().checked != RIGHT, (number, fault)
        else:
            assert_whole(done, error, found, fault, tables, unchecked)
        ends.append((done, found))
    assert {(True, "new"), (False, "old")} <= set(ends)


@pytest.mark.slow
def test_the_connection_may_break_at_every_step(tables, unchecked):
    """One break, before or after what was sent had its effect, is taken up; none is too many."""
    steps = DirectLink(fresh(tables))
    deploy(tables["new"], box_of(steps))
    for at in range(1, steps.operations + 1):
        block = fresh(tables)
        assert deploy(tables["new"], box_of(FaultyLink(block, at, 1, lose=True))).action == "deployed"
        assert used(block, tables) == "new"


def test_what_is_deployed_is_in_use_already_the_next_time_and_can_be_rolled_back(tables, block, unchecked):
    old, new, box = tables["old"], tables["new"], box_of(DirectLink(block))
    assert deploy(old, box).action == "in use already"
    done = deploy(new, box)
    assert (done.action, done.held_sha256) == ("deployed", new.hashes["table_sha256"])
    assert (done.before.checksum, done.after.checksum) == (old.checksum, new.checksum)
    verify(new, box)
    with pytest.raises(CheckFailed, match=r"does not use .*old"):
        verify(old, box)
    assert deploy(old, box, rollback=True).action == "rolled back"
    verify(old, box)
    with pytest.raises(
        DeploymentError, match=r"does not hold .*other.*\nThe controller uses the table that it had"
    ):
        deploy(tables["other"], box, rollback=True)


def test_what_sways_too_much_is_not_switched_to(tables, block):
    """Another machine than the one that the table was designed for, as if a manifest were wrong."""
    spec = preset_spec("paper", [*VARIABLES, "move.distance=0.25", "plant.L1=0.9"])
    wrong = attrs.evolve(tables["new"], specs=(spec,))
    with pytest.raises(CheckFailed, match="The controller uses the table that it had"):
        deploy(wrong, box_of(DirectLink(block)))
    assert used(block, tables) == "old"


def test_the_check_is_of_what_was_read_back(tables):
    judgement = tables["new"].check(tables["new"].values, lambda *_: None)
    assert judgement.check.passed and judgement.manifest == "none"
    altered = tables["new"].values.copy()
    altered[100] += 1e-9
    with pytest.raises(ExportError, match="was altered"):
        tables["new"].check(altered, lambda *_: None)


@pytest.mark.slow
def test_a_library_is_deployed_and_any_motion_of_it_that_sways_too_much_stops_that(libraries):
    block, (old, new) = fresh(libraries), (libraries["old"], libraries["new"])
    spec = preset_spec("paper", [*VARIABLES, "move.distance=0.2", "plant.L1=0.9"])
    with pytest.raises(CheckFailed, match="The controller uses the table that it had"):
        deploy(attrs.evolve(new, specs=(new.specs[0], spec, new.specs[2])), box_of(DirectLink(block)))
    assert used(block, libraries) == "old"
    done = deploy(new, box_of(DirectLink(block)))
    assert (done.action, done.to_dict()["motions"]) == ("deployed", 3)
    block.set("nProfile", np.array([2.0]))
    block.run(100)
    started(block)
    while block.outputs["bBusy"][0]:
        block.run(1)
    assert block.outputs["fPosition"].tolist() == [0.15] and block.outputs["bDone"][0]
    assert used(block, libraries) == "new"  # whatever is selected
    assert deploy(old, box_of(DirectLink(block)), rollback=True).action == "rolled back"
    assert used(block, libraries) == "old"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["old", "new"])
def test_a_trial_is_refused_before_anything_is_asked_of_the_controller(planners, name):
    """Its manifest states 8 histories, as one may that was sealed again."""
    link = DirectLink(fresh(planners))
    with pytest.raises(
        CheckFailed, match=r"is a trial, on 8 histories, and 200 make a proof: .* for a trial by name"
    ):
        deploy(planners[name], box_of(link))
    assert link.operations == 0


@pytest.mark.slow
def test_a_planner_is_proved_by_what_was_read_back_and_never_switched_while_enabled(planners):
    block, new = fresh(planners), planners["new"]
    block.set("bEnable", np.array([1.0]))
    block.run(10)
    with pytest.raises(DeploymentError, match="The block moves"):
        deploy(new, box_of(DirectLink(block)), trial=True)
    assert used(block, planners) == "old"
    done = deploy(new, box_of(DirectLink(block)), trial=True)
    assert done.to_dict()["check"]["histories"] == 8 and done.judgement.check.passed
    assert used(block, planners) == "new"
    block.set("bEnable", np.array([1.0]))
    block.run(500)
    assert block.outputs["bPromise"] == 0.0  # how the load swings is unknown
    block.set("bLoadAtRest", np.array([1.0]))
    block.set("fTarget", np.array([12.0]))
    block.set("bExecute", np.array([1.0]))
    velocities = []
    while not block.outputs["bDone"][0]:
        block.run(20)
        velocities.append(block.outputs["fVelocity"][0])
    assert 0.85 < max(velocities) <= 0.9 and block.outputs["fPosition"] == pytest.approx(12.0, abs=1e-6)
    assert block.outputs["aState"][[2, 3, 14]].tolist() == [0.0, 0.0, block.outputs["fPosition"][0]]
    assert used(block, planners) == "new"


@pytest.mark.slow
def test_a_planner_that_is_built_otherwise_is_refused(planners, tmp_path):
    table = read_table(exported_planner(tmp_path, "planner.zones=true"))
    status = attrs.evolve(
        box_of(DirectLink(fresh(planners))).status(), cycle_time=table.spec.export.cycle_time
    )
    with pytest.raises(ExportError, match=r"is built otherwise than that of bay-crane\.st"):
        require_fit(table, status)


@pytest.mark.slow
def test_libraries_and_single_motions_are_told_apart(tables, libraries, block):
    with pytest.raises(ExportError, match=r"moves\.st is a library, and .* takes a single motion"):
        deploy(libraries["new"], box_of(DirectLink(block)))
    with pytest.raises(ExportError, match=r"paper\.st is a single motion, and .* takes a library"):
        deploy(tables["new"], box_of(DirectLink(fresh(libraries))))


@pytest.mark.slow
def test_a_library_of_constants_is_deployed_likewise(libraries, unchecked, tmp_path):
    block = fresh(libraries)
    path = exported_library(tmp_path, [0.25, 0.2, 0.15], "export.plc_tables=constants")
    table = read_table(path)
    assert deploy(table, box_of(DirectLink(block))).action == "deployed"
    assert used(block, libraries) == "new"
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b"fStartTolerance", b"FSTARTTOLERANCE"))
    with pytest.raises(CheckFailed, match=r"is not the library of moves\.json"):
        read_table(path)
    path.write_bytes(whole)
    index = path.with_suffix(".json")
    index.write_bytes(index.read_bytes().replace(b'"L1": ', b'"L1": 1', 1))
    with pytest.raises(OutputError, match="tells no specs; make the library again"):
        read_table(path)
    index.unlink()
    with pytest.raises(OutputError, match="no manifest"):
        read_table(path)


def test_a_block_that_moves_is_left_alone(tables, block, unchecked):
    started(block)
    with pytest.raises(DeploymentError, match="The block moves"):
        deploy(tables["new"], box_of(DirectLink(block)))
    assert used(block, tables) == "old"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("export.plc_layout=samples", "another table's layout, segments and not samples"),
        ("export.cycle_time=0.01", r"another cycle time in s, 0\.02 and not 0\.01"),
        ("axis.unit=mm", "is for axes of other names, units or signs"),
    ],
)
def test_what_does_not_fit_is_refused_with_the_cure(change, words, tables, block, tmp_path):
    table = read_table(exported(tmp_path, change))
    with pytest.raises(ExportError, match=f"{words}.*; export the block with these settings"):
        deploy(table, box_of(DirectLink(block)))


def test_an_interruption_leaves_the_block_to_others_and_tells_what_is_used(tables, block, unchecked):
    def interrupt():
        link.happened = True
        raise KeyboardInterrupt

    link, said = FaultyLink(block, 9, 1, happen=interrupt), []
    with pytest.raises(KeyboardInterrupt):
        deploy(tables["new"], box_of(link), progress=said.append)
    assert said[-1] == "The controller uses the table that it had"
    assert deploy(tables["other"], box_of(DirectLink(block))).action == "deployed"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("at", "change", "words"),
    [
        (3, "axis.unit=mm", "The controller's program was replaced meanwhile"),
        (15, "move.distance=0.3", "730 of 971 values are not those .* look whether it was started anew"),
    ],
)
def test_a_controller_that_is_another_one_after_a_break_is_not_switched(
    at, change, words, tables, block, unchecked, tmp_path
):
    link, there = FaultyLink(block, at, 1, lose=True), read_table(exported(tmp_path, change))
    link.happen = lambda: setattr(link, "block", SimulatedBlock(there))
    with pytest.raises(DeploymentError, match=f"{words}.*\\n.* uses the table that it had"):
        deploy(tables["new"], box_of(link))


@pytest.mark.parametrize(
    ("there", "words"),
    [
        ({"interface": 1}, "another version, 1 and not 2"),
        ({"axes": 2}, "another number of axes, 2 and not 1"),
        ({"capacity": 100}, "The buffers in the controller hold 100 values"),
    ],
)
def test_another_block_is_refused(there, words, tables, block):
    status = box_of(DirectLink(block)).status()
    with pytest.raises(ExportError, match=words):
        require_fit(tables["new"], attrs.evolve(status, **there))


def test_a_block_of_constants_is_deployed_likewise(tables, block, unchecked, tmp_path):
    path = exported(tmp_path, "export.plc_tables=constants", "move.distance=0.25")
    assert deploy(read_table(path), box_of(DirectLink(block))).action == "deployed"
    assert used(block, tables) == "new"


def test_an_altered_file_is_refused(tmp_path):
    path = exported(tmp_path)
    path.write_text(
        path.read_text("ascii").replace(
            "fStartTolerance : LREAL := 0.001", "fStartTolerance : LREAL := 0.002"
        )
    )
    with pytest.raises(CheckFailed, match="altered after its export"):
        read_table(path)


def test_memory_that_fails_later_stops_the_block_and_is_told(tables, block):
    box = box_of(DirectLink(block))
    before = box.read(IN_USE, len(tables["old"].values))
    poked(block, tables["old"].values, random.Random(3))
    block.run(300)
    assert not np.array_equal(box.read(IN_USE, len(before)), before)
    with pytest.raises(CheckFailed, match="does not use"):
        verify(tables["old"], box)
    assert deploy(tables["old"], box).action == "deployed"  # which repairs it
    assert used(block, tables) == "old"
