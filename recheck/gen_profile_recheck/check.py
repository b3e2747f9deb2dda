"""A certificate against its artefact and spec: every claim of the spec is in it, and is proved."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from fractions import Fraction
from itertools import combinations, pairwise, product
from math import prod
from typing import Any

from flint import acb_mat, arb, ctx

from gen_profile_recheck.axes import axis_pieces, quintic
from gen_profile_recheck.boxes import Box, Piece
from gen_profile_recheck.enclosure import BoxProof, NotProvedError, Watch
from gen_profile_recheck.jets import along, moved
from gen_profile_recheck.machines import MACHINES, Machine
from gen_profile_recheck.reading import CLAIMS, FORMAT, KEYS, Proof, Setpoints, ranges_of, read_json, read_setpoints, spec_of

PRECISION = 64  # bits of balls
SAME = 1e-9  # relative, by which what is stated may be off for rounding
OVERSHOOT = {"velocity": 0.02, "acceleration": 0.4}  # of limits of the axes, which the check allows beside rounding
KINDS = {"velocity": "s", "acceleration": "s²", "jerk": "s³"}
ALLOWED = 1.01  # of limits.sway
SHORTEST_WATCH = 4.0  # s; or two of the slowest periods

TRUST = """Trusted: that python-flint (Arb) encloses what it computes, Python runs this program as it is written, and
SHA-256 has no collisions; that the controller issues the artefact's positions at their times and the drives join them
by straight lines; and that the machine has the equations in machines.py, with constant parameters. Nothing of the
program that made artefact and certificate is used."""


def check(artefact: bytes, spec: bytes, certificate: bytes, progress: Callable[[int, int], None] = lambda _, __: None) -> str:
    """Prove again what a certificate says of an artefact and a spec (or its manifest), and say it in a sentence.

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
    given = spec_of(read_json(spec), document["spec_sha256"])
    try:
        return _checked(artefact, given, document, progress)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise NotProvedError(f"a file is damaged, or not covered ({type(error).__name__}: {error})") from error


def _checked(artefact: bytes, spec: Mapping[str, Any], document: Mapping[str, Any], progress: Any) -> str:
    machine = MACHINES.get(spec["plant"].get("type"))
    if machine is None:
        raise NotProvedError(f"not covered: machines of the type {spec['plant'].get('type')}")
    if spec["actuator"]["type"] != "ideal":
        raise NotProvedError("not covered: drives that lag behind their setpoints")
    if spec["check"].get("foreign") is not None:
        raise NotProvedError("not covered: a foreign model of the machine (check.fmu)")
    setpoints = read_setpoints(artefact, spec, machine.axes)
    ranges = ranges_of(spec)
    if {name: tuple(ends) for name, ends in document["ranges"].items()} != ranges:
        raise NotProvedError("the certificate is about other ranges")
    _require_setpoints(document["setpoints"], spec, machine, setpoints)
    _require_times(document, spec, machine, setpoints, ranges)
    proof = Proof(document, 2 * len(machine.coordinates), len(machine.axes))
    _require_cover(proof, len(ranges))
    watches = _watches(document, spec, machine, setpoints, proof)
    _prove(machine, spec, {name: ranges[name] for name in document["ranges"]}, setpoints, proof, watches, progress)
    bounds = ", ".join(f"{load} {1e3 * bound:.6g} mm" for load, bound in document["bounds_m"].items())
    way = document["on_the_way"]
    on_the_way = "" if way is None else f"; on the way {way['load']} {1e3 * way['bound_m']:.6g} mm"
    machines = ", ".join(f"{name} from {low:.6g} to {high:.6g}" for name, (low, high) in document["ranges"].items())
    times = f"from {document['from_s']:.6g} s to {document['until_s']:.6g} s"
    return f"proved: of all machines with {machines or 'nominal parameters'}, {times}, at most {bounds}{on_the_way}."


