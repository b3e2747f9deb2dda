"""Every error a user can meet, and the exit code each one ends in.

::

    GenProfileError
    ├── SpecError            2   the spec, or the way it was asked for
    ├── OutputError          2   the output folder or a file cannot be read or written
    │   └── UnknownProgram     2   what was received would run a program that the user has not let run
    ├── NoMotion             3   there is no motion for the spec
    │   ├── InfeasibleProblem  3   no such motion exists
    │   ├── SolverDiverged     3   the solver found none
    │   └── LimitViolation     3   the motion found breaks a limit of the spec
    ├── CheckFailed          4   the written artefact leaves too much sway
    ├── CosimulationError    4   the check itself could not be carried out
    ├── CertificateError     4   a certificate cannot be made, or does not hold
    ├── ExportError          5   the target cannot take the motion
    ├── StreamAborted        6   streaming was stopped
    └── DeploymentError      6   a table did not get into a controller, which uses the one that it had

A message is one or more whole sentences: what is wrong, where (a spec path such as ``limits.jerk``, or a
file and line), and what to do about it. Why there is no motion stands in values, too: by reasons, each with
a code, and by suggestions that were tried.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from gen_profile.support.phrase import OR_WITH, Phrase, joined


class GenProfileError(Exception):
    """Root of the tree; raised itself only for a broken invariant, which is a bug.

    Parameters
    ----------
    sentences : str
    values
        Of a single sentence, which is then a template, as `gen_profile.support.phrase.Phrase` takes them.

    Examples
    --------
    >>> try:
    ...     gp.plan("nowhere.toml")
    ... except gp.GenProfileError as error:  # whatever was wrong with what was asked
    ...     print(type(error).__name__)
    OutputError
    """

    exit_code: ClassVar[int] = 1

    def __init__(self, *sentences: str, **values: Any) -> None:
        super().__init__(*([Phrase(sentences[0], **values)] if values else sentences))

    def __str__(self) -> str:
        """Join the sentences."""
        return "\n".join(self.sentences)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is wrong, and what to do about it."""
        return self.args


class SpecError(GenProfileError):
    """One or more faults of a spec, all of them at once.

    Parameters
    ----------
    faults : str
        One sentence each, every one beginning with the place (``plant.m1: must be positive …``).

    Examples
    --------
    >>> gp.preset_spec("paper", move={"duration": -1.0})
    Traceback (most recent call last):
    gen_profile.support.errors.SpecError: move.duration: must be at least 0.001 ...
    """

    exit_code = 2

    @property
    def faults(self) -> tuple[str, ...]:
        """One sentence each."""
        return self.sentences


class OutputError(GenProfileError):
    """A file or folder cannot be read or written.

    Examples
    --------
    >>> gp.read_spec("nowhere.toml")
    Traceback (most recent call last):
    gen_profile.support.errors.OutputError: ...
    """

    exit_code = 2


class UnknownProgram(OutputError):
    """What was received names programs that would run with the user's rights, which he has not let run yet.

    Attributes
    ----------
    programs : mapping of Path to str
        Their SHA-256.
    """

    def __init__(self, *sentences: str, programs: Mapping[Path, str]) -> None:
        self.programs = programs
        super().__init__(*sentences)

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep the programs where it goes to another process."""
        return partial(UnknownProgram, programs=self.programs), self.args


class Code(StrEnum):
    """What may be in the way of a motion: a closed list."""

    INFEASIBLE = "infeasible"  # no motion meets the end conditions within the limits
    SWINGS_TOO_FAR = "swings_too_far"  # a load would have to
    NOT_CONTROLLABLE = "not_controllable"  # a part of the machine swings on, whatever the axes do
    DIVERGED = "diverged"  # the solver found none
    GIVEN_UP = "given_up"  # the search took too long
    LIMIT_BROKEN = "limit_broken"  # the motion found needs more than a limit allows
    TOO_SHORT = "too_short"  # the method takes longer
    NOT_AT_REST = "not_at_rest"  # the method moves from rest to rest only
    RESIDUAL_SWAY = "residual_sway"  # no duration leaves so little


class Reason(NamedTuple):
    """Why there is no motion.

    Attributes
    ----------
    code : Code
    place : str
        Key of the spec that is in the way, where one alone is.
    found, allowed : float or None
        What the motion needs, or the spec states, and what may be, in the spec's units.
    """

    code: Code
    place: str = ""
    found: float | None = None
    allowed: float | None = None


class Suggestion(NamedTuple):
    """Values with which a motion was found, and tried on all machines of the ranges.

    Attributes
    ----------
    values : mapping of str to value
        By their places in the spec, such as ``{"move.duration": 3.16}``.
    spec : Spec
        With these values.
    fraction : float
        Of the limit of residual sway that the worst machine takes up then.
    passes : bool
        Whether the check is to pass.
    """

    values: Mapping[str, Any]
    spec: Any  # a Spec, of which this module knows nothing
    fraction: float
    passes: bool = True

    def __str__(self) -> str:
        """Write the values as overrides of a spec."""
        return ", ".join(f"{place} = {_written(value)}" for place, value in self.values.items())

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON; see the command-line contract."""
        return {"values": dict(self.values), "share": self.fraction, "passes": self.passes}


