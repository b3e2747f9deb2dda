"""What is read: an artefact's setpoints, a spec's numbers, and a certificate, none of them believed."""

from __future__ import annotations

import base64
import csv
import hashlib
import json
import math
import re
import zlib
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from math import isfinite, prod
from typing import Any

from flint import arb, arb_mat

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


def scales_of(spec: Mapping[str, Any], axes: Sequence[str]) -> list[float]:
    """Tell how many of its units each axis counts per m (or rad), negative where it counts the other way."""
    return [
        one["sign"] * (one["counts_per_metre"] if one["unit"] == "counts" else PER_SI[one["unit"]])
        for one in (spec["axis"][name] for name in axes)
    ]


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
    export, factors = spec["export"], scales_of(spec, axes)
    if export["csv_dialect"] != "rfc4180" or "position" not in export["csv_columns"]:
        raise ValueError("tables of other dialects, or without positions")
    header, *rows = csv.reader(text.splitlines())
    several = len(axes) > 1
    names = [f"{f'{name}_' if several else ''}position_{spec['axis'][name]['unit']}" for name in axes]
    times = [Decimal(row[header.index("time_s")]) for row in rows]
    cycle = float(times[1] - times[0])
    over, under = Decimal(repr(cycle)).as_integer_ratio()
    if any(time * under != number * over for number, time in enumerate(times)):
        raise ValueError("times that are not even")
    columns = [[float(row[header.index(name)]) for row in rows] for name in names]
    counted = [spec["axis"][name]["unit"] == "counts" for name in axes]
    return _setpoints(cycle, columns, factors, counted)


def _setpoints(
    cycle: float, columns: Sequence[Sequence[float]], factors: Sequence[float], counted: Sequence[bool]
) -> TimedSetpoints:
    over, under = Decimal(repr(cycle)).as_integer_ratio()
    return TimedSetpoints(
        times=[number * over / under for number in range(len(columns[0]))],
        cycle=cycle,
        positions=[[one / factor for one in row] for row, factor in zip(columns, factors, strict=True)],
        resolution=[flag / abs(factor) for flag, factor in zip(counted, factors, strict=True)],
    )


def _of_block(text: str, spec: Mapping[str, Any], axes: Sequence[str]) -> TimedSetpoints:
    """Play a block at full rate: positions of every cycle, or powers of the time since a segment began."""
    bare, several = re.sub(r"\(\*.*?\*\)", "", text, flags=re.S), len(axes)
    variables: dict[str, list[float]] = {}

    def constant(name: str) -> list[float]:
        if name in variables:
            return variables[name]
        array_of = r"(?:ARRAY\s*\[[0-9.]+\]\s*OF\s*)?"
        (values,) = re.findall(rf"\b{name}\s*:\s*{array_of}[A-Z]+\s*:=\s*\[?([^\];]*)", bare)
        return [float(one) for one in values.split(",")]

    layout, factors = spec["export"]["plc_layout"], scales_of(spec, axes)
    if "aTable" in bare:
        variables = _buffer(constant("aTable"), several, layout)
    counted = [layout == "counts" or spec["axis"][name]["unit"] == "counts" for name in axes]
    if layout == "counts":
        factors = [spec["axis"][name]["sign"] * spec["axis"][name]["counts_per_metre"] for name in axes]
    (cycle,), (last,) = constant("cCycleTime"), constant("cLast")
    if layout == "segments":
        first, powers = constant("cFirst"), [constant(f"cPower{power}") for power in range(6)]
        rows, segment = [], 0
        for number in range(int(last)):
            segment += segment + 1 < len(first) and number >= first[segment + 1]
            time = (number - first[segment]) * cycle
            rows.append(
                [_horner([one[segment * several + axis] for one in powers], time) for axis in range(several)]
            )
        rows.append(constant("cTarget"))
        counted = [False] * several
    else:
        flat = constant("cPosition")
        rows = [flat[number : number + several] for number in range(0, len(flat), several)]
        if len(rows) != int(last) + 1:
            raise ValueError("a table of another length")
    return _setpoints(cycle, list(zip(*rows, strict=True)), factors, counted)


def _buffer(values: Sequence[float], axes: int, layout: str) -> dict[str, list[float]]:
    """Name what stands in the first buffer of a block whose numbers are variables."""
    names = [f"cPower{power}" for power in range(6)] if layout == "segments" else ["cPosition"]
    rows, own = int(values[0]), 8 + 8 * axes
    found = {
        name: list(values[own + number * rows : own + (number + 1) * rows])
        for number, name in enumerate([*names, "cFirst"])
    }
    found["cFirst"] = found["cFirst"][::axes]
    return found | {"cLast": [values[3]], "cTarget": list(values[12:own:8])}


