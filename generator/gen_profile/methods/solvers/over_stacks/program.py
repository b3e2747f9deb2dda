"""The trolley's convex program for a duration and a hoist's motion: all machines linear about what they did.

Variables are changes of the trolley's jerks in every interval and of all states at its begin; what a load may
do while it is low are linear bounds of its place, at steps and at the instants at which it crosses a height.
"""

import math
from functools import cached_property, partial

import attrs
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from gen_profile.dynamics.problem.linearization import linearize
from gen_profile.methods.solvers.direct.conic import ConicProgram, ConicStatus, Entries, place, squares
from gen_profile.methods.solvers.over_stacks.bay import Bay
from gen_profile.methods.solvers.over_stacks.hoist import Pieces
from gen_profile.methods.solvers.over_stacks.swing import CARRIED, FollowedMachines, followed
from gen_profile.motion.profile import Array

INTERVAL = 0.4  # s, about, of constant jerk
MOST_INTERVALS = 200  # longer ones have more steps of integration
ROUNDING = 0.25  # of an interval, by which it may be longer than usual
STEPS, FEW_STEPS = 8, 4  # in each interval; few suffice as long as durations are searched roughly
MARGIN = 0.3  # m, of spare room that is worth knowing
MISSING = 30.0  # times a metre too near to a stack, a metre beside the target counts
SMOOTH = 1e-4  # of the squared jerk's mean, beside a metre of room
DEAR = 1e3  # times the squared jerk's mean, a metre too near counts where the jerk is what is minimised
KEPT_SWAY = 0.998  # share of the limit of sway that is kept at steps, for what lies between them
KEPT_RESIDUAL = 0.98  # likewise of residual sway
TURNS = 24  # times within half a period, at which residual sway is held to its limit

Numbers = NDArray[np.intp]


@attrs.frozen(kw_only=True, eq=False)
class Course:
    """The trolley's motion by jerks in even intervals, and what every machine does under it.

    Attributes
    ----------
    up : Pieces
        The hoist's motion, upwards.
    jerks : (intervals, lines) array
    nodes : tuple of arrays
        States of the nominal machine at the begin and end of every interval, (intervals + 1, n), and of the
        others, (machines, intervals + 1, n).
    room : float
        m, that is left to the stacks beyond the clearance; negative where it is missing.
    miss : float
        m, between its end and the target.
    smooth : bool
        Whether it is the smoothest one.
    """

    up: Pieces
    jerks: Array
    nodes: tuple[Array, Array]
    room: float = -math.inf
    miss: float = 0.0
    smooth: bool = False


def resting(bay: Bay, up: Pieces) -> Course:
    """Begin where everything hangs still at the start."""
    intervals = min(max(math.ceil(up.duration / INTERVAL), 4), MOST_INTERVALS)
    begin = np.tile(bay.begin, (intervals + 1, 1))
    other = np.tile(bay.begin[: bay.others.states], (len(bay.machines) - 1, intervals + 1, 1))
    return Course(up=up, jerks=np.zeros((intervals, len(bay.lines))), nodes=(begin, other))


