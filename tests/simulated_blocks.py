"""A simulated playback block for the tests of deployment, and the shortest way to it."""

import json
from pathlib import Path

import numpy as np

from gen_profile.delivery.deployment.mailbox import LinkLostError, Mailbox
from gen_profile.delivery.deployment.simulated_block import SimulatedBlock
from gen_profile.delivery.deployment.watching.watch import watch
from gen_profile.delivery.designs.design import design
from gen_profile.planner.design import planner_block
from gen_profile.planner.forms import block_files
from gen_profile.spec.reading import preset_spec
from gen_profile.studies.sweep.library import index_of
from gen_profile.support.artefacts.manifest import Manifest, artefact_of
from gen_profile_exporters.block_source import parse_function_block
from gen_profile_exporters.exporter import target_of
from gen_profile_exporters.playback.library import LibraryEntry, library_source

VARIABLES = ("export.plc_tables=variables", "export.cycle_time=0.02", "move.duration=3.0")


def exported(folder, *changes, preset="paper"):
    """What is written is checked when it is deployed."""
    spec = preset_spec(preset, [*VARIABLES, *changes])
    outcome = design(spec, ["plc"], folder, check=False)
    return Path(folder) / outcome.artefacts[0].path


def exported_library(folder, distances, *changes):
    """Moves of some distances in one block, as `write_library` writes it after a sweep."""
    paths = [exported(folder / str(one), f"move.distance={one}", *changes) for one in distances]
    entries = [
        LibraryEntry(source=parse_function_block(path.read_text("ascii")), label=path.parent.name)
        for path in paths
    ]
    specs = [json.loads((path.parent / "manifest.json").read_bytes())["spec"] for path in paths]
    library = library_source(entries, target_of(preset_spec("paper", [*VARIABLES, *changes])))
    path = folder / "moves.st"
    path.write_text(library.text(), "ascii")
    path.with_suffix(".json").write_bytes(index_of(library.name, path.read_bytes(), [], [], specs))
    return path


def exported_planner(folder, *changes):
    """A planner block, and a manifest that asks for few histories; it is proved when it is deployed."""
    spec = preset_spec("bay-crane", ["export.plc_tables=variables", *changes])
    (file, *_) = block_files(planner_block(spec), spec, ["plc"])
    deliver_planner(folder, spec, [file], histories=8)
    return folder / file.filename


def deliver_planner(folder, spec, files, **check):
    """Write files of a planner block, and a manifest with what it knows of its proof."""
    manifest = Manifest(
        name=spec.name,
        spec=spec.to_dict(),
        spec_sha256=spec.sha256(),
        profile_sha256="",
        versions={},
        artefacts=tuple(artefact_of("planner", file.filename, file.content) for file in files),
        check=check,
    )
    for file in files:
        (folder / file.filename).write_bytes(file.content)
    (folder / "manifest.json").write_bytes(manifest.to_json())


class DirectLink:
    """A way to a simulated block without any network: every look is a cycle."""

    def __init__(self, block):
        self.block, self.operations = block, 0

    def write(self, request):
        self.operations += 1
        self.block.set("aRequest", request)

    def read(self):
        self.operations += 1
        self.block.run(1)
        return self.block.outputs["aReply"].copy()

    def reopen(self):
        self.operations += 1

    def state(self):
        self.operations += 1
        self.block.run(1)
        return self.block.outputs["aState"].copy()


class Machine(DirectLink):
    """A block whose task goes on while time passes, and what happens to it at given times."""

    def __init__(self, table, script=(), alter=lambda values: values, pace=1.0):
        super().__init__(SimulatedBlock(table))
        self.block.run(60)
        self.time, self.called, self.pace = 0.0, 0, pace
        self.cycle = table.spec.export.cycle_time
        self.script, self.alter, self.lost = sorted(script, key=lambda one: one[0]), alter, []
        self.runs = True

    def advance(self, seconds):
        self.time += seconds
        while self.script and self.script[0][0] <= self.time:
            self.script.pop(0)[1](self)
        due = round(self.time * self.pace / self.cycle)
        if due > self.called:
            if self.runs:
                self.block.run(due - self.called)
            self.called = due

    def state(self):
        if any(begin <= self.time < end for begin, end in self.lost):
            raise LinkLostError("the cable was pulled")
        return self.alter(self.block.outputs["aState"].copy())

    def reopen(self):
        self.state()


def setting(**inputs):
    return lambda machine: [machine.block.set(name, np.atleast_1d(value)) for name, value in inputs.items()]


def seen(table, machine, seconds=6.0):
    events = []
    found = watch(
        table,
        machine,
        lambda _state, _at, words: events.append(words),
        seconds=seconds,
        now=lambda: machine.time,
        pause=machine.advance,
    )
    return found, [one for one in events if one]


def box_of(link):
    return Mailbox(link, pause=lambda _: None)


def poked(block, values, choices):
    """Flip a bit of a table where the block keeps it, as failing memory does."""
    memory = block._instance._memory
    place = memory.raw.rfind(values[-40:].tobytes())
    if place >= 0:
        at = place + choices.randrange(40 * 8)
        memory[at] = memory.raw[at] ^ 1 << choices.randrange(8)
