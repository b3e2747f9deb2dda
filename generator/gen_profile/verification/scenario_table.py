"""All scenarios of a check as a table on disk, with what each of them was given and left."""

import csv
from collections.abc import Iterator
from io import StringIO

import attrs

from gen_profile.spec.disturbances import PathSpec
from gen_profile.spec.model import Spec
from gen_profile.verification.setpoint_path import lag_of, path_taken
from gen_profile.verification.verdict import Check, Finding

PATH = tuple(field.name for field in attrs.fields(PathSpec))


def table(spec: Spec, check: Check) -> str:
    """Write a row per scenario, numbers as exactly as they were calculated.

    Columns are the scenario's number, group and name; the machine's parameters (``plant.L1`` …) and the path
    of its setpoints (``path.lag`` …), in the spec's units; the residual sway of every load in m, the bound of
    its error in m, and whether the limits are kept: ``passed`` or ``failed``.

    Parameters
    ----------
    spec : Spec
    check : Check
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    parameters = (f"plant.{name}" for name in spec.plant.parameters)
    loads = (f"{load}_m" for load in check.limit)
    path = (f"path.{name}" for name in PATH)
    writer.writerow(["row", "group", "name", *parameters, *path, *loads, "error_bound_m", "verdict"])
    by_group = (finding for findings in check.groups.values() for finding in findings)
    writer.writerows([*_cells(spec, check, finding)] for finding in by_group)
    return text.getvalue()


def _cells(spec: Spec, check: Check, finding: Finding) -> Iterator[object]:
    scenario = finding.scenario
    path = attrs.asdict(path_taken(spec, scenario)) | {"lag": lag_of(spec, scenario)}
    yield from (scenario.row, scenario.group, scenario.name)
    yield from (scenario.parameters[name] for name in spec.plant.parameters)
    yield from (path[name] for name in PATH)
    yield from (finding.residual[load] for load in check.limit)
    yield check.error_bound
    yield "passed" if check.keeps_limit(finding) else "failed"
