"""A certificate against its artefact and spec: every claim of the spec is in it, and is proved."""

from __future__ import annotations

import hashlib
import signal
import zlib
from collections.abc import Callable, Container, Mapping
from fractions import Fraction
from itertools import combinations, pairwise, product
from math import inf, pi, prod
from multiprocessing import get_all_start_methods, get_context
from typing import Any

from flint import acb_mat, arb, ctx

from gen_profile_recheck.axes import axis_pieces, quintic
from gen_profile_recheck.boxes import MachineBox, MotionPiece
from gen_profile_recheck.enclosure import SwayClaim, prove
from gen_profile_recheck.jets import derivatives
from gen_profile_recheck.machines import MACHINES
from gen_profile_recheck.reading import (
    FORMAT,
    KEYS,
    NotProvedError,
    ProofMaterial,
    ranges_of,
    read_json,
    read_setpoints,
    require,
    spec_of,
)

PRECISION = 64  # bits of balls
SAME = 1e-9  # relative, by which what is stated may be off for rounding
NEAR, STANDING = 1e-6, 1e-7  # of a move, within which an axis is at its ends and travel, and stands
OVERSHOOT = {"velocity": 0.02, "acceleration": 0.4}  # beyond limits of the axes, beside rounding
KINDS = {"velocity": "s", "acceleration": "s²", "jerk": "s³"}
OF_AXIS = {*KINDS, "travel"}
OF_SPEC = {"name", "plant", "move", "actuator", "robustness", "cost", "solver", "limits", "check", "axis"}
OF_SPEC |= {"export", "can", "planner"}
OF_CHECK = {"residual_sway", "uncertain", "spans", "samples", "seed", "path", "wind"}
ALLOWED = 1.01  # of limits.sway
SHORTEST_WATCH = 4.0  # s; or two of the slowest periods

DAMAGED = (KeyError, TypeError, ValueError, AttributeError, IndexError, ArithmeticError, zlib.error)
Progress = Callable[[int, int], None]  # gets how many boxes are done, of how many

TRUST = """Trusted: that python-flint (Arb) encloses what it computes, Python runs this program as it is
written, and SHA-256 has no collisions; that the controller issues the artefact's positions at their
times (a function block those of its table: its statements are not looked at), and the drives join them
by straight lines, the shorter way round for a modulo axis; and that the machine has the
equations in machines.py, with constant parameters.
Nothing of the program that made the artefact is used."""


def check(
    artefact: bytes,
    spec: bytes,
    certificate: bytes,
    progress: Progress = lambda done, boxes: None,
    processes: int = 1,
) -> str:
    """Prove again what a certificate says of an artefact and a spec (or its manifest), and report it.

    Boxes are shared among processes where the system can fork.

    Raises
    ------
    NotProvedError
        Why it is not.
    """
    ctx.prec = PRECISION
    document, digest = read_json(certificate), hashlib.sha256(artefact).hexdigest()
    known = isinstance(document, dict) and document.get("format") == FORMAT
    require(known, f"the certificate is none of the kind {FORMAT!r}")
    require("clearance" not in document, "not covered: the clearance of a path")
    wrong = sorted(KEYS ^ document.keys())
    require(not wrong, f"the certificate lacks {', '.join(wrong)}, or should not have it")
    require(digest == document["artefact_sha256"], "the certificate is about another artefact")
    try:
        case = Case(artefact, spec_of(read_json(spec), digest, document["spec_sha256"]), document)
        case.require_move()
        case.require_setpoints()
        case.require_times()
        case.require_cover()
        case.prove(progress, processes)
        return case.words()
    except DAMAGED as error:
        name = type(error).__name__
        raise NotProvedError(f"a file is damaged, or not covered ({name}: {error})") from error


