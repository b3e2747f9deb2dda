"""The example of every public name runs, and gives what it shows."""

import doctest

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import gen_profile as gp

FINDER = doctest.DocTestFinder(recurse=False)
NAMES = {"gp": gp, "np": np, "CubicSpline": CubicSpline}


@pytest.mark.slow
def test_every_public_name_has_an_example_that_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    gp.design(gp.preset_spec("paper"), ["csv", "plc"], "deploy")
    last = ("run_sweep", "lookup", "write_library")  # each goes on with what the one before wrote
    for name in (*sorted(set(gp.__all__) - set(last)), *last):
        (example,) = FINDER.find(getattr(gp, name), name, globs=dict(NAMES))
        assert example.examples, name
        assert doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(example).failed == 0, name
