"""Drives that answer late, change their mode late, or hold what others let be set."""

import re

import pytest
from exporters.can.bench import MS, Bench
from exporters.motions import quintic, target

from gen_profile.spec.can import CanSpec
from gen_profile.support.errors import SpecError
from gen_profile_exporters.can import frames
from gen_profile_exporters.can.simulation.drive_dictionary import DriveVariant
from gen_profile_exporters.can.streaming.record import Phase

ANSWER = 0x581


def late(bench, number, milliseconds):
    """Hold back one SDO answer of the first drive for a while; the bus itself is not disturbed."""
    seen, held = [], []

    def receive(message):
        if message is not None and message.arbitration_id == ANSWER:
            seen.append(message)
            if len(seen) == number:
                held.append((bench.now + milliseconds, message))
                return None
        return message

    def hand_over():
        while held and held[0][0] <= bench.now:
            bench.streamer_end.inbox.append(held.pop(0)[1])

    bench.streamer_end.receiving = lambda message: message if message in seen else receive(message)
    bench.clock.actors.append(hand_over)


def settings(drive):
    """Everything that a drive holds, but for what it tells of itself."""
    unlike = {0x6040, 0x6041, 0x6061, 0x6064, 0x607A}
    objects = drive.local.object_dictionary
    return {
        (index, sub): drive.value(index, sub)
        for index, entry in objects.items()
        if index not in unlike
        for sub in getattr(entry, "subindices", [0])
        if objects.get_variable(index, sub).data_type in range(2, 8)
        and not (0x1600 <= index < 0x1C00 and sub > drive.value(index))  # an entry that does not count
    }


@pytest.mark.parametrize("number", [1, 5, 12, 40, 60])
def test_an_answer_after_700_ms_is_waited_for(number):
    with Bench(step=MS) as bench:
        late(bench, number, 700)
        record = bench.run()
    assert record.phase is Phase.DONE, record.reason


@pytest.mark.parametrize("number", [12, 40, 44, 60])
def test_an_answer_that_comes_too_late_leaves_the_drive_as_it_was(number):
    """It is no answer to the next question, by which settings would stay, and be reported wrongly."""
    with Bench(step=MS, sdo_timeout=0.3) as bench:
        before = settings(bench.drive)
        late(bench, number, 700)
        record = bench.run()
        assert record.phase is Phase.ABORTED
        assert settings(bench.drive) == before
        assert not bench.drive.was_enabled
    assert "does not answer properly (no answer within 0.3 s)" in record.reason
    assert not record.aftermath


@pytest.mark.parametrize(("delay", "phase"), [(3.0, Phase.DONE), (6.0, Phase.ABORTED)])
def test_a_mode_that_takes_seconds(delay, phase):
    with Bench(step=MS, make=DriveVariant(mode_delay=delay)) as bench:
        record = bench.run()
    assert record.phase is phase, record.reason
    assert (
        phase is Phase.DONE
        or "shows mode 0 (6061h) instead of 8, still 5 s after it was set" in record.reason
    )


def test_the_wait_is_the_specs():
    with Bench(step=MS, make=DriveVariant(mode_delay=6.0), state_timeout=8.0) as bench:
        assert bench.run().phase is Phase.DONE


def test_a_negative_mode_is_shown_as_one():
    with Bench(step=MS, make=DriveVariant(mode_delay=60.0)) as bench:
        bench.drive.store(0x6061, 0, -1)
        assert "shows mode -1 (6061h) instead of 8" in bench.run().reason


def test_an_enabled_drive_that_does_not_follow():
    with Bench(step=MS, state_timeout=0.5) as bench:

        def without_bit_12(message):
            if message is not None and message.arbitration_id == 0x181:
                word = int.from_bytes(message.data[:2], "little") & ~0x1000
                message.data[:2] = word.to_bytes(2, "little")
            return message

        bench.streamer_end.receiving = without_bit_12
        record = bench.run()
    assert re.search(
        r"^axis cart: the drive is enabled, but says that it follows no setpoints within 0\.5 s "
        r"\(can\.state_timeout\): bit 12",
        record.reason,
    )
    assert "do not reach" not in record.reason


@pytest.mark.parametrize(
    ("period", "held"),
    [(0.01, (10, -3)), (0.004, (4, -3)), (0.1, (100, -3)), (0.0005, (5, -4)), (1.0, (100, -2))],
)
def test_periods_are_in_milliseconds_where_they_can_be(period, held):
    digits, exponent = frames.period_digits(target(sync_period=period).can)
    assert (digits, exponent) == held
    assert digits * 10.0**exponent == pytest.approx(period, rel=1e-12)


@pytest.mark.parametrize(("period", "exponent", "digits"), [(0.01, -3, 10), (0.01, -4, 100), (0.02, -2, 2)])
def test_a_drive_that_keeps_its_power_of_ten(period, exponent, digits):
    make = DriveVariant(period_exponent=exponent, miss="hold")
    seen = set()
    with Bench(profile=quintic((0.1, 0.2)), step=MS, make=make, sync_period=period) as bench:
        bench.clock.actors.append(
            lambda: seen.add((bench.drive.value(0x60C2, 1), bench.drive.value(0x60C2, 2)))
        )
        record = bench.run()
    assert record.phase is Phase.DONE, record.reason
    assert (digits, exponent) in seen


def test_a_power_of_ten_that_does_not_fit_is_named_in_both_ways():
    with Bench(step=MS, make=DriveVariant(period_exponent=-6), sync_period=0.01) as bench:
        record = bench.run()
    assert re.search(r"60C2h:01 .* must hold 10 \(Ah\), but the drive keeps 1 \(1h\)|60C2h:02", record.reason)


def test_a_counter_of_sync_is_switched_off_and_put_back():
    """A drive that expects one takes a SYNC without it for an error (8240h)."""
    with Bench(step=MS, make=DriveVariant(sync_counter=240)) as bench:
        bench.drive.store(0x1006, 0, 10_000)
        counters = set()
        bench.clock.actors.append(lambda: counters.add(bench.drive.value(0x1019)))
        record = bench.run()
        assert record.phase is Phase.DONE, record.reason
        assert counters == {0, 240}
        assert (bench.drive.value(0x1019), bench.drive.value(0x1006)) == (240, 10_000)
    assert not record.aftermath


@pytest.mark.parametrize("key", ["sdo_timeout", "state_timeout"])
@pytest.mark.parametrize("value", [0.0, -1.0, 1e9, "1"])
def test_time_outs_are_times(key, value):
    with pytest.raises(SpecError, match=f"can.{key}"):
        CanSpec(**{key: value})
