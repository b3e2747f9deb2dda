"""A path over stacks as the programs take it: machines, their ends, and when each load is high enough."""

import math
from collections.abc import Sequence

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.dynamics.problem.initial_state import initial_state
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.methods.solvers.over_stacks.hoist import Pieces, Rates, highest, least_time
from gen_profile.methods.solvers.over_stacks.swing import Swing, swing_of, swings_along
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant, decides
from gen_profile.spec.model import AxisLimitsSpec, Spec
from gen_profile.spec.plan_view import Area, StraightWay
from gen_profile.spec.stacks import PathAxes, StackZone, hanging, path_axes, zones
from gen_profile.support.units import RATES

FINE = 4001  # times at which levels are compared; between them they are straight lines
UNLIMITED = 1e4  # in place of a limit of the trolley that is not stated
EDGE = 1e-9  # s, to either side of a crossing
LEVEL = 1e-5  # m, by which a level may be too low: between the times at which it is known it is higher


@attrs.frozen(kw_only=True, eq=False)
class Bay:
    """What is asked for.

    Attributes
    ----------
    spec : Spec
    plant : Plant
    axes : PathAxes
    line : StraightWay
        In plan view, along which the load goes: the trolley's places are along it.
    moving : tuple of int
        Coordinates of the machine that move as the load goes along the line.
    nominal, others : Swing
        Of the nominal machine, with sensitivities, and of the machines at the ends of all ranges.
    machines : (machines, parameters) array
        Nominal first.
    hang : (machines, bodies) array
        Heights of the bodies at the start, m above the suspension.
    zones : tuple of StackZone
        Along the line.
    """

    spec: Spec
    plant: Plant
    axes: PathAxes
    line: StraightWay
    moving: tuple[int, ...]
    nominal: Swing
    others: Swing
    machines: Array
    hang: Array
    zones: tuple[StackZone, ...]

    @property
    def hoist(self) -> int:
        """Number of the axis that lifts."""
        return self.axes.hoist

    @property
    def limits(self) -> AxisLimitsSpec:
        """Of the trolley, along the line: what the axes that carry it along allow."""
        stated = [
            (self.spec.limits.of(axis), k) for k, axis in enumerate(self.axes.along) if self.line.way[k]
        ]
        rates = {
            rate: min(
                (
                    each / abs(self.line.way[k])
                    for one, k in stated
                    if (each := getattr(one, rate)) is not None
                ),
                default=None,
            )
            for rate in RATES
        }
        travels = [
            sorted((edge - self.line.origin[k]) / self.line.way[k] for edge in one.travel)
            for one, k in stated
            if one.travel is not None
        ]
        travel = (max(low for low, _ in travels), min(high for _, high in travels)) if travels else None
        return AxisLimitsSpec(**rates, travel=travel)

    @property
    def rates(self) -> Rates:
        """Of the hoist."""
        return _rates(self.spec.limits.of(self.hoist))

    @property
    def begin(self) -> Array:
        """State of the nominal machine at the start, sensitivities included."""
        state = np.zeros(self.nominal.states)
        state[0] = self._along(self.spec.move.start)
        swing = initial_state(self.plant, self.spec.move.initial).reshape(2, -1)[:, list(self.moving)].ravel()
        state[3 : 3 + len(swing)] = swing
        return state

    @property
    def target(self) -> float:
        """Of the trolley in m, along the line."""
        return self._along(self.spec.move.target)

    def _along(self, end: Sequence[float]) -> float:
        places = [*(end[axis] for axis in self.axes.along), 0.0][:2]
        return float(self.line.along(np.array(places)))

    @property
    def rise(self) -> float:
        """From start to target in m, upwards."""
        return -self.spec.move.distance[self.hoist]

    @property
    def top(self) -> float:
        """How far the hoist can lift from the start in m."""
        travel, start = self.spec.limits.of(self.hoist).travel, self.spec.move.start[self.hoist]
        least = self.plant.actuated[self.hoist].lower
        highest = start - max(least, travel[0] if travel else least)
        below = min((self.headroom(zone) for zone in self.zones if self.passes(zone)), default=math.inf)
        return min(highest, max(below, self.rise, 0.0))

    def headroom(self, zone: StackZone) -> float:
        """How far the hoist can lift from the start in m below what is overhead."""
        if not zone.overhead:
            return math.inf
        return zone.top - float(self.hang[:, zone.body].max())

    @property
    def needed(self) -> float:
        """How far the hoist has to lift from the start in m, so that all loads clear what is between."""
        passed = (zone for zone in self.zones if self.passes(zone) and not zone.overhead)
        lifts = [zone.top - float(self.hang[:, zone.body].min()) for zone in passed]
        return max(0.0, self.rise, *lifts)

    @property
    def way(self) -> float:
        """Of the trolley in m."""
        return abs(self.target - float(self.begin[0]))

    def passes(self, zone: StackZone) -> bool:
        """Whether a body has to go over a stack, or below what is overhead."""
        sides = self._sides(zone)
        return len(set(sides)) > 1 or (zone.overhead and sides[0] == (-math.inf, math.inf))

    def alone(self) -> "Bay":
        """Leave the nominal machine only."""
        return attrs.evolve(self, machines=self.machines[:1], hang=self.hang[:1])

    def quickest_travel(self) -> float:
        """Least time in s that the trolley takes by itself."""
        return least_time(self.way, _rates(self.limits)) if self.way else 0.0

    def quickest_lift(self, lift: float) -> float:
        """Least time in s that the hoist takes to rest at a height and go on from there to the target."""
        return least_time(lift, self.rates) + least_time(self.rise - lift, self.rates)

    def lifted(self, duration: float, top: float, waits: tuple[float, float] = (0.0, 0.0)) -> Pieces | None:
        """Find the hoist's motion upwards, at most as high as the top; none in too little time."""
        motion = highest(duration - sum(waits), self.rise, top, self.rates)
        return motion if motion is None or not any(waits) else motion.within(*waits)

    def _sides(self, zone: StackZone) -> tuple[tuple[float, float], tuple[float, float]]:
        """Between which places a body may be while it is low, before a stack and after it."""
        return _side(zone, float(self.begin[0])), _side(zone, self.target)

    def bounds(self, machine: int, body: int, up: Pieces, times: Array) -> tuple[Array, Array]:
        """Tell between which places a body of a machine may be at some times, as a hoist lifts it."""
        low, high = np.full(len(times), -np.inf), np.full(len(times), np.inf)
        fine = np.linspace(0.0, up.duration, FINE)
        level = self.hang[machine, body] + up.at(fine)[:, 0]
        for zone in self.zones:
            if zone.body != body or (zone.overhead and (self.passes(zone) or level.max() <= zone.top)):
                continue
            rises, falls = _crossings(fine, level, zone.top)
            if zone.overhead:  # while it is too high, it stays where it starts and ends
                left, right = self._sides(zone)[0]
                counts = (times >= rises - EDGE) & (times <= falls + EDGE)
                low[counts] = np.maximum(low[counts], left)
                high[counts] = np.minimum(high[counts], right)
                continue
            for (left, right), counts in zip(
                self._sides(zone), (times <= rises + EDGE, times >= falls - EDGE), strict=True
            ):
                low[counts] = np.maximum(low[counts], left)
                high[counts] = np.minimum(high[counts], right)
        return low, high

    @property
    def tightest(self) -> tuple[StackZone | None, float]:
        """The stack that a body of the nominal machine is nearest beside at the target, and its room in m."""
        still = self.still(0)[:, 0]
        low = [zone for zone in self.zones if self.hang[0, zone.body] + self.rise < zone.top]
        rooms = [(zone, float(zone.beside(still[zone.body]))) for zone in low]
        return min(rooms, key=lambda pair: pair[1], default=(None, math.inf))

    def still(self, machine: int) -> Array:
        """Where the bodies of a machine hang at the target in m, and their derivatives by its state."""
        state = np.zeros(self.others.states)
        state[0] = self.target
        hoist = np.array([self.spec.move.target[self.hoist], 0.0, 0.0])
        return self.others.seen(state, hoist, self.machines[machine])[:-1]

    def events(self, machine: int, up: Pieces) -> Array:
        """List the times at which bodies of a machine cross the heights of stacks."""
        fine = np.linspace(0.0, up.duration, FINE)
        lifted = up.at(fine)[:, 0]
        crossed = [_crossings(fine, self.hang[machine, zone.body] + lifted, zone.top) for zone in self.zones]
        return np.unique([time for pair in crossed for time in pair if 0.0 < time < up.duration])


