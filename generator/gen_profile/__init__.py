"""Design motion profiles that leave no sway, and prove it.

The names here are the front door for Python. Each is loaded when it is first asked for (PEP 562), so that
importing the package costs next to nothing. Everything else in the package may move.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gen_profile.certificate.from_file import certify_artefact as certify_artefact
    from gen_profile.certificate.from_file import check_certificate as check_certificate
    from gen_profile.charts.plot import plot as plot
    from gen_profile.comparison.compare import compare as compare
    from gen_profile.comparison.robustness import robustness as robustness
    from gen_profile.designs.design import Design as Design
    from gen_profile.designs.design import design as design
    from gen_profile.designs.fmu import export_fmu as export_fmu
    from gen_profile.designs.plan import plan as plan
    from gen_profile.designs.planner import deploy_planner as deploy_planner
    from gen_profile.errors import CertificateError as CertificateError
    from gen_profile.errors import CheckFailed as CheckFailed
    from gen_profile.errors import CosimulationError as CosimulationError
    from gen_profile.errors import ExportError as ExportError
    from gen_profile.errors import GenProfileError as GenProfileError
    from gen_profile.errors import InfeasibleProblem as InfeasibleProblem
    from gen_profile.errors import LimitViolation as LimitViolation
    from gen_profile.errors import NoMotion as NoMotion
    from gen_profile.errors import OutputError as OutputError
    from gen_profile.errors import SolverDiverged as SolverDiverged
    from gen_profile.errors import SpecError as SpecError
    from gen_profile.evaluation.motion_evaluation import evaluate as evaluate
    from gen_profile.identification.identify import identify as identify
    from gen_profile.identification.identify import read_swing as read_swing
    from gen_profile.identification.measurements import parse_period as parse_period
    from gen_profile.identification.measurements import parse_reading as parse_reading
    from gen_profile.motion.profile import Profile as Profile
    from gen_profile.motion.profile import SampledProfile as SampledProfile
    from gen_profile.motion.profile import sample as sample
    from gen_profile.planner.planner import Planner as Planner
    from gen_profile.problem.linearization import linearize as linearize
    from gen_profile.spec.model import Spec as Spec
    from gen_profile.spec.reading import evolve_spec as evolve_spec
    from gen_profile.spec.reading import make_spec as make_spec
    from gen_profile.spec.reading import parse_spec as parse_spec
    from gen_profile.spec.reading import preset_spec as preset_spec
    from gen_profile.spec.reading import presets as presets
    from gen_profile.spec.reading import read_spec as read_spec
    from gen_profile.sweep.from_python import run_sweep as run_sweep
    from gen_profile.sweep.library import write_library as write_library
    from gen_profile.sweep.lookup import lookup as lookup
    from gen_profile.verification.check import check_artefact as check_artefact
    from gen_profile.verification.from_python import cosimulate as cosimulate
    from gen_profile.verification.from_python import residual_sways as residual_sways

_NAMES = {
    "errors": "CertificateError CheckFailed CosimulationError ExportError GenProfileError InfeasibleProblem "
    "LimitViolation NoMotion OutputError SolverDiverged SpecError",
    "certificate.from_file": "certify_artefact check_certificate",
    "charts.plot": "plot",
    "comparison.compare": "compare",
    "comparison.robustness": "robustness",
    "designs.design": "Design design",
    "designs.fmu": "export_fmu",
    "designs.plan": "plan",
    "designs.planner": "deploy_planner",
    "evaluation.motion_evaluation": "evaluate",
    "identification.identify": "identify read_swing",
    "identification.measurements": "parse_period parse_reading",
    "motion.profile": "Profile SampledProfile sample",
    "planner.planner": "Planner",
    "problem.linearization": "linearize",
    "spec.model": "Spec",
    "spec.reading": "evolve_spec make_spec parse_spec preset_spec presets read_spec",
    "sweep.from_python": "run_sweep",
    "sweep.library": "write_library",
    "sweep.lookup": "lookup",
    "verification.check": "check_artefact",
    "verification.from_python": "cosimulate residual_sways",
}  # by module
_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name == "__version__":
        return import_module("importlib.metadata").version("gen-profile")
    if name not in _HOMES:
        raise AttributeError(f"module 'gen_profile' has no attribute {name!r}")
    value = getattr(import_module(f"gen_profile.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names."""
    return sorted([*_HOMES, "__version__"])
