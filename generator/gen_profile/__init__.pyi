"""The public names and their modules, for type checkers and for loading each when it is first asked for."""

from .api.certificates import certify_artefact as certify_artefact
from .api.certificates import check_certificate as check_certificate
from .api.checks import check_artefact as check_artefact
from .api.comparisons import compare as compare
from .api.comparisons import robustness as robustness
from .api.cosimulation import cosimulate as cosimulate
from .api.cosimulation import residual_sways as residual_sways
from .api.designs import design as design
from .api.fmu import export_fmu as export_fmu
from .api.measurements import identify as identify
from .api.measurements import parse_period as parse_period
from .api.measurements import parse_reading as parse_reading
from .api.measurements import read_swing as read_swing
from .api.motions import evaluate as evaluate
from .api.motions import linearize as linearize
from .api.motions import plan as plan
from .api.pictures import plot as plot
from .api.planner import deploy_planner as deploy_planner
from .api.sweeps import lookup as lookup
from .api.sweeps import run_sweep as run_sweep
from .api.sweeps import write_library as write_library
from .delivery.designs.design import Design as Design
from .motion.profile import Profile as Profile
from .motion.profile import SampledProfile as SampledProfile
from .motion.profile import sample as sample
from .planner.planner import Planner as Planner
from .spec.model import Spec as Spec
from .spec.reading import evolve_spec as evolve_spec
from .spec.reading import make_spec as make_spec
from .spec.reading import parse_spec as parse_spec
from .spec.reading import preset_spec as preset_spec
from .spec.reading import presets as presets
from .spec.reading import read_spec as read_spec
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