def bay_of(spec: Spec, reserve: float = 0.0) -> Bay:
    """State the path of a spec over its stacks, with so much more clearance in m."""
    plant, path, move = spec.machine(), spec.path, spec.move
    axes = path_axes(plant, spec.plant.parameters)
    assert path is not None and axes is not None  # as the spec's rules hold
    line = axes.line(move.start, move.target)
    swings = swings_along(plant, axes, line, linearize(plant, spec.plant.parameters, move.target))
    sideways, above = path.clearances
    wider = attrs.evolve(path, clearance=(sideways + reserve, above + reserve))
    named = _machines(spec, plant)
    ends = [hanging(plant, spec.plant.parameters, q_a) for q_a in (move.start, move.target)]
    hang = np.array([[z for *_, z in hanging(plant, values, move.start)] for values in named])
    desensitized = tuple(spec.robustness.uncertain) if spec.robustness.method == "sensitivity" else ()
    found = []
    for wide, zone in zip(zones(wider, ends), zones(path, ends), strict=True):
        met, met_wide = zone.on(line), wide.on(line)
        if met is not None and met_wide is not None:  # loads do not sway away from the line
            places = [float(line.along(np.array(end[zone.body][:2]))) for end in ends]
            found.append(_up_to_ends(met_wide, met, places))
    return Bay(
        spec=spec,
        plant=plant,
        axes=axes,
        line=line,
        moving=swings[1],
        nominal=swing_of(plant, axes, *swings, desensitized),
        others=swing_of(plant, axes, *swings, ()),
        machines=parameter_rows(plant, named),
        hang=hang,
        zones=tuple(found),
    )