def _require_setpoints(said: Any, spec: Mapping[str, Any], machine: Machine, setpoints: Setpoints) -> None:
    """Require what is said of velocity, acceleration and jerk wherever the spec limits them."""
    expected: dict[str, dict[str, Any]] = {}
    for number, name in enumerate(machine.axes):
        limits = {**spec["limits"], **spec["limits"].get("axis", {}).get(name, {})}
        for order, (kind, per) in enumerate(KINDS.items(), start=1):
            if limits.get(kind) is None:
                continue
            rounding = 2 ** (order - 1) * setpoints.resolution[number] / setpoints.cycle**order
            told, found = said[name][kind], _difference(setpoints, number, order, spec["move"]["final_velocity"][number])
            if not (found <= told["bound"] * (1 + SAME) and told["limit"] == limits[kind]):
                raise NotProvedError(f"the setpoints ask {name} for more {kind} than is said")
            if abs(told["rounding"] - rounding) > SAME * rounding:
                raise NotProvedError(f"rounding is not what is said for {name}")
            if kind in OVERSHOOT and told["bound"] > (1 + OVERSHOOT[kind]) * limits[kind] + rounding:
                raise NotProvedError(f"the setpoints break limits.{kind} of {name}")
            unit = f"{'rad' if name in ('slew', 'hub') else 'm'}/{per}"
            expected.setdefault(name, {})[kind] = told if told.keys() == {"bound", "limit", "rounding", "unit"} else None
            if told["unit"] != unit:
                raise NotProvedError(f"the unit of {kind} of {name} is {unit}")
    if said != expected:
        raise NotProvedError("something is said of setpoints that the spec does not limit")


def _difference(setpoints: Setpoints, axis: int, order: int, velocity: float) -> float:
    """Bound an axis' difference quotients, with those before the first and after the last setpoint."""
    found = [arb(one) for one in setpoints.positions[axis]]
    found = found[:1] * (order - 1) + found + [found[-1] + setpoints.cycle * arb(velocity) * n for n in range(1, order)]
    for _ in range(order):
        found = [(after - before) / setpoints.cycle for before, after in pairwise(found)]
    return max(float(abs(one).upper()) for one in found)


def _require_times(document: Any, spec: Any, machine: Machine, setpoints: Setpoints, ranges: Any) -> None:
    if document["from_s"] != setpoints.times[-1]:
        raise NotProvedError("the sway is not bounded from the last setpoint on")
    nominal = _parameters(spec)
    corners = [dict(zip(ranges, ends, strict=True)) for ends in product(*ranges.values())]
    corners = corners if len(ranges) <= 3 else [corners[0], corners[-1]]
    single = [{name: end} for name, ends in ranges.items() for end in ends]
    slowest = min(_frequency(machine, nominal | change, spec["move"]["target"]) for change in [{}, *corners, *single])
    watched = max(SHORTEST_WATCH, 4 * float(arb.pi()) / slowest)
    if not watched * (1 - SAME) <= document["until_s"] - document["from_s"] <= document["axes"]["knots"][-1]:
        raise NotProvedError("the sway is not bounded for as long as the check watches it")
    if document["until_s"] > document["axes"]["knots"][-1]:
        raise NotProvedError("the sway is stated for longer than the certificate's motions last")


def _parameters(spec: Mapping[str, Any]) -> dict[str, float]:
    return {name: value for name, value in spec["plant"].items() if isinstance(value, (int, float))}


def _frequency(machine: Machine, parameters: Mapping[str, float], target: Any) -> float:
    """Find the slowest undamped frequency at the target in rad/s; it tells how long to watch, and bounds nothing."""
    k = machine.constants({name: arb(value) for name, value in parameters.items()})
    n = len(machine.coordinates)
    at, still, axes = [arb(0)] * n, [arb(0)] * n, [arb(one) for one in target]
    columns = []
    for chosen in range(n):
        unit = [1 if row == chosen else 0 for row in range(n)]
        bent = machine.free(moved(at, unit, 1), still, axes, [arb(0)] * len(axes), k)
        columns.append([-arb(along(one, 1)) for one in bent])
    values = acb_mat([list(row) for row in zip(*columns, strict=True)]).eig(algorithm="approx")
    return min(float(one.real.mid()) for one in values) ** 0.5


