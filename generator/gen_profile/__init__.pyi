"""The public names and their modules, for type checkers and for loading each when it is first asked for."""

from .certificate.from_file import certify_artefact as certify_artefact
from .certificate.from_file import check_certificate as check_certificate
from .charts.plot import plot as plot
from .comparison.compare import compare as compare
from .comparison.robustness import robustness as robustness
from .designs.design import Design as Design
from .designs.design import design as design
from .designs.fmu import export_fmu as export_fmu
from .designs.planner import deploy_planner as deploy_planner
from .errors import CertificateError as CertificateError
from .errors import CheckFailed as CheckFailed
from .errors import CosimulationError as CosimulationError
from .errors import ExportError as ExportError
from .errors import GenProfileError as GenProfileError
from .errors import InfeasibleProblem as InfeasibleProblem
from .errors import LimitViolation as LimitViolation
from .errors import NoMotion as NoMotion
from .errors import OutputError as OutputError
from .errors import SolverDiverged as SolverDiverged
from .errors import SpecError as SpecError
from .evaluation.motion_evaluation import evaluate as evaluate
from .identification.identify import identify as identify
from .identification.identify import read_swing as read_swing
from .identification.measurements import parse_period as parse_period
from .identification.measurements import parse_reading as parse_reading
from .motion.profile import Profile as Profile
from .motion.profile import SampledProfile as SampledProfile
from .motion.profile import sample as sample
from .planner.planner import Planner as Planner
from .problem.linearization import linearize as linearize
from .solvers.plan import plan as plan
from .spec.model import Spec as Spec
from .spec.reading import evolve_spec as evolve_spec
from .spec.reading import make_spec as make_spec
from .spec.reading import parse_spec as parse_spec
from .spec.reading import preset_spec as preset_spec
from .spec.reading import presets as presets
from .spec.reading import read_spec as read_spec
from .sweep.library import write_library as write_library
from .sweep.lookup import lookup as lookup
from .sweep.run import run_sweep as run_sweep
from .verification.check import check_artefact as check_artefact
from .verification.from_python import cosimulate as cosimulate
from .verification.from_python import residual_sways as residual_sways

__version__: str
