"""Input shapers: impulse trains whose convolution with any motion leaves a mode at rest.

One pure function per shaper takes the mode's frequency in rad/s; `SHAPERS` names them. An undamped mode is
left at rest exactly when Σ aᵢ exp(jω tᵢ) = 0; the motion keeps its distance when Σ aᵢ = 1 (Singer and
Seering, 1990).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import reduce

import attrs
import numpy as np

from gen_profile.profile import Array, read_only


@attrs.frozen(kw_only=True, eq=False)
class Impulses:
    """A train of impulses.

    Attributes
    ----------
    times : (impulses,) array
        s, rising from 0.
    amplitudes : (impulses,) array
        Their sum is 1.
    """

    times: Array = attrs.field(converter=read_only)
    amplitudes: Array = attrs.field(converter=read_only)

    @property
    def delay(self) -> float:
        """Time of the last impulse in s: what the shaper adds to any motion."""
        return float(self.times[-1])


Shaper = Callable[[float], Impulses]


def nzv(frequency: float) -> Impulses:
    """Place +1 −1 +1 within T/3: unity-magnitude negative zero vibration (Singhose et al., 1994)."""
    period = 2.0 * math.pi / frequency
    return Impulses(times=[0.0, period / 6.0, period / 3.0], amplitudes=[1.0, -1.0, 1.0])


def zvd(frequency: float) -> Impulses:
    """Place ¼ ½ ¼ within T: zero vibration and derivative, flat in ω (Singer and Seering, 1990)."""
    period = 2.0 * math.pi / frequency
    return Impulses(times=[0.0, period / 2.0, period], amplitudes=[0.25, 0.5, 0.25])


SHAPERS: dict[str, Shaper] = {
    "nzv": nzv,
    "zvd": zvd,
}


def convolve(trains: Iterable[Impulses]) -> Impulses:
    """Join shapers of several modes into one that leaves all of them at rest."""
    return reduce(_convolve, trains)


def _convolve(one: Impulses, other: Impulses) -> Impulses:
    times = np.add.outer(one.times, other.times).ravel()
    order = np.argsort(times, kind="stable")
    amplitudes = np.multiply.outer(one.amplitudes, other.amplitudes).ravel()
    return Impulses(times=times[order], amplitudes=amplitudes[order])
