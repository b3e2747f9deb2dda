"""Many cases at once, and what is taken of them."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from gen_profile.spec.arguments import as_names, as_path, as_text, as_values
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import as_spec
from gen_profile.spec.values import require_whole
from gen_profile.studies.sweep.grid import grid_of_values
from gen_profile.studies.sweep.library import Library
from gen_profile.studies.sweep.library import write_library as _write_library
from gen_profile.studies.sweep.lookup import LookupResult
from gen_profile.studies.sweep.lookup import lookup as _lookup
from gen_profile.studies.sweep.run import Sweep, prepare, sweep
from gen_profile.support.errors import SpecError
from gen_profile.support.progress import Progress, no_progress, require_progress


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
        Processes of this computer; by default as many as pay, one for each of its processors at most.
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
    if not isinstance(vary, Mapping):
        raise SpecError(f"vary: give values by key, such as {{'plant.L1': [0.45, 0.5]}}, found {vary!r}.")
    if scheduler is not None:
        as_text(scheduler, "scheduler: an address")
    if workers is not None:
        require_whole(workers, 1, "workers")
    for key, values in vary.items():
        if isinstance(values, str) or not isinstance(values, Iterable):
            raise SpecError(f"vary {key}: give a list of values, found {values!r}.")
    listed = {key: [np.asarray(value).tolist() for value in values] for key, values in vary.items()}
    grid = grid_of_values(listed)  # value by value: numbers beside texts would become texts
    text = (tomli_w.dumps(spec.to_dict()), spec.name, Path())
    store = prepare(text, (), grid, as_names(formats), as_path(folder))
    return sweep(store, scheduler=scheduler, workers=workers)


def lookup(
    folder: Path | str,
    asked: Mapping[str, Any],
    progress: Progress = no_progress,
    *,
    out: Path | str | None = None,
) -> LookupResult:
    """Find the nearest profile that keeps the limits on the machine asked for, by co-simulation of the file.

    Distances are counted in steps of the grid, and what is more than one step away is another profile, not an
    answer. Keys of the machine, its check and what stands there (``path``) are taken as asked; in all others,
    such as the move, what the profile was designed for stands in for what was asked.

    Parameters
    ----------
    folder : Path or str
        Or file, of a finished sweep.
    asked : mapping
        A value, or a text of one, for every varied key.
    progress : callable, optional
        Told every step.
    out : Path or str, optional
        Folder to which the profile is written, with its manifest.

    Raises
    ------
    SpecError
        A key is missing or was not varied, or its value makes no sense.
    OutputError
        There is no finished sweep, or its files were altered.
    CheckFailed
        No profile near is safe there, or what was asked for lies beyond the grid.

    Examples
    --------
    >>> gp.lookup("ropes", {"plant.L1": 0.49}).used  # of what gp.run_sweep wrote
    {'plant.L1': 0.5}
    """
    require_progress(progress)
    folder, out = as_path(folder), None if out is None else as_path(out)
    texts = {key: str(value) for key, value in as_values(asked, "asked").items()}
    return _lookup(folder, texts, progress, out=out)


def write_library(folder: Path | str, path: Path | str, progress: Progress = no_progress) -> Library:
    """Put the PLC blocks of all cases that passed into one, and make sure that it issues the same.

    Parameters
    ----------
    folder : Path or str
        Or file, of a finished sweep that exported a format with the playback block.
    path : Path or str
        File to write, such as ``crane.st``; the function block is named after it, and its suffix tells the
        format, which need not be the sweep's.
    progress : callable
        Told what is being done.

    Raises
    ------
    SpecError
        The sweep exported no playback blocks, no case passed, or no format with the block has that suffix.
    OutputError
        The sweep's files were altered, or the library cannot be written, as where a motion has its names.
    ExportError
        The profiles do not fit into one block.

    Examples
    --------
    >>> gp.write_library("ropes", "crane.st").block  # of what gp.run_sweep wrote
    'FB_crane'
    """
    require_progress(progress)
    return _write_library(as_path(folder), as_path(path), progress)
