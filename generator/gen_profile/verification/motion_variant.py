"""A motion smaller, mirrored or elsewhere, as a playback block plays it, for the check to judge."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from gen_profile.errors import SpecError
from gen_profile.motion.profile import Array, SampledProfile, columns_of
from gen_profile.spec.model import Spec
from gen_profile.suggestion import suggestion


@attrs.frozen(kw_only=True)
class MotionVariant:
    """What is asked for, by axis.

    Attributes
    ----------
    scale : mapping of str to float
        Factors of the distance, 0 to 1.
    mirror : tuple of str
        Axes that go the other way.
    offset : mapping of str to float
        Where they begin, in m (or rad) from the start as planned.
    """

    scale: Mapping[str, float] = attrs.field(factory=dict)
    mirror: tuple[str, ...] = ()
    offset: Mapping[str, float] = attrs.field(factory=dict)

    def gain(self, axes: Sequence[str]) -> Array:
        """Signed factor of every axis's distance."""
        return np.array([(-1.0 if name in self.mirror else 1.0) * self.scale.get(name, 1.0) for name in axes])

    def shift(self, axes: Sequence[str]) -> Array:
        """Offset of every axis."""
        return np.array([self.offset.get(name, 0.0) for name in axes])

    def described(self) -> str | None:
        """Describe it in words, or not at all where the motion is as planned."""
        words = [f"{name} {value:g} times as far" for name, value in self.scale.items()]
        words += [f"{name} the other way" for name in self.mirror]
        words += [f"{name} begins {value:+g} from its start" for name, value in self.offset.items()]
        return ", ".join(words) or None


def parse_variant(
    spec: Spec, scale: Sequence[str], mirror: Sequence[str], offset: Sequence[str]
) -> MotionVariant:
    """Read ``AXIS=VALUE``; a machine of one axis needs no name.

    Raises
    ------
    SpecError
    """
    axes = list(spec.axis)
    factors = dict(_entry("scale", text, axes) for text in scale)
    for name, value in factors.items():
        if not 0.0 <= value <= 1.0:
            raise SpecError(f"scale {name}={value:g}: a playback block takes 0 to 1.")
    return MotionVariant(
        scale=factors,
        mirror=tuple(_axis("mirror", name, axes) for name in mirror),
        offset=dict(_entry("offset", text, axes) for text in offset),
    )


def varied(spec: Spec, setpoints: SampledProfile, variant: MotionVariant) -> tuple[Spec, SampledProfile]:
    """Change a motion, and the move that it is judged by."""
    gain, shift = variant.gain(list(spec.axis)), variant.shift(list(spec.axis))
    start = np.array(spec.move.start)

    move = attrs.evolve(
        spec.move,
        start=tuple((start + shift).tolist()),
        target=tuple((start + shift + gain * np.array(spec.move.distance)).tolist()),
        final_velocity=tuple((gain * np.array(spec.move.final_velocity)).tolist()),
    )
    columns: dict[str, Any] = {name: values * gain for name, values in columns_of(setpoints).items()}
    columns["position"] = start + shift + gain * (setpoints.position - start)
    return attrs.evolve(spec, move=move), attrs.evolve(setpoints, **columns)


def _entry(option: str, text: str, axes: Sequence[str]) -> tuple[str, float]:
    name, equals, number = text.rpartition("=")
    if not equals and len(axes) > 1:
        raise SpecError(f"{option} {text}: say of which axis, as {axes[0]}={text} ({', '.join(axes)}).")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SpecError(f"{option} {text}: {number!r} is no number.")
    return _axis(option, name, axes) if equals else axes[0], value


def _axis(option: str, name: str, axes: Sequence[str]) -> str:
    if name not in axes:
        raise SpecError(f"{option}: the machine has no axis {name!r}{suggestion(name, axes)}")
    return name
