"""Playback function block in IEC 61131-3 Structured Text, for any controller that takes this language.

The block (``text/block.st``) holds the motion as a table, by default as quintic
segments, and issues position, velocity and acceleration every cycle of its task. It keeps to what independent
compilers have in common: ASCII, ``(* *)`` comments, one-dimensional arrays in ``VAR CONSTANT``, literals such
as ``-1.5E-7`` that a REAL could hold.
Each literal reads back to the same double, and the block counts cycles instead of adding up times.

- A rising edge of ``bExecute`` starts, if the task's cycle, the actual position and the checksum of all
  constants are right. Dropping it does not stop the motion; at the end the target is held until it drops.
- ``bHold``, ``bAbort`` and ``rOverride`` change the rate at which the path is played: all axes stay on it,
  and keep to the motion's own peaks of velocity and acceleration (`path_limits`).
- Where there are several axes, inputs and outputs are arrays, in the order of the machine's axes.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from gen_profile.motion.profile import Array, Profile, SampledProfile
from gen_profile.support.errors import ExportError
from gen_profile.support.units import AxisScale
from gen_profile_exporters.block_source import BlockSource, initialiser, is_planner, parse_function_block
from gen_profile_exporters.exporter import File, Target
from gen_profile_exporters.machine_variants import AxisVariants
from gen_profile_exporters.modulo import least
from gen_profile_exporters.playback import block as playback_block
from gen_profile_exporters.playback import buffers
from gen_profile_exporters.playback.block import Token
from gen_profile_exporters.playback.quintic_segments import ACCELERATION_ERROR, POSITION_ERROR
from gen_profile_exporters.playback.table import PlaybackTable, counted_axes, shape_for, tabulate
from gen_profile_exporters.playback.table_checksum import checksum
from gen_profile_exporters.setpoints import plausible_cycle_time

START_TOLERANCE = 1e-3  # m (or rad), the default
SEGMENT_COLUMNS = tuple(f"power{power}" for power in range(6))
SAMPLE_COLUMNS = ("position", "velocity", "acceleration")
QUINTIC_TOLERANCE = 1e-12  # relative, of an evaluated quintic
MOST_CYCLES = 10_000_000  # of a motion that is read

_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_SWITCH = {"FALSE": "0", "TRUE": "1"}
_FORM = r"\s*[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?\s*"
_NUMBER, _NUMBERS = re.compile(_FORM, re.ASCII), re.compile(rf"\[?{_FORM}(?:,{_FORM})*\]?", re.ASCII)


def encode(profile: Profile, target: Target) -> tuple[File, ...]:
    """Write the block with the motion, on the grid of the target's cycle time.

    Raises
    ------
    ExportError
        A position does not fit the axis's counts, or the table is too long to compile.
    """
    return (File(f"{target.name}.st", block_text(profile, target).encode("ascii")),)


def replay(content: bytes, target: Target) -> SampledProfile:
    """Work out what the block issues, after making sure that it is one and that its checksum is right.

    Raises
    ------
    ExportError
        The text is no such block, was altered or cut off, or is for other axes than the target's.
    """
    return read_table(content.decode("latin-1"), target).motion()


def wrap(source: BlockSource, target: Target) -> tuple[File, ...]:
    """Write any block."""
    return (File(f"{target.name}.st", source.text().encode("ascii")),)


def unwrap(content: bytes, target: Target) -> BlockSource:
    """Read a block.

    Raises
    ------
    ExportError
        The text is none.
    """
    return parse_function_block(content.decode("latin-1"))


def block_text(profile: Profile, target: Target) -> str:
    """Write the block, see `encode`."""
    table = tabulate(profile, target)
    values = _table_values(table) | _values(table) | _header_values(table, target)
    text = playback_block.fill(values, table.shape)
    if target.export.plc_tables == "constants":
        return text
    return buffers.buffered([parse_function_block(text)], target).text()


def read_table(text: str, target: Target) -> PlaybackTable:
    """Read a block's table; raises as `replay` does."""
    if is_planner(text):
        raise ExportError("this is a planner block, which plans at run time; name an exported motion.")
    if buffers.TABLE in text and buffers.is_buffered(source := parse_function_block(text)):
        if buffers.is_library(source):
            raise ExportError(
                "The block is a library of motions, and no single one; check the sweep's cases."
            )
        text = buffers.constant_sources(source, target)[0].text()
    layout = playback_block.layout_of(text)
    tokens = playback_block.match(text, shape_for(target.axes, layout))
    if not _NAME.fullmatch(tokens["block"].text):
        raise ExportError(
            f"line {tokens['block'].line}: {tokens['block'].text!r} stands where a name is due."
        )
    _array(tokens["start_tolerance"])
    table = _table(tokens, layout, target)
    _verify(tokens, table)
    return table


