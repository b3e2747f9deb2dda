"""That linear algebra keeps to one thread, whichever of its libraries is loaded when."""

import json
import os
import subprocess
import sys

import pytest

PROGRAM = """
import json
from gen_profile.support.one_thread import one_thread
import scipy.linalg
from threadpoolctl import threadpool_info
def threads():
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]
first, second, found = one_thread, one_thread, []
first.__enter__()
found.append(threads())
second.__enter__()
first.__exit__(None, None, None)
found.append(threads())
second.__exit__(None, None, None)
print(json.dumps([*found, threads()]))
"""


@pytest.mark.slow
def test_libraries_that_are_loaded_later_are_held_until_the_last_of_several_threads_has_ended():
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
    )
    assert [set(found) for found in json.loads(done.stdout)] == [{1}, {1}, {2}]
