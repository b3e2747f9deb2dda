"""The clock of simulations: it follows the machine's, and stands still while the machine does."""

import time

from gen_profile_exporters.can.host.clock import SharedClock

MS = 1_000_000


def test_follows_the_machine_and_lets_others_work():
    seen = []
    clock = SharedClock(longest=5 * MS, work=lambda: seen.append(clock.now()))
    real, began = time.monotonic_ns(), clock.now()
    clock.sleep_until(began + 50 * MS)
    passed, really = clock.now() - began, time.monotonic_ns() - real
    assert 50 * MS <= passed <= really
    assert seen == sorted(seen)
    assert len(seen) >= 10


def test_stands_still_while_the_machine_does():
    clock = SharedClock(longest=5 * MS)
    began = clock.now()
    time.sleep(0.2)
    assert clock.now() - began == 5 * MS
    assert clock.stalled >= 195 * MS


def test_what_was_done_before_counts_for_nothing():
    clock = SharedClock(longest=5 * MS)
    time.sleep(0.05)
    real, before = time.monotonic_ns(), clock.catch_up()
    assert before >= 45 * MS
    assert clock.catch_up() - before <= time.monotonic_ns() - real


def test_others_work_even_when_an_instant_has_passed():
    worked = []
    clock = SharedClock(longest=5 * MS, work=lambda: worked.append(True))
    clock.sleep_until(clock.now() - MS)
    assert worked == [True]