def replays(unwrap: Callable[[bytes, Target], BlockSource]) -> Callable[[bytes, Target], SampledProfile]:
    """Make the `replay` of a format from how it reads its first block; raises as both do."""
    return lambda content, target: read_table(unwrap(content, target).text(), target).motion()


def block_name(name: str) -> str:
    """Name the block after the motion: letters, digits and single underscores, as every compiler takes."""
    return f"FB_{re.sub(r'[^A-Za-z0-9]+', '_', name).strip('_') or 'motion'}"


def literal(value: float) -> str:
    """Shortest LREAL literal that reads back to the same double, such as ``-0.25`` or ``1.5E-7``."""
    mantissa, _, exponent = repr(float(value)).partition("e")
    if not exponent:
        return mantissa
    return f"{mantissa}{'' if '.' in mantissa else '.0'}E{int(exponent):+d}"


def plain(name: str) -> str:
    """Text that can neither end a comment nor leave ASCII."""
    return re.sub(r"[^A-Za-z0-9._ ,+\[\]-]", "_", name)


def _values(table: PlaybackTable) -> dict[str, str]:
    """Fill every hole of the program but for those of the table itself."""
    constants = _constants(table)
    return constants | {"checksum": str(_checksum(table, constants))}


def table_checksum(table: PlaybackTable) -> int:
    """Checksum that a block works out: of the table, then of all other constants, axis by axis."""
    return _checksum(table, _constants(table))


def _checksum(table: PlaybackTable, values: Mapping[str, str]) -> int:
    constants = playback_block.constants(values, table.shape)
    numbers = np.array([_array(Token(text)) * np.ones(len(table.axes)) for text in constants])
    return checksum(np.append(table.values(), numbers.T))


def _table_values(table: PlaybackTable) -> dict[str, str]:
    """Fill the holes of the table."""
    write = _whole_numbers if table.layout == "counts" else _literals
    names = SAMPLE_COLUMNS if table.first is None else SEGMENT_COLUMNS
    values = {name: write(column.ravel()) for name, column in zip(names, table.columns, strict=True)}
    return values if table.first is None else values | {"first": _whole_numbers(table.first)}


def _constants(table: PlaybackTable) -> dict[str, str]:
    limits, rows = table.limits, table.columns[0].size
    last = 0 if table.first is None else len(table.first) - 1
    segments = {} if table.first is None else {"last_segment": str(last), "segments": f"[0..{last}]"}
    turns = [axis.modulo or 0.0 for axis in table.axes]
    turns_low = [least(turn) for turn in turns]
    modulo = {"modulo": _per_axis(turns), "modulo_low": _per_axis(turns_low)} if any(turns) else {}
    return (
        segments
        | modulo
        | {
            "last": str(table.last),
            "row_count": str(rows),
            "checks": str(table.checks()),
            "play_on": str(table.play_on),
            "rows": f"[0..{rows - 1}]",
            "cycle_time": literal(table.cycle_time),
            "slope": literal(limits.slope),
            "slope_rate": literal(limits.slope_rate),
            "room": _per_axis(limits.room),
            "inverse": _per_axis(limits.inverse_velocity),
            "stop_jerk": _per_axis(limits.jerk),
            "start": _per_axis(table.start),
            "target": _per_axis(table.target),
            "least_scale": _per_axis([variant.least_scale for variant in table.variants]),
            "mirrors": _per_axis([variant.mirror for variant in table.variants]),
            "shifts": _per_axis([variant.shift for variant in table.variants]),
        }
    )


