"""Playback function block in IEC 61131-3 Structured Text, for any controller that takes this language.

The block (`gen_profile_exporters.playback_block`) holds the motion as tables of LREAL, one entry per cycle of
its task, and issues position, velocity and acceleration. It keeps to what independent compilers have in
common: ASCII, ``(* *)`` comments, one-dimensional arrays in ``VAR CONSTANT``, literals such as ``-1.5E-3``.
Each literal reads back to the same double, and the block counts cycles instead of adding up times.

- A rising edge of ``bExecute`` starts, if the task's cycle and the actual position are those of the table.
  Dropping it does not stop the motion; at the end the last sample is held until it drops.
- ``bAbort`` brakes each axis along its own direction of travel with the constant deceleration
  ``fStopDeceleration``, so neither position nor velocity jumps. The default is the motion's own peak
  acceleration a. Braking from anywhere, an axis then stays within the range of its move (to within a T² / 8,
  T being the cycle), as the move itself could not have turned back sooner.
- An axis that counts in ``counts`` gets whole numbers from the table; while it brakes they are not rounded.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from gen_profile.errors import ExportError
from gen_profile.profile import Array, Profile, SampledProfile
from gen_profile.units import AxisScale
from gen_profile_exporters import playback_block
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.playback_block import Token
from gen_profile_exporters.setpoints import AxisTable, axis_table, motion_of, plausible_cycle_time, sampled

MOST_SAMPLES = 100_001  # larger tables were not seen to compile
START_TOLERANCE = 1e-3  # m (or rad), the default
VALUES_PER_LINE = 4
QUANTITIES = ("position", "velocity", "acceleration")

_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_NUMBER = re.compile(r"\s*[-+]?\d+(\.\d+)?([eE][-+]?\d+)?\s*", re.ASCII)


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the block with the motion, sampled at the target's cycle time.

    Raises
    ------
    ExportError
        A position does not fit the axis's counts, or the table is too long to compile.
    """
    motion = sampled(profile, target, target.cycle_time, "export.cycle_time", MOST_SAMPLES)
    table = axis_table(motion, target.axes)
    suffixes = _suffixes(target.axes)
    values = _table_values(table, target)
    for column, (suffix, axis) in enumerate(zip(suffixes, target.axes, strict=True)):
        values |= {key + suffix: value for key, value in _axis_values(table, axis, column).items()}
    text = playback_block.fill(values, suffixes)
    return (File(filename=f"{target.name}.st", content=text.encode("ascii")),)


def replay(content: bytes, target: Target) -> SampledProfile:
    """Read the tables, after making sure that nothing but numbers and comments was edited in the block.

    Raises
    ------
    ExportError
        The text is no such block, was cut off, or is for other axes than the target's.
    """
    suffixes = _suffixes(target.axes)
    values = playback_block.match(content.decode("latin-1"), suffixes)
    if not _NAME.fullmatch(values["block"].text):
        raise ExportError(
            f"line {values['block'].line}: {values['block'].text!r} stands where a name is due."
        )
    columns = {
        quantity: np.column_stack([_array(values[quantity + suffix], values) for suffix in suffixes])
        for quantity in QUANTITIES
    }
    for suffix in suffixes:
        for parameter in ("start", "start_tolerance", "stop_deceleration"):
            _number(values[parameter + suffix].text, values[parameter + suffix].line)
    cycle = values["cycle_time"]
    table = AxisTable(
        cycle_time=plausible_cycle_time(_number(cycle.text, cycle.line), cycle.line),
        position=columns["position"],
        velocity=columns["velocity"],
        acceleration=columns["acceleration"],
        jerk=None,
    )
    return motion_of(table, target.axes)


def _table_values(table: AxisTable, target: Target) -> dict[str, str]:
    samples = len(table.position)
    return {
        "name": _plain(target.name),
        "block": f"FB_{_identifier(target.name)}",
        "samples": str(samples),
        "cycle": repr(table.cycle_time),
        "kilobytes": f"{samples * len(target.axes) * len(QUANTITIES) * 8 / 1000:.3g}",
        "sha256": motion_of(table, target.axes).payload_hash(),
        "last": str(samples - 1),
        "range": f"[0..{samples - 1}]",
        "cycle_time": _literal(table.cycle_time),
    }


def _axis_values(table: AxisTable, axis: AxisScale, column: int) -> dict[str, str]:
    position, velocity, acceleration = (getattr(table, quantity)[:, column] for quantity in QUANTITIES)
    peak = float(np.abs(acceleration).max())
    return {
        "axis": _plain(axis.name),
        "unit": axis.unit,
        "first": f"{position[0]:g}",
        "final": f"{position[-1]:g}",
        "peak_velocity": f"{np.abs(velocity).max():g}",
        "peak_acceleration": f"{peak:g}",
        "start": _literal(position[0]),
        "start_tolerance": _literal(START_TOLERANCE * abs(axis.factor)),
        "stop_deceleration": _literal(peak or 1.0),  # the block asks for one even of an axis that stays
        "position": _literals(position),
        "velocity": _literals(velocity),
        "acceleration": _literals(acceleration),
    }


def _suffixes(axes: Sequence[AxisScale]) -> list[str]:
    """Tell the axes' variables apart: nothing for a single axis, else their names."""
    if len(axes) == 1:
        return [""]
    names = [f"_{_identifier(axis.name)}" for axis in axes]
    distinct = len({name.lower() for name in names}) == len(names)
    return names if distinct else [f"{name}{number}" for number, name in enumerate(names, start=1)]


def _identifier(name: str) -> str:
    """Letters, digits and single underscores inside, as every compiler takes after a letter prefix."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "motion"


def _plain(name: str) -> str:
    """Text that can neither end a comment nor leave ASCII."""
    return re.sub(r"[^A-Za-z0-9._ -]", "_", name)


def _literal(value: float) -> str:
    """Shortest LREAL literal that reads back to the same double, such as ``-1.5E-3``."""
    return np.format_float_scientific(value, trim="0", exp_digits=1).upper()


def _literals(values: Array) -> str:
    texts = [_literal(value) for value in values]
    rows = [", ".join(texts[k : k + VALUES_PER_LINE]) for k in range(0, len(texts), VALUES_PER_LINE)]
    return "[\n        " + ",\n        ".join(rows) + "\n    ]"


def _array(token: Token, values: Mapping[str, Token]) -> Array:
    """Read an initialiser; too few values would compile all the same, and leave zeros."""
    texts = token.text.strip("[]").split(",")
    last, declared = values["last"].text, values["range"].text
    if len(texts) < 2 or last != str(len(texts) - 1) or declared != f"[0..{last}]":
        raise ExportError(
            f"line {token.line}: {len(texts)} values in an array {declared[:40]} with cLast = {last[:40]}; "
            "values are missing or too many, export the block again."
        )
    numbers = []
    line = token.line
    for text in texts:
        line += text.rstrip().count("\n")
        numbers.append(_number(text, line))
    return np.array(numbers)


def _number(text: str, line: int) -> float:
    number = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise ExportError(f"line {line}: {text.strip()[:40]!r} is no finite number; export the block again.")
    return number
