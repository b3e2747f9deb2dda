"""Designs over a grid of parameters: cases, their store and table, lookup, profile library."""

from gen_profile.support.plugins import require_installed

require_installed("Sweeps need Dask and PyArrow", "sweep", "cryptography", "distributed", "pyarrow")