def _require_cover(proof: Proof, ranges: int) -> None:
    """Require that boxes are disjoint, and together everything."""
    if any(len(box) != ranges or any(not 0 <= index < 2**level for level, index in box) for box in proof.parts):
        raise NotProvedError("a box is none of the ranges'")
    if len(proof.terms) != ranges:
        raise NotProvedError("series of other parameters than the ranges'")
    volume = sum((Fraction(1, prod(2**level for level, _ in box)) for box in proof.parts), Fraction(0))
    overlap = any(
        all(_meet(*pair) for pair in zip(one, other, strict=True)) for one, other in combinations(proof.parts, 2)
    )
    if volume != 1 or overlap:
        raise NotProvedError("the boxes are not all machines of the ranges")


def _meet(one: tuple[int, int], other: tuple[int, int]) -> bool:
    (level, index), (deeper, inside) = sorted((one, other))
    return inside >> (deeper - level) == index


def _watches(document: Any, spec: Any, machine: Machine, setpoints: Setpoints, proof: Proof) -> list[Watch]:
    """List the bounds that are claimed, which must be all that the spec asks, and keep its limits."""
    limits, bounds, way = (document[name] for name in ("limits_m", "bounds_m", "on_the_way"))
    if limits != spec["check"]["residual_sway"] or set(limits) != set(machine.loads) or bounds.keys() != limits.keys():
        raise NotProvedError("the certificate is about other limits than the spec's, or other loads")
    if any(bounds[load] > limits[load] for load in limits):
        raise NotProvedError("a bound is above its limit")
    arrived = max(n for n, knot in enumerate(proof.knots) if knot <= setpoints.times[-1])
    found = [
        Watch(slice(number, number + 1), arrived, bounds[load]) for number, load in enumerate(machine.loads)
    ]
    limit = spec["limits"].get("sway")
    if (limit is None) != (way is None):
        raise NotProvedError("the certificate is silent of the sway on the way, or the spec is")
    if way is not None:
        name, loads = machine.end_load
        if way.keys() != {"load", "bound_m", "limit_m"} or way["load"] != name or way["limit_m"] != ALLOWED * limit:
            raise NotProvedError("the certificate is about another limit on the way")
        if way["bound_m"] > way["limit_m"]:
            raise NotProvedError("a bound is above its limit")
        found.append(Watch(loads, 0, way["bound_m"]))
    return found


def _prove(machine: Machine, spec: Any, ranges: Any, setpoints: Setpoints, proof: Proof, watches: Any, progress: Any) -> None:
    knots, times = proof.knots, setpoints.times
    if knots[0] != times[0] or times[-1] not in knots or not {one for one in knots if one < times[-1]} <= set(times):
        raise NotProvedError("the certificate's motion of the axes does not belong to the setpoints")
    halves = [(arb(end) - begin) / 2 for begin, end in pairwise(knots)]
    axes = []
    for axis, positions in enumerate(setpoints.positions):
        smooth = [quintic(half, *ends) for half, ends in zip(halves, proof.ends[axis], strict=True)]
        velocity = spec["move"]["final_velocity"][axis]
        axes.append(list(axis_pieces(knots, smooth, times, positions, velocity)))
    names = (*machine.coordinates, *(f"{name}.rate" for name in machine.coordinates))
    start = [spec["move"].get("initial", {}).get(name, 0.0) for name in names]
    for number, parts in enumerate(proof.parts):
        box = Box(machine, _parameters(spec), ranges, parts, proof.terms)
        pieces = [
            Piece(box, half, along_axes, series)
            for half, along_axes, series in zip(halves, zip(*axes, strict=True), proof.motion(number), strict=True)
        ]
        BoxProof(box, pieces, proof.scales(number), start).require(watches)
        progress(number + 1, len(proof.parts))
