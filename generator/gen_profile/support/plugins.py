"""What other distributions bring along: by entry points, and libraries that extras need."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, TypeVar

from gen_profile.support.errors import OutputError, SpecError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint  # which takes an eighth of what --help does

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
        plugin = entry.load()
    except Exception as error:
        raise SpecError(
            f"{where} {entry.name!r} cannot be loaded from {entry.value} ({error}); {CURE}"
        ) from error
    if not isinstance(plugin, kind):
        raise SpecError(
            f"{where} {entry.name!r}: {entry.value} is no {kind.__module__}.{kind.__qualname__}; {CURE}"
        )
    return plugin


def require_installed(what: str, extra: str, *modules: str) -> None:
    """Refuse what takes libraries that are not installed.

    Parameters
    ----------
    what : str
        Begins the sentence, such as ``"Streaming needs canopen"``.
    extra : str
        Of this distribution, that brings them.
    modules : str

    Raises
    ------
    OutputError
        With the command that installs what is missing.
    """
    if any(find_spec(module) is None for module in modules):
        raise OutputError(f"{what}: pip install 'gen-profile[{extra}]'.")
