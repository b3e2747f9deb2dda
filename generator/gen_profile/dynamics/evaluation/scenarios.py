"""What a motion is tried on: machines at the ends and corners of their ranges, drives, random draws."""

from collections.abc import Iterator, Mapping, Sequence

import attrs
import numpy as np

from gen_profile.dynamics.problem.parameter_box import MOST_TRACED, corners, ends
from gen_profile.spec.model import Spec

TIMING = "timing"
SEARCH = "search"
GROUPS = {
    "machines": "nominal, ends and corners of the ranges",
    "corners": "all other corners of more than three ranges",
    SEARCH: "the worst that a search found anywhere in the ranges",
    "drives": "the same with drives that follow otherwise",
    "samples": "drawn from all ranges",
    TIMING: "setpoints late, at uneven times, or lost",
}
NOMINAL = "nominal"
LAG = "lag"
FEWEST_TIMINGS = 20  # draws of uneven times


@attrs.frozen(kw_only=True)
class Scenario:
    """A machine that the check moves.

    Attributes
    ----------
    name : str
        Such as ``"nominal"`` or ``"L1 +20 %"``.
    parameters : mapping of str to float
        Value of every plant parameter.
    group : str
        Which scenarios it is judged with: ``"machines"``, or another of `GROUPS`.
    row : int
        Its number among all scenarios, from 0.
    lag : float or None
        Time constant of the drives in s where it is not the one that the spec states.
    """

    name: str
    parameters: Mapping[str, float]
    group: str = "machines"
    row: int = 0
    lag: float | None = None

    @property
    def followed(self) -> bool:
        """Whether its whole trajectory is looked at, not its peaks alone."""
        return self.group in ("machines", SEARCH)


def scenarios(spec: Spec) -> tuple[Scenario, ...]:
    """List the nominal machine, then that with all uncertain parameters at their upper ends, and the rest.

    Corners of many ranges are left to `further_scenarios`, but for the two extreme ones.
    """
    nominal = Scenario(name=NOMINAL, parameters=spec.plant.parameters)
    return _numbered([nominal, *_off_nominal(spec, ends(spec.checked_ranges()))])


def extremes(spec: Spec) -> tuple[int, ...]:
    """Tell which of `scenarios` are nominal, all parameters at upper ends, and all at lower ends."""
    ranges = len(spec.checked_ranges())
    return (0, 1, 2**ranges if ranges <= MOST_TRACED else 2) if ranges else (0,)


def further_scenarios(spec: Spec, machines: Sequence[Scenario]) -> tuple[Scenario, ...]:
    """List what else `[check]` asks for: more corners, other drives, random draws, faults of timing.

    Parameters
    ----------
    spec : Spec
    machines : sequence of Scenario
        Of `scenarios`.
    """
    path = spec.check.path
    others: list[Scenario] = []
    ranges = spec.checked_ranges()
    if len(ranges) > MOST_TRACED:
        others += [
            attrs.evolve(corner, group="corners") for corner in _off_nominal(spec, corners(ranges)[1:-1])
        ]
    if path.alters_setpoints:
        for lag in dict.fromkeys(path.lag or (None,)):
            words = "" if lag is None else f", lag {lag:.6g} s"
            others += [
                attrs.evolve(machine, name=f"{machine.name}{words}", group="drives", lag=lag)
                for machine in machines
            ]
    others += _draws(spec)
    if path.faulty:
        for draw in range(max(FEWEST_TIMINGS, len(machines))):
            machine = machines[draw % len(machines)]
            name = f"{machine.name}, timing {draw}"
            others.append(attrs.evolve(machine, name=name, group=TIMING, lag=path.lag and path.lag[1]))
    return _numbered(others, len(machines))


def _numbered(rows: Sequence[Scenario], first: int = 0) -> tuple[Scenario, ...]:
    return tuple(attrs.evolve(row, row=first + index) for index, row in enumerate(rows))


def _off_nominal(spec: Spec, shifts: Sequence[Mapping[str, float]]) -> Iterator[Scenario]:
    """Give some parameters other values, and machines their names."""
    for shifted in shifts:
        words = [named(spec, name, value) for name, value in shifted.items()]
        yield Scenario(name=", ".join(words), parameters={**spec.plant.parameters, **shifted})


def named(spec: Spec, name: str, value: float) -> str:
    """Name a parameter's value relative to the nominal one, but where it is stated as it is."""
    if name in spec.check.spans:
        return f"{name} {value:.5g}"
    return f"{name} {100.0 * (value / spec.plant.parameters[name] - 1.0):+.4g} %"


def _draws(spec: Spec) -> list[Scenario]:
    """Draw machines, and the drives' lag where it has a range, as a Latin hypercube."""
    lag = spec.check.path.lag
    ranges = spec.checked_ranges() | ({LAG: lag} if lag is not None else {})
    if not (ranges and spec.check.samples):
        return []
    ends = np.array(list(ranges.values()))
    random = np.random.default_rng(spec.check.seed)
    from scipy.stats import qmc  # noqa: PLC0415  # half a second

    shares = qmc.LatinHypercube(len(ranges), seed=random).random(spec.check.samples)
    values = ends[:, 0] + shares * np.ptp(ends, axis=1)
    rows = []
    for draw, drawn in enumerate(values.tolist()):
        named = dict(zip(ranges, drawn, strict=True))
        lag_drawn = named.pop(LAG, None) if lag is not None else None
        parameters = {**spec.plant.parameters, **named}
        rows.append(Scenario(name=f"sample {draw}", parameters=parameters, group="samples", lag=lag_drawn))
    return rows
