"""Robustness as a table on disk."""

from __future__ import annotations

import csv
from io import StringIO

import numpy as np

from gen_profile.comparison.robustness import Robustness


def table(found: Robustness) -> str:
    """Write a row per machine: relative errors, then every load's residual sway in m by method."""
    loads = found.spec.machine().loads
    head = [*(f"{name}_error" for name in found.errors)]
    head += [f"{method}_{load}_m" for method in found.residual for load in loads]
    grid = np.meshgrid(*found.errors.values(), indexing="ij")
    columns = [values.ravel() for values in grid]
    columns += [
        sway.reshape(-1, len(loads))[:, i] for sway in found.residual.values() for i in range(len(loads))
    ]
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows([f"{value:.9g}" for value in row] for row in zip(*columns, strict=True))
    return text.getvalue()
