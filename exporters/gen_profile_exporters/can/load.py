"""What the simulated drives move: a port."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import attrs


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


@attrs.define
class RigidLoad:
    """Axes that follow at once, or with a first-order lag, whatever hangs on them.

    Attributes
    ----------
    position : list of float
        Where the axes are, in m (or rad).
    lag : float
        Share of the distance that is left after one step; 0 follows at once.
    """

    position: list[float]
    lag: float = 0.0

    def advance(self, position: Sequence[float], duration: float) -> Sequence[float]:
        """Lead every axis to a position."""
        del duration
        self.position = [
            goal + self.lag * (at - goal) for at, goal in zip(self.position, position, strict=True)
        ]
        return self.position
