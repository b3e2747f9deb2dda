"""A certificate against its artefact and spec: every claim of the spec is in it, and is proved."""

from __future__ import annotations

import hashlib
import signal
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, pairwise, product
from math import prod
from multiprocessing import get_all_start_methods, get_context
from typing import Any

from flint import acb_mat, arb, ctx

from gen_profile_recheck.axes import axis_pieces, quintic
from gen_profile_recheck.boxes import MachineBox, MotionPiece
from gen_profile_recheck.enclosure import MANY_MORE, BoxProof, NotProvedError, SwayClaim
from gen_profile_recheck.jets import along, moved
from gen_profile_recheck.machines import MACHINES, Machine
from gen_profile_recheck.reading import (
    FORMAT,
    KEYS,
    ProofMaterial,
    TimedSetpoints,
    ranges_of,
    read_json,
    read_setpoints,
    spec_of,
)

PRECISION = 64  # bits of balls
SAME = 1e-9  # relative, by which what is stated may be off for rounding
OVERSHOOT = {"velocity": 0.02, "acceleration": 0.4}  # beyond limits of the axes, beside rounding
KINDS = {"velocity": "s", "acceleration": "s²", "jerk": "s³"}
ALLOWED = 1.01  # of limits.sway
SHORTEST_WATCH = 4.0  # s; or two of the slowest periods

Progress = Callable[[int, int], None]  # gets how many boxes are done, of how many

TRUST = """Trusted: that python-flint (Arb) encloses what it computes, Python runs this program as it is
written, and SHA-256 has no collisions; that the controller issues the artefact's positions at their
times (a function block those of its table: its statements are not looked at), and the drives join them
by straight lines; and that the machine has the equations in machines.py, with constant parameters.
Nothing of the program that made the artefact is used."""


@dataclass(frozen=True)
class Case:
    """What a certificate is about, and the certificate's document."""

    machine: Machine
    spec: Mapping[str, Any]
    setpoints: TimedSetpoints
    ranges: Mapping[str, tuple[float, float]]
    document: Mapping[str, Any]

    @property
    def parameters(self) -> dict[str, float]:
        """Nominal values of the machine's parameters."""
        return {name: value for name, value in self.spec["plant"].items() if isinstance(value, (int, float))}


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
    document = read_json(certificate)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise NotProvedError(f"the certificate is none of the kind {FORMAT!r}")
    if wrong := sorted(KEYS ^ document.keys()):
        raise NotProvedError(f"the certificate lacks {', '.join(wrong)}, or should not have it")
    if hashlib.sha256(artefact).hexdigest() != document["artefact_sha256"]:
        raise NotProvedError("the certificate is about another artefact")
    try:
        case = _case(artefact, spec_of(read_json(spec), document["spec_sha256"]), document)
        _require_setpoints(case)
        _require_times(case)
        _prove(case, progress, processes)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise NotProvedError(
            f"a file is damaged, or not covered ({type(error).__name__}: {error})"
        ) from error
    return _words(case)


def _case(artefact: bytes, spec: Mapping[str, Any], document: Mapping[str, Any]) -> Case:
    machine = MACHINES.get(spec["plant"].get("type"))
    if machine is None:
        raise NotProvedError("not covered: machines other than those in machines.py")
    if spec["actuator"]["type"] != "ideal":
        raise NotProvedError("not covered: drives that lag behind their setpoints")
    if "foreign" in spec["check"] or "fmu" in spec["check"]:
        raise NotProvedError("not covered: a foreign model of the machine (check.fmu)")
    ranges = ranges_of(spec)
    if {name: tuple(ends) for name, ends in document["ranges"].items()} != ranges:
        raise NotProvedError("the certificate is about other ranges")
    return Case(
        machine=machine,
        spec=spec,
        setpoints=read_setpoints(artefact, spec, machine.axes),
        ranges={name: ranges[name] for name in document["ranges"]},
        document=document,
    )


def _words(case: Case) -> str:
    document, way = case.document, case.document["on_the_way"]
    bounds = ", ".join(f"{load} {1e3 * bound:.6g} mm" for load, bound in document["bounds_m"].items())
    on_the_way = "" if way is None else f"; at any time {way['load']} {1e3 * way['bound_m']:.6g} mm"
    named = ", ".join(f"{name} from {low:.6g} to {high:.6g}" for name, (low, high) in case.ranges.items())
    times = f"from {document['from_s']:.6g} s to {document['until_s']:.6g} s"
    return (
        f"Proved of all machines with {named or 'nominal parameters'}: {times} at most {bounds}{on_the_way}."
    )


