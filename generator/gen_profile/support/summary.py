"""Results as a line in a terminal, as a small table and a picture in a notebook, and as a table of pandas."""

from collections.abc import Callable, Mapping, Sequence
from html import escape
from typing import Any

import attrs

from gen_profile.support.errors import OutputError
from gen_profile.support.plugins import require_installed

drawers: list[Callable[["Drawable"], str]] = []  # from above: each gives the address of an image


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


class Sampled(Summarised):
    """Arrays, each named with its shape in place of its numbers."""

    __slots__ = ()

    def summary(self) -> Mapping[str, object]:
        """Name what attrs would print."""
        kind: Any = type(self)
        printed = [field.name for field in attrs.fields(kind) if field.repr]
        return {name: getattr(value, "shape", value) for name in printed for value in [getattr(self, name)]}


class Drawable(Summarised):
    """What `gen_profile.plot` draws, too: a notebook shows the picture below the table."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Add an image where something draws; none without Matplotlib."""
        table = super()._repr_html_()
        try:
            sources = [drawer(self) for drawer in drawers]
        except OutputError:
            return table
        images = (
            f'<img style="max-width: 100%" alt="{escape(repr(self))}" src="{source}">' for source in sources
        )
        return f"{table}{''.join(images)}"


class Tabled:
    """What is a table, too."""

    __slots__ = ()

    def records(self) -> Sequence[Mapping[str, object]]:
        """List its rows, values by column, in SI units."""
        raise NotImplementedError

    def to_pandas(self) -> Any:
        """Make a `pandas.DataFrame` of its rows.

        Raises
        ------
        OutputError
            pandas is not installed.
        """
        require_installed("to_pandas needs pandas", "data", "pandas")
        import pandas as pd  # noqa: PLC0415  # an extra

        return pd.DataFrame(self.records())
