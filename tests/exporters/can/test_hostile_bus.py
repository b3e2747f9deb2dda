"""Peers that send whatever they like, on every identifier."""

import random

import can
import pytest
from exporters.can.bench import QUICK_STOP, Bench
from motions import quintic

from gen_profile.support.errors import StreamAborted
from gen_profile_exporters.can.streaming.record import Phase

FRAMES = 100_000
ROUNDS = 20


def noise(generator):
    """Any frame: classical or extended, data, remote or error."""
    kind = generator.randrange(8)
    extended = kind == 0
    return can.Message(
        arbitration_id=generator.randrange(1 << 29 if extended else 1 << 11),
        is_extended_id=extended,
        is_remote_frame=kind == 1,
        is_error_frame=kind == 2,
        data=b"" if kind == 1 else generator.randbytes(generator.randrange(9)),
    )


def answers(generator):
    """Frames as the drive itself would send them, with any content."""
    cob_id = generator.choice((0x181, 0x581, 0x701))
    return can.Message(
        arbitration_id=cob_id, data=generator.randbytes(generator.randrange(9)), is_extended_id=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("make_frame", [noise, answers])
@pytest.mark.parametrize("seed", range(ROUNDS))
def test_nothing_on_the_bus_crashes_it_or_moves_the_axis_elsewhere(make_frame, seed):
    generator = random.Random(seed)
    mode = [{}, {"mode": "ip"}, {"mode": "csv", "following_error": 0.01}][seed % 3]
    with Bench(profile=quintic((0.0, 0.3)), **mode) as bench:
        start = [0, 1, 150][seed // 3 % 3] * 1_000_000  # while it listens, configures or streams
        count = [0]

        def chatter():
            if bench.clock.now() > 1_000_000_000 + start and count[0] < FRAMES // ROUNDS:
                for _ in range(50):
                    count[0] += 1
                    bench.streamer_end.inbox.append(make_frame(generator))

        bench.clock.actors.append(chatter)
        record = bench.run()
    allowed = {message.data.hex() for cycle in bench.plan.cycles for message in cycle}
    assert {frame.data.hex() for frame in bench.of(0x301)} <= allowed
    assert record.phase in {Phase.DONE, Phase.ABORTED}
    if record.phase is Phase.ABORTED and bench.of(0x301):
        stop = next(frame.at for frame in bench.of(0x201) if frame.data == QUICK_STOP)
        assert max(frame.at for frame in bench.of(0x301)) <= stop


def test_a_frame_that_is_refused_is_a_sentence():
    with Bench() as bench:
        bench.streamer_end.sending = lambda message: (_ for _ in ()).throw(OSError("gone"))
        with pytest.raises(StreamAborted, match=r"301h cannot be sent \(gone\)"):
            bench.streamer._link.send(bench.plan.cycles[0][0])


def test_an_interface_that_goes_down_is_a_sentence():
    def down(message):
        raise can.CanOperationError("Network is down")

    with Bench() as bench:
        bench.at_cycle(50, lambda: setattr(bench.streamer_end, "receiving", down))
        record = bench.run()
    assert record.phase is Phase.ABORTED
    assert "the interface went down. Not every axis is known to stand" in record.reason
    assert bench.of(0x201)[-1].data == QUICK_STOP
