"""One binary for both processors of macOS: Mach-O files behind a common header (mach-o/fat.h)."""

import struct
from collections.abc import Sequence

_MAGIC = 0xCAFEBABE
_ALIGNMENT = 14  # as a power of two: a page of Apple's own processors


def universal_binary(slices: Sequence[bytes]) -> bytes:
    """Join Mach-O files of different processors.

    Parameters
    ----------
    slices : sequence of bytes
        64-bit, little-endian.
    """
    joined = bytearray(struct.pack(">II", _MAGIC, len(slices)))
    offset, offsets = 1 << _ALIGNMENT, []
    for part in slices:
        _, processor, variant = struct.unpack_from("<III", part)
        joined += struct.pack(">IIIII", processor, variant, offset, len(part), _ALIGNMENT)
        offsets.append(offset)
        offset = -(-(offset + len(part)) >> _ALIGNMENT) << _ALIGNMENT
    for start, part in zip(offsets, slices, strict=True):
        joined += bytes(start - len(joined)) + part
    return bytes(joined)
