"""One case of a sweep, from its values to a record and files, on whatever computer a worker runs.

Nothing is shared with the workers but the program: what a case needs comes with it, and what comes of it goes
back as bytes.
"""

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import attrs

from gen_profile.assurance.verification.batch import on_processors
from gen_profile.assurance.verification.verdict import Check
from gen_profile.delivery.designs.design import Design, design_in_memory
from gen_profile.spec.model import Spec
from gen_profile.spec.reading import parse_spec
from gen_profile.studies.sweep.grid import overrides
from gen_profile.support import errors
from gen_profile.support.cluster import require_versions
from gen_profile.support.one_thread import one_thread

_ALONE = threading.Lock()  # compiled FMUs hold global state, and a Dask worker may have several threads
EVERY = 50  # case is co-simulated by FMPy, too, which must agree with the compiled loop
PASSED, CHECK_FAILED, CRASHED = "passed", "check failed", "crashed"
STATUSES: dict[type[errors.GenProfileError], str] = {
    errors.SpecError: "faulty spec",
    errors.InfeasibleProblem: "infeasible",
    errors.SolverDiverged: "diverged",
    errors.LimitViolation: "limit broken",
    errors.ExportError: "not exportable",
    errors.CosimulationError: "not simulated",
}


@attrs.frozen(kw_only=True)
class Recipe:
    """What all cases of a sweep have in common.

    Attributes
    ----------
    text : str
        TOML of the spec.
    overrides : tuple of str
        Of the spec, the same for every case.
    source : str
        Where the text comes from, for errors.
    folder : str
        What files that the spec names are relative to; workers must find them there, too.
    formats : tuple of str
        To export.
    versions : tuple of (str, str)
        Of the libraries that shape the numbers.
    """

    text: str
    overrides: tuple[str, ...]
    source: str
    folder: str
    formats: tuple[str, ...]
    versions: tuple[tuple[str, str], ...]

    def spec(self, values: Mapping[str, Any]) -> Spec:
        """Read the spec of a case.

        Raises
        ------
        SpecError
        """
        return parse_spec(self.text, (*self.overrides, *overrides(values)), self.source, Path(self.folder))


@attrs.frozen(kw_only=True)
class CaseOutcome:
    """What came of a case.

    Attributes
    ----------
    record : dict
        Plain values: the case's row of the table. It tells of no clock and no computer.
    files : dict of str to bytes
        Artefacts with their manifest; none where the case failed.
    """

    record: dict[str, Any]
    files: dict[str, bytes]

    @property
    def passed(self) -> bool:
        """Whether the case may be used."""
        return bool(self.record["status"] == PASSED)


def run_cases(recipe: Recipe, cases: Mapping[int, Mapping[str, Any]]) -> list[CaseOutcome]:
    """Work out cases, each given by its number and the values of the keys varied; raises as `run_case`."""
    return [run_case(recipe, case, values) for case, values in cases.items()]


def run_case(recipe: Recipe, case: int, values: Mapping[str, Any]) -> CaseOutcome:
    """Design, export and check one case; whatever is wrong with it becomes its record.

    Parameters
    ----------
    recipe : Recipe
    case : int
    values : mapping
        Of the keys varied.

    Raises
    ------
    SpecError
        This computer has other versions than the recipe asks for.
    """
    require_versions(recipe.versions, "this sweep")
    try:
        with _ALONE, one_thread, on_processors(1):
            outcome, files = design_in_memory(recipe.spec(values), recipe.formats, by_fmpy=case % EVERY == 0)
        return CaseOutcome(record=_record(case, values, outcome), files=files)
    except errors.GenProfileError as error:
        return failed(case, values, STATUSES.get(type(error), CRASHED), str(error))
    except Exception as error:
        return failed(case, values, CRASHED, f"Internal error ({type(error).__name__}: {error}).")


def failed(case: int, values: Mapping[str, Any], status: str, reason: str) -> CaseOutcome:
    """Record a case of which nothing came."""
    record = {"case": case, "values": dict(values), "status": status, "reason": reason}
    return CaseOutcome(record=record, files={})


def _record(case: int, values: Mapping[str, Any], outcome: Design) -> dict[str, Any]:
    document, check = outcome.to_dict(), cast("Check", outcome.check)  # it was asked for
    load, finding = check.worst
    solver = {
        key: ", ".join(value) if isinstance(value, list) else value
        for key, value in document["solver"].items()
        if key not in {"status", "time_s"}  # the one is stated before, and the other differs every time
    }
    return {
        "case": case,
        "values": dict(values),
        "status": PASSED if check.passed else CHECK_FAILED,
        "reason": " ".join(check.reasons()),
        "spec_sha256": document["spec_sha256"],
        "profile_sha256": outcome.plan.evaluation.command.payload_hash(),
        "solver": solver,
        "figures": document["figures"],
        "check": {
            "worst_load": load,
            "worst_scenario": finding.scenario.name,
            "worst_sway_m": finding.residual[load],
            "limit_m": check.limit[load],
            "error_bound_m": check.error_bound,
            "arrival_s": check.arrival,
        },
        "artefacts": [attrs.asdict(artefact) for artefact in outcome.artefacts],
    }