def _horner(powers: Sequence[float], time: float) -> float:
    """Evaluate as the block does, rounding included."""
    total = powers[-1]
    for one in powers[-2::-1]:
        total = one + time * total
    return total


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
    NotProvedError
        It is damaged, or its arrays do not fit together.
    """

    def __init__(self, document: Mapping[str, Any], coordinates: int, axes: int) -> None:
        try:
            self.knots, position, velocity, acceleration = (
                document["axes"][name] for name in ("knots", "position", "velocity", "acceleration")
            )
            pieces = len(self.knots) - 1
            _require(sorted(set(self.knots)) == self.knots and pieces > 0, "knots")
            _require(all(len(row) == axes for row in [*position, *velocity]), "axes")
            _require(len(position) == len(velocity) == pieces + 1 and len(acceleration) == pieces, "axes")
            self.ends = [
                [
                    (
                        (position[n][axis], position[n + 1][axis]),
                        (velocity[n][axis], velocity[n + 1][axis]),
                        (acceleration[n][0][axis], acceleration[n][1][axis]),
                    )
                    for n in range(pieces)
                ]
                for axis in range(axes)
            ]
            self.parts = [[(int(level), int(index)) for level, index in box] for box in document["parts"]]
            self.terms = tuple(document["terms"])
            _require(all(0 < count <= 32 for count in self.terms), "terms")
            _require(len(document["motions"]) == len(self.parts) > 0, "motions")
            self.motions, self.pieces, self.coordinates = document["motions"], pieces, coordinates
            self._shape, self._scales = _unpacked(document["scales"], "d")
            boxes, self.scale_pieces, *rest = self._shape
            terms = prod(min(3, count) for count in self.terms)
            _require(boxes == len(self.parts) and self.scale_pieces in (1, pieces), "scales")
            _require(rest[:2] == [coordinates] * 2 and rest[2] in (1, terms), "scales")
            _require(all(isfinite(one) for one in self._scales), "scales")
        except (KeyError, TypeError, ValueError, IndexError, zlib.error) as error:
            raise NotProvedError(f"the certificate is damaged ({error})") from error

    def scales(self, box: int) -> list[Any]:
        """List S of a box for every piece, or for all of them: rows of entries, which are coefficients."""
        boxes, pieces, n, _, terms = self._shape
        return [
            [
                [
                    [
                        self._scales[(((i * n + j) * terms + t) * boxes + box) * pieces + piece]
                        for t in range(terms)
                    ]
                    for j in range(n)
                ]
                for i in range(n)
            ]
            for piece in range(pieces)
        ]

    def motion(self, box: int) -> list[list[arb_mat]]:
        """List the series of every piece and coordinate, (time terms × parameter terms).

        Raises
        ------
        NotProvedError
        """
        try:
            packed = self.motions[box]
            (pieces, n, times, terms), whole = _unpacked(packed, "q")
            quanta = [float(one) for one in packed["quanta"]]
            _require((pieces, n, terms) == (self.pieces, self.coordinates, prod(self.terms)), "motions")
            _require(len(quanta) == n and all(map(isfinite, quanta)) and 0 < times <= 16, "motions")
        except (KeyError, TypeError, ValueError, zlib.error) as error:
            raise NotProvedError(f"the certificate is damaged ({error})") from error
        return [
            [
                arb_mat(
                    times,
                    terms,
                    [
                        arb(one) * quanta[c]
                        for one in whole[c * times * terms * pieces :][
                            piece : times * terms * pieces : pieces
                        ]
                    ],
                )
                for c in range(n)
            ]
            for piece in range(pieces)
        ]


def _require(fits: bool, what: str) -> None:
    if not fits:
        raise ValueError(f"{what} that do not fit")


def _unpacked(packed: Mapping[str, Any], kind: str) -> tuple[list[int], array[Any]]:
    """Decompress little-endian numbers."""
    shape = [int(size) for size in packed["shape"]]
    size = prod(shape) * 8
    _require(0 < size <= MOST_BYTES and min(shape) > 0, "arrays")
    content = zlib.decompressobj().decompress(base64.b64decode(packed["zlib"], validate=True), size)
    _require(len(content) == size, "arrays")
    values = array(kind, content)
    if memoryview(array("H", [1])).tobytes() != b"\x01\x00":
        values.byteswap()
    return shape, values
