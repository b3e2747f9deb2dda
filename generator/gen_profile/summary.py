"""Results as one line in a terminal, and as a small table in a notebook."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape


class Summarised:
    """Print what matters of a value, not all its arrays; attrs classes take it with ``repr=False``."""

    __slots__ = ()

    def summary(self) -> Mapping[str, object]:
        """Name what is shown, in the order in which it is shown."""
        raise NotImplementedError

    def __repr__(self) -> str:
        pairs = ", ".join(f"{name}: {value}" for name, value in self.summary().items())
        return f"<{type(self).__name__} {pairs}>"

    def _repr_html_(self) -> str:
        """Lay the summary out as Jupyter shows it."""
        rows = "".join(
            f"<tr><th>{escape(name)}</th><td>{escape(str(value))}</td></tr>"
            for name, value in self.summary().items()
        )
        return f"<table><caption>{type(self).__name__}</caption>{rows}</table>"
