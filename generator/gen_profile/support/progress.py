"""What long work reports of its progress."""

from typing import Protocol

from gen_profile.support.errors import SpecError
from gen_profile.support.suggestion import found


class Progress(Protocol):
    """Told what is being done, as often as it likes."""

    def __call__(self, stage: str, done: int = 0, total: int = 0, remark: str = "") -> None:
        """Take the stage, how many of its steps are done, of how many if that is known, and a remark."""


def no_progress(stage: str, done: int = 0, total: int = 0, remark: str = "") -> None:
    """Report nothing."""


def require_progress(progress: object) -> None:
    """Refuse, by a `SpecError`, what takes no report."""
    if not callable(progress):
        raise SpecError(f"progress: must be a function, found {found(progress)}.")
