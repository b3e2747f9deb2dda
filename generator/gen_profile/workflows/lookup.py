"""Looking a profile library up: the nearest profile that is safe on the machine that one has."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from pyarrow import compute

from gen_profile.errors import CheckFailed, SpecError
from gen_profile.manifest import FILENAME, parse_manifest
from gen_profile.spec import Spec
from gen_profile.spec_reading import overridden, spec_from_dict
from gen_profile.suggestion import suggestion
from gen_profile.workflows.check import Judgement, check_artefact
from gen_profile.workflows.sweep_case import PASSED
from gen_profile.workflows.sweep_grid import Axis, Grid, overrides
from gen_profile.workflows.sweep_store import grid_of, read_swept
from gen_profile.workflows.sweep_table import Table, cell, read_table

TRIES = 64
MACHINE = ("plant.", "actuator.", "check.", "robustness.uncertain.")  # what one has; all else, one may choose


@attrs.frozen(kw_only=True)
class Found:
    """A profile of a library, and what it costs to use it.

    Attributes
    ----------
    asked : dict
        Value of every varied key.
    used : dict
        The same of the case found.
    row : dict
        Of the sweep's table.
    judgement : Judgement
        Of its artefact on the machine asked for.
    passed_over : dict of int to str
        Cases that are nearer, and why they are not safe.
    """

    asked: dict[str, Any]
    used: dict[str, Any]
    row: dict[str, Any]
    judgement: Judgement
    passed_over: dict[int, str]

    @property
    def differences(self) -> dict[str, float]:
        """How much more the case has of every numeric key than was asked for."""
        return {
            key: self.used[key] - value
            for key, value in self.asked.items()
            if isinstance(value, float) and isinstance(self.used[key], float)
        }

    @property
    def costs(self) -> dict[str, float]:
        """Those differences that the user feels: the machine stays what it is, whatever was asked for."""
        return {key: more for key, more in self.differences.items() if not key.startswith(MACHINE)}

    @property
    def sway(self) -> tuple[float, float]:
        """Worst residual sway in m: on the machine asked for, and on the one it was designed for."""
        load, finding = self.judgement.check.worst
        return finding.residual[load], self.row["check_worst_sway_m"]

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON."""
        expected, designed = self.sway
        return {
            "case": self.row["case"],
            "asked": self.asked,
            "used": self.used,
            "differences": self.differences,
            "sway_residual_worst_m": expected,
            "sway_residual_worst_designed_m": designed,
            "duration_s": self.row["duration_s"],
            **self.judgement.to_dict(),
            "artefacts": [
                {**artefact, "path": str(self.judgement.path.parent / artefact["path"])}
                for artefact in self.row["artefacts"]
            ],
            "passed_over": [{"case": case, "reason": reason} for case, reason in self.passed_over.items()],
        }


def lookup(folder: Path, asked: Mapping[str, str], on_build: Callable[[], None] = lambda: None) -> Found:
    """Find the nearest profile that keeps the limits on the machine asked for, by co-simulation of the file.

    Distances are counted in steps of the grid. Keys of the machine and its check are taken as asked; in all
    others, such as the move, what the profile was designed for stands in for what was asked.

    Parameters
    ----------
    folder : Path
        Of a finished sweep.
    asked : mapping of str to str
        A value for every varied key.
    on_build : callable, optional
        Called before the plant's FMU is compiled.

    Raises
    ------
    SpecError
        A key is missing or was not varied, or its value makes no sense.
    OutputError
        There is no finished sweep, or its files were altered.
    CheckFailed
        No profile near is safe there.
    """
    grid = grid_of(folder)
    wanted = _wanted(grid, asked)
    passed_over: dict[int, str] = {}
    for row in _nearest(grid, read_table(folder), wanted):
        judgement = _judge(folder, row, wanted, on_build)
        if judgement.check.passed:
            used = {key: row[key] for key in wanted}
            return Found(asked=wanted, used=used, row=row, judgement=judgement, passed_over=passed_over)
        passed_over[row["case"]] = " ".join(judgement.check.reasons())
    if not passed_over:
        raise CheckFailed(f"The sweep in {folder} has no profile that passed and could be used.")
    case, reason = next(iter(passed_over.items()))
    raise CheckFailed(
        f"None of the {len(passed_over)} nearest profiles is safe there. Of the nearest, case {case}: "
        f"{reason} Sweep a finer grid, or a more robust design."
    )


def _wanted(grid: Grid, asked: Mapping[str, str]) -> dict[str, Any]:
    """Read what was asked for, as the table's cells hold it."""
    axes = {axis.key: axis for axis in grid.axes}
    for key in asked:
        if key not in axes:
            raise SpecError(f"--{key}: the sweep did not vary this{suggestion(key, axes)}")
    for key, axis in axes.items():
        if key not in asked:
            raise SpecError(f"--{key}: state it, {_range(axis)} were swept.")
    return {key: _value(axis, asked[key]) for key, axis in axes.items()}


def _value(axis: Axis, text: str) -> float | str:
    if not axis.numeric:
        known = [str(cell(axis, value)) for value in axis.values]
        if text not in known:
            raise SpecError(f"--{axis.key}: not among the values swept{suggestion(text, known)}")
        return text
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SpecError(f"--{axis.key}: must be a finite number, found {text[:60]!r}.")
    return value


def _range(axis: Axis) -> str:
    if axis.numeric:
        return f"{min(axis.values):g} to {max(axis.values):g}"
    return ", ".join(str(cell(axis, value)) for value in axis.values)


def _nearest(grid: Grid, table: Table, wanted: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Give usable rows by their distance, the nearest first; of equally near ones, the earlier case."""
    usable = compute.equal(table["status"], PASSED)
    squares = np.zeros(len(table))
    for axis in grid.axes:
        if axis.numeric:
            squares += ((table[axis.key].to_numpy() - wanted[axis.key]) / axis.step) ** 2
        else:
            usable = compute.and_(usable, compute.equal(table[axis.key], wanted[axis.key]))
    cases = np.flatnonzero(usable.to_numpy())
    order = cases[np.argsort(squares[cases], kind="stable")][:TRIES]
    yield from table.take(order).to_pylist()


def _judge(
    folder: Path, row: Mapping[str, Any], wanted: Mapping[str, Any], on_build: Callable[[], None]
) -> Judgement:
    artefact = row["artefacts"][0]
    path = folder / row["folder"] / artefact["path"]
    read_swept(path, artefact["sha256"])
    return check_artefact(path, _spec_there(path.parent, wanted), on_build)


def _spec_there(case: Path, wanted: Mapping[str, Any]) -> Spec:
    """Put the machine asked for into a case's spec."""
    path = case / FILENAME
    document = parse_manifest(read_swept(path), str(path)).spec
    machine = {key: value for key, value in wanted.items() if key.startswith(MACHINE)}
    return spec_from_dict(overridden(document, overrides(machine)), case)
