"""Sweeps of values, as Python has them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_names, as_spec
from gen_profile.sweep.grid import grid_of_values
from gen_profile.sweep.plan import prepare
from gen_profile.sweep.run import Sweep, sweep


def run_sweep(
    spec: Spec | Path | str,
    vary: Mapping[str, Sequence[Any]],
    formats: Sequence[str] | str,
    folder: Path | str,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Sweep:
    """Design, export and check all combinations of values, or go on where such a sweep was interrupted.

    Parameters
    ----------
    spec : Spec, or the path of one
    vary : mapping of str to sequence
        Values by key of the spec, such as ``{"plant.L1": [0.4, 0.5]}``.
    formats : sequence of str, or str
        To export, such as ``["plc"]``.
    folder : Path or str
        To write to.
    workers : int, optional
        Processes of this computer; by default one for each of its processors.
    scheduler : str, optional
        Address of a Dask scheduler, whose workers to use instead.

    Raises
    ------
    SpecError
        A key or all of its values make no sense, or the scheduler does not answer.
    OutputError
        Dask or PyArrow are not installed, or the folder holds another sweep or cannot be written.

    Examples
    --------
    >>> sweep = gp.run_sweep(gp.preset_spec("paper"), {"plant.L1": [0.45, 0.5]}, "plc", "ropes", workers=1)
    >>> sweep.statuses
    {'passed': 2}
    """
    spec = as_spec(spec)
    grid = grid_of_values({key: np.asarray(values).tolist() for key, values in vary.items()})
    text = (tomli_w.dumps(spec.to_dict()), spec.name, Path())
    return sweep(
        prepare(text, (), grid, as_names(formats), Path(folder)), scheduler=scheduler, workers=workers
    )
