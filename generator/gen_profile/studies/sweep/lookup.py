"""Looking a profile library up: the nearest profile that is safe on the machine that one has."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from pyarrow import compute

from gen_profile.assurance.verification.check import Judgement, check_artefact
from gen_profile.dynamics.evaluation.phrases import named
from gen_profile.spec.model import Spec
from gen_profile.studies.sweep.case import PASSED
from gen_profile.studies.sweep.grid import Grid, GridAxis, overrides
from gen_profile.studies.sweep.store import case_folder, case_spec, grid_of, swept_table, take_out
from gen_profile.studies.sweep.table import Table, cell
from gen_profile.support.errors import CheckFailed, SpecError
from gen_profile.support.progress import Progress, no_progress
from gen_profile.support.suggestion import finite_number, number_meant, suggestion

TRIES = 64
GRID_TOLERANCE = 1e-9  # of a step of the grid
FINER = "Sweep a finer grid, or a more robust design."
# what one has, and what stands there; all else, one may choose
MACHINE = ("plant.", "actuator.", "check.", "robustness.uncertain.", "path.")


@attrs.frozen(kw_only=True)
class LookupResult:
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


def lookup(
    folder: Path,
    asked: Mapping[str, str],
    progress: Progress = no_progress,
    *,
    out: Path | None = None,
) -> LookupResult:
    """Find the nearest profile that keeps the limits on the machine asked for, by co-simulation of the file.

    Parameters
    ----------
    folder : Path
        Or file, of a finished sweep.
    asked : mapping of str to str
        A value for every varied key.
    progress : callable, optional
    out : Path, optional
        Folder to which the profile is written, with its manifest.

    Raises
    ------
    SpecError
        A key is missing or was not varied, or its value makes no sense.
    OutputError
        There is no finished sweep, or its files were altered.
    CheckFailed
        No profile near is safe there, or what was asked for lies beyond the grid.
    """
    grid = grid_of(folder)
    wanted = _wanted(grid, asked)
    near, first = _near(grid, swept_table(folder, grid, ["case", "status", *wanted]), wanted)
    rows = swept_table(folder, grid, cases=near).to_pylist()
    nearest = next(iter(swept_table(folder, grid, cases=first).to_pylist()), None)
    if nearest is None:
        raise CheckFailed(f"The sweep in {folder} has no profile that passed and could be used.")
    with case_folder(folder, nearest) as case:
        _spec_there(folder, nearest, case, wanted)  # may refuse what was asked for
    _require_within(grid, wanted, nearest)
    if not rows:
        raise CheckFailed(
            f"No profile within a step of the grid passed its check. {_named(nearest, wanted)} {FINER}"
        )
    progress("checking by co-simulation")
    passed_over: dict[int, str] = {}
    for row in rows:
        judgement = _judge(folder, row, wanted, progress)
        if judgement.check.passed:
            if out is not None:
                take_out(folder, row, out)
                judgement = attrs.evolve(judgement, path=out / judgement.path.name)
            used = {key: row[key] for key in wanted}
            return LookupResult(
                asked=wanted, used=used, row=row, judgement=judgement, passed_over=passed_over
            )
        passed_over[row["case"]] = " ".join(judgement.check.reasons())
    raise CheckFailed(
        f"None of the {len(rows)} nearest profiles is safe there. {_named(rows[0], wanted)} "
        f"{passed_over[rows[0]['case']]} {FINER}"
    )


def _wanted(grid: Grid, asked: Mapping[str, str]) -> dict[str, Any]:
    """Read what was asked for, as the table's cells hold it."""
    axes = {axis.key: axis for axis in grid.axes}
    unknown = [key for key in asked if key not in axes]
    faults = [f"{key}: the sweep did not vary this{suggestion(key, axes)}" for key in unknown]
    wanted = {}
    for key, axis in axes.items():
        try:
            wanted[key] = _value(axis, asked.get(key))
        except SpecError as error:
            faults += error.faults
    if faults:
        raise SpecError(*faults)
    return wanted


def _value(axis: GridAxis, text: str | None) -> float | str:
    if text is None:
        raise SpecError(f"{axis.key}: state it, {_range(axis)} were swept.")
    if not axis.numeric:
        known = [str(cell(axis, value)) for value in axis.values]
        if text not in known:
            raise SpecError(f"{axis.key}: not among the values swept{suggestion(text, known)}")
        return text
    value = finite_number(text)
    if math.isnan(value):
        raise SpecError(f"{axis.key}: must be a finite number, found {text[:60]!r}{number_meant(text)}.")
    return value


def _range(axis: GridAxis) -> str:
    if axis.numeric:
        return f"{min(axis.values):g} to {max(axis.values):g}"
    return ", ".join(str(cell(axis, value)) for value in axis.values)


def _near(grid: Grid, table: Table, wanted: Mapping[str, Any]) -> tuple[list[int], ...]:
    """List usable cases within a step of the grid, the nearest first, and the nearest of all if there is one.

    Of equally near ones, the earlier case comes first.
    """
    usable = compute.equal(table["status"], PASSED)
    squares, farthest = np.zeros(len(table)), np.zeros(len(table))
    for axis in grid.axes:
        if axis.numeric:
            steps = np.abs(axis.steps(table[axis.key].to_numpy()) - axis.steps(wanted[axis.key]))
            squares += steps**2
            farthest = np.maximum(farthest, steps)
        else:
            usable = compute.and_(usable, compute.equal(table[axis.key], wanted[axis.key]))
    cases = np.flatnonzero(usable.to_numpy())
    order = cases[np.argsort(squares[cases], kind="stable")]
    near = order[farthest[order] <= 1.0 + GRID_TOLERANCE][:TRIES]
    return tuple(table["case"].take(some).to_pylist() for some in (near, order[:1]))


def _require_within(grid: Grid, wanted: Mapping[str, Any], nearest: Mapping[str, Any]) -> None:
    """Refuse what lies beyond the values swept: however near the last of them is, it is another."""
    beyond = [
        f"{axis.key} {wanted[axis.key]:g}: beyond the grid, {_range(axis)} were swept."
        for axis in grid.axes
        if axis.numeric and not min(axis.values) <= wanted[axis.key] <= max(axis.values)
    ]
    if beyond:
        raise CheckFailed("\n".join([*beyond, f"{_named(nearest, wanted)} Sweep further for this one."]))


def _named(row: Mapping[str, Any], wanted: Mapping[str, Any]) -> str:
    values = ", ".join(named({key: row[key] for key in wanted}))
    return f"The nearest profile that passed is case {row['case']} ({values})."


def _judge(folder: Path, row: Mapping[str, Any], wanted: Mapping[str, Any], progress: Progress) -> Judgement:
    name = row["artefacts"][0]["path"]
    with case_folder(folder, row) as case:
        judgement = check_artefact(case / name, _spec_there(folder, row, case, wanted), progress=progress)
    return attrs.evolve(judgement, path=folder / row["folder"] / name)


def _spec_there(folder: Path, row: Mapping[str, Any], case: Path, wanted: Mapping[str, Any]) -> Spec:
    """Put the machine asked for into the spec of a case, whose files lie in a folder."""
    machine = {key: value for key, value in wanted.items() if key.startswith(MACHINE)}
    return case_spec(folder, row, case, overrides(machine))
