"""A sample of random knob sequences: every one is answered, and nothing of it stays behind."""

import asyncio
import tempfile

import pytest
from end_to_end.knob_sequences import Footprint, turn_knobs
from end_to_end.studios import studio


@pytest.mark.slow
def test_random_knobs_leave_no_traceback_no_process_and_no_open_file():
    with tempfile.TemporaryFile("w+") as stderr, studio(stderr=stderr) as running:
        asyncio.run(turn_knobs(running, "first", 0, 1))
        before = Footprint.of(running.pid)
        ends = asyncio.run(turn_knobs(running, "sample", 0, 3))
        after = Footprint.of(running.pid)
        assert ends.pop("at first: verdict") == 3 and ends.pop("at last: verdict") == 1
        assert set(ends) <= {"verdict", "faults", "failure", "overtaken"}
        assert (after.files, after.workers) <= (before.files, before.workers)
        stderr.seek(0)
        (line,) = stderr.read().splitlines()
        assert line.startswith("The code was used.")
