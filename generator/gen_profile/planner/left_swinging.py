"""What a motion leaves swinging on the linear machine that a block is given, and with stated errors."""

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Self

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.motion.profile import Array
from gen_profile.planner.machine import left_by_errors, linearized
from gen_profile.spec.model import Spec

ERRORS = (0.0, -1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0)  # of the stated ones
TURN = 0.45  # rad, at most, between what machines next to each other do after a history: a block tries fewer
PIECE = 4096  # cycles that are integrated at once
_AT_ONCE = 64  # cycles of a wave


@attrs.frozen(kw_only=True)
class GivenModes:
    """The modes of a machine whose live parameters stay as they are.

    Attributes
    ----------
    poles : (modes, errors) array
        −σ + iω in 1/s, of the machine as given and with shares of the stated errors.
    gains : (axes, modes) array
        Sway of the load that shows it most in m, by `left`.
    damped : bool
    """

    poles: NDArray[np.complex128]
    gains: Array
    damped: bool

    @classmethod
    def of(cls, spec: Spec, live: Mapping[str, float], seconds: float = 0.0) -> Self:
        """Linearise a machine at the live parameters of a block; with more errors the longer it moves."""
        point = [
            (2.0 * live[name] - low - high) / (high - low) for name, (low, high) in spec.planner.live.items()
        ]
        at = linearized(spec, point)
        rates, ratios = at.distinct_frequencies, at.distinct_damping_ratios
        errors, *gains = left_by_errors(spec, point).reshape(-1, len(rates))
        damped = rates * np.sqrt(1.0 - ratios**2)
        between = math.ceil(0.25 * float((errors * damped).max()) * seconds / TURN)
        finer = np.linspace(-1.0, 1.0, 8 * between + 1) if between > 1 else ()
        shares = np.array([*ERRORS, *finer])
        poles = 1j * damped[:, None] * (1.0 + np.outer(errors, shares)) - (ratios * rates)[:, None]
        return cls(
            poles=np.asarray(poles, dtype=np.complex128), gains=np.array(gains), damped=bool(ratios.any())
        )

    @property
    def turns(self) -> float:
        """By how much the stated error turns a mode at most, in rad/s."""
        return float((self.poles.imag.max(axis=1) - self.poles[:, 0].imag).max())

    def left(self, acceleration: Array, ends: Sequence[int], cycle: float) -> tuple[Array, Array]:
        """Find what sways on where axes stand.

        Parameters
        ----------
        acceleration : (axes, cycles) array
            In m/s², linear within each cycle, and 0 at all ends.
        ends : sequence of int
            Rising cycles, in which the axes stand.
        cycle : float
            s.

        Returns
        -------
        as_given, at_most : (ends,) arrays
            Sum over axes and modes in m: of the machine as given, and of each mode at its worst error.
        """
        poles = self.poles.ravel()
        marks = sorted({*ends, *range(0, ends[-1], PIECE)})
        wave = _wave(poles * cycle, 1 + max(end - begin for begin, end in pairwise([0, *marks])))
        left, over_time = np.zeros((len(acceleration), len(poles)), dtype=np.complex128), []
        for begin, end in pairwise(marks):
            passed = acceleration[:, begin + 1 : end + 1][:, ::-1] @ wave[: end - begin].view(np.float64)
            left = left * wave[end - begin] + passed.view(np.complex128)
            over_time.append(left)
        kept = [left for left, end in zip(over_time, marks[1:], strict=True) if end in {*ends}]
        # ∫ velocity exp(p t) dt, of hats that are the acceleration's share of a cycle
        half = 0.5 * poles * cycle
        by_mode = np.abs(np.array(kept) * cycle * (np.sinh(half) / half) ** 2 / poles)
        swings = self.gains[..., None] * by_mode.reshape(len(ends), *self.gains.shape, -1)
        return swings[..., 0].sum(axis=(1, 2)), swings.max(axis=-1).sum(axis=(1, 2))


def _wave(turns: NDArray[np.complex128], length: int) -> NDArray[np.complex128]:
    """Powers of exp(turn), shape (length, turns)."""
    coarse = np.exp(np.outer(_AT_ONCE * np.arange(-(-length // _AT_ONCE)), turns))
    fine = np.exp(np.outer(np.arange(_AT_ONCE), turns))
    wave: NDArray[np.complex128] = (coarse[:, None] * fine).reshape(-1, len(turns))
    return wave[:length]