def _up_to_ends(wide: StackZone, zone: StackZone, places: Sequence[float]) -> StackZone:
    """Widen a zone up to where its body starts or ends at most, which else would be within it."""
    low = max([wide.low, *(x for x in places if x <= zone.low)])
    high = min([wide.high, *(x for x in places if x >= zone.high)])
    return attrs.evolve(wide, area=Area((low, high)))


def _machines(spec: Spec, plant: Plant) -> list[dict[str, float]]:
    """List the nominal machine, and those at ends and corners of ranges that matter."""
    nominal = dict(spec.plant.parameters)
    found = [nominal]
    idle = {name for name in spec.checked_ranges() if not decides(plant, name, nominal)}
    for row in scenarios(spec)[1:]:
        values = {name: nominal[name] if name in idle else value for name, value in row.parameters.items()}
        if values not in found:
            found.append(values)
    return found


def _rates(limits: AxisLimitsSpec) -> Rates:
    return Rates(
        speed=limits.velocity or UNLIMITED,
        acceleration=limits.acceleration or UNLIMITED,
        jerk=limits.jerk or UNLIMITED,
    )


def _side(zone: StackZone, end: float) -> tuple[float, float]:
    """Between which places a body may be that is on its end's side of a stack."""
    if end <= zone.low:
        return (-math.inf, zone.low)
    if end >= zone.high:
        return (zone.high, math.inf)
    return next((one.x for one in zone.own if one.x[0] <= end <= one.x[1]), (-math.inf, math.inf))


def _crossings(times: Array, level: Array, top: float) -> tuple[float, float]:
    """Tell until when a level is too low on its way up, and from when on its way down."""
    peak = int(np.argmax(level))
    low = level < top - LEVEL
    if low[peak]:
        return float(times[peak]), float(times[peak])
    before, after = np.flatnonzero(low[:peak]), np.flatnonzero(low[peak:])
    rises = -1.0 if not len(before) else _crossed(times, level, top, int(before[-1]))
    falls = times[-1] + 1.0 if not len(after) else _crossed(times, level, top, peak + int(after[0]) - 1)
    return rises, float(falls)


def _crossed(times: Array, level: Array, top: float, k: int) -> float:
    share = (top - LEVEL - level[k]) / (level[k + 1] - level[k])
    return float(times[k] + share * (times[k + 1] - times[k]))
