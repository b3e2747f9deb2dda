"""The tree of errors, and the exit codes that scripts rely on."""

import inspect

import pytest

from gen_profile import errors
from gen_profile.errors import GenProfileError, SpecError

EXIT_CODES = {
    "GenProfileError": 1,
    "SpecError": 2,
    "OutputError": 2,
    "InfeasibleProblem": 3,
    "SolverDiverged": 3,
    "LimitViolation": 3,
    "CertificateError": 4,
    "CheckFailed": 4,
    "CosimulationError": 4,
    "ExportError": 5,
    "StreamAborted": 6,
}


def test_every_error_has_its_exit_code():
    tree = dict(inspect.getmembers(errors, inspect.isclass))
    tree = {name: error for name, error in tree.items() if issubclass(error, GenProfileError)}
    assert {name: error.exit_code for name, error in tree.items()} == EXIT_CODES


@pytest.mark.parametrize(("name", "code"), list(EXIT_CODES.items())[1:])
def test_the_module_draws_the_tree_as_it_is(name, code):
    assert any(line.split()[1:3] == [name, str(code)] for line in errors.__doc__.splitlines() if "──" in line)


def test_a_specs_faults_are_lines():
    error = SpecError("plant.m1: must be positive.", "move: required.")
    assert error.faults == ("plant.m1: must be positive.", "move: required.")
    assert str(error) == "plant.m1: must be positive.\nmove: required."
