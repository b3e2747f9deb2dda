"""What is read: an artefact's setpoints, a spec's numbers, and a certificate, none of them believed."""

from __future__ import annotations

import base64
import csv
import hashlib
import json
import re
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import reduce
from itertools import pairwise
from math import frexp, isfinite, pi, prod
from operator import index
from typing import Any

from flint import arb_mat

FORMAT = "gen-profile certificate 1"
CLAIMS = {"bounds_m", "limits_m", "on_the_way", "setpoints", "ranges", "from_s", "until_s"}
KEYS = CLAIMS | {"format", "spec_sha256", "artefact_sha256", "axes", "parts", "terms", "motions", "scales"}
PER_SI = {"m": 1.0, "mm": 1e3, "um": 1e6, "rad": 1.0, "deg": 180.0 / pi}
QUANTITIES = {"position": "", "velocity": "_per_s", "acceleration": "_per_s2", "jerk": "_per_s3"}
NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)
COMMENTS = re.compile(r"\(\*.*?\*\)|//[^\n]*|\{.*?\}", re.DOTALL)
ALL_BITS = 1 << 32  # counts of a turn that lies around zero
SAME_TIME = 1e-9  # relative, by which a time in a table may be off its cycle
GREATEST = 1 << 45  # whole number that is a coefficient
MOST_HALVINGS = 50  # of a range, up to which shares of it are exact
MOST, MOST_CYCLES = 1 << 27, 1 << 21  # numbers of an array, and cycles of a block


class NotProvedError(Exception):
    """A sentence that says why nothing is proved."""


def require(fits: bool, why_not: str) -> None:
    """Raise a `NotProvedError` where something is not as it should be."""
    if not fits:
        raise NotProvedError(why_not)


def read_json(text: bytes) -> Any:
    """Read JSON of finite numbers, in which no key stands twice.

    Raises
    ------
    NotProvedError
    """

    def finite(number: str) -> float:
        require(isfinite(value := float(number)), f"a file is no JSON of finite numbers ({number[:20]})")
        return value

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        require(len(dict(pairs)) == len(pairs), "a key stands twice in a file")
        return dict(pairs)

    try:
        return json.loads(text, parse_float=finite, parse_constant=finite, object_pairs_hook=once)
    except (ValueError, RecursionError) as error:
        raise NotProvedError(f"a file is no JSON of finite numbers ({error})") from error


@dataclass(frozen=True)
class TimedSetpoints:
    """Where the axes are commanded to be: times in s, and positions in m (or rad) of each axis."""

    times: Sequence[float]
    cycle: float
    positions: Sequence[Sequence[float]]
    resolution: Sequence[float]


