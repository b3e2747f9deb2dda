"""The search for the worst machines anywhere in the ranges, among which the ends and corners need not be.

Every machine that the search looks at is a co-simulation of the plant's FMU, too, with setpoints and
integration steps that are only as close as the modes need. What it finds is then co-simulated in full.
"""

from collections.abc import Iterator, Sequence

import attrs
import numpy as np

from gen_profile.assurance.verification.batch import Feed, many_machines, residual_peaks
from gen_profile.assurance.verification.setpoint_path import followed_up, follows_exactly, transmitted
from gen_profile.assurance.verification.time_scales import standstill, watched
from gen_profile.dynamics.evaluation.scenarios import LAG, SEARCH, Scenario, named
from gen_profile.dynamics.problem.linearization import eigenvalues_at
from gen_profile.dynamics.problem.parameter_box import Box, start, worst_places
from gen_profile.motion.profile import Array, SampledProfile
from gen_profile.spec.model import Spec
from gen_profile.support.progress import Progress, no_progress
from gen_profile_fmu.running.many_runs import ManyRuns

# rad of the fastest mode between setpoints, and per step, in the search alone; 0.6 leads to the same machines
COARSE = 0.3
KEPT_PER_LIMIT = 3  # of the worst machines for each limit; of 1 and 6 the worst is the same on four machines
SAME = 1e-3  # of its range, by which two machines must differ in some parameter to be two


@attrs.frozen(kw_only=True, eq=False)
class _Way:
    """Machines in ranges of their parameters, and how the drives follow; their lag may have a range, too."""

    spec: Spec
    box: Box
    group: str
    lag: float | None

    def lags(self, places: Array) -> Array:
        """Time constants of the drives in s at some places."""
        if LAG in self.box.ranges:
            low, high = self.box.ranges[LAG]
            return np.asarray(low + places[:, list(self.box.ranges).index(LAG)] * (high - low))
        lag = self.spec.actuator.tau if self.lag is None else self.lag
        return np.full(len(places), lag or 0.0)

    def scenario(self, place: Array) -> Scenario:
        """Name the machine at a place."""
        (values,) = self.box.parameters(place[None])
        words = [named(self.spec, name, values[name]) for name in self.box.ranges if name != LAG]
        lag = float(self.lags(place[None])[0]) if LAG in self.box.ranges else self.lag
        if lag is not None:
            words.append(f"lag {lag:.4g} s")
        return Scenario(name=", ".join(words), parameters=values, group=self.group, lag=lag)

    def place(self, scenario: Scenario) -> Array:
        """Tell where in the ranges a scenario is."""
        values, ranges = {**scenario.parameters, LAG: scenario.lag or 0.0}, self.box.ranges
        return np.array([(values[name] - low) / (high - low) for name, (low, high) in ranges.items()])


def worst_machines(
    spec: Spec, setpoints: SampledProfile, rows: Sequence[Scenario], progress: Progress = no_progress
) -> tuple[tuple[Scenario, ...], int]:
    """Search the ranges of a check, and of the drives' lag, for the machines that setpoints suit least.

    Parameters
    ----------
    spec : Spec
    setpoints : SampledProfile
        Replayed from an artefact.
    rows : sequence of Scenario
        All others of the check; those found are numbered after them.
    progress : callable
        Told of a compilation, which takes seconds.

    Returns
    -------
    machines : tuple of Scenario
        The worst ones that are not among the others.
    tried : int
        Number of machines looked at.

    Raises
    ------
    SpecError
        What the spec says of the path does not fit the artefact's cycle.
    CosimulationError
    """
    ways = list(_ways(spec, float(setpoints.times[-1])))
    if not ways:
        return (), 0
    machines: list[Scenario] = []
    tried = 0
    with many_machines(spec.machine(), progress) as runs:
        for way in ways:
            places, looked_at = _searched(way, setpoints, runs)
            tried += looked_at
            exact = way.group == SEARCH
            matching = [row for row in rows if (follows_exactly(row) if exact else row.group == way.group)]
            machines += [way.scenario(place) for place in _new(places, [way.place(row) for row in matching])]
    numbered = (attrs.evolve(row, row=len(rows) + index) for index, row in enumerate(machines))
    return tuple(numbered), tried


def _ways(spec: Spec, duration: float) -> Iterator[_Way]:
    """List what has ranges: machines with drives that follow exactly, and on a path that bends setpoints."""
    box = Box(
        plant=spec.machine(),
        nominal=spec.plant.parameters,
        ranges={name: ends for name, ends in spec.checked_ranges().items() if ends[1] > ends[0]},
        ends=(spec.move.start, spec.move.target),
        duration=duration,
    )
    if box.ranges:
        yield _Way(spec=spec, box=box, group=SEARCH, lag=None)
    path = spec.check.path
    if path.alters_setpoints:
        low, high = path.lag or (None, None)
        if low is not None and high is not None and high > low:
            box = attrs.evolve(box, ranges={**box.ranges, LAG: (low, high)})
        if box.ranges:
            yield _Way(spec=spec, box=box, group="drives", lag=low)


def _searched(way: _Way, setpoints: SampledProfile, runs: ManyRuns) -> tuple[Array, int]:
    """Places of the worst machines, a few for each limit, and how many were looked at."""
    spec, box = way.spec, way.box
    since, sway = standstill(spec, setpoints), spec.limits.sway
    begun = start(box.phases, len(box.ranges))
    rates = eigenvalues_at(box.plant, box.machines(begun.places), box.ends)
    step = COARSE / max(float(np.abs(at_end).max()) for at_end in rates)
    feed = _coarse(way, setpoints, step)
    feed = followed_up(feed, watched(spec, setpoints, COARSE), spec.move.final_velocity)
    limits = np.array(list(spec.check.residual_sway.values()))

    def shares(places: Array) -> Array:
        peaks = residual_peaks(
            runs,
            spec,
            feed,
            box.machines(places),
            tau=way.lags(places),
            max_step=step,
            since=since,
            on_the_way=sway is not None,
        )
        figures = [peaks[:, : len(limits)] / limits]
        if sway is not None:
            figures.append(peaks[:, len(limits)] / sway)
        if spec.path is not None or spec.limits.overshoot is not None:
            figures.append(-peaks[:, -3])
        return np.column_stack(figures)

    return worst_places(shares, begun, KEPT_PER_LIMIT)


def _coarse(way: _Way, setpoints: SampledProfile, step: float) -> Feed:
    """Leave out setpoints that straight lines do not need; what the path makes of them needs all."""
    row = Scenario(name="", parameters={}, group=way.group, lag=way.lag)
    feed, path = transmitted(way.spec, setpoints, [row]), way.spec.check.path
    if way.group != SEARCH and (path.quantum > 0.0 or path.between != "linear"):
        return feed
    return feed.thinned(max(int(step / setpoints.cycle_time), 1))


def _new(places: Array, known: Sequence[Array]) -> Iterator[Array]:
    """Leave out places that are known or come twice."""
    taken = list(known)
    for place in places:
        if not any(np.abs(place - other).max() < SAME for other in taken):
            taken.append(place)
            yield place
