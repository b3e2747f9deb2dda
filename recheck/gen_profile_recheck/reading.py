"""What is read: an artefact's setpoints, a spec's numbers, and a certificate, none of them believed."""

from __future__ import annotations

import base64
import csv
import hashlib
import json
import math
import re
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import reduce
from itertools import pairwise
from math import isfinite, prod
from typing import Any

from flint import arb_mat

from gen_profile_recheck.enclosure import NotProvedError

FORMAT = "gen-profile certificate 1"
CLAIMS = {"bounds_m", "limits_m", "on_the_way", "setpoints", "ranges", "from_s", "until_s"}
KEYS = CLAIMS | {"format", "spec_sha256", "artefact_sha256", "axes", "parts", "terms", "motions", "scales"}
PER_SI = {"m": 1.0, "mm": 1e3, "um": 1e6, "rad": 1.0, "deg": 180.0 / math.pi}
MOST_BYTES = 1 << 30


def read_json(text: bytes) -> Any:
    """Read JSON of finite numbers.

    Raises
    ------
    NotProvedError
    """

    def finite(number: str) -> float:
        if not isfinite(value := float(number)):
            raise ValueError(f"{number} is no finite number")
        return value

    try:
        return json.loads(text, parse_float=finite, parse_constant=finite)
    except (ValueError, RecursionError) as error:
        raise NotProvedError(f"a file is no JSON of finite numbers ({error})") from error


@dataclass(frozen=True)
class TimedSetpoints:
    """Where the axes are commanded to be: times in s, and positions in m (or rad) of each axis."""

    times: Sequence[float]
    cycle: float
    positions: Sequence[Sequence[float]]
    resolution: Sequence[float]


def spec_of(document: Mapping[str, Any], digest: str) -> Mapping[str, Any]:
    """Find the spec with a hash: a manifest's, or the document itself.

    Raises
    ------
    NotProvedError
    """
    listed = [document, *document.get("earlier", ())] if "spec" in document else [{"spec": document}]
    for one in listed:
        text = json.dumps(one["spec"], sort_keys=True, separators=(",", ":"), ensure_ascii=True)
        if hashlib.sha256(text.encode("ascii")).hexdigest() == digest:
            spec: Mapping[str, Any] = one["spec"]
            return spec
    raise NotProvedError("the certificate is about another spec")


def read_setpoints(content: bytes, spec: Mapping[str, Any], axes: Sequence[str]) -> TimedSetpoints:
    """Read a table of positions at even times (RFC 4180), or that of a playback block (IEC 61131-3).

    Raises
    ------
    NotProvedError
        It is of another format, for which nothing is written here.
    """
    try:
        text = content.decode("utf-8")
        setpoints = (
            _of_block(text, spec, axes) if "END_FUNCTION_BLOCK" in text else _of_table(text, spec, axes)
        )
    except (ValueError, IndexError, ArithmeticError) as error:
        raise NotProvedError(f"not covered, or damaged: an artefact of another format ({error})") from error
    if len(setpoints.times) < 2 or not all(isfinite(one) for row in setpoints.positions for one in row):
        raise NotProvedError("the artefact holds a number that is not finite, or no motion")
    return setpoints


def _of_table(text: str, spec: Mapping[str, Any], axes: Sequence[str]) -> TimedSetpoints:
    if spec["export"]["csv_dialect"] != "rfc4180" or "position" not in spec["export"]["csv_columns"]:
        raise ValueError("tables of other dialects, or without positions")
    header, *rows = csv.reader(text.splitlines())
    prefixes = [f"{name}_" if len(axes) > 1 else "" for name in axes]
    names = [
        f"{prefix}position_{spec['axis'][name]['unit']}" for prefix, name in zip(prefixes, axes, strict=True)
    ]
    times = [Decimal(row[header.index("time_s")]) for row in rows]
    cycle = float(times[1] - times[0])
    over, under = Decimal(repr(cycle)).as_integer_ratio()
    if any(time * under != number * over for number, time in enumerate(times)):
        raise ValueError("times that are not even")
    return _setpoints(cycle, [[float(row[header.index(name)]) for row in rows] for name in names], spec, axes)


def _setpoints(
    cycle: float,
    columns: Sequence[Sequence[float]],
    spec: Mapping[str, Any],
    axes: Sequence[str],
    layout: str = "",
) -> TimedSetpoints:
    """Take positions in an axis' units, or in its counts, for those in m (or rad)."""
    (over, under), positions, resolution = Decimal(repr(cycle)).as_integer_ratio(), [], []
    for column, axis in zip(columns, (spec["axis"][name] for name in axes), strict=True):
        counted = layout == "counts" or axis["unit"] == "counts"
        per_si = axis["sign"] * (axis["counts_per_metre"] if counted else PER_SI[axis["unit"]])
        positions.append([one / per_si for one in column])
        resolution.append(1 / abs(per_si) if counted and layout != "segments" else 0.0)
    return TimedSetpoints(
        [number * over / under for number in range(len(columns[0]))], cycle, positions, resolution
    )


