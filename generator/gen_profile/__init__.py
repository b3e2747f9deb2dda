"""Design motion profiles that leave no sway, and prove it.

The names in `__init__.pyi` are the front door for Python. Each is loaded when first asked for (SPEC 1 of
scientific-python.org), so that importing the package costs next to nothing. Everything else may move.
"""

from importlib import import_module
from typing import Any

import lazy_loader

_attribute, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name == "__version__":
        return import_module("importlib.metadata").version("gen-profile")
    return _attribute(name)


def __dir__() -> list[str]:
    """List the public names."""
    return sorted([*_names(), "__version__"])
