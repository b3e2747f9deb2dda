"""The machines that a motion is tried on: nominal, each uncertain parameter off its value, all corners."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

from gen_profile.check import Scenario
from gen_profile.spec import Spec

NOMINAL = "nominal"


def scenarios(spec: Spec) -> tuple[Scenario, ...]:
    """List the nominal machine, then that with all uncertain parameters at their upper ends, and the rest."""
    uncertain = spec.robustness.uncertain
    corners = list(product((+1, -1), repeat=len(uncertain)))
    offsets = [dict(zip(uncertain, signs, strict=True)) for signs in corners]
    if len(uncertain) > 1:
        offsets += [{name: sign} for name in uncertain for sign in (+1, -1)]
    return (Scenario(name=NOMINAL, parameters=spec.plant.parameters), *_off_nominal(spec, offsets))


def _off_nominal(spec: Spec, offsets: list[dict[str, int]]) -> Iterator[Scenario]:
    uncertain, nominal = spec.robustness.uncertain, spec.plant.parameters
    for offset in offsets:
        if offset:
            shifted = {name: nominal[name] * (1.0 + sign * uncertain[name]) for name, sign in offset.items()}
            words = [f"{name} {sign * 100.0 * uncertain[name]:+.6g} %" for name, sign in offset.items()]
            yield Scenario(name=", ".join(words), parameters={**nominal, **shifted})
