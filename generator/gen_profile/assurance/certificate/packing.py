"""Arrays of a certificate, compressed: most coefficients of a motion are 0."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from operator import index
from typing import Any

import attrs
import numpy as np

from gen_profile.assurance.certificate.arithmetic.balls import Array

MOST_BYTES = 2**32  # of an array: a small file must not fill the memory
GREATEST = 2.0**45  # whole number that is a coefficient, so that sums of them are exact
LEVEL = 1  # of compression; 6 makes files 6 % smaller, and takes five times as long


@attrs.frozen(kw_only=True, eq=False)
class Motions:
    """Series of the motions of one box's machines.

    Attributes
    ----------
    quanta : tuple of float
        Powers of two, of which the coefficients of each coordinate are whole multiples.
    packed : mapping
        For JSON.
    """

    quanta: tuple[float, ...]
    packed: Mapping[str, Any]

    @classmethod
    def of(cls, coefficients: Array) -> Motions:
        """Compress coefficients, (pieces, 2 n_u, time terms, parameter terms)."""
        quanta = [_quantum(coefficients[:, row]) for row in range(coefficients.shape[1])]
        whole = np.round(coefficients / np.array(quanta)[:, None, None]).astype("<i8")
        return cls(quanta=tuple(quanta), packed=pack(whole, 1))

    def coefficients(self) -> Array:
        """Decompress.

        Raises
        ------
        ValueError
            They are not what they should be.
        """
        factors, whole = numbers(self.quanta), unpack(self.packed, "<i8", 1)
        if not (np.frexp(factors)[0] == 0.5).all() or factors.shape != whole.shape[1:2]:
            raise ValueError("quanta that are no powers of two")
        if not (np.abs(whole) < GREATEST).all():
            raise ValueError("coefficients whose sums are not exact")
        return np.asarray(whole * factors[:, None, None])


def _quantum(values: Array) -> float:
    """Find the greatest power of two of which all values are whole multiples."""
    used = values[values != 0.0]
    if not used.size:
        return 1.0
    mantissa, exponent = np.frexp(used)
    whole = (mantissa * 2.0**53).astype(np.int64)
    zeros = np.log2((whole & -whole).astype(np.float64))  # trailing ones of the mantissa that are 0
    return float(2.0 ** int((exponent - 53 + zeros).min()))


def numbers(nested: Any) -> Array:
    """Take nested lists of numbers as an array; texts that look like numbers are none.

    Raises
    ------
    ValueError
    """
    array = np.array(nested)
    if array.dtype.kind not in "if":
        raise ValueError("something that is no number")
    return array.astype(np.float64)


def pack(array: Any, leading: int) -> dict[str, Any]:
    """Compress an array whose first axes, so many, have numbers of like size, side by side."""
    reordered = np.ascontiguousarray(np.moveaxis(array, range(leading), range(-leading, 0)))
    return {
        "shape": list(array.shape),
        "zlib": base64.b64encode(zlib.compress(reordered.tobytes(), LEVEL)).decode("ascii"),
    }


def unpack(packed: Mapping[str, Any], kind: str, leading: int) -> Any:
    """Decompress an array, as one of doubles.

    Raises
    ------
    ValueError, KeyError, TypeError, binascii.Error, zlib.error
        It is damaged.
    """
    if packed.keys() != {"shape", "zlib"}:
        raise ValueError("an array of another kind")
    shape = tuple(index(size) for size in packed["shape"])
    inflater = zlib.decompressobj()
    size = int(np.prod([float(size) for size in shape])) * np.dtype(kind).itemsize
    if not 0 < size <= MOST_BYTES:
        raise ValueError("an array of such a size")
    content = inflater.decompress(base64.b64decode(packed["zlib"], validate=True), size + 1)
    if not inflater.eof or inflater.unused_data:
        raise ValueError("an array of another length")
    array = np.frombuffer(content, dtype=kind).reshape(*shape[leading:], *shape[:leading])
    return np.moveaxis(array, range(-leading, 0), range(leading)).astype(np.float64)
