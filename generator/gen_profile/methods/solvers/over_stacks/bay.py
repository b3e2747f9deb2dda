"""A path over stacks as the programs take it: machines, their ends, and when each load is high enough."""

import math
from collections.abc import Iterable, Iterator, Sequence

import attrs
import numpy as np

from gen_profile.dynamics.evaluation.scenarios import scenarios
from gen_profile.dynamics.problem.dynamics import parameter_rows
from gen_profile.dynamics.problem.initial_state import initial_state
from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.methods.solvers.over_stacks.guide import Guide, Numbers, blocks
from gen_profile.methods.solvers.over_stacks.hoist import Pieces, Rates, highest, least_time
from gen_profile.methods.solvers.over_stacks.swing import CARRIED, Swing, swing_of, swings_along
from gen_profile.methods.solvers.search import Search, least
from gen_profile.motion.profile import Array
from gen_profile.plants.plant import Plant, decides
from gen_profile.spec.model import AxisLimitsSpec, Spec
from gen_profile.spec.plan_view import Area, StraightWay
from gen_profile.spec.stacks import PathAxes, Place, StackZone, hanging, path_axes, zones
from gen_profile.support.units import RATES

FINE = 4001  # times at which levels are compared; between them they are straight lines
UNLIMITED = 1e4  # in place of a limit of the trolley that is not stated
EDGE = 1e-9  # s, to either side of a crossing
PLAN = (StraightWay(), StraightWay(way=(0.0, 1.0)))  # both axes by themselves
OVER = Search(precision=2e-3, close=2e-3, downward=True)  # for how long loads are above stacks
LEVEL = 1e-5  # m, by which a level may be too low: between the times at which it is known it is higher