def rounded_up(value: float, digits: int = 3) -> float:
    """Keep some digits of a number that is not negative, rounded up: what is called enough must be enough."""
    if value == 0.0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{math.ceil(value / unit) * unit:.{digits}g}")


def rounded_down(value: float, digits: int = 3) -> float:
    """Keep some digits of a positive number, rounded down: what is called few enough must be."""
    unit = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    return float(f"{math.floor(value / unit) * unit:.{digits}g}")


def _written(value: Any) -> str:
    """Write a value as TOML."""
    if isinstance(value, str):
        return f'"{value}"'
    return f"{value:.9g}" if isinstance(value, int | float) else f"[{', '.join(map(_written, value))}]"


class NoMotion(GenProfileError):
    """There is no motion for a spec.

    Parameters
    ----------
    sentences : str
    reasons : iterable of Reason
    suggestions : iterable of Suggestion
        Each by itself gives a motion; those come first that the check is to pass.

    Examples
    --------
    >>> try:
    ...     gp.plan(gp.preset_spec("paper", ["solver.method=zvd"], limits={"velocity": 0.2}))
    ... except gp.NoMotion as error:
    ...     print(error.reasons[0])
    Reason(...place='limits.velocity', found=0.2436..., allowed=0.2)
    """

    exit_code = 3

    def __init__(
        self,
        *sentences: str,
        reasons: Iterable[Reason] = (),
        suggestions: Iterable[Suggestion] = (),
        **values: Any,
    ) -> None:
        super().__init__(*sentences, **values)
        self.reasons, self.suggestions = tuple(reasons), tuple(suggestions)

    def __str__(self) -> str:
        """Tell all in a row."""
        return " ".join(self.sentences)

    @property
    def sentences(self) -> tuple[str, ...]:
        """Why there is no motion, and what would help."""
        return (*super().sentences, *_suggested(self.suggestions))

    @property
    def least_duration(self) -> float | None:
        """Of the move in s, where the method is known to take that long."""
        return next((one.allowed for one in self.reasons if one.code is Code.TOO_SHORT), None)

    def to_dict(self) -> dict[str, Any]:
        """Nest plain values for JSON; see the command-line contract."""
        return {
            "reasons": [reason._asdict() for reason in self.reasons],
            "suggestions": [suggestion.to_dict() for suggestion in self.suggestions],
        }


def _suggested(suggestions: Sequence[Suggestion]) -> Iterator[str]:
    """Put suggestions into words."""
    if passing := [str(one) for one in suggestions if one.passes]:
        yield Phrase("It can be done with {changes}.", changes=joined(OR_WITH, passing))
    if others := [one for one in suggestions if not one.passes]:
        template = "{change} ({times:.2g} times the residual sway allowed)"
        changes = [Phrase(template, change=str(one), times=one.fraction) for one in others]
        yield Phrase(
            "With {changes} there is a motion, but the check will not pass.", changes=joined(OR_WITH, changes)
        )


class InfeasibleProblem(NoMotion):
    """No motion meets the requirements.

    Examples
    --------
    >>> try:
    ...     gp.plan(gp.preset_spec("paper", limits={"acceleration": 0.2}))
    ... except gp.InfeasibleProblem as error:
    ...     print(error.suggestions[0].values)
    {'move.duration': ...}
    """


class SolverDiverged(NoMotion):
    """The solver did not find a motion.

    Examples
    --------
    >>> issubclass(gp.SolverDiverged, gp.NoMotion)  # so that ``except gp.NoMotion`` takes it, too
    True
    """


class LimitViolation(NoMotion):
    """The motion found breaks a limit.

    Examples
    --------
    >>> issubclass(gp.LimitViolation, gp.NoMotion)  # so that ``except gp.NoMotion`` takes it, too
    True
    """


class CheckFailed(GenProfileError):
    """The artefact, replayed on the plant FMU, leaves more sway than allowed.

    Examples
    --------
    >>> spec = gp.preset_spec("paper", ["robustness.method=none"])
    >>> loose = gp.design(spec, "csv", "unsafe", keep_failed=True)
    >>> loose.check.raise_for_failure()
    Traceback (most recent call last):
    gen_profile.support.errors.CheckFailed: ...
    """

    exit_code = 4


class CosimulationError(GenProfileError):
    """The plant FMU could not be built, loaded or stepped.

    Examples
    --------
    >>> issubclass(gp.CosimulationError, gp.GenProfileError)
    True
    """

    exit_code = 4


class CertificateError(GenProfileError):
    """A proof cannot be carried out, or a certificate does not prove what it says.

    Examples
    --------
    >>> gp.check_certificate("deploy/paper.csv", "deploy/manifest.json")
    Traceback (most recent call last):
    gen_profile.support.errors.CertificateError: ...
    """

    exit_code = 4


class ExportError(GenProfileError):
    r"""The target format cannot take the motion, or an artefact cannot be read back.

    Examples
    --------
    >>> with open("damaged.csv", "w") as file:
    ...     _ = file.write("time_s,position_m\n0.0,none\n")
    >>> gp.check_artefact("damaged.csv", gp.preset_spec("paper"))
    Traceback (most recent call last):
    gen_profile.support.errors.ExportError: ...
    """

    exit_code = 5


class StreamAborted(GenProfileError):
    """A stream of setpoints was stopped before its end."""

    exit_code = 6


class DeploymentError(GenProfileError):
    """A table did not get into a controller."""

    exit_code = 6
