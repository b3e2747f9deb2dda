"""Rules of the table ``[path]``: a machine that can pass over stacks, and ends that are clear of them."""

from collections.abc import Iterator

import numpy as np

from gen_profile.plants.plant import Plant
from gen_profile.spec.model import Spec
from gen_profile.spec.stacks import (
    MOST_STACKS,
    PathAxes,
    Place,
    StacksSpec,
    StackZone,
    hanging,
    path_axes,
    zones,
)
from gen_profile.support.errors import SpecError
from gen_profile.support.phrase import Phrase
from gen_profile.support.units import RATES

FARTHEST = 1000.0  # m from the rail, or from start and target, from which on lengths are taken to be in mm

Fault = tuple[str, ...]


def stack_faults(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Find what a spec of a path over stacks lacks, and where its ends are in the way."""
    path = spec.path
    if path is None:
        return
    for key, rows in (("stacks", path.stacks), ("overhead", path.overhead)):
        for number, (low, high, *rest) in enumerate(rows):
            if not low < high:
                yield f"path.{key}.{number}", "must begin left of where it ends: from, to, height"
            elif len(rest) == 3 and not rest[0] < rest[1]:
                yield (
                    f"path.{key}.{number}",
                    "must begin before where it ends, in y too: third and fourth number",
                )
    if not path.stacks:
        yield (
            "path.stacks",
            "must hold at least one stack: from, to and height in m",
            "path.file",
            "path.profile",
        )
    if len(path.stacks) > MOST_STACKS:
        template = "holds {count} stacks, and {most} are the most; join those of about one height"
        yield "path.stacks", Phrase(template, count=len(path.stacks), most=MOST_STACKS)
    axes = path_axes(plant, spec.plant.parameters)
    if axes is None:
        yield (
            "path",
            "needs a machine of a hoist and one or two axes that carry the load along, such as "
            "single-pendulum-crane or hall-crane",
        )
        return
    highest = max((row[-1] for row in path.stacks), default=path.rail)
    if highest - path.rail > FARTHEST:
        template = (
            "reach {height:g} m, far above path.rail of {rail:g} m; state places and heights in m, not mm"
        )
        yield "path.stacks", Phrase(template, height=highest, rail=path.rail), "path.file", "path.profile"
        return
    if path.rail - highest > FARTHEST:
        template = (
            "is {above:g} m above the highest stack; state it in m, not mm, from the level of their heights"
        )
        yield "path.rail", Phrase(template, above=path.rail - highest)
    ends = [end[axes.along[0]] for end in (spec.move.start, spec.move.target)]
    away = min((max(row[0] - max(ends), min(ends) - row[1]) for row in path.stacks), default=0.0)
    if away > FARTHEST:
        template = "are all {away:g} m or more from start and target; state places in m, not mm"
        yield "path.stacks", Phrase(template, away=away), "path.file", "path.profile"
    yield from _methods(spec)
    yield from _in_plan_view(spec, axes)
    yield from _rates(spec, plant, axes.hoist)
    yield from _ends(spec, plant)


def refuse_stacks(spec: Spec, what: str) -> None:
    """Refuse a path over stacks where something would plan through them.

    Raises
    ------
    SpecError
    """
    if spec.path is not None:
        raise SpecError(
            "path: {what} does not consider stacks; remove [path], or see docs/over-stacks.md.", what=what
        )


def _methods(spec: Spec) -> Iterator[Fault]:
    """Refuse what does not go together with a path over stacks."""
    if spec.solver.method != "auto":
        yield "solver.method", "does not consider stacks; remove it, or remove [path]"
    if not spec.move.stops:
        yield "move.final_velocity", "a path over stacks ends at rest; remove it, or remove [path]"
    if spec.move.free:
        yield "move.free", "both axes move on a path over stacks; remove it"
    if spec.actuator.type != "ideal":
        yield (
            "actuator.type",
            "a path over stacks is planned for drives that follow exactly; remove it, and state how they lag "
            "as check.path.lag, so that it is judged",
        )
    if spec.robustness.order != 1:
        yield (
            "robustness.order",
            "a path over stacks is planned with first-order sensitivities only; remove it",
        )
    if spec.check.foreign is not None:
        yield "check.fmu", "an external FMU does not tell where the load is; remove it, or remove [path]"


def _in_plan_view(spec: Spec, axes: PathAxes) -> Iterator[Fault]:
    """Refuse what a machine of so many horizontal axes does not know."""
    assert spec.path is not None
    if len(axes.along) == 2:
        if any(spec.move.initial.values()):
            yield (
                "move.initial",
                "a path of two horizontal axes begins with the load hanging still; remove it",
            )
        yield from _ropes(spec, spec.path, axes)
        return
    for key, rows in (("stacks", spec.path.stacks), ("overhead", spec.path.overhead)):
        for number, row in enumerate(rows):
            if len(row) != 3:
                template = "the machine has one horizontal axis; state three numbers: from, to and height"
                yield f"path.{key}.{number}", template


def _ropes(spec: Spec, path: StacksSpec, axes: PathAxes) -> Iterator[Fault]:
    """Refuse a straight way on which ropes, in the plane above it, would run through what is overhead."""
    line, sideways = axes.line(spec.move.start, spec.move.target), path.clearances[0]
    whole = float(line.along(np.array([spec.move.target[axis] for axis in axes.along])))
    for number in range(len(path.overhead)):
        span = line.span(path.area(len(path.stacks) + number).widened(sideways, sideways))
        if span is not None and span[0] < whole and span[1] > 0.0:
            template = (
                "ropes would run through it, from {low:.3g} m on along the straight way of {whole:.3g} m; "
                "move the start or the target, or allow a smaller path.clearance"
            )
            yield f"path.overhead.{number}", Phrase(template, low=max(span[0], 0.0), whole=whole)


def _rates(spec: Spec, plant: Plant, hoist: int) -> Iterator[Fault]:
    """Require what limits the hoist, and where its top is."""
    limits, name = spec.limits.of(hoist), plant.actuated[hoist].name
    for rate in RATES:
        if getattr(limits, rate) is None:
            yield f"limits.axis.{name}.{rate}", Phrase("required with [path]: it decides when the load is up")
    if limits.travel is None and plant.actuated[hoist].lower < -1e3:
        template = "required with [path]: its lower end is the hoist's top"
        yield f"limits.axis.{name}.travel", Phrase(template)


def _ends(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Refuse ends at which a load is nearer to a stack than it may come."""
    path, parameters = spec.path, spec.plant.parameters
    assert path is not None
    places = [hanging(plant, parameters, q_a) for q_a in (spec.move.start, spec.move.target)]
    if len(places[0]) == 1 and path.hook is not None:
        yield "path.hook", "the machine has no hook; remove it"
    for key, bodies in zip(("start", "target"), places, strict=True):
        for zone in zones(path, [bodies, bodies]):
            x, y, z = bodies[zone.body]
            if not zone.own and zone.area.holds((x, y)) and zone.clear(np.asarray(z)) < 0.0:
                yield f"move.{key}", _too_near(spec, plant, zone, bodies[zone.body])


def _too_near(spec: Spec, plant: Plant, zone: StackZone, place: Place) -> Phrase:
    """Say how far a load is from where it may be: sideways, or upwards."""
    assert spec.path is not None
    template = (
        "the {body} is too near to {obstacle}, by {sideways:.3g} m sideways; move it, allow a "
        "smaller path.clearance, or begin or end {upwards:.3g} m higher"
    )
    if zone.overhead:
        template = (
            "the {body} is too near to {obstacle}, by {sideways:.3g} m sideways; move it, allow a "
            "smaller path.clearance, or begin or end {upwards:.3g} m lower"
        )
    return Phrase(
        template,
        body=plant.bodies[zone.body],
        obstacle=spec.path.named(zone.obstacle),
        sideways=-float(zone.area.outside(*place[:2])),
        upwards=abs(zone.top - place[2]),
    )