@attrs.frozen(kw_only=True, eq=False)
class Bay:
    """What is asked for.

    Attributes
    ----------
    spec : Spec
    plant : Plant
    axes : PathAxes
    lines : tuple of StraightWay
        In plan view: the one along which the load goes, or both axes where it goes around something. The
        trolley's places are along them.
    moving : tuple of int
        Coordinates of the machine that move as the load goes along the line.
    nominal, others : Swing
        Of the nominal machine, with sensitivities, and of the machines at the ends of all ranges.
    machines : (machines, parameters) array
        Nominal first.
    hang : (machines, bodies) array
        Heights of the bodies at the start, m above the suspension.
    zones : tuple of StackZone
        Along the line, or in plan view.
    guide : Guide or None
        Of a way around something.
    """

    spec: Spec
    plant: Plant
    axes: PathAxes
    lines: tuple[StraightWay, ...]
    moving: tuple[int, ...]
    nominal: Swing
    others: Swing
    machines: Array
    hang: Array
    zones: tuple[StackZone, ...]
    guide: Guide | None = None

    @property
    def hoist(self) -> int:
        """Number of the axis that lifts."""
        return self.axes.hoist

    @property
    def limits(self) -> tuple[AxisLimitsSpec, ...]:
        """Of the trolley, along every line: what the axes that carry it along allow."""
        return tuple(self._limits(line) for line in self.lines)

    def _limits(self, line: StraightWay) -> AxisLimitsSpec:
        stated = [(self.spec.limits.of(axis), k) for k, axis in enumerate(self.axes.along) if line.way[k]]
        rates = {
            rate: min(
                (each / abs(line.way[k]) for one, k in stated if (each := getattr(one, rate)) is not None),
                default=None,
            )
            for rate in RATES
        }
        travels = [
            sorted((edge - line.origin[k]) / line.way[k] for edge in one.travel)
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
        carried = self.nominal.carried
        state[:carried:CARRIED] = self.start
        swing = initial_state(self.plant, self.spec.move.initial).reshape(2, -1)[:, list(self.moving)].ravel()
        state[carried : carried + len(swing)] = swing
        return state

    @property
    def start(self) -> Array:
        """Of the trolley in m, along every line."""
        return self._along(self.spec.move.start)

    @property
    def target(self) -> Array:
        """Likewise."""
        return self._along(self.spec.move.target)

    def _along(self, end: Sequence[float]) -> Array:
        places = np.array([*(end[axis] for axis in self.axes.along), 0.0][:2])
        return np.array([line.along(places) for line in self.lines])

    @property
    def rise(self) -> float:
        """From start to target in m, upwards."""
        return -self.spec.move.distance[self.hoist]

    @property
    def highest(self) -> float:
        """How far the hoist itself can lift from the start in m."""
        travel, start = self.spec.limits.of(self.hoist).travel, self.spec.move.start[self.hoist]
        least = self.plant.actuated[self.hoist].lower
        return start - max(least, travel[0] if travel else least)

    @property
    def top(self) -> float:
        """How far the hoist can lift from the start in m."""
        below = min((self.headroom(zone) for zone in self.zones if self.passes(zone)), default=math.inf)
        return min(self.highest, max(below, self.rise, 0.0))

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
        return float(np.linalg.norm(self.target - self.start))

    def passes(self, zone: StackZone) -> bool:
        """Whether a body has to go over a stack, or below what is overhead."""
        if self.guide is not None:
            return self.guide.crosses(zone.area)
        sides = self._sides(zone)
        return len(set(sides)) > 1 or (zone.overhead and sides[0] == (-math.inf, math.inf))

    def is_wall(self, zone: StackZone) -> bool:
        """Whether a body goes around it: something overhead, or too high to be lifted over."""
        assert self.guide is not None
        lift = zone.top - float(self.hang[:, zone.body].min())
        return zone.overhead or lift > self.highest

    def goes_around(self, zone: StackZone) -> bool:
        """Whether a body leaves the straight way to its target for it."""
        if self.guide is None or not self.is_wall(zone):
            return False
        return blocks(zone.area, self.guide.route[0], self.guide.route[-1])

    def guided_by(self, places: Array, window: float) -> "Bay":
        """Let lines turn as bodies go at even times, (times, bodies, 2)."""
        assert self.guide is not None
        return attrs.evolve(self, guide=self.guide.going(places, window))

    def alone(self) -> "Bay":
        """Leave the nominal machine only."""
        return attrs.evolve(self, machines=self.machines[:1], hang=self.hang[:1])

    def quickest_travel(self) -> float:
        """Least time in s that the trolley takes by itself."""
        if self.guide is not None:
            return sum(self.legs(self.guide.route))
        return self.directly()

    def directly(self) -> float:
        """Least time in s straight to the target, whatever is in the way."""
        return self._travel(self.target - self.start)

    def legs(self, route: Sequence[tuple[float, float]]) -> list[float]:
        """Least times in s from corner to corner of a route, resting at each."""
        return [self._travel(way) for way in np.diff(np.array(route), axis=0)]

    def _travel(self, ways: Array) -> float:
        pairs = zip(ways.tolist(), self.limits, strict=True)
        return max(least_time(way, _rates(limits)) if way else 0.0 for way, limits in pairs)

    def quickest_lift(self, lift: float) -> float:
        """Least time in s that the hoist takes to rest at a height and go on from there to the target."""
        return least_time(lift, self.rates) + least_time(self.rise - lift, self.rates)

    def quickest_pass(self) -> float:
        """Estimate the least time in s in which the hoist holds loads above stacks until the trolley is past.

        It goes at full speed from before one stack to behind another one; ways around something count for
        nothing. As loads swing, it may take longer, or less.
        """
        passed = [zone for zone in self.zones if self.passes(zone) and not zone.overhead]
        speed = self.limits[0].velocity or UNLIMITED
        ends = np.array([(zone.low, zone.high) for zone in passed]).reshape(-1, 2)
        (before, behind) = np.sort(np.sign(self.target[0] - self.start[0]) * ends).T
        ways = behind - before[:, None] if self.guide is None else np.zeros((len(passed), len(passed)))

        def excess(duration: float) -> float:
            up = self.lifted(duration, self.top)
            if up is None or up.peak() < self.needed:
                return math.inf
            fine = np.linspace(0.0, duration, FINE)
            lift = up.at(fine)[:, 0]
            held = [_crossings(fine, self.hang[:, zone.body].min() + lift, zone.top) for zone in passed]
            rises, falls = np.array(held).reshape(-1, 2).T
            lacking = np.where(ways > 0.0, ways / speed - (falls - rises[:, None]), -math.inf)
            return float(lacking.max(initial=-duration)) / duration

        found = least(excess, self.quickest_lift(self.needed), OVER)
        return self.quickest_lift(self.needed) if found is None else found

    def lifted(self, duration: float, top: float, waits: tuple[float, float] = (0.0, 0.0)) -> Pieces | None:
        """Find the hoist's motion upwards, at most as high as the top; none in too little time."""
        motion = highest(duration - sum(waits), self.rise, top, self.rates)
        return motion if motion is None or not any(waits) else motion.within(*waits)

    def _sides(self, zone: StackZone) -> tuple[tuple[float, float], tuple[float, float]]:
        """Between which places a body may be while it is low, before a stack and after it."""
        return _side(zone, float(self.start[0])), _side(zone, float(self.target[0]))

    def sides(self, machine: int, body: int, up: Pieces, times: Array) -> tuple[Numbers, Array, Array]:
        """Tell on which sides of lines a body of a machine has to be, as a hoist lifts it.

        Returns
        -------
        rows, normals, most : (rows,), (rows, lines) and (rows,) arrays
            Numbers of times, and ``normal · place ≤ most`` at them.
        """
        if self.guide is not None:
            return self._around(machine, body, up, times)
        low, high = self._bounds(machine, body, up, times)
        held = [np.flatnonzero(np.isfinite(bound)) for bound in (high, low)]
        signs = np.repeat([[1.0], [-1.0]], [len(rows) for rows in held], axis=0)
        return np.concatenate(held), signs, np.concatenate([high[held[0]], -low[held[1]]])

    def _around(self, machine: int, body: int, up: Pieces, times: Array) -> tuple[Numbers, Array, Array]:
        """Tell the sides in plan view: of lines past areas while a body is low, of its own place else.

        Between two times a body may not cut a corner, so the lines of both hold at each.
        """
        assert self.guide is not None
        fine = np.linspace(0.0, up.duration, FINE)
        level = self.hang[machine, body] + up.at(fine)[:, 0]
        found = [(np.zeros(0, dtype=np.intp), np.zeros((0, 2)), np.zeros(0))]
        between = np.concatenate([times[:1], (times[:-1] + times[1:]) / 2.0, times[-1:]])
        for zone in self.zones:
            if zone.body != body or (zone.overhead and (self.passes(zone) or level.max() <= zone.top)):
                continue
            rises, falls = (up.duration, 0.0) if zone.overhead else _crossings(fine, level, zone.top)
            normals, most = self.guide.lines(zone.area, body, rises / up.duration, falls / up.duration)
            last = len(most) - 1
            early, late = (
                np.clip(np.round(one / up.duration * last), 0, last).astype(np.intp)
                for one in (between[:-1], between[1:])
            )
            low = (times <= rises + EDGE, times >= falls - EDGE)
            for own, counts in zip((self._own(zone, 0), self._own(zone, -1)), low, strict=True):
                rows = np.flatnonzero(counts)
                if own is not None:
                    lines, limits = own
                    found.append(
                        (np.repeat(rows, 4), np.tile(lines, (len(rows), 1)), np.tile(limits, len(rows)))
                    )
                    continue
                found.append((rows, normals[early[rows]], most[early[rows]]))
                other = rows[(normals[early[rows]] != normals[late[rows]]).any(axis=1)]
                found.append((other, normals[late[other]], most[late[other]]))
        rows, normals, most = (np.concatenate(one) for one in zip(*found, strict=True))
        return rows, normals, most

    def _own(self, zone: StackZone, end: int) -> tuple[Array, Array] | None:
        """Lines around a body's own place where it starts or ends within a zone; none elsewhere."""
        assert self.guide is not None
        x, y = self.guide.route[end]  # a course in too little time may end elsewhere
        if not zone.area.holds((x, y)):
            return None
        own = next(one for one in zone.own if float(one.outside(x, y)) <= 0.0)
        normals = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        return normals, np.array([own.x[1], -own.x[0], own.y[1], -own.y[0]])

    def _bounds(self, machine: int, body: int, up: Pieces, times: Array) -> tuple[Array, Array]:
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
        still = self.still(0)[:, :, 0]
        low = [zone for zone in self.zones if self.hang[0, zone.body] + self.rise < zone.top]
        rooms = [(zone, float(zone.beside(*still[zone.body]))) for zone in low]
        return min(rooms, key=lambda pair: pair[1], default=(None, math.inf))

    def still(self, machine: int) -> Array:
        """Where the bodies of a machine hang at the target in m, and their derivatives by its state.

        Returns
        -------
        (bodies, lines, 1 + states) array
        """
        state, lines = np.zeros(self.others.states), len(self.lines)
        state[: self.others.carried : CARRIED] = self.target
        hoist = np.array([self.spec.move.target[self.hoist], 0.0, 0.0])
        seen = self.others.seen(state, hoist, self.machines[machine])[:-lines]
        return seen.reshape(-1, lines, seen.shape[-1])

    def events(self, machine: int, up: Pieces) -> Array:
        """List the times at which bodies of a machine cross the heights of stacks."""
        fine = np.linspace(0.0, up.duration, FINE)
        lifted = up.at(fine)[:, 0]
        crossed = [_crossings(fine, self.hang[machine, zone.body] + lifted, zone.top) for zone in self.zones]
        return np.unique([time for pair in crossed for time in pair if 0.0 < time < up.duration])


def bay_of(spec: Spec, reserve: float = 0.0, guide: Guide | None = None) -> Bay:
    """State the path of a spec over its stacks, with so much more clearance in m, straight or guided."""
    plant, path, move = spec.machine(), spec.path, spec.move
    axes = path_axes(plant, spec.plant.parameters)
    assert path is not None and axes is not None  # as the spec's rules hold
    lines = PLAN if guide is not None else (axes.line(move.start, move.target),)
    swings = swings_along(plant, axes, lines, linearize(plant, spec.plant.parameters, move.target))
    sideways, above = path.clearances
    wider = attrs.evolve(path, clearance=(sideways + reserve, above + reserve))
    named = _machines(spec, plant)
    ends = [hanging(plant, spec.plant.parameters, q_a) for q_a in (move.start, move.target)]
    hang = np.array([[z for *_, z in hanging(plant, values, move.start)] for values in named])
    desensitized = tuple(spec.robustness.uncertain) if spec.robustness.method == "sensitivity" else ()
    pairs = zip(zones(wider, ends), zones(path, ends), strict=True)
    return Bay(
        spec=spec,
        plant=plant,
        axes=axes,
        lines=lines,
        moving=swings[1],
        nominal=swing_of(plant, axes, *swings, desensitized),
        others=swing_of(plant, axes, *swings, ()),
        machines=parameter_rows(plant, named),
        hang=hang,
        zones=tuple(_met(pairs, lines, ends)),
        guide=guide,
    )


def _met(
    pairs: Iterable[tuple[StackZone, StackZone]],
    lines: tuple[StraightWay, ...],
    ends: Sequence[Sequence[Place]],
) -> Iterator[StackZone]:
    """Take what is on the way, a little wider: of one line, from which loads do not sway away, or all."""
    for wide, zone in pairs:
        places = np.array([end[zone.body][:2] for end in ends])
        if len(lines) == 2:
            x, y = (
                _up_to_ends(
                    (wide.area.x, wide.area.y)[k], (zone.area.x, zone.area.y)[k], places[:, k].tolist()
                )
                for k in range(2)
            )
            yield attrs.evolve(wide, area=Area(x, y))
            continue
        met, met_wide = zone.on(lines[0]), wide.on(lines[0])
        if met is not None and met_wide is not None:
            along = lines[0].along(places).tolist()
            yield attrs.evolve(met_wide, area=Area(_up_to_ends(met_wide.area.x, met.area.x, along)))


def _up_to_ends(
    wide: tuple[float, float], span: tuple[float, float], places: Sequence[float]
) -> tuple[float, float]:
    """Widen a span up to where a body starts or ends at most, which else would be within it."""
    low = max([wide[0], *(x for x in places if x <= span[0])])
    high = min([wide[1], *(x for x in places if x >= span[1])])
    return low, high


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
