"""DBC of the bus: what the frames mean, for analysers and loggers."""

import re
from collections.abc import Sequence
from fractions import Fraction

from gen_profile.spec.can import CanSpec
from gen_profile.support.units import AxisScale
from gen_profile_exporters.can import frames, pdos
from gen_profile_exporters.can.drive_units import VELOCITY_UNIT, exact, per_count
from gen_profile_exporters.can.pdos import Field
from gen_profile_exporters.exporter import Target

MASTER_NAME = "Controller"


def dbc(target: Target) -> bytes:
    """Render the database; positions and velocities read in the axes' SI units.

    The format is that of Vector's *DBC File Format Documentation*, version 1.0.5.
    """
    names, layout = [identifier(axis.name) for axis in target.axes], pdos.layout(target.can)
    blocks = ['VERSION ""', "NS_ :", "BS_:", f"BU_: {MASTER_NAME} {' '.join(names)}"]
    blocks.append(f"BO_ {frames.SYNC} Sync: 0 {MASTER_NAME}")
    for name, axis, own in zip(names, target.axes, frames.cob_ids(target), strict=True):
        for pdo, fields in {**layout.received, **layout.transmitted}.items():
            role = layout.role(pdo).title().replace("_", "")
            measured = [(field, *_physical(field, axis, target.can)) for field in fields]
            way = (MASTER_NAME, name) if pdo in layout.received else (name, MASTER_NAME)
            blocks.append(_message(own[pdo], f"{name}_{role}", measured, way))
    return ("\n\n".join(blocks) + "\n").encode("ascii")


def identifier(name: str) -> str:
    """Turn an axis's name into a C identifier."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return plain if plain[:1].isalpha() else f"axis_{plain}"


def _message(cob_id: int, name: str, fields: Sequence[tuple[Field, str, str]], way: tuple[str, str]) -> str:
    sender, receiver = way
    lines = [f"BO_ {cob_id} {name}: {pdos.packing([field for field, *_ in fields]).size} {sender}"]
    start = 0
    for field, factor, unit in fields:
        sign = "-" if field.code.islower() else "+"
        if field.used:
            lines.append(
                f' SG_ {field.name} : {start}|{field.bits}@1{sign} ({factor},0) [0|0] "{unit}" {receiver}'
            )
        start += field.bits
    return "\n".join(lines)


def _physical(field: Field, axis: AxisScale, can: CanSpec) -> tuple[str, str]:
    """Factor and unit of a signal: what one count means."""
    metre = Fraction(1) / exact(axis.counts_per_si)
    length = "rad" if axis.unit in {"rad", "deg"} else "m"
    if field in {pdos.TARGET_POSITION, pdos.INTERPOLATION_DATA, pdos.ACTUAL_POSITION}:
        return repr(float(metre)), length
    if field in {pdos.VELOCITY_OFFSET, pdos.TARGET_VELOCITY}:
        return repr(float(metre / per_count(VELOCITY_UNIT, can, axis))), f"{length}/s"
    return ("0.1", "%") if field == pdos.TORQUE_OFFSET else ("1", "")
