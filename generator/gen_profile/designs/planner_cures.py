"""What would let a refused planner block pass, each change by itself, tried by the same proof."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import attrs

from gen_profile.errors import GenProfileError
from gen_profile.planner.machine import planned_axes
from gen_profile.proof.verdict import Proof
from gen_profile.spec.model import Spec

TRIES = 4  # of each kind of change
ENOUGH = 0.8  # share of the limits aimed at: other histories sway more
WHAT_MOVES = ("velocity", "acceleration", "jerk")

Change = Callable[[Spec, float], tuple[Spec, dict[str, float]]]


@attrs.frozen(kw_only=True)
class Cure:
    """Values with which a block passed its proof.

    Attributes
    ----------
    values : mapping of str to float
        By their places in the spec.
    share : float
        Of the limits of residual sway that the worst history took up then.
    """

    values: Mapping[str, float]
    share: float

    def __str__(self) -> str:
        """Tell them as overrides of a spec."""
        return ", ".join(f"{place} = {value:g}" for place, value in self.values.items())


def cures(spec: Spec, proof: Proof, prove: Callable[[Spec], Proof]) -> tuple[Cure, ...]:
    """Look for changes that help, where too much sway is all that is wrong.

    Parameters
    ----------
    spec : Spec
    proof : Proof
        That failed.
    prove : Spec → Proof
        Of the block of a changed spec, on as many histories.
    """
    if proof.faults or any(judged.faults for judged in proof.judged):
        return ()
    share = proof.share(proof.worst)
    found = (_tried(spec, share, prove, change, power) for change, power in CHANGES.items())
    return tuple(cure for cure in found if cure is not None)


def _tried(
    spec: Spec, share: float, prove: Callable[[Spec], Proof], change: Change, power: float
) -> Cure | None:
    """Change by a factor until the proof passes; the sway is taken to go with a power of it."""
    factor = 1.0
    for _ in range(TRIES):
        factor *= (ENOUGH / share) ** (1.0 / power)
        try:
            changed, values = change(spec, factor)
            proof = prove(changed) if values else None
        except GenProfileError:  # out of what a spec or a block may be
            return None
        if proof is None:
            return None
        share = proof.share(proof.worst)
        if proof.passed:
            return Cure(values=values, share=share)
        share = max(share, 1.0)
    return None


def _slower(spec: Spec, factor: float) -> tuple[Spec, dict[str, float]]:
    stated, axes = spec.limits.stated(), planned_axes(spec)
    places = dict.fromkeys(spec.limits.place(axis, name) for axis in axes for name in WHAT_MOVES)
    values = {place: _rounded_down(factor * stated[place]) for place in places}
    return attrs.evolve(spec, limits=spec.limits.changed(values)), values


def _surer(spec: Spec, factor: float) -> tuple[Spec, dict[str, float]]:
    stated = spec.robustness.uncertain if spec.check.uncertain is None else spec.check.uncertain
    shares = {name: _rounded_down(factor * share) for name, share in stated.items()}
    changed = attrs.evolve(spec, check=attrs.evolve(spec.check, uncertain=shares))
    return changed, {f"check.uncertain.{name}": share for name, share in shares.items()}


def _more_allowed(spec: Spec, factor: float) -> tuple[Spec, dict[str, float]]:
    sway = {load: -_rounded_down(-most / factor) for load, most in spec.check.residual_sway.items()}
    values = {f"check.residual_sway.{load}": most for load, most in sway.items()}
    if len(set(sway.values())) == 1:
        values = {"check.residual_sway": next(iter(sway.values()))}
    changed = attrs.evolve(spec, check=attrs.evolve(spec.check, residual_sway=sway))
    return changed, values


CHANGES: dict[Change, float] = {  # and the power of its factor that the sway goes with
    _surer: 2.0,
    _slower: 1.0,
    _more_allowed: 1.0,
}


def _rounded_down(value: float) -> float:
    """Keep two digits."""
    unit = 10.0 ** (math.floor(math.log10(abs(value))) - 1)
    return float(f"{math.floor(value / unit) * unit:.2g}")
