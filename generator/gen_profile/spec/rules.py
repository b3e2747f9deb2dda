"""Rules across the fields of a spec, and between a spec and its machine."""

from collections.abc import Iterator
from types import SimpleNamespace

from gen_profile.plants.plant import Coordinate, Parameter, Plant, decides
from gen_profile.plants.virtual_work import end_load_is_a_body
from gen_profile.spec.can import SENSOR_BYTES, CanSensorSpec
from gen_profile.spec.model import RobustnessSpec, Spec
from gen_profile.spec.passed_target import directions
from gen_profile.spec.planner import SensorSpec
from gen_profile.spec.stack_rules import stack_faults
from gen_profile.spec.structure import place
from gen_profile.support.phrase import Phrase
from gen_profile.support.suggestion import suggestion
from gen_profile.support.units import RATES, UNITS

LARGEST_ANGLE = 1.4  # rad, of a load at the start
SHORTEST_MOVE = 1e-12  # m (or rad); squares of what is smaller come near to what floats can hold
SMALL_SWING = 1e-3  # m (or rad), to compare forces with
FRAME_BYTES = 8  # of CAN
MOST_CORNERS = 10  # parameters whose ranges have 2¹⁰ corners

Fault = tuple[str, ...]  # a place, what is wrong there, and other places that may be the cause


def broken_rules(spec: Spec, plant: Plant | None) -> Iterator[Fault]:
    """Find what a spec's fields, each for itself as it may be, contradict.

    Parameters
    ----------
    spec : Spec
    plant : Plant or None
        None where the machine is not known: what depends on it is not judged then.
    """
    for rule in OF_SPEC:
        yield from rule(spec)
    if plant is not None:
        for of_machine in OF_MACHINE:
            yield from of_machine(spec, plant)


def _drive(spec: Spec) -> Iterator[Fault]:
    """Hold the time constant and the effort to the kind of drive."""
    lag = spec.actuator.type == "first-order"
    if lag and spec.actuator.tau is None:
        yield "actuator.tau", 'required with type = "first-order" (time constant in s)'
    if not lag and spec.actuator.tau is not None:
        yield "actuator.tau", 'only with type = "first-order"; remove it or set the type'
    if not lag and spec.cost.effort == "reference":
        yield (
            "cost.effort",
            '"reference" weighs the reference of a lagging drive (eq. 6); '
            'set actuator.type = "first-order" with tau, or choose "jerk" or "snap"',
        )


def _robustness(spec: Spec) -> Iterator[Fault]:
    own, usual = spec.robustness, RobustnessSpec()
    if own.method == usual.method:
        return
    if not own.uncertain:
        names = [*spec.plant.parameters]
        one = next((name for name in names if name.startswith("L")), [*names, "L1"][0])  # ropes are
        template = 'required with method = "{method}", such as {{ {one} = 0.2 }}'
        yield "robustness.uncertain", Phrase(template, method=own.method, one=one)
    for key, method in own.OF_METHOD.items():
        if own.method != method and getattr(own, key) != getattr(usual, key):
            yield f"robustness.{key}", Phrase('only with method = "{method}"', method=method)


def _move(spec: Spec) -> Iterator[Fault]:
    move = spec.move
    if not any(move.distance) and move.stops and not any(move.initial.values()):
        yield "move.distance", "must not be zero on every axis"
    if any(0.0 < abs(way) < SHORTEST_MOVE for way in move.distance):
        yield "move.distance", Phrase("must be zero, or at least {least:g} m (or rad)", least=SHORTEST_MOVE)
    least, most = move.bounds.least, move.bounds.most
    if least is not None and most is not None and most < least:
        yield "move.duration.most", Phrase("must be at least {least:g}, the least one", least=least)
    limited = " ".join(spec.limits.only([k for k, asked in enumerate(move.asked) if asked]).stated())
    if move.shortest and not any(name in limited for name in RATES):
        problem = '"minimum" needs a limit: state limits.acceleration, or velocity or jerk'
        yield "move.duration", problem, "limits.axis", *(f"limits.{name}" for name in RATES)


