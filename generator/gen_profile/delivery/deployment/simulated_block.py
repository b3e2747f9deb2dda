"""A block in a simulated controller: its own text, compiled, called cycle by cycle behind a server."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from threading import Event

import numpy as np

from gen_profile.delivery.deployment.table import BlockTable
from gen_profile.motion.profile import Array
from gen_profile.planner.execution import BlockInstance

LOOPBACK = "127.0.0.1"  # of the servers that it runs behind
POLL_INTERVAL = 0.02  # s between two looks at what their clients wrote
FOLLOWED = ("fActPosition", "fActVelocity")  # inputs that tell where an axis is
GUIDING = ("bBusy", "bDone", "bAborted", "bEnabled")  # while one of them is set, the axes follow


class SimulatedBlock:
    """An instance with its inputs and outputs, and axes that stand wherever it sends them.

    Parameters
    ----------
    table : BlockTable

    Raises
    ------
    ExportError, CosimulationError
        As `BlockInstance`.
    """

    def __init__(self, table: BlockTable) -> None:
        self._instance = BlockInstance(table.source.text())
        self.inputs = _places(self._instance.inputs)
        self._places = _places(self._instance.outputs)
        self._row = np.array(list(self._instance.inputs.values()))
        self.outputs = {name: np.zeros(len(places)) for name, places in self._places.items()}
        self.set("fCycleTime", np.array([table.spec.export.cycle_time]))
        self._followed = [name for name in self.inputs if name.startswith(FOLLOWED)]
        places = [name for name in self._followed if name.startswith(FOLLOWED[0])]
        for name, at in zip(places, np.split(table.start, len(places)), strict=True):
            self.set(name, at)

    @property
    def names(self) -> list[str]:
        """Inputs that a user sets."""
        return [name for name in self.inputs if name not in {"fCycleTime", *self._followed}]

    def get(self, name: str) -> Array:
        """Give an input's elements."""
        return self._row[self.inputs[name]].copy()

    def set(self, name: str, values: Array) -> None:
        """Set an input's elements."""
        self._row[self.inputs[name]] = values

    def run(self, cycles: int) -> None:
        """Call the block so often; the axes follow from cycle to cycle."""
        issued = self._instance.call(np.tile(self._row, (cycles, 1)))[-1]
        self.outputs = {name: issued[places] for name, places in self._places.items()}
        if any(self.outputs[name][0] for name in GUIDING if name in self.outputs):
            for name in self._followed:
                self.set(name, self.outputs[name.replace("Act", "", 1)])


def _places(elements: Iterable[str]) -> dict[str, list[int]]:
    """Gather the places of each variable's elements: those of ``a[0]`` and ``a[1]`` under ``a``."""
    places: dict[str, list[int]] = {}
    for number, name in enumerate(elements):
        places.setdefault(name.partition("[")[0], []).append(number)
    return places


class SimulatedController(ABC):
    """A simulated block behind a server on the loopback interface.

    Parameters
    ----------
    table : BlockTable
    instance : str
        What clients call the block.
    port : int

    Attributes
    ----------
    ended : Event
        Set to end it.
    fingerprint : str
        SHA-256 of the server's certificate, once it answers; empty where it has none.
    """

    def __init__(self, table: BlockTable, instance: str, port: int) -> None:
        self.block, self.cycle_time = SimulatedBlock(table), table.spec.export.cycle_time
        self.instance, self.port, self.ended, self.fingerprint = instance, port, Event(), ""

    def serve(self, ready: Callable[[str], None]) -> None:
        """Call the block as often as the time that has passed asks for; report the address once it answers.

        Raises
        ------
        OutputError
            The port is not available.
        """
        with self._served() as address:
            ready(address)
            begun, called = time.monotonic(), 0
            while not self.ended.wait(min(self.cycle_time, POLL_INTERVAL)):
                due = int((time.monotonic() - begun) / self.cycle_time)
                if due > called:
                    self.turn(due - called)
                    called = due

    @abstractmethod
    def turn(self, cycles: int) -> None:
        """Take over what clients wrote, call the block, show what it gives."""

    @abstractmethod
    def _served(self) -> AbstractContextManager[str]:
        """Have the server answer; gives its address."""