def _require_setpoints(case: Case) -> None:
    """Require what is said of velocity, acceleration and jerk, where the spec limits them only."""
    limits, said, cycle = case.spec["limits"], case.document["setpoints"], case.setpoints.cycle
    asked = {}
    for number, name in enumerate(case.machine.axes):
        own = {**limits, **limits.get("axis", {}).get(name, {})}
        orders = [(n, kind) for n, kind in enumerate(KINDS, start=1) if own.get(kind) is not None]
        for order, kind in orders:
            rounding = 2 ** (order - 1) * case.setpoints.resolution[number] / cycle**order
            largest, claim = _difference(case, number, order), said[name][kind]
            if not largest <= claim["bound"] * (1 + SAME):
                raise NotProvedError(f"the setpoints ask {name} for more {kind} than is said")
            if kind in OVERSHOOT and claim["bound"] > (1 + OVERSHOOT[kind]) * own[kind] + rounding:
                raise NotProvedError(f"the setpoints break the limit of {kind} of {name}")
            if claim["limit"] != own[kind] or abs(claim["rounding"] - rounding) > SAME * rounding:
                raise NotProvedError(f"limit or rounding of {kind} of {name} are others")
            unit = f"{'rad' if name in ('slew', 'hub') else 'm'}/{KINDS[kind]}"
            if claim.keys() != {"bound", "limit", "rounding", "unit"} or claim["unit"] != unit:
                raise NotProvedError(f"something else is said of {kind} of {name}")
        if orders:
            asked[name] = {kind for _, kind in orders}
    if {name: set(kinds) for name, kinds in said.items()} != asked:
        raise NotProvedError("something is said of setpoints that the spec does not limit")


def _difference(case: Case, axis: int, order: int) -> float:
    """Bound an axis' difference quotients, with those before the first and after the last setpoint."""
    cycle, velocity = case.setpoints.cycle, arb(case.spec["move"]["final_velocity"][axis])
    quotients = [arb(one) for one in case.setpoints.positions[axis]]
    after = [quotients[-1] + n * cycle * velocity for n in range(1, order)]
    quotients = quotients[:1] * (order - 1) + quotients + after
    for _ in range(order):
        quotients = [(after - before) / cycle for before, after in pairwise(quotients)]
    return max(float(abs(one).upper()) for one in quotients)


def _require_times(case: Case) -> None:
    begin, until, last = case.document["from_s"], case.document["until_s"], case.document["axes"]["knots"][-1]
    if begin != case.setpoints.times[-1]:
        raise NotProvedError("the sway is not bounded from the last setpoint on")
    corners = [dict(zip(case.ranges, ends, strict=True)) for ends in product(*case.ranges.values())]
    corners = corners if len(case.ranges) <= 3 else [corners[0], corners[-1]]
    changes = [{}, *corners, *({name: end} for name, ends in case.ranges.items() for end in ends)]
    slowest = min(_frequency(case, case.parameters | change) for change in changes)
    watched = max(SHORTEST_WATCH, 4 * float(arb.pi()) / slowest)
    if not (watched * (1 - SAME) <= until - begin and until <= last):
        raise NotProvedError("the sway is not bounded for as long as the check watches it")


def _frequency(case: Case, parameters: Mapping[str, float]) -> float:
    """Find the slowest frequency at the target in rad/s; it tells how long to watch, and bounds nothing."""
    machine, n = case.machine, len(case.machine.coordinates)
    k = machine.constants({name: arb(value) for name, value in parameters.items()})
    still, axes = [arb(0)] * n, [arb(one) for one in case.spec["move"]["target"]]
    columns = []
    for chosen in range(n):
        unit = [1 if row == chosen else 0 for row in range(n)]
        bent = machine.drift(moved(still, unit, 1), still, axes, [arb(0)] * len(axes), k)
        columns.append([-arb(along(one, 1)) for one in bent])
    values = acb_mat([list(row) for row in zip(*columns, strict=True)]).eig(algorithm="approx")
    return float(min(float(one.real.mid()) for one in values) ** 0.5)


def _require_cover(proof: ProofMaterial, ranges: int) -> None:
    """Require that boxes are disjoint, and together everything."""
    if any(len(box) != ranges for box in proof.parts) or len(proof.terms) != ranges:
        raise NotProvedError("boxes of other parameters than the ranges'")
    inside = all(0 <= index < 2**level for box in proof.parts for level, index in box)
    volume = sum((Fraction(1, prod(2**level for level, _ in box)) for box in proof.parts), Fraction(0))
    overlap = any(
        all(_meet(*pair) for pair in zip(one, other, strict=True))
        for one, other in combinations(proof.parts, 2)
    )
    if not inside or volume != 1 or overlap:
        raise NotProvedError("the boxes are not all machines of the ranges, each of them once")


