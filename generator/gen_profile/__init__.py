"""Design motion profiles that leave no sway, and prove it.

The names here are the front door for Python. Each is loaded when it is first asked for (PEP 562), so that
importing the package costs next to nothing. Everything else in the package may move.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gen_profile.charts.plot import plot as plot
    from gen_profile.comparison.compare import compare as compare
    from gen_profile.comparison.robustness import robustness as robustness
    from gen_profile.designs.design import Design as Design
    from gen_profile.designs.design import design as design
    from gen_profile.designs.fmu import export_fmu as export_fmu
    from gen_profile.designs.plan import plan as plan
    from gen_profile.designs.planner import deploy_planner as deploy_planner
    from gen_profile.errors import CheckFailed as CheckFailed
    from gen_profile.errors import CosimulationError as CosimulationError
    from gen_profile.errors import ExportError as ExportError
    from gen_profile.errors import GenProfileError as GenProfileError
    from gen_profile.errors import InfeasibleProblem as InfeasibleProblem
    from gen_profile.errors import LimitViolation as LimitViolation
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

_HOMES = {
    "CheckFailed": "errors",
    "CosimulationError": "errors",
    "Design": "designs.design",
    "ExportError": "errors",
    "GenProfileError": "errors",
    "InfeasibleProblem": "errors",
    "LimitViolation": "errors",
    "OutputError": "errors",
    "Planner": "planner.planner",
    "Profile": "motion.profile",
    "SampledProfile": "motion.profile",
    "SolverDiverged": "errors",
    "Spec": "spec.model",
    "SpecError": "errors",
    "check_artefact": "verification.check",
    "compare": "comparison.compare",
    "cosimulate": "verification.from_python",
    "deploy_planner": "designs.planner",
    "design": "designs.design",
    "evaluate": "evaluation.motion_evaluation",
    "evolve_spec": "spec.reading",
    "export_fmu": "designs.fmu",
    "identify": "identification.identify",
    "linearize": "problem.linearization",
    "lookup": "sweep.lookup",
    "make_spec": "spec.reading",
    "parse_period": "identification.measurements",
    "parse_reading": "identification.measurements",
    "parse_spec": "spec.reading",
    "plan": "designs.plan",
    "plot": "charts.plot",
    "preset_spec": "spec.reading",
    "presets": "spec.reading",
    "read_spec": "spec.reading",
    "read_swing": "identification.identify",
    "residual_sways": "verification.from_python",
    "robustness": "comparison.robustness",
    "run_sweep": "sweep.from_python",
    "sample": "motion.profile",
    "write_library": "sweep.library",
}


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
