"""CRC-32 over a table of doubles, in a form that a controller can work out without looking at their bytes.

IEC 61131-3 has no portable way to the bits of an LREAL. So each value x = ±m 2ᵉ, ½ ≤ m < 1, is taken as
three whole numbers, exactly: ``2 (e + 2048) + sign``, the upper 26 bits of m and its lower 27 bits. They go
into the checksum (reflected polynomial EDB88320h, as in Ethernet and zip) as 32-bit words, low byte first.
"""

from __future__ import annotations

import zlib

import numpy as np

from gen_profile.profile import Array

UPPER, LOWER = 2.0**26, 2.0**27


def crc32(values: Array) -> int:
    """Checksum of numbers in their order."""
    mantissa, exponent = np.frexp(np.abs(values))
    upper = np.floor(mantissa * UPPER)
    lower = (mantissa * UPPER - upper) * LOWER
    head = 2 * (exponent.astype(np.int64) + 2048) + (values < 0.0)
    return zlib.crc32(np.stack([head, upper, lower], axis=-1).astype("<u4").tobytes())
