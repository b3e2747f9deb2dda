"""What the simulated drives move: a port."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Load(Protocol):
    """A machine whose axes follow positions."""

    def advance(self, position: Sequence[float], duration: float) -> Sequence[float]:
        """Lead every axis evenly to a position.

        Parameters
        ----------
        position : sequence of float
            Commanded at the end, per axis, in m (or rad).
        duration : float
            s.

        Returns
        -------
        sequence of float
            Where the axes then are.
        """
        ...