@attrs.frozen(kw_only=True, eq=False)
class Program:
    """All machines linear about a course, looked at in so many steps of every interval."""

    bay: Bay
    about: Course
    steps: int = STEPS

    @property
    def finer(self) -> int:
        """Times as many steps of integration as others, in intervals that are longer."""
        return max(1, math.ceil(self.about.up.duration / len(self.about.jerks) / INTERVAL - ROUNDING))

    @property
    def count(self) -> int:
        """Steps of integration in each interval."""
        return self.finer * self.steps

    @property
    def step(self) -> float:
        """Of integration in s."""
        return self.about.up.duration / len(self.about.jerks) / self.count

    @cached_property
    def followed(self) -> list[FollowedMachines]:
        """What the machines do, the nominal one first; each is alone along the first axis."""
        bay, about = self.bay, self.about
        intervals = len(about.jerks)
        half = np.arange(2 * self.count * intervals + 1) * self.step / 2.0
        lifted = -about.up.at(half.astype(np.float64))[:, :3]
        lifted[:, 0] += bay.spec.move.start[bay.hoist]
        rows = np.arange(intervals)[:, None] * 2 * self.count + np.arange(2 * self.count + 1)
        nominal, others = about.nodes
        follow = partial(followed, jerks=about.jerks, hoist=lifted[rows], step=self.step)
        first = follow(bay.nominal, nominal[None, :-1], bay.machines[:1])
        if not len(others):
            return [first]
        rest = follow(bay.others, others[:, :-1], bay.machines[1:])
        each = attrs.asdict(rest, recurse=False)
        return [
            first,
            *(FollowedMachines(**{k: v[m : m + 1] for k, v in each.items()}) for m in range(len(others))),
        ]

    @property
    def defect(self) -> float:
        """By how much machines are elsewhere after an interval than at the next node, in SI units."""
        nodes = [self.about.nodes[0], *self.about.nodes[1]]
        pairs = zip(self.followed, nodes, strict=True)
        return max(float(np.abs(one.states[0, :, -1] - begin[1:]).max()) for one, begin in pairs)

    @property
    def places(self) -> Array:
        """Where the nominal machine's bodies are along the lines at steps, (samples, bodies, lines)."""
        seen, lines = self.followed[0].seen[0], len(self.bay.lines)
        steps = np.concatenate([seen[:, :-1].reshape(-1, seen.shape[-1]), seen[-1, -1:]])
        return np.asarray(steps[:, :-lines].reshape(len(steps), -1, lines))

    @property
    def width(self) -> int:
        """Number of states of all machines, the trolley's once."""
        others = (len(self.bay.machines) - 1) * (self.bay.others.states - self.bay.others.carried)
        return self.bay.nominal.states + others

    @property
    def stride(self) -> int:
        """Number of variables of an interval: states and jerks."""
        return self.width + len(self.bay.lines)

    def _columns(self, machine: int) -> Numbers:
        """Where the states of a machine are among all, and the jerks behind them."""
        first, jerks = self.bay.nominal.states, np.arange(self.width, self.stride)
        if machine == 0:
            return np.concatenate([np.arange(first), jerks])
        carried = self.bay.others.carried
        own = self.bay.others.states - carried
        swing = first + (machine - 1) * own + np.arange(own)
        return np.concatenate([np.arange(carried), swing, jerks])

    def _states(self, machine: int) -> Numbers:
        return self._columns(machine)[: -len(self.bay.lines)]

    def _rows(self, intervals: Numbers, blocks: Array, machine: int = 0) -> Entries:
        """Place rows on a machine's state at the begin of intervals, and on the jerks there.

        Parameters
        ----------
        intervals : (count,) array of int
        blocks : (count, rows, n + lines) array
        """
        wide = np.zeros((*blocks.shape[:2], self.stride))
        wide[:, :, self._columns(machine)] = blocks
        return place(wide, intervals * self.stride)

    @staticmethod
    def _alone(column: int) -> Entries:
        """Take one variable by itself."""
        return place(np.ones((1, 1, 1)), np.array([column]))

    @property
    def variables(self) -> int:
        """Number of them: states and jerks, how far from the target it ends, and how much room is missing."""
        return len(self.about.jerks) * self.stride + self.width + 2

    def solve(self, *, smooth: bool) -> Course | None:
        """Find the motion with the most room; or the smoothest one, where room suffices.

        Returns
        -------
        Course or None
            None where the program was not solved.
        """
        program = ConicProgram(np.ones(self.variables))
        self._dynamics(program)
        self._trolley(program)
        self._ends(program, free=not smooth)
        for machine in range(len(self.bay.machines)):
            self._beside(program, machine)
            self._sway(program, machine)
            if machine:
                self._left(program, machine)
        least = -self._alone(self.variables - 1)
        program.at_most(least, np.array([-1.0 if smooth else MARGIN - 1.0]))
        intervals, lines = self.about.jerks.shape
        jerks = np.arange(intervals)[:, None] * self.stride + self.width + np.arange(lines)
        weight, linear = np.zeros(self.variables), np.zeros(self.variables)
        limits = np.array([one.jerk or 1.0 for one in self.bay.limits])
        scale = limits**2 * intervals / (1.0 if smooth else SMOOTH)
        weight[jerks], linear[jerks] = 1.0 / scale, self.about.jerks / scale
        linear[-1], linear[-2] = (DEAR, 0.0) if smooth else (1.0, MISSING)
        costs = squares(weight[:, None, None], np.arange(self.variables)[:, None])
        solution = program.solve(costs, linear, scaled=False)
        if solution.verdict is not ConicStatus.SOLVED:
            return None
        return attrs.evolve(self._course(solution.x, jerks), smooth=smooth)

    def _course(self, x: Array, jerks: Numbers) -> Course:
        """Take the states and jerks that a program found."""
        changes = np.append(x[:-2], np.zeros(len(self.bay.lines))).reshape(-1, self.stride)
        nominal, others = self.about.nodes
        moved = [changes[:, self._states(m + 1)] for m in range(len(others))]
        return attrs.evolve(
            self.about,
            jerks=self.about.jerks + x[jerks],
            nodes=(nominal + changes[:, : nominal.shape[1]], others + np.array(moved).reshape(others.shape)),
            room=1.0 - float(x[-1]),
            miss=float(x[-2]),
        )

    def _dynamics(self, program: ConicProgram) -> None:
        """Let every interval begin where the one before it ended, and the first at the start."""
        first = place(np.eye(self.width)[None], np.zeros(1, dtype=np.intp))
        program.equal(first, np.zeros(self.width))
        intervals = np.arange(len(self.about.jerks))
        starts = [self.about.nodes[0], *self.about.nodes[1]]
        for machine, (one, nodes) in enumerate(zip(self.followed, starts, strict=True)):
            skipped = self.bay.others.carried if machine else 0
            ends, along = one.states[0, :, -1, skipped:], one.along[0, :, -1, skipped:]
            blocks = np.zeros((len(intervals), along.shape[1], self.stride + self.width))
            blocks[:, :, self._columns(machine)] = along
            own = self.stride + self._states(machine)[skipped:]
            blocks[:, np.arange(along.shape[1]), own] = -1.0
            matrix = place(blocks, intervals * self.stride)
            program.equal(matrix, (nodes[1:, skipped:] - ends).ravel())

    def _trolley(self, program: ConicProgram) -> None:
        """Hold travel, velocity, acceleration and jerk to limits, by control points of half intervals."""
        jerks, span = self.about.jerks, self.step * self.count
        intervals = np.arange(len(jerks))
        for line, limits in enumerate(self.bay.limits):
            carried = CARRIED * line + np.arange(CARRIED)
            state = np.concatenate([self.about.nodes[0][:-1, carried], jerks[:, line, None]], axis=1)
            ranges = [(limits.travel, 0), (limits.velocity, 1), (limits.acceleration, 2), (limits.jerk, 3)]
            for stated, order in ranges:
                if stated is None:
                    continue
                low, high = stated if isinstance(stated, tuple) else (-stated, stated)
                points = _control_points(span, order)
                now = state @ points.T
                blocks = np.zeros((len(jerks), len(points), len(self._columns(0))))
                blocks[:, :, [*carried, self.bay.nominal.states + line]] = points
                matrix = self._rows(intervals, blocks)
                program.at_most(matrix, (high - now).ravel())
                program.at_most(-matrix, (now - low).ravel())

    def _ends(self, program: ConicProgram, *, free: bool) -> None:
        """End at rest, without sway or sensitivity, at the target, or as near to it as can be."""
        states = self.bay.nominal.states
        places = CARRIED * np.arange(len(self.bay.lines))
        asked = np.zeros(states)
        asked[places] = self.bay.target
        left = asked - self.about.nodes[0][-1]
        at = len(self.about.jerks) * self.stride
        rest = np.delete(np.arange(states), places)
        program.equal(place(np.eye(states)[None, rest], np.array([at])), left[rest])
        off = self._alone(self.variables - 2)
        if not free:
            program.equal(off, np.zeros(1))
        for one in places:
            reached = self._alone(at + int(one))
            program.at_most(reached + (-off), left[[one]])
            program.at_most(-(reached + off), -left[[one]])

    def _beside(self, program: ConicProgram, machine: int) -> None:
        """Keep the bodies of a machine beside stacks while they are low."""
        bay, up = self.bay, self.about.up
        every = self.steps // FEW_STEPS
        grid = np.arange(every, len(self.about.jerks) * self.count + 1, every) * self.step
        events = bay.events(machine, up)
        times = np.unique(np.concatenate([grid, events - 1e-7, events, events + 1e-7]))
        times = times[(times > 0.0) & (times <= up.duration)]
        for body in range(len(bay.plant.bodies)):
            rows, normals, most = bay.sides(machine, body, up, times)
            if not len(rows):
                continue
            intervals, now, along = self._at(machine, body, times[rows])
            matrix = self._rows(intervals, np.einsum("ki,kij->kj", normals, along)[:, None], machine)
            program.at_most(matrix, most - (normals * now).sum(axis=1), give=1.0)

    def _at(self, machine: int, body: int, times: Array) -> tuple[Numbers, Array, Array]:
        """Tell where a body of a machine is at some times, straight between steps, and its derivatives."""
        one, (intervals, lines) = self.followed[machine], self.about.jerks.shape
        number = np.minimum((times / self.step).astype(np.intp), intervals * self.count - 1)
        k, j = np.divmod(number, self.count)
        share, own = (times / self.step - number)[:, None], slice(lines * body, lines * (body + 1))
        now = (1.0 - share) * one.seen[0, k, j, own] + share * one.seen[0, k, j + 1, own]
        weights = share[:, None]
        along = (1.0 - weights) * one.seen_along[0, k, j, own] + weights * one.seen_along[0, k, j + 1, own]
        return k, now, along

    def _sway(self, program: ConicProgram, machine: int) -> None:
        """Hold the end load's sway on the way to its limit, or its length along two lines."""
        limit, lines = self.bay.spec.limits.sway, len(self.bay.lines)
        if limit is None:
            return
        one, intervals = self.followed[machine], np.arange(len(self.about.jerks))
        every = self.finer if lines == 1 else self.count // FEW_STEPS
        now, along = one.seen[0, :, every::every, -lines:], one.seen_along[0, :, every::every, -lines:]
        if lines == 1:
            matrix = self._rows(intervals, along[:, :, 0], machine)
            program.at_most(matrix, (KEPT_SWAY * limit - now).ravel())
            program.at_most(-matrix, (KEPT_SWAY * limit + now).ravel())
            return
        count = now.shape[0] * now.shape[1]
        blocks = np.concatenate([np.zeros_like(along[:, :, :1]), along], axis=2)
        matrix = self._rows(intervals, blocks.reshape(len(intervals), -1, along.shape[-1]), machine)
        sides = np.concatenate([np.full((count, 1), KEPT_SWAY * limit), -now.reshape(count, lines)], axis=1)
        program.within_cones(matrix, sides)

    def _left(self, program: ConicProgram, machine: int) -> None:
        """Hold what a machine swings by at the target to the limits of residual sway, and off stacks."""
        bay, up, at = self.bay, self.about.up, len(self.about.jerks) * self.stride
        carried = bay.others.carried
        gain, turns = _swinging_on(bay, machine)
        sways = np.concatenate([gain, np.zeros_like(gain)], axis=1)
        stated, ways = np.array(list(bay.spec.check.residual_sway.values())), bay.plant.directions
        groups = stated.reshape(-1, ways if len(stated) % ways == 0 else len(stated))
        alike = groups.min(axis=1).repeat(groups.shape[1])  # along one line, of both directions
        limits = KEPT_RESIDUAL * (alike if len(bay.lines) == 1 else stated)
        held = [] if bay.spec.robustness.method == "none" else [(sways, limits, 0.0)]
        for body, still in enumerate(bay.still(machine)):
            _, normals, most = bay.sides(machine, body, up, np.array([up.duration]))
            held.append((normals @ still[:, 1 + carried :], most - normals @ still[:, 0], 1.0))
        last = self.about.nodes[1][machine - 1][-1, carried:]
        for outputs, limit, give in held:
            if not len(limit):
                continue
            shown = np.concatenate([outputs @ turn for turn in turns])
            wide = np.zeros((1, len(shown), self.width))
            wide[0, :, self._states(machine)[carried:]] = shown.T
            for sign in (1.0, -1.0):
                side = np.tile(limit, len(turns)) - sign * shown @ last
                program.at_most(place(sign * wide, np.array([at])), side, give=give)