def _header_values(table: PlaybackTable, target: Target) -> dict[str, str]:
    units = [axis.unit for axis in table.axes]
    size = table.columns.size * (4 if table.layout == "counts" else 8)
    return {
        "name": plain(target.name),
        "block": block_name(target.name),
        "layout": table.layout if table.first is None else f"{len(table.first)} quintic segments",
        "accuracy": "Every cycle is tabulated."
        if table.first is None
        else f"Fit error at the cycles below\n    {POSITION_ERROR:g} m and {ACCELERATION_ERROR:g} m/s2.",
        "samples": str(table.last),
        "cycle": repr(table.cycle_time),
        "kilobytes": f"{size / 1000:.3g}",
        "check_cycles": str(-(-_checked(table) // table.checks())),
        "axis_lines": "\n".join(axis_lines(table)),
        "units": units[0] if len(set(units)) == 1 else ", ".join(units),
        "sha256": table.motion().payload_hash(),
        "start_tolerance": _per_axis([START_TOLERANCE * abs(axis.factor) for axis in table.axes]),
    }


def _checked(table: PlaybackTable) -> int:
    """Count what enters the checksum."""
    return len(table.values()) + playback_block.constant_count(table.shape)


def axis_lines(table: PlaybackTable) -> list[str]:
    """Tell for each axis where it moves, its peaks, and what the machine allows."""
    velocity, acceleration, _ = table.peaks
    jerk, position = table.limits.jerk, table.played.position
    low, high = position.min(axis=0), position.max(axis=0)
    return [
        f"    Axis {number + 1}, {plain(axis.name)}: {table.start[number]:g} to {table.target[number]:g} "
        f"{axis.unit}, peaks {velocity[number]:.4g} {axis.unit}/s and {acceleration[number]:.4g} "
        f"{axis.unit}/s2,\n"
        f"        stop jerk {jerk[number]:.4g} {axis.unit}/s3; on the way {low[number]:g} to "
        f"{high[number]:g} {axis.unit}; {_allowed(table.variants[number])}."
        for number, axis in enumerate(table.axes)
    ]


def _allowed(variants: AxisVariants) -> str:
    """Say which variants of the motion the machine allows."""
    allowed = [f"fScale from {variants.least_scale:g}"] if variants.least_scale < 1.0 else []
    allowed += ["bMirror"] * variants.mirror + ["fStartOffset"] * variants.shift
    return f"allows {', '.join(allowed)}" if allowed else "allows no variants"


def _table(tokens: Mapping[str, Token], layout: str, target: Target) -> PlaybackTable:
    """Read the table; too few values would compile all the same, and leave zeros."""
    axes = counted_axes(target, layout)
    names = SEGMENT_COLUMNS if layout == "segments" else SAMPLE_COLUMNS
    columns = [_array(tokens[name]) for name in names]
    rows = len(columns[0])
    first = _array(tokens["first"]) if layout == "segments" else None
    lengths = [(tokens[name], len(column), rows) for name, column in zip(names, columns, strict=True)]
    if first is not None:
        lengths.append((tokens["first"], len(first) * len(axes), rows))
    for token, length, due in lengths:
        if length != due or due % len(axes) or tokens["rows"].text != f"[0..{due - 1}]":
            raise ExportError(
                f"line {token.line}: {length} values in an array {tokens['rows'].text[:40]} for {len(axes)} "
                "axes; values are missing or too many, export the block again."
            )
    cycle, last = tokens["cycle_time"], _number(tokens["last"].text, tokens["last"])
    cycles = rows // len(axes) - 1 if first is None else last
    if last != cycles or not 1 <= last <= MOST_CYCLES or (first is not None and not _rise(first, last)):
        raise _altered(tokens["last"], f"cLast = {last:g} does not belong to the table")
    columns_by_axis = np.array(columns).reshape(len(names), -1, len(axes))
    return PlaybackTable(
        layout=layout,
        cycle_time=plausible_cycle_time(_number(cycle.text, cycle), cycle.line),
        axes=axes,
        first=first,
        columns=columns_by_axis,
        last=int(last),
        target=columns_by_axis[0, -1] if first is None else _end(tokens["target"], axes),
        stated_play_on=_within(tokens["play_on"], last),
        variants=_variants(tokens, axes),
    )


def _within(token: Token, last: float) -> int:
    number = _number(token.text, token)
    if not (0.0 <= number <= last and number.is_integer()):
        raise _altered(token, f"{token.text[:40]} is no cycle of the motion")
    return int(number)


def _variants(tokens: Mapping[str, Token], axes: Sequence[AxisScale]) -> tuple[AxisVariants, ...]:
    columns = [_array(tokens[name]) for name in ("least_scale", "mirrors", "shifts")]
    if any(len(column) != len(axes) for column in columns):
        wrong = f"{len(axes)} axes, but values for another number of them"
        raise _altered(tokens["least_scale"], wrong)
    return tuple(
        AxisVariants(least_scale=float(scale), mirror=bool(mirror), shift=bool(shift))
        for scale, mirror, shift in zip(*columns, strict=True)
    )


def _end(token: Token, axes: Sequence[AxisScale]) -> Array:
    target = _array(token)
    if len(target) != len(axes):
        raise _altered(token, f"{len(target)} targets for {len(axes)} axes")
    return target


def _rise(first: Array, last: float) -> bool:
    """Whether segments begin at whole cycles, one after the other, before the end."""
    cycles = np.append(first, last)
    return bool(first[0] == 0.0 and (cycles == np.floor(cycles)).all() and (np.diff(cycles) >= 1.0).all())


def _verify(tokens: Mapping[str, Token], table: PlaybackTable) -> None:
    """Refuse a block that would refuse to start, or whose limits are those of another motion."""
    due, written = _values(table), tokens["checksum"]
    if written.text != due["checksum"]:
        raise ExportError(
            f"line {written.line}: the checksum of the constants is {due['checksum']}, not "
            f"{written.text[:40]}: one was altered, and the block would refuse to start (nErrorId 5); "
            "export it again."
        )
    for name, token in tokens.items():
        same = token.text == due.get(name, token.text)  # as it was exported: no number need be read
        if not same and _numbers(token) != _numbers(Token(due[name])):
            raise _altered(token, f"{token.text[:40]} stands where the table asks for {due[name][:40]}")
    end_error = np.abs(table.arrival() - table.target)
    factor = np.abs([axis.factor for axis in table.axes])
    if (end_error > POSITION_ERROR * factor + QUINTIC_TOLERANCE * np.abs(table.target)).any():
        wrong = f"cTarget = {tokens['target'].text[:40]} is not where the table ends"
        raise _altered(tokens["target"], wrong)


def _per_axis(values: ArrayLike) -> str:
    """Write a number, or TRUE or FALSE, for each axis."""
    known = np.asarray(values).tolist()
    texts = [str(value).upper() if isinstance(value, bool) else literal(value) for value in known]
    return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"


def _literals(values: Array) -> str:
    return initialiser([literal(value) for value in values.tolist()])


def _whole_numbers(values: Array) -> str:
    return initialiser([str(int(value)) for value in values.tolist()])


def _array(token: Token) -> Array:
    """Read an initialiser, or a single number."""
    texts = token.text.strip("[]").split(",")
    if _NUMBERS.fullmatch(token.text) and np.isfinite(numbers := np.array(list(map(float, texts)))).all():
        return numbers
    below = np.cumsum([text.rstrip().count("\n") for text in texts])
    return np.array([_number(text, token, lines) for text, lines in zip(texts, below.tolist(), strict=True)])


def _numbers(token: Token) -> list[float] | str:
    """Compare by value where it is numbers, else by text."""
    if token.text.startswith("[0.."):
        return token.text.upper()
    return [float(number) for number in _array(token).tolist()]


def _number(text: str, token: Token, below: int = 0) -> float:
    """Read a number that stands in a token, so many lines below where that begins."""
    text = _SWITCH.get(text.strip().upper(), text)
    number = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(number):
        raise _altered(token, f"{text.strip()[:40]!r} is no finite number", below)
    return number


def _altered(token: Token, what: str, below: int = 0) -> ExportError:
    """Say what is wrong with a token, so many lines below where that begins."""
    return ExportError(f"line {token.line + below}: {what}; export the block again.")
