"""What other distributions bring along by entry points."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from typing import TypeVar

from gen_profile.errors import SpecError

CURE = "update or uninstall the package that provides it."

Kind = TypeVar("Kind")


def load_plugin(entry: EntryPoint, kind: type[Kind], where: str) -> Kind:
    """Load what an entry point names, which must be of a kind.

    Parameters
    ----------
    entry : EntryPoint
    kind : type
    where : str
        Begins the sentences: where it was asked for.

    Raises
    ------
    SpecError
        It cannot be loaded, or is something else.
    """
    try:
        found = entry.load()
    except Exception as error:
        raise SpecError(
            f"{where} {entry.name!r} cannot be loaded from {entry.value} ({error}); {CURE}"
        ) from error
    if not isinstance(found, kind):
        raise SpecError(
            f"{where} {entry.name!r}: {entry.value} is no {kind.__module__}.{kind.__qualname__}; {CURE}"
        )
    return found