def _swinging_on(bay: Bay, machine: int) -> tuple[Array, list[Array]]:
    """Linearise a machine at the target: sways by what moves, and what (q_u, q̇_u) becomes later."""
    plant, target, moving = bay.plant, bay.spec.move.target, list(bay.moving)
    names = [parameter.name for parameter in plant.parameters]
    linear = linearize(plant, dict(zip(names, bay.machines[machine].tolist(), strict=True)), target)
    stiffness, damping = (one[np.ix_(moving, moving)] for one in (linear.stiffness, linear.damping))
    n = len(stiffness)
    periods = 0.5 if n == 1 else 3.0
    times = TURNS * (1 if n == 1 else 4)
    step = periods * 2.0 * math.pi / float(linear.frequencies[0]) / times
    once = expm(step * np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]]))
    turns = [np.eye(2 * n)]
    for _ in range(times - 1):
        turns.append(turns[-1] @ once)
    return linear.sway_gain[:, moving], turns


def _control_points(span: float, order: int) -> Array:
    """Bernstein coefficients of a derivative in both halves of an interval, by (x, v, a, jerk) at its begin.

    They bound the derivative (G. Farin, Curves and Surfaces for CAGD, 2002, section 5.1).
    """
    half = span / 2.0

    def state(t: float) -> Array:
        powers = [
            [t ** (p - d) / math.factorial(p - d) if p >= d else 0.0 for p in range(4)] for d in range(4)
        ]
        return np.array(powers)

    degree = 3 - order
    found: list[Array] = []
    for begin in (0.0, half):
        at = state(begin)
        # blossoms: c_i = Σ_k binom(i, k) / binom(degree, k) · half^k / k! · k-th derivative
        for i in range(degree + 1):
            weights = [
                math.comb(i, k) / math.comb(degree, k) * half**k / math.factorial(k) for k in range(i + 1)
            ]
            found.append(np.sum([w * at[order + k] for k, w in enumerate(weights)], axis=0))
    found.append(state(span)[order])
    return np.unique(np.array(found), axis=0)
