"""How motions of axes leave a machine's loads swinging, by the modes of that very machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Self

import attrs
import numpy as np
from numpy.typing import NDArray

from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant

PIECE = 4096  # cycles that are integrated at once
_AT_ONCE = 64  # cycles of a wave

Complex = NDArray[np.complex128]


@attrs.frozen(kw_only=True, eq=False)
class SwayModes:
    """The modes of one or several machines, each with its own shapes.

    A mode of pole p = −σ + iω that an axis's acceleration a has moved, s = ∫ a(τ) exp(p (t − τ)) dτ in m/s
    (or rad/s), makes a load sway by its gain times |s|, in m.

    Attributes
    ----------
    poles : (machines, modes) array
        In 1/s, of modes of different frequencies.
    gains : (machines, loads, axes, modes) array
        In s, with the sign in which modes of several axes add up.
    """

    poles: Complex
    gains: Array

    @classmethod
    def of(
        cls,
        plant: Plant,
        machines: Sequence[tuple[Mapping[str, float], Sequence[float]]],
        axes: Sequence[int],
    ) -> Self:
        """Linearise machines, given by their parameters and the places of their axes."""
        poles, gains = zip(*(_modes(plant, *machine, axes) for machine in machines), strict=True)
        return cls(poles=np.array(poles), gains=np.array(gains))

    @property
    def damped(self) -> bool:
        """Whether any of them decays."""
        return bool((self.poles.real < 0.0).any())

    @property
    def periods(self) -> Array:
        """Of the first machine, in s, (modes,)."""
        return np.asarray(2.0 * np.pi / self.poles[0].imag)

    def between(self, shares: Array) -> SwayModes:
        """Follow the line of these machines, which lie at 0 … 1 of it evenly, to shares of it."""
        places = np.linspace(0.0, 1.0, len(self.poles))
        right = np.clip(np.searchsorted(places, shares), 1, len(places) - 1)
        weight = (shares - places[right - 1]) / (places[right] - places[right - 1])

        w, v = weight[:, None], weight[:, None, None, None]
        return SwayModes(
            poles=(1.0 - w) * self.poles[right - 1] + w * self.poles[right],
            gains=(1.0 - v) * self.gains[right - 1] + v * self.gains[right],
        )

    def moved(self, acceleration: Array, ends: Sequence[int], cycle: float) -> Complex:
        """Integrate what motions have made of every mode.

        Parameters
        ----------
        acceleration : (axes, cycles) array
            In m/s², linear within each cycle, and 0 at first.
        ends : sequence of int
            Rising cycles in which it is asked for.
        cycle : float
            s.

        Returns
        -------
        (ends, axes, machines, modes) array
        """
        poles = self.poles.ravel()
        marks = sorted({0, *ends, *range(0, ends[-1], PIECE)})
        wave = _wave(poles * cycle, 1 + max((end - begin for begin, end in pairwise(marks)), default=0))
        state = np.zeros((len(acceleration), len(poles)), dtype=np.complex128)
        kept = {0: state}
        for begin, end in pairwise(marks):
            passed = acceleration[:, begin + 1 : end + 1][:, ::-1] @ wave[: end - begin].view(np.float64)
            state = state * wave[end - begin] + passed.view(np.complex128)
            kept[end] = state
        half = 0.5 * poles * cycle
        whole = cycle * (np.sinh(half) / half) ** 2  # of the hat that a cycle's acceleration makes
        last = acceleration[:, list(ends)][..., None]
        # the half of the last hat that is still to come
        ahead = cycle * (
            (np.exp(2.0 * half) - 1.0 - 2.0 * half) / (2.0 * half) ** 2 - (np.sinh(half) / half) ** 2
        )
        moved = np.array([kept[end] for end in ends]) * whole + np.swapaxes(last, 0, 1) * ahead
        return np.asarray(moved.reshape(len(ends), len(acceleration), *self.poles.shape))

    def sway(self, moved: Complex) -> Array:
        """Find the greatest sway in m of a load, once and for all, as all modes add up at some time.

        Parameters
        ----------
        moved : (ends, axes, machines, modes) array

        Returns
        -------
        (ends, machines) array
        """
        by_mode = np.abs(np.einsum("jlam,eajm->ejlm", self.gains, moved))
        return np.asarray(by_mode.sum(axis=-1).max(axis=-1))


def _modes(
    plant: Plant, parameters: Mapping[str, float], places: Sequence[float], axes: Sequence[int]
) -> tuple[Complex, Array]:
    """Poles, (modes,), and gains, (loads, axes, modes), of a machine; equal frequencies are one mode."""
    at = linearize(plant, parameters, list(places))
    rates, ratios = at.distinct_frequencies, at.distinct_damping_ratios
    same = np.abs(at.frequencies[:, None] - rates).argmin(axis=1)[:, None] == np.arange(len(rates))
    damped = rates * np.sqrt(1.0 - ratios**2)
    excited = np.linalg.solve(at.modes, at.input)[:, list(axes)]
    gains = np.einsum("lk,ka,km->lam", at.sway_gain @ at.modes, excited, same) / damped
    return np.asarray(1j * damped - ratios * rates, dtype=np.complex128), gains


def _wave(turns: Complex, length: int) -> Complex:
    """Powers of exp(turn), shape (length, turns)."""
    coarse = np.exp(np.outer(_AT_ONCE * np.arange(-(-length // _AT_ONCE)), turns))
    fine = np.exp(np.outer(np.arange(_AT_ONCE), turns))
    wave: Complex = (coarse[:, None] * fine).reshape(-1, len(turns))
    return wave[:length]