def _of_block(text: str, spec: Mapping[str, Any], axes: Sequence[str]) -> TimedSetpoints:
    """Play a block at full rate: positions of every cycle, or powers of the time since a segment began."""
    bare, m, layout = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S), len(axes), spec["export"]["plc_layout"]

    def constant(name: str) -> list[float]:
        array_of = r"(?:ARRAY\s*\[[0-9.]+\]\s*OF\s*)?"
        (values,) = re.findall(rf"\b{name}\s*:\s*{array_of}[A-Z]+\s*:=\s*\[?([^\];]*)", bare)
        return [float(one) for one in values.split(",")]

    names = ["cPosition"] if layout != "segments" else [f"cPower{power}" for power in range(6)]
    if "aTable" in bare:  # a buffer: its size, what holds for all, what holds for each axis, and its columns
        table = constant("aTable")[3:]  # of which length and checks of the whole come first
        size, first, last, target = int(table[0]), 8 + 8 * m, table[3], table[12 : 8 + 8 * m : 8]
        *columns, starts = (table[first + n * size :][:size] for n in range(len(names) + 1))
        starts = starts[::m]
    else:
        columns, (last,) = [constant(name) for name in names], constant("cLast")
        starts, target = (constant("cFirst"), constant("cTarget")) if layout == "segments" else ([], [])
    (cycle,), flat, segment = constant("cCycleTime"), list[float](), 0
    for number in range(int(last) if layout == "segments" else 0):
        segment += segment + 1 < len(starts) and number >= starts[segment + 1]
        time = (number - starts[segment]) * cycle
        flat += [_horner([one[segment * m + axis] for one in columns], time) for axis in range(m)]
    flat = [*flat, *target] if layout == "segments" else columns[0]
    if len(flat) != m * (int(last) + 1):
        raise ValueError("a table of another length")
    return _setpoints(cycle, [flat[axis::m] for axis in range(m)], spec, axes, layout)


def _horner(powers: Sequence[float], time: float) -> float:
    """Evaluate as the block does, rounding included."""
    return reduce(lambda total, one: one + time * total, reversed(powers))


def ranges_of(spec: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """List the ranges of the check that are wider than nothing."""
    check, plant = spec["check"], spec["plant"]
    shares = check["uncertain"] if "uncertain" in check else spec["robustness"].get("uncertain", {})
    ranges = {
        name: (plant[name] * (1.0 - fraction), plant[name] * (1.0 + fraction))
        for name, fraction in shares.items()
    }
    ranges |= {name: (low, high) for name, (low, high) in check.get("spans", {}).items()}
    return {name: ends for name, ends in ranges.items() if ends[1] > ends[0]}


class ProofMaterial:
    """The material of a certificate.

    Raises
    ------
    ValueError, or alike
        It is damaged, or its arrays do not fit together.
    """

    def __init__(self, document: Mapping[str, Any], coordinates: int, axes: int) -> None:
        motion = document["axes"]
        self.knots, self.terms = motion["knots"], tuple(document["terms"])
        position, velocity = (list(zip(*motion[name], strict=True)) for name in ("position", "velocity"))
        begin, end = (list(zip(*column, strict=True)) for column in zip(*motion["acceleration"], strict=True))
        self.ends = [  # of each axis and piece: both of each derivative
            list(zip(pairwise(p), pairwise(v), zip(b, c, strict=True), strict=True))
            for p, v, b, c in zip(position, velocity, begin, end, strict=True)
        ]
        self.parts = [[(int(level), int(index)) for level, index in box] for box in document["parts"]]
        self.motions, self.pieces, self.coordinates = document["motions"], len(self.knots) - 1, coordinates
        (boxes, pieces, *rest), self._scales = _unpacked(document["scales"], "d")
        self._scale_shape = boxes, pieces, rest[2]
        _require(sorted(set(self.knots)) == self.knots and self.pieces > 0, "knots")
        _require(len(self.ends) == axes and all(len(one) == self.pieces for one in self.ends), "axes")
        _require(all(0 < count <= 32 for count in self.terms), "terms")
        _require(len(self.motions) == len(self.parts) == boxes, "motions")
        _require(pieces in (1, self.pieces) and rest[:2] == [coordinates] * 2, "scales")
        _require(rest[2:] in ([1], [prod(min(3, count) for count in self.terms)]), "scales")
        _require(all(map(isfinite, self._scales)), "scales")

    def scales(self, box: int) -> Iterator[list[list[Sequence[float]]]]:
        """Give S of a box for every piece, or once for all: rows of entries, which are coefficients."""
        (boxes, pieces, terms), n = self._scale_shape, self.coordinates
        for place in range(box * pieces, (box + 1) * pieces):
            own = self._scales[place :: boxes * pieces]
            entries = [own[first : first + terms] for first in range(0, len(own), terms)]
            yield [entries[first : first + n] for first in range(0, len(entries), n)]

    def motion(self, box: int) -> Iterator[list[arb_mat]]:
        """Give the series of every coordinate, (time terms × parameter terms), piece by piece."""
        packed = self.motions[box]
        (pieces, n, times, terms), whole = _unpacked(packed, "q")
        quanta = [float(one) for one in packed["quanta"]]
        _require((pieces, n, terms) == (self.pieces, self.coordinates, prod(self.terms)), "motions")
        _require(len(quanta) == n and all(map(isfinite, quanta)) and times <= 16, "motions")
        each = times * terms
        for piece in range(pieces):
            own = whole[piece::pieces]
            columns = (own[first : first + each] for first in range(0, n * each, each))
            yield [
                arb_mat(times, terms, list(column)) * unit
                for column, unit in zip(columns, quanta, strict=True)
            ]


def _require(fits: bool, what: str) -> None:
    if not fits:
        raise ValueError(f"{what} that do not fit")


def _unpacked(packed: Mapping[str, Any], kind: str) -> tuple[list[int], Sequence[Any]]:
    """Decompress little-endian numbers."""
    shape = [int(size) for size in packed["shape"]]
    size = prod(shape) * 8
    _require(0 < size <= MOST_BYTES and min(shape) > 0, "arrays")
    content = zlib.decompressobj().decompress(base64.b64decode(packed["zlib"], validate=True), size)
    _require(len(content) == size, "arrays")
    return shape, struct.unpack(f"<{prod(shape)}{kind}", content)
