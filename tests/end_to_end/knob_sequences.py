"""Random sequences of knobs, and what they leave behind in the studio: ``just knobs --count 1000``."""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import attrs

sys.path.insert(0, str(Path(__file__).parents[1]))
from end_to_end.studios import Studio, studio, workers_of
from tornado.websocket import WebSocketClientConnection

PRESETS = ("", "paper-beta0", "gantry-crane", "slosh-tank", "flexible-joint", "tower-crane")
BORED = 0.7  # s after which a hand turns the next knob, answered or not
UNDONE = 0.3  # of the turns are taken back by the next one
SEQUENCES = 25  # of a page before it is closed
ENDS = ("verdict", "faults", "failure")
SEARCHING = "Looking for what would help"
UNHEARD = ("Internal error", "not understood", "has ended")


def edits_of(chance: random.Random, knobs: list[dict[str, Any]]) -> dict[str, Any]:
    """Turn a knob as a hand might, within its bounds and now and then beyond."""
    knob = chance.choice(knobs)
    path, value = knob["path"], knob["value"]
    if knob.get("optional") and chance.random() < 0.2:
        return {path: None}
    match knob["kind"]:
        case "choice":
            value = chance.choice(knob["choices"])
        case "switch":
            value = chance.random() < 0.5
        case "several":
            value = chance.sample(knob["choices"], chance.randint(0, len(knob["choices"])))
        case "interval":
            value = chance.choice([0.05, 0.1, 0.2])
        case "pair":
            value = [-1.0, chance.uniform(0.0, 20.0)]
        case "text":
            value = chance.choice(["bay 3", "", "ä" * 64])
        case _:
            usual = value if isinstance(value, int | float) else knob.get("usual") or 1.0
            value = (
                chance.choice([0.0, -1.0, 1e9])
                if chance.random() < 0.05
                else usual * chance.uniform(0.7, 1.5)
            )
    same = [one for one in knobs if one["path"] == path and "index" in one]
    return {path: [value] * len(same) if same else value}


class Page:
    """A page without a browser: what it asks, and how its last question was answered."""

    def __init__(self, connection: WebSocketClientConnection) -> None:
        self._connection, self._serial = connection, 0
        self.knobs: list[dict[str, Any]] = []

    @classmethod
    async def open(cls, running: Studio) -> Page:
        """Open a page."""
        page = cls(await running.connect())
        await page._connection.write_message(json.dumps({"say": "open", "address": ""}))
        await page.answer()
        return page

    async def show(self, preset: str, edits: dict[str, Any]) -> None:
        """Ask for a state."""
        self._serial += 1
        state = {"preset": preset, "edits": edits}
        await self._connection.write_message(
            json.dumps({"say": "show", "serial": self._serial, "state": state})
        )

    async def answer(self, patience: float = 600.0) -> str:
        """Wait for the last question's answer: the part that it ended in, or what should not be shown."""
        until = time.monotonic() + patience
        while (left := until - time.monotonic()) > 0.0:
            try:
                text = await asyncio.wait_for(self._connection.read_message(), left)
            except TimeoutError:
                break
            if text is None:
                return "closed"
            part, words = json.loads(text), str(text)
            if any(one in words for one in UNHEARD):
                return words[:300]
            if part["part"] == "setting":
                self.knobs = part["knobs"]
            if part["part"] in ENDS and part["serial"] == self._serial and SEARCHING not in words:
                return str(part["part"])
        return "overtaken"

    async def close(self) -> None:
        """Close the page, and wait until the studio has."""
        self._connection.close()
        while await self._connection.read_message() is not None:
            pass


async def turn_knobs(running: Studio, seed: str, first: int, count: int) -> Counter[str]:
    """Turn knobs in sequences, some on one page, and tell how often each ended how."""
    ends = Counter[str]()
    page = await Page.open(running)
    for index in range(first, first + count):
        chance = random.Random(f"{seed}-{index}")
        preset, edits = chance.choice(PRESETS), dict[str, Any](name=f"{seed}-{index}")
        await page.show(preset, edits)
        ends[f"at first: {await page.answer()}"] += 1
        for _ in range(chance.randint(1, 8)):
            taken = edits | edits_of(chance, page.knobs)
            await page.show(preset, taken)
            edits = edits if chance.random() < UNDONE else taken
            await asyncio.sleep(chance.choice([0.0, 0.02, 0.1]))
        ends[await page.answer(BORED)] += 1
        if index % SEQUENCES == SEQUENCES - 1:
            await page.close()
            page = await Page.open(running)
    await page.show("", {"name": "at last"})
    ends[f"at last: {await page.answer()}"] += 1
    await page.close()
    return ends


@attrs.frozen
class Footprint:
    """What a process holds: memory in MB, open files, threads; and how many processes it has started."""

    memory: float
    files: int
    threads: int
    workers: int

    @classmethod
    def of(cls, server: int) -> Footprint:
        """Look at the studio once its pages are gone, and their processes with them."""
        for _ in range(100):
            if len(workers_of(server)) <= 1:
                break
            time.sleep(0.1)
        time.sleep(1.5)  # until a worker is ready again, and threads of those that ended are gone
        folder = Path(f"/proc/{server}")
        pages = int((folder / "statm").read_text().split()[1])
        counts = (len(list((folder / name).iterdir())) for name in ("fd", "task"))
        return cls(pages * 4096 / 1e6, *counts, len(workers_of(server)))


def main() -> None:
    """Turn knobs, and print what was left."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", default="knobs")
    parser.add_argument("--first", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryFile("w+") as stderr, studio("--preset", "paper", stderr=stderr) as running:
        warm = 50
        print(
            asyncio.run(turn_knobs(running, "warm", 0, warm)), Footprint.of(running.pid), sep="\n", flush=True
        )
        began = time.perf_counter()
        ends = asyncio.run(turn_knobs(running, arguments.seed, arguments.first, arguments.count))
        print(f"{arguments.count} sequences, {time.perf_counter() - began:.0f} s: {dict(ends)}")
        print(Footprint.of(running.pid))
        stderr.seek(0)
        print("told:", stderr.read() or "nothing")


if __name__ == "__main__":
    main()