def _setpoint_path(spec: Spec) -> Iterator[Fault]:
    path = spec.check.path
    least = path.lag[0] if path.lag else spec.actuator.tau or 0.0
    if path.between == "hold" and least <= 0.0:
        yield (
            "check.path.between",
            '"hold" lets the axis leap to each setpoint, which takes a drive with a lag: '
            "state check.path.lag, or actuator.tau",
            "check.path.lag",
        )


def _csv_columns(spec: Spec) -> Iterator[Fault]:
    columns = spec.export.csv_columns
    if len(set(columns)) != len(columns):
        yield "export.csv_columns", "names a column twice"
    elif not {"position", "velocity"}.intersection(columns):
        yield "export.csv_columns", 'must hold "position" or "velocity": nothing else can be played'


def _can(spec: Spec) -> Iterator[Fault]:
    can = spec.can
    if can.feed_forward in ("torque", "both") and can.torque_per_acceleration is None:
        template = 'required with feed_forward = "{feed_forward}" (‰ of the rated torque per m/s²)'
        yield "can.torque_per_acceleration", Phrase(template, feed_forward=can.feed_forward)
    if can.mode != "csp" and can.feed_forward != "none":
        yield "can.feed_forward", 'only with mode = "csp"; remove it or set the mode'
    if can.mode == "csv" and can.following_error is None:
        problem = 'required with mode = "csv": how far the axis may be off the motion, in m'
        yield "can.following_error", problem
    if can.sensor is not None:
        yield from _can_sensor(can.sensor, spec.planner.sensor)
    taken: dict[int, str] = {}
    for axis, node in can.nodes.items():
        if taken.setdefault(node, axis) != axis:
            problem = Phrase("{node} is the node of the axis {taken} already", node=node, taken=taken[node])
            yield place("can.nodes", axis), problem


def _can_sensor(frames: CanSensorSpec, sensor: SensorSpec | None) -> Iterator[Fault]:
    """Hold the frames of sensors to the sensors of the planner."""
    if sensor is None:
        yield "can.sensor", "only with planner.sensor; state that, or remove it"
    elif len(frames.byte) != len(sensor.names):
        template = "must have {count} numbers, one for each sensor"
        yield "can.sensor.byte", Phrase(template, count=len(sensor.names)), "planner.sensor.of"
    if max(frames.byte, default=0) + SENSOR_BYTES[frames.type] > FRAME_BYTES:
        template = "{type} would end beyond the {most} bytes of a frame"
        yield "can.sensor.byte", Phrase(template, type=frames.type, most=FRAME_BYTES)