def _meet(one: tuple[int, int], other: tuple[int, int]) -> bool:
    (level, index), (deeper, inside) = sorted((one, other))
    return inside >> (deeper - level) == index


def _watches(case: Case, knots: Sequence[float]) -> list[SwayClaim]:
    """List the bounds that are claimed, which must be all that the spec asks, and keep its limits."""
    limits, bounds, way = (case.document[name] for name in ("limits_m", "bounds_m", "on_the_way"))
    loads, sway = case.machine.loads, case.spec["limits"].get("sway")
    if limits != case.spec["check"]["residual_sway"] or not set(loads) == limits.keys() == bounds.keys():
        raise NotProvedError("the certificate is about other limits than the spec's, or other loads")
    arrived = max(n for n, knot in enumerate(knots) if knot <= case.setpoints.times[-1])
    claims = [SwayClaim(slice(n, n + 1), arrived, bounds[load]) for n, load in enumerate(loads)]
    kept = [bounds[load] <= limits[load] for load in loads]
    if (sway is None) != (way is None):
        raise NotProvedError("the certificate is silent of the sway on the way, or the spec is")
    if way is not None:
        name, both = case.machine.end_load
        if (
            way.keys() != {"load", "bound_m", "limit_m"}
            or way["load"] != name
            or way["limit_m"] != ALLOWED * sway
        ):
            raise NotProvedError("the certificate is about another limit on the way")
        kept.append(way["bound_m"] <= way["limit_m"])
        claims.append(SwayClaim(both, 0, way["bound_m"]))
    if not all(kept):
        raise NotProvedError("a bound is above its limit")
    return claims


def _prove(case: Case, progress: Progress, processes: int) -> None:
    proof = ProofMaterial(case.document, 2 * len(case.machine.coordinates), len(case.machine.axes))
    _require_cover(proof, len(case.ranges))
    knots, times, boxes = proof.knots, case.setpoints.times, len(proof.parts)
    moving = {knot for knot in knots if knot <= times[-1]}
    if knots[0] != times[0] or times[-1] not in moving or not moving <= set(times):
        raise NotProvedError("the certificate's motion of the axes does not belong to the setpoints")
    work = BoxByBox(case, proof)
    if processes == 1 or boxes == 1 or "fork" not in get_all_start_methods():
        for number in range(boxes):
            work.prove(number)
            progress(number + 1, boxes)
        return
    with get_context("fork").Pool(min(processes, boxes), _begin, (work,)) as pool:
        for done, _ in enumerate(pool.imap_unordered(_prove_box, range(boxes)), start=1):
            progress(done, boxes)


class BoxByBox:
    """The proof of every box, which needs nothing of the others."""

    def __init__(self, case: Case, proof: ProofMaterial) -> None:
        setpoints, knots = case.setpoints, proof.knots
        self.case, self.proof, self.watches = case, proof, _watches(case, knots)
        self.halves = [(arb(end) - begin) / 2 for begin, end in pairwise(knots)]
        axes = []
        for axis, positions in enumerate(setpoints.positions):
            smooth = [quintic(half, *ends) for half, ends in zip(self.halves, proof.ends[axis], strict=True)]
            velocity = case.spec["move"]["final_velocity"][axis]
            axes.append(list(axis_pieces(knots, smooth, setpoints.times, positions, velocity)))
        self.axes = list(zip(*axes, strict=True))
        initial, coordinates = case.spec["move"].get("initial", {}), case.machine.coordinates
        names = (*coordinates, *(f"{name}.rate" for name in coordinates))
        self.start = [initial.get(name, 0.0) for name in names]

    def prove(self, number: int) -> None:
        """Prove a box.

        Raises
        ------
        NotProvedError
        """
        case, proof = self.case, self.proof
        box = MachineBox(case.machine, case.parameters, case.ranges, proof.parts[number], proof.terms)
        motion = zip(self.halves, self.axes, proof.motion(number), strict=True)
        pieces = [MotionPiece(box, half, along_axes, series) for half, along_axes, series in motion]
        material = box, pieces, proof.scales(number), self.start
        try:
            BoxProof(*material).require(self.watches)
        except NotProvedError:
            BoxProof(*material, beyond=MANY_MORE).require(self.watches)


_own: list[BoxByBox] = []  # of this process, one of several that share the work


def _begin(work: BoxByBox) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends the others
    _own.append(work)


def _prove_box(number: int) -> None:
    _own[-1].prove(number)
