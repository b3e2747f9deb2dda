"""A simulated playback block for the tests of deployment, and the shortest way to it."""

from pathlib import Path

from gen_profile.deployment.mailbox import Mailbox
from gen_profile.designs.design import design
from gen_profile.spec.reading import preset_spec

VARIABLES = ("export.plc_tables=variables", "export.cycle_time=0.02", "move.duration=3.0")


def exported(folder, *changes, preset="paper"):
    """What is written is checked when it is deployed."""
    spec = preset_spec(preset, [*VARIABLES, *changes])
    outcome = design(spec, ["plc"], folder, check=False)
    return Path(folder) / outcome.artefacts[0].path


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


def box_of(link):
    return Mailbox(link, pause=lambda _: None)


def poked(block, values, choices):
    """Flip a bit of a table where the block keeps it, as failing memory does."""
    memory = block._instance._memory
    place = memory.raw.rfind(values[-40:].tobytes())
    if place >= 0:
        at = place + choices.randrange(40 * 8)
        memory[at] = memory.raw[at] ^ 1 << choices.randrange(8)
