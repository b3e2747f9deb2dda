"""An hour of 4 ms on a simulated clock: nothing drifts. Takes minutes."""

from collections.abc import Sequence

import attrs
import numpy as np
from exporters.can.bench import MS, Bench
from exporters.motions import quintic

from gen_profile_exporters.can.scaling import Setpoints
from gen_profile_exporters.can.streaming.plan import message
from gen_profile_exporters.can.streaming.streamer import Phase, Streamer

CYCLES = 900_000
PERIOD = 0.004


class Encoded(Sequence):
    """Cycles that are encoded when they are asked for: all at once take a gigabyte."""

    def __init__(self, position):
        self._position = position

    def __len__(self):
        return len(self._position)

    def __getitem__(self, cycle):
        at = int(self._position[cycle, 0])
        return (message(0x301, at.to_bytes(4, "little", signed=True)),)


def test_an_hour_of_cycles():
    instants = []
    with Bench(step=4 * MS) as bench:
        bench.clock.actors.remove(bench._listen)
        times = np.arange(CYCLES + 1) * PERIOD
        slow = quintic((0.1, 0.4), duration=CYCLES * PERIOD)(times).position
        counts = np.rint(1e6 * slow).astype(np.int64)
        motion = Setpoints(period=PERIOD, position=counts, offsets=np.zeros((*counts.shape, 0), np.int64))
        plan = attrs.evolve(bench.plan, motion=motion, cycles=Encoded(motion.position))
        bench.streamer_end.sending = lambda sent: (
            sent.arbitration_id != 0x080 or not instants.append(bench.now)
        )
        record = Streamer(bench.streamer_end, bench.clock, plan).run()
    assert (record.phase, record.sent, record.final) == (Phase.DONE, CYCLES + 1, (400_000,))
    assert record.lateness.percentile(100) == 0.0
    assert record.lateness.drift == 0.0
    syncs = np.rint(1e6 * np.array(instants)).astype(np.int64)  # ns
    print(f"\n{len(syncs)} SYNCs, the last of {CYCLES} cycles after {CYCLES * PERIOD} s to the nanosecond")
    assert CYCLES * round(PERIOD * 1e9) in syncs - syncs[10]
    assert set(np.diff(syncs[:-1]).tolist()) == {round(PERIOD * 1e9)}