def spec_of(document: Mapping[str, Any], artefact: str, digest: str) -> Mapping[str, Any]:
    """Take the spec that a manifest has of an artefact, or of its latest motion, or the document itself.

    Raises
    ------
    NotProvedError
        It has another hash.
    """
    listed = list[Mapping[str, Any]]([{"spec": document}])
    if "spec" in document:
        listed = [document, *document.get("earlier", ())]
    own = [one for one in listed if artefact in (file["sha256"] for file in one.get("artefacts", ()))]
    spec: Mapping[str, Any] = (own or listed)[0]["spec"]
    text = json.dumps(spec, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    found = hashlib.sha256(text.encode("ascii")).hexdigest()
    require(found == digest, "the certificate is about another spec")
    return spec


def read_setpoints(content: bytes, spec: Mapping[str, Any], axes: Sequence[str]) -> TimedSetpoints:
    """Read a table of positions at even times (RFC 4180), or that of a playback block (IEC 61131-3).

    Raises
    ------
    NotProvedError
        It is of another format, for which nothing is written here.
    """
    try:
        text = content.decode("utf-8-sig")
        read = _of_block if "END_FUNCTION_BLOCK" in text else _of_table
        cycle, layout, columns = read(text, spec, axes)
        finite = cycle > 0 and all(isfinite(one) for column in columns for one in column)
        require(finite and min(map(len, columns)) > 1, "no motion, or none of finite numbers")
    except (NotProvedError, ValueError, IndexError, ArithmeticError) as error:
        raise NotProvedError(f"not covered, or damaged: an artefact of another format ({error})") from error
    (over, under), positions, resolution = Decimal(repr(cycle)).as_integer_ratio(), [], []
    stated = [spec["axis"][name] for name in axes]
    for column, axis, start in zip(columns, stated, spec["move"]["start"], strict=True):
        counted = layout == "counts" or axis["unit"] == "counts"
        per_si = axis["sign"] * (axis["counts_per_metre"] if counted else PER_SI[axis["unit"]])
        anew = axis.get("modulo") and not layout
        places = _unwound(column, axis["modulo"], start * per_si) if anew else column
        positions.append([one / per_si for one in places])
        resolution.append(1 / abs(per_si) if counted and layout != "segments" else 0.0)
    times = [number * over / under for number in range(len(columns[0]))]
    return TimedSetpoints(times, cycle, positions, resolution)


def _unwound(places: Sequence[float], turn: float, near: float) -> list[float]:
    """Unwrap positions of a modulo axis by the shorter ways, from as near as can be to a place."""
    low = -turn / 2 if turn == ALL_BITS else 0.0
    require(all(low <= place < low + turn for place in places), "places outside the turn of axis.modulo")
    turns = [round((near - places[0]) / turn)]
    for before, place in pairwise(places):
        jump = round((place - before) / turn)
        require(abs(place - before - turn * jump) < turn / 2, "half a turn of axis.modulo in a cycle")
        turns.append(turns[-1] - jump)
    return [place + turn * number for place, number in zip(places, turns, strict=True)]


# cycle in s, layout, and positions in an axis' units or counts
Table = tuple[float, str, Sequence[Sequence[float]]]


def _of_table(text: str, spec: Mapping[str, Any], axes: Sequence[str]) -> Table:
    quantities, units = spec["export"]["csv_columns"], [spec["axis"][name]["unit"] for name in axes]
    require(spec["export"]["csv_dialect"] == "rfc4180" and "position" in quantities, "another dialect")
    require(text.endswith(("\n", "\r")), "a table without its last line end")
    header, *rows = ([cell.strip() for cell in row] for row in csv.reader(text.rstrip().splitlines()))
    prefixes = [f"{name}_" if len(axes) > 1 else "" for name in axes]
    named = list(zip(prefixes, units, strict=True))
    due = [f"{prefix}{one}_{unit}{QUANTITIES[one]}" for prefix, unit in named for one in quantities]
    require(sorted(header) == sorted(["time_s", *due]), "other columns")
    require(all(NUMBER.fullmatch(cell) for row in rows for cell in row), "cells that are no numbers")
    columns = dict(zip(header, zip(*(map(float, row) for row in rows), strict=True), strict=True))
    times, cycle = columns["time_s"], columns["time_s"][1]
    uneven = (abs(time - number * cycle) > SAME_TIME * number * cycle for number, time in enumerate(times))
    require(not any(uneven), "times that are not even")
    return cycle, "", [columns[f"{prefix}position_{unit}"] for prefix, unit in named]


def _of_block(text: str, spec: Mapping[str, Any], axes: Sequence[str]) -> Table:
    """Play a block at full rate: positions of every cycle, or powers of the time since a segment began."""
    bare, m, layout = COMMENTS.sub("", text), len(axes), spec["export"]["plc_layout"]
    whole = bare.lstrip().startswith("FUNCTION_BLOCK") and bare.rstrip().endswith("END_FUNCTION_BLOCK")
    require(whole and bare.count("FUNCTION_BLOCK") == 2, "more or less than a function block")

    def constant(name: str) -> list[float]:
        declared = rf"\b{name}\s*:\s*(?:ARRAY\s*\[[0-9.]+\]\s*OF\s*)?[A-Z]+\s*:=\s*\[?([^\];]*)"
        (values,) = re.findall(declared, bare, re.IGNORECASE)
        require(all(map(NUMBER.fullmatch, values.split(","))), f"{name} that is no list of numbers")
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
    require(last.is_integer() and 0 < last < MOST_CYCLES, "another number of cycles")
    (cycle,), flat, segment = constant("cCycleTime"), list[float](), 0
    for number in range(int(last) if layout == "segments" else 0):
        segment += segment + 1 < len(starts) and number >= starts[segment + 1]
        time = (number - starts[segment]) * cycle
        flat += [_horner([one[segment * m + axis] for one in columns], time) for axis in range(m)]
    flat = [*flat, *target] if layout == "segments" else columns[0]
    require(len(flat) == m * (int(last) + 1), "a table of another length")
    return cycle, layout, [flat[axis::m] for axis in range(m)]


def _horner(powers: Sequence[float], time: float) -> float:
    """Evaluate as the block does, rounding included."""
    return reduce(lambda total, one: one + time * total, reversed(powers))


def ranges_of(spec: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """List the ranges of the check that are wider than nothing, in alphabetical order."""
    check, plant = spec["check"], spec["plant"]
    shares = check["uncertain"] if "uncertain" in check else spec["robustness"].get("uncertain", {})
    ranges = {name: (plant[name] * (1.0 - one), plant[name] * (1.0 + one)) for name, one in shares.items()}
    ranges |= {name: (low, high) for name, (low, high) in check.get("spans", {}).items()}
    require(all(low <= high for low, high in ranges.values()), "a range that ends before it begins")
    return {name: (low, high) for name, (low, high) in sorted(ranges.items()) if high > low}


class ProofMaterial:
    """The material of a certificate.

    Raises
    ------
    ValueError, or alike
        It is damaged, or its arrays do not fit together.
    """

    def __init__(self, document: Mapping[str, Any], coordinates: int, axes: int) -> None:
        motion, self.terms = document["axes"], tuple(map(index, document["terms"]))
        require(motion.keys() == {"knots", "position", "velocity", "acceleration"}, "axes of another kind")
        self.knots, self.coordinates = motion["knots"], coordinates
        position, velocity = (list(zip(*motion[name], strict=True)) for name in ("position", "velocity"))
        begin, end = (list(zip(*column, strict=True)) for column in zip(*motion["acceleration"], strict=True))
        self.ends = [  # of each axis and piece: both of each derivative
            list(zip(pairwise(p), pairwise(v), zip(b, c, strict=True), strict=True))
            for p, v, b, c in zip(position, velocity, begin, end, strict=True)
        ]
        self.parts = [[(index(level), index(number)) for level, number in box] for box in document["parts"]]
        self.motions, self.pieces = document["motions"], len(self.knots) - 1
        halved = (level for box in self.parts for level, _ in box)
        require(all(0 <= level <= MOST_HALVINGS for level in halved), "boxes of no such kind")
        boxes, pieces, rows, columns, terms = self._scale_shape = document["scales"]["shape"]
        require(sorted(set(self.knots)) == self.knots and self.pieces > 0, "knots that do not rise")
        require(len(self.ends) == axes and all(len(one) == self.pieces for one in self.ends), "other axes")
        require(all(0 < count <= 32 for count in self.terms), "another number of terms")
        require(len(self.motions) == len(self.parts) == boxes, "another number of motions")
        fits = pieces in (1, self.pieces) and rows == columns == coordinates
        fits = fits and terms in (1, prod(min(3, count) for count in self.terms))
        require(fits, "scales that do not fit")
        self._scales = _unpacked(document["scales"], "d")
        require(all(map(isfinite, self._scales)), "scales that are not finite")

    def scales(self, box: int) -> Iterator[list[list[Sequence[float]]]]:
        """Give S of a box for every piece, or once for all: rows of entries, which are coefficients."""
        boxes, pieces, n, _, terms = self._scale_shape
        for place in range(box * pieces, (box + 1) * pieces):
            own = self._scales[place :: boxes * pieces]
            entries = [own[first : first + terms] for first in range(0, len(own), terms)]
            yield [entries[first : first + n] for first in range(0, len(entries), n)]

    def motion(self, box: int) -> Iterator[tuple[list[arb_mat], list[arb_mat]]]:
        """Give the series of every coordinate (time × parameter terms), and their sizes, piece by piece."""
        packed = dict(self.motions[box])
        quanta, (pieces, n, times, terms) = packed.pop("quanta"), packed["shape"]
        fits = (pieces, n, terms) == (self.pieces, self.coordinates, prod(self.terms)) and 0 < times <= 16
        require(fits, "motions that do not fit")
        whole = _unpacked(packed, "q")
        require(max(map(abs, whole)) < GREATEST, "coefficients whose sums are not exact")
        powers = len(quanta) == n and all(frexp(one)[0] == 0.5 for one in quanta)
        require(powers, "quanta that are no powers of two")
        each = times * terms
        for piece in range(pieces):
            own = whole[piece::pieces]
            columns = [list(own[first : first + each]) for first in range(0, n * each, each)]
            sizes = ([abs(entry) for entry in column] for column in columns)
            series, greatest = (
                [arb_mat(times, terms, one) * unit for one, unit in zip(each_one, quanta, strict=True)]
                for each_one in (columns, sizes)
            )
            yield series, greatest


def _unpacked(packed: Mapping[str, Any], kind: str) -> Sequence[Any]:
    """Decompress little-endian numbers."""
    count, inflater = prod(map(index, packed["shape"])), zlib.decompressobj()
    require(packed.keys() == {"shape", "zlib"} and 0 < count <= MOST, "arrays of another kind")
    content = inflater.decompress(base64.b64decode(packed["zlib"], validate=True), 8 * count + 1)
    require(
        len(content) == 8 * count and inflater.eof and not inflater.unused_data, "arrays of another length"
    )
    return struct.unpack(f"<{count}{kind}", content)