class Case:
    """A certificate's document and what it is about.

    Raises
    ------
    NotProvedError, or DAMAGED
        By all methods.
    """

    def __init__(self, artefact: bytes, spec: Mapping[str, Any], document: Mapping[str, Any]) -> None:
        require(spec["plant"].get("type") in MACHINES, "not covered: machines that are not in machines.py")
        require(spec["actuator"] == {"type": "ideal"}, "not covered: drives that lag behind their setpoints")
        machine, limits, initial = MACHINES[spec["plant"]["type"]], spec["limits"], spec["move"]["initial"]
        tables: list[tuple[Any, Container[str]]] = [(one, OF_AXIS) for one in limits["axis"].values()]
        tables += [(spec, OF_SPEC), (spec["check"], OF_CHECK), (limits, OF_AXIS | {"sway", "axis"})]
        tables += [(limits["axis"], machine.axes), (initial, machine.states)]
        more = [key for table, known in tables for key in table if key not in known]
        require(not more, f"not covered: {', '.join(more)} in the spec")
        self.machine, self.spec, self.document, self.ranges = machine, spec, document, ranges_of(spec)
        claimed = {name: tuple(ends) for name, ends in document["ranges"].items()}
        require(claimed == self.ranges, "the certificate is about other ranges")
        self.parameters = {name: one for name, one in spec["plant"].items() if isinstance(one, (int, float))}
        self.setpoints = read_setpoints(artefact, spec, machine.axes)
        self.proof = ProofMaterial(document, 2 * len(machine.coordinates), len(machine.axes))

    def words(self) -> str:
        """Say what is proved."""
        document, way = self.document, self.document["on_the_way"]
        named = ", ".join(f"{name} from {low:.6g} to {high:.6g}" for name, (low, high) in self.ranges.items())
        bounds = ", ".join(f"{load} {1e3 * bound:.6g} mm" for load, bound in document["bounds_m"].items())
        times = f"from {document['from_s']:.6g} s to {document['until_s']:.6g} s"
        on_the_way = "" if way is None else f"; at any time {way['load']} {1e3 * way['bound_m']:.6g} mm"
        machines = f"Proved of all machines with {named or 'nominal parameters'}"
        return f"{machines}: {times} at most {bounds}{on_the_way}."

    def _limits(self, axis: str) -> Mapping[str, Any]:
        limits = self.spec["limits"]
        return {**limits, **limits["axis"].get(axis, {})}

    def require_move(self) -> None:
        """Require the move that the spec asks for: its ends, its time and its travel."""
        move, setpoints = self.spec["move"], self.setpoints
        times, cycle, speeds = setpoints.times, setpoints.cycle, move["final_velocity"]
        due = times[-1] if (shortest := move["duration"] == "minimum") else move["duration"]
        sizes = [abs(end - start) for start, end in zip(move["start"], move["target"], strict=True)]
        longest, arrived = max(sizes) or 1.0, 0
        for n, (name, size, speed) in enumerate(zip(self.machine.axes, sizes, speeds, strict=True)):
            positions, resolution = setpoints.positions[n], setpoints.resolution[n]
            near, end = NEAR * (size or longest) + resolution, move["target"][n] + (times[-1] - due) * speed
            off = max(abs(positions[0] - move["start"][n]), abs(positions[-1] - end))
            fits = off <= near + shortest * cycle * abs(speed)
            require(fits, f"the setpoints do not move {name} from where to where the spec asks")
            low, high = self._limits(name).get("travel", (-inf, inf))
            fits = low - near <= min(positions) and max(positions) <= high + near
            require(fits, f"the setpoints take {name} beyond its travel")
            onward = (positions[-1] + (time - times[-1]) * speed for time in times)
            away = (abs(one - other) for one, other in zip(positions, onward, strict=True))
            still = STANDING * longest + resolution / 2
            arrived = max([arrived, *(row for row, one in enumerate(away, start=1) if not one <= still)])
        late, early = times[max(arrived - 1, 0)] >= due * (1 - SAME), times[-1] + cycle <= due * (1 + SAME)
        require(not (late or early), "the setpoints arrive at another time than the spec asks")

    def require_setpoints(self) -> None:
        """Require what is said of velocity, acceleration and jerk, where the spec limits them only."""
        said, asked = self.document["setpoints"], dict[str, dict[str, Any]]()
        for number, name in enumerate(self.machine.axes):
            length, own = "rad" if name in ("slew", "hub") else "m", self._limits(name)
            for order, (kind, per) in enumerate(KINDS.items(), start=1):
                if (limit := own.get(kind)) is None:
                    continue
                rounding = 2 ** (order - 1) * self.setpoints.resolution[number] / self.setpoints.cycle**order
                claim = {**said[name][kind], "limit": limit, "unit": f"{length}/{per}"}
                asked.setdefault(name, {})[kind] = claim
                most = (1 + OVERSHOOT.get(kind, inf)) * limit + rounding
                fits = self._difference(number, order) <= claim["bound"] * (1 + SAME)
                require(fits, f"the setpoints ask {name} for more {kind} than is said")
                require(claim["bound"] <= most, f"the setpoints break the limit of {kind} of {name}")
                fits = abs(claim["rounding"] - rounding) <= SAME * rounding and len(claim) == 4
                require(fits, f"the rounding of {kind} of {name} is another")
        require(said == asked, "something else is said of setpoints than the spec limits")

    def _difference(self, axis: int, order: int) -> float:
        """Bound an axis' difference quotients, with those before the first and after the last setpoint."""
        cycle, velocity = self.setpoints.cycle, arb(self.spec["move"]["final_velocity"][axis])
        quotients = [arb(one) for one in self.setpoints.positions[axis]]
        after = [quotients[-1] + n * cycle * velocity for n in range(1, order)]
        quotients = quotients[:1] * (order - 1) + quotients + after
        for _ in range(order):
            quotients = [(after - before) / cycle for before, after in pairwise(quotients)]
        return max(float(abs(one).upper()) for one in quotients)

    def require_times(self) -> None:
        """Require that sways are bounded for as long as the check watches them."""
        begin, until, knots = self.document["from_s"], self.document["until_s"], self.proof.knots
        times = self.setpoints.times
        moving = {knot for knot in knots if knot <= times[-1]}
        ends = begin == times[-1] and knots[0] == times[0] and times[-1] in moving
        fits = ends and moving <= set(times)
        require(fits, "the certificate's motion of the axes does not belong to the setpoints")
        corners = [dict(zip(self.ranges, ends, strict=True)) for ends in product(*self.ranges.values())]
        corners = corners if len(self.ranges) <= 3 else [corners[0], corners[-1]]
        changes = [{}, *corners, *({name: end} for name, ends in self.ranges.items() for end in ends)]
        slowest = min(self._frequency(self.parameters | change) for change in changes)
        watched = max(SHORTEST_WATCH, 4 * pi / slowest)
        fits = watched * (1 - SAME) <= until - begin and until <= knots[-1]
        require(fits, "the sway is not bounded for as long as the check watches it")

    def _frequency(self, parameters: Mapping[str, float]) -> float:
        """Find the slowest frequency at the target in rad/s, which bounds nothing but how long to watch."""
        axes, still = [arb(one) for one in self.spec["move"]["target"]], [arb(0)] * self.proof.coordinates
        k = self.machine.constants({name: arb(value) for name, value in parameters.items()})
        q, dq, v = still[::2], still[::2], [arb(0)] * len(axes)
        pulls = derivatives(lambda q: self.machine.at(q, axes, k).drift(dq, v), q)
        values = acb_mat([[-arb(one) for one in row] for row in pulls]).eig(algorithm="approx")
        return float(min(float(one.real.mid()) for one in values) ** 0.5)

    def require_cover(self) -> None:
        """Require that boxes are disjoint, and together everything."""
        parts, count = self.proof.parts, len(self.ranges)
        inside = len(self.proof.terms) == count and all(
            len(box) == count and all(0 <= index < 2**level for level, index in box) for box in parts
        )
        volume = sum((Fraction(1, prod(2**level for level, _ in box)) for box in parts), Fraction(0))
        apart = (not all(map(_meet, *pair)) for pair in combinations(parts, 2))
        whole = inside and volume == 1 and all(apart)
        require(whole, "the boxes are not all machines of the ranges, each of them once")

    def claims(self) -> list[SwayClaim]:
        """List the bounds that are claimed, which must be all that the spec asks, and keep its limits."""
        limits, bounds, way = (self.document[name] for name in ("limits_m", "bounds_m", "on_the_way"))
        loads, sway = self.machine.loads, self.spec["limits"].get("sway")
        fits = limits == self.spec["check"]["residual_sway"] and set(loads) == limits.keys() == bounds.keys()
        require(fits, "the certificate is about other limits than the spec's, or other loads")
        arrived = self.proof.knots.index(self.setpoints.times[-1])
        claims = [SwayClaim(slice(n, n + 1), arrived, bounds[load]) for n, load in enumerate(loads)]
        kept, asked = [bounds[load] <= limits[load] for load in loads], None
        if sway is not None:
            name, both = self.machine.end_load
            asked = {"load": name, "bound_m": way["bound_m"], "limit_m": ALLOWED * sway}
            kept.append(way["bound_m"] <= asked["limit_m"])
            claims.append(SwayClaim(both, 0, way["bound_m"]))
        require(way == asked, "the certificate says something else of the sway on the way than the spec")
        require(all(kept), "a bound is above its limit")
        return claims

    def prove(self, progress: Progress, processes: int) -> None:
        """Prove all boxes, each of which needs nothing of the others."""
        proof, setpoints, pieces = self.proof, self.setpoints, list(pairwise(self.proof.knots))
        halves, axes = [(arb(end) - begin) / 2 for begin, end in pieces], []
        speeds = self.spec["move"]["final_velocity"]
        for positions, ends, velocity in zip(setpoints.positions, proof.ends, speeds, strict=True):
            smooth = [quintic(half, *one) for half, one in zip(halves, ends, strict=True)]
            axes.append(list(axis_pieces(proof.knots, smooth, setpoints.times, positions, velocity)))
        start = [self.spec["move"]["initial"].get(name, 0.0) for name in self.machine.states]
        claims, numbers = self.claims(), range(len(proof.parts))

        def prove_box(number: int) -> None:
            box = MachineBox(self.machine, self.parameters, self.ranges, proof.parts[number], proof.terms)
            motion = zip(halves, zip(*axes, strict=True), proof.motion(number), strict=True)
            pieces = [MotionPiece(box, half, own, *series) for half, own, series in motion]
            prove(pieces, list(proof.scales(number)), start, claims)

        if processes == 1 or len(numbers) == 1 or "fork" not in get_all_start_methods():
            for done, _ in enumerate(map(prove_box, numbers), start=1):
                progress(done, len(numbers))
            return
        _shared[:] = [prove_box]
        ignoring = signal.signal, (signal.SIGINT, signal.SIG_IGN)  # the first process ends the others
        with get_context("fork").Pool(min(processes, len(numbers)), *ignoring) as pool:
            for done, _ in enumerate(pool.imap_unordered(_prove_shared, numbers), start=1):
                progress(done, len(numbers))


_shared: list[Callable[[int], None]] = []  # what forked processes find here


def _prove_shared(number: int) -> None:
    _shared[0](number)


def _meet(one: tuple[int, int], other: tuple[int, int]) -> bool:
    (level, index), (deeper, inside) = sorted((one, other))
    return inside >> (deeper - level) == index
