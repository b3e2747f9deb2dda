"""That linear algebra keeps to one thread, whichever of its libraries is loaded when."""

import json
import os
import subprocess
import sys

PROGRAM = """
import json
from gen_profile.one_thread import one_thread
import scipy.linalg
from threadpoolctl import threadpool_info
with one_thread():
    print(json.dumps([one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]))
"""


def test_libraries_are_held_that_are_loaded_after_this_module():
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
    )
    assert set(json.loads(done.stdout)) == {1}
