"""What motions leave swinging on the linear machine that a block is given, and on machines of stated errors.

Each machine swings in its own modes, with its own shapes and frequencies, and its load that sways most
counts; modes add up, as they will in some hour. How a block finds what it states is of no account here.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Self

import attrs
import numpy as np

from gen_profile.methods.quickest.modes import SwayModes
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant

TURN = (
    0.45  # rad, at most, between what machines next to each other do after a history: 1 − cos half of it, 3 %
)
USUAL = 9  # machines from the one as given to a corner, at least
FEW_ERRORS = 0.01  # of the stated ones: what is left there is their first order

Machine = tuple[Mapping[str, float], Sequence[float]]  # parameters, and places of the axes


@attrs.frozen(kw_only=True, eq=False)
class GivenModes:
    """The modes of a machine whose live parameters stay as they are, and of those that it may be in truth.

    Attributes
    ----------
    modes : SwayModes
        First of the machine as given.
    ends : sequence of int
        Which of them are at the corners of the errors whose slowest mode is slowest and fastest.
    near : int
        Which is near the machine as given.
    """

    modes: SwayModes
    ends: Sequence[int] = ()
    near: int = 0

    @classmethod
    def of(
        cls,
        plant: Plant,
        axes: Sequence[int],
        corners: Sequence[Sequence[Machine]],
        others: Sequence[Machine] = (),
        seconds: float = 0.0,
    ) -> Self:
        """Linearise machines, the more of them between the corners the longer they move.

        Parameters
        ----------
        plant : Plant
        axes : sequence of int
            That move.
        corners : sequence of sequences of machines
            Each from the machine as given, evenly, to a corner of the stated errors.
        others : sequence of machines
            Somewhere among them.
        seconds : float
            How long they move.
        """
        lines = [SwayModes.of(plant, line, axes) for line in corners]
        turns = [float(np.abs(line.poles[-1].imag - line.poles[0].imag).max()) for line in lines]
        slowest = [float(line.poles[-1, 0].imag) for line in lines]
        extreme = sorted({int(np.argmin(slowest)), int(np.argmax(slowest))})
        found, ends = [SwayModes.of(plant, [corners[0][0], *others], axes)], []
        for k, (line, turn) in enumerate(zip(lines, turns, strict=True)):
            count = max(USUAL, math.ceil(turn * seconds / TURN) + 1) if k in extreme else USUAL
            found.append(line.between(np.array([FEW_ERRORS, *np.linspace(0.0, 1.0, count)[1:]])))
            last = sum(len(one.poles) for one in found) - 1
            ends += [last] if k in extreme else []
        return cls(
            modes=SwayModes(
                poles=np.concatenate([one.poles for one in found]),
                gains=np.concatenate([one.gains for one in found]),
            ),
            ends=ends,
            near=1 + len(others),
        )

    def left(self, acceleration: Array, ends: Sequence[int], cycle: float) -> tuple[Array, Array, Array]:
        """Find what sways on where axes stand.

        Parameters
        ----------
        acceleration : (axes, cycles) array
            In m/s², linear within each cycle.
        ends : sequence of int
            Rising cycles, in which the axes stand.
        cycle : float
            s.

        Returns
        -------
        as_given, at_most, apart : (ends,) arrays
            In m: of the machine as given; of the worst one; and if each axis and mode had a worst one of its
            own, which all were shown by one load.
        """
        moved = self.modes.moved(acceleration, ends, cycle)
        by_machine = self.modes.sway(moved)
        largest = np.abs(self.modes.gains).max(axis=1)  # of the loads
        apart = np.einsum("jam,eajm->eamj", largest, np.abs(moved)).max(axis=-1).sum(axis=(1, 2))
        return by_machine[:, 0], by_machine.max(axis=-1), apart
