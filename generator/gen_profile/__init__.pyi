"""The public names and their modules, for type checkers and for loading each when it is first asked for."""

from .assurance.certificate.from_file import certify_artefact as certify_artefact
from .assurance.certificate.from_file import check_certificate as check_certificate
from .assurance.verification.check import check_artefact as check_artefact
from .assurance.verification.from_python import cosimulate as cosimulate
from .assurance.verification.from_python import residual_sways as residual_sways
from .delivery.designs.design import Design as Design
from .delivery.designs.design import design as design
from .delivery.designs.fmu import export_fmu as export_fmu
from .delivery.designs.planner import deploy_planner as deploy_planner
from .dynamics.evaluation.motion_evaluation import evaluate as evaluate
from .dynamics.problem.linearization import linearize as linearize
from .methods.solvers.plan import plan as plan
from .motion.profile import Profile as Profile
from .motion.profile import SampledProfile as SampledProfile
from .motion.profile import sample as sample
from .planner.planner import Planner as Planner
from .presentation.charts.plot import plot as plot
from .spec.model import Spec as Spec
from .spec.reading import evolve_spec as evolve_spec
from .spec.reading import make_spec as make_spec
from .spec.reading import parse_spec as parse_spec
from .spec.reading import preset_spec as preset_spec
from .spec.reading import presets as presets
from .spec.reading import read_spec as read_spec
from .studies.comparison.compare import compare as compare
from .studies.comparison.robustness import robustness as robustness
from .studies.identification.identify import identify as identify
from .studies.identification.identify import read_swing as read_swing
from .studies.identification.measurements import parse_period as parse_period
from .studies.identification.measurements import parse_reading as parse_reading
from .studies.sweep.library import write_library as write_library
from .studies.sweep.lookup import lookup as lookup
from .studies.sweep.run import run_sweep as run_sweep
from .support.errors import CertificateError as CertificateError
from .support.errors import CheckFailed as CheckFailed
from .support.errors import CosimulationError as CosimulationError
from .support.errors import ExportError as ExportError
from .support.errors import GenProfileError as GenProfileError
from .support.errors import InfeasibleProblem as InfeasibleProblem
from .support.errors import LimitViolation as LimitViolation
from .support.errors import NoMotion as NoMotion
from .support.errors import OutputError as OutputError
from .support.errors import SolverDiverged as SolverDiverged
from .support.errors import SpecError as SpecError

__version__: str