def _all_axes(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Have every axis a node and a channel of its own, or none."""
    for what, stated in (("nodes", spec.can.nodes), ("channels", spec.can.channels)):
        for axis in plant.actuated:
            if stated and axis.name not in stated:
                problem = Phrase("required beside the other axes' {what}", what=what)
                yield place(f"can.{what}", axis.name), problem


def _forgotten(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Refuse a machine that is the user's in one essential value and the type's nominal one in another."""
    essential = [parameter for parameter in plant.parameters if parameter.essential]
    stated = [one.name for one in essential if one.name not in spec.plant.defaults]
    missing = [one for one in essential if one.name not in stated]
    if stated and (forgotten := [one for one in missing if decides(plant, one.name, spec.plant.parameters)]):
        template = (
            "states {stated}, so it must state what else decides the swing: {missing} (the values of the "
            "type's nominal machine)"
        )
        values = ", ".join(f"{one.name} = {one.nominal:g} {one.unit}" for one in forgotten)
        yield "plant", Phrase(template, stated=", ".join(stated), missing=values)


def _free(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Hold the names of axes that may help to the machine; in place, some must."""
    names = [axis.name for axis in plant.actuated]
    for name in spec.move.free:
        if name not in names:
            yield (
                "move.free",
                Phrase("{name} is no axis{hint}", name=repr(name), hint=suggestion(name, names)),
            )
    if any(spec.move.initial.values()) and len(spec.held()) == len(names):
        template = 'required where no axis has a way to go: name those that may move, such as ["{axis}"]'
        yield "move.free", Phrase(template, axis=names[0])


def _at_start(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Hold what swings at the start to angles that a taut rope can have."""
    angles = {q.name for q in plant.unactuated if q.unit == "rad"}
    for name, value in spec.move.initial.items():
        if name in angles and abs(value) > LARGEST_ANGLE:
            problem = Phrase("must be from -{angle:g} to {angle:g} rad", angle=LARGEST_ANGLE)
            yield place("move.initial", name), problem


def _at_end(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Refuse to end at a speed at which the loads do not hang still, as on a turning jib."""
    if spec.move.stops:
        return
    named = SimpleNamespace(**spec.plant.parameters)
    still = [0.0] * len(plant.unactuated)

    def pull(q_u: list[float], dq_a: tuple[float, ...]) -> float:
        terms = plant.equations(q_u, still, list(spec.move.target), list(dq_a), named)
        return max(abs(float(k + g)) for k, g in zip(terms.K_u, terms.G_u, strict=True))

    swung, standstill = [SMALL_SWING for _ in still], (0.0,) * len(plant.actuated)
    if pull(still, spec.move.final_velocity) > 1e-9 * pull(swung, standstill):
        yield "move.final_velocity", "the load does not hang still while the axes move so; end at rest"


def _shares(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Refuse relative ranges of nothing, and those that reach beyond what the machine takes."""
    tables = {"robustness": spec.robustness.uncertain, "check": spec.check.uncertain or {}}
    cure_by_table = {"robustness": "", "check": "; state check.spans"}
    for table, shares in tables.items():
        for parameter in plant.parameters:
            if parameter.name not in shares:
                continue
            where, value = place(f"{table}.uncertain", parameter.name), spec.plant.parameters[parameter.name]
            if value == 0.0:
                template = "its value is 0, so a relative range is empty{cure}"
                yield where, Phrase(template, cure=cure_by_table[table])
            for end in (value * (1.0 + sign * shares[parameter.name]) for sign in (-1.0, 1.0)):
                if not parameter.lower <= end <= parameter.upper:
                    bounds = Phrase("{own.lower:g} to {own.upper:g} {own.unit}", own=parameter)
                    template = "reaches {end:.6g}, and the machine takes {bounds}"
                    yield where, Phrase(template, end=end, bounds=bounds)


def _wind(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Refuse a wind that pushes nothing, or where no energy is known that it works against."""
    if spec.check.wind.force == 0.0:
        return
    if not plant.bodies:
        yield (
            "check.wind.force",
            "the machine's file states no bodies, and equations alone do not tell how far a force holds a "
            "load aside; state bodies and mechanics in it, or remove the wind",
        )
    elif not end_load_is_a_body(plant):
        template = "wind does not push the {load}, which is no body of the machine; remove it"
        yield "check.wind.force", Phrase(template, load=plant.end_load_name)
    if spec.check.foreign is not None:
        yield "check.wind.force", "a foreign FMU (check.fmu) has no input for wind; remove one of them"


def _checked_machines(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Hold the ranges of the check to what can be tried, and to what tries it."""
    changed = spec.checked_ranges()
    if len(changed) > MOST_CORNERS:
        template = (
            "{count} parameters have 2^{count} corners; name at most {most} in "
            "check.uncertain, widen theirs, and let check.samples draw"
        )
        yield "check.uncertain", Phrase(template, count=len(changed), most=MOST_CORNERS)
    if spec.check.foreign is None:
        return
    problem = "required, as it is uncertain; name the FMU's variable for it"
    unnamed = [name for name in changed if name not in spec.check.foreign.parameters]
    yield from ((place("check.parameters", name), problem) for name in unnamed)
    if spec.move.initial or not spec.move.stops:
        yield "check.fmu", "judges moves from rest to rest only; remove move.initial and final_velocity"


def _axis_limits(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Hold the limits of every axis against the move."""
    move, limits = spec.move, spec.limits
    for column, axis in enumerate(plant.actuated):
        own = limits.of(column)
        if own.velocity is not None and abs(move.final_velocity[column]) > own.velocity:
            template = "must keep limits.velocity ({velocity:g}), found {found}"
            found = list(move.final_velocity)
            yield "move.final_velocity", Phrase(template, velocity=own.velocity, found=found)
        if own.travel is None:
            continue
        low, high = own.travel
        for key, ends in (("start", move.start), ("target", move.target)):
            if not low <= ends[column] <= high:
                template = "must contain move.{key} of {axis} ({at:g}), found {found}"
                problem = Phrase(template, key=key, axis=axis.name, at=ends[column], found=[low, high])
                yield limits.place(column, "travel"), problem


def _overshoot(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Refuse to look at targets that no load is known to pass, or that it passes anyway."""
    if spec.limits.overshoot is None:
        return
    where = "limits.overshoot"
    if spec.path is not None:
        yield where, "not on a path over stacks; state what is behind the target as a stack (path.stacks)"
    elif not spec.move.stops:
        yield where, "a load that reaches its target at a speed passes it; end at rest (move.final_velocity)"
    elif spec.check.foreign is not None:
        yield where, "a foreign FMU (check.fmu) does not tell where the load is; remove one of them"
    elif not plant.bodies:
        yield (
            where,
            "the machine's file states no bodies, and equations alone do not tell where a load is; state "
            "bodies and mechanics in it, or remove the limit",
        )
    elif not any(spec.move.distance[one.axis] for one in directions(plant)):
        template = "no axis carries the {load} straight to a target that it could pass; remove the limit"
        yield where, Phrase(template, load=plant.end_load_name)


def _units(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Hold the target's units to what its axes measure."""
    for axis in plant.actuated:
        unit = spec.axis[axis.name].unit if axis.name in spec.axis else axis.unit
        if unit in UNITS and UNITS[unit][0] != axis.unit:
            template = "{unit} does not measure an axis that moves in {own}"
            yield f"axis.{axis.name}.unit", Phrase(template, unit=repr(unit), own=axis.unit)


def _live(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Let the range of a live parameter begin below the machine's only where that is next to nothing."""
    known: tuple[Parameter | Coordinate, ...] = (*plant.actuated, *plant.parameters)
    for name, (low, high) in spec.planner.live.items():
        least = {one.name: one.lower for one in known}[name]
        if low < least > 1e-3 * high:
            problem = Phrase("begins below the least that the machine takes, {least:g}", least=least)
            yield place("planner.live", name), problem
    live = spec.planner.live
    for key in ("live_rate", "live_noise"):
        for name in getattr(spec.planner, key):
            if name not in live:
                problem = Phrase("not among planner.live{hint}", hint=suggestion(name, live))
                yield place(f"planner.{key}", name), problem, place("planner.live", name)


def _sensor(spec: Spec, plant: Plant) -> Iterator[Fault]:
    """Hold a sensor and what it is for to each other, and to the machine."""
    sensor, disturbance = spec.planner.sensor, spec.planner.disturbance
    if sensor is None or disturbance is None:
        if sensor is not None or disturbance is not None:
            missing, of = ("disturbance", "sensor") if disturbance is None else ("sensor", "disturbance")
            yield f"planner.{missing}", Phrase("required by planner.{of}", of=of), f"planner.{of}"
        return
    of_load = sensor.quantity == "sway"
    known = list(plant.loads) if of_load else [coordinate.name for coordinate in plant.unactuated]
    if not sensor.names:
        template = "must name a load of the machine" if of_load else "must name a coordinate that swings"
        yield "planner.sensor.of", template
    for name in sensor.names:
        if name not in known:
            template = "no load of the machine{hint}" if of_load else "no coordinate that swings{hint}"
            yield "planner.sensor.of", Phrase(template, hint=suggestion(name, known))
    if not disturbance.swing:
        yield "planner.disturbance.swing", "must name a load"
    if spec.planner.zones:
        problem = Phrase("not together with planner.{name} so far; leave one out", name="zones")
        yield "planner.sensor", problem


def _stop(spec: Spec) -> Iterator[Fault]:
    """Refuse prompt stops of machines whose loads are followed: a promise would not hold."""
    for name in ("live_rate", "sensor"):
        if spec.planner.stop == "prompt" and getattr(spec.planner, name):
            problem = Phrase('"prompt" is not together with planner.{name}; leave one out', name=name)
            yield "planner.stop", problem, f"planner.{name}"


OF_SPEC = (_stop, _drive, _robustness, _move, _setpoint_path, _csv_columns, _can)
OF_MACHINE = (
    _forgotten, _free, _at_start, _at_end, _shares, _wind, _checked_machines, _axis_limits, _overshoot,
    _units, _all_axes, _live, _sensor, stack_faults,
)  # fmt: skip
