"""Every error a user can meet, and the exit code each one ends in.

::

    GenProfileError
    ├── SpecError            2   the spec, or the way it was asked for
    ├── OutputError          2   the output folder or a file cannot be read or written
    ├── InfeasibleProblem    3   no such motion exists
    ├── SolverDiverged       3   the solver found none
    ├── LimitViolation       3   the motion found breaks a limit of the spec
    ├── CheckFailed          4   the written artefact leaves too much sway
    ├── CosimulationError    4   the check itself could not be carried out
    ├── CertificateError     4   a certificate cannot be made, or does not hold
    ├── ExportError          5   the target cannot take the motion
    └── StreamAborted        6   streaming was stopped

A message is one or more whole sentences: what is wrong, where (a spec path such as ``limits.jerk``, or a
file and line), and what to do about it.
"""

from __future__ import annotations

from typing import ClassVar


class GenProfileError(Exception):
    """Root of the tree; raised itself only for a broken invariant, which is a bug."""

    exit_code: ClassVar[int] = 1


class SpecError(GenProfileError):
    """One or more faults of a spec, all of them at once.

    Parameters
    ----------
    faults : str
        One sentence each, every one beginning with the place (``plant.m1: must be positive …``).
    """

    exit_code = 2

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


class OutputError(GenProfileError):
    """A file or folder cannot be read or written."""

    exit_code = 2


class InfeasibleProblem(GenProfileError):
    """No motion meets the requirements.

    Parameters
    ----------
    sentences : str
    duration : float, optional
        s, which the move takes at least, where that alone is in the way.
    """

    exit_code = 3

    def __init__(self, sentences: str, *, duration: float | None = None) -> None:
        super().__init__(sentences)
        self.duration = duration


class SolverDiverged(GenProfileError):
    """The solver did not find a motion."""

    exit_code = 3


class LimitViolation(GenProfileError):
    """The motion found breaks a limit."""

    exit_code = 3


class CheckFailed(GenProfileError):
    """The artefact, replayed on the plant FMU, leaves more sway than allowed."""

    exit_code = 4


class CosimulationError(GenProfileError):
    """The plant FMU could not be built, loaded or stepped."""

    exit_code = 4


class CertificateError(GenProfileError):
    """A proof cannot be carried out, or a certificate does not prove what it says."""

    exit_code = 4


class ExportError(GenProfileError):
    """The target format cannot take the motion, or an artefact cannot be read back."""

    exit_code = 5


class StreamAborted(GenProfileError):
    """A stream of setpoints was stopped before its end."""

    exit_code = 6
