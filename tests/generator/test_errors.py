"""The tree of errors, and the exit codes that scripts rely on."""

import inspect
import pickle

import pytest

from gen_profile.support import errors
from gen_profile.support.errors import Code, GenProfileError, InfeasibleProblem, Reason, SpecError, Suggestion
from gen_profile.support.phrase import plain

EXIT_CODES = {
    "GenProfileError": 1,
    "SpecError": 2,
    "OutputError": 2,
    "UnknownProgram": 2,
    "NoMotion": 3,
    "InfeasibleProblem": 3,
    "SolverDiverged": 3,
    "LimitViolation": 3,
    "CertificateError": 4,
    "CheckFailed": 4,
    "CosimulationError": 4,
    "ExportError": 5,
    "StreamAborted": 6,
    "DeploymentError": 6,
}


def test_every_error_has_its_exit_code():
    tree = dict(inspect.getmembers(errors, inspect.isclass))
    tree = {name: error for name, error in tree.items() if issubclass(error, GenProfileError)}
    assert {name: error.exit_code for name, error in tree.items()} == EXIT_CODES


@pytest.mark.parametrize(("name", "code"), list(EXIT_CODES.items())[1:])
def test_the_module_draws_the_tree_as_it_is(name, code):
    drawn = [line.partition("── ")[2].split()[:2] for line in errors.__doc__.splitlines()]
    assert [name, str(code)] in drawn


def test_a_specs_faults_are_lines():
    error = SpecError("plant.m1: must be positive.", "move: required.")
    assert error.faults == ("plant.m1: must be positive.", "move: required.")
    assert str(error) == "plant.m1: must be positive.\nmove: required."


def test_errors_are_the_same_in_another_process():
    reason = Reason(code=Code.LIMIT_BROKEN, place="limits.jerk", found=2.0, allowed=1.0)
    suggestion = Suggestion(values={"limits.jerk": 2.5, "robustness.order": 1}, spec=None, fraction=0.5)
    template = "{one.place}: {found:.1f} and {text!r}"
    error = InfeasibleProblem(
        template, one=reason, found=2.0, text="{x}", reasons=[reason], suggestions=[suggestion]
    )
    again = pickle.loads(pickle.dumps(error))
    assert (
        str(again)
        == str(error)
        == "limits.jerk: 2.0 and '{x}' It can be done with limits.jerk = 2.5, robustness.order = 1."
    )
    assert again.reasons == error.reasons
    assert plain(again.sentences[0]) == {
        "template": template,
        "values": {"one.place": "limits.jerk", "found": "2.0", "text": "'{x}'"},
    }
